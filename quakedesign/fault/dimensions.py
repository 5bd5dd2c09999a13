"""The dimensions of the spring-slider: what may be rescaled independently.

The equation of motion never compares a slip with the length of the fault, nor a tangential with a normal direction:
a stiffness k = GL is a force per slip, a friction coefficient a tangential force per normal force. The metres of the
three are therefore three units (directed lengths, as in Huntley 1967, Dimensional Analysis), with mass and time five
in all; this is why slip, fault length and friction scale by different factors in Table I of the paper.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from functools import cache
from typing import TYPE_CHECKING, Any

from quakedesign.errors import UnitError
from quakedesign.fault.disturbance import Disturbance
from quakedesign.fault.friction import FrictionLaw
from quakedesign.fault.parameters import Fault
from quakedesign.fault.reference import Reference
from quakedesign.rationals import rational

if TYPE_CHECKING:
    import sympy as sp

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """One parameter of a fault.

    Attributes
    ----------
    name : str
        Dotted name inside the `Fault`.
    unit : str
        With directed lengths.
    value : Fraction
        In that unit.
    """

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
    """Exponents of `BASES` in a unit; a plain ``m`` is one of slip and ``Pa`` one of normal stress or fluid pressure.

    Raises
    ------
    UnitError
        For a unit that cannot be read.
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
    """Every parameter of a fault by dotted name, those of its friction law included.

    Where a friction law cannot be stretched as a whole by its dimensionless parameters, friction has no scale of its
    own; the constant friction coefficient 1 is then one more parameter, the same for every fault.
    """
    law = fault.friction
    named = {name: (unit, number) for name, unit in PLANT_UNITS.items() if (number := _number(fault, name)) is not None}
    named |= {
        f"friction.{name}": (_friction_unit(field.metadata), getattr(law, name))
        for name, field in law.quantities().items()
    }
    quantities = {n: Quantity(name=n, unit=u, value=rational(v, n)) for n, (u, v) in named.items()}
    if not stretches(law):
        quantities[_UNIT_FRICTION] = Quantity(name=_UNIT_FRICTION, unit=_FRICTION, value=Fraction(1))
    return quantities


def _number(fault: Fault, dotted: str) -> float | None:
    value: Any = fault
    for part in dotted.split("."):
        value = getattr(value, part)
    number: float | None = value
    return number


def _friction_unit(metadata: Mapping[str, Any]) -> str:
    """Unit with directed lengths: a law may state it as ``directed_unit``; a number is a friction coefficient."""
    return str(metadata.get("directed_unit", metadata["unit"] or _FRICTION))


def stretches(law: FrictionLaw) -> bool:
    """True where μ grows by any factor as all friction coefficients among the parameters do (degree 1 of Euler)."""
    import sympy as sp

    factor = sp.Symbol("c", positive=True)
    slip, rate = sp.Symbol("x", positive=True), sp.Symbol("v", positive=True)
    state = sp.symbols(f"theta:{len(law.state_names)}", positive=True)
    plain = sp.sympify(law.symbolic().coefficient(slip, rate, *state))
    symbols = law.symbols()
    numbers = [symbols[n] for n, f in law.quantities().items() if _friction_unit(f.metadata) == _FRICTION]
    grown = plain.subs({symbol: factor * symbol for symbol in numbers}, simultaneous=True)
    return bool(sp.expand(grown - factor * plain) == 0)
