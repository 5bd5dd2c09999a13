"""What the linear feedback's certificate needs of a fault: sectors about any constant reference (ERRATA 6 to 12)."""

from fractions import Fraction

from quakedesign.bounds import UpperBound
from quakedesign.certificates.certificate import Certificate
from quakedesign.certificates.claim import require
from quakedesign.certificates.premise import Premise
from quakedesign.certificates.sectors import rest_pressure, sectors
from quakedesign.controllers import Controller
from quakedesign.fault import Fault
from quakedesign.rationals import float_above, rational


def linear_premises(fault: Fault, controller: Controller, certificate: Certificate | None) -> list[Premise]:
    """Premises of the linear feedback: sectors inside the certified ones; constant reference; vanishing disturbance.

    The certificate speaks about constant references and disturbances that vanish at the equilibrium. The last two
    premises say by how much a task leaves that (ERRATA 8, 11): errors then stay bounded, as certified peaks say.

    Raises
    ------
    CertificateError
        When the certificate is about other gains.
    """
    needed = sectors(fault)
    proved = certificate is not None
    ranges = certificate.loop.uncertain if certificate is not None else needed.ranges()
    if certificate is not None:
        require(
            certificate.loop.law == controller.name
            and dict(certificate.loop.gains) == dict(controller.gains)
            and certificate.loop.constants.get("b") == needed.authority,
            "the certificate is about other gains, or another fault.",
        )
    inside = ranges["s"][0] <= needed.slip[0] and ranges["w"][0] <= needed.rate[0] <= needed.rate[1] <= ranges["w"][1]
    peak_rate = Fraction(15, 8) * rational(fault.reference.target_slip) / rational(fault.reference.operation_time)
    return [
        Premise(
            name="control_coefficient",
            required=needed.beta[1],
            certified=ranges["beta"][1],
            unit="-",
            proved=proved and ranges["beta"][0] <= needed.beta[0],
        ),
        Premise(
            name="friction_slope",
            required=needed.slip[1],
            certified=ranges["s"][1],
            unit="1/s^2",
            proved=proved and inside,
            note=f"net chord in slip; effective stress up to {UpperBound(needed.largest_effective_stress):.4g} Pa",
        ),
        Premise(
            name="constant_reference",
            required=peak_rate,
            certified=0.0,
            unit="m/s",
            note="certified about constant references; for a moving one see the certified peaks",
        ),
        Premise(
            name="vanishing_disturbance",
            required=float_above(fault.disturbance_bounds[0]),
            certified=0.0,
            unit="m/s^2",
            note="for one that does not vanish see the certified peaks",
        ),
        *_limits_premise(fault, controller),
    ]


def _limits_premise(fault: Fault, controller: Controller) -> list[Premise]:
    """Whether the pressure at rest stays inside the limits of the law, for every constant reference and plant."""
    limits = getattr(controller, "limits", None)
    if limits is None:
        return []
    low, high = rest_pressure(fault, (Fraction(0), rational(fault.reference.target_slip)))
    worst = max((low, limits.lowest), (high, limits.highest), key=lambda pair: pair[0] / pair[1])
    return [
        Premise(
            name="pressure_at_rest",
            required=abs(worst[0]),
            certified=abs(worst[1]),
            unit="Pa",
            note="inside the limits of the law; the proof is about deviations that do not reach them",
        )
    ]
