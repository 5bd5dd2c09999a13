"""Plant of a rate-and-state fault in slow sliding, in rationals, and cells of its parameter box.

Quantities are per unit of area. For any cuts, the cells into which they divide the box of constants cover it.
"""

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.exact import apart, shortly, six_digits
from quakedesign.loop import StateLaw

# ----------------------------------------------------------------------
# Per unit of area: mass m = ρL, stiffness K = G/L, damping H = η/L². The friction coefficient is that of sliding at V,
# μ*, plus a·ln(v/V) + b·ln(θV/D), or its regularised form, a·arsinh(sinh(μ*/a)·exp((a·ln(v/V) + b·ln(θV/D))/a)); the
# state follows the ageing law, θ′ = 1 − vθ/D, or the slip law, θ′ = −(vθ/D)·ln(vθ/D). Initially the fault slides at V,
# without pressure; the far end of its spring is at rest. Along a reference r from 0, whose rate stays within V(1 ±
# ``swing``), it then needs p* = Kr/μ*; the planned pressure is ``ramp``·r/V. If ``swing`` is 0, r = Vt.

Range = tuple[Fraction, Fraction]
AXES = ("direct_effect", "evolution_effect", "critical_slip", "coefficient", "normal_stress")
"""Uncertain constants, given by their ranges: a, b, D [m], μ* and σ′ [Pa]."""

_SAME = {
    "density": "kg/m^3",
    "shear_modulus": "Pa",
    "length": "m",
    "damping": "kg/s",
    "rate": "m/s",
    "ramp": "Pa/s",
    "state_law": "-",
    "regularised": "-",
}
_CONSTANTS = dict(zip(AXES, ("a [-]", "b [-]", "D_c [m]", "friction at V [-]", "normal stress [Pa]"), strict=True))
_WITHIN = {"distance": "m", "swing": "-", "stress": "Pa"}


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class SlidingPlant:
    """A fault, its box of constants, the reference and the stress disturbance.

    Attributes
    ----------
    name : str
    density, shear_modulus, length, damping : Fraction
        ρ [kg/m³], G [Pa], L [m], η [kg/s].
    ranges : mapping of str to (Fraction, Fraction)
        Ranges of the uncertain constants, by the names in `AXES`.
    rate, distance, ramp : Fraction
        V [m/s], distance of the reference [m], and rate of the planned pressure at slip rate V [Pa/s].
    swing : Fraction
        Largest relative deviation of the reference rate from V [-], below 1; 0 for a constant rate.
    stress : Fraction
        Bound of the shear stress disturbance [Pa].
    state_law : str
        ``"ageing"`` or ``"slip"``.
    regularised : bool
        Whether friction has the regularised form, which is finite at rest.
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
    swing: Fraction = Fraction(0)
    state_law: StateLaw = "ageing"
    regularised: bool = False

    def __post_init__(self) -> None:
        if set(self.ranges) != set(AXES):
            raise ParameterError(
                f"ranges of {self.name} must be given for {', '.join(AXES)}. "
                f"Received {', '.join(self.ranges) or 'none'}."
            )
        for axis, (low, high) in self.ranges.items():
            ends = " to ".join(apart(low, high))
            self._require(0 < low <= high, f"range of {axis}", "positive, its lower end first", ends)
        for name in ("density", "shear_modulus", "length", "rate"):
            self._require(getattr(self, name) > 0, name, "positive", shortly(getattr(self, name)))
        for name in ("damping", "distance", "ramp", "stress"):
            self._require(getattr(self, name) >= 0, name, "0 or more", shortly(getattr(self, name)))
        self._require(0 <= self.swing < 1, "swing", "from 0 to below 1", shortly(self.swing))

    def _require(self, satisfied: bool, name: str, condition: str, value: str) -> None:
        if not satisfied:
            raise ParameterError(f"{name} of {self.name} must be {condition}. Received {value}. Correct the value.")

    @property
    def course(self) -> str:
        """Empty text, in place of the distance and duration of `FaultPlant.course`; statements give them elsewhere."""
        return ""

    def differences(self, other: "SlidingPlant") -> list[str]:
        """Differences of another plant that a proof for this one does not cover, with both values, SI.

        Constants of the fault, V, `ramp` and the form of friction must be the same; constants of friction, distance,
        swing and stress must lie within those of the proof. The name is not compared.
        """

        def both(own: str, others: str) -> str:
            return f"{own} in the certificate, {others} in the fault"

        def values(name: str) -> str:
            return both(_in_words(getattr(self, name)), _in_words(getattr(other, name)))

        texts = [
            f"{name} [{unit}] {values(name)}"
            for name, unit in _SAME.items()
            if getattr(self, name) != getattr(other, name)
        ]
        texts += [
            f"{name} [{unit}] up to {values(name)}"
            for name, unit in _WITHIN.items()
            if getattr(self, name) < getattr(other, name)
        ]
        return texts + [
            f"{words} from {both(*(' to '.join(dict.fromkeys(map(_in_words, x.ranges[axis]))) for x in (self, other)))}"
            for axis, words in _CONSTANTS.items()
            if other.ranges[axis][0] < self.ranges[axis][0] or other.ranges[axis][1] > self.ranges[axis][1]
        ]

    @property
    def stiffness(self) -> Fraction:
        """Stiffness per unit area, K = G/L [Pa/m]."""
        return self.shear_modulus / self.length

    @property
    def inertia(self) -> Fraction:
        """Mass per unit area, m = ρL [kg/m²]."""
        return self.density * self.length

    @property
    def radiation(self) -> Fraction:
        """Damping per unit area, H = η/L² [Pa·s/m]."""
        return self.damping / self.length**2

    @property
    def fastest(self) -> Fraction:
        """Largest rate of the reference [m/s]."""
        return self.rate * (1 + self.swing)

    @property
    def pressure_per_slip(self) -> Fraction:
        """Largest dp*/dr [Pa/m]."""
        return self.stiffness / self.ranges["coefficient"][0]

    @property
    def drift(self) -> Fraction:
        """Largest rate of p* relative to the planned pressure [Pa/s]."""
        along = max(abs(self.stiffness * self.rate / mu - self.ramp) for mu in self.ranges["coefficient"])
        return along * (1 + self.swing)

    def normal_stress(self, pressure: Fraction) -> Range:
        """Range of N = σ′ − p [Pa] along the reference, for |p − p*| ≤ `pressure` [Pa]."""
        low, high = self.ranges["normal_stress"]
        return low - self.pressure_per_slip * self.distance - pressure, high + pressure


def _in_words(value: Fraction | str | bool) -> str:
    """Number with six digits, or unchanged text."""
    return six_digits(value) if isinstance(value, Fraction) else str(value)


# ----------------------------------------------------------------------
# Repeated cuts of a box of constants: for any cuts, the cells cover it.

MOST_CELLS = 64
Cuts = tuple[tuple[str, Fraction] | None, ...]
"""Tree of cuts in preorder: (axis, value) for a box that is cut, then the entries of its lower part and of its upper
part; None for a box that is not cut, which is a cell."""
WHOLE: Cuts = (None,)


def cells(task: SlidingPlant, cuts: Cuts) -> tuple[SlidingPlant, ...]:
    """Plants on the cells into which `cuts` divide the box of `task`.

    Raises
    ------
    ParameterError
        For an unknown axis, a cut outside its box, too few or too many entries of `cuts`, or more than 64 cells.
    """
    boxes, leaves = [task], []
    for cut in cuts[: 2 * MOST_CELLS]:  # 65 cells need 129 entries, one more than are read
        if not boxes:
            break
        box = boxes.pop()
        if cut is None:
            leaves.append(box)
        else:
            boxes += reversed(parts(box, *cut))
    if len(cuts) != 2 * len(leaves) - 1:
        raise ParameterError(
            f"n cells of a box, n from 1 to {MOST_CELLS}, need 2n - 1 entries of cuts. Received {len(cuts)} entries "
            f"for {len(leaves)} cells. Add or remove entries."
        )
    return tuple(leaves)


def parts(task: SlidingPlant, axis: str, at: Fraction) -> tuple[SlidingPlant, SlidingPlant]:
    """The two parts of a box, below and above a cut.

    Raises
    ------
    ParameterError
        For an unknown axis, or a cut that is not strictly within the range of its axis.
    """
    low, high = task.ranges.get(axis, (at, at))
    if not low < at < high:
        raise ParameterError(
            f"a cut must be along one of {', '.join(AXES)}, strictly within its range. Received {axis} at "
            f"{shortly(at)}. Move the cut."
        )
    below, above = ({**task.ranges, axis: ends} for ends in ((low, at), (at, high)))
    return replace(task, ranges=below), replace(task, ranges=above)
