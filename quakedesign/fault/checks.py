"""Checks of physical values, shared by the types of this room."""

import math
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from numbers import Integral, Real
from typing import Any

from quakedesign.errors import ParameterError, QuakedesignError, ScenarioError
from quakedesign.text import shown

MOST_WORKERS = 256
"""Processes that one command may start."""

_LARGEST = 1e40
_NAME = re.compile(r"\w[\w .-]{0,59}")
_MOST_BYTES = 120  # files and folders are named after it, and a system gives them 255


class Problems:
    """What is wrong with one input, collected so that all of it is said at once."""

    def __init__(self) -> None:
        self.found: list[QuakedesignError] = []

    @contextmanager
    def collected(self) -> Iterator[None]:
        """Keep the refusal that the block ends with, and go on."""
        try:
            yield
        except QuakedesignError as error:
            self.found += error.parts or (error,)

    def refuse(self, where: str = "") -> None:
        """Raise what was collected, if anything: as it is, or as one error that counts and names them all.

        Raises
        ------
        QuakedesignError
        """
        if not self.found:
            return
        kinds = {type(error) for error in self.found}
        kind = kinds.pop() if len(kinds) == 1 else ScenarioError
        told = [str(error) for error in self.found]
        if len(told) > 1:
            told = [f"{len(told)} errors.", *(f"({i}) {text}" for i, text in enumerate(told, start=1))]
        error = kind(f"{where}: {' '.join(told)}" if where else " ".join(told))
        error.parts = tuple(self.found) if len(told) > 1 else ()
        raise error from None


def require_all(*checks: Callable[[], None]) -> None:
    """Make every check, and refuse all that is wrong at once.

    Raises
    ------
    QuakedesignError
    """
    problems = Problems()
    for check in checks:
        with problems.collected():
            check()
    problems.refuse()


def require_seed(seed: int) -> None:
    """Refuse what is no seed.

    Raises
    ------
    ParameterError
    """
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise ParameterError(f"seed must be a whole number of at least 0. Received {seed!r}.")


def require_positive(remedy: str = "", **values: float | Fraction) -> None:
    """Refuse values that are not positive finite numbers, all at once; the keyword is the name.

    Raises
    ------
    ParameterError
    """
    _require(values, lambda v: v > 0, "positive and finite", remedy)


def require_nonnegative(remedy: str = "", **values: float) -> None:
    """Refuse values that are negative or no finite numbers.

    Raises
    ------
    ParameterError
    """
    _require(values, lambda v: v >= 0, "zero or positive, and finite", remedy)


def require_finite(remedy: str = "", **values: float) -> None:
    """Refuse values that are no finite numbers.

    Raises
    ------
    ParameterError
    """
    _require(values, lambda v: True, "finite", remedy)


def is_ordinary(size: float | Fraction, least: float = 1 / _LARGEST) -> bool:
    """Whether a positive number can be the size of something in SI units."""
    return least <= size <= _LARGEST


def require_ordinary(least: float = 1 / _LARGEST, **values: float | Fraction) -> None:
    """Refuse values that are no sizes of anything, so that no product of them leaves the floats; zero is one.

    Raises
    ------
    ParameterError
    """
    problems = Problems()
    for name, value in values.items():
        with problems.collected():
            if value and not is_ordinary(max(value, -value), least):
                raise ParameterError(
                    f"{name} must be of a size between {least:g} and {_LARGEST:g} in SI units. "
                    f"Received {shown(value)}. Check its unit."
                )
    problems.refuse()


def require_count(most: int, **values: int) -> None:
    """Refuse values that are no whole numbers from 1 to `most`.

    Raises
    ------
    ParameterError
    """
    for name, value in values.items():
        if not isinstance(value, Integral) or isinstance(value, bool) or not 1 <= value <= most:
            raise ParameterError(f"{name} must be a whole number from 1 to {most}. Received {shown(value)}.")


def _require(values: dict[str, Any], fine: Callable[[Any], bool], what: str, remedy: str) -> None:
    problems = Problems()
    for name, value in values.items():
        with problems.collected():
            if not isinstance(value, Real) or isinstance(value, bool):
                raise ParameterError(f"{name} must be a number in SI units, {what}. Received {shown(value)}.")
            if not (is_finite(value) and fine(value)):
                raise ParameterError(f"{name} must be {what}. Received {shown(value)} (SI units). {remedy}".strip())
    problems.refuse()


def is_finite(value: Real | float) -> bool:
    """Whether a number is one that a float holds."""
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def require_name(name: str) -> None:
    """Refuse a name after which no file can be named everywhere.

    Raises
    ------
    ParameterError
    """
    if not isinstance(name, str) or not _NAME.fullmatch(name) or len(name.encode()) > _MOST_BYTES:
        raise ParameterError(
            "name must be a text of at most 60 letters, digits, spaces and _ . - (120 bytes in UTF-8), beginning "
            f"with a letter or digit. Received {shown(name)}."
        )
