"""Plant of a fault that follows a reference: ranges and inputs of its error loop, by rational inequalities.

Let p*(t) be the pressure at which the fault is in equilibrium at rest at the reference slip r(t). The error e = x − (r,
r′) satisfies

    e1′ = e2,   e2′ = s·e1 − w·e2 + β·b·(p − p*) + φ − w·r′ − r″.

k̂, η̂ and N̂ are stiffness, damping and area per mass; φ1 and φ2 are slopes of the disturbance in slip and slip rate.
p* solves N̂(μ*σ′ − μ(r, 0)(σ′ − p*)) = (k̂ − φ1)r, and β·b = μ(x)N̂. s is −k̂ + φ1, and w is η̂ − φ2, each plus N̂(σ′ −
p*) times a chord slope of friction between x and (r, 0): −Δμ/Δslip in s, Δμ/Δrate in w. So s, w and β lie in ranges for
every friction μ(x) with the given bounds and slopes. As k̂, N̂ and φ1 are constant, b·|dp*/dt| = |s_r|r′/β_r with s_r,
β_r in the same ranges. r is constant outside [0, t_op].
"""

from collections.abc import Iterable
from dataclasses import fields
from fractions import Fraction
from functools import cached_property, lru_cache
from itertools import pairwise, product
from math import comb

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.exact import apart, shortly, six_digits
from quakedesign.laws import NominalModel
from quakedesign.text import duration, quantity

Range = tuple[Fraction, Fraction]
_HALVINGS = 7


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Friction:
    """Friction of a plant: μ at rest at t = 0 [-], its bounds [-], and bounds of its chord slopes [1/m], [s/m].

    Attributes
    ----------
    weakening, strengthening : Fraction
        Largest fall and rise of μ per slip [1/m], both 0 or more.
    rate_slope : Fraction
        Largest |Δμ/Δrate| [s/m].
    """

    static: Fraction
    least: Fraction
    largest: Fraction
    weakening: Fraction
    strengthening: Fraction
    rate_slope: Fraction


@checked_dataclass(frozen=True, kw_only=True)
class FaultPlant:
    """A fault, its reference and its disturbance, as a certificate states them. SI units.

    Attributes
    ----------
    name : str
    density, shear_modulus, length, damping, normal_stress : Fraction
        ρ [kg/m³], G [Pa], L [m], η [kg/s], σ′ [Pa]. A rectangular patch is modelled as a row of equal squares; these
        are the values of one square.
    spreads : (Fraction, Fraction, Fraction)
        Relative half-widths of k̂, η̂ and N̂ [-].
    friction : Friction
    shape : tuple of Fraction
        Coefficients of r/target as a polynomial in t/t_op, lowest power first.
    target_slip, operation_time : Fraction
        Final slip of the reference [m], and its duration t_op [s].
    amplitude : Fraction
        Bound of the disturbance φ(t) [m/s²].
    change : Fraction or None
        Bound of |φ′| [m/s³] of a disturbance that starts at 0 (class rate); None: φ is any measurable function.
    growths : (Fraction, Fraction)
        φ1 [1/s²] and φ2 [1/s]: slopes of the disturbance in slip and slip rate.
    """

    name: str
    density: Fraction
    shear_modulus: Fraction
    length: Fraction
    damping: Fraction
    normal_stress: Fraction
    spreads: tuple[Fraction, Fraction, Fraction]
    friction: Friction
    shape: tuple[Fraction, ...]
    target_slip: Fraction
    operation_time: Fraction
    amplitude: Fraction
    change: Fraction | None
    growths: tuple[Fraction, Fraction]

    def __post_init__(self) -> None:
        law = self.friction
        least, static, largest = law.least, law.static, law.largest
        for name in ("density", "shear_modulus", "length", "normal_stress", "target_slip", "operation_time"):
            self._require(getattr(self, name) > 0, name, "positive", getattr(self, name))
        self._require(least > 0, "least friction coefficient", "positive", least)
        for name in ("damping", "amplitude"):
            self._require(getattr(self, name) >= 0, name, "0 or more", getattr(self, name))
        for name in ("weakening", "strengthening", "rate_slope"):
            self._require(getattr(law, name) >= 0, f"friction {name}", "0 or more", getattr(law, name))
        for name, value in zip(_SPREADS, self.spreads, strict=True):
            self._require(0 <= value < 1, f"spread of {name}", "from 0 to below 1", value)
        if not least <= static <= largest:
            low, received, high = apart(least, static, largest)
            raise ParameterError(
                f"static friction coefficient of {self.name} must be between the least, {low}, and the largest, "
                f"{high}. Received {received}. Correct the value."
            )
        if self.change is not None:
            self._require(self.change >= 0, "disturbance rate", "0 or more", self.change)
        shape = self.shape
        slope = _derived(shape, 1)
        ends = shape[:1] == (Fraction(0),) and sum(shape) == 1 and slope[:1] == (Fraction(0),) and sum(slope) == 0
        if not (ends and _range_of(slope)[0] >= 0):
            raise ParameterError(
                f"the shape of the reference of {self.name} must rise from 0 to 1 with slope 0 at both ends. "
                f"Received the coefficients {', '.join(map(shortly, self.shape))}. Give them lowest power first."
            )

    def _require(self, satisfied: bool, name: str, condition: str, value: Fraction) -> None:
        if not satisfied:
            raise ParameterError(
                f"{name} of {self.name} must be {condition}. Received {shortly(value)}. Correct the value."
            )

    def _spread(self, value: Fraction, number: int) -> Range:
        return value * (1 - self.spreads[number]), value * (1 + self.spreads[number])

    @cached_property
    def stiffness(self) -> Range:
        """Range of k̂ = G/(ρL²) [1/s²]."""
        return self._spread(self.shear_modulus / (self.density * self.length**2), 0)

    @cached_property
    def specific_damping(self) -> Range:
        """Range of η̂ = η/(ρL³) [1/s]."""
        return self._spread(self.damping / (self.density * self.length**3), 1)

    @cached_property
    def area_per_mass(self) -> Range:
        """Range of N̂ = 1/(ρL) [m²/kg]."""
        return self._spread(1 / (self.density * self.length), 2)

    @cached_property
    def authority(self) -> Fraction:
        """b [m²/kg]: least friction coefficient times least N̂."""
        return self.friction.least * self.area_per_mass[0]

    @cached_property
    def beta(self) -> Range:
        """Range of β = μN̂/b [-]."""
        return Fraction(1), self.friction.largest * self.area_per_mass[1] / self.authority

    @cached_property
    def stress(self) -> Range:
        """Range of σ′ − p* [Pa] along the reference; monotone in μ, in κ = (k̂ − φ1)/N̂, and in r between `breaks`."""
        law, target = self.friction, self.target_slip
        breaks = {Fraction(0), target}
        breaks |= {(law.static - law.least) / law.weakening} if law.weakening else set()
        breaks |= {(law.largest - law.static) / law.strengthening} if law.strengthening else set()
        kappa = _hull((k - self.growths[0]) / n for k, n in product(self.stiffness, self.area_per_mass))
        return _hull(
            (law.static * self.normal_stress - c * r) / mu
            for r in breaks
            if r <= target
            for c in kappa
            for mu in (max(law.least, law.static - law.weakening * r),
                       min(law.largest, law.static + law.strengthening * r))
        )  # fmt: skip

    @cached_property
    def rest_pressure(self) -> Range:
        """Range of p* [Pa] along the reference."""
        return self.normal_stress - self.stress[1], self.normal_stress - self.stress[0]

    @cached_property
    def slip_chord(self) -> Range:
        """Range of s [1/s²] along the reference."""
        return self.slip_slopes(self.stress)

    def slip_slopes(self, stress: Range) -> Range:
        """Range of s [1/s²] for any effective normal stress σ′ − p* in a range [Pa]."""
        law, k = self.friction, self.stiffness
        low, high = _hull(
            n * p * c for n in self.area_per_mass for p in stress for c in (law.weakening, -law.strengthening)
        )
        return low - k[1] + self.growths[0], high - k[0] + self.growths[0]

    @cached_property
    def rate_chord(self) -> Range:
        """Range of w [1/s] along the reference."""
        return self.rate_slopes(self.stress)

    def rate_slopes(self, stress: Range) -> Range:
        """Range of w [1/s] for any effective normal stress σ′ − p* in a range [Pa]."""
        most = self.area_per_mass[1] * max(map(abs, stress)) * self.friction.rate_slope
        low, high = self.specific_damping
        return low - most - self.growths[1], high + most - self.growths[1]

    @cached_property
    def reference_rates(self) -> tuple[Fraction, Fraction]:
        """Bounds of r′ [m/s] and |r″| [m/s²]."""
        bounds = []
        for order in (1, 2):
            bound = max(abs(v) for v in _range_of(_derived(self.shape, order)))
            bounds.append(bound * self.target_slip / self.operation_time**order)
        return bounds[0], bounds[1]

    @cached_property
    def reference_jerk(self) -> Fraction:
        """Bound of |r‴| [m/s³] for 0 < t < t_op; at t = 0 and t_op r″ may jump."""
        bound = max(map(abs, _range_of(_derived(self.shape, 3))))
        return bound * self.target_slip / self.operation_time**3

    def require_smooth_reference(self) -> None:
        """Reject a reference whose acceleration jumps at its start or end."""
        bent = _derived(self.shape, 2)
        if bent[0] or sum(bent):
            raise ParameterError(
                "state feedback of the slip rate needs a reference that starts and ends without acceleration. "
                f"Received the reference of {self.name}, whose acceleration jumps there. Use feedback 'error'."
            )

    @cached_property
    def model(self) -> NominalModel:
        """Nominal model: midpoints of the ranges."""
        s, w, beta = ((low + high) / 2 for low, high in (self.slip_chord, self.rate_chord, self.beta))
        return NominalModel(slip=s, rate=w, gain=beta * self.authority)

    @cached_property
    def half_ranges(self) -> dict[str, Fraction]:
        """Half-widths of the ranges of s [1/s²], w [1/s] and β [-], by the name of the signal that each multiplies."""
        return {
            name: (high - low) / 2
            for name, (low, high) in (
                ("slip_error", self.slip_chord),
                ("slip_rate_error", self.rate_chord),
                ("push", self.beta),
            )
        }

    @cached_property
    def reference_force(self) -> Fraction:
        """Bound of |w·r′ + r″| [m/s²]."""
        first, second = self.reference_rates
        return max(map(abs, self.rate_chord)) * first + second

    @cached_property
    def drift(self) -> Fraction:
        """Bound of b·|dp*/dt| [m/s³], β being at least 1."""
        return max(map(abs, self.slip_chord)) * self.reference_rates[0]

    @property
    def course(self) -> str:
        """Distance and duration of the reference, as text."""
        return f", which moves {quantity(float(self.target_slip), 'm')} in {duration(float(self.operation_time))}"

    def differences(self, other: "FaultPlant") -> list[str]:
        """Differences of another plant that a proof for this one does not cover, with both values, SI; empty if none.

        Constants of the fault and its reference must be the same; friction, ranges and disturbance must lie within
        those of this plant. The name is not compared.
        """
        return [*_differing(self, other), *_wider_ranges(self, other), *_rougher(self.friction, other.friction)]


def _hull(values: Iterable[Fraction]) -> Range:
    listed = list(values)
    return min(listed), max(listed)


def _derived(shape: tuple[Fraction, ...], order: int) -> tuple[Fraction, ...]:
    for _ in range(order):
        shape = tuple(n * c for n, c in enumerate(shape))[1:]
    return shape


def _halves(row: list[Fraction]) -> tuple[list[Fraction], list[Fraction]]:
    """Bernstein coefficients on both halves (de Casteljau); those of the right half are in reverse order."""
    left, right = [], []
    while row:
        left.append(row[0])
        right.append(row[-1])
        row = [(a + b) / 2 for a, b in pairwise(row)]
    return left, right


def _range_of(shape: tuple[Fraction, ...]) -> Range:
    """Enclosure of a polynomial on [0, 1], by subdivision."""
    return _range_by(shape, _HALVINGS)


@lru_cache(maxsize=64)
def _range_by(shape: tuple[Fraction, ...], halvings: int) -> Range:
    n = len(shape) - 1
    rows = [  # Bernstein coefficients, whose hull contains every value
        [sum((Fraction(comb(i, j), comb(n, j)) * shape[j] for j in range(i + 1)), Fraction(0)) for i in range(n + 1)]
    ]
    for _ in range(halvings):
        rows = [half for row in rows for half in _halves(row)]
    return _hull(v for row in rows for v in row)


# ----------------------------------------------------------------------
# Differences of a plant that a proof for another does not cover.

_SAME = {
    "density": "kg/m^3",
    "shear_modulus": "Pa",
    "length": "m",
    "damping": "kg/s",
    "normal_stress": "Pa",
    "target_slip": "m",
    "operation_time": "s",
}
_SPREADS = ("stiffness", "damping", "authority")


def _differing(proved: FaultPlant, required: FaultPlant) -> list[str]:
    """Constants that differ."""
    pairs = {f"{name} [{unit}]": (getattr(proved, name), getattr(required, name)) for name, unit in _SAME.items()}
    pairs["static friction [-]"] = proved.friction.static, required.friction.static
    for name, unit, *both in zip(("slip", "rate"), ("1/s^2", "1/s"), proved.growths, required.growths, strict=True):
        pairs[f"disturbance per {name} [{unit}]"] = both[0], both[1]
    differences = [
        f"{name} {six_digits(one)} in the certificate, {six_digits(other)} in the fault"
        for name, (one, other) in pairs.items()
        if one != other
    ]
    return differences + ([] if proved.shape == required.shape else ["the shape of the reference"])


def _wider_ranges(proved: FaultPlant, required: FaultPlant) -> list[str]:
    """Ranges and disturbances beyond those of the proof."""
    pairs = {
        f"spread of {name} [-]": both for name, *both in zip(_SPREADS, proved.spreads, required.spreads, strict=True)
    }
    pairs["disturbance [m/s^2]"] = [proved.amplitude, required.amplitude]
    if proved.change is not None and required.change is not None:
        pairs["change of the disturbance [m/s^3]"] = [proved.change, required.change]
    wider = [
        f"{name} up to {six_digits(one)} in the certificate, {six_digits(other)} in the fault"
        for name, (one, other) in pairs.items()
        if other > one
    ]
    jumps = proved.change is not None and required.change is None
    return wider + (["class of the disturbance: rate in the certificate, amplitude in the fault"] if jumps else [])


def _rougher(proved: Friction, required: Friction) -> list[str]:
    """Bounds of friction beyond those of the proof."""
    beyond = {part.name: getattr(required, part.name) > getattr(proved, part.name) for part in fields(Friction)}
    beyond |= {"static": False, "least": required.least < proved.least}
    names = [name for name, wider in beyond.items() if wider]
    both = [(name, *(six_digits(getattr(one, name)) for one in (proved, required))) for name in names]
    units = {"weakening": "1/m", "strengthening": "1/m", "rate_slope": "s/m"}
    return [
        f"friction: {name} [{units.get(name, '-')}] {theirs} in the certificate, {own} in the fault"
        for name, theirs, own in both
    ]
