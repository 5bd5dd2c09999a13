"""A fault that differs from the nominal one within its uncertainty box, without deriving or compiling anything anew."""

import math
from dataclasses import astuple, dataclass, fields
from typing import Any

import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.fault import Fault, FrictionLaw
from quakedesign.symbolic import plant


@dataclass(frozen=True, slots=True, kw_only=True)
class Variation:
    """True parameters over nominal ones; the controller keeps what it was designed with.

    Attributes
    ----------
    stiffness, damping, authority : float
        Factors of k̂, η̂ and N̂ [-], each within the fault's box.
    weakening : float
        Share of the friction drop that takes place [-], 0 … 1: μ = μ_res + weakening·(μ_law − μ_res). With the
        authority it sets β; every value keeps μ and its slope within the bounds of every box.
    amplitude : float
        Share of the amplitude of the fault's sinusoidal disturbance that acts [-], 0 … 1.
    phase : float
        Of that sine at the start [rad], 0 … 2π.
    """

    stiffness: float = 1.0
    damping: float = 1.0
    authority: float = 1.0
    weakening: float = 1.0
    amplitude: float = 1.0
    phase: float = 0.0

    def require_within(self, fault: Fault) -> None:
        """Refuse what the fault's uncertainty box excludes.

        Raises
        ------
        ParameterError
        """
        box = fault.box
        for name in ("stiffness", "damping", "authority"):
            width = getattr(box, name)
            _require(name, getattr(self, name), float(1 - width), float(1 + width), f"the box {box.name!r}")
        for name, highest in (("weakening", 1.0), ("amplitude", 1.0), ("phase", 2 * math.pi)):
            _require(name, getattr(self, name), 0.0, highest, "every box")

    @property
    def values(self) -> tuple[float, ...]:
        """The factors in the order of `symbols`."""
        return astuple(self)


def _require(name: str, value: float, low: float, high: float, where: str) -> None:
    if not low - 1e-12 <= value <= high + 1e-12:
        raise ParameterError(
            f"{name} of a variation must be {low:g} to {high:g} in {where}. Received {value!r}. "
            "Choose a value inside, or a fault with a wider box."
        )


def names() -> tuple[str, ...]:
    """Names of the factors, in order."""
    return tuple(field.name for field in fields(Variation))


def complete(factors: tuple[Any, ...]) -> tuple[Any, ...]:
    """All factors, those left out at the end as in the nominal fault."""
    return factors + astuple(Variation())[len(factors) :]


def symbols() -> tuple[sp.Symbol, ...]:
    """Symbols of the factors, none of which is negative."""
    return tuple(map(symbol, names()))


def symbol(name: str) -> sp.Symbol:
    """Symbol of one factor."""
    return sp.Symbol(f"factor_{name}", nonnegative=True)


def varied_disturbance(disturbance: sp.Expr) -> sp.Expr:
    """The disturbance of a fault with share and phase of its sine."""
    return disturbance.replace(sp.sin, lambda angle: symbol("amplitude") * sp.sin(angle + symbol("phase")))


@dataclass(frozen=True)
class WeakenedFriction:
    """A friction law of which only a share of the drop takes place."""

    law: FrictionLaw
    share: Any

    def coefficient(self, slip: Any, rate: Any) -> Any:
        """Friction coefficient [-]."""
        return self._weakened(self.law.coefficient(slip, rate))

    def extended(self, slip: Any, rate: Any) -> Any:
        """Friction coefficient [-] continued to all slips and rates."""
        return self._weakened(self.law.extended(slip, rate))

    def _weakened(self, value: Any) -> Any:
        residual = sp.sympify(self.law.bounds[0])
        return residual + self.share * (value - residual)


def varied_values(fault: Fault) -> dict[sp.Symbol, sp.Expr]:
    """Value of every hatted parameter, nominal number times symbol."""
    stiffness, damping, authority, *_ = symbols()
    factors = {plant.k_hat: stiffness, plant.eta_hat: damping, plant.N_hat: authority}
    return {hatted: value * factors.get(hatted, 1) for hatted, value in plant.plant_values(fault).items()}
