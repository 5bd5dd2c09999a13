"""What a moving reference and a disturbance put into the error loop, bounded rigorously."""

from dataclasses import dataclass
from fractions import Fraction

import sympy as sp

from quakedesign.certificates.linear_premises import Sectors
from quakedesign.controllers import Controller, Signals
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.symbolic.balls import upper_bound

stage = sp.Symbol("s", nonnegative=True)
_PIECES = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceRates:
    """Largest |r′| [m/s], |r″| [m/s²] and |r‴| [m/s³] of a reference, exact or rounded up."""

    first: Fraction
    second: Fraction
    third: Fraction


def reference_rates(fault: Fault) -> ReferenceRates:
    """Bounds on the derivatives of r(t); r‴ jumps at both ends of the task, which no bound here minds."""
    duration = rational(fault.reference.operation_time)
    exact_duration = sp.Rational(duration.numerator, duration.denominator)
    slip = sp.expand(fault.reference.slip(stage * exact_duration))
    box = {stage: (Fraction(0), Fraction(1))}
    first, second, third = (
        upper_bound(sp.factor(slip.diff(stage, n)), box, pieces=_PIECES) / duration**n for n in (1, 2, 3)
    )
    return ReferenceRates(first=first, second=second, third=third)


def fed_forward(controller: Controller) -> tuple[Fraction, Fraction]:
    """Coefficients of r and r′ [Pa/m, Pa·s/m] in −p while all errors and integrals are zero; read off the law."""
    r, rate = sp.symbols("r r_1", real=True)
    zero = sp.Integer(0)
    signals = Signals(
        slip=r,
        slip_rate=rate,
        slip_error=zero,
        slip_rate_error=zero,
        integrals=(zero,) * len(controller.integral_units),
    )
    constant = sp.expand(-controller.pressure(signals))
    parts = [sp.Rational(constant.coeff(symbol)) for symbol in (r, rate)]
    return Fraction(int(parts[0].p), int(parts[0].q)), Fraction(int(parts[1].p), int(parts[1].q))


def tracking_inputs(fault: Fault, controller: Controller, sectors: Sectors) -> dict[str, Fraction]:
    """Bounds of the inputs that the reference alone puts into the error loop; zero ones are left out.

    force = −r″ − w·r′. drift = dp*(r)/dt = −s_r·r′/(β_r·b), with the slopes s_r and β_r at rest at r inside the sectors
    (p* balances s and β there). drift_rate is the second derivative of what the law feeds forward.

    Returns
    -------
    dict of str to Fraction
        ``force`` [m/s²], ``drift`` [Pa/s], ``drift_rate`` [Pa/s²].
    """
    rates = reference_rates(fault)
    of_slip, of_rate = fed_forward(controller)
    bounds = {
        "force": rates.second + max(map(abs, sectors.rate)) * rates.first,
        "drift": max(map(abs, sectors.slip)) * rates.first / (sectors.beta[0] * sectors.authority),
        "drift_rate": abs(of_slip) * rates.second + abs(of_rate) * rates.third,
    }
    return {name: bound for name, bound in bounds.items() if bound > 0}


def disturbance_inputs(fault: Fault, rate_limited: bool) -> dict[str, Fraction]:
    """Bounds of the fault's disturbance class: |φ_e| ≤ a [m/s²] and, if asked, |φ_e′| ≤ ȧ [m/s³]; empty for none.

    A class without rate (a constant disturbance) keeps the amplitude alone.
    """
    force, change = (rational(v) for v in (fault.disturbance.largest_explicit, fault.disturbance.largest_rate))
    if force <= 0:
        return {}
    return {"force": force} | ({"force_rate": change} if rate_limited and change > 0 else {})
