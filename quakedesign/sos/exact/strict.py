"""Strict reading of JSON: canonical rationals, bounded sizes, no unknown or duplicate keys."""

import json
import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, is_dataclass
from fractions import Fraction
from functools import cache, lru_cache
from itertools import accumulate
from pathlib import Path
from typing import Annotated, Any, NoReturn, TypeVar, cast

import msgspec

from quakedesign.errors import CertificateError
from quakedesign.exact import exact_text
from quakedesign.files import Json, write_whole
from quakedesign.text import one_line

_Kind = TypeVar("_Kind")

LARGEST_FILE = 4 << 20
Name = Annotated[str, msgspec.Meta(pattern=r"\A[A-Za-z][A-Za-z0-9_]{0,39}\Z")]
_RATIONAL = re.compile(r"(-?[1-9][0-9]{0,399}|0)(?:/([1-9][0-9]{0,399}))?")
_EXPONENTS = re.compile(r"(0|[1-9][0-9]{0,2})(,(0|[1-9][0-9]{0,2}))*")
_GRID_BITS = 1 << 14
_DEPTH = 12
_STRING = re.compile(r'"[^"\\]*(?:\\.[^"\\]*)*(?:"|\\?\Z)', re.DOTALL)  # an unclosed string ends with the text
_PATTERN = re.compile(r"`str` matching regex .*")
_NO_BRACKETS = re.compile(r"[^\[\]{}]+")


def parse(text: str) -> Any:
    """JSON value of a text.

    Raises
    ------
    CertificateError
        When the text is not JSON, is nested too deeply, or has floats, long integers or duplicate keys.
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


def unique(pairs: list[tuple[str, object]]) -> Json:
    """Object of key-value pairs. Raises CertificateError for duplicate keys."""
    need(len({k for k, _ in pairs}) == len(pairs), "a key occurs twice in one object")
    return dict(pairs)


def _no_float(text: str) -> None:
    raise CertificateError(f"numbers must be integers or strings of rationals; received {text[:20]}.")


def _integer(text: str) -> int:
    if len(text) > 3 or text == "-0":
        _reject(f"the integer {text[:20]} is out of range")
    return int(text)


def _reject(reason: str) -> NoReturn:
    raise CertificateError(f"{reason}.")


def need(condition: bool, reason: str) -> None:
    """Raise CertificateError unless a condition holds."""
    if not condition:
        _reject(reason)


def headed(raw: object, kind: str = "") -> Json:
    """Entries of a file without format and, if given, kind. Raises CertificateError if one of these is wrong."""
    if not isinstance(raw, dict):
        _reject("the file must be an object")
    need(type(raw.get("format")) is int and raw["format"] == 1, "format must be 1")
    need(not kind or raw.get("kind") == kind, f"kind must be {kind}")
    return {key: entry for key, entry in raw.items() if key != "format" and (key != "kind" or not kind)}


def read_rational(raw: object) -> Fraction:
    """Fraction of a text in canonical form."""
    if not isinstance(raw, str):
        _reject("a rational must be a string")
    return _rational(raw)


@lru_cache(maxsize=1 << 15)  # numbers recur often in one file
def _rational(text: str) -> Fraction:
    match = _RATIONAL.fullmatch(text)
    if match is None:
        _reject(f"{text[:40]!r} is not a canonical rational")
    top, bottom = match.groups("1")
    value = Fraction(int(top), int(bottom))
    if str(value) != text:
        _reject(f"{text[:40]!r} is not in lowest terms")
    return value


def common_grid(gram: Iterable[Fraction]) -> None:
    """Raise CertificateError if the common denominator of a Gram matrix has more than 2¹⁴ bits."""
    common = 1
    for denominator in {entry.denominator for entry in gram}:
        common = math.lcm(common, denominator)
        if common.bit_length() > _GRID_BITS:
            _reject(f"the common denominator of a Gram matrix exceeds {_GRID_BITS} bits")


def read_polynomial(raw: object) -> dict[tuple[int, ...], Fraction]:
    """Polynomial from an object of exponents (equal length, each at most 999) to nonzero rationals."""
    if not isinstance(raw, dict):
        _reject("a polynomial must be an object")
    polynomial: dict[tuple[int, ...], Fraction] = {}
    for key, number in raw.items():
        if _EXPONENTS.fullmatch(key) is None:
            _reject(f"the key {key[:40]!r} of a polynomial is not a list of exponents")
        polynomial[tuple(map(int, key.split(",")))] = value = read_rational(number)
        if not value:
            _reject("a polynomial has a zero coefficient")
    need(len(set(map(len, polynomial))) <= 1, "the keys of a polynomial differ in length")
    return polynomial


def require_polynomial(polynomial: Mapping[tuple[int, ...], Fraction], what: str, variables: int, limit: int) -> None:
    """Raise CertificateError for a polynomial with another number of variables, or more terms than the limit."""
    need(len(polynomial) <= limit, f"{what} is longer than {limit} terms")
    need(all(len(exponents) == variables for exponents in polynomial), f"{what} has another number of variables")


def polynomial_text(polynomial: Any) -> dict[str, str]:
    """Inverse of `read_polynomial`."""
    return {",".join(map(str, e)): exact_text(c) for e, c in polynomial.items()}


def write_readable(path: str | Path, written: str, load: Callable[[str], object]) -> None:
    """Write a text atomically, and only if it can be read back."""
    load(written)
    write_whole(Path(path), written)


# ----------------------------------------------------------------------
# Objects of a file with typed fields, which define how to read and write them.


class Entries(msgspec.Struct, forbid_unknown_fields=True):
    """An object of a file, with its fields as keys; a field with its default value is omitted."""


def read_as(kind: type[_Kind], raw: object, what: str = "the file") -> _Kind:
    """Value of a type from parsed entries; `written` is its inverse.

    Parameters
    ----------
    kind : type
        An `Entries` or a dataclass, whose fields are of such types, rationals, integers, texts, or tuples of these.
    raw : object
        Result of `parse`.
    what : str
        Name of the entries for messages.

    Raises
    ------
    CertificateError
        For a wrong type, a missing or unknown key, a number that is not canonical, an explicit default value, or a
        value that its class rejects.
    """
    try:
        value = msgspec.convert(raw, kind, dec_hook=_decoded)
    except msgspec.ValidationError as error:
        reason, _, place = str(error).partition(" - at ")
        reason = _PATTERN.sub("a name of up to 40 letters, digits and underscores that begins with a letter", reason)
        place = place.replace("`", "").replace("$.", "").strip("$.")
        _reject(f"{place or what}: {reason[:1].lower()}{reason[1:].strip('.')}")
    if place := _difference(raw, written(value)):
        _reject(f"{place.strip('. ')} is an unknown key, or has its default value, which must be omitted")
    return value


def written(value: object) -> Any:
    """Entries of a file for a value; the inverse of `read_as`."""
    match value:
        case int() | str():
            return value
        case Fraction():
            return exact_text(value)
        case tuple() | list():
            return [written(entry) for entry in value]
        case PolynomialEntries():
            return polynomial_text(value)
        case Mapping():
            return {key: written(entry) for key, entry in value.items()}
    if parts := _parts(cast(Any, type(value))):
        entries = ((key, getattr(value, name), default) for name, key, default in parts)
        return {key: written(entry) for key, entry, default in entries if entry != default}
    return value


@cache
def _parts(kind: Any) -> tuple[tuple[str, str, Any], ...]:
    """Name, key and default value (or a marker for none) of every field of an object; empty for other types."""
    if issubclass(kind, msgspec.Struct):
        return tuple((part.name, part.encode_name, part.default) for part in msgspec.structs.fields(kind))
    return tuple((part.name, part.name, part.default) for part in fields(kind)) if is_dataclass(kind) else ()


class PolynomialEntries(dict[tuple[int, ...], Fraction]):
    """A polynomial of a file: exponents such as ``"2,0,1"`` to nonzero rationals."""


def _decoded(kind: type, raw: object) -> Any:
    if kind is PolynomialEntries:
        return PolynomialEntries(read_polynomial(raw))
    return kind(read_rational(raw))  # a Fraction or a bound


def _difference(raw: Any, again: Any) -> str:
    """Place of the first difference between the entries read and those written back; empty without one."""
    if type(raw) is not type(again):
        return " "
    match raw:
        case dict():
            for key, entry in raw.items():
                if key not in again:
                    return f".{one_line(key)[:40]}"
                if place := _difference(entry, again[key]):
                    return f".{key}{place}"
        case list():
            for number, pair in enumerate(zip(raw, again, strict=True)):
                if place := _difference(*pair):
                    return f"[{number}]{place}"
    return "" if raw == again else " "


def made(kind: type[_Kind], *sources: object, **entries: object) -> _Kind:
    """Object of a type; each field is given, taken from a source with that attribute, or left at its default."""
    for name, *_ in _parts(cast(Any, kind)):
        values = [getattr(source, name) for source in sources if hasattr(source, name)]
        if name not in entries and values:
            entries[name] = values[0]
    return kind(**entries)
