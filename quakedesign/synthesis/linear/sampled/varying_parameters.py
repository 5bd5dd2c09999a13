"""Up to which sampling period the law that runs is proved: summed integrals, parameters that vary as they like.

The integrals are summed over the samples as in the scheme ``explicit``; β, s and w are measurable in time, anywhere in
their ranges over the box, also inside a period.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from quakedesign.bounds import LowerBound, UpperBound
from quakedesign.certificates import Verdict
from quakedesign.rationals import rational
from quakedesign.synthesis.linear.plant.problem import LinearProblem, Vertex
from quakedesign.synthesis.linear.sampled.clock_dependent import DEGREE, ClockProof, clock_proof
from quakedesign.synthesis.linear.sampled.input_delay import DelayProof, delay_proof
from quakedesign.synthesis.linear.sampled.zero_order_hold import HeldPoles

_SHARES = tuple(Fraction(n, 100) for n in (99, 98, 96, 93, 88, 80))
"""Of the limit at the corners, where a V that depends on the clock is tried; degree 8 reaches 98 or 99 %."""
_DEGREES = (DEGREE, 2 * DEGREE)
"""Tried for one period: where the plant alone doubles within it, 8 is too few."""
_TOLERANCE = Fraction(1, 50)
"""Relative width at which the bisection for one V stops."""
HoldProof = DelayProof | ClockProof


@dataclass(frozen=True, slots=True, kw_only=True)
class VaryingVerdict:
    """Verdict on the law that runs at one sampling period.

    Attributes
    ----------
    verdict : Verdict
        REFUTED: not asymptotically stable with the constant parameters of `witness`.
    step : Fraction
        T [s].
    proof : DelayProof, ClockProof or None
    witness : (Fraction, Fraction, Fraction) or None
        β, s [1/s²], w [1/s].
    """

    verdict: Verdict
    step: Fraction
    proof: HoldProof | None = None
    witness: Vertex | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LargestVaryingStep:
    """How long the sampling period of the law that runs may be.

    Attributes
    ----------
    proved : LowerBound
        Every period in (0, proved] is stable [s].
    refuted : UpperBound or None
        A longer one at which some constant parameters of the box are unstable [s]; in between it is open.
    proofs : tuple of DelayProof or ClockProof
        Together about every period up to `proved`.
    """

    proved: LowerBound
    refuted: UpperBound | None
    proofs: tuple[HoldProof, ...]

    def proof_at(self, step: Fraction) -> HoldProof | None:
        """Proof that is about a period [s]."""
        return next((proof for proof in self.proofs if proof.covers(step)), None)


def varying_verdict(
    problem: LinearProblem,
    gains: Sequence[Fraction],
    step: float | str | Fraction,
    *,
    known: LargestVaryingStep | None = None,
) -> VaryingVerdict:
    """Prove the law that runs, or refute it with constant parameters, at a sampling period.

    Parameters
    ----------
    problem : LinearProblem
        In SI.
    gains : sequence of 4 Fraction
    step : number or text
        T [s].
    known : LargestVaryingStep, optional
        What is proved of these gains already.
    """
    period = rational(step, "step")
    witness = HeldPoles(problem, gains).unstable(period)
    if witness is not None:
        return VaryingVerdict(verdict=Verdict.REFUTED, step=period, witness=witness)
    proof: HoldProof | None = known.proof_at(period) if known else delay_proof(problem, gains, period)
    for degree in () if proof else _DEGREES:
        proof = proof or clock_proof(problem, gains, (period, period), degree=degree)
    return VaryingVerdict(verdict=Verdict.PROVED if proof else Verdict.UNDECIDED, step=period, proof=proof)


def largest_varying_step(problem: LinearProblem, gains: Sequence[Fraction]) -> LargestVaryingStep | None:
    """Longest sampling period up to which the law that runs is proved.

    One V for all phases from short periods on, by bisection; then one that depends on the clock, range by range,
    towards the longest one that constant parameters at the corners allow. Periods have four digits.

    Parameters
    ----------
    problem : LinearProblem
        In SI.
    gains : sequence of 4 Fraction

    Returns
    -------
    LargestVaryingStep or None
        None when no range of periods was proved.
    """
    corners = HeldPoles(problem, gains)
    longest, refuted = corners.limit() or (None, None)
    first = _longest_delay(problem, gains, longest) if longest else None
    if longest is None or first is None:
        return None
    proofs: list[HoldProof] = [first]
    while more := _further(problem, gains, proofs[-1].longest, longest):
        proofs.append(more)
    return LargestVaryingStep(
        proved=LowerBound(proofs[-1].longest),
        refuted=_refuted(corners, refuted) if refuted is not None else None,
        proofs=tuple(proofs),
    )


def _longest_delay(problem: LinearProblem, gains: Sequence[Fraction], most: Fraction) -> DelayProof | None:
    low, high, best = Fraction(0), most, None
    while high - low > _TOLERANCE * high and high > most / 1000:
        middle = _short((low + high) / 2)
        proof = delay_proof(problem, gains, middle)
        low, high, best = (middle, high, proof) if proof else (low, middle, best)
    return best


def _further(problem: LinearProblem, gains: Sequence[Fraction], low: Fraction, limit: Fraction) -> ClockProof | None:
    """Proof from a period on, as far towards the limit at the corners as one is found."""
    for share in _SHARES:
        high = _short(share * limit)
        proof = clock_proof(problem, gains, (low, high)) if high > low else None
        if proof is not None:
            return proof
    return None


def _refuted(corners: HeldPoles, step: Fraction) -> UpperBound:
    """A refuted period, with four digits where the next longer one of four digits is refuted too."""
    longer = Fraction(f"{UpperBound(step):.4g}")
    return UpperBound(longer if corners.unstable(longer) else step)


def _short(step: Fraction) -> Fraction:
    """Four digits of a period, not above it."""
    return Fraction(f"{LowerBound(step):.4g}")
