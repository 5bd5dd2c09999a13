"""Exceptions of quakedesign; messages give quantity and condition, and where possible value and remedy."""

import math
import re
from collections.abc import Iterable
from typing import ClassVar

from quakedesign.text import nearest_name, one_line, shown


class QuakedesignError(Exception):
    """Base class of all errors of quakedesign; one that ends a command is printed in one line, with exit code 2.

    Attributes
    ----------
    parts : tuple of QuakedesignError
        The individual errors, if one exception reports several; empty otherwise.
    code : str
        Kind of the error for scripts, such as ``parameter``; each class has its own.
    """

    parts: "tuple[QuakedesignError, ...]" = ()
    code: ClassVar[str] = "error"

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))

    def __init_subclass__(cls) -> None:
        cls.code = re.sub(r"(?<=[a-z])(?=[A-Z])", "-", cls.__name__.removesuffix("Error")).lower()

    @property
    def quantity(self) -> str:
        """Quantity in error: the message text before "must", "need" or "needs"; empty without these words."""
        subject, verb, _ = re.split(r" (must|needs?) ", f"{self.args[0]} must ", maxsplit=1)
        return subject if verb and subject != self.args[0] else ""


class ParameterError(QuakedesignError, ValueError):
    """An argument of the wrong type, or with an unphysical or meaningless value."""


class UnitError(QuakedesignError, ValueError):
    """A quantity with an unknown unit, or with one of the wrong dimension."""


class ScenarioError(QuakedesignError, ValueError):
    """A fault description that cannot be read or is incomplete."""


class RecordError(QuakedesignError, ValueError):
    """A record of an experiment that cannot be read, is incomplete, or does not suit the analysis."""


class UnknownNameError(QuakedesignError, KeyError):
    """A name that does not exist, such as that of a preset, law, controller, objective or class."""

    def __str__(self) -> str:
        return str(self.args[0])


class UserCodeError(QuakedesignError, RuntimeError):
    """User code that raises an exception other than a `QuakedesignError`, including `SystemExit`."""


class UnsupportedError(QuakedesignError, NotImplementedError):
    """An expression, model, law or certificate that a method does not support, or a missing library of Rocq."""


class KinkError(QuakedesignError, ArithmeticError):
    """A derivative at a point where the expression is not differentiable."""


class PolynomialError(QuakedesignError, ValueError):
    """A text that is not a polynomial or a constraint, or is too large to be parsed."""


class CertificateError(QuakedesignError, ValueError):
    """A file that is not a certificate, one that is invalid or does not apply, or a loop without a certificate form."""


class WorkError(QuakedesignError, ArithmeticError):
    """An exact check that exceeds its work limit; its verdict is undecided."""


class SimulationError(QuakedesignError, RuntimeError):
    """A simulation that cannot be run as requested, or worker processes or a scheduler that fail."""


class OutputError(QuakedesignError, OSError):
    """A result that cannot be written."""


def is_whole(value: object, least: float, most: float = math.inf) -> bool:
    """Whether a value is a whole number from `least` to `most`; booleans are not."""
    return isinstance(value, int) and not isinstance(value, bool) and least <= value <= most


def require_whole(least: int, **values: object) -> None:
    """Raise `ParameterError` unless all values are whole numbers ≥ `least`; keywords are their names in the message."""
    for name in (name for name, value in values.items() if not is_whole(value, least)):
        raise ParameterError(f"{name} must be a whole number of at least {least}. Received {values[name]!r}.")


def require_known(
    name: object, known: Iterable[str], what: str, refusal: type[QuakedesignError] = ParameterError
) -> None:
    """Raise for an unknown name; the message lists the known names and suggests the nearest.

    Parameters
    ----------
    name : object
        As received.
    known : iterable of str
        Valid names.
    what : str
        Kind of the name, such as ``"controller"``.
    refusal : type of QuakedesignError
        Class of the error.

    Raises
    ------
    QuakedesignError
        Of the type `refusal`, for an unknown name.
    """
    names = list(known)
    if not isinstance(name, str) or name not in names:
        listed = f"{what} must be one of {', '.join(names) or 'none'}. Received {shown(name)}."
        raise refusal(listed + nearest_name(str(name), names))
