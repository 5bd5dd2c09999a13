"""Guarantee of a sampled loop with an uncertain plant: vector small gain, claims, files.

**Theorem.** Consider a loop relative to the equilibrium under its loads, with every sector at its midpoint. For numbers
W_s ≥ 0 that bound the deviations of the sectors from their midpoints, let P_r = start_r + Σ g_ri·size_i + Σ g_rs·W_s
for every row r: an output, the argument of a sector, or a control. g_ri is the L1 gain from input i to row r; the
inputs are disturbances, rates of the loads and noise, and start_r bounds the response to the box of initial states. Let
h_s be half the width of sector s. If h_s·P_s < W_s for the argument of every sector with h_s > 0, and P_s < `within`
for every sector valid up to a bound, then every row stays below P_r for all t ≥ 0.

**Proof.** Let all sectors be valid up to t. The deviation of a sector from its midpoint is at most h_s|y_s|, so the
suprema W(t) up to t obey W(t) ≤ F + M·W(t) with M_sk = h_s·g_sk and F + M·W < W for the numbers W, so that M·W < W: the
spectral radius of M is below 1 (Collatz and Wielandt), W(t) is finite, and W(t) ≤ (1 − M)⁻¹F < W. So all arguments stay
below P_s, those with a bound strictly within it. As they are continuous and initially within it, they never leave it. ∎
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import zip_longest
from typing import TYPE_CHECKING, Annotated, ClassVar

from msgspec import Meta

from quakedesign.errors import ParameterError
from quakedesign.exact import Bound, LowerBound, UpperBound
from quakedesign.files import Json
from quakedesign.guarantees.exact.plant_loop import LinearPart, MatrixLaw, ResponseBounds, response_bounds
from quakedesign.guarantees.exact.proof import NoProof, Proof
from quakedesign.lyapunov.exact.certificate_files import UNCERTAIN_PLANT
from quakedesign.plant.plant_values import MOST, ExactSector, Matrix, Row, SlowLoad
from quakedesign.sos.exact.strict import Entries, made, need, read_as, written
from quakedesign.text import counted

if TYPE_CHECKING:
    from quakedesign.plant import UncertainPlant

MOST_PIECES = 64
_MOST_LAW_STATES = 48


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantClaims:
    """Claimed peaks for all t ≥ 0: outputs, then controls relative to their equilibrium."""

    outputs: tuple[UpperBound, ...]
    controls: tuple[UpperBound, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantProof(Proof[Row]):
    """Peaks of an uncertain plant under a sampled law, for all t ≥ 0; `check` decides them.

    Attributes
    ----------
    part : LinearPart
        The plant in exact numbers.
    law : MatrixLaw
    pieces : int
        Number of pieces of each flow for the bounds.
    inputs : Row
        W_s, one for every sector.
    claims : PlantClaims
    outputs, controls : tuple of str
        Names for display.
    units : tuple of str
        Units of outputs, controls and disturbances for display; empty for none.
    name : str
    remarks : mapping of str to str
        As in `UncertainPlant`.
    notes : tuple of str
        Changes of the law by rounding to exact numbers, or for blocks in slow sliding the bound of their slip rates.
    """

    kind: ClassVar[str] = UNCERTAIN_PLANT
    part: LinearPart
    law: MatrixLaw
    pieces: int
    inputs: Row
    claims: PlantClaims
    outputs: tuple[str, ...] = ()
    controls: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    name: str = "plant"
    remarks: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"PlantProof({self.name}: {', '.join(self._peaks())})"

    def _peaks(self) -> list[str]:
        named = [*self.outputs, *(f"{name} minus its equilibrium value" for name in self.controls)]
        bounds = (*self.claims.outputs, *self.claims.controls)
        named = named if len(named) == len(bounds) else [f"row {i}" for i in range(1, len(bounds) + 1)]
        units = self.units[: len(bounds)] or [""] * len(bounds)
        return [f"|{name}| <= {_shown(bound, unit)}" for name, bound, unit in zip(named, bounds, units, strict=True)]

    @property
    def bounds(self) -> Mapping[str, Bound]:
        """Peaks by the names of outputs and controls, in the units of the plant."""
        return dict(zip((*self.outputs, *self.controls), (*self.claims.outputs, *self.claims.controls), strict=True))

    def theorem_bounds(self) -> Row | NoProof:
        """Peaks of outputs and controls that the theorem gives for `inputs`."""
        try:
            largest = peaks(self.part, response_bounds(self.part.loop(self.law), self.pieces), self.inputs)
        except ParameterError as error:
            return NoProof(reason=str(error))
        failed = "a sector deviates by more than its number W_s, or its argument exceeds its bound"
        return NoProof(reason=failed) if largest is None else largest

    def follows_from(self, bounds: Row) -> bool:
        """Whether no peak exceeds its claim."""
        return all(a <= b for a, b in zip(bounds, (*self.claims.outputs, *self.claims.controls), strict=True))

    def statement(self) -> list[str]:
        """Lines of text: the statement, then the notes."""
        return [f"proved: {self.sentence()}", *self.notes]

    def sentence(self) -> str:
        """Statement of the guarantee; the covered ranges are rounded inward."""
        part, law = self.part, self.law
        size = f"{counted(len(part.A), 'state')}, {counted(len(part.B[0]), 'control')}"
        of_plant, of_forces = (self.remarks.get(name, "") for name in ("plant", "disturbances"))
        text = f"on the uncertain plant of the certificate ({size}){of_plant and f' {of_plant}'}, "
        text += f"from |x_i(0)| <= {_listed(part.start)}" if any(part.start) else "from rest"
        text += f", with zero-order hold over {UpperBound(law.step):.6g} s"
        text += f", with a delay of {UpperBound(law.delay):.6g} s" if law.delay else ""
        text += f", for all uncertain terms in {counted(len(part.sectors), 'sector')}" if part.sectors else ""
        regions = [s.within for s in part.sectors if s.within is not None]
        text += f", {len(regions)} of which hold for |y| <= {_listed(regions)}" if regions else ""
        sizes, first = [size for _, size in part.disturbances], len(self.claims.outputs)
        pushed = self.units[first + len(part.B[0]) :]
        text += f", disturbances of at most {_listed(sizes, pushed)}{of_forces and f' ({of_forces})'}" if sizes else ""
        rates, unit = [load.rate for load in part.loads], self.units[first] if self.units else ""
        text += f", loads that change by at most {_listed(rates, [unit and f'{unit}/s'] * len(rates))}" if rates else ""
        noise = f"measurement noise of at most {_listed(part.noise)}" if any(part.noise) else "exact measurements"
        text += f", {noise}"
        return f"{text}, for all t >= 0: {', '.join(self._peaks())}"

    def to_dict(self) -> Json:
        """Exact numbers as strings."""
        return {
            "peaks": {name: bound.exact for name, bound in self.bounds.items()},
            "step": str(self.law.step),
            "delay": str(self.law.delay),
            "notes": list(self.notes),
        }


def _listed(values: Iterable[Fraction], units: Iterable[str] = ()) -> str:
    """Distinct covered numbers in their order, as text."""
    return ", ".join(dict.fromkeys(_shown(LowerBound(v), unit) for v, unit in zip_longest(values, units, fillvalue="")))


def _shown(bound: LowerBound | UpperBound, unit: str) -> str:
    """Bound with four digits and an engineering prefix of its unit."""
    if unit.startswith("MPa"):
        bound, unit = type(bound)(bound * 10**6), unit[1:]
    return bound.quantity(unit, 4) if unit and bound else f"{bound:.4g}"


def peaks(part: LinearPart, responses: ResponseBounds, inputs: Row) -> Row | None:
    """Bounds of outputs and controls for given W_s of the sectors; None if a condition of the theorem fails."""
    if min(inputs, default=Fraction(0)) < 0:  # Collatz and Wielandt compare numbers >= 0
        return None
    bounds = row_bounds(part, responses, inputs)
    count = len(part.outputs)
    for sector, bound, most in zip(part.sectors, bounds[count:], inputs, strict=False):
        half = (sector.slopes[1] - sector.slopes[0]) / 2
        if (half and not half * bound < most) or (sector.within is not None and not bound < sector.within):
            return None
    return bounds[:count] + bounds[count + len(part.sectors) :]


def row_bounds(part: LinearPart, responses: ResponseBounds, inputs: Row) -> Row:
    """P_r of every row of the loop: outputs, arguments of sectors, controls."""
    own = [size for _, size in part.disturbances] + [load.rate for load in part.loads]
    uncertain = [s.slopes[0] != s.slopes[1] for s in part.sectors]
    sizes = [*own, *(w if varies else Fraction(0) for w, varies in zip(inputs, uncertain, strict=True))]
    noise = [size for size in part.noise if size]
    parts = (*zip(responses.inputs, sizes, strict=True), *zip(responses.sampled, noise, strict=True))
    bounds = list(responses.start)
    for gains, size in parts:
        bounds = [b + g * size for b, g in zip(bounds, gains, strict=True)]
    return tuple(bounds)


# ----------------------------------------------------------------------
# Files of the kind ``uncertain_plant`` (proofs/FORMAT.md).


class SizedEntry(Entries):
    """A disturbance: where it enters, and its bound."""

    entry: Row
    size: Fraction


class PlantEntries(Entries):
    """A plant in exact numbers, see `LinearPart`."""

    A: Matrix
    B: Matrix
    C: Matrix
    disturbances: tuple[SizedEntry, ...]
    loads: tuple[SlowLoad, ...]
    sectors: tuple[ExactSector, ...]
    noise: Row
    start: Row
    outputs: Matrix

    def part(self) -> LinearPart:
        """The plant, after a check of its sizes."""
        n, m = len(self.A), len(self.B[0]) if self.B else 0
        need(1 <= n <= MOST and 1 <= m <= MOST, f"a plant must have 1 to {MOST} states, and 1 to {MOST} controls")
        for name in ("C", "disturbances", "loads", "sectors", "outputs"):
            need(len(getattr(self, name)) <= MOST, f"{name} must have at most {MOST} entries")
        sizes = (
            *(len(row) - n for row in (*self.A, *self.C, *self.outputs, self.start)),
            *(len(row) - m for row in self.B),
            *(len(one.entry) - n for one in self.disturbances),
            *(abs(len(one.control) - m) + abs(len(one.shift) - n) for one in self.loads),
            *(abs(len(one.entry) - n) + abs(len(one.row) - n - m) for one in self.sectors),
            len(self.B) - n,
            len(self.noise) - len(self.C),
        )
        need(not any(sizes), "rows and columns of a plant must fit")
        for load in self.loads:
            seen = any(sum((c * s for c, s in zip(row, load.shift, strict=True)), Fraction(0)) for row in self.C)
            need(load.rate >= 0 and not seen, "a load must have a rate of 0 or more and a shift that is not measured")
        for one in self.sectors:
            need(one.slopes[0] <= one.slopes[1], "slopes must be in order")
            need(one.within is None or one.within > 0, "a bound of a sector must be positive")
            need(one.within is None or not any(one.row[n:]), "a sector with a bound must depend on the states alone")
        return made(LinearPart, self, disturbances=tuple((one.entry, one.size) for one in self.disturbances))


class PlantLawEntries(Entries):
    """A sampled law of a plant, see `MatrixLaw`."""

    step: Fraction
    delay: Fraction
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix


class PlantFile(Entries):
    """Content of a file without its format and kind."""

    plant: PlantEntries
    law: PlantLawEntries
    pieces: Annotated[int, Meta(ge=1, le=MOST_PIECES)]
    inputs: Row
    claims: dict[str, UpperBound]


def plant_entries(claim: PlantProof) -> Json:
    """Content of the file but its format and kind."""
    part, law = claim.part, claim.law
    disturbances = tuple(SizedEntry(entry=entry, size=size) for entry, size in part.disturbances)
    file = PlantFile(
        plant=made(PlantEntries, part, disturbances=disturbances),
        law=made(PlantLawEntries, law, A=law.update, B=law.measured, C=law.output, D=law.feedback),
        pieces=claim.pieces,
        inputs=claim.inputs,
        claims={
            f"{name}_{i}": bound
            for name, bounds in (("output", claim.claims.outputs), ("control", claim.claims.controls))
            for i, bound in enumerate(bounds, 1)
        },
    )
    return dict(written(file))


def read_plant_guarantee(raw: Json) -> PlantProof:
    """Claim from a parsed file without its format and kind.

    Raises
    ------
    CertificateError
        When it breaks a rule of FORMAT.md.
    """
    file = read_as(PlantFile, raw)
    part, matrices = file.plant.part(), file.law
    need(len(matrices.A) <= _MOST_LAW_STATES, f"a law must have at most {_MOST_LAW_STATES} states")
    law = made(MatrixLaw, matrices, update=matrices.A, measured=matrices.B, output=matrices.C, feedback=matrices.D)
    part.loop(law)  # rejects dimensions that do not match, and a load that the law cannot balance
    count = {"output": len(part.outputs), "control": len(part.B[0])}
    names = {kind: [f"{kind}_{i}" for i in range(1, most + 1)] for kind, most in count.items()}
    expected = [*names["output"], *names["control"]]
    need(set(file.claims) == set(expected), f"claims must be {', '.join(expected)}")
    claims = {f"{kind}s": tuple(file.claims[name] for name in of) for kind, of in names.items()}
    need(len(file.inputs) == len(part.sectors), "inputs must have an entry for each sector")
    sizes = (*part.noise, *part.start, *(size for _, size in part.disturbances), *file.inputs)
    need(min(sizes, default=Fraction(0)) >= 0, "noise, start, sizes of disturbances and inputs must be 0 or more")
    return PlantProof(part=part, law=law, pieces=file.pieces, inputs=file.inputs, claims=PlantClaims(**claims))


def named(claim: PlantProof, plant: "UncertainPlant") -> PlantProof:
    """Claim with the names and units of its plant."""
    outputs, controls, units = tuple(plant.outputs or ()), tuple(plant.controls), plant.units
    symbols = tuple(units.get(name, "") for name in (*outputs, *controls, *plant.disturbances)) if units else ()
    return replace(claim, outputs=outputs, controls=controls, units=symbols, name=plant.name, remarks=plant.remarks)
