"""Friction over slip, with its slopes, of a law that depends on slip alone."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import sympy as sp

from quakedesign.fault import FrictionLaw
from quakedesign.symbolic.casadi_printer import to_numpy
from quakedesign.symbolic.plant import x1


@dataclass(frozen=True)
class Curve:
    """Friction of a law over slip, in NumPy, for logarithms of what is fitted.

    Attributes
    ----------
    law : FrictionLaw
    names : tuple of str
        What is fitted, in its order.
    """

    law: FrictionLaw
    names: tuple[str, ...]

    def friction(self, slip: "np.ndarray", fitted: "np.ndarray") -> "tuple[np.ndarray, np.ndarray]":
        """Friction [-] and its slope in slip [1/m]."""
        friction, per_slip = self._rows(self._expressions[:2], slip, fitted)
        return friction, per_slip

    def slopes(self, slip: "np.ndarray", fitted: "np.ndarray") -> "np.ndarray":
        """Derivatives in the logarithms, shape (slips, names)."""
        rows = self._rows(self._expressions[2:], slip, fitted)
        slopes: np.ndarray = np.array(rows).T * np.exp(fitted[: len(self.names)])
        return slopes

    def _rows(self, expressions: Any, slip: "np.ndarray", fitted: "np.ndarray") -> "list[np.ndarray]":
        values = dict(zip(self._symbols, np.exp(fitted[: len(self.names)]), strict=True))
        return [row + np.zeros_like(slip) for row in to_numpy(expressions, values | {x1: slip})]

    @cached_property
    def _symbols(self) -> list[Any]:
        return [self.law.symbols()[name] for name in self.names]

    @cached_property
    def _expressions(self) -> list[Any]:
        friction = sp.sympify(self.law.symbolic().coefficient(x1, 0)).rewrite(sp.Piecewise)
        return [friction, *(friction.diff(symbol) for symbol in (x1, *self._symbols))]
