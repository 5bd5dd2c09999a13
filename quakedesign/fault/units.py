"""Quantities with units: parsing, conversion to SI, and output."""

import re
from decimal import Decimal
from fractions import Fraction
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from quakedesign.errors import ParameterError, UnitError
from quakedesign.exact import rational
from quakedesign.text import nearest_name, shown

_TIMES = {"s": "1", "ms": "0.001", "us": "0.000001", "min": "60", "h": "3600", "hour": "3600", "day": "86400"}
_LENGTHS = {"m": "1", "cm": "0.01", "mm": "0.001", "um": "0.000001", "nm": "1E-9", "km": "1000"}
_PLAIN: dict[str, dict[str, str]] = {
    "": {"": "1"},
    "s": _TIMES,
    "m": _LENGTHS,
    "m/s": {f"{unit}/s": size for unit, size in _LENGTHS.items()},
    "m/s^2": {"m/s^2": "1"},
    "Pa": {"Pa": "1", "kPa": "1000", "MPa": "1000000", "GPa": "1E+9"},
    "Pa/s": {"Pa/s": "1", "kPa/s": "1000", "MPa/s": "1000000"},
    "kg/m^3": {"kg/m^3": "1"},
    "kg/s": {"kg/s": "1"},
    "m^2/s": {"m^2/s": "1"},
    "m^3/Pa": {"m^3/Pa": "1"},
    "rad/s": {"rad/s": "1"},
    "Hz": {"Hz": "1", "kHz": "1000"},
    "1/s": {"1/s": "1"},
    "1/s^2": {"1/s^2": "1"},
}
"""Sizes of common units in SI units, the same as those of pint, which has all units but takes half a second to load."""
_WRITTEN = re.compile(r"([+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d{1,3})?)(?: ([A-Za-z1][A-Za-z0-9/^]*))?", re.ASCII)


def _plain(quantity: object, unit: str) -> Decimal | None:
    """Value in SI units of a number with a common unit; None for any other text."""
    match = _WRITTEN.fullmatch(quantity) if isinstance(quantity, str) and len(quantity) <= 100 else None
    size = _PLAIN.get(unit, {}).get(match[2] or "") if match else None
    return Decimal(match[1]) * Decimal(size) if match and size else None


_NUMBER = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?![\d.])\s*((?![*^]).*)", re.ASCII | re.DOTALL)
_WITHIN_A_UNIT = re.compile(r"^1\s*(?=/)|(\^|\*\*)\s*[+-]?\d+|(?<=[A-Za-z])\d+", re.ASCII)


@cache
def _words_of_units() -> frozenset[str]:
    """Words of pint's definition file, including names of units and prefixes; empty without the file."""
    spec = find_spec("pint")
    files = Path(spec.origin).parent.glob("*_en.txt") if spec and spec.origin else ()
    texts = (re.sub("#.*", "", file.read_text(encoding="utf-8")) for file in files)
    return frozenset(word for text in texts for word in re.findall(r"[^\W\d]\w*", text))


def _is_unknown_unit(written: str) -> bool:
    """Whether a word is not a unit of pint (name, name with a prefix, or plural), decided without loading pint."""
    words, singular = _words_of_units(), written.removesuffix("s")
    ends = {end[i:] for end in (written, singular) for i in range(len(end)) if not i or end[:i] in words}
    return bool(words) and written.isascii() and written.isalpha() and words.isdisjoint(ends)


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry(non_int_type=Decimal, autoconvert_offset_to_baseunit=False)


def si_value(quantity: object, unit: str, name: str) -> float:
    """Value in an SI unit of a text such as ``"30 GPa"``; conversion in decimal arithmetic, rounded once.

    Parameters
    ----------
    quantity : str, int or float
        Text with a unit; a number without a unit only where `unit` is empty.
    unit : str
        SI unit, empty for dimensionless.
    name : str
        Name of the quantity in messages.

    Raises
    ------
    UnitError
        For an unknown unit, a wrong dimension, a missing unit or number; and for hertz where an angular frequency is
        required, because pint converts 1 Hz to 1 rad/s.
    """
    if (plain := _plain(quantity, unit)) is not None:
        return float(plain)
    wanted = f"a quantity in {unit}, such as {_example(unit)!r}" if unit else "a plain number"
    received = f"{name} must be {wanted}. Received {shown(quantity)}"
    if isinstance(quantity, bool) or not isinstance(quantity, str | int | float):
        raise UnitError(f"{received}.")
    if isinstance(quantity, int | float):
        return _plain_number(quantity, unit, received)
    if len(quantity) > 100:
        raise UnitError(f"{name} must be {wanted}. Received a text of {len(quantity)} characters.")
    if re.match(r"\s*[+-]?\d+,\d", quantity):
        raise UnitError(f"{received}, with a comma. Write a decimal point, and nothing between thousands.")
    split = _NUMBER.fullmatch(quantity)
    if re.search(r"[\d+-]", _WITHIN_A_UNIT.sub("", split[2]) if split else quantity):
        raise UnitError(f"{received}, which is more than one number and a unit. Write the number in one piece.")
    number, written = (Decimal(split[1]), split[2]) if split else (None, quantity)
    remedy = nearest_name(written, _PLAIN.get(unit, ())) or " Check its spelling."
    unknown = f"{received}, whose unit is unknown.{remedy}"
    if number is not None and _is_unknown_unit(written):
        raise UnitError(unknown)
    import pint

    try:
        parsed = _registry().Quantity(f"1 {written}") * number if number is not None else _registry().Quantity(written)
        converted = parsed.to(unit or "dimensionless") if not (unit and parsed.unitless) else None
    except pint.UndefinedUnitError:
        raise UnitError(unknown) from None
    except pint.DimensionalityError:
        raise UnitError(f"{received}, whose unit has another dimension. Check the unit.") from None
    except Exception:
        raise UnitError(f"{received}, which cannot be read.") from None
    if not isinstance(parsed.magnitude, Decimal):
        raise UnitError(f"{received} without a number. Add the number.")
    if converted is None:
        raise UnitError(f"{received} without a unit. Add the unit.")
    if plural := next(filter(_is_plural_of_a_symbol, re.findall(r"[^\W\d_]\w*", quantity)), None):
        raise UnitError(f"{received}, whose unit is unknown: symbols have no plural. Write {plural[:-1]}.")
    if unit == "rad/s" and "hertz" in str(parsed.units):
        raise UnitError(
            f"{name} must be an angular frequency in rad/s. Received {quantity!r}. Multiply a frequency by 2π."
        )
    return float(converted.magnitude)


def quantity(unit: str, example: str | float, default: str = "", **more: str) -> dict[str, str | float]:
    """Metadata of a field for a fault file: SI unit, example, default in words; see `entries.FileEntry`."""
    return {"unit": unit, "example": example, "default": default} | more


def exact_value(quantity: str | float | Fraction, unit: str, name: str) -> Fraction:
    """Exact value in the SI unit of a quantity: a number, decimal or p/q in this unit, or a text with a unit.

    Raises
    ------
    ParameterError
        For a number that is not finite, or an object that is neither a number nor a text.
    UnitError
        As in `si_value`, for a text that is not a number.
    """
    try:
        return rational(quantity, name)
    except ParameterError:
        if not isinstance(quantity, str):
            raise
    return rational(si_value(quantity, unit, name), name)


def _plain_number(number: float, unit: str, received: str) -> float:
    if unit:
        raise UnitError(f"{received} without a unit. Add the unit.")
    try:
        return float(number)
    except OverflowError:
        raise UnitError(f"{received}, which is too large. Check its exponent.") from None


def _is_plural_of_a_symbol(word: str) -> bool:
    """Whether pint reads a word as the plural of a symbol, such as MPas of MPa; hours is the plural of a name."""
    if not word.endswith("s"):
        return False
    for _, unit, _ in _registry().parse_unit_name(word)[:1]:
        definition = _registry()._units[unit]
        own = word.endswith((definition.name, definition.symbol, *definition.aliases))
        return not own and definition.symbol != definition.name and word[:-1].endswith(definition.symbol)
    return False


def _example(unit: str) -> str:
    return {
        "Pa": "30 GPa",
        "m": "1.5 m",
        "s": "20 ms",
        "kg/m^3": "2700 kg/m^3",
        "kg/s": "5e14 kg/s",
        "m/s": "3 mm/s",
        "m/s^2": "0.2 mm/s^2",
        "m^2/s": "7 cm^2/s",
        "rad/s": "0.5 rad/s",
        "Pa/s": "2 kPa/s",
    }.get(unit, f"1 {unit}")
