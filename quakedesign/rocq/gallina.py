"""Certificates as Gallina terms for the checker in proofs/rocq.

Chapters: identity of a witness with integer coefficients; proof that a multiplier is non-negative (positivity.v);
integers, rationals and polynomials as terms of Gallina, the language of Rocq.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import lcm

from quakedesign.errors import CertificateError
from quakedesign.sos.exact.polynomial import Exponents, Polynomial, combination, constant
from quakedesign.sos.exact.polynomial_statement import Statement
from quakedesign.sos.exact.proofs import Square, as_polynomial, integer_gram, is_definite

# ----------------------------------------------------------------------
# The identity of a witness in integers, in the form of the checker in ``proofs/rocq``.

Triangle = list[list[int]]
"""Upper triangle of a symmetric matrix, row by row."""


@dataclass(frozen=True, kw_only=True)
class IntegerSquare:
    """(Π g_i)·bᵀQb with integer coefficients."""

    product: tuple[int, ...]
    basis: tuple[Polynomial, ...]
    gram: Triangle


@dataclass(frozen=True, kw_only=True)
class IntegerWitness:
    """left · multiplier · P = right · (Σ (Π g_i)·bᵀQb + Σ q_k h_k), all in integers.

    P, g_i and h_k are those of the statement, each times `clearing`, their common denominator.
    """

    clearing: int
    left: int
    right: int
    multiplier: Polynomial
    squares: tuple[IntegerSquare, ...]
    cofactors: tuple[Polynomial, ...]


def denominator(polynomial: Polynomial) -> int:
    """Common denominator of the coefficients."""
    return lcm(1, *(c.denominator for c in polynomial.values()))


def clearing(statement: Statement) -> int:
    """Common denominator of the polynomial, the inequalities and the equalities."""
    return lcm(*map(denominator, (statement.polynomial, *statement.inequalities, *statement.equalities)))


def in_integers(
    statement: Statement, squares: Sequence[Square], cofactors: Sequence[Polynomial], constraints: int | None = None
) -> IntegerWitness:
    """Witness of the statement multiplier · polynomial = Σ squares + Σ cofactors · equalities, in integers.

    Parameters
    ----------
    constraints : int, optional
        Factor that clears the denominators of the constraints; if given, the polynomial must have integer coefficients
        and is not scaled. By default the common denominator of the polynomial and its constraints.
    """
    common = clearing(statement) if constraints is None else constraints
    grams = [_cleared_gram(square, common) for square in squares]
    shares = [scaled(q, Fraction(1, common)) for q in cofactors]
    scale = lcm(1, *(v.denominator for rows in grams for row in rows for v in row), *map(denominator, shares))
    factor = denominator(statement.multiplier)
    ratio = Fraction(scale, factor * (common if constraints is None else 1))
    return IntegerWitness(
        clearing=common,
        left=ratio.numerator,
        right=ratio.denominator,
        multiplier=scaled(statement.multiplier, factor),
        squares=tuple(_square(square, rows, scale) for square, rows in zip(squares, grams, strict=True)),
        cofactors=tuple(scaled(q, scale) for q in shares),
    )


def scaled(polynomial: Polynomial, factor: int | Fraction) -> Polynomial:
    """Product of a polynomial and a number."""
    return {e: c * factor for e, c in polynomial.items()}


def _cleared_gram(square: Square, common: int) -> list[list[Fraction]]:
    """Gram matrix for constraints scaled by a number and a basis scaled by its denominators."""
    weight = common ** len(square.product)
    basis = [denominator(as_polynomial(b)) for b in square.basis]
    entries = iter(square.gram)
    return [[next(entries) / (weight * basis[i] * basis[j]) for j in range(i, len(basis))] for i in range(len(basis))]


def _square(square: Square, rows: Iterable[Iterable[Fraction]], common: int) -> IntegerSquare:
    gram = [[int(v * common) for v in row] for row in rows]
    basis = (as_polynomial(b) for b in square.basis)
    return IntegerSquare(product=square.product, basis=tuple(scaled(b, denominator(b)) for b in basis), gram=gram)


# ----------------------------------------------------------------------
# Proof that the multiplier of a polynomial's proof suffices, in terms of ``proofs/rocq/positivity.v``.


@dataclass(frozen=True, kw_only=True)
class Reason:
    """Proof that a multiplier μ, scaled to integer coefficients, is nowhere negative on the set of the statement."""

    # numerator · μ − rest as a sum of squares, rest ≥ 0; None if the sign follows from the terms of μ
    sums: IntegerWitness | None = None
    numerator: int = 1
    rest: int = 0


def multiplier_reason(statement: Statement, squares: Sequence[Square]) -> Reason:
    """Proof of the sign of a statement's multiplier.

    Parameters
    ----------
    squares : sequence of Square
        The multiplier as a sum of squares; empty if the sign follows from its terms.

    Raises
    ------
    CertificateError
        If the Gram matrix of the multiplier is not positive definite.
    """
    if not squares:
        return Reason()
    one = (0,) * len(statement.variables)
    strict = next((i for i, s in enumerate(squares) if not s.product and one in s.basis), None)
    if strict is None:
        return Reason(sums=_sums(statement, squares, Fraction(0)))
    margin, less = _minus_margin(squares[strict], squares[strict].basis.index(one))
    numerator = margin.denominator
    return Reason(
        sums=_sums(statement, [*squares[:strict], less, *squares[strict + 1 :]], margin),
        numerator=numerator,
        rest=int(margin * numerator * denominator(statement.multiplier)),
    )


def _minus_margin(square: Square, index: int) -> tuple[Fraction, Square]:
    """A number δ > 0 and the square minus δ, for a basis that contains 1."""
    size = len(square.basis)
    place = index * size - index * (index - 1) // 2
    margin = square.gram[place]
    for _ in range(2000):
        margin /= 2
        less = replace(square, gram=(*square.gram[:place], square.gram[place] - margin, *square.gram[place + 1 :]))
        if is_definite(integer_gram(less)):
            return margin, less
    raise CertificateError(
        f"the Gram matrix of the multiplier must be positive definite. Received a {size} x {size} matrix that is not."
    )


def _sums(statement: Statement, squares: Sequence[Square], margin: Fraction) -> IntegerWitness:
    """numerator · μ − rest = Σ squares, with μ times its common denominator."""
    factor = Fraction(margin.denominator * denominator(statement.multiplier))
    size = len(statement.variables)
    target = combination([(factor, statement.multiplier), (-factor * margin, constant(size))])
    scaled_squares = [replace(s, gram=tuple(factor * v for v in s.gram)) for s in squares]
    stated = replace(statement, polynomial=target, multiplier=constant(size), equalities=())
    return in_integers(stated, scaled_squares, (), clearing(statement))


# ----------------------------------------------------------------------
# Values as terms of Gallina, the language of Rocq.


def listed(entries: Iterable[str], joint: str = "; ") -> str:
    """List of Gallina terms."""
    return f"[{joint.join(entries)}]"


def integer(number: int) -> str:
    """Integer as a literal; from ten digits on hexadecimal, which coqc reads in half the time."""
    short = abs(number) < 10**9
    text = str(abs(number)) if short else hex(abs(number))
    return f"-{text}" if number < 0 else text


def rational(number: Fraction) -> str:
    """Rational as a literal of Q in lowest terms."""
    return f"({number.numerator} # {number.denominator})" if number else "0%Q"


def exponents(powers: Exponents) -> str:
    """Exponents as a list of nat."""
    return listed(map(str, powers), ";")


def polynomial(given: Polynomial) -> str:
    """Polynomial with rational coefficients as a list of terms with coefficient and exponents."""
    return listed(f"term {rational(c)} {exponents(e)}" for e, c in sorted(given.items(), reverse=True))


def tree(given: Polynomial) -> str:
    """Polynomial with integer coefficients as a tree of powers, monomials and sums."""
    if list(given.values()) == [1]:
        return f"power {exponents(next(iter(given)))}"
    return "sum " + listed(
        f"monomial ({integer(int(c))}) {exponents(e)}" for e, c in sorted(given.items(), reverse=True)
    )


def witness(given: IntegerWitness) -> str:
    """Witness as a record of ``squares.v``."""
    squares = listed(map(_square_term, given.squares), ";\n    ")
    parts = given.clearing, given.left, given.right, f"({tree(given.multiplier)})"
    return f"Witness {' '.join(map(str, parts))}\n   {squares}\n   {listed(map(tree, given.cofactors))}"


def _square_term(given: IntegerSquare) -> str:
    rows = listed((listed(map(integer, row), ";") for row in given.gram), ";\n      ") + "%Z"
    product, basis = exponents(given.product), listed(map(tree, given.basis))
    return f"Square {product} {basis}\n      {rows}"


def question(statement: Statement) -> str:
    """Polynomial, inequalities and equalities of a statement as a Gallina record."""
    inequalities, equalities = (
        listed(map(polynomial, given), ";\n   ") for given in (statement.inequalities, statement.equalities)
    )
    return f"Question\n  {polynomial(statement.polynomial)}\n  {inequalities}\n  {equalities}"


def reason(given: Reason) -> str:
    """Gallina term for the proof that the multiplier is nowhere negative."""
    if given.sums is None:
        return "Terms"
    if not given.rest:
        return f"Dense ({witness(given.sums)})"
    return f"Sums {given.numerator} {given.rest} ({witness(given.sums)})"


def accepted(check: str, name: str = "accepted") -> str:
    """Lemma that a check returns true, proved by computation."""
    return f"Lemma {name} : {check} = true.\nProof. vm_cast_no_check (eq_refl true). Qed."
