"""Quantities with units, at the boundary only."""

from decimal import Decimal
from functools import cache
from typing import Any

from quakedesign.errors import UnitError


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry(non_int_type=Decimal, autoconvert_offset_to_baseunit=False)


def si_value(quantity: Any, unit: str, name: str) -> float:
    """Value in an SI unit of a text such as ``"30 GPa"``; converted in decimal arithmetic, so nothing is rounded twice.

    Parameters
    ----------
    quantity : str, int or float
        Text with a unit. A bare number is accepted only where `unit` is empty.
    unit : str
        SI unit, empty for dimensionless.
    name : str
        What the quantity is, for the message.

    Returns
    -------
    float

    Raises
    ------
    UnitError
        For an unknown unit, a wrong dimension, a missing unit or no number at all; and for hertz where an
        angular frequency is wanted, because pint takes 1 Hz for 1 rad/s.
    """
    import pint

    wanted = f"a quantity in {unit}, such as {_example(unit)!r}" if unit else "a plain number"
    if isinstance(quantity, bool) or not isinstance(quantity, str | int | float):
        raise UnitError(f"{name} must be {wanted}. Received {quantity!r}.")
    if isinstance(quantity, int | float):
        if unit:
            raise UnitError(f"{name} must be {wanted}. Received {quantity!r} without a unit. Add the unit.")
        return float(quantity)
    if len(quantity) > 100:
        raise UnitError(f"{name} must be {wanted}. Received a text of {len(quantity)} characters.")
    try:
        parsed = _registry().Quantity(quantity)
        converted = parsed.to(unit or "dimensionless") if not (unit and parsed.unitless) else None
    except pint.UndefinedUnitError:
        raise UnitError(
            f"{name} must be {wanted}. Received {quantity!r}, whose unit is unknown. Check its spelling."
        ) from None
    except pint.DimensionalityError:
        raise UnitError(f"{name} must be {wanted}. Received {quantity!r}, which has another dimension.") from None
    except Exception:
        raise UnitError(f"{name} must be {wanted}. Received {quantity!r}, which cannot be read.") from None
    if not isinstance(parsed.magnitude, Decimal):
        raise UnitError(f"{name} must be {wanted}. Received {quantity!r} without a number. Add the number.")
    if converted is None:
        raise UnitError(f"{name} must be {wanted}. Received {quantity!r} without a unit. Add the unit.")
    if unit == "rad/s" and "hertz" in str(parsed.units):
        raise UnitError(
            f"{name} must be an angular frequency in rad/s. Received {quantity!r}. Give 2π times it in rad/s."
        )
    return float(converted.magnitude)


def _example(unit: str) -> str:
    return {
        "Pa": "30 GPa",
        "m": "276.35 mm",
        "s": "184 ms",
        "kg/m^3": "2500 kg/m^3",
        "kg/s": "5e14 kg/s",
        "": "0.4",
    }.get(unit, f"1 {unit}")
