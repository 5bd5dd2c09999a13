"""Bounds of the matched perturbation, the input gain, sectors and equilibrium pressures of a fault.

All bounds hold over the uncertainty box and are computed in ball arithmetic. Chapters: bounds of the matched
perturbation h and its rate, with and without feed-forward; sectors and equilibrium pressures for any constant reference
(ERRATA 6 to 12).
"""

from dataclasses import dataclass
from fractions import Fraction
from functools import cache, lru_cache
from itertools import product

import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.exact import end_of, fraction_of, rational, to_sympy
from quakedesign.fault import Fault
from quakedesign.laws.feed_forward import NONE, FeedForward
from quakedesign.plant import static_friction, uncertain_plant
from quakedesign.symbolic import plant
from quakedesign.symbolic.enclosure import enclose, upper_bound
from quakedesign.symbolic.friction_bounds import friction_bounds

# ----------------------------------------------------------------------
# Matched perturbation h and its rate, with and without feed-forward, in ball arithmetic.

Range = tuple[Fraction, Fraction]

stage = sp.Symbol("s", nonnegative=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Bounds on |e1| [m], |e2| [m/s] and |e2'| [m/s²]."""

    slip: Fraction = Fraction(0)
    rate: Fraction = Fraction(0)
    acceleration: Fraction = Fraction(0)

    def ranges(self) -> dict[sp.Symbol, Range]:
        """Symmetric ranges of the errors by symbol."""
        parts = {plant.e1: self.slip, plant.e2: self.rate, plant.acceleration_error: self.acceleration}
        return {symbol: (-v, v) for symbol, v in parts.items()}


def friction_range(fault: Fault) -> Range:
    """Exact bounds μ_res and μ_max [-], confirmed by enclosure of the law."""
    bounds = friction_bounds(fault.friction)
    return bounds.least, bounds.most


def plant_ranges(fault: Fault) -> dict[sp.Symbol, Range]:
    """Ranges of k̂ [1/s²], η̂ [1/s], N̂ [m²/kg] over the uncertainty box; σ'_n [Pa] is known."""
    values = {symbol: fraction_of(v) for symbol, v in plant.plant_values(fault).items()}
    widths = {plant.k_hat: fault.box.stiffness, plant.eta_hat: fault.box.damping, plant.N_hat: fault.box.authority}
    return {s: (v * (1 - widths.get(s, 0)), v * (1 + widths.get(s, 0))) for s, v in values.items()}


def least_authority(fault: Fault) -> Fraction:
    """μ_res·N̂_min [m²/kg], the divisor of designed gains and the b of the e-LQR (ERRATA 9)."""
    return friction_range(fault)[0] * plant_ranges(fault)[plant.N_hat][0]


def coefficient_range(fault: Fault, divisor: Fraction) -> Range:
    """Range of β = μN̂/divisor [-] (eq. Bounds)."""
    low, high = friction_range(fault)
    N_low, N_high = plant_ranges(fault)[plant.N_hat]
    return low * N_low / divisor, high * N_high / divisor


@lru_cache(maxsize=16)
def rate_expression(fault: Fault, divisor: Fraction, feedforward: FeedForward) -> sp.Expr:
    """Rate h' [m/s³] along a solution, in symbols whose ranges are those of `parameter_ranges` and of the errors."""
    bending, flat = plant.matched_rate_in_parts()
    moved = (plant.r3, plant.r2, plant.r1, plant.phi_t, plant.acceleration_error, plant.e2)
    x1, x2, push = sp.symbols("x1 x2 push", real=True)
    rates = {x1: plant.e2 + plant.r1, x2: plant.acceleration_error + plant.r2, push: plant.r3}
    added = feedforward.acceleration(x1, x2, push)
    flat = sp.expand(flat + sum((added.diff(signal) * rate for signal, rate in rates.items()), start=sp.Integer(0)))
    return _with_values(bending + sp.collect(flat, moved), fault, divisor)


@lru_cache(maxsize=16)
def sensitivity_expressions(fault: Fault, divisor: Fraction, feedforward: FeedForward) -> tuple[sp.Expr, sp.Expr]:
    """∂h/∂e1 [1/s²] and ∂h/∂e2 [1/s] at a fixed time; chord slopes where friction has no derivative.

    They bound the error-dependent part of h: |h(t, e) − h(t, 0)| ≤ g1|e1| + g2|e2| with the largest absolute values g1,
    g2 between 0 and e.
    """
    added = feedforward.acceleration(plant.e1, plant.e2, sp.Integer(0))
    slip, still, rate, calm = plant.sensitivities()
    expressions = (slip + (still + added.diff(plant.e1)), rate + (calm + added.diff(plant.e2)))
    first, second = (_with_values(expression, fault, divisor) for expression in expressions)
    return first, second


def _with_values(expression: sp.Expr, fault: Fault, divisor: Fraction) -> sp.Expr:
    """Expression with values of μ*, divisor and reference, and with the growth of the disturbance added to φ."""
    static = static_friction(fault)
    grown = plant.phi_1 * (plant.e1 + plant.r0) + plant.phi_2 * (plant.e2 + plant.r1)
    values = {
        plant.mu_star: sp.Rational(static.numerator, static.denominator),
        plant.divisor: sp.Rational(divisor.numerator, divisor.denominator),
    }
    return expression.xreplace({plant.phi: plant.phi + grown}).xreplace(values | _reference_values(fault))


@lru_cache(maxsize=16)
def _reference_values(fault: Fault) -> dict[sp.Symbol, sp.Expr]:
    """r and its three derivatives [m, m/s, …] as polynomials of the normalised time t/t_op."""
    t_op = sp.Rational(str(rational(fault.reference.operation_time)))
    r = fault.reference.slip(stage * t_op)
    names = (plant.r0, plant.r1, plant.r2, plant.r3)
    return {name: sp.factor(sp.expand(r).diff(stage, n) / t_op**n) for n, name in enumerate(names)}


def parameter_ranges(fault: Fault) -> dict[sp.Symbol, Range]:
    """Ranges of all symbols in h' and its sensitivities except the errors; friction by its bounds and slope bounds."""
    friction, disturbance = friction_bounds(fault.friction), fault.disturbance
    value, change = fault.disturbance_bounds
    growth = rational(disturbance.slip_growth), rational(disturbance.rate_growth)
    return plant_ranges(fault) | {
        stage: (Fraction(0), Fraction(1)),
        plant.friction_value: friction_range(fault),
        plant.slip_slope: (-friction.slip_slope, Fraction(0) if friction.weakens else friction.slip_slope),
        plant.rate_slope: (-friction.rate_slope, friction.rate_slope),
        plant.phi: (-value, value),
        plant.phi_t: (-change, change),
        plant.phi_1: (growth[0], growth[0]),
        plant.phi_2: (growth[1], growth[1]),
    }


@lru_cache(maxsize=256)
def largest_matched_rate(
    fault: Fault,
    divisor: Fraction,
    errors: Errors,
    *,
    pieces: int = 120,
    feedforward: FeedForward = NONE,
    limit: Fraction | None = None,
) -> Fraction:
    """Rigorous bound on |h'| [m/s³] over the uncertainty box, the reference and the disturbance class.

    Friction may be any function within its bounds and slope bounds, and weakens with slip if its law does. The
    disturbance may be any function within the fault's bounds on value and rate of change.

    Parameters
    ----------
    divisor : Fraction
        Divisor μ0N̂0 [m²/kg] of the control law p = ν/(μ0N̂0).
    errors : Errors
        Bounds on |e1| [m], |e2| [m/s] and |e2'| [m/s²].
    pieces : int
        Largest number of subdivisions; fewer yield a larger bound.
    feedforward : FeedForward
        Term that the law adds to ν, and thus to h.
    limit : Fraction, optional
        Limit [m/s³] as in `upper_bound`, if only the comparison of the bound with this limit is needed.
    """
    expression = rate_expression(fault, divisor, feedforward)
    return upper_bound(expression, parameter_ranges(fault) | errors.ranges(), pieces=pieces, limit=limit)


@lru_cache(maxsize=256)
def largest_sensitivities(
    fault: Fault, divisor: Fraction, errors: Errors, *, pieces: int = 60, feedforward: FeedForward = NONE
) -> tuple[Fraction, Fraction]:
    """Rigorous bounds g1 on |∂h/∂e1| [1/s²] and g2 on |∂h/∂e2| [1/s], as `largest_matched_rate`."""
    box = parameter_ranges(fault) | errors.ranges()
    first, second = sensitivity_expressions(fault, divisor, feedforward)
    return upper_bound(first, box, pieces=pieces), upper_bound(second, box, pieces=pieces)


def initial_perturbation(fault: Fault, divisor: Fraction) -> Fraction:
    """Bound on |h| [m/s²] at t = 0, x = 0: disturbance divided by β, with static friction, without feed-forward."""
    static, least = static_friction(fault), plant_ranges(fault)[plant.N_hat][0]
    return fault.disturbance_bounds[0] * divisor / (static * least)


# ----------------------------------------------------------------------
# Sectors and pressures of a fault for any constant reference, over its uncertainty box (ERRATA 6 to 12).


@dataclass(frozen=True, slots=True, kw_only=True)
class Sectors:
    """Ranges of the chord slopes of all state-dependent terms, about the equilibrium of any constant reference.

    x2' = s·x1 − w·x2 + β·b·p, where s, w and β take any values in their ranges at every time.
    """

    authority: Fraction  # b = μ_res·N̂_min [m²/kg] (ERRATA 9)
    beta: Range  # Range of μN̂/b [-]
    # Range of s [1/s²]: friction's weakening (and strengthening, unless the law only weakens), spring, growth of the
    # disturbance
    slip: Range
    rate: Range  # Range of w [1/s]: damping, friction's slope in slip rate (ERRATA 10), growth of the disturbance
    # g1 [Pa/m] and g2 [Pa·s/m] with |h| ≤ g1|x1| + g2|x2| (ERRATA 6, 7), where h [Pa] is the state-dependent force per
    # mass beyond that of the nominal spring and dashpot, divided by b
    row_bounds: Range
    # max |σ' − p*| [Pa] over the constant references up to the target slip (ERRATA 8)
    largest_effective_stress: Fraction

    def __post_init__(self) -> None:
        if not all(low <= high for low, high in self.ranges().values()):
            raise ParameterError(f"ranges must be ordered. Received {self.beta}, {self.slip}, {self.rate}.")

    def vertices(self) -> list[tuple[Fraction, Fraction, Fraction]]:
        """Distinct corners (β, s, w) of the ranges."""
        return list(dict.fromkeys(product(self.beta, self.slip, self.rate)))

    def ranges(self) -> dict[str, Range]:
        """Ranges by their names in the loop field of the e-LQR."""
        return {"beta": self.beta, "s": self.slip, "w": self.rate}


def sectors(fault: Fault) -> Sectors:
    """Exact sector bounds of a fault over its uncertainty box, from the ranges of its uncertain plant."""
    ranges = uncertain_plant(fault)
    nominal = {name: fraction_of(v) for name, v in plant.plant_values(fault).items()}
    return Sectors(
        authority=ranges.authority,
        beta=ranges.beta,
        slip=ranges.slip_chord,
        rate=ranges.rate_chord,
        row_bounds=(
            max(abs(s + nominal[plant.k_hat]) for s in ranges.slip_chord) / ranges.authority,
            max(abs(w - nominal[plant.eta_hat]) for w in ranges.rate_chord) / ranges.authority,
        ),
        largest_effective_stress=max(map(abs, ranges.stress)),
    )


def rest_pressure(
    fault: Fault, slip: Range, *, nominal: bool = False, drift: Fraction = Fraction(0), pieces: int = 64
) -> Range:
    """Rigorous enclosure of the pressure p* [Pa] that holds the fault at rest at a constant reference (ERRATA 8).

    The range of references is subdivided, and every piece is enclosed in ball arithmetic.

    Parameters
    ----------
    slip : (Fraction, Fraction)
        Range of the reference r0 [m], not negative.
    nominal : bool
        Use the friction law and parameters of the fault, instead of any friction and parameters in the box.
    drift : Fraction
        Largest drift term k̂v∞t of the loading [m/s²].
    pieces : int
        Number of subdivisions of the range.

    Raises
    ------
    ParameterError
        When no finite enclosure is found.
    """
    expression, box = _rest(fault, nominal)
    box = box | {_drift: (Fraction(0), drift)}
    step, ends = (slip[1] - slip[0]) / pieces, list[Fraction]()
    friction, start = friction_bounds(fault.friction), static_friction(fault)
    for n in range(pieces if step else 1):
        part = (slip[0] + n * step, slip[0] + (n + 1) * step)
        most = friction.slip_slope * part[1]  # largest change from the static value, by the slope bound
        at_rest = max(friction.least, start - most), min(friction.most, start + most)
        pressures = enclose(expression, box | {_r: part, _mu: at_rest})
        if not pressures.is_finite():
            raise ParameterError("the pressure at rest has no finite enclosure: friction may vanish. Narrow the box.")
        ends += [end_of(pressures.lower()), end_of(pressures.upper())]
    return min(ends), max(ends)


@lru_cache(maxsize=64)
def equilibrium_pressure(fault: Fault, slip: Fraction) -> Range:
    """Rigorous range of the pressure [Pa] that holds the nominal fault at rest at references from 0 to a slip [m].

    The part of the disturbance that depends only on time is excluded. Each end exceeds the attained range by at most
    1e-4 of its width.

    Raises
    ------
    ParameterError
        When no finite enclosure is found.
    """
    box = {_r: (Fraction(0), slip)}
    expression = _rest(fault, nominal=True)[0].subs(_drift, 0)
    low, high = rest_pressure(fault, box[_r], nominal=True)
    above = upper_bound(expression - to_sympy(low), box, tolerance=_FINE)
    below = upper_bound(to_sympy(high) - expression, box, tolerance=_FINE)
    return high - below, low + above


_FINE = Fraction(1, 10**4)
_r = sp.Symbol("r_0", nonnegative=True)
_mu = sp.Symbol("mu", positive=True)
_growth = sp.Symbol("phi_1", real=True)
_drift = sp.Symbol("drift", nonnegative=True)


@cache
def _net_stress() -> sp.Expr:
    """σ' − p* [Pa] at rest at r0 [m], for friction μ, a disturbance that grows with slip, and a drift k̂v∞t [m/s²]."""
    balance = plant.shifted_acceleration().replace(plant.disturbance, lambda x, *_: _growth * x + _drift)
    balance = balance.replace(plant.mu, lambda *_: _mu).subs({plant.x1: _r, plant.x2: 0})
    balance = sp.expand(balance)  # linear in p
    return sp.expand(plant.sigma + balance.coeff(plant.p, 0) / balance.coeff(plant.p))


def _rest(fault: Fault, nominal: bool) -> tuple[sp.Expr, dict[sp.Symbol, Range]]:
    """p* [Pa] in symbols, with few repetitions for tight enclosures, and the ranges of the symbols."""
    values = {
        _growth: to_sympy(rational(fault.disturbance.slip_growth)),
        plant.mu_star: to_sympy(static_friction(fault)),
    }
    expression = plant.sigma - sp.collect(sp.expand(_net_stress().subs(values) * _mu), _r) / _mu  # μ occurs once
    ranges = plant_ranges(fault)
    if not nominal:
        return expression, {s: ranges[s] for s in (plant.k_hat, plant.N_hat, plant.sigma)}
    law = fault.friction.exact()
    return expression.subs(plant.plant_values(fault)).subs(_mu, law.coefficient(_r, sp.Integer(0))), {}
