"""Base classes of control laws: closed loop for proofs, and controllers of a fault."""

import tomllib
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import fields
from fractions import Fraction
from functools import partial
from importlib.resources import files
from types import MappingProxyType
from typing import Any, ClassVar, Generic, Protocol, Self, TypeVar, runtime_checkable

import sympy as sp

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.exact import rational, six_digits
from quakedesign.fault import Fault
from quakedesign.laws.feed_forward import NONE, FeedForward
from quakedesign.laws.loop_field import LoopField
from quakedesign.text import shown


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Signals:
    """Signals that a control law may use.

    Attributes
    ----------
    slip, slip_rate : Expr
        x1 [m], x2 [m/s].
    slip_error, slip_rate_error : Expr
        e1 = x1 − r [m], e2 = x2 − r' [m/s].
    integrals : tuple of Expr
        The law's own states ξ.
    reference_acceleration : Expr
        r'' [m/s²]; zero by default, as for a reference at rest.
    """

    slip: sp.Expr
    slip_rate: sp.Expr
    slip_error: sp.Expr
    slip_rate_error: sp.Expr
    integrals: tuple[sp.Expr, ...]
    reference_acceleration: sp.Expr = sp.S.Zero


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """Sampling of a sampled law: scheme, settings, T_s and path of its guarantee.

    Attributes
    ----------
    step : Fraction
        T_s [s].
    scheme : str
        Name of a scheme of `quakedesign.loop.schemes`.
    settings : tuple of (str, Fraction)
        Numbers of the scheme by name, in its own units.
    delay, lag, diffusion : Fraction
        Delay from measurement to valve, time constant of the pump and L²/D of the diffusion path [s] of the design; the
        default path in every run and in `loop_transfer`.
    longest : Fraction
        Longest sampling interval [s] of aperiodic sampling in `simulate`, T_s the shortest; 0 for periodic sampling.
    """

    step: Fraction
    scheme: str = "explicit"
    settings: tuple[tuple[str, Fraction], ...] = ()
    delay: Fraction = Fraction(0)
    lag: Fraction = Fraction(0)
    diffusion: Fraction = Fraction(0)
    longest: Fraction = Fraction(0)

    @property
    def path(self) -> dict[str, Any]:
        """Delay, lag and L²/D [s] of the path from law to fault."""
        return {"delay": self.delay, "lag": self.lag, "diffusion": self.diffusion}

    def __str__(self) -> str:
        numbers = "".join(f", {name} {float(value)!r}" for name, value in self.settings)
        return f"{self.scheme}{numbers}"


L = TypeVar("L", bound="Law", covariant=True)


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class BaseGains(Generic[L]):
    """Gains of a law with λ = 1, the bound on |h'| for which they are proved, and their source.

    Attributes
    ----------
    law : Law
    lipschitz : Fraction
        Bound on |h'| [m/s³].
    source : str
    literature : bool
        False for gains that were computed with this package.
    """

    law: L
    lipschitz: Fraction
    source: str
    literature: bool


@checked_dataclass(frozen=True, kw_only=True)
class Law(ABC):
    """A law with exact gains whose closed loop can be proved stable.

    Attributes
    ----------
    gains : mapping of str to Fraction
        Exact gains, in the units of `gain_units`; numbers and texts are converted.

    Raises
    ------
    ParameterError
        For gains that are not a mapping, or a missing, unknown or non-finite gain.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    source: ClassVar[str]
    gain_units: ClassVar[Mapping[str, str]]

    gains: Mapping[str, Fraction]

    def __post_init__(self) -> None:
        if not isinstance(self.gains, Mapping):
            raise ParameterError(
                f"gains of {self.name} must be a mapping of name to number. Received {shown(self.gains)}. "
                "Use from_values for gains in order."
            )
        if set(self.gains) != set(self.gain_units):
            raise ParameterError(
                f"{self.name} needs the gains {', '.join(self.gain_units)}. Received {', '.join(self.gains) or 'none'}."
            )
        exact = {name: rational(self.gains[name], f"gain {name}") for name in self.gain_units}
        object.__setattr__(self, "gains", MappingProxyType(exact))

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        if "__repr__" not in vars(cls):  # otherwise a dataclass defines its own
            type.__setattr__(cls, "__repr__", Law.__repr__)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name} ≈ {six_digits(v)}' for name, v in self.numbers.items())})"

    @property
    def numbers(self) -> dict[str, Fraction]:
        """Gains and all other exact numbers of the law, by name."""
        return dict(self.gains)

    def __reduce__(self) -> tuple[Any, tuple[()]]:
        # A read-only view cannot be pickled, and campaigns send controllers to other processes.
        arguments = {f.name: getattr(self, f.name) for f in fields(self)} | {"gains": dict(self.gains)}
        return partial(type(self), **arguments), ()

    @classmethod
    @abstractmethod
    def loop_field(cls) -> LoopField:
        """Return the closed loop in symbols, derived from the law, as the subject of certificates."""

    @classmethod
    def from_values(cls, values: "tuple[str | float | Fraction, ...]", **more: Any) -> Self:
        """Return a law from gains in the order of `gain_units`; `more` are its other fields, by name.

        Raises
        ------
        ParameterError
            For a wrong number of gains.
        """
        if len(values) != len(cls.gain_units):
            raise ParameterError(
                f"{cls.name} needs {len(cls.gain_units)} gains ({', '.join(cls.gain_units)}). Received {len(values)}."
            )
        named = {name: rational(v, f"gain {name}") for name, v in zip(cls.gain_units, values, strict=True)}
        return cls(gains=named, **more)

    @classmethod
    def base_gains(cls) -> tuple[BaseGains[Self], ...]:
        """Return base gains with a proof, in the order in which a design tries them.

        Raises
        ------
        UnknownNameError
            When there are none for the law.
        """
        data = tomllib.loads((files("quakedesign.laws") / "families.toml").read_text(encoding="utf-8"))
        if cls.name not in (laws := {group["law"] for group in data.values()}):
            raise UnknownNameError(f"base gains exist for {', '.join(sorted(laws))}. Received {cls.name!r}.")
        return tuple(
            BaseGains(
                law=cls.from_values(tuple(gains)),
                lipschitz=Fraction(group["lipschitz"]),
                source=group["source"],
                literature=group["literature"],
            )
            for group in data.values()
            if group["law"] == cls.name
            for gains in group["gains"]
        )

    @property
    def lipschitz_limit(self) -> Fraction | None:
        """Least |h'| [m/s³] for which no certificate exists; None if it is not known for the law."""
        return None

    @classmethod
    def counterexample(
        cls, gains: Mapping[str, Fraction], uncertain: Mapping[str, tuple[Fraction, Fraction]]
    ) -> Mapping[str, Mapping[str, Fraction]] | None:
        """Suggest a Filippov equilibrium away from the origin, as ``parameters``, ``point`` and ``weights``.

        None if the law has none. The suggestion requires a check in exact arithmetic.
        """
        return None

    def _exact_gains(self) -> list[sp.Rational]:
        return [sp.Rational(v.numerator, v.denominator) for v in self.gains.values()]


Designed = TypeVar("Designed", covariant=True)


@runtime_checkable
class DesignProblem(Protocol[Designed]):
    """Design problem of a law for a fault, with the services that its design may use.

    Through it a law uses the searches for proofs without importing them. The options ``objective``, ``continuous``,
    ``feedforward``, ``measured`` and ``noise`` are those of `quakedesign.synthesis.design`.
    """

    @property
    def fault(self) -> Fault:
        """The fault."""

    def by_method(self, law: "type[Controller]") -> Designed:
        """Gains by the method of the family that a law belongs to."""

    def assessed(self, controller: "Controller") -> Designed:
        """Verdict on a controller whose gains the law designed itself."""

    def undecided(self, name: str, reason: str) -> Designed:
        """Undecided result for a law called `name`, without gains, and the reason."""


@checked_dataclass(frozen=True, kw_only=True)
class Controller(Law):
    """A law that acts on the slip of a fault through the fluid pressure.

    Attributes
    ----------
    gains : mapping of str to Fraction
        By name, exact; their units are the law's `gain_units`.
    """

    integral_units: ClassVar[tuple[str, ...]]

    @property
    def sampling(self) -> Sampling | None:
        """Sampling of a sampled law; None for a law in continuous time, for which any scheme is possible."""
        return None

    @property
    def sampling_time(self) -> float | None:
        """T_s [s] of a sampled law; None in continuous time."""
        return float(self.sampling.step) if self.sampling else None

    def other_step(self, fault: Fault) -> str:
        """A note if T_s of a sampled law differs from that of the fault; empty if both are equal."""
        if self.sampling_time in (None, fault.sampling_time):
            return ""
        return f"NOT for the fault's T_s = {fault.sampling_time:g} s: the law runs every {self.sampling_time:.4g} s"

    warning_at_rest: ClassVar[str] = ""
    """Warning about a law that is unstable while the fault is at rest."""

    @property
    def of_slip(self) -> Any:
        """Matrices of a sampled linear law that measures the slip alone (`LinearLaw`), or None."""
        return None

    @property
    def while_moving(self) -> "Controller":
        """The law without its limit at rest."""
        return self

    @property
    def scale(self) -> Fraction | None:
        """Scale λ [-] of the loop; None for a law without a scale."""
        return None

    @property
    def divisor(self) -> Fraction | None:
        """Divisor μ0N̂0 [m²/kg] of ν; None for a law that computes the pressure directly."""
        return None

    @property
    def feedforward(self) -> FeedForward:
        """Feed-forward from a plant model, added to ν [m/s²]."""
        return NONE

    @classmethod
    def for_authority(cls, values: "tuple[str | float | Fraction, ...]", authority: Fraction) -> Self:
        """Return a law from gains in order, for a fault whose least μN̂ is `authority` [m²/kg]."""
        return cls.from_values(values)

    def scaled(self, scale: str | float | Fraction) -> Self:
        """Return the law with the same base gains and another λ; raises for a law without a scale."""
        raise ParameterError(f"scale is for sliding modes. Received a scale for {self.name}. Omit the scale.")

    def with_divisor(self, divisor: Fraction) -> Self:
        """Return the law with another divisor; raises for a law without a divisor."""
        raise ParameterError(f"{self.name} has no divisor. Received the divisor {divisor}. Omit the divisor.")

    def with_feedforward(self, feedforward: FeedForward) -> Self:
        """Return the same law with another feed-forward; raises for a law without one."""
        if feedforward != NONE:
            raise ParameterError(
                f"feedforward is for sliding modes. Received {feedforward.name} for {self.name}. Omit feedforward."
            )
        return self

    @classmethod
    def design(cls, problem: DesignProblem[Designed]) -> Designed:
        """Return gains with a proof for a fault, by the method of the law's family; a law may override it."""
        return problem.by_method(cls)

    def premises(self, fault: Fault, certificate: Any) -> tuple[Any, ...]:
        """Premises of proofs on a fault, besides those of the law's family (`quakedesign.lyapunov.exact.premises`)."""
        return ()

    @abstractmethod
    def pressure(self, signals: Signals) -> sp.Expr:
        """Commanded fluid pressure p [Pa]."""

    @abstractmethod
    def integral_rates(self, signals: Signals) -> tuple[sp.Expr, ...]:
        """Time derivatives of the law's own states."""
