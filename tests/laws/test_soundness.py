"""Closed loops that are not what they seem are refused when they are written down, not when a proof fails."""

from dataclasses import replace
from fractions import Fraction as F

import pytest
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.laws import LoopField, laws
from quakedesign.lyapunov import loop_of
from quakedesign.symbolic import AbsolutePower, SignedPower

x, y, k, d, a = sp.symbols("x y k d a", real=True)
HALF = sp.Rational(1, 2)
FIELD = {x: -k * SignedPower(x, HALF) + y, y: -2 * SignedPower(x, 0) + d}


def loop(**changed):
    parts = {"states": {x: 2, y: 1}, "field": FIELD, "gains": (k,), "constants": (), "uncertain": (d,)}
    return LoopField(**(parts | {"domain": "cells"} | changed))


def test_the_rates_belong_to_their_states_in_whatever_order_they_are_written():
    swapped = loop(field={y: FIELD[y], x: FIELD[x]})
    assert list(swapped.field) == [x, y]
    one, other = (
        loop_of("custom", model, gains={"k": F(2)}, uncertain={"d": (F(-1), F(1))}) for model in (loop(), swapped)
    )
    assert one == other
    assert {t.factors for t in one.field["y"]} == {(), (("x", F(0), "s"),)}


def test_weights_become_integers():
    assert [type(w) for w in loop(states={x: sp.Integer(2), y: sp.Integer(1)}).states.values()] == [int, int]


def test_sympys_own_signs_and_absolute_values_are_signed_powers():
    rate = -k * sp.sqrt(sp.Abs(x)) * sp.sign(x) + y
    found = loop(field=FIELD | {x: rate}).field[x]
    assert found == -k * AbsolutePower(x, HALF) * SignedPower(x, 0) + y


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"states": {}}, "needs 1 to 6 states. Received 0"),
        ({"states": {x: 2, y: 0}}, "weights must be integers from 1 to 12.*Received 0 for y"),
        ({"states": {x: 1, y: HALF}}, "states of LoopField must be .* a whole number. Received .*y: 1/2"),
        ({"states": {x: 26, y: 13}}, "weights must be integers.*Received 26 for x"),
        ({"domain": "reals"}, "weights must be 1 on reals"),
        ({"domain": "torus"}, "must be cells or reals. Received 'torus'"),
        ({"field": {x: FIELD[x]}}, "one rate for each of x, y. Received rates of x"),
        ({"field": FIELD | {a: x}}, "one rate for each of x, y. Received rates of x, y, a"),
        ({"field": FIELD | {x: FIELD[x] + 0.5 * y}}, "must be exact and finite. Received 1.5"),
        ({"field": FIELD | {x: FIELD[x] + sp.nan}}, "must be exact and finite. Received nan"),
        ({"field": FIELD | {x: FIELD[x] + sp.oo * y}}, "must be exact and finite. Received oo"),
        ({"field": FIELD | {x: FIELD[x] + a * y}}, "must contain only d, k, x, y. Received a. Declare"),
        ({"field": FIELD | {x: FIELD[x] * sp.Symbol("k")}}, "Another symbol of this name has other assumptions"),
        ({"gains": (k, k)}, "must be different.*Received 'k' twice"),
        ({"gains": (k, sp.Symbol("d"))}, "must be different.*Received 'd' twice"),
        ({"gains": (k, sp.Symbol("k'"))}, 'must be different.*Received "k\'"'),
        ({"units": {a: k}}, "units belong to states, x, y. Received a unit of a"),
        ({"units": {y: a}}, "the unit of y must contain only k. Received a"),
        ({"units": {y: k / 3.0}}, "must be exact and finite"),
        ({"roots": {a: y}}, "the root a must be that of a gain or constant. Received y"),
    ],
)
def test_what_no_certificate_could_mean_is_refused(changed, message):
    with pytest.raises(ParameterError, match=message):
        loop(**changed)


def test_a_state_of_one_sign_is_refused():
    slip = sp.Symbol("x", positive=True)
    with pytest.raises(ParameterError, match=r"declared real only\. Received x"):
        loop(states={slip: 2, y: 1}, field={slip: y, y: FIELD[y].subs(x, slip)})


def test_the_laws_of_the_package_are_sound():
    for one in laws().values():
        model = one.loop_field()
        assert replace(model) == model
