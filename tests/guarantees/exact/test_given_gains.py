"""Gains as engineers have them: numbers, lists, a row of a matrix; and a PID, which has one integral."""

import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import control
import numpy as np
import pytest

import quakedesign as qd
from quakedesign.checking import check_files
from quakedesign.errors import ParameterError
from quakedesign.guarantees.exact.guarantee_files import save_guarantee
from quakedesign.laws import summed_integrals

CHECK = Path(__file__).parents[3] / "proofs" / "check.py"
LAB = qd.load_fault("lab-fault")
STEP = 0.001


@pytest.fixture(scope="module")
def placed():
    """K of a PID by pole placement of python-control, on the fault as it is held over T_s with one summed integral."""
    plant = control.sample_system(qd.to_statespace(LAB), STEP)
    update = np.block([[plant.A, np.zeros((2, 1))], [STEP, 0, 1]])
    return control.place(update, np.vstack([plant.B, [[0]]]), np.exp(STEP * np.array([-400, -420, -100])))


def test_a_pid_from_a_matrix_of_python_control_is_proved_by_both_checkers(placed, tmp_path):
    gains = np.append(placed, [[0.0]], axis=1)
    found = qd.guarantee(LAB, gains=gains)
    assert found.proved
    assert found.proof.sampled_loop.law.states == ("xi1",)
    path = tmp_path / "pid.json"
    save_guarantee(found.proof, path)
    assert check_files([path], "lab-fault")[str(path)][0] == "proved"
    assert subprocess.run([sys.executable, CHECK, path], capture_output=True, check=False).returncode == 0


@pytest.mark.slow
def test_numbers_lists_and_rows_are_the_same_gains(placed):
    row = [*placed[0], 0.0]
    texts = tuple(str(Fraction(repr(float(v)))) for v in row)
    laws = [qd.guarantee(LAB, gains=given).proof.sampled_loop.law for given in (row, texts, np.array([row]))]
    assert laws[0] == laws[1] == laws[2]


def test_a_pid_moves_as_the_law_with_a_double_integral_that_counts_for_nothing():
    step, errors = Fraction(1, 7), [(Fraction(i * i - 5), Fraction(3 - i)) for i in range(6)]
    gains = [Fraction(3), Fraction(2), Fraction(5), Fraction(0)]
    law, total, moved = summed_integrals(tuple(gains), step), Fraction(0), Fraction(0)
    for slip, rate in errors:
        pressure = law.output[0] * moved + law.feedback[0] * slip + law.feedback[1] * rate
        assert pressure == -(gains[0] * slip + gains[1] * rate + gains[2] * total)
        moved = law.update[0][0] * moved + law.measured[0][0] * slip
        total += step * slip


@pytest.mark.parametrize("gains", [[1, 2, 3], [[1, 2], [3, 4]], [1, 2, 3, float("nan")], np.ones((2, 2)), [None] * 4])
def test_what_are_no_four_gains_is_refused(gains):
    with pytest.raises(ParameterError):
        qd.guarantee(LAB, gains=gains)


def test_a_law_without_any_integral_is_refused():
    with pytest.raises(ParameterError, match="Add an integral of the slip error"):
        qd.guarantee(LAB, gains=[1e7, 1e4, 0, 0])
