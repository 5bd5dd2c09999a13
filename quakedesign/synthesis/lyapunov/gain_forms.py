"""V and −V̇ on every different cell and vertex in floats, kept for all loops of one structure."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from typing import Any

from quakedesign.certificates import Loop
from quakedesign.symbolic.candidates import signed_monomials
from quakedesign.synthesis.lyapunov.parametric_forms import Part, Row, rows_of


@dataclass(frozen=True, slots=True)
class Structure:
    """All of a loop that the rows depend on, to tell whether they can be used again."""

    loop: tuple[Any, ...]
    inside: tuple[tuple[str, Fraction], ...]
    points: tuple[tuple[str, bool, bool], ...]
    degree: int

    @classmethod
    def of(cls, loop: Loop, degree: int) -> "Structure":
        """Structure of a loop and a degree of V; numbers count only inside nested powers."""
        names = {p for terms in loop.lifts.values() for term in terms for p in term.parameters}
        known = {**loop.parameters, **{name: low for name, (low, _) in loop.ranges.items()}}
        fixed = (loop.law, tuple(loop.states.items()), tuple(loop.field.items()), tuple(loop.lifts.items()))
        inside = tuple(sorted((name, known[name]) for name in names))
        return cls(fixed, inside, tuple((n, a == b, a == -b) for n, (a, b) in loop.ranges.items()), degree)


class Kin:
    """A loop, the same as any other one of its structure."""

    def __init__(self, loop: Loop, degree: int) -> None:
        self.loop, self.structure = loop, Structure.of(loop, degree)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Kin) and self.structure == other.structure

    def __hash__(self) -> int:
        return hash(self.structure)


@lru_cache(maxsize=32)
def float_rows(kin: Kin) -> tuple[Row, ...]:
    """Every different row of the monomials of V, each −V̇ with the V beside it."""
    monomials = signed_monomials(kin.loop.states, kin.structure.degree, kin.loop.domain)
    rows = rows_of(kin.loop, monomials, beside=True)
    return tuple(replace(row, function=_floats(row.function), fall=_floats(row.fall)) for row in rows)


def _floats(parts: Iterable[Part]) -> tuple[Part, ...]:
    return tuple((j, e, names, float(c)) for j, e, names, c in parts)
