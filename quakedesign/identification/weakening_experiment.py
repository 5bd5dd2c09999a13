"""Experiments with slip-weakening friction: at a measured slip, or with a block pulled by a stiff spring."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sympy as sp
from numpy import ndarray
from scipy.optimize.elementwise import find_root

from quakedesign.fault import FrictionLaw
from quakedesign.identification.experiment import Coordinate, Experiment
from quakedesign.symbolic.casadi_printer import to_numpy
from quakedesign.symbolic.plant import x1

START = "start_friction"
_SMALL_SHARE = 0.3  # an additional noise of this share of the friction noise increases the total by 4 %


@dataclass(frozen=True, kw_only=True)
class _Weakening(Experiment):
    """An experiment with a law that depends on slip alone; the quantities of the law are the first coordinates."""

    law: FrictionLaw
    coordinates: tuple[Coordinate, ...]

    def strength(self, slip: ndarray, fitted: ndarray) -> tuple[ndarray, ndarray]:
        """Friction of the law [-] and its slope in slip [1/m]."""
        friction, per_slip = self._rows(self._expressions[:2], slip, fitted)
        return friction, per_slip

    def strength_slopes(self, slip: ndarray, fitted: ndarray) -> ndarray:
        """Derivatives of `strength` [-] by the logarithms of the quantities of the law, shape (slips, quantities)."""
        rows = self._rows(self._expressions[2:], slip, fitted)
        return np.asarray(np.array(rows).T * np.exp(fitted[: len(self._symbols)]))

    def _rows(self, expressions: list[sp.Expr], slip: ndarray, fitted: ndarray) -> list[ndarray]:
        values = dict(zip(self._symbols, np.exp(fitted[: len(self._symbols)]), strict=True))
        return [np.asarray(row + np.zeros_like(slip)) for row in to_numpy(expressions, values | {x1: slip})]

    @cached_property
    def _symbols(self) -> list[sp.Symbol]:
        symbols = self.law.symbols()
        return [symbols[c.name] for c in self.coordinates if c.name in symbols]

    @cached_property
    def _expressions(self) -> list[sp.Expr]:
        friction = sp.sympify(self.law.symbolic().coefficient(x1, 0)).rewrite(sp.Piecewise)
        return [friction, *(friction.diff(symbol) for symbol in (x1, *self._symbols))]


@dataclass(frozen=True, kw_only=True)
class MeasuredSlip(_Weakening):
    """Friction of a law at the measured, non-negative slip [m]; `slip_noise` is its standard deviation [m]."""

    slip: ndarray
    slip_noise: float

    def friction(self, fitted: ndarray) -> ndarray:
        """Friction coefficient [-] at every slip."""
        return self.strength(self.slip, fitted)[0]

    def slopes(self, fitted: ndarray) -> ndarray:
        """Derivatives of `friction` by the logarithms of the quantities of the law, the only coordinates here."""
        return self.strength_slopes(self.slip, fitted)

    def remarks(self, fitted: ndarray, noise: float) -> tuple[str, ...]:
        """Remark if the noise of the slip, which the fit neglects, affects friction."""
        felt = float(np.max(np.abs(self.strength(self.slip, fitted)[1]))) * self.slip_noise
        text = f"the slip is taken as exact, although its noise of {self.slip_noise:.2g} m moves friction by {felt:.2g}"
        return (text,) if felt > _SMALL_SHARE * noise else ()


@dataclass(frozen=True, kw_only=True)
class SpringLoaded(_Weakening):
    """A block at rest until its strength is reached, which then slips until the spring balances friction.

    Slip never decreases. With a soft spring, friction falls faster than the spring force and the block jumps. No
    balance describes this, so slip and friction are NaN then. `load_point` is the displacement of the load
    point since the first sample [m], `normal` the normal load in Pa, N or 1. Coordinates: those of the
    law, the stiffness if not given, `START` last.
    """

    load_point: ndarray
    normal: ndarray
    stiffness: float | None

    def friction(self, fitted: ndarray) -> ndarray:
        """Shear over normal force [-] at every sample."""
        limit, softness = self._without_slip(fitted)
        return np.asarray(limit - softness * self.slip(fitted)[0])

    def slopes(self, fitted: ndarray) -> ndarray:
        """Derivatives; those of slip follow from the balance at the sample where it was reached."""
        (slip, since), (_, softness) = self.slip(fitted), self._without_slip(fitted)
        at_fixed_slip = np.zeros((len(slip), len(fitted)))
        at_fixed_slip[:, -1] = self.normal[0] / self.normal
        if self.stiffness is None:
            at_fixed_slip[:, -2] = softness * (self.load_point - slip)
        laws = np.zeros_like(at_fixed_slip)
        laws[:, : len(self._symbols)] = self.strength_slopes(slip[since], fitted)
        per_slip = self.strength(slip[since], fitted)[1]
        moved = (at_fixed_slip[since] - laws) / (softness[since] + per_slip)[:, None]
        moved[slip == 0] = 0
        return np.asarray(at_fixed_slip - softness[:, None] * moved)

    def _without_slip(self, fitted: ndarray) -> tuple[ndarray, ndarray]:
        """Shear over normal force without slip, and its decrease per slip [1/m]."""
        softness = (np.exp(fitted[-2]) if self.stiffness is None else self.stiffness) / self.normal
        return np.asarray(fitted[-1] * self.normal[0] / self.normal + softness * self.load_point), softness

    def slip(self, fitted: ndarray) -> tuple[ndarray, ndarray]:
        """Slip [m] at every sample, and the sample at which it was reached."""
        limit, softness = self._without_slip(fitted)
        strength, weakening = self.strength(np.zeros(1), fitted)
        if np.min(softness + weakening) <= 0:
            return np.full(len(limit), np.nan), np.arange(len(limit))
        slip, slips = np.zeros(len(limit)), limit > strength

        def excess(slip: ndarray, limit: ndarray, softness: ndarray) -> ndarray:
            return limit - softness * slip - self.strength(slip, fitted)[0]  # type: ignore[no-any-return]

        if np.any(slips):
            own = limit[slips], softness[slips]
            slip[slips] = find_root(excess, (0.0, own[0] / own[1]), args=own).x
        largest = np.maximum.accumulate(slip)
        new = np.where(slip == largest, np.arange(len(limit)), 0)
        return largest, np.maximum.accumulate(new)
