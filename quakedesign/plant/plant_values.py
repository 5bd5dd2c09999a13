"""Exact values of uncertain plants: matrices, sectors, loads."""

from dataclasses import dataclass
from fractions import Fraction

Row = tuple[Fraction, ...]
Matrix = tuple[Row, ...]

MOST = 40
"""Largest number of states, of controls, of measurements, of sectors and of outputs of a plant."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExactSector:
    """A sector in exact numbers, its row over states and controls."""

    entry: Row
    row: Row
    slopes: tuple[Fraction, Fraction]
    within: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowLoad:
    """A load v = control·λ(t), |λ′| ≤ rate, λ(0) = 0, balanced by u = v with x = shift·λ; C·shift = 0.

    The states in a statement to be proved are x − shift·λ.
    """

    control: Row
    shift: Row
    rate: Fraction


def unit(size: int, place: int) -> Row:
    """Unit row."""
    return tuple(Fraction(i == place) for i in range(size))
