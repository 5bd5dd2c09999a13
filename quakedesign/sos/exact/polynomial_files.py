"""Files of a statement about one polynomial (proofs/FORMAT.md): strict reading, and writing."""

import json
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from quakedesign.errors import CertificateError, PolynomialError
from quakedesign.files import Json
from quakedesign.sos.exact.polynomial_statement import Statement
from quakedesign.sos.exact.proofs import Functional, Point, Proof, Square, SumOfSquares
from quakedesign.sos.exact.strict import (
    Entries,
    Name,
    PolynomialEntries,
    common_grid,
    headed,
    made,
    need,
    parse,
    polynomial_text,
    read_as,
    read_polynomial,
    require_polynomial,
    write_readable,
    written,
)

TERMS, _VARIABLES, _CONSTRAINTS, _PRODUCTS, _BASIS, _SQUARES = 20_000, 16, 32, 1024, 400, 4096
Names = Annotated[tuple[Name, ...], Meta(min_length=1, max_length=_VARIABLES)]
Product = Annotated[tuple[int, ...], Meta(max_length=_CONSTRAINTS)]
Polynomials = Annotated[tuple[PolynomialEntries, ...], Meta(max_length=_CONSTRAINTS)]


class GramEntries(Entries):
    """A square: product of inequalities, basis of monomials or polynomials, and Gram matrix."""

    product: Product
    basis: Annotated[tuple[tuple[int, ...] | dict[str, str], ...], Meta(min_length=1, max_length=_BASIS)]
    gram: tuple[Fraction, ...]

    def square(self, statement: Statement) -> Square:
        """Square; its sizes must match the statement."""
        need(self.product in statement.products, "the product of a square is not among the products of the statement")
        n, size = len(statement.variables), len(self.basis)
        basis = tuple(entry if isinstance(entry, tuple) else read_polynomial(entry) for entry in self.basis)
        monomials = [element for element in basis if isinstance(element, tuple)]
        need(len(set(monomials)) == len(monomials), "a monomial occurs twice in a basis")
        for element in basis:
            if isinstance(element, tuple):
                sound = len(element) == n and all(0 <= power <= 999 for power in element)
                need(sound, f"a monomial must be {n} exponents from 0 to 999")
            else:
                require_polynomial(element, "a basis element", n, TERMS)
                canonical = element != {} and (len(element) > 1 or 1 not in element.values())
                need(canonical, "a basis element is not canonical")
        need(len(self.gram) == size * (size + 1) // 2, "gram must have an entry for each pair of the basis")
        common_grid(self.gram)
        return Square(product=self.product, basis=basis, gram=self.gram)


Squares = Annotated[tuple[GramEntries, ...], Meta(max_length=_SQUARES)]


class SosEntries(Entries):
    """A sum of squares with cofactors of equalities and a multiplier."""

    squares: Squares
    cofactors: tuple[PolynomialEntries, ...]
    multiplier: Squares

    def proof(self, statement: Statement) -> SumOfSquares:
        """Proof; its sizes must match the statement."""
        need(len(self.cofactors) == len(statement.equalities), "there must be a cofactor for each equality")
        for cofactor in self.cofactors:
            require_polynomial(cofactor, "a cofactor", len(statement.variables), TERMS)
        return SumOfSquares(
            squares=tuple(entry.square(statement) for entry in self.squares),
            cofactors=tuple(map(dict, self.cofactors)),
            multiplier=tuple(entry.square(statement) for entry in self.multiplier),
        )


class PointEntries(Entries):
    """A point."""

    point: tuple[Fraction, ...]

    def proof(self, variables: int) -> Point:
        """Point; it must have a coordinate for each variable."""
        need(len(self.point) == variables, f"point must have {variables} coordinates")
        return Point(coordinates=self.point)


class FunctionalEntries(Entries):
    """A linear functional on polynomials."""

    functional: PolynomialEntries


class StatementEntries(Entries):
    """Statement about a polynomial: constraints, products of inequalities, degree and multiplier."""

    variables: Names
    polynomial: PolynomialEntries
    inequalities: Polynomials
    equalities: Polynomials
    products: Annotated[tuple[Product, ...], Meta(max_length=_PRODUCTS)]
    degree: Annotated[int, Meta(ge=0)]
    multiplier: PolynomialEntries

    def statement(self) -> Statement:
        """Statement; its polynomials must be in its variables."""
        every = (self.polynomial, self.multiplier, *self.inequalities, *self.equalities)
        for polynomial in every:
            require_polynomial(polynomial, "a polynomial", len(self.variables), TERMS)
        few = len(self.inequalities) + len(self.equalities) <= _CONSTRAINTS
        need(few, f"there are more than {_CONSTRAINTS} constraints")
        plain = {name: dict(getattr(self, name)) for name in ("polynomial", "multiplier")}
        lists = {name: tuple(map(dict, getattr(self, name))) for name in ("inequalities", "equalities")}
        try:
            return made(Statement, self, **plain, **lists)
        except PolynomialError as error:
            raise CertificateError(str(error)) from None


class SosFile(StatementEntries, rename={"proof": "sos"}):
    """File of a polynomial with its proof as a sum of squares."""

    proof: SosEntries


class NoSosFile(StatementEntries, rename={"proof": "not-sos"}):
    """File of a polynomial that is not a sum of squares with the given products."""

    proof: FunctionalEntries


class NegativeFile(StatementEntries, rename={"proof": "negative"}):
    """File of a polynomial that is negative at a point."""

    proof: PointEntries


def read(raw: Any) -> tuple[Statement, Proof]:
    """Statement and proof of a parsed file, which are not checked.

    Raises
    ------
    CertificateError
        When the file breaks a rule of FORMAT.md.
    """
    entries = headed(raw)
    if "negative" in entries:
        negative = read_as(NegativeFile, entries)
        return negative.statement(), negative.proof.proof(len(negative.variables))
    if "not-sos" in entries:
        refuted = read_as(NoSosFile, entries)
        require_polynomial(refuted.proof.functional, "functional", len(refuted.variables), TERMS)
        return refuted.statement(), Functional(values=dict(refuted.proof.functional))
    file = read_as(SosFile, entries)
    statement = file.statement()
    return statement, file.proof.proof(statement)


def load(text: str) -> tuple[Statement, Proof]:
    """Statement and proof of the text of a file. Raises CertificateError as `read`."""
    return read(parse(text))


def text(statement: Statement, proof: Proof) -> str:
    """Text of the file, reproducible for a given proof."""
    plain: Json = {name: PolynomialEntries(getattr(statement, name)) for name in ("polynomial", "multiplier")}
    plain |= {name: tuple(map(PolynomialEntries, getattr(statement, name))) for name in ("inequalities", "equalities")}
    file = {"format": 1} | written(made(StatementEntries, statement, **plain)) | proof_entries(proof)
    return json.dumps(file, ensure_ascii=True, separators=(",", ":")) + "\n"


def proof_entries(proof: Proof) -> Json:
    """Entries of a proof under the key of its kind."""
    match proof:
        case Point():
            return {"negative": written(PointEntries(proof.coordinates))}
        case Functional():
            return {"not-sos": written(FunctionalEntries(PolynomialEntries(proof.values)))}
    squares, multiplier = (
        tuple(
            made(GramEntries, one, basis=tuple(b if isinstance(b, tuple) else polynomial_text(b) for b in one.basis))
            for one in part
        )
        for part in (proof.squares, proof.multiplier)
    )
    cofactors = tuple(map(PolynomialEntries, proof.cofactors))
    return {"sos": written(SosEntries(squares=squares, cofactors=cofactors, multiplier=multiplier))}


def save(statement: Statement, proof: Proof | None, path: str | Path) -> None:
    """Write the file atomically, and only if it can be read back.

    Raises
    ------
    CertificateError
        When there is no proof, or it exceeds the limits of the format.
    OutputError
        When the folder is not writable.
    """
    if proof is None:
        raise CertificateError("only a proof can be saved. Received an undecided answer.")
    write_readable(path, text(statement, proof), load)
