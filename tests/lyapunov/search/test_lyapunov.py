"""The search for V: which degrees it tries, and what the higher ones add."""

from fractions import Fraction as F

import pytest

from quakedesign.laws import law
from quakedesign.lyapunov import Verdict, loop_of
from quakedesign.lyapunov.search.certify import certify
from quakedesign.lyapunov.search.lyapunov_search import candidate_degrees, find_certificate


def loop(name, gains, lipschitz):
    chosen = law(name)
    values = dict(zip(chosen.gain_units, map(F, gains), strict=True))
    uncertain = {"beta": (F(1), F(1)), "d": (-F(lipschitz), F(lipschitz))}
    return loop_of(name, chosen.loop_field(), gains=values, uncertain=uncertain)


def test_degrees_come_from_weights_not_from_names():
    assert candidate_degrees(loop("super-twisting", (1, 2), 1)) == (3, 4, 6, 8, 10)
    assert candidate_degrees(loop("cta", (7, 5, 2, 1), 1)) == (5, 6, 8)
    assert candidate_degrees(loop("cta3", (1, 2, 2, 1, 0, 0), 1)) == (7, 8)
    elqr = law("elqr").loop_field()
    values = {g.name: F(1) for g in elqr.gains}
    ranges = {u.name: (F(0), F(1)) for u in elqr.uncertain}
    linear = loop_of("elqr", elqr, gains=values, constants={"b": F(1)}, uncertain=ranges)
    assert candidate_degrees(linear) == (2,)


def test_a_higher_degree_proves_gains_that_the_lowest_does_not():
    gains = loop("cta", (3, 3, "2.3", "1.1"), 1)
    assert find_certificate(gains, 5) is None
    assert find_certificate(gains, (5,)) is None
    certificate = find_certificate(gains)
    assert certificate.check() is Verdict.PROVED
    # the other checker's rule for the degree: Σ exponent·weight, the same in every term
    degrees = {sum(a * gains.states[s] for s, a, _ in term.factors) for term in certificate.lyapunov}
    assert degrees == {6}


@pytest.mark.slow
def test_the_third_order_law_is_proved():
    verdict, certificate = certify("cta3", (1, 2, 2, "0.05", "0.02", "0.01"), lipschitz="0.005", gain_range=(1, "1.05"))
    assert verdict is Verdict.PROVED
    assert certificate.check() is Verdict.PROVED


def test_the_third_order_law_is_refuted_where_its_integral_can_be_held():
    verdict, certificate = certify("cta3", (1, 2, 2, "0.05", "0.02", "0.01"), lipschitz="0.02")
    assert verdict is Verdict.REFUTED
    assert certificate.refutation.point == {"e1": 1, "e2": 0, "e3": 0, "e4": 1}
