"""A perturbation φ_e of the user's, written as text."""

import ast
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.rationals import rational
from quakedesign.simulation.loading import SYMBOLS

if TYPE_CHECKING:
    import sympy as sp

FUNCTIONS = ("sin", "cos", "tan", "exp", "log", "sqrt", "tanh", "atan", "Abs", "Min", "Max", "sign")
MOST_NODES = 300
MOST_BITS = 1024  # of an exact power


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
        As `quakedesign.simulation.Load` takes it.

    Raises
    ------
    ParameterError
        For anything else, or a value that is not a real number.
    """
    try:
        tree = ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise _refusal(text, text) from None
    if sum(1 for _ in ast.walk(tree)) > MOST_NODES:
        raise ParameterError(f"a perturbation must be short, {MOST_NODES} terms at most. Received more. Shorten it.")
    expression = _value(tree.body, text.strip())
    if not _real(expression):
        raise _refusal(text, text)
    return expression


def _real(expression: Any) -> bool:
    """Whether every number in an expression is real and finite."""
    return all(part.is_real and part.is_finite for part in sp.preorder_traversal(expression) if part.is_number)


def _value(node: ast.expr, text: str) -> Any:
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
                raise _refusal(text, f"{name} of {len(arguments)} arguments")
            return getattr(sp, name)(*(_value(argument, text) for argument in arguments))
    raise _refusal(text, ast.get_source_segment(text, node) or text)


def _power(base: Any, exponent: Any, text: str) -> Any:
    digits = max(base.p.bit_length(), base.q.bit_length()) if base.is_Rational else 1
    if not (exponent.is_Rational and abs(exponent) * digits <= MOST_BITS):
        raise _refusal(text, f"the exponent {str(exponent)[:40]}")
    return base**exponent


def _quotient(numerator: Any, denominator: Any, text: str) -> Any:
    if denominator == 0:
        raise _refusal(text, "a division by zero")
    return numerator / denominator


_OPERATIONS: dict[type[ast.operator], Callable[[Any, Any, str], Any]] = {
    ast.Add: lambda a, b, _: a + b,
    ast.Sub: lambda a, b, _: a - b,
    ast.Mult: lambda a, b, _: a * b,
    ast.Div: _quotient,
    ast.Pow: _power,
}


def _refusal(text: str, part: str) -> ParameterError:
    inside = f" in {text!r}" if part != text else ""
    return ParameterError(
        f"a perturbation consists of numbers, pi, {', '.join(SYMBOLS)}, + - * / ** with numbers as exponents, and "
        f"{', '.join(FUNCTIONS)}, and is real. Received {part!r}{inside}."
    )
