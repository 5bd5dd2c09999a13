"""Searches that every comparison of the presets asks for again, with what they have found: it is decided anew.

The folder `found` has a certificate for each such question, or ``null`` where nothing was found, by a digest of the
question; what else was searched for on this machine is in `quakedesign.cache`. A certificate counts after its exact
check only, so that a wrong file costs time and proves nothing.
"""

from collections.abc import Callable
from dataclasses import fields
from functools import wraps
from hashlib import sha256
from pathlib import Path

from quakedesign.cache import in_use, search_once
from quakedesign.certificates import Certificate, Loop, Verdict, certificate_text, decided_once, parse_certificate
from quakedesign.controllers import Subject
from quakedesign.errors import CertificateError, WorkError
from quakedesign.output import write_whole
from quakedesign.sos.solve.conic import handing_back

FOLDER = Path(__file__).parent / "found"
_NOTHING = "null\n"

Search = Callable[[Loop, int, Subject | None], Certificate | None]


def kept(search: Search) -> Search:
    """Take what a search has found before from the folder; search where it has nothing that holds."""

    @wraps(search)
    def known(loop: Loop, degree: int, subject: Subject | None) -> Certificate | None:
        path, found = place(loop, degree), list[Certificate | None]()

        def searched() -> str:
            found.append(search(loop, degree, subject))
            return _NOTHING if found[0] is None else certificate_text(found[0])

        if path.exists():
            text = path.read_text(encoding="utf-8")
        elif handing_back() or not in_use():
            return search(loop, degree, subject)
        else:
            text = search_once(searched, "lyapunov", loop, degree)
        if found:
            return found[0]
        if text == _NOTHING:
            return None
        try:
            certificate = parse_certificate(text)
            if certificate.loop == loop and decided_once(certificate, subject) is Verdict.PROVED:
                return certificate
        except (CertificateError, WorkError):
            pass
        return search(loop, degree, subject)

    return known


def place(loop: Loop, degree: int) -> Path:
    """File of a question: a loop with all its numbers, and the degree of V."""
    asked = repr([degree, *((field.name, getattr(loop, field.name)) for field in fields(loop))])
    return FOLDER / f"{loop.law}_{sha256(asked.encode()).hexdigest()[:16]}.json"


def keep(loop: Loop, degree: int, certificate: Certificate | None) -> None:
    """Write what a search has found."""
    write_whole(place(loop, degree), _NOTHING if certificate is None else certificate_text(certificate))
