"""Base class of friction laws."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import Field, fields
from typing import TYPE_CHECKING, Any, ClassVar, Self

from quakedesign.errors import ParameterError
from quakedesign.exact import rational
from quakedesign.fault.equilibrium import AT_REST, STEADY_SLIDING, FaultEquilibrium

if TYPE_CHECKING:
    import sympy as sp


class FrictionLaw(ABC):
    """A friction law μ(slip, slip rate, state …), written once, whose parameters are its attributes.

    A subclass is a frozen dataclass. Each quantity carries ``metadata`` with ``unit`` (for pint), ``symbol`` (LaTeX)
    and ``example`` (for templates); a field without a symbol is an option, not a quantity. The same methods serve
    numbers, exact rationals and symbols: `exact` and `symbolic` return copies of the law with such parameters.

    A law without state defines `name`, `source`, `domain`, `coefficient`, `extended`, `bounds`, `slip_slope` and
    `rate_slope`. A law with state also names its variables in `state_names` (with `state_units`), and defines
    `state_rates`, `steady_state`, `operating_rate` and `working_rates`.
    """

    name: ClassVar[str]
    source: ClassVar[str]
    domain: ClassVar[str]
    state_names: ClassVar[tuple[str, ...]] = ()
    state_units: ClassVar[tuple[str, ...]] = ()
    equilibrium: ClassVar[FaultEquilibrium] = AT_REST

    def __init_subclass__(cls, **named: Any) -> None:
        super().__init_subclass__(**named)
        cls.equilibrium = STEADY_SLIDING if cls.state_names else AT_REST

    @abstractmethod
    def coefficient(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] at a slip [m], a slip rate [m/s] and a state inside the domain of the law."""

    @abstractmethod
    def extended(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] extended to all slips, rates and states, so that the bounds hold everywhere."""

    def state_rates(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "tuple[sp.Expr, ...]":
        """Time derivative of every state variable in its unit per second; empty for a law without state."""
        return ()

    @property
    def stress_exponents(self) -> tuple[float, ...]:
        """∂ln(state)/∂ln(effective normal stress) [-] of every state variable at a sudden change of the stress."""
        return (0,) * len(self.state_names)

    def steady_state(self, rate: "sp.Expr") -> "tuple[sp.Expr, ...]":
        """Steady state of sliding at a constant rate [m/s]; empty for a law without state."""
        return ()

    def steady_coefficient(self, rate: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] of steady sliding at a rate [m/s], at slip 0."""
        return self.coefficient(0, rate, *self.steady_state(rate))

    @property
    def rest_excess(self) -> float:
        """Friction at rest minus friction in slip [-]: `healing`; 0 for laws without this parameter."""
        return float(getattr(self, "healing", 0.0))

    @property
    def operating_rate(self) -> float:
        """Slip rate [m/s] of the default equilibrium; 0 for laws without state."""
        return 0

    @property
    def working_rates(self) -> tuple[float, float]:
        """Slip rates [m/s] between which, if not negative, the bounds hold for `coefficient`; by default no limits."""
        return -math.inf, math.inf

    @property
    @abstractmethod
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest friction coefficient [-], eq. mug of the paper."""

    @property
    @abstractmethod
    def slip_slope(self) -> float:
        """Largest chord slope |Δμ/Δslip| [1/m]; with state, along a motion in which the state evolves."""

    @property
    @abstractmethod
    def rate_slope(self) -> float:
        """Largest chord slope |Δμ/Δrate| [s/m] at a fixed state."""

    def require(self, **given: object) -> None:
        """Raise `ParameterError` for arguments, other than None, that do not apply to the equilibrium of this law."""
        for name, message in self.equilibrium.messages.items():
            if (value := given.get(name)) is not None:
                raise ParameterError(message.format(value=value, law=self.name, states=", ".join(self.state_names)))

    def _with_values(self, values: "Mapping[str, sp.Expr]") -> Self:
        law = object.__new__(type(self))
        for name, value in values.items():
            object.__setattr__(law, name, value)
        return law

    @classmethod
    def quantities(cls) -> "dict[str, Field[float]]":
        """Fields that are quantities with unit and symbol, by name."""
        return {f.name: f for f in fields(cls) if "symbol" in f.metadata}  # type: ignore[arg-type]

    def _options(self) -> dict[str, Any]:
        """Values of all other fields, by name."""
        return {f.name: getattr(self, f.name) for f in fields(self) if "symbol" not in f.metadata}  # type: ignore[arg-type]

    def symbols(self) -> "dict[str, sp.Symbol]":
        """Positive symbols of the quantities, by field name."""
        import sympy as sp

        return {name: sp.Symbol(f.metadata["symbol"], positive=True) for name, f in self.quantities().items()}

    def symbolic(self) -> Self:
        """Law with symbols as quantities; only for building expressions."""
        return self._with_values(self._options() | self.symbols())

    def exact(self) -> Self:
        """Law with SymPy rationals as quantities; only for building expressions."""
        import sympy as sp

        exact = {name: sp.Rational(str(rational(getattr(self, name), name))) for name in self.quantities()}
        return self._with_values(self._options() | exact)

    def values(self) -> "dict[sp.Symbol, sp.Rational]":
        """Exact values of the quantities, by symbol."""
        exact = self.exact()
        return {symbol: getattr(exact, name) for name, symbol in self.symbols().items()}
