"""Simulated experiments for the fit: friction at the samples of a record, and its derivatives.

Chapters: the interface; velocity steps and holds with rate-and-state friction; slip-weakening friction.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np
import sympy as sp
from numpy import ndarray
from scipy.linalg import solve_banded
from scipy.optimize.elementwise import find_root

from quakedesign.fault import FrictionLaw
from quakedesign.symbolic.casadi_printer import to_casadi, to_numpy, vectorised
from quakedesign.symbolic.plant import x1
from quakedesign.symbolic.rate_and_state_plant import rate, state_symbols, without_overflow


@dataclass(frozen=True, kw_only=True)
class Coordinate:
    """One fitted number: between `low` and `high` [`unit`, SI]; searches start inside the interval `start`.

    If it is `logarithmic`, it is positive and its logarithm is fitted.
    """

    name: str
    unit: str
    low: float
    high: float
    start: tuple[float, float]
    logarithmic: bool = True

    def inward(self, value: float) -> float:
        """Fitted coordinate of a value."""
        return math.log(value) if self.logarithmic else value

    def outward(self, fitted: float) -> float:
        """Value, in its unit, of a fitted coordinate."""
        return math.exp(fitted) if self.logarithmic else fitted


class Experiment(ABC):
    """A simulated experiment: friction of the record without noise, for given coordinates.

    The values of fitted quantities in `law` are placeholders.
    """

    law: FrictionLaw
    coordinates: tuple[Coordinate, ...]

    @abstractmethod
    def friction(self, fitted: ndarray) -> ndarray:
        """Friction coefficient [-] at every sample; not finite if the experiment cannot be simulated."""

    @abstractmethod
    def slopes(self, fitted: ndarray) -> ndarray:
        """Derivatives of `friction`, shape (samples, coordinates)."""

    def remarks(self, fitted: ndarray, noise: float) -> tuple[str, ...]:
        """Remarks on assumptions that a noise of friction [-] makes relevant; empty by default."""
        return ()

    def best_law(self, fitted: ndarray) -> FrictionLaw:
        """The law with the values of given coordinates."""
        values = {name: v for name, v in self.outward(fitted).items() if name in self.law.quantities()}
        return with_values(self.law, values)

    def resolved(self, fitted: ndarray, accuracy: float) -> "Experiment":
        """The same experiment, simulated to an accuracy of friction [-] at given coordinates."""
        return self

    @property
    def bounds(self) -> tuple[ndarray, ndarray]:
        """Smallest and largest fitted coordinates."""
        ends = [(c.inward(c.low), c.inward(c.high)) for c in self.coordinates]
        low, high = np.array(ends, dtype=float).T
        return low, high

    def near(self, values: Mapping[str, float]) -> ndarray:
        """Fitted coordinates at values of another experiment; for a missing value, the middle of `start`."""
        given = ((c, values.get(c.name)) for c in self.coordinates)
        return np.array([sum(map(c.inward, c.start)) / 2 if v is None else c.inward(v) for c, v in given])

    def outward(self, fitted: ndarray) -> dict[str, float]:
        """Values in their units by name."""
        return {c.name: c.outward(float(q)) for c, q in zip(self.coordinates, fitted, strict=True)}


def fitted_quantities(
    law: FrictionLaw, names: Sequence[str], fitted: Any, linear: Collection[str] = ()
) -> dict[Any, Any]:
    """Values of the symbols of a law: exponentials of the fitted coordinates by name, else its own numbers.

    The `linear` quantities, which may be negative, are fitted without the exponential.
    """
    values = {n: fitted[place] if n in linear else ca.exp(fitted[place]) for place, n in enumerate(names)}
    return {symbol: values.get(name, getattr(law, name)) for name, symbol in law.symbols().items()}


def with_values(law: FrictionLaw, values: Mapping[str, float]) -> FrictionLaw:
    """A law with other values, even with an evolution effect that is not positive, which no fault can have."""
    if values.get("evolution_effect", 1.0) > 0:
        return replace(law, **values)  # type: ignore[type-var]
    own = {name: getattr(law, name) for name in law.quantities()} | law._options()
    return law._with_values({**own, **values})


TREND, TREND_IN_TIME = "trend", "trend_in_time"


@dataclass(frozen=True, kw_only=True)
class _Transformed(Experiment):
    """An experiment in other coordinates than those of the experiment that it wraps, `whole`."""

    whole: Any

    @property
    def law(self) -> FrictionLaw:  # type: ignore[override]
        """Law of `whole`."""
        return self.whole.law  # type: ignore[no-any-return]

    @abstractmethod
    def inside(self, fitted: ndarray) -> ndarray:
        """Coordinates of `whole`."""

    def remarks(self, fitted: ndarray, noise: float) -> tuple[str, ...]:
        """Remarks of `whole`."""
        return self.whole.remarks(self.inside(fitted), noise)  # type: ignore[no-any-return]

    def best_law(self, fitted: ndarray) -> FrictionLaw:
        """Best law of `whole`."""
        return self.whole.best_law(self.inside(fitted))  # type: ignore[no-any-return]

    def resolved(self, fitted: ndarray, accuracy: float) -> Experiment:
        """The same experiment with `whole` resolved."""
        finer = self.whole.resolved(self.inside(fitted), accuracy)
        return self if finer is self.whole else replace(self, whole=finer)


@dataclass(frozen=True, kw_only=True)
class Widened(_Transformed):
    """An experiment, `whole`, with further coordinates, which come last and change friction in proportion to `columns`.

    Trends add to friction; their columns are displacement [m] or time [s]. A delay of a change of rate [s] changes
    friction, to first order, by minus the delay times the time derivative of friction; its column is 1 from this change
    to the next, and 0 elsewhere.
    """

    coordinates: tuple[Coordinate, ...]
    columns: ndarray  # shape (samples, further coordinates)
    delays: bool = False

    def inside(self, fitted: ndarray) -> ndarray:
        """Coordinates of `whole`, without the further ones."""
        return fitted[: len(self.whole.coordinates)]

    def friction(self, fitted: ndarray) -> ndarray:
        """Friction of `whole`, changed by the further coordinates."""
        own = self.inside(fitted)
        with np.errstate(invalid="ignore", over="ignore"):
            moved = self.columns @ fitted[len(own) :] * (-self.whole.growth(own) if self.delays else 1.0)
            return np.asarray(self.whole.friction(own) + moved)

    def slopes(self, fitted: ndarray) -> ndarray:
        """Derivatives, for delays that are short compared with the transients after the changes."""
        own = self.inside(fitted)
        moved = -self.whole.growth(own)[:, None] * self.columns if self.delays else self.columns
        return np.column_stack([self.whole.slopes(own), moved])


DELAY = "delay"


def delayed(whole: Any, after: ndarray, most: ndarray) -> Experiment:
    """An experiment with a delay of each change of rate, at most `most` [s]; `after` are the columns of `Widened`."""
    if not after.shape[1]:
        return whole  # type: ignore[no-any-return]
    delays = [_about_zero(f"{DELAY}_{place}", "s", end) for place, end in enumerate(most.tolist(), start=1)]
    return Widened(whole=whole, coordinates=(*whole.coordinates, *delays), columns=after, delays=True)


def trended(whole: Experiment, along: ndarray, size: float, name: str = TREND) -> Widened:
    """An experiment with a trend along displacement [m] or time [s], over the span at most ten times `size` [-]."""
    trend = _about_zero(name, "1/m" if name == TREND else "1/s", 10 * size / float(np.ptp(along)))
    return Widened(whole=whole, coordinates=(*whole.coordinates, trend), columns=along[:, None])


def _about_zero(name: str, unit: str, most: float) -> Coordinate:
    return Coordinate(name=name, unit=unit, low=-most, high=most, start=(-1e-3 * most, 1e-3 * most), logarithmic=False)


@dataclass(frozen=True, kw_only=True)
class Difference(_Transformed):
    """An experiment with coordinate `first` minus the sum of coordinates `seconds` (indices) in place of `first`."""

    first: int
    seconds: tuple[int, ...]

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:  # type: ignore[override]
        """Coordinates of the experiment, with the difference in place of the first."""
        changed = list(self.whole.coordinates)
        a, others = changed[self.first], [changed[place] for place in self.seconds]
        changed[self.first] = Coordinate(
            name=" - ".join(each.name for each in (a, *others)),
            unit=a.unit,
            low=a.low - sum(b.high for b in others),
            high=a.high - sum(b.low for b in others),
            start=(a.start[0] - sum(b.start[1] for b in others), a.start[1] - sum(b.start[0] for b in others)),
            logarithmic=False,
        )
        return tuple(changed)

    def friction(self, fitted: ndarray) -> ndarray:
        """Friction of the experiment; not finite if the first coordinate would not be positive."""
        return self.whole.friction(self.inside(fitted))  # type: ignore[no-any-return]

    def slopes(self, fitted: ndarray) -> ndarray:
        """Derivatives by the chain rule."""
        at = self.inside(fitted)
        grown = [np.exp(q) if c.logarithmic else 1.0 for q, c in zip(at, self.whole.coordinates, strict=True)]
        slopes = np.array(self.whole.slopes(at))
        slopes[:, self.first] /= grown[self.first]
        for second in self.seconds:
            slopes[:, second] += slopes[:, self.first] * grown[second]
        return slopes

    def difference(self, fitted: ndarray) -> ndarray:
        """Coordinates of this experiment from those of `whole`."""
        changed = np.array(fitted, dtype=float)
        first = self.whole.coordinates[self.first].outward(float(fitted[self.first]))
        changed[self.first] = first - self._others(fitted)
        return changed

    def inside(self, fitted: ndarray) -> ndarray:
        """Coordinates of `whole` from those of this experiment; NaN if the first would not be positive."""
        changed = np.array(fitted, dtype=float)
        first = fitted[self.first] + self._others(fitted)
        if self.whole.coordinates[self.first].logarithmic:
            first = np.log(first) if first > 0 else np.nan
        changed[self.first] = first
        return changed

    def _others(self, fitted: ndarray) -> float:
        return float(sum(self.whole.coordinates[place].outward(float(fitted[place])) for place in self.seconds))


# ----------------------------------------------------------------------
# Simulated velocity-step and hold experiments with rate-and-state friction.

ORDER = 3
_DIAGONAL = 0.5


def step(field: Callable[[ca.SX], ca.SX], y: ca.SX, length: ca.SX) -> tuple[ca.SX, ca.SX]:
    """State after one L-stable step of order 3, and its error as estimated by an embedded step of order 2.

    `field` gives dy/dt of y, both CasADi SX columns, and must not depend on time. For `length` 0 [s], y is unchanged.
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
_SHORTEST = 1e-8  # shortest step, relative to the time between neighbouring instants
STIFFNESS = "stiffness"
START_STATE = "start_state"  # logarithm of the ratio of the state at the first sample to that of steady sliding
START_RATE = "start_rate"  # logarithm of the ratio of the slip rate at the first sample to the load-point rate


@dataclass(frozen=True, kw_only=True)
class Drive:
    """Inputs of an experiment, one value per interval between neighbouring instants: samples and changes of rate."""

    lengths: ndarray  # of the intervals [s]
    rates: ndarray  # rates of the load point [m/s]
    growth: ndarray  # d(log σ')/dt [1/s]
    compliance: ndarray  # reciprocal normal load 1/σ' at the middle [1/Pa, 1/N, or 1]
    first_rate: float  # rate of steady sliding before the first sample [m/s]

    @cached_property
    def inputs(self) -> ndarray:
        """Rates, growth and compliance, one column per interval between neighbouring instants."""
        return np.array([self.rates, self.growth, self.compliance])


@dataclass(frozen=True, kw_only=True)
class SlidingExperiment(Experiment):
    """A block without inertia, pulled by a spring, with the friction of a law with state."""

    law: FrictionLaw
    drive: Drive
    coordinates: tuple[Coordinate, ...]
    stiffness: float | None  # in units of the normal load per m; None if it is fitted
    normal_unit: str  # Pa, N or empty
    steps: tuple[tuple[float, ...], ...]  # step lengths [s] between neighbouring instants
    measured: ndarray  # whether an instant is a sample; the others are changes of rate

    def friction(self, fitted: ndarray) -> ndarray:
        """Friction coefficient [-] at every sample; begins in steady sliding or with a fitted deviation from it."""
        states = self._states(fitted)[:, self._sampled]
        return np.asarray(self._build["friction"](states, np.asarray(fitted)[:, None])[0])

    def slopes(self, fitted: ndarray) -> ndarray:
        """Exact derivatives of the discretised simulation, from the variational equations of its steps.

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
        """The fitted law; its working range, if any, is from half the smallest to twice the largest slip rate."""
        law, rates = Experiment.best_law(self, fitted), self.rates(fitted)
        ends = {"slowest_rate": float(f"{np.min(rates) / 2:.2g}"), "fastest_rate": float(f"{2 * np.max(rates):.2g}")}
        effect = {"evolution_effect": getattr(law, "evolution_effect", 1.0)}
        return with_values(law, {n: end for n, end in (ends | effect).items() if n in law.quantities()})

    def resolved(self, fitted: ndarray, accuracy: float) -> "SlidingExperiment":
        """The same experiment with the steps that an accuracy of friction requires at given coordinates.

        These steps follow from the embedded error estimate. They are also used at other coordinates, so that friction
        is a smooth function of these. If the steps would be too many or too short, for example because the block is
        unstable, the experiment is returned unchanged.
        """
        q = np.asarray(fitted)
        taken = _steps(self._build["trial"], q, accuracy, self.drive, self._build["start"](q))
        return self if taken is None else replace(self, steps=taken)

    def _states(self, fitted: ndarray) -> ndarray:
        """Logarithms of rate and states (rows, SI) at the beginning and after every step (columns)."""
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
    """CasADi Functions of a step, its derivatives and outputs, for logarithms of rate and states.

    Quantities of the law are exponentials of the coordinates, coordinates if `linear`, or numbers.
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


# ----------------------------------------------------------------------
# Experiments with slip-weakening friction: at a measured slip, or with a block pulled by a stiff spring.

START = "start_friction"
_SMALL_SHARE = 0.3  # an additional noise of this share of the friction noise increases the total by 4 %


@dataclass(frozen=True, kw_only=True)
class _Weakening(Experiment):
    """An experiment with a law that depends on slip alone; the quantities of the law are the first coordinates."""

    law: FrictionLaw
    coordinates: tuple[Coordinate, ...]

    def strength(self, slip: ndarray, fitted: ndarray) -> tuple[ndarray, ndarray]:
        """Friction of the law [-] and its slope in slip [1/m]."""
        friction, per_slip = self._rows(self._expressions[:2], slip, fitted)
        return friction, per_slip

    def strength_slopes(self, slip: ndarray, fitted: ndarray) -> ndarray:
        """Derivatives of `strength` [-] by the logarithms of the quantities of the law, shape (slips, quantities)."""
        rows = self._rows(self._expressions[2:], slip, fitted)
        return np.asarray(np.array(rows).T * np.exp(fitted[: len(self._symbols)]))

    def _rows(self, expressions: list[sp.Expr], slip: ndarray, fitted: ndarray) -> list[ndarray]:
        values = dict(zip(self._symbols, np.exp(fitted[: len(self._symbols)]), strict=True))
        return [np.asarray(row + np.zeros_like(slip)) for row in to_numpy(expressions, values | {x1: slip})]

    @cached_property
    def _symbols(self) -> list[sp.Symbol]:
        symbols = self.law.symbols()
        return [symbols[c.name] for c in self.coordinates if c.name in symbols]

    @cached_property
    def _expressions(self) -> list[sp.Expr]:
        friction = sp.sympify(self.law.symbolic().coefficient(x1, 0)).rewrite(sp.Piecewise)
        return [friction, *(friction.diff(symbol) for symbol in (x1, *self._symbols))]


@dataclass(frozen=True, kw_only=True)
class MeasuredSlip(_Weakening):
    """Friction of a law at the measured, non-negative slip [m]; `slip_noise` is its standard deviation [m]."""

    slip: ndarray
    slip_noise: float

    def friction(self, fitted: ndarray) -> ndarray:
        """Friction coefficient [-] at every slip."""
        return self.strength(self.slip, fitted)[0]

    def slopes(self, fitted: ndarray) -> ndarray:
        """Derivatives of `friction` by the logarithms of the quantities of the law, the only coordinates here."""
        return self.strength_slopes(self.slip, fitted)

    def remarks(self, fitted: ndarray, noise: float) -> tuple[str, ...]:
        """Remark if the noise of the slip, which the fit neglects, affects friction."""
        felt = float(np.max(np.abs(self.strength(self.slip, fitted)[1]))) * self.slip_noise
        text = f"slip is taken as exact, although its noise of {self.slip_noise:.2g} m changes friction by {felt:.2g}"
        return (text,) if felt > _SMALL_SHARE * noise else ()


@dataclass(frozen=True, kw_only=True)
class SpringLoaded(_Weakening):
    """A block that is at rest until its strength is reached, and then slips until the spring balances friction.

    Slip never decreases. With a soft spring, friction falls faster than the spring force and the block jumps. No
    balance describes a jump, so slip and friction are then NaN. `load_point` is the displacement of the load point
    since the first sample [m], `normal` the normal load in Pa, N or 1. Coordinates: those of the law, the stiffness if
    not given, `START` last.
    """

    load_point: ndarray
    normal: ndarray
    stiffness: float | None

    def friction(self, fitted: ndarray) -> ndarray:
        """Shear over normal force [-] at every sample."""
        limit, softness = self._without_slip(fitted)
        return np.asarray(limit - softness * self.slip(fitted)[0])

    def slopes(self, fitted: ndarray) -> ndarray:
        """Derivatives; those of slip follow from the balance at the sample where it was reached."""
        (slip, since), (_, softness) = self.slip(fitted), self._without_slip(fitted)
        at_fixed_slip = np.zeros((len(slip), len(fitted)))
        at_fixed_slip[:, -1] = self.normal[0] / self.normal
        if self.stiffness is None:
            at_fixed_slip[:, -2] = softness * (self.load_point - slip)
        laws = np.zeros_like(at_fixed_slip)
        laws[:, : len(self._symbols)] = self.strength_slopes(slip[since], fitted)
        per_slip = self.strength(slip[since], fitted)[1]
        moved = (at_fixed_slip[since] - laws) / (softness[since] + per_slip)[:, None]
        moved[slip == 0] = 0
        return np.asarray(at_fixed_slip - softness[:, None] * moved)

    def _without_slip(self, fitted: ndarray) -> tuple[ndarray, ndarray]:
        """Shear over normal force [-] without slip, and its decrease per slip [1/m]."""
        softness = (np.exp(fitted[-2]) if self.stiffness is None else self.stiffness) / self.normal
        return np.asarray(fitted[-1] * self.normal[0] / self.normal + softness * self.load_point), softness

    def slip(self, fitted: ndarray) -> tuple[ndarray, ndarray]:
        """Slip [m] at every sample, and the sample at which it was reached."""
        limit, softness = self._without_slip(fitted)
        strength, weakening = self.strength(np.zeros(1), fitted)
        if np.min(softness + weakening) <= 0:
            return np.full(len(limit), np.nan), np.arange(len(limit))
        slip, slips = np.zeros(len(limit)), limit > strength

        def excess(slip: ndarray, limit: ndarray, softness: ndarray) -> ndarray:
            return limit - softness * slip - self.strength(slip, fitted)[0]  # type: ignore[no-any-return]

        if np.any(slips):
            own = limit[slips], softness[slips]
            slip[slips] = find_root(excess, (0.0, own[0] / own[1]), args=own).x
        largest = np.maximum.accumulate(slip)
        new = np.where(slip == largest, np.arange(len(limit)), 0)
        return largest, np.maximum.accumulate(new)
