"""User-defined parts, one of every kind, as in a file outside the package."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, ClassVar

import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.fault import FrictionLaw
from quakedesign.laws import Controller, LoopField
from quakedesign.laws.base import BaseGains
from quakedesign.laws.cta import ContinuousTwisting
from quakedesign.loop.actuators.base import SampledStage
from quakedesign.loop.schemes.explicit import Explicit
from quakedesign.loop.sensing import Sensor, SlipStage
from quakedesign.sos.exact.proofs import Square, SumOfSquares
from quakedesign.sos.solve.engine import Method

X1, X2, XI, K1, K2, K3, BETA, S, W, B = sp.symbols("x1 x2 xi k1 k2 k3 beta s w b", real=True)


@dataclass(frozen=True, kw_only=True)
class PID(Controller):
    """p = −k1·e1 − k2·e2 − k3·ξ, ξ' = e1."""

    name: ClassVar[str] = "pid"
    title: ClassVar[str] = "PID"
    source: ClassVar[str] = "textbooks"
    gain_units: ClassVar[Mapping[str, str]] = {"k1": "Pa/m", "k2": "Pa s/m", "k3": "Pa/(m s)"}
    integral_units: ClassVar[tuple[str, ...]] = ("m s",)

    def pressure(self, signals):
        states = signals.slip_error, signals.slip_rate_error, *signals.integrals
        return -sum(k * x for k, x in zip(self._exact_gains(), states, strict=True))

    def integral_rates(self, signals):
        return (signals.slip_error,)

    @classmethod
    def loop_field(cls):
        pushed = S * X1 - W * X2 - BETA * B * (K1 * X1 + K2 * X2 + K3 * XI)
        return LoopField(
            states={X1: 1, X2: 1, XI: 1},
            field={X1: X2, X2: sp.expand(pushed), XI: X1},
            gains=(K1, K2, K3),
            constants=(B,),
            uncertain=(BETA, S, W),
            domain="reals",
        )

    @classmethod
    def design(cls, problem):
        """Gains for a triple pole at −2 1/s without a plant: stiff enough for both faults of the paper."""
        return problem.assessed(cls.from_values(("1e8", "1e8", "1e7")))


class Mislaid(PID):
    """Declares the loop of a PID, with the sign of the pressure reversed."""

    name: ClassVar[str] = "mislaid"

    def pressure(self, signals):
        return -super().pressure(signals)


@dataclass(frozen=True, kw_only=True)
class OwnTwisting(ContinuousTwisting):
    """2-CTA with user-defined base gains."""

    name: ClassVar[str] = "own-twisting"
    title: ClassVar[str] = "own twisting"

    @classmethod
    def base_gains(cls):
        law = cls.from_values(("7", "5", "2.3", "1.1"))
        return (BaseGains(law=law, lipschitz=Fraction(1), source="tests", literature=False),)


@dataclass(frozen=True, slots=True, kw_only=True)
class Hyperbolic(FrictionLaw):
    """μ(slip) = residual + drop/(1 + slip/critical_slip)."""

    name: ClassVar[str] = "hyperbolic"
    source: ClassVar[str] = "tests"
    domain: ClassVar[str] = "slip >= 0"

    residual: float = field(metadata={"unit": "", "symbol": r"\mu_{res}"})
    drop: float = field(metadata={"unit": "", "symbol": r"\Delta\mu"})
    critical_slip: float = field(metadata={"unit": "m", "symbol": "d_c"})

    def __post_init__(self):
        for name in self.quantities():
            if not 0 < getattr(self, name) < float("inf"):
                raise ParameterError(f"{name} must be positive. Received {getattr(self, name)!r}.")

    def coefficient(self, slip, rate, *state):
        return self.residual + self.drop / (1 + slip / self.critical_slip)

    def extended(self, slip, rate, *state):
        return self.coefficient(sp.Max(slip, 0), rate)

    @property
    def bounds(self):
        return self.residual, self.residual + self.drop

    @property
    def slip_slope(self):
        return self.drop / self.critical_slip

    @property
    def rate_slope(self):
        return 0


@dataclass(frozen=True, kw_only=True)
class Smoothing(SampledStage):
    """Mean of the present commanded pressure and that of the last sample."""

    name: ClassVar[str] = "smoothing"

    @property
    def start(self):
        return (0.0,)

    def apply(self, numbers: Any, memory: list[Any], pressure: Any, step: float):
        return (memory[0] + pressure) / 2, [pressure]


@dataclass(frozen=True, kw_only=True)
class Halved(Explicit):
    """The law at the measured state, with half the increment of its integral states."""

    name: ClassVar[str] = "halved"

    @staticmethod
    def derive(law):
        return law.pressure, *(rate / 2 for rate in law.rates)


@dataclass(frozen=True, kw_only=True)
class Offset(SlipStage):
    """An instrument with an offset."""

    hardware: ClassVar[bool] = True

    offset: float

    @property
    def start(self):
        return ()

    def numbers(self, step: float):
        return (self.offset,)

    def pass_on(self, numbers: list[Any], memory: list[Any], slip: Any):
        return slip + numbers[0], memory


@dataclass(frozen=True, kw_only=True)
class Backward(Sensor):
    """Exact slip, slip rate as difference of the last two."""

    period: float

    @property
    def step(self):
        return self.period

    @property
    def numbers(self):
        return ()

    @property
    def start(self):
        return (0.0,)

    def measure(self, numbers: list[Any], memory: list[Any], x: Any):
        import casadi as ca

        return ca.vertcat(x[0], (x[0] - memory[0]) / self.period), [x[0]]

    @property
    def software(self):
        return self


class Monomials(Method):
    """c·x^2k as one square."""

    name: ClassVar[str] = "monomials"
    order: ClassVar[int] = 0

    def propose(self, asked):
        (power, coefficient), *more = asked.target.items()
        if more or any(n % 2 for n in power):
            return None
        half = tuple(n // 2 for n in power)
        return SumOfSquares(squares=(Square(basis=(half,), gram=(coefficient,)),), cofactors=())
