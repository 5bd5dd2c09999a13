"""Similarity of faults: π-groups, exact scale factors, and scaled faults.

The dimensional matrix follows from the units alone; two faults are similar if all their π-groups agree (Buckingham
1914, Phys. Rev. 4, 345). Slip, fault length and the normal direction have separate units of length (directed lengths,
Huntley 1967, Dimensional Analysis), as Table I of the paper requires. A scale factor is a root of a positive rational.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from decimal import Context, Decimal, localcontext
from fractions import Fraction
from functools import cache, cached_property
from math import lcm, prod
from operator import attrgetter
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, UnitError, UnknownNameError, require_known
from quakedesign.exact import exact_text, fraction_of, rational
from quakedesign.fault.friction.base import FrictionLaw
from quakedesign.fault.model import Disturbance, Fault, Reference

if TYPE_CHECKING:
    import sympy as sp


# ----------------------------------------------------------------------
# Dimensions. The equation of motion never compares a slip with the length of the fault, nor a tangential with a normal
# direction: a stiffness k = GL is a force per slip, a friction coefficient a tangential force per normal force. The
# three metres are therefore three units, with mass and time five in all; this is why slip, fault length and friction
# scale by different factors in Table I of the paper.

BASES = ("mass", "fault_length", "slip", "normal_length", "time")
"""Independent dimensions, in the order of the rows of the dimensional matrix."""

_UNITS = (
    "kilogram = [mass] = kg",
    "second = [time] = s",
    "radian = [] = rad",
    "fault_meter = [fault_length] = fault_m",
    "slip_meter = [slip] = slip_m = m = meter",
    "normal_meter = [normal_length] = normal_m",
    "shear_newton = kg * slip_m / s^2 = shear_N",
    "shear_pascal = shear_N / fault_m^2 = shear_Pa",
    "normal_newton = kg * normal_m / s^2 = normal_N",
    "normal_pascal = normal_N / fault_m^2 = normal_Pa = Pa = pascal",
)

PLANT_UNITS: Mapping[str, str] = {
    f"{part}{each.name}": each.metadata.get("directed_unit", each.metadata["unit"])
    for part, kind in (("", Fault), ("reference.", Reference), ("disturbance.", Disturbance))
    for each in fields(kind)
    if "unit" in each.metadata
}
"""Units of the numbers of a `Fault`, by dotted name; with all three metres equal they are its SI units."""

_FRICTION = "slip_m/normal_m"
_UNIT_FRICTION = "unit friction"


class Quantity(NamedTuple):
    """One parameter of a fault: dotted name, unit with directed lengths, value in that unit."""

    name: str
    unit: str
    value: Fraction


@cache
def _registry() -> Any:
    import pint

    registry: Any = pint.UnitRegistry(None)
    for line in _UNITS:
        registry.define(line)
    return registry


@cache
def dimension(unit: str) -> tuple[Fraction, ...]:
    """Exponents of `BASES` in a unit; plain ``m`` means slip, ``Pa`` normal stress or fluid pressure.

    Raises
    ------
    UnitError
        For a unit that cannot be parsed.
    """
    try:
        exponents = dict(_registry().parse_units(unit).dimensionality)
    except Exception:
        raise UnitError(
            f"a unit in kg, s, slip_m (or m), fault_m, normal_m, Pa is needed. Received {unit!r}. Check its spelling."
        ) from None
    return tuple(Fraction(exponents.get(f"[{base}]", 0)).limit_denominator(1000) for base in BASES)


def dimensional_matrix(units: Sequence[str]) -> "sp.Matrix":
    """Exponents of the base dimensions (rows, as `BASES`) in units (columns), exact."""
    import sympy as sp

    columns = [[sp.Rational(e.numerator, e.denominator) for e in dimension(unit)] for unit in units]
    return sp.Matrix(len(BASES), len(units), lambda row, column: columns[column][row])


def quantities(fault: Fault) -> dict[str, Quantity]:
    """Every parameter of a fault by dotted name, including those of its friction law.

    If the friction coefficient is not proportional to the dimensionless parameters of its law, it cannot be scaled. The
    constant coefficient 1 is then one more parameter, the same for every fault.
    """
    law = fault.friction
    named = {name: (unit, attrgetter(name)(fault)) for name, unit in PLANT_UNITS.items()}
    named |= {
        f"friction.{name}": (_friction_unit(f.metadata), getattr(law, name)) for name, f in law.quantities().items()
    }
    if not is_homogeneous(law):
        named[_UNIT_FRICTION] = _FRICTION, 1
    return {n: Quantity(n, unit, rational(value, n)) for n, (unit, value) in named.items() if value is not None}


def _friction_unit(metadata: Mapping[str, str]) -> str:
    """Unit with directed lengths: ``directed_unit`` of the law if given; a pure number is a friction coefficient."""
    return str(metadata.get("directed_unit", metadata["unit"] or _FRICTION))


def is_homogeneous(law: FrictionLaw) -> bool:
    """Whether μ is homogeneous of degree 1 (Euler) in those parameters that are friction coefficients."""
    import sympy as sp

    factor, symbols = sp.Symbol("c", positive=True), law.symbols()
    plain = sp.sympify(law.symbolic().coefficient(*_arguments(law)))
    numbers = [symbols[n] for n, f in law.quantities().items() if _friction_unit(f.metadata) == _FRICTION]
    grown = plain.subs({symbol: factor * symbol for symbol in numbers}, simultaneous=True)
    return bool(sp.expand(grown - factor * plain) == 0)


def _arguments(law: FrictionLaw) -> "tuple[sp.Symbol, ...]":
    """Symbols of slip, slip rate and state, the arguments of a coefficient."""
    import sympy as sp

    return tuple(sp.Symbol(n, positive=True) for n in ("x", "v", *(f"theta{i}" for i in range(len(law.state_names)))))


# ----------------------------------------------------------------------
# Signed roots of rationals: exact rational powers of rationals.

_WORKING_DIGITS = 60


@dataclass(frozen=True, slots=True)
class Radical:
    """sign · radicand^(1/degree) with sign −1, 0 or 1, radicand > 0 (1 for zero), and the smallest possible degree.

    This form is unique, so equal numbers compare equal. Products, quotients and rational powers have this form too, so
    every scale factor and every scaled gain is exact. Create such numbers with `radical`.
    """

    sign: int
    radicand: Fraction
    degree: int

    @property
    def fraction(self) -> Fraction:
        """The number as a fraction.

        Raises
        ------
        ParameterError
            When it is irrational.
        """
        if self.degree > 1:
            raise ParameterError(
                f"a rational number is needed. Received {self.text()}…, a root of degree {self.degree}."
            )
        return self.sign * self.radicand

    def __mul__(self, other: "Radical | Fraction | int") -> "Radical":
        right = radical(other)
        degree = lcm(self.degree, right.degree)
        radicand = self.radicand ** (degree // self.degree) * right.radicand ** (degree // right.degree)
        return _canonical(self.sign * right.sign, radicand, degree)

    __rmul__ = __mul__

    def __truediv__(self, other: "Radical | Fraction | int") -> "Radical":
        return self * radical(other) ** -1

    def __pow__(self, exponent: Fraction | int) -> "Radical":
        power = Fraction(exponent)
        if (self.sign == 0 and power <= 0) or (self.sign < 0 and power.denominator != 1):
            raise ParameterError(
                f"a power must be real and finite. Received the base {self.text()} and the exponent {power}. "
                "A base of 0 needs a positive exponent, and a negative base an integer exponent."
            )
        if self.sign == 0:
            return self
        sign = -1 if self.sign < 0 and power.numerator % 2 else 1
        return _canonical(sign, self.radicand**power.numerator, self.degree * power.denominator)

    def decimal(self, digits: int = 12) -> Decimal:
        """Nearest decimal number with the given significant digits."""
        with localcontext(Context(prec=max(_WORKING_DIGITS, 2 * digits))):
            ratio = Decimal(self.radicand.numerator) / Decimal(self.radicand.denominator)
            root = self.sign * ratio ** (Decimal(1) / self.degree)
        return Context(prec=digits).plus(root)

    def nearest(self, digits: int = 12) -> Fraction:
        """The number itself if it is rational, else the nearest decimal with the given significant digits."""
        return self.fraction if self.degree == 1 else rational(str(self.decimal(digits)))

    def text(self, digits: int = 12) -> str:
        """Exact decimal or p/q if the number is rational, else a decimal with the given significant digits."""
        if self.degree > 1:
            return f"{self.decimal(digits):.{digits}g}"
        rounded = self.decimal(17).normalize()
        if Fraction(rounded) != self.fraction:
            return exact_text(self.fraction)
        return f"{rounded:f}" if -7 <= rounded.adjusted() <= 17 else str(rounded)

    def __float__(self) -> float:
        return float(self.decimal(40))

    __str__ = text


def radical(value: "Radical | Fraction | int") -> Radical:
    """Exact number from a rational; a `Radical` is returned unchanged."""
    if isinstance(value, Radical):
        return value
    exact = Fraction(value)
    return _canonical((exact > 0) - (exact < 0), abs(exact) or Fraction(1), 1)


def _canonical(sign: int, radicand: Fraction, degree: int) -> Radical:
    if sign == 0:
        return Radical(0, Fraction(1), 1)
    for power in (n for n in range(degree, 1, -1) if degree % n == 0):
        from sympy import integer_nthroot

        (top, whole), (bottom, whole_below) = (integer_nthroot(n, power) for n in radicand.as_integer_ratio())
        if whole and whole_below:
            return Radical(sign, Fraction(int(top), int(bottom)), degree // power)
    return Radical(sign, radicand, degree)


# ----------------------------------------------------------------------
# Scale factors between faults, and of any quantity.


@checked_dataclass(frozen=True, kw_only=True)
class Scales:
    """Scale factors λ, target over source, of mass, time and three independent lengths: fault, slip, normal direction.

    Attributes
    ----------
    factors : mapping of str to Radical
        Positive, by name in `quakedesign.fault.similarity.BASES`.

    Raises
    ------
    ParameterError
        For a factor that is missing, unknown or not positive.
    """

    factors: Mapping[str, Radical]

    def __post_init__(self) -> None:
        if set(self.factors) != set(BASES) or any(f.sign <= 0 for f in self.factors.values()):
            raise ParameterError(
                f"scale factors must be positive, one for each of {', '.join(BASES)}. "
                f"Received {', '.join(f'{n} = {f}' for n, f in self.factors.items()) or 'none'}."
            )
        object.__setattr__(self, "factors", MappingProxyType(dict(self.factors)))

    @classmethod
    def from_ratios(cls, ratios: Mapping[str, Radical | Fraction | int]) -> Self:
        """Scale factors from the ratios of five independent quantities.

        Parameters
        ----------
        ratios : mapping of unit to number
            Target over source, such as ``{"slip_m": …, "s": …, "normal_Pa": …, "fault_m": …, "kg/fault_m^3": …}``.

        Raises
        ------
        ParameterError
            When the units are not five independent ones, or a ratio is not positive.
        """
        matrix = dimensional_matrix(list(ratios))
        if matrix.shape != (5, 5) or matrix.det() == 0:
            raise ParameterError(
                f"scale factors need the ratios of five quantities with independent dimensions. "
                f"Received {', '.join(ratios) or 'none'}."
            )
        if any(radical(ratio).sign <= 0 for ratio in ratios.values()):
            raise ParameterError(f"ratios must be positive. Received {', '.join(str(r) for r in ratios.values())}.")
        powers = {base: map(fraction_of, matrix.inv().col(i)) for i, base in enumerate(BASES)}
        return cls(
            factors={base: power_product(ratios, dict(zip(ratios, powers[base], strict=True))) for base in BASES}
        )

    def of(self, unit: str) -> Radical:
        """Scale factor of any quantity from its unit; ``m`` is a slip, ``Pa`` a normal stress or fluid pressure."""
        return power_product(self.factors, dict(zip(BASES, dimension(unit), strict=True)))

    def inverse(self) -> Self:
        """Scale factors in the opposite direction."""
        return replace(self, factors={base: factor**-1 for base, factor in self.factors.items()})


def power_product(bases: Mapping[str, Radical | Fraction | int], exponents: Mapping[str, Fraction]) -> Radical:
    """Π base^exponent, exact; a base that is zero must have an exponent ≥ 0."""
    return prod((radical(bases[n]) ** e for n, e in exponents.items() if e), start=radical(1))


# ----------------------------------------------------------------------
# Similarity of faults: π-groups as the null space of the dimensional matrix, scale factors, and scaled faults. If every
# π-group has the same value in two faults, every solution of one is a solution of the other after slip, time and
# pressure are multiplied by their scale factors.

TOLERANCE = Fraction(1, 100)
"""Largest relative difference of a π-group of similar faults, for parameters given to three digits."""

CLOCKS = ("reference.operation_time", "shear_modulus")
"""Quantities that may set the time scale: the task, as in Table I of the paper, or the natural period ∝ √(ρL²/G)."""

_SUPERSCRIPTS = str.maketrans("-/0123456789", "⁻ᐟ⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True, kw_only=True)
class PiGroup:
    """One dimensionless product Π parameter^exponent, without zero exponents.

    `name` is the parameter that the product makes dimensionless; its exponent is 1.
    """

    name: str
    exponents: Mapping[str, Fraction]

    @property
    def formula(self) -> str:
        """The product as text, such as ``shear_modulus·density⁻¹·…``."""
        return "·".join(n + (str(e).translate(_SUPERSCRIPTS) if e != 1 else "") for n, e in self.exponents.items())

    def _repr_latex_(self) -> str:
        words = (rf"\text{{{n.replace('_', ' ')}}}^{{{e}}}" for n, e in self.exponents.items())
        return rf"$\displaystyle {' '.join(words)}$"

    def value(self, parameters: Mapping[str, Quantity]) -> Radical:
        """Exact value [-] for given parameters."""
        values = {name: parameters[name].value for name in self.exponents}
        return power_product(values, self.exponents) if all(values.values()) else radical(0)


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupComparison:
    """Values [-] of one π-group in two faults."""

    group: PiGroup
    source: Radical
    target: Radical

    @property
    def ratio(self) -> Radical | None:
        """target/source [-]; None if only the source has the value zero."""
        if self.source == self.target:
            return radical(1)
        return self.target / self.source if self.source.sign else None

    def within(self, tolerance: Fraction) -> bool:
        """Whether the ratio is in [1 − tolerance, 1 + tolerance], decided in exact arithmetic."""
        if (ratio := self.ratio) is None:
            return False
        return (1 - tolerance) ** ratio.degree <= ratio.sign * ratio.radicand <= (1 + tolerance) ** ratio.degree


@dataclass(frozen=True, kw_only=True)
class Similarity:
    """Scale factors from one fault to another, and the differences that remain."""

    scales: Scales
    # Parameters whose ratios give the scales of slip, time, pressure, length and mass
    repeating: tuple[str, ...]
    comparisons: tuple[GroupComparison, ...]  # π-groups of the parameters that both faults have
    # ``friction.law`` if the laws are different functions, and parameters of only one fault
    unmatched: tuple[str, ...] = ()

    @cached_property
    def differing(self) -> tuple[GroupComparison, ...]:
        """Groups that are not exactly equal."""
        return tuple(c for c in self.comparisons if c.source != c.target)

    def violations(self, tolerance: Fraction = TOLERANCE) -> tuple[GroupComparison, ...]:
        """Groups that differ by more than a relative tolerance."""
        return tuple(c for c in self.comparisons if not c.within(tolerance))

    def similar(self, tolerance: Fraction = TOLERANCE) -> bool:
        """Whether no group differs by more than the tolerance and both faults have the same parameters."""
        return not self.unmatched and not self.violations(tolerance)


def pi_groups(parameters: Sequence[Quantity]) -> tuple[PiGroup, ...]:
    """Basis of the rational null space of the dimensional matrix, one group for every non-repeating parameter.

    The first parameters with independent dimensions are the repeating ones, so the order determines the basis.
    """
    groups = []
    for vector in dimensional_matrix([q.unit for q in parameters]).nullspace():
        powers = {q.name: fraction_of(power) for q, power in zip(parameters, vector, strict=True) if power}
        made = list(powers)[-1]
        groups.append(PiGroup(name=made, exponents={made: Fraction(1)} | powers))
    return tuple(groups)


def ordered(fault: Fault, clock: str = CLOCKS[0]) -> tuple[Quantity, ...]:
    """Parameters of a fault, beginning with those that fix the scales; `clock` is one of `CLOCKS`.

    Raises
    ------
    UnknownNameError
        For any other value of `clock`.
    """
    require_known(clock, CLOCKS, "clock", UnknownNameError)
    every, (slip, normal, time) = quantities(fault), map(BASES.index, ("slip", "normal_length", "time"))
    # Friction parameters with a slip length, pure lengths first, then the target slip.
    sizes = {name: dimension(q.unit) for name, q in every.items() if name.startswith("friction.")}
    lengths = sorted(
        (n for n, size in sizes.items() if size[slip] and not size[normal]), key=lambda n: sizes[n][time] != 0
    )
    first = (_UNIT_FRICTION, "density", "length", clock, *lengths, "reference.target_slip", "effective_normal_stress")
    return tuple(sorted(every.values(), key=lambda q: (q.value == 0, first.index(q.name) if q.name in first else 99)))


def similarity(source: Fault, target: Fault, *, clock: str | None = None) -> Similarity:
    """Scale factors from one fault to another, and every π-group in both.

    Parameters
    ----------
    clock : str, optional
        Quantity that sets the time scale, one of `CLOCKS`. By default the task, as in Table I of the paper; but the
        natural period if the ratio of operation times is not that of the natural periods (within `TOLERANCE`).
    """
    if clock is None:
        by_task = similarity(source, target, clock=CLOCKS[0])
        agrees = all(c.within(TOLERANCE) for c in by_task.comparisons if c.group.name == CLOCKS[1])
        return by_task if agrees else similarity(source, target, clock=CLOCKS[1])
    there, here = quantities(target), quantities(source)
    common = [q for q in ordered(source, clock) if q.name in there and there[q.name].unit == q.unit]
    common.sort(key=lambda q: q.value == 0 or there[q.name].value == 0)
    repeating = [common[i] for i in dimensional_matrix([q.unit for q in common]).rref()[1]]
    law = () if _law(source) == _law(target) else ("friction.law",)
    return Similarity(
        scales=Scales.from_ratios({q.unit: there[q.name].value / q.value for q in repeating}),
        repeating=tuple(q.name for q in repeating),
        comparisons=tuple(
            GroupComparison(group=g, source=g.value(here), target=g.value(there)) for g in pi_groups(common)
        ),
        unmatched=(*law, *(name for name in here | there if name not in {q.name for q in common})),
    )


def _law(fault: Fault) -> "tuple[sp.Expr, ...]":
    """Friction as a symbolic function, which does not depend on the values of the parameters."""
    law, arguments = fault.friction.symbolic(), _arguments(fault.friction)
    return law.coefficient(*arguments), *law.state_rates(*arguments)


def scaled_parameters(parameters: Mapping[str, Quantity], scales: Scales) -> dict[str, Radical]:
    """Exact parameters of the similar fault, by dotted name."""
    return {name: scales.of(q.unit) * q.value for name, q in parameters.items()}


def scaled_fault(source: Fault, scales: Scales, name: str | None = None) -> Fault:
    """Fault that is similar to another one; only the final conversion to floats rounds.

    Parameters
    ----------
    source : Fault
    scales : Scales
    name : str, optional
        Name of the new fault; by default that of the source with ``-scaled``.

    Raises
    ------
    ParameterError
        When a scaled value is out of range, or the scales change a friction coefficient that cannot be scaled.
    """
    exact = scaled_parameters(quantities(source), scales)
    if exact.pop(_UNIT_FRICTION, radical(1)) != radical(1):
        raise ParameterError(
            f"slip_m/normal_m must have the factor 1, because {source.friction.name} cannot be multiplied by a factor. "
            f"Received the factor {scales.of('slip_m/normal_m')}. Give slip_m and normal_m the same factor."
        )
    parts: dict[str, dict[str, float]] = {"": {}, "friction": {}, "reference": {}, "disturbance": {}}
    for dotted, value in exact.items():
        part, _, key = dotted.rpartition(".")
        parts[part][key] = float(value)
    changes: dict[str, Any] = dict(parts.pop(""))
    changes |= {part: replace(getattr(source, part), **values) for part, values in parts.items()}
    return replace(source, name=name or f"{source.name}-scaled", source=f"similar to: {source.source}", **changes)
