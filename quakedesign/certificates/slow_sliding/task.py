"""What a guarantee of slow sliding uses of a fault with rate-and-state friction, in rationals.

Per unit of area: mass m = ρL, stiffness K = G/L, damping H = η/L². The friction coefficient is that of sliding at V,
μ*, plus a·ln(v/V) + b·ln(θV/D), or its regularised form, a·arsinh(sinh(μ*/a)·exp((a·ln(v/V) + b·ln(θV/D))/a)); the
state follows the ageing law, θ′ = 1 − vθ/D, or the slip law, θ′ = −(vθ/D)·ln(vθ/D). The fault slides at V at first,
without pressure, its far end at rest. Along r = Vt it then needs p* = KVt/μ*, of which the plan brings ``ramp``·t.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import get_args

from quakedesign.errors import ParameterError, require_known
from quakedesign.loop import StateLaw

Range = tuple[Fraction, Fraction]
AXES = ("direct_effect", "evolution_effect", "critical_slip", "coefficient", "normal_stress")
"""Constants that are only known to lie in ranges: a, b, D [m], μ* and σ′ [Pa]."""


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
    state_law : str
        ``"ageing"`` or ``"slip"``.
    regularised : bool
        Whether friction is of the form that stays finite at rest.

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
    state_law: StateLaw = "ageing"
    regularised: bool = False

    def __post_init__(self) -> None:
        ends = [self.ranges[axis] for axis in AXES] if set(self.ranges) == set(AXES) else []
        positive = (self.density, self.shear_modulus, self.length, self.rate, *(low for low, _ in ends))
        ordered = len(ends) == len(AXES) and all(low <= high for low, high in ends)
        if not ordered or min(positive) <= 0 or min(self.damping, self.distance, self.ramp, self.stress) < 0:
            raise ParameterError(
                f"slow sliding needs ordered ranges of {', '.join(AXES)} above 0, density, modulus, length and rate "
                f"above 0, damping, distance, ramp and stress not below. Received others for {self.name}."
            )
        require_known(self.state_law, get_args(StateLaw), "state_law")

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
