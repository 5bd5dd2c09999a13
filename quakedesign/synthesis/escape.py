"""Runs against a homogeneous loop without a proof: disturbances under which its state grows. Measured, not proved."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from quakedesign.certificates import Loop
from quakedesign.symbolic.terms import Term

_STARTS = 6
_GROWTH = 3.0  # e-foldings that count as without end
_ALIKE = 0.7  # share of it that must be left with finer steps, or it was the steps' chatter
_UNCOUNTED = 0.25  # share of a run at its beginning


@dataclass(frozen=True, slots=True, kw_only=True)
class Escape:
    """A run that grows without end, since the loop is homogeneous; floating point.

    Attributes
    ----------
    growth : float
        e-foldings of Σ|x_i|^{1/r_i} over the run.
    strategy : str
        What the uncertain parameters follow.
    """

    growth: float
    strategy: str


def escape(loop: Loop, *, steps: int = 6000, seed: int = 0) -> Escape | None:
    """Run that grows for parameters that jump between their ends, at two step sizes alike; None if none is found.

    Every uncertain parameter follows the sign of one state, or of the rate of one state, from several starts.

    Parameters
    ----------
    loop : Loop
    steps : int
        Of the coarse runs; every step moves the state by at most 1/200 of its size.
    seed : int
        Of the starts.
    """
    field = _Field(loop)
    plays = list(product(*(_choices(loop, low < high) for low, high in loop.uncertain.values())))
    coarse = field.growths(plays, steps, 1 / 200, seed)
    for i in sorted(range(len(plays)), key=lambda i: -coarse[i])[:3]:
        if coarse[i] < _GROWTH:
            break
        fine = field.growths(plays[i : i + 1], 4 * steps, 1 / 800, seed)[0]
        if fine > _ALIKE * coarse[i]:
            told = (f"{name} follows {play}" for name, play in zip(loop.uncertain, plays[i], strict=True))
            return Escape(growth=float(fine), strategy=", ".join(told))
    return None


@dataclass(frozen=True, slots=True)
class _Play:
    """What a parameter follows: the sign of a state, or of its rate at the middle of all ranges, or the opposite."""

    state: str
    rate: bool
    sign: int

    def __str__(self) -> str:
        prime = "'" if self.rate else ""
        return f"{'' if self.sign > 0 else '-'}{self.state}{prime}"


def _choices(loop: Loop, ranged: bool) -> list[_Play]:
    everything = [_Play(s, rate, sign) for s in loop.states for rate in (False, True) for sign in (1, -1)]
    return everything if ranged else everything[:1]


class _Field:
    """The field of a loop in floating point, for many columns of states and parameters at once."""

    def __init__(self, loop: Loop) -> None:
        import numpy as np

        self.loop, self.states = loop, list(loop.states)
        self.weights = np.array(list(loop.states.values()), dtype=float)[:, None]

    def rates(self, x: Any, parameters: Mapping[str, Any]) -> Any:
        """x' for states of shape (n, columns)."""
        import numpy as np

        known = dict(zip(self.states, x, strict=True))
        for lift, terms in self.loop.lifts.items():
            known[lift] = self._sum(terms, known, parameters)
        columns = [self._sum(terms, known, parameters) + np.zeros(x.shape[1]) for terms in self.loop.field.values()]
        return np.array(columns)

    def _sum(self, terms: Sequence[Term], known: Mapping[str, Any], parameters: Mapping[str, Any]) -> Any:
        import numpy as np

        total: Any = 0.0
        for term in terms:
            part: Any = float(term.coefficient)
            for name in term.parameters:
                part = part * parameters[name]
            for state, exponent, kind in term.factors:
                size = np.abs(known[state]) ** float(exponent) if exponent else 1.0
                part = part * size * (np.sign(known[state]) if kind == "s" else 1.0)
            total = total + part
        return total

    def growths(self, plays: Sequence[tuple[_Play, ...]], steps: int, pace: float, seed: int) -> Any:
        """Largest growth in e-foldings of every play over all starts, the beginning of the run left out."""
        import numpy as np

        x = np.tile(np.random.default_rng(seed).normal(size=(len(self.states), _STARTS)), len(plays))
        middle, ends = self._parameters()
        growth = np.zeros(x.shape[1])
        followed = {name: self._columns([play[i] for play in plays]) for i, name in enumerate(self.loop.uncertain)}
        for step in range(steps):
            size = (np.abs(x) ** (1 / self.weights)).sum(axis=0)
            x = x / size**self.weights
            growth += np.log(size) if step > steps * _UNCOUNTED else 0.0
            signs = np.sign(np.concatenate([x, self.rates(x, middle)]))
            chosen = dict(middle)
            for name, (low, high) in ends.items():
                row, sign = followed[name]
                up = signs[row, np.arange(x.shape[1])] * sign > 0
                chosen[name] = np.where(up, high, low)
            speed = self.rates(x, chosen)
            x = x + pace * speed / np.abs(speed).max(axis=0)
        return growth.reshape(len(plays), _STARTS).max(axis=1)

    def _columns(self, plays: Sequence[_Play]) -> tuple[Any, Any]:
        """Row of states and rates that every column follows, and the sign."""
        import numpy as np

        rows = [self.states.index(p.state) + len(self.states) * p.rate for p in plays]
        return np.repeat(rows, _STARTS), np.repeat([p.sign for p in plays], _STARTS)

    def _parameters(self) -> tuple[dict[str, Any], dict[str, tuple[float, float]]]:
        """All numbers with ranges at their middle, and the ends of the ranges."""
        ends = {name: (float(low), float(high)) for name, (low, high) in self.loop.uncertain.items()}
        middle = {name: float(v) for name, v in self.loop.parameters.items()}
        middle |= {name: middle[of] ** 0.5 for name, (of, _) in self.loop.roots.items()}
        return middle | {name: (low + high) / 2 for name, (low, high) in ends.items()}, ends
