"""From a fault to gains with a proof, and from given gains to a verdict."""

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

from quakedesign.certificates import Certificate, Loop, Verdict, loop_of
from quakedesign.certificates.guarantee import Guarantee, NoGuarantee, task_of
from quakedesign.certificates.guarantee.statement import Around
from quakedesign.certificates.linear_premises import linear_premises, sectors
from quakedesign.certificates.premises import (
    Errors,
    coefficient_range,
    largest_matched_rate,
    least_authority,
    sliding_mode_premises,
)
from quakedesign.controllers import BaseGains, Controller, SlidingMode, control_law, family
from quakedesign.controllers.feed_forward import NONE, FeedForward, feed_forward
from quakedesign.errors import CertificateError, KinkError, ParameterError, UnknownNameError
from quakedesign.fault import Fault, require_fault
from quakedesign.rationals import rational
from quakedesign.synthesis.designed import Design
from quakedesign.synthesis.guaranteed import MEASURED, OBJECTIVES, guarantee_of, sampled_design, sampled_sliding_mode
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

    All of them run as they are guaranteed, measured and held over the fault's T_s, or over the longest T_s with a
    guarantee where the fault's own has none; see `Design.guarantee`.

    2-CTA, 2-DIA: base gains (families.toml) are proved in continuous time for the fault's range of β; λ = ρ⁶ (ρ
    rational, so that every scaled gain is rational), weight and authority of the scheme ``compensated`` are chosen by
    what is guaranteed. e-LQR: feedback with an estimate of the disturbance.

    With `continuous` those of the paper, without a guarantee of the loop that runs. 2-CTA, 2-DIA: λ grows until L̄
    exceeds by a tenth what the reference and the disturbance need; so does it where no T_s has a guarantee. e-LQR:
    Riccati equation with the sound bound on the uncertainty, then an exact proof about any constant reference.

    Parameters
    ----------
    fault : Fault
    controller : str
        ``"cta"``, ``"dia"`` or ``"elqr"``.
    feedforward : str
        What a sliding mode adds to ν from what is known of the plant: ``"none"``, ``"nominal"`` or ``"centred"``, see
        `quakedesign.controllers.feed_forward`. It enlarges the certified domain in continuous time and has no guarantee
        as it runs, so it needs `continuous`; the e-LQR takes none.
    objective : str
        ``"tracking"`` for small errors under slow disturbances, ``"peak"`` for the smallest guaranteed slip-rate error.
    continuous : bool
        The paper's design in continuous time.
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
        For a feed-forward with a law that takes none or runs sampled, an unknown objective, or one of a design in
        continuous time.
    """
    require_fault(fault)
    if controller not in DESIGNABLE:
        raise UnknownNameError(f"controller to design must be one of {', '.join(DESIGNABLE)}. Received {controller!r}.")
    fault.require_memoryless("design")
    added = feed_forward(feedforward, fault, least_authority(fault))
    noise = Around(slip_noise=rational(slip_noise, "slip_noise"), rate_noise=rational(rate_noise, "rate_noise"))
    told = measured != MEASURED[0] or any(noise.values())
    if objective not in OBJECTIVES or (continuous and objective != OBJECTIVES[0]):
        raise ParameterError(
            f"objective must be one of {', '.join(OBJECTIVES)}, of designs that are not continuous. Received "
            f"{objective!r}{' with continuous' if continuous else ''}. Change it."
        )
    if issubclass(control_law(controller), SlidingMode):
        if told:
            raise ParameterError(
                f"measured and noise are for the e-LQR. Received some of them with {controller}. Leave them out."
            )
        if added != NONE and not continuous:
            raise ParameterError(
                "a feed-forward has no guarantee with the pressure held over T_s. "
                f"Received {feedforward!r}. Design with continuous, or leave it out."
            )
        base, certificate = _proved_base(fault, controller)
        if continuous:
            return _design_scaled(fault, base, certificate, added)
        return _design_compensated(fault, base, certificate, objective)
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


def _proved_base(fault: Fault, name: str) -> tuple[BaseGains, Certificate | None]:
    """First base gains of a family that are proved for the fault's range of β, else the first of all."""
    beta = coefficient_range(fault, least_authority(fault))
    for base in family(name):
        certificate = find_certificate(
            sliding_mode_loop(base.law, base.lipschitz, beta), control_law(name).loop_field().degree
        )
        if certificate is not None:
            return base, certificate
    return family(name)[0], None


def _design_compensated(fault: Fault, base: BaseGains, certificate: Certificate | None, objective: str) -> Design:
    """Sliding mode as it runs with a guarantee; that in continuous time where no T_s has one."""
    law = replace(_sliding(base), gains=dict(base.law.gains), divisor=least_authority(fault))
    made, found = sampled_sliding_mode(task_of(fault), law, rational(fault.sampling_time), objective)
    if found.runs is None:
        paper = _design_scaled(fault, base, certificate, NONE)
        none = NoGuarantee(reason=f"run in the scheme compensated, {found.reason}", small_gain=None)
        return replace(paper, runs=none, details={"reason": none.reason, **paper.details})
    details = {
        "objective": objective,
        "step": str(found.runs.held.step),
        "reason": found.reason or None,
        "rho": str(smallest_root(made.controller.scale)),
    }
    judged = _judged(fault, made.controller, certificate, {**details, **_origin(base)}, runs=found.runs)
    return replace(judged, premises=(*found.premises(), *judged.premises))


def _design_scaled(fault: Fault, base: BaseGains, certificate: Certificate | None, added: FeedForward) -> Design:
    """Sliding mode in continuous time with the smallest scale for the fault's |h'|."""
    law, divisor = _sliding(base), least_authority(fault)
    if certificate is None:
        return _without_gains(fault, law.name, "no base gains of the family were proved for the fault's range of β")
    rho = smallest_root(required_lipschitz(fault, law, divisor, added) * _HEADROOM / base.lipschitz)
    scaled = replace(law, gains=dict(law.gains), scale=rho**6, divisor=divisor, feedforward=added)
    return _judged(fault, scaled, certificate, {"rho": str(rho), **_origin(base)})


def _sliding(base: BaseGains) -> SlidingMode:
    assert isinstance(base.law, SlidingMode)
    return base.law


def _origin(base: BaseGains) -> dict[str, str]:
    return {"base_lipschitz": str(base.lipschitz), "base_source": base.source}


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
        return _without_gains(fault, "elqr", str(error))
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
        return _without_gains(fault, "elqr", found.reason)
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
        runs=found.runs,
    )


def _without_gains(fault: Fault, name: str, reason: str) -> Design:
    """Undecided design for which no gains were found."""
    return Design(
        fault=fault,
        name=name,
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
    sectors. A law that certificates cannot express yet is ``UNDECIDED``. The verdict on a sliding mode of samples is
    that on its guarantee.
    """
    fault.require_memoryless("a verdict on gains")
    if not isinstance(controller, SlidingMode):
        return _judged_linear(fault, controller, quadratic_certificate(linear_loop(fault, controller)), {})
    runs = guarantee_of(task_of(fault), controller) if controller.sampling else None
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
            return _judged(fault, controller, certificate, {"base_lipschitz": str(limit * share)}, runs)
    return _judged(fault, controller, None, {}, runs)


def _judged(
    fault: Fault,
    controller: Controller,
    certificate: Certificate | None,
    details: Mapping[str, Any],
    runs: Guarantee | NoGuarantee | None = None,
) -> Design:
    """Design with its premises; the verdict is that on the certificate, or of a law of samples on what runs."""
    domain = None
    if isinstance(controller, SlidingMode):
        premises, domain = sliding_mode_premises(fault, controller, certificate)
    else:
        premises = linear_premises(fault, controller, certificate)
    proved = certificate.check(type(controller)) if certificate is not None else Verdict.UNDECIDED
    return Design(
        fault=fault,
        name=controller.name,
        verdict=proved if runs is None else runs.check(),
        controller=controller,
        certificate=certificate,
        premises=tuple(premises),
        domain=domain,
        details=dict(details),
        runs=runs,
    )
