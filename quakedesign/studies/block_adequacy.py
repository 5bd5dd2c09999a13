"""Adequacy of a one-block model of a fault: guarantees for the fault divided into several blocks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from quakedesign.exact import UpperBound, rational
from quakedesign.fault import Fault
from quakedesign.files import Json
from quakedesign.guarantees import NoProof
from quakedesign.guarantees.exact.plant_proof import PlantProof
from quakedesign.loop.loop_setup import LoopSetup
from quakedesign.plant import UncertainPlant
from quakedesign.synthesis import guarantee


@dataclass(frozen=True, slots=True, kw_only=True)
class BlocksResult:
    """Guarantees for a fault divided into different numbers of blocks."""

    fault: Fault
    wells: str  # ``"one"`` or ``"each"``
    step: Fraction  # T_s [s]
    proofs: Mapping[int, PlantProof | NoProof]  # Guarantees by the number of blocks

    @property
    def proved(self) -> bool:
        """Whether all numbers of blocks have a guarantee."""
        return all(one.available for one in self.proofs.values())

    def peaks(self, blocks: int) -> tuple[Any, Any] | None:
        """Largest proved slip error [m] and slip-rate error [m/s] of all blocks."""
        one = self.proofs[blocks]
        if not one.available:
            return None
        outputs = one.claims.outputs
        return max(outputs[:blocks]), max(outputs[blocks:])

    def lines(self) -> list[str]:
        """The result as lines of text."""
        wells = "one well for all" if self.wells == "one" else "a well for each block"
        parts = [
            f"{self.fault.name} cut into blocks, {wells}, a law designed for each number of blocks; the certificates "
            "are about the plants without stick that are derived from the fault, not about the derivation",
            f"from rest, with zero-order hold over {UpperBound(self.step):.6g} s, each block with its own friction "
            "law of the box, for all t >= 0:",
        ]
        for blocks, one in self.proofs.items():
            ends = self.peaks(blocks)
            if not one.available or ends is None:
                parts.append(f"{blocks:3} blocks: {one.sentence()}")
                continue
            about = "its equilibrium" if self.wells == "one" else "the reference"
            parts.append(
                f"{blocks:3} blocks: proved: slip-rate error at most {ends[1]:.4g} m/s, slip within {ends[0]:.4g} m of "
                f"{about}"
            )
        return parts

    def to_dict(self) -> Json:
        """Plain values, SI."""
        rows = []
        for blocks, one in self.proofs.items():
            ends = self.peaks(blocks)
            entry: Json = {"blocks": blocks, "verdict": "proved" if one.available else "undecided"}
            entry |= {"reason": None if one.available else one.reason}
            entry |= {"slip_error": ends and ends[0].exact, "slip_rate_error": ends and ends[1].exact}
            rows.append(entry)
        return {"fault": self.fault.name, "wells": self.wells, "step": str(self.step), "blocks": rows}


def one_block(
    fault: Fault, blocks: Sequence[int] = range(2, 11), *, wells: str = "one", coupling: Any = None, step: Any = None
) -> BlocksResult:
    """Guarantees for a fault divided into blocks, as a check whether one block is an adequate model.

    Parameters
    ----------
    fault : Fault
    blocks : sequence of int
    wells : str
        ``"one"`` well for all blocks, whose law measures the means of slip and slip rate, or ``"each"``.
    coupling : number, optional
        As in `UncertainPlant.from_blocks` [1/s²].
    step : str, float or Fraction, optional
        T_s [s]; by default the fault's.
    """
    setup = LoopSetup(step=rational(fault.sampling_time) if step is None else step)
    proofs: dict[int, PlantProof | NoProof] = {}
    for count in blocks:
        plant = UncertainPlant.from_blocks(fault, count, wells=wells, coupling=coupling)
        proofs[count] = guarantee(plant, setup=setup).proof
    assert setup.step is not None
    return BlocksResult(fault=fault, wells=wells, step=setup.step, proofs=proofs)
