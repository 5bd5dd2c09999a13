"""Compiled programmes against closed forms, and cones in cvxpy against the ones that are assembled by hand."""

import cvxpy as cp
import numpy as np
import pytest

from quakedesign.sos.exact import polynomial_text as text
from quakedesign.sos.exact.polynomial_statement import statement
from quakedesign.sos.solve.conic import Compiled, in_cones, stated_problems
from quakedesign.sos.solve.conic import solve as solved
from quakedesign.sos.solve.joint import shape_of


def ellipse():
    """Largest cᵀx with xᵀAx ≤ 1, as [[A⁻¹, x], [xᵀ, 1]] ⪰ 0: √(cᵀA⁻¹c)."""
    inverse, c, x = np.array([[2.0, 1.0], [1.0, 3.0]]), cp.Parameter(2), cp.Variable((2, 1))
    matrix = cp.bmat([[inverse, x], [x.T, np.ones((1, 1))]])
    return Compiled(cp.Problem(cp.Maximize(c @ x[:, 0]), [matrix >> 0])), c, x, inverse


@pytest.mark.parametrize("anew", [True, False])
def test_other_parameters_give_other_answers(anew):
    compiled, c, x, inverse = ellipse()
    for value in ((1.0, 0.0), (0.5, -2.0), (-1.0, 1.0)):
        c.value = np.array(value)
        assert compiled.solve(anew=anew)
        best = np.sqrt(c.value @ inverse @ c.value)
        assert compiled.problem.value == pytest.approx(best, rel=1e-6)
        assert x.value[:, 0] == pytest.approx(inverse @ c.value / best, abs=1e-3)  # the root of the value's accuracy


def test_the_numbers_of_the_cone_form_are_those_of_cvxpy():
    x, matrix, side = cp.Variable(3), cp.Parameter((2, 3)), cp.Parameter(2)
    problem = cp.Problem(cp.Minimize(side[0] * x[0] + x[1]), [matrix @ x <= side, cp.diag(x) >> np.eye(3) * side[1]])
    compiled, random = Compiled(problem), np.random.default_rng(5)
    for _ in range(3):
        matrix.value, side.value = random.normal(size=(2, 3)), random.normal(size=2)
        ours, theirs = compiled.data()[0], problem.get_problem_data(cp.CLARABEL, canon_backend="COO", solver_opts={})[0]
        assert np.array_equal(ours["A"].toarray(), theirs["A"].toarray())
        assert ours["A"].nnz == theirs["A"].nnz
        assert np.array_equal(ours["b"], theirs["b"])
        assert np.array_equal(ours["c"], theirs["c"])


def test_what_has_no_answer_has_none():
    x, b = cp.Variable(), cp.Parameter(value=-1.0)
    compiled = Compiled(cp.Problem(cp.Minimize(x), [x >= 0, x <= b]))
    assert not compiled.solve()
    b.value = 2.0
    assert compiled.solve()
    assert compiled.problem.value == pytest.approx(0, abs=1e-7)


@pytest.mark.parametrize(
    ("polynomial", "conditions"),
    [
        ("3*x^4 + 2*x^3*y + 5*x^2*y^2 - x*y^3 + 4*y^4", {}),
        ("x^3 + 2*x*y^2 - x*y + 3", {"inequalities": ("x", "2 - x - y")}),
        ("x^4 + y^4 + x*y", {"equalities": ("x^2 + y^2 - 1",)}),
    ],
)
def test_cones_are_those_that_are_assembled_by_hand(polynomial, conditions):
    """Two statements of the largest margin: by hand in `MomentProgram`, and in cvxpy from `in_cones`."""
    names, exact = text.parse(polynomial)
    read = {kind: tuple(text.parse(p, names)[1] for p in given) for kind, given in conditions.items()}
    shape = shape_of(statement(names, exact, **read))
    target = {e: float(c) for e, c in exact.items()}
    moments, slack = cp.Variable(len(shape.keys)), cp.Variable(nonneg=True)
    traces = np.zeros(len(shape.keys))
    rows, columns, values, diagonal = shape.localizing
    np.add.at(traces, columns[np.isin(rows, diagonal)], values[np.isin(rows, diagonal)])
    unit = traces @ moments + slack == 1
    problem = cp.Problem(cp.Minimize(shape.vector(target) @ moments + 4 * slack), [unit, *in_cones([shape], moments)])
    assert Compiled(problem).solve()
    assert problem.value == pytest.approx(shape.solve(target).margin, abs=1e-6)


def test_problems_are_handed_back_within_the_block_only():
    compiled, c, _, _ = ellipse()
    c.value = np.ones(2)
    once = cp.Problem(cp.Minimize(0), [])
    assert compiled.solve()
    with stated_problems() as problems:
        assert compiled.solve()
        assert solved(once)
        assert compiled.solve()
    assert compiled.solve()
    assert problems == [compiled.problem, once]
