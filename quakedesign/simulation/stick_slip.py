"""Uncontrolled runs with rate-and-state friction: velocity steps and stick–slip cycles.

The last part gives initial conditions: in steady sliding, after a hold, and late in a cycle.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from time import perf_counter
from typing import Any

import numpy as np

from quakedesign.errors import ParameterError
from quakedesign.fault import Fault, FrictionLaw
from quakedesign.fault.model import require_positive
from quakedesign.simulation.closed_loop import EnergyBudget
from quakedesign.simulation.inputs import PressureHistory
from quakedesign.simulation.integrators import RTOL, TIGHT_RTOL
from quakedesign.simulation.recorder import Metrics
from quakedesign.simulation.run_settings import library_versions
from quakedesign.simulation.seismic_cycle import StateTrajectory
from quakedesign.simulation.smooth_integration import Ramp, SmoothProblem, SmoothSolution
from quakedesign.simulation.state_plant import SpringSlider
from quakedesign.symbolic import derive

# ----------------------------------------------------------------------
# Faults with rate-and-state friction under remote loading and pressure: velocity steps and stick-slip cycles.

_ONSET = 10.0  # times the fastest loading rate
_SHARE_OF_STRETCH = 1e-3  # of the initial stretch: scale of the slip for a law without a critical slip
_FARTHEST = 1e7  # largest displacement of the load point, in critical slips; one earthquake may need a million
_LONGEST = 1e9  # s, longest span of one time variable: the resolution of its floats is then 1.2e-7 s
_LONGEST_RUN = 1e5 * _LONGEST  # s, three million years: limits the number of spans of a run


def simulate_state(
    subject: Fault | SpringSlider,
    loading: "float | Sequence[tuple[float, float]]",
    *,
    duration: float | None = None,
    inertia: bool = True,
    pressure: "float | PressureHistory" = 0.0,
    start_rate: float | None = None,
    start_state: Sequence[float] | None = None,
    times: "Sequence[float] | np.ndarray | None" = None,
    onset_rate: float | None = None,
    method: str = "radau",
    rtol: float = RTOL,
) -> StateTrajectory:
    """Simulate an uncontrolled fault whose friction has a state, under remote loading and a prescribed pressure.

    The logarithms of rate and state are integrated, so that a hold of years and slip within milliseconds have the same
    relative accuracy. Initially the forces balance; if the pressure has a step at t = 0, at the pressure before it.

    Parameters
    ----------
    subject : Fault or SpringSlider
        A `Fault` is converted by `SpringSlider.of`, with its damping.
    loading : float or sequence of (float, float)
        v_∞ [m/s] for `duration`; or consecutive pairs of (length [s], v_∞ [m/s]). Not negative.
    duration : float, optional
        [s]; only for a single loading rate.
    inertia : bool
        For a `Fault`: True for inertia, False for quasi-dynamic motion. Ignored for a `SpringSlider`.
    pressure : float or PressureHistory
        Fluid pressure [Pa], below the effective normal stress. At a step of the pressure the values before and after it
        are both returned, at the same time; at instants given by `times` only the values after it.
    start_rate : float, optional
        Initial slip rate [m/s]; the first loading rate unless given.
    start_state : sequence of float, optional
        Initial state, in the law's units; steady at `start_rate` unless given.
    times : sequence of float, optional
        Instants to return [s]; every step of the method unless given.
    onset_rate : float, optional
        Slip rate whose upward crossings are events [m/s]; ten times the fastest loading rate unless given.
    method : str
        ``"radau"`` (stiff problems, as with inertia), ``"dop853"`` (usually faster without inertia), or ``"cvodes"``,
        ``"idas"`` (stiff problems; independent implementations).
    rtol : float
        Tolerance of one step, 1e-13 … 1e-3; relative to variables that exceed their scale, which is 1 for logarithms.

    Raises
    ------
    ParameterError
        For a law without a state, a setting that is not positive and finite, an unknown method, a pressure that opens
        the fault, or a load point that moves by more than 1e7 critical slips.
    SimulationError
        If the integration fails, as when the slip rate grows without bound (no inertia and no damping).
    """
    slider = subject if isinstance(subject, SpringSlider) else SpringSlider.of(subject, inertia=inertia)
    slider.law.require(simulate_state=subject)
    course = pressure if isinstance(pressure, PressureHistory) else PressureHistory.constant(pressure)
    if course.largest >= slider.normal_stress:
        raise ParameterError(
            f"pressure must stay below the effective normal stress, {slider.normal_stress:.6g} Pa, at which the fault "
            f"opens. Received {course.largest:.6g} Pa. Reduce the pressure."
        )
    pieces = _pieces(loading, duration)
    first = pieces[0][1] if start_rate is None else start_rate
    start = slider.start(first, None if start_state is None else tuple(start_state), course.before(0.0))
    level = _ONSET * max(v for _, v in pieces) if onset_rate is None else onset_rate
    length = getattr(slider.law, "critical_slip", abs(start[1]) * _SHARE_OF_STRETCH)
    scales = np.array([length, length, *[1.0] * (len(start) - 2)])  # scale 1 for the logarithms
    farthest = _FARTHEST * float(scales[0])
    travelled = sum(length * speed for length, speed in pieces)
    if travelled > farthest:
        raise ParameterError(
            f"loading must move the load point by at most {_FARTHEST:.0e} critical slips, {farthest:.6g} m. "
            f"Received {travelled:.6g} m. Shorten the duration."
        )
    problem = SmoothProblem(slider.rates, scales, 2, math.log(level) if level > 0 else math.inf)
    history = _History(slider, problem, pieces, course, _output_times(times, pieces), method, rtol)
    return _trajectory(subject, slider, history, level, start)


def velocity_step(
    law: FrictionLaw,
    stiffness: float,
    loading: Sequence[tuple[float, float]],
    *,
    times: "Sequence[float] | np.ndarray | None" = None,
    method: str = "dop853",
    rtol: float = TIGHT_RTOL,
) -> StateTrajectory:
    """Simulate a laboratory sample that is driven through a spring whose far end moves at given rates.

    The run starts in steady sliding at the first rate, without inertia or damping. A rate of 0 is a hold.

    Parameters
    ----------
    law : FrictionLaw
        Friction law with a state.
    stiffness : float
        Change of friction per displacement of the far end [1/m]: stiffness per area over normal stress.
    loading : sequence of (float, float)
        Consecutive pairs of (length [s], rate of the far end [m/s]).
    times, method, rtol
        As in `simulate_state`.

    Raises
    ------
    ParameterError, SimulationError
        As `simulate_state`.
    """
    slider = SpringSlider(law=law, stiffness=stiffness, normal_stress=1.0)
    return simulate_state(slider, loading, times=times, method=method, rtol=rtol)


def _pieces(loading: Any, duration: float | None) -> list[tuple[float, float]]:
    single = isinstance(loading, int | float)
    if single == (duration is None):
        raise ParameterError(
            "loading must be one rate together with duration, or pairs of (length, rate) without duration. "
            f"Received loading={loading!r}, duration={duration!r}."
        )
    pieces: list[tuple[Any, Any]] = [(duration, loading)] if single else list(loading)
    for length, speed in pieces:
        if not (math.isfinite(length) and length > 0 and math.isfinite(speed) and speed >= 0):
            raise ParameterError(
                "each pair of loading must have a positive, finite length and a finite rate ≥ 0. "
                f"Received {length!r} s at {speed!r} m/s."
            )
    if (whole := math.fsum(length for length, _ in pieces)) > _LONGEST_RUN:
        raise ParameterError(f"duration must be at most {_LONGEST_RUN:g} s, got {whole:g} s: give a shorter duration")
    if not pieces:
        raise ParameterError("loading must have at least one pair of (length, rate). Received none.")
    return [(float(length), float(speed)) for length, speed in pieces]


def _output_times(times: Any, pieces: list[tuple[float, float]]) -> "np.ndarray | None":
    if times is None:
        return None
    instants, end = np.asarray(times, dtype=float), math.fsum(length for length, _ in pieces)
    if (
        instants.ndim != 1
        or not len(instants)
        or np.any(np.diff(instants) <= 0)
        or instants[0] < 0
        or instants[-1] > end * (1 + 1e-12)
    ):
        raise ParameterError(f"times must ascend between 0 and the duration ({end!r} s). Received {times!r}.")
    return np.asarray(np.minimum(instants, end))


@dataclass(frozen=True)
class _History:
    slider: SpringSlider
    problem: SmoothProblem
    pieces: list[tuple[float, float]]
    course: PressureHistory
    output_times: "np.ndarray | None"
    method: str
    rtol: float

    def run(self, start: list[float]) -> SmoothSolution:
        """Solution over all pieces; the variables are continuous at a jump of the loading rate."""
        parts: list[SmoothSolution] = []
        y = np.array(start)
        for now, end, load in self._spans():
            y, onset = self._stepped(y, now)
            pressure = self.course.after(now)
            slope = (self.course.before(end) - pressure) / (end - now)
            inner = (
                np.empty(0)
                if self.output_times is None
                else self.output_times[(self.output_times > now) & (self.output_times < end)]
            )
            part = self.problem.integrate(
                y,
                Ramp(now, (load, pressure, slope), (0.0, slope, 0.0)),
                np.array([now, *inner, end]),
                every_step=self.output_times is None,
                method=self.method,
                rtol=self.rtol,
            )
            parts.append(replace(part, crossings=np.concatenate([onset, part.crossings])))
            y = part.values[:, -1]
        return self._joined(np.array(start), parts)

    def _spans(self) -> "list[tuple[float, float, float]]":
        """Start, end [s] and loading rate [m/s] of spans of limited length with smooth loading and pressure."""
        spans, now = [], 0.0
        for length, load in self.pieces:
            end = now + length
            inside = {time for time in self.course.times if now < time < end}
            inside |= {now + i * _LONGEST for i in range(1, math.ceil(length / _LONGEST))}
            spans += [(a, b, load) for a, b in pairwise((now, *sorted(inside), end))]
            now = end
        return spans

    def _stepped(self, y: "np.ndarray", now: float) -> "tuple[np.ndarray, np.ndarray]":
        """Variables after a step of the pressure at this time, if any; the time if the rate jumps above the onset."""
        before, after = self.course.before(now), self.course.after(now)
        if before == after:
            return y, np.empty(0)
        stepped, watched = self.slider.stepped(y, before, after), self.problem.watched
        risen = y[watched] < self.problem.level <= stepped[watched]
        return stepped, np.array([now] if risen else [])

    def _joined(self, start: "np.ndarray", parts: list[SmoothSolution]) -> SmoothSolution:
        """All parts joined; at a jump both values are returned, but only the later one at a requested instant."""
        times, values = [parts[0].time[:1]], [start[:, None]]
        for part in parts:
            same = int(np.array_equal(part.values[:, 0], values[-1][:, -1]))
            times.append(part.time[same:])
            values.append(part.values[:, same:])
        time, value = np.concatenate(times), np.concatenate(values, axis=1)
        if self.output_times is not None:
            selected = np.isin(time, self.output_times) & np.append(np.diff(time) > 0, True)
            time, value = time[selected], value[:, selected]
        crossings = np.concatenate([part.crossings for part in parts])
        return SmoothSolution(time, value, crossings, sum(part.evaluations for part in parts))

    def load_point(self, time: "np.ndarray") -> "np.ndarray":
        """Displacement of the far end [m]."""
        ends = np.cumsum([0.0, *(length for length, _ in self.pieces)])
        passed = np.cumsum([0.0, *(length * load for length, load in self.pieces)])
        return np.asarray(np.interp(time, ends, passed))


def _trajectory(
    subject: Fault | SpringSlider, slider: SpringSlider, history: _History, level: float, start: list[float]
) -> StateTrajectory:
    began, solution = perf_counter(), history.run(start)
    loaded = history.load_point(solution.time)
    pressure = history.course.sampled(solution.time)
    readings = slider.readings.map(len(solution.time))(solution.values, pressure)
    friction, excess = (row.full().ravel() for row in readings)
    rate = np.exp(solution.values[2])
    name, area, dynamic, moment = slider.law.name, 1.0, math.inf, math.nan
    if isinstance(subject, Fault):
        name, area, dynamic, moment = subject.name, subject.area, dynamic_rate(subject), subject.moment_of(1.0)
    return StateTrajectory(
        name=f"{name}, remote loading",
        time=solution.time,
        load_point=loaded,
        slip=solution.values[0],
        slip_rate=rate,
        stretch=solution.values[1],
        friction=friction,
        pressure=pressure,
        states=np.exp(solution.values[3:]),
        state_names=slider.law.state_names,
        state_units=slider.law.state_units,
        imbalance=excess / slider.normal_stress,
        onsets=solution.crossings,
        onset_rate=level,
        loading_rate=max(load for _, load in history.pieces),
        dynamic_rate=dynamic,
        moment_per_slip=moment,
        metrics=Metrics(
            peak_slip_rate=float(np.max(rate)),
            settled_from=0.0,
            steps=len(solution.time) - 1,
            seconds=perf_counter() - began,
        ),
        events={},
        energy=_energy(slider, area, loaded, solution.values, friction, pressure),
        provenance={
            "friction": slider.law.name,
            "inertia": str(slider.mass > 0),
            "method": history.method,
            "rtol": history.rtol,
            "evaluations": solution.evaluations,
        }
        | library_versions("scipy", "casadi", "numpy", "quakedesign"),
    )


def _energy(
    slider: SpringSlider,
    area: float,
    loaded: "np.ndarray",
    values: "np.ndarray",
    friction: "np.ndarray",
    pressure: "np.ndarray",
) -> EnergyBudget:
    """Energy budget of an area [m²] from forces integrated along the paths of block and load point."""
    slip, stretch, rate = values[0], values[1], np.exp(values[2])

    def change_of(energy: "np.ndarray") -> float:
        return float(area * (energy[-1] - energy[0]))

    def work(force: "np.ndarray", path: "np.ndarray") -> float:
        return float(area * np.trapezoid(force, path))

    return EnergyBudget(
        kinetic=change_of(0.5 * slider.mass * rate**2),
        elastic=change_of(0.5 * slider.stiffness * stretch**2),
        frictional=work((slider.normal_stress - pressure) * friction, slip),
        injection=work(pressure * friction, slip),
        viscous=work(slider.damping * rate, slip),
        far_field=work(slider.stiffness * stretch, loaded),
        disturbance=0.0,
    )


# ----------------------------------------------------------------------
# Slip rate at which damping and inertia balance the direct effect.


def direct_strength(fault: Fault) -> float:
    """aσ' [Pa]: instantaneous increase of the strength in steady sliding if the slip rate is multiplied by e."""
    law = fault.friction
    rate, state = law.operating_rate, law.steady_state(law.operating_rate)
    gain = law.coefficient(0, math.e * rate, *state) - law.coefficient(0, rate, *state)
    return float(gain) * fault.effective_normal_stress


def dynamic_rate(fault: Fault) -> float:
    """aσ'A/(η + √(km)) [m/s]: slip rate at which damping and inertia balance the direct effect."""
    resisting = fault.damping + fault.mass * fault.natural_frequency
    return direct_strength(fault) * fault.area / resisting


# ----------------------------------------------------------------------
# Initial conditions of a fault with a state: in steady sliding, after a hold, or late in its cycle.

_CYCLES = 3  # the first cycle depends on the initial condition
_FIRST_LOADS, _MOST_LOADS = 10.0, 1000.0  # loads of the first and of the longest run, in units of aσ'
_OLDER = 1.5  # ratio of the initial to the steady friction state


@dataclass(frozen=True, slots=True, kw_only=True)
class InitialCondition:
    """Initial slip rate and friction state; the stretch of the spring balances the forces."""

    slip_rate: float  # [m/s]
    state: tuple[float, ...]  # In the units of the law

    @property
    def settings(self) -> dict[str, Any]:
        """Arguments of `simulate_state`."""
        return {"start_rate": self.slip_rate, "start_state": self.state}


def sliding(fault: Fault, rate: float) -> InitialCondition:
    """Steady sliding at a rate [m/s]."""
    return InitialCondition(slip_rate=rate, state=tuple(map(float, fault.friction.steady_state(rate))))


def locked(fault: Fault, rate: float, hold: float, **settings: Any) -> InitialCondition:
    """Initial condition after steady sliding at `rate` [m/s] and a hold of the far end for the time `hold` [s].

    `settings` are ``inertia, method, rtol`` of `simulate_state`.
    """
    require_positive(hold=hold)
    run = simulate_state(fault, [(hold, 0.0)], start_rate=rate, times=[hold], **settings)
    return InitialCondition(slip_rate=float(run.slip_rate[-1]), state=tuple(map(float, run.states[:, -1])))


def late_in_cycle(fault: Fault, rate: float, share: float, **settings: Any) -> InitialCondition:
    """Initial condition at the fraction `share` of the time between two onsets, for a loading rate [m/s].

    `settings` are ``inertia, method, rtol`` of `simulate_state`.

    Raises
    ------
    ParameterError
        For a loading rate that is not positive, a share outside [0, 1), or a fault without repeated events.
    SimulationError
        If the integration fails.
    """
    require_positive(loading_rate=rate)
    if not 0 <= share < 1:
        raise ParameterError(
            f"share of the cycle must be at least 0 and less than 1. Received {share!r}. Give for example 0.9."
        )
    if not derive(fault).unstable:
        raise ParameterError(
            f"an initial condition late in the cycle needs repeated events. Received {fault.name}, which is stable. "
            "Use steady sliding as initial condition."
        )
    cycle = cycles(fault, rate, **settings)
    if len(cycle.onsets) < _CYCLES:
        raise ParameterError(
            f"an initial condition late in the cycle needs three events. Received {fault.name}, with "
            f"{len(cycle.onsets)} in {cycle.time[-1]:.3g} s at {rate:.3g} m/s. Use steady sliding as initial condition."
        )
    before, after = cycle.onsets[-2:]
    time = float(before + share * (after - before))
    settings |= disturbed(fault, rate).settings
    run = simulate_state(fault, rate, duration=math.nextafter(time, math.inf), times=[time], **settings)
    return InitialCondition(slip_rate=float(run.slip_rate[-1]), state=tuple(map(float, run.states[:, -1])))


def cycles(fault: Fault, rate: float, **settings: Any) -> StateTrajectory:
    """Run at a loading rate [m/s], initially near steady sliding, with at least three events if they repeat.

    The load starts at 10 aσ' and is doubled until three events have begun, to at most 640 aσ' (stable fault: 10).
    `settings` as in `locked`.
    """
    unit = direct_strength(fault) * fault.area / (fault.stiffness * rate)
    loads, most = _FIRST_LOADS, _MOST_LOADS if derive(fault).unstable else _FIRST_LOADS
    while True:
        run = simulate_state(fault, rate, duration=loads * unit, **disturbed(fault, rate).settings, **settings)
        loads *= 2
        if len(run.onsets) >= _CYCLES or loads > most:
            return run


def disturbed(fault: Fault, rate: float) -> InitialCondition:
    """Initial condition at a slip rate [m/s], with 1.5 times the friction state of steady sliding."""
    return InitialCondition(slip_rate=rate, state=tuple(_OLDER * float(v) for v in fault.friction.steady_state(rate)))
