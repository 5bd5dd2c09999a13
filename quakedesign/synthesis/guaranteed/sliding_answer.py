"""What is guaranteed of a law that holds a rate-and-state fault in slow sliding, as `guarantee` says it."""

from dataclasses import asdict, dataclass, replace
from fractions import Fraction
from functools import cached_property, partial
from math import exp
from typing import Any, ClassVar, Unpack

from quakedesign.certificates.guarantee import Held, NoGuarantee
from quakedesign.certificates.guarantee.pump import Pump
from quakedesign.certificates.guarantee.statement import Around
from quakedesign.certificates.slow_sliding import SlidingGuarantee, SlidingTask, sliding_task
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.synthesis.guaranteed.sliding_adversary import WorstSliding, worst_sliding
from quakedesign.synthesis.guaranteed.slow_sliding import (
    LOG_RATES,
    designed_sliding,
    largest_stress,
    proved_sliding,
    two_digits,
)

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
            return {"verdict": "undecided", "reason": self.found.reason}
        held = self.found.held
        return {
            "verdict": "proved",
            "guarantee": self.found.sentence(),
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
    if not 0 <= spread < 1 or (stress is not None and stress <= 0):
        raise ParameterError(
            f"a spread must be from 0 to below 1, a stress above 0. Received {float(spread):g} and "
            f"{float(stress or 0):g} Pa. Change them."
        )
    if not (around.get("lag") or around.get("diffusion")):
        raise ParameterError(
            "slow sliding is guaranteed through rock or a lag between well and fault. Received neither. Give "
            "--diffusion, such as '833 s', or --lag."
        )
    held_over = rational(fault.sampling_time) if step is None else step
    task = sliding_task(fault, stress or Fraction(1), spread)
    pump, answers = around.pop("pump", None), []
    if pump is not None and pump.rate is not None:
        raise ParameterError(
            f"the rate of a pump is not known of slow sliding. Received {float(pump.rate):g} Pa/s. Leave it out."
        )
    for log_rate in LOG_RATES:
        answers.append(_answer(task, held_over, log_rate, around, pump, given=stress is not None))
        if answers[-1].proved:
            return answers[-1]
    return answers[0]


def _answer(
    task: SlidingTask, step: Fraction, log_rate: Fraction, around: Around, pump: Pump | None, *, given: bool
) -> SlidingAnswer:
    """With |ln(v/V)| at most `log_rate`, under the task's stress if that is given."""
    design = designed_sliding(task, step, log_rate=log_rate, **around)
    if isinstance(design, NoGuarantee):
        return SlidingAnswer(found=design, task=task, held=None)
    prove = proved_sliding if given else partial(_with_the_largest_stress, pump=pump)
    proved = _held_by(pump, prove(task, design, log_rate=log_rate))
    return SlidingAnswer(found=proved, task=proved.task if isinstance(proved, SlidingGuarantee) else task, held=design)


def _held_by(pump: Pump | None, found: SlidingGuarantee | NoGuarantee) -> SlidingGuarantee | NoGuarantee:
    """A guarantee whose pressures at the valve the pump can hold."""
    if pump is None or isinstance(found, NoGuarantee):
        return found
    too_much = pump.exceeded(*found.valve_pressures)
    return NoGuarantee(reason=too_much, small_gain=None) if too_much else found


def _with_the_largest_stress(
    task: SlidingTask, design: Held, *, log_rate: Fraction, pump: Pump | None = None
) -> SlidingGuarantee | NoGuarantee:
    """A guarantee under about the largest stress that has one: what is estimated of it, or somewhat less."""
    most = largest_stress(task, design, log_rate=log_rate) or Fraction(1)
    found: SlidingGuarantee | NoGuarantee
    for share in _SHARES:
        tried = replace(task, stress=two_digits(share * most))
        found = _held_by(pump, proved_sliding(tried, design, log_rate=log_rate))
        if isinstance(found, SlidingGuarantee):
            break
    return found
