"""Powers of two that make a loop's numbers about one before a solver sees them."""

import math
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import pairwise

import numpy as np

from quakedesign.certificates import Loop
from quakedesign.sos import Polynomial
from quakedesign.sos.exact.polynomial import monomial
from quakedesign.symbolic.terms import Factor, Term


def balance(loop: Loop) -> tuple[Fraction, ...]:
    """Powers of two 2^n_i that make the terms of every state's rate about equally large, for u_i = 2^n_i·ũ_i.

    Least squares on the logarithms; the first state keeps its scale. A nested power counts as that of each of its
    terms.
    """
    states = tuple(loop.states)
    rows, sides = [], []
    for terms in loop.field.values():
        plain = [one for term in terms for one in _without_lifts(term, loop)]
        entries = [_logarithm(term, loop, states) for term in plain if term.factors and _size(term, loop)]
        for (e, c), (f, d) in pairwise(entries):
            if max(e) and max(f):
                rows.append([a - b for a, b in zip(e, f, strict=True)])
                sides.append(d - c)
    if len(states) == 1 or not rows:
        return (Fraction(1),) * len(states)
    solution, *_ = np.linalg.lstsq(np.array(rows)[:, 1:], np.array(sides), rcond=None)
    return (Fraction(1), *(Fraction(2) ** round(float(n)) for n in solution))


def _without_lifts(term: Term, loop: Loop) -> Iterator[Term]:
    """The term with its nested power replaced by the power of each of its arguments' terms, sizes left out."""
    lift = next((f for f in term.factors if f[0] in loop.lifts), None)
    if lift is None:
        yield term
        return
    for inner in loop.lifts[lift[0]]:
        if inner.factors and _size(inner, loop):
            powers: dict[str, Fraction] = {}
            for name, exponent, _ in (*(f for f in term.factors if f != lift), *inner.factors):
                share = exponent * lift[1] if (name, exponent, _) in inner.factors else exponent
                powers[name] = powers.get(name, Fraction(0)) + share
            factors: tuple[Factor, ...] = tuple((name, e, "a") for name, e in powers.items() if e)
            yield from _without_lifts(Term(term.coefficient, term.parameters, factors), loop)


def _logarithm(term: Term, loop: Loop, states: Sequence[str]) -> tuple[list[float], float]:
    exponents = [0.0] * len(states)
    for state, exponent, _ in term.factors:
        exponents[states.index(state)] = float(exponent * loop.states[state])
    return exponents, math.log2(_size(term, loop))


def _size(term: Term, loop: Loop) -> Fraction:
    size = Fraction(abs(term.coefficient))
    for name in term.parameters:
        ends = loop.ranges.get(name) or (loop.parameters[name],) * 2
        size *= max(abs(ends[0]), abs(ends[1]))
    return size


def lifted_scale(equalities: Sequence[Polynomial], scale: Sequence[Fraction]) -> tuple[Fraction, ...]:
    """Scale of all variables, given that of the first ones: each equality t·w^n = P fixes that of its w in turn."""
    scales = list(scale)
    for equality in equalities:
        position = len(scales)
        power = max(e[position] for e in equality)
        sizes = [abs(c) * monomial(scales, e[:position]) for e, c in equality.items() if not any(e[position:])]
        largest = max(sizes, default=Fraction(1))
        exponent = (math.log2(largest.numerator) - math.log2(largest.denominator)) / power
        scales.append(Fraction(2) ** round(exponent))
    return tuple(scales)


def below(number: float) -> Fraction:
    """Positive number rounded down to about three digits, as a short rational; zero stays zero."""
    if not number > 0 or not math.isfinite(number):
        return Fraction(0)
    shift = Fraction(2) ** (9 - math.floor(math.log2(number)))
    return Fraction(math.floor(Fraction(number) * shift)) / shift


def scaled(polynomial: Polynomial, scale: Sequence[Fraction], factor: Fraction = Fraction(1)) -> Polynomial:
    """factor · P(scale ∘ ũ)."""
    return {e: c * factor * monomial(scale, e) for e, c in polynomial.items()}


def normal(polynomial: Polynomial, scale: Sequence[Fraction]) -> Polynomial:
    """P(scale ∘ ũ) over its largest coefficient."""
    moved = scaled(polynomial, scale)
    size = max(abs(c) for c in moved.values())
    return {e: c / size for e, c in moved.items()}


def exponents_of(term: Term, weights: Mapping[str, int]) -> tuple[int, ...]:
    """Exponents of a monomial of V in the cell variables of the states."""
    powers = {state: exponent * weights[state] for state, exponent, _ in term.factors}
    return tuple(int(powers.get(state, 0)) for state in weights)
