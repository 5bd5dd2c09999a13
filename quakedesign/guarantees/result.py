"""Base class of all results of `quakedesign.guarantee`; result for an uncertain plant."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from quakedesign.errors import CertificateError
from quakedesign.exact import Bound, LowerBound
from quakedesign.files import Json
from quakedesign.guarantees.exact.guarantee_files import save_guarantee
from quakedesign.guarantees.exact.plant_proof import PlantProof
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.search.compensated_search import Compensation
from quakedesign.guarantees.search.worst_case import WorstCase
from quakedesign.lyapunov.exact.claim import Verdict


class Guarantee:
    """Guarantee of a loop, or the reason why there is none; base class of all results.

    Attributes
    ----------
    proof : Proof or NoProof
    worst : WorstCase or None
        Largest values that a search reaches on the same loop; None without a proof or a search.
    worst_with_stick : WorstCase or None
        The same on the stick–slip plant, for a proof on the plant without stick.
    compensation : Compensation or None
        Gains, scale and settings of a sliding mode in the guaranteed scheme.
    not_at_rest, stick_slip_gap : str
        Why there is no proof on the stick–slip plant, and the quantities that are not searched there.
    least_slip_rate : LowerBound or None
        Slip rate, or its error [m/s], below which no controller can keep the fault at this T_s.
    """

    __slots__ = ()
    proof: Any
    compensation: Compensation | None
    not_at_rest: str = ""

    @property
    def worst(self) -> WorstCase | None:
        """Worst case found on the same loop (lower bound)."""
        return None

    @property
    def proved(self) -> bool:
        """Whether there is a guarantee."""
        return bool(self.proof.available)

    @property
    def verdict(self) -> Verdict:
        """PROVED, or UNDECIDED without a guarantee."""
        return Verdict.PROVED if self.proved else Verdict.UNDECIDED

    @property
    def reason(self) -> str:
        """Why there is no guarantee; empty if there is one."""
        return "" if self.proved else self.proof.reason

    @property
    def bounds(self) -> Mapping[str, Bound]:
        """Proved bounds by name; empty without a guarantee.

        For a fault: ``slip_error`` [m], ``peak_slip_rate`` [m/s], ``least_pressure`` and ``largest_pressure`` [Pa] in
        the fault; except in slow sliding also ``slip_rate_error`` [m/s]. For an uncertain plant: its outputs and
        controls, in its own units.
        """
        named: Mapping[str, Bound] = self.proof.bounds
        return named

    @property
    def worst_case(self) -> dict[str, float]:
        """Worst case found by quantity, SI (lower bounds); empty if none was searched for."""
        return {} if self.worst is None else {k: size for k, size in asdict(self.worst).items() if size is not None}

    @property
    def worst_with_stick(self) -> WorstCase | None:
        """Worst case found on the stick–slip plant (lower bound)."""
        return None

    @property
    def stick_slip_gap(self) -> str:
        """Quantities that are neither proved nor searched on the stick–slip plant."""
        return ""

    @property
    def least_slip_rate(self) -> LowerBound | None:
        """Performance limit [m/s] at the same T_s; None if unknown."""
        return None

    def sentence(self) -> str:
        """Statement of the guarantee, or the reason why there is none."""
        return str(self.proof.sentence())

    def lines(self) -> list[str]:
        """Lines of text: the guarantee, then the worst case found."""
        return [f"proved: {self.sentence()}" if self.proved else self.sentence()]

    def limit_lines(self) -> list[str]:
        """Performance limits at the same T_s, as text; empty if unknown."""
        return []

    def task_lines(self) -> list[str]:
        """Performance limits and other notes that do not depend on the law, as text."""
        return []

    def check(self) -> Verdict:
        """Re-check the guarantee in exact arithmetic; UNDECIDED without one."""
        return Verdict(self.proof.check())

    def to_dict(self) -> Json:
        """Plain values, SI; exact numbers as strings."""
        result = {"verdict": str(self.verdict), "sentence": self.sentence()}
        return result | (self.proof.to_dict() if self.proved else {"reason": self.reason})

    @property
    def controller(self) -> Any:
        """Controller for `simulate`, `export_controller` and `loop_transfer`.

        Raises
        ------
        CertificateError
            Without a guarantee.
        """
        proof, sliding = self._proof(), self.compensation
        return proof.controller if sliding is None else sliding.limited

    def save(self, path: str | Path) -> None:
        """Write the certificate file for `load_guarantee` and ``quakedesign check``.

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


@dataclass(frozen=True, kw_only=True)
class PlantGuarantee(Guarantee):
    """Guarantee of an uncertain plant, or of several blocks.

    Attributes
    ----------
    proof : PlantProof or NoProof
    """

    proof: PlantProof | NoProof
    compensation: None = None

    def lines(self) -> list[str]:
        """Lines of text: the guarantee, then the notes of its proof."""
        return self.proof.statement() if self.proof.available else super().lines()

    @property
    def controller(self) -> Any:
        """The law in exact numbers, `MatrixLaw`."""
        return self._proof().law
