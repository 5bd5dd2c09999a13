"""A controlled fault with rate-and-state friction: sampled, held, through rock, with a stiff solver between samples."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np

from quakedesign.errors import ParameterError, require_known
from quakedesign.fault import Fault
from quakedesign.fault.checks import require_nonnegative, require_positive
from quakedesign.loop import Layer, LinearLaw
from quakedesign.simulation.integrators import adaptive_integrators
from quakedesign.simulation.metrics import Metrics
from quakedesign.simulation.outcome import OutcomeCriterion
from quakedesign.simulation.run import library_versions
from quakedesign.simulation.setting import Setting
from quakedesign.simulation.slip_events import dynamic_rate
from quakedesign.simulation.state_plants import SpringSlider
from quakedesign.simulation.trajectory import Trajectory

MODES = 24  # of the layer; the law has fewer
_SHARES = (0.25, 0.5, 0.75, 1.0)  # of a period, at which a run is recorded
_RTOL = 1e-11

SIGNALS = {
    "slip_error": ("slip less that of the reference", "m"),
    "theta": ("state of friction", "s"),
    "asked": ("pressure that the law asks for beside that of the reference", "Pa"),
    "stress": ("shear stress disturbance", "Pa"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Tide:
    """Shear stress S·sin(2πt/P) on the fault, beside that of the spring.

    Attributes
    ----------
    amplitude : float
        S [Pa], not negative.
    period : float
        P [s], positive.
    """

    amplitude: float = 0.0
    period: float = 1.0

    def __post_init__(self) -> None:
        require_nonnegative(stress=self.amplitude)
        require_positive(stress_period=self.period)


@dataclass(frozen=True, eq=False, kw_only=True)
class SlidingRun(Trajectory):
    """One run of a law around slow sliding: four instants a period, all of them kept; no energy.

    Attributes
    ----------
    theta, asked, stress : ndarray
        As in `SIGNALS`, shape (n,).
    """

    theta: "np.ndarray" = field(repr=False)
    asked: "np.ndarray" = field(repr=False)
    stress: "np.ndarray" = field(repr=False)

    @property
    def opened(self) -> float | None:
        """Time [s] at which the pressure would reach the effective normal stress, where the run ends."""
        return self.events.get("opening")

    def signals(self) -> dict[str, tuple["np.ndarray", str, str]]:
        """Values, long name and SI unit of every signal, by name."""
        return super().signals() | {name: (getattr(self, name), *described) for name, described in SIGNALS.items()}


def simulate_sliding(
    fault: Fault,
    law: LinearLaw,
    step: Fraction,
    *,
    diffusion: Fraction = Fraction(0),
    tide: Tide | None = None,
    duration: float | None = None,
    inertia: bool = False,
    method: str = "cvodes",
    progress: Callable[[float], None] = lambda _: None,
) -> SlidingRun:
    """Let a fault slip at its mean rate V, target slip over operation time, from steady sliding at V.

    The far end rests. The pressure p_n that the nominal fault needs for it grows by kV/(μ*A) a second and reaches the
    fault as it is; the law sees the slip error at every sample, and what it asks for is held and goes through the rock.

    Parameters
    ----------
    fault : Fault
        With one state; its table of disturbances is not used.
    law : LinearLaw
        Of the slip error alone [m → Pa].
    step : Fraction
        T_s [s].
    diffusion : Fraction
        L²/D of the rock between well and fault [s]; 0 for none.
    tide : Tide, optional
        None: no disturbance.
    duration : float, optional
        [s]; the operation time unless given.
    inertia : bool
        Whether the fault has its mass.
    method : str
        ``"cvodes"`` or ``"idas"``.
    progress : callable

    Raises
    ------
    ParameterError, SimulationError
    """
    if len(fault.friction.state_names) != 1 or not law.of_slip_alone:
        raise ParameterError(
            "slow sliding needs friction with one state and a linear law of the slip alone. Received "
            f"{fault.friction.name}. Use simulate for other loops."
        )
    require_known(method, adaptive_integrators(), "method")
    began, length = perf_counter(), fault.reference.operation_time if duration is None else duration
    require_positive(duration=length, step=float(step))
    setting = Setting.of(fault, float(step), max(length, float(step)), 1, None)
    loop = _Loop.of(fault, diffusion, tide or Tide(), inertia)
    rows, opened = _followed(loop, law, float(step), length, method, progress)
    told = {"scheme": "explicit", "step": float(step), "method": method, "inertia": str(inertia)}
    run = _recorded(fault, loop, rows, opened, told | {"plant": "smooth" if inertia else "quasi-dynamic"})
    return replace(run, metrics=_metrics(run, setting, perf_counter() - began))


@dataclass(frozen=True)
class _Loop:
    """Plant between samples: slip, stretch (with the stress over the stiffness), log rate and log state."""

    slider: SpringSlider
    speed: float
    ramp: float
    tide: Tide
    decay: "np.ndarray"
    share: "np.ndarray"

    @classmethod
    def of(cls, fault: Fault, diffusion: Fraction, tide: Tide, inertia: bool) -> "_Loop":
        slider = SpringSlider.of(fault, inertia=inertia)
        speed = fault.reference.target_slip / fault.reference.operation_time
        steady = float(fault.friction.steady_coefficient(speed))
        layer, count = Layer(time=diffusion or Fraction(1)), MODES if diffusion else 0
        decay, share = (np.array([float(of(i)) for i in range(count)]) for of in (layer.rate, layer.share))
        return cls(slider, speed, slider.stiffness * speed / steady, tide, decay, share)

    def pressure(self, time: Any, held: Any, since: Any, modes: Any, exp: Callable[[Any], Any] = np.exp) -> Any:
        """Pressure [Pa] of the fault at a time [s], `since` [s] after the law asked for `held` [Pa]."""
        direct, layered = held * (1 - sum(self.share)), 0
        for i, (rate, share) in enumerate(zip(self.decay, self.share, strict=True)):
            layered = layered + share * (held + (modes[i] - held) * exp(-rate * since))
        return self.ramp * time + direct + layered

    def rates(self) -> Any:
        """CasADi Function (t, y, (held pressure, its time, modes)) → dy/dt."""
        time, y, told = ca.SX.sym("t"), ca.SX.sym("y", 4), ca.SX.sym("told", 2 + len(self.decay))
        pressure = self.pressure(time, told[0], time - told[1], told[2:], ca.exp)
        turn = 2 * math.pi / self.tide.period
        load = self.tide.amplitude * turn * ca.cos(turn * time) / self.slider.stiffness
        field = self.slider.rates(y, ca.vertcat(load, pressure, ca.jacobian(pressure, time)))[0]
        return ca.Function("rates", [time, y, told], [ca.densify(field)])

    def stress(self, time: "np.ndarray") -> "np.ndarray":
        return self.tide.amplitude * np.sin(2 * math.pi / self.tide.period * time)


def _followed(
    loop: _Loop, law: LinearLaw, step: float, length: float, method: str, progress: Callable[[float], None]
) -> tuple["np.ndarray", float | None]:
    """Rows of (time, y, asked, pressure), and when the fault opens."""
    sizes = [float(loop.slider.law.critical_slip)] * 2 + [1.0, 1.0]  # type: ignore[attr-defined]
    flow = adaptive_integrators()[method].flow(loop.rates(), sizes, _SHARES, rtol=_RTOL)
    own, fed, output = (np.array(part, dtype=float) for part in (law.update, law.measured, law.output))
    z, y, held, modes = np.zeros(len(output)), np.array(loop.slider.start(loop.speed)), 0.0, np.zeros(len(loop.decay))
    rows = [[0.0, *y, 0.0, 0.0]]
    for k in range(math.ceil(length / step)):
        now = k * step
        error = y[0] - loop.speed * now
        asked = float(output @ z) + float(law.feedback[0]) * error
        z = own @ z + fed[:, 0] * error
        before, after = (loop.pressure(now, p, 0.0, modes) for p in (held, asked))
        if after >= loop.slider.normal_stress:
            return np.array(rows), now
        y, held = loop.slider.stepped(y, before, after), asked
        for share, values in zip(_SHARES, flow.follow(now, step, y, (held, now, *modes))[0].T, strict=True):
            pressure = loop.pressure(now + share * step, held, share * step, modes)
            rows.append([now + share * step, *values, held, pressure])
        y, modes = values, held + (modes - held) * np.exp(-loop.decay * step)
        progress(min(1.0, (now + step) / length))
    return np.array(rows), None


def _recorded(
    fault: Fault, loop: _Loop, rows: "np.ndarray", opened: float | None, told: Mapping[str, Any]
) -> SlidingRun:
    time, slip, _, log_rate, log_state, asked, pressure = rows.T.copy()
    friction = loop.slider.readings.map(len(time))(rows[:, 1:5].T, pressure)[0].full().ravel()
    return SlidingRun(
        name=f"{fault.name}, held in slow sliding",
        time=time,
        slip=slip,
        slip_rate=np.exp(log_rate),
        pressure=pressure,
        reference=loop.speed * time,
        reference_rate=np.full(len(time), loop.speed),
        matched_perturbation=None,
        friction=friction,
        shear_stress=friction * (loop.slider.normal_stress - pressure),
        moment_per_slip=fault.moment_of(1.0),
        integrals=np.empty((0, len(time))),
        integral_units=(),
        metrics=Metrics(settled_from=0.0, steps=0, seconds=0.0),
        energy=None,
        events={} if opened is None else {"opening": opened},
        criterion=OutcomeCriterion(
            natural_peak=None,
            inertial_rate=math.inf,
            reference_rate=loop.speed,
            target_slip=fault.reference.target_slip,
            dynamic_rate=dynamic_rate(fault),
        ),
        provenance={"friction": fault.friction.name, "controller": "elqr", **told}
        | library_versions("casadi", "numpy", "quakedesign"),
        theta=np.exp(log_state),
        asked=asked,
        stress=loop.stress(time),
    )


def _metrics(run: SlidingRun, setting: Setting, seconds: float) -> Metrics:
    """Figures of all instants of a run that followed its reference."""
    late = run.time > setting.settled_from
    slip, rate = (values[late] for values in (run.slip - run.reference, run.slip_rate - run.reference_rate))
    pressure = run.pressure[late]
    of_errors: dict[str, float] = {}
    if late.any():
        of_errors = {
            "max_slip_error": float(np.max(np.abs(slip))),
            "max_slip_rate_error": float(np.max(np.abs(rate))),
            "mise_slip": float(np.mean(slip**2)),
            "mise_slip_rate": float(np.mean(rate**2)),
            "rms_slip_error": math.sqrt(np.mean(slip**2)),
            "rms_slip_rate_error": math.sqrt(np.mean(rate**2)),
            "rms_pressure": math.sqrt(np.mean(pressure**2)),
            "pressure_total_variation": float(np.sum(np.abs(np.diff(pressure)))),
            "reverse_slip_fraction": 0.0,  # its logarithm is what is integrated
        }
    return Metrics(
        **of_errors,
        peak_slip_rate=float(run.slip_rate.max()),
        max_pressure=float(run.pressure.max()),
        min_pressure=float(run.pressure.min()),
        settled_from=setting.settled_from,
        steps=len(run.time) - 1,
        seconds=seconds,
    )
