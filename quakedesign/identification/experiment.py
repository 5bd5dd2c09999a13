"""What every experiment offers to a fit: friction at the instants of a record, and its slopes in the parameters."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from quakedesign.fault import FrictionLaw


@dataclass(frozen=True, kw_only=True)
class Coordinate:
    """One number that is fitted.

    Attributes
    ----------
    name : str
    unit : str
        SI.
    low, high : float
        Between which it is sought.
    start : tuple of float
        Between which searches start.
    logarithmic : bool
        Whether its logarithm is fitted; it is positive then.
    """

    name: str
    unit: str
    low: float
    high: float
    start: tuple[float, float]
    logarithmic: bool = True

    def inward(self, value: float) -> float:
        """What is fitted."""
        return math.log(value) if self.logarithmic else value

    def outward(self, fitted: float) -> float:
        """Value in its unit of what is fitted."""
        return math.exp(fitted) if self.logarithmic else fitted


class Experiment(ABC):
    """A simulated experiment: what the record's friction would be without noise, for given coordinates.

    Attributes
    ----------
    law : FrictionLaw
        With any values for what is fitted.
    coordinates : tuple of Coordinate
    """

    law: FrictionLaw
    coordinates: tuple[Coordinate, ...]

    @abstractmethod
    def friction(self, fitted: "np.ndarray") -> "np.ndarray":
        """Friction coefficient [-] at every sample; not finite where there is no such experiment."""

    @abstractmethod
    def slopes(self, fitted: "np.ndarray") -> "np.ndarray":
        """Derivatives of `friction`, shape (samples, coordinates)."""

    def remarks(self, fitted: "np.ndarray", noise: float) -> tuple[str, ...]:
        """What a noise of friction [-] means for what was taken for granted; nothing unless told."""
        return ()

    def best_law(self, fitted: "np.ndarray") -> FrictionLaw:
        """The law with the values of given coordinates."""
        values = {name: v for name, v in self.outward(fitted).items() if name in self.law.quantities()}
        return replace(self.law, **values)  # type: ignore[type-var]

    def resolved(self, fitted: "np.ndarray", accuracy: float) -> "Experiment":
        """The same experiment, simulated to an accuracy of friction [-] at given coordinates."""
        return self

    @property
    def bounds(self) -> "tuple[np.ndarray, np.ndarray]":
        """Least and largest of what is fitted."""
        ends = [(c.inward(c.low), c.inward(c.high)) for c in self.coordinates]
        low, high = np.array(ends, dtype=float).T
        return low, high

    def inward(self, values: Sequence[float]) -> "np.ndarray":
        """What is fitted, of values in their units."""
        return np.array([c.inward(v) for c, v in zip(self.coordinates, values, strict=True)])

    def outward(self, fitted: "np.ndarray") -> dict[str, float]:
        """Values in their units by name."""
        return {c.name: c.outward(float(q)) for c, q in zip(self.coordinates, fitted, strict=True)}


def fitted_quantities(law: FrictionLaw, names: Sequence[str], fitted: Any) -> dict[Any, Any]:
    """What the symbols of a law stand for: exponentials of what is fitted by name, else its own numbers."""
    places = {name: i for i, name in enumerate(names)}
    return {
        symbol: ca.exp(fitted[places[name]]) if name in places else getattr(law, name)
        for name, symbol in law.symbols().items()
    }


@dataclass(frozen=True, kw_only=True)
class Difference(Experiment):
    """An experiment in which the difference of two coordinates stands for the first of them.

    Attributes
    ----------
    whole : Experiment
        In which both are logarithmic.
    first, second : int
        Places of the two.
    """

    whole: Experiment
    first: int
    second: int

    @property
    def law(self) -> FrictionLaw:  # type: ignore[override]
        """That of the experiment."""
        return self.whole.law

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:  # type: ignore[override]
        """Those of the experiment, with the difference in place of the first."""
        changed = list(self.whole.coordinates)
        a, b = changed[self.first], changed[self.second]
        changed[self.first] = Coordinate(
            name=f"{a.name} - {b.name}",
            unit=a.unit,
            low=a.low - b.high,
            high=a.high - b.low,
            start=(a.start[0] - b.start[1], a.start[1] - b.start[0]),
            logarithmic=False,
        )
        return tuple(changed)

    def friction(self, fitted: "np.ndarray") -> "np.ndarray":
        """Friction of the experiment; there is none where the first would not be positive."""
        return self.whole.friction(self.whole_of(fitted))

    def slopes(self, fitted: "np.ndarray") -> "np.ndarray":
        """Derivatives by the chain rule."""
        at = self.whole_of(fitted)
        slopes = self.whole.slopes(at).copy()
        per_first = slopes[:, self.first] / np.exp(at[self.first])
        slopes[:, self.second] += per_first * np.exp(at[self.second])
        slopes[:, self.first] = per_first
        return slopes

    def resolved(self, fitted: "np.ndarray", accuracy: float) -> "Difference":
        """With the whole resolved."""
        return replace(self, whole=self.whole.resolved(self.whole_of(fitted), accuracy))

    def difference(self, fitted: "np.ndarray") -> "np.ndarray":
        """Coordinates here, of those of the whole."""
        changed = np.array(fitted, dtype=float)
        changed[self.first] = np.exp(fitted[self.first]) - np.exp(fitted[self.second])
        return changed

    def whole_of(self, fitted: "np.ndarray") -> "np.ndarray":
        """Coordinates of the whole, of those here; not a number where the first would not be positive."""
        changed = np.array(fitted, dtype=float)
        first = fitted[self.first] + np.exp(fitted[self.second])
        changed[self.first] = np.log(first) if first > 0 else np.nan
        return changed
