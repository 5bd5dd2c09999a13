"""Performance limits of every controller, reported with the proved bounds of designed ones."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, require_known
from quakedesign.exact import Bound, LowerBound, UpperBound, rational, shortly
from quakedesign.fault import Fault
from quakedesign.fault.equilibrium import by_equilibrium
from quakedesign.guarantees import (
    NoProof,
    SlidingProof,
    TrackingProof,
    continued,
    design_at,
    design_held,
    farthest_rock,
    longest_delay,
    longest_step,
)
from quakedesign.guarantees.exact.limit_theorems import (
    Noise,
    SlidingPush,
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
# Limits of every controller as values, each beside what a designed one is proved to do.

_Size = float | None  # [Pa]
_POINTS = 24  # of the curve of smallest peaks

KNOWING = "all controllers, linear or not, that know fault, slip, slip rate and disturbance exactly up to the sample"
TOLD = "all controllers, linear or not, that know the fault and measure, up to the sample, {} and nothing else"
WAITING = "all controllers, linear or not, that know everything from the first sample after the disturbance begins"
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
    """One quantity, its limit for all controllers, and how far designed ones have a guarantee.

    Attributes
    ----------
    title : str
    unit : str
    impossible_beyond : LowerBound or UpperBound or None
        A LowerBound: nothing smaller is possible; an UpperBound: nothing larger; None: no limit is known.
    proved_up_to : LowerBound or UpperBound or None
        Of the designs that were tried, the best with a guarantee; None where none was found.
    holds_for : str
        Controllers for which it is impossible.
    """

    title: str
    unit: str
    impossible_beyond: Bound | None
    proved_up_to: Bound | None
    holds_for: str

    def to_dict(self) -> dict[str, str | None]:
        """Decimal texts, rounded outwards."""
        beyond, proved = self.impossible_beyond, self.proved_up_to
        return {
            "impossible_beyond": None if beyond is None else str(beyond),
            "proved_up_to": None if proved is None else str(proved),
            "unit": self.unit,
            "holds_for": self.holds_for,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensing:
    """What controllers measure of slip and slip rate, at all times up to a sample.

    Raises
    ------
    ParameterError
        For noise of a slip rate that is not measured, or a differentiator.
    """

    # What controllers measure, with its noise; all of it is that of the designs that are proved
    setup: LoopSetup = IDEAL

    def __post_init__(self) -> None:
        require_known(self.measured, MEASURED[:2], "measured")
        if self._alone and self.rate_noise:
            noise = f"{float(self.slip_noise):.4g} m and {float(self.rate_noise):.4g} m/s"
            raise ParameterError(
                f"noise of the slip rate needs one that is measured. Received {noise}, measured {self.measured}. Leave "
                "it out."
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
        """Of `smallest_peak`."""
        return {"slip_noise": self.slip_noise, "rate_noise": None if self._alone else self.rate_noise}

    @property
    def wanted(self) -> dict[str, Any]:
        """Arguments of a search for a design."""
        return {"measured": self.measured, "setup": ExactSetup.of(self.setup)}

    def words(self) -> str:
        """Measured quantities with the bounds of their errors, rounded up: a limit holds for larger errors as well."""
        slip = f"the slip with errors of no more than {UpperBound(self.slip_noise).quantity('m')}"
        if self._alone:
            return slip
        return f"{slip}, the slip rate with errors of no more than {UpperBound(self.rate_noise).quantity('m/s')}"

    def knowing(self) -> str:
        """Controllers for which a smallest slip-rate error holds."""
        return TOLD.format(self.words()) if self.noisy else KNOWING


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of a fault, for the worst friction and parameters of its box.

    Attributes
    ----------
    fault : Fault
    withdrawal : Fraction
        Largest withdrawal [Pa], P of −P ≤ p.
    diffusivity : Fraction
        [m²/s].
    slip_error : UpperBound or None
        Within which the smallest slip-rate error is meant [m]; None for any bounded slip error.
    peak_slip_rate_error, largest_step, largest_delay, largest_diffusion_time, farthest_well, smallest_pressure : Limit
        Each of the latter three and the delay at the fault's T_s.
    proved : tuple of TrackingProof
        Of the designs without delay that were found on the way, by T_s.
    sensing : Sensing
        What controllers are told, for the slip-rate error and designs; all others may know everything.
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
        """The disturbances that are meant."""
        return f"any disturbance of at most {float(self.fault.disturbance_bounds[0]):.6g} m/s^2"

    @property
    def achieved(self) -> list[tuple[Fraction, UpperBound]]:
        """T_s [s] and proved slip-rate error [m/s] of the designs that were found on the way, by T_s."""
        return sorted((g.held.step, g.claims.slip_rate_error) for g in self.proved)

    def named(self) -> dict[str, Limit]:
        """All limits by name."""
        return {name: getattr(self, name) for name in QUANTITIES}

    @property
    def stick_slip_rate(self) -> LowerBound | None:
        """Slip rate [m/s] that a fault that sticks reaches at its T_s under every controller that moves it."""
        return smallest_stick_slip_rate(uncertain_plant(self.fault), rational(self.fault.sampling_time))

    @property
    def natural_peak(self) -> float | None:
        """Slip rate [m/s] of the natural earthquake, which is simulated; None where there is none."""
        return natural_peak(self.fault)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, SI; what is proved as decimal texts, rounded outwards."""
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
        """T_s [s] from a tenth of the fault's on, and the slip-rate error [m/s] that no controller goes below.

        Of controllers that are `measured` no more than these, or that know everything.
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
    """Limits of a fault in slow sliding along its task, of its nominal plant linearised there."""

    push: SlidingPush
    guarantee: SlidingProof | None
    rock: Fraction  # L²/D [s] of the well that was asked about; 0 without one

    @property
    def beyond(self) -> bool:
        """Whether the given diffusion path is infeasible for every controller."""
        farthest = self.largest_diffusion_time.impossible_beyond
        return farthest is not None and self.rock > farthest

    @property
    def against(self) -> str:
        """The disturbances that are meant."""
        return f"any shear stress of at most {UpperBound(self.push.amplitude).quantity('Pa')}"

    @property
    def achieved(self) -> list[tuple[Fraction, UpperBound]]:
        """T_s [s] and proved slip-rate error [m/s] of the guarantee."""
        proof = self.guarantee
        return [] if proof is None else [(proof.held.step, above_the_reference(proof))]

    @property
    def stick_slip_rate(self) -> None:
        """None: the fault never rests."""

    @property
    def natural_peak(self) -> float | None:
        """None: it needs a simulated cycle."""
        return None

    def to_dict(self) -> dict[str, Any]:
        """Plain values, SI; what is proved as decimal texts, rounded outwards."""
        return Limits.to_dict(self) | {"disturbance": None, "stress": float(self.push.amplitude)}

    def smallest_peaks(self, *, measured: bool = True) -> list[tuple[Fraction, LowerBound]]:
        """T_s [s] from a tenth of the fault's on, and the slip-rate error [m/s] that no controller goes below."""
        return [(step, self.push.smallest_rate_error(step)) for step in self._steps()]


def above_the_reference(proof: SlidingProof) -> UpperBound:
    """Proved bound of the slip rate, less V [m/s]."""
    return UpperBound(proof.peak_slip_rate - proof.task.rate)


# ----------------------------------------------------------------------
# What no controller can do with a fault, beside what a designed one is proved to do.


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

    With friction that has a state: in slow sliding along its task, of the nominal plant linearised there.

    There are none of the class ``rate``: every proof pushes the fault with a disturbance that jumps.

    Parameters
    ----------
    fault : Fault
    setup : LoopSetup
        T_s in place of the fault's; what controllers measure, with its noise, and the loop with which designs are
        proved. In slow sliding T_s, a lag or a diffusion path alone; the path of a well near the fault without both.
    pressure : float, optional
        Largest withdrawal [Pa]; the effective normal stress unless given. In slow sliding: largest pressure beside what
        the reference needs, in both directions.
    diffusivity : float
        Of the rock between well and fault [m²/s].
    stress : float, optional
        Of friction with a state: bound of the shear stress disturbance [Pa]; the largest that a design stands unless
        given.
    spread : float, str or Fraction
        Of friction with a state: by how much of their values a, b and D_c may be off [-] for a design that is proved;
        what is impossible is so for the nominal ones.
    prove : bool
        Whether to look for designs with a guarantee, which takes a minute.
    **entered : float, str or Fraction
        Fields of `LoopSetup` that replace those of `setup`, such as ``delay="20 ms"``.

    Returns
    -------
    Limits

    Raises
    ------
    ParameterError
        For a negative pressure, a diffusivity that is not positive, a stress without friction that has a state, no
        stress where no design stands any, noise or more of a setup with it, negative noise, or noise of a slip rate
        that is not measured.
    """
    off = rational(spread, "spread")
    fault, setup = setup.with_given(**entered).at_step(fault)
    return _of_plant(fault, pressure, diffusivity, stress, Sensing(setup=setup), off, prove)


def _limits_at_rest(
    fault: Fault, pressure: _Size, diffusivity: float, stress: _Size, sensing: Sensing, off: Fraction, prove: bool
) -> Limits:
    if stress is not None or off:
        raise ParameterError(
            f"{'a spread' if off else 'stress'} needs friction with a state. Received {fault.friction.name}. Leave it "
            "out: the box and the disturbance of the fault are meant."
        )
    task, step = uncertain_plant(fault), rational(fault.sampling_time)
    withdrawal, spread = _pressure_and_diffusivity(fault, pressure, diffusivity)
    proofs, own = _proved_steps(task, step, sensing) if prove else ((), None)
    late = ExactSetup.of(sensing.setup).delay
    peak, proved = smallest_peak(task, step, late, **sensing.bounds), dict[str, Bound | None]()
    if proofs:
        proved["largest_step"] = LowerBound(proofs[-1].held.step)
    if own is not None:
        proved["peak_slip_rate_error"] = own.claims.slip_rate_error
        longest = longest_delay(task, step, **sensing.wanted)
        proved["largest_delay"] = LowerBound(longest.held.delay) if longest else None
        proved["smallest_pressure"] = UpperBound(max(-own.claims.pressures[-1][0], Fraction(0)))
        if (farthest := farthest_rock(task, step, **sensing.wanted)) is not None:
            proved["largest_diffusion_time"] = rock = LowerBound(farthest.held.diffusion)
            proved["farthest_well"] = nearest_proved_well(rock, spread)
    return Limits(
        fault=fault,
        withdrawal=withdrawal,
        diffusivity=spread,
        slip_error=peak.slip_error if peak else None,
        **_limits(
            _impossible(task, withdrawal, step, spread, peak.slip_rate_error if peak else None),
            proved,
            sensing.knowing(),
        ),
        proved=proofs,
        sensing=sensing,
    )


def _impossible(
    push: FaultPlant | SlidingPush, withdrawal: Fraction, step: Fraction, diffusivity: Fraction, peak: Bound | None
) -> dict[str, Bound | None]:
    """What no controller can do, by name; nothing where no limit is known."""
    reaction, path = longest_reaction(push, withdrawal), longest_diffusion(push, withdrawal, step)
    return {
        "peak_slip_rate_error": peak,
        "largest_step": reaction,
        "largest_delay": None if reaction is None else UpperBound(max(reaction - step, Fraction(0))),
        "largest_diffusion_time": path,
        "farthest_well": None if path is None else farthest_well(path, diffusivity),
        "smallest_pressure": smallest_withdrawal(push, step),
    }


def _limits(
    impossible: Mapping[str, Bound | None], proved: Mapping[str, Bound | None], knowing: str, plant: str = ""
) -> dict[str, Limit]:
    """Limits by name, of a plant that is not the fault itself if one is named."""
    return {
        name: Limit(
            title=title,
            unit=unit,
            impossible_beyond=impossible[name],
            proved_up_to=proved.get(name),
            holds_for=(knowing if name == "peak_slip_rate_error" else WAITING) + plant,
        )
        for name, (title, unit) in QUANTITIES.items()
    }


def _require_plain(fault: Fault, sensing: Sensing) -> None:
    if sensing.setup.noise or sensing.measured != MEASURED[0]:
        raise ParameterError(
            f"no limit of slow sliding is known for noise. Received {fault.friction.name}, measured "
            f"{sensing.words()}. Leave noise out: what cannot be done without it cannot be done with it."
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
            "m^2/s. Give the size of the largest withdrawal."
        )
    return withdrawal, spread


def _sliding_limits(
    fault: Fault, pressure: _Size, diffusivity: float, stress: _Size, plain: Sensing, off: Fraction, prove: bool
) -> Limits:
    """Beside what is proved of a design behind a path, or behind that of a near well; of none without a path.

    Unless a stress is told, it is that which the design stands, or that with a near well where none is found behind the
    path; behind a path that is impossible under the latter no design is looked for.
    """
    _require_plain(fault, plain)
    setup = plain.setup if prove else None
    withdrawal, spread = _pressure_and_diffusivity(fault, pressure, diffusivity)
    model, step = sliding_model(fault), rational(fault.sampling_time)
    requested = None if stress is None else rational(stress, "stress")
    path = setup if setup is not None and setup.path else None
    through = ExactSetup(diffusion=near_path(model))
    result = None if setup is None else guarantee_sliding(fault, stress=requested, spread=off, setup=through)
    proof = result.proof if result is not None and result.proof.proved else None
    amplitude = requested if requested is not None or proof is None else proof.task.stress
    if amplitude is None or amplitude <= 0:
        why = f": {result.reason}" if result is not None and not result.proved else ""
        raise ParameterError(
            "limits of slow sliding need a shear stress disturbance above 0. Received none, and no design was "
            f"found that withstands any{why}. Give --stress, such as '25 kPa'."
        )
    push = SlidingPush(model=model, amplitude=amplitude)
    farthest, rock = longest_diffusion(push, withdrawal, step), (path or IDEAL).diffusion
    if path is not None and (farthest is None or rock <= farthest):
        behind = guarantee_sliding(fault, stress=requested, spread=off, setup=ExactSetup.of(path)).proof
        proof = behind if behind.proved else None
        push = replace(push, amplitude=proof.task.stress) if proof else push
    impossible = _impossible(push, withdrawal, step, spread, push.smallest_rate_error(step))
    proved: dict[str, Bound | None] = {}
    if proof is not None:
        proved["peak_slip_rate_error"] = above_the_reference(proof)
        proved["largest_step"] = LowerBound(step)
        proved["largest_diffusion_time"] = LowerBound(proof.held.diffusion)
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
        push=push,
        guarantee=proof,
        rock=rock,
    )


_of_plant = by_equilibrium(rest=_limits_at_rest, sliding=_sliding_limits)


def _proved_steps(
    task: FaultPlant, step: Fraction, sensing: Sensing
) -> tuple[tuple[TrackingProof, ...], TrackingProof | None]:
    """Guarantees at growing T_s up to nearly the longest, and that at the fault's own, if there is one."""
    own: TrackingProof | NoProof | None = design_held(task, step, objective="peak", **sensing.wanted)
    longest = longest_step(task, **sensing.wanted)
    if own is not None and own.proved:
        own = _best_at(own, sensing)
    else:
        own = continued(task, step, longest, **sensing.wanted)
    proofs = [] if own is None else [own]
    if longest is not None and (own is None or longest.guarantee.held.step > step):
        proofs.append(design_at(task, longest))
    return tuple(proofs), own


def _best_at(least_peak: TrackingProof, sensing: Sensing) -> TrackingProof:
    """Of a design for the smallest slip-rate error and one that tracks, that with the smaller one that is proved."""
    tracking = design_held(least_peak.task, least_peak.held.step, objective="tracking", **sensing.wanted)
    proofs = [least_peak, *([tracking] if tracking.proved else [])]
    return min(proofs, key=lambda g: g.claims.slip_rate_error)
