from fractions import Fraction

import numpy as np
import pytest

from quakedesign import sos
from quakedesign.errors import PolynomialError

LEVEL = "(100*x^4 - 384*x^2*y^2 + 400*y^4)"


def test_lower_bound_of_a_univariate_quartic_is_its_minimum():
    program = sos.Program(["x"], ["g"])
    program.require("x^4 - 3*x^2 + x + 5 - g")
    program.maximize("g")
    found = program.solve()
    grid = np.linspace(-2, 2, 200_001)
    least = float((grid**4 - 3 * grid**2 + grid + 5).min())
    assert least - 1e-4 < float(found.objective) <= least + 1e-9
    assert all(a.check() and str(a.verdict) == "sos" for a in found.answers)


def test_constrained_bound_on_an_interval():
    program = sos.Program(["x"], ["g"])
    program.require("x^3 - x - g", on=["x >= 0", "x <= 2"])
    program.maximize("g")
    assert float(program.solve().objective) == pytest.approx(-2 / 27**0.5, abs=1e-4)


def test_matrix_inequality_is_finished_exactly():
    program = sos.Program(["x"], ["a", "b"])
    program.require_definite([["a", 1], [1, "b"]])
    program.minimize("a + b")
    found = program.solve()
    a, b = found.values["a"], found.values["b"]
    assert a * b > 1
    assert 2 < a + b < Fraction(2001, 1000)
    assert found.objective == a + b  # of the minimised function, not of its negative
    assert found.bound == pytest.approx(2, abs=1e-4)


def test_cvxpy_constraints_steer_the_search():
    program = sos.Program(["x", "y"], ["a"])
    program.require("x^4 + y^4 + a*x^2*y^2")
    program.constraints.append(program["a"] >= -1)
    program.minimize("a")
    assert float(program.solve().values["a"]) == pytest.approx(-1, abs=1e-3)


def test_infeasible_is_an_answer():
    program = sos.Program(["x"], ["g"])
    program.require("-x^2 + g")
    found = program.solve()
    assert not found
    assert "only squares contain x^2" in found.reason


def test_a_product_of_decisions_is_refused():
    program = sos.Program(["x"], ["a", "b"])
    with pytest.raises(PolynomialError, match="affine"):
        program.require("a*b*x^2")
    with pytest.raises(PolynomialError, match="symmetric"):
        program.require_definite([["a", "b"], [1, "b"]])


def region(level):
    """Whether V' ≤ 0 is proved on {x² + y² ≤ level} for ẋ = (U − 1)∇U; U = 1 first at radius² 1/20."""
    return sos.prove(f"8*{LEVEL}*(1 - {LEVEL})", on=[f"{level} - x^2 - y^2 >= 0"])


@pytest.mark.slow
def test_region_of_attraction_approaches_one_twentieth_from_below():
    level, answer = sos.largest(region, "1/100", "1", relative=1e-4)
    assert Fraction(1, 20) * Fraction(999, 1000) < level <= Fraction(1, 20)
    assert answer.check()


@pytest.mark.parametrize("excess", ["1e-9", "1e-6", "1e-4", "1e-2"])
def test_region_of_attraction_never_exceeds_it(excess):
    beyond = region(Fraction(1, 20) + Fraction(excess))
    assert str(beyond.verdict) != "sos"
    assert beyond.check()
