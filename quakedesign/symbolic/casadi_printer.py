"""SymPy expressions in CasADi and NumPy: one traversal of the tree, two tables of operations."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache, reduce
from operator import add, mul
from types import ModuleType
from typing import Any

import casadi as ca
import numpy as np
import sympy as sp
from sympy.codegen.cfunctions import expm1

from quakedesign.errors import ParameterError
from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower

Value = ca.SX | np.ndarray | float  # value of a symbol or an expression
Values = Mapping[sp.Symbol, Value]
Operations = Mapping[type[sp.Basic], Callable[..., Value]]


def to_casadi(expressions: Sequence[sp.Expr], values: Values, motion: Sequence[ca.SX] = ()) -> list[ca.SX]:
    """Translate expressions to CasADi SX; every common subexpression is translated once.

    Parameters
    ----------
    expressions : sequence of Expr
        Of signed and absolute powers, sums, products, powers, Max, Min, Abs, sign, Piecewise and elementary functions.
    values : mapping of Symbol to SX
        Value of every free symbol.
    motion : sequence of SX
        Symbols whose increase defines the direction of motion. Where two branches of Max, Min or Abs meet, the
        derivative is that of the branch that is entered when the first symbol increases; if this symbol has no effect,
        the next one decides. Without symbols the derivative is the mean of both branches, as in CasADi. The values do
        not depend on `motion`.

    Returns
    -------
    list of SX
        Translated expressions, with sign(0) = 0.

    Raises
    ------
    ParameterError
        If a symbol has no value, an operation is not supported, or the last branch of a Piecewise is conditional.
    """
    table = {**_casadi_operations(), **(_kinks(ca.vertcat(*motion)) if motion else {})}
    return [ca.SX(item) for item in _translate(expressions, values, table)]


def to_numpy(expressions: Sequence[sp.Expr], values: Mapping[sp.Symbol, Value]) -> list[Value]:
    """Values of expressions at floats or at NumPy arrays of one shape, with the operations of `to_casadi`.

    Parameters
    ----------
    expressions : sequence of Expr
        As in `to_casadi`.
    values : mapping of Symbol to float or array
        Value of every free symbol.

    Raises
    ------
    ParameterError
        As in `to_casadi`.
    """
    return _translate(expressions, values, _numpy_operations())


def _translate(expressions: Sequence[sp.Expr], values: Mapping[sp.Symbol, Value], table: Operations) -> list[Value]:
    translated: dict[sp.Basic, Value] = dict(values)

    def walk(node: sp.Basic) -> Value:
        if node not in translated:
            translated[node] = _number(node) if node.is_number else _operate(node, table, walk)
        return translated[node]

    return [walk(sp.sympify(expression)) for expression in expressions]


def _number(node: sp.Basic) -> float:
    exact = node.p / node.q if node.is_Rational else None
    return float(node.evalf(30)) if exact is None else exact


def _operate(node: sp.Basic, table: Operations, walk: Callable[[sp.Basic], Value]) -> Value:
    if node.is_Add or node.is_Mul:
        # Sum or product; its numbers are combined exactly and then rounded once.
        numbers = [arg for arg in node.args if arg.is_number]
        rest = [walk(arg) for arg in node.args if not arg.is_number]
        first = [walk(node.func(*numbers))] if numbers else []
        return reduce(add if node.is_Add else mul, first + rest)
    if isinstance(node, SignedPower | AbsolutePower | sp.Pow) and node.args[1].is_number:
        return table[node.func](walk(node.args[0]), node.args[1])
    if node in (sp.true, sp.false):
        return float(bool(node))
    if isinstance(node, sp.Piecewise):
        if node.args[-1][1] != sp.true:
            raise ParameterError(f"the last branch of a piecewise expression must be unconditional. Received {node}.")
        result = walk(node.args[-1][0])
        for value, condition in reversed(node.args[:-1]):
            result = table[sp.Piecewise](walk(condition), walk(value), result)
        return result
    if node.func not in table:
        reason = f"the symbol {node} has no value" if node.is_Symbol else f"{node.func.__name__} is not supported"
        raise ParameterError(f"the expression cannot be evaluated: {reason}.")
    return table[node.func](*(walk(arg) for arg in node.args))


def _power(library: ModuleType, base: Value, exponent: sp.Expr) -> Value:
    """Power; exponents ±1, 2, 3, ±1/2 and ±3/2 use products and square roots, which is faster and more accurate."""
    if exponent in (1, -1):
        return base if exponent == 1 else 1 / base
    if exponent in (2, 3):
        return base * base if exponent == 2 else base * base * base
    if exponent in (sp.Rational(1, 2), sp.Rational(3, 2)):
        root: Value = library.sqrt(base)
        return root if exponent < 1 else base * root
    if exponent in (sp.Rational(-1, 2), sp.Rational(-3, 2)):
        return 1 / _power(library, base, -exponent)
    return base ** _number(exponent)


def _powers(library: ModuleType) -> dict[type[sp.Basic], Callable[..., Value]]:
    def signed(x: Value, a: sp.Expr) -> Value:
        sign: Value = library.sign(x)
        return sign if a == 0 else sign * _power(library, library.fabs(x), a)

    def absolute(x: Value, a: sp.Expr) -> Value:
        return _power(library, library.fabs(x), a)

    def larger(first: Value, *others: Value) -> Value:
        """Largest argument; max(0, x) is computed without a branch as (x + |x|)/2, which is exactly x or 0."""
        rest: Value = reduce(library.fmax, others)
        greater: Value = library.fmax(first, rest)
        return (rest + library.fabs(rest)) / 2 if isinstance(first, float) and first == 0 else greater

    elementary = {getattr(sp, name): getattr(library, name) for name in ("exp", "log", "sin", "cos", "tan", "tanh")}
    return {
        SignedPower: signed,
        AbsolutePower: absolute,
        sp.Pow: lambda x, a: _power(library, x, a),
        sp.Max: larger,
        sp.Min: lambda *parts: reduce(library.fmin, parts),
        sp.Abs: library.fabs,
        sp.sign: library.sign,
        sp.StrictLessThan: lambda a, b: a < b,
        sp.LessThan: lambda a, b: a <= b,
        sp.StrictGreaterThan: lambda a, b: a > b,
        sp.GreaterThan: lambda a, b: a >= b,
        **elementary,
    }


def _kinks(motion: ca.SX) -> dict[type[sp.Basic], Callable[..., Value]]:
    """Max, Min and Abs with CasADi's values, and the derivatives of the branch that a motion enters."""

    def not_less(a: Value, b: Value) -> Value:
        ahead: ca.SX | bool = True
        slopes = ca.jacobian(ca.SX(a) - b, motion)
        for slope in reversed(ca.vertsplit(slopes.T)):
            ahead = ca.logic_or(slope > 0, ca.logic_and(slope == 0, ahead))
        return ca.logic_or(a > b, ca.logic_and(a == b, ahead))

    def larger(a: Value, b: Value) -> Value:
        return ca.if_else(not_less(a, b), a, b)

    def smaller(a: Value, b: Value) -> Value:
        return ca.if_else(not_less(a, b), b, a)

    return {
        sp.Max: lambda *parts: reduce(larger, parts),
        sp.Min: lambda *parts: reduce(smaller, parts),
        sp.Abs: lambda a: larger(a, -a),
    }


@cache
def _casadi_operations() -> Operations:
    return _operations(ca, ca.asinh, ca.atan, ca.if_else, ca.logic_and, ca.logic_or)


@cache
def _numpy_operations() -> Operations:
    return _operations(np, np.arcsinh, np.arctan, np.where, np.logical_and, np.logical_or)


def _operations(library: ModuleType, *others: Callable[..., Value]) -> Operations:
    asinh, atan, choose, both, either = others
    other = {expm1: library.expm1, sp.asinh: asinh, sp.sinh: library.sinh, sp.cosh: library.cosh, sp.atan: atan}
    logic = {sp.Piecewise: choose, sp.And: lambda *c: reduce(both, c), sp.Or: lambda *c: reduce(either, c)}
    return _powers(library) | other | logic


# ----------------------------------------------------------------------
# Evaluation of CasADi Functions at many points at once.


def vectorised(function: ca.Function) -> Callable[..., "np.ndarray"]:
    """Function that evaluates a CasADi SX Function at many points at once in NumPy, faster than `Function.map`.

    Parameters
    ----------
    function : casadi.Function
        With dense inputs and one dense output.

    Returns
    -------
    callable
        Function of one array per input, of shape (entries, points), or (entries, 1) if all points share the input. It
        returns the entries of the output in column-major order, of shape (entries, points).

    Raises
    ------
    ParameterError
        If the function contains an unsupported CasADi operation.
    """
    steps: list[tuple[int, list[int], Any]] = []  # operation, indices of results, and of arguments (or a constant)
    for k in range(function.n_instructions()):
        code, out, into = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
        if code not in (ca.OP_CONST, ca.OP_INPUT, ca.OP_OUTPUT) and code not in _INSTRUCTIONS:
            raise ParameterError(f"the CasADi operation with code {code} is not supported in vectorised evaluation.")
        steps.append((code, out, function.instruction_constant(k) if code == ca.OP_CONST else into))

    def evaluated(*inputs: "np.ndarray") -> "np.ndarray":
        work: list[Value] = [0.0] * function.sz_w()
        result = np.empty((function.nnz_out(0), max(each.shape[1] for each in inputs)))
        with np.errstate(all="ignore"):
            for code, out, into in steps:
                if code == ca.OP_CONST:
                    work[out[0]] = into
                elif code == ca.OP_INPUT:
                    work[out[0]] = inputs[into[0]][into[1]]
                elif code == ca.OP_OUTPUT:
                    result[out[1]] = work[into[0]]
                else:
                    work[out[0]] = _INSTRUCTIONS[code](*(work[place] for place in into))
        return result

    return evaluated


_NAMED = {"NEG": "negative", "SQ": "square", "INV": "reciprocal", "NOT": "logical_not", "AND": "logical_and"}
_NAMED |= {"ADD": "add", "SUB": "subtract", "MUL": "multiply", "DIV": "divide", "POW": "power", "CONSTPOW": "power"}
_NAMED |= {"ASINH": "arcsinh", "ATAN": "arctan", "LT": "less", "LE": "less_equal", "EQ": "equal", "OR": "logical_or"}
_NAMED |= {
    n: n.lower() for n in "EXP LOG SQRT FABS FMAX FMIN SIGN SIN COS TAN TANH SINH COSH LOG1P EXPM1 HYPOT".split()
}
_INSTRUCTIONS: dict[int, Callable[..., Value]] = {
    **{getattr(ca, f"OP_{name}"): getattr(np, ours) for name, ours in _NAMED.items()},
    ca.OP_ASSIGN: lambda x: x,
    ca.OP_TWICE: lambda x: x + x,
    ca.OP_IF_ELSE_ZERO: lambda condition, x: np.where(condition, x, 0.0),
}
