"""Claims about closed loops, their files, and the exact decision."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.certificates.certificate import Certificate, load_certificate, parse_certificate
    from quakedesign.certificates.claim import Equilibrium, Evidence, Loop, Verdict, Witness, loop_of
    from quakedesign.certificates.covering import covers
    from quakedesign.certificates.files import certificate_text, save_certificate

__all__ = [
    "Certificate",
    "Equilibrium",
    "Evidence",
    "Loop",
    "Verdict",
    "Witness",
    "certificate_text",
    "covers",
    "load_certificate",
    "loop_of",
    "parse_certificate",
    "save_certificate",
]

face(__name__)
