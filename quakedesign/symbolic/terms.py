"""Sums of products of signed powers as plain data, and their polynomials on sign cells."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from quakedesign.errors import CertificateError
from quakedesign.exact import exact_text

Factor = tuple[str, Fraction, str]  # state, exponent, kind: ``s`` for ⌈x⌋^a, ``a`` for |x|^a


@dataclass(frozen=True, slots=True, order=True)
class Term:
    """Product of a rational coefficient, parameters, and signed or absolute powers of states."""

    coefficient: Fraction
    parameters: tuple[str, ...]  # Names; a parameter to the power n occurs n times
    factors: tuple[Factor, ...]  # At most one per state


def plain(terms: Iterable[Term]) -> list[Any]:
    """Terms in JSON types, with numbers as strings."""
    return [
        [exact_text(t.coefficient), list(t.parameters), [[s, exact_text(e), k] for s, e, k in t.factors]] for t in terms
    ]


def collected(terms: Iterable[Term], states: Sequence[str]) -> tuple[Term, ...]:
    """Sum with equal products collected, in a fixed order: parameters by name, factors in the order of their states."""
    order = {state: i for i, state in enumerate(states)}
    coefficients: dict[tuple[tuple[str, ...], tuple[Factor, ...]], Fraction] = {}
    for term in terms:
        key = (tuple(sorted(term.parameters)), tuple(sorted(term.factors, key=lambda factor: order[factor[0]])))
        coefficients[key] = coefficients[key] + term.coefficient if key in coefficients else term.coefficient
    return tuple(sorted(Term(c, *key) for key, c in coefficients.items() if c))


def multiplied(factors: Iterable[Factor]) -> tuple[Factor, ...]:
    """Product of signed and absolute powers with one factor per state; ⌈x⌋⁰ = sign(x) is retained, |x|⁰ is omitted."""
    powers: dict[str, tuple[Fraction, bool]] = {}
    for state, exponent, kind in factors:
        power, odd = powers.get(state, (Fraction(0), False))
        powers[state] = power + exponent, odd != (kind == "s")
    return tuple((state, a, "s" if odd else "a") for state, (a, odd) in powers.items() if a or odd)


def lie_terms(function: Term, field: Mapping[str, tuple[Term, ...]]) -> Iterator[Term]:
    """Terms of the derivative of a C¹ product along a field, by (⌈x⌋^a)′ = a|x|^{a−1} and (|x|^a)′ = a⌈x⌋^{a−1}.

    The caller ensures that the product is C¹: a ≥ 1 for signed and a > 1 for absolute powers.
    """
    for state, a, kind in function.factors:
        others = [f for f in function.factors if f[0] != state]
        slope = (state, a - 1, "s" if kind == "a" else "a")
        for rate in field[state]:
            factors = multiplied([*others, slope, *rate.factors])
            coefficient = function.coefficient * a * rate.coefficient
            yield Term(coefficient, (*function.parameters, *rate.parameters), factors)


def written(terms: Iterable[Term]) -> str:
    """Sum as text for SymPy, with signed and absolute powers as functions and positive terms first."""
    ordered = sorted(terms, key=lambda term: term.coefficient < 0)
    words = [f" {'-' if term.coefficient < 0 else '+'} {_written_size(term)}" for term in ordered]
    return "".join(words)[3:] if ordered and ordered[0].coefficient > 0 else "-" + "".join(words)[3:] if words else "0"


def _written_size(term: Term) -> str:
    """Term without its sign: numerator, parameters, powers, denominator."""
    kinds = {"s": "SignedPower", "a": "AbsolutePower"}
    powers = [s if kind == "s" and e == 1 else f"{kinds[kind]}({s}, {e})" for s, e, kind in term.factors]
    numerator, denominator = abs(term.coefficient.numerator), term.coefficient.denominator
    factors = [*([exact_text(numerator)] if numerator != 1 else []), *term.parameters, *powers] or ["1"]
    return "*".join(factors) + (f"/{denominator}" if denominator != 1 else "")


def value(term: Term, parameters: Mapping[str, Fraction]) -> Fraction:
    """Value of the coefficient of a term times its parameters."""
    product = term.coefficient
    for name in term.parameters:
        product *= parameters[name]
    return product


def cell_polynomial(
    terms: Iterable[Term], weights: Mapping[str, int], signs: Mapping[str, int], parameters: Mapping[str, Fraction]
) -> dict[tuple[int, ...], Fraction]:
    """Polynomial of a sum of terms on a sign cell, in the variables u_i ≥ 0 with x_i = s_i·u_i^{r_i}.

    Parameters
    ----------
    terms : iterable of Term
        Terms of the sum.
    weights : mapping of state to r_i
        Weights, in the order of the variables.
    signs : mapping of state to ±1
        Signs s_i of the cell.
    parameters : mapping of str to Fraction
        Value of every parameter.

    Raises
    ------
    CertificateError
        If an exponent does not become a nonnegative integer.
    """
    total: dict[tuple[int, ...], Fraction] = {}
    for term in terms:
        coefficient, exponents = value(term, parameters), dict.fromkeys(weights, 0)
        for state, exponent, kind in term.factors:
            degree, rest = divmod(exponent.numerator * weights[state], exponent.denominator)
            if rest or degree < 0:
                raise CertificateError(f"⌈{state}⌋^{exponent} of weight {weights[state]} is not polynomial on a cell.")
            exponents[state] = degree
            coefficient *= signs[state] if kind == "s" else 1
        key = tuple(exponents.values())
        total[key] = total[key] + coefficient if key in total else coefficient
    return {e: c for e, c in total.items() if c}


def real_polynomial(
    terms: Iterable[Term], states: Sequence[str], parameters: Mapping[str, Fraction]
) -> dict[tuple[int, ...], Fraction]:
    """Polynomial on ℝⁿ from terms whose factors are odd signed or even absolute integer powers.

    Raises
    ------
    CertificateError
        If a factor is not a polynomial.
    """
    terms = tuple(terms)
    for term in terms:
        for state, exponent, kind in term.factors:
            if exponent.denominator != 1 or (kind == "s") != (exponent % 2 == 1):
                word = "signed" if kind == "s" else "absolute"
                raise CertificateError(f"the {word} power {exponent} of {state} is not polynomial on the reals.")
    return cell_polynomial(terms, dict.fromkeys(states, 1), dict.fromkeys(states, 1), parameters)
