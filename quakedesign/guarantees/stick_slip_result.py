"""Results of `quakedesign.guarantee` on the stick–slip plant: proof, worst case, limits."""

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from quakedesign.errors import ParameterError
from quakedesign.exact import LowerBound, rational
from quakedesign.fault import Fault
from quakedesign.files import Json
from quakedesign.guarantees.exact.limit_theorems import smallest_stick_slip_rate
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.exact.stick_slip_proof import StickSlipProof
from quakedesign.guarantees.result import Guarantee
from quakedesign.guarantees.search.compensated_search import Compensation, design_sticking
from quakedesign.guarantees.search.stick_slip_design import design_stick_slip, worst_stick_slip
from quakedesign.guarantees.search.worst_case import WorstCase
from quakedesign.laws import SlidingMode
from quakedesign.loop.loop_setup import LoopSetup
from quakedesign.plant.of_fault import uncertain_plant
from quakedesign.text import Progress, quantity, silent


@dataclass(frozen=True, kw_only=True)
class StickSlipGuarantee(Guarantee):
    """Guarantee of one loop on the stick–slip plant, or the reason why there is none.

    Attributes
    ----------
    fault : Fault
    proof : StickSlipProof or NoProof
    worst : WorstCase or None
        Worst case found on the same loop (lower bound by falsification); None without a guarantee.
    compensation : Compensation or None
        For a sliding mode: its gains, scale and settings in the scheme ``stick-slip``.
    """

    fault: Fault
    proof: StickSlipProof | NoProof
    worst: WorstCase | None = None
    compensation: Compensation | None = None

    @property
    def least_slip_rate(self) -> LowerBound | None:
        """Performance limit of the slip rate [m/s] at this T_s; None without a guarantee."""
        if not self.proof.available:
            return None
        task = replace(self.proof.task, amplitude=self.proof.disturbance)  # healing does not increase this limit
        return smallest_stick_slip_rate(task, self.proof.sampled_loop.longest)

    def limit_lines(self) -> list[str]:
        """Performance limit at the same T_s, as text; empty if unknown."""
        least = self.least_slip_rate
        if least is None or not self.proof.available:
            return []
        return [
            f"no controller with zero-order hold over T_s = {float(self.proof.sampled_loop.longest):.6g} s keeps the "
            f"slip rate below {least.quantity('m/s')} for all disturbances"
        ]

    def lines(self) -> list[str]:
        """Text for users: the sentence first, then the worst case found and the performance limit."""
        if not self.proof.available:
            return [self.proof.sentence(), "the plant without stick may have a guarantee: use --plant printed"]
        healing = self.proof.covered_healing()
        parts = [
            f"proved: {self.proof.sentence()}",
            f"without a disturbance the same bounds hold if friction at rest is up to {healing:.3g} above friction in "
            "slip",
        ]
        if self.worst is not None:
            ends = [quantity(end or 0.0, "m") for end in (self.worst.slip_behind, self.worst.slip_ahead)]
            rate = quantity(self.worst.peak_slip_rate or 0.0, "m/s")
            parts.append(
                f"worst case found: slip rate {rate}, slip {ends[0]} behind and {ends[1]} ahead of the reference"
            )
        parts += self.limit_lines()
        return parts if self.compensation is None else [*parts, self.compensation.sentence()]

    def to_dict(self) -> Json:
        """Plain values, SI; exact numbers as strings."""
        if not self.proved:
            return super().to_dict()
        worst, least = self.worst, self.least_slip_rate
        seen = worst and {"slip_rate": worst.peak_slip_rate} | {
            name: getattr(worst, name) for name in ("slip_error", "slip_behind", "slip_ahead")
        }
        return {
            **super().to_dict(),
            "worst_found": seen,
            "limit": None if least is None else {"slip_rate": least.exact},
            **({} if self.compensation is None else {"controller": self.compensation.to_dict()}),
        }


TAKEN = frozenset({"step", "slip_noise", "longest_step"})
"""Quantities of a loop setup that the theorem covers."""


def guarantee_stick_slip(
    fault: Fault,
    setup: LoopSetup,
    *,
    objective: str = "tracking",
    sliding: SlidingMode | None = None,
    progress: Progress | None = None,
) -> StickSlipGuarantee:
    """Design a law for the stick–slip plant and prove its bounds.

    Parameters
    ----------
    fault : Fault
        With friction of slip and slip rate alone.
    setup : LoopSetup
        With at most the sampling time, the longest interval and the noise of the slip.
    objective : str
        ``tracking`` or ``peak``.
    sliding : SlidingMode, optional
        Gives the base gains; an e-LQR is designed unless given.
    progress : callable, optional
        Called with the name of the current step and the fraction done [-].

    Raises
    ------
    ParameterError
        For another quantity of the setup.
    """
    if unknown := setup.given().keys() - TAKEN:
        raise ParameterError(
            "a guarantee on the stick-slip plant is proved for an exact slip rate, bounded noise of the slip and a "
            f"pressure without delay. Received {', '.join(sorted(unknown))}. Omit the quantity, or omit plant."
        )
    task = uncertain_plant(fault)
    step = rational(fault.sampling_time) if setup.step is None else Fraction(setup.step)
    progress = progress or silent
    healing = rational(fault.friction.rest_excess)
    options: Any = {"objective": objective, "slip_noise": setup.slip_noise, "healing": healing, "progress": progress}
    options["longest_step"] = setup.longest_step
    if sliding is None:
        return stick_slip_with_worst_case(fault, design_stick_slip(task, step, **options))
    made = design_sticking(task, sliding, step, **options)
    if isinstance(made, NoProof):
        return stick_slip_with_worst_case(fault, made)
    assert isinstance(made.proof, StickSlipProof)
    return stick_slip_with_worst_case(fault, made.proof, made)


def stick_slip_with_worst_case(
    fault: Fault, proof: StickSlipProof | NoProof, compensation: Compensation | None = None
) -> StickSlipGuarantee:
    """A guarantee with the worst case found on its loop."""
    worst = worst_stick_slip(proof) if proof.available else None
    return StickSlipGuarantee(fault=fault, proof=proof, worst=worst, compensation=compensation)
