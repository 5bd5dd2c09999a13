"""What is guaranteed of a controller on a fault as it runs, beside the worst that a search finds."""

from dataclasses import asdict, dataclass, replace
from fractions import Fraction
from math import log
from typing import Any

import numpy as np

from quakedesign.bounds import LowerBound, UpperBound
from quakedesign.certificates.claim import Verdict
from quakedesign.certificates.guarantee import Guarantee, NoGuarantee, guarantee
from quakedesign.certificates.impossibility import SmallestPeak, smallest_peak
from quakedesign.fault import Fault
from quakedesign.loop import LinearLaw, RestLimit
from quakedesign.loop.sensing.differences import least_bound
from quakedesign.rationals import exact_text, float_above
from quakedesign.sos.exact.strict import texts
from quakedesign.synthesis.guaranteed.adversary import WorstFound, worst_found
from quakedesign.synthesis.guaranteed.compensated import Compensation
from quakedesign.synthesis.guaranteed.families import MEASURED, measured_by
from quakedesign.synthesis.guaranteed.poles import own_poles

_TOLD = (
    "step",
    "slip_noise",
    "rate_noise",
    "initial_slip",
    "initial_slip_rate",
    "jitter",
    "delay_jitter",
    "averaging",
    "longest_step",
)
_GROWS = 1 + 1e-6  # a factor per sample; eigenvalues that are 1 twice are rounded by less


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
    asked_step : Fraction or None
        T_s [s] that has no guarantee where `shorter` has one.
    nearest : (str, Guarantee) or None
        For a loop without a guarantee: another quantity of its setup and a design with the value nearest to it that
        has one, all else as it is; `GAINS` for a design in place of given gains.
    compensation : Compensation or None
        Gains, scale and settings of a sliding mode that runs in the scheme ``compensated``.
    """

    fault: Fault
    found: Guarantee | NoGuarantee
    worst: WorstFound | None = None
    worst_with_stick: WorstFound | None = None
    shorter: Guarantee | None = None
    asked_step: Fraction | None = None
    nearest: tuple[str, Guarantee] | None = None
    compensation: Compensation | None = None

    @property
    def proved(self) -> bool:
        """Whether there is a guarantee."""
        return isinstance(self.found, Guarantee)

    def lines(self) -> list[str]:
        """For people: the sentence first, then what was seen."""
        if not isinstance(self.found, Guarantee):
            said = [self.found.sentence()]
            if self.asked_step is not None:
                said = [f"not guaranteed at T_s = {float(self.asked_step):g} s: {self.found.reason}"]
            if self.shorter is not None:
                said.append(f"with T_s = {float(self.shorter.held.step):g} s: {self.shorter.sentence()}")
            if self.nearest is not None:
                said.append(f"{_with_nearest(*self.nearest)}: {self.nearest[1].sentence()}")
            if len(said) == 1:
                said.append("no T_s was found for which a design is proved with this box, disturbance and setup")
            return said
        said = [f"proved: {self.found.sentence()}", *self._at_rest()]
        for name, seen in (("worst found", self.worst), ("worst found with stick", self.worst_with_stick)):
            if seen is not None:
                ends = seen.pressures
                pressure = "" if ends is None else f", pressure {ends[0] / 1e6:.4g} MPa to {ends[1] / 1e6:.4g} MPa"
                said.append(
                    f"{name}: slip error {seen.slip_error:.3g} m, slip-rate error {seen.slip_rate_error:.3g} m/s"
                    f"{pressure}"
                )
        said += [*self._told(), *self.task_lines()]
        if self.leaves_with_stick:
            said.append("with stick a course was found that leaves the bounds, which are those of the continued plant")
        return said if self.compensation is None else [*said, self.compensation.sentence()]

    @property
    def grows_at_rest(self) -> float | None:
        """Time [s] in which the law's states grow e-fold while friction holds the fault at rest; None if they do not.

        Then what is measured no longer answers to the pressure, and the law is left to itself.
        """
        if not isinstance(self.found, Guarantee):
            return None
        held = self.found.held
        growth = float(np.max(np.abs(own_poles(held.law)), initial=0.0))
        return float(held.step) / log(growth) if growth > _GROWS else None

    @property
    def differentiator_bound(self) -> UpperBound | None:
        """λ_d [m/s³] from which on the differentiator tells what is proved; None for a law without one."""
        if not isinstance(self.found, Guarantee) or measured_by(self.found.held.law) != MEASURED[2]:
            return None
        return UpperBound(least_bound(self.found.slip_acceleration, self.found.held.slip_noise, self.found.held.step))

    def _told(self) -> list[str]:
        """For people; nothing of a law without a differentiator."""
        bound = self.differentiator_bound
        if bound is None:
            return []
        return [
            "told by the implicit differentiator of the slip error, n_d = 2 with any n_f, from rest: with lambda_d of "
            f"{bound:.3g} m/s^3 or more it is (3x - 4x_1 + x_2)/(2 T_s) of the last three readings, for ever"
        ]

    def _at_rest(self) -> list[str]:
        """For people; nothing of a law that does not grow."""
        time = self.grows_at_rest
        if time is None:
            return []
        return [
            "NOT for a fault that sticks: by itself the law is unstable, and while friction holds the fault at rest "
            f"its pressure grows e-fold in {time:.3g} s"
        ]

    def limit_lines(self) -> list[str]:
        """What no controller can do at the same T_s, for people; empty where that is not known."""
        limit = self.limit
        if limit is None or not isinstance(self.found, Guarantee):
            return []
        held = self.found.held
        step = f"{float(max(held.step, held.longest_step)):.6g} s"
        step += " with that noise" if held.noise else ""
        both = "" if limit.slip_error is None else f" and the slip error below {limit.slip_error:.3g} m as well"
        rate = f"{limit.slip_rate_error:.3g} m/s"
        return [f"no controller held over T_s = {step} keeps the slip-rate error below {rate}{both}"]

    def task_lines(self) -> list[str]:
        """What is said of the task, whatever law it is for."""
        return self.limit_lines() + self._narrower_class()

    def _narrower_class(self) -> list[str]:
        """That the fault's own disturbance belongs to the class ``rate`` as well, for people."""
        given = self.fault.disturbance
        own = isinstance(self.found, Guarantee) and self.found.task.change is None
        if not own or given.constant or not given.largest_rate:
            return []
        change = UpperBound(self.fault.disturbance_bounds[1])
        return [
            f"this covers disturbances that jump; the fault's own changes by at most {change:.3g} m/s^3, for which the "
            "class rate may prove much less"
        ]

    @property
    def limit(self) -> SmallestPeak | None:
        """What no controller can do at the same T_s and delay, told as much; None for the class ``rate``."""
        if not isinstance(self.found, Guarantee) or self.found.task.change is not None:
            return None
        held = self.found.held
        rate_noise = None if held.law.of_slip_alone else held.rate_noise
        step = max(held.step, held.longest_step)
        return smallest_peak(self.found.task, step, held.delay, slip_noise=held.slip_noise, rate_noise=rate_noise)

    @property
    def leaves_with_stick(self) -> bool:
        """Whether a course with stick was found beyond the claims."""
        if not isinstance(self.found, Guarantee) or self.worst_with_stick is None:
            return False
        claims, seen = self.found.claims, self.worst_with_stick
        (least, largest), ends = claims.pressures[-1], seen.pressures
        if ends is not None and not least <= ends[0] <= ends[1] <= largest:
            return True
        return seen.slip_error > claims.slip_error or seen.slip_rate_error > claims.slip_rate_error

    def to_dict(self) -> dict[str, Any]:
        """Plain values, SI; exact numbers as texts."""
        if not isinstance(self.found, Guarantee):
            gain = self.found.small_gain
            other = self.shorter
            shorter = None if other is None else {"step": str(other.held.step), **other.claims.to_dict()}
            return {
                "verdict": "undecided",
                "sentence": self.found.sentence(),
                "reason": self.found.reason,
                "small_gain": None if gain is None else gain.exact,
                "shorter": shorter,
                "nearest": self.nearest and _nearest(*self.nearest),
            }
        bounds, held = self.found.bounds(), self.found.held
        small = None if isinstance(bounds, NoGuarantee) else float_above(bounds.small_gain)
        return {
            "verdict": "proved",
            "sentence": self.found.sentence(),
            **self.found.claims.to_dict(),
            "small_gain": small,
            "worst_found": self.worst and asdict(self.worst),
            "worst_found_with_stick": self.worst_with_stick and asdict(self.worst_with_stick),
            "grows_at_rest": self.grows_at_rest,
            "rest_limit": _rest_limit(self.found.rest_limit),
            "limit": _limit(self.limit),
            "measured": measured_by(held.law),
            "differentiator_bound": None if self.differentiator_bound is None else self.differentiator_bound.exact,
            **{name: str(getattr(held, name)) for name in _TOLD},
            "pump": None if held.pump is None else held.pump.to_dict(),
            "law": _law(held.law),
            **({} if self.compensation is None else {"controller": self.compensation.to_dict()}),
        }


GAINS = "gains"
_QUANTITIES = {
    "delay_jitter": ("jitter of the delay", "s"),
    "jitter": ("jitter", "s"),
    "averaging": ("averaging time", "s"),
    "delay": ("delay", "s"),
    "lag": ("lag", "s"),
    "diffusion": ("diffusion time L^2/D", "s"),
}


def _with_nearest(name: str, found: Guarantee) -> str:
    """For people."""
    if name == GAINS:
        return "with designed gains"
    if name in _QUANTITIES:
        title, unit = _QUANTITIES[name]
        if not getattr(found.held, name):
            return f"without any {title}"
        return f"with a {title} of at most {LowerBound(getattr(found.held, name)).quantity(unit)}"
    pump = found.held.pump
    if pump is None:
        return "with a pump without limits"
    return f"with a pump of at least {UpperBound(pump.rate or 0).quantity('Pa/s')}"


def _nearest(name: str, found: Guarantee) -> dict[str, Any]:
    """Plain values, SI; exact numbers as texts."""
    pump = found.held.pump
    value = getattr(found.held, name, None) if name in _QUANTITIES else pump and pump.rate
    return {"quantity": name, "value": None if value is None else str(value), **found.claims.to_dict()}


def attacked(fault: Fault, found: Guarantee | NoGuarantee) -> Answer:
    """A guarantee beside the worst that a search finds on its loop; about a second.

    Where a course with stick leaves a claim of a slow input gain, that of any gain takes its place if it is wider than
    the course.
    """
    if isinstance(found, NoGuarantee):
        return Answer(fault=fault, found=found)
    seen = Answer(fault=fault, found=found, worst=worst_found(found), worst_with_stick=worst_found(found, sticks=True))
    return seen if found.slow_gain is None or not seen.leaves_with_stick else _with_room(seen, found)


def _with_room(seen: Answer, found: Guarantee) -> Answer:
    anyhow, worst = guarantee(found.task, found.held), seen.worst_with_stick
    if isinstance(anyhow, NoGuarantee) or worst is None:
        return seen
    left = ["slip_error"] if worst.slip_error > found.claims.slip_error else []
    left += ["slip_rate_error", "peak_slip_rate"] if worst.slip_rate_error > found.claims.slip_rate_error else []
    claims = replace(found.claims, **{name: getattr(anyhow.claims, name) for name in left})
    wider = replace(seen, found=replace(found, claims=claims))
    return seen if wider.leaves_with_stick or wider.found.check() is not Verdict.PROVED else wider


def _limit(limit: SmallestPeak | None) -> dict[str, str | None] | None:
    if limit is None:
        return None
    slip = limit.slip_error
    return {"slip_rate_error": limit.slip_rate_error.exact, "slip_error": None if slip is None else slip.exact}


def _rest_limit(limit: RestLimit | None) -> dict[str, str] | None:
    names = ("width", "per_slip", "resolution", "least", "largest", "fastest")
    return None if limit is None else {name: exact_text(getattr(limit, name)) for name in names}


def _law(law: LinearLaw) -> dict[str, Any]:
    root = law.root
    lines = {} if root is None else {"slopes": texts(root.slopes), "remainder": exact_text(root.remainder)}
    matrices = {name: [texts(row) for row in getattr(law, name)] for name in ("update", "measured")}
    rows = {name: texts(getattr(law, name)) for name in ("output", "feedback", "applied")}
    return {**lines, "states": list(law.states), **matrices, **rows}
