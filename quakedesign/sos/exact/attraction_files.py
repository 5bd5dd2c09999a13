"""The file about a region of attraction (proofs/FORMAT.md): read strictly, written whole."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from quakedesign.errors import CertificateError, PolynomialError
from quakedesign.sos.exact.attraction import Attraction, LyapunovProof
from quakedesign.sos.exact.polynomial import constant
from quakedesign.sos.exact.polynomial_files import TERMS, plain_proof, read_proof, variables
from quakedesign.sos.exact.proofs import Point
from quakedesign.sos.exact.strict import (
    headed,
    listed,
    parse,
    polynomial_text,
    read_polynomial,
    read_rational,
    write_readable,
)

_CLAIM = {"variables", "field", "V", "level"}
_PROOF = {"multiplier", "positive", "decrease"}


def read(raw: Any) -> Attraction:
    """Claim and proof of a parsed file; reading verifies nothing.

    Raises
    ------
    CertificateError
        When it breaks a rule of FORMAT.md.
    """
    refuted = isinstance(raw, dict) and "negative" in raw
    headed(raw, _CLAIM | ({"negative"} if refuted else _PROOF), "attraction")
    names = variables(raw)
    size = len(names)
    field = listed(raw["field"], "field", length=size)
    level = listed(raw["level"], "level", 1)
    try:
        claim = Attraction(
            variables=names,
            field=tuple(read_polynomial(f, "field", size, TERMS) for f in field),
            lyapunov=read_polynomial(raw["V"], "V", size, TERMS),
            level=read_rational(level[0]) if level else None,
            multiplier=constant(size) if refuted else read_polynomial(raw["multiplier"], "multiplier", size, TERMS),
        )
        return _with_proof(claim, raw, refuted)
    except PolynomialError as error:
        raise CertificateError(str(error)) from None


def _with_proof(claim: Attraction, raw: dict[str, Any], refuted: bool) -> Attraction:
    if refuted:
        return replace(claim, proof=read_proof(raw["negative"], "negative", claim.positive))
    found = [read_proof(raw[part], "sos", getattr(claim, part)) for part in ("positive", "decrease")]
    return replace(claim, proof=LyapunovProof(positive=found[0], decrease=found[1]))


def load(text: str) -> Attraction:
    """Claim and proof of the text of a file. Raises CertificateError as `read`."""
    return read(parse(text))


def text(claim: Attraction) -> str:
    """Text of the file, the same for the same proof.

    Raises
    ------
    CertificateError
        When there is no proof.
    """
    proof = claim.proof
    if proof is None:
        raise CertificateError("only a proof can be saved. Received an undecided answer.")
    plain: dict[str, Any] = {
        "format": 1,
        "kind": "attraction",
        "variables": list(claim.variables),
        "field": [polynomial_text(f) for f in claim.field],
        "V": polynomial_text(claim.lyapunov),
        "level": [] if claim.level is None else [str(claim.level)],
    }
    if isinstance(proof, Point):
        plain |= plain_proof(proof)
    else:
        plain["multiplier"] = polynomial_text(claim.multiplier)
        plain |= {part: plain_proof(getattr(proof, part))["sos"] for part in ("positive", "decrease")}
    return json.dumps(plain, ensure_ascii=True, separators=(",", ":")) + "\n"


def save_attraction(claim: Attraction, path: str | Path) -> None:
    """Write the file whole or not at all, and only if it can be read again.

    Raises
    ------
    CertificateError
        When there is no proof, or it is beyond the limits of the format.
    OutputError
        When the folder cannot be written.
    """
    write_readable(path, text(claim), load)
