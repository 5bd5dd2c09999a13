"""Polynomials with a square factor."""

from dataclasses import replace
from typing import ClassVar

from quakedesign.sos.exact.polynomial import Polynomial, constant, degree, product, square_factor
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
        """See `Method.propose`; None as well where r has no sum of squares.

        A square in the multiplier may be what makes r one, so that the polynomial's own is tried alone as well.
        """
        count = len(asked.variables)
        whole = replace(asked, polynomial=asked.target, multiplier=constant(count))
        parts = {degree(root): (root, replace(part, polynomial=rest))
                 for part in (asked, whole) for root, rest in [square_factor(part.polynomial, count)]}  # fmt: skip
        proofs = (_multiplied(*parts[d], asked.degree - 2 * d) for d in sorted(parts, reverse=True) if d)
        return next((proof for proof in proofs if proof is not None), None)


def _multiplied(root: Polynomial, left: Statement, bound: int) -> SumOfSquares | None:
    """Proof of what is left beside root², up to a degree, times root²."""
    inner = decide(replace(left, degree=bound)).proof if bound >= 0 else None
    if not isinstance(inner, SumOfSquares):
        return None
    count = len(left.variables)
    squares = tuple(
        in_echelon_form(replace(s, basis=tuple(as_element(product(count, (root, as_polynomial(b)))) for b in s.basis)))
        for s in inner.squares
    )
    return SumOfSquares(squares=squares, cofactors=tuple(product(count, (root, root, q)) for q in inner.cofactors))
