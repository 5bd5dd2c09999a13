"""Membership in a cone as a semidefinite programme over functionals, passed to Clarabel directly.

    minimise L(target) + 4y  subject to  L(g_S·b bᵀ) ⪰ 0 for every block, Σ tr L(g_S·b bᵀ) + y = 1, y ≥ 0, L(m·h) = 0.

Its value t is the largest margin up to 4: target = Σ g_S·bᵀ(Z + t·I)b + Σ q·h with the dual Z ⪰ 0. One solution yields
the Gram matrices if t > 0 and a refuting functional if t < 0. There is one unknown per monomial, far fewer than Gram
entries, and between polynomials of one shape only the cost changes.
"""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from time import perf_counter
from typing import Self

import clarabel
import numpy as np
from clarabel import DefaultSolution
from scipy import sparse

from quakedesign.sos.exact.polynomial import Exponents

Array = np.ndarray
Sided = tuple[sparse.csc_matrix, np.ndarray]  # matrix and right-hand side
# upper bounds imposed on the margin in turn; without a bound it is infinite if every polynomial is in the cone
_LARGEST_MARGINS = (4.0, 1e-2, 1e-5)


@dataclass(frozen=True, kw_only=True)
class Shape:
    """One block in floating point: weight g_S and basis."""

    weight: Mapping[Exponents, float]
    basis: tuple[Exponents, ...]  # Monomials m (length n)
    face: np.ndarray | list[list[float]] | None = None  # r × n; the basis is face·m, or m if None

    @property
    def size(self) -> int:
        """Number of rows of the Gram matrix."""
        return len(self.basis) if self.face is None else len(self.face)


@dataclass(frozen=True, kw_only=True)
class MomentSolution:
    """Floating-point solution, without proof."""

    margin: float
    # grams, moments: list of array: Q = Z + t·I and L(g_S·b bᵀ) of every block
    grams: list[np.ndarray]
    moments: list[np.ndarray]
    functional: Mapping[Exponents, float]
    cofactors: Sequence[float] | np.ndarray  # Coefficients of the multiples of the equalities, in order


class MomentProgram:
    """Programme of given blocks, built once and solved for many targets.

    Parameters
    ----------
    blocks : sequence of Shape
    relations : sequence of mapping of exponents to float
        Multiples m·h of the equalities, on which L vanishes.
    """

    def __init__(self, blocks: Sequence[Shape], relations: Sequence[Mapping[Exponents, float]] = ()) -> None:
        self.blocks = tuple(blocks)
        entries = [_entries(b) for b in blocks]
        extra = np.array([e for r in relations for e in r], dtype=np.int64)
        stacked = [e.reshape(-1, e.shape[-1]) for e, _ in entries]
        self.keys, where = _unique([*stacked, extra] if extra.size else stacked)
        self.index = {tuple(e): i for i, e in enumerate(self.keys.tolist())}
        self.localizing = _localizing(self.blocks, entries, where, len(self.keys))
        self.relation_entries = (
            np.array([i for i, r in enumerate(relations) for _ in r], dtype=np.int64),
            np.array([self.index[e] for r in relations for e in r], dtype=np.int64),
            np.array([float(c) for r in relations for c in r.values()]),
        )
        self.relation_count = len(relations)
        self._solver: clarabel.DefaultSolver | None = None
        self._chosen: tuple[float, bool] | None = None
        self.solver_seconds = 0.0

    def alone(self) -> Self:
        """Copy of the programme with its own solver, which shares no mutable state."""
        own = copy(self)
        own._solver = None
        return own

    def covers(self, target: Mapping[Exponents, object]) -> bool:
        """Whether the products and relations contain every monomial of a target."""
        return all(e in self.index for e in target)

    def solve(self, target: Mapping[Exponents, float], accuracy: float = 1e-9) -> MomentSolution | None:
        """Largest margin for a target whose coefficients are about one; None if the solver fails.

        If the solver fails, smaller bounds are tried: without an interior, the largest margin may not be attained.
        """
        answers = (self._answer(target, (accuracy, True), most) for most in _LARGEST_MARGINS)
        return next((self._solution(answer) for answer in answers if answer is not None), None)

    def margin(self, target: Mapping[Exponents, float], accuracy: float) -> float | None:
        """Margin as in `solve`; the first attempt omits iterative refinement, which takes two thirds of the time."""
        quick = self._answer(target, (accuracy, False), _LARGEST_MARGINS[0])
        if quick is not None:
            return -float(quick.z[0])
        solution = self.solve(target, accuracy)
        return None if solution is None else solution.margin

    def _answer(
        self, target: Mapping[Exponents, float], chosen: tuple[float, bool], most: float
    ) -> DefaultSolution | None:
        """Solution of the solver; None if it is not usable."""
        cost = np.append(self.vector(target), most)
        if self._solver is None or self._chosen != chosen:
            slack = [(0, len(self.keys), 1.0), (1 + self.relation_count, len(self.keys), -1.0)]
            A, b = self._matrix(slack, equations=1 + self.relation_count, limits=1)
            cones = [clarabel.ZeroConeT(1 + self.relation_count), clarabel.NonnegativeConeT(1), *self._cones()]
            self._solver = clarabel.DefaultSolver(_zero(len(cost)), cost, A, b, cones, settings(*chosen))
            self._chosen = chosen
        else:
            self._solver.update(q=cost)
        began = perf_counter()
        answer = self._solver.solve()
        self.solver_seconds = perf_counter() - began  # the solver's solve_time includes the set-up of the first solve
        return answer if useful(answer) else None

    def _solution(self, answer: DefaultSolution) -> MomentSolution:
        x, z, s = (np.array(v) for v in (answer.x, answer.z, answer.s))
        count = 1 + self.relation_count
        margin = -z[0]
        grams, moments, start = [], [], count + 1
        for block in self.blocks:
            stop = start + block.size * (block.size + 1) // 2
            grams.append(_full(z[start:stop], block.size) + margin * np.eye(block.size))
            moments.append(_full(s[start:stop], block.size))
            start = stop
        return MomentSolution(
            margin=float(margin),
            grams=grams,
            moments=moments,
            functional=dict(zip(self.index, x.tolist()[:-1], strict=True)),
            cofactors=-z[1:count],
        )

    def _cones(self) -> list[clarabel.PSDTriangleConeT]:
        return [clarabel.PSDTriangleConeT(s.size) for s in self.blocks]

    def _matrix(self, more: Sequence[tuple[int, int, float]], *, equations: int, limits: int) -> Sided:
        """Sparse matrix and right-hand side: trace, relations, further rows, then minus the localizing matrices.

        The unknowns are the values of L and one further scalar; `more` lists further entries (row, column, value).
        """
        rows, columns, values, diagonal = self.localizing
        first = equations + limits
        size = sum(s.size * (s.size + 1) // 2 for s in self.blocks)
        extra = np.array(more, dtype=float).reshape(-1, 3)
        on = _marked(size, diagonal)[rows]
        entries = np.concatenate([values[on], self.relation_entries[2], -values, extra[:, 2]])
        down = np.concatenate([np.zeros(on.sum()), 1 + self.relation_entries[0], rows + first, extra[:, 0]])
        across = np.concatenate([columns[on], self.relation_entries[1], columns, extra[:, 1]])
        b = np.zeros(first + size)
        b[0] = 1.0
        return _by_columns(
            entries, down.astype(np.int64), across.astype(np.int64), (first + size, len(self.keys) + 1)
        ), b

    def interior(self, target: Mapping[Exponents, float], value: float) -> Mapping[Exponents, float] | None:
        """Functional with L(target) = value < 0 that maximises the smallest eigenvalue; None if none is found."""
        cost = self.vector(target)
        count = 1 + self.relation_count
        unit = np.concatenate([_unit_vector(s.size) for s in self.blocks])
        floor = [(1 + count + int(i), len(cost), 1.0) for i in np.flatnonzero(unit)]
        aim = [(count, int(i), float(cost[i])) for i in np.flatnonzero(cost)]
        A, b = self._matrix([*floor, *aim], equations=1 + count, limits=0)
        b[count] = value
        q = np.append(np.zeros(len(cost)), -1.0)
        cones = [clarabel.ZeroConeT(1 + count), *self._cones()]
        solver = clarabel.DefaultSolver(_zero(len(q)), q, A, b, cones, settings(1e-8))
        answer = solver.solve()
        if not useful(answer) or not answer.x[-1] > 0:
            return None
        return dict(zip(self.index, answer.x[:-1], strict=True))

    def triangles(self) -> sparse.csr_array:
        """Sparse map from L to the stacked upper triangles of all localizing matrices, column by column."""
        rows, columns, values, diagonal = self.localizing
        size = sum(s.size * (s.size + 1) // 2 for s in self.blocks)
        plain = np.where(_marked(size, diagonal)[rows], values, values / np.sqrt(2.0))
        return sparse.csr_array((plain, (rows, columns)), shape=(size, len(self.keys)))

    def relations(self) -> sparse.csr_array:
        """Sparse map from L to its values at the multiples of the equalities."""
        rows, columns, values = self.relation_entries
        return sparse.csr_array((values, (rows, columns)), shape=(self.relation_count, len(self.keys)))

    def vector(self, target: Mapping[Exponents, Fraction | float]) -> np.ndarray:
        """Coefficients as floats, in the order of the monomials.

        Raises
        ------
        ValueError
            When a monomial is not in the programme.
        """
        vector = np.zeros(len(self.keys))
        for e, c in target.items():
            if e not in self.index:
                raise ValueError(f"the monomial {e} does not occur in this programme.")
            vector[self.index[e]] = float(c)
        return vector


def useful(answer: DefaultSolution) -> bool:
    """Whether a solution of the solver is usable, which is no verdict on the problem."""
    finite = np.all(np.isfinite(answer.x)) and np.all(np.isfinite(answer.z))
    return str(answer.status) in _USEFUL and bool(finite)


_USEFUL = {"Solved", "AlmostSolved", "InsufficientProgress", "MaxIterations"}


@lru_cache(maxsize=256)
def _zero(size: int) -> sparse.csc_matrix:
    return sparse.csc_matrix((size, size))


def _marked(size: int, places: np.ndarray) -> np.ndarray:
    marks = np.zeros(size, dtype=bool)
    marks[places] = True
    return marks


def _by_columns(entries: Array, rows: Array, columns: Array, shape: tuple[int, int]) -> sparse.csc_matrix:
    """Sparse matrix that sums duplicate entries; for small matrices three times as fast as SciPy."""
    places = columns * shape[0] + rows
    order = np.argsort(places, kind="stable")
    places = places[order]
    starts = np.flatnonzero(np.diff(places, prepend=-1))
    across, down = np.divmod(places[starts], shape[0])
    ends = np.searchsorted(across, np.arange(shape[1] + 1))
    return sparse.csc_matrix((np.add.reduceat(entries[order], starts), down, ends), shape=shape)


def _localizing(
    blocks: Sequence[Shape], entries: list[tuple[Array, Array]], where: Array, width: int
) -> tuple[Array, ...]:
    """Rows, columns and values of all stacked localizing matrices, and the rows of their diagonals."""
    rows, columns, values, diagonal = [], [], [], []
    start = first = 0
    for block, (exponents, factors) in zip(blocks, entries, strict=True):
        terms, pairs = exponents.shape[:2]
        chosen = where[start : start + terms * pairs]
        start += terms * pairs
        numbers = np.tile(np.arange(pairs), terms)
        flat = factors.ravel()
        if block.face is not None:
            whole = sparse.csr_matrix((flat, (numbers, chosen)), shape=(pairs, width))
            moved = (_congruence(block.face) @ whole).tocoo()
            numbers, chosen, flat = moved.row, moved.col, moved.data
        rows.append(numbers + first)
        columns.append(chosen)
        values.append(flat)
        diagonal.append(_diagonal(block.size) + first)
        first += block.size * (block.size + 1) // 2
    parts = (rows, columns, values, diagonal)
    return tuple(np.concatenate(part) if part else np.zeros(0, dtype=np.int64) for part in parts)


def options(accuracy: float) -> dict[str, float]:
    """Tolerances and options of Clarabel, by the names of its settings."""
    exact = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), accuracy)
    return {"presolve_enable": False, "chordal_decomposition_enable": False, "max_iter": 100, **exact}


def settings(accuracy: float, refined: bool = True) -> clarabel.DefaultSettings:
    """Settings of Clarabel with the values of `options`."""
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.iterative_refinement_enable = refined
    for name, value in options(accuracy).items():
        setattr(settings, name, value)
    return settings


def _unique(stacked: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    together = np.concatenate(stacked)
    span = together.max(axis=0).astype(object) + 1
    if int(np.prod(span)) < 2**62:
        radix = np.concatenate([[1], np.cumprod(span[:-1])]).astype(np.int64)
        _, first, where = np.unique(together @ radix, return_index=True, return_inverse=True)
        return together[first], where
    keys, where = np.unique(together, axis=0, return_inverse=True)
    return keys, where.reshape(-1)


@lru_cache(maxsize=256)
def pairs(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the upper triangle, column by column; read-only."""
    columns, rows = np.tril_indices(size)
    rows.flags.writeable = columns.flags.writeable = False
    return rows, columns


def _diagonal(size: int) -> np.ndarray:
    return np.arange(1, size + 1).cumsum() - 1


def _unit_vector(size: int) -> np.ndarray:
    vector = np.zeros(size * (size + 1) // 2)
    vector[_diagonal(size)] = 1.0
    return vector


def _entries(block: Shape) -> tuple[np.ndarray, np.ndarray]:
    """Exponents (terms × pairs × variables) and factors of the scaled upper triangle of L(g·m mᵀ)."""
    basis = np.array(block.basis, dtype=np.int64)
    rows, columns = pairs(len(basis))
    sums = basis[rows] + basis[columns]
    terms = np.array(list(block.weight), dtype=np.int64)
    factors = np.where(rows == columns, 1.0, np.sqrt(2.0))
    values = np.array(list(block.weight.values()), dtype=float)[:, None] * factors[None, :]
    return terms[:, None, :] + sums[None, :, :], values


def _congruence(face: np.ndarray | list[list[float]]) -> sparse.csr_matrix:
    """Sparse map from the scaled triangle of M to that of F M Fᵀ."""
    face = np.asarray(face, dtype=float)
    a, b = pairs(face.shape[0])
    i, j = pairs(face.shape[1])
    whole = face[a][:, i] * face[b][:, j] + face[a][:, j] * face[b][:, i]
    whole *= np.where(a == b, 1.0, np.sqrt(2.0))[:, None] * np.where(i == j, 0.5, 1 / np.sqrt(2.0))[None, :]
    return sparse.csr_matrix(whole)


def _full(triangle: np.ndarray, size: int) -> np.ndarray:
    rows, columns = pairs(size)
    matrix = np.zeros((size, size))
    values = np.where(rows == columns, 1.0, 1 / np.sqrt(2.0)) * triangle
    matrix[rows, columns] = values
    matrix[columns, rows] = values
    return matrix
