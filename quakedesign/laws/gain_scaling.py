"""Gains scaled from one fault to a similar one, with exponents from the terms of the law.

Let λ_p, λ_δ and λ_t be the ratios of pressure, slip and time, target fault over source fault (Table I of the paper). A
law keeps its effect if every term scales like the sum to which it belongs. The pressure scales with λ_p, the rate of an
integral state like this state divided by time, slip errors with λ_δ, and slip-rate errors with λ_δ/λ_t. These
conditions are linear in the exponents of the gains. They are derived from the SymPy expression of the law and solved
exactly, so that user-defined laws are scaled like those of the paper (appendix, with ERRATA 19 and 20).
"""

import tomllib
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, replace
from decimal import Decimal
from fractions import Fraction
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import NamedTuple

import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.exact import fraction_of, rational
from quakedesign.fault.similarity import Radical, Scales, power_product, radical
from quakedesign.laws.base import Controller, Signals
from quakedesign.laws.catalogue import control_law
from quakedesign.symbolic.homogeneity import size_of

Form = dict[str, Fraction]
"""Exponents of `BASES`."""

BASES = ("slip", "time", "output")
"""Base quantities of the dimension of a gain; `output` is p [Pa], or ν = p·divisor [m/s²] with a divisor."""

UNROUNDED = {("lab-fault", "elqr"): ("1250000000/3", "6250000/9", "125000000/3", "1250000/9")}
"""Laboratory gains before they were rounded for print; only these give the printed real-fault gains (ERRATA 25)."""


class LawDimensions(NamedTuple):
    """Exponents of slip, time and output by name of gain and integral state (``xi1``, ``xi2`` and so on) of a law."""

    gains: Mapping[str, Form]
    integrals: Mapping[str, Form]


@dataclass(frozen=True, kw_only=True)
class ScaledGains:
    """Exact gains of a law in `gain_units`, and its integral states over those on the source fault."""

    law: Controller
    gains: Mapping[str, Radical]
    integrals: Mapping[str, Radical]

    def controller(self, digits: int = 12) -> Controller:
        """Controller with these gains; irrational ones are rounded to `digits` significant digits."""
        return replace(self.law, gains={name: gain.nearest(digits) for name, gain in self.gains.items()})


def carry(gains: Controller | ScaledGains, scales: Scales, *, divisor: Fraction | None = None) -> ScaledGains:
    """Gains of the target fault that are equivalent to those of the source fault.

    Parameters
    ----------
    gains : Controller or ScaledGains
        `ScaledGains` are scaled further, or back with `scales.inverse()`, without rounding.
    scales : Scales
        From source to target.
    divisor : Fraction, optional
        μ0N̂0 of the scaled law [m²/kg], for laws that have one. By default it is unchanged, as in the appendix of the
        paper, and ν scales like the pressure.

    Raises
    ------
    ParameterError
        If a divisor is given for a law that has none, or the terms of the law are inconsistent.
    """
    start = gains if isinstance(gains, ScaledGains) else exact(gains)
    law, output = start.law, scales.of("Pa")
    if divisor is not None:
        law = law.with_divisor(divisor)
        output *= Fraction(divisor) / (start.law.divisor or 1)
    factors = {"slip": scales.of("slip_m"), "time": scales.of("s"), "output": output}
    forms = law_dimensions(law)
    return ScaledGains(
        law=law,
        gains={name: gain * power_product(factors, forms.gains[name]) for name, gain in start.gains.items()},
        integrals={name: xi * power_product(factors, forms.integrals[name]) for name, xi in start.integrals.items()},
    )


def exact(controller: Controller) -> ScaledGains:
    """Exact gains of a controller before any scaling."""
    return ScaledGains(
        law=controller,
        gains={name: radical(gain) for name, gain in controller.gains.items()},
        integrals={name: radical(1) for name in _integral_names(controller)},
    )


def _integral_names(controller: Controller) -> list[str]:
    return [f"xi{i}" for i, _ in enumerate(controller.integral_units, start=1)]


def law_dimensions(controller: Controller) -> LawDimensions:
    """Dimensions of all gains and integral states of a law, inferred from its expressions.

    Raises
    ------
    ParameterError
        When the terms of the law are inconsistent, or do not determine the dimension of a gain.
    """
    symbols = {name: sp.Symbol(name, positive=True) for name in controller.gain_units}
    integrals = {name: sp.Symbol(name, real=True) for name in _integral_names(controller)}
    slip, time, output = (sp.Dummy(base) for base in BASES)
    x1, e1, x2, e2 = sp.symbols("x1 e1 x2 e2", real=True)
    signals = Signals(slip=x1, slip_error=e1, slip_rate=x2, slip_rate_error=e2, integrals=tuple(integrals.values()))
    unknown = {symbol: symbol for symbol in (*symbols.values(), *integrals.values())}
    sizes = {**unknown, x1: slip, e1: slip, x2: slip - time, e2: slip - time}
    twin, conditions = _with_gains(controller, symbols), list[sp.Expr]()
    equations = [(twin.pressure(signals), output)]
    equations += [(rate, xi - time) for xi, rate in zip(integrals.values(), twin.integral_rates(signals), strict=True)]
    for expression, left in equations:
        whole = sp.sympify(expression)
        if strange := whole.free_symbols - sizes.keys():
            names = ", ".join(sorted(map(str, strange)))
            raise ParameterError(f"{controller.name} must depend on gains and signals only. Received {names}.")
        conditions.append(size_of(whole, sizes, conditions) - left)
    solution = _solved(conditions, [*unknown], [slip, time, output], controller.name)
    return LawDimensions(gains={n: solution[n] for n in symbols}, integrals={n: solution[n] for n in integrals})


def _with_gains(controller: Controller, symbols: Mapping[str, sp.Symbol]) -> Controller:
    """The law with symbols for gains; only for building expressions."""
    twin = copy(controller)
    kind = type("Symbolic", (type(controller),), {"_exact_gains": lambda _: list(symbols.values())})
    object.__setattr__(twin, "__class__", kind)
    object.__setattr__(twin, "gains", symbols)
    return twin


def _solved(conditions: list[sp.Expr], unknown: list[sp.Symbol], bases: list[sp.Symbol], law: str) -> dict[str, Form]:
    """Every unknown dimension in terms of `BASES`, from linear expressions that vanish."""
    reduced, pivots = sp.linear_eq_to_matrix(conditions, *unknown, *bases)[0].rref()
    if any(pivot >= len(unknown) for pivot in pivots):
        raise ParameterError(
            f"the terms of {law} must have consistent units: no units of its gains make each sum consistent. "
            "Check the exponents, and make every constant with a unit a gain."
        )
    free = [symbol.name for i, symbol in enumerate(unknown) if i not in pivots]
    if free:
        raise ParameterError(
            f"the terms of {law} do not determine the unit of {', '.join(free)}. Replace products of gains by one gain."
        )
    forms = {}
    for row, pivot in enumerate(pivots):
        values = {base: reduced[row, len(unknown) + i] for i, base in enumerate(BASES)}
        forms[unknown[pivot].name] = {base: -fraction_of(v) for base, v in values.items() if v}
    return forms


@cache
def printed_gains(fault_name: str, law: str) -> Mapping[str, str]:
    """Gains as the paper prints them, with their digits; empty where it prints none."""
    data = tomllib.loads((files("quakedesign.laws") / "published.toml").read_text(encoding="utf-8"))
    table = data.get(fault_name)
    entry = table.get(law) if isinstance(table, dict) else None
    names = control_law(law).gain_units if entry else ()
    return MappingProxyType(dict(zip(names, entry["gains"], strict=True)) if entry else {})


def agrees(value: Radical, printed: str) -> bool:
    """True where a number rounds to a printed one, decided in exact arithmetic."""
    half = Fraction(Decimal(1).scaleb(int(Decimal(printed).as_tuple().exponent))) / 2
    low, high = (  # sign(end)·|end|^degree, which increases with the end
        (1 if end >= 0 else -1) * abs(end) ** value.degree
        for end in (rational(printed) - half, rational(printed) + half)
    )
    return low <= value.sign * value.radicand <= high
