"""Whether a given K is optimal for a Q that covers the uncertainty: decided exactly, either way.

K is optimal for some Q ≥ Q0 + R·D if and only if a P exists with PB = R·Kᵀ and

    F(P) = −(AᵀP + PA) + R·KᵀK − R·D − Q0 ≥ 0,

and the loop A − BK is stable; P is then the solution of the Riccati equation with Q = F(P) + R·D + Q0 (Kalman 1964,
J. Basic Eng. 86, 51). Dividing by R leaves one question about K. In the nondimensional states B = (0, 1, 0, 0)ᵀ fixes
the second column of P and leaves six entries free. D = diag(a1, a2, 0, 0) with g1²/a1 + g2²/a2 ≤ 1 for the sound
bound of ERRATA 7, D = GᵀG for the printed one.

The other way round: a matrix Z ≥ 0 for which tr(Z F(P)) does not depend on P has the pattern of the four moments
∫|x1|²ω^{2n}, n = −2 … 1, of a signal (x1, jωx1, x1/jω, −x1/ω²). If tr(Z F) ≤ 0 for all admissible D, no P exists.
Such a Z is a combination of frequencies at which the return difference is too small.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from quakedesign.certificates import Verdict
from quakedesign.rationals import exact_text
from quakedesign.synthesis.linear.analysis.inverse_optimality_problem import Question, refutes
from quakedesign.synthesis.linear.analysis.inverse_optimality_search import bound_of, candidates, near, propose
from quakedesign.synthesis.linear.plant.problem import LinearProblem, Scales
from quakedesign.synthesis.linear.plant.rational_matrices import Matrix, characteristic, definite, hurwitz

_BITS = (30, 60, 120, 200)


@dataclass(frozen=True, slots=True, kw_only=True)
class InverseOptimality:
    """Verdict on a K with its proof, in nondimensional states and pressure.

    Attributes
    ----------
    verdict : Verdict
        PROVED: K is optimal for a Q ≥ Q0 + R·D; REFUTED: for none; UNDECIDED: too close to tell.
    P : Matrix or None
        Solution of the Riccati equation that has K, for R = 1.
    bound : Matrix or None
        D for which it holds.
    Q0 : Matrix or None
        What is left of Q, positive definite.
    moments : tuple of Fraction or None
        z1, z2, z3, z4 of the refuting Z = [[z1, ., ., −z3], [., z2, −z1, .], [., −z1, z3, .], [−z3, ., ., z4]].
    scales : Scales
    reason : str
    """

    verdict: Verdict
    P: Matrix | None = None
    bound: Matrix | None = None
    Q0: Matrix | None = None
    moments: tuple[Fraction, ...] | None = None
    scales: Scales
    reason: str = ""

    @property
    def frequency(self) -> float | None:
        """Mean angular frequency [rad/s] of the refuting signal, √(z2/z1)."""
        if not self.moments or not self.moments[0]:
            return None
        return float(float(self.moments[1] / self.moments[0]) ** 0.5) / float(self.scales.time)

    def to_dict(self) -> dict[str, Any]:
        """Plain values; matrices as texts p/q."""
        return {
            "verdict": str(self.verdict),
            "reason": self.reason,
            "P": [[exact_text(v) for v in row] for row in self.P] if self.P else None,
            "frequency": self.frequency,
        }


def inverse_optimality(
    problem: LinearProblem,
    gains: Sequence[Fraction],
    *,
    printed: Sequence[Fraction] | None = None,
) -> InverseOptimality:
    """Decide whether K is optimal for a Q that covers the uncertainty.

    Parameters
    ----------
    problem : LinearProblem
        In SI.
    gains : sequence of 4 Fraction
        K in SI, exact.
    printed : (Fraction, Fraction), optional
        Row G [Pa/m, Pa·s/m] of the printed test, D = GᵀG; without it the sound bound of the problem.

    Returns
    -------
    InverseOptimality
    """
    scales = problem.scales()
    inside = problem.nondimensional(scales)
    K = scales.gains_inside(gains)
    row = None if printed is None else (printed[0] * scales.slip / scales.pressure,
                                        printed[1] * scales.states[1] / scales.pressure)  # fmt: skip
    question = Question(inside, K, row)
    loop = inside.loop((Fraction(1), -inside.stiffness, inside.damping), K)
    if not hurwitz(characteristic(loop)):
        reason = "the nominal loop is not asymptotically stable (Routh, exact)"
        return InverseOptimality(verdict=Verdict.REFUTED, scales=scales, reason=reason)
    return _proof(question, scales) or _refutation(question, scales) or InverseOptimality(
        verdict=Verdict.UNDECIDED, scales=scales, reason="neither a P nor a refuting signal was found"
    )  # fmt: skip


def _proof(question: Question, scales: Scales) -> InverseOptimality | None:
    proposal = propose(question)
    if proposal is None:
        return None
    entries, split = proposal
    for bits in _BITS:
        P = question.P([near(v, bits) for v in entries])
        D = bound_of(question, split)
        left = question.F(P, D)
        if question.covers(D) and definite(left) and definite(P):
            return InverseOptimality(
                verdict=Verdict.PROVED, P=P, bound=D, Q0=left, scales=scales,
                reason="P, Q0 positive definite, exactly",
            )  # fmt: skip
    return None


def _refutation(question: Question, scales: Scales) -> InverseOptimality | None:
    for z in candidates(question):
        if refutes(question, z):
            return InverseOptimality(
                verdict=Verdict.REFUTED, moments=z, scales=scales,
                reason="a signal at which the return difference does not cover the bound, exactly",
            )  # fmt: skip
    return None
