"""Definite matrices as polynomial files: proved if definite, refused if not, split where there are too many."""

from fractions import Fraction as F

import pytest

import quakedesign as qd
from quakedesign.laws import published
from quakedesign.linear.linear_problem import LinearProblem
from quakedesign.linear.sampled_stability import varying_verdict
from quakedesign.linear.verdict import definite_files, sampled_files
from quakedesign.sos.exact.polynomial_files import load, text

GOOD, BAD = ((F(2), F(-1)), (F(-1), F(1))), ((F(1), F(1)), (F(1), F(1)))


def test_a_definite_matrix_is_proved_and_a_singular_one_is_not():
    (answer,) = definite_files({"P": GOOD, "Q": GOOD})
    assert answer.check()
    assert answer.statement.variables == ("P1", "P2", "Q1", "Q2")
    assert answer.statement.polynomial[1, 1, 0, 0] == -2
    assert load(text(answer.statement, answer.proof)) == (answer.statement, answer.proof)
    (other,) = definite_files({"P": GOOD, "Q": BAD})
    assert not other.check()


@pytest.mark.parametrize(("count", "sizes"), [(8, [16]), (9, [16, 2]), (0, [])])
def test_more_than_sixteen_variables_are_split(count, sizes):
    found = definite_files({f"M{n}_": GOOD for n in range(count)})
    assert [len(answer.statement.variables) for answer in found] == sizes
    assert all(answer.check() for answer in found)


def test_the_published_gains_have_their_matrices_in_files_and_bad_gains_none():
    problem = LinearProblem.of(qd.load_fault("lab-fault"))
    gains = tuple(published("lab-fault")["elqr"].gains.values())
    held = sampled_files(problem, gains, varying_verdict(problem, gains, "0.0005"))
    assert len(held) == 3  # P, W and four vertices of seven variables
    assert all(answer.check() for answer in held)
    assert sampled_files(problem, gains, varying_verdict(problem, gains, "0.001")) == []
