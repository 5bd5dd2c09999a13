"""Sums of products of signed powers as plain data, and their polynomials on sign cells."""

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import count

import sympy as sp

from quakedesign.errors import CertificateError
from quakedesign.rationals import fraction_of
from quakedesign.symbolic.normal_form import normal_form
from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower

Factor = tuple[str, Fraction, str]
"""State, exponent, kind: ``s`` for ⌈x⌋^a, ``a`` for |x|^a."""


@dataclass(frozen=True, slots=True, order=True)
class Term:
    """coefficient · parameters · factors.

    Attributes
    ----------
    coefficient : Fraction
    parameters : tuple of str
        Names, each as often as it multiplies.
    factors : tuple of (state, exponent, kind)
        At most one for every state.
    """

    coefficient: Fraction
    parameters: tuple[str, ...]
    factors: tuple[Factor, ...]


def to_terms(expression: sp.Expr, states: Sequence[sp.Symbol]) -> tuple[Term, ...]:
    """Expand an expression into terms, with equal products collected, in a fixed order.

    Raises
    ------
    CertificateError
        When a part is not a product of rational number, parameters and signed powers of single states.
    """
    parts = sp.Add.make_args(sp.expand(expression))
    return collected((_split(part, set(states)) for part in parts), [state.name for state in states])


def collected(terms: Iterable[Term], states: Sequence[str]) -> tuple[Term, ...]:
    """Sum with equal products collected, in a fixed order: parameters by name, factors in the order of their states."""
    order = {state: i for i, state in enumerate(states)}
    coefficients: dict[tuple[tuple[str, ...], tuple[Factor, ...]], Fraction] = {}
    for term in terms:
        key = (tuple(sorted(term.parameters)), tuple(sorted(term.factors, key=lambda factor: order[factor[0]])))
        coefficients[key] = coefficients[key] + term.coefficient if key in coefficients else term.coefficient
    return tuple(sorted(Term(c, *key) for key, c in coefficients.items() if c))


def without_nesting(
    expressions: Sequence[sp.Expr], states: Sequence[sp.Symbol], taken: Iterable[str] = ()
) -> tuple[dict[sp.Symbol, sp.Expr], list[sp.Expr]]:
    """Nested signed powers named: the argument of every power of a sum becomes a symbol of its own.

    Powers of a product of states need none: ⌈x²⌋⁰ = 1 and ⌈xy⌋⁰ = ⌈x⌋⁰⌈y⌋⁰ where neither vanishes.

    Parameters
    ----------
    expressions : sequence of Expr
    states : sequence of Symbol
    taken : iterable of str
        Names that the new symbols must not have.

    Returns
    -------
    lifts : dict of Symbol to Expr
        Argument of every new symbol, in states and earlier symbols; empty without nesting.
    expressions : list of Expr
        The same, in states and new symbols.
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


def multiplied(factors: Iterable[Factor]) -> tuple[Factor, ...]:
    """Product of signed powers with every state once; ⌈x⌋⁰ is its sign, |x|⁰ is left out."""
    powers: dict[str, tuple[Fraction, bool]] = {}
    for state, exponent, kind in factors:
        power, odd = powers.get(state, (Fraction(0), False))
        powers[state] = power + exponent, odd != (kind == "s")
    return tuple((state, a, "s" if odd else "a") for state, (a, odd) in powers.items() if a or odd)


def from_terms(terms: Iterable[Term], symbols: Mapping[str, sp.Symbol]) -> sp.Expr:
    """SymPy expression of terms; `symbols` gives the symbol of every name."""
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
    """Σ ∂V/∂x_i · f_i.

    Raises
    ------
    KinkError
        When the function is not continuously differentiable.
    """
    return sum((function.diff(state) * rate for state, rate in field.items()), start=sp.Integer(0))


def lie_terms(function: Term, field: Mapping[str, tuple[Term, ...]]) -> Iterator[Term]:
    """Terms of the derivative of a C¹ product along a field, by (⌈x⌋^a)′ = a|x|^{a−1} and (|x|^a)′ = a⌈x⌋^{a−1}.

    That the product is C¹, a ≥ 1 for signed and a > 1 for absolute powers, is the caller's question.
    """
    for state, a, kind in function.factors:
        others = [f for f in function.factors if f[0] != state]
        slope = (state, a - 1, "s" if kind == "a" else "a")
        for speed in field[state]:
            factors = multiplied([*others, slope, *speed.factors])
            coefficient = function.coefficient * a * speed.coefficient
            yield Term(coefficient, (*function.parameters, *speed.parameters), factors)


def value(term: Term, parameters: Mapping[str, Fraction]) -> Fraction:
    """Coefficient with numbers for the parameters."""
    product = term.coefficient
    for name in term.parameters:
        product *= parameters[name]
    return product


def cell_polynomial(
    terms: Iterable[Term],
    weights: Mapping[str, int],
    signs: Mapping[str, int],
    parameters: Mapping[str, Fraction],
) -> dict[tuple[int, ...], Fraction]:
    """Polynomial in u_i ≥ 0 after x_i = s_i·u_i^{r_i}.

    Parameters
    ----------
    terms : iterable of Term
    weights : mapping of state to r_i
        In the order of the variables.
    signs : mapping of state to ±1
    parameters : mapping of name to Fraction

    Raises
    ------
    CertificateError
        When an exponent does not become an integer.
    """
    total: dict[tuple[int, ...], Fraction] = {}
    for term in terms:
        coefficient, exponents = value(term, parameters), dict.fromkeys(weights, 0)
        for state, exponent, kind in term.factors:
            degree, rest = divmod(exponent.numerator * weights[state], exponent.denominator)
            if rest or degree < 0:
                raise CertificateError(f"⌈{state}⌋^{exponent} with weight {weights[state]} is no polynomial on a cell.")
            exponents[state] = degree
            coefficient *= signs[state] if kind == "s" else 1
        key = tuple(exponents.values())
        total[key] = total[key] + coefficient if key in total else coefficient
    return {e: c for e, c in total.items() if c}


def real_polynomial(
    terms: Iterable[Term], states: Sequence[str], parameters: Mapping[str, Fraction]
) -> dict[tuple[int, ...], Fraction]:
    """Polynomial on ℝⁿ of terms whose factors are integer powers of the right parity.

    Raises
    ------
    CertificateError
        When a factor is not a polynomial.
    """
    terms = tuple(terms)
    for term in terms:
        for state, exponent, kind in term.factors:
            if exponent.denominator != 1 or (kind == "s") != (exponent % 2 == 1):
                raise CertificateError(f"{kind}-power {exponent} of {state} is no polynomial on the reals.")
    return cell_polynomial(terms, dict.fromkeys(states, 1), dict.fromkeys(states, 1), parameters)
