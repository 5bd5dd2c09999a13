"""Discrete control law: expressions in the signals of one sample; numbers become parameters."""

from dataclasses import dataclass
from typing import Any

import sympy as sp

from quakedesign.laws import Controller, Signals
from quakedesign.laws.sampled_controller import integral_symbols
from quakedesign.symbolic.casadi_printer import to_casadi

Values = dict[sp.Symbol, Any]

slip, rate = sp.symbols("slip rate", real=True)
slip_error, rate_error = sp.symbols("slip_error rate_error", real=True)
acceleration = sp.Symbol("reference_acceleration", real=True)
next_reference, next_reference_rate = sp.symbols("next_reference next_reference_rate", real=True)
applied_pressure = sp.Symbol("held", real=True)
step = sp.Symbol("T_s", positive=True)
authority = sp.Symbol("B_0", positive=True)


def values(expressions: tuple[sp.Expr, ...], numbers: Values) -> list[Any]:
    """Expressions as CasADi SX."""
    return to_casadi(list(expressions), numbers)


@dataclass(frozen=True)
class DiscreteLaw:
    """Pressure and integral states of a law, in the symbols of this module."""

    pressure: sp.Expr  # p [Pa]
    rates: tuple[sp.Expr, ...]  # ξ' of every integral state
    integrals: tuple[sp.Symbol, ...]  # ξ

    @classmethod
    def of(cls, controller: Controller | None, constant_pressure: float) -> "DiscreteLaw":
        """Law of a controller, through its public expressions, or a constant pressure [Pa]."""
        integrals = integral_symbols(controller)
        if controller is None:
            return cls(sp.Float(constant_pressure), (), ())
        signals = Signals(
            slip=slip,
            slip_rate=rate,
            slip_error=slip_error,
            slip_rate_error=rate_error,
            integrals=integrals,
            reference_acceleration=acceleration,
        )
        return cls(sp.sympify(controller.pressure(signals)), tuple(controller.integral_rates(signals)), integrals)


@dataclass(frozen=True)
class Lifted:
    """Expressions with symbols in place of numbers, so that laws with other gains share compiled code."""

    expressions: tuple[sp.Expr, ...]
    numbers: tuple[sp.Symbol, ...]  # Positive; signs stay in the expressions
    values: tuple[float, ...]  # Values of the symbols

    @classmethod
    def of(cls, expressions: tuple[sp.Expr, ...]) -> "Lifted":
        """Replace every number by a symbol, except 0, ±1 and exponents."""
        symbols: dict[sp.Expr, sp.Symbol] = {}
        lifted = tuple(_lift(sp.sympify(expression), symbols) for expression in expressions)
        return cls(lifted, tuple(symbols.values()), tuple(float(number.evalf(30)) for number in symbols))


def _lift(node: Any, symbols: dict[sp.Expr, sp.Symbol]) -> Any:
    if node.is_number:
        if node in (0, 1, -1):
            return node
        return sp.sign(node) * symbols.setdefault(abs(node), sp.Symbol(f"number_{len(symbols)}", positive=True))
    if node.is_Add or node.is_Mul:
        numbers = node.func(*(arg for arg in node.args if arg.is_number))
        rest = sorted((arg for arg in node.args if not arg.is_number), key=_structure)
        return node.func(_lift(numbers, symbols), *(_lift(arg, symbols) for arg in rest))
    if not node.args:
        return node
    return node.func(_lift(node.args[0], symbols), *node.args[1:])


def _structure(node: sp.Expr) -> Any:
    """Sorting key without the numerical factor of the node, so that names do not depend on values."""
    return sp.default_sort_key(node.as_independent(*node.free_symbols, as_Add=False)[1])
