"""Compiled sweeps against the demands that the search derives anew for every point."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest

from quakedesign.errors import CertificateError
from quakedesign.laws import law
from quakedesign.lyapunov.maps.sweep import Frame, Sweep
from quakedesign.lyapunov.search.certify import closed_loop
from quakedesign.lyapunov.search.lyapunov_search import balance, family_of
from quakedesign.lyapunov.search.parametric_forms import rows_of, values_of
from quakedesign.sos.solve.joint import JointProgram

LOOPS = {
    "super-twisting": (("1.5", "1.1"), "0.9", (1, "1.3"), 4),
    "cta": (("7", "5", "2.3", "1.1"), "1", (1, 1), 5),
    "dia": (("4", "20", "1", "0.3"), "0.3", (1, "1.4"), 5),
}


def loop(name):
    gains, bound, gain_range, degree = LOOPS[name]
    return closed_loop(name, gains, lipschitz=bound, gain_range=gain_range), degree


def with_numbers(at, values):
    """Other gains, the same structure."""
    gains = dict(zip(at.gains, map(F, values), strict=True))
    return replace(at, gains=gains)


@pytest.mark.parametrize("name", LOOPS)
def test_the_rows_are_the_demands_of_the_search(name):
    at, degree = loop(name)
    family = family_of(at, degree, (F(1),) * len(at.states))
    rows = rows_of(at, family.monomials)
    values = {n: F(v).limit_denominator(10**9) for n, v in values_of(at).items()}

    def parts(row):
        found = [{} for _ in family.monomials]
        for j, exponents, names, c in row.parts:
            for n in names:
                c = c * values[n]
            found[j][exponents] = found[j].get(exponents, F(0)) + c
        factor = 1 / family.rate_scale if row.rate else F(1)
        return tuple(tuple(sorted((e, c * factor) for e, c in p.items() if c)) for p in found)

    wanted = {tuple(tuple(sorted(p.items())) for p in d.parts) for d in family.demands}
    assert {parts(row) for row in rows} == wanted


@pytest.mark.parametrize("name", ["super-twisting", "cta"])
def test_slopes_are_the_derivatives_of_the_margin(name):
    at, degree = loop(name)
    sweep = Sweep(at, degree)
    frame = sweep.frame(at)
    slopes = sweep.solve(at, frame).slopes
    assert {"d", *at.gains} <= set(slopes)
    for gain, value in at.gains.items():
        step = value / 2000
        ends = [sweep.solve(replace(at, gains={**at.gains, gain: value + s}), frame).margin for s in (-step, step)]
        difference = (ends[1] - ends[0]) / float(2 * step)
        assert slopes[gain] == pytest.approx(difference, rel=5e-2, abs=2e-3 * max(map(abs, slopes.values())))


def test_slopes_in_the_ends_of_beta():
    at, degree = loop("super-twisting")
    sweep = Sweep(at, degree)
    frame = sweep.frame(at)
    slopes = sweep.solve(at, frame).slopes
    for end, name in enumerate(("beta-", "beta+")):
        moved = []
        for step in (F(-1, 1000), F(1, 1000)):
            ends = list(at.uncertain["beta"])
            ends[end] += step
            moved.append(sweep.solve(replace(at, uncertain={**at.uncertain, "beta": tuple(ends)}), frame).margin)
        assert slopes[name] == pytest.approx((moved[1] - moved[0]) * 500, rel=1e-2, abs=1e-6)


@pytest.mark.slow
def test_found_is_what_the_search_finds_at_every_point():
    rng = np.random.default_rng(4)
    base = closed_loop("super-twisting", (1, 2), lipschitz=1)
    sweep, answers = Sweep(base, 6), []
    for k1, k2 in np.exp(rng.uniform((-1, 0.05), (1, 1.5), size=(40, 2))):
        at = with_numbers(base, (F(f"{k1:.4g}"), F(f"{k2:.4g}")))
        family = family_of(at, 6, balance(at))
        anew = JointProgram(family.demands).solve(family.demands)
        found = sweep.solve(at)
        if abs(found.margin) > 1e-7:
            answers.append((found.feasible, anew.margin > 1e-7))
    assert len(answers) > 30
    assert {one for one, _ in answers} == {True, False}
    assert all(one == other for one, other in answers)


def test_the_sign_of_the_margin_does_not_depend_on_units_or_on_what_was_solved_before():
    at, degree = loop("cta")
    sweep = Sweep(at, degree)
    beyond = closed_loop("cta", LOOPS["cta"][0], lipschitz="1.3")
    for one, sign in ((at, 1), (beyond, -1)):
        for scale in ((1, 1, 8), (1, 1, 16), (1, 2, 8)):
            frame = Frame(scale=tuple(map(F, scale)), rate_scale=sweep.frame(one).rate_scale)
            assert np.sign(sweep.solve(one, frame).margin) == sign
    assert sweep.solve(at).margin == pytest.approx(Sweep(at, degree).solve(at).margin, rel=1e-4)


def test_the_margin_goes_on_below_zero_with_the_disturbance():
    bounds = [closed_loop("super-twisting", ("1.5", "1.1"), lipschitz=f"{0.2 * i}") for i in range(1, 6)]
    sweep = Sweep(bounds[0], 6)
    frame = sweep.frame(bounds[0])
    margins = [sweep.solve(b, frame).margin for b in bounds]
    assert margins == sorted(margins, reverse=True)
    beyond = closed_loop("super-twisting", ("1.5", "1.1"), lipschitz="2")
    assert sweep.solve(beyond, frame).margin < -1e-3


def test_another_structure_is_refused():
    at, degree = loop("super-twisting")
    point = closed_loop("super-twisting", ("1.5", "1.1"), lipschitz="0.9")
    with pytest.raises(ValueError, match="must have the structure of the sweep"):
        Sweep(at, degree).solve(point)
    nested = closed_loop("dia", ("4", "20", "1", "0.3"), lipschitz="0.3")
    sweep = Sweep(nested, 5)
    assert sweep.covers(replace(nested, gains={**nested.gains, "kI2": F(19)}))
    assert not sweep.covers(replace(nested, gains={**nested.gains, "kI4": F(1, 5)}))
    without = closed_loop("dia", ("4", "20", "1", "0"), lipschitz="0.3")
    assert Sweep(without, 5).covers(closed_loop("dia", ("9", "20", "1", "0"), lipschitz="0.3"))


def test_a_degree_without_candidates_is_refused():
    with pytest.raises(CertificateError, match="no candidate functions V of degree 1"):
        Sweep(loop("cta")[0], 1)
    assert law("cta").name == "cta"
