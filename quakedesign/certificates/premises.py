"""What a certificate needs, against what a given fault, reference and disturbance ask for. Ball arithmetic only."""

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

import sympy as sp

from quakedesign.certificates.claim import Certificate, require, sympy_field
from quakedesign.controllers import SlidingMode
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.symbolic import plant
from quakedesign.symbolic.balls import enclose, upper_bound
from quakedesign.symbolic.terms import from_terms

Range = tuple[Fraction, Fraction]

stage = sp.Symbol("s", nonnegative=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Premise:
    """One condition under which a certificate speaks about a given loop.

    Attributes
    ----------
    name : str
    required : float
        What the loop asks for, in `unit`; a rigorous upper bound unless `measured`.
    certified : float
        What the certificate covers, in `unit`.
    unit : str
    proved : bool
        False if `certified` is only a limit that no certificate can exceed; the premise then never holds.
    measured : bool
        True if `required` was read off a simulation.
    note : str
        What the number assumes.
    """

    name: str
    required: float
    certified: float
    unit: str
    measured: bool = False
    proved: bool = True
    note: str = ""

    @property
    def ratio(self) -> float | None:
        """required/certified [-]; None where nothing is certified and something is required."""
        if self.certified == 0:
            return 0.0 if self.required == 0 else None
        return self.required / self.certified

    @property
    def holds(self) -> bool:
        """Whether the ratio is at most 1 and a certificate exists."""
        return self.proved and self.ratio is not None and self.ratio <= 1

    def to_dict(self) -> dict:
        """Keys of DESIGN.md and the unit."""
        return {
            "name": self.name,
            "required": self.required,
            "certified": self.certified,
            "ratio": self.ratio,
            "holds": self.holds,
            "unit": self.unit,
            "measured": self.measured,
            "note": self.note,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Bounds on |e1| [m], |e2| [m/s] and |e2'| [m/s²]."""

    slip: Fraction
    rate: Fraction
    acceleration: Fraction

    def ranges(self) -> dict[sp.Symbol, Range]:
        """Symmetric ranges by symbol."""
        parts = {plant.e1: self.slip, plant.e2: self.rate, plant.acceleration_error: self.acceleration}
        return {symbol: (-v, v) for symbol, v in parts.items()}


def friction_range(fault: Fault) -> Range:
    """μ_res and μ_max [-], exact."""
    low, high = (_fraction(v) for v in fault.friction.exact().bounds)
    return low, high


def plant_ranges(fault: Fault) -> dict[sp.Symbol, Range]:
    """Ranges of k̂ [1/s²], η̂ [1/s], N̂ [m²/kg] over the uncertainty box; σ'_n [Pa] is known."""
    values = {symbol: _fraction(v) for symbol, v in plant.plant_values(fault).items()}
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


def _reference_values(fault: Fault) -> dict[sp.Symbol, sp.Expr]:
    """r and its three derivatives [m, m/s, …] as polynomials of the stage t/t_op."""
    t_op = sp.Rational(str(rational(fault.reference.operation_time)))
    r = fault.reference.slip(stage * t_op)
    names = (plant.r0, plant.r1, plant.r2, plant.r3)
    return {name: sp.factor(sp.expand(r).diff(stage, n) / t_op**n) for n, name in enumerate(names)}


@lru_cache(maxsize=16)
def _matched_rate(fault: Fault, divisor: Fraction) -> sp.Expr:
    static = friction_range(fault)[1]
    known = {
        plant.mu_star: sp.Rational(static.numerator, static.denominator),
        plant.divisor: sp.Rational(divisor.numerator, divisor.denominator),
    }
    return plant.matched_rate().subs(known).subs(_reference_values(fault))


def _box(fault: Fault) -> dict[sp.Symbol, Range]:
    """Everything that h' depends on, but the errors: friction anywhere in its bounds and slopes."""
    law, disturbance = fault.friction.exact(), fault.disturbance
    slip_slope, rate_slope = (_fraction(sp.sympify(v)) for v in (law.slip_slope, law.rate_slope))
    value, change = (rational(v) for v in (disturbance.largest_explicit, disturbance.largest_rate))
    growth = rational(disturbance.slip_growth), rational(disturbance.rate_growth)
    return plant_ranges(fault) | {
        stage: (Fraction(0), Fraction(1)),
        plant.friction_value: friction_range(fault),
        plant.slip_slope: (-slip_slope, Fraction(0)),
        plant.rate_slope: (-rate_slope, rate_slope),
        plant.phi: (-value, value),
        plant.phi_t: (-change, change),
        plant.phi_1: (growth[0], growth[0]),
        plant.phi_2: (growth[1], growth[1]),
    }


def largest_matched_rate(fault: Fault, divisor: Fraction, errors: Errors, *, pieces: int = 400) -> Fraction:
    """Rigorous bound on |h'| [unit of ν per s] over the uncertainty box, the reference and the disturbance class.

    Friction may be any function that weakens with slip within its bounds and slope bounds. The disturbance may
    be any function of the preset's amplitude and rate of change.

    Parameters
    ----------
    fault : Fault
    divisor : Fraction
        μ0N̂0 [m²/kg].
    errors : Errors
        Ranges of e1 [m], e2 [m/s], e2' [m/s²].
    pieces : int
        Largest number of subdivisions; fewer give a larger bound.
    """
    return upper_bound(_matched_rate(fault, divisor), _box(fault) | errors.ranges(), pieces=pieces)


def control_coefficient(fault: Fault, divisor: Fraction, certified: Range) -> Premise:
    """β inside the certified range; the ratio is the larger of b_M/β_M and β_m/b_m."""
    low, high = coefficient_range(fault, divisor)
    worst = max(high / certified[1], certified[0] / low)
    return Premise(
        name="control_coefficient",
        required=float(worst * certified[1]),
        certified=float(certified[1]),
        unit="-",
        note=f"β from {float(low):.6g} to {float(high):.6g}; certified from {float(certified[0]):.6g}",
    )


def matched_rate_premise(
    fault: Fault, controller: SlidingMode, name: str, errors: Errors, certified: Fraction | None, note: str
) -> Premise:
    """|h'| ≤ L̄ while the errors stay within bounds; without a certificate against the limit of the gains."""
    required = largest_matched_rate(fault, controller.divisor, errors)
    against = controller.lipschitz_limit if certified is None else certified * controller.scale
    return Premise(
        name=name,
        required=_up(required),
        certified=float(against),
        unit="m/s^3",
        proved=certified is not None,
        note=note if certified is not None else note + "; no certificate: compared with the limit that no V can exceed",
    )


@dataclass(frozen=True)
class LevelSets:
    """Level sets of a proved V for gains scaled by λ, in metres and seconds.

    Attributes
    ----------
    certificate : Certificate
        For the base gains (λ = 1), with bounds of all states.
    scale : Fraction
        λ; the scaled loop has the errors λe of the base loop at the same time.
    """

    certificate: Certificate
    scale: Fraction

    def level(self, matched: Fraction) -> Fraction:
        """Upper bound of V where e1 = e2 = 0 and |e3| ≤ matched [unit of ν]."""
        loop = self.certificate.loop
        states = [loop.symbols[s] for s in loop.states]
        box = {s: (Fraction(0), Fraction(0)) for s in states}
        box[states[-1]] = (-matched / self.scale, matched / self.scale)
        return _top(enclose(from_terms(self.certificate.lyapunov, loop.symbols), box))

    def errors(self, level: Fraction) -> Errors:
        """Bounds on e1, e2 and e2' on {V ≤ level}, from V ≥ γ_i u_i^m."""
        loop = self.certificate.loop
        degree = sum(f[1] * loop.states[f[0]] for f in self.certificate.lyapunov[0].factors)
        x, g = sp.symbols("x g", positive=True)
        sizes: dict[str, Fraction] = {}
        for state, weight in loop.states.items():
            gamma = self.certificate.claims[f"bound_{state}"]
            power = sp.Rational(weight) / sp.Rational(int(degree))
            sizes[state] = _top(enclose((x / g) ** power, {x: (level, level), g: (gamma, gamma)})) if level else level
        box = {loop.symbols[s]: (-v, v) for s, v in sizes.items()} | {
            loop.symbols[n]: ends for n, ends in loop.uncertain.items()
        }
        box |= {loop.symbols[n]: (v, v) for n, v in loop.parameters.items()}
        first, second, _ = loop.states
        acceleration = _top(abs(enclose(sympy_field(loop)[loop.symbols[second]], box)))
        return Errors(
            slip=self.scale * sizes[first], rate=self.scale * sizes[second], acceleration=self.scale * acceleration
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Domain:
    """Largest level set found on which |h'| ≤ L̄ holds with the control's own contribution (ERRATA 16).

    Attributes
    ----------
    level : float
        Of V for the base gains; 0 when there is none.
    slip_error, slip_rate_error : float
        Bounds on |e1| [m] and |e2| [m/s] on it.
    """

    level: float
    slip_error: float
    slip_rate_error: float

    def to_dict(self) -> dict[str, float]:
        """Plain values, SI."""
        return {"level": self.level, "slip_error": self.slip_error, "slip_rate_error": self.slip_rate_error}


def certified_domain(fault: Fault, controller: SlidingMode, certificate: Certificate, doublings: int = 400) -> Domain:
    """Largest level 2^−n on which the premise on |h'| proves itself, rigorous but not sharp."""
    sets = LevelSets(certificate, controller.scale)
    allowed = certified_lipschitz(certificate) * controller.scale

    def holds(exponent: int) -> bool:
        errors = sets.errors(Fraction(2) ** exponent)
        return largest_matched_rate(fault, controller.divisor, errors, pieces=40) <= allowed

    low, high = -doublings, 40
    if not holds(low):
        return Domain(level=0.0, slip_error=0.0, slip_rate_error=0.0)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    errors = sets.errors(Fraction(2) ** low)
    return Domain(level=2.0**low, slip_error=float(errors.slip), slip_rate_error=float(errors.rate))


def certified_lipschitz(certificate: Certificate) -> Fraction:
    """L̄ of the base gains: the smaller end of the range of d = h'."""
    low, high = certificate.loop.uncertain["d"]
    return min(-low, high)


def sliding_mode_premises(
    fault: Fault, controller: SlidingMode, certificate: Certificate | None
) -> tuple[list[Premise], Domain | None]:
    """Premises that can be decided without a run, and the certified domain.

    `along_reference` takes the errors as zero. `level_set` takes the level set of V that holds the start
    x = 0, ξ = 0 for every disturbance of the class, and the control's own part of h' on it.

    Raises
    ------
    CertificateError
        When the certificate is about other gains.
    """
    zero = Errors(slip=Fraction(0), rate=Fraction(0), acceleration=Fraction(0))
    note = "rigorous over the uncertainty box and the disturbance class, errors zero"
    if certificate is None or certificate.refutation is not None:
        return [matched_rate_premise(fault, controller, "along_reference", zero, None, note)], None
    require(
        certificate.loop.law == controller.name and dict(certificate.loop.gains) == dict(controller.gains),
        "the certificate is about other gains than the controller's.",
    )
    lipschitz = certified_lipschitz(certificate)
    premises = [
        control_coefficient(fault, controller.divisor, certificate.loop.uncertain["beta"]),
        matched_rate_premise(fault, controller, "along_reference", zero, lipschitz, note),
    ]
    if not all(f"bound_{state}" in certificate.claims for state in certificate.loop.states):
        return premises, None
    sets = LevelSets(certificate, controller.scale)
    errors = sets.errors(sets.level(_initial_perturbation(fault, controller.divisor)))
    start = f"rigorous on the level set of V that holds the start: |e1| <= {float(errors.slip):.2g} m, "
    start += f"|e2| <= {float(errors.rate):.2g} m/s"
    premises.append(matched_rate_premise(fault, controller, "level_set", errors, lipschitz, start))
    return premises, certified_domain(fault, controller, certificate)


def _initial_perturbation(fault: Fault, divisor: Fraction) -> Fraction:
    """Bound on |h| at t = 0, x = 0: the disturbance over β, friction at its static value."""
    static, least = friction_range(fault)[1], plant_ranges(fault)[plant.N_hat][0]
    return rational(fault.disturbance.largest_explicit) * divisor / (static * least)


def _fraction(value: sp.Rational) -> Fraction:
    exact = sp.nsimplify(value, rational=True)
    return Fraction(int(exact.p), int(exact.q))


def _top(enclosure: Any) -> Fraction:
    end = enclosure.upper().fmpq()
    return Fraction(int(end.p), int(end.q))


def _up(value: Fraction) -> float:
    """Float not below a rational."""
    number = float(value)
    return number if Fraction(number) >= value else math.nextafter(number, math.inf)
