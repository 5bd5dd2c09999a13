"""Membership in a cone as a semidefinite programme over functionals L, handed to Clarabel without a modelling layer.

    minimise L(target) + 4y  subject to  L(g_S·b bᵀ) ⪰ 0 for every block,  Σ traces + y = 1,  y ≥ 0,  L(m·h) = 0.

Its value t is the largest margin: target = Σ g_S·bᵀ(Z + t·I)b + Σ q·h with the dual Z ⪰ 0. One solve gives the Gram
matrices when t > 0 and a functional that refutes when t < 0. There are as many unknowns as monomials, far fewer than
Gram entries, and between polynomials of one shape only the cost changes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from quakedesign.sos.exact.polynomial import Exponents

SOLVER = "Clarabel"
_LARGEST_MARGIN = 4.0  # keeps the programme bounded where every polynomial is in the cone, as on an empty set


@dataclass(frozen=True, kw_only=True)
class Shape:
    """Numbers of one block: weight g_S and basis, all as floats.

    Attributes
    ----------
    weight : mapping of exponents to float
    basis : tuple of exponents
        Monomials m (length n).
    face : array (r × n), optional
        The basis is face·m; the monomials themselves unless given.
    """

    weight: Mapping[Exponents, float]
    basis: tuple[Exponents, ...]
    face: Any = None

    @property
    def size(self) -> int:
        """Rows of the Gram matrix."""
        return len(self.basis) if self.face is None else len(self.face)


@dataclass(frozen=True, kw_only=True)
class Solution:
    """Floating-point answer; proves nothing.

    Attributes
    ----------
    margin : float
    grams, moments : list of array
        Q = Z + t·I and L(g_S·b bᵀ) of every block.
    functional : mapping of exponents to float
    cofactors : array
        Coefficients of the multiples of the equalities, in the order of their rows.
    """

    margin: float
    grams: list
    moments: list
    functional: Mapping[Exponents, float]
    cofactors: Any


class MomentProgram:
    """Programme of one shape, built once and solved for many targets.

    Parameters
    ----------
    blocks : sequence of Shape
    relations : sequence of mapping of exponents to float
        The multiples m·h on which L vanishes.
    """

    def __init__(self, blocks: Sequence[Shape], relations: Sequence[Mapping[Exponents, float]] = ()) -> None:
        import numpy as np
        from scipy import sparse

        self.blocks = tuple(blocks)
        entries = [_entries(b) for b in blocks]
        extra = np.array([e for r in relations for e in r], dtype=np.int64)
        stacked = [e.reshape(-1, e.shape[-1]) for e, _ in entries]
        self.keys, where = _unique([*stacked, extra] if extra.size else stacked)
        self.index = {tuple(e): i for i, e in enumerate(self.keys.tolist())}
        rows, start = [], 0
        for block, (exponents, values) in zip(blocks, entries, strict=True):
            count = exponents.shape[0] * exponents.shape[1]
            columns = where[start : start + count]
            start += count
            numbers = np.repeat(np.arange(exponents.shape[1])[None, :], exponents.shape[0], axis=0).ravel()
            matrix = sparse.coo_matrix((values.ravel(), (numbers, columns)), shape=(exponents.shape[1], len(self.keys)))
            rows.append(matrix.tocsr() if block.face is None else _congruence(block.face) @ matrix.tocsr())
        self._rows = rows
        self._relations = sparse.csr_matrix(
            (
                [float(c) for r in relations for c in r.values()],
                (
                    [i for i, r in enumerate(relations) for _ in r],
                    [self.index[e] for r in relations for e in r],
                ),
            ),
            shape=(len(relations), len(self.keys)),
        )
        self._trace = np.asarray(
            sum((m[_diagonal(b.size)].sum(axis=0) for m, b in zip(rows, self.blocks, strict=True)), start=0.0)
        ).reshape(1, -1)
        self._solver: Any = None
        self._accuracy = 0.0

    def covers(self, target: Mapping[Exponents, Any]) -> bool:
        """Whether every monomial of a target can be produced at all."""
        return all(e in self.index for e in target)

    def solve(self, target: Mapping[Exponents, float], accuracy: float = 1e-9) -> Solution | None:
        """Largest margin for a target whose coefficients are about one; None if the solver fails."""
        import clarabel
        import numpy as np
        from scipy import sparse

        cost = np.append(self._vector(target), _LARGEST_MARGIN)
        fresh = self._solver is None or self._accuracy != accuracy
        if fresh:
            top = sparse.vstack([sparse.csr_matrix(self._trace), self._relations])
            slack = sparse.csr_matrix(([1.0], ([0], [0])), shape=(top.shape[0], 1))
            last = sparse.csr_matrix(([-1.0], ([0], [len(self.keys)])), shape=(1, len(self.keys) + 1))
            A = sparse.vstack(
                [sparse.hstack([top, slack]), last, sparse.hstack([self._below(), self._column()])]
            ).tocsc()
            b = np.zeros(A.shape[0])
            b[0] = 1.0
            cones = [
                clarabel.ZeroConeT(top.shape[0]),
                clarabel.NonnegativeConeT(1),
                *(clarabel.PSDTriangleConeT(s.size) for s in self.blocks),
            ]
            P = sparse.csc_matrix((len(cost), len(cost)))
            self._solver, self._accuracy = clarabel.DefaultSolver(P, cost, A, b, cones, _settings(accuracy)), accuracy
        else:
            self._solver.update(q=cost)
        answer = self._solver.solve()
        x, z, s = (np.array(v) for v in (answer.x, answer.z, answer.s))
        if str(answer.status) not in _USEFUL or not np.all(np.isfinite(x)) or not np.all(np.isfinite(z)):
            return None
        count = 1 + self._relations.shape[0]
        margin = -z[0]
        grams, moments, start = [], [], count + 1
        for block in self.blocks:
            stop = start + block.size * (block.size + 1) // 2
            grams.append(_full(z[start:stop], block.size) + margin * np.eye(block.size))
            moments.append(_full(s[start:stop], block.size))
            start = stop
        return Solution(
            margin=float(margin),
            grams=grams,
            moments=moments,
            functional=dict(zip(self.index, x.tolist()[:-1], strict=True)),
            cofactors=-z[1:count],
        )

    def _below(self):
        from scipy import sparse

        return sparse.vstack([-m for m in self._rows])

    def _column(self):
        from scipy import sparse

        return sparse.csr_matrix((sum(m.shape[0] for m in self._rows), 1))

    def interior(self, target: Mapping[Exponents, float], value: float) -> Mapping[Exponents, float] | None:
        """Functional with L(target) = value < 0 and the largest smallest eigenvalue; None if none is found."""
        import clarabel
        import numpy as np
        from scipy import sparse

        cost = self._vector(target)
        top = sparse.vstack([sparse.csr_matrix(self._trace), sparse.csr_matrix(cost[None, :]), self._relations])
        unit = np.concatenate([_unit_vector(s.size) for s in self.blocks])
        column = np.concatenate([np.zeros(top.shape[0]), unit])[:, None]
        A = sparse.hstack([sparse.vstack([top, *(-m for m in self._rows)]), sparse.csc_matrix(column)]).tocsc()
        b = np.zeros(A.shape[0])
        b[:2] = 1.0, value
        q = np.zeros(len(cost) + 1)
        q[-1] = -1.0
        cones = [clarabel.ZeroConeT(top.shape[0]), *(clarabel.PSDTriangleConeT(s.size) for s in self.blocks)]
        solver = clarabel.DefaultSolver(sparse.csc_matrix((len(q), len(q))), q, A, b, cones, _settings(1e-8))
        answer = solver.solve()
        if str(answer.status) not in _USEFUL or not answer.x[-1] > 0:
            return None
        return dict(zip(self.index, answer.x[:-1], strict=True))

    def _vector(self, target: Mapping[Exponents, float]):
        import numpy as np

        vector = np.zeros(len(self.keys))
        for e, c in target.items():
            vector[self.index[e]] = float(c)
        return vector


_USEFUL = {"Solved", "AlmostSolved", "InsufficientProgress", "MaxIterations"}


def _settings(accuracy: float):
    import clarabel

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.presolve_enable = False
    settings.chordal_decomposition_enable = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = accuracy
    settings.max_iter = 100
    return settings


def _unique(stacked: list):
    import numpy as np

    together = np.concatenate(stacked)
    span = together.max(axis=0).astype(object) + 1
    if int(np.prod(span)) < 2**62:
        radix = np.concatenate([[1], np.cumprod(span[:-1])]).astype(np.int64)
        _, first, where = np.unique(together @ radix, return_index=True, return_inverse=True)
        return together[first], where
    keys, where = np.unique(together, axis=0, return_inverse=True)
    return keys, where.reshape(-1)


def _pairs(size: int):
    """Rows and columns of the upper triangle, column by column."""
    import numpy as np

    columns, rows = np.tril_indices(size)
    return rows, columns


def _diagonal(size: int):
    import numpy as np

    return np.arange(1, size + 1).cumsum() - 1


def _unit_vector(size: int):
    import numpy as np

    vector = np.zeros(size * (size + 1) // 2)
    vector[_diagonal(size)] = 1.0
    return vector


def _entries(block: Shape):
    """Exponents (terms × pairs × variables) and factors of the scaled upper triangle of L(g·m mᵀ)."""
    import numpy as np

    basis = np.array(block.basis, dtype=np.int64)
    rows, columns = _pairs(len(basis))
    sums = basis[rows] + basis[columns]
    terms = np.array(list(block.weight), dtype=np.int64)
    factors = np.where(rows == columns, 1.0, np.sqrt(2.0))
    values = np.array(list(block.weight.values()), dtype=float)[:, None] * factors[None, :]
    return terms[:, None, :] + sums[None, :, :], values


def _congruence(face):
    """Sparse map from the scaled triangle of M to that of F M Fᵀ."""
    import numpy as np
    from scipy import sparse

    face = np.asarray(face, dtype=float)
    a, b = _pairs(face.shape[0])
    i, j = _pairs(face.shape[1])
    whole = face[a][:, i] * face[b][:, j] + face[a][:, j] * face[b][:, i]
    whole *= np.where(a == b, 1.0, np.sqrt(2.0))[:, None] * np.where(i == j, 0.5, 1 / np.sqrt(2.0))[None, :]
    return sparse.csr_matrix(whole)


def _full(triangle, size: int):
    import numpy as np

    rows, columns = _pairs(size)
    matrix = np.zeros((size, size))
    values = np.where(rows == columns, 1.0, 1 / np.sqrt(2.0)) * triangle
    matrix[rows, columns] = values
    matrix[columns, rows] = values
    return matrix
