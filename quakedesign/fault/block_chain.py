"""Faults of several blocks in a row, coupled by springs, with wells along the fault, and their files.

Such a fault file has ``[[block]]`` tables. Without a diffusivity the pressure along the fault is steady: linear between
two wells, constant beyond the outermost ones. A block has the pressure at its middle. With a diffusivity D the pressure
diffuses between neighbouring points: the middles x_i of the blocks, of lengths L_i, and the wells. The pressures there
obey q_i' = D/L_i·Σ(q_j − q_i)/|x_j − x_i| (finite volumes, no flow through the ends); at a well, q_i is its pressure.
"""

from collections.abc import Iterable, Mapping
from dataclasses import field, replace
from fractions import Fraction
from functools import cached_property
from itertools import accumulate, pairwise
from math import isfinite
from pathlib import Path
from typing import Any

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, ScenarioError
from quakedesign.exact import apart, rational, shortly
from quakedesign.fault.entries import FileEntry, Table, entries_of
from quakedesign.fault.fault_toml import PLANT, fault_of_tables, read_friction, source_text
from quakedesign.fault.friction.base import FrictionLaw
from quakedesign.fault.model import Fault, Problems, require_nonnegative, require_ordinary, require_positive
from quakedesign.fault.units import quantity
from quakedesign.files import parse_toml
from quakedesign.text import counted

MOST_BLOCKS = 20


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class FaultBlock:
    """One block of a row.

    Raises `ParameterError` for a length or stress that is not positive and finite.

    Attributes
    ----------
    length : float
        Length of the block along the fault [m], positive.
    effective_normal_stress : float
        σ'_n [Pa], positive in compression; default in a file: that of the fault.
    friction : FrictionLaw
        Friction law of the block; default in a file: that of the fault.
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
        Common data of all blocks: host rock, width, damping per area, task, disturbance, box, name.
    blocks : tuple of FaultBlock
        2 to 20 blocks, whose lengths add up to that of the fault; friction has a state in all blocks or in none.
    wells : tuple of float
        Positions along the fault [m], in increasing order; at least one, at most as many as blocks.
    diffusivity : float, optional
        Diffusivity of the pressure along the fault [m²/s], positive; without it the pressure is steady.

    Raises
    ------
    ParameterError
        When these conditions are violated, or a diffusivity is given for friction with a state.
    """

    fault: Fault
    blocks: tuple[FaultBlock, ...]
    wells: tuple[float, ...]
    diffusivity: float | None = field(default=None, metadata=quantity("m^2/s", "1e6 m^2/s"))

    def __post_init__(self) -> None:
        blocks, wells = len(self.blocks), len(self.wells)
        if not 2 <= blocks <= MOST_BLOCKS or not 1 <= wells <= blocks:
            raise ParameterError(
                f"a fault of several blocks must have 2 to {MOST_BLOCKS} blocks, at least one well, and at most as "
                f"many wells as blocks. Received {counted(blocks, 'block')} and {counted(wells, 'well')}. Add or omit "
                "[[block]] or [[well]] tables; the file of a fault of one block has neither."
            )
        whole, length = sum(self.lengths, Fraction(0)), rational(self.fault.length)
        if whole != length:
            raise ParameterError(
                "lengths of the blocks must add up to the length of the fault, {} m. Received {} m, which differs by "
                "{} m. Change one of these lengths.".format(*apart(length, whole), shortly(abs(whole - length)))
            )
        places = [rational(v, "position of a well") for v in self.wells]
        if not all(0 <= v <= length for v in places) or any(a >= b for a, b in pairwise(places)):
            most, *received = apart(length, *places)
            raise ParameterError(
                f"positions of wells must be from 0 to {most} m and increase. Received {', '.join(received)} m. Sort "
                "the wells, and give each its own position on the fault."
            )
        if self.diffusivity is not None:
            require_positive(diffusivity=self.diffusivity)
            self.friction.require(diffusivity=self.diffusivity)
        for place, block in enumerate(self.blocks, 1):
            if block.friction.equilibrium is not self.friction.equilibrium:
                raise ParameterError(
                    "either all blocks of a fault or none must have friction with a state. Received "
                    f"{self.friction.name} in block 1 and {block.friction.name} in block {place}. Change one."
                )

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
        """Share of each well pressure (columns) in each block pressure (rows) [-]; every row adds up to 1."""
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
    def flow(self) -> tuple[tuple[Fraction, ...], ...]:
        """Matrix [1/s] that gives q' from q (first columns) and the well pressures (last columns).

        q are the pressures of the blocks without a well at their middle. The matrix is empty without a diffusivity.
        """
        wells, states = [rational(v) for v in self.wells], self._diffusing
        diffusivity = rational(self.diffusivity or 0)
        points = sorted({*self.middles, *wells})
        rows = []
        for i in states:
            x, row = self.middles[i], [Fraction(0)] * (len(states) + len(wells))
            place = points.index(x)
            for other in points[max(place - 1, 0) : place] + points[place + 1 : place + 2]:
                rate = diffusivity / (self.lengths[i] * abs(other - x))
                column = len(states) + wells.index(other) if other in wells else states.index(self.middles.index(other))
                row[column] += rate
                row[states.index(i)] -= rate
            rows.append(tuple(row))
        return tuple(rows)

    @cached_property
    def pressures(self) -> tuple[tuple[Fraction, ...], ...]:
        """Share of each pressure of `flow` (columns) in each block pressure (rows) [-]; `shares` if it is steady."""
        if self.diffusivity is None:
            return self.shares
        wells, states = [rational(v) for v in self.wells], self._diffusing
        places = [states.index(i) if i in states else len(states) + wells.index(x) for i, x in enumerate(self.middles)]
        size = len(states) + len(wells)
        return tuple(tuple(Fraction(j == place) for j in range(size)) for place in places)

    @property
    def _diffusing(self) -> list[int]:
        """Indices of the blocks whose pressure is a state of the diffusion."""
        wells = {rational(v) for v in self.wells}
        return [] if self.diffusivity is None else [i for i, x in enumerate(self.middles) if x not in wells]

    @cached_property
    def springs(self) -> tuple[tuple[int, int, Fraction], ...]:
        """(i, j, K): block j accelerates block i by K [1/s²] per relative slip, K = G/(ρ·distance·length of i)."""
        wave, springs = rational(self.fault.shear_modulus) / rational(self.fault.density), []
        for i, j in pairwise(range(len(self.blocks))):
            distance = self.middles[j] - self.middles[i]
            springs += [(a, b, wave / (distance * self.lengths[a])) for a, b in ((i, j), (j, i))]
        return tuple(springs)

    @cached_property
    def faults(self) -> tuple[Fault, ...]:
        """One fault per block, with its friction and stress; of the other values only those per unit area apply."""
        return tuple(
            replace(self.fault, friction=b.friction, effective_normal_stress=b.effective_normal_stress)
            for b in self.blocks
        )

    @property
    def friction(self) -> FrictionLaw:
        """Friction law of the first block, whose equilibrium is that of all blocks."""
        return self.blocks[0].friction

    @property
    def has_state(self) -> bool:
        """Whether friction has a state, such as rate-and-state friction."""
        return bool(self.friction.state_names)

    @property
    def alike(self) -> bool:
        """Whether all blocks have the same length, stress and friction."""
        return len(set(self.blocks)) == 1


def add_springs(rows: Any, springs: Iterable[tuple[int, int, Fraction]], scale: Any = 1) -> None:
    """Add springs (i, j, K), times `scale`, to a matrix of the acceleration of each block (row) per slip (column)."""
    for i, j, K in springs:
        rows[i][j] += K * scale
        rows[i][i] -= K * scale


BLOCK = {
    name: replace(PLANT[name], required=name == "length", owner=FaultBlock)
    for name in ("length", "effective_normal_stress")
}
WELL = {"position": FileEntry(name="position", unit="m", example="1 km", text="Position along the fault")}
DIFFUSION = entries_of(BlockChain)
"""Top-level entries that only a file of several blocks has."""


def load_chain(source: str | Path, *, box: str | None = None, allow_code: bool = False) -> BlockChain | None:
    """Fault of several blocks from a TOML file; None if it is not TOML or has no ``[[block]]`` or ``[[well]]`` table.

    Parameters
    ----------
    source : str or Path
        Name of a preset, or a path that ends in ``.toml``.
    box : str, optional
        Name of an uncertainty box that replaces the one in the file.
    allow_code : bool
        As in `load_fault`, whose errors are raised here too.
    """
    text = source_text(source)
    try:
        raw = parse_toml(text)
    except ValueError:
        return None  # load_fault reports the error
    if not {"block", "well"} & set(raw):
        return None
    problems = Problems()
    along = Table({key: raw.pop(key) for key in DIFFUSION if key in raw}, problems)
    values = along.read(DIFFUSION)
    tables = {key: _tables(raw.pop(key, []), key, problems) for key in ("block", "well")}
    fault = fault_of_tables(Table(raw, problems), allow_code)
    blocks = [_block(table, fault, allow_code) for table in tables["block"]]
    wells = [_position(table) for table in tables["well"]]
    for key in tables:
        for place, table in enumerate(tables[key], 1):
            problems.errors += [type(one)(f"{key} {place}: {one}") for one in table.problems.errors]
    fault = problems.resolved(fault, str(source))
    parts = {"fault": fault.with_box(box) if box else fault, "blocks": tuple(blocks), "wells": tuple(wells)}
    return problems.resolved(along.built(BlockChain, parts | values), str(source))


def _tables(given: object, key: str, problems: Problems) -> list[Table]:
    if not isinstance(given, list) or not all(isinstance(one, Mapping) for one in given):
        with problems.collected():
            kind = type(given).__name__
            raise ScenarioError(f"{key} must be [[{key}]] tables. Received {kind}. Begin each table with [[{key}]].")
        return []
    return [Table(one, Problems()) for one in given]


def _block(table: Table, fault: Fault | None, allow_code: bool) -> FaultBlock | None:
    values = table.read(BLOCK)
    own = table.table("friction", optional=True)
    if own.where:  # given, and a table
        values["friction"] = read_friction(own, allow_code)
    table.close()
    if fault is None or None in values.values():
        return None
    shared = {name: getattr(fault, name) for name in ("effective_normal_stress", "friction")}
    with table.problems.collected():
        require_ordinary(**{key: value for key, value in values.items() if key in BLOCK and isfinite(value)})
        return FaultBlock(**shared | values)
    return None


def _position(table: Table) -> float | None:
    values = table.read(WELL)
    table.close()
    with table.problems.collected():
        require_nonnegative("", **{key: value for key, value in values.items() if value is not None})
    return values["position"]  # type: ignore[no-any-return]
