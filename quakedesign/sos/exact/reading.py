"""Text, SymPy or sparse mappings in; sparse polynomials over common variables out."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import floor
from numbers import Real
from typing import Any

from quakedesign.errors import PolynomialError
from quakedesign.rationals import rational
from quakedesign.sos.exact import text
from quakedesign.sos.exact.polynomial import Exponents, Polynomial, from_sympy
from quakedesign.sos.exact.squares import Element, as_element

_AUTO = "auto"


def read(
    polynomial: Any, on: Sequence[Any], multiplier: Any, variables: Sequence[Any] | None
) -> tuple[tuple[str, ...], dict[Exponents, Fraction], tuple[Polynomial, ...], tuple[Polynomial, ...], Any]:
    """Variables, polynomial, inequalities, equalities and multiplier (None, ``"auto"`` or a polynomial).

    Raises
    ------
    PolynomialError
        When something cannot be read, or a mapping comes without variables.
    """
    if isinstance(on, str):
        on = (on,)
    inputs = [polynomial, *on, *([] if multiplier in (None, _AUTO) else [multiplier])]
    names = tuple(map(str, variables)) if variables is not None else _names(inputs)
    if len(set(names)) < len(names):
        raise PolynomialError(f"variables must be different. Received {', '.join(names)}. Rename one.")
    exact = _polynomial(polynomial, names)
    constraints = [_constraint(c, names) for c in on]
    factor = multiplier if multiplier in (None, _AUTO) else _polynomial(multiplier, names)
    inequalities = tuple(p for kind, p in constraints if kind == "inequality")
    equalities = tuple(p for kind, p in constraints if kind == "equality")
    return names, exact, inequalities, equalities, factor


def read_element(given: Any, names: tuple[str, ...]) -> Element:
    """Element of a basis: a polynomial as for `read`, or the exponents of a monomial.

    Raises
    ------
    PolynomialError
    """
    exponents = tuple(map(_whole, given)) if isinstance(given, Sequence) and not isinstance(given, str) else None
    return as_element(_polynomial({exponents: 1} if exponents is not None else given, names))


def _whole(exponent: Any) -> Any:
    """Integer of an exponent that another programme wrote as a float; text of what is no exponent."""
    return floor(exponent) if isinstance(exponent, Real) and exponent % 1 == 0 else str(exponent)


def _names(inputs: Sequence[Any]) -> tuple[str, ...]:
    names: dict[str, None] = {}
    for one in inputs:
        if isinstance(one, str):
            names |= dict.fromkeys(text.names(one))
        elif hasattr(one, "free_symbols"):
            names |= dict.fromkeys(sorted(s.name for s in one.free_symbols))
        elif isinstance(one, Mapping):
            raise PolynomialError(
                "a polynomial given by its exponents needs its variables. Received none. Give variables=('x', 'y')."
            )
    return tuple(names) or ("x",)


def _polynomial(given: Any, names: tuple[str, ...]) -> dict[Exponents, Fraction]:
    if isinstance(given, str):
        return text.parse(given, names)[1]
    if isinstance(given, Mapping):
        return _mapping(given, names)
    if hasattr(given, "free_symbols"):
        return _sympy(given, names)
    return {e: c for e, c in {(0,) * len(names): rational(given, "polynomial")}.items() if c}


def _mapping(given: Polynomial, names: tuple[str, ...]) -> dict[Exponents, Fraction]:
    for e in given:
        if not isinstance(e, tuple) or len(e) != len(names) or not all(type(x) is int and x >= 0 for x in e):
            raise PolynomialError(f"exponents must be {len(names)} non-negative integers in a tuple. Received {e!r}.")
    exact = {e: rational(c, "coefficient") for e, c in given.items()}
    return {e: c for e, c in exact.items() if c}


def _sympy(given: Any, names: tuple[str, ...]) -> dict[Exponents, Fraction]:
    by_name = {s.name: s for s in given.free_symbols}
    unknown = sorted(set(by_name) - set(names))
    if unknown:
        raise PolynomialError(f"variables must be among {', '.join(names)}. Received {', '.join(unknown)} as well.")
    import sympy as sp

    return from_sympy(given, [by_name.get(n, sp.Symbol(n)) for n in names])


def _constraint(given: Any, names: tuple[str, ...]) -> tuple[str, dict[Exponents, Fraction]]:
    kind: str
    if isinstance(given, str):
        kind, _, polynomial = text.parse_constraint(given, names)
    else:
        kind, polynomial = _relation(given, names)
    if not polynomial:
        raise PolynomialError(f"a constraint must say something. Received {given}, which is always true. Leave it out.")
    return kind, polynomial


def _relation(given: Any, names: tuple[str, ...]) -> tuple[str, dict[Exponents, Fraction]]:
    import sympy as sp

    if isinstance(given, sp.GreaterThan):
        return "inequality", _sympy(given.lhs - given.rhs, names)
    if isinstance(given, sp.LessThan):
        return "inequality", _sympy(given.rhs - given.lhs, names)
    if isinstance(given, sp.Equality):
        return "equality", _sympy(given.lhs - given.rhs, names)
    raise PolynomialError(
        f"a constraint is text such as 'x >= 0', or a SymPy relation >=, <=, Eq. Received {given!s:.60}. "
        "Strict inequalities are not closed; use >=."
    )
