"""What every friction law offers."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any, ClassVar, Self

from quakedesign.rationals import rational

if TYPE_CHECKING:
    import sympy as sp


class FrictionLaw(ABC):
    """One friction coefficient μ(slip, slip rate), written once with the parameters as attributes.

    A subclass is a frozen dataclass. Each field carries ``metadata`` with ``unit`` (as pint reads it) and
    ``symbol`` (LaTeX). The same method serves numbers, exact rationals and symbols, because `symbolic` and
    `exact` return copies of the law that hold those instead of floats.
    """

    name: ClassVar[str]
    source: ClassVar[str]
    domain: ClassVar[str]

    @abstractmethod
    def coefficient(self, slip: "sp.Expr", rate: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] at a slip [m] and a slip rate [m/s] inside the domain of the law."""

    @abstractmethod
    def extended(self, slip: "sp.Expr", rate: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] continued to all slips and rates, so that the bounds hold everywhere."""

    @property
    @abstractmethod
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest friction coefficient [-], eq. mug."""

    @property
    @abstractmethod
    def slip_slope(self) -> float:
        """Largest chord slope |Δμ/Δslip| [1/m]."""

    @property
    @abstractmethod
    def rate_slope(self) -> float:
        """Largest chord slope |Δμ/Δrate| [s/m]."""

    def _holding(self, values: Mapping[str, Any]) -> Self:
        law = object.__new__(type(self))
        for name, value in values.items():
            object.__setattr__(law, name, value)
        return law

    def symbols(self) -> "dict[str, sp.Symbol]":
        """Positive symbol of every parameter, by field name."""
        import sympy as sp

        return {f.name: sp.Symbol(f.metadata["symbol"], positive=True) for f in fields(self)}  # type: ignore[arg-type]

    def symbolic(self) -> Self:
        """Return the law with symbols for parameters; only for building expressions."""
        return self._holding(self.symbols())

    def exact(self) -> Self:
        """Return the law with SymPy rationals for parameters; only for building expressions."""
        import sympy as sp

        names = [f.name for f in fields(self)]  # type: ignore[arg-type]
        return self._holding({n: sp.Rational(str(rational(getattr(self, n), n))) for n in names})

    def values(self) -> "dict[sp.Symbol, sp.Rational]":
        """Exact value of every parameter symbol."""
        exact = self.exact()
        return {symbol: getattr(exact, name) for name, symbol in self.symbols().items()}
