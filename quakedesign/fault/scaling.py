"""Similarity of faults: π-groups as the null space of the dimensional matrix, scale factors, and scaled faults.

The dimensional matrix comes from units alone (`quakedesign.fault.dimensions`). Two faults are similar if every
π-group has the same value in both (Buckingham 1914, Phys. Rev. 4, 345); then every solution of one is a solution of
the other after slip, time and pressure are multiplied by their scale factors.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

from quakedesign.errors import ParameterError, UnknownNameError, require_known
from quakedesign.fault.dimensions import BASES, PLANT_UNITS, Quantity, dimension, dimensional_matrix, quantities
from quakedesign.fault.parameters import Fault
from quakedesign.fault.radical import Radical, radical
from quakedesign.fault.scales import Scales, power_product
from quakedesign.rationals import fraction_of

TOLERANCE = Fraction(1, 100)
"""Relative difference of a π-group up to which faults known to three digits count as similar."""

CLOCKS = ("reference.operation_time", "shear_modulus")
"""What may fix the scale of time: the task, as in Table I of the paper, or the natural period 1/ω_n ∝ √(ρL²/G)."""

_SUPERSCRIPTS = str.maketrans("-/0123456789", "⁻ᐟ⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True, kw_only=True)
class PiGroup:
    """One dimensionless product of parameters, Π parameter^exponent.

    Attributes
    ----------
    name : str
        The parameter that this group makes dimensionless; its exponent is 1.
    exponents : mapping of str to Fraction
        By dotted name of the parameter, without zeros.
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
        if any(parameters[name].value == 0 for name in self.exponents):
            return radical(0)
        return power_product({name: parameters[name].value for name in self.exponents}, self.exponents)


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupComparison:
    """One π-group in two faults.

    Attributes
    ----------
    group : PiGroup
    source, target : Radical
        Values [-].
    """

    group: PiGroup
    source: Radical
    target: Radical

    @property
    def ratio(self) -> Radical | None:
        """target/source [-]; None where it is zero in the source only."""
        if self.source == self.target:
            return radical(1)
        return self.target / self.source if self.source.sign else None

    def within(self, tolerance: Fraction) -> bool:
        """True where the ratio is in [1 − tolerance, 1 + tolerance], decided in exact arithmetic."""
        if self.ratio is None:
            return False
        bound = self.ratio.degree
        size = self.ratio.sign * self.ratio.radicand
        return (1 - tolerance) ** bound <= size <= (1 + tolerance) ** bound


@dataclass(frozen=True, kw_only=True)
class Similarity:
    """How one fault maps onto another, and what stands in the way.

    Attributes
    ----------
    scales : Scales
    repeating : tuple of str
        Parameters from whose ratios the scales follow; they fix slip, time, pressure, length and mass.
    comparisons : tuple of GroupComparison
        Every π-group of the parameters that both faults have.
    unmatched : tuple of str
        ``friction.law`` where the laws are different functions, and parameters that only one of them has.
    """

    scales: Scales
    repeating: tuple[str, ...]
    comparisons: tuple[GroupComparison, ...]
    unmatched: tuple[str, ...] = ()

    @cached_property
    def differing(self) -> tuple[GroupComparison, ...]:
        """Groups that are not exactly equal."""
        return tuple(c for c in self.comparisons if c.source != c.target)

    def violations(self, tolerance: Fraction = TOLERANCE) -> tuple[GroupComparison, ...]:
        """Groups that differ by more than a relative tolerance."""
        return tuple(c for c in self.comparisons if not c.within(tolerance))

    def similar(self, tolerance: Fraction = TOLERANCE) -> bool:
        """True where no group differs by more than the tolerance and both faults have the same parameters."""
        return not self.unmatched and not self.violations(tolerance)


def pi_groups(parameters: Sequence[Quantity]) -> tuple[PiGroup, ...]:
    """Basis of the rational null space of the dimensional matrix, one group for every parameter that is not repeated.

    Parameters
    ----------
    parameters : sequence of Quantity
        The first ones with independent dimensions are the repeated ones, so the order decides on the basis.
    """
    names = [q.name for q in parameters]
    groups = []
    for vector in dimensional_matrix([q.unit for q in parameters]).nullspace():
        powers = {name: fraction_of(power) for name, power in zip(names, vector, strict=True) if power}
        made = list(powers)[-1]
        groups.append(PiGroup(name=made, exponents={made: Fraction(1)} | powers))
    return tuple(groups)


def ordered(fault: Fault, clock: str = CLOCKS[0]) -> tuple[Quantity, ...]:
    """Parameters of a fault, those that fix the scales first.

    Parameters
    ----------
    fault : Fault
    clock : str
        One of `CLOCKS`.

    Raises
    ------
    UnknownNameError
        For another clock.
    """
    require_known(clock, CLOCKS, "clock", UnknownNameError)
    first = ("unit friction", "density", "length", clock, *_slip_parameters(fault), "effective_normal_stress")
    found = quantities(fault)
    return tuple(sorted(found.values(), key=lambda q: (q.value == 0, first.index(q.name) if q.name in first else 99)))


def _slip_parameters(fault: Fault) -> tuple[str, ...]:
    """Friction parameters with a slip length, pure lengths first, then the target slip."""
    slip = BASES.index("slip")
    found = [q for q in quantities(fault).values() if q.name.startswith("friction.")]
    held = [q for q in found if dimension(q.unit)[slip] and not dimension(q.unit)[BASES.index("normal_length")]]
    return (*(q.name for q in sorted(held, key=lambda q: dimension(q.unit)[-1] != 0)), "reference.target_slip")


def similarity(source: Fault, target: Fault, *, clock: str | None = None) -> Similarity:
    """Scale factors from one fault to another, and every π-group in both.

    Parameters
    ----------
    source, target : Fault
    clock : str, optional
        What fixes the scale of time, one of `CLOCKS`. Unless given the task, as in Table I of the paper; but the
        natural period where the operation times are not in the ratio of the natural periods (within `TOLERANCE`).
    """
    if clock is not None:
        return _compared(source, target, clock)
    by_task = _compared(source, target, CLOCKS[0])
    agrees = all(c.within(TOLERANCE) for c in by_task.comparisons if c.group.name == CLOCKS[1])
    return by_task if agrees else _compared(source, target, CLOCKS[1])


def _compared(source: Fault, target: Fault, clock: str) -> Similarity:
    there, here = quantities(target), quantities(source)
    common = [q for q in ordered(source, clock) if q.name in there and there[q.name].unit == q.unit]
    common.sort(key=lambda q: q.value == 0 or there[q.name].value == 0)
    pivots = dimensional_matrix([q.unit for q in common]).rref()[1]
    repeating = [common[i] for i in pivots]
    comparisons = tuple(
        GroupComparison(group=g, source=g.value(here), target=g.value(there)) for g in pi_groups(common)
    )
    matched = {q.name for q in common}
    law = () if _law(source) == _law(target) else ("friction.law",)
    return Similarity(
        scales=Scales.from_ratios({q.unit: there[q.name].value / q.value for q in repeating}),
        repeating=tuple(q.name for q in repeating),
        comparisons=comparisons,
        unmatched=(*law, *(n for n in (here | there) if n not in matched)),
    )


def _law(fault: Fault) -> tuple[Any, ...]:
    """Friction as a function, in symbols: equal for equal laws, whatever their parameters' values."""
    import sympy as sp

    slip, rate = sp.Symbol("x", positive=True), sp.Symbol("v", positive=True)
    state = sp.symbols(f"theta:{len(fault.friction.state_names)}", positive=True)
    law = fault.friction.symbolic()
    return law.coefficient(slip, rate, *state), *law.state_rates(slip, rate, *state)


def scaled_parameters(parameters: Mapping[str, Quantity], scales: Scales) -> dict[str, Radical]:
    """Exact parameters of the similar fault, by dotted name."""
    return {name: scales.of(q.unit) * q.value for name, q in parameters.items()}


def scaled_fault(source: Fault, scales: Scales, name: str | None = None) -> Fault:
    """Fault that is similar to another one; only the last step, to the floats of a `Fault`, rounds.

    Parameters
    ----------
    source : Fault
    scales : Scales
    name : str, optional
        Name of the new fault; that of the source with ``-scaled`` unless given.

    Raises
    ------
    ParameterError
        When a scaled value is out of range, or friction shall be scaled though its law admits no factor.
    """
    exact = scaled_parameters(quantities(source), scales)
    if exact.pop("unit friction", radical(1)) != radical(1):
        raise ParameterError(
            f"{source.friction.name} cannot be multiplied by a factor, so the scales must leave friction as it is. "
            f"Received the factor {scales.of('slip_m/normal_m')} for slip_m/normal_m."
        )
    held = {dotted: float(value) for dotted, value in exact.items()}
    changes: dict[str, Any] = {key: held[key] for key in PLANT_UNITS if "." not in key and key in held}
    for part in ("friction", "reference", "disturbance"):
        changes[part] = replace(getattr(source, part), **_inside(held, f"{part}."))
    return replace(source, name=name or f"{source.name}-scaled", source=f"similar to: {source.source}", **changes)


def _inside(values: Mapping[str, float], prefix: str) -> dict[str, float]:
    return {name.removeprefix(prefix): value for name, value in values.items() if name.startswith(prefix)}
