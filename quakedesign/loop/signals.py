"""Exact linear systems whose signals are connected by name."""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from quakedesign.loop.periodic import Matrix, Row

Signal = Mapping[str, Fraction]
"""Linear combination of states, inputs and other signals."""
_ZERO, _ONE = Fraction(0), Fraction(1)


@dataclass(frozen=True, slots=True)
class Interconnection:
    """Ordered states, and signals by name, each a linear combination of states, inputs and other signals."""

    states: tuple[str, ...]
    signals: Mapping[str, Signal]

    def resolved(self, signal: Signal) -> dict[str, Fraction]:
        """A signal as a combination of states and inputs alone."""
        whole: dict[str, Fraction] = {}
        for name, share in signal.items():
            parts = self.resolved(self.signals[name]) if name in self.signals else {name: _ONE}
            for part, factor in parts.items():
                whole[part] = whole.get(part, _ZERO) + share * factor
        return whole

    def row(self, signal: Signal) -> Row:
        """Coefficients of the states in a signal."""
        return self.column(self.resolved(signal))

    def column(self, entries: Signal) -> Row:
        """Column over the states of given entries, 0 elsewhere."""
        return tuple(entries.get(name, _ZERO) for name in self.states)

    def flow(self, rates: Mapping[str, Signal]) -> Matrix:
        """Rows of x′; states without a rate stay constant."""
        return tuple(self.row(rates.get(name, {})) for name in self.states)

    def jump(self, updates: Mapping[str, Signal]) -> Matrix:
        """Rows of x⁺; states without an update stay constant."""
        return tuple(self.row(updates.get(name, {name: _ONE})) for name in self.states)

    def entry(self, updates: Mapping[str, Signal], name: str) -> Row:
        """Coefficients of an input in the states after a jump."""
        return self.column({state: self.resolved(signal).get(name, _ZERO) for state, signal in updates.items()})
