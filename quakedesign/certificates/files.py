"""The certificate file (proofs/FORMAT.md): read strictly, written whole."""

import json
import math
import re
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

from quakedesign.certificates.claim import Certificate, Equilibrium, Loop
from quakedesign.errors import CertificateError
from quakedesign.output import write_whole
from quakedesign.sos import Block, Witness
from quakedesign.symbolic.terms import Term

_LARGEST_FILE = 4 << 20
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
_LAW = re.compile(r"[A-Za-z0-9_-]{1,40}")
_RATIONAL = re.compile(r"(-?)(0|[1-9][0-9]{0,399})(?:/([1-9][0-9]{0,399}))?")
_GRID_BITS = 1 << 14
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
    try:
        if Path(path).stat().st_size > _LARGEST_FILE:
            raise CertificateError(f"{path}: a certificate must be at most 4 MiB.")
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not UTF-8 text"
        raise CertificateError(f"certificate cannot be read: {path}: {reason}.") from None
    return parse_certificate(text)


def parse_certificate(text: str) -> Certificate:
    """Certificate from the text of a file. Raises CertificateError as `load_certificate`."""
    if max(_depths(text), default=0) > 12:
        raise CertificateError("the file is nested deeper than 12 levels.")
    try:
        raw = json.loads(
            text, object_pairs_hook=_unique, parse_float=_no_float, parse_constant=_no_float, parse_int=_integer
        )
    except (json.JSONDecodeError, RecursionError) as error:
        raise CertificateError(f"the file is not JSON: {error}.") from None
    return _certificate(_keys(raw, _PROOF if isinstance(raw, dict) and "refutation" not in raw else _REFUTATION))


_COMMON = {"format", "law", "gains", "constants", "states", "domain", "uncertain", "field"}
_PROOF = _COMMON | {"V", "claims", "witnesses"}
_REFUTATION = _COMMON | {"refutation"}


def _depths(text: str):
    depth, in_string, escaped = 0, False, False
    for character in text:
        if in_string:
            in_string = escaped or character != '"'
            escaped = character == "\\" and not escaped
        elif character == '"':
            in_string, escaped = True, False
        elif character in "[{":
            depth += 1
            yield depth
        elif character in "]}":
            depth -= 1


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    _need(len({k for k, _ in pairs}) == len(pairs), "a key occurs twice in one object")
    return dict(pairs)


def _no_float(text: str):
    raise CertificateError(f"numbers must be integers or texts of rationals; received {text[:20]}.")


def _integer(text: str) -> int:
    _need(len(text) <= 3 and text != "-0", f"the integer {text[:20]} is out of range")
    return int(text)


def _need(condition: bool, reason: str) -> None:
    if not condition:
        raise CertificateError(f"{reason}.")


def _keys(raw: Any, keys: set[str]) -> dict[str, Any]:
    _need(isinstance(raw, dict) and set(raw) == keys, f"an object must have exactly the keys {', '.join(sorted(keys))}")
    return raw


def _list(raw: Any, what: str, limit: int | None = None, length: int | None = None) -> list[Any]:
    _need(isinstance(raw, list), f"{what} must be a list")
    _need(limit is None or len(raw) <= limit, f"{what} is longer than {limit}")
    _need(length is None or len(raw) == length, f"{what} must have {length} entries")
    return raw


def _object(raw: Any, what: str, limit: int) -> dict[str, Any]:
    _need(isinstance(raw, dict) and len(raw) <= limit, f"{what} must be an object with at most {limit} entries")
    return raw


def _rational(raw: Any) -> Fraction:
    _need(isinstance(raw, str), "a rational must be a text")
    match = _RATIONAL.fullmatch(raw)
    _need(match is not None and raw != "-0" and match[3] != "1", f"{raw[:40]!r} is not a canonical rational")
    assert match is not None
    top, bottom = int(match[2]), int(match[3] or 1)
    _need(math.gcd(top, bottom) == 1 and (top != 0 or match[3] is None), f"{raw[:40]!r} is not in lowest terms")
    return Fraction(-top if match[1] else top, bottom)


def _rationals(raw: Any, what: str, limit: int) -> dict[str, Fraction]:
    entries = _object(raw, what, limit)
    for name in entries:
        _need(_NAME.fullmatch(name) is not None, f"{name[:40]!r} in {what} is not a name")
    return {name: _rational(v) for name, v in entries.items()}


def _certificate(raw: dict[str, Any]) -> Certificate:
    _need(type(raw["format"]) is int and raw["format"] == 1, "format must be 1")
    loop = _loop(raw)
    if "refutation" in raw:
        return Certificate(loop=loop, refutation=_equilibrium(raw["refutation"]))
    witnesses: dict[str, Witness] = {}
    for entry in _list(raw["witnesses"], "witnesses", _LIMITS["witnesses"]):
        name = _keys(entry, {"obligation", "multiplier", "squares"})["obligation"]
        _need(isinstance(name, str) and name not in witnesses, "an obligation must be named once, by a text")
        witnesses[name] = _witness(entry, len(loop.states))
    return Certificate(
        loop=loop,
        lyapunov=_terms(raw["V"], loop),
        claims=_rationals(raw["claims"], "claims", 2 + _LIMITS["states"]),
        witnesses=witnesses,
    )


def _loop(raw: dict[str, Any]) -> Loop:
    _need(isinstance(raw["law"], str) and _LAW.fullmatch(raw["law"]) is not None, "law must be a short name")
    _need(raw["domain"] in ("cells", "reals"), "domain must be cells or reals")
    gains = _rationals(raw["gains"], "gains", _LIMITS["parameters"])
    constants = _rationals(raw["constants"], "constants", _LIMITS["parameters"])
    states = _object(raw["states"], "states", _LIMITS["states"])
    uncertain = _object(raw["uncertain"], "uncertain", _LIMITS["uncertain"])
    names = [*gains, *constants, *states, *uncertain]
    _need(len(set(names)) == len(names) and len(gains) + len(constants) <= _LIMITS["parameters"], "names must differ")
    _need(all(_NAME.fullmatch(n) for n in names) and states != {}, "states and uncertain need names")
    top = 12 if raw["domain"] == "cells" else 1
    _need(all(type(w) is int and 1 <= w <= top for w in states.values()), f"weights must be integers from 1 to {top}")
    ranges: dict[str, tuple[Fraction, Fraction]] = {}
    for name, ends in uncertain.items():
        low, high = (_rational(v) for v in _list(ends, "a range", length=2))
        _need(low <= high, f"the range of {name} is not ordered")
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
    rates = _keys(raw["field"], set(states))
    field = {state: _terms(rates[state], bare) for state in states}
    return Loop(**{**{f: getattr(bare, f) for f in bare.__slots__}, "field": field})


def _terms(raw: Any, loop: Loop) -> tuple[Term, ...]:
    return tuple(_term(entry, loop) for entry in _list(raw, "terms", _LIMITS["terms"]))


def _term(raw: Any, loop: Loop) -> Term:
    number, names, powers = _list(raw, "a term", length=3)
    coefficient = _rational(number)
    _need(coefficient != 0, "a term must not be zero")
    known = {*loop.gains, *loop.constants, *loop.uncertain}
    parameters = tuple(_list(names, "parameters", 32))
    _need(all(isinstance(n, str) and n in known for n in parameters), "a term has an unknown parameter")
    factors = tuple(_factor(entry, loop) for entry in _list(powers, "factors", _LIMITS["states"]))
    _need(len({f[0] for f in factors}) == len(factors), "a state occurs twice in a term")
    return Term(coefficient, parameters, factors)


def _factor(raw: Any, loop: Loop) -> tuple[str, Fraction, str]:
    state, exponent, kind = _list(raw, "a factor", length=3)
    power = _rational(exponent)
    _need(isinstance(state, str) and state in loop.states, "a factor has an unknown state")
    _need(
        kind in ("s", "a") and 0 <= power <= 24 and (kind == "s" or power > 0), "a factor has a wrong kind or exponent"
    )
    return state, power, kind


def _exponents(raw: Any, variables: int, largest: int) -> tuple[int, ...]:
    entries = _list(raw, "exponents", length=variables)
    _need(all(type(e) is int and 0 <= e <= largest for e in entries), f"exponents must be integers from 0 to {largest}")
    return tuple(entries)


def _witness(raw: dict[str, Any], variables: int) -> Witness:
    multiplier: dict[tuple[int, ...], Fraction] = {}
    for key, number in _object(raw["multiplier"], "multiplier", _LIMITS["basis"]).items():
        _need(
            re.fullmatch(r"(0|[1-9][0-9]{0,2})(,(0|[1-9][0-9]{0,2}))*", key) is not None, "a multiplier has a wrong key"
        )
        multiplier[_exponents([int(part) for part in key.split(",")], variables, 999)] = _rational(number)
    blocks = []
    for entry in _list(raw["squares"], "squares", 1 << variables):
        block = _keys(entry, {"times", "basis", "gram"})
        gram = [_rational(v) for v in _list(block["gram"], "gram")]
        _common_grid(gram)
        basis = _list(block["basis"], "basis", _LIMITS["basis"])
        size = len(basis)
        blocks.append(
            Block(
                times=_exponents(block["times"], variables, 1),
                basis=tuple(_exponents(b, variables, 999) for b in basis),
                gram=tuple(_list(gram, "gram", length=size * (size + 1) // 2)),
            )
        )
    return Witness(multiplier=multiplier, blocks=tuple(blocks))


def _common_grid(gram: list[Fraction]) -> None:
    """Refuse a Gram matrix whose common denominator would make exact arithmetic slow."""
    common = 1
    for entry in gram:
        common = math.lcm(common, entry.denominator)
        _need(common.bit_length() <= _GRID_BITS, f"the common denominator of a Gram matrix exceeds {_GRID_BITS} bits")


def _equilibrium(raw: Any) -> Equilibrium:
    entries = _keys(raw, {"parameters", "point", "weights"})
    weights = _object(entries["weights"], "weights", 64)
    return Equilibrium(
        parameters=_rationals(entries["parameters"], "parameters", _LIMITS["uncertain"]),
        point=_rationals(entries["point"], "point", _LIMITS["states"]),
        weights={cell: _rational(w) for cell, w in weights.items()},
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
                "multiplier": {",".join(map(str, e)): str(c) for e, c in witness.multiplier.items()},
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
