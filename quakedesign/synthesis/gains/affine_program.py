"""Decision variables with fixed parts, their own bounds and linear limits, on top of `JointProgram`."""

from collections.abc import Sequence
from dataclasses import dataclass

from quakedesign.sos import Polynomial
from quakedesign.sos.solve.joint import Demand, JointProgram, Proposal
from quakedesign.sos.solve.moment import settings, useful


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Bounds on the decisions x: |x_j| ≤ radius_j, row·x ≤ bound for every row, and Σ_j share_j|x_j| ≤ 1.

    Attributes
    ----------
    radii : sequence of float
        Without effect on those that have a share.
    rows : sequence of sequence of float
    bounds : sequence of float
    shares : sequence of float
        Of the first decisions, positive; none unless given.
    """

    radii: Sequence[float]
    rows: Sequence[Sequence[float]] = ()
    bounds: Sequence[float] = ()
    shares: Sequence[float] = ()


class AffineProgram(JointProgram):
    """Largest t with C_o + Σ_j x_j P_oj − t·N_o in the cone of every demand o, and x within limits.

    The other side of it, as in `JointProgram`: C adds its value to the cost, and every limit has a multiplier y ≥ 0.
    """

    def largest(self, demands: Sequence[Demand], fixed: Sequence[Polynomial], limits: Limits) -> Proposal | None:
        """Decision with the largest margin; None if the solver fails.

        Parameters
        ----------
        demands : sequence of Demand
        fixed : sequence of Polynomial
            C_o, in the monomials of the demand's template.
        limits : Limits
        """
        import clarabel
        import numpy as np
        from scipy import sparse

        A, b, cones = self._matrix(demands)
        count, shared = self._count, len(limits.shares)
        radii = [*[0.0] * shared, *limits.radii[shared:]]
        cost = [shape.vector(c) for shape, c in zip(self._shapes, fixed, strict=True)]
        beside, below, bounds = self._limiting(limits, A.shape)
        q = np.concatenate([*cost, radii, radii, bounds])
        if len(bounds):
            A = sparse.csc_matrix(sparse.vstack([sparse.hstack([A, beside]), below]))
            b = np.append(b, np.zeros(below.shape[0]))
            cones = [*cones, clarabel.NonnegativeConeT(below.shape[0])]
        quadratic = sparse.csc_matrix((len(q), len(q)))
        answer = clarabel.DefaultSolver(quadratic, q, A, b, cones, settings(1e-8)).solve()
        if not useful(answer):
            return None
        z = np.array(answer.z)
        return Proposal(z[1 : 1 + count].tolist(), float(-z[0]))

    def _limiting(self, limits: Limits, shape: tuple[int, int]):
        """Columns of the multipliers, rows below that bound them, and their costs.

        A multiplier of a row adds it to the equations of the decisions. That of the shares bounds the two multipliers
        of |x_j|, which cost nothing themselves.
        """
        import numpy as np
        from scipy import sparse

        count, shared, rows = self._count, len(limits.shares), len(limits.bounds)
        more = rows + bool(shared)
        beside = sparse.lil_matrix((shape[0], more))
        if rows:
            beside[1 : 1 + count, :rows] = -np.asarray(limits.rows, dtype=float).T
        below = sparse.lil_matrix((more + shared, shape[1] + more))
        below[np.arange(more), shape[1] + np.arange(more)] = -1.0
        each, first = np.arange(shared), shape[1] - 2 * count
        if shared:
            below[more + each, first + each] = 1.0
            below[more + each, first + count + each] = 1.0
            below[more + each, shape[1] + rows] = -np.asarray(limits.shares, dtype=float)
        return beside, below, [*limits.bounds, *[1.0] * bool(shared)]
