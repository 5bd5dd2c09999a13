"""Decision variables that put many polynomials into their cones at once, with the largest common margin.

Primal: maximise t with Σ_j a_j P_j − t·N in the cone of every obligation, |a_j| ≤ 1. It is solved from the other side,

    minimise Σ_j |Σ_o L_o(P_j)|  subject to  Σ_o L_o(N) = 1,  L_o(g_S·b bᵀ) ⪰ 0,  L_o(m·h) = 0,

where the unknowns are as many as monomials and the P_j occur in one row each: a sweep over other P_j changes only
these rows.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from quakedesign.sos.exact.polynomial import Exponents, Polynomial, product
from quakedesign.sos.exact.statement import Statement
from quakedesign.sos.solve.decide import initial_blocks
from quakedesign.sos.solve.faces import modulo
from quakedesign.sos.solve.moment import MomentProgram, settings, useful
from quakedesign.sos.solve.rounding import relations


@dataclass(frozen=True, kw_only=True)
class Demand:
    """One polynomial Σ_j a_j P_j − t·N that must be in a cone.

    Attributes
    ----------
    template : Statement
        Its set, degree and multiplier; the polynomial only says which monomials may occur.
    parts : sequence of Polynomial
        P_j.
    margin : Polynomial
        N.
    """

    template: Statement
    parts: Sequence[Polynomial]
    margin: Polynomial


@dataclass(frozen=True, slots=True)
class Proposal:
    """Floating-point answer of a search; proves nothing.

    Attributes
    ----------
    decision : list of float
        a_j in [−1, 1].
    margin : float
        Largest t; negative or zero when no decision gives one.
    """

    decision: list[float]
    margin: float


class JointProgram:
    """Programme of one structure, built once and solved for many numbers.

    Parameters
    ----------
    demands : sequence of Demand
        All with the same number of parts.
    """

    def __init__(self, demands: Sequence[Demand]) -> None:
        import numpy as np

        self._shapes = [_shape(d.template) for d in demands]
        widths = [len(s.keys) for s in self._shapes]
        self._starts = np.concatenate([[0], np.cumsum(widths)]).astype(int)
        self._count = len(demands[0].parts)
        self._solver: Any = None
        self._entries: Any = None
        self.solver_seconds = 0.0

    def solve(self, demands: Sequence[Demand]) -> Proposal | None:
        """Decision with the largest margin for demands of the same structure; None if the solver fails.

        Raises
        ------
        ValueError
            When a monomial occurs that the structure does not have.
        """
        import clarabel
        import numpy as np
        from scipy import sparse

        A, b, cones = self._matrix(demands)
        total, count = int(self._starts[-1]), self._count
        q = np.concatenate([np.zeros(total), np.ones(2 * count)])
        if self._solver is None or not np.array_equal(A.indices, self._entries):
            zero = sparse.csc_matrix((len(q), len(q)))
            self._solver, self._entries = clarabel.DefaultSolver(zero, q, A, b, cones, settings(1e-8)), A.indices
        else:
            self._solver.update(A=A, b=b)
        answer = self._solver.solve()
        self.solver_seconds = answer.solve_time
        z = np.array(answer.z)
        if not useful(answer):
            return None
        return Proposal((z[1 : 1 + count]).tolist(), float(-z[0]))

    def _matrix(self, demands: Sequence[Demand]):
        """Rows: Σ L(N) = 1; one for every decision; relations; y ≥ 0; localizing matrices."""
        import clarabel
        import numpy as np
        from scipy import sparse

        total, count = int(self._starts[-1]), self._count
        rows: list[Any] = []
        columns: list[Any] = []
        values: list[Any] = []

        def put(r, c, v) -> None:
            rows.append(np.asarray(r, dtype=np.int64))
            columns.append(np.asarray(c, dtype=np.int64))
            values.append(np.asarray(v, dtype=float))

        for shape, start, demand in zip(self._shapes, self._starts, demands, strict=False):
            put(
                np.zeros(len(shape.keys)),
                start + np.arange(len(shape.keys)),
                shape.vector(_times(demand, demand.margin)),
            )
            for j, part in enumerate(demand.parts):
                vector = shape.vector(_times(demand, part))
                put(np.full(len(vector), 1 + j), start + np.arange(len(vector)), vector)
        each = np.arange(count)
        put(1 + each, total + each, -np.ones(count))
        put(1 + each, total + count + each, np.ones(count))
        first = 1 + count
        for shape, start in zip(self._shapes, self._starts, strict=False):
            number, column, value = shape.relation_entries
            put(first + number, start + column, value)
            first += shape.relation_count
        cones = [clarabel.ZeroConeT(first), clarabel.NonnegativeConeT(2 * count)]
        put(first + np.arange(2 * count), total + np.arange(2 * count), -np.ones(2 * count))
        first += 2 * count
        for shape, start in zip(self._shapes, self._starts, strict=False):
            number, column, value, _ = shape.localizing
            put(first + number, start + column, -value)
            for block in shape.blocks:
                cones.append(clarabel.PSDTriangleConeT(block.size))
                first += block.size * (block.size + 1) // 2
        where = (np.concatenate(rows), np.concatenate(columns))
        A = sparse.csc_matrix((np.concatenate(values), where), shape=(first, total + 2 * count))
        b = np.zeros(first)
        b[0] = 1.0
        return A, b, cones


def _shape(template: Statement) -> MomentProgram:
    multiples = [r for _, _, r in relations(template)]
    blocks = modulo(initial_blocks(template), multiples)
    rows = [{e: float(c) for e, c in r.items()} for r in multiples]
    return MomentProgram([b.shape() for b in blocks], rows)


def _times(demand: Demand, part: Polynomial) -> Mapping[Exponents, Any]:
    one = demand.template.multiplier
    if len(one) == 1 and not any(map(any, one)):
        return part
    return product(len(demand.template.variables), (one, part))
