"""Conic programmes stated in cvxpy and solved by Clarabel, once or compiled with parameters."""

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cached_property
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from quakedesign.sos.solve.moment import MomentProgram, options, pairs, useful

if TYPE_CHECKING:
    import cvxpy as cp

_collected: ContextVar["dict[int, cp.Problem] | None"] = ContextVar("collected", default=None)


@contextmanager
def stated_problems() -> "Iterator[list[cp.Problem]]":
    """Collect the cvxpy problems solved within a block, each once, in the order of their first solution.

    Parameters, variables and multipliers have the values of the last solve. Within the block all problems are solved in
    this process, regardless of `workers`. The fastest backend to compile them is `canon_backend="COO"`. A statement
    about one polynomial (`sos.prove`) is not stated in cvxpy, as compiling it would take several times as long as
    solving it.

    Yields
    ------
    list of cvxpy.Problem
        Filled when the block ends.
    """
    by_number: dict[int, cp.Problem] = {}
    problems: list[cp.Problem] = []
    token = _collected.set(by_number)
    try:
        yield problems
    finally:
        _collected.reset(token)
        problems.extend(by_number.values())


def collecting() -> bool:
    """Whether a `stated_problems` block is active."""
    return _collected.get() is not None


def record(problem: "cp.Problem") -> None:
    """Record a problem for the active `stated_problems` block."""
    collected = _collected.get()
    if collected is not None:
        collected.setdefault(id(problem), problem)


def solve(problem: "cp.Problem", **chosen: Any) -> bool:
    """Run Clarabel; return whether its solution is usable, which is no proof of feasibility."""
    import cvxpy as cp

    record(problem)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            problem.solve(solver=cp.CLARABEL, **chosen)
        except (cp.SolverError, ValueError, ArithmeticError):
            return False
    return problem.status in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE)


class Compiled:
    """A cvxpy problem whose cone form is compiled once; between two solves only its Parameters change.

    Parameters
    ----------
    problem : cvxpy.Problem
        DPP-compliant (disciplined parametrised programming); no term of the objective may consist of a Parameter alone.
    """

    def __init__(self, problem: "cp.Problem") -> None:
        self.problem = problem
        self.solver_seconds = 0.0
        self._solvers: dict[str, Any] = {}

    def data(self) -> tuple[dict[str, Any], Any, Any]:
        """Cone form for the present Parameters, in the format of `cvxpy.Problem.get_problem_data`."""
        form, chain, inverse = self._form
        program = form["param_prob"]
        if not program.total_param_size:
            return self._form
        parameters = np.zeros(program.total_param_size + 1)
        parameters[-1] = 1
        for key, parameter in program.id_to_param.items():
            start = program.param_id_to_col[key]
            parameters[start : start + parameter.size] = np.ravel(parameter.value, order="F")
        values, costs = program.reduced_A.reduced_mat @ parameters, program.q @ parameters
        rows, ends, (height, width) = program.reduced_A.problem_data_index
        last = ends[-2]
        side = np.zeros(height)
        side[rows[last:]] = values[last:]
        matrix = sparse.csc_array((-values[:last], rows[:last], ends[:-1]), shape=(height, width - 1))
        return {**form, "A": matrix, "b": side, "c": costs[:-1]}, chain, inverse

    @cached_property
    def _form(self) -> tuple[dict[str, Any], Any, Any]:
        """Compiled cone form, with the maps from the Parameters to its numbers."""
        import cvxpy as cp

        form, chain, inverse = self.problem.get_problem_data(
            cp.CLARABEL, canon_backend=cp.COO_CANON_BACKEND, solver_opts={}
        )
        return form, chain, inverse

    def solve(self, accuracy: float = 1e-8, *, anew: bool = True) -> bool:
        """Run Clarabel and return whether its solution is usable; if it is, variables and dual variables are set.

        Parameters
        ----------
        accuracy : float
            Tolerance of gap and feasibility [-].
        anew : bool
            False reuses the solver of the last call with its ordering and scaling, which is faster; rounding then
            depends on the problems solved before.
        """
        record(self.problem)
        data, chain, inverse = self.data()
        answer = chain.solver.solve_via_data(data, not anew, False, options(accuracy), self._solvers)
        self.solver_seconds = answer.solve_time
        if not useful(answer):
            return False
        fields = {name: getattr(answer, name) for name in ("x", "z", "obj_val", "solve_time", "iterations")}
        self.problem.unpack_results(SimpleNamespace(status="Solved", **fields), chain, inverse)
        return True


def in_cones(shapes: Sequence[MomentProgram], moments: "cp.Expression") -> "list[cp.Constraint]":
    """cvxpy constraints on stacked functionals, one per shape: zero on its relations, ⪰ 0 on its blocks.

    Blocks of equal size share one constraint, which compiles about ten times faster than one per block.
    """
    import cvxpy as cp

    triangles = sparse.block_diag([shape.triangles() for shape in shapes], format="csr")
    relations = sparse.block_diag([shape.relations() for shape in shapes], format="csr")
    sizes = np.array([block.size for shape in shapes for block in shape.blocks])
    starts = np.cumsum(sizes * (sizes + 1) // 2) - sizes * (sizes + 1) // 2
    constraints = [relations @ moments == 0] if relations.shape[0] else []
    for size in np.unique(sizes).tolist():
        place = np.empty((size, size), dtype=np.int64)
        rows, columns = pairs(size)
        place[rows, columns] = place[columns, rows] = np.arange(len(rows))
        first = starts[sizes == size]
        entries = triangles[(first[:, None] + place.ravel()).ravel()]
        constraints.append(cp.reshape(entries @ moments, (len(first), size, size), order="C") >> 0)
    return constraints
