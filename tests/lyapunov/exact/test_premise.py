"""A premise compares two numbers, each taken on its safe side, and says what it found in plain values."""

import math
from fractions import Fraction as F

import pytest

from quakedesign.exact import LowerBound, UpperBound
from quakedesign.lyapunov import Witness
from quakedesign.lyapunov.exact.premises import Premise


def premise(required, certified, **more):
    return Premise(name="x", required=required, certified=certified, unit="m/s", **more)


def test_what_is_required_is_rounded_up_and_what_is_certified_down():
    one = premise(F(1, 3), F(2, 3))
    assert type(one.required) is type(one.ratio) is UpperBound
    assert type(one.certified) is LowerBound
    assert (one.required, one.certified, one.ratio) == (F(1, 3), F(2, 3), F(1, 2))
    assert f"{one.required:.2g} {one.certified:.2g}" == "0.34 0.66"
    assert type(premise(0.5, 1.0).required) is type(premise(0.5, 1.0).ratio) is UpperBound


@pytest.mark.parametrize(
    ("required", "certified", "sides"),
    [
        (F(3353, 2353), F(57, 40), ("1.425 m/s", "1.425 m/s")),
        (F(14245, 10000), F(14246, 10000), ("1.4245 m/s", "1.4246 m/s")),
        (F(14245, 10000), F(14244, 10000), ("1.425 m/s", "1.424 m/s")),
        (F(1, 3), F(1, 3) + F(1, 10**9), ("0.333333334 m/s", "0.333333334 m/s")),
        (F(1, 3), F(1, 3) + F(1, 10**90), ("0.3334 m/s", "at least as large")),
        (F(10**400, 3), F(10**401), ("3.334e+399 m/s", "1e+401 m/s")),
    ],
)
def test_what_holds_is_seen_to_hold(required, certified, sides):
    one = premise(required, certified)
    assert one.sides == sides
    assert one.holds is (required <= certified)


def test_a_premise_is_about_a_proof_and_no_measurement_unless_told():
    assert premise(1.0, 2.0).holds
    assert not premise(1.0, 2.0).measured


def test_plain_values():
    assert premise(F(1, 4), F(1, 2), note="n").to_dict() == {
        "name": "x", "required": 0.25, "certified": 0.5, "ratio": 0.5, "holds": True, "unit": "m/s", "measured": False,
        "note": "n",
    }  # fmt: skip
    assert premise(1.0, 0.0, measured=True).to_dict() | {"note": ""} == {
        "name": "x", "required": 1.0, "certified": 0.0, "ratio": None, "holds": False, "unit": "m/s", "measured": True,
        "note": "",
    }  # fmt: skip


def test_where_nothing_is_required_nothing_needs_to_be_certified():
    one = premise(0.0, 0.0)
    assert one.ratio == 0
    assert type(one.ratio) is UpperBound
    assert one.to_dict()["ratio"] == 0.0


@pytest.mark.parametrize("required", [math.inf, math.nan])
def test_a_run_that_diverges_holds_no_premise(required):
    one = premise(required, 1.0, measured=True)
    assert type(one.required) is type(one.ratio) is float
    assert not math.isfinite(one.ratio)
    assert not one.holds
    told = one.to_dict()
    assert (told["required"], told["certified"], told["ratio"]) == (None, 1.0, None)


def test_a_number_beyond_all_floats_is_a_bound_too():
    one = premise(F(10**400), F(10**401))
    assert one.ratio == F(1, 10)
    assert one.holds


def test_a_witness_is_about_no_sign_conditions_unless_told():
    assert Witness(multiplier={(0,): F(1)}).conditions == 0


@pytest.mark.parametrize(("unit", "said"), [("m/s", " m/s"), ("-", "")])
def test_both_sides_are_said_on_their_outer_sides_and_one_number_once(unit, said):
    one = Premise(name="x", required=F(1, 3), certified=F(2, 3), unit=unit)
    assert one.sides == (f"0.3334{said}", f"0.6666{said}")
    same = Premise(name="x", required=F(1, 3), certified=F(1, 3), unit=unit)
    assert same.sides == (f"at most 0.3334{said}", "equal")


@pytest.mark.parametrize(("value", "sides"), [(0, ("0", "0")), (1, ("at most 1", "equal"))])
def test_equal_sides_are_said_once_unless_they_are_zero(value, sides):
    assert Premise(name="x", required=F(value), certified=F(value), unit="-").sides == sides
