"""What a sampled controller computes at one sample, as one CasADi Function."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import casadi as ca
import sympy as sp

from quakedesign.loop.steps import discrete_law
from quakedesign.loop.steps.discrete_law import Law, Lifted, Values

SIGNALS = (
    discrete_law.slip,
    discrete_law.rate,
    discrete_law.slip_error,
    discrete_law.rate_error,
    discrete_law.acceleration,
    discrete_law.next_reference,
    discrete_law.next_reference_rate,
    discrete_law.step,
    discrete_law.authority,
    discrete_law.held,
)


@dataclass(frozen=True)
class Decision:
    """What a controller decides at one sample.

    Attributes
    ----------
    pressure : SX
        That it asks for [Pa].
    integrals : list of SX
        ξ at the next sample.
    own : list of SX
        Memory of the scheme itself at the next sample.
    """

    pressure: Any
    integrals: list[Any]
    own: list[Any]


class Decided(ABC):
    """What a controller does with a law at one sample: one part of a scheme that samples.

    Attributes
    ----------
    own_size : int
        Entries of its own memory.
    """

    own_size: ClassVar[int] = 0

    @staticmethod
    @abstractmethod
    def derive(law: Law) -> tuple[sp.Expr, ...]:
        """Return the expressions that `decide` evaluates, with the numbers of the law in them."""

    @classmethod
    @abstractmethod
    def decide(cls, found: tuple[sp.Expr, ...], law: Law, known: Values, own: list[Any]) -> Decision:
        """What the controller does, given the expressions, the values of their symbols, and its own memory."""


@dataclass(frozen=True)
class ControlStep:
    """The sampled-step function of a controller, without plant and actuator.

    Attributes
    ----------
    function : casadi.Function
        (signals in the order of `SIGNALS`, integrals ξ, numbers of the law, memory of the scheme) → pressure [Pa],
        integrals and memory at the next sample, and push, the change of the pressure [Pa] that the change of ξ makes.
    numbers : tuple of float
        Of this law; another law of the same kind has the same function.
    """

    function: Any
    numbers: tuple[float, ...]


@lru_cache(maxsize=64)
def control_step(kind: type[Decided], law: Law) -> ControlStep:
    """Sampled-step function of a law under a scheme."""
    slopes = tuple(slope_of(law.pressure, symbol) for symbol in law.integrals)
    lifted = Lifted.of((*kind.derive(law), *slopes))
    symbols = {"signals": SIGNALS, "integrals": law.integrals, "numbers": lifted.numbers}
    inputs = {name: ca.SX.sym(name, len(parts)) for name, parts in symbols.items()}
    own = ca.SX.sym("own", kind.own_size)
    known = {s: inputs[name][i] for name, parts in symbols.items() for i, s in enumerate(parts)}
    split = len(lifted.expressions) - len(slopes)
    decision = kind.decide(lifted.expressions[:split], law, known, ca.vertsplit(own) if kind.own_size else [])
    changes = (after - known[s] for s, after in zip(law.integrals, decision.integrals, strict=True))
    slope = discrete_law.values(lifted.expressions[split:], known)
    push = sum((k * change for k, change in zip(slope, changes, strict=True)), start=ca.SX(0))
    results = [decision.pressure, _column(decision.integrals), _column(decision.own), push]
    names = ["pressure", "integrals", "own", "push"]
    function = ca.Function("control", [*inputs.values(), own], results, [*inputs, "own"], [f"{n}_next" for n in names])
    return ControlStep(function, lifted.values)


def slope_of(pressure: sp.Expr, integral: sp.Symbol) -> sp.Expr:
    """Slope of the pressure in an integral state; 0 where the law limits itself and so looks after its own windup."""
    limited = pressure.has(sp.Min, sp.Max, sp.Piecewise)
    return sp.Integer(0) if limited else sp.diff(pressure, integral)


def _column(entries: list[Any]) -> Any:
    return ca.vertcat(*entries) if entries else ca.SX(0, 1)
