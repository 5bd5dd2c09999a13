"""Bounds of the linear design from the uncertainty of a fault, term by term (ERRATA 6 to 11, 24)."""

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from quakedesign.errors import ParameterError
from quakedesign.exact import LowerBound, UpperBound, float_above, float_below, fraction_of, rational, shortly
from quakedesign.fault import Fault
from quakedesign.files import Json
from quakedesign.lyapunov.exact.perturbation_bounds import (
    Sectors,
    least_authority,
    plant_ranges,
    rest_pressure,
    sectors,
)
from quakedesign.symbolic import plant
from quakedesign.symbolic.friction_bounds import friction_bounds

Range = tuple[Fraction, Fraction]


@dataclass(frozen=True, slots=True, kw_only=True)
class Contribution:
    """Contribution of one uncertain quantity to h."""

    name: str
    acts_on: str  # ``"slip"``, ``"slip rate"``, or ``"nothing"`` for a part that does not vanish at the equilibrium
    range: Range  # Coefficient in x2' [1/s² on slip, 1/s on slip rate, m/s² on nothing]
    bound: Fraction  # Largest share in |h| [Pa/m, Pa·s/m, Pa]


@dataclass(frozen=True, slots=True, kw_only=True)
class UncertaintyBounds:
    """Bounds of h = (…)/b and of μN̂ over the uncertainty box, about any constant reference up to the target slip."""

    sectors: Sectors
    contributions: tuple[Contribution, ...]
    control: Range  # Interval of μN̂ [m²/kg]
    rest_pressure: Range  # Rigorous enclosure of p* [Pa] over the constant references and the box
    # Bound on |h| [Pa] at the equilibrium: drift of the far end and disturbance. No equilibrium exists where it is not
    # zero; only a bounded error can then be certified (ERRATA 8, 11, 24).
    nonvanishing: Fraction

    def to_dict(self) -> Json:
        """Plain values, SI."""
        return {
            "g1": float_above(self.sectors.row_bounds[0]),
            "g2": float_above(self.sectors.row_bounds[1]),
            "control": _outward(self.control),
            "rest_pressure": _outward(self.rest_pressure),
            "largest_effective_stress": float_above(self.sectors.largest_effective_stress),
            "nonvanishing": float_above(self.nonvanishing),
            "contributions": [
                {"name": c.name, "acts_on": c.acts_on, "range": _outward(c.range), "bound": float_above(c.bound)}
                for c in self.contributions
            ],
        }

    def table(self) -> str:
        """Markdown table: every term, its range in x2', its bound in h and its share of the column."""
        lines = ["| term | acts on | range in x2' | bound in \\|h\\| | share |", "|---|---|---|---:|---:|"]
        for c in self.contributions:
            column = sum((d.bound for d in self.contributions if d.acts_on == c.acts_on), Fraction(0))
            share = f"{float(c.bound / column):.1%}" if column else "-"
            ends = f"{LowerBound(c.range[0]):.4g} … {UpperBound(c.range[1]):.4g}"
            lines.append(
                f"| {c.name} | {c.acts_on} | {ends} {_UNITS[c.acts_on][0]} | "
                f"{UpperBound(c.bound):.4g} {_UNITS[c.acts_on][1]} | {share} |"
            )
        return "\n".join(lines) + "\n"


def _outward(ends: Range) -> list[float]:
    return [float_below(ends[0]), float_above(ends[1])]


_UNITS = {"slip": ("1/s²", "Pa/m"), "slip rate": ("1/s", "Pa·s/m"), "nothing": ("m/s²", "Pa")}


def uncertainty_bounds(fault: Fault, *, loading_rate: float | str = 0) -> UncertaintyBounds:
    """Bounds of a fault, term by term with names.

    Parameters
    ----------
    fault : Fault
    loading_rate : float or str
        v∞ [m/s], speed of the far end: k̂v∞t remains as a non-vanishing term (ERRATA 24).

    Raises
    ------
    ParameterError
        For a negative loading rate.
    """
    speed = rational(loading_rate, "loading_rate")
    if speed < 0:
        raise ParameterError(
            f"loading_rate must not be negative. Received {shortly(speed)} m/s. Give its absolute value."
        )
    needed, b, ranges = sectors(fault), least_authority(fault), plant_ranges(fault)
    values = {name: fraction_of(v) for name, v in plant.plant_values(fault).items()}
    drift = ranges[plant.k_hat][1] * speed * rational(fault.reference.operation_time)
    parts = _terms(fault, needed, ranges, values, drift)
    lasting = sum((max(map(abs, r)) for _, acts_on, r in parts if acts_on == "nothing"), Fraction(0)) / b
    return UncertaintyBounds(
        sectors=needed,
        contributions=tuple(
            Contribution(name=name, acts_on=acts_on, range=ends, bound=max(map(abs, ends)) / b)
            for name, acts_on, ends in parts
        ),
        control=(needed.beta[0] * b, needed.beta[1] * b),
        rest_pressure=rest_pressure(fault, (Fraction(0), rational(fault.reference.target_slip)), drift=drift),
        nonvanishing=lasting,
    )


def _terms(fault: Fault, sectors: Sectors, ranges: Any, values: Any, drift: Fraction) -> list[tuple[str, str, Range]]:
    """Name, argument, and range in x2' of every term of b·h."""
    friction, disturbance = friction_bounds(fault.friction), fault.disturbance
    load = ranges[plant.N_hat][1] * sectors.largest_effective_stress
    slip_chord, rate_chord = (load * slope for slope in (friction.slip_slope, friction.rate_slope))
    k, eta = ranges[plant.k_hat], ranges[plant.eta_hat]
    lowest = sectors.slip[0] + k[1] - rational(disturbance.slip_growth)  # 0 where σ' − p* stays positive
    growth = [rational(v) for v in (disturbance.slip_growth, disturbance.rate_growth)]
    shaking, _ = fault.disturbance_bounds
    return [
        ("friction chord slope", "slip", (lowest, slip_chord)),
        ("stiffness", "slip", (values[plant.k_hat] - k[1], values[plant.k_hat] - k[0])),
        ("disturbance growing with slip", "slip", (growth[0], growth[0])),
        ("friction chord slope", "slip rate", (-rate_chord, rate_chord)),
        ("viscosity", "slip rate", (values[plant.eta_hat] - eta[1], values[plant.eta_hat] - eta[0])),
        ("disturbance growing with slip rate", "slip rate", (growth[1], growth[1])),
        ("drift of the far end", "nothing", (Fraction(0), drift)),
        ("disturbance at rest", "nothing", (-shaking, shaking)),
    ]
