"""The question of inverse optimality in exact numbers: what a proof and a refutation must satisfy."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from quakedesign.certificates.guarantee.ball_matrices import ball
from quakedesign.rationals import end_of
from quakedesign.synthesis.linear.plant.problem import LinearProblem
from quakedesign.synthesis.linear.plant.rational_matrices import (
    Matrix,
    diagonal,
    lyapunov,
    outer,
    times,
    total,
    trace_of_product,
)

FREE = ((0, 0), (0, 2), (0, 3), (2, 2), (2, 3), (3, 3))
NOTHING = diagonal((Fraction(0),) * 4)


@dataclass(frozen=True, slots=True)
class Question:
    """A, K and the bound in nondimensional numbers; B = (0, 1, 0, 0)ᵀ."""

    inside: LinearProblem
    K: tuple[Fraction, ...]
    printed: tuple[Fraction, Fraction] | None

    def P(self, free: Sequence[Fraction]) -> Matrix:
        """Symmetric matrix with second column K and six free entries."""
        rows = [[Fraction(0)] * 4 for _ in range(4)]
        for i, k in enumerate(self.K):
            rows[i][1] = rows[1][i] = k
        for (i, j), v in zip(FREE, free, strict=True):
            rows[i][j] = rows[j][i] = v
        return tuple(tuple(row) for row in rows)

    def F(self, P: Matrix, D: Matrix) -> Matrix:
        """−(AᵀP + PA) + KᵀK − D."""
        return total(times(-1, lyapunov(self.inside.nominal(), P)), outer(self.K, self.K), times(-1, D))

    @property
    def fixed_bound(self) -> Matrix | None:
        """D, where it is not free: the printed one, or with a g that is zero."""
        g1, g2 = self.printed or self.inside.bounds
        if self.printed is not None:
            return outer((g1, g2, Fraction(0), Fraction(0)), (g1, g2, Fraction(0), Fraction(0)))
        return None if g1 and g2 else diagonal((g1**2, g2**2, Fraction(0), Fraction(0)))

    def covers(self, D: Matrix) -> bool:
        """Whether h² ≤ xᵀDx for every |h| ≤ g1|x1| + g2|x2| (sound), or D is the printed one."""
        if self.fixed_bound is not None:
            return D == self.fixed_bound
        g1, g2 = self.inside.bounds
        return D[0][0] > 0 and D[1][1] > 0 and g1**2 / D[0][0] + g2**2 / D[1][1] <= 1


def moment_matrix(z: Sequence[Fraction]) -> Matrix:
    """Z of four moments, for which tr(Z(AᵀP + PA)) does not depend on the free entries of P."""
    z1, z2, z3, z4 = z
    o = Fraction(0)
    return (z1, o, o, -z3), (o, z2, -z1, o), (o, -z1, z3, o), (-z3, o, o, z4)


def refutes(question: Question, z: Sequence[Fraction]) -> bool:
    """Whether moments prove that no P exists, exactly: Z ≥ 0, not 0, and tr(Z F) ≤ 0 for every admissible D."""
    z1, z2, z3, z4 = z
    if min(z) < 0 or not any(z) or z2 * z3 < z1**2 or z1 * z4 < z3**2:
        return False
    Z = moment_matrix(z)
    D = question.fixed_bound
    value = trace_of_product(Z, question.F(question.P((Fraction(0),) * 6), D or NOTHING))
    if D is not None:
        return value <= 0
    g1, g2 = question.inside.bounds
    root = end_of(ball(z1 * z2).sqrt().lower())
    least = g1**2 * z1 + g2**2 * z2 + 2 * g1 * g2 * max(root, Fraction(0))
    return value - least <= 0  # min of a1z1 + a2z2 over the admissible D is (g1√z1 + g2√z2)²
