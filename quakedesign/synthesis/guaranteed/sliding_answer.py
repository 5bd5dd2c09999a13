"""What is guaranteed of a law that holds a rate-and-state fault in slow sliding, as `guarantee` says it."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from fractions import Fraction
from functools import cached_property
from math import exp
from typing import Any, ClassVar, Unpack

import numpy as np

from quakedesign.bounds import LowerBound, UpperBound
from quakedesign.certificates.guarantee import Held, NoGuarantee
from quakedesign.certificates.guarantee.held import Around
from quakedesign.certificates.guarantee.pump import Pump
from quakedesign.certificates.impossibility import longest_diffusion
from quakedesign.certificates.slow_sliding import SlidingGuarantee, SlidingTask, sliding_task
from quakedesign.certificates.slow_sliding.push import SlidingPush
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.fault import Fault
from quakedesign.fault.defaults import AGEINGS
from quakedesign.rationals import rational, shortly
from quakedesign.synthesis.guaranteed.sliding_adversary import WorstSliding, worst_sliding
from quakedesign.synthesis.guaranteed.sliding_reach import Prove, Reach, farthest, suitable, what_would_do
from quakedesign.synthesis.guaranteed.slow_sliding import (
    LOG_RATES,
    designed_sliding,
    largest_stress,
    proved_sliding,
    two_digits,
)
from quakedesign.synthesis.linear.plant.sliding_model import sliding_model

Tell = Callable[[str, float], None]
"""Of what is being done, and the fraction done [-]."""
_TRIFLE = Fraction(1)  # stress [Pa] that is tried where a law is estimated to stand none: another law may stand more
_SEARCHED = 0.8  # of the work, when a law of a search is proved
_SHARES = (Fraction(1), Fraction(9, 10), Fraction(3, 4), Fraction(1, 2))  # of an estimate that may be too large


@dataclass(frozen=True, kw_only=True)
class SlidingAnswer:
    """Guarantee of slow sliding, or why there is none.

    Attributes
    ----------
    found : SlidingGuarantee or NoGuarantee
    task : SlidingTask
    held : Held or None
        The law as it runs; None where no law was found.
    """

    found: SlidingGuarantee | NoGuarantee
    task: SlidingTask
    held: Held | None
    compensation: ClassVar[None] = None

    @property
    def proved(self) -> bool:
        """Whether there is a guarantee."""
        return isinstance(self.found, SlidingGuarantee)

    @cached_property
    def worst(self) -> WorstSliding | None:
        """The worst that a search finds, beside a guarantee; some tenths of a second for every corner of the box."""
        return worst_sliding(self.found) if isinstance(self.found, SlidingGuarantee) else None

    def lines(self) -> list[str]:
        """For people."""
        if self.worst is None:
            return [self.found.sentence()]
        seen = f"slip error {self.worst.slip_error:.3g} m, slip rate {exp(self.worst.log_rate):.4g} V"
        return [f"proved: {self.found.sentence()}", f"worst found without inertia: {seen}"]

    def limit_lines(self) -> list[str]:
        """What no controller can do at the same T_s; none is known."""
        return []

    def task_lines(self) -> list[str]:
        """What is said of the task, whatever law it is for; nothing."""
        return []

    def to_dict(self) -> dict[str, Any]:
        """Plain values, SI; exact numbers as texts."""
        if not isinstance(self.found, SlidingGuarantee):
            return {"verdict": "undecided", "sentence": self.found.sentence(), "reason": self.found.reason}
        held = self.found.held
        return {
            "verdict": "proved",
            "sentence": self.found.sentence(),
            **self.found.to_dict(),
            **{name: str(getattr(held, name)) for name in ("step", "diffusion", "lag", "delay", "slip_noise")},
            "measured": "slip",
            "worst_found": self.worst and asdict(self.worst),
        }


def answer_sliding(
    fault: Fault,
    *,
    controller: str = "elqr",
    step: Fraction | None = None,
    stress: Fraction | None = None,
    spread: Fraction = Fraction(0),
    tell: Tell = lambda what, done: None,
    **around: Unpack[Around],
) -> SlidingAnswer:
    """Design and prove a law for a rate-and-state fault at the mean rate of its task.

    Parameters
    ----------
    fault : Fault
    controller : str
        ``elqr``.
    step : Fraction, optional
        T_s [s]; the fault's unless given.
    stress : Fraction, optional
        Bound of the shear stress disturbance [Pa]; the largest that the design is seen to stand unless given.
    spread : Fraction
        By how much of their values a, b and D_c may be off [-].
    tell : callable, optional
        Called with what is being done and the fraction done [-].
    **around : Fraction, Pump
        As in `design_held`; a lag or a diffusion is needed. A proof is one that the pump can hold all of its pressures.

    Raises
    ------
    ParameterError, UnsupportedError
    """
    box = fault.box
    if controller != "elqr" or any((box.stiffness, box.damping, box.authority)):
        raise UnsupportedError(
            "slow sliding is guaranteed of elqr, with the box of a, b and D_c that a spread gives; sliding modes do "
            "not apply to it, as the slip rate follows the pressure at once. Received "
            f"{controller} and the box {box.name}. Give --controller elqr, --box paper and --spread."
        )
    if not 0 <= spread < 1:
        meant = f": {float(spread):g} % is {float(spread) / 100:g}" if 1 <= spread < 100 else ""
        raise ParameterError(f"a spread must be from 0 to below 1. Received {float(spread):g}. Change it{meant}.")
    if stress is not None and stress <= 0:
        raise ParameterError(f"a stress must be above 0. Received {shortly(stress)} Pa. Change it, or leave it out.")
    if not (around.get("lag") or around.get("diffusion")):
        raise ParameterError(
            "slow sliding is guaranteed through rock or a lag between well and fault. Received neither. Give "
            "--diffusion, such as '833 s', or --lag."
        )
    held_over = rational(fault.sampling_time) if step is None else step
    task = sliding_task(fault, stress or _TRIFLE, spread)
    pump = around.pop("pump", None)
    if pump is not None and pump.rate is not None:
        raise ParameterError(
            f"the rate of a pump is not known of slow sliding. Received {shortly(pump.rate)} Pa/s. Leave it out."
        )
    prove = _proof(pump, tell, given=stress is not None)
    tell(f"a law for |ln(v/V)| up to {LOG_RATES[0]}", 0.0)
    answer, reach, remedy = _answer(task, held_over, LOG_RATES[0], around, prove), Reach(share=Fraction(1)), ""
    if answer.held is None:
        tell("how far the well may be", 0.3)
        reach = farthest(task, suitable(task, held_over), around, stressed=stress is not None)
        remedy = _remedy(fault, task, held_over, reach, around, prove, spread)
    for log_rate in LOG_RATES[1:]:
        if (answer.proved and (stress or answer.task.stress > _TRIFLE)) or reach.share < 1:
            break
        tell(f"a law for |ln(v/V)| up to {log_rate}", _SEARCHED)
        smaller = _answer(task, held_over, log_rate, around, prove, reach.numbers)
        more = smaller.proved and (not answer.proved or smaller.task.stress > answer.task.stress)
        answer = smaller if more else answer
    if isinstance(answer.found, NoGuarantee) and not remedy and stress:
        pumped: dict[str, Any] = {} if pump is None else {"pump": pump}
        remedy = _under_less(answer_sliding(fault, step=step, spread=spread, tell=tell, **around, **pumped))
        if remedy and answer.held is None:
            none = f"no law was found that holds the fault under {UpperBound(stress).quantity('Pa')}"
            answer = replace(answer, found=NoGuarantee(reason=none, small_gain=None))
    if isinstance(answer.found, NoGuarantee):
        why = (stress and _beyond(fault, stress, around)) or answer.found.reason
        return replace(answer, found=replace(answer.found, reason="; ".join(filter(None, (why, remedy)))))
    return answer


def _beyond(fault: Fault, stress: Fraction, around: Around) -> str:
    """Why no controller holds the fault under a stress [Pa] through its rock; empty where that is not proved."""
    most = rational(fault.effective_normal_stress)
    push = SlidingPush(model=sliding_model(fault), amplitude=stress)
    far = longest_diffusion(push, most, Fraction(0))
    if far is None or around.get("diffusion", 0) <= far:
        return ""
    return (
        f"no controller whatever whose pressure is within {LowerBound(most).quantity('Pa')} of what the reference "
        f"needs holds the nominal fault, linearised, through rock of L^2/D above {far.quantity('s')}"
    )


def _under_less(answer: SlidingAnswer) -> str:
    """The stress for which a proof was found that is not for the one that was asked for; empty without one."""
    if not answer.proved:
        return ""
    most = LowerBound(answer.task.stress).quantity("Pa")
    return f"a proof was found for a stress of at most {most}: give --stress '{most}'; somewhat more may do"


def _remedy(
    fault: Fault, task: SlidingTask, step: Fraction, reach: Reach, around: Around, prove: Prove, spread: Fraction
) -> str:
    """Which T_s, V or path would do; empty where a law was followed through all of the path at the T_s asked for."""
    if reach.share < 1:
        return what_would_do(fault, task, reach, around, prove, spread=spread)
    suits = suitable(task, step)
    near = f"T_s near D_c/({AGEINGS:g} V), here {float(suits):.2g} s, suits: set sampling_time in [task]"
    return "" if suits == step else near


def _proof(pump: Pump | None, tell: Tell, *, given: bool) -> Prove:
    """Proofs whose pressures the pump can hold, under the task's stress if that is given, or about the largest."""

    def tried(task: SlidingTask, held: Held, log_rate: Fraction) -> SlidingGuarantee | NoGuarantee:
        under = f"a stress of {float(task.stress):.2g} Pa with |ln(v/V)| up to {log_rate}"
        tell(f"{under}: proof", _SEARCHED)
        found = _held_by(pump, proved_sliding(task, held, log_rate=log_rate))
        tell(f"{under}: {'proved' if isinstance(found, SlidingGuarantee) else 'not proved'}", _SEARCHED)
        return found

    def about_the_largest(task: SlidingTask, held: Held, log_rate: Fraction) -> SlidingGuarantee | NoGuarantee:
        most = largest_stress(task, held, log_rate=log_rate)
        found: SlidingGuarantee | NoGuarantee
        for share in _SHARES if most else _SHARES[:1]:
            found = tried(replace(task, stress=two_digits(share * (most or _TRIFLE))), held, log_rate)
            if isinstance(found, SlidingGuarantee):
                break
        return found

    return tried if given else about_the_largest


def _answer(
    task: SlidingTask,
    step: Fraction,
    log_rate: Fraction,
    around: Around,
    prove: Prove,
    near: np.ndarray | None = None,
) -> SlidingAnswer:
    """With |ln(v/V)| at most `log_rate`, searched near the numbers of a law as well if they are told."""
    design = designed_sliding(task, step, log_rate=log_rate, near=near, **around)
    if isinstance(design, NoGuarantee):
        return SlidingAnswer(found=design, task=task, held=None)
    proved = prove(task, design, log_rate)
    return SlidingAnswer(found=proved, task=proved.task if isinstance(proved, SlidingGuarantee) else task, held=design)


def _held_by(pump: Pump | None, found: SlidingGuarantee | NoGuarantee) -> SlidingGuarantee | NoGuarantee:
    """A guarantee whose pressures at the valve the pump can hold."""
    if pump is None or isinstance(found, NoGuarantee):
        return found
    too_much = pump.exceeded(*found.valve_pressures)
    return NoGuarantee(reason=too_much, small_gain=None) if too_much else found
