"""What the matched perturbation h of a fault asks for, with and without feed-forward. Ball arithmetic only."""

from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

import sympy as sp

from quakedesign.controllers.feed_forward import NONE, FeedForward
from quakedesign.fault import Fault
from quakedesign.rationals import fraction_of, rational
from quakedesign.symbolic import plant
from quakedesign.symbolic.balls import upper_bound
from quakedesign.symbolic.friction_bounds import friction_bounds

Range = tuple[Fraction, Fraction]

stage = sp.Symbol("s", nonnegative=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Bounds on |e1| [m], |e2| [m/s] and |e2'| [m/s²]."""

    slip: Fraction = Fraction(0)
    rate: Fraction = Fraction(0)
    acceleration: Fraction = Fraction(0)

    def ranges(self) -> dict[sp.Symbol, Range]:
        """Symmetric ranges by symbol."""
        parts = {plant.e1: self.slip, plant.e2: self.rate, plant.acceleration_error: self.acceleration}
        return {symbol: (-v, v) for symbol, v in parts.items()}


def friction_range(fault: Fault) -> Range:
    """μ_res and μ_max [-], exact, confirmed by enclosure of the law."""
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
    """h' along a solution [unit of ν per s], in what `known_ranges` and the errors bound."""
    bending, flat = plant.matched_rate_in_parts()
    moved = (plant.r3, plant.r2, plant.r1, plant.phi_t, plant.acceleration_error, plant.e2)
    flat = sp.expand(flat + _feedforward_rate(feedforward))
    return _with_known(bending + sp.collect(flat, moved), fault, divisor)


def _feedforward_rate(feedforward: FeedForward) -> sp.Expr:
    """Time derivative of the feed-forward along a solution, by the chain rule."""
    x1, x2, push = sp.symbols("x1 x2 push", real=True)
    rates = {x1: plant.e2 + plant.r1, x2: plant.acceleration_error + plant.r2, push: plant.r3}
    added = feedforward.acceleration(x1, x2, push)
    return sum((added.diff(signal) * rate for signal, rate in rates.items()), start=sp.Integer(0))


@lru_cache(maxsize=16)
def sensitivity_expressions(fault: Fault, divisor: Fraction, feedforward: FeedForward) -> tuple[sp.Expr, sp.Expr]:
    """∂h/∂e1 [1/s²] and ∂h/∂e2 [1/s] at a fixed time; along a chord where friction has no derivative.

    They bound the part of h that the errors cause: |h(t, e) − h(t, 0)| ≤ g1|e1| + g2|e2| with the largest
    absolute values g1, g2 between 0 and e.
    """
    added = feedforward.acceleration(plant.e1, plant.e2, sp.Integer(0))
    slip, still, rate, calm = plant.sensitivities()
    expressions = (slip + (still + added.diff(plant.e1)), rate + (calm + added.diff(plant.e2)))
    first, second = (_with_known(expression, fault, divisor) for expression in expressions)
    return first, second


def _with_known(expression: sp.Expr, fault: Fault, divisor: Fraction) -> sp.Expr:
    """Insert μ*, the divisor, the reference, and the growth of the disturbance where its value stands."""
    static = static_friction(fault)
    grown = plant.phi_1 * (plant.e1 + plant.r0) + plant.phi_2 * (plant.e2 + plant.r1)
    known = {
        plant.mu_star: sp.Rational(static.numerator, static.denominator),
        plant.divisor: sp.Rational(divisor.numerator, divisor.denominator),
    }
    return expression.xreplace({plant.phi: plant.phi + grown}).xreplace(known | _reference_values(fault))


@lru_cache(maxsize=16)
def _reference_values(fault: Fault) -> dict[sp.Symbol, sp.Expr]:
    """r and its three derivatives [m, m/s, …] as polynomials of the stage t/t_op."""
    t_op = sp.Rational(str(rational(fault.reference.operation_time)))
    r = fault.reference.slip(stage * t_op)
    names = (plant.r0, plant.r1, plant.r2, plant.r3)
    return {name: sp.factor(sp.expand(r).diff(stage, n) / t_op**n) for n, name in enumerate(names)}


def known_ranges(fault: Fault) -> dict[sp.Symbol, Range]:
    """Ranges of all that h' and its sensitivities depend on, but the errors: friction in its bounds and slopes."""
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


def static_friction(fault: Fault) -> Fraction:
    """μ* [-], friction at rest where the fault starts, exact or rounded."""
    start = sp.nsimplify(fault.friction.exact().coefficient(sp.Integer(0), sp.Integer(0)), rational=True)
    return fraction_of(start) if start.is_Rational else rational(str(sp.N(start, 50)))


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
    """Rigorous bound on |h'| [unit of ν per s] over the uncertainty box, the reference and the disturbance class.

    Friction may be any function within its bounds and slope bounds; one that weakens with slip, where its law does. The
    disturbance may be any function of the preset's amplitude and rate of change.

    Parameters
    ----------
    fault : Fault
    divisor : Fraction
        μ0N̂0 [m²/kg].
    errors : Errors
        Ranges of e1 [m], e2 [m/s], e2' [m/s²].
    pieces : int
        Largest number of subdivisions; fewer give a larger bound.
    feedforward : FeedForward
        What the law adds to ν, and so to h.
    limit : Fraction, optional
        As in `upper_bound`, where it is asked only whether the bound is below that [unit of ν per s].
    """
    expression = rate_expression(fault, divisor, feedforward)
    return upper_bound(expression, known_ranges(fault) | errors.ranges(), pieces=pieces, limit=limit)


@lru_cache(maxsize=256)
def largest_sensitivities(
    fault: Fault, divisor: Fraction, errors: Errors, *, pieces: int = 60, feedforward: FeedForward = NONE
) -> tuple[Fraction, Fraction]:
    """Rigorous bounds g1 on |∂h/∂e1| [1/s²] and g2 on |∂h/∂e2| [1/s], as `largest_matched_rate`."""
    box = known_ranges(fault) | errors.ranges()
    first, second = sensitivity_expressions(fault, divisor, feedforward)
    return upper_bound(first, box, pieces=pieces), upper_bound(second, box, pieces=pieces)


def initial_perturbation(fault: Fault, divisor: Fraction) -> Fraction:
    """Bound on |h| at t = 0, x = 0: the disturbance over β, friction at its static value; no feed-forward there."""
    static, least = static_friction(fault), plant_ranges(fault)[plant.N_hat][0]
    return fault.disturbance_bounds[0] * divisor / (static * least)
