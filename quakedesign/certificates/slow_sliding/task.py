"""What a guarantee of slow sliding uses of a fault with rate-and-state friction, in rationals.

Per unit of area: mass m = ρL, stiffness K = G/L, damping H = η/L². The friction coefficient is that of sliding at V,
μ*, plus a·ln(v/V) + b·ln(θV/D); the state follows the ageing law, θ′ = 1 − vθ/D. The fault slides at V at first,
without pressure, its far end at rest. Along r = Vt it then needs p* = KVt/μ*, of which the plan brings ``ramp``·t.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

import sympy as sp

from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.fault import Fault
from quakedesign.rationals import fraction_of, rational

Range = tuple[Fraction, Fraction]
AXES = ("direct_effect", "evolution_effect", "critical_slip", "coefficient", "normal_stress")
"""Constants that are only known to lie in ranges: a, b, D [m], μ* and σ′ [Pa]."""
_AGEING = "rate-and-state-aging"
_DIGITS = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class SlidingTask:
    """A fault, its box of constants, the reference and the stress disturbance.

    Attributes
    ----------
    name : str
    density, shear_modulus, length, damping : Fraction
        ρ [kg/m³], G [Pa], L [m], η [kg/s].
    ranges : mapping of str to (Fraction, Fraction)
        By the names of `AXES`.
    rate, distance, ramp : Fraction
        V [m/s], how far the reference goes [m], and how fast the planned pressure rises [Pa/s].
    stress : Fraction
        Bound of the shear stress disturbance [Pa].

    Raises
    ------
    ParameterError
    """

    name: str
    density: Fraction
    shear_modulus: Fraction
    length: Fraction
    damping: Fraction
    ranges: Mapping[str, Range]
    rate: Fraction
    distance: Fraction
    ramp: Fraction
    stress: Fraction

    def __post_init__(self) -> None:
        ends = [self.ranges[axis] for axis in AXES] if set(self.ranges) == set(AXES) else []
        positive = (self.density, self.shear_modulus, self.length, self.rate, *(low for low, _ in ends))
        ordered = len(ends) == len(AXES) and all(low <= high for low, high in ends)
        if not ordered or min(positive) <= 0 or min(self.damping, self.distance, self.ramp, self.stress) < 0:
            raise ParameterError(
                f"slow sliding needs ordered ranges of {', '.join(AXES)} above 0, density, modulus, length and rate "
                f"above 0, damping, distance, ramp and stress not below. Received others for {self.name}."
            )

    @property
    def stiffness(self) -> Fraction:
        """K [Pa/m]."""
        return self.shear_modulus / self.length

    @property
    def inertia(self) -> Fraction:
        """M [kg/m²]."""
        return self.density * self.length

    @property
    def radiation(self) -> Fraction:
        """H [Pa·s/m]."""
        return self.damping / self.length**2

    @property
    def fastest_rise(self) -> Fraction:
        """Largest dp*/dt [Pa/s]."""
        return self.stiffness * self.rate / self.ranges["coefficient"][0]

    @property
    def drift(self) -> Fraction:
        """How fast p* may leave the plan [Pa/s]."""
        return max(abs(self.stiffness * self.rate / mu - self.ramp) for mu in self.ranges["coefficient"])

    def normal_stress(self, push: Fraction) -> Range:
        """N = σ′ − p [Pa] along the reference, with |p − p*| up to `push` [Pa]."""
        low, high = self.ranges["normal_stress"]
        return low - self.fastest_rise / self.rate * self.distance - push, high + push


def sliding_task(fault: Fault, stress: Fraction, spread: Fraction = Fraction(0)) -> SlidingTask:
    """The task of a fault at its mean rate V, target slip over operation time, under a stress of at most `stress` [Pa].

    The ranges of a, b and D are their values and `spread` of them to both sides [-]; that of μ* follows from a − b.

    Raises
    ------
    UnsupportedError
        For friction other than of the ageing law, or whose state feels the normal stress.
    """
    if fault.friction.name != _AGEING or fault.friction.stress_sensitivity:  # type: ignore[attr-defined]
        raise UnsupportedError(
            f"a guarantee of slow sliding needs friction of the law {_AGEING}, its state deaf to the normal stress. "
            f"Received {fault.friction.name}. Simulate it."
        )
    law = fault.friction.exact()
    rate = rational(fault.reference.target_slip) / rational(fault.reference.operation_time)
    named = {axis: rational(getattr(fault.friction, axis)) for axis in AXES[:3]}
    steady = law.steady_coefficient(sp.Rational(rate.numerator, rate.denominator))
    middle = _near(steady)
    per_effect = abs(_near(sp.log(sp.Rational(rate.numerator, rate.denominator) / law.reference_rate)))  # type: ignore[attr-defined]
    off = spread * per_effect * (named["direct_effect"] + named["evolution_effect"])
    off += Fraction(1, 10**_DIGITS) * middle if off or not steady.is_Rational else 0
    ends = {name: (value * (1 - spread), value * (1 + spread)) for name, value in named.items()}
    normal = rational(fault.effective_normal_stress)
    stiffness = rational(fault.shear_modulus) / rational(fault.side)
    return SlidingTask(
        name=fault.name,
        density=rational(fault.density),
        shear_modulus=rational(fault.shear_modulus),
        length=rational(fault.side),
        damping=rational(fault.damping) / fault.squares,
        ranges={**ends, "coefficient": (middle - off, middle + off), "normal_stress": (normal, normal)},
        rate=rate,
        distance=rational(fault.reference.target_slip),
        ramp=stiffness * rate / middle,
        stress=stress,
    )


def _near(expression: sp.Expr) -> Fraction:
    """A rational within 10^-14 of a number; itself if it is rational."""
    value = sp.nsimplify(expression, rational=True) if expression.is_Rational else sp.N(expression, 40)
    return fraction_of(value) if value.is_Rational else Fraction(str(value)).limit_denominator(10**18)
