"""Faults of several blocks in a row with springs between neighbours, and wells along them; their files.

A fault file with ``[[block]]`` tables. Wells share their pressure as steady diffusion along the fault does: linear
between two wells, constant beyond the last ones, at the middle of each block.
"""

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, ScenarioError
from quakedesign.exact import rational, shortly
from quakedesign.fault.fault_toml import Table, fault_of_tables, read_friction, source_text
from quakedesign.fault.friction.base import FrictionLaw
from quakedesign.fault.model import Fault, Problems, require_positive
from quakedesign.files import parse_toml

MOST_BLOCKS = 20


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class FaultBlock:
    """One block of a row.

    Attributes
    ----------
    length : float
        Along the fault [m].
    effective_normal_stress : float
        σ' [Pa].
    friction : FrictionLaw
    """

    length: float
    effective_normal_stress: float
    friction: FrictionLaw

    def __post_init__(self) -> None:
        require_positive(length=self.length, effective_normal_stress=self.effective_normal_stress)


@checked_dataclass(frozen=True, kw_only=True)
class BlockChain:
    """A fault of several blocks.

    Attributes
    ----------
    fault : Fault
        What all blocks share: rock, width, damping per area, task, disturbance, box; also its name.
    blocks : tuple of FaultBlock
        2 to 20 blocks, whose lengths add up to that of the fault.
    wells : tuple of float
        Positions along the fault [m], in increasing order.

    Raises
    ------
    ParameterError
    """

    fault: Fault
    blocks: tuple[FaultBlock, ...]
    wells: tuple[float, ...]

    def __post_init__(self) -> None:
        if not 2 <= len(self.blocks) <= MOST_BLOCKS or not 1 <= len(self.wells) <= len(self.blocks):
            raise ParameterError(
                f"a fault of several blocks must have 2 to {MOST_BLOCKS} blocks, and 1 well to one well a block. "
                f"Received {len(self.blocks)} blocks and {len(self.wells)} wells."
            )
        whole, length = sum(self.lengths), rational(self.fault.length)
        if whole != length:
            raise ParameterError(
                f"lengths of the blocks must add up to the length of the fault, {shortly(length)} m. "
                f"Received {shortly(whole)} m."
            )
        places = [rational(v) for v in self.wells]
        if not all(0 <= v <= length for v in places) or any(a >= b for a, b in pairwise(places)):
            raise ParameterError(
                f"positions of wells must increase, from 0 to {shortly(length)} m. Received "
                f"{', '.join(map(shortly, places))}."
            )
        for block in self.blocks:
            replace(self.fault, friction=block.friction).require_memoryless("a fault of several blocks")

    @property
    def name(self) -> str:
        """Name of the fault."""
        return self.fault.name

    @cached_property
    def lengths(self) -> tuple[Fraction, ...]:
        """Lengths of the blocks [m]."""
        return tuple(rational(block.length) for block in self.blocks)

    @cached_property
    def middles(self) -> tuple[Fraction, ...]:
        """Positions of the middles of the blocks [m]."""
        return tuple(end - length / 2 for end, length in zip(accumulate(self.lengths), self.lengths, strict=True))

    @cached_property
    def shares(self) -> tuple[tuple[Fraction, ...], ...]:
        """Share of each well's pressure (columns) in that of each block (rows) [-]; every row adds up to 1."""
        places, rows = [rational(v) for v in self.wells], []
        for x in self.middles:
            row = [Fraction(0)] * len(places)
            after = next((j for j, place in enumerate(places) if place >= x), len(places))
            if after in (0, len(places)):
                row[min(after, len(places) - 1)] = Fraction(1)
            else:
                part = (x - places[after - 1]) / (places[after] - places[after - 1])
                row[after - 1], row[after] = 1 - part, part
            rows.append(tuple(row))
        return tuple(rows)

    @cached_property
    def springs(self) -> tuple[tuple[int, int, Fraction], ...]:
        """(i, j, K): block j pulls block i by K [1/s²] per metre of slip between them, G/(ρ·distance·length of i)."""
        wave, found = rational(self.fault.shear_modulus) / rational(self.fault.density), []
        for i, j in pairwise(range(len(self.blocks))):
            distance = self.middles[j] - self.middles[i]
            found += [(a, b, wave / (distance * self.lengths[a])) for a, b in ((i, j), (j, i))]
        return tuple(found)

    @cached_property
    def faults(self) -> tuple[Fault, ...]:
        """The fault with the friction and the stress of each block: what holds of it for its area."""
        return tuple(
            replace(self.fault, friction=b.friction, effective_normal_stress=b.effective_normal_stress)
            for b in self.blocks
        )

    @property
    def alike(self) -> bool:
        """Whether all blocks have the same length, stress and friction."""
        return len(set(self.blocks)) == 1


def load_chain(source: str | Path, *, box: str | None = None, allow_code: bool = False) -> BlockChain | None:
    """Fault of several blocks from a TOML file; None for a file or preset without ``[[block]]`` tables.

    Parameters
    ----------
    source : str or Path
    box : str, optional
        Name of an uncertainty box in place of that of the file.
    allow_code : bool
        As of `load_fault`.

    Raises
    ------
    UnknownNameError, ScenarioError, UnitError, ParameterError
    """
    text = source_text(source)
    try:
        raw = parse_toml(text)
    except ValueError:
        return None  # load_fault says what is wrong
    if not {"block", "well"} & set(raw):
        return None
    problems = Problems()
    tables = {key: _tables(raw.pop(key, []), key, problems) for key in ("block", "well")}
    fault = fault_of_tables(Table(raw, problems), problems, allow_code)
    blocks = [_block(table, problems, fault, allow_code) for table in tables["block"]]
    wells = [_position(table) for table in tables["well"]]
    problems.refuse(str(source))
    fault = fault.with_box(box) if box else fault
    return BlockChain(fault=fault, blocks=tuple(blocks), wells=tuple(wells))


def _tables(given: Any, key: str, problems: Problems) -> list[Table]:
    if not isinstance(given, list) or not all(isinstance(one, Mapping) for one in given):
        with problems.collected():
            raise ScenarioError(f"{key} must be tables [[{key}]]. Received another kind of entry.")
        return []
    return [Table(one, problems, f"{key} {place}") for place, one in enumerate(given, 1)]


def _block(table: Table, problems: Problems, fault: Fault | None, allow_code: bool) -> Any:
    read = table.quantities({"length": "m"})
    read |= table.quantities({"effective_normal_stress": "Pa"}, optional=True)
    friction = table.table("friction", optional=True)
    law = read_friction(friction, problems, allow_code) if friction is not None else getattr(fault, "friction", None)
    table.close()
    if fault is None or law is None or None in read.values():
        return None
    with problems.collected():
        return FaultBlock(**{"effective_normal_stress": fault.effective_normal_stress, "friction": law} | read)
    return None


def _position(table: Table) -> Any:
    read = table.quantities({"position": "m"})
    table.close()
    return read["position"]
