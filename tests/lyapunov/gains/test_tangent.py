"""Floating-point rows against the exact obligations, and the bound behind a pace against numbers."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest

from quakedesign.lyapunov.exact.obligations import Obligations
from quakedesign.lyapunov.gains.path_following import (
    fastest,
    neighbourhood,
    on_box,
    required_rate,
    rounded,
    short,
    with_gains,
)
from quakedesign.lyapunov.search.certify import closed_loop
from quakedesign.lyapunov.search.lyapunov_search import find_certificate
from quakedesign.symbolic.term_expressions import signed_monomials


@pytest.fixture(scope="module")
def cta():
    return find_certificate(closed_loop("cta", ("7", "5", "2.3", "1.1"), lipschitz=1, gain_range=(1, "1.2")), 5)


def forms(obligations):
    """Every different polynomial of V and −V̇, divided by its largest coefficient."""
    exact = [p for _, p in obligations.function()] + [one.polynomial for _, one in obligations.decrease("")]
    return {normal(p) for p in exact}


def normal(p):
    """A polynomial as a hashable value that does not see its size, nor rounding errors."""
    size = max(abs(float(c)) for c in p.values())
    return frozenset((e, round(float(c) / size, 9)) for e, c in p.items() if abs(float(c)) > 1e-9 * size)


@pytest.mark.parametrize(("name", "gains"), [("cta", ("7", "5", "2.3", "1.1")), ("dia", ("9/4", "20", "3", "0"))])
def test_parts_add_up_to_the_obligations_of_v_here_and_at_other_gains(name, gains):
    loop = closed_loop(name, gains, lipschitz=1, gain_range=(1, "1.2"))
    V = tuple(replace(t, coefficient=F(3 + i, 7)) for i, t in enumerate(signed_monomials(loop.states, 5, "cells")))
    other = with_gains(loop, short(loop, {n: 1.25 * float(k) for n, k in loop.gains.items()}))
    one = (F(1),) * len(loop.states)
    around = neighbourhood(loop, 5, one, lyapunov=V, changed=[other])
    known = {t.factors: float(t.coefficient) for t in V}
    decision = [known.get(t.factors, 0.0) for t in around.monomials]

    def total(demand, change):
        found = {}
        for part, x in zip(demand.parts, [*decision, change], strict=True):
            for e, c in part.items():
                found[e] = found.get(e, 0.0) + c * x
        return normal(found)

    assert {total(d, 0.0) for d in around.demands} == forms(Obligations(loop, V))
    assert {total(d, 1.0) for d in around.demands} == forms(Obligations(other, V))


def test_the_bound_behind_a_pace_holds_for_every_w_and_is_sharp_at_the_root():
    rng = np.random.default_rng(1)
    V, w = rng.exponential(size=(2, 1000))
    for m, n in ((5, 4), (8, 7), (4, 2)):
        bound = n / m * V / w ** (m - n) + (1 - n / m) * w**n
        assert np.all(bound >= V ** (n / m) * (1 - 1e-12))
        root = V ** (1 / m)
        assert n / m * V / root ** (m - n) + (1 - n / m) * root**n == pytest.approx(V ** (n / m))


def test_the_rate_estimated_by_sampling_is_above_what_is_proved(cta):
    # V̇ ≤ −κV^{4/5} with κ from V ≤ CΣu⁵ and −V̇ ≥ ε'Σu⁴, as (Σu⁵)^{4/5} ≤ Σu⁴
    crude = sum(abs(float(t.coefficient)) for t in cta.lyapunov)
    assert fastest(cta.loop, cta.lyapunov) >= float(cta.claims["decrease"]) / crude**0.8


def test_linear_forms_are_near_the_root_of_v(cta):
    required = required_rate(cta.loop, cta.lyapunov, 1.0, 5)
    rng = np.random.default_rng(2)
    u = rng.dirichlet((1, 1, 1), 500) * (1, 1.4, 7)
    for cell in Obligations(cta.loop, cta.lyapunov).sign_cells():
        potential = Obligations(cta.loop, cta.lyapunov).potential(cell.signs)
        V = sum(float(c) * np.prod(u ** np.array(e), axis=1) for e, c in potential.items())
        w = sum(c * u[:, e.index(1)] for e, c in required.forms[cell.name].items())
        assert np.median(np.abs(w / V**0.2 - 1)) < 0.2


def test_v_on_a_box_is_below_its_bound(cta):
    rng = np.random.default_rng(4)
    sizes = (1.5, 1.2, 2.0)
    bound = on_box(cta.lyapunov, cta.loop.states, sizes)
    u = np.array(sizes) * rng.random((2000, 3))
    for cell in Obligations(cta.loop, cta.lyapunov).sign_cells():
        potential = Obligations(cta.loop, cta.lyapunov).potential(cell.signs)
        assert sum(float(c) * np.prod(u ** np.array(e), axis=1) for e, c in potential.items()).max() <= bound


def test_rounding_keeps_so_many_binary_digits(cta):
    short_terms = rounded(cta.lyapunov, 12, 3.0)
    for term, other in zip(cta.lyapunov, short_terms, strict=True):
        assert float(other.coefficient) == pytest.approx(float(term.coefficient) / 3, rel=2**-12)
        assert other.coefficient.numerator < 2**13
