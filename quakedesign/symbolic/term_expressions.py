"""Conversion between SymPy and sums of signed-power terms, and Lyapunov candidates.

Candidates are sums of homogeneous terms, generated from weights and degree.
"""

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import count, product

import sympy as sp

from quakedesign.errors import CertificateError, ParameterError
from quakedesign.exact import fraction_of
from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower, normal_form
from quakedesign.symbolic.terms import Factor, Term, collected, multiplied
from quakedesign.text import shown

# ----------------------------------------------------------------------
# Sums of products of signed powers, to and from SymPy; see `quakedesign.symbolic.terms`.


def to_terms(expression: sp.Expr, states: Sequence[sp.Symbol]) -> tuple[Term, ...]:
    """Expand an expression into terms, with equal products collected, in a fixed order.

    Raises
    ------
    CertificateError
        If a part is not a product of a rational number, parameters and signed powers of single states.
    """
    parts = sp.Add.make_args(sp.expand(expression))
    return collected((_split(part, set(states)) for part in parts), [state.name for state in states])


def without_nesting(
    expressions: Sequence[sp.Expr], states: Sequence[sp.Symbol], taken: Iterable[str] = ()
) -> tuple[dict[sp.Symbol, sp.Expr], list[sp.Expr]]:
    """Replace every sum inside a signed or absolute power by a new symbol (lift), so that no power is nested.

    Powers of a product of states need no symbol: ⌈x²⌋⁰ = 1 and ⌈xy⌋⁰ = ⌈x⌋⁰⌈y⌋⁰ where neither vanishes.

    Parameters
    ----------
    taken : iterable of str
        Names that the new symbols must not have.

    Returns
    -------
    lifts : dict of Symbol to Expr
        Argument of every new symbol, in states and earlier symbols; empty without nesting.
    expressions : list of Expr
        The expressions, in states and new symbols.
    """
    lifts: dict[sp.Expr, sp.Symbol] = {}
    names = (f"n{i}" for i in count(1))
    free = (name for name in names if name not in set(taken))

    def walk(e: sp.Expr) -> sp.Expr:
        if not e.args:
            return e
        if isinstance(e, SignedPower | AbsolutePower) and e.args[0] not in states and e.args[0].has(*states):
            argument = sp.expand(walk(e.args[0]))
            if not argument.is_Add and argument.free_symbols <= set(states):
                return normal_form(e.func(argument, e.args[1]))
            if argument not in lifts:
                lifts[argument] = sp.Symbol(next(free), real=True)
            return e.func(lifts[argument], e.args[1])
        return e.func(*(walk(a) for a in e.args))

    plain = [walk(sp.sympify(e)) for e in expressions]
    return {symbol: argument for argument, symbol in lifts.items()}, plain


def _split(part: sp.Expr, states: Container[sp.Symbol]) -> Term:
    coefficient, parameters = Fraction(1), list[str]()
    powers = list[Factor]()
    for factor in sp.Mul.make_args(part):
        base, power = factor.as_base_exp()
        if factor.is_Rational:
            coefficient *= fraction_of(factor)
        elif base.is_Symbol and base not in states and power.is_Integer and power > 0:
            parameters += [base.name] * int(power)
        else:
            powers.append(_power(base, power, states))
    return Term(coefficient, tuple(parameters), multiplied(powers))


def _power(base: sp.Expr, power: sp.Expr, states: Container[sp.Symbol]) -> Factor:
    if base in states and power.is_Integer and power > 0:
        return base.name, Fraction(int(power)), "s" if power % 2 else "a"
    if isinstance(base, SignedPower | AbsolutePower) and power.is_Integer and power > 0:
        state, exponent = base.args
        if state in states and exponent.is_Rational:
            odd = isinstance(base, SignedPower) and power % 2 == 1
            return state.name, fraction_of(exponent) * int(power), "s" if odd else "a"
    raise CertificateError(
        f"a certificate needs products of signed powers of single states. Received the factor {base**power}. "
        "Nested powers need a change of coordinates first."
    )


def from_terms(terms: Iterable[Term], symbols: Mapping[str, sp.Symbol]) -> sp.Expr:
    """SymPy expression of a sum of terms; `symbols` maps every name to its symbol."""
    kinds = {"s": SignedPower, "a": AbsolutePower}
    total = sp.Integer(0)
    for term in terms:
        product = sp.Rational(term.coefficient.numerator, term.coefficient.denominator)
        for name in term.parameters:
            product *= symbols[name]
        for state, exponent, kind in term.factors:
            product *= kinds[kind](symbols[state], sp.Rational(exponent.numerator, exponent.denominator))
        total += product
    return total


def lie_derivative(function: sp.Expr, field: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    """Lie derivative Σ ∂V/∂x_i·f_i of a function V along a field f.

    Raises
    ------
    KinkError
        If the function is not continuously differentiable.
    """
    return sum((function.diff(state) * rate for state, rate in field.items()), start=sp.Integer(0))


def real_symbols(names: Iterable[str]) -> dict[str, sp.Symbol]:
    """SymPy symbol of every name.

    Raises
    ------
    ParameterError
        If a name is not a string.
    """
    listed = list(names)
    if wrong := [name for name in listed if not isinstance(name, str)]:
        raise ParameterError(f"names must be strings. Received {shown(wrong[0])}. Write for example 'x'.")
    return {name: sp.Symbol(name, real=True) for name in listed}


# ----------------------------------------------------------------------
# Candidates for homogeneous Lyapunov functions, generated from weights and degree.


def signed_monomials(weights: Mapping[str, int], degree: int, domain: str) -> tuple[Term, ...]:
    """All C¹ products of signed and absolute powers that have a given degree and are even under x → −x.

    Parameters
    ----------
    weights : mapping of str to int
        Weight of every state.
    degree : int
        Weighted degree of every product.
    domain : str
        ``"cells"`` for all such products, or ``"reals"`` for polynomials only.

    Returns
    -------
    tuple of Term
        Products with coefficient 1.
    """
    terms = []
    for degrees in product(range(degree + 1), repeat=len(weights)):
        if sum(degrees) != degree:
            continue
        powers = [(s, Fraction(n, weights[s])) for s, n in zip(weights, degrees, strict=True) if n]
        for factors in _kinds(powers, domain):
            if sum(kind == "s" for _, _, kind in factors) % 2 == 0:
                terms.append(Term(Fraction(1), (), factors))
    return tuple(terms)


def _kinds(powers: list[tuple[str, Fraction]], domain: str) -> Iterator[tuple[Factor, ...]]:
    if any(a < 1 for _, a in powers):
        return
    for kinds in product("sa", repeat=len(powers)):
        factors = tuple((s, a, kind) for (s, a), kind in zip(powers, kinds, strict=True))
        smooth = all(kind == "s" or a > 1 for _, a, kind in factors)
        if smooth and (domain == "cells" or all((kind == "s") == (a % 2 == 1) for _, a, kind in factors)):
            yield factors
