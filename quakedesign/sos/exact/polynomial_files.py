"""The file about one polynomial (proofs/FORMAT.md): read strictly, written whole."""

import json
from pathlib import Path
from typing import Any

from quakedesign.errors import CertificateError, PolynomialError
from quakedesign.sos.exact.polynomial_statement import Statement
from quakedesign.sos.exact.proofs import Element, Functional, Point, Proof, Square, SumOfSquares
from quakedesign.sos.exact.strict import (
    common_grid,
    headed,
    listed,
    need,
    parse,
    polynomial_text,
    read_exponents,
    read_names,
    read_polynomial,
    read_row,
    texts,
    with_keys,
    write_readable,
)

_STATEMENT = {"variables", "polynomial", "inequalities", "equalities", "products", "degree", "multiplier"}
_KINDS = ("sos", "not-sos", "negative")
TERMS, _VARIABLES, _CONSTRAINTS, _PRODUCTS, _BASIS, _SQUARES = 20_000, 16, 32, 1024, 400, 4096


def read(raw: Any) -> tuple[Statement, Proof]:
    """Statement and proof of a parsed file; reading verifies nothing.

    Raises
    ------
    CertificateError
        When it breaks a rule of FORMAT.md.
    """
    kind = next((k for k in _KINDS if isinstance(raw, dict) and k in raw), "sos")
    with_keys(headed(raw), _STATEMENT | {kind})
    asked = _statement(raw, variables(raw))
    return asked, read_proof(raw[kind], kind, asked)


def variables(raw: dict[str, Any]) -> tuple[str, ...]:
    """Variables of a file."""
    names = read_names(raw["variables"], "variables", _VARIABLES)
    need(names != (), "variables must be names")
    return names


def load(text: str) -> tuple[Statement, Proof]:
    """Statement and proof of the text of a file. Raises CertificateError as `read`."""
    return read(parse(text))


def _statement(raw: dict[str, Any], names: tuple[str, ...]) -> Statement:
    size = len(names)

    def polynomials(key: str) -> Any:
        return tuple(read_polynomial(p, key, size, TERMS) for p in listed(raw[key], key, _CONSTRAINTS))

    products = [listed(s, "a product", _CONSTRAINTS) for s in listed(raw["products"], "products", _PRODUCTS)]
    need(all(type(i) is int for s in products for i in s), "products must be lists of integers")
    need(type(raw["degree"]) is int and raw["degree"] >= 0, "degree must be a non-negative integer")
    inequalities, equalities = polynomials("inequalities"), polynomials("equalities")
    need(len(inequalities) + len(equalities) <= _CONSTRAINTS, f"there are more than {_CONSTRAINTS} constraints")
    try:
        return Statement(
            variables=names,
            polynomial=read_polynomial(raw["polynomial"], "polynomial", size, TERMS),
            inequalities=inequalities,
            equalities=equalities,
            products=tuple(tuple(s) for s in products),
            degree=raw["degree"],
            multiplier=read_polynomial(raw["multiplier"], "multiplier", size, TERMS),
        )
    except PolynomialError as error:
        raise CertificateError(str(error)) from None


def read_proof(raw: Any, kind: str, asked: Statement) -> Any:
    """Proof of a kind, as it stands under it."""
    size = len(asked.variables)
    if kind == "negative":
        return Point(coordinates=read_row(with_keys(raw, {"point"})["point"], "point", length=size))
    if kind == "not-sos":
        values = with_keys(raw, {"functional"})["functional"]
        return Functional(values=read_polynomial(values, "functional", size, TERMS))
    with_keys(raw, {"squares", "cofactors", "multiplier"})
    cofactors = listed(raw["cofactors"], "cofactors", length=len(asked.equalities))
    return SumOfSquares(
        squares=_squares(raw["squares"], asked),
        cofactors=tuple(read_polynomial(q, "a cofactor", size, TERMS) for q in cofactors),
        multiplier=_squares(raw["multiplier"], asked),
    )


def _squares(raw: Any, asked: Statement) -> tuple[Square, ...]:
    return tuple(_square(entry, asked) for entry in listed(raw, "squares", _SQUARES))


def _square(raw: Any, asked: Statement) -> Square:
    with_keys(raw, {"product", "basis", "gram"})
    chosen = tuple(listed(raw["product"], "a product", _CONSTRAINTS))
    need(all(type(i) is int for i in chosen) and chosen in asked.products, "a square has a product that is not listed")
    basis = tuple(_element(b, len(asked.variables)) for b in listed(raw["basis"], "basis", _BASIS))
    need(basis != (), "a basis must not be empty")
    size = len(basis)
    gram = read_row(raw["gram"], "gram", length=size * (size + 1) // 2)
    common_grid(gram)
    monomials = [b for b in basis if isinstance(b, tuple)]
    need(len(set(monomials)) == len(monomials), "a monomial occurs twice in a basis")
    return Square(product=chosen, basis=basis, gram=gram)


def _element(raw: Any, variables: int) -> Element:
    if isinstance(raw, list):
        return read_exponents(raw, variables, 999)
    polynomial = read_polynomial(raw, "a basis element", variables, TERMS)
    need(polynomial != {} and (len(polynomial) > 1 or 1 not in polynomial.values()), "a basis element is not canonical")
    return polynomial


def text(asked: Statement, proof: Proof) -> str:
    """Text of the file, the same for the same proof."""
    plain = {
        "format": 1,
        "variables": list(asked.variables),
        "polynomial": polynomial_text(asked.polynomial),
        "inequalities": [polynomial_text(g) for g in asked.inequalities],
        "equalities": [polynomial_text(h) for h in asked.equalities],
        "products": [list(s) for s in asked.products],
        "degree": asked.degree,
        "multiplier": polynomial_text(asked.multiplier),
    }
    return json.dumps(plain | plain_proof(proof), ensure_ascii=True, separators=(",", ":")) + "\n"


def plain_proof(proof: Proof) -> dict[str, Any]:
    """Proof in the words of the format, under its kind."""
    if isinstance(proof, Point):
        return {"negative": {"point": texts(proof.coordinates)}}
    if isinstance(proof, Functional):
        return {"not-sos": {"functional": polynomial_text(proof.values)}}
    parts = {
        "squares": [_plain_square(s) for s in proof.squares],
        "cofactors": [polynomial_text(q) for q in proof.cofactors],
        "multiplier": [_plain_square(s) for s in proof.multiplier],
    }
    return {"sos": parts}


def _plain_square(square: Square) -> dict[str, Any]:
    basis = [list(b) if isinstance(b, tuple) else polynomial_text(b) for b in square.basis]
    return {"product": list(square.product), "basis": basis, "gram": texts(square.gram)}


def save(asked: Statement, proof: Proof | None, path: str | Path) -> None:
    """Write the file whole or not at all, and only if it can be read again.

    Raises
    ------
    CertificateError
        When there is no proof, or it is beyond the limits of the format.
    OutputError
        When the folder cannot be written.
    """
    if proof is None:
        raise CertificateError("only a proof can be saved. Received an undecided answer.")
    write_readable(path, text(asked, proof), load)
