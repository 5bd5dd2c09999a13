"""Simulated velocity-step and hold experiments with rate-and-state friction.

A spring loads a block. Its far end follows the recorded load point, from sample to sample at a constant rate. Inertia
is neglected: the spring balances friction, k(x − slip) = σ'μ, and the time derivative of this balance gives the slip
rate (the plant of `quakedesign.symbolic.rate_and_state_plant`, without damping, on the time scale of a record). The
stiff equations are integrated by an L-stable Rosenbrock step of order 3, with exact derivatives.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy import ndarray
from scipy.linalg import solve_banded

from quakedesign.fault import FrictionLaw
from quakedesign.identification.experiment import Coordinate, Experiment, fitted_quantities, with_values
from quakedesign.symbolic.casadi_printer import to_casadi, vectorised
from quakedesign.symbolic.plant import x1
from quakedesign.symbolic.rate_and_state_plant import rate, state_symbols, without_overflow

ORDER = 3
_DIAGONAL = 0.5


def step(field: Callable[[ca.SX], ca.SX], y: ca.SX, length: ca.SX) -> tuple[ca.SX, ca.SX]:
    """State after one L-stable step of order 3, and its error as estimated by an embedded step of order 2.

    `field` gives dy/dt of y, both CasADi SX columns; time must not enter. Nothing changes in a step of length 0 [s].
    RODAS3 of Sandu, Verwer, Blom, Spee, Carmichael and Potra (1997), Atmos. Environ. 31(20), 3459.
    """
    rates = field(y)
    inverse = ca.inv(ca.SX.eye(y.numel()) - _DIAGONAL * length * ca.jacobian(rates, y))

    def stage(at: ca.SX, memory: ca.SX | float) -> ca.SX:
        return _DIAGONAL * (inverse @ (length * at + memory))

    first = stage(rates, 0)
    second = stage(rates, 4 * first)
    third = stage(field(y + 2 * first), first - second)
    fourth = stage(field(y + 2 * first + third), first - second - 8 * third / 3)
    return y + 2 * first + third + fourth, fourth


_MOST_STEPS = 30  # largest mean number of trial steps per interval; more: an unstable block, or samples too sparse
_SAFETY = 0.9
_USABLE_ERROR = 1e3  # largest error of friction that gives the next length; else the length falls by a fixed factor
_SHORTEST = 1e-8  # share of the time between two samples
STIFFNESS = "stiffness"
START_STATE = "start_state"  # logarithm of the ratio of the state at the first sample to that of steady sliding
START_RATE = "start_rate"  # logarithm of the ratio of the slip rate at the first sample to the load-point rate


@dataclass(frozen=True, kw_only=True)
class Drive:
    """Inputs of an experiment between neighbouring instants: samples and changes of rate."""

    lengths: ndarray  # [s]
    rates: ndarray  # rates of the load point [m/s]
    growth: ndarray  # d(log σ')/dt [1/s]
    compliance: ndarray  # 1/σ' at the middle [1/Pa, 1/N, or 1]
    first_rate: float  # rate of steady sliding before the first sample [m/s]

    @cached_property
    def inputs(self) -> ndarray:
        """Rates, growth and compliance, one column per interval between neighbouring instants."""
        return np.array([self.rates, self.growth, self.compliance])


@dataclass(frozen=True, kw_only=True)
class SlidingExperiment(Experiment):
    """Simulated friction of a law with state."""

    law: FrictionLaw
    drive: Drive
    coordinates: tuple[Coordinate, ...]
    stiffness: float | None  # given stiffness, in units of the normal load per m
    normal_unit: str  # Pa, N or empty
    steps: tuple[tuple[float, ...], ...]  # step lengths [s] between neighbouring instants
    measured: ndarray  # instants that are samples; the others are changes of rate between them

    def friction(self, fitted: ndarray) -> ndarray:
        """Friction coefficient [-] at every sample, from steady sliding or a fitted deviation from it at the first."""
        states = self._states(fitted)[:, self._sampled]
        return np.asarray(self._build["friction"](states, np.asarray(fitted)[:, None])[0])

    def slopes(self, fitted: ndarray) -> ndarray:
        """Derivatives from the variational equations of the steps themselves: exact for what `friction` computes.

        The derivatives of the single steps are computed for all steps at once; a banded linear system combines them.
        """
        q, states = np.asarray(fitted)[:, None], self._states(fitted)
        size, count = len(states), len(q)
        each = self._build["step_slopes"](states[:, :-1], self._inputs, q).reshape(size + count, size, -1)
        bands = np.zeros((2 * size, states.size))
        bands[0] = 1
        for after, before in np.ndindex(size, size):
            bands[size + after - before, before : states.size - size : size] = -each[before, after]
        moved = np.vstack([self._build["start_slopes"](q[:, 0]).full(), each[size:].T.reshape(-1, count)])
        moved = solve_banded((2 * size - 1, 0), bands, moved, check_finite=False).reshape(-1, size, count)
        read = self._build["friction_slopes"](states[:, self._sampled], q)
        return np.asarray(read[size:].T + np.einsum("it,tij->tj", read[:size], moved[self._sampled]))

    def rates(self, fitted: ndarray) -> ndarray:
        """Slip rate [m/s] at every sample."""
        with np.errstate(over="ignore"):
            rates: ndarray = np.exp(self._states(fitted)[0, self._sampled])
        return rates

    def growth(self, fitted: ndarray) -> ndarray:
        """Time derivative of friction [1/s] just after every sample, from the spring at constant normal load."""
        ends, place = np.flatnonzero(self.measured), [c.name for c in self.coordinates]
        after = np.minimum(ends, len(self.drive.rates) - 1)
        stiffness = self.stiffness if self.stiffness is not None else float(np.exp(fitted[place.index(STIFFNESS)]))
        return np.asarray(stiffness * self.drive.compliance[after] * (self.drive.rates[after] - self.rates(fitted)))

    def remarks(self, fitted: ndarray, noise: float) -> tuple[str, ...]:
        """Remark with the mass above which inertia would be visible."""
        rates = np.exp(self._states(fitted)[0, self._ends])
        acceleration = float(np.max(np.abs(np.diff(rates) / self.drive.lengths * self.drive.compliance)))
        if not (acceleration > 0 and self.normal_unit):
            return ()
        unit = {"Pa": "kg/m^2", "N": "kg"}[self.normal_unit]
        return (f"inertia is neglected: it would matter above {noise / acceleration:.2g} {unit}",)

    def best_law(self, fitted: ndarray) -> FrictionLaw:
        """The law; its working range, if any, is from half the smallest to twice the largest slip rate."""
        law, rates = Experiment.best_law(self, fitted), self.rates(fitted)
        ends = {"slowest_rate": float(f"{np.min(rates) / 2:.2g}"), "fastest_rate": float(f"{2 * np.max(rates):.2g}")}
        effect = {"evolution_effect": getattr(law, "evolution_effect", 1.0)}
        return with_values(law, {n: end for n, end in (ends | effect).items() if n in law.quantities()})

    def resolved(self, fitted: ndarray, accuracy: float) -> "SlidingExperiment":
        """The same experiment with the steps that an accuracy of friction requires at given coordinates.

        By the embedded error estimate; the same steps are then used at other coordinates too, so that friction is a
        smooth function of them. If the steps would be too many or too short, for example because the block is
        unstable, nothing changes.
        """
        q = np.asarray(fitted)
        taken = _steps(self._build["trial"], q, accuracy, self.drive, self._build["start"](q))
        return self if taken is None else replace(self, steps=taken)

    def _states(self, fitted: ndarray) -> ndarray:
        """Logarithms of rate and states [SI]: initial values, then after every step."""
        q = np.asarray(fitted)
        if q.tobytes() not in self._latest:
            start = self._build["start"](q).full()
            states = self._accumulated(start, self._inputs, np.tile(q[:, None], self._inputs.shape[1])).full()
            self._latest.clear()
            self._latest[q.tobytes()] = np.hstack([start, states])
        return self._latest[q.tobytes()]

    @cached_property
    def _latest(self) -> dict[bytes, ndarray]:
        """Cache of the last states: friction, its growth and its slopes use them in turn."""
        return {}

    @cached_property
    def _ends(self) -> ndarray:
        """Number of steps up to every instant."""
        return np.concatenate([[0], np.cumsum([len(lengths) for lengths in self.steps])])

    @cached_property
    def _sampled(self) -> ndarray:
        return np.asarray(self._ends[self.measured])

    @cached_property
    def _inputs(self) -> ndarray:
        between = np.repeat(self.drive.inputs, [len(lengths) for lengths in self.steps], axis=1)
        return np.vstack([np.concatenate(self.steps), between])

    @cached_property
    def _accumulated(self) -> Any:
        return self._build["step"].mapaccum(self._inputs.shape[1])

    @cached_property
    def _build(self) -> dict[str, Any]:
        linear = frozenset(c.name for c in self.coordinates if not c.logarithmic)
        return _built(self.law, tuple(c.name for c in self.coordinates), self.stiffness, self.drive.first_rate, linear)


def _steps(
    trial: Any, fitted: ndarray, accuracy: float, drive: Drive, start: Any
) -> tuple[tuple[float, ...], ...] | None:
    """Step lengths between neighbouring instants, from one simulation; None if the steps are too many or too short."""
    y, length, steps, left = start, float("inf"), [], _MOST_STEPS * len(drive.lengths)
    for whole, between in zip(drive.lengths.tolist(), drive.inputs.T.tolist(), strict=True):
        taken: list[float] = []
        rest = whole
        while rest > 0:
            length, left = (length if length < _SAFETY * rest else rest), left - 1
            if left < 0 or length < _SHORTEST * whole:
                return None
            after, error = trial(y, [length, *between], fitted)
            off = float(error)
            factor = min(max((accuracy / max(off, 1e-300)) ** (1 / ORDER), 0.1), 5.0) if off <= _USABLE_ERROR else 0.1
            if factor >= 1:
                taken.append(length)
                y, rest = after, (0.0 if length == rest else rest - length)
            length *= _SAFETY * factor if factor < 1 else max(_SAFETY * factor, 1.0)
        steps.append(tuple(taken))
    return tuple(steps)


@lru_cache(maxsize=8)
def _built(
    law: FrictionLaw, names: tuple[str, ...], stiffness: float | None, first_rate: float, linear: frozenset[str]
) -> dict[str, Any]:
    """CasADi Functions of a step, its derivatives and outputs, for logarithms of rate, states and coordinates.

    Quantities of the law are exponentials of the coordinates, or numbers.
    """
    symbolic, moving = law.symbolic(), (rate, *state_symbols(law.state_names))
    size = len(law.state_names)
    q, u, y = ca.SX.sym("q", len(names)), ca.SX.sym("u", 4), ca.SX.sym("y", 1 + size)
    friction = without_overflow(symbolic.coefficient(x1, *moving))
    rows = [friction, *(friction.diff(x) for x in moving), *symbolic.state_rates(x1, *moving)]

    def at(expressions: list[Any], y: ca.SX) -> list[ca.SX]:
        now = {x: ca.exp(y[i]) for i, x in enumerate(moving)}
        return to_casadi(expressions, fitted_quantities(law, names, q, linear) | now)

    def field(y: ca.SX) -> ca.SX:
        """d/dt of the logarithms of rate and states, from d(σ'μ)/dt = k(load rate − rate)."""
        mu, mu_rate, *others = at(rows, y)
        load, growth, compliance = u[1], u[2], u[3]
        spring = stiffness if stiffness is not None else ca.exp(q[names.index(STIFFNESS)])
        v = ca.exp(y[0])
        drawn = spring * compliance * (load - v) - growth * mu
        drawn -= sum(slope * change for slope, change in zip(others[:size], others[size:], strict=True))
        return ca.vertcat(drawn / (v * mu_rate), *(others[size + i] / ca.exp(y[1 + i]) for i in range(size)))

    # steady sliding, except for fitted deviations of state and rate
    values = fitted_quantities(law, names, q, linear) | {rate: ca.SX(first_rate)}
    steady = ca.log(ca.vertcat(*to_casadi(symbolic.steady_state(rate), values)))
    older, faster = (q[names.index(n)] if n in names else 0 for n in (START_STATE, START_RATE))
    start = ca.vertcat(np.log(first_rate) + faster, steady + older)
    (after, error), (read,) = step(field, y, u[0]), at([friction], y)
    outputs = {
        "step": ([y, u, q], [after]),
        "trial": ([y, u, q], [after, ca.sum2(ca.fabs(ca.jacobian(read, y)) * ca.fabs(error.T))]),
        "start": ([q], [start]),
        "start_slopes": ([q], [ca.jacobian(start, q)]),
        "step_slopes": ([y, u, q], [ca.jacobian(after, ca.vertcat(y, q))]),
        "friction": ([y, q], [read]),
        "friction_slopes": ([y, q], [ca.jacobian(read, ca.vertcat(y, q))]),
    }
    built = {
        name: ca.Function(name, into, [ca.densify(each) for each in ca.cse(results)])
        for name, (into, results) in outputs.items()
    }
    return built | {name: vectorised(built[name]) for name in ("step_slopes", "friction", "friction_slopes")}
