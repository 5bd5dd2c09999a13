"""Whether a certificate is about a fault: its constants and ranges cover those of the fault."""

from fractions import Fraction

from quakedesign.bounds import UpperBound
from quakedesign.certificates.certificate import Certificate
from quakedesign.certificates.meaning import require_degree_of_slip
from quakedesign.certificates.premises import (
    Errors,
    certified_lipschitz,
    coefficient_range,
    largest_matched_rate,
    least_authority,
)
from quakedesign.certificates.sectors import sectors
from quakedesign.errors import CertificateError
from quakedesign.fault import Fault


def covers(certificate: Certificate, fault: Fault) -> list[str]:
    """Refuse a certificate whose constants or ranges do not cover a fault (designed gains, divisor μ_res·N̂_min).

    A sliding mode's certificate is about the base gains; the scale λ that the fault needs is said.

    Returns
    -------
    list of str
        What is covered, in lines.

    Raises
    ------
    CertificateError
    """
    require_degree_of_slip(certificate.loop)
    loop, said = certificate.loop, [f'covers {certificate.loop.law} on "{fault.name}", box {fault.box.name}']
    if loop.domain == "reals":
        needed = sectors(fault)
        if loop.constants != {"b": needed.authority}:
            raise CertificateError(f"the control authority is not that of {fault.name}")
        ranges = needed.ranges()
    else:
        divisor = least_authority(fault)
        ranges = {"beta": coefficient_range(fault, divisor)}
        zero = Errors(slip=Fraction(0), rate=Fraction(0), acceleration=Fraction(0))
        if certified_lipschitz(certificate) <= 0:
            raise CertificateError("the certified range of d = h' must hold 0 inside to cover a fault")
        rate = largest_matched_rate(fault, divisor, zero)
        least = UpperBound(rate / certified_lipschitz(certificate))
        said.append(f"|h'| <= {UpperBound(rate):.4g} m/s^3 along the reference needs a scale of at least {least:.4g}")
    for name, (low, high) in ranges.items():
        if not loop.uncertain[name][0] <= low <= high <= loop.uncertain[name][1]:
            raise CertificateError(f"the certified range of {name} does not cover {fault.name}")
    return said
