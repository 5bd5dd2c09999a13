"""Polynomials with a square factor."""

from dataclasses import replace
from typing import ClassVar

from quakedesign.sos.exact.polynomial import constant, degree, product, square_factor
from quakedesign.sos.exact.proofs import SumOfSquares
from quakedesign.sos.exact.squares import as_element, as_polynomial, in_echelon_form
from quakedesign.sos.exact.statement import Statement
from quakedesign.sos.solve.engine import decide
from quakedesign.sos.solve.methods.base import Method


class SquareFactor(Method):
    """Proof for s²·r from one for r."""

    name: ClassVar[str] = "square-factor"
    order: ClassVar[int] = 1

    def propose(self, asked: Statement) -> SumOfSquares | None:
        """See `Method.propose`; None as well where r has no sum of squares."""
        root, rest = square_factor(asked.target, len(asked.variables))
        size = degree(root)
        if not size or 2 * size > asked.degree:
            return None
        one = constant(len(asked.variables))
        inner = decide(replace(asked, polynomial=rest, multiplier=one, degree=asked.degree - 2 * size)).proof
        if not isinstance(inner, SumOfSquares):
            return None
        count = len(asked.variables)
        squares = tuple(
            in_echelon_form(
                replace(s, basis=tuple(as_element(product(count, (root, as_polynomial(b)))) for b in s.basis))
            )
            for s in inner.squares
        )
        cofactors = tuple(product(count, (root, root, q)) for q in inner.cofactors)
        return SumOfSquares(squares=squares, cofactors=cofactors)
