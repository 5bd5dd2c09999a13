"""Interface of experiments for the fit: friction at the samples of a record, and its derivatives."""

import math
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy import ndarray

from quakedesign.fault import FrictionLaw


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

    The fitted quantities stored in its law are not used.
    """

    law: FrictionLaw
    coordinates: tuple[Coordinate, ...]

    @abstractmethod
    def friction(self, fitted: ndarray) -> ndarray:
        """Friction coefficient [-] at every sample; not finite if the experiment does not exist."""

    @abstractmethod
    def slopes(self, fitted: ndarray) -> ndarray:
        """Derivatives of `friction`, shape (samples, coordinates)."""

    def remarks(self, fitted: ndarray, noise: float) -> tuple[str, ...]:
        """Remarks on assumptions, checked with a noise of friction [-]; empty by default."""
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
        """Fitted coordinates at values of another experiment; where one is missing, the middle of `start`."""
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
        """Law of the whole."""
        return self.whole.law  # type: ignore[no-any-return]

    @abstractmethod
    def inside(self, fitted: ndarray) -> ndarray:
        """Coordinates of the whole."""

    def remarks(self, fitted: ndarray, noise: float) -> tuple[str, ...]:
        """Remarks of the whole."""
        return self.whole.remarks(self.inside(fitted), noise)  # type: ignore[no-any-return]

    def best_law(self, fitted: ndarray) -> FrictionLaw:
        """Law of the whole."""
        return self.whole.best_law(self.inside(fitted))  # type: ignore[no-any-return]

    def resolved(self, fitted: ndarray, accuracy: float) -> Experiment:
        """The same experiment with `whole` resolved."""
        finer = self.whole.resolved(self.inside(fitted), accuracy)
        return self if finer is self.whole else replace(self, whole=finer)


@dataclass(frozen=True, kw_only=True)
class Widened(_Transformed):
    """An experiment, `whole`, with further coordinates, which come last and change friction in proportion to `columns`.

    Trends add to friction; their columns are displacement [m] or time [s]. A delay of a change of rate [s] changes
    friction, to first order, by minus the delay times the time derivative of friction; its column is not 0 from this
    change to the next.
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
    """An experiment with a delay of each change of rate, at most `most` [s]; `after`: the columns of `Widened`."""
    if not after.shape[1]:
        return whole  # type: ignore[no-any-return]
    delays = [_about_zero(f"{DELAY}_{place}", "s", end) for place, end in enumerate(most.tolist(), start=1)]
    return Widened(whole=whole, coordinates=(*whole.coordinates, *delays), columns=after, delays=True)


def trended(whole: Experiment, along: ndarray, size: float, name: str = TREND) -> Widened:
    """An experiment with a trend along displacement [m] or time [s], at most ten times the friction over the span."""
    trend = _about_zero(name, "1/m" if name == TREND else "1/s", 10 * size / float(np.ptp(along)))
    return Widened(whole=whole, coordinates=(*whole.coordinates, trend), columns=along[:, None])


def _about_zero(name: str, unit: str, most: float) -> Coordinate:
    return Coordinate(name=name, unit=unit, low=-most, high=most, start=(-1e-3 * most, 1e-3 * most), logarithmic=False)


@dataclass(frozen=True, kw_only=True)
class Difference(_Transformed):
    """An experiment in which coordinate `first` is reduced by the sum of coordinates `seconds` (indices)."""

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
