"""How much of the box a given K tolerates: friction slope, range of β, decay rate. Each proved, beside its limit."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from quakedesign.bounds import LowerBound, UpperBound
from quakedesign.certificates import Certificate, Loop
from quakedesign.certificates.premises import plant_ranges
from quakedesign.certificates.sectors import sectors
from quakedesign.controllers import Controller
from quakedesign.fault import Fault
from quakedesign.rationals import fraction_of, nearest, rational
from quakedesign.symbolic import plant
from quakedesign.symbolic.friction_bounds import friction_bounds
from quakedesign.synthesis.linear.analysis.common_quadratic import robust_stability, sector_loop
from quakedesign.synthesis.linear.analysis.frequency import circle_limit, slip_limit
from quakedesign.synthesis.linear.plant.polytope import polytope_of
from quakedesign.synthesis.linear.plant.problem import FeedbackLoop

_SHARES = (Fraction(9995, 10000), Fraction(999, 1000), Fraction(997, 1000), Fraction(992, 1000))
_STEPS = 10
_BETA_STEPS = 7
_LARGEST_BETA = 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class SlopeMargin:
    """Friction-slope margin: h = s(t)·x1 with 0 ≤ s ≤ margin·s_max at any time, for all β of the box ``paper``.

    Attributes
    ----------
    certified : LowerBound
        The common quadratic V proves it up to here; 0 when nothing was proved.
    limit : UpperBound
        A constant s of limit·s_max, with β = `limit_beta`, is not asymptotically stable (Routh–Hurwitz, exact).
    limit_beta : Fraction
    circle : float
        What the circle criterion allows for time-varying s at `limit_beta`, measured.
    slope : Fraction
        s_max = N̂σ'_n·|Δμ|/d_c [1/s²].
    working_slope : Fraction
        The same with the largest effective stress on the way to the target slip (ERRATA 8) [1/s²].
    certificate : Certificate or None
    """

    certified: LowerBound
    limit: UpperBound
    limit_beta: Fraction
    circle: float
    slope: Fraction
    working_slope: Fraction
    certificate: Certificate | None

    def to_dict(self) -> dict[str, Any]:
        """Exact numbers as texts, measured ones as numbers."""
        return {
            "friction_slope_margin": self.certified.exact,
            "linear_limit": self.limit.exact,
            "linear_limit_beta": str(self.limit_beta),
            "circle_limit": self.circle,
            "slope": str(self.slope),
            "working_slope": str(self.working_slope),
            "working_margin": float(LowerBound(self.certified * self.slope / self.working_slope)),
        }


def friction_slope_margin(fault: Fault, controller: Controller) -> SlopeMargin | None:
    """Certify the friction-slope margin to within a thousandth of its supremum for this family of V.

    Parameters
    ----------
    fault : Fault
        Its box is replaced by ``paper``; its disturbance does not count.
    controller : Controller
        e-LQR.

    Returns
    -------
    SlopeMargin or None
        None for friction without slope, or when the loop without friction slope is unstable for a β of the range.
    """
    fault = fault.with_box("paper")
    needed, slope = sectors(fault), nominal_slope(fault)
    spring, damping = (plant_ranges(fault)[symbol][0] for symbol in (plant.k_hat, plant.eta_hat))
    still = replace(needed, slip=(-spring, -spring), rate=(damping, damping))
    loop = FeedbackLoop(gains=tuple(controller.gains.values()), sectors=still)
    critical = slip_limit(loop, damping)
    if slope == 0 or critical is None or critical[0] <= -spring:
        return None
    limit, beta = (critical[0] + spring) / slope, critical[1]

    def prove(margin: Fraction) -> Certificate | None:
        widened = replace(needed, slip=(-spring, margin * slope - spring), rate=(damping, damping))
        return robust_stability(sector_loop(controller, widened))

    certified, certificate = _largest(prove, limit)
    stress = needed.largest_effective_stress / rational(fault.effective_normal_stress)
    return SlopeMargin(
        certified=LowerBound(certified),
        limit=UpperBound(limit),
        limit_beta=beta,
        circle=circle_limit(loop, beta, damping, -spring) / float(slope),
        slope=slope,
        working_slope=slope * stress,
        certificate=certificate,
    )


def nominal_slope(fault: Fault) -> Fraction:
    """s_max = N̂σ'_n·(largest chord slope of friction in slip) at zero pressure [1/s²]."""
    values = plant.plant_values(fault)
    return fraction_of(values[plant.N_hat] * values[plant.sigma]) * friction_bounds(fault.friction).slip_slope


def _largest(prove: Callable[[Fraction], Certificate | None], limit: Fraction) -> tuple[Fraction, Certificate | None]:
    """Largest number below a limit that is proved: shares of the limit first, bisection below them."""
    for share in _SHARES:
        value = _decimal(limit * share)
        certificate = prove(value)
        if certificate is not None:
            return value, certificate
    low, high, best = Fraction(0), limit * _SHARES[-1], None
    for _ in range(_STEPS):
        middle = _decimal((low + high) / 2)
        proof = prove(middle)
        low, high, best = (middle, high, proof) if proof is not None else (low, middle, best)
    return low, best


def _decimal(value: Fraction) -> Fraction:
    """Value rounded down to six significant decimals."""
    digits = f"{float(value) * (1 - 1e-6):.5e}"
    return Fraction(digits)


@dataclass(frozen=True, slots=True, kw_only=True)
class GainRange:
    """Range of β = μN̂/b over which one V proves stability with everything else anywhere in the box.

    Attributes
    ----------
    low, high : UpperBound, LowerBound
        Printed, they stay inside what is proved. Each with the other end as the box has it. `high` is at most 1024
        times the box's: no upper limit was looked for above.
    low_limit : LowerBound
        A constant β of this, with a constant vertex of the rest, is not asymptotically stable (exact).
    certificates : tuple of Certificate
    """

    low: UpperBound
    high: LowerBound
    low_limit: LowerBound
    certificates: tuple[Certificate, ...]

    def to_dict(self) -> dict[str, Any]:
        """Exact numbers as texts."""
        return {"beta_low": self.low.exact, "beta_high": self.high.exact, "beta_low_limit": self.low_limit.exact}


def gain_range(fault: Fault, controller: Controller) -> GainRange | None:
    """Certify how far β may leave the box at either end, by bisection; None when the box itself is not proved."""
    needed = sectors(fault)

    def prove(low: Fraction, high: Fraction) -> Certificate | None:
        return robust_stability(sector_loop(controller, replace(needed, beta=(low, high))))

    least, most = needed.beta
    inside = prove(least, most)
    if inside is None:
        return None
    limit = _least_stable(FeedbackLoop(gains=tuple(controller.gains.values()), sectors=needed))
    ends = {"low": (least, inside), "high": (most, inside)}
    low, certified = limit, least
    for _ in range(_BETA_STEPS):
        middle = nearest(float((low + certified) / 2), 1 << 24)
        proof = prove(middle, most)
        if proof is None:
            low = middle
        else:
            certified, ends["low"] = middle, (middle, proof)
    factor, failed = Fraction(4), False
    while factor <= _LARGEST_BETA and not failed:
        proof = prove(least, most * factor)
        failed = proof is None
        if proof is not None:
            ends["high"] = (most * factor, proof)
        factor *= 4
    return GainRange(
        low=UpperBound(ends["low"][0]),
        high=LowerBound(ends["high"][0]),
        low_limit=LowerBound(limit),
        certificates=(ends["low"][1], ends["high"][1]),
    )


def _least_stable(loop: FeedbackLoop) -> Fraction:
    """Largest β below the range, to 2⁻²⁰ of its end, at which a constant vertex of s and w is not stable, or 0."""
    low, high = Fraction(0), loop.sectors.beta[0]
    for _ in range(20):
        middle = (low + high) / 2
        there = replace(loop, sectors=replace(loop.sectors, beta=(middle, middle)))
        low, high = (low, middle) if there.unstable_vertex() is None else (middle, high)
    return low


@dataclass(frozen=True, slots=True, kw_only=True)
class DecayRate:
    """Exponential decay for all measurable courses of the parameters in the box.

    Attributes
    ----------
    certified : LowerBound
        a with |x(t)| ≤ C·e^{−at} [1/s].
    limit : float
        The slowest pole of a constant vertex [1/s], measured; nothing decays faster.
    certificate : Certificate
    """

    certified: LowerBound
    limit: float
    certificate: Certificate


def decay_rate(loop: Loop) -> DecayRate | None:
    """Certify the largest decay rate that a common quadratic V finds; None when stability is not proved."""
    certificate = robust_stability(loop, fastest=True)
    if certificate is None:
        return None
    limit = -polytope_of(loop).slowest()
    return DecayRate(certified=LowerBound(certificate.claims["rate"]), limit=limit, certificate=certificate)
