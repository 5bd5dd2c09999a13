"""Evidence that decides itself, and goes into a file and back."""

import pickle
from dataclasses import dataclass, field, fields
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

from quakedesign.certificates.checking import check
from quakedesign.certificates.claim import Evidence, Verdict
from quakedesign.certificates.files import evidence_of, read_json, save_certificate
from quakedesign.sos.exact.strict import parse

if TYPE_CHECKING:
    from quakedesign.controllers import Law, LoopField


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Certificate(Evidence):
    """A statement about one closed loop with its proof or its counterexample.

    Attributes
    ----------
    loop : Loop
    lyapunov : tuple of Term
        V; empty for a refutation.
    claims : mapping of str to Fraction
        ``positive`` and ``decrease`` or ``rate`` [1/s on `reals`].
    witnesses : mapping of str to Witness
        One for every different obligation, by name.
    refutation : Equilibrium, optional
    """

    @classmethod
    def of(cls, evidence: Evidence) -> "Certificate":
        """Certificate with the parts of evidence."""
        return cls(**{part.name: getattr(evidence, part.name) for part in fields(Evidence)})

    def check(self, law: "str | type[Law] | LoopField | None" = None) -> Verdict:
        """Re-decide the statement from nothing but its claim, in exact arithmetic; field against law as well.

        Parameters
        ----------
        law : str, type of Law or LoopField, optional
            What the field must be that of; without it the law of the package that the certificate names.

        Raises
        ------
        CertificateError
            When the proof does not hold, or the field is not that of the law.
        WorkError
            When that takes more work than a check may (proofs/FORMAT.md): it is undecided.
        """
        return check(self, law)

    def save(self, path: str | Path) -> None:
        """Write the file of FORMAT.md, whole or not at all."""
        save_certificate(self, path)


@dataclass(frozen=True, slots=True)
class _Asked:
    """A certificate and a law, the same as another by all that they hold."""

    digest: bytes
    law: "str | type[Law] | None"
    certificate: Certificate = field(compare=False)


def decided_once(certificate: Certificate, law: "str | type[Law] | LoopField | None" = None) -> Verdict:
    """Verdict of `Certificate.check`, found once in a process for the same contents and law.

    Searches that hand a certificate on ask for it; of a bare loop it is found each time.

    Raises
    ------
    CertificateError, WorkError
        As `Certificate.check`, each time.
    """
    if not isinstance(law, str | type | None):
        return certificate.check(law)
    return _verdict(_Asked(sha256(pickle.dumps(certificate)).digest(), law, certificate))


@lru_cache(maxsize=64)
def _verdict(asked: _Asked) -> Verdict:
    return asked.certificate.check(asked.law)


def load_certificate(path: str | Path) -> Certificate:
    """Read a certificate file; reading verifies nothing.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Certificate

    Raises
    ------
    CertificateError
        When the file cannot be read or breaks a rule of FORMAT.md.
    """
    return Certificate.of(evidence_of(read_json(path)))


def parse_certificate(text: str) -> Certificate:
    """Certificate from the text of a file. Raises CertificateError as `load_certificate`."""
    return Certificate.of(evidence_of(parse(text)))
