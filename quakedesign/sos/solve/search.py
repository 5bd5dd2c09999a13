"""Search for decision variables that put a family of polynomials into their cones with the largest margin."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from quakedesign.sos.exact.witness import Polynomial
from quakedesign.sos.solve.cone import Cone

SOLVER = "CLARABEL"


@dataclass(frozen=True, slots=True)
class Family:
    """A polynomial Σ_j a_j P_j that must lie in a cone with margin.

    Attributes
    ----------
    cone : Cone
    parts : sequence of Polynomial
        P_j, one for every decision variable.
    """

    cone: Cone
    parts: Sequence[Polynomial]


@dataclass(frozen=True, slots=True)
class Proposal:
    """Floating-point answer of a search; proves nothing.

    Attributes
    ----------
    decision : list of float
    margin : float
        Largest t with P − t Σ u_i^degree in every cone.
    """

    decision: list[float]
    margin: float


def propose(families: Sequence[Family], decisions: int) -> Proposal | None:
    """Decision in [−1, 1]ⁿ with the largest margin t over all families; None if the solver finds no t > 0.

    Solver: Clarabel through cvxpy.
    """
    import cvxpy as cp
    import numpy as np

    decision, margin = cp.Variable(decisions), cp.Variable()
    constraints = [cp.abs(decision) <= 1, margin <= 1]
    for family in families:
        cone = family.cone
        parts = np.array([cone.vector(p) for p in family.parts]).T
        power_sum = np.array([float(max(e) == cone.degree) for e in cone.monomials])
        constraints.append(parts @ decision - margin * power_sum == _sum_of_blocks(cone))
    problem = cp.Problem(cp.Maximize(margin), constraints)
    if not solve(problem) or margin.value is None or not margin.value > 1e-9:
        return None
    return Proposal(np.asarray(decision.value, dtype=float).tolist(), float(margin.value))


def largest_multiple(cone: Cone, polynomials: Sequence[Polynomial], direction: Polynomial) -> float:
    """Largest g for which the solver finds all P − g·direction in the cone; 0 if it finds none. Proves nothing."""
    import cvxpy as cp
    import numpy as np

    multiple = cp.Variable()
    towards = np.array(cone.vector(direction))
    constraints = [np.array(cone.vector(p)) - multiple * towards == _sum_of_blocks(cone) for p in polynomials]
    problem = cp.Problem(cp.Maximize(multiple), constraints)
    return max(0.0, float(multiple.value)) if solve(problem) and multiple.value is not None else 0.0


def _sum_of_blocks(cone: Cone):
    import cvxpy as cp

    grams = [cp.Variable((len(basis), len(basis)), PSD=True) for _, basis in cone.blocks]
    return sum(m @ cp.vec(q, order="F") for m, q in zip(cone.maps, grams, strict=True))


def solve(problem, **options) -> bool:
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


class GramSearch:
    """Gram matrices with the largest smallest eigenvalue for polynomials of one cone; modelled once.

    Parameters
    ----------
    cone : Cone
    """

    def __init__(self, cone: Cone) -> None:
        import cvxpy as cp
        import numpy as np

        self.cone = cone
        self._target = cp.Parameter(len(cone.monomials))
        self._margin = cp.Variable()
        self._grams = [cp.Variable((len(b), len(b)), symmetric=True) for _, b in cone.blocks]
        total = sum(
            (m @ cp.vec(q, order="F") for m, q in zip(cone.maps, self._grams, strict=True)),
            start=np.zeros(len(cone.monomials)),
        )
        bounds = [q - self._margin * np.eye(q.shape[0]) >> 0 for q in self._grams]
        self._problem = cp.Problem(cp.Maximize(self._margin), [*bounds, total == self._target, self._margin <= 1])

    def __call__(self, polynomial: Polynomial | Mapping) -> list | None:
        """Gram matrices (arrays) for a polynomial, or None if none with a positive margin is found."""
        import numpy as np

        vector = np.array(self.cone.vector(polynomial))
        size = float(np.abs(vector).max())
        if size == 0:
            return None
        self._target.value = vector / size
        if not solve(self._problem) or self._margin.value is None or not self._margin.value > 0:
            return None
        values = [np.asarray(q.value, dtype=float) for q in self._grams]
        return [size * (q + q.T) / 2 for q in values]
