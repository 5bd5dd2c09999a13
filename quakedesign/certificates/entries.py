"""All that a claim about a loop that runs depends on, as lines below its sentence; those of proofs/check.py."""

import json
from collections.abc import Mapping
from decimal import Decimal
from fractions import Fraction
from hashlib import sha256
from typing import Any

from quakedesign.bounds import LowerBound, UpperBound

_HEADED = {"format", "kind", "claims"}
_NAMED = {"name", "states"}  # nothing depends on them
_MOST_LISTED = 64
_MOST_CHARACTERS = 24
_DIGITS = 6


def entry_lines(document: Mapping[str, Any]) -> list[str]:
    """Every entry of a file of `guarantee_text` but names: a line for each of its parts, its claims and its SHA-256.

    Parameters
    ----------
    document : mapping
        Parsed file; a claim is worth as much as it was read from, so that its own document is the one to give.
    """
    stated = {key: _without_names(part) for key, part in document.items() if key not in _HEADED}
    claims = []
    for name, value in sorted(document["claims"].items()):
        bound = LowerBound if name.startswith("least") else UpperBound
        claims.append(f"{name} {bound(value):.{_DIGITS}g}")
    exact = json.dumps(stated, sort_keys=True, separators=(",", ":")).encode()
    lines = ["entries, in SI units of FORMAT.md; ~ is rounded to nearest, claims outward:"]
    lines += [f"{key}: {_part(part)}" for key, part in sorted(stated.items())]
    lines.append("claims: " + ", ".join(claims))
    return [*lines, f"SHA-256 of the entries without claims: {sha256(exact).hexdigest()}"]


def _without_names(part: Any) -> Any:
    if not isinstance(part, dict):
        return part
    return {key: _without_names(entry) for key, entry in part.items() if key not in _NAMED}


def _part(part: Any) -> str:
    return "; ".join(_phrases(part, ())) if isinstance(part, dict) else _entry(part)


def _phrases(part: dict[str, Any], path: tuple[str, ...]) -> list[str]:
    """Entries that are no objects behind the path to them, then those of every object."""
    inner = {key: entry for key, entry in sorted(part.items()) if isinstance(entry, dict)}
    own = ", ".join(f"{key} {_entry(entry)}" for key, entry in sorted(part.items()) if key not in inner)
    found = [" ".join((*path, own))] if own else []
    return found + [phrase for key, entry in inner.items() for phrase in _phrases(entry, (*path, key))]


def _entry(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + _part(value) + "}"
    if isinstance(value, list):
        count = _leaves(value)
        return f"({count} entries)" if count > _MOST_LISTED else f"[{', '.join(map(_entry, value))}]"
    return _number(value) if isinstance(value, str) and value.lstrip("-")[:1].isdigit() else str(value)


def _leaves(value: Any) -> int:
    """Entries of nested lists; an empty one counts as one."""
    if isinstance(value, dict):
        return sum(map(_leaves, value.values()))
    return sum(map(_leaves, value)) or 1 if isinstance(value, list) else 1


def _number(text: str) -> str:
    """A rational as a decimal of at most 15 digits or a short fraction, if it is one, else rounded."""
    value = Fraction(text)
    about = Decimal(value.numerator) / Decimal(value.denominator)
    decimal = f"{float(about):.15g}"
    if "inf" not in decimal and Fraction(decimal) == value:
        return decimal
    return text if len(text) <= _MOST_CHARACTERS else f"~{about:.{_DIGITS}g}"
