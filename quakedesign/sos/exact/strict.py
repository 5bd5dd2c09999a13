"""JSON read strictly: canonical rationals, bounded sizes, no unknown or duplicate keys; one reason for a refusal."""

import json
import math
import re
from collections.abc import Callable, Iterable
from dataclasses import MISSING, fields, is_dataclass
from fractions import Fraction
from functools import cache, lru_cache
from itertools import accumulate
from pathlib import Path
from typing import Any, NoReturn, TypeVar, cast

import msgspec

from quakedesign.errors import CertificateError
from quakedesign.exact import exact_text
from quakedesign.files import write_whole
from quakedesign.text import one_line

_Kind = TypeVar("_Kind")

LARGEST_FILE = 4 << 20
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
_RATIONAL = re.compile(r"(-?[1-9][0-9]{0,399}|0)(?:/([1-9][0-9]{0,399}))?")
_EXPONENTS = re.compile(r"(0|[1-9][0-9]{0,2})(,(0|[1-9][0-9]{0,2}))*")
_GRID_BITS = 1 << 14
_DEPTH = 12
_STRING = re.compile(r'"[^"\\]*(?:\\.[^"\\]*)*(?:"|\\?\Z)', re.DOTALL)  # to the end of the text if never closed
_NO_BRACKETS = re.compile(r"[^\[\]{}]+")


def parse(text: str) -> Any:
    """JSON value of a text.

    Raises
    ------
    CertificateError
        When it is no JSON, too deep, or has floats, long integers or duplicate keys.
    """
    if _depth(text) > _DEPTH:
        raise CertificateError(f"the file is nested deeper than {_DEPTH} levels.")
    try:
        return json.loads(
            text, object_pairs_hook=unique, parse_float=_no_float, parse_constant=_no_float, parse_int=_integer
        )
    except (json.JSONDecodeError, RecursionError) as error:
        raise CertificateError(f"the file is not JSON: {error}.") from None


def _depth(text: str) -> int:
    """Deepest nesting of brackets outside of strings."""
    brackets = _NO_BRACKETS.sub("", _STRING.sub("", text))
    return max(accumulate(1 if bracket in "[{" else -1 for bracket in brackets), default=0)


def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Object whose keys differ. Raises CertificateError for others."""
    need(len({k for k, _ in pairs}) == len(pairs), "a key occurs twice in one object")
    return dict(pairs)


def _no_float(text: str) -> None:
    raise CertificateError(f"numbers must be integers or texts of rationals; received {text[:20]}.")


def _integer(text: str) -> int:
    if len(text) > 3 or text == "-0":
        _refuse(f"the integer {text[:20]} is out of range")
    return int(text)


def _refuse(reason: str) -> NoReturn:
    raise CertificateError(f"{reason}.")


def need(condition: bool, reason: str) -> None:
    """Refuse unless a condition holds."""
    if not condition:
        _refuse(reason)


def with_keys(raw: Any, keys: set[str]) -> dict[str, Any]:
    """Object with exactly the given keys."""
    if not isinstance(raw, dict) or set(raw) != keys:
        _refuse(f"an object must have exactly the keys {', '.join(sorted(keys))}")
    return raw


def headed(raw: Any, kind: str = "") -> dict[str, Any]:
    """Entries of a file without the format's number and, if there is one, its kind, which must be the given one."""
    if not isinstance(raw, dict):
        _refuse("the file must be an object")
    need(type(raw.get("format")) is int and raw["format"] == 1, "format must be 1")
    need(not kind or raw.get("kind") == kind, f"kind must be {kind}")
    return {key: entry for key, entry in raw.items() if key != "format" and (key != "kind" or not kind)}


def listed(raw: Any, what: str, limit: int | None = None, length: int | None = None) -> list[Any]:
    """List of bounded or given length."""
    if not isinstance(raw, list):
        _refuse(f"{what} must be a list")
    if limit is not None and len(raw) > limit:
        _refuse(f"{what} is longer than {limit}")
    if length is not None and len(raw) != length:
        _refuse(f"{what} must have {length} entries")
    return raw


def objected(raw: Any, what: str, limit: int) -> dict[str, Any]:
    """Object of bounded size."""
    if not isinstance(raw, dict) or len(raw) > limit:
        _refuse(f"{what} must be an object with at most {limit} entries")
    return raw


def read_rational(raw: Any) -> Fraction:
    """Canonical rational."""
    if not isinstance(raw, str):
        _refuse("a rational must be a text")
    return _rational(raw)


@lru_cache(maxsize=1 << 15)  # the same numbers occur again and again in one file
def _rational(text: str) -> Fraction:
    match = _RATIONAL.fullmatch(text)
    if match is None:
        _refuse(f"{text[:40]!r} is not a canonical rational")
    top, bottom = match.groups("1")
    value = Fraction(int(top), int(bottom))
    if str(value) != text:
        _refuse(f"{text[:40]!r} is not in lowest terms")
    return value


def read_exactly(raw: Any, names: Iterable[str]) -> dict[str, Fraction]:
    """Object of rationals with exactly the given names, in their order."""
    order = list(names)
    entries = with_keys(raw, set(order))
    return {name: read_rational(entries[name]) for name in order}


def read_row(raw: Any, what: str, limit: int | None = None, length: int | None = None) -> tuple[Fraction, ...]:
    """List of rationals of bounded or given length."""
    return tuple(read_rational(v) for v in listed(raw, what, limit, length))


def read_ends(raw: Any, what: str) -> tuple[Fraction, Fraction]:
    """Two rationals."""
    low, high = read_row(raw, what, length=2)
    return low, high


def read_names(raw: Any, what: str, limit: int) -> tuple[str, ...]:
    """List of names."""
    names = listed(raw, what, limit)
    need(all(isinstance(n, str) and NAME.fullmatch(n) for n in names), f"{what} must be names")
    return tuple(names)


def texts(values: Iterable[Fraction]) -> list[str]:
    """Rationals as they stand in files."""
    return [exact_text(v) for v in values]


def read_rationals(raw: Any, what: str, limit: int) -> dict[str, Fraction]:
    """Object of names and rationals."""
    entries = objected(raw, what, limit)
    for name in entries:
        need(NAME.fullmatch(name) is not None, f"{name[:40]!r} in {what} is not a name")
    return {name: read_rational(v) for name, v in entries.items()}


def read_exponents(raw: Any, variables: int, largest: int) -> tuple[int, ...]:
    """Exponents from a list of integers."""
    entries = listed(raw, "exponents", length=variables)
    if {*map(type, entries)} != {int} or min(entries) < 0 or max(entries) > largest:
        _refuse(f"exponents must be integers from 0 to {largest}")
    return tuple(entries)


def common_grid(gram: Iterable[Fraction]) -> None:
    """Refuse a Gram matrix whose common denominator would make exact arithmetic slow."""
    common = 1
    for denominator in {entry.denominator for entry in gram}:
        common = math.lcm(common, denominator)
        if common.bit_length() > _GRID_BITS:
            _refuse(f"the common denominator of a Gram matrix exceeds {_GRID_BITS} bits")


def read_polynomial(raw: Any, what: str, variables: int | None, limit: int) -> dict[tuple[int, ...], Fraction]:
    """Polynomial from an object of exponents to nonzero rationals; with `variables` None its keys are equally long."""
    polynomial: dict[tuple[int, ...], Fraction] = {}
    for key, number in objected(raw, what, limit).items():
        if _EXPONENTS.fullmatch(key) is None:
            _refuse(f"{what} has a wrong key")
        parts = [int(part) for part in key.split(",")]
        variables = len(parts) if variables is None else variables
        exponents = read_exponents(parts, variables, 999)
        polynomial[exponents] = read_rational(number)
        if not polynomial[exponents]:
            _refuse(f"{what} has a zero coefficient")
    return polynomial


def polynomial_text(polynomial: Any) -> dict[str, str]:
    """Inverse of `read_polynomial`."""
    return {",".join(map(str, e)): exact_text(c) for e, c in polynomial.items()}


def write_readable(path: str | Path, written: str, load: Callable[[str], Any]) -> None:
    """Write a text whole or not at all, and only if it can be read again."""
    load(written)
    write_whole(Path(path), written)


# ----------------------------------------------------------------------
# Objects of a file with typed fields: reading and writing follow from the types.


class Entries(msgspec.Struct, forbid_unknown_fields=True):
    """An object of a file; its fields are the keys, and one that equals its default value is left out."""


def read_as(kind: type[_Kind], raw: Any, what: str = "the file") -> _Kind:
    """Value of a type from parsed entries, such that `written` gives these entries again.

    Parameters
    ----------
    kind : type
        An `Entries`, a dataclass, or a tuple of these, of rationals, integers and texts.
    raw : object
        As `parse` gives it.
    what : str
        Name of the entries for messages.

    Raises
    ------
    CertificateError
        For another type, a missing or unknown key, a number that is not canonical, a default value that is given, or a
        value that its class rejects.
    """
    try:
        value = msgspec.convert(raw, kind, dec_hook=_decoded)
    except msgspec.ValidationError as error:
        reason, _, place = str(error).partition(" - at `$")
        _refuse(f"{place.strip('.`') or what}: {reason[:1].lower()}{reason[1:].rstrip('.')}")
    if place := _difference(raw, written(value)):
        _refuse(f"{place.strip('. ')} must be a known key, and omitted where it has its default value")
    return value


def written(value: Any) -> Any:
    """Entries of a file that `read_as` reads as a value."""
    if isinstance(value, Fraction):
        return exact_text(value)
    if isinstance(value, tuple | list):
        return [written(entry) for entry in value]
    if isinstance(value, dict):
        return {key: written(entry) for key, entry in value.items()}
    if defaults := _defaults(cast(Any, type(value))):
        entries = ((name, getattr(value, name), default) for name, default in defaults.items())
        return {name: written(entry) for name, entry, default in entries if default is _NONE or entry != default}
    return value


_NONE = object()


@cache
def _defaults(kind: Any) -> dict[str, Any]:
    """Default value of every field of an object; empty for other types."""
    if issubclass(kind, msgspec.Struct):
        parts = ((part.name, part.default) for part in msgspec.structs.fields(kind))
        return {name: _NONE if default is msgspec.NODEFAULT else default for name, default in parts}
    if is_dataclass(kind):
        return {part.name: _NONE if part.default is MISSING else part.default for part in fields(kind)}
    return {}


def _decoded(kind: type, raw: Any) -> Any:
    number = read_rational(raw)
    return number if kind is Fraction else kind(number)


def _difference(raw: Any, again: Any) -> str:
    """Place of the first entry that differs between what was read and what would be written; empty without one."""
    if type(raw) is not type(again):
        return " "
    if isinstance(raw, dict):
        for key, entry in raw.items():
            if key not in again:
                return f".{one_line(key)[:40]}"
            if place := _difference(entry, again[key]):
                return f".{key}{place}"
    elif isinstance(raw, list):
        for number, pair in enumerate(zip(raw, again, strict=True)):
            if place := _difference(*pair):
                return f"[{number}]{place}"
    return "" if raw == again else " "


def made(kind: type[_Kind], *sources: Any, **entries: Any) -> _Kind:
    """Object whose fields are given, or attributes of the same name of one of the sources, or have their defaults."""
    for name in _defaults(cast(Any, kind)):
        found = [getattr(source, name) for source in sources if hasattr(source, name)]
        if name not in entries and found:
            entries[name] = found[0]
    return kind(**entries)
