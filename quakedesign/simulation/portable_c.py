"""Operations in C that have the same digits everywhere, the elementary functions among them."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import casadi as ca

from quakedesign.simulation.c_files import c_file
from quakedesign.simulation.elementary import FUNCTIONS, THIRD, any_power, cube_root, power, verbatim
from quakedesign.simulation.instructions import Instruction, NotPortableError, instructions

_ATOMIC = {
    ca.OP_POW: "two_to",
    ca.OP_CONSTPOW: "two_to",
    ca.OP_LOG: "exponent_of",
    ca.OP_LOG1P: "mantissa_of",
    ca.OP_SINH: "near_cube_root",
}
_BINARY = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
_COMPARED = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}
_JOINED = {ca.OP_AND: "&", ca.OP_OR: "|"}
_WRITTEN = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "2 * {0}",
    ca.OP_INV: "1 / {0}",
    ca.OP_FABS: "fabs({0})",
    ca.OP_SQRT: "sqrt({0})",
    ca.OP_SIGN: "{0} < 0 ? -1.0 : {0} > 0 ? 1.0 : {0}",
}
_OF_THE_LIBRARY = {
    ca.OP_FMOD: "fmod",
    ca.OP_CEIL: "ceil",
    ca.OP_TAN: "tan",
    ca.OP_ATAN: "atan",
    ca.OP_SINH: "sinh",
    ca.OP_COSH: "cosh",
    ca.OP_ASINH: "asinh",
    ca.OP_LOG1P: "log1p",
}


@dataclass(frozen=True)
class Value:
    """A value in C.

    Attributes
    ----------
    text : str
    true_or_false : bool
    """

    text: str
    true_or_false: bool = False

    @property
    def number(self) -> str:
        """As a double."""
        return f"({self.text} ? 1.0 : 0.0)" if self.true_or_false else self.text

    @property
    def condition(self) -> str:
        """As what is true or false."""
        return self.text if self.true_or_false else f"({self.text} != 0)"


def operation(code: int, arguments: Sequence[Value], named: Callable[[int], str | None]) -> Value:
    """Result of an operation in C; `named` are the functions to call for operations, by code.

    Raises
    ------
    NotPortableError
    """
    numbers = [argument.number for argument in arguments]
    if name := named(code):
        return Value(f"{name}({', '.join(numbers)})")
    if code in _BINARY:
        return Value(f"{numbers[0]} {_BINARY[code]} {numbers[1]}")
    if code in _COMPARED:
        return Value(f"{numbers[0]} {_COMPARED[code]} {numbers[1]}", True)
    if code in _JOINED:
        return Value(f"{arguments[0].condition} {_JOINED[code]} {arguments[1].condition}", True)
    if code == ca.OP_NOT:
        return Value(f"!{arguments[0].condition}", True)
    if code == ca.OP_IF_ELSE_ZERO:
        return Value(f"{arguments[0].condition} ? {numbers[1]} : 0.0")
    if code in _WRITTEN:
        return Value(_WRITTEN[code].format(*numbers))
    raise NotPortableError(f"operation {code}")


def constant(value: float) -> str:
    """A float in C, to its last bit."""
    if math.isnan(value):
        return "NAN"
    return f"({'-' if value < 0 else ''}INFINITY)" if math.isinf(value) else f"({value.hex()})"


def portable_name(code: int) -> str | None:
    """Name in C of an elementary function."""
    return f"portable_{FUNCTIONS[code].__name__}" if code in FUNCTIONS else None


def called_alone(code: int) -> str | None:
    """Name in C of a function of the C library that is called for one number at a time."""
    return _OF_THE_LIBRARY.get(code)


@cache
def elementary_c() -> str:
    """The elementary functions in C, to be inlined."""
    parts: list[Callable[..., Any]] = [*dict.fromkeys(FUNCTIONS.values()), cube_root, any_power]
    written = "".join(_function_c(function) for function in parts if function is not power)
    return c_file("portable.c") + written + c_file("power.c", third=constant(THIRD))


def _function_c(function: Callable[..., Any]) -> str:
    count = function.__code__.co_argcount
    with verbatim(bits=True):
        arguments = [ca.SX.sym(f"x{i}") for i in range(count)]
        written = ca.Function("written", arguments, [ca.cse([function(*arguments)])[0]])
    lines, values, end = list[str](), dict[int, Value](), ""
    for number, work in enumerate(instructions(written)):
        if work.operation == ca.OP_OUTPUT:
            end = values[work.taken[0]].number
            continue
        if work.operation == ca.OP_INPUT:
            values[work.given[0]] = Value(f"x{work.taken[0]}")
            continue
        arguments_ = [values[i] for i in work.taken]
        if work.operation in (ca.OP_POW, ca.OP_CONSTPOW):
            arguments_ = arguments_[1:]
        values[work.given[0]] = declared(lines, number, work, arguments_, _ATOMIC.get)
    head = ", ".join(f"double x{i}" for i in range(count))
    body = "\n".join(f"  {line}" for line in lines)
    return f"\nPORTABLE double portable_{function.__name__}({head}) {{\n{body}\n  return {end};\n}}\n"


def declared(
    lines: list[str], number: int, work: Instruction, arguments: Sequence[Value], named: Callable[[int], str | None]
) -> Value:
    """Value of an instruction, computed by a line that is added."""
    if work.operation == ca.OP_CONST:
        return Value(constant(work.constant))
    made = operation(work.operation, arguments, named)
    name = f"{'b' if made.true_or_false else 'v'}{number}"
    lines.append(f"const {'_Bool' if made.true_or_false else 'double'} {name} = {made.text};")
    return replace(made, text=name)


@cache
def in_place_of_the_library() -> str:
    """Text before C of CasADi, which then calls the portable functions in place of those of the C library."""
    names = {FUNCTIONS[code].__name__: code for code in FUNCTIONS if code != ca.OP_POW}
    called = {"power": "pow"}
    replaced = "".join(f"#define {called.get(name, name)} portable_{name}\n" for name in names)
    return elementary_c() + "\n" + replaced + "\n"
