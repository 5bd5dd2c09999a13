"""The command about plain polynomials."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from quakedesign.cli.options import PLAIN, Force, Output
from quakedesign.cli.shared import app, new_file
from quakedesign.errors import PolynomialError

Text = Annotated[str, Parameter(allow_leading_hyphen=True)]


@app.command
def sos(
    polynomial: Text | None = None,
    /,
    *,
    on: Annotated[tuple[str, ...], Parameter(allow_leading_hyphen=True, negative="")] = (),
    multiplier: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    margin: str = "0",
    degree: int | None = None,
    products: bool | None = None,
    gram: Path | None = None,
    verbose: Annotated[bool, Parameter(negative="")] = False,
    out: Path | None = None,
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Decide whether a polynomial is a sum of squares, with proof either way. Exit code 0 only if it is.

    Parameters
    ----------
    polynomial
        Such as "x^4*y^2 + x^2*y^4 + 1 - 3*x^2*y^2": numbers, names, + - * ^ ** and parentheses.
    on
        A constraint such as "x >= 0", "x^2 + y^2 <= 1" or "x + y == 1"; repeat for more. All of ℝⁿ unless given.
    multiplier
        Positive polynomial to multiply with, or auto to search one, and to try powers of 1 + x² + y² + … (x² + y² + …
        for forms).
    margin
        Decide polynomial − margin·(1 + Σ x_i^degree) instead (without the 1 for forms).
    degree
        Largest degree of a summand; the smallest that fits unless given, and the next even one under constraints.
    products
        Use all products of constraints, or none; unless given, products of variables only.
    gram
        Instead of a polynomial: a file, JSON or .mat, with a polynomial and a Gram matrix from another programme.
    verbose
        Show the sizes of the Gram matrices before and after the exact reduction.
    out
        File for the proof (proofs/FORMAT.md).
    """
    from quakedesign.sos import prove, read_gram
    from quakedesign.sos.exact.polynomial_files import plain_proof
    from quakedesign.sos.exact.words import sentences

    new_file(out, "proof file", force=force)
    asked = (polynomial, on, multiplier, margin, degree, products)
    if gram is not None and asked != (None, (), None, "0", None, None):
        raise PolynomialError("--gram is a file that says what is asked. Received more. Leave the rest out.")
    if gram is not None:
        answer = read_gram(gram).verify()
    elif polynomial is None:
        raise PolynomialError("sos needs a polynomial, or --gram FILE. Received neither. Give for example 'x^2 + 1'.")
    else:
        answer = prove(polynomial, on=on, multiplier=multiplier, margin=margin, degree_bound=degree, products=products)
    if out is not None and answer.proof is not None:
        answer.save(out)
    facts: dict[str, Any] = {
        "verdict": str(answer.verdict),
        "variables": list(answer.statement.variables),
        "degree": answer.statement.degree,
        "blocks": dict(answer.blocks),
        "witness": plain_proof(answer.proof) if answer.proof is not None else None,
        "file": str(out) if out is not None and answer.proof is not None else None,
        "remark": answer.remark or None,
        "empty_set": answer.set_is_empty,
        "seconds": answer.seconds,
        "versions": dict(answer.versions),
    }
    output.show(facts, sentences(answer, verbose=verbose))
    return 0 if facts["verdict"] == "sos" else 1
