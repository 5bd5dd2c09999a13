"""The certificate file (proofs/FORMAT.md): read strictly, written whole."""

import json
import re
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

from quakedesign.certificates.claim import Certificate, Equilibrium, Loop
from quakedesign.errors import CertificateError
from quakedesign.output import write_whole
from quakedesign.sos import Block, Witness
from quakedesign.sos.exact.strict import (
    LARGEST_FILE,
    NAME,
    common_grid,
    listed,
    need,
    objected,
    parse,
    polynomial_text,
    read_exponents,
    read_polynomial,
    read_rational,
    read_rationals,
    with_keys,
)
from quakedesign.symbolic.terms import Term

_LAW = re.compile(r"[A-Za-z0-9_-]{1,40}")
_LIMITS = {"states": 6, "uncertain": 8, "parameters": 64, "terms": 200, "basis": 200, "witnesses": 4096}


def load_certificate(path: str | Path) -> Certificate:
    """Read a certificate file; reading verifies nothing.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Certificate

    Raises
    ------
    CertificateError
        When the file cannot be read or breaks a rule of FORMAT.md.
    """
    return certificate_of(read_json(path))


def read_json(path: str | Path) -> Any:
    """JSON value of a file of bounded size.

    Raises
    ------
    CertificateError
        When it cannot be read, or is no strict JSON.
    """
    try:
        if Path(path).stat().st_size > LARGEST_FILE:
            raise CertificateError(f"{path}: a certificate must be at most 4 MiB.")
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not UTF-8 text"
        raise CertificateError(f"certificate cannot be read: {path}: {reason}.") from None
    return parse(text)


def parse_certificate(text: str) -> Certificate:
    """Certificate from the text of a file. Raises CertificateError as `load_certificate`."""
    return certificate_of(parse(text))


def certificate_of(raw: Any) -> Certificate:
    """Certificate from a parsed file. Raises CertificateError as `load_certificate`."""
    return _certificate(with_keys(raw, _PROOF if isinstance(raw, dict) and "refutation" not in raw else _REFUTATION))


_COMMON = {"format", "law", "gains", "constants", "states", "domain", "uncertain", "field"}
_PROOF = _COMMON | {"V", "claims", "witnesses"}
_REFUTATION = _COMMON | {"refutation"}


def _certificate(raw: dict[str, Any]) -> Certificate:
    need(type(raw["format"]) is int and raw["format"] == 1, "format must be 1")
    loop = _loop(raw)
    if "refutation" in raw:
        return Certificate(loop=loop, refutation=_equilibrium(raw["refutation"]))
    witnesses: dict[str, Witness] = {}
    for entry in listed(raw["witnesses"], "witnesses", _LIMITS["witnesses"]):
        name = with_keys(entry, {"obligation", "multiplier", "squares"})["obligation"]
        need(isinstance(name, str) and name not in witnesses, "an obligation must be named once, by a text")
        witnesses[name] = _witness(entry, len(loop.states))
    return Certificate(
        loop=loop,
        lyapunov=_terms(raw["V"], loop),
        claims=read_rationals(raw["claims"], "claims", 2 + _LIMITS["states"]),
        witnesses=witnesses,
    )


def _loop(raw: dict[str, Any]) -> Loop:
    need(isinstance(raw["law"], str) and _LAW.fullmatch(raw["law"]) is not None, "law must be a short name")
    need(raw["domain"] in ("cells", "reals"), "domain must be cells or reals")
    gains = read_rationals(raw["gains"], "gains", _LIMITS["parameters"])
    constants = read_rationals(raw["constants"], "constants", _LIMITS["parameters"])
    states = objected(raw["states"], "states", _LIMITS["states"])
    uncertain = objected(raw["uncertain"], "uncertain", _LIMITS["uncertain"])
    names = [*gains, *constants, *states, *uncertain]
    need(len(set(names)) == len(names) and len(gains) + len(constants) <= _LIMITS["parameters"], "names must differ")
    need(all(NAME.fullmatch(n) for n in names) and states != {}, "states and uncertain need names")
    top = 12 if raw["domain"] == "cells" else 1
    need(all(type(w) is int and 1 <= w <= top for w in states.values()), f"weights must be integers from 1 to {top}")
    ranges: dict[str, tuple[Fraction, Fraction]] = {}
    for name, ends in uncertain.items():
        low, high = (read_rational(v) for v in listed(ends, "a range", length=2))
        need(low <= high, f"the range of {name} is not ordered")
        ranges[name] = (low, high)
    bare = Loop(
        law=raw["law"],
        gains=gains,
        constants=constants,
        states=states,
        domain=raw["domain"],
        uncertain=ranges,
        field={},
    )
    rates = with_keys(raw["field"], set(states))
    field = {state: _terms(rates[state], bare) for state in states}
    return Loop(**{**{f: getattr(bare, f) for f in bare.__slots__}, "field": field})


def _terms(raw: Any, loop: Loop) -> tuple[Term, ...]:
    return tuple(_term(entry, loop) for entry in listed(raw, "terms", _LIMITS["terms"]))


def _term(raw: Any, loop: Loop) -> Term:
    number, names, powers = listed(raw, "a term", length=3)
    coefficient = read_rational(number)
    need(coefficient != 0, "a term must not be zero")
    known = {*loop.gains, *loop.constants, *loop.uncertain}
    parameters = tuple(listed(names, "parameters", 32))
    need(all(isinstance(n, str) and n in known for n in parameters), "a term has an unknown parameter")
    factors = tuple(_factor(entry, loop) for entry in listed(powers, "factors", _LIMITS["states"]))
    need(len({f[0] for f in factors}) == len(factors), "a state occurs twice in a term")
    return Term(coefficient, parameters, factors)


def _factor(raw: Any, loop: Loop) -> tuple[str, Fraction, str]:
    state, exponent, kind = listed(raw, "a factor", length=3)
    power = read_rational(exponent)
    need(isinstance(state, str) and state in loop.states, "a factor has an unknown state")
    need(
        kind in ("s", "a") and 0 <= power <= 24 and (kind == "s" or power > 0), "a factor has a wrong kind or exponent"
    )
    return state, power, kind


def _witness(raw: dict[str, Any], variables: int) -> Witness:
    multiplier = read_polynomial(raw["multiplier"], "multiplier", variables, _LIMITS["basis"])
    blocks = []
    for entry in listed(raw["squares"], "squares", 1 << variables):
        block = with_keys(entry, {"times", "basis", "gram"})
        gram = [read_rational(v) for v in listed(block["gram"], "gram")]
        common_grid(gram)
        basis = listed(block["basis"], "basis", _LIMITS["basis"])
        size = len(basis)
        blocks.append(
            Block(
                times=read_exponents(block["times"], variables, 1),
                basis=tuple(read_exponents(b, variables, 999) for b in basis),
                gram=tuple(listed(gram, "gram", length=size * (size + 1) // 2)),
            )
        )
    return Witness(multiplier=multiplier, blocks=tuple(blocks))


def _equilibrium(raw: Any) -> Equilibrium:
    entries = with_keys(raw, {"parameters", "point", "weights"})
    weights = objected(entries["weights"], "weights", 64)
    return Equilibrium(
        parameters=read_rationals(entries["parameters"], "parameters", _LIMITS["uncertain"]),
        point=read_rationals(entries["point"], "point", _LIMITS["states"]),
        weights={cell: read_rational(w) for cell, w in weights.items()},
    )


def certificate_text(certificate: Certificate) -> str:
    """Text of the file, the same for the same certificate."""
    return json.dumps(_plain(certificate), ensure_ascii=True, separators=(",", ":"), indent=None) + "\n"


def _texts(values: Mapping[str, Fraction]) -> dict[str, str]:
    return {name: str(v) for name, v in values.items()}


def _plain_terms(terms: tuple[Term, ...]) -> list[Any]:
    return [[str(t.coefficient), list(t.parameters), [[s, str(e), k] for s, e, k in t.factors]] for t in terms]


def _plain(certificate: Certificate) -> dict[str, Any]:
    loop = certificate.loop
    plain: dict[str, Any] = {
        "format": 1,
        "law": loop.law,
        "gains": _texts(loop.gains),
        "constants": _texts(loop.constants),
        "states": dict(loop.states),
        "domain": loop.domain,
        "uncertain": {name: [str(low), str(high)] for name, (low, high) in loop.uncertain.items()},
        "field": {state: _plain_terms(terms) for state, terms in loop.field.items()},
    }
    if certificate.refutation is not None:
        found = certificate.refutation
        parts = {"parameters": found.parameters, "point": found.point, "weights": found.weights}
        return plain | {"refutation": {key: _texts(values) for key, values in parts.items()}}
    return plain | {
        "V": _plain_terms(certificate.lyapunov),
        "claims": _texts(certificate.claims),
        "witnesses": [
            {
                "obligation": name,
                "multiplier": polynomial_text(witness.multiplier),
                "squares": [
                    {"times": list(b.times), "basis": [list(v) for v in b.basis], "gram": [str(v) for v in b.gram]}
                    for b in witness.blocks
                ],
            }
            for name, witness in certificate.witnesses.items()
        ],
    }


def save_certificate(certificate: Certificate, path: str | Path) -> None:
    """Write a certificate file whole or not at all, and only if it can be read again.

    Raises
    ------
    OutputError
        When the folder cannot be written.
    CertificateError
        When the certificate is beyond the limits of the format, such as numbers of more than 400 digits.
    """
    text = certificate_text(certificate)
    parse_certificate(text)
    write_whole(Path(path), text)
