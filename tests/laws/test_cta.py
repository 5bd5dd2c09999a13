"""2-CTA: the Filippov equilibria that it suggests, checked by hand."""

from fractions import Fraction as F

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quakedesign.laws import control_law

CTA = control_law("cta")
UNCERTAIN = {"beta": (F(1), F(7, 5)), "d": (F(-1), F(1))}


def gains(*values):
    return dict(zip(CTA.gain_units, map(F, values), strict=True))


def balanced(k, found):
    """Convex combination of the field in the named cells, from eq. clsystem1 with λ = 1, at e1 = 1 and e2 = 0."""
    point, parameters, weights = found["point"], found["parameters"], found["weights"]
    assert (point["e1"], point["e2"]) == (1, 0)
    assert sum(weights.values()) == 1
    assert all(share >= 0 for share in weights.values())
    assert all(UNCERTAIN[name][0] <= v <= UNCERTAIN[name][1] for name, v in parameters.items())
    sign = {"+": 1, "-": -1}
    for cell in weights:  # each cell touches the point
        assert cell[0] == "+"
        assert sign[cell[2]] * point["e3"] > 0
    acceleration = parameters["beta"] * (-k["k1"] + point["e3"])
    drift = sum(w * (-k["k3"] - k["k4"] * sign[cell[1]] + parameters["d"]) for cell, w in weights.items())
    return point["e2"], acceleration, drift


@pytest.mark.parametrize(
    "values",
    [
        ("7", "5", "1", "0"),
        ("7", "5", "1.5", "0.5"),
        ("7", "5", "1.2", "1.1"),
        ("7", "5", "1.2", "-0.3"),
        ("7", "5", "2", "2"),
        ("7", "5", "0.5", "3"),
        ("-7", "5", "1", "0.5"),
        ("7", "5", "0", "0"),
    ],
)
def test_a_constant_pull_holds_the_loop_away_from_the_origin(values):
    k = gains(*values)
    found = CTA.counterexample(k, UNCERTAIN)
    assert balanced(k, found) == (0, 0, 0)


@pytest.mark.parametrize("values", [("7", "5", "2.3", "1.1"), ("0", "5", "1", "0"), ("7", "5", "-1", "0")])
def test_none_is_suggested_where_there_is_none_of_this_kind(values):
    # k3 − |k4| = 1.2 > 1; k1 = 0 puts e3 on a switching surface; k3 < 0 without k4 drives e3 away
    assert CTA.counterexample(gains(*values), UNCERTAIN) is None


small = st.fractions(-3, 3, max_denominator=10)


@given(small, small, small, small)
def test_every_suggestion_is_an_equilibrium(k1, k2, k3, k4):
    k = gains(k1, k2, k3, k4)
    found = CTA.counterexample(k, UNCERTAIN)
    if found is None:
        assert k1 == 0 or k3 - abs(k4) > 1 or abs(k3) > abs(k4)
    else:
        assert balanced(k, found) == (0, 0, 0)


def test_a_perturbation_that_only_pushes_has_none():
    assert CTA.counterexample(gains("7", "5", "1", "0"), UNCERTAIN | {"d": (F(-1), F(0))}) is None
