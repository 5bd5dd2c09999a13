"""Vector field of a loop in SymPy, and units of its states."""

from collections.abc import Mapping
from fractions import Fraction

import sympy as sp

from quakedesign.exact import end_of
from quakedesign.laws import LoopField, laws
from quakedesign.lyapunov.exact.claim import Loop, Range, require
from quakedesign.symbolic.enclosure import enclose
from quakedesign.symbolic.term_expressions import from_terms


def sympy_field(loop: Loop) -> dict[sp.Symbol, sp.Expr]:
    """Vector field of a loop as SymPy expressions."""
    symbols = loop.symbols
    return {symbols[state]: from_terms(terms, symbols) for state, terms in loop.field.items()}


def full_field(loop: Loop) -> dict[sp.Symbol, sp.Expr]:
    """Vector field of a loop with every nested power written out."""
    symbols = loop.symbols
    field = sympy_field(loop)
    for lift, terms in reversed(list(loop.lifts.items())):
        argument = from_terms(terms, symbols)
        field = {state: rate.subs(symbols[lift], argument) for state, rate in field.items()}
    return field


def error_units(loop: Loop, model: LoopField | None = None) -> dict[str, Range]:
    """Enclosure, for each state, of the error that equals one unit of this state; 1 unless the law defines a unit.

    The units are those of `model`; by default, those of the package's law with the name of the loop's law.
    """
    if model is None and loop.law in laws():
        model = laws()[loop.law].loop_field()
    return unit_ranges(loop, {str(state): unit for state, unit in model.units.items()} if model is not None else {})


def unit_ranges(loop: Loop, units: Mapping[str, sp.Expr]) -> dict[str, Range]:
    """Enclosure of the value of every unit, by the name of its state; 1 without a unit.

    Raises
    ------
    CertificateError
        When a unit is not positive.
    """
    values = {**{n: (v, v) for n, v in loop.parameters.items()}, **{n: ends for n, (_, ends) in loop.roots.items()}}
    ranges: dict[str, Range] = dict.fromkeys(loop.states, (Fraction(1), Fraction(1)))
    for state, unit in units.items():
        ball = enclose(unit, {s: values[str(s)] for s in unit.free_symbols})
        low, high = (end_of(end) for end in (ball.lower(), ball.upper()))
        require(low > 0, f"the unit of {state} must be positive. Received {unit}.")
        ranges[state] = (low, high)
    return ranges
