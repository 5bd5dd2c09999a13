"""Friction laws that weaken from a static to a kinetic coefficient with slip or slip rate."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from quakedesign.fault.friction.base import FrictionLaw
from quakedesign.fault.model import require_all, require_nonnegative, require_positive

if TYPE_CHECKING:
    import sympy as sp


@dataclass(frozen=True, slots=True, kw_only=True)
class Weakening(FrictionLaw):
    """A law without state whose coefficient falls from residual + drop to residual.

    Attributes
    ----------
    residual : float
        Kinetic friction coefficient μ_res [-], positive.
    drop : float
        Static minus kinetic friction coefficient Δμ [-], not negative; the paper's Δμ has the opposite sign.
    healing : float
        Largest excess of friction at rest over friction in slip, Δμ_h [-]; 0 by default. It acts in full after a rest
        of any duration, and not in slip.

    Raises
    ------
    ParameterError
        When a parameter is outside its range.
    """

    residual: float = field(metadata={"unit": "", "symbol": r"\mu_{res}", "example": 0.45})
    drop: float = field(metadata={"unit": "", "symbol": r"\Delta\mu", "example": 0.15})
    healing: float = field(default=0.0, metadata={"unit": "", "example": 0.0001, "default": "0"})

    def __post_init__(self) -> None:
        remedy = "It is the static minus the kinetic coefficient; the paper's Δμ has the opposite sign."
        require_all(
            lambda: require_positive(residual=self.residual),
            lambda: require_nonnegative(remedy, drop=self.drop),
            lambda: require_nonnegative(healing=self.healing),
        )

    @property
    def bounds(self) -> tuple[float, float]:
        """Kinetic and static friction coefficient [-], μ_res and μ_max = μ_res + drop."""
        return self.residual, self.residual + self.drop

    @property
    def slip_slope(self) -> float:
        """Zero [1/m] by default: the law does not depend on the slip."""
        return 0

    @property
    def rate_slope(self) -> float:
        """Zero [s/m] by default: the law does not depend on the slip rate."""
        return 0


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipWeakening(Weakening):
    """A law of the slip alone, steepest where slip begins.

    Attributes
    ----------
    critical_slip : float
        Characteristic slip d_c [m], positive.
    """

    critical_slip: float = field(metadata={"unit": "m", "symbol": "d_c", "example": "2 cm"})

    def __post_init__(self) -> None:
        require_all(lambda: Weakening.__post_init__(self), lambda: require_positive(critical_slip=self.critical_slip))

    def extended(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-], constant at its static value for slip < 0 (ERRATA 12)."""
        import sympy as sp

        return self.coefficient(sp.Max(slip, 0), rate)

    @property
    def slip_slope(self) -> float:
        """drop/d_c [1/m], reached at slip 0."""
        return self.drop / self.critical_slip


@dataclass(frozen=True, slots=True, kw_only=True)
class ExponentialSlipWeakening(SlipWeakening):
    """μ(slip) = residual + drop · exp(−slip/critical_slip), eq. mu of the paper, whose Δμ is −drop.

    The law meets the bounds of eq. mug only for slip ≥ 0; `extended` is μ(0) for slip < 0 (ERRATA 12).
    """

    name: ClassVar[str] = "exponential-slip-weakening"
    source: ClassVar[str] = "Kanamori and Brodsky (2004), Rep. Prog. Phys. 67, 1429; eq. mu of the paper"
    domain: ClassVar[str] = "slip >= 0"

    def coefficient(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] for slip ≥ 0 (eq. mu)."""
        import sympy as sp

        return self.residual + self.drop * sp.exp(-slip / self.critical_slip)


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearSlipWeakening(SlipWeakening):
    """μ(slip) = residual + drop · max(0, 1 − slip/critical_slip).

    Friction has a kink at the critical slip. For slip < 0 the formula grows without bound; `extended` is μ(0) there.

    Attributes
    ----------
    critical_slip : float
        Slip d_c beyond which friction is kinetic [m], positive.
    """

    name: ClassVar[str] = "linear-slip-weakening"
    source: ClassVar[str] = "Ida (1972), J. Geophys. Res. 77(20), 3796; Andrews (1976), J. Geophys. Res. 81(20), 3575"
    domain: ClassVar[str] = "slip >= 0"

    def coefficient(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] for slip ≥ 0."""
        import sympy as sp

        return self.residual + self.drop * sp.Max(0, 1 - slip / self.critical_slip)


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipRateWeakening(Weakening):
    """μ(rate) = residual + drop/(1 + rate/critical_rate) for rate ≥ 0, even in the rate when extended.

    The coefficient is for forward motion; the plant gives friction its sign (ERRATA 14).

    Attributes
    ----------
    critical_rate : float
        Rate v_c [m/s] at which friction has lost half of the drop, positive.
    """

    name: ClassVar[str] = "slip-rate-weakening"
    source: ClassVar[str] = (
        "Carlson and Langer (1989), Phys. Rev. A 40, 6470; Huang and Turcotte (1992), Pure Appl. Geophys. 138, 569; "
        "with a residual as in Cochard and Madariaga (1994), Pure Appl. Geophys. 142, 419"
    )
    domain: ClassVar[str] = "rate >= 0"

    critical_rate: float = field(metadata={"unit": "m/s", "symbol": "v_c", "example": "10 cm/s"})

    def __post_init__(self) -> None:
        require_all(lambda: Weakening.__post_init__(self), lambda: require_positive(critical_rate=self.critical_rate))

    def coefficient(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] for rate ≥ 0."""
        return self.residual + self.drop / (1 + rate / self.critical_rate)

    def extended(self, slip: "sp.Expr", rate: "sp.Expr", *state: "sp.Expr") -> "sp.Expr":
        """Friction coefficient [-] at the absolute value of the rate."""
        import sympy as sp

        return self.coefficient(slip, sp.Abs(rate))

    @property
    def rate_slope(self) -> float:
        """drop/v_c [s/m], reached at rest."""
        return self.drop / self.critical_rate
