"""Courses of pressure by hand."""

import math
from fractions import Fraction

import numpy as np
import pytest

from quakedesign.errors import ParameterError, UnitError
from quakedesign.simulation import PressureHistory, pressure_history

HOUR = 3600.0


def test_a_quantity_is_a_constant_pressure():
    course = pressure_history("5 MPa")
    assert [course.before(t) for t in (-1.0, 0.0, 1e9)] == [5e6] * 3
    assert course.after(0.0) == course.largest == 5e6


def test_instants_are_joined_by_straight_lines_and_steps():
    course = pressure_history("1 hour: 2 MPa, 3 hour: 4 MPa, 3 hour: 1 MPa")
    assert course.before(0.0) == 2e6
    assert course.before(1.5 * HOUR) == course.after(1.5 * HOUR) == pytest.approx(2.5e6, rel=1e-15)
    assert (course.before(3 * HOUR), course.after(3 * HOUR)) == (4e6, 1e6)
    assert course.after(100 * HOUR) == 1e6
    assert course.largest == 4e6
    times = np.array([HOUR, 3 * HOUR, 3 * HOUR, 4 * HOUR])
    assert course.sampled(times).tolist() == [2e6, 4e6, 1e6, 1e6]


def test_a_step_at_the_first_instant_has_two_sides():
    course = PressureHistory(times=(0.0, 0.0), pressures=(1.0, 3.0))
    assert (course.before(0.0), course.after(0.0)) == (1.0, 3.0)


def test_a_file_has_its_units_in_the_first_row(tmp_path):
    path = tmp_path / "well.csv"
    path.write_text("time [day],pressure [kPa]\n0,0\n1,500\n\n1,-200\n")
    course = pressure_history(str(path))
    assert course.times == (0.0, 86400.0, 86400.0)
    assert course.pressures == (0.0, 5e5, -2e5)


@pytest.mark.parametrize(
    ("text", "kind", "said"),
    [
        ("5 m", UnitError, "pressure must be a quantity in Pa"),
        ("1 s: 1 MPa, 2 MPa", ParameterError, "'time: pressure'"),
        ("2 s: 1 MPa, 1 s: 2 MPa", ParameterError, "must not decrease"),
        ("1 s: 1 MPa, 1 s: 2 MPa, 1 s: 3 MPa", ParameterError, "must not decrease"),
        ("1 s: inf", ParameterError, "finite"),
        ("none.csv", ParameterError, "cannot be read"),
    ],
)
def test_other_texts_are_refused_in_one_line(text, kind, said):
    with pytest.raises(kind, match=said) as error:
        pressure_history(text)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("0,0\n", "must have the columns"),
        ("time [s]\n0\n", "must have the columns"),
        ("time [s],pressure [Pa]\n1\n", "row 2 must have a time and a pressure"),
        ("time [s],pressure [m]\n1,2\n", "row 2: pressure must be a quantity in Pa"),
        ("time [s],pressure [Pa]\n", "1 to 4096 times"),
        ("", "must have the columns"),
    ],
)
def test_other_files_are_refused(tmp_path, content, said):
    path = tmp_path / "well.csv"
    path.write_text(content)
    with pytest.raises((ParameterError, UnitError), match=said):
        pressure_history(str(path))


def test_pressures_may_be_any_numbers_that_are_finite():
    assert PressureHistory.constant(Fraction(1, 4)).after(3.0) == 0.25
    with pytest.raises(ParameterError, match="must be finite"):
        PressureHistory.constant(math.nan)
