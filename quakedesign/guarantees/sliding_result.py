"""Results of `quakedesign.guarantee` in slow sliding: search, proof, worst case, remedies."""

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from math import exp

import numpy as np

from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.exact import LowerBound, UpperBound, rational, shortly
from quakedesign.fault import Fault
from quakedesign.fault.fault_toml import SAMPLES_PER_STATE_TIME
from quakedesign.files import Json
from quakedesign.guarantees.exact.limit_theorems import DisturbedSliding, longest_diffusion
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.exact.sampled_loop import PLAIN, ExactSetup, SampledLoop
from quakedesign.guarantees.exact.sliding_proof import SlidingProof
from quakedesign.guarantees.result import Guarantee
from quakedesign.guarantees.search.lqg import sliding_model
from quakedesign.guarantees.search.sliding_design import (
    LOG_RATES,
    FarthestWell,
    Prove,
    admissible_step,
    designed_sliding,
    farthest,
    largest_stress,
    possible_remedy,
    proved_sliding,
    quieter,
    two_digits,
    with_noise,
)
from quakedesign.guarantees.search.worst_case import WorstCase, worst_sliding
from quakedesign.loop.loop_setup import Pump
from quakedesign.plant.of_fault import slow_sliding_plant
from quakedesign.plant.sliding_plant import SlidingPlant
from quakedesign.text import Progress, quantity, silent

_TRIFLE = Fraction(1)  # stress [Pa] of the plant if none is given; tried if the estimate of the largest is 0
_SEARCHED = 0.8  # fraction of the work at which the proof of a designed law begins
_SHARES = (Fraction(1), Fraction(9, 10), Fraction(3, 4), Fraction(1, 2))  # shares of an estimate that may be too large


@dataclass(frozen=True, kw_only=True)
class SlidingGuarantee(Guarantee):
    """Guarantee of slow sliding, or the reason why there is none.

    Attributes
    ----------
    proof : SlidingProof or NoProof
    task : SlidingPlant
    sampled_loop : SampledLoop or None
        The sampled law in its loop setup; None where no law was found.
    """

    proof: SlidingProof | NoProof
    task: SlidingPlant
    sampled_loop: SampledLoop | None
    compensation: None = None

    @cached_property
    def worst(self) -> WorstCase | None:
        """Worst case found (lower bound); takes some tenths of a second for every corner of the box."""
        return worst_sliding(self.proof) if self.proof.available else None

    def lines(self) -> list[str]:
        """Text for users."""
        if self.worst is None:
            return [self.proof.sentence()]
        seen = f"slip error {quantity(self.worst.slip_error, 'm')}, slip rate {exp(self.worst.log_rate or 0):.4g} V"
        return [f"proved: {self.proof.sentence()}", f"worst case found without inertia: {seen}"]

    def to_dict(self) -> Json:
        """Plain values, SI; exact numbers as strings."""
        seen = self.worst and {"log_rate": self.worst.log_rate, "slip_error": self.worst.slip_error}
        return super().to_dict() | ({"worst_found": seen} if self.proved else {})


def guarantee_sliding(
    fault: Fault,
    *,
    controller: str = "elqr",
    step: Fraction | None = None,
    stress: Fraction | None = None,
    spread: Fraction = Fraction(0),
    progress: Progress = silent,
    setup: ExactSetup = PLAIN,
) -> SlidingGuarantee:
    """Design a law for a rate-and-state fault at the mean rate of its reference, and prove bounds.

    Parameters
    ----------
    fault : Fault
    controller : str
        ``elqr``.
    step : Fraction, optional
        T_s [s]; the fault's unless given.
    stress : Fraction, optional
        Bound of the shear stress disturbance [Pa]; by default the largest that is proved.
    spread : Fraction
        Relative uncertainty of a, b and D_c [-].
    progress : callable, optional
        Called with the name of the current step and the fraction done [-].
    setup : ExactSetup
        With a lag or a diffusion path. All proved pressures lie within the limits of its pump.

    Raises
    ------
    UnsupportedError
        For another controller, a box with uncertain constants, or a fault that `slow_sliding_plant` rejects.
    ParameterError
        For a spread or stress out of its range, no lag or diffusion path, or a pump with a rate limit.
    """
    box = fault.box
    if controller != "elqr" or any((box.stiffness, box.damping, box.authority)):
        raise UnsupportedError(
            "slow sliding has a guarantee for the controller elqr, with the box of a, b and D_c given by --spread; "
            "sliding modes do not apply, since the slip rate responds to the pressure without delay. Received the "
            f"controller {controller} and the box {box.name}. Give --controller elqr, --box paper and --spread."
        )
    if not 0 <= spread < 1:
        meant = f": {float(spread):g} % is {float(spread) / 100:g}" if 1 <= spread < 100 else ""
        raise ParameterError(f"spread must be from 0 to below 1. Received {shortly(spread)}. Give a fraction{meant}.")
    if stress is not None and stress <= 0:
        raise ParameterError(
            f"stress must be positive. Received {shortly(stress)} Pa. Omit stress for the largest that can be proved."
        )
    if not (setup.lag or setup.diffusion):
        raise ParameterError(
            "slow sliding needs a diffusion path or a lag between well and fault. Received neither. Give --diffusion, "
            "such as '833 s', or --lag."
        )
    period = rational(fault.sampling_time) if step is None else step
    task = slow_sliding_plant(fault, stress or _TRIFLE, spread)
    pump, setup = setup.pump, replace(setup, pump=None)
    if pump is not None and pump.rate is not None:
        raise ParameterError(
            "slow sliding has no guarantee with the rate limit of a pump. Received the rate limit "
            f"{shortly(pump.rate)} Pa/s. Omit the rate limit."
        )
    prove = _proof(pump, progress, with_stress=stress is not None)
    progress(f"a law for |ln(v/V)| up to {LOG_RATES[0]}", 0.0)
    result, well, remedy = _designed(task, period, LOG_RATES[0], setup, prove), FarthestWell(share=Fraction(1)), ""
    if result.sampled_loop is None:
        progress("largest distance of the well", 0.3)
        well = farthest(task, admissible_step(task, period), setup, stressed=stress is not None)
        remedy = _remedy(fault, task, period, well, setup, prove, spread)
    for log_rate in LOG_RATES[1:]:
        if (result.proved and (stress or result.task.stress > _TRIFLE)) or well.share < 1:
            break
        progress(f"a law for |ln(v/V)| up to {log_rate}", _SEARCHED)
        smaller = _designed(task, period, log_rate, setup, prove, well.numbers)
        more = smaller.proved and (not result.proved or smaller.task.stress > result.task.stress)
        result = smaller if more else result
    if not result.proof.available and not remedy and stress:
        pumped = replace(setup, pump=pump)
        remedy = _under_less(guarantee_sliding(fault, step=step, spread=spread, progress=progress, setup=pumped))
        if remedy and result.sampled_loop is None:
            none = f"no law was found that controls the fault under {UpperBound(stress).quantity('Pa')}"
            result = replace(result, proof=NoProof(reason=none))
    if not result.proof.available and not remedy:
        remedy = _with_less_noise(task, period, setup, prove)
    if not result.proof.available:
        why = (stress and _beyond(fault, stress, setup)) or result.proof.reason
        return replace(result, proof=replace(result.proof, reason="; ".join(filter(None, (why, remedy)))))
    return result


def _beyond(fault: Fault, stress: Fraction, setup: ExactSetup) -> str:
    """Reason why the diffusion path is infeasible under a stress [Pa]; empty if not proved."""
    most = rational(fault.effective_normal_stress)
    limit = DisturbedSliding(model=sliding_model(fault), amplitude=stress)
    far = longest_diffusion(limit, most, Fraction(0))
    if far is None or setup.diffusion <= far:
        return ""
    return (
        f"no controller whose pressure stays within {LowerBound(most).quantity('Pa')} of what the reference needs can "
        f"hold the fault through a diffusion path of L^2/D above {far.quantity('s')} (nominal parameters, linearised, "
        "under this stress, constant from some instant on)"
    )


def _under_less(result: SlidingGuarantee) -> str:
    """Remedy: a smaller stress that has a proof; empty without one."""
    if not result.proved:
        return ""
    most = LowerBound(result.task.stress).quantity("Pa")
    return f"a proof was found for a stress of at most {most}: give --stress '{most}', or somewhat more"


def _with_less_noise(task: SlidingPlant, step: Fraction, setup: ExactSetup, prove: Prove) -> str:
    """Remedy: a smaller slip noise that has a proof; empty without one."""
    for noise in quieter(setup):
        if _designed(task, step, LOG_RATES[0], replace(setup, slip_noise=noise), prove).proved:
            return f"a proof was found {with_noise(noise, setup).rstrip()}"
    return ""


def _remedy(
    fault: Fault,
    task: SlidingPlant,
    step: Fraction,
    well: FarthestWell,
    setup: ExactSetup,
    prove: Prove,
    spread: Fraction,
) -> str:
    """Remedy: a proved V or diffusion path, else an admissible T_s (not proved); empty if there is none."""
    if well.share < 1:
        return possible_remedy(fault, task, well, setup, prove, spread=spread)
    suits = admissible_step(task, step)
    near = f"T_s near D_c/({SAMPLES_PER_STATE_TIME:g} V), here {float(suits):.2g} s, suits: set sampling_time in [task]"
    return "" if suits == step else near


def _proof(pump: Pump | None, progress: Progress, *, with_stress: bool) -> Prove:
    """Function that proves a law within the pump limits, under the given or nearly the largest stress."""

    def tried(task: SlidingPlant, sampled_loop: SampledLoop, log_rate: Fraction) -> SlidingProof | NoProof:
        under = f"a stress of {float(task.stress):.2g} Pa with |ln(v/V)| up to {log_rate}"
        progress(f"{under}: proof", _SEARCHED)
        proof = _within_pump(pump, proved_sliding(task, sampled_loop, log_rate=log_rate))
        progress(f"{under}: {'proved' if proof.available else 'not proved'}", _SEARCHED)
        return proof

    def near_the_largest(task: SlidingPlant, sampled_loop: SampledLoop, log_rate: Fraction) -> SlidingProof | NoProof:
        most = largest_stress(task, sampled_loop, log_rate=log_rate)
        proof: SlidingProof | NoProof
        for share in _SHARES if most else _SHARES[:1]:
            proof = tried(replace(task, stress=two_digits(share * (most or _TRIFLE))), sampled_loop, log_rate)
            if proof.available:
                break
        return proof

    return tried if with_stress else near_the_largest


def _designed(
    task: SlidingPlant,
    step: Fraction,
    log_rate: Fraction,
    setup: ExactSetup,
    prove: Prove,
    near: np.ndarray | None = None,
) -> SlidingGuarantee:
    """Guarantee of a designed law with |ln(v/V)| ≤ `log_rate`; `near` is a further initial law."""
    design = designed_sliding(task, step, log_rate=log_rate, near=near, setup=setup)
    if isinstance(design, NoProof):
        return SlidingGuarantee(proof=design, task=task, sampled_loop=None)
    proved = prove(task, design, log_rate)
    return SlidingGuarantee(proof=proved, task=proved.task if proved.available else task, sampled_loop=design)


def _within_pump(pump: Pump | None, proof: SlidingProof | NoProof) -> SlidingProof | NoProof:
    """The given proof if its valve pressures lie within the pump limits, else the reason."""
    if pump is None or not proof.available:
        return proof
    too_much = pump.exceeded(*proof.valve_pressures)
    return NoProof(reason=too_much) if too_much else proof
