"""Exact scaling, so that a solver sees coefficients of about one whatever the units."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import prod

import numpy as np

from quakedesign.sos.exact.polynomial import Exponents, Polynomial, monomial, rescaled
from quakedesign.sos.exact.proofs import Functional, Point, Proof, SumOfSquares
from quakedesign.sos.exact.squares import Element, Square
from quakedesign.sos.exact.statement import Statement


@dataclass(frozen=True, kw_only=True)
class Scaled:
    """A statement in ũ = u/scale, scale powers of two, with every polynomial divided by its largest coefficient.

    Attributes
    ----------
    statement : Statement
    scale : tuple of Fraction
    target : Fraction
        Factor that the target was divided by.
    inequalities, equalities : tuple of Fraction
        Factors that the constraints were divided by.
    """

    statement: Statement
    scale: tuple[Fraction, ...]
    target: Fraction
    inequalities: tuple[Fraction, ...]
    equalities: tuple[Fraction, ...]

    def restore(self, proof: Proof) -> Proof:
        """Proof of the statement in u from one in ũ."""
        if isinstance(proof, Point):
            return Point(coordinates=tuple(s * x for s, x in zip(self.scale, proof.coordinates, strict=True)))
        if isinstance(proof, Functional):
            return Functional(values={e: v * monomial(self.scale, e) for e, v in proof.values.items()})
        return self.restored(proof)

    def restored(self, proof: SumOfSquares) -> SumOfSquares:
        """Sum of squares in u from one in ũ."""
        inverse = tuple(1 / s for s in self.scale)
        squares = tuple(_moved(s, inverse, self._factor(s)) for s in proof.squares)
        cofactors = tuple(
            {e: c * self.target / factor for e, c in rescaled(q, inverse).items()}
            for q, factor in zip(proof.cofactors, self.equalities, strict=True)
        )
        return SumOfSquares(squares=squares, cofactors=cofactors, multiplier=proof.multiplier)

    def square(self, square: Square) -> Square:
        """Square in ũ from one in u."""
        return _moved(square, self.scale, 1 / self._factor(square))

    def _factor(self, square: Square) -> Fraction:
        """What a Gram matrix in ũ is multiplied by in u."""
        return self.target / prod(self.inequalities[i] for i in square.product)


def _moved(square: Square, scale: Sequence[Fraction], factor: Fraction) -> Square:
    elements = [_rescaled(b, scale) for b in square.basis]
    sizes = [size for _, size in elements]
    pairs = (left * right for i, left in enumerate(factor * size for size in sizes) for right in sizes[i:])
    gram = tuple(q * size for q, size in zip(square.gram, pairs, strict=True))
    return Square(product=square.product, basis=tuple(b for b, _ in elements), gram=gram)


def _rescaled(basis_element: Element, scale: Sequence[Fraction]) -> tuple[Element, Fraction]:
    """Basis element in the other variables, and the factor that its rows of the Gram matrix take."""
    if isinstance(basis_element, tuple):
        return basis_element, monomial(scale, basis_element)
    polynomial = rescaled(basis_element, scale)
    lead = abs(next(iter(polynomial.values())))
    return {e: c / lead for e, c in polynomial.items()}, lead


def scaled(statement: Statement) -> Scaled:
    """Statement with coefficients of about one."""
    scale = _balance(statement)

    def normal(polynomial: Polynomial) -> tuple[dict[Exponents, Fraction], Fraction]:
        moved = rescaled(polynomial, scale)
        factor = max((abs(c) for c in moved.values()), default=Fraction(1))
        return {e: c / factor for e, c in moved.items()}, factor

    polynomial, multiplier = normal(statement.polynomial), normal(statement.multiplier)
    inequalities = [normal(g) for g in statement.inequalities]
    equalities = [normal(h) for h in statement.equalities]
    moved = replace(
        statement,
        polynomial=polynomial[0],
        multiplier=multiplier[0],
        inequalities=tuple(g for g, _ in inequalities),
        equalities=tuple(h for h, _ in equalities),
    )
    return Scaled(
        statement=moved,
        scale=scale,
        target=polynomial[1] * multiplier[1],
        inequalities=tuple(f for _, f in inequalities),
        equalities=tuple(f for _, f in equalities),
    )


def decimal_units(scale: Sequence[Fraction]) -> tuple[Fraction, ...]:
    """Scaled variables in units of a power of ten near their scale, where simple numbers are looked for."""
    return tuple(s / Fraction(10) ** round(_log2(s) / math.log2(10)) for s in scale)


def _log2(value: Fraction) -> float:
    return math.log2(value.numerator) - math.log2(value.denominator)


def _balance(statement: Statement) -> tuple[Fraction, ...]:
    """Powers of two that bring the coefficients of every polynomial as near to each other as they can."""
    size = len(statement.variables)
    rows, sides = [], []
    polynomials = (statement.polynomial, *statement.inequalities, *statement.equalities)
    for k, p in enumerate(polynomials):
        for e, c in p.items() if len(p) > 1 else ():
            level = [0.0] * len(polynomials)
            level[k] = -1.0
            rows.append([*e, *level])
            sides.append(-_log2(abs(c)))
    if not rows:
        return (Fraction(1),) * size
    solution, *_ = np.linalg.lstsq(np.array(rows, dtype=float), np.array(sides), rcond=1e-9)
    return tuple(Fraction(2) ** round(float(n)) for n in solution[:size])
