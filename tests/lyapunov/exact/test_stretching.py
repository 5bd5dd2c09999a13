"""How gains scale: what the literature prints, and what exact dilations of the field confirm."""

from fractions import Fraction as F

import pytest
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.laws import control_law
from quakedesign.lyapunov.exact.loop_expressions import sympy_field
from quakedesign.lyapunov.gains.path_following import scaled_norm, scaling_exponents
from quakedesign.lyapunov.search.certify import closed_loop
from quakedesign.symbolic.signed_power import SignedPower


@pytest.mark.parametrize(
    ("name", "exponents"),
    [
        ("cta", ("2/3", "1/2", "1", "1")),  # eq. cta of the paper
        ("dia", ("1/3", "1/2", "1", "-1/2")),  # eq. dia with λ^½ in both places (ERRATA 5)
        ("super-twisting", ("1/2", "1")),
        ("cta3", ("3/4", "2/3", "1/2", "1", "1", "1")),
    ],
)
def test_exponents_of_the_lambda_scaling(name, exponents):
    ones = (1,) * len(exponents)
    loop = closed_loop(name, ones, lipschitz=1)
    found = scaling_exponents(loop, {"d": 1})
    assert [found[gain] for gain in loop.gains] == [F(p) for p in exponents]


def test_the_scaled_norm_is_that_of_the_issue_and_no_scale_changes_it():
    loop = closed_loop("cta", ("7", "5", "2.3", "1.1"), lipschitz="0.8")
    exponents = scaling_exponents(loop, {"d": 1})
    parts = (7 * 0.8 ** (-2 / 3), 5 * 0.8**-0.5, 2.3 / 0.8, 1.1 / 0.8)
    assert scaled_norm(loop, exponents) == pytest.approx(sum(x * x for x in parts) ** 0.5)
    law = control_law("cta").from_values((7, 5, "2.3", "1.1"))
    grown = [float(k) * 64 ** float(exponents[n]) for n, k in law.gains.items()]  # λ = 2⁶: 16, 8, 64, 64
    assert grown == pytest.approx([7 * 16, 5 * 8, 2.3 * 64, 1.1 * 64])
    scaled = closed_loop("cta", tuple(grown), lipschitz=0.8 * 64)
    assert scaled_norm(scaled, exponents) == pytest.approx(scaled_norm(loop, exponents))


@pytest.mark.parametrize(
    ("name", "stretched"), [("cta", "d"), ("cta", "beta"), ("cta3", "d"), ("super-twisting", "beta")]
)
def test_the_stretched_field_is_the_old_one_in_stretched_states(name, stretched):
    count = {"cta": 4, "cta3": 6, "super-twisting": 2}[name]
    loop = closed_loop(name, (1,) * count, lipschitz=1)
    found = scaling_exponents(loop, {stretched: 1})
    s = sp.Integer(2) ** 12
    sizes = {name: s ** sp.Rational(str(p)) for name, p in found.items()} | {stretched: s}
    symbols = loop.symbols
    at = {symbols[n]: size * symbols[n] for n, size in sizes.items()}
    point = {
        symbols[n]: sp.Integer(v)
        for n, v in zip((*loop.states, *loop.gains, *loop.uncertain), range(2, 20), strict=False)
    }
    for state, rate in sympy_field(loop).items():
        old, new = (float(e.subs(point)) for e in (rate, rate.subs(at, simultaneous=True)))
        assert new == pytest.approx(float(sizes[state.name]) * old, rel=1e-12)


def test_gains_that_the_terms_leave_open_are_refused():
    from quakedesign.laws import LoopField

    x, k, free, d = sp.symbols("x k free d", real=True)
    field = {x: -k * SignedPower(x, 0) + d}
    model = LoopField(states={x: 1}, field=field, gains=(k, free), constants=(), uncertain=(d,), domain="cells")
    with pytest.raises(ParameterError, match="determine how its gains scale"):
        scaling_exponents(closed_loop(model, (1, 1), lipschitz=1), {"d": 1})
