"""Claims about closed loops, their files, and the exact decision."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.certificates.certificate import Certificate as Certificate
    from quakedesign.certificates.certificate import decided_once as decided_once
    from quakedesign.certificates.certificate import load_certificate as load_certificate
    from quakedesign.certificates.certificate import parse_certificate as parse_certificate
    from quakedesign.certificates.claim import Equilibrium as Equilibrium
    from quakedesign.certificates.claim import Evidence as Evidence
    from quakedesign.certificates.claim import Loop as Loop
    from quakedesign.certificates.claim import Verdict as Verdict
    from quakedesign.certificates.claim import Witness as Witness
    from quakedesign.certificates.claim import loop_of as loop_of
    from quakedesign.certificates.covering import covers as covers
    from quakedesign.certificates.files import certificate_text as certificate_text
    from quakedesign.certificates.files import save_certificate as save_certificate
    from quakedesign.certificates.guarantee.files import load_guarantee as load_guarantee
    from quakedesign.certificates.guarantee.files import save_guarantee as save_guarantee

face(__name__)
