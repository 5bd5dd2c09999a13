"""Whether Lyapunov functions are found, followed from one point of a sweep to the next by bounds of their margin.

The programme of a sweep (`parametric_cones`) has a centre for every τ > 0, where μ/τ − Σ log det S is least over the
functionals L, with S = L(b bᵀ) of all blocks. Newton's step towards it bounds the margin from both sides:

- where S + ΔS ≻ 0, the moved functional satisfies all equations, so that no margin is above its μ;
- where S − ΔS ≻ 0, the multipliers t and a_j of the equations and the Gram matrices Z = τ·S⁻¹(S − ΔS)S⁻¹ satisfy
  Σ a_j P_j − t·N = Σ bᵀZb, so that the margin t is reached.

Only the sign is asked for: the first bound that has one ends the search, some steps after the neighbour's centre. All
numbers are floating point: a path screens, it proves nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
from scipy.linalg import null_space

from quakedesign.certificates import Loop
from quakedesign.sos.solve.moment import MomentProgram, pairs
from quakedesign.synthesis.analysis.parametric_program import SURE, Frame, Sweep

_FIRST = 1e-3  # τ, margins being far smaller
_NEAR, _FAR = 0.9, 2.0  # sizes of a step that ends near a centre, and of one from a place that is of no use
_REACH = 1.3  # size that a smaller τ may give a step, estimated from above
_APART = 0.3  # ratio of τ of centres that are kept
_MOST = 60
_ROUNDS = 5
_ROOM = 10.0  # a bound counts where it is that many times what its equations are missed by


@dataclass(frozen=True, slots=True)
class _Place:
    """Functionals of all kinds of rows, about the centre of one τ."""

    tau: float
    functionals: Sequence[Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Step:
    """Newton's step towards the centre of one τ.

    Attributes
    ----------
    tau : float
    moves, multipliers, bound
        ΔL, those of the equations over τ, and μ.
    least, most : float
        Eigenvalues of ΔS beside S.
    missed : float
        By how much the equations are missed at most, for rounding errors.
    """

    tau: float
    moves: Sequence[Any]
    multipliers: Any
    bound: float
    least: float
    most: float
    missed: float

    @property
    def size(self) -> float:
        """Below one where both bounds hold."""
        return max(-self.least, self.most)

    @property
    def found(self) -> bool | None:
        """Whether the margin is above `SURE`; None where the bounds do not tell."""
        if self.most < 1 and -self.tau * self.multipliers[0] > max(SURE, _ROOM * self.missed):
            return True
        return False if self.least > -1 and self.bound < -_ROOM * self.missed else None


class Path:
    """Answers at points of one sweep after each other, quick where they are near each other.

    Parameters
    ----------
    sweep : Sweep
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
        self._places = [_Place(_FIRST, begun)]

    def begin(self, frame: Frame) -> "Path":
        """Forget all neighbours, so that no answer depends on them; units of the same scale."""
        self.frame = frame
        del self._places[1:]
        return self

    def found(self, loop: Loop) -> bool | None:
        """Whether there is a Lyapunov function with a margin above `SURE`; None where that was not decided."""
        table = self.sweep.cones(self.frame).table(self.sweep.parts_at(loop, self.frame))
        tables = [kind.of(table) for kind in self._kinds]
        place, at_neighbour = self._places[-1], True
        for _ in range(_MOST):
            try:
                newton = _Newton(self._kinds, tables, self._means, place)
                step = newton.step()
                if step.found is None and step.size < _NEAR:
                    step = newton.further(step)
            except np.linalg.LinAlgError:
                step = None
            if step is not None and step.found is not None:
                return step.found
            if at_neighbour and len(self._places) > 1 and (step is None or step.size > _FAR):
                self._places.pop()
                place = self._places[-1]
                continue
            if step is None:
                return None
            place, at_neighbour = self._moved(place, step), False
        return None

    def _moved(self, place: _Place, step: _Step) -> _Place:
        """Where a step leads, or nine tenths of the way to the border; kept in the place of smaller τ if centred."""
        share = min(1.0, 0.9 / step.size)
        moved = _Place(step.tau, [f + share * d for f, d in zip(place.functionals, step.moves, strict=True)])
        if step.size < _NEAR:
            known = [one for one in self._places[1:] if one.tau > step.tau]
            if len(known) > 1 and known[-2].tau * _APART < step.tau:
                known.pop()
            self._places[1:] = [*known, moved]
        return moved


class _Newton:
    """Newton's equations at one place: H·ΔL + Cλ = a, Σ CᵀΔL − Δμ·means = b, meansᵀλ = c.

    Parameters
    ----------
    kinds : sequence of _Rows
    tables : sequence of array
        C, of every kind of rows.
    means : array
    place : _Place

    Raises
    ------
    LinAlgError
        Where a functional is not inside its cone.
    """

    def __init__(self, kinds: "Sequence[_Rows]", tables: Sequence[Any], means: Any, place: _Place) -> None:
        self._kinds, self._tables, self._means, self._place = kinds, tables, means, place
        self._forms = [kind.beside(f) for kind, f in zip(kinds, place.functionals, strict=True)]
        self._squares = [one @ one.transpose(0, 2, 1) for one in self._forms]
        slopes = [one @ kind.unit for kind, one in zip(kinds, self._forms, strict=True)]
        sides = [np.dstack(pair) for pair in zip(tables, slopes, strict=True)]
        solved = [np.linalg.solve(*pair) for pair in zip(self._squares, sides, strict=True)]
        self._solved, self._free = [one[..., :-1] for one in solved], [one[..., -1] for one in solved]
        self._system = np.zeros((len(means) + 1, len(means) + 1))
        self._system[:-1, :-1] = sum(map(_sum, tables, self._solved))
        self._system[:-1, -1] = self._system[-1, :-1] = means

    def _solve(self, free: Sequence[Any], rest: Any, slope: float) -> tuple[list[Any], Any, float]:
        """ΔL, λ and Δμ, from H⁻¹a."""
        side = np.append(sum(map(_sum, self._tables, free)) - rest, slope)
        answer = np.linalg.solve(self._system, side)
        moves = [one - solved @ answer[:-1] for one, solved in zip(free, self._solved, strict=True)]
        return moves, answer[:-1], float(answer[-1])

    def _changes(self, moves: Sequence[Any]) -> list[Any]:
        """ΔS beside S."""
        return [(move[:, None] @ one)[:, 0] for move, one in zip(moves, self._forms, strict=True)]

    def _ends(self, changes: Sequence[Any]) -> tuple[float, float]:
        ends = [end for kind, change in zip(self._kinds, changes, strict=True) for end in kind.ends(change)]
        return min(ends), max(ends)

    def step(self) -> _Step:
        """Step towards the centre of the τ of the place."""
        rest = self._rest(self._place.functionals, 0.0)
        return self._refined(self._place.tau, *self._solve(self._free, rest, 1 / self._place.tau))

    def further(self, step: _Step) -> _Step:
        """Step towards the centre of a smaller τ that is small enough, from one for the τ of the place."""
        moves, multipliers, bound = self._solve([0.0 * one for one in step.moves], 0.0 * self._means, 1.0)
        more = (_REACH - step.size) / max(map(_longest, self._kinds, self._changes(moves)))
        return self._refined(
            1 / (1 / step.tau + more),
            [one + more * other for one, other in zip(step.moves, moves, strict=True)],
            step.multipliers + more * multipliers,
            step.bound + more * bound,
        )

    def _rest(self, functionals: Sequence[Any], bound: float) -> Any:
        """By how much the equations of the functionals are missed."""
        rest = bound * self._means - sum(map(_sum, self._tables, functionals))
        rest[0] += 1.0
        return rest

    def _refined(self, tau: float, moves: Sequence[Any], multipliers: Any, bound: float) -> _Step:
        """Step whose equations hold as well as its bounds need."""
        for _ in range(_ROUNDS):
            changes = self._changes(moves)
            falls = [
                (one @ (kind.unit - change)[..., None])[..., 0] - table @ multipliers
                for kind, one, change, table in zip(self._kinds, self._forms, changes, self._tables, strict=True)
            ]
            rest = self._rest([f + d for f, d in zip(self._place.functionals, moves, strict=True)], bound)
            missed = max(np.abs(rest).max(), tau * max(np.abs(fall).max() for fall in falls))
            if missed * _ROOM < min(abs(bound), tau * abs(multipliers[0])):
                break
            free = [np.linalg.solve(h, fall[..., None])[..., 0] for h, fall in zip(self._squares, falls, strict=True)]
            more, further, higher = self._solve(free, rest, 1 / tau - self._means @ multipliers)
            moves = [move + one for move, one in zip(moves, more, strict=True)]
            multipliers, bound = multipliers + further, bound + higher
        least, most = self._ends(changes)
        return _Step(
            tau=tau, moves=moves, multipliers=multipliers, bound=bound, least=least, most=most, missed=float(missed)
        )


def _kind(shape: MomentProgram) -> tuple[Any, ...]:
    return len(shape.keys), shape.relation_count, tuple(block.size for block in shape.blocks)


def _sum(tables: Any, vectors: Any) -> Any:
    """Σ over rows and unknowns."""
    return np.tensordot(tables, vectors, axes=((0, 1), (0, 1)))


class _Rows:
    """Rows whose programmes have one shape, in coordinates in which the relations hold.

    Parameters
    ----------
    rows : sequence of (MomentProgram, int)
        Shapes, and where their moments begin among those of all.
    """

    def __init__(self, rows: Sequence[tuple[MomentProgram, int]]) -> None:
        self._shapes = [shape for shape, _ in rows]
        shape = self._shapes[0]
        self._places = np.array([start + np.arange(len(shape.keys)) for _, start in rows])
        self._bases = np.array([_solutions(one) for one in self._shapes])
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

    def of(self, table: Any) -> Any:
        """What all moments are multiplied by in the equations, in the coordinates of every row."""
        return self._bases.transpose(0, 2, 1) @ table[self._places]

    def interior(self, margin: Any) -> Any:
        """Functional of every row inside its cone, with L(N) = 1."""
        centres = (one.alone().solve({}) for one in self._shapes)
        nothing = np.full(self._places.shape[1], np.nan)  # outside of every cone
        values = np.array([nothing if c is None else list(c.functional.values()) for c in centres])
        sized = values / (values * margin[self._places]).sum(axis=1)[:, None]
        return (self._bases.transpose(0, 2, 1) @ sized[..., None])[..., 0]

    def beside(self, functional: Any) -> Any:
        """F⁻¹ S_i F⁻ᵀ of all unknowns i, with F Fᵀ = S = Σ_i L_i S_i: scaled triangles (rows × unknowns × ·)."""
        found = []
        for block, (upper, lower, factors) in zip(self._blocks, self._corners, strict=True):
            rows, count, size, unknowns = block.shape[:4]
            whole = (block.transpose(0, 1, 2, 4, 3) @ functional[:, None, None, :, None])[..., 0]
            inverse = np.linalg.inv(np.linalg.cholesky(whole))
            half = (inverse @ block.reshape(rows, count, size, -1)).reshape(block.shape).transpose(0, 1, 4, 3, 2)
            both = (inverse @ half.reshape(rows, count, size, -1)).reshape(block.shape)
            triangles = both.transpose(0, 3, 1, 2, 4)[..., upper, lower] * factors
            found.append(triangles.reshape(rows, unknowns, -1))
        return np.concatenate(found, axis=2)

    def ends(self, triangles: Any) -> tuple[float, float]:
        """Smallest and largest eigenvalue of all matrices."""
        found, start = [], 0
        for block, (upper, lower, factors) in zip(self._blocks, self._corners, strict=True):
            rows, count, size = block.shape[:3]
            stop = start + count * len(upper)
            full = np.empty((rows, count, size, size))
            full[..., lower, upper] = triangles[:, start:stop].reshape(rows, count, -1) / factors
            found.append(np.linalg.eigvalsh(full))
            start = stop
        return min(float(np.min(e)) for e in found), max(float(np.max(e)) for e in found)


def _longest(kind: _Rows, triangles: Any) -> float:
    """Largest norm of a matrix, at least its largest eigenvalue."""
    return float(np.sqrt(np.add.reduceat(triangles**2, kind.firsts, axis=1).max()))


def _corners(size: int) -> tuple[Any, Any, Any]:
    """Rows and columns of an upper triangle, and what makes its length that of the matrix."""
    rows, columns = pairs(size)
    return rows, columns, np.where(rows == columns, 1.0, np.sqrt(2.0))


def _solutions(shape: MomentProgram) -> Any:
    """Basis of the functionals that vanish on the relations, orthonormal."""
    return null_space(shape.relations().toarray()) if shape.relation_count else np.eye(len(shape.keys))


def _matrices(triangle: Any, size: int) -> Any:
    """Matrices (size × unknowns × size) with an upper triangle, column by column."""
    rows, columns = pairs(size)
    full = np.zeros((size, triangle.shape[1], size))
    full[rows, :, columns] = full[columns, :, rows] = triangle
    return full
