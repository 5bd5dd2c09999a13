"""Largest perturbations and smallest decays that quadratic functions have in closed form."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest
import sympy as sp

from quakedesign.laws import LoopField
from quakedesign.lyapunov import Certificate, Loop
from quakedesign.lyapunov.exact.robustness import _Cells, robustness
from quakedesign.symbolic.terms import Term


def power(coefficient, name, exponent, kind="a", parameters=()):
    return Term(F(coefficient), parameters, ((name, F(exponent), kind),))


def product(coefficient, kind="s"):
    return Term(F(coefficient), (), (("e1", F(1), kind), ("e2", F(1), kind)))


def certificate(*more, **claims):
    """e1' = -e1, e2' = -beta e2 with beta in [1, 4], V = e1^2 + e2^2 and more: -V' = 2 e1^2 + 2 beta e2^2."""
    loop = Loop(
        law="own",
        gains={"k": F(3)},
        constants={},
        states={"e1": 1, "e2": 1},
        domain="cells",
        uncertain={"beta": (F(1), F(4))},
        field={"e1": (power(-1, "e1", 1, "s"),), "e2": (power(-1, "e2", 1, "s", ("beta",)),)},
    )
    lyapunov = (power(1, "e1", 2), power(1, "e2", 2), *more)
    return Certificate(loop=loop, lyapunov=lyapunov, claims={name: F(value) for name, value in claims.items()})


def weighted():
    """e1' = e2, e2' = -2 [e1]^(1/3) - 3 [e2]^(1/2), V = |e1|^(4/3) + |e2|^2, of degrees 4 and 3 in u, weights 3 and 2.

    V' = 4/3 s1 s2 u1 u2^2 - 4 s1 s2 u1 u2^2 - 6 u2^3, hence zero at u2 = 0.
    """
    return replace(
        certificate(),
        loop=replace(
            certificate().loop,
            states={"e1": 3, "e2": 2},
            field={
                "e1": (power(1, "e2", 1, "s"),),
                "e2": (power(-2, "e1", "1/3", "s"), power(-3, "e2", "1/2", "s")),
            },
        ),
        lyapunov=(power(1, "e1", "4/3"), power(1, "e2", 2)),
    )


def covers(bound, exact):
    return exact * (1 - 1e-9) <= float(bound) <= 1.051 * exact


def test_the_worst_perturbation_of_a_decoupled_loop():
    """beta 2w u / (2u^2 + 2 beta w^2) is sqrt(beta)/2 at most, so 1; beta 2w w / (...) is 1 at u = 0."""
    found = robustness(certificate())
    assert covers(found.slip, 1)
    assert covers(found.rate, 1)
    assert (found.slip_power, found.rate_power) == (0, 0)
    assert found.source == "bisection of the cells"


def test_units_enlarge_what_a_perturbation_does():
    """Errors of 6 and of 2 per unit of the states: e1 weighs three times as much against e2."""
    e1, e2, k, beta = sp.symbols("e1 e2 k beta", real=True)
    model = LoopField(
        states={e1: 1, e2: 1},
        field={e1: -e1, e2: -beta * e2},
        gains=(k,),
        constants=(),
        uncertain=(beta,),
        domain="reals",
        units={e1: 2 * k, e2: sp.Integer(2)},
    )
    found = robustness(certificate(), model)
    assert covers(found.slip, 3)
    assert covers(found.rate, 1)


def test_a_claimed_decay_serves_where_powers_are_nested():
    """beta 2w u / (u^2 + w^2) is 4 at most, beta 2w w / (...) is 8; over kappa = 1/2 twice that."""
    nested = certificate(decay="1/2")
    loop = replace(nested.loop, lifts={"n": (power(1, "e1", 1, "s"),)})
    found = robustness(replace(nested, loop=replace(loop, field=loop.field | {"e1": (power(-1, "n", 1, "s"),)})))
    assert found.source == "claimed decay"
    assert covers(found.slip, 8)
    assert covers(found.rate, 16)
    assert robustness(replace(nested, loop=loop, claims={})) is None


def test_powers_of_v_follow_the_weights():
    """p1 = (3 - 2 + 1)/4, p2 = (2 - 2 + 1)/4."""
    cells = _Cells(weighted())
    assert (cells.m, cells.degree, cells.decrease_degree) == (4, -1, 3)
    assert (cells.power(0), cells.power(1)) == (F(1, 2), F(1, 4))


def decoupled():
    """e1' = -[e1]^(2/3), e2' = -beta [e2]^(1/2), V = |e1|^(4/3) + |e2|^2: u^4 + w^4 and -V' = 4/3 u^3 + 2 beta w^3."""
    base = certificate()
    field = {"e1": (power(-1, "e1", "2/3", "s"),), "e2": (power(-1, "e2", "1/2", "s", ("beta",)),)}
    loop = replace(base.loop, states={"e1": 3, "e2": 2}, field=field)
    lyapunov = (power(1, "e1", "4/3"), power(1, "e2", 2))
    return replace(base, loop=loop, lyapunov=lyapunov, claims={"decrease": F(1)})


def sampled():
    """Largest quotients on a fine grid of directions, for beta = 1 and 4."""
    angle = np.linspace(0, np.pi / 2, 20001)
    u, w = np.cos(angle), np.sin(angle)
    value = u**4 + w**4
    falls = {beta: 4 / 3 * u**3 + 2 * beta * w**3 for beta in (1, 4)}
    slip = max((beta * 2 * w**2 * u**3 / (fall * value**0.5)).max() for beta, fall in falls.items())
    rate = max((beta * 2 * w**2 * w**2 / (fall * value**0.25)).max() for beta, fall in falls.items())
    return slip, rate


def test_weights_enter_the_powers_of_v():
    slip, rate = sampled()
    found = robustness(decoupled())
    assert covers(found.slip, slip)
    assert covers(found.rate, rate)
    assert (found.slip_power, found.rate_power) == (F(1, 2), F(1, 4))


def test_both_ends_of_uncertain_units_count():
    """e1 and e2 in units between 7/5 and 3/2: a quotient of 15/14 each."""
    e1, e2, k, beta, c, r = sp.symbols("e1 e2 k beta c r", real=True)
    model = LoopField(
        states={e1: 1, e2: 1}, field={e1: -e1, e2: -beta * e2}, gains=(k,), constants=(c,), uncertain=(beta,),
        domain="reals", roots={r: c}, units={e1: r, e2: r},
    )  # fmt: skip
    one = certificate()
    loop = replace(one.loop, constants={"c": F(2)}, roots={"r": ("c", (F(7, 5), F(3, 2)))})
    found = robustness(replace(one, loop=loop), model)
    assert covers(found.slip, 15 / 14)
    assert covers(found.rate, 15 / 14)


def test_sizes_of_the_states_change_nothing_but_the_time():
    found = robustness(certificate(bound_e1=F(1, 16), bound_e2=F(9)))
    assert covers(found.slip, 1)
    assert covers(found.rate, 1)
    assert _Cells(certificate(bound_e1=F(1, 16), bound_e2=F(4))).sizes == [4, F(1, 2)]
    assert _Cells(certificate()).sizes == [1, 1]


@pytest.mark.parametrize("missing", [0, 1])
def test_without_one_of_both_bounds_nothing_is_said(missing, monkeypatch):
    found = iter([None, F(1)] if missing == 0 else [F(1), None])
    monkeypatch.setattr("quakedesign.lyapunov.exact.robustness.largest_ratio", lambda _: next(found))
    assert robustness(certificate()) is None


def test_where_no_largest_ratio_is_found_nothing_is_said(monkeypatch):
    monkeypatch.setattr("quakedesign.lyapunov.exact.robustness.largest_ratio", lambda problems: None)
    one = certificate(decay="1/2")
    nested = replace(one.loop, lifts={"n": (power(1, "e1", 1, "s"),)})
    assert robustness(one) is None
    assert robustness(replace(one, loop=nested)) is None
