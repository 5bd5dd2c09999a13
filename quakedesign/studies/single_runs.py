"""Single runs: rate-and-state faults (free or controlled), estimated states, any law.

The first chapter runs a fault with friction state, the second sets up sensor and differentiator with their premise, the
third selects a controller and runs it once.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from fractions import Fraction
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from quakedesign.errors import CertificateError, ParameterError, SimulationError, UnknownNameError, require_known
from quakedesign.exact import UpperBound, rational
from quakedesign.fault import Disturbance, Fault
from quakedesign.fault.equilibrium import STEADY_SLIDING
from quakedesign.fault.model import require_positive
from quakedesign.guarantees import FaultProof, SlidingProof, load_guarantee
from quakedesign.guarantees.search.compensated_search import recovered
from quakedesign.guarantees.search.lqg import growth_rate, sliding_law, sliding_model
from quakedesign.laws import Controller, Sampling, control_law, published
from quakedesign.laws.feed_forward import feed_forward
from quakedesign.laws.sampled_controller import SampledController
from quakedesign.loop import Actuator, simulation_scheme
from quakedesign.loop.actuators.base import SampledStage
from quakedesign.loop.actuators.chain import DIRECT
from quakedesign.loop.loop_setup import IDEAL
from quakedesign.loop.sensing import (
    Averaging,
    Differentiator,
    JointCondition,
    OutputFeedback,
    Sensor,
    SlipStage,
    Transducer,
    joint_condition,
)
from quakedesign.loop.sensing.measurement import EXACT, Measurement
from quakedesign.lyapunov import Verdict
from quakedesign.lyapunov.exact.certificate_files import UNCERTAIN_PLANT
from quakedesign.lyapunov.exact.perturbation_bounds import least_authority
from quakedesign.lyapunov.exact.premises import Premise
from quakedesign.plant import plant_like, slow_sliding_plant
from quakedesign.simulation import (
    Load,
    PressureHistory,
    StateTrajectory,
    Trajectory,
    natural_earthquake,
    simulate,
    simulate_state,
)
from quakedesign.simulation import simulate as run_loop
from quakedesign.simulation.integrators import CYCLE_RTOL
from quakedesign.simulation.run_settings import PRINTED, STICK_SLIP
from quakedesign.simulation.slow_sliding import PLANTS, SlidingRun, simulate_sliding
from quakedesign.simulation.state_plant import TIDE, Tide
from quakedesign.simulation.stick_slip import (
    InitialCondition,
    cycles,
    disturbed,
    dynamic_rate,
    late_in_cycle,
    locked,
    sliding,
)
from quakedesign.simulation.trajectory import EARTHQUAKE_SHARE
from quakedesign.studies.certified import certified_bound, trajectory_premise
from quakedesign.symbolic import derive
from quakedesign.synthesis import Design, design, guarantee

# ----------------------------------------------------------------------
# Runs of a fault whose friction has a state: without control, or in slow sliding under control.

_NATURAL = (True, "radau"), (True, "cvodes"), (False, "cvodes")  # inertia and method of cycles, tried in this order
_MOMENT = 1e-3  # duration, relative to the initial age of the state, over which every solver succeeds
_UNDISTURBED = 1e-3  # change of the logarithm of the slip rate
_PERIODS = 4  # smallest number of stress periods in a shown run
_SHOWN = 500  # duration of the run of a slow task in D_c/V: the loop settles within some tens


def run_state(
    fault: Fault,
    *,
    start: str = "steady",
    hold: float | None = None,
    share: float | None = None,
    pressure: PressureHistory | None = None,
    loading_rate: float | None = None,
    duration: float | None = None,
    plant: str = "smooth",
    method: str = "radau",
) -> tuple[StateTrajectory, dict[str, Any]]:
    """Run a fault whose friction has a state under far-field loading and a prescribed pressure; also returns its JSON.

    Parameters
    ----------
    start : str
        ``steady`` (sliding at the loading rate), ``locked`` (then held with the far end at rest for the time `hold`) or
        ``late`` (when a `share` of the time between two events has passed).
    hold : float, optional
        Duration of the hold [s].
    share : float, optional
        Share of the recurrence time [-], 0 to 1; 0.9 by default.
    pressure : PressureHistory, optional
        None: no pressure.
    loading_rate : float, optional
        v_∞ [m/s]; by default the reference rate of the law.
    duration : float, optional
        Duration of the run [s]; by default the operation time of the task.
    plant : str
        ``smooth`` (with inertia) or ``quasi-dynamic`` (without).
    method : str
        As in `simulate_state`.
    """
    _require_runnable(fault, plant)
    rate = fault.friction.operating_rate if loading_rate is None else loading_rate
    require_positive("Steady sliding at this rate is where the run begins.", loading_rate=rate)
    settings: dict[str, Any] = {"inertia": PLANTS[plant], "method": method, "rtol": CYCLE_RTOL}
    begun = _start(fault, start, rate, hold, share, settings)
    run = simulate_state(
        fault,
        rate,
        duration=fault.reference.operation_time if duration is None else duration,
        **begun.settings,
        pressure=pressure or 0.0,
        **settings,
    )
    still = np.all(np.abs(np.log(run.slip_rate / fault.friction.operating_rate)) < _UNDISTURBED)
    result = {
        "outcome": run.outcome.to_dict() | {"earthquake_from": EARTHQUAKE_SHARE * run.dynamic_rate},
        "resting": bool(still) and derive(fault).unstable,
        "loading_rate": rate,
        "start": {"slip_rate": begun.slip_rate, "state": dict(zip(run.state_names, begun.state, strict=True))},
        "cycle": run.cycle,
        "slip_events": [asdict(event) for event in run.slip_events],
        "pressure": [float(run.pressure.min()), float(run.pressure.max())],
        "slip": float(run.slip[-1]),
        "duration": float(run.time[-1]),
        "energy": run.energy.to_dict() | {"relative_residual": run.energy.relative_residual},
        "steps": len(run.time),
        "run": dict(run.provenance),
    }
    return run, result


def natural_run(fault: Fault) -> StateTrajectory:
    """Natural behaviour at the reference rate of the friction law, with inertia: cycle or creep.

    If a method fails, another one is used, at last without inertia; the provenance of the run names it. If all fail,
    `failed` gives the reason.
    """
    began, rate = perf_counter(), fault.friction.operating_rate
    start = disturbed(fault, rate)
    for inertia, method in _NATURAL:
        try:
            run = cycles(fault, rate, inertia=inertia, method=method, rtol=CYCLE_RTOL)
        except SimulationError as error:
            failed = str(error)
            continue
        return _natural_cycle(run, "smooth" if inertia else "quasi-dynamic", seconds=perf_counter() - began)
    moment = _MOMENT * min(start.state)
    begun = simulate_state(fault, rate, duration=moment, **start.settings, inertia=False, method="cvodes")
    return replace(_natural_cycle(begun, "quasi-dynamic", seconds=0.0, peak_slip_rate=None), failed=failed)


def _natural_cycle(run: StateTrajectory, plant: str, **figures: Any) -> StateTrajectory:
    """A run with the provenance entries of controlled runs, and with other values in its metrics."""
    settings = {"scheme": "continuous", "step": None, "plant": plant, "controller": "none"}
    return replace(run, provenance={**run.provenance, **settings}, metrics=replace(run.metrics, **figures))


def shown_time(fault: Fault, *, whole: bool = False) -> float:
    """Duration [s] of the run of a design for slow sliding: 500 D_c/V, many times the settling time of the loop.

    The whole task if it is shorter, if its rate has a ramp, or if `whole`.
    """
    task = fault.reference
    ageing = float(min(fault.friction.steady_state(task.target_slip / task.operation_time)))
    return task.operation_time if whole or task.ramp else min(task.operation_time, _SHOWN * ageing)


def designed_run(
    design: Design, natural_peak: float | None, progress: Callable[[float], None], *, whole: bool = False
) -> SlidingRun:
    """The law of a design for slow sliding over its `shown_time`, under a sinusoidal stress of the design's amplitude.

    The period of the sine is that of the tide, or a quarter of a run that is shorter than four tides.
    """
    result = design.sliding
    if result is None or result.sampled_loop is None:
        raise ParameterError(f"a designed run needs a law for slow sliding. Received {design!r:.60}. Use simulate.")
    duration = shown_time(design.fault, whole=whole)
    run = simulate_sliding(
        design.fault,
        result.sampled_loop.law,
        result.sampled_loop.step,
        lag=result.sampled_loop.lag,
        diffusion=result.sampled_loop.diffusion,
        tide=Tide(amplitude=float(result.task.stress), period=min(TIDE, duration / _PERIODS)),
        duration=duration,
        inertia=True,
        progress=progress,
    )
    return replace(run, criterion=replace(run.criterion, natural_peak=natural_peak))


def run_sliding(
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
    claim: SlidingProof | None = None,
) -> tuple[SlidingRun, dict[str, Any]]:
    """Run the e-LQR of `sliding_law`, or of a guarantee, from steady sliding; also returns its JSON.

    Parameters
    ----------
    fault : Fault
        Fault whose friction has one state.
    step : float, optional
        Sampling time [s]; by default that of the fault.
    lag : float
        Time constant of pump and pipe [s]; the law is designed without it.
    diffusion : float
        L²/D of the diffusion path between well and fault [s].
    stages, transducer : sequence of SampledStage, Transducer
        As in `simulate_sliding`; the law is designed without them.
    stress, stress_period : float
        Amplitude [Pa] and period [s] of a sinusoidal shear stress.
    duration, plant, method
        As in `run_state`.
    claim : SlidingProof, optional
        Guarantee whose law runs, with its T_s, delay, lag, diffusion path and planned pressure instead of those above,
        which must be omitted.
    """
    _require_runnable(fault, plant)
    sampling_step, path = rational(fault.sampling_time if step is None else step), rational(diffusion)
    through, model, plan = rational(lag), sliding_model(fault), None
    if claim is None:
        law = sliding_law(model, sampling_step, diffusion=path)
    else:
        law, sampling_step, path, through = (
            claim.sampled_loop.law,
            claim.sampled_loop.step,
            claim.sampled_loop.diffusion,
            claim.sampled_loop.lag,
        )
        stages = (*Actuator.meant_for(Sampling(step=sampling_step, delay=claim.sampled_loop.delay)).sampled, *stages)
        if slow_sliding_plant(fault, claim.task.stress).ramp != claim.task.ramp:  # another fault of the same box
            plan = float(claim.task.ramp / claim.task.rate)
    run = simulate_sliding(
        fault,
        law,
        sampling_step,
        lag=through,
        diffusion=path,
        stages=stages,
        transducer=transducer,
        tide=Tide(amplitude=stress, period=stress_period),
        duration=duration,
        inertia=PLANTS[plant],
        method=method,
        pressure_per_slip=plan,
    )
    assert run.reference is not None
    assert run.reference_rate is not None
    result = {
        "outcome": run.outcome.to_dict() | {"earthquake_from": float(model.rate) + 0.1 * dynamic_rate(fault)},
        "reference_rate": float(model.rate),
        "largest_reference_rate": float(np.max(run.reference_rate)),
        "growth_rate": growth_rate(model),
        "step": float(sampling_step),
        "lag": float(through),
        "diffusion": float(path),
        "stages": [stage.name for stage in stages],
        "metrics": {
            "max_log_rate": float(np.max(np.abs(np.log(run.slip_rate / run.reference_rate)))),
            "max_slip_error": float(np.max(np.abs(run.slip - run.reference))),
            "max_asked": float(np.max(np.abs(run.feedback_pressure))),
        },
        "pressure": [float(run.pressure.min()), float(run.pressure.max())],
        "stress": float(np.max(np.abs(run.stress))),
        "slip": float(run.slip[-1]),
        "duration": float(run.time[-1]),
        "steps": len(run.time),
        "run": dict(run.provenance),
        "guarantee": {"sentence": claim.sentence()} if claim else None,
        "outside": [],
    }
    return run, result


def _require_runnable(fault: Fault, plant: str) -> None:
    require_known(plant, PLANTS, "plant of a fault with a state", UnknownNameError)
    if fault.disturbance != Disturbance():
        raise ParameterError(
            "a fault with a friction state is disturbed by a pressure or a shear stress alone. Received a fault with a "
            "table [disturbance]. Remove it, and give --pressure, or --stress with a controller."
        )


def _start(
    fault: Fault, kind: str, rate: float, hold: float | None, share: float | None, settings: dict[str, Any]
) -> InitialCondition:
    options = {"hold": hold, "share": share}
    entries: dict[str, tuple[str, ...]] = {"steady": (), "locked": ("hold",), "late": ("share",)}
    require_known(kind, entries, "start", UnknownNameError)
    if others := [name for name, value in options.items() if value is not None and name not in entries[kind]]:
        raise ParameterError(f"{others[0]} cannot be used with the start {kind}. Received both. Omit {others[0]}.")
    if kind == "steady":
        return sliding(fault, rate)
    if kind == "late":
        return late_in_cycle(fault, rate, 0.9 if share is None else share, **settings)
    if hold is None:
        raise ParameterError(
            "a locked start needs the time for which the far end is at rest. Received none. Give --hold."
        )
    return locked(fault, rate, hold, **settings)


# ----------------------------------------------------------------------
# Output feedback: the sensor, and the premise of its differentiator.

WINDOW = 4000
DEVIATIONS = 4.0  # standard deviations of normal noise that count as its bound


def sensor(
    step: float,
    noise: Measurement,
    bound: float | None,
    filter_order: int = 0,
    *,
    order: int = 1,
    bandwidth: float = math.inf,
    averaging: int = 1,
    quantum: float = 0.0,
    inner_steps: int = 1,
) -> Measurement | OutputFeedback:
    """Sensor of a law: exact or noisy states, or estimates from the noisy slip.

    Parameters
    ----------
    step : float
        Sampling period [s].
    bound : float or None
        λ_d [m/s^(n_d + 1)] of a differentiator; None for none.
    filter_order : int
        n_f of the differentiator.
    order : int
        n_d of the differentiator.
    bandwidth : float
        Bandwidth of the transducer [Hz].
    averaging : int
        Number of the latest readings whose mean is the input of the differentiator.
    quantum : float
        Resolution of the transducer [m]; 0 for no rounding.
    inner_steps : int
        Steps of the differentiator per reading.

    Raises
    ------
    ParameterError
        For noise of an unmeasured slip rate, or settings of a differentiator without one.
    """
    if bound is None:
        entered = {
            "differentiator order": order != 1,
            "filter order": filter_order != 0,
            "bandwidth": bandwidth != math.inf,
            "averaging": averaging != 1,
            "quantum of the slip": quantum != 0,
            "number of inner steps": inner_steps != 1,
        }
        for name in (name for name, there in entered.items() if there):
            raise ParameterError(
                f"the {name} needs a differentiator. Received no bound of one. Give this bound, or omit the {name}."
            )
        return noise
    if noise.rate_noise:
        raise ParameterError(
            "with a differentiator the slip alone is measured. "
            f"Received rate noise {noise.rate_noise:g} m/s. Omit the rate noise."
        )
    transducer = Transducer(deviation=noise.slip_noise, bandwidth=bandwidth, quantum=quantum, seed=noise.seed)
    stages: list[SlipStage] = [transducer] if transducer.start or quantum else []
    stages += [Averaging(samples=averaging)] if averaging != 1 else []
    differentiator = Differentiator(
        bound=bound, step=step, order=order, filter_order=filter_order, inner_steps=inner_steps
    )
    return OutputFeedback(stages=tuple(stages), differentiator=differentiator)


def differentiator_premise(fault: Fault, law: Controller, seen: OutputFeedback, *, scheme: str = "explicit") -> Premise:
    """Premise: λ_d satisfies the joint condition of slip, law and sampling period (ERRATA 21).

    The largest |x1''| [m/s²] comes from `largest_acceleration`. The condition is sufficient for the differentiator to
    converge, not necessary for the loop to work. If one of its two runs diverges, nothing is certified. With n_d of 2
    or more a bound of the next derivative is needed, which does not exist with zero-order hold: the requirement is
    infinite.
    """
    differentiator = seen.differentiator
    noise = max((DEVIATIONS * s.deviation for s in seen.stages if isinstance(s, Transducer)), default=0.0)
    reached, diverged = largest_acceleration(fault, law, scheme=scheme, step=differentiator.step)
    condition = joint_condition(fault, law, differentiator, acceleration=reached, noise=noise)
    premise = Premise(
        name="differentiator",
        required=condition.required,
        certified=condition.certified,
        unit=f"m/s^{differentiator.order + 1}",
        measured=True,
        note=_note(differentiator.order, reached, condition),
    )
    if diverged is None:
        return premise
    text = (
        f"the loop with exact states diverges at {diverged:.4g} s, so that no λ_d is enough; until then {premise.note}"
    )
    return replace(premise, certified=0.0, proved=False, note=text)


def _note(order: int, reached: float, condition: JointCondition) -> str:
    if order > 1:
        return f"no λ_d bounds derivative {order + 1} of the slip: derivative 2 jumps at every step of the pressure"
    return (
        f"λ_d must exceed |x1''| <= {reached:.3g} m/s² with exact states plus the contribution of the errors of the "
        f"estimates, {condition.slip_error:.2g} m and {condition.rate_error:.2g} m/s, through the law"
    )


def largest_acceleration(fault: Fault, law: Controller, *, scheme: str, step: float) -> tuple[float, float | None]:
    """Largest |Δx2|/T_s [m/s²] of the sampled loop with exact states in 4000 periods of the task, on both plants.

    The second entry is the time [s] of the first divergence, up to which values count, or None.
    """
    window = min(WINDOW * step, fault.reference.operation_time)
    setting: dict[str, Any] = {"scheme": scheme, "step": step, "duration": window, "samples": WINDOW}
    runs = [simulate(fault, law, plant=plant, **setting) for plant in (STICK_SLIP, PRINTED)]
    steps = [np.max(np.abs(np.diff(run.slip_rate)) / np.diff(run.time), initial=0.0) for run in runs]
    ends = [run.events["diverged"] for run in runs if "diverged" in run.events]
    return float(max(steps)), min(ends, default=None)


# ----------------------------------------------------------------------
# One run of one controller, for the command line.

PUBLISHED, DESIGNED, CONTINUOUS = ("published",), ("designed",), ("continuous",)


@dataclass(frozen=True, kw_only=True)
class Choice:
    """Controller, with its certified bound on |h'| or its guarantee where it has one."""

    controller: Controller
    # Certified bound on |h'| [m/s³]; None for gains without a certificate, and for a linear law
    lipschitz: Fraction | None = None
    # Guarantee of a law from a certificate file
    claim: FaultProof | None = None

    def noise(self, seed: int) -> Measurement:
        """Measurement errors within the bounds of the controller's guarantee; no noise without a guarantee."""
        sampled_loop = self.claim.sampled_loop if self.claim else None
        off = {name: float(bound) for name, bound in sampled_loop.noise.items()} if sampled_loop else {}
        return Measurement(**off, seed=seed, bounded=True) if off else EXACT


def certified_choice(fault: Fault, path: str | Path) -> Choice:
    """Law of a `guarantee` file, which must be valid and about the fault; its proof is re-checked.

    Raises
    ------
    CertificateError
        When the file cannot be read, is about another subject, or is invalid.
    UnsupportedError
        For a sliding mode whose gains do not follow from its implicit step.
    """
    claim: Any = load_guarantee(path)
    if claim.kind == UNCERTAIN_PLANT:
        raise CertificateError(
            f"the certificate of a law must be about a fault. Received {path}, about an uncertain plant. Give a "
            f"file that `guarantee {fault.name} --out FILE` writes."
        )
    if not claim.sampled or claim.slides != (fault.friction.equilibrium is STEADY_SLIDING):
        raise CertificateError(
            "the certificate must be of a sampled law, and for friction with a state if and only if the fault has such "
            f"friction. Received {path} and {fault.name}. Give a file that `guarantee {fault.name} --out FILE` writes."
        )
    if differences := _differences(fault, claim):
        raise CertificateError(
            f"a certificate must be about the fault. Received {path} about {claim.task.name}, and {fault.name}: "
            f"{'; '.join(differences)}. Give the fault of the certificate, or make a new certificate with guarantee."
        )
    if claim.implicit_step is not None:
        controller: Controller = recovered(claim).limited
    else:
        controller = claim.controller
        if type(controller) is SampledController:  # the file does not tell a designed e-LQR from a user-defined law
            object.__setattr__(controller, "title", "law of the certificate")
    if claim.check() is not Verdict.PROVED:
        raise CertificateError(f"certificate must be valid. Received {path}: its claims do not follow. Prove it again.")
    return Choice(controller=controller, claim=claim)


def _differences(fault: Fault, claim: Any) -> list[str]:
    """Differences of a fault that a certificate does not cover, except the planned pressure of slow sliding."""
    task: Any = plant_like(claim.task, fault)
    if claim.covers_healing:
        task, covered = claim.beside_healing(task, rational(fault.friction.rest_excess))
        if covered is not None:  # less than the healing of the fault
            healing = UpperBound(rational(fault.friction.rest_excess))
            return [f"healing {healing:.3g}; with the disturbance of this fault, at most {covered:.3g} is covered"]
    differences: list[str] = claim.task.differences(task)
    return differences


def optional_choice(fault: Fault, name: str, gains: tuple[str, ...], **more: Any) -> Choice | None:
    """Controller as in `choice`, or None for the name ``none``.

    Raises
    ------
    UnknownNameError, ParameterError
        As in `choice`; also for gains, a scale or a feed-forward without a controller.
    """
    if name != "none":
        return choice(fault, name, gains, **more)
    if gains != PUBLISHED or more.get("scale") is not None or more.get("feedforward", "none") != "none":
        raise ParameterError("gains, scale and feedforward need a controller. Received none. Give --controller.")
    return None


def choice(
    fault: Fault,
    name: str,
    gains: tuple[str, ...],
    *,
    scale: str | None = None,
    feedforward: str = "none",
    step: float | None = None,
    path: Mapping[str, float] | None = None,
) -> Choice:
    """Controller from a law's name and ``("published",)``, ``("designed",)``, ``("continuous",)`` or exact gains.

    Designed gains run as guaranteed, with their own scheme and T_s; gains designed in continuous time, as in the paper,
    run with any scheme and T_s.

    Parameters
    ----------
    scale : str, optional
        λ of a sliding mode in place of that of the gains.
    feedforward : str
        ``none``, ``nominal`` or ``centred``; for a sliding mode.
    step : float, optional
        T_s [s] of a design; by default the fault's.
    path : mapping of str to float, optional
        Delay, lag and diffusion [s] of the loop for which a law is designed; none by default.
    """
    law, base = _with_gains(fault, name, gains, step, path or {})
    if law.divisor is None:
        if scale is None and feedforward == "none":
            return Choice(controller=law, lipschitz=base)
        raise ParameterError(f"scale and feedforward are for sliding modes. Received {name}. Omit both.")
    if law.sampling is not None and feedforward != "none":
        raise ParameterError(
            "feedforward has no guarantee with zero-order hold, which designed gains use. "
            f"Received {feedforward}. Give --gains continuous, or omit feedforward."
        )
    scaled = law if scale is None else law.scaled(rational(scale, "scale"))
    added = feed_forward(feedforward, fault, law.divisor)
    return Choice(
        controller=law if scaled is law and feedforward == "none" else scaled.with_feedforward(added),
        lipschitz=None if base is None else base * (scaled.scale or 1),
    )


def _with_gains(
    fault: Fault, name: str, gains: tuple[str, ...], step: float | None, path: Mapping[str, float]
) -> tuple[Controller, Fraction | None]:
    """Law, and its certified bound on |h'| for λ = 1."""
    law = control_law(name)
    if len(gains) == 1 and gains[0].isalpha():
        require_known(gains[0], (*PUBLISHED, *DESIGNED, *CONTINUOUS), "a name of gains", UnknownNameError)
    if gains == PUBLISHED:
        laws = published(fault.name)
        if name not in laws:
            raise UnknownNameError(
                f"published gains exist for the laws of the paper, on real-fault and lab-fault. Received {name} on "
                f"{fault.name!r}. "
                "Give --gains designed, or the gains of the law."
            )
        return laws[name], None
    if gains == DESIGNED and step is not None:
        fault = replace(fault, sampling_time=step)
    if gains == DESIGNED and path:
        return _designed_for_path(fault, name, path), None
    if gains in (DESIGNED, CONTINUOUS):
        designed = design(fault, name, continuous=gains == CONTINUOUS)
        if designed.controller is None:
            raise ParameterError(f"no gains with a proof were found for {name} on {fault.name}. Give --gains.")
        return designed.controller, certified_bound(designed)
    return law.for_authority(gains, least_authority(fault)), None


def _designed_for_path(fault: Fault, name: str, path: Mapping[str, float]) -> Controller:
    """Law designed for a delay, a lag and a diffusion path, sampled with the fault's T_s.

    Raises
    ------
    ParameterError
        If no design has a proof, or the delay exceeds that of an `Actuator`.
    """
    setup = IDEAL.with_given(**path)
    Actuator.meant_for(Sampling(step=rational(fault.sampling_time), **setup.path))
    result: Any = guarantee(fault, name, setup)
    if not result.proved:
        text = ", ".join(f"{part} {time:g} s" for part, time in path.items())
        sooner = (
            f"--step '{float(result.shorter.sampled_loop.step):g} s', for which a proof was found, "
            if result.shorter
            else ""
        )
        raise ParameterError(
            f"designed gains must have a proof with this delay, lag or diffusion path. Received {name} with {text}, "
            f"T_s = {fault.sampling_time:g} s: {result.proof.reason}. Give {sooner}gains as numbers, or see limits."
        )
    law: Controller = result.controller
    return law


def run_single(
    fault: Fault,
    law: Controller | Choice | None,
    *,
    progress: Callable[[float], None],
    duration: float | None = None,
    load: Load | None = None,
    noise: Sensor = EXACT,
    actuator: Actuator = DIRECT,
    tuning: Mapping[str, float] | None = None,
    initial: Mapping[str, float] | None = None,
    **settings: Any,
) -> tuple[Trajectory, list[Premise]]:
    """Simulate a loop, and decide the premises that a simulation can decide.

    Parameters
    ----------
    law : Controller, Choice or None
        A choice also supplies certified bounds. None with a duration: the fault under its own disturbance. None without
        a duration: the natural earthquake.
    progress : callable
        Called with the progress.
    duration : float, optional
        Duration of the run [s]; by default the operation time, but see `law`.
    noise : Measurement or Sensor
        Measurement of the law.
    actuator : Actuator
        Stages between law and fault.
    tuning : mapping of str to float, optional
        Settings of the scheme itself, such as ``weight`` and ``authority`` of ``compensated``.
    initial : mapping of str to float, optional
        ``initial_slip`` [m] and ``initial_slip_rate`` [m/s], if the run does not start from rest.
    **settings
        ``step, scheme, method, plant, substeps`` of `quakedesign.simulation.simulate`.

    Returns
    -------
    Trajectory
    list of Premise
        `on_trajectory` of a sliding mode, with or without a certificate, and `differentiator`.
    """
    given: dict[str, Any] = {"measurement": noise} if noise.noisy else {}
    given |= {"actuator": actuator} if actuator.stages else {}
    if law is None and duration is None:
        more = dict(tuning or {}) | dict(initial or {}) | ({"load": load} if load else {})
        return _natural(fault, settings, given | more), []
    name = settings["scheme"]
    if tuning:
        substeps = settings.pop("substeps")
        given |= {"substeps": substeps} if substeps != 1 else {}
        settings, given = settings | {"scheme": simulation_scheme(name, **tuning, **given)}, {}
    chosen = law if isinstance(law, Choice) or law is None else Choice(controller=law)
    own = chosen.controller if chosen else None
    given |= dict(initial or {})
    run = run_loop(fault, own, duration=duration, load=load, progress=progress, **settings, **given)
    if chosen is None:
        return run, []
    return run, _premises(fault, chosen, run, noise, name)


def _premises(fault: Fault, chosen: Choice, run: Trajectory, seen: Sensor, scheme: str) -> list[Premise]:
    """Premises that a run decides, and those of a differentiator."""
    law, bound = chosen.controller, chosen.lipschitz
    premises = [trajectory_premise(law, None if bound is None else float(bound), run)]
    if isinstance(seen, OutputFeedback):
        premises.append(differentiator_premise(fault, law, seen, scheme=scheme))
    return [premise for premise in premises if premise is not None]


def _natural(fault: Fault, settings: dict[str, Any], given: dict[str, Any]) -> Trajectory:
    """Natural earthquake, which has no setting other than the plant."""
    usual = {"step": None, "scheme": "continuous", "method": "dormand-prince", "substeps": 1}
    others = [name for name, value in settings.items() if name != "plant" and value != usual[name]]
    others += list(given)
    if others:
        raise ParameterError(
            f"the natural earthquake runs with the settings of the fault. Received {', '.join(others)}. "
            "Choose a controller, or give a duration."
        )
    return natural_earthquake(fault, plant=settings["plant"])
