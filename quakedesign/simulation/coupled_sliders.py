"""Coupled blocks with rate-and-state friction: seismic cycles, controlled runs, pressure diffusion.

Let ζ be the slip minus the displacement of the far end, which moves at v_∞; v the slip rate; N = σ' − p; S the
stiffness matrix; τ_0 the initial shear stress; s(t) a further shear stress; m and H mass and damping. For each block

    ζ' = v − v_∞,    mv' = τ_0 − Sζ + s − Nμ(v, θ) − Hv,    θ' as given by the friction law.

Without mass (quasi-dynamic) the right-hand side of the second equation is 0, and its time derivative gives v'. The
logarithms of v and θ are integrated. Pressures h of cells or wells obey h' = Fh + Gu and act on the blocks by shares.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
import sympy as sp

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, SimulationError
from quakedesign.fault import BlockChain, FrictionLaw, SlidingReference
from quakedesign.fault.block_chain import add_springs
from quakedesign.fault.model import magnitude, require_positive
from quakedesign.plant.block_plant import measured_by
from quakedesign.simulation.block_run import MPA
from quakedesign.simulation.integrators import RTOL, TIGHT_RTOL, StoppedError, adaptive_integrators
from quakedesign.simulation.smooth_integration import Ramp, SmoothProblem
from quakedesign.simulation.state_plant import TIDE, slip
from quakedesign.simulation.stick_slip import direct_strength
from quakedesign.symbolic.casadi_printer import to_casadi
from quakedesign.symbolic.rate_and_state_plant import rate, state_symbols, without_overflow

MOST_EXPANDED = 40  # above this number of blocks, matrix equations are used, without a Jacobian
_LONGEST = 1e9  # s, longest span of one time variable: the resolution of its floats is then 1.2e-7 s
_LONGEST_RUN = 1e5 * _LONGEST  # s
_FARTHEST = 1e6  # largest displacement of the far end, in critical slips: some thousand cycles
_MOST_PERIODS = 10**5  # of a controlled run
_ONSET = 10.0  # times the loading rate
_EVENTS, _FIRST_LOADS, _MOST_LOADS = 3, 10.0, 1000.0  # least number of events; first and largest load [aσ']
_SMALL = 1e3  # Pa; the tolerance of pressures below this value is absolute
_SHARES = (0.25, 0.5, 0.75, 1.0)  # fractions of a sampling period at which a controlled run is recorded
_WIDEST = 50.0  # largest change of the logarithm of a rate by the initial stress


@checked_dataclass(frozen=True, eq=False, kw_only=True)
class CoupledSliders:
    """Coupled blocks, with all quantities per unit area, and the pressures that act on them.

    Attributes
    ----------
    laws : tuple of FrictionLaw
        Friction laws of the blocks, with one state each; a ParameterError is raised for others.
    stiffness : ndarray
        S [Pa/m], blocks × blocks: decrease of the stress on a block per slip of every block.
    normal_stress : tuple of float
        σ' [Pa] of every block.
    damping : float
        H [Pa·s/m].
    mass : float
        m [kg/m²]; 0: quasi-dynamic.
    flow : ndarray
        F [1/s] in h' = Fh + Gu for the pressures h of cells or wells; empty without such pressures.
    source : ndarray
        G in h' = Fh + Gu, shape (pressures, inputs) [Pa/s per unit of u].
    shares : ndarray
        Share of each of these pressures (columns) in the pressure of every block (rows) [-].
    """

    laws: tuple[FrictionLaw, ...]
    stiffness: np.ndarray
    normal_stress: tuple[float, ...]
    damping: float
    mass: float = 0.0
    flow: np.ndarray | tuple[()] = ()
    source: np.ndarray | tuple[()] = ()
    shares: np.ndarray | tuple[()] = ()

    def __post_init__(self) -> None:
        wrong = [law.name for law in self.laws if len(law.state_names) != 1]
        if wrong:
            raise ParameterError(f"coupled blocks need friction with one state. Received {wrong[0]}. Change the law.")

    @classmethod
    def of(cls, chain: BlockChain, *, inertia: bool = False, lag: float | None = None) -> "CoupledSliders":
        """Blocks of a chain. With a lag [s], also the lagged feedback pressures of its wells."""
        N, m, fault = len(chain.blocks), len(chain.wells), chain.fault
        stiffness, mass = np.diag([fault.stiffness / fault.area] * N), fault.mass / fault.area
        add_springs(stiffness, chain.springs, -mass)
        wells = {} if lag is None else {"flow": -np.eye(m) / lag, "source": np.eye(m) / lag}
        return cls(
            laws=tuple(block.friction for block in chain.blocks),
            stiffness=stiffness,
            normal_stress=tuple(block.effective_normal_stress for block in chain.blocks),
            damping=fault.damping / fault.area,
            mass=mass if inertia else 0.0,
            shares=() if lag is None else np.array(chain.shares, dtype=float),
            **wells,
        )

    @property
    def sizes(self) -> tuple[int, int]:
        """Number of blocks, and number of pressures of cells or wells."""
        return len(self.laws), len(self.flow)

    def start(self, rates: Sequence[float], states: Sequence[float]) -> "np.ndarray":
        """Initial y: ζ = 0 [m], logarithms of the positive rates [m/s] and states [s], and pressures h = 0 [Pa]."""
        require_positive("", slip_rate=min(rates), state=min(states))
        return np.concatenate([np.zeros(len(rates)), np.log(rates), np.log(states), np.zeros(len(self.flow))])

    @cached_property
    def _friction(self) -> list[ca.Function]:
        """Per block (log v, log θ) → μ, ∂μ/∂log v, ∂μ/∂log θ, (log θ)', and the factor of −(log N)' in (log θ)'."""
        functions: dict[FrictionLaw, ca.Function] = {}
        for law in self.laws:
            if law not in functions:
                log_rate, log_state = ca.SX.sym("log_rate"), ca.SX.sym("log_state")
                exact, states = law.exact(), state_symbols(law.state_names)
                parts = [
                    without_overflow(exact.coefficient(slip, rate, *states)),
                    *exact.state_rates(slip, rate, *states),
                ]
                values = {rate: ca.exp(log_rate), states[0]: ca.exp(log_state), slip: ca.SX(0)}
                mu, change = to_casadi([sp.sympify(part) for part in parts], values)
                by = [ca.jacobian(mu, x) for x in (log_rate, log_state)]
                outputs = [mu, *by, change / values[states[0]], ca.SX(law.stress_exponents[0])]
                functions[law] = ca.Function("friction", [log_rate, log_state], outputs)
        return [functions[law] for law in self.laws]

    def _of_friction(self, log_rate: ca.MX, log_state: ca.MX) -> list[ca.MX]:
        """Outputs of `_friction` as columns, one entry a block."""
        functions, N = self._friction, len(self.laws)
        if len(set(self.laws)) == 1:
            return [row.T for row in functions[0].map(N)(log_rate.T, log_state.T)]
        rows = [f(log_rate[i], log_state[i]) for i, f in enumerate(functions)]
        return [ca.vertcat(*column) for column in zip(*rows, strict=True)]

    def field(self, y: Any, load: Any, stress: Any = 0, stress_rate: Any = 0) -> ca.MX:
        """y' in CasADi.

        Parameters
        ----------
        y : MX
            Vector of `start`.
        load : MX
            v_∞ [m/s], a further pressure on all blocks and its rate [Pa, Pa/s], τ_0 of every block [Pa] if there is
            mass, and inputs u.
        stress, stress_rate : MX
            s [Pa] of every block and its rate [Pa/s].
        """
        N, n = self.sizes
        zeta, log_rate, log_state, h = ca.vertsplit(y, [0, N, 2 * N, 3 * N, 3 * N + n])
        v, pressure, change, h_rate = ca.exp(log_rate), load[1], load[2], y[:0]
        fixed_loads = 3 + N * (self.mass > 0)
        if n:
            flow = ca.DM(ca.sparsify(ca.DM(self.flow)))
            h_rate = ca.mtimes(flow, h)
            if np.size(self.source):
                h_rate += ca.mtimes(ca.DM(self.source), load[fixed_loads:])
            shares = ca.DM(ca.sparsify(ca.DM(self.shares)))
            pressure, change = pressure + ca.mtimes(shares, h), change + ca.mtimes(shares, h_rate)
        normal = ca.DM(self.normal_stress) - pressure
        mu, by_rate, by_state, log_state_change, exponent = self._of_friction(log_rate, log_state)
        log_state_change -= exponent * change / normal
        S = ca.DM(self.stiffness)
        if self.mass:
            driven = load[3:fixed_loads] - ca.mtimes(S, zeta) + stress - normal * mu - self.damping * v
            log_rate_change = driven / (self.mass * v)
        else:
            loaded = stress_rate - ca.mtimes(S, v - load[0]) + change * mu - normal * by_state * log_state_change
            log_rate_change = loaded / (normal * by_rate + self.damping * v)
        return ca.vertcat(v - load[0], log_rate_change, log_state_change, h_rate)

    def rates(self, inputs: int = 0) -> ca.Function:
        """CasADi Function (y, load) → y', with the Jacobian up to `MOST_EXPANDED` blocks."""
        N, n = self.sizes
        y, load = ca.MX.sym("y", 3 * N + n), ca.MX.sym("load", 3 + N * (self.mass > 0) + inputs)
        rates = ca.Function("rates", [y, load], [ca.densify(self.field(y, load))])
        if N > MOST_EXPANDED:
            return rates
        state, loading = ca.SX.sym("y", y.size1()), ca.SX.sym("load", load.size1())
        field = ca.cse([rates(state, loading)])[0]
        return ca.Function("rates", [state, loading], [field, ca.jacobian(field, state)])

    def resisting(self, y: "np.ndarray") -> "np.ndarray":
        """Nμ + Hv [Pa] of every block."""
        N, n = self.sizes
        normal = np.array(self.normal_stress) - (np.asarray(self.shares) @ y[3 * N :] if n else 0)
        mu = [float(f(*pair)[0]) for f, pair in zip(self._friction, y[N : 3 * N].reshape(2, N).T, strict=True)]
        return np.asarray(normal * mu + self.damping * np.exp(y[N : 2 * N]))

    def stressed(self, y: "np.ndarray", stress: "np.ndarray") -> "np.ndarray":
        """Vector y after a step of the stress [Pa] on every block; y itself if the blocks have mass."""
        from scipy.optimize import brentq

        if self.mass:
            return y
        strength, stressed = self.resisting(y) + stress, y.copy()
        N = len(self.laws)

        def excess(value: float, i: int) -> float:
            tried = y.copy()
            tried[N + i] = value
            return float(self.resisting(tried)[i] - strength[i])

        for i in range(N):
            stressed[N + i] = brentq(excess, y[N + i] - _WIDEST, y[N + i] + _WIDEST, args=(i,), xtol=1e-14)
        return stressed


# ----------------------------------------------------------------------
# Runs without control.


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockEvent:
    """One event of several blocks, during which the fastest block exceeds the onset rate."""

    onset: float  # [s]
    arrest: float | None  # [s]; None if the run ends earlier
    slip: tuple[float, ...] | None  # Of every block [m]
    peak_slip_rate: tuple[float, ...]  # Of every block [m/s]
    magnitude: float | None  # M_w [-]


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidersRun:
    """A run of coupled blocks. Arrays have shape (instants, blocks); `pressure` has shape (instants, cells or wells).

    Attributes
    ----------
    times, slip, slip_rate, state, pressure : ndarray
        Time [s], slip [m], slip rate [m/s], friction state [s], pressure [Pa].
    reference : ndarray
        Displacement of the far end, or r of a controlled run [m].
    onsets : ndarray
        Times [s] at which the slip rate of the fastest block rises through the onset rate.
    onset_rate, loading_rate : float
        [m/s].
    evaluations : int
        Number of evaluations of the right-hand side.
    """

    times: "np.ndarray"
    slip: "np.ndarray"
    slip_rate: "np.ndarray"
    state: "np.ndarray"
    pressure: "np.ndarray"
    reference: "np.ndarray"
    onsets: "np.ndarray"
    onset_rate: float
    loading_rate: float
    evaluations: int

    @property
    def fastest(self) -> "np.ndarray":
        """Slip rate of the fastest block [m/s]."""
        return np.asarray(self.slip_rate.max(axis=1))

    def events(self, moment_per_slip: "np.ndarray | None" = None) -> tuple[BlockEvent, ...]:
        """Events of the run. Magnitudes need `moment_per_slip`, the seismic moment per slip of every block [N]."""
        below, events = self.fastest <= self.onset_rate, []
        falls = np.flatnonzero(~below[:-1] & below[1:])
        for onset in self.onsets:
            after = falls[self.times[falls + 1] > onset]
            end = int(after[0]) if len(after) else None
            arrest, moved = None, None
            if end is not None:
                fast, slow = self.fastest[end : end + 2]
                part = (fast - self.onset_rate) / (fast - slow)
                arrest = float(self.times[end] + part * (self.times[end + 1] - self.times[end]))
                pairs = [np.interp([onset, arrest], self.times, column) for column in self.slip.T]
                moved = tuple(float(b - a) for a, b in pairs)
            during = (self.times >= onset) & (self.times <= (np.inf if arrest is None else arrest))
            size = None
            if moved is not None and moment_per_slip is not None:
                size = magnitude(float(moment_per_slip @ moved))
            events.append(
                BlockEvent(
                    onset=float(onset),
                    arrest=arrest,
                    slip=moved,
                    peak_slip_rate=tuple(map(float, self.slip_rate[during].max(axis=0, initial=0.0))),
                    magnitude=size,
                )
            )
        return tuple(events)


def _run_of(sliders: CoupledSliders, times: np.ndarray, values: np.ndarray, far: Any = 0.0, *more: Any) -> SlidersRun:
    """A run from vectors y and the far end's displacement [m]; `more`: its rate, onsets, onset rate, evaluations."""
    N, (rate, onsets, onset, evaluations) = len(sliders.laws), more or (0.0, np.empty(0), math.inf, 0)
    return SlidersRun(
        times=times,
        slip=values[:, :N] + np.reshape(far, (-1, 1)),
        slip_rate=np.exp(values[:, N : 2 * N]),
        state=np.exp(values[:, 2 * N : 3 * N]),
        pressure=values[:, 3 * N :],
        reference=far,
        onsets=onsets,
        onset_rate=onset,
        loading_rate=rate,
        evaluations=evaluations,
    )


def simulate_sliders(
    sliders: CoupledSliders,
    start: "np.ndarray",
    duration: float,
    *,
    loading_rate: float = 0.0,
    inputs: Sequence[tuple[float, Sequence[float]]] = (),
    onset_rate: float = math.inf,
    times: Sequence[float] = (),
    method: str = "radau",
    rtol: float = RTOL,
) -> SlidersRun:
    """Simulate coupled blocks without control under remote loading.

    Parameters
    ----------
    sliders : CoupledSliders
    start : ndarray
        Vector of `CoupledSliders.start`; the initial stresses balance friction.
    duration : float
        [s].
    loading_rate : float
        v_∞ [m/s].
    inputs : sequence of (float, sequence of float)
        Times [s], the first 0, at which the inputs u change, and the new values of u.
    onset_rate : float
        Slip rate [m/s] above which an event begins.
    times : sequence of float, optional
        Ascending output times [s], in addition to both ends and the times of `inputs`; by default every solver step.
    method, rtol
        As in `simulate_state`.

    Raises
    ------
    ParameterError
        For a duration outside (0, 1e14] s, or if the far end moves by more than 1e6 critical slips.
    """
    require_positive(duration=duration)
    slips = [float(law.critical_slip) for law in sliders.laws]  # type: ignore[attr-defined]
    if duration > _LONGEST_RUN or duration * loading_rate > _FARTHEST * min(slips):
        raise ParameterError(
            f"duration must be at most {_LONGEST_RUN:g} s, and the far end must move by at most {_FARTHEST:g} critical "
            f"slips. Received {duration:g} s at {loading_rate:g} m/s. Shorten the duration."
        )
    N, n = sliders.sizes
    prestress = tuple(sliders.resisting(start)) if sliders.mass else ()
    scales = np.array([*slips, *[1.0] * (2 * N), *[_SMALL] * n])
    level = math.log(onset_rate) if math.isfinite(onset_rate) else math.inf
    pressures = tuple(inputs[0][1]) if inputs else ()
    problem = SmoothProblem(sliders.rates(len(pressures)), scales, slice(N, 2 * N), level)
    breaks = {float(time) for time, _ in inputs if 0 < time < duration}
    breaks |= {i * _LONGEST for i in range(1, math.ceil(duration / _LONGEST))}
    y, pieces, crossings, evaluations = start, list[tuple[np.ndarray, np.ndarray]](), [], 0
    for now, end in pairwise((0.0, *sorted(breaks), duration)):
        pressures = next((tuple(u) for time, u in reversed(inputs) if time <= now), pressures)
        load = (loading_rate, 0.0, 0.0, *prestress, *pressures)
        ramp = Ramp(now, load, (0.0,) * len(load))
        instants = np.array([now, *(time for time in times if now < time < end), end])
        part = problem.integrate(y, ramp, instants, every_step=not len(times), method=method, rtol=rtol)
        first = int(bool(pieces))
        pieces.append((part.time[first:], part.values[:, first:]))
        crossings.append(part.crossings)
        evaluations += part.evaluations
        y = part.values[:, -1]
    passed = np.concatenate([time for time, _ in pieces])
    values = np.concatenate([value for _, value in pieces], axis=1).T
    crossed = np.concatenate(crossings)
    return _run_of(sliders, passed, values, loading_rate * passed, loading_rate, crossed, onset_rate, evaluations)


def natural_cycles(
    chain: BlockChain,
    duration: float | None = None,
    *,
    loading_rate: float | None = None,
    inertia: bool = False,
    method: str = "radau",
    rtol: float = RTOL,
) -> SlidersRun:
    """Simulate blocks under remote loading. Block i = 1 … N has initially 1 + i/N times its steady state.

    Parameters
    ----------
    chain : BlockChain
        With rate-and-state friction.
    duration : float, optional
        [s]. By default the duration is doubled until three events have begun: the far end loads the first block by 10,
        20, 40 … 640 times its aσ'.
    loading_rate : float, optional
        v_∞ [m/s]; the reference rate of the friction of the first block unless given.
    inertia : bool
        Whether the inertia of the blocks is included.
    method, rtol
        As for `simulate_state`.
    """
    far = float(chain.blocks[0].friction.operating_rate) if loading_rate is None else loading_rate
    require_positive(loading_rate=far)
    sliders, N, fault = CoupledSliders.of(chain, inertia=inertia), len(chain.blocks), chain.faults[0]
    older = [float(law.steady_state(far)[0]) * (1 + i / N) for i, law in enumerate(sliders.laws, 1)]
    start = sliders.start([far] * N, older)
    settings: dict[str, Any] = {"method": method, "rtol": rtol, "loading_rate": far, "onset_rate": _ONSET * far}
    if duration is not None:
        return simulate_sliders(sliders, start, duration, **settings)
    unit, loads = direct_strength(fault) * fault.area / (fault.stiffness * far), _FIRST_LOADS
    while True:
        run = simulate_sliders(sliders, start, loads * unit, **settings)
        loads *= 2
        if len(run.onsets) >= _EVENTS or loads > _MOST_LOADS:
            return run


# ----------------------------------------------------------------------
# Controlled runs in slow sliding.


def planned_per_slip(chain: BlockChain) -> float:
    """Pressure for steady sliding at the first rate of the reference, per slip of the reference [Pa/m]."""
    rate = float(SlidingReference(task=chain.fault.reference).first_rate)
    steady = float(chain.blocks[0].friction.steady_coefficient(rate))
    return float(chain.fault.stiffness / chain.fault.area / steady)


def simulate_sampled_blocks(
    chain: BlockChain,
    law: Any,
    *,
    lag: float,
    stress: float = 0.0,
    period: float = TIDE,
    duration: float | None = None,
    inertia: bool = False,
    progress: Callable[[float], None] = lambda _: None,
) -> SlidersRun:
    """Simulate blocks under a sampled law that tracks the slow-sliding reference.

    Initially all blocks slide steadily at its first rate. The planned pressure acts on them directly, the feedback
    pressure through a first-order lag. The far end is fixed. From t = 0 a sinusoidal stress acts on block i = 0 … N − 1
    with the phase 2πi/N. A SimulationError is raised if the solver stops.

    Parameters
    ----------
    chain : BlockChain
    law : MatrixLaw
        Its inputs are the slip errors of the blocks [m], or one average per well; its outputs are pressures [MPa].
    lag : float
        Time constant of the lag [s].
    stress, period : float
        Amplitude [Pa] and period [s] of the stress.
    duration : float, optional
        [s], at most 1e5 sampling periods; the operation time unless given.
    inertia : bool
        Whether the inertia of the blocks is included.

    Returns
    -------
    SlidersRun
        Four instants per sampling period. `pressure` is the feedback pressure of the wells.
    """
    length, step = chain.fault.reference.operation_time if duration is None else duration, float(law.step)
    require_positive(duration=length, stress_period=period, lag=lag)
    if length > _MOST_PERIODS * step:
        raise ParameterError(
            f"duration must be at most {_MOST_PERIODS:g} sampling periods, {_MOST_PERIODS * step:g} s. "
            f"Received {length:g} s. Shorten the duration."
        )
    sliders, course = CoupledSliders.of(chain, inertia=inertia, lag=lag), SlidingReference(task=chain.fault.reference)
    (N, m), V = sliders.sizes, float(course.first_rate)
    per_slip = planned_per_slip(chain)
    turn, phases = 2 * math.pi / period, 2 * np.pi * np.arange(N) / N
    y = sliders.start([V] * N, [float(one.steady_state(V)[0]) for one in sliders.laws])
    prestress = sliders.resisting(y)
    y = sliders.stressed(y, stress * np.sin(phases))
    time, pressures, state = ca.MX.sym("t"), ca.MX.sym("held", m), ca.MX.sym("y", len(y))
    planned = per_slip * course.slip(time)
    load = ca.vertcat(0, planned, ca.jacobian(planned, time), ca.DM(prestress) if inertia else ca.MX(0, 1), pressures)
    stresses = stress * ca.sin(turn * time + ca.DM(phases)), stress * turn * ca.cos(turn * time + ca.DM(phases))
    rates = ca.Function("rates", [time, state, pressures], [ca.densify(sliders.field(state, load, *stresses))])
    slips = [float(one.critical_slip) for one in sliders.laws]  # type: ignore[attr-defined]
    scales = [*slips, *[1.0] * (2 * N), *[MPA] * m]
    flow = adaptive_integrators()["cvodes"].flow(rates.expand(), scales, _SHARES, rtol=TIGHT_RTOL)
    F, G, H, D = (np.array(part, dtype=float) for part in (law.update, law.measured, law.output, law.feedback))
    weights = np.array(measured_by(chain.shares), dtype=float)
    z, rows, times = np.zeros(len(F)), [y], [0.0]
    for k in range(math.ceil(length / step)):
        now = k * step
        seen = weights @ y[:N] - float(course.slip(now))
        u = MPA * (H @ z + D @ seen)
        z = F @ z + G @ seen if len(F) else z
        try:
            samples = flow.follow(now, step, y, u)[0]
        except StoppedError as error:
            raise SimulationError(f"the run stopped at {now:g} s: {error}. Reduce the stress.") from None
        rows += list(samples.T)
        times += [now + share * step for share in _SHARES]
        y = samples[:, -1]
        progress(min(1.0, (now + step) / length))
    run = _run_of(sliders, np.array(times), np.array(rows))
    return replace(run, reference=np.asarray(course.slip(run.times)))
