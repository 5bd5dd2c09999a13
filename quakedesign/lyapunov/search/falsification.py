"""Falsification of a homogeneous loop by simulation: disturbances under which the state grows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from quakedesign.lyapunov.exact.claim import Loop
from quakedesign.symbolic.terms import Term

_STARTS = 6
_GROWTH = 1.0  # e-foldings from which a run is repeated with smaller steps
_AGAIN = 1.4  # least ratio of growth in twice the time with half the step; less is chatter or a transient
_UNCOUNTED = 0.25  # initial share of a run whose growth is not counted


@dataclass(frozen=True, slots=True, kw_only=True)
class Escape:
    """Simulation in floating point whose state grows; as the loop is homogeneous, the growth is unbounded."""

    growth: float  # e-foldings of Σ|x_i|^{1/r_i} over the run
    strategy: str  # Sign that determines the end of the range, for each uncertain parameter


def escape(loop: Loop, *, steps: int = 6000) -> Escape | None:
    """Simulation that grows at two step sizes, with parameters that switch between their ends; None if none is found.

    Every uncertain parameter takes the end of its range given by a sign: that of a state or a rate, or of a product of
    two such quantities if all its terms are odd in the states.

    Parameters
    ----------
    steps : int
        Number of steps of the first runs; a step moves the state by at most 1/200 of its size.
    """
    field = _FloatField(loop)
    strategies = list(product(*(_choices(loop, name) for name in loop.uncertain)))
    coarse = field.growths(strategies, steps, 1 / 200)
    for i in sorted(range(len(strategies)), key=lambda i: -coarse[i])[:3]:
        if coarse[i] < _GROWTH:
            break
        fine = field.growths(strategies[i : i + 1], 4 * steps, 1 / 400)[0]
        if fine > _AGAIN * coarse[i]:
            followed = (f"{name} follows {one}" for name, one in zip(loop.uncertain, strategies[i], strict=True))
            return Escape(growth=float(fine), strategy=", ".join(followed))
    return None


@dataclass(frozen=True, slots=True)
class _Strategy:
    """Sign that a parameter follows: that of a product of states and rates, the rates at the middle of all ranges."""

    names: tuple[str, ...]
    sign: int

    def __str__(self) -> str:
        return ("" if self.sign > 0 else "-") + "·".join(self.names)


def _choices(loop: Loop, name: str) -> list[_Strategy]:
    low, high = loop.uncertain[name]
    rates = {state: f"{state}'" for state in loop.states}
    products: list[tuple[str, ...]]
    terms = (term for rates in loop.field.values() for term in rates if name in term.parameters)
    if all(sum(kind == "s" for _, _, kind in term.factors) % 2 == 1 for term in terms):  # odd in its states
        products = [*rates.items(), *combinations(loop.states, 2)]
    else:
        products = [(one,) for pair in rates.items() for one in pair]
    everything = [_Strategy(names, sign) for names in products for sign in (1, -1)]
    return everything if low < high else everything[:1]


class _FloatField:
    """Field of a loop in floating point, vectorised over columns of states and parameters."""

    def __init__(self, loop: Loop) -> None:
        self.loop, self.states = loop, list(loop.states)
        self.weights = np.array(list(loop.states.values()), dtype=float)[:, None]

    def rates(self, x: np.ndarray, parameters: Mapping[str, np.ndarray | float]) -> np.ndarray:
        """Rates x' for states of shape (n, columns)."""
        values = dict(zip(self.states, x, strict=True))
        for lift, terms in self.loop.lifts.items():
            values[lift] = self._sum(terms, values, parameters)
        columns = [self._sum(terms, values, parameters) + np.zeros(x.shape[1]) for terms in self.loop.field.values()]
        return np.array(columns)

    def _sum(
        self,
        terms: Sequence[Term],
        values: Mapping[str, np.ndarray | float],
        parameters: Mapping[str, np.ndarray | float],
    ) -> np.ndarray | float:
        total: np.ndarray | float = 0.0
        for term in terms:
            part: np.ndarray | float = float(term.coefficient)
            for name in term.parameters:
                part = part * parameters[name]
            for state, exponent, kind in term.factors:
                size = np.abs(values[state]) ** float(exponent) if exponent else 1.0
                part = part * size * (np.sign(values[state]) if kind == "s" else 1.0)
            total = total + part
        return total

    def growths(self, strategies: Sequence[tuple[_Strategy, ...]], steps: int, step: float) -> np.ndarray:
        """Largest growth of every strategy in e-foldings over all initial states, without the initial part of a run."""
        x = np.tile(np.random.default_rng(0).normal(size=(len(self.states), _STARTS)), len(strategies))
        middle, ends = self._parameters()
        growth = np.zeros(x.shape[1])
        followed = {name: self._followed([one[i] for one in strategies]) for i, name in enumerate(self.loop.uncertain)}
        columns = np.arange(x.shape[1])
        for number in range(steps):
            size = (np.abs(x) ** (1 / self.weights)).sum(axis=0)
            x = x / size**self.weights
            growth += np.log(size) if number > steps * _UNCOUNTED else 0.0
            signs = np.sign(np.concatenate([x, self.rates(x, middle), np.ones((1, x.shape[1]))]))
            chosen: dict[str, np.ndarray | float] = dict(middle)
            for name, (low, high) in ends.items():
                first, second, sign = followed[name]
                chosen[name] = np.where(signs[first, columns] * signs[second, columns] * sign > 0, high, low)
            speed = self.rates(x, chosen)
            x = x + step * speed / np.abs(speed).max(axis=0)
        return np.asarray(growth.reshape(len(strategies), _STARTS).max(axis=1))

    def _followed(self, strategies: Sequence[_Strategy]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows (of states, rates and a one) of the two signs multiplied in a column, and the sign of its strategy."""
        rows = {name: i for i, name in enumerate((*self.states, *(f"{s}'" for s in self.states), ""))}
        pairs = np.array([[rows[name] for name in (*one.names, "")[:2]] for one in strategies])
        return (*np.repeat(pairs, _STARTS, axis=0).T, np.repeat([one.sign for one in strategies], _STARTS))

    def _parameters(self) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
        """All parameters, those with ranges at their middle, and the ends of the ranges."""
        ends = {name: (float(low), float(high)) for name, (low, high) in self.loop.uncertain.items()}
        middle = {name: float(v) for name, v in self.loop.parameters.items()}
        middle |= {name: middle[of] ** 0.5 for name, (of, _) in self.loop.roots.items()}
        return middle | {name: (low + high) / 2 for name, (low, high) in ends.items()}, ends
