"""What acts on the fault besides the spring, the dashpot, friction and the injected fluid."""

from dataclasses import dataclass, field, fields
from fractions import Fraction
from math import inf, nextafter
from typing import TYPE_CHECKING, Any

from quakedesign.errors import UnitError
from quakedesign.fault.checks import require_finite, require_nonnegative, require_ordinary
from quakedesign.fault.units import si_value
from quakedesign.rationals import rational

if TYPE_CHECKING:
    import sympy as sp


STRESSES = ("constant", "amplitude")


def acceleration(quantity: Any, authority: Fraction, name: str) -> tuple[float, bool]:
    """Value [m/s²] of a text such as ``"1e-4 m/s^2"``, or of a shear stress such as ``"35 kPa"``; whether it was that.

    A stress τ accelerates a fault by τA/m: rounded up in size, so that what is proved of the float is so of the stress.

    Parameters
    ----------
    quantity : str
    authority : Fraction
        A/m [m²/kg] of the fault, the nominal one.
    name : str
        What the quantity is, for the message.

    Raises
    ------
    UnitError
        For another unit.
    ParameterError
        For a stress that is no size of anything on this fault.
    """
    try:
        return si_value(quantity, "m/s^2", name), False
    except UnitError as error:
        try:
            stress = rational(si_value(quantity, "Pa", name), name)
        except UnitError as other:
            if "Did you mean" in str(other):
                raise
            raise UnitError(f"{error} A shear stress in Pa will do as well.") from None
    require_ordinary(**{name: float(stress)})
    exact = abs(stress) * authority
    size = float(exact)
    while rational(size) < exact:  # the decimal that proofs read
        size = nextafter(size, inf)
    return (size if stress >= 0 else -size), True


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """Acceleration φ̂_e(x1, x2, t) = constant + amplitude·sin(frequency·t) + slip_growth·x1 + rate_growth·x2.

    Attributes
    ----------
    constant : float
        [m/s²], in a file also as a shear stress on the fault, such as "35 kPa".
    amplitude : float
        [m/s²], not negative, in a file also as a shear stress on the fault, such as "35 kPa".
    frequency : float
        Angular frequency [rad/s], not negative.
    slip_growth : float
        [1/s²].
    rate_growth : float
        [1/s].
    stresses : tuple of str
        Which of ``constant`` and ``amplitude`` were given as a shear stress: proofs cover it for every area per mass of
        the fault's box, while the number itself is for the nominal one.
    """

    constant: float = field(default=0.0, metadata={"unit": "m/s^2"})
    amplitude: float = field(default=0.0, metadata={"unit": "m/s^2"})
    frequency: float = field(default=0.0, metadata={"unit": "rad/s"})
    slip_growth: float = field(default=0.0, metadata={"unit": "1/s^2"})
    rate_growth: float = field(default=0.0, metadata={"unit": "1/s"})
    stresses: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        require_finite(constant=self.constant, slip_growth=self.slip_growth, rate_growth=self.rate_growth)
        require_nonnegative(amplitude=self.amplitude, frequency=self.frequency)
        require_ordinary(**{each.name: getattr(self, each.name) for each in fields(self) if "unit" in each.metadata})

    def acceleration(self, slip: "sp.Expr", rate: "sp.Expr", time: "sp.Expr") -> "sp.Expr":
        """φ̂_e [m/s²] at a slip [m], slip rate [m/s] and time [s]."""
        import sympy as sp

        return self.explicit(time) + sp.Float(self.slip_growth) * slip + sp.Float(self.rate_growth) * rate

    def explicit(self, time: "sp.Expr") -> "sp.Expr":
        """Part of φ̂_e [m/s²] that depends on time [s] alone."""
        import sympy as sp

        return self.constant + self.amplitude * sp.sin(sp.Float(self.frequency) * time)

    @property
    def largest_explicit(self) -> float:
        """Bound on the part of φ̂_e that depends on time alone [m/s²]."""
        return abs(self.constant) + self.amplitude

    @property
    def largest_rate(self) -> float:
        """Bound on the time derivative of that part [m/s³]."""
        return self.amplitude * self.frequency

    def exact_bounds(self, width: Fraction = Fraction(0)) -> tuple[Fraction, Fraction]:
        """Both bounds [m/s²] and [m/s³] of the decimals given, for proofs: of floats they may be rounded inward.

        A stress accelerates by up to 1 + `width` times as much, the half-width of the area per mass [-].
        """
        constant, amplitude = (
            abs(rational(getattr(self, name))) * (1 + width * (name in self.stresses)) for name in STRESSES
        )
        return constant + amplitude, amplitude * rational(self.frequency)
