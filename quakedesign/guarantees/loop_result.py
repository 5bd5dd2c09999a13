"""Interface of all results of `quakedesign.guarantee` about a fault."""

from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from quakedesign.errors import CertificateError
from quakedesign.exact import Bound
from quakedesign.guarantees.exact.guarantee_files import save_guarantee
from quakedesign.lyapunov.exact.claim import Verdict


class Guarantee:
    """Base of results with a guarantee, or the reason why there is none, in `found`; the worst case in `worst`."""

    __slots__ = ()
    proof: Any
    worst: Any
    compensation: Any

    @property
    def proved(self) -> bool:
        """Whether there is a guarantee."""
        return bool(self.proof.proved)

    @property
    def verdict(self) -> Verdict:
        """PROVED, or UNDECIDED without a guarantee."""
        return Verdict.PROVED if self.proved else Verdict.UNDECIDED

    @property
    def reason(self) -> str:
        """Why there is no guarantee; empty if there is one."""
        return "" if self.proved else self.proof.reason

    @property
    def bounds(self) -> dict[str, Bound]:
        """Proved bounds by name, in SI units; empty without a guarantee.

        Every fault has ``slip_error`` [m], ``peak_slip_rate`` [m/s], ``least_pressure`` and ``largest_pressure`` [Pa]
        in the fault; tracking also ``slip_rate_error`` [m/s].
        """
        if not self.proved:
            return {}
        found, claims = self.proof, self.proof.claims
        least, largest = found.pressures if hasattr(found, "pressures") else claims.pressures[0]
        named = {part.name: getattr(claims, part.name) for part in fields(claims)}
        named |= {"slip_error": claims.slip_error, "peak_slip_rate": found.peak_slip_rate}
        named |= {"slip_rate_error": getattr(found, "slip_rate_error", None)}
        named |= {"least_pressure": least, "largest_pressure": largest}
        return {name: bound for name, bound in named.items() if bound is not None}

    @property
    def worst_case(self) -> dict[str, float]:
        """Largest values that the search reaches by name, in SI units: lower bounds of the worst case; else empty."""
        worst = self.worst
        if worst is None:
            return {}
        return {name: size for name, size in asdict(worst).items() if size is not None} | {
            "slip_error": worst.slip_error
        }

    def sentence(self) -> str:
        """What is guaranteed and for what, or why nothing is."""
        return str(self.proof.sentence())

    def check(self) -> Verdict:
        """Decide the guarantee again in exact arithmetic; UNDECIDED without one."""
        return Verdict(self.proof.check())

    @property
    def controller(self) -> Any:
        """The law for `simulate`, `export_controller` and `loop_transfer`.

        Raises
        ------
        CertificateError
            Without a guarantee.
        """
        found, sliding = self._proof(), self.compensation
        return found.controller if sliding is None else sliding.limited

    def save(self, path: str | Path) -> None:
        """Write the certificate for `load_guarantee`, ``quakedesign check`` and ``proofs/check.py``.

        Raises
        ------
        CertificateError
            Without a guarantee.
        OutputError
            When the folder cannot be written.
        """
        save_guarantee(self._proof(), path)

    def _proof(self) -> Any:
        if not self.proved:
            raise CertificateError(
                f"a result must be proved to have a law and a certificate. Received {self.sentence()}."
            )
        return self.proof
