"""cvxpy problems solved by Clarabel."""

from typing import Any


def solve(problem: Any, **options: Any) -> bool:
    """Run Clarabel; whether there is an answer worth looking at. Its status is no verdict."""
    import warnings

    import cvxpy as cp

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            problem.solve(solver=cp.CLARABEL, **options)
        except (cp.SolverError, ValueError, ArithmeticError):
            return False
    return problem.status in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE)
