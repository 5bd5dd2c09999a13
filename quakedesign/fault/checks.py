"""Checks of physical values, shared by the types of this room."""

import math

from quakedesign.errors import ParameterError


def require_positive(remedy: str = "", **values: float) -> None:
    """Refuse a value that is not a positive finite number; the keyword is its name.

    Raises
    ------
    ParameterError
    """
    _require({k: (v, v > 0) for k, v in values.items()}, "positive and finite", remedy)


def require_nonnegative(remedy: str = "", **values: float) -> None:
    """Refuse a value that is negative or not finite.

    Raises
    ------
    ParameterError
    """
    _require({k: (v, v >= 0) for k, v in values.items()}, "zero or positive, and finite", remedy)


def require_finite(remedy: str = "", **values: float) -> None:
    """Refuse a value that is not a finite number.

    Raises
    ------
    ParameterError
    """
    _require({k: (v, True) for k, v in values.items()}, "finite", remedy)


def _require(values: dict[str, tuple[float, bool]], what: str, remedy: str) -> None:
    for name, (value, fine) in values.items():
        if not (math.isfinite(value) and fine):
            message = f"{name} must be {what}. Received {value!r} (SI units)."
            raise ParameterError(f"{message} {remedy}".strip())
