"""Forms V and −V̇ on cells and vertices, with gains and ranges as parameters.

The forms are also evaluated in floating point and cached for all loops of one structure.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from itertools import product
from typing import Any

from quakedesign.lyapunov.exact.claim import Loop
from quakedesign.lyapunov.exact.obligations import Obligations, power_sum
from quakedesign.sos import Polynomial
from quakedesign.symbolic.term_expressions import signed_monomials
from quakedesign.symbolic.terms import Term, cell_polynomial

# ----------------------------------------------------------------------
# V_j and −V̇_j on every cell and vertex, each distinct form once, with symbolic gains and ranges.

Part = tuple[int, tuple[int, ...], tuple[str, ...], Fraction | float]
"""Term of V_j or −V̇_j: index j, exponents, names of its parameters, coefficient."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FormRow:
    """V, or −V̇ with its V, on one cell (and vertex): a form Σ_j a_j P_j that must be non-negative there."""

    cell: str  # Signs of the states
    # function, decrease: Terms of all V_j and of all −V̇_j; `decrease` is empty in a row of V
    function: tuple[Part, ...]
    decrease: tuple[Part, ...] = ()
    # equalities, inequalities: Conditions on the variables in addition to u ≥ 0
    equalities: tuple[Polynomial, ...] = ()
    inequalities: tuple[Polynomial, ...] = ()

    @property
    def rate(self) -> bool:
        """Whether P_j is −V̇_j instead of V_j."""
        return bool(self.decrease)

    @property
    def parts(self) -> tuple[Part, ...]:
        """Terms of all P_j."""
        return self.decrease or self.function

    @property
    def margin(self) -> Polynomial:
        """Margin N = Σ u_i^n over the states, where n is the degree of the form."""
        states, width = (len(parts[0][1]) for parts in (self.function, self.parts))
        return power_sum(states, max(sum(e) for _, e, _, _ in self.parts), width)


def ends_of(loop: Loop) -> dict[str, tuple[tuple[str, int], ...]]:
    """Symbolic ends of every range: −name and name for [−x, x], name for one value, else ``name-`` and ``name+``."""
    ends: dict[str, tuple[tuple[str, int], ...]] = {}
    for name, (low, high) in loop.uncertain.items():
        if low == -high:
            ends[name] = ((name, -1), (name, 1))
        else:
            ends[name] = ((name, 1),) if low == high else ((f"{name}-", 1), (f"{name}+", 1))
    return ends


def values_of(loop: Loop) -> dict[str, float]:
    """Floating-point values of all parameters, of roots, and of the ends of the ranges, by name."""
    values = {name: float(v) for name, v in loop.parameters.items()}
    for name, (of, _) in loop.roots.items():
        values[name] = values[of] ** 0.5
    for name, (low, high) in loop.uncertain.items():
        values |= {name: float(high), f"{name}-": float(low), f"{name}+": float(high)}
    return values


def rows_of(loop: Loop, monomials: Sequence[Term], *, with_function: bool = False) -> tuple[FormRow, ...]:
    """Every distinct form of V, then of −V̇; with `with_function`, equal forms of −V̇ with different V are separate.

    Raises
    ------
    CertificateError
        When certificates do not support the nested powers of the law.
    """
    columns = [Obligations(loop, (term,)) for term in monomials]
    rows: dict[tuple[object, ...], FormRow] = {}
    for row in (*_functions(columns), *_decreases(loop, columns)):
        conditions = tuple(tuple(sorted(p.items())) for p in (*row.equalities, *row.inequalities))
        rows.setdefault((row.rate, row.parts, row.function if with_function else (), conditions), row)
    return tuple(rows.values())


def _functions(columns: Sequence[Obligations]) -> Iterator[FormRow]:
    for cell in columns[0].sign_cells():
        yield FormRow(cell=cell.name, function=_potential(columns, cell.signs))


def _potential(columns: Sequence[Obligations], signs: Mapping[str, int]) -> tuple[Part, ...]:
    return tuple(sorted((j, e, (), c) for j, column in enumerate(columns) for e, c in column.potential(signs).items()))


def _decreases(loop: Loop, columns: Sequence[Obligations]) -> Iterator[FormRow]:
    first, ends = columns[0], ends_of(loop)
    weights = {**loop.states, **first.lift_degrees}
    places = [i for i, name in enumerate(weights) if name in loop.states or name in first.with_variable]
    terms = [(j, term) for j, column in enumerate(columns) for term in column.derivative]
    for cell in first.cells:
        plain = [(j, term.parameters, *_single(term, weights, cell.signs)) for j, term in terms]
        V = _potential(columns, cell.signs)
        word = "".join("+" if cell.signs[s] > 0 else "-" for s in loop.states)
        for choice in product(*ends.values()):
            vertex = dict(zip(ends, choice, strict=True))
            total: dict[tuple[Any, ...], Fraction] = {}
            for j, names, exponents, coefficient in plain:
                chosen = [vertex.get(name, (name, 1)) for name in names]
                key = (j, tuple(exponents[i] for i in places), tuple(sorted(name for name, _ in chosen)))
                sign = math.prod(factor for _, factor in chosen)
                total[key] = total.get(key, Fraction(0)) - coefficient * sign
            parts = tuple(sorted((*key, c) for key, c in total.items() if c))
            if parts:
                yield FormRow(
                    cell=word, function=V, decrease=parts, equalities=cell.equalities, inequalities=cell.inequalities
                )


def _single(term: Term, weights: Mapping[str, int], signs: Mapping[str, int]) -> tuple[tuple[int, ...], Fraction]:
    """Exponents and coefficient of one term on a cell, without its parameters."""
    polynomial = cell_polynomial((Term(term.coefficient, (), term.factors),), weights, signs, {})
    return next(iter(polynomial.items()))


# ----------------------------------------------------------------------
# V and −V̇ on every cell and vertex, each distinct form once, in floating point, cached for all loops of one structure.


@dataclass(frozen=True, slots=True)
class Structure:
    """All properties of a loop on which its rows depend, as key of the cache."""

    loop: tuple[object, ...]
    inside: tuple[tuple[str, Fraction], ...]  # Parameters in nested powers, with their values
    points: tuple[tuple[str, bool, bool], ...]  # Ranges: name, whether low = high, whether low = −high
    degree: int

    @classmethod
    def of(cls, loop: Loop, degree: int) -> "Structure":
        """Structure of a loop and a degree of V; numbers are included only inside nested powers."""
        names = {p for terms in loop.lifts.values() for term in terms for p in term.parameters}
        values = {**loop.parameters, **{name: low for name, (low, _) in loop.ranges.items()}}
        fixed = (loop.law, tuple(loop.states.items()), tuple(loop.field.items()), tuple(loop.lifts.items()))
        inside = tuple(sorted((name, values[name]) for name in names))
        return cls(fixed, inside, tuple((n, a == b, a == -b) for n, (a, b) in loop.ranges.items()), degree)


class StructureKey:
    """Cache key of a loop, equal for all loops of one structure."""

    def __init__(self, loop: Loop, degree: int) -> None:
        self.loop, self.structure = loop, Structure.of(loop, degree)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, StructureKey) and self.structure == other.structure

    def __hash__(self) -> int:
        return hash(self.structure)


@lru_cache(maxsize=32)
def float_rows(key: StructureKey) -> tuple[FormRow, ...]:
    """Every distinct row of the monomials of V in floating point, each −V̇ with its V."""
    monomials = signed_monomials(key.loop.states, key.structure.degree, key.loop.domain)
    rows = rows_of(key.loop, monomials, with_function=True)
    return tuple(replace(row, function=_floats(row.function), decrease=_floats(row.decrease)) for row in rows)


def _floats(parts: Iterable[Part]) -> tuple[Part, ...]:
    return tuple((j, e, names, float(c)) for j, e, names, c in parts)
