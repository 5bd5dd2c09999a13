"""From a fault to gains with a proof, and from given gains to a verdict."""

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

from quakedesign.certificates import Certificate, Loop, Verdict, loop_of
from quakedesign.certificates.guarantee import Around, task_of
from quakedesign.certificates.linear_premises import linear_premises, sectors
from quakedesign.certificates.premises import (
    Errors,
    coefficient_range,
    largest_matched_rate,
    least_authority,
    sliding_mode_premises,
)
from quakedesign.controllers import Controller, SlidingMode, control_law, family
from quakedesign.controllers.feed_forward import NONE, FeedForward, feed_forward
from quakedesign.errors import CertificateError, KinkError, ParameterError, UnknownNameError
from quakedesign.fault import Fault, require_fault
from quakedesign.rationals import rational
from quakedesign.synthesis.designed import Design
from quakedesign.synthesis.guaranteed import MEASURED, OBJECTIVES, sampled_design
from quakedesign.synthesis.linear.analysis.common_quadratic import finished_exactly, robust_stability
from quakedesign.synthesis.linear.analysis.robust_stability import unstable_vertex, why_undecided
from quakedesign.synthesis.linear.design.riccati import RiccatiDesign, riccati_design
from quakedesign.synthesis.linear.plant.polytope import error_loop
from quakedesign.synthesis.linear.plant.rational_matrices import Matrix
from quakedesign.synthesis.lyapunov.certify_exactly import claims_of, finish
from quakedesign.synthesis.lyapunov.quadratic import quadratic_margin
from quakedesign.synthesis.lyapunov.search import find_certificate

DESIGNABLE = ("cta", "dia", "elqr")
_HEADROOM = Fraction(11, 10)
_SHARES = (Fraction(99, 100), Fraction(9, 10), Fraction(1, 2))


def design(
    fault: Fault,
    controller: str = "cta",
    *,
    feedforward: str = "none",
    objective: str = "tracking",
    continuous: bool = False,
    measured: str = MEASURED[0],
    slip_noise: str | float | Fraction = 0,
    rate_noise: str | float | Fraction = 0,
) -> Design:
    """Find gains with a proof for a fault.

    2-CTA, 2-DIA: base gains (families.toml) are proved for the fault's range of β and scaled by λ = ρ⁶ (ρ rational,
    so that every scaled gain is rational) until L̄ exceeds by a tenth what the reference and the disturbance need.
    e-LQR: feedback with an estimate of the disturbance for the loop as it runs, measured and held over the fault's T_s,
    or over the longest T_s with a guarantee where the fault's own has none; see `Design.guarantee`. With `continuous`
    that of the paper: Riccati equation with the sound bound on the uncertainty, then an exact proof about any constant
    reference in continuous time.

    Parameters
    ----------
    fault : Fault
    controller : str
        ``"cta"``, ``"dia"`` or ``"elqr"``.
    feedforward : str
        What a sliding mode adds to ν from what is known of the plant: ``"none"``, ``"nominal"`` or ``"centred"``, see
        `quakedesign.controllers.feed_forward`. It enlarges the certified domain; the e-LQR takes none.
    objective : str
        Of the e-LQR: ``"tracking"`` for small errors under slow disturbances, ``"peak"`` for the smallest guaranteed
        slip-rate error.
    continuous : bool
        For the e-LQR: the paper's design in continuous time.
    measured : str
        What the e-LQR of samples is told: ``"slip-and-rate"``, or ``"slip"``, from which it estimates the slip rate.
    slip_noise, rate_noise : str, float or Fraction
        Bounds of what it is told wrongly of slip [m] and slip rate [m/s], for its guarantee.

    Returns
    -------
    Design
        With verdict ``UNDECIDED`` and ``reason`` in its details when no proof was found.

    Raises
    ------
    UnknownNameError
        For a controller that cannot be designed, or an unknown feed-forward.
    ParameterError
        For a feed-forward with a law that takes none, options of the e-LQR with another law, or an unknown objective.
    """
    require_fault(fault)
    if controller not in DESIGNABLE:
        raise UnknownNameError(f"controller to design must be one of {', '.join(DESIGNABLE)}. Received {controller!r}.")
    fault.require_memoryless("design")
    added = feed_forward(feedforward, fault, least_authority(fault))
    noise = Around(slip_noise=rational(slip_noise, "slip_noise"), rate_noise=rational(rate_noise, "rate_noise"))
    told = measured != MEASURED[0] or any(noise.values())
    if issubclass(control_law(controller), SlidingMode):
        if continuous or told or objective != OBJECTIVES[0]:
            raise ParameterError(
                "continuous, objective, measured and noise are for the e-LQR. Received some of them with "
                f"{controller}. Leave them out."
            )
        return _design_sliding_mode(fault, controller, added)
    if added != NONE:
        raise ParameterError(
            f"a feed-forward is part of sliding-mode laws. Received {feedforward!r} with {controller}. Leave it out."
        )
    if continuous and told:
        raise ParameterError(
            "a design in continuous time knows slip and slip rate exactly. Received noise, or the slip alone. "
            "Leave continuous out."
        )
    return _design_linear(fault) if continuous else _design_sampled(fault, objective, measured, noise)


def _design_sliding_mode(fault: Fault, name: str, added: FeedForward) -> Design:
    divisor = least_authority(fault)
    for base in family(name):
        assert isinstance(base.law, SlidingMode)
        loop = sliding_mode_loop(base.law, base.lipschitz, coefficient_range(fault, divisor))
        certificate = find_certificate(loop, control_law(name).loop_field().degree)
        if certificate is not None:
            break
    else:
        return Design(
            fault=fault,
            name=name,
            verdict=Verdict.UNDECIDED,
            controller=None,
            certificate=None,
            premises=(),
            details={"reason": "no base gains of the family were proved for the fault's range of β"},
        )
    needed = required_lipschitz(fault, base.law, divisor, added)
    rho = smallest_root(needed * _HEADROOM / base.lipschitz)
    controller = replace(base.law, scale=rho**6, divisor=divisor, feedforward=added)
    details = {"rho": str(rho), "base_lipschitz": str(base.lipschitz), "base_source": base.source}
    return _judged(fault, controller, certificate, details)


def required_lipschitz(fault: Fault, law: Controller, divisor: Fraction, added: FeedForward = NONE) -> Fraction:
    """Bound on |h'| [m/s³] that the reference, the disturbance and the uncertainty need while the errors are zero."""
    return largest_matched_rate(fault, divisor, Errors(), feedforward=added)


def smallest_root(scale: Fraction) -> Fraction:
    """Smallest ρ with three significant digits and ρ⁶ ≥ scale."""
    import math

    estimate = float(scale) ** (1 / 6)
    unit = Fraction(10) ** (math.floor(math.log10(estimate)) - 2)
    steps = math.floor(Fraction(estimate) / unit)
    while (steps * unit) ** 6 < scale:
        steps += 1
    return steps * unit


def sliding_mode_loop(controller: Controller, lipschitz: Fraction, beta: tuple[Fraction, Fraction]) -> Loop:
    """Loop of base gains for |h'| ≤ lipschitz and a range of β.

    Raises
    ------
    CertificateError
        When the law has parts that certificates cannot express.
    """
    uncertain = {"beta": beta, "d": (-lipschitz, lipschitz)}
    return loop_of(controller.name, controller.loop_field(), gains=controller.gains, uncertain=uncertain)


def linear_loop(fault: Fault, controller: Controller) -> Loop:
    """Loop of the linear feedback about any constant reference, over the fault's sectors."""
    needed = sectors(fault)
    return loop_of(
        controller.name,
        controller.loop_field(),
        gains=controller.gains,
        constants={"b": needed.authority},
        uncertain=needed.ranges(),
    )


def _design_linear(fault: Fault) -> Design:
    try:
        found = riccati_design(fault)
    except ParameterError as error:
        return _without_gains(fault, str(error))
    loop = linear_loop(fault, found.controller)
    certificate = _of_riccati(loop, found) or quadratic_certificate(loop, theta=found.theta)
    details = {
        "R": found.R,
        "poles": [[float(z.real), float(z.imag)] for z in found.E],
        "fastest_pole": found.fastest_pole,
    }
    return _judged_linear(fault, found.controller, certificate, details)


def _of_riccati(loop: Loop, found: RiccatiDesign) -> Certificate | None:
    """Certificate with the V of the Riccati equation."""
    margin = quadratic_margin(loop, found.lyapunov)
    claims = claims_of(loop, found.lyapunov, (margin, Fraction(0)))
    return finish(loop, found.lyapunov, claims) if min(claims.values()) > 0 else None


def quadratic_certificate(loop: Loop, *, theta: Matrix | None = None) -> Certificate | None:
    """Quadratic V for a linear loop: searched in two scalings, then a known one, whose rate is decided exactly.

    Parameters
    ----------
    loop : Loop
    theta : matrix (4 × 4) of Fraction, optional
        V = xᵀΘx in SI that may be a proof.
    """
    found = find_certificate(loop, 2) or robust_stability(loop)
    return found or (finished_exactly(loop, theta) if theta is not None else None)


def _design_sampled(fault: Fault, objective: str, measured: str, noise: Around) -> Design:
    found = sampled_design(task_of(fault), rational(fault.sampling_time), objective, measured=measured, **noise)
    if found.runs is None:
        return _without_gains(fault, found.reason)
    held = found.runs.held
    return Design(
        fault=fault,
        name="elqr",
        verdict=found.runs.check(),
        controller=held.controller,
        certificate=None,
        premises=found.premises(),
        details={
            "objective": objective,
            "step": str(held.step),
            "reason": found.reason or None,
            "measured": measured,
            **{name: str(value) for name, value in held.noise.items()},
        },
        slip_noise=held.slip_noise,
        rate_noise=held.rate_noise,
    )


def _without_gains(fault: Fault, reason: str) -> Design:
    """Undecided design of an e-LQR for which no gains were found."""
    return Design(
        fault=fault,
        name="elqr",
        verdict=Verdict.UNDECIDED,
        controller=None,
        certificate=None,
        premises=(),
        details={"reason": reason},
    )


def _judged_linear(
    fault: Fault, controller: Controller, certificate: Certificate | None, details: Mapping[str, Any]
) -> Design:
    """Design of an e-LQR; refuted where a constant vertex of the box is not stable, undecided where no V was found."""
    more: dict[str, Any] = {"rate": str(certificate.claims["rate"]) if certificate else None}
    if certificate is not None:
        return _judged(fault, controller, certificate, {**details, **more})
    loop = error_loop(tuple(controller.gains.values()), sectors(fault))
    verdict = Verdict.UNDECIDED if unstable_vertex(loop) is None else Verdict.REFUTED
    found = _judged(fault, controller, None, {**details, **more, "reason": why_undecided(loop)})
    return replace(found, verdict=verdict)


def assess(fault: Fault, controller: Controller) -> Design:
    """Judge given gains on a fault: verdict, certificate and premises.

    Sliding modes are tried at 99, 90 and 50 % of the bound on |h'| that no V can exceed; the e-LQR over the fault's
    sectors. A law that certificates cannot express yet is ``UNDECIDED``.
    """
    fault.require_memoryless("a verdict on gains")
    if not isinstance(controller, SlidingMode):
        return _judged_linear(fault, controller, quadratic_certificate(linear_loop(fault, controller)), {})
    limit = controller.lipschitz_limit / controller.scale
    beta = coefficient_range(fault, controller.divisor)
    for share in _SHARES if limit > 0 else ():
        try:
            certificate = find_certificate(
                sliding_mode_loop(controller, limit * share, beta),
                controller.loop_field().degree,
                subject=type(controller),
            )
        except (CertificateError, KinkError):
            break
        if certificate is not None:
            return _judged(fault, controller, certificate, {"base_lipschitz": str(limit * share)})
    return _judged(fault, controller, None, {})


def _judged(
    fault: Fault, controller: Controller, certificate: Certificate | None, details: Mapping[str, Any]
) -> Design:
    domain = None
    if isinstance(controller, SlidingMode):
        premises, domain = sliding_mode_premises(fault, controller, certificate)
    else:
        premises = linear_premises(fault, controller, certificate)
    return Design(
        fault=fault,
        name=controller.name,
        verdict=certificate.check(type(controller)) if certificate is not None else Verdict.UNDECIDED,
        controller=controller,
        certificate=certificate,
        premises=tuple(premises),
        domain=domain,
        details=dict(details),
    )
