"""What a moving reference and a disturbance put into the error loop, bounded rigorously."""

from dataclasses import dataclass, replace
from fractions import Fraction

import sympy as sp

from quakedesign.bounds import UpperBound
from quakedesign.certificates.claim import Certificate, Loop, require
from quakedesign.certificates.linear_premises import Sectors, sectors
from quakedesign.certificates.meaning import SLIP_RATE_ERROR, meaning
from quakedesign.controllers import Controller, Signals, control_law
from quakedesign.controllers.elqr import FEEDBACKS
from quakedesign.fault import Fault
from quakedesign.rationals import fraction_of, rational
from quakedesign.symbolic.balls import upper_bound
from quakedesign.symbolic.terms import Term

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
    return fraction_of(parts[0]), fraction_of(parts[1])


def tracking_inputs(fault: Fault, controller: Controller, needed: Sectors) -> dict[str, Fraction]:
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
        "force": rates.second + max(map(abs, needed.rate)) * rates.first,
        "drift": max(map(abs, needed.slip)) * rates.first / (needed.beta[0] * needed.authority),
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


def needed_inputs(
    fault: Fault, controller: Controller, needed: Sectors, rate_limited: bool
) -> dict[str, tuple[Fraction, ...]]:
    """Limits of every input that a task puts into the error loop, each with one cause; no zero ones.

    Returns
    -------
    dict of str to tuple of Fraction
        ``disturbance`` [m/s²], with a limited rate [m/s³] if asked; ``reference_force`` [m/s²], ``reference_drift``
        [Pa/s] and ``reference_drift_rate`` [Pa/s²].
    """
    disturbance = tuple(disturbance_inputs(fault, rate_limited).values())
    found = {"disturbance": disturbance} if disturbance else {}
    reference = tracking_inputs(fault, controller, needed)
    return found | {f"reference_{name}": (bound,) for name, bound in reference.items()}


ENTERS = {
    "disturbance": "e2",
    "reference_force": "e2",
    "reference_drift": "zeta",
    "reference_drift_rate": "chi",
}
"""State whose rate every input adds to."""


def peaks_covered(certificate: Certificate, fault: Fault) -> list[str]:
    """Refuse a bound on outputs whose inputs are smaller than those of a fault's task; what it says of the fault.

    Raises
    ------
    CertificateError
    """
    loop, response = certificate.loop, certificate.response
    require(response is not None, "the certificate bounds no outputs.")
    assert response is not None
    law, needed = control_law(loop.law)(gains=loop.gains), sectors(fault)
    rate_limited = len(loop.inputs.get("disturbance", ())) == 2
    laws = [replace(law, feedback=f) for f in FEEDBACKS] if hasattr(law, "feedback") else [law]  # type: ignore[call-arg]
    wanted = [needed_inputs(fault, one, needed, rate_limited) for one in laws]
    covered = [one for one, inputs in zip(laws, wanted, strict=True) if _acts(loop, inputs)]
    require(bool(covered), f"the inputs are smaller than those of {fault.name}, or act elsewhere.")
    kinds = " or ".join(one.feedback for one in covered if hasattr(one, "feedback"))
    said = [f"covers the task's reference and disturbance{f', feedback of the {kinds}' if kinds else ''}"]
    bounds = [response.total(name) for name, row in response.outputs.items() if meaning(loop, row) == SLIP_RATE_ERROR]
    if bounds:
        peak = reference_rates(fault).first + min(bounds)
        said.append(f"the slip rate never exceeds {UpperBound(peak):.6g} m/s (from rest, p acting at once)")
    return said


def _acts(loop: Loop, wanted: dict[str, tuple[Fraction, ...]]) -> bool:
    """Whether a loop has all wanted inputs, each in the rate of its state and nowhere else, and at least as large."""
    places = {
        name: [(s, t) for s, terms in loop.field.items() for t in terms if name in t.parameters] for name in wanted
    }
    return all(
        places[name] == [(ENTERS[name], Term(Fraction(1), (name,), ()))]
        and len(loop.inputs[name]) == len(limits)
        and all(has >= need for has, need in zip(loop.inputs[name], limits, strict=True))
        for name, limits in wanted.items()
    )
