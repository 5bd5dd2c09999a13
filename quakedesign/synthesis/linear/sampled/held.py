"""Everything that is decided of a K when p is held over a sampling period."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite
from typing import Any

from quakedesign.bounds import LowerBound, UpperBound
from quakedesign.fault.checks import require_positive
from quakedesign.rationals import rational
from quakedesign.synthesis.linear.plant.problem import LinearProblem
from quakedesign.synthesis.linear.sampled.varying_parameters import (
    LargestVaryingStep,
    VaryingVerdict,
    largest_varying_step,
    varying_verdict,
)
from quakedesign.synthesis.linear.sampled.zero_order_hold import HeldPoles


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldLoop:
    """What is decided of a K when p is held over a sampling period.

    Attributes
    ----------
    runs : VaryingVerdict
        About the law that runs: summed integrals, any course of the parameters.
    longest : LargestVaryingStep or None
        Up to which period that is proved.
    radius : float
        Spectral radius of a period, largest over the vertices, measured.
    """

    runs: VaryingVerdict
    longest: LargestVaryingStep | None
    radius: float

    @property
    def step(self) -> Fraction:
        """T_s [s]."""
        return self.runs.step

    @property
    def largest_step(self) -> LowerBound | None:
        """Every period up to it is proved for the law that runs [s]."""
        return self.longest.proved if self.longest else None

    @property
    def refuted_step(self) -> UpperBound | None:
        """Longer period that constant parameters make unstable [s]; in between it is open."""
        return self.longest.refuted if self.longest else None

    def to_dict(self) -> dict[str, Any]:
        """Plain values, SI; periods that are proved are floats from below."""
        refuted, witness = self.refuted_step, self.runs.witness
        return {
            "step": float(self.step),
            "verdict": str(self.runs.verdict),
            "varying": str(self.runs.verdict),
            "radius": self.radius if isfinite(self.radius) else None,
            "witness": [float(v) for v in witness] if witness else None,
            "largest_step": _number(self.largest_step),
            "refuted_step": _number(refuted),
        }


def _number(bound: LowerBound | UpperBound | None) -> float | None:
    return None if bound is None else float(bound)


def held_loop(problem: LinearProblem, gains: Sequence[Fraction], step: float | str | Fraction) -> HeldLoop:
    """Decide a K at a sampling period [s], and up to which period it holds.

    Parameters
    ----------
    problem : LinearProblem
        In SI.
    gains : sequence of 4 Fraction
    step : number or text
        T_s [s].

    Raises
    ------
    ParameterError
        For a period that is not positive.
    """
    period = rational(step, "step")
    require_positive("Give it in seconds.", step=period)
    longest = largest_varying_step(problem, gains)
    return HeldLoop(
        runs=varying_verdict(problem, gains, period, known=longest),
        longest=longest,
        radius=HeldPoles(problem, gains).radius(period),
    )
