"""User-defined inputs of a run: a perturbation given as text, and a prescribed fluid pressure.

The perturbation is an acceleration [m/s²]; the pressure [Pa] is piecewise linear in time and may have steps.
"""

import ast
import csv
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import sympy as sp

from quakedesign.arguments import checked_dataclass, parsed
from quakedesign.errors import ParameterError, UnitError
from quakedesign.exact import rational
from quakedesign.fault.model import is_finite
from quakedesign.fault.units import si_value
from quakedesign.files import read_text
from quakedesign.simulation.closed_loop import SYMBOLS
from quakedesign.text import shown

# ----------------------------------------------------------------------
# User-defined perturbation φ_e as text.

FUNCTIONS = ("sin", "cos", "tan", "exp", "log", "sqrt", "tanh", "atan", "Abs", "Min", "Max", "sign")
MOST_NODES = 300
MOST_BITS = 1024  # size limit of an exact power


def perturbation(text: str) -> "sp.Expr":
    """Perturbation φ̂_e [m/s²] from text such as ``"3e-4*sin(0.69*time) + 1e-6*slip"``.

    The text is parsed, not executed; its numbers are exact.

    Parameters
    ----------
    text : str
        Numbers, ``pi``, ``slip`` [m], ``slip_rate`` [m/s], ``time`` [s], + - * / **, and the functions of `FUNCTIONS`.

    Returns
    -------
    Expr
        Argument of `quakedesign.simulation.Load`.

    Raises
    ------
    ParameterError
        For text outside this grammar, text or powers that are too large, or a number that is not real and finite.
    """
    try:
        tree = parsed(text.strip(), "eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise _text_error(text, text) from None
    if (nodes := sum(1 for _ in ast.walk(tree))) > MOST_NODES:
        raise ParameterError(
            f"a perturbation must have at most {MOST_NODES} numbers, names, operators and calls. Received {nodes}. "
            "Shorten it."
        )
    expression = _value(tree.body, text.strip())
    if not all(part.is_real and part.is_finite for part in sp.preorder_traversal(expression) if part.is_number):
        raise _text_error(text, text)
    return expression


def _value(node: ast.expr, text: str) -> sp.Expr:
    """SymPy expression of one node."""
    match node:
        case ast.Constant(value=int() | float()) if not isinstance(node.value, bool):
            return sp.Rational(str(rational(ast.get_source_segment(text, node) or "", "perturbation")))
        case ast.Name(id="pi"):
            return sp.pi
        case ast.Name(id=name) if name in SYMBOLS:
            return sp.Symbol(name, real=True)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=inner):
            return _value(inner, text) * (-1 if isinstance(node.op, ast.USub) else 1)
        case ast.BinOp(left=left, op=operation, right=right) if type(operation) in _OPERATIONS:
            return _OPERATIONS[type(operation)](_value(left, text), _value(right, text), text)
        case ast.Call(func=ast.Name(id=name), args=[_, *_] as arguments, keywords=[]) if name in FUNCTIONS:
            if len(arguments) > 1 and name not in ("Min", "Max"):
                raise _text_error(text, f"{name} of {len(arguments)} arguments")
            return getattr(sp, name)(*(_value(argument, text) for argument in arguments))
    raise _text_error(text, ast.get_source_segment(text, node) or text)


def _power(base: sp.Expr, exponent: sp.Expr, text: str) -> sp.Expr:
    digits = max(base.p.bit_length(), base.q.bit_length()) if base.is_Rational else 1
    if not (exponent.is_Rational and abs(exponent) * digits <= MOST_BITS):
        raise _text_error(text, f"the exponent {str(exponent)[:40]}")
    return base**exponent


def _quotient(numerator: sp.Expr, denominator: sp.Expr, text: str) -> sp.Expr:
    if denominator == 0:
        raise _text_error(text, "a division by zero")
    return numerator / denominator


_OPERATIONS: dict[type[ast.operator], Callable[[sp.Expr, sp.Expr, str], sp.Expr]] = {
    ast.Add: lambda a, b, _: a + b,
    ast.Sub: lambda a, b, _: a - b,
    ast.Mult: lambda a, b, _: a * b,
    ast.Div: _quotient,
    ast.Pow: _power,
}


def _text_error(text: str, part: str) -> ParameterError:
    inside = f" in {text!r}" if part != text else ""
    return ParameterError(
        f"a perturbation consists of numbers, pi, {', '.join(SYMBOLS)}, + - * / ** with rational exponents of moderate "
        f"size, and {', '.join(FUNCTIONS)}, and is real. Received {part!r}{inside}."
    )


# ----------------------------------------------------------------------
# Prescribed fluid pressure: piecewise linear in time, with steps.

MOST_POINTS = 4096
_LARGEST_FILE = 1 << 20
_COLUMNS = ("time", "pressure")
_UNITS = {"time": "s", "pressure": "Pa"}


@checked_dataclass(frozen=True, kw_only=True)
class PressureHistory:
    """Pressure p(t): linear between instants, constant before the first and after the last; a repeated time is a step.

    Attributes
    ----------
    times : tuple of float
        Times [s] in nondecreasing order, each at most twice.
    pressures : tuple of float
        [Pa], one for each time.
    """

    times: tuple[float, ...]
    pressures: tuple[float, ...]

    def __post_init__(self) -> None:
        if not 0 < len(self.times) == len(self.pressures) <= MOST_POINTS:
            raise ParameterError(
                f"a pressure history must have 1 to {MOST_POINTS} times, and one pressure for each. Received "
                f"{len(self.times)} times and {len(self.pressures)} pressures. Omit points on a straight line."
            )
        if not all(map(is_finite, (*self.times, *self.pressures))):
            wrong = next(value for value in (*self.times, *self.pressures) if not is_finite(value))
            raise ParameterError(f"times [s] and pressures [Pa] must be finite. Received {wrong!r}.")
        thrice = any(late <= early for early, late in zip(self.times, self.times[2:], strict=False))
        if thrice or any(late < early for early, late in pairwise(self.times)):
            raise ParameterError(
                "times of a pressure history must not decrease, and a time may occur at most twice (a step). "
                f"Received {shown(list(self.times))} s. Sort them, and remove repeated times."
            )

    @classmethod
    def constant(cls, pressure: float) -> "PressureHistory":
        """The same pressure [Pa] at all times."""
        return cls(times=(0.0,), pressures=(pressure,))

    @property
    def largest(self) -> float:
        """Largest pressure [Pa]."""
        return max(self.pressures)

    def before(self, time: float) -> float:
        """Pressure [Pa] just before a time [s]."""
        return self._at(time, int(np.searchsorted(self.times, time, side="left")))

    def after(self, time: float) -> float:
        """Pressure [Pa] just after a time [s]."""
        return self._at(time, int(np.searchsorted(self.times, time, side="right")))

    def sampled(self, time: "np.ndarray") -> "np.ndarray":
        """Pressures [Pa] at ascending times [s]; at a repeated time those before and after the step."""
        twice = np.append(np.diff(time) == 0, False)
        return np.array([self.before(t) if early else self.after(t) for t, early in zip(time, twice, strict=True)])

    def _at(self, time: float, following: int) -> float:
        if following in (0, len(self.times)):
            return self.pressures[min(following, len(self.times) - 1)]
        (start, end), (low, high) = (row[following - 1 : following + 1] for row in (self.times, self.pressures))
        return low + (high - low) * (time - start) / (end - start)


def pressure_history(text: str) -> PressureHistory:
    """Pressure history from a quantity such as ``"5 MPa"``, a list of instants, or the path of a CSV file.

    Parameters
    ----------
    text : str
        A constant; or instants as ``"0 s: 0 MPa, 1 day: 0 MPa, 1 day: 5 MPa, 9 day: 2 MPa"``, linear between, with a
        step at a repeated time; or a path that ends in ``.csv``, with the first row ``time [s],pressure [MPa]`` or
        other units.

    Raises
    ------
    ParameterError, UnitError
        For another form or unit, for no instant or more than 4096, or for times that decrease.
    """
    if Path(text).suffix.lower() == ".csv":
        rows = list(_rows(text))
    elif ":" in text:
        rows = [_instant(part) for part in text.split(",")]
    else:
        return PressureHistory.constant(_number(text, "pressure"))
    times, pressures = zip(*rows, strict=True) if rows else ((), ())
    return PressureHistory(times=tuple(times), pressures=tuple(pressures))


def _number(text: str, name: str) -> float:
    try:
        return float(text)
    except ValueError:
        return si_value(text.strip(), _UNITS[name], name)


def _instant(part: str) -> tuple[float, float]:
    time, colon, pressure = part.partition(":")
    if not colon:
        raise ParameterError(
            f"a point of a pressure history must be written 'time: pressure'. Received {shown(part)}. "
            "Write for example '1 day: 5 MPa'."
        )
    return _number(time, "time"), _number(pressure, "pressure")


def _rows(path: str) -> Iterator[tuple[float, float]]:
    text = read_text(path, "pressure history", largest=_LARGEST_FILE, refusal=ParameterError)
    head, *rows = [row for row in csv.reader(text.splitlines()) if row] or [[]]
    units = [_unit_of(name, column) for name, column in zip(_COLUMNS, (*head, "", ""), strict=False)]
    for number, row in enumerate(rows, start=2):
        if len(row) != len(_COLUMNS):
            raise ParameterError(f"{path}, row {number} must have a time and a pressure. Received {shown(row)}.")
        time, pressure = (
            si_value(f"{value.strip()} {unit}", _UNITS[name], f"{path}, row {number}: {name}")
            for value, unit, name in zip(row, units, _COLUMNS, strict=True)
        )
        yield time, pressure


def _unit_of(name: str, column: str) -> str:
    """Unit in a column title such as ``pressure [MPa]``."""
    word, bracket, unit = column.strip().partition("[")
    if word.strip().lower() != name or not bracket or not unit.endswith("]"):
        raise UnitError(
            f"a pressure history must have the columns 'time [s]' and 'pressure [Pa]', in this order; other units of "
            f"time and pressure are accepted. Received {shown(column)}. Name the columns in the first row."
        )
    return unit[:-1]
