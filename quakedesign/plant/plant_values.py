"""Exact values of uncertain plants: matrices, sectors, loads."""

from dataclasses import dataclass
from fractions import Fraction

Row = tuple[Fraction, ...]
Matrix = tuple[Row, ...]

MOST = 40
"""Largest number of states, of controls, of measurements, of sectors and of outputs of a plant."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExactSector:
    """A sector in exact numbers, see `Sector` in `user_plant`; `row` always has entries for states and controls."""

    entry: Row
    row: Row
    slopes: tuple[Fraction, Fraction]
    within: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowLoad:
    """A slow load v = control·λ(t) with |λ′| ≤ rate and λ(0) = 0, which u = v balances at x = shift·λ; C·shift = 0.

    Guarantees bound the states relative to this balance, x − shift·λ.
    """

    control: Row
    shift: Row
    rate: Fraction


def unit(size: int, place: int) -> Row:
    """Row of a unit matrix: 1 at index `place`, else 0."""
    return tuple(Fraction(i == place) for i in range(size))
