"""What is guaranteed of a controller on a fault as it runs, beside the worst that a search finds."""

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Unpack

from quakedesign.certificates.guarantee import Guarantee, Held, NoGuarantee, guarantee, task_of
from quakedesign.certificates.guarantee.statement import Around
from quakedesign.certificates.impossibility import SmallestPeak, smallest_peak
from quakedesign.controllers import SlidingMode, control_law
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.loop import LinearLaw, summed_integrals
from quakedesign.rationals import rational
from quakedesign.synthesis.guaranteed.adversary import WorstFound, worst_found
from quakedesign.synthesis.guaranteed.compensated import Compensation
from quakedesign.synthesis.guaranteed.continuous import CLASSES
from quakedesign.synthesis.guaranteed.design import design_held
from quakedesign.synthesis.guaranteed.families import MEASURED
from quakedesign.synthesis.guaranteed.reach import design_at, longest_step
from quakedesign.synthesis.guaranteed.sliding import GUARANTEED, sliding_mode


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """Guarantee of one loop, or why there is none.

    Attributes
    ----------
    fault : Fault
    found : Guarantee or NoGuarantee
    worst, worst_with_stick : WorstFound or None
        Of a search on the same loop; None without a guarantee.
    shorter : Guarantee or None
        For a design without a guarantee at its step: one near the longest step that has one.
    compensation : Compensation or None
        Gains, scale and settings of a sliding mode that runs in the scheme ``compensated``.
    """

    fault: Fault
    found: Guarantee | NoGuarantee
    worst: WorstFound | None = None
    worst_with_stick: WorstFound | None = None
    shorter: Guarantee | None = None
    compensation: Compensation | None = None

    @property
    def proved(self) -> bool:
        """Whether there is a guarantee."""
        return isinstance(self.found, Guarantee)

    def lines(self) -> list[str]:
        """For people: the sentence first, then what was seen."""
        if not isinstance(self.found, Guarantee):
            said = [self.found.sentence()]
            if self.shorter is not None:
                said.append(f"with T_s = {float(self.shorter.held.step):g} s: {self.shorter.sentence()}")
            return said
        said = [f"proved: {self.found.sentence()}"]
        for name, seen in (("worst found", self.worst), ("worst found with stick", self.worst_with_stick)):
            if seen is not None:
                said.append(
                    f"{name}: slip error {seen.slip_error:.3g} m, slip-rate error {seen.slip_rate_error:.3g} m/s"
                )
        limit = self.limit
        if limit is not None:
            both = "" if limit.slip_error is None else f" and the slip error below {limit.slip_error:.3g} m as well"
            errors = f"the slip-rate error below {limit.slip_rate_error:.3g} m/s{both}"
            said.append(f"no controller held over this T_s keeps {errors}")
        if self._leaves_with_stick():
            said.append("with stick a course was found that leaves the bounds, which are those of the continued plant")
        return said if self.compensation is None else [*said, self.compensation.sentence()]

    @property
    def limit(self) -> SmallestPeak | None:
        """What no controller can do at the same T_s and delay; None for the class ``rate``."""
        if not isinstance(self.found, Guarantee) or self.found.task.change is not None:
            return None
        return smallest_peak(self.found.task, self.found.held.step, self.found.held.delay)

    def _leaves_with_stick(self) -> bool:
        if not isinstance(self.found, Guarantee) or self.worst_with_stick is None:
            return False
        claims, seen = self.found.claims, self.worst_with_stick
        return seen.slip_error > claims.slip_error or seen.slip_rate_error > claims.slip_rate_error

    def to_dict(self) -> dict[str, Any]:
        """Plain values, SI; exact numbers as texts."""
        if not isinstance(self.found, Guarantee):
            gain = self.found.small_gain
            other = self.shorter
            shorter = None if other is None else {"step": str(other.held.step), **other.claims.to_dict()}
            return {
                "verdict": "undecided",
                "reason": self.found.reason,
                "small_gain": None if gain is None else gain.exact,
                "shorter": shorter,
            }
        bounds = self.found.bounds()
        small = None if isinstance(bounds, NoGuarantee) else float(bounds.small_gain)
        return {
            "verdict": "proved",
            "guarantee": self.found.sentence(),
            **self.found.claims.to_dict(),
            "small_gain": small,
            "worst_found": _seen(self.worst),
            "worst_found_with_stick": _seen(self.worst_with_stick),
            "limit": _limit(self.limit),
            "step": str(self.found.held.step),
            "measured": MEASURED[self.found.held.law.of_slip_alone],
            "slip_noise": str(self.found.held.slip_noise),
            "rate_noise": str(self.found.held.rate_noise),
            "law": _law(self.found.held.law),
            **({} if self.compensation is None else {"controller": self.compensation.to_dict()}),
        }


def answer(
    fault: Fault,
    *,
    controller: str = "elqr",
    gains: tuple[str, ...] = (),
    objective: str = "tracking",
    scheme: str | None = None,
    step: Fraction | None = None,
    measured: str = MEASURED[0],
    disturbance_class: str = "amplitude",
    **around: Unpack[Around],
) -> Answer:
    """Guarantee of given e-LQR gains with summed integrals, of a law that is designed for it, or of a sliding mode.

    Parameters
    ----------
    fault : Fault
    controller : str
        ``elqr``, or a sliding mode, ``cta`` or ``dia``.
    gains : tuple of str
        k1 … k4 of the e-LQR, run by the scheme ``explicit``; none to design a law with a disturbance estimate. Base
        gains of a sliding mode; none for those that a design tries first.
    objective : str
        ``tracking`` or ``peak``, of a design.
    scheme : str, optional
        Of a sliding mode: ``compensated`` unless given, the only one with a guarantee; of the e-LQR ``explicit``.
    step : Fraction, optional
        T_s [s]; the fault's unless given.
    measured : str
        ``slip-and-rate``, or ``slip`` for a designed e-LQR with an observer.
    disturbance_class : str
        ``amplitude``: any measurable disturbance as large as the fault's; ``rate``: no faster either.
    **around : Fraction
        Delay, lag and L²/D [s], bounds of the noise of slip [m] and slip rate [m/s]; 0 unless given.

    Raises
    ------
    ParameterError
    """
    if disturbance_class not in CLASSES:
        raise ParameterError(f"class must be one of {', '.join(CLASSES)}. Received {disturbance_class!r}.")
    period = rational(fault.sampling_time) if step is None else step
    if not Fraction(1, 10**9) <= period <= 10**9:
        raise ParameterError(f"step must be positive, between 1e-9 s and 1e9 s. Received {float(period):.4g} s.")
    task = task_of(fault, rate_limited=disturbance_class == "rate")
    law = control_law(controller)
    if measured != MEASURED[0] and (gains or issubclass(law, SlidingMode)):
        raise ParameterError(
            f"measured is for a designed e-LQR, all other laws need slip and slip rate. Received {measured!r}. "
            "Leave it out, or the gains and the controller."
        )
    if issubclass(law, SlidingMode):
        made = sliding_mode(task, law, period, gains=gains, scheme=scheme or GUARANTEED, objective=objective, **around)
        if isinstance(made, NoGuarantee):
            return Answer(fault=fault, found=made)
        return replace(attacked(fault, made.found), compensation=made)
    if scheme not in (None, "explicit"):
        raise ParameterError(f"the e-LQR runs in the scheme explicit. Received {scheme!r}. Leave it out.")
    if gains:
        summed = summed_integrals(_four(gains), period)
        return attacked(fault, guarantee(task, Held(law=summed, step=period, **around)))
    found = design_held(task, period, objective=objective, measured=measured, **around)
    if isinstance(found, Guarantee):
        return attacked(fault, found)
    longest = longest_step(task, period, measured=measured, **around)
    return Answer(fault=fault, found=found, shorter=longest and design_at(task, longest, objective))


def attacked(fault: Fault, found: Guarantee | NoGuarantee) -> Answer:
    """A guarantee beside the worst that a search finds on its loop; about a second."""
    if isinstance(found, NoGuarantee):
        return Answer(fault=fault, found=found)
    return Answer(fault=fault, found=found, worst=worst_found(found), worst_with_stick=worst_found(found, sticks=True))


def _four(gains: tuple[str, ...]) -> tuple[Fraction, ...]:
    if len(gains) != 4:
        raise ParameterError(f"gains must be four numbers, k1 to k4. Received {len(gains)}. Leave them out to design.")
    return tuple(rational(v, f"k{i}") for i, v in enumerate(gains, 1))


def _seen(worst: WorstFound | None) -> dict[str, float] | None:
    return None if worst is None else {"slip_error": worst.slip_error, "slip_rate_error": worst.slip_rate_error}


def _limit(limit: SmallestPeak | None) -> dict[str, str | None] | None:
    if limit is None:
        return None
    slip = limit.slip_error
    return {"slip_rate_error": limit.slip_rate_error.exact, "slip_error": None if slip is None else slip.exact}


def _law(law: LinearLaw) -> dict[str, Any]:
    root = law.root
    lines = {} if root is None else {"slopes": [str(v) for v in root.slopes], "remainder": str(root.remainder)}
    return {
        **lines,
        "states": list(law.states),
        "update": [[str(v) for v in row] for row in law.update],
        "measured": [[str(v) for v in row] for row in law.measured],
        "output": [str(v) for v in law.output],
        "feedback": [str(v) for v in law.feedback],
    }
