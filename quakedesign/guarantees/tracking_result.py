"""Results of `quakedesign.guarantee` on the plant without stick."""

from dataclasses import replace
from fractions import Fraction
from functools import cached_property

from quakedesign.arguments import checked_dataclass
from quakedesign.exact import LowerBound, UpperBound, exact_text, float_above, shortly
from quakedesign.fault import Fault
from quakedesign.files import Json
from quakedesign.guarantees.exact.limit_theorems import SmallestPeak, smallest_peak
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.exact.tracking_proof import TrackingProof, guarantee
from quakedesign.guarantees.result import Guarantee
from quakedesign.guarantees.search.compensated_search import Compensation
from quakedesign.guarantees.search.linear_design import AMPLITUDE, BOX, SATURATION
from quakedesign.guarantees.search.lqg import measured_by
from quakedesign.guarantees.search.worst_case import WorstCase, worst_tracking
from quakedesign.laws import LinearLaw, RestLimit
from quakedesign.laws.sampled_controller import growth_time_at_rest, warning_at_rest
from quakedesign.loop.loop_setup import MEASURED
from quakedesign.loop.sensing.differentiator import least_bound
from quakedesign.lyapunov.exact.claim import Verdict
from quakedesign.sos.exact.strict import written
from quakedesign.text import quantity

_SETUP_KEYS = (
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


@checked_dataclass(frozen=True, kw_only=True)
class TrackingGuarantee(Guarantee):
    """Guarantee of one loop, or the reason why there is none.

    Attributes
    ----------
    fault : Fault
    proof : TrackingProof or NoProof
    worst, stick_search : WorstCase or None
        Worst cases found on the same loop, and on the stick–slip plant; None without a guarantee.
    shorter : TrackingProof or None
        Proof near the longest step that has one, if the design has no guarantee at its own step.
    unproved_step : Fraction or None
        T_s [s] that has no guarantee where `shorter` has one.
    nearest : (str, TrackingProof) or None
        For a loop without a guarantee: a quantity of its setup or of the fault, and the proof of the loop with the
        smallest change of this quantity alone for which a proof was found. `GAINS` is a design in place of given gains,
        `FACTOR` the law with its pressure times `factor`.
    factor : Fraction or None
    compensation : Compensation or None
        Gains, scale and settings of a sliding mode in the scheme ``compensated``.
    notes : tuple of str or None
        Changes of a user-defined law when its floats became exact numbers; None for other laws.
    not_at_rest : str
        Why there is no guarantee on the stick–slip plant, where one was searched for.
    given : bool
        Whether the law is given, so that no design was searched for.
    """

    fault: Fault
    proof: TrackingProof | NoProof
    worst: WorstCase | None = None
    stick_search: WorstCase | None = None
    shorter: TrackingProof | None = None
    unproved_step: Fraction | None = None
    nearest: tuple[str, TrackingProof] | None = None
    factor: Fraction | None = None
    compensation: Compensation | None = None
    notes: tuple[str, ...] | None = None
    not_at_rest: str = ""
    given: bool = False

    @cached_property
    def worst_with_stick(self) -> WorstCase | None:
        """Worst case found on the stick–slip plant; for a given law the search runs on access.

        None for a law that uses slip, slip rate or reference directly, or that is itself unstable.
        """
        if not (self.given and self.proof.available) or self.proof.sampled_loop.law.of_reference or self.grows_at_rest:
            return self.stick_search
        return worst_tracking(self.proof, sticks=True)

    def lines(self) -> list[str]:
        """Lines of text: guarantee, worst case found, changes of the law."""
        tried = [f"not proved on the stick-slip plant: {self.not_at_rest}"] if self.not_at_rest else []
        excess = self.fault.friction.rest_excess
        healed = [
            f"not covered: friction at rest up to {excess:.3g} above friction in slip (healing of the fault file)"
        ]
        return [*self._lines(), *tried, *(healed if excess else ()), *(self.notes or ())]

    def _lines(self) -> list[str]:
        if not self.proof.available:
            lines = [self.proof.sentence()]
            if self.unproved_step is not None:
                lines = [f"not guaranteed at T_s = {float(self.unproved_step):g} s: {self.proof.reason}"]
            if self.shorter is not None:
                lines.append(f"with T_s = {float(self.shorter.sampled_loop.step):g} s: {self.shorter.sentence()}")
            if self.nearest is not None:
                other = f"this law {_with_nearest(*self.nearest)}" if self.given else _with_nearest(*self.nearest)
                if self.factor is not None:
                    other = f"not this law, but the same law with its output multiplied by {shortly(self.factor)}"
                lines.append(f"{other}: {self.nearest[1].sentence()}")
            if len(lines) == 1 and not self.given:
                lines.append("no T_s was found for which a design is proved with this box, disturbance and setup")
            return lines
        lines = [f"proved: {self.proof.sentence()}", *self._at_rest()]
        for name, seen in (("", self.worst), (" on the stick-slip plant", self.worst_with_stick)):
            if seen is not None:
                ends = [quantity(end, "Pa", 4) for end in seen.pressures or ()]
                lines.append(
                    f"worst case found{name}: slip error {quantity(seen.slip_error, 'm')}, slip-rate error "
                    f"{quantity(seen.slip_rate_error or 0.0, 'm/s')}{', pressure ' if ends else ''}{' to '.join(ends)}"
                )
        lines += [*filter(None, [self.stick_slip_gap]), *self._differentiator_lines(), *self.task_lines()]
        if self.exceeded_on_stick_slip:
            lines.append(
                "on the stick-slip plant a run was found that exceeds the bounds, which are proved on the plant "
                "without stick only"
            )
        return lines if self.compensation is None else [*lines, self.compensation.sentence()]

    @property
    def stick_slip_gap(self) -> str:
        """Quantities neither proved nor searched on the stick–slip plant; empty for a design."""
        seen = self.worst_with_stick
        if not self.proof.available or (seen is not None and not (self.given and seen.pressures is None)):
            return ""
        searched = "case" if seen is None else "pressure"
        return (
            f"on the stick-slip plant nothing is proved for a given law, and its worst {searched} is not searched: the "
            "bounds may be exceeded there; run simulate"
        )

    @property
    def grows_at_rest(self) -> float | None:
        """Time constant [s] of growth of the law's states while the fault is at rest, or None.

        The measurements do not respond to the pressure at rest, so that the law runs in open loop.
        """
        if not self.proof.available:
            return None
        return growth_time_at_rest(self.proof.sampled_loop.law, self.proof.sampled_loop.step)

    @property
    def differentiator_bound(self) -> UpperBound | None:
        """Least λ_d [m/s³] of the differentiator for the guarantee; None for a law without one."""
        if not self.proof.available or measured_by(self.proof.sampled_loop.law) != MEASURED[2]:
            return None
        return UpperBound(
            least_bound(self.proof.slip_acceleration, self.proof.sampled_loop.slip_noise, self.proof.sampled_loop.step)
        )

    def _differentiator_lines(self) -> list[str]:
        """Line of text on the differentiator; none for a law without one."""
        bound = self.differentiator_bound
        if bound is None:
            return []
        return [
            "slip rate by the implicit differentiator of the slip error, n_d = 2 with any n_f, from rest: for lambda_d "
            f"of {bound:.3g} m/s^3 or more this estimate is (3 x - 4 x_1 + x_2)/(2 T_s) for all t >= 0, with the last "
            "reading x and the two before it, x_1 and x_2"
        ]

    def _at_rest(self) -> list[str]:
        """Warning about a law whose states grow while the fault is at rest; none for other laws."""
        if not self.proof.available:
            return []
        limited = self.proof.rest_limit is not None
        return list(
            filter(None, [warning_at_rest(self.proof.sampled_loop.law, self.proof.sampled_loop.step, limited=limited)])
        )

    def limit_lines(self) -> list[str]:
        """Performance limits at the same T_s, as text; empty if unknown."""
        limit = self.limit
        if limit is None or not self.proof.available:
            return []
        sampled_loop = self.proof.sampled_loop
        step = f"{float(max(sampled_loop.step, sampled_loop.longest_step)):.6g} s"
        step += " with the noise of the guarantee" if sampled_loop.noise else ""
        both = "" if limit.slip_error is None else f" while the slip error stays below {limit.slip_error.quantity('m')}"
        rate = limit.slip_rate_error.quantity("m/s")
        return [
            f"no controller with zero-order hold over T_s = {step} keeps the slip-rate error below {rate}{both}, "
            "for all disturbances and friction of the box"
        ]

    def task_lines(self) -> list[str]:
        """Performance limits for the measured signals, and a note on the disturbance class; none without a proof."""
        return self.limit_lines() + self._narrower_class()

    def _narrower_class(self) -> list[str]:
        """Line of text which says that the fault's own disturbance is of the class ``rate``; none otherwise."""
        disturbance = self.fault.disturbance
        own = self.proof.available and self.proof.task.change is None
        if not own or disturbance.constant or not disturbance.largest_rate:
            return []
        change = UpperBound(self.fault.disturbance_bounds[1])
        return [
            "these bounds allow the disturbance to jump; that of the fault file changes by at most "
            f"{change:.3g} m/s^3: --class rate (disturbance_class='rate') may prove smaller bounds"
        ]

    @property
    def limit(self) -> SmallestPeak | None:
        """Performance limit at the same T_s, delay and measurements; None for the class ``rate``."""
        if not self.proof.available or self.proof.task.change is not None:
            return None
        sampled_loop = self.proof.sampled_loop
        rate_noise = None if sampled_loop.law.of_slip_alone else sampled_loop.rate_noise
        step = max(sampled_loop.step, sampled_loop.longest_step)
        return smallest_peak(
            self.proof.task, step, sampled_loop.delay, slip_noise=sampled_loop.slip_noise, rate_noise=rate_noise
        )

    @property
    def least_slip_rate(self) -> LowerBound | None:
        """Performance limit of the slip-rate error [m/s] at the same T_s; None if unknown."""
        return None if self.limit is None else self.limit.slip_rate_error

    @property
    def exceeded_on_stick_slip(self) -> bool:
        """Whether the stick–slip plant exceeds the claims in the worst case found."""
        if not self.proof.available or self.worst_with_stick is None:
            return False
        claims, seen = self.proof.claims, self.worst_with_stick
        (least, largest), ends = claims.pressures[-1], seen.pressures
        if ends is not None and not least <= ends[0] <= ends[1] <= largest:
            return True
        return seen.slip_error > claims.slip_error or (seen.slip_rate_error or 0.0) > claims.slip_rate_error

    def to_dict(self) -> Json:
        """Plain values, SI; exact numbers as strings."""
        if not self.proof.available:
            gain = self.proof.small_gain
            other = self.shorter
            shorter = None if other is None else {"step": str(other.sampled_loop.step), **other.claims.to_dict()}
            return {
                "verdict": "undecided",
                "sentence": self.proof.sentence(),
                "reason": self.proof.reason,
                "small_gain": None if gain is None else gain.exact,
                "shorter": shorter,
                "nearest": self.nearest and _nearest(*self.nearest, self.factor),
                **({} if self.notes is None else {"notes": list(self.notes)}),
                **({"stick_slip": self.not_at_rest} if self.not_at_rest else {}),
            }
        bounds, sampled_loop = self.proof.theorem_bounds(), self.proof.sampled_loop
        small = None if not bounds.available else float_above(bounds.small_gain)
        return {
            "verdict": str(self.proof.verdict_of(bounds)),
            "sentence": self.proof.sentence(),
            **self.proof.claims.to_dict(),
            "small_gain": small,
            "worst_found": _seen(self.worst),
            "worst_found_with_stick": _seen(self.worst_with_stick),
            "grows_at_rest": self.grows_at_rest,
            "rest_limit": _rest_limit(self.proof.rest_limit),
            "limit": _limit(self.limit),
            "measured": measured_by(sampled_loop.law),
            "differentiator_bound": None if self.differentiator_bound is None else self.differentiator_bound.exact,
            **{name: str(getattr(sampled_loop, name)) for name in _SETUP_KEYS},
            "pump": None if sampled_loop.pump is None else sampled_loop.pump.to_dict(),
            "law": _law(sampled_loop.law),
            **({} if self.notes is None else {"notes": list(self.notes)}),
            **({"stick_slip": self.not_at_rest} if self.not_at_rest else {}),
            **({} if self.compensation is None else {"controller": self.compensation.to_dict()}),
        }


GAINS = "gains"
FACTOR = "pressure_factor"
_QUANTITIES = {
    "delay_jitter": ("jitter of the delay", "s"),
    "jitter": ("jitter", "s"),
    "averaging": ("averaging time", "s"),
    "delay": ("delay", "s"),
    "lag": ("lag", "s"),
    "diffusion": ("diffusion time L^2/D", "s"),
    "longest_step": ("longest interval", "s"),
}


def _with_nearest(name: str, proof: TrackingProof) -> str:
    """Clause that names the nearest setup with a guarantee."""
    if name == GAINS:
        return "with designed gains"
    if name in _QUANTITIES:
        (title, unit), value = _QUANTITIES[name], getattr(proof.sampled_loop, name)
        if not value:
            return f"without any {title}"
        if name not in ("delay", "lag", "diffusion"):
            return (
                f"with {'an' if title.startswith('a') else 'a'} {title} of at most {LowerBound(value).quantity(unit)}"
            )
        text = shortly(value)  # not "at most": nothing is proved for smaller values
        return f"with a {title} of {text if Fraction(text) == value else exact_text(value)} {unit}"
    if name == BOX:
        pairs = zip(proof.task.spreads, ("k", "eta", "N"), strict=True)
        widths = (f"{LowerBound(100 * width):.3g} % of {of}" for width, of in pairs if width)
        wide = f"of +-{', '.join(widths)}" if any(proof.task.spreads) else "'paper' (uncertain friction alone)"
        return f"with the box {wide}"
    if name == AMPLITUDE:
        return f"with a disturbance of at most {LowerBound(proof.task.amplitude):.3g} m/s^2"
    pump = proof.sampled_loop.pump
    if name == SATURATION and pump is not None and pump.limits is not None:
        low, high = pump.limits
        return f"with a pump from {LowerBound(low).quantity('Pa')} or less to {UpperBound(high).quantity('Pa')} or more"
    if pump is None:
        return "with a pump without limits"
    return f"with a pump of at least {UpperBound(pump.rate or 0).quantity('Pa/s')}"


def _nearest(name: str, proof: TrackingProof, factor: Fraction | None) -> Json:
    """Plain values, SI; exact numbers as strings; a list for a box and for limits of a pump."""
    pump, value = proof.sampled_loop.pump, None
    if name == FACTOR:
        value = str(factor)
    elif name == AMPLITUDE:
        value = str(proof.task.amplitude)
    elif name in (BOX, SATURATION):
        several = proof.task.spreads if name == BOX else (pump and pump.limits) or ()
        return {"quantity": name, "value": [str(v) for v in several], **proof.claims.to_dict()}
    else:
        one = getattr(proof.sampled_loop, name, None) if name in _QUANTITIES else pump and pump.rate
        value = None if one is None else str(one)
    return {"quantity": name, "value": value, **proof.claims.to_dict()}


def with_worst_case(fault: Fault, proof: TrackingProof | NoProof) -> TrackingGuarantee:
    """A guarantee with the worst case found on its loop; takes about a second.

    If a trajectory with stick exceeds claims that were proved with a slowly varying input gain, those for an arbitrary
    input gain replace them, provided that they contain the trajectory.
    """
    if not proof.available:
        return TrackingGuarantee(fault=fault, proof=proof)
    seen = TrackingGuarantee(
        fault=fault, proof=proof, worst=worst_tracking(proof), stick_search=worst_tracking(proof, sticks=True)
    )
    return seen if proof.varying_gain is None or not seen.exceeded_on_stick_slip else _with_arbitrary_gain(seen, proof)


def given_law_with_worst_case(
    fault: Fault, proof: TrackingProof | NoProof, notes: tuple[str, ...] | None = None
) -> TrackingGuarantee:
    """The guarantee of a given law; for a law that uses the errors alone also the worst case found."""
    worst = worst_tracking(proof) if proof.available and not proof.sampled_loop.law.of_reference else None
    return TrackingGuarantee(fault=fault, proof=proof, worst=worst, notes=notes, given=True)


def _with_arbitrary_gain(seen: TrackingGuarantee, proof: TrackingProof) -> TrackingGuarantee:
    arbitrary, worst = guarantee(proof.task, proof.sampled_loop), seen.worst_with_stick
    if not arbitrary.available or worst is None:
        return seen
    exceeded = ["slip_error"] if worst.slip_error > proof.claims.slip_error else []
    faster = (worst.slip_rate_error or 0.0) > proof.claims.slip_rate_error
    exceeded += ["slip_rate_error", "peak_slip_rate"] if faster else []
    claims = replace(proof.claims, **{name: getattr(arbitrary.claims, name) for name in exceeded})
    wider = replace(seen, proof=replace(proof, claims=claims))
    return seen if wider.exceeded_on_stick_slip or wider.proof.check() is not Verdict.PROVED else wider


def _seen(worst: WorstCase | None) -> dict[str, float | None] | None:
    names = ("slip_error", "slip_rate_error", "least_pressure", "largest_pressure")
    return None if worst is None else {name: getattr(worst, name) for name in names}


def _limit(limit: SmallestPeak | None) -> dict[str, str | None] | None:
    if limit is None:
        return None
    slip = limit.slip_error
    return {"slip_rate_error": limit.slip_rate_error.exact, "slip_error": None if slip is None else slip.exact}


def _rest_limit(limit: RestLimit | None) -> dict[str, str] | None:
    names = ("width", "per_slip", "resolution", "least", "largest", "fastest")
    return None if limit is None else {name: exact_text(getattr(limit, name)) for name in names}


def _law(law: LinearLaw) -> Json:
    root = law.implicit_step
    of_root = {} if root is None else {"slopes": written(root.slopes), "remainder": exact_text(root.remainder)}
    matrices = {name: written(getattr(law, name)) for name in ("update", "measured")}
    rows = {name: written(getattr(law, name)) for name in ("output", "feedback", "applied")}
    return {**of_root, "states": list(law.states), **matrices, **rows}
