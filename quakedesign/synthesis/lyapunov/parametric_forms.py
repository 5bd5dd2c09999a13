"""V_j and −V̇_j on every different cell and vertex, with gains and ranges left as names."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import Any

from quakedesign.certificates import Loop
from quakedesign.certificates.obligations import Cell, Obligations, power_sum
from quakedesign.sos import Polynomial
from quakedesign.symbolic.terms import Term, cell_polynomial, lie_terms

Ends = Mapping[str, tuple[tuple[str, int], ...]]
"""For every uncertain parameter its ends, each a name times ±1."""
Part = tuple[int, tuple[int, ...], tuple[str, ...], Fraction]
"""j, exponents, names multiplied, coefficient."""


@dataclass(frozen=True, slots=True)
class Row:
    """One form Σ_j a_j P_j that must be non-negative on a cell.

    Attributes
    ----------
    rate : bool
        P_j is −V̇_j; else V_j.
    parts : tuple of Part
        Terms of all P_j.
    margin : Polynomial
        N = Σ u_i^n over the states, n the degree of the form.
    equalities, inequalities : tuple of Polynomial
        Conditions on the variables, besides u ≥ 0.
    """

    rate: bool
    parts: tuple[Part, ...]
    margin: Polynomial
    equalities: tuple[Polynomial, ...] = ()
    inequalities: tuple[Polynomial, ...] = ()


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


def rows_of(loop: Loop, monomials: Sequence[Term]) -> tuple[Row, ...]:
    """Every different form of V, then of −V̇.

    Raises
    ------
    CertificateError
        When the law has nested powers that certificates do not know.
    """
    columns = [Obligations(loop, (term,)) for term in monomials]
    rows: dict[tuple[Any, ...], Row] = {}
    for row in (*_functions(columns), *_rates(loop, columns)):
        conditions = tuple(tuple(sorted(p.items())) for p in (*row.equalities, *row.inequalities))
        rows.setdefault((row.rate, row.parts, conditions), row)
    return tuple(rows.values())


def _functions(columns: Sequence[Obligations]) -> Iterator[Row]:
    for cell in columns[0].sign_cells():
        parts: list[Part] = [
            (j, e, (), c) for j, column in enumerate(columns) for e, c in column.potential(cell.signs).items()
        ]
        yield from _row(parts, columns[0])


def _rates(loop: Loop, columns: Sequence[Obligations]) -> Iterator[Row]:
    first, ends = columns[0], ends_of(loop)
    weights = {**loop.states, **first.lift_degrees}
    kept = [i for i, name in enumerate(weights) if name in loop.states or name in first.with_variable]
    terms = [(j, t) for j, column in enumerate(columns) for t in lie_terms(column.lyapunov[0], loop.field)]
    for cell in first.cells:
        plain = [(j, term.parameters, *_single(term, weights, cell.signs)) for j, term in terms]
        for choice in product(*ends.values()):
            vertex = dict(zip(ends, choice, strict=True))
            total: dict[tuple[Any, ...], Fraction] = {}
            for j, names, exponents, coefficient in plain:
                chosen = [vertex.get(name, (name, 1)) for name in names]
                for _, factor in chosen:
                    coefficient = coefficient * factor
                key = (j, tuple(exponents[i] for i in kept), tuple(sorted(name for name, _ in chosen)))
                total[key] = total.get(key, Fraction(0)) - coefficient
            yield from _row([(*key, c) for key, c in total.items() if c], first, cell)


def _row(parts: list[Part], obligations: Obligations, cell: Cell | None = None) -> Iterator[Row]:
    """The row of some parts, none for none; of −V̇ on a cell where one is given."""
    if parts:
        margin = power_sum(len(obligations.loop.states), max(sum(e) for _, e, _, _ in parts), len(parts[0][1]))
        conditions = (cell.equalities, cell.inequalities) if cell else ((), ())
        yield Row(cell is not None, tuple(sorted(parts)), margin, *conditions)


def _single(term: Term, weights: Mapping[str, int], signs: Mapping[str, int]) -> tuple[tuple[int, ...], Fraction]:
    """Exponents and coefficient of one term on a cell, its parameters left out."""
    found = cell_polynomial((Term(term.coefficient, (), term.factors),), weights, signs, {})
    return next(iter(found.items()))
