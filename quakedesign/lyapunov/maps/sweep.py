"""Sweeps of one law over many gains: one compiled conic programme with parameters.

The module contains the programme in cvxpy; V and −V̇ as functions of gains and ranges; and a central-path method that
bounds the margin from both sides at successive points. A sweep screens in floating point; `prove` makes the result at a
point exact.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import groupby
from math import factorial, prod

import numpy as np
from scipy import sparse
from scipy.linalg import null_space

from quakedesign.errors import CertificateError
from quakedesign.laws import Subject
from quakedesign.lyapunov.exact.certificate import Certificate
from quakedesign.lyapunov.exact.claim import Loop
from quakedesign.lyapunov.exact.obligations import Obligation, statement_of
from quakedesign.lyapunov.search.lyapunov_search import (
    Family,
    balance,
    certificate_from_proposal,
    exponents_of,
    lifted_scale,
    normal,
)
from quakedesign.lyapunov.search.parametric_forms import FormRow, ends_of, rows_of, values_of
from quakedesign.sos.exact.polynomial import monomial
from quakedesign.sos.exact.polynomial_statement import Statement
from quakedesign.sos.solve.conic import Compiled, in_cones
from quakedesign.sos.solve.joint import Proposal, shape_of
from quakedesign.sos.solve.moment import MomentProgram, pairs
from quakedesign.symbolic.term_expressions import signed_monomials
from quakedesign.symbolic.terms import Term

# ----------------------------------------------------------------------
# The programme of a sweep in cvxpy: stated and compiled once, with new numbers at every point.


class Cones:
    """Minimise μ subject to Σ L(N) = 1, Σ L(P_j) = μ·mean(V_j) for every j, and L ≥ 0 on the cone of every row.

    Every row (`FormRow`) has a functional L, a margin form N and forms P_j, which are V_j or −V̇_j. The multipliers of
    the equations are the margin and the coefficients a_j of V.

    Parameters
    ----------
    rows : sequence of FormRow
        Rows of the programme.
    loop : Loop
        Any point of the sweep.
    monomials : sequence of Term
        Monomials V_j.
    scale : tuple of Fraction
        Units of the states, in which the conditions of the rows are expressed.
    """

    def __init__(
        self, rows: Sequence[FormRow], loop: Loop, monomials: Sequence[Term], scale: Sequence[Fraction]
    ) -> None:
        import cvxpy as cp

        shapes = self.shapes = [shape_of(_template(row, loop, scale)) for row in rows]
        starts = np.cumsum([0, *(len(s.keys) for s in shapes)])
        placed = list(zip(rows, shapes, starts, strict=False))
        self.columns = np.array([start + shape.index[e] for row, shape, start in placed for _, e, _, _ in row.parts])
        self.parts = np.array([j for row in rows for j, _, _, _ in row.parts])
        count, size = len(monomials), int(starts[-1])
        places, self.slots = np.unique(self.columns * count + self.parts, return_inverse=True)
        each, ones = np.arange(len(places)), np.ones(len(places))
        chosen = sparse.csr_array((ones, (each, places // count)), shape=(len(places), size))
        summed = sparse.csr_array((ones, (places % count, each)), shape=(count, len(places)))
        self._numbers = cp.Parameter(len(places), name="numbers")
        self._moments, level = cp.Variable(size, name="moments"), cp.Variable(name="level")
        self.margin = np.concatenate([shape.vector(row.margin) for row, shape, _ in placed])
        self.means = np.array(means(monomials, loop.states))
        self._unit = self.margin @ self._moments == 1
        sums = summed @ cp.multiply(self._numbers, chosen @ self._moments)
        self._link = sums - level * self.means == 0
        constraints = [self._unit, self._link, *in_cones(shapes, self._moments)]
        self.compiled = Compiled(cp.Problem(cp.Minimize(level), constraints))

    def table(self, parts: np.ndarray) -> np.ndarray:
        """Coefficients of every moment (row) in ΣL(N) and in every ΣL(P_j) (columns)."""
        count = len(self.means)
        values = np.bincount(self.columns * count + self.parts, parts, minlength=len(self.margin) * count)
        return np.column_stack([self.margin, values.reshape(-1, count)])

    def solve(
        self, parts: np.ndarray, accuracy: float, *, anew: bool = False
    ) -> tuple[float, np.ndarray, np.ndarray] | None:
        """Margin, a_j and L for values of all parts in the order of the rows; None if the solver fails twice."""
        self._numbers.value = np.bincount(self.slots, parts)
        if not self.compiled.solve(accuracy, anew=anew) and not self.compiled.solve(accuracy):
            return None
        return -float(self._unit.dual_value), self._link.dual_value, self._moments.value


def means(monomials: Sequence[Term], weights: Mapping[str, int]) -> list[float]:
    """Mean of every V_j over all cells and Σu_i = 1, relative to that of u^m; 0 if V_j changes sign."""
    means = []
    for term in monomials:
        even = all(kind == "a" for _, _, kind in term.factors)
        powers = exponents_of(term, weights)
        means.append(prod(map(factorial, powers)) / factorial(sum(powers)) if even else 0.0)
    return means


def _template(row: FormRow, loop: Loop, scale: Sequence[Fraction]) -> Statement:
    """Set and monomials of a row, in scaled variables."""
    whole = lifted_scale(row.equalities, scale)
    support = dict.fromkeys([*(e for _, e, _, _ in row.parts), *row.margin], Fraction(1))
    conditions = (tuple(normal(p, whole) for p in group) for group in (row.equalities, row.inequalities))
    return statement_of(Obligation("", support, *conditions), loop.domain)


# ----------------------------------------------------------------------
# One law compiled for many gains: V and −V̇ as functions of gains and ranges, one structure for all points.
#
# V = Σ a_j V_j with the monomials of one degree. At every point the programme is
#
#     maximise t  subject to  V − t·N_m  and  −V̇ − t·N_n  in the cone on every cell and vertex,  mean of V = 1,
#
# so that t is negative beyond the largest disturbance, and its derivatives with respect to gains and bounds follow from
# the multipliers. All numbers are floating point: a sweep screens without proof.

ACCURACY = 1e-10
"""Default tolerance of the solver."""
SURE = 5e-10
"""Margins above this value count as positive; it is close to the accuracy of the solver."""
CLEAR = 1e-6
"""Least margin for a choice that affects many points, such as a degree. The linear-algebra kernels of different
processors change margins near zero by up to 2e-9; with this value, the choice is the same on all processors."""
_TOO_FAR = "the magnitudes of the gains differ too much for a search in floating point."
_MOST_SCALES = 64  # number of scales with cached coefficients


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """Units in which the numbers of a point are of order one."""

    scale: tuple[Fraction, ...]  # Powers of two, u_i = scale_i·ũ_i
    rate_scale: float  # Divisor of −V̇


@dataclass(frozen=True, slots=True, kw_only=True)
class Screened:
    """Floating-point solution at one point, without proof."""

    margin: float  # Largest t
    decision: list[float]  # Coefficients a_j, in the units of the frame
    frame: Frame
    # Derivative of the margin with respect to every parameter of V̇, by the names of `rows_of`
    slopes: Mapping[str, float]

    @property
    def feasible(self) -> bool:
        """Whether the search finds a Lyapunov function of the family."""
        return self.margin > SURE


class Sweep:
    """Screening of one law and one degree of V at many gains and ranges.

    Parameters
    ----------
    loop : Loop
        Any point of the sweep. All points must have ranges of the same kinds (single value, symmetric or general), and
        the same parameters inside nested powers.
    degree : int
        Degree of V.

    Raises
    ------
    CertificateError
        When there are no candidates of this degree, or certificates do not support a part of the law.
    """

    def __init__(self, loop: Loop, degree: int) -> None:
        self.loop, self.degree = loop, degree
        self.monomials = signed_monomials(loop.states, degree, loop.domain)
        self.rows = rows_of(loop, self.monomials) if self.monomials else ()
        if not any(row.rate for row in self.rows):
            raise CertificateError(f"there are no candidate functions V of degree {degree} for {loop.law}.")
        self.products = sorted({names for row in self.rows for _, _, names, _ in row.parts})
        order = {names: i for i, names in enumerate(self.products)}
        parts = [part for row in self.rows for part in row.parts]
        coefficients = [Fraction(c) for *_, c in parts]
        self.parts = np.array([j for j, *_ in parts])
        self.places = np.array([order[names] for _, _, names, _ in parts])
        self.rate = np.array([row.rate for row in self.rows for _ in row.parts])
        self.exponents = _exponents(coefficients)
        self.mantissas = np.array(
            [float(c / Fraction(2) ** int(n)) for c, n in zip(coefficients, self.exponents, strict=True)]
        )
        self.solves = 0
        self.solver_seconds = 0.0
        self._numbers: dict[tuple[Fraction, ...], _Numbers] = {}

    def covers(self, loop: Loop) -> bool:
        """Whether a point has the structure of this sweep."""
        return ends_of(loop) == ends_of(self.loop) and _nested(loop) == _nested(self.loop)

    def frame(self, loop: Loop) -> Frame:
        """Units of one point."""
        scale = balance(loop)
        return Frame(scale=scale, rate_scale=self._in_units(scale).rate_scale(self._features(values_of(loop))))

    def solve(
        self, loop: Loop, frame: Frame | None = None, accuracy: float = ACCURACY, *, anew: bool = False
    ) -> Screened | None:
        """Largest margin at one point; None if the solver fails.

        Parameters
        ----------
        loop : Loop
            Point of the sweep.
        frame : Frame, optional
            Units; by default those of the point. Margins in different units are comparable only in sign.
        accuracy : float
            Tolerance of the solver.
        anew : bool
            Whether to solve anew, so that the result does not depend on earlier solutions (bitwise).

        Raises
        ------
        ValueError
            When the point does not have the structure of the sweep.
        CertificateError
            When the magnitudes of its numbers differ too much for floating point.
        """
        if not self.covers(loop):
            raise ValueError("the loop must have the structure of the sweep. Create another Sweep for this loop.")
        values, units = values_of(loop), frame or self.frame(loop)
        solution = self._in_units(units.scale).solve(self._features(values), units.rate_scale, accuracy, anew=anew)
        self.solves += 1
        if solution is None:
            return None
        margin, decision, per_product, seconds = solution
        self.solver_seconds += seconds
        slopes = self._slopes(values, per_product)
        return Screened(margin=margin, decision=decision, frame=units, slopes=slopes)

    def family(self, frame: Frame) -> Family:
        """Lyapunov functions in the units of a frame."""
        return Family(
            monomials=self.monomials,
            sizes=self._in_units(frame.scale).sizes,
            demands=(),
            rate_scale=Fraction(frame.rate_scale),
            decrease_degree=max(sum(e) for row in self.rows if row.rate for e in row.margin),
        )

    def cones(self, frame: Frame) -> Cones:
        """The programme in the units of a frame."""
        return self._in_units(frame.scale).cones

    def parts_at(self, loop: Loop, frame: Frame) -> np.ndarray:
        """Values of all parts at a point, as required by `Cones`."""
        features = self._features(values_of(loop))
        numbers = self._in_units(frame.scale)
        return np.asarray(numbers.weights(frame.rate_scale) * features[numbers.products])

    def _in_units(self, scale: tuple[Fraction, ...]) -> "_Numbers":
        if scale not in self._numbers:
            free = self._numbers and not any(row.equalities or row.inequalities for row in self.rows)
            cones = next(iter(self._numbers.values())).cones if free else None
            if len(self._numbers) >= _MOST_SCALES:
                self._numbers.pop(next(iter(self._numbers)))
            try:
                self._numbers[scale] = _Numbers(self, scale, cones)
            except OverflowError:
                raise CertificateError(_TOO_FAR) from None
        return self._numbers[scale]

    def _features(self, values: Mapping[str, float]) -> np.ndarray:
        """Value of every product of parameters."""
        return np.array([_product(values, names) for names in self.products])

    def _slopes(self, values: Mapping[str, float], per_product: np.ndarray) -> dict[str, float]:
        """Derivative of the margin with respect to every parameter, from those with respect to the products."""
        slopes = {name: 0.0 for names in self.products for name in names}
        for names, slope in zip(self.products, per_product.tolist(), strict=True):
            for i, name in enumerate(names):
                slopes[name] += slope * _product(values, (*names[:i], *names[i + 1 :]))
        return slopes


def prove(sweep: Sweep, loop: Loop, solution: Screened, subject: Subject | None = None) -> Certificate | None:
    """Certificate of a screened point, checked in exact arithmetic; None without an exact proof."""
    family, proposal = sweep.family(solution.frame), Proposal(solution.decision, solution.margin)
    return certificate_from_proposal(loop, family, proposal, solution.frame.scale, subject)


class _Numbers:
    """Coefficients of a sweep in the units of one scale; without conditions, all scales share one programme."""

    def __init__(self, sweep: Sweep, scale: tuple[Fraction, ...], cones: Cones | None) -> None:
        self.cones = cones or Cones(sweep.rows, sweep.loop, sweep.monomials, scale)
        self.sizes = tuple(monomial(scale, exponents_of(t, sweep.loop.states)) for t in sweep.monomials)
        self.products, self.rate = sweep.places, sweep.rate
        moved = [
            np.array([part[1] for part in row.parts]) @ _exponents(lifted_scale(row.equalities, scale))
            for row in sweep.rows
        ]
        grown = sweep.exponents + np.concatenate(moved) - _exponents(self.sizes)[sweep.parts]
        with np.errstate(over="ignore"):
            self.coefficients = np.ldexp(sweep.mantissas, grown)
        if not np.isfinite(self.coefficients).all():
            raise OverflowError

    def rate_scale(self, features: np.ndarray) -> float:
        """Largest coefficient of all −V̇_j."""
        with np.errstate(over="ignore", invalid="ignore"):
            merged = np.bincount(self.cones.slots[self.rate], (self.coefficients * features[self.products])[self.rate])
        if not np.isfinite(merged).all():
            raise CertificateError(_TOO_FAR)
        return float(np.abs(merged).max(initial=0.0)) or 1.0

    def weights(self, rate_scale: float) -> np.ndarray:
        """Coefficient of the product of parameters in every part."""
        return np.asarray(np.where(self.rate, self.coefficients / rate_scale, self.coefficients))

    def solve(
        self, features: np.ndarray, rate_scale: float, accuracy: float, *, anew: bool
    ) -> tuple[float, list[float], np.ndarray, float] | None:
        """Margin, a_j, derivatives of the margin by product, and solver time [s]; None if the solver fails."""
        weights = self.weights(rate_scale)
        solution = self.cones.solve(weights * features[self.products], accuracy, anew=anew)
        if solution is None:
            return None
        margin, decision, moments = solution
        shares = weights * decision[self.cones.parts] * moments[self.cones.columns]
        per_product = np.bincount(self.products, shares, minlength=len(features))
        return margin, decision.tolist(), per_product, self.cones.compiled.solver_seconds


def _exponents(values: Sequence[Fraction]) -> np.ndarray:
    """Binary exponents n with 2^n within a factor of two of |value|, for any magnitude; exact for powers of two."""
    return np.array([v.numerator.bit_length() - v.denominator.bit_length() for v in values])


def _product(values: Mapping[str, float], names: tuple[str, ...]) -> float:
    product = 1.0
    for name in names:
        product *= values[name]
    return product


def _nested(loop: Loop) -> list[tuple[Fraction, ...]]:
    """Gains and constants inside nested powers, on which the cells depend; zero for terms that vanish."""
    parameters = loop.parameters | {name: loop.parameters[of] for name, (of, _) in loop.roots.items()}
    terms = [term for terms in loop.lifts.values() for term in terms]
    values = [tuple(parameters[name] for name in term.parameters) for term in terms]
    return [v if all(v) else (Fraction(0),) for v in values]


# ----------------------------------------------------------------------
# Feasibility at successive points of a sweep, from two-sided bounds on the margin.
#
# The programme of a sweep (`Cones`) has a centre for every τ > 0, the minimum of μ/τ − Σ log det S over the functionals
# L, with S = L(b bᵀ) of all blocks. Newton's step towards the centre bounds the margin from both sides:
#
# - if S + ΔS ≻ 0, the moved functional satisfies all equations, so that no margin exceeds its μ;
# - if S − ΔS ≻ 0, the multipliers t and a_j of the equations and the Gram matrices Z = τ·S⁻¹(S − ΔS)S⁻¹ satisfy
#   Σ a_j P_j − t·N = Σ bᵀZb, so that the margin t is attained.
#
# Only the sign is needed: the search ends with the first bound that determines it, a few steps from the centre of the
# neighbouring point. All numbers are floating point: a path screens without proof.

_FIRST = 1e-3  # first τ, far larger than margins
_NEAR, _FAR = 0.9, 2.0  # size below which a step ends near a centre; above which its initial point is discarded
_REACH = 1.3  # largest size of a step after a reduction of τ, estimated from above
_APART = 0.3  # largest ratio of τ between cached centres
_MOST = 60  # largest number of steps
_ROUNDS = 5  # largest number of refinements of a step
_ROOM = 10.0  # least ratio of a valid bound to the residual of its equations


@dataclass(frozen=True, slots=True)
class _Centre:
    """Functionals of all kinds of rows, near the centre of one τ."""

    tau: float
    functionals: Sequence[np.ndarray]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Step:
    """Newton's step towards the centre of one τ."""

    tau: float
    # moves, multipliers, bound: ΔL, the multipliers of the equations divided by τ, and μ
    moves: Sequence[np.ndarray]
    multipliers: np.ndarray
    bound: float
    # least, most: Extreme eigenvalues of ΔS relative to S
    least: float
    most: float
    residual: float  # Largest residual of the equations, due to rounding errors

    @property
    def size(self) -> float:
        """Size of the step relative to S; both bounds are valid below 1."""
        return max(-self.least, self.most)

    @property
    def feasible(self) -> bool | None:
        """Whether the margin is above `SURE`; None if the bounds do not decide."""
        if self.most < 1 and -self.tau * self.multipliers[0] > max(SURE, _ROOM * self.residual):
            return True
        return False if self.least > -1 and self.bound < -_ROOM * self.residual else None


class Path:
    """Feasibility at successive points of one sweep, fast for points near each other.

    Parameters
    ----------
    sweep : Sweep
        Sweep of the points.
    frame : Frame
        Units of all points.
    """

    def __init__(self, sweep: Sweep, frame: Frame) -> None:
        self.sweep, self.frame = sweep, frame
        cones = sweep.cones(frame)
        widths = [len(shape.keys) for shape in cones.shapes]
        starts = np.cumsum([0, *widths[:-1]])
        rows = sorted(zip(cones.shapes, starts, strict=True), key=lambda row: _kind(row[0]))
        self._kinds = [_Rows(list(alike)) for _, alike in groupby(rows, key=lambda row: _kind(row[0]))]
        self._means = np.append(0.0, cones.means)
        begun = [kind.interior(cones.margin) / len(rows) for kind in self._kinds]
        self._centres = [_Centre(_FIRST, begun)]

    def begin(self, frame: Frame) -> "Path":
        """Path without cached neighbours, on which results could depend; the frame must have the same scale."""
        self.frame = frame
        del self._centres[1:]
        return self

    def feasible(self, loop: Loop) -> bool | None:
        """Whether there is a Lyapunov function with a margin above `SURE`; None if undecided."""
        table = self.sweep.cones(self.frame).table(self.sweep.parts_at(loop, self.frame))
        tables = [kind.of(table) for kind in self._kinds]
        centre, at_neighbour = self._centres[-1], True
        for _ in range(_MOST):
            try:
                newton = _Newton(self._kinds, tables, self._means, centre)
                step = newton.step()
                if step.feasible is None and step.size < _NEAR:
                    step = newton.further(step)
            except np.linalg.LinAlgError:
                step = None
            if step is not None and step.feasible is not None:
                return step.feasible
            if at_neighbour and len(self._centres) > 1 and (step is None or step.size > _FAR):
                self._centres.pop()
                centre = self._centres[-1]
                continue
            if step is None:
                return None
            centre, at_neighbour = self._moved(centre, step), False
        return None

    def _moved(self, centre: _Centre, step: _Step) -> _Centre:
        """Point after a step, or after 90 % of the way to the boundary; a centred point replaces those of smaller τ."""
        share = min(1.0, 0.9 / step.size)
        moved = _Centre(step.tau, [f + share * d for f, d in zip(centre.functionals, step.moves, strict=True)])
        if step.size < _NEAR:
            later = [one for one in self._centres[1:] if one.tau > step.tau]
            if len(later) > 1 and later[-2].tau * _APART < step.tau:
                later.pop()
            self._centres[1:] = [*later, moved]
        return moved


class _Newton:
    """Newton's equations at one point: H·ΔL + Cλ = a, Σ CᵀΔL − Δμ·means = b, meansᵀλ = c.

    Parameters
    ----------
    tables : sequence of array
        Coefficients C of every kind of rows.

    Raises
    ------
    LinAlgError
        When a functional is not inside its cone.
    """

    def __init__(
        self, kinds: "Sequence[_Rows]", tables: Sequence[np.ndarray], means: np.ndarray, centre: _Centre
    ) -> None:
        self._kinds, self._tables, self._means, self._centre = kinds, tables, means, centre
        self._forms = [kind.relative_to(f) for kind, f in zip(kinds, centre.functionals, strict=True)]
        self._squares = [one @ one.transpose(0, 2, 1) for one in self._forms]
        slopes = [one @ kind.unit for kind, one in zip(kinds, self._forms, strict=True)]
        sides = [np.dstack(pair) for pair in zip(tables, slopes, strict=True)]
        solved = [np.linalg.solve(*pair) for pair in zip(self._squares, sides, strict=True)]
        self._solved, self._free = [one[..., :-1] for one in solved], [one[..., -1] for one in solved]
        self._system = np.zeros((len(means) + 1, len(means) + 1))
        self._system[:-1, :-1] = sum(map(_sum, tables, self._solved))
        self._system[:-1, -1] = self._system[-1, :-1] = means

    def _solve(
        self, free: Sequence[np.ndarray], rest: np.ndarray, slope: float
    ) -> tuple[list[np.ndarray], np.ndarray, float]:
        """Solution ΔL, λ and Δμ, from H⁻¹a."""
        side = np.append(sum(map(_sum, self._tables, free)) - rest, slope)
        solution = np.linalg.solve(self._system, side)
        moves = [one - solved @ solution[:-1] for one, solved in zip(free, self._solved, strict=True)]
        return moves, solution[:-1], float(solution[-1])

    def _changes(self, moves: Sequence[np.ndarray]) -> list[np.ndarray]:
        """ΔS relative to S, as triangles of F⁻¹ΔS F⁻ᵀ with F Fᵀ = S."""
        return [(move[:, None] @ one)[:, 0] for move, one in zip(moves, self._forms, strict=True)]

    def _ends(self, changes: Sequence[np.ndarray]) -> tuple[float, float]:
        ends = [end for kind, change in zip(self._kinds, changes, strict=True) for end in kind.ends(change)]
        return min(ends), max(ends)

    def step(self) -> _Step:
        """Newton's step towards the centre for the τ of the point."""
        rest = self._rest(self._centre.functionals, 0.0)
        return self._refined(self._centre.tau, *self._solve(self._free, rest, 1 / self._centre.tau))

    def further(self, step: _Step) -> _Step:
        """Step of limited size towards the centre for a smaller τ, from the step for the τ of the point."""
        moves, multipliers, bound = self._solve([0.0 * one for one in step.moves], 0.0 * self._means, 1.0)
        more = (_REACH - step.size) / max(map(_longest, self._kinds, self._changes(moves)))
        return self._refined(
            1 / (1 / step.tau + more),
            [one + more * other for one, other in zip(step.moves, moves, strict=True)],
            step.multipliers + more * multipliers,
            step.bound + more * bound,
        )

    def _rest(self, functionals: Sequence[np.ndarray], bound: float) -> np.ndarray:
        """Residual of the equations of the functionals."""
        rest = bound * self._means - sum(map(_sum, self._tables, functionals))
        rest[0] += 1.0
        return rest

    def _refined(self, tau: float, moves: Sequence[np.ndarray], multipliers: np.ndarray, bound: float) -> _Step:
        """Step refined until the residual of its equations is small against its bounds."""
        for _ in range(_ROUNDS):
            changes = self._changes(moves)
            gradients = [
                (one @ (kind.unit - change)[..., None])[..., 0] - table @ multipliers
                for kind, one, change, table in zip(self._kinds, self._forms, changes, self._tables, strict=True)
            ]
            rest = self._rest([f + d for f, d in zip(self._centre.functionals, moves, strict=True)], bound)
            residual = max(np.abs(rest).max(), tau * max(np.abs(one).max() for one in gradients))
            if residual * _ROOM < min(abs(bound), tau * abs(multipliers[0])):
                break
            free = [np.linalg.solve(h, one[..., None])[..., 0] for h, one in zip(self._squares, gradients, strict=True)]
            more, further, higher = self._solve(free, rest, 1 / tau - self._means @ multipliers)
            moves = [move + one for move, one in zip(moves, more, strict=True)]
            multipliers, bound = multipliers + further, bound + higher
        least, most = self._ends(changes)
        return _Step(
            tau=tau, moves=moves, multipliers=multipliers, bound=bound, least=least, most=most, residual=float(residual)
        )


def _kind(shape: MomentProgram) -> tuple[int | tuple[int, ...], ...]:
    return len(shape.keys), shape.relation_count, tuple(block.size for block in shape.blocks)


def _sum(tables: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Sum over rows and unknowns."""
    return np.tensordot(tables, vectors, axes=((0, 1), (0, 1)))


class _Rows:
    """Rows whose programmes have equal shapes, in coordinates that satisfy the relations.

    Parameters
    ----------
    rows : sequence of (MomentProgram, int)
        Shapes, and the index of their first moment among all moments.
    """

    def __init__(self, rows: Sequence[tuple[MomentProgram, int]]) -> None:
        self._shapes = [shape for shape, _ in rows]
        shape = self._shapes[0]
        self._places = np.array([start + np.arange(len(shape.keys)) for _, start in rows])
        self._bases = np.array(
            [
                (null_space(one.relations().toarray()) if one.relation_count else np.eye(len(one.keys)))
                for one in self._shapes
            ]
        )
        sizes = np.array([block.size for block in shape.blocks])
        ends = np.cumsum(sizes * (sizes + 1) // 2)
        triangles = [one.triangles() @ basis for one, basis in zip(self._shapes, self._bases, strict=True)]
        self._blocks = [
            np.array([[_matrices(t[end - s * (s + 1) // 2 : end], s) for end in ends[sizes == s]] for t in triangles])
            for s in np.unique(sizes).tolist()
        ]
        self._corners = [_corners(block.shape[2]) for block in self._blocks]
        counts = [block.shape[1] for block in self._blocks]
        units = [
            one for (i, j, _), count in zip(self._corners, counts, strict=True) for one in [(i == j) * 1.0] * count
        ]
        self.unit = np.concatenate(units)
        self.firsts = np.cumsum([0, *map(len, units[:-1])])

    def of(self, table: np.ndarray) -> np.ndarray:
        """Coefficients of all moments in the equations, in the coordinates of every row."""
        return np.asarray(self._bases.transpose(0, 2, 1) @ table[self._places])

    def interior(self, margin: np.ndarray) -> np.ndarray:
        """Functional in the interior of the cone of every row, with L(N) = 1."""
        centres = (one.alone().solve({}) for one in self._shapes)
        nothing = np.full(self._places.shape[1], np.nan)  # outside of every cone
        values = np.array([nothing if c is None else list(c.functional.values()) for c in centres])
        sized = values / (values * margin[self._places]).sum(axis=1)[:, None]
        return np.asarray((self._bases.transpose(0, 2, 1) @ sized[..., None])[..., 0])

    def relative_to(self, functional: np.ndarray) -> np.ndarray:
        """F⁻¹ S_i F⁻ᵀ of all unknowns i, with F Fᵀ = S = Σ_i L_i S_i: scaled triangles (rows × unknowns × ·)."""
        blocks = []
        for block, (upper, lower, factors) in zip(self._blocks, self._corners, strict=True):
            rows, count, size, unknowns = block.shape[:4]
            whole = (block.transpose(0, 1, 2, 4, 3) @ functional[:, None, None, :, None])[..., 0]
            inverse = np.linalg.inv(np.linalg.cholesky(whole))
            half = (inverse @ block.reshape(rows, count, size, -1)).reshape(block.shape).transpose(0, 1, 4, 3, 2)
            both = (inverse @ half.reshape(rows, count, size, -1)).reshape(block.shape)
            triangles = both.transpose(0, 3, 1, 2, 4)[..., upper, lower] * factors
            blocks.append(triangles.reshape(rows, unknowns, -1))
        return np.concatenate(blocks, axis=2)

    def ends(self, triangles: np.ndarray) -> tuple[float, float]:
        """Smallest and largest eigenvalue of all matrices."""
        eigenvalues, start = [], 0
        for block, (upper, lower, factors) in zip(self._blocks, self._corners, strict=True):
            rows, count, size = block.shape[:3]
            stop = start + count * len(upper)
            full = np.empty((rows, count, size, size))
            full[..., lower, upper] = triangles[:, start:stop].reshape(rows, count, -1) / factors
            eigenvalues.append(np.linalg.eigvalsh(full))
            start = stop
        return min(float(np.min(e)) for e in eigenvalues), max(float(np.max(e)) for e in eigenvalues)


def _longest(kind: _Rows, triangles: np.ndarray) -> float:
    """Largest Frobenius norm of the matrices, an upper bound on their eigenvalues."""
    return float(np.sqrt(np.add.reduceat(triangles**2, kind.firsts, axis=1).max()))


def _corners(size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows and columns of an upper triangle, and factors that make its norm equal that of the matrix."""
    rows, columns = pairs(size)
    return rows, columns, np.where(rows == columns, 1.0, np.sqrt(2.0))


def _matrices(triangle: np.ndarray, size: int) -> np.ndarray:
    """Symmetric matrices (size × unknowns × size) from their upper triangles, column by column."""
    rows, columns = pairs(size)
    full = np.zeros((size, triangle.shape[1], size))
    full[rows, :, columns] = full[columns, :, rows] = triangle
    return full
