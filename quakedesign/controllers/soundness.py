"""What a closed loop must be like so that a certificate is about the loop that its author wrote."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping

import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
_MOST_STATES, _HEAVIEST = 6, 12  # as in proofs/FORMAT.md
_KINDS = ("positive", "nonnegative", "negative", "nonpositive", "nonzero", "rational")


def sound_states(states: Mapping[sp.Symbol, int], domain: str) -> dict[sp.Symbol, int]:
    """States with their weights as integers.

    Raises
    ------
    ParameterError
        For an unknown domain; none or more than 6 states; one that is declared of one sign; weights that are not
        integers from 1 to 12 on `cells` or 1 on `reals`.
    """
    if domain not in ("cells", "reals"):
        raise ParameterError(f"the domain of a loop must be cells or reals. Received {domain!r}.")
    if not 1 <= len(states) <= _MOST_STATES:
        raise ParameterError(f"a loop needs 1 to {_MOST_STATES} states. Received {len(states)}.")
    signed = [s for s in states if any(getattr(s, f"is_{kind}") is not None for kind in _KINDS)]
    if signed:
        raise ParameterError(
            f"a state takes both signs. Received {signed[0]}, declared otherwise. Declare it with real=True only."
        )
    most = _HEAVIEST if domain == "cells" else 1
    wrong = {s: w for s, w in states.items() if not 1 <= w <= most}
    if wrong:
        (state, weight), *_ = wrong.items()
        allowed = f"integers from 1 to {most}" if most > 1 else "1"
        raise ParameterError(
            f"weights must be {allowed} on {domain}. Received {weight} for {state}. "
            "Multiply all weights by one number, or divide them."
        )
    return {s: int(w) for s, w in states.items()}


def sound_field(
    field: Mapping[sp.Symbol, sp.Expr], known: Iterable[sp.Symbol], states: Iterable[sp.Symbol]
) -> dict[sp.Symbol, sp.Expr]:
    """Rate of every state, in the order of the states; SymPy's own signs and absolute values as signed powers.

    Parameters
    ----------
    field : mapping of Symbol to Expr
    known : iterable of Symbol
        Everything that a rate may hold.
    states : iterable of Symbol

    Returns
    -------
    dict of Symbol to Expr

    Raises
    ------
    ParameterError
        When a rate is missing or one too many, or holds a float, an infinity or an unknown symbol.
    """
    order, allowed = tuple(states), set(known)
    if set(order) != set(field):
        raise ParameterError(
            f"a field needs one rate for each of {', '.join(map(str, order))}. "
            f"Received rates of {', '.join(map(str, field)) or 'none'}."
        )
    rates = {s: _signed(sp.sympify(field[s])) for s in order}
    for state, rate in rates.items():
        _require_exact(rate, f"the rate of {state}")
        _require_known(rate, allowed, f"the rate of {state}")
    return rates


def _signed(rate: sp.Expr) -> sp.Expr:
    """sign(x) as ⌈x⌋⁰ and |x|^a as one power."""
    signed = rate.replace(sp.sign, lambda x: SignedPower(x, 0)).replace(sp.Abs, lambda x: AbsolutePower(x, 1))
    return signed.replace(
        lambda e: e.is_Pow and isinstance(e.base, AbsolutePower) and e.exp.is_Rational,
        lambda e: AbsolutePower(e.base.args[0], e.base.args[1] * e.exp),
    )


def _require_exact(expression: sp.Expr, what: str) -> None:
    inexact = [*expression.atoms(sp.Float), *(v for v in (sp.nan, sp.oo, -sp.oo, sp.zoo) if expression.has(v))]
    if inexact:
        raise ParameterError(
            f"{what} must be exact and finite. Received {inexact[0]} in {expression}. "
            "Write numbers as sympy.Rational, such as Rational(3, 2)."
        )


def _require_known(expression: sp.Expr, known: set[sp.Symbol], what: str) -> None:
    unknown = sorted(expression.free_symbols - known, key=str)
    if unknown:
        twin = " Another symbol of this name has other assumptions." * (str(unknown[0]) in map(str, known))
        raise ParameterError(
            f"{what} must hold only {', '.join(sorted(map(str, known))) or 'numbers'}. "
            f"Received {unknown[0]}.{twin} Declare every symbol once."
        )


def require_names(symbols: Iterable[sp.Symbol]) -> None:
    """Refuse names that a certificate file cannot hold, and equal ones.

    Raises
    ------
    ParameterError
    """
    names = [str(symbol) for symbol in symbols]
    wrong = [name for name in names if not _NAME.fullmatch(name)]
    twice = [name for name, n in Counter(names).items() if n > 1]
    if wrong or twice:
        raise ParameterError(
            "names in a loop must be different, of letters, digits and _, beginning with a letter, at most 40 "
            f"characters. Received {(wrong or twice)[0]!r}{' twice' * (not wrong)}. Rename it."
        )


def require_roots(roots: Mapping[sp.Symbol, sp.Symbol], numbers: Iterable[sp.Symbol]) -> None:
    """Refuse a root of anything but a gain or constant.

    Raises
    ------
    ParameterError
    """
    known = set(numbers)
    for root, of in roots.items():
        if of not in known:
            raise ParameterError(f"the root {root} must be that of a gain or constant. Received {of}.")


def require_units(
    units: Mapping[sp.Symbol, sp.Expr], states: Iterable[sp.Symbol], numbers: Iterable[sp.Symbol]
) -> None:
    """Refuse a unit of anything but a state, or one that holds anything but gains, constants and roots.

    Raises
    ------
    ParameterError
    """
    order, known = tuple(states), set(numbers)
    for state, unit in units.items():
        if state not in order:
            raise ParameterError(f"units belong to states, {', '.join(map(str, order))}. Received one of {state}.")
        _require_exact(sp.sympify(unit), f"the unit of {state}")
        _require_known(sp.sympify(unit), known, f"the unit of {state}")
