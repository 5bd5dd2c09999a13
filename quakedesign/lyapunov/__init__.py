"""Claims about closed loops, their files, and the exact decision."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.lyapunov.exact.certificate import Certificate as Certificate
    from quakedesign.lyapunov.exact.certificate import decided_once as decided_once
    from quakedesign.lyapunov.exact.certificate import load_certificate as load_certificate
    from quakedesign.lyapunov.exact.certificate import parse_certificate as parse_certificate
    from quakedesign.lyapunov.exact.certificate_files import certificate_text as certificate_text
    from quakedesign.lyapunov.exact.certificate_files import save_certificate as save_certificate
    from quakedesign.lyapunov.exact.claim import Equilibrium as Equilibrium
    from quakedesign.lyapunov.exact.claim import Evidence as Evidence
    from quakedesign.lyapunov.exact.claim import Loop as Loop
    from quakedesign.lyapunov.exact.claim import Verdict as Verdict
    from quakedesign.lyapunov.exact.claim import Witness as Witness
    from quakedesign.lyapunov.exact.claim import loop_of as loop_of
    from quakedesign.lyapunov.exact.premises import covers as covers
    from quakedesign.lyapunov.gains.synthesise import synthesise as synthesise
    from quakedesign.lyapunov.maps.gain_map import gain_map as gain_map
    from quakedesign.lyapunov.search.certify import certify as certify
    from quakedesign.lyapunov.search.certify import largest_lipschitz as largest_lipschitz
    from quakedesign.lyapunov.search.settling import settling as settling

face(__name__)
