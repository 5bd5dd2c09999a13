"""Why the multiplier of a polynomial's proof is enough, in the words of ``proofs/rocq/positivity.v``."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from quakedesign.certificates.rocq.integers import IntegerWitness, clearing, denominator, in_integers
from quakedesign.errors import CertificateError
from quakedesign.sos.exact.polynomial import combination, constant
from quakedesign.sos.exact.squares import Square, integer_gram, is_definite
from quakedesign.sos.exact.statement import Statement


@dataclass(frozen=True, kw_only=True)
class Reason:
    """Why a multiplier μ, times its common denominator, is nowhere negative on the set.

    Attributes
    ----------
    sums : IntegerWitness, optional
        numerator · μ − rest as a sum of squares; without it the terms of μ show its sign.
    numerator, rest : int
    """

    sums: IntegerWitness | None = None
    numerator: int = 1
    rest: int = 0


def reason(asked: Statement, squares: Sequence[Square]) -> Reason:
    """Reason for the sign of a statement's multiplier.

    Parameters
    ----------
    asked : Statement
    squares : sequence of Square
        The multiplier as a sum of squares; empty where its terms show its sign.

    Raises
    ------
    CertificateError
        When its Gram matrix is not positive definite.
    """
    if not squares:
        return Reason()
    one = (0,) * len(asked.variables)
    strict = next((i for i, s in enumerate(squares) if not s.product and one in s.basis), None)
    if strict is None:
        return Reason(sums=_sums(asked, squares, Fraction(0)))
    margin, less = _less_one(squares[strict], squares[strict].basis.index(one))
    numerator = margin.denominator
    return Reason(
        sums=_sums(asked, [*squares[:strict], less, *squares[strict + 1 :]], margin),
        numerator=numerator,
        rest=int(margin * numerator * denominator(asked.multiplier)),
    )


def _less_one(square: Square, index: int) -> tuple[Fraction, Square]:
    """A number δ > 0 and the square less δ, of a basis that holds 1."""
    size = len(square.basis)
    place = index * size - index * (index - 1) // 2
    margin = square.gram[place]
    for _ in range(2000):
        margin /= 2
        less = replace(square, gram=(*square.gram[:place], square.gram[place] - margin, *square.gram[place + 1 :]))
        if is_definite(integer_gram(less)):
            return margin, less
    raise CertificateError("a Gram matrix of the multiplier must be positive definite. Received another.")


def _sums(asked: Statement, squares: Sequence[Square], margin: Fraction) -> IntegerWitness:
    """numerator · μ − rest = Σ squares, with μ times its common denominator."""
    factor = Fraction(margin.denominator * denominator(asked.multiplier))
    size = len(asked.variables)
    target = combination([(factor, asked.multiplier), (-factor * margin, constant(size))])
    scaled_squares = [replace(s, gram=tuple(factor * v for v in s.gram)) for s in squares]
    stated = replace(asked, polynomial=target, multiplier=constant(size), equalities=())
    return in_integers(stated, scaled_squares, (), clearing(asked))
