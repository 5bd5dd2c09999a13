"""Runs of a fault whose friction has a state: free, as it is by nature, or held in slow sliding."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from fractions import Fraction
from functools import cached_property
from time import perf_counter
from typing import Any

import numpy as np

from quakedesign.certificates.slow_sliding import SlidingGuarantee
from quakedesign.controllers import Sampling
from quakedesign.errors import ParameterError, SimulationError, UnknownNameError, require_known
from quakedesign.fault import Disturbance, Fault, SlidingReference
from quakedesign.fault.checks import require_positive
from quakedesign.loop import SlidingModel
from quakedesign.loop.actuators import Actuator, SampledStage
from quakedesign.loop.sensing import Transducer
from quakedesign.rationals import rational
from quakedesign.simulation import PressureCourse, StateTrajectory, simulate_state
from quakedesign.simulation.metrics import Metrics
from quakedesign.simulation.outcome import Outcome
from quakedesign.simulation.sliding_conditions import TIDE, Tide
from quakedesign.simulation.slip_events import SlipEvent, cycle_outcome, dynamic_rate, last_cycle, slip_events
from quakedesign.simulation.slow_sliding import PLANTS, SlidingRun, simulate_sliding
from quakedesign.simulation.starting_state import StartingState, cycles, disturbed, late_in_cycle, locked, sliding
from quakedesign.symbolic import derive
from quakedesign.synthesis import Design
from quakedesign.synthesis.linear.plant.sliding_model import growth_rate, sliding_model
from quakedesign.synthesis.linear.sampled.slow_sliding import sliding_law

_RTOL = 1e-8
_NATURAL = (True, "radau"), (True, "cvodes"), (False, "cvodes")  # inertia, method: of cycles, in this order
_MOMENT = 1e-3  # of the state's age at first, over which any solver goes on
_UNDISTURBED = 1e-3  # change of the logarithm of the slip rate
_SWINGS = 4  # of the stress at least, in a run that is shown
_SHOWN = 500  # D_c/V of a slow task that are run: the loop settles within some tens


@dataclass(frozen=True, kw_only=True)
class StateRun:
    """A run, and what it comes to.

    Attributes
    ----------
    fault : Fault
    loading_rate : float
        v_∞ [m/s].
    start : StartingState
    trajectory : StateTrajectory
    seconds : float
        Time that it took [s], where that was measured.
    failed : str
        Why what the fault does is not known: the trajectory is but the first instants. Empty otherwise.
    """

    fault: Fault
    loading_rate: float
    start: StartingState
    trajectory: StateTrajectory
    seconds: float = 0.0
    failed: str = ""

    @property
    def outcome(self) -> Outcome:
        """Earthquake, slow slip or creep; unknown where that could not be computed."""
        if self.failed:
            return Outcome(kind="unknown", peak_slip_rate=None, share_of_natural=None)
        return cycle_outcome(self.fault, self.trajectory)

    @property
    def time(self) -> "np.ndarray":
        """[s], shape (n,)."""
        return self.trajectory.time

    @property
    def slip(self) -> "np.ndarray":
        """[m], shape (n,)."""
        return self.trajectory.slip

    @property
    def slip_rate(self) -> "np.ndarray":
        """[m/s], shape (n,)."""
        return self.trajectory.slip_rate

    @cached_property
    def slip_events(self) -> tuple[SlipEvent, ...]:
        """Every event."""
        return slip_events(self.fault, self.trajectory, self.loading_rate)

    @property
    def cycle(self) -> dict[str, float | None]:
        """Recurrence interval [s], slip [m] and magnitude of the last one that is complete; None for none."""
        return last_cycle(self.slip_events)

    @property
    def natural_peak(self) -> float | None:
        """Largest slip rate of its events [m/s]; None without any."""
        return self.outcome.peak_slip_rate if self.slip_events else None

    @property
    def metrics(self) -> Metrics:
        """Largest slip rate and number of steps: nothing is followed."""
        run = self.trajectory
        return Metrics(
            peak_slip_rate=self.outcome.peak_slip_rate, settled_from=0.0, steps=len(run.time) - 1, seconds=self.seconds
        )

    @property
    def events(self) -> dict[str, float]:
        """Nothing that ends a run happened."""
        return {}

    @property
    def provenance(self) -> dict[str, Any]:
        """How it was made, as of runs with a controller."""
        run, plant = self.trajectory.provenance, "smooth" if self.trajectory.provenance["inertia"] == "True" else ""
        return {**run, "scheme": "continuous", "step": None, "plant": plant or "quasi-dynamic", "controller": "none"}

    @property
    def resting(self) -> bool:
        """Whether the run slides steadily at the law's reference rate, where that is unstable: nothing disturbs it."""
        still = np.all(np.abs(np.log(self.trajectory.slip_rate / self.fault.friction.operating_rate)) < _UNDISTURBED)
        return bool(still) and derive(self.fault).unstable

    def to_dict(self) -> dict[str, Any]:
        """Answer of ``simulate`` for such a fault, SI units; the cycle is the last one that is complete."""
        run = self.trajectory
        return {
            "outcome": self.outcome.to_dict() | {"earthquake_from": 0.1 * dynamic_rate(self.fault)},
            "resting": self.resting,
            "loading_rate": self.loading_rate,
            "start": {
                "slip_rate": self.start.slip_rate,
                "state": dict(zip(run.state_names, self.start.state, strict=True)),
            },
            "cycle": self.cycle,
            "slip_events": [asdict(event) for event in self.slip_events],
            "pressure": [float(run.pressure.min()), float(run.pressure.max())],
            "slip": float(run.slip[-1]),
            "duration": float(run.time[-1]),
            "energy": run.energy.to_dict() | {"relative_residual": run.energy.relative_residual},
            "steps": len(run.time),
            "run": dict(run.provenance),
        }


def run_state(
    fault: Fault,
    *,
    start: str = "steady",
    hold: float | None = None,
    share: float | None = None,
    pressure: PressureCourse | None = None,
    loading_rate: float | None = None,
    duration: float | None = None,
    plant: str = "smooth",
    method: str = "radau",
) -> StateRun:
    """Run a fault whose friction has a state under loading from afar and a prescribed pressure.

    Parameters
    ----------
    fault : Fault
    start : str
        ``steady`` (sliding at the loading rate), ``locked`` (held since then for the time `hold`) or ``late`` (when a
        `share` of the time between two events has passed).
    hold : float, optional
        [s].
    share : float, optional
        [-], of 0 to 1; 0.9 unless given.
    pressure : PressureCourse, optional
        None: no pressure.
    loading_rate : float, optional
        v_∞ [m/s]; the reference rate of the law unless given.
    duration : float, optional
        [s]; the operation time of the task unless given.
    plant : str
        ``smooth`` (with inertia) or ``quasi-dynamic`` (without).
    method : str
        As of `simulate_state`.

    Raises
    ------
    ParameterError, UnknownNameError, SimulationError
    """
    _require_runnable(fault, plant)
    rate = fault.friction.operating_rate if loading_rate is None else loading_rate
    require_positive("Steady sliding at this rate is where the run begins.", loading_rate=rate)
    settings: dict[str, Any] = {"inertia": PLANTS[plant], "method": method, "rtol": _RTOL}
    begun = _start(fault, start, rate, hold, share, settings)
    run = simulate_state(
        fault,
        rate,
        duration=fault.reference.operation_time if duration is None else duration,
        start_rate=begun.slip_rate,
        start_state=begun.state,
        pressure=pressure or 0.0,
        **settings,
    )
    return StateRun(fault=fault, loading_rate=rate, start=begun, trajectory=run)


def natural_run(fault: Fault) -> StateRun:
    """What a fault does that is loaded at the reference rate of its law, with inertia: its cycle, or that it creeps.

    Where one method cannot go on another one is taken, and without inertia if there is none: the run says which. Where
    none can it says why, in `failed`.
    """
    began, rate = perf_counter(), fault.friction.operating_rate
    start = disturbed(fault, rate)
    for inertia, method in _NATURAL:
        try:
            run = cycles(fault, rate, inertia=inertia, method=method, rtol=_RTOL)
        except SimulationError as error:
            failed = error
            continue
        return StateRun(fault=fault, loading_rate=rate, start=start, trajectory=run, seconds=perf_counter() - began)
    moment = _MOMENT * min(start.state)
    begun = simulate_state(
        fault, rate, duration=moment, start_rate=rate, start_state=start.state, inertia=False, method="cvodes"
    )
    return StateRun(fault=fault, loading_rate=rate, start=start, trajectory=begun, failed=str(failed))


def shown_time(fault: Fault, *, whole: bool = False) -> float:
    """How much of a task [s] is run of a design for slow sliding: 500 D_c/V, in which the loop settles many times over.

    All of a shorter task, of one whose rate swells on the way, and of a `whole` one.
    """
    task = fault.reference
    ageing = float(min(fault.friction.steady_state(task.target_slip / task.operation_time)))
    return task.operation_time if whole or task.ramp else min(task.operation_time, _SHOWN * ageing)


def designed_run(
    design: Design, natural_peak: float | None, progress: Callable[[float], None], *, whole: bool = False
) -> SlidingRun:
    """The law of a design for slow sliding over its `shown_time`, under the stress that it is designed for as a sine.

    Its period is that of the tide, or a quarter of a run that is shorter than four of them.
    """
    answer = design.sliding
    if answer is None or answer.held is None:
        raise ParameterError(f"a designed run needs a law for slow sliding. Received {design!r:.60}. Use simulate.")
    duration = shown_time(design.fault, whole=whole)
    run = simulate_sliding(
        design.fault,
        answer.held.law,
        answer.held.step,
        lag=answer.held.lag,
        diffusion=answer.held.diffusion,
        tide=Tide(amplitude=float(answer.task.stress), period=min(TIDE, duration / _SWINGS)),
        duration=duration,
        inertia=True,
        progress=progress,
    )
    return replace(run, criterion=replace(run.criterion, natural_peak=natural_peak))


@dataclass(frozen=True, kw_only=True)
class HeldRun:
    """A controlled run, and what it comes to.

    Attributes
    ----------
    fault : Fault
    model : SlidingModel
    step, lag, diffusion : Fraction
        [s].
    stages : tuple of str
        What else the pressure goes through.
    trajectory : SlidingRun
    claim : SlidingGuarantee or None
        What is proved of the law, where it comes from the file of that.
    """

    fault: Fault
    model: SlidingModel
    step: Fraction
    lag: Fraction
    diffusion: Fraction
    stages: tuple[str, ...]
    trajectory: SlidingRun
    claim: SlidingGuarantee | None = None

    def to_dict(self) -> dict[str, Any]:
        """Answer of ``simulate`` with a controller, SI units."""
        run, rate = self.trajectory, float(self.model.rate)
        reference = SlidingReference(task=self.fault.reference)
        followed = reference.rate(run.time)
        return {
            "outcome": run.outcome.to_dict() | {"earthquake_from": rate + 0.1 * dynamic_rate(self.fault)},
            "reference_rate": rate,
            "largest_reference_rate": float(np.max(followed)),
            "growth_rate": growth_rate(self.model),
            "step": float(self.step),
            "lag": float(self.lag),
            "diffusion": float(self.diffusion),
            "stages": list(self.stages),
            "metrics": {
                "max_log_rate": float(np.max(np.abs(np.log(run.slip_rate / followed)))),
                "max_slip_error": float(np.max(np.abs(run.slip - reference.slip(run.time)))),
                "max_asked": float(np.max(np.abs(run.asked))),
            },
            "pressure": [float(run.pressure.min()), float(run.pressure.max())],
            "stress": float(np.max(np.abs(run.stress))),
            "slip": float(run.slip[-1]),
            "duration": float(run.time[-1]),
            "steps": len(run.time),
            "run": dict(run.provenance),
            "guarantee": {"sentence": self.claim.sentence()} if self.claim else None,
            "outside": [],
        }


def run_held(
    fault: Fault,
    *,
    step: float | None = None,
    lag: float = 0.0,
    diffusion: float = 0.0,
    stages: Sequence[SampledStage] = (),
    transducer: Transducer | None = None,
    stress: float = 0.0,
    stress_period: float = TIDE,
    duration: float | None = None,
    plant: str = "smooth",
    method: str = "cvodes",
    claim: SlidingGuarantee | None = None,
) -> HeldRun:
    """Let the e-LQR of `sliding_law`, or that of a guarantee, hold a fault at the mean rate of its task.

    It starts in steady sliding.

    Parameters
    ----------
    fault : Fault
        Its friction has one state.
    step : float, optional
        [s]; the sampling time of the fault unless given.
    lag : float
        Time constant of pump and pipe [s], which the law does not know.
    diffusion : float
        L²/D of the rock between well and fault [s].
    stages, transducer : sequence of SampledStage, Transducer
        As of `simulate_sliding`; the law does not know them.
    stress, stress_period : float
        Of a sine of shear stress [Pa], [s].
    duration, plant, method
        As of `run_state`.
    claim : SlidingGuarantee, optional
        Its law runs, with its T_s, delay, lag and rock in place of those above, which are not to be given.

    Raises
    ------
    ParameterError, UnknownNameError, SimulationError
    """
    _require_runnable(fault, plant)
    held, path = rational(fault.sampling_time if step is None else step), rational(diffusion)
    through, model = rational(lag), sliding_model(fault)
    if claim is None:
        law = sliding_law(model, held, diffusion=path)
    else:
        law, held, path, through = claim.held.law, claim.held.step, claim.held.diffusion, claim.held.lag
        stages = (*Actuator.meant_for(Sampling(step=held, delay=claim.held.delay)).sampled, *stages)
    run = simulate_sliding(
        fault,
        law,
        held,
        lag=through,
        diffusion=path,
        stages=stages,
        transducer=transducer,
        tide=Tide(amplitude=stress, period=stress_period),
        duration=duration,
        inertia=PLANTS[plant],
        method=method,
    )
    around: dict[str, Any] = {"lag": through, "diffusion": path, "stages": tuple(s.name for s in stages)}
    return HeldRun(fault=fault, model=model, step=held, **around, trajectory=run, claim=claim)


def _require_runnable(fault: Fault, plant: str) -> None:
    require_known(plant, PLANTS, "plant of a fault with a state", UnknownNameError)
    if fault.disturbance != Disturbance():
        raise ParameterError(
            "a run of friction with a state has no disturbance but a pressure or a stress. Received a fault with a "
            "table disturbance. Remove it, and give --pressure, or --stress with a controller."
        )


def _start(
    fault: Fault, kind: str, rate: float, hold: float | None, share: float | None, settings: dict[str, Any]
) -> StartingState:
    given = {"hold": hold, "share": share}
    wanted: dict[str, tuple[str, ...]] = {"steady": (), "locked": ("hold",), "late": ("share",)}
    require_known(kind, wanted, "start", UnknownNameError)
    if others := [name for name, value in given.items() if value is not None and name not in wanted[kind]]:
        raise ParameterError(f"{others[0]} belongs to another start than {kind}. Received both. Leave one out.")
    if kind == "steady":
        return sliding(fault, rate)
    if kind == "late":
        return late_in_cycle(fault, rate, 0.9 if share is None else share, **settings)
    if hold is None:
        raise ParameterError("a locked start needs the time that the fault was held. Received none. Give --hold.")
    return locked(fault, rate, hold, **settings)
