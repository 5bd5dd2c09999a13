"""From a loop and a Lyapunov function to the polynomials that must be non-negative."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import product

from quakedesign.certificates.claim import Loop, require, sympy_field
from quakedesign.errors import CertificateError, KinkError
from quakedesign.sos import Polynomial
from quakedesign.symbolic.terms import Term, cell_polynomial, from_terms, lie_derivative, real_polynomial, to_terms


@dataclass(frozen=True)
class Obligations:
    """All polynomials that decide V > 0 and V̇ < 0 for one loop and one V (FORMAT.md, 2 to 5).

    Attributes
    ----------
    loop : Loop
    lyapunov : tuple of Term
    """

    loop: Loop
    lyapunov: tuple[Term, ...]

    @cached_property
    def derivative(self) -> tuple[Term, ...]:
        """Terms of V̇; refused unless V is C¹ and V̇ affine in every uncertain parameter."""
        symbols = self.loop.symbols
        kinks = [t for t in self.lyapunov for _, a, kind in t.factors if a < 1 or (kind == "a" and a == 1)]
        require(not kinks, "V is not continuously differentiable term by term.")
        try:
            rate = lie_derivative(from_terms(self.lyapunov, symbols), sympy_field(self.loop))
        except KinkError as error:
            raise CertificateError(f"V is not continuously differentiable: {error}") from None
        terms = to_terms(rate, [symbols[s] for s in self.loop.states])
        twice = {p for t in terms for p in t.parameters if p in self.loop.uncertain and t.parameters.count(p) > 1}
        require(not twice, f"V̇ is not affine in {', '.join(sorted(twice))}; the ends of its range do not decide.")
        return terms

    def cells(self) -> Iterator[tuple[str, dict[str, int]]]:
        """Every sign cell with its name; one without a name on the reals."""
        states = tuple(self.loop.states)
        if self.loop.domain == "reals":
            yield "", dict.fromkeys(states, 1)
            return
        for signs in product((1, -1), repeat=len(states)):
            yield "".join("+" if s > 0 else "-" for s in signs), dict(zip(states, signs, strict=True))

    def vertices(self) -> Iterator[tuple[str, dict[str, Fraction]]]:
        """Every vertex of the uncertain box with its name."""
        ends = [sorted(set(ends)) for ends in self.loop.uncertain.values()]
        for values in product(*ends):
            vertex = dict(zip(self.loop.uncertain, values, strict=True))
            yield " ".join(f"{name}={v}" for name, v in vertex.items()), vertex

    def function(self, claim: str = "positive") -> Iterator[tuple[str, Polynomial]]:
        """V on every cell; `claim` begins the names."""
        for cell, signs in self.cells():
            yield " ".join(filter(None, (claim, cell))), self._polynomial(self.lyapunov, signs, {})

    def decrease(self, claim: str) -> Iterator[tuple[str, Polynomial]]:
        """−V̇ on every cell and vertex; `claim` begins the names."""
        for cell, signs in self.cells():
            for vertex, values in self.vertices():
                negative = {e: -c for e, c in self._polynomial(self.derivative, signs, values).items()}
                yield " ".join(filter(None, (claim, cell, vertex))), negative

    def _polynomial(self, terms: tuple[Term, ...], signs: Mapping[str, int], vertex: Mapping[str, Fraction]):
        values = {**self.loop.parameters, **vertex}
        if self.loop.domain == "reals":
            return real_polynomial(terms, tuple(self.loop.states), values)
        return cell_polynomial(terms, self.loop.states, signs, values)


def degree(polynomials: list[Polynomial], what: str) -> int:
    """Degree of forms that must all share it.

    Raises
    ------
    CertificateError
        When there is none, or more than one.
    """
    degrees = {sum(exponents) for p in polynomials for exponents in p}
    require(len(degrees) == 1 and min(degrees) >= 1, f"{what} is not homogeneous of one positive degree.")
    return degrees.pop()


def power_sum(variables: int, power: int, factor: Fraction) -> dict[tuple[int, ...], Fraction]:
    """factor · Σ u_i^power."""
    return {tuple(power if j == i else 0 for j in range(variables)): factor for i in range(variables)}


def difference(left: Polynomial, right: Polynomial) -> dict[tuple[int, ...], Fraction]:
    """Left minus right, without zero coefficients."""
    total = dict(left)
    for exponents, c in right.items():
        total[exponents] = total.get(exponents, Fraction(0)) - c
    return {e: c for e, c in total.items() if c}


def claimed(loop: Loop, lyapunov: tuple[Term, ...], claims: Mapping[str, Fraction]) -> Iterator[tuple[str, Polynomial]]:
    """Every obligation of a certificate with the polynomial that must be non-negative, in the order of FORMAT.md."""
    obligations = Obligations(loop, lyapunov)
    variables = len(loop.states)
    function = list(obligations.function())
    m = degree([p for _, p in function], "V")
    require(loop.domain == "cells" or m % 2 == 0, "V has odd degree on the reals.")
    for name, polynomial in function:
        yield name, difference(polynomial, power_sum(variables, m, claims["positive"]))
    for i, state in enumerate(loop.states):
        for name, polynomial in obligations.function(f"bound_{state}") if f"bound_{state}" in claims else ():
            corner = {tuple(m if j == i else 0 for j in range(variables)): claims[f"bound_{state}"]}
            yield name, difference(polynomial, corner)
    second = "decrease" if loop.domain == "cells" else "rate"
    decrease = list(obligations.decrease(second))
    n = degree([p for _, p in decrease], "V̇")
    for name, polynomial in decrease:
        if second == "decrease":
            yield name, difference(polynomial, power_sum(variables, n, claims[second]))
        else:
            require(m == n, "a rate needs V and V̇ of the same degree.")
            yield name, difference(polynomial, {e: 2 * claims[second] * c for e, c in function[0][1].items()})
