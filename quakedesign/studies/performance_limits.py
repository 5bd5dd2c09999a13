"""Performance limits of every controller, and proved bounds of designed ones."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, require_known
from quakedesign.exact import Bound, LowerBound, UpperBound, rational, shortly
from quakedesign.fault import Fault
from quakedesign.fault.equilibrium import by_equilibrium
from quakedesign.files import Json
from quakedesign.guarantees import (
    NoProof,
    SlidingProof,
    TrackingProof,
    design_at,
    design_near_longer_step,
    design_sampled_law,
    longest_delay,
    longest_diffusion_time,
    longest_step,
)
from quakedesign.guarantees.exact.limit_theorems import (
    DisturbedSliding,
    Noise,
    farthest_well,
    longest_diffusion,
    longest_reaction,
    nearest_proved_well,
    smallest_peak,
    smallest_stick_slip_rate,
    smallest_withdrawal,
)
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search.lqg import near_path, sliding_model
from quakedesign.guarantees.sliding_result import guarantee_sliding
from quakedesign.loop.loop_setup import IDEAL, MEASURED, LoopSetup, Quantity
from quakedesign.plant import FaultPlant, uncertain_plant
from quakedesign.simulation.earthquake import natural_peak

# ----------------------------------------------------------------------
# Limits of every controller as values, each reported with the proved bound of a designed one.

_Size = float | None  # [Pa]
_POINTS = 24  # intervals on the curve of smallest peaks

KNOWING = "all controllers, linear or not, that know fault, slip, slip rate and disturbance exactly up to the sample"
MEASURING = "all controllers, linear or not, that know the fault and measure, up to the sample, {} and nothing else"
WAITING = "all controllers, linear or not, that know everything, but act only at samples after the disturbance begins"
QUANTITIES = {
    "peak_slip_rate_error": ("slip-rate error", "m/s"),
    "largest_step": ("T_s", "s"),
    "largest_delay": ("delay", "s"),
    "largest_diffusion_time": ("diffusion time L^2/D", "s"),
    "farthest_well": ("distance of the well", "m"),
    "smallest_pressure": ("withdrawal", "Pa"),
}
"""Title and unit of every limit, by the name of its field."""


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """One quantity, its limit for all controllers, and the best proved value of designed ones.

    Attributes
    ----------
    title : str
    unit : str
    impossible_beyond : LowerBound or UpperBound or None
        A LowerBound: no smaller value is feasible; an UpperBound: no larger one; None: no limit is known.
    proved_up_to : LowerBound or UpperBound or None
        Best guarantee among the designs that were tried; None without one.
    holds_for : str
        Controllers to which the limit applies.
    """

    title: str
    unit: str
    impossible_beyond: Bound | None
    proved_up_to: Bound | None
    holds_for: str

    def to_dict(self) -> dict[str, str | None]:
        """Decimal strings, rounded outwards."""
        beyond, proved = self.impossible_beyond, self.proved_up_to
        return {
            "impossible_beyond": None if beyond is None else str(beyond),
            "proved_up_to": None if proved is None else str(proved),
            "unit": self.unit,
            "holds_for": self.holds_for,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensing:
    """Measurements of slip and slip rate that controllers have, at all times up to a sample.

    Raises
    ------
    ParameterError
        For noise of a slip rate that is not measured, or a differentiator.
    """

    # Measured quantities and their noise; the proved designs use the whole setup
    setup: LoopSetup = IDEAL

    def __post_init__(self) -> None:
        require_known(self.measured, MEASURED[:2], "measured")
        if self._alone and self.rate_noise:
            raise ParameterError(
                f"rate noise must be 0 unless the slip rate is measured. Received {float(self.rate_noise):.4g} m/s, "
                f"measured {self.measured}. Omit the rate noise, or measure {MEASURED[0]}."
            )

    @property
    def measured(self) -> str:
        """``slip-and-rate`` or ``slip``."""
        return self.setup.measured

    @property
    def slip_noise(self) -> Fraction:
        """Bound of the measurement error of the slip [m]."""
        return self.setup.slip_noise

    @property
    def rate_noise(self) -> Fraction:
        """Bound of the measurement error of the slip rate [m/s]."""
        return self.setup.rate_noise

    @property
    def _alone(self) -> bool:
        return self.measured == MEASURED[1]

    @property
    def noisy(self) -> bool:
        """Whether measurement noise limits controllers: noisy slip, and a noisy or unmeasured slip rate."""
        return bool(self.slip_noise and (self._alone or self.rate_noise))

    @property
    def bounds(self) -> Noise:
        """Noise arguments of `smallest_peak`."""
        return {"slip_noise": self.slip_noise, "rate_noise": None if self._alone else self.rate_noise}

    @property
    def options(self) -> dict[str, Any]:
        """Arguments of a search for a design."""
        return {"measured": self.measured, "setup": ExactSetup.of(self.setup)}

    def summary(self) -> str:
        """Measured quantities with the bounds of their errors, rounded up: a limit holds for larger errors as well."""
        slip = f"the slip with errors of no more than {UpperBound(self.slip_noise).quantity('m')}"
        if self._alone:
            return slip
        return f"{slip}, the slip rate with errors of no more than {UpperBound(self.rate_noise).quantity('m/s')}"

    def controllers(self) -> str:
        """Controllers to which the limit of the slip-rate error applies."""
        return MEASURING.format(self.summary()) if self.noisy else KNOWING


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of a fault, for the worst friction and parameters of its box.

    Attributes
    ----------
    fault : Fault
    withdrawal : Fraction
        Largest withdrawal [Pa], P of −P ≤ p.
    diffusivity : Fraction
        Diffusivity between well and fault [m²/s].
    slip_error : UpperBound or None
        Bound of the slip error for the smallest slip-rate error [m]; None for any bounded slip error.
    peak_slip_rate_error, largest_step, largest_delay, largest_diffusion_time, farthest_well, smallest_pressure : Limit
        Limits; all but `largest_step` are for the fault's T_s.
    proved : tuple of TrackingProof
        Guarantees of the designs without delay, ordered by T_s.
    sensing : Sensing
        Measurements of controllers, for the slip-rate error and designs; all other limits assume complete knowledge.
    """

    fault: Fault
    withdrawal: Fraction
    diffusivity: Fraction
    slip_error: UpperBound | None
    peak_slip_rate_error: Limit
    largest_step: Limit
    largest_delay: Limit
    largest_diffusion_time: Limit
    farthest_well: Limit
    smallest_pressure: Limit
    proved: tuple[TrackingProof, ...]
    sensing: Sensing

    def __repr__(self) -> str:
        return f"Limits({self.fault.name}: {', '.join(self.named())})"

    @property
    def against(self) -> str:
        """Disturbances of the limits, in words."""
        return f"any disturbance of at most {float(self.fault.disturbance_bounds[0]):.6g} m/s^2"

    @property
    def achieved(self) -> list[tuple[Fraction, UpperBound]]:
        """T_s [s] and proved slip-rate error [m/s] of the designs, ordered by T_s."""
        return sorted((g.sampled_loop.step, g.claims.slip_rate_error) for g in self.proved)

    def named(self) -> dict[str, Limit]:
        """All limits by name."""
        return {name: getattr(self, name) for name in QUANTITIES}

    @property
    def stick_slip_rate(self) -> LowerBound | None:
        """Lower bound of the peak slip rate [m/s] of the stick–slip plant for every controller that moves it."""
        return smallest_stick_slip_rate(uncertain_plant(self.fault), rational(self.fault.sampling_time))

    @property
    def natural_peak(self) -> float | None:
        """Slip rate [m/s] of the simulated natural earthquake; None without one."""
        return natural_peak(self.fault)

    def to_dict(self) -> Json:
        """Plain values, SI; proved bounds are decimal texts, rounded outwards."""
        return {
            "fault": self.fault.name,
            "box": self.fault.box.name,
            "disturbance": float(self.fault.disturbance_bounds[0]),
            "class": "amplitude",
            "step": self.fault.sampling_time,
            "withdrawal": float(self.withdrawal),
            "diffusivity": float(self.diffusivity),
            "measured": self.sensing.measured,
            "slip_noise": str(self.sensing.slip_noise),
            "rate_noise": str(self.sensing.rate_noise),
            "slip_error": None if self.slip_error is None else str(self.slip_error),
            "stick_slip_rate": None if (least := self.stick_slip_rate) is None else str(least),
            **{name: limit.to_dict() for name, limit in self.named().items()},
        }

    def smallest_peaks(self, *, measured: bool = True) -> list[tuple[Fraction, LowerBound]]:
        """T_s [s] from a tenth of the fault's upward, and lower bounds of the slip-rate error [m/s] of any controller.

        If `measured`, for controllers with these measurements only, else for controllers that know everything.
        """
        task, noise = uncertain_plant(self.fault), (self.sensing if measured else Sensing()).bounds
        peaks = [(step, smallest_peak(task, step, **noise)) for step in self._steps()]
        return [(step, peak.slip_rate_error) for step, peak in peaks if peak is not None]

    def _steps(self) -> list[Fraction]:
        first = rational(self.fault.sampling_time) / 10
        last = float(self.largest_step.impossible_beyond or 10_000 * first)
        ratio = max(last / float(first), 100.0) ** (1 / _POINTS)
        return [Fraction(f"{float(first) * ratio**i:.4g}") for i in range(_POINTS + 1)]


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingLimits(Limits):
    """Limits of a fault in slow sliding along its task, for its nominal plant linearised there."""

    disturbed: DisturbedSliding
    guarantee: SlidingProof | None
    diffusion_time: Fraction  # L²/D [s] of the given well; 0 without one

    @property
    def beyond(self) -> bool:
        """Whether the given diffusion path is infeasible for every controller."""
        farthest = self.largest_diffusion_time.impossible_beyond
        return farthest is not None and self.diffusion_time > farthest

    @property
    def against(self) -> str:
        """Disturbances of the limits, in words."""
        return f"any shear stress of at most {UpperBound(self.disturbed.amplitude).quantity('Pa')}"

    @property
    def achieved(self) -> list[tuple[Fraction, UpperBound]]:
        """T_s [s] and proved slip-rate error [m/s] of the guarantee."""
        proof = self.guarantee
        return [] if proof is None else [(proof.sampled_loop.step, above_the_reference(proof))]

    @property
    def stick_slip_rate(self) -> None:
        """None: the fault never rests."""

    @property
    def natural_peak(self) -> float | None:
        """None: it needs a simulated cycle."""
        return None

    def to_dict(self) -> Json:
        """Plain values, SI; proved bounds are decimal texts, rounded outwards."""
        return Limits.to_dict(self) | {"disturbance": None, "stress": float(self.disturbed.amplitude)}

    def smallest_peaks(self, *, measured: bool = True) -> list[tuple[Fraction, LowerBound]]:
        """T_s [s] from a tenth of the fault's upward, and lower bounds of the slip-rate error [m/s]."""
        return [(step, self.disturbed.smallest_rate_error(step)) for step in self._steps()]


def above_the_reference(proof: SlidingProof) -> UpperBound:
    """Proved bound of the slip rate minus V [m/s]."""
    return UpperBound(proof.peak_slip_rate - proof.task.rate)


# ----------------------------------------------------------------------
# Performance limits of a fault, with proved bounds of a designed controller.


def limits(
    fault: Fault,
    setup: LoopSetup = IDEAL,
    *,
    pressure: float | None = None,
    diffusivity: float = 1.0,
    stress: float | None = None,
    spread: Quantity = 0,
    prove: bool = True,
    **entered: Quantity | None,
) -> Limits:
    """Performance limits of every controller for a disturbance of the class ``amplitude``.

    For friction with a state: in slow sliding along its task, for the nominal plant linearised there.

    There are no limits for the class ``rate``: every proof of a limit uses a disturbance that jumps.

    Parameters
    ----------
    fault : Fault
    setup : LoopSetup
        T_s in place of the fault's; measurements of the controllers with their noise, and the loop of the proved
        designs. In slow sliding only T_s, a lag or a diffusion path; by default the path of a well near the fault.
    pressure : float, optional
        Largest withdrawal [Pa]; by default the effective normal stress. In slow sliding: largest pressure relative to
        that of the reference, in both directions.
    diffusivity : float
        Diffusivity of the rock between well and fault [m²/s].
    stress : float, optional
        For friction with a state: bound of the shear stress disturbance [Pa]; by default the largest that a design
        withstands.
    spread : float, str or Fraction
        For friction with a state: relative uncertainty of a, b and D_c [-] in the proof of a design; the limits are
        those of the nominal values.
    prove : bool
        Whether to search for designs with a guarantee, which takes a minute.
    **entered : float, str or Fraction
        Fields of `LoopSetup` that replace those of `setup`, such as ``delay="20 ms"``.

    Returns
    -------
    Limits

    Raises
    ------
    ParameterError
        For a negative pressure, a diffusivity that is not positive, a stress for friction without a state, a missing
        stress if no design withstands any, a setup of slow sliding with noise or more than lag and diffusion, negative
        noise, or noise of an unmeasured slip rate.
    """
    off = rational(spread, "spread")
    fault, setup = setup.with_given(**entered).at_step(fault)
    return _of_plant(fault, pressure, diffusivity, stress, Sensing(setup=setup), off, prove)


def _limits_at_rest(
    fault: Fault, pressure: _Size, diffusivity: float, stress: _Size, sensing: Sensing, off: Fraction, prove: bool
) -> Limits:
    if stress is not None or off:
        raise ParameterError(
            f"{'a spread' if off else 'stress'} needs friction with a state. Received {fault.friction.name}. Omit it: "
            "the limits are for the box and the disturbance of the fault."
        )
    task, step = uncertain_plant(fault), rational(fault.sampling_time)
    withdrawal, spread = _pressure_and_diffusivity(fault, pressure, diffusivity)
    proofs, own = _proved_steps(task, step, sensing) if prove else ((), None)
    late = ExactSetup.of(sensing.setup).delay
    peak, proved = smallest_peak(task, step, late, **sensing.bounds), dict[str, Bound | None]()
    if proofs:
        proved["largest_step"] = LowerBound(proofs[-1].sampled_loop.step)
    if own is not None:
        proved["peak_slip_rate_error"] = own.claims.slip_rate_error
        longest = longest_delay(task, step, **sensing.options)
        proved["largest_delay"] = LowerBound(longest.sampled_loop.delay) if longest else None
        proved["smallest_pressure"] = UpperBound(max(-own.claims.pressures[-1][0], Fraction(0)))
        if (farthest := longest_diffusion_time(task, step, **sensing.options)) is not None:
            proved["largest_diffusion_time"] = largest = LowerBound(farthest.sampled_loop.diffusion)
            proved["farthest_well"] = nearest_proved_well(largest, spread)
    return Limits(
        fault=fault,
        withdrawal=withdrawal,
        diffusivity=spread,
        slip_error=peak.slip_error if peak else None,
        **_limits(
            _limits_by_name(task, withdrawal, step, spread, peak.slip_rate_error if peak else None),
            proved,
            sensing.controllers(),
        ),
        proved=proofs,
        sensing=sensing,
    )


def _limits_by_name(
    task: FaultPlant | DisturbedSliding, withdrawal: Fraction, step: Fraction, diffusivity: Fraction, peak: Bound | None
) -> dict[str, Bound | None]:
    """Performance limits of every controller by name; None where no limit is known."""
    reaction, path = longest_reaction(task, withdrawal), longest_diffusion(task, withdrawal, step)
    return {
        "peak_slip_rate_error": peak,
        "largest_step": reaction,
        "largest_delay": None if reaction is None else UpperBound(max(reaction - step, Fraction(0))),
        "largest_diffusion_time": path,
        "farthest_well": None if path is None else farthest_well(path, diffusivity),
        "smallest_pressure": smallest_withdrawal(task, step),
    }


def _limits(
    impossible: Mapping[str, Bound | None], proved: Mapping[str, Bound | None], controllers: str, plant: str = ""
) -> dict[str, Limit]:
    """Limits by name; `plant` names a plant other than the fault itself."""
    return {
        name: Limit(
            title=title,
            unit=unit,
            impossible_beyond=impossible[name],
            proved_up_to=proved.get(name),
            holds_for=(controllers if name == "peak_slip_rate_error" else WAITING) + plant,
        )
        for name, (title, unit) in QUANTITIES.items()
    }


def _require_plain(fault: Fault, sensing: Sensing) -> None:
    if sensing.setup.noise or sensing.measured != MEASURED[0]:
        raise ParameterError(
            f"no performance limit of slow sliding with noise is known. Received {fault.friction.name}, measured "
            f"{sensing.summary()}. Omit the noise: what is infeasible without noise is infeasible with it."
        )
    if more := sensing.setup.given().keys() - {"lag", "diffusion"}:
        raise ParameterError(
            f"limits of slow sliding take lag and diffusion only. Received {', '.join(sorted(more))}. Omit these."
        )


def _pressure_and_diffusivity(fault: Fault, pressure: float | None, diffusivity: float) -> tuple[Fraction, Fraction]:
    withdrawal = rational(fault.effective_normal_stress if pressure is None else pressure, "pressure")
    spread = rational(diffusivity, "diffusivity")
    if withdrawal <= 0 or spread <= 0:
        raise ParameterError(
            f"pressure and diffusivity must be positive. Received {shortly(withdrawal)} Pa and {shortly(spread)} "
            "m^2/s. Give the largest withdrawal as a positive number."
        )
    return withdrawal, spread


def _sliding_limits(
    fault: Fault, pressure: _Size, diffusivity: float, stress: _Size, plain: Sensing, off: Fraction, prove: bool
) -> Limits:
    """Limits and proved bounds of a design with the given path, or by default with that of a near well.

    By default the stress is the largest that the design withstands. If no design is found for the path, the stress is
    that of a design with a near well. If the path is infeasible under that stress, no design is searched for the path.
    """
    _require_plain(fault, plain)
    setup = plain.setup if prove else None
    withdrawal, spread = _pressure_and_diffusivity(fault, pressure, diffusivity)
    model, step = sliding_model(fault), rational(fault.sampling_time)
    requested = None if stress is None else rational(stress, "stress")
    path = setup if setup is not None and setup.path else None
    through = ExactSetup(diffusion=near_path(model))
    result = None if setup is None else guarantee_sliding(fault, stress=requested, spread=off, setup=through)
    proof = result.proof if result is not None and result.proof.available else None
    amplitude = requested if requested is not None or proof is None else proof.task.stress
    if amplitude is None or amplitude <= 0:
        why = f": {result.reason}" if result is not None and not result.proved else ""
        raise ParameterError(
            "limits of slow sliding need a shear stress disturbance above 0. Received none, and no design was "
            f"found that withstands any{why}. Give --stress, such as '25 kPa'."
        )
    task = DisturbedSliding(model=model, amplitude=amplitude)
    farthest, diffusion = longest_diffusion(task, withdrawal, step), (path or IDEAL).diffusion
    if path is not None and (farthest is None or diffusion <= farthest):
        behind = guarantee_sliding(fault, stress=requested, spread=off, setup=ExactSetup.of(path)).proof
        proof = behind if behind.available else None
        task = replace(task, amplitude=proof.task.stress) if proof else task
    impossible = _limits_by_name(task, withdrawal, step, spread, task.smallest_rate_error(step))
    proved: dict[str, Bound | None] = {}
    if proof is not None:
        proved["peak_slip_rate_error"] = above_the_reference(proof)
        proved["largest_step"] = LowerBound(step)
        proved["largest_diffusion_time"] = LowerBound(proof.sampled_loop.diffusion)
        proved["smallest_pressure"] = proof.claims.push
    limits_by_name = _limits(impossible, proved, KNOWING, ", of the linearised plant")
    return SlidingLimits(
        fault=fault,
        withdrawal=withdrawal,
        diffusivity=spread,
        slip_error=None,
        **limits_by_name | {"smallest_pressure": replace(limits_by_name["smallest_pressure"], title="pressure")},
        proved=(),
        sensing=Sensing(),
        disturbed=task,
        guarantee=proof,
        diffusion_time=diffusion,
    )


_of_plant = by_equilibrium(rest=_limits_at_rest, sliding=_sliding_limits)


def _proved_steps(
    task: FaultPlant, step: Fraction, sensing: Sensing
) -> tuple[tuple[TrackingProof, ...], TrackingProof | None]:
    """Guarantees at increasing T_s up to nearly the longest, and that at the fault's own T_s, if there is one."""
    own: TrackingProof | NoProof | None = design_sampled_law(task, step, objective="peak", **sensing.options)
    longest = longest_step(task, **sensing.options)
    if own is not None and own.available:
        own = _best_at(own, sensing)
    else:
        own = design_near_longer_step(task, step, longest, **sensing.options)
    proofs = [] if own is None else [own]
    if longest is not None and (own is None or longest.guarantee.sampled_loop.step > step):
        proofs.append(design_at(task, longest))
    return tuple(proofs), own


def _best_at(least_peak: TrackingProof, sensing: Sensing) -> TrackingProof:
    """The better of the designs for peak and for tracking: the one with the smaller proved slip-rate error."""
    tracking = design_sampled_law(
        least_peak.task, least_peak.sampled_loop.step, objective="tracking", **sensing.options
    )
    proofs = [least_peak, *([tracking] if tracking.available else [])]
    return min(proofs, key=lambda g: g.claims.slip_rate_error)
