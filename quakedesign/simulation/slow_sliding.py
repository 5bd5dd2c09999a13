"""Runs of a controlled fault with rate-and-state friction: zero-order hold, diffusion path, stiff solver."""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from fractions import Fraction
from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, require_known
from quakedesign.fault import Fault, SlidingReference
from quakedesign.fault.model import require_positive
from quakedesign.laws import LinearLaw
from quakedesign.loop.actuators.base import SampledStage
from quakedesign.loop.sensing import Transducer
from quakedesign.simulation.integrators import TIGHT_RTOL, StoppedError, adaptive_integrators
from quakedesign.simulation.recorder import NEVER, metrics
from quakedesign.simulation.run_settings import RunSetting, library_versions
from quakedesign.simulation.state_plant import Instruments, PressurePath, SlidingVariation, SpringSlider, Tide
from quakedesign.simulation.stick_slip import dynamic_rate
from quakedesign.simulation.trajectory import LoopTrajectory, OutcomeCriterion, signal

_SHARES = (0.25, 0.5, 0.75, 1.0)  # of a section between changes of the zero-order hold, at which a run is recorded
PLANTS = {"smooth": True, "quasi-dynamic": False}  # whether with inertia


@checked_dataclass(frozen=True, eq=False, kw_only=True)
class SlidingRun(LoopTrajectory):
    """Controlled run in slow sliding: four instants between changes of the zero-order hold, no energy budget.

    Attributes
    ----------
    theta, feedback_pressure, stress : ndarray
        State of friction [s], feedback pressure commanded in addition to the planned one, and shear stress disturbance
        [Pa], shape (n,).
    """

    theta: "np.ndarray" = signal("state of friction", "s")
    feedback_pressure: "np.ndarray" = signal("feedback pressure commanded in addition to the planned pressure", "Pa")
    stress: "np.ndarray" = signal("shear stress disturbance", "Pa")

    def signals(self) -> "dict[str, tuple[np.ndarray, str, str]]":
        """Values, long name and SI unit of every signal of this run, by name."""
        return super().signals() | {"slip_error": (self.slip - self.reference, "slip error", "m")}


def simulate_sliding(
    fault: Fault,
    law: LinearLaw,
    step: Fraction,
    *,
    lag: Fraction = Fraction(0),
    diffusion: Fraction = Fraction(0),
    stages: Sequence[SampledStage] = (),
    transducer: Transducer | None = None,
    tide: Tide | None = None,
    variation: SlidingVariation | None = None,
    pressure_per_slip: float | None = None,
    duration: float | None = None,
    settled_from: float | None = None,
    samples: int | None = None,
    inertia: bool = False,
    method: str = "cvodes",
    progress: Callable[[float], None] = lambda _: None,
) -> SlidingRun:
    """Simulate a controlled fault that tracks r of `SlidingReference`.

    Initially the fault slides steadily at the first rate V of r. The far end is fixed. The planned pressure kr/(μ*A),
    at which the nominal fault slides steadily at V with slip r and friction μ*, acts on the fault directly. At every
    sample the law measures the slip error and commands an additional feedback pressure, which passes through a
    zero-order hold, the lag and the diffusion path.

    Parameters
    ----------
    fault : Fault
        Fault with one friction state. Its disturbance is ignored.
    law : LinearLaw
        Linear law from the slip error [m] to the feedback pressure [Pa]; a ParameterError is raised for others.
    step : Fraction
        T_s [s].
    lag, diffusion, stages : Fraction, Fraction, sequence of SampledStage
        As in `PressurePath`.
    transducer : Transducer, optional
        Transducer of the slip; unless given, the measurement is exact.
    tide : Tide, optional
        None: no disturbance.
    variation : SlidingVariation, optional
        Ratios of the true to the nominal constants. The fault is initially in steady sliding at V in any case.
    duration : float, optional
        [s]; the operation time unless given.
    pressure_per_slip : float, optional
        Planned pressure per slip [Pa/m]; k/(μ*A) of the nominal fault unless given.
    settled_from : float, optional
        Time [s] from which errors are evaluated; by default a quarter of the shorter of operation time and duration.
    samples : int, optional
        Approximate number of instants to return; all unless given. Metrics use all instants.
    inertia : bool
        Whether the inertia of the fault is included.
    method : str
        ``"cvodes"`` or ``"idas"``.

    Returns
    -------
    SlidingRun
        The run ends if the fault opens. If the solver stops, the run counts as diverged and has no metrics.
    """
    if len(fault.friction.state_names) != 1 or not law.of_slip_alone:
        raise ParameterError(
            "slow sliding needs friction with one state and a linear law of the slip alone. Received "
            f"{fault.friction.name}. Use simulate for other loops."
        )
    require_known(method, adaptive_integrators(), "method")
    began, length = perf_counter(), fault.reference.operation_time if duration is None else duration
    require_positive(duration=length, step=float(step))
    count = 1 if samples is None else samples
    setting = RunSetting.of(fault, float(step), max(length, float(step)), count, settled_from)
    path = PressurePath(lag=lag, diffusion=diffusion, stages=tuple(stages))
    varied = variation or SlidingVariation()
    loop = _Loop.of(fault, path, tide or Tide(), varied, inertia, pressure_per_slip)
    instruments = Instruments.of(path, transducer, float(step))
    rows, events = _followed(loop, law, instruments, length, method, progress)
    time, slip, _, log_rate, log_state, commanded, pressure = rows.T.copy()
    rate, reference, reference_rate = np.exp(log_rate), loop.reference.slip(time), loop.reference.rate(time)
    friction = loop.slider.readings.map(len(time))(rows[:, 1:5].T, pressure)[0].full().ravel()
    late = time > setting.settled_from
    slip_error, rate_error, applied = (values[late] for values in (slip - reference, rate - reference_rate, pressure))
    figures = metrics(
        {
            "settled_count": float(np.count_nonzero(late)),
            "max_slip_error": float(np.max(np.abs(slip_error), initial=0.0)),
            "max_slip_rate_error": float(np.max(np.abs(rate_error), initial=0.0)),
            "sum_square_slip_error": float(np.sum(slip_error**2)),
            "sum_square_slip_rate_error": float(np.sum(rate_error**2)),
            "sum_square_pressure": float(np.sum(applied**2)),
            "pressure_variation": float(np.sum(np.abs(np.diff(applied)))),
            "reverse_count": 0.0,  # the logarithm of the slip rate is integrated
            "max_h_change": math.nan,
            "max_pressure": float(pressure.max()),
            "min_pressure": float(pressure.min()),
            "peak_slip_rate": math.inf if "diverged" in events else float(rate.max()),
            "diverged": len(time) - 1 if "diverged" in events else NEVER,
        },
        controlled=True,
        step=1.0,
        steps=len(time) - 1,
        settled_from=setting.settled_from,
        seconds=perf_counter() - began,
    )
    run = SlidingRun(
        name=f"{fault.name}, controlled slow sliding",
        time=time,
        slip=slip,
        slip_rate=rate,
        pressure=pressure,
        reference=reference,
        reference_rate=reference_rate,
        matched_perturbation=None,
        friction=friction,
        shear_stress=friction * (loop.slider.normal_stress - pressure),
        moment_per_slip=fault.moment_of(1.0),
        integrals=np.empty((0, len(time))),
        integral_units=(),
        metrics=figures,
        energy=None,
        events=events,
        criterion=criterion_of(fault),
        provenance={
            "friction": fault.friction.name,
            "controller": "elqr",
            "scheme": "explicit",
            "step": float(step),
            "method": method,
            "inertia": str(inertia),
            **{f"variation_{name}": value for name, value in asdict(varied).items() if value != 1},
            "plant": "smooth" if inertia else "quasi-dynamic",
        }
        | library_versions("casadi", "numpy", "quakedesign"),
        theta=np.exp(log_state),
        feedback_pressure=commanded,
        stress=loop.tide.at(time),
    )
    if samples is None:
        return run
    shown = np.unique(np.linspace(0, len(time) - 1, min(len(time), samples + 1)).astype(int))
    arrays: dict[str, Any] = {
        f.name: value[..., shown] for f in fields(run) if isinstance(value := getattr(run, f.name), np.ndarray)
    }
    return replace(run, **arrays)


@dataclass(frozen=True)
class _Loop:
    """Plant between samples, in the variables slip, stretch + tide/stiffness, log rate and log state."""

    slider: SpringSlider
    reference: SlidingReference
    pressure_per_slip: float
    tide: Tide
    decay: "np.ndarray"
    share: "np.ndarray"

    @classmethod
    def of(
        cls,
        fault: Fault,
        path: PressurePath,
        tide: Tide,
        variation: SlidingVariation,
        inertia: bool,
        planned: float | None,
    ) -> "_Loop":
        reference = SlidingReference(task=fault.reference)
        steady = float(fault.friction.steady_coefficient(float(reference.first_rate)))
        needed = fault.stiffness / fault.area / steady if planned is None else planned
        return cls(variation.slider(fault, inertia=inertia), reference, needed, tide, *path.modes)

    @property
    def start(self) -> "np.ndarray":
        """Initial vector: steady sliding, followed by a step of the shear stress to the initial value of the tide."""
        y = np.array(self.slider.start(float(self.reference.first_rate)))
        y[1] += self.tide.at(0.0) / self.slider.stiffness
        return self.slider.stepped(y, 0.0, 0.0)

    def planned(self, time: Any) -> Any:
        """Planned pressure [Pa] at a time [s]."""
        return self.pressure_per_slip * self.reference.slip(time)

    def pressure(self, time: Any, sample: Any, since: Any, modes: Any, exp: Callable[[Any], Any] = np.exp) -> Any:
        """Fault pressure [Pa] at `time` [s], `since` [s] after the hold changed to `sample` [Pa]."""
        direct, layered = sample * (1 - sum(self.share)), 0
        for i, (rate, share) in enumerate(zip(self.decay, self.share, strict=True)):
            layered = layered + share * (sample + (modes[i] - sample) * exp(-rate * since))
        return self.planned(time) + direct + layered

    def rates(self) -> ca.Function:
        """CasADi Function (t, y, (pressure of the zero-order hold, time of its change, modes)) → dy/dt."""
        time, y, sample = ca.SX.sym("t"), ca.SX.sym("y", 4), ca.SX.sym("sample", 2 + len(self.decay))
        pressure = self.pressure(time, sample[0], time - sample[1], sample[2:], ca.exp)
        turn = 2 * math.pi / self.tide.period
        load = self.tide.amplitude * turn * ca.cos(turn * time + self.tide.phase) / self.slider.stiffness
        field = self.slider.rates(y, ca.vertcat(load, pressure, ca.jacobian(pressure, time)))[0]
        return ca.Function("rates", [time, y, sample], [ca.densify(field)])


def _followed(
    loop: _Loop, law: LinearLaw, instruments: Instruments, length: float, method: str, progress: Callable[[float], None]
) -> tuple["np.ndarray", dict[str, float]]:
    """Rows of (time, y, commanded pressure, pressure), and the event that ends them: opening or divergence."""
    sizes = [float(loop.slider.law.critical_slip)] * 2 + [1.0, 1.0]  # type: ignore[attr-defined]
    flow = adaptive_integrators()[method].flow(loop.rates(), sizes, _SHARES, rtol=TIGHT_RTOL)
    own, fed, output = (np.array(part, dtype=float) for part in (law.update, law.measured, law.output))
    z, y, sample, modes = np.zeros(len(output)), loop.start, 0.0, np.zeros(len(loop.decay))
    rows, step = [[0.0, *y, 0.0, 0.0]], instruments.step
    for k in range(math.ceil(length / step)):
        now = k * step
        error = instruments.read(y[0]) - loop.reference.slip(now)
        commanded = float(output @ z) + float(law.feedback[0]) * error
        z = own @ z + fed[:, 0] * error
        acting = instruments.pump(commanded, loop.planned(now))
        for begin, lasting, changed in instruments.sections(now, sample, acting):
            before, after = (loop.pressure(begin, p, 0.0, modes) for p in (sample, changed))
            if after >= loop.slider.normal_stress:
                return np.array(rows), {"opening": begin}
            y, sample = loop.slider.stepped(y, before, after), changed
            try:
                samples = flow.follow(begin, lasting, y, (sample, begin, *modes))[0]
            except StoppedError:
                return np.array(rows), {"diverged": begin}
            for passed, values in zip(lasting * np.array(_SHARES), samples.T, strict=True):
                rows.append([begin + passed, *values, commanded, loop.pressure(begin + passed, sample, passed, modes)])
            y, modes = samples[:, -1], sample + (modes - sample) * np.exp(-loop.decay * lasting)
        progress(min(1.0, (now + step) / length))
    return np.array(rows), {}


def criterion_of(fault: Fault) -> OutcomeCriterion:
    """Outcome criterion in slow sliding; it has no natural peak, which would require the simulation of a cycle."""
    reference = SlidingReference(task=fault.reference)
    return OutcomeCriterion(
        natural_peak=None,
        inertial_rate=math.inf,
        reference_rate=float(reference.first_rate * (1 + reference.swing)),
        target_slip=fault.reference.target_slip,
        dynamic_rate=dynamic_rate(fault),
    )
