"""A controlled fault with rate-and-state friction: sampled, held, through rock, with a stiff solver between samples."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

import casadi as ca
import numpy as np

from quakedesign.errors import ParameterError, require_known
from quakedesign.fault import Fault
from quakedesign.fault.checks import require_nonnegative, require_positive
from quakedesign.loop import Layer, LinearLaw
from quakedesign.simulation.integrators import adaptive_integrators
from quakedesign.simulation.outcome import Outcome, OutcomeCriterion
from quakedesign.simulation.recording import Recording
from quakedesign.simulation.run import library_versions
from quakedesign.simulation.slip_events import dynamic_rate
from quakedesign.simulation.state_plants import SpringSlider

MODES = 24  # of the layer; the law has fewer
_SHARES = (0.25, 0.5, 0.75, 1.0)  # of a period, at which a run is recorded
_RTOL = 1e-11

SIGNALS = {
    "slip": ("slip", "m"),
    "slip_rate": ("slip rate", "m/s"),
    "slip_error": ("slip less that of the reference", "m"),
    "theta": ("state of friction", "s"),
    "asked": ("pressure that the law asks for beside that of the reference", "Pa"),
    "pressure": ("fluid pressure in the fault", "Pa"),
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
class SlidingRun(Recording):
    """One run of a law around slow sliding.

    Attributes
    ----------
    name : str
    time, slip, slip_rate, slip_error, theta, asked, pressure, stress : ndarray
        Four times a period; units in `SIGNALS`, time in s.
    outcome : Outcome
    opened : float or None
        Time [s] at which the pressure would reach the effective normal stress, where the run ends.
    provenance : mapping
    """

    name: str
    time: "np.ndarray" = field(repr=False)
    slip: "np.ndarray" = field(repr=False)
    slip_rate: "np.ndarray" = field(repr=False)
    slip_error: "np.ndarray" = field(repr=False)
    theta: "np.ndarray" = field(repr=False)
    asked: "np.ndarray" = field(repr=False)
    pressure: "np.ndarray" = field(repr=False)
    stress: "np.ndarray" = field(repr=False)
    outcome: Outcome
    opened: float | None
    provenance: Mapping[str, Any] = field(repr=False)

    def signals(self) -> dict[str, tuple["np.ndarray", str, str]]:
        """Values, long name and SI unit of every signal, by name."""
        return {name: (getattr(self, name), *described) for name, described in SIGNALS.items()}

    def attributes(self) -> Mapping[str, Any]:
        """Provenance."""
        return self.provenance


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
    length = fault.reference.operation_time if duration is None else duration
    require_positive(duration=length, step=float(step))
    loop = _Loop.of(fault, diffusion, tide or Tide(), inertia)
    rows, opened = _followed(loop, law, float(step), length, method, progress)
    return _recorded(fault, loop, rows, opened, {"method": method, "inertia": str(inertia), "step": float(step)})


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
    time, slip, _, log_rate, log_state, asked, pressure = rows.T
    error, rate = slip - loop.speed * time, np.exp(log_rate)
    criterion = OutcomeCriterion(
        natural_peak=dynamic_rate(fault),
        inertial_rate=math.inf,
        reference_rate=loop.speed,
        target_slip=fault.reference.target_slip,
    )
    events = {} if opened is None else {"opening": opened}
    found = criterion.outcome(float(rate.max()), float(np.max(np.abs(error))), events, followed=True)
    return SlidingRun(
        name=f"{fault.name}, held in slow sliding",
        time=time,
        slip=slip,
        slip_rate=rate,
        slip_error=error,
        theta=np.exp(log_state),
        asked=asked,
        pressure=pressure,
        stress=loop.stress(time),
        outcome=replace(found, share_of_natural=None),
        opened=opened,
        provenance={"friction": fault.friction.name, **told} | library_versions("casadi", "numpy", "quakedesign"),
    )
