"""Sum-of-squares programmes with decision variables, solved, rounded and proved.

The solver is Clarabel through cvxpy. `Membership` computes the margins of many polynomials of one shape with one model.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import diags_array

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import PolynomialError
from quakedesign.exact import nearest, rational
from quakedesign.sos.exact.answer import Answer, Positivity
from quakedesign.sos.exact.polynomial import Exponents, combination, degree, positive_definite
from quakedesign.sos.exact.polynomial_statement import Statement, statement
from quakedesign.sos.exact.polynomial_text import read
from quakedesign.sos.solve.conic import Compiled, solve
from quakedesign.sos.solve.decide import initial_blocks
from quakedesign.sos.solve.engine import decide
from quakedesign.sos.solve.facial_reduction import Block, at_kernels
from quakedesign.sos.solve.forced_equations import Forced, Requirement
from quakedesign.sos.solve.moment import MomentProgram, pairs
from quakedesign.sos.solve.rounding import relations

if TYPE_CHECKING:
    import cvxpy as cp

# ----------------------------------------------------------------------
# Positivity with decision variables: solved by cvxpy and Clarabel, rounded, and proved polynomial by polynomial.

_LOSSES = (1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
_BITS = (4, 8, 12, 18, 24, 32)
_KERNELS = ((1e-6, 1e-3), (1e-6, 1e-5), (1e-4, 1e-2), (1e-4, 1e-4))  # eigenvalue threshold and rounding tolerance
_ROUNDS = 3  # successive restrictions to faces by numerical kernels


@dataclass(frozen=True, kw_only=True)
class Solution:
    """Exact values of the decisions with a proof of every requirement."""

    values: Mapping[str, Fraction]  # Decision variables
    answers: tuple[Answer, ...]  # One ``sos`` answer for every required polynomial, in order
    objective: Fraction  # Exact value of the maximised or minimised function at these values
    bound: float  # Optimum of the same function by the solver, in floating point without proof
    # Equations solved in advance, each with its requirement and the monomial or kernel that forces it
    forced: tuple[str, ...] = ()


@checked_dataclass(frozen=True, kw_only=True)
class NoSolution:
    """Result of a search that found no decisions; false as a truth value.

    It implies infeasibility only if the reason states it.

    Attributes
    ----------
    reason : str
        Decisions forced by each requirement, and the outcome of the search.
    """

    reason: str

    def __bool__(self) -> bool:
        return False


class Program:
    """Polynomials, affine in decision variables, that must have sum-of-squares proofs on their sets.

    Parameters
    ----------
    variables, decisions : sequence of str
        Names of the indeterminates and of the decision variables.
    """

    def __init__(self, variables: Sequence[str], decisions: Sequence[str]) -> None:
        import cvxpy as cp

        self.variables, self.decisions = tuple(variables), tuple(decisions)
        self._vector = cp.Variable(len(self.decisions), name="decisions")
        self.constraints: list[cp.Constraint] = []
        self._required: list[Requirement] = []
        self._forced = Forced(requirements=())
        self._grams: list[list[cp.Variable]] = []
        self._margin: cp.Variable | None = None
        self._status = ""
        self._definite: list[list[list[dict[Exponents, Fraction]]]] = []
        self._objective: dict[Exponents, Fraction] = {}  # maximised
        self._sign = 1  # -1 if the function of the user is minimised

    def __getitem__(self, decision: str) -> "cp.Expression":
        """Decision as a cvxpy expression for further constraints, which steer the search and are not proved."""
        return self._vector[self.decisions.index(decision)]

    def require(
        self, polynomial: Any, *, on: Sequence[Any] = (), degree_bound: int | None = None, products: bool | None = None
    ) -> None:
        """Require a proof that a polynomial in variables and decisions is non-negative on a set.

        Parameters
        ----------
        polynomial : str, SymPy expression or mapping
            Affine in the decisions; a linear constraint if it has no variables.
        on, degree_bound, products
            As in `quakedesign.sos.prove`; the constraints must not contain decisions.

        Raises
        ------
        PolynomialError
            When the polynomial is not affine in the decisions.
        """
        names = self.variables + self.decisions
        _, exact, _, _, _ = read(polynomial, (), None, names)
        _, _, inequalities, equalities, _ = read("0", on, None, self.variables)
        parts = self._parts(exact)
        support = {e for p in parts for e in p}
        template = statement(
            self.variables,
            dict.fromkeys(support, Fraction(1)),
            inequalities=inequalities,
            equalities=equalities,
            products=products,
            degree_bound=degree_bound,
        )
        self._required.append(Requirement(parts=parts, template=template))

    def require_definite(self, matrix: Sequence[Sequence[Any]]) -> None:
        """Require an exact proof that a symmetric matrix, affine in the decisions, is positive definite.

        Parameters
        ----------
        matrix : n sequences of n str, SymPy expressions or numbers

        Raises
        ------
        PolynomialError
            When the matrix is not symmetric or not affine.
        """
        rows = [[self._affine(entry) for entry in row] for row in matrix]
        size = len(rows)
        if any(len(row) != size for row in rows) or any(
            rows[i][j] != rows[j][i] for i in range(size) for j in range(i)
        ):
            raise PolynomialError(
                f"a matrix inequality with {size} rows needs a symmetric {size} x {size} matrix. "
                "Received a matrix that is not square or not symmetric."
            )
        self._definite.append(rows)

    def maximize(self, objective: Any) -> None:
        """Set a function of the decisions to maximise. Raises PolynomialError if it is not affine."""
        self._objective, self._sign = self._affine(objective), 1

    def minimize(self, objective: Any) -> None:
        """Set a function of the decisions to minimise. Raises PolynomialError if it is not affine."""
        self._objective, self._sign = {e: -c for e, c in self._affine(objective).items()}, -1

    def problem(self) -> "cp.Problem":
        """First cvxpy problem of the search, on the forced faces. Raises PolynomialError without a requirement."""
        self._forced = Forced(requirements=tuple(self._required)).reduced(self.decisions)
        return self._problem()

    def _problem(self) -> "cp.Problem":
        import cvxpy as cp

        return cp.Problem(cp.Maximize(self._value(self._objective)), self._constraints(0.0))

    def solve(self) -> Solution | NoSolution:
        """Exact values of the decisions with proofs, as close to the optimum as the rounding permits.

        Decisions that the requirements force, such as the coefficient of a monomial that no square produces, are
        eliminated exactly in advance.

        Returns
        -------
        Solution or NoSolution
            NoSolution gives a reason; it implies infeasibility only if the reason states it.
        """
        self.problem()
        base = self._forced
        solution, outcome = self._attempt()
        for kernel in _KERNELS if solution is None and self._margin is not None else ():
            self._forced = base
            for _ in range(_ROUNDS):
                if not self._restricted(*kernel):
                    break
                solution, _ = self._attempt()
                if solution is not None:
                    return solution
            self._forced = base
        return solution or NoSolution(reason="; ".join((*base.reasons, outcome)))

    def _attempt(self) -> tuple[Solution | None, str]:
        """Solution on the present faces or None, and the outcome of the search in words."""
        if self._forced.contradiction:
            return None, "hence the requirements are infeasible at this degree"
        solution = next(filter(None, (self._rounded(*point) for point in self._interior(_LOSSES))), None)
        outcome = (
            f"the {'remaining programme' if self._forced.reasons else 'programme'} is {self._status} in floating point"
        )
        if self._margin is not None:
            outcome += f", with a margin of {self._margin.value:.1g}, but no exact decisions were found"
        elif refuted := self._forced.refuted():
            outcome = f"{refuted}; so no decisions satisfy the requirements at this degree"
        return solution, outcome

    def _restricted(self, threshold: float, tolerance: float) -> bool:
        """Restrict to faces without the numerical kernels of the last Gram matrices; whether any kernel exists."""
        if self._margin is None or self._forced.contradiction:
            return False
        faces: list[Sequence[Block] | None] = []
        sizes = [float(np.abs(v.value).max(initial=0)) for v in (self._vector, *(g for gs in self._grams for g in gs))]
        for required, grams in zip(self._forced.requirements, self._grams, strict=True):
            whole = [gram.value + self._margin.value * np.eye(gram.shape[0]) for gram in grams]
            unit = max(1e-3 * max(sizes), 1e-300, *(float(np.abs(w).max()) for w in whole))
            ones = [Fraction(1)] * len(self.variables)
            faces.append(at_kernels(required.present, [w / unit for w in whole], threshold, tolerance, ones))
        self._forced = self._forced.on_faces(faces, self.decisions)
        return any(face is not None for face in faces)

    def proposal(self, margin: float) -> list[float] | None:
        """Decisions with the largest margin, in floating point without proof; None if none are found.

        Parameters
        ----------
        margin : float
            Loss of objective allowed for the margin, relative to max(1, |optimum|); finite and not negative.
        """
        if not margin >= 0 or math.isinf(margin):
            raise PolynomialError(f"margin must be a number of at least 0. Received {margin!r}. Give for example 0.01.")
        self.problem()
        solution = next(self._interior((margin,)), None)
        return None if solution is None else np.asarray(self._vector.value).tolist()

    def _interior(self, losses: Sequence[float]) -> Iterator[tuple[float, float]]:
        """Optimum and allowed loss of objective, for each loss that admits decisions with a margin."""
        import cvxpy as cp

        self._margin = None
        if self._forced.contradiction:
            return
        problem = self._problem()
        solved = solve(problem)
        self._status = "feasible" if solved else problem.status or "not solved"
        if not solved:
            return
        best = float(problem.value)
        margin, least = cp.Variable(), cp.Parameter()
        least_objective = [self._value(self._objective) >= least] if self._objective else []
        within = Compiled(cp.Problem(cp.Maximize(margin), [*self._constraints(margin), margin <= 1, *least_objective]))
        for loss in (share * max(1.0, abs(best)) for share in (losses if self._objective else losses[:1])):
            least.value = best - loss
            if within.solve():
                self._margin = margin
                if within.problem.value >= 1e-11:
                    yield best, loss

    def _rounded(self, best: float, loss: float) -> Solution | None:
        """Proved solution near the last one of the solver; its objective is within 2·`loss` of the optimum."""
        for bits in _BITS:
            near = [nearest(float(v), 2**bits) for v in np.asarray(self._vector.value).tolist()]
            values = self._forced.completed(near)
            close = not self._objective or _at(self._objective, values) >= Fraction(best) - 2 * Fraction(loss)
            answers = self._proved(values) if close else None
            if answers is not None:
                return Solution(
                    values=dict(zip(self.decisions, values, strict=True)),
                    answers=answers,
                    objective=self._sign * _at(self._objective, values),
                    bound=self._sign * best,
                    forced=self._forced.reasons,
                )
        return None

    def _proved(self, values: Sequence[Fraction]) -> tuple[Answer, ...] | None:
        for rows in self._definite:
            if not positive_definite([[_at(entry, values) for entry in row] for row in rows]):
                return None
        answers = []
        for required in self._required:
            polynomial = combination(zip((Fraction(1), *values), required.parts, strict=True))
            answer = decide(replace(required.template, polynomial=polynomial))
            if answer.verdict is not Positivity.SOS:
                return None
            answers.append(answer)
        return tuple(answers)

    def _constraints(self, margin: "cp.Variable | float") -> "list[cp.Constraint]":
        constraints, self._grams = list(self.constraints), []
        for required in self._forced.requirements:
            grams, equations = _membership(self._vector, required, margin)
            self._grams.append(grams)
            constraints += [*(gram >> 0 for gram in grams), *equations]
        for j, affine in self._forced.solved.items():
            row = np.array([float(c) for c in affine])
            constraints.append(self._vector[j] == row[0] + row[1:] @ self._vector)
        for rows in self._definite:
            constraints.append(_definite(self._vector, rows, margin))
        if not constraints:
            raise PolynomialError("the program has no requirement: call require or require_definite first.")
        return constraints

    def _value(self, affine: Mapping[Exponents, Fraction]) -> "cp.Expression":
        zero = (0,) * len(self.decisions)
        units = [tuple(int(i == j) for j in range(len(zero))) for i in range(len(zero))]
        return np.array([float(affine.get(u, 0)) for u in units]) @ self._vector + float(affine.get(zero, 0))

    def _affine(self, given: Any) -> dict[Exponents, Fraction]:
        if not isinstance(given, str | Mapping) and not hasattr(given, "free_symbols"):
            return {(0,) * len(self.decisions): rational(given, "entry")}
        _, exact, _, _, _ = read(given, (), None, self.decisions)
        if degree(exact) > 1:
            raise PolynomialError(f"an affine function of {', '.join(self.decisions)} is needed. Received {given}.")
        return exact

    def _parts(self, exact: Mapping[Exponents, Fraction]) -> list[dict[Exponents, Fraction]]:
        """Constant part of a polynomial, then the part of every decision."""
        count = len(self.variables)
        parts: list[dict[Exponents, Fraction]] = [{} for _ in range(1 + len(self.decisions))]
        for e, c in exact.items():
            if sum(e[count:]) > 1:
                raise PolynomialError(
                    f"a polynomial must be affine in {', '.join(self.decisions)}. Received a product."
                )
            parts[1 + e[count:].index(1) if any(e[count:]) else 0][e[:count]] = c
        return parts


def largest(
    problem: Callable[[Fraction], Answer], low: Any, high: Any, *, relative: float = 1e-4
) -> tuple[Fraction, Answer] | None:
    """Largest level proved by a bisection, with its proof; None if the lowest level is not proved.

    Parameters
    ----------
    problem : callable
        Maps a rational level to an `Answer`.
    low, high : rational
        Ends of the initial bracket; the verdict at `low` must be ``sos``.
    relative : float
        Width of the final bracket relative to its upper end.
    """
    below, above = rational(low, "low"), rational(high, "high")
    answer = problem(below)
    if answer.verdict is not Positivity.SOS:
        return None
    best = below, answer
    while above - below > Fraction(relative) * abs(above):
        width = above - below
        grid = 1
        while Fraction(8, grid) > width:
            grid *= 10
        middle = nearest(float((below + above) / 2), grid)
        answer = problem(middle)
        if answer.verdict is Positivity.SOS:
            below, best = middle, (middle, answer)
        else:
            above = middle
    return best


def _at(affine: Mapping[Exponents, Fraction], values: Sequence[Fraction]) -> Fraction:
    return sum((c * (values[e.index(1)] if any(e) else 1) for e, c in affine.items()), start=Fraction(0))


def _membership(
    vector: "cp.Variable", required: Requirement, margin: "cp.Variable | float"
) -> "tuple[list[cp.Variable], list[cp.Constraint]]":
    """Gram matrices minus margin·I, and the equations that match their coefficients to the polynomial."""
    import cvxpy as cp

    shape, reached = required.shape, required.reached
    beyond = {e for part in required.parts for e in part if e not in reached}  # empty unless requirements conflict
    vanishing = []
    for constant, *factors in map(required.coefficient, beyond):
        vanishing.append(float(constant) + np.array(factors, dtype=float) @ vector == 0)
    if shape is None:
        return [], vanishing
    reachable = [{e: c for e, c in part.items() if e in reached} for part in required.parts]
    left, triangles = np.array([shape.vector(part) for part in reachable]).T, shape.triangles()
    total: cp.Expression = left[:, 0] + left[:, 1:] @ vector
    grams, start = [], 0
    for block in shape.blocks:
        gram = cp.Variable((block.size, block.size), symmetric=True)
        rows, columns = pairs(block.size)
        own = triangles[start : start + len(rows)].T @ diags_array(np.where(rows == columns, 1.0, 2.0))
        total = total - own @ (gram[rows, columns] + margin * (rows == columns))
        grams.append(gram)
        start += len(rows)
    if shape.relation_count:
        total = total - shape.relations().T @ cp.Variable(shape.relation_count)
    return grams, [*vanishing, total == 0]


def _definite(
    vector: "cp.Variable", rows: list[list[dict[Exponents, Fraction]]], margin: "cp.Variable | float"
) -> "cp.Constraint":
    size = len(rows)
    zero = (0,) * vector.shape[0]
    total: cp.Expression = np.array([[float(entry.get(zero, 0)) for entry in row] for row in rows])
    for k in range(vector.shape[0]):
        unit = tuple(int(i == k) for i in range(len(zero)))
        total = total + vector[k] * np.array([[float(entry.get(unit, 0)) for entry in row] for row in rows])
    return total - margin * np.eye(size) >> 0


# ----------------------------------------------------------------------
# Many polynomials of one shape: modelled once, then solved with updated solver data.


class Membership:
    """Largest margins of polynomials whose monomials are among those of one statement.

    Parameters
    ----------
    template : Statement
        Defines set, degree, multiplier and, by its polynomial, the admissible monomials.
    """

    def __init__(self, template: Statement) -> None:
        self.template = template
        self.solver_seconds = 0.0
        rows = [{e: float(c) for e, c in r.items()} for _, _, r in relations(template)]
        self._program = MomentProgram([b.shape() for b in initial_blocks(template)], rows)

    def margin(self, polynomial: Mapping[Exponents, Fraction | float]) -> float:
        """Largest t (float, unproved) with polynomial − t·Σ b² in the cone; NaN if the solver fails, −∞ if none exists.

        Raises
        ------
        PolynomialError
            When a monomial is not in the template's polynomial.
        """
        unknown = [e for e in polynomial if e not in self.template.polynomial]
        if unknown:
            raise PolynomialError(f"monomials must be those of the template. Received {unknown[0]}.")
        target = polynomial
        if len(self.template.multiplier) != 1 or any(map(any, self.template.multiplier)):
            target = replace(self.template, polynomial={e: Fraction(c) for e, c in polynomial.items()}).target
        size = max((abs(float(c)) for c in target.values()), default=0.0)
        if size == 0 or not self._program.covers(target):
            return 0.0 if size == 0 else float("-inf")
        margin = self._program.margin({e: float(c) / size for e, c in target.items()}, 1e-8)
        self.solver_seconds = self._program.solver_seconds
        return float("nan") if margin is None else margin * size

    def prove(self, polynomial: Mapping[Exponents, Fraction]) -> Answer:
        """Decide one polynomial exactly; see `quakedesign.sos.solve.engine.decide`."""
        return decide(replace(self.template, polynomial=dict(polynomial)))
