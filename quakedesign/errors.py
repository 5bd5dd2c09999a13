"""Exceptions of quakedesign: each message gives quantity, condition, value and remedy."""

import math
import re
from collections.abc import Iterable
from typing import ClassVar

from quakedesign.text import nearest_name, one_line, shown


class QuakedesignError(Exception):
    """Anything that quakedesign refuses; the command line prints it as one line and exits with 2.

    Attributes
    ----------
    parts : tuple of QuakedesignError
        What is wrong one by one, where several things are.
    code : str
        Kind of the error for scripts, such as ``parameter``: that of its class.
    """

    parts: "tuple[QuakedesignError, ...]" = ()
    code: ClassVar[str] = "error"

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))

    def __init_subclass__(cls) -> None:
        cls.code = re.sub(r"(?<=[a-z])(?=[A-Z])", "-", cls.__name__.removesuffix("Error")).lower()

    @property
    def quantity(self) -> str:
        """What is wrong: the subject of the condition that the message begins with; empty without one."""
        subject, verb, _ = re.split(r" (must|needs?) ", f"{self.args[0]} must ", maxsplit=1)
        return subject if verb and subject != self.args[0] else ""


class ParameterError(QuakedesignError, ValueError):
    """An unphysical or meaningless value."""


class UnitError(QuakedesignError, ValueError):
    """A quantity with an unknown unit, or with one of the wrong dimension."""


class ScenarioError(QuakedesignError, ValueError):
    """A fault description that cannot be read or is incomplete."""


class RecordError(QuakedesignError, ValueError):
    """A record of an experiment that cannot be read, is incomplete, or does not fit what is asked of it."""


class UnknownNameError(QuakedesignError, KeyError):
    """A preset, law or controller that does not exist."""

    def __str__(self) -> str:
        return str(self.args[0])


class UserCodeError(QuakedesignError, RuntimeError):
    """Code of the user's that raises what is no refusal of quakedesign, `SystemExit` among it."""


class UnsupportedError(QuakedesignError, NotImplementedError):
    """An expression or model for which no method is known."""


class KinkError(QuakedesignError, ArithmeticError):
    """A derivative asked for at a point where the expression has none."""


class PolynomialError(QuakedesignError, ValueError):
    """A text that is not a polynomial or a constraint, or too large to be read as one."""


class CertificateError(QuakedesignError, ValueError):
    """A certificate file that is not one, or whose proof does not hold."""


class WorkError(QuakedesignError, ArithmeticError):
    """An exact check that takes more work than it may: it is undecided."""


class SimulationError(QuakedesignError, RuntimeError):
    """A closed loop that cannot be integrated as asked."""


class OutputError(QuakedesignError, OSError):
    """A result that cannot be written."""


def is_whole(value: object, least: float, most: float = math.inf) -> bool:
    """Whether a value is a whole number from `least` to `most`; True and False are none."""
    return isinstance(value, int) and not isinstance(value, bool) and least <= value <= most


def require_whole(least: int, **values: object) -> None:
    """Raise for values that are no whole numbers of at least `least`; the keyword is the name."""
    for name in (name for name, value in values.items() if not is_whole(value, least)):
        raise ParameterError(f"{name} must be a whole number of at least {least}. Received {values[name]!r}.")


def require_known(
    name: object, known: Iterable[str], what: str, refusal: type[QuakedesignError] = ParameterError
) -> None:
    """Refuse a name that is none of those known: the message lists them, and asks whether the nearest is meant.

    Parameters
    ----------
    name : object
        As it was received.
    what : str
        What the name is of, such as ``"controller"``.

    Raises
    ------
    QuakedesignError
        Of the type `refusal`.
    """
    names = list(known)
    if not isinstance(name, str) or name not in names:
        listed = f"{what} must be one of {', '.join(names) or 'none'}. Received {shown(name)}."
        raise refusal(listed + nearest_name(str(name), names))
