"""How far gains reach, against exactly known regions and limits."""

import importlib.util
from fractions import Fraction as F
from pathlib import Path

import pytest
from scipy.optimize import brentq

from quakedesign.errors import ParameterError
from quakedesign.laws import law
from quakedesign.lyapunov import Verdict
from quakedesign.lyapunov.search import certify as questions
from quakedesign.lyapunov.search.certify import (
    TOLERANCE,
    certify,
    closed_loop,
    largest_gain_range,
    largest_lipschitz,
    necessary_limit,
)
from quakedesign.lyapunov.search.lyapunov_search import find_certificate, refute

SPECIFICATION = importlib.util.spec_from_file_location(
    "reach_region", Path(__file__).with_name("super_twisting_region.py")
)
region = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(region)

SHARP = {"rel": 1.5e-4}


def exact_lipschitz(k1, k2):
    """Largest L for which the gains stabilise, from the closed form."""
    return brentq(lambda L: region.contraction(k1, k2, L) - 1, 1e-6, k2 * (1 - 1e-12))


def exact_upper_end(k1, k2, L):
    return brentq(lambda high: region.contraction(k1, k2, L, 1, high) - 1, 1, 1e4)


@pytest.mark.parametrize(("k1", "k2", "degrees"), [("0.7", "2", None), ("0.4", "1.5", None), ("1.5", "3", (4, 6))])
def test_the_largest_bound_stays_below_the_exact_one_and_comes_near(k1, k2, degrees):
    reach = largest_lipschitz("super-twisting", (k1, k2), degrees=degrees)
    exact = exact_lipschitz(float(k1), float(k2))
    assert float(reach.value) <= exact <= 1.4 * float(reach.value)
    assert reach.sharp
    assert reach.limit == F(k2)
    assert reach.certificate.check() is Verdict.PROVED
    assert reach.certificate.loop.uncertain["d"] == (-reach.value, reach.value)
    if reach.beyond is not None:
        beyond = closed_loop("super-twisting", (k1, k2), lipschitz=reach.beyond)
        assert find_certificate(beyond, reach.degrees) is None


def test_the_largest_range_of_beta_stays_below_the_exact_one():
    reach = largest_gain_range("super-twisting", ("1.2", "2"), lipschitz=1, degrees=(6, 8))
    exact = exact_upper_end(1.2, 2.0, 1.0)
    assert float(reach.value) <= exact <= 2 * float(reach.value)
    assert reach.sharp
    assert reach.certificate.check() is Verdict.PROVED
    assert reach.certificate.loop.uncertain["beta"] == (1, reach.value)
    wider = largest_gain_range("super-twisting", ("1.2", "2"), lipschitz=1, nominal=2, degrees=6, symmetric=True)
    assert wider.certificate.loop.uncertain["beta"] == (2 / wider.value, 2 * wider.value)
    assert region.stable(1.2, 2.0, 1.0, *map(float, wider.certificate.loop.uncertain["beta"]))


@pytest.mark.parametrize("gains", [("7", "5"), ("25", "15"), ("19", "10"), ("13", "7.5")])
def test_the_published_gains_reach_the_necessary_limit(gains):
    reach = largest_lipschitz("cta", (*gains, "2.3", "1.1"), degrees=5)
    assert reach.limit == F("1.2")
    assert reach.beyond is None
    assert reach.sharp
    assert F("1.2") * (1 - TOLERANCE) <= reach.value < F("1.2")
    assert reach.certificate.check() is Verdict.PROVED
    assert reach.solves <= 3


@pytest.mark.parametrize("last", ["2.3", "-2.3"])
def test_equal_integral_gains_are_never_proved(last):
    reach = largest_lipschitz("cta", ("7", "5", "2.3", last))
    assert (reach.value, reach.limit, reach.counterexample) == (None, 0, "exact")
    assert reach.certificate.check() is Verdict.REFUTED
    assert not reach.sharp


@pytest.mark.slow
def test_a_higher_degree_is_tried_where_the_lowest_finds_nothing():
    first, both = (largest_lipschitz("cta", ("3", "3", "2.3", "1.1"), degrees=d) for d in ((5,), (5, 6)))
    assert first.value is None
    assert first.counterexample == "none"
    assert both.degree == 6
    assert both.sharp


@pytest.mark.slow
def test_what_speaks_against_gains_is_told():
    kinds = []
    for gains, lipschitz in ((("0.4", "1.5"), 1), (("0.4", "1.5"), 2), ((3, 2), 1)):
        loop = closed_loop("super-twisting", gains, lipschitz=lipschitz)
        refuted = refute(loop, "super-twisting")
        assert refuted is None or refuted.check() is Verdict.REFUTED
        kinds.append(questions.counterexample_kind(loop, refuted))
    assert kinds == ["simulated", "exact", "none"]


def test_the_limit_comes_from_the_law_or_from_an_equilibrium():
    cases = {
        ("cta", ("7", "5", "2.3", "1.1")): F("1.2"),
        ("cta", ("7", "5", "1.1", "-2.3")): 0,
        ("dia", ("1", "20", "1.5", "0")): F("1.5"),
        ("super-twisting", ("1", "2")): 2,
        ("super-twisting", ("1e-20", "1e20")): 10**20,
        ("cta3", ("1", "2", "2", "0.05", "0.02", "0.01")): F("0.02"),
    }
    for (name, gains), limit in cases.items():
        assert necessary_limit(closed_loop(name, gains, lipschitz=1), name) == limit
    bare = law("super-twisting").loop_field()
    assert necessary_limit(closed_loop(bare, ("1", "2"), lipschitz=1), bare) is None


def test_a_bare_loop_without_a_known_limit_is_searched_as_well():
    bare = law("super-twisting").loop_field()
    reach = largest_lipschitz(bare, ("0.7", "2"), degrees=6)
    named = largest_lipschitz("super-twisting", ("0.7", "2"), degrees=6)
    assert reach.limit is None
    assert float(reach.value) == pytest.approx(float(named.value), **SHARP)


def test_the_smallest_scale_is_enough_and_a_smaller_one_is_not():
    reach = largest_lipschitz("super-twisting", ("0.7", "2"), degrees=6)
    scale = reach.smallest_scale(3)
    assert scale == 3 / reach.value
    # k1 grows like √λ, k2 like λ (METHODS, ERRATA): the next square is a little above
    root = F(f"{float(scale) ** 0.5:.6f}") + F(1, 10**6)
    gains = (root * F("0.7"), root**2 * 2)
    assert certify("super-twisting", gains, lipschitz=3)[0] is Verdict.PROVED
    smaller = root * F(9997, 10_000)
    loop = closed_loop("super-twisting", (smaller * F("0.7"), smaller**2 * 2), lipschitz=3)
    assert find_certificate(loop, 6) is None


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: largest_lipschitz("elqr", (1, 1, 1, 1)), "requires a sliding-mode law"),
        (lambda: largest_lipschitz("cta", (1, 1)), "needs 4 gains"),
        (lambda: largest_gain_range("cta", (7, 5, 2, 1), lipschitz=-1), "must not be negative"),
        (lambda: largest_gain_range("cta", (7, 5, 2, 1), lipschitz=1, nominal=0), "0 < b_m"),
    ],
)
def test_bad_input_gets_one_clear_message(call, message):
    with pytest.raises(ParameterError, match=message):
        call()


def test_a_scale_needs_a_bound():
    reach = largest_gain_range("super-twisting", ("1.2", "2"), lipschitz=1, degrees=6)
    with pytest.raises(ParameterError, match="a scale needs the limit of lipschitz"):
        reach.smallest_scale(1)


@pytest.mark.slow
def test_the_discontinuous_integral_law_reaches_what_is_asked():
    laboratory = largest_lipschitz("dia", ("2", "5", "1.44e-4", "0"), gain_range=("1", "1.425"), degrees=5)
    assert F("0.97") * F("1.44e-4") <= laboratory.value < laboratory.limit == F("1.44e-4")
    assert laboratory.sharp
    plain = largest_lipschitz("dia", ("1", "20", "1", "0"), gain_range=("1", "1.425"), degrees=5)
    assert plain.value >= F("0.3")
    fourth = largest_lipschitz("dia", ("1", "20", "1", "0.1"), gain_range=("1", "1.425"), degrees=5)
    assert fourth.value >= F("0.9")
    for reach in (laboratory, plain, fourth):
        assert reach.certificate.check() is Verdict.PROVED
    verdict, _ = certify(
        "dia", ("2", "5", "1.44e-4", "0"), lipschitz=F("0.97") * F("1.44e-4"), gain_range=("1", "1.425")
    )
    assert verdict is Verdict.PROVED


@pytest.mark.slow
def test_higher_degrees_reach_a_wider_range_of_beta():
    gains = ("7", "5", "2.3", "1.1")
    first, all_of_them = (largest_gain_range("cta", gains, lipschitz=1, degrees=d) for d in (5, None))
    assert first.value > 3
    assert all_of_them.value > 50 * first.value
    assert all_of_them.certificate.check() is Verdict.PROVED
