"""V and −V̇ on every different cell and vertex, with gains and ranges left as names."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import product
from typing import Any

from quakedesign.certificates import Loop
from quakedesign.certificates.obligations import Obligations
from quakedesign.sos import Polynomial
from quakedesign.symbolic.candidates import signed_monomials
from quakedesign.symbolic.terms import Term, cell_polynomial
from quakedesign.synthesis.lyapunov.parametric_forms import ends_of

Part = tuple[int, tuple[int, ...], tuple[str, ...], float]
"""j, exponents, names multiplied, coefficient."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """V, or −V̇ beside V, on one cell (and vertex), with gains and ends of ranges left as names.

    Attributes
    ----------
    cell : str
        Signs of the states.
    function, fall : tuple of Part
        V, and −V̇; the latter is empty for the row of V itself.
    equalities, inequalities : tuple of Polynomial
    """

    cell: str
    function: tuple[Part, ...]
    fall: tuple[Part, ...] = ()
    equalities: tuple[Polynomial, ...] = ()
    inequalities: tuple[Polynomial, ...] = ()


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
def rows_of(kin: Kin) -> tuple[Row, ...]:
    """Every different row of the monomials of V."""
    loop, degree = kin.loop, kin.structure.degree
    columns = [Obligations(loop, (term,)) for term in signed_monomials(loop.states, degree, loop.domain)]
    rows: dict[tuple[Any, ...], Row] = {}
    for row in (*_functions(columns), *_falls(loop, columns)):
        conditions = tuple(tuple(sorted(p.items())) for p in (*row.equalities, *row.inequalities))
        rows.setdefault((row.function, row.fall, conditions), row)
    return tuple(rows.values())


def _functions(columns: Sequence[Obligations]) -> Iterator[Row]:
    for cell in columns[0].sign_cells():
        yield Row(cell=cell.name, function=_potential(columns, cell.signs))


def _potential(columns: Sequence[Obligations], signs: Mapping[str, int]) -> tuple[Part, ...]:
    return tuple((j, e, (), float(c)) for j, column in enumerate(columns) for e, c in column.potential(signs).items())


def _falls(loop: Loop, columns: Sequence[Obligations]) -> Iterator[Row]:
    first, ends = columns[0], ends_of(loop)
    weights = {**loop.states, **first.lift_degrees}
    kept = [i for i, name in enumerate(weights) if name in loop.states or name in first.with_variable]
    terms = [(j, term) for j, column in enumerate(columns) for term in column.derivative]
    for cell in first.cells:
        plain = [(j, term.parameters, *_single(term, weights, cell.signs)) for j, term in terms]
        function = _potential(columns, cell.signs)
        word = "".join("+" if cell.signs[s] > 0 else "-" for s in loop.states)
        for choice in product(*ends.values()):
            vertex = dict(zip(ends, choice, strict=True))
            total: dict[tuple[Any, ...], float] = {}
            for j, names, exponents, coefficient in plain:
                chosen = [vertex.get(name, (name, 1)) for name in names]
                key = (j, tuple(exponents[i] for i in kept), tuple(sorted(name for name, _ in chosen)))
                sign = math.prod(factor for _, factor in chosen)
                total[key] = total.get(key, 0.0) - float(coefficient) * sign
            parts = tuple(sorted((*key, c) for key, c in total.items() if c))
            yield Row(
                cell=word, function=function, fall=parts, equalities=cell.equalities, inequalities=cell.inequalities
            )


def _single(term: Term, weights: Mapping[str, int], signs: Mapping[str, int]) -> tuple[tuple[int, ...], Fraction]:
    """Exponents and coefficient of one term on a cell, its parameters left out."""
    bare = cell_polynomial((Term(term.coefficient, (), term.factors),), weights, signs, {})
    return next(iter(bare.items()))
