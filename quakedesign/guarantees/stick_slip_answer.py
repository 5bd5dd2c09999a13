"""Result of a guarantee on the stick–slip plant, with the worst case that a search finds."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from quakedesign.errors import ParameterError
from quakedesign.exact import LowerBound, rational
from quakedesign.fault import Fault
from quakedesign.guarantees.exact.limit_theorems import smallest_stick_slip_rate
from quakedesign.guarantees.exact.small_gain import NoProof
from quakedesign.guarantees.exact.stick_slip_guarantee import StickSlipProof
from quakedesign.guarantees.loop_result import Guarantee
from quakedesign.guarantees.search.compensated_search import Compensation, design_sticking
from quakedesign.guarantees.search.stick_slip_design import WorstStickSlip, design_stick_slip, worst_stick_slip
from quakedesign.laws import SlidingMode
from quakedesign.laws.stick_slip_law import GAIN_UNITS
from quakedesign.loop.loop_setup import LoopSetup
from quakedesign.plant.of_fault import uncertain_plant
from quakedesign.text import quantity


@dataclass(frozen=True, slots=True, kw_only=True)
class StickSlipGuarantee(Guarantee):
    """Guarantee of one loop on the stick–slip plant, or why there is none.

    Attributes
    ----------
    fault : Fault
    proof : StickSlipProof or NoProof
    worst : WorstStickSlip or None
        Largest values that a search reaches on the same loop: lower bounds of the worst case; None without a guarantee.
    compensation : Compensation or None
        Of a sliding mode: its gains, scale and settings in the scheme ``stick-slip``.
    """

    fault: Fault
    proof: StickSlipProof | NoProof
    worst: WorstStickSlip | None = None
    compensation: Compensation | None = None

    @property
    def least_slip_rate(self) -> LowerBound | None:
        """Slip rate [m/s] that the fault reaches at this T_s under every controller; None without a guarantee."""
        if not self.proof.proved:
            return None
        task = replace(self.proof.task, amplitude=self.proof.disturbance)  # which healing does not enlarge
        return smallest_stick_slip_rate(task, self.proof.held.longest)

    def limit_lines(self) -> list[str]:
        """Performance limit at the same T_s, as text; empty if unknown."""
        least = self.least_slip_rate
        if least is None or not self.proof.proved:
            return []
        return [
            f"no controller with zero-order hold over T_s = {float(self.proof.held.longest):.6g} s keeps the slip rate "
            f"below {least.quantity('m/s')} for all disturbances"
        ]

    def lines(self) -> list[str]:
        """For people: the sentence first, then the worst case found and the performance limit."""
        if not self.proof.proved:
            return [self.proof.sentence(), "the plant without stick may have a guarantee: use --plant printed"]
        healing = self.proof.covered_healing()
        parts = [
            f"proved: {self.proof.sentence()}",
            f"without a disturbance the same bounds hold if friction at rest is up to {healing:.3g} above friction in "
            "slip",
        ]
        if self.worst is not None:
            parts.append(
                f"worst case found: slip rate {quantity(self.worst.peak_slip_rate, 'm/s')}, slip "
                f"{quantity(self.worst.slip_behind, 'm')} behind and {quantity(self.worst.slip_ahead, 'm')} ahead of "
                "the reference"
            )
        parts += self.limit_lines()
        return parts if self.compensation is None else [*parts, self.compensation.sentence()]

    def to_dict(self) -> dict[str, Any]:
        """Plain values, SI; exact numbers as texts."""
        if not self.proof.proved:
            return {"verdict": "undecided", "sentence": self.proof.sentence(), "reason": self.proof.reason}
        worst, law = self.worst, self.proof.held.law
        return {
            "verdict": "proved",
            "sentence": self.proof.sentence(),
            "plant": self.proof.plant,
            "slip_error": self.proof.claims.slip_error.exact,
            **self.proof.claims.to_dict(),
            "covered_healing": float(self.proof.covered_healing()),
            "healing": str(self.proof.healing),
            "worst_found": worst
            and {
                "slip_error": worst.slip_error,
                "slip_rate": worst.peak_slip_rate,
                "slip_behind": worst.slip_behind,
                "slip_ahead": worst.slip_ahead,
            },
            "limit": None if (least := self.least_slip_rate) is None else {"slip_rate": least.exact},
            "step": str(self.proof.held.step),
            **({"longest_step": str(self.proof.held.longest_step)} if self.proof.held.longest_step else {}),
            **{name: str(size) for name, size in self.proof.held.noise.items()},
            "law": {name: str(getattr(law, name)) for name in GAIN_UNITS},
            **({} if self.compensation is None else {"controller": self.compensation.to_dict()}),
        }


TAKEN = frozenset({"step", "slip_noise", "longest_step"})
"""Quantities of a loop setup that the theorem knows."""


def answer_stick_slip(
    fault: Fault,
    setup: LoopSetup,
    *,
    objective: str = "tracking",
    sliding: SlidingMode | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> StickSlipGuarantee:
    """Design a law for the stick–slip plant and prove its bounds.

    Parameters
    ----------
    fault : Fault
        Its friction depends on slip and slip rate alone.
    setup : LoopSetup
        Only its sampling time, its longest interval and noise of the slip may be given.
    objective : str
        ``tracking`` or ``peak``.
    sliding : SlidingMode, optional
        Whose base gains count; an e-LQR is designed unless given.
    progress : callable, optional
        Called with what the search does, and the fraction done [-].

    Raises
    ------
    ParameterError
        For another quantity of the setup.
    """
    if unknown := setup.given().keys() - TAKEN:
        raise ParameterError(
            "a guarantee on the stick-slip plant is proved for an exact slip rate, bounded noise of the slip and a "
            f"pressure that acts at once. Received {', '.join(sorted(unknown))}. Omit the quantity, or omit plant."
        )
    task = uncertain_plant(fault)
    step = rational(fault.sampling_time) if setup.step is None else Fraction(setup.step)
    tell = progress or (lambda what, done: None)
    healing = rational(fault.friction.rest_excess)
    wanted: Any = {"objective": objective, "slip_noise": setup.slip_noise, "healing": healing, "tell": tell}
    wanted["longest_step"] = setup.longest_step
    if sliding is None:
        return attacked_stick_slip(fault, design_stick_slip(task, step, **wanted))
    made = design_sticking(task, sliding, step, **wanted)
    if isinstance(made, NoProof):
        return attacked_stick_slip(fault, made)
    assert isinstance(made.proof, StickSlipProof)
    return attacked_stick_slip(fault, made.proof, made)


def attacked_stick_slip(
    fault: Fault, found: StickSlipProof | NoProof, compensation: Compensation | None = None
) -> StickSlipGuarantee:
    """A guarantee with the worst case found on its loop."""
    worst = worst_stick_slip(found) if found.proved else None
    return StickSlipGuarantee(fault=fault, proof=found, worst=worst, compensation=compensation)
