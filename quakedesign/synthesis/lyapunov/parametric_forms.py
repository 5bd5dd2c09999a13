"""V_j and −V̇_j on every different cell and vertex, with gains and ranges left as names."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import Any

from quakedesign.certificates import Loop
from quakedesign.certificates.obligations import Obligations, power_sum
from quakedesign.sos import Polynomial
from quakedesign.symbolic.terms import Term, cell_polynomial

Part = tuple[int, tuple[int, ...], tuple[str, ...], Fraction | float]
"""j, exponents, names multiplied, coefficient."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """V, or −V̇ beside V, on one cell (and vertex): a form Σ_j a_j P_j that must be non-negative there.

    Attributes
    ----------
    cell : str
        Signs of the states.
    function, fall : tuple of Part
        Terms of all V_j, and of all −V̇_j; the latter is empty for the row of V itself.
    equalities, inequalities : tuple of Polynomial
        Conditions on the variables, besides u ≥ 0.
    """

    cell: str
    function: tuple[Part, ...]
    fall: tuple[Part, ...] = ()
    equalities: tuple[Polynomial, ...] = ()
    inequalities: tuple[Polynomial, ...] = ()

    @property
    def rate(self) -> bool:
        """Whether P_j is −V̇_j; else V_j."""
        return bool(self.fall)

    @property
    def parts(self) -> tuple[Part, ...]:
        """Terms of all P_j."""
        return self.fall or self.function

    @property
    def margin(self) -> Polynomial:
        """N = Σ u_i^n over the states, n the degree of the form."""
        states, width = (len(parts[0][1]) for parts in (self.function, self.parts))
        return power_sum(states, max(sum(e) for _, e, _, _ in self.parts), width)


def ends_of(loop: Loop) -> dict[str, tuple[tuple[str, int], ...]]:
    """Ends of every range: ±name where it is [−x, x], name where it is a point, else name- and name+."""
    ends: dict[str, tuple[tuple[str, int], ...]] = {}
    for name, (low, high) in loop.uncertain.items():
        if low == -high:
            ends[name] = ((name, -1), (name, 1))
        else:
            ends[name] = ((name, 1),) if low == high else ((f"{name}-", 1), (f"{name}+", 1))
    return ends


def values_of(loop: Loop) -> dict[str, float]:
    """Numbers that the names stand for, roots included (their enclosures are narrow)."""
    values = {name: float(v) for name, v in loop.parameters.items()}
    for name, (of, _) in loop.roots.items():
        values[name] = values[of] ** 0.5
    for name, (low, high) in loop.uncertain.items():
        values |= {name: float(high), f"{name}-": float(low), f"{name}+": float(high)}
    return values


def rows_of(loop: Loop, monomials: Sequence[Term], *, beside: bool = False) -> tuple[Row, ...]:
    """Every different form of V, then of −V̇; two that differ in the V beside them alone are one unless told.

    Raises
    ------
    CertificateError
        When the law has nested powers that certificates do not know.
    """
    columns = [Obligations(loop, (term,)) for term in monomials]
    rows: dict[tuple[Any, ...], Row] = {}
    for row in (*_functions(columns), *_falls(loop, columns)):
        conditions = tuple(tuple(sorted(p.items())) for p in (*row.equalities, *row.inequalities))
        rows.setdefault((row.rate, row.parts, row.function if beside else (), conditions), row)
    return tuple(rows.values())


def _functions(columns: Sequence[Obligations]) -> Iterator[Row]:
    for cell in columns[0].sign_cells():
        yield Row(cell=cell.name, function=_potential(columns, cell.signs))


def _potential(columns: Sequence[Obligations], signs: Mapping[str, int]) -> tuple[Part, ...]:
    return tuple(sorted((j, e, (), c) for j, column in enumerate(columns) for e, c in column.potential(signs).items()))


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
            total: dict[tuple[Any, ...], Fraction] = {}
            for j, names, exponents, coefficient in plain:
                chosen = [vertex.get(name, (name, 1)) for name in names]
                key = (j, tuple(exponents[i] for i in kept), tuple(sorted(name for name, _ in chosen)))
                sign = math.prod(factor for _, factor in chosen)
                total[key] = total.get(key, Fraction(0)) - coefficient * sign
            parts = tuple(sorted((*key, c) for key, c in total.items() if c))
            if parts:
                yield Row(
                    cell=word, function=function, fall=parts, equalities=cell.equalities, inequalities=cell.inequalities
                )


def _single(term: Term, weights: Mapping[str, int], signs: Mapping[str, int]) -> tuple[tuple[int, ...], Fraction]:
    """Exponents and coefficient of one term on a cell, its parameters left out."""
    found = cell_polynomial((Term(term.coefficient, (), term.factors),), weights, signs, {})
    return next(iter(found.items()))
