"""Closed loop of a control law as an uncertain vector field, the subject of a certificate.

The first chapter checks names, roots, units and states, so that a certificate describes the intended loop.
"""

import dataclasses
import re
from collections import Counter
from collections.abc import Iterable, Mapping

import sympy as sp

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import CertificateError, ParameterError
from quakedesign.laws.field_terms import FieldTerms
from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower
from quakedesign.symbolic.term_expressions import to_terms, without_nesting
from quakedesign.symbolic.terms import Term

# ----------------------------------------------------------------------
# Conditions on a closed loop that ensure that a certificate describes the intended loop.

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
_MOST_STATES, _HEAVIEST = 6, 12  # as in proofs/FORMAT.md
_KINDS = ("positive", "nonnegative", "negative", "nonpositive", "nonzero", "rational")


def sound_states(states: Mapping[sp.Symbol, int], domain: str) -> dict[sp.Symbol, int]:
    """States with their weights as integers.

    Raises
    ------
    ParameterError
        For an unknown domain; none or more than 6 states; a state declared with a sign; weights outside 1 to 12 on
        `cells` (signed powers), or other than 1 on `reals` (polynomials).
    """
    if domain not in ("cells", "reals"):
        raise ParameterError(f"the domain of a loop must be cells or reals. Received {domain!r}.")
    if not 1 <= len(states) <= _MOST_STATES:
        raise ParameterError(f"a loop needs 1 to {_MOST_STATES} states. Received {len(states)}.")
    signed = [s for s in states if any(getattr(s, f"is_{kind}") is not None for kind in _KINDS)]
    if signed:
        raise ParameterError(
            f"states must be declared real only. Received {signed[0]}, declared with a sign. Declare it with real=True."
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
    field: Mapping[sp.Symbol, sp.Expr], symbols: Iterable[sp.Symbol], states: Iterable[sp.Symbol]
) -> dict[sp.Symbol, sp.Expr]:
    """Rate of every state, in the order of the states; SymPy's own signs and absolute values become power functions.

    Parameters
    ----------
    symbols : iterable of Symbol
        All symbols that a rate may contain.

    Raises
    ------
    ParameterError
        When a rate is missing or superfluous, or contains a float, an infinity or an unknown symbol.
    """
    order, allowed = tuple(states), set(symbols)
    if set(order) != set(field):
        raise ParameterError(
            f"a field needs one rate for each of {', '.join(map(str, order))}. "
            f"Received rates of {', '.join(map(str, field)) or 'none'}."
        )
    rates = {s: _signed(sp.sympify(field[s])) for s in order}
    for state, rate in rates.items():
        _require_exact(rate, f"the rate of {state}")
        _require_symbols(rate, allowed, f"the rate of {state}")
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


def _require_symbols(expression: sp.Expr, symbols: set[sp.Symbol], what: str) -> None:
    unknown = sorted(expression.free_symbols - symbols, key=str)
    if unknown:
        twin = " Another symbol of this name has other assumptions." * (str(unknown[0]) in map(str, symbols))
        raise ParameterError(
            f"{what} must contain only {', '.join(sorted(map(str, symbols))) or 'numbers'}. "
            f"Received {unknown[0]}.{twin} Declare every symbol once."
        )


def require_names(symbols: Iterable[sp.Symbol]) -> None:
    """Reject names that a certificate file does not admit, and duplicate names."""
    names = [str(symbol) for symbol in symbols]
    wrong = [name for name in names if not _NAME.fullmatch(name)]
    twice = [name for name, n in Counter(names).items() if n > 1]
    if wrong or twice:
        raise ParameterError(
            "names in a loop must be different, of letters, digits and _, beginning with a letter, at most 40 "
            f"characters. Received {(wrong or twice)[0]!r}{' twice' * (not wrong)}. Rename it."
        )


def require_roots(roots: Mapping[sp.Symbol, sp.Symbol], numbers: Iterable[sp.Symbol]) -> None:
    """Reject a root of anything but a gain or constant."""
    symbols = set(numbers)
    for root, of in roots.items():
        if of not in symbols:
            raise ParameterError(f"the root {root} must be that of a gain or constant. Received {of}.")


def require_units(
    units: Mapping[sp.Symbol, sp.Expr], states: Iterable[sp.Symbol], numbers: Iterable[sp.Symbol]
) -> None:
    """Reject a unit of anything but a state, or one that contains more than gains, constants and roots."""
    order, symbols = tuple(states), set(numbers)
    for state, unit in units.items():
        if state not in order:
            raise ParameterError(f"units belong to states, {', '.join(map(str, order))}. Received a unit of {state}.")
        _require_exact(sp.sympify(unit), f"the unit of {state}")
        _require_symbols(sp.sympify(unit), symbols, f"the unit of {state}")


# ----------------------------------------------------------------------
# A closed loop in symbols, as a law derives it, and its terms.


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class LoopField:
    """A closed loop as an uncertain vector field, the subject of a certificate.

    Attributes
    ----------
    states : dict of Symbol to int
        States and their weights.
    field : dict of Symbol to Expr
        Time derivative of every state, in gains, constants and uncertain parameters.
    gains, constants, uncertain : tuple of Symbol
        Gains, constants and uncertain parameters of the field.
    domain : str
        ``"cells"`` for signed powers, ``"reals"`` for polynomials.
    roots : mapping of Symbol to Symbol
        Symbols that stand for the positive square root of a gain or constant.
    units : mapping of Symbol to Expr
        Factor by which a state is multiplied to give its error, in gains, constants and roots; 1 if omitted.

    Raises
    ------
    ParameterError
        For duplicate names or names that a certificate file does not admit, an unknown domain, states declared with a
        sign, none or more than 6 of them, weights outside 1 to 12 (other than 1 on `reals`), a rate that is missing,
        superfluous, inexact or contains an unknown symbol, a root of anything but a gain or constant, a unit of
        anything but a state or with symbols other than gains, constants and roots.
    """

    states: dict[sp.Symbol, int]
    field: dict[sp.Symbol, sp.Expr]
    gains: tuple[sp.Symbol, ...]
    constants: tuple[sp.Symbol, ...]
    uncertain: tuple[sp.Symbol, ...]
    domain: str
    roots: Mapping[sp.Symbol, sp.Symbol] = dataclasses.field(default_factory=dict)
    units: Mapping[sp.Symbol, sp.Expr] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        numbers = (*self.gains, *self.constants)
        symbols = (*self.states, *numbers, *self.uncertain, *self.roots)
        object.__setattr__(self, "states", sound_states(self.states, self.domain))
        require_names(symbols)
        require_roots(self.roots, numbers)
        require_units(self.units, self.states, (*numbers, *self.roots))
        object.__setattr__(self, "field", sound_field(self.field, symbols, self.states))

    @property
    def degree(self) -> int:
        """Lowest degree of the Lyapunov functions to try, see `lowest_degree`."""
        return lowest_degree(self.states.values(), self.domain)

    @property
    def terms(self) -> FieldTerms:
        """The loop as plain data, with a name for the argument of every nested power.

        Raises
        ------
        CertificateError
            For parts that certificates cannot express, and rates that are unbounded near the origin.
        """
        states = tuple(self.states)
        names = [s.name for s in (*self.gains, *self.constants, *self.uncertain, *self.roots, *states)]
        lifts, rates = without_nesting([self.field[s] for s in states], states, names)
        powers = (*states, *lifts)
        speeds = {s.name: to_terms(rate, powers) for s, rate in zip(states, rates, strict=True)}
        _require_bounded(speeds)
        arguments = {lift.name: to_terms(argument, powers) for lift, argument in lifts.items()}
        gains, constants, uncertain = (tuple(s.name for s in g) for g in (self.gains, self.constants, self.uncertain))
        used = {name for terms in speeds.values() for term in terms for name, _, _ in term.factors}
        for lift, terms in reversed(list(arguments.items())):
            used |= {name for term in terms for name, _, _ in term.factors} if lift in used else set()
        return FieldTerms(
            states={s.name: weight for s, weight in self.states.items()},
            field=speeds,
            gains=gains,
            constants=constants,
            uncertain=uncertain,
            domain=self.domain,
            roots={root.name: of.name for root, of in self.roots.items()},
            lifts={lift: terms for lift, terms in arguments.items() if lift in used},
        )


def lowest_degree(weights: Iterable[int], domain: str) -> int:
    """Degree of the product of the two heaviest states, the least of a V that couples them; 2 on `reals`."""
    *_, first, second = (1, *sorted(weights))
    return first + second if domain == "cells" else 2


def _require_bounded(speeds: Mapping[str, Iterable[Term]]) -> None:
    """Reject a negative power that no other factor of its product compensates."""
    for state, terms in speeds.items():
        for of, exponent, kind in (factor for term in terms for factor in term.factors if factor[1] < 0):
            power = f"|{of}|^({exponent})" if kind == "a" else f"⌈{of}⌋^({exponent})"
            raise CertificateError(
                f"every rate must be bounded near the origin. Received {power} in the rate of {state}, unbounded at "
                f"{of} = 0. Multiply this term by a power of {of} with a larger exponent."
            )
