"""2-DIA: what is special about it."""

from fractions import Fraction as F

import pytest

from quakedesign.errors import ParameterError
from quakedesign.laws import control_law

DIA = control_law("dia")


def test_a_negative_root_gain_is_refused():
    # k_I1^{3/2} would be imaginary
    with pytest.raises(ParameterError, match=r"gain kI1 must not be negative.*Received -1"):
        DIA.from_values(("-1", "5", "1", "0"))
    assert DIA.from_values(("0", "5", "1", "0")).gains["kI1"] == 0


def test_it_knows_no_equilibrium_away_from_the_origin():
    assert DIA.counterexample(dict.fromkeys(DIA.gain_units, F(1)), {"beta": (F(1), F(1)), "d": (F(-1), F(1))}) is None
