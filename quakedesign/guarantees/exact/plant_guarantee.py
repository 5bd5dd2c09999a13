"""Guarantee of a sampled loop around an uncertain plant: vector small gain, claims that check themselves, files.

**Theorem.** Of a loop about the balance of its loads, with every sector at its middle, let P_r be a bound of a row r by
the sizes of the disturbances, the rates of the loads, the noise, the box of starts and numbers W_s ≥ 0 for what the
sectors are more than their middles: P_r = start_r + Σ g_ri·size_i + Σ g_rs·W_s. Let h_s be half the width of sector s,
and h_s·P_s < W_s for the argument of every sector with h_s > 0, and P_s < `within` for every sector that holds up to a
bound. Then every row stays below P_r for all t ≥ 0.

**Proof.** Let all sectors hold up to t. What a sector is more than its middle is at most h_s|y_s|, so the suprema W(t)
up to t obey W(t) ≤ F + M·W(t) with M_sk = h_s·g_sk and F + M·W < W for the numbers W, so that M·W < W: the spectral
radius of M is below 1 (Collatz and Wielandt), W(t) is finite, and W(t) ≤ (1 − M)⁻¹F < W. So all arguments stay below
P_s, those with a bound strictly within it; as they are continuous and within it at first, they never leave it. ∎
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import zip_longest
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from quakedesign.errors import CertificateError, ParameterError
from quakedesign.exact import LowerBound, UpperBound
from quakedesign.guarantees.exact.plant_loop import LinearPart, MatrixLaw, ResponseBounds, response_bounds
from quakedesign.lyapunov.exact.certificate_files import UNCERTAIN_PLANT
from quakedesign.lyapunov.exact.claim import Verdict
from quakedesign.plant.plant_values import MOST, ExactSector, Matrix, Row, SlowLoad
from quakedesign.sos.exact.strict import (
    headed,
    listed,
    need,
    read_ends,
    read_exactly,
    read_rational,
    read_row,
    texts,
    with_keys,
)
from quakedesign.text import counted

if TYPE_CHECKING:
    from quakedesign.plant import UncertainPlant

MOST_PIECES = 64
_MOST_LAW_STATES = 48


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantClaims:
    """Claimed peaks for all t ≥ 0, in the order of the plant: outputs, then controls less what balances the loads."""

    outputs: tuple[UpperBound, ...]
    controls: tuple[UpperBound, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantGuarantee:
    """Peaks of an uncertain plant under a sampled law, for all t ≥ 0; `check` decides them.

    Attributes
    ----------
    part : LinearPart
        The plant in exact numbers.
    law : MatrixLaw
    pieces : int
        Into how many pieces each flow is cut for the bounds.
    inputs : Row
        W_s, one for every sector.
    claims : PlantClaims
    outputs, controls : tuple of str
        Names for people.
    units : tuple of str
        Those of outputs, controls and disturbances, for people; without entries numbers have none.
    name : str
    remarks : mapping of str to str
        As of `UncertainPlant`.
    notes : tuple of str
        What was changed when the law became one in exact numbers.
    """

    proved: ClassVar[Literal[True]] = True
    verdict: ClassVar[Verdict] = Verdict.PROVED
    reason: ClassVar[str] = ""
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
        return f"PlantGuarantee({self.name}: {', '.join(self._peaks())})"

    def _peaks(self) -> list[str]:
        named = [*self.outputs, *(f"{name} less its load" for name in self.controls)]
        bounds = (*self.claims.outputs, *self.claims.controls)
        named = named if len(named) == len(bounds) else [f"row {i}" for i in range(1, len(bounds) + 1)]
        units = self.units[: len(bounds)] or [""] * len(bounds)
        return [f"|{name}| <= {_told(bound, unit)}" for name, bound, unit in zip(named, bounds, units, strict=True)]

    @property
    def bounds(self) -> dict[str, UpperBound]:
        """Peaks by the names of outputs and controls, in the units of the plant."""
        return dict(zip((*self.outputs, *self.controls), (*self.claims.outputs, *self.claims.controls), strict=True))

    def check(self) -> Verdict:
        """PROVED if the theorem gives the claims, in ball arithmetic; else UNDECIDED."""
        try:
            found = peaks(self.part, response_bounds(self.part.loop(self.law), self.pieces), self.inputs)
        except ParameterError:
            return Verdict.UNDECIDED
        claimed = (*self.claims.outputs, *self.claims.controls)
        holds = found is not None and all(a <= b for a, b in zip(found, claimed, strict=True))
        return Verdict.PROVED if holds else Verdict.UNDECIDED

    def lines(self) -> list[str]:
        """What is printed."""
        return [f"proved: {self.sentence()}", *self.notes]

    def sentence(self) -> str:
        """What is guaranteed, for people, of the plant and the law in the file; what it covers is rounded inward."""
        part, law = self.part, self.law
        size = f"{counted(len(part.A), 'state')}, {counted(len(part.B[0]), 'control')}"
        of_plant, of_forces = (self.remarks.get(name, "") for name in ("plant", "disturbances"))
        said = f"on the uncertain plant of the certificate ({size}){of_plant and f' {of_plant}'}, "
        said += f"from |x_i(0)| <= {_listed(part.start)}" if any(part.start) else "from rest"
        said += f", with zero-order hold over {UpperBound(law.step):.6g} s"
        said += f", {UpperBound(law.delay):.6g} s late" if law.delay else ""
        said += f", for all uncertain terms in {counted(len(part.sectors), 'sector')}" if part.sectors else ""
        regions = [s.within for s in part.sectors if s.within is not None]
        said += f", {len(regions)} of which hold for |y| <= {_listed(regions)}" if regions else ""
        sizes, first = [size for _, size in part.disturbances], len(self.claims.outputs)
        pushed = self.units[first + len(part.B[0]) :]
        said += f", disturbances of at most {_listed(sizes, pushed)}{of_forces and f' ({of_forces})'}" if sizes else ""
        rates, unit = [load.rate for load in part.loads], self.units[first] if self.units else ""
        said += f", loads of rates of at most {_listed(rates, [unit and f'{unit}/s'] * len(rates))}" if rates else ""
        said += f", measurement noise of at most {_listed(part.noise)}" if any(part.noise) else ""
        return f"{said}, for all t >= 0: {', '.join(self._peaks())}"

    def to_dict(self) -> dict[str, Any]:
        """Exact numbers as texts."""
        return {
            "verdict": "proved",
            "sentence": self.sentence(),
            "peaks": {name: bound.exact for name, bound in self.bounds.items()},
            "step": str(self.law.step),
            "delay": str(self.law.delay),
            "notes": list(self.notes),
        }


def _listed(values: Iterable[Fraction], units: Iterable[str] = ()) -> str:
    """Different numbers that are covered, in their order."""
    return ", ".join(dict.fromkeys(_told(LowerBound(v), unit) for v, unit in zip_longest(values, units, fillvalue="")))


def _told(bound: LowerBound | UpperBound, unit: str) -> str:
    """With four digits, and an engineering prefix of its unit."""
    if unit.startswith("MPa"):
        bound, unit = type(bound)(bound * 10**6), unit[1:]
    return bound.quantity(unit, 4) if unit and bound else f"{bound:.4g}"


def peaks(part: LinearPart, found: ResponseBounds, inputs: Row) -> Row | None:
    """Bounds of outputs and controls by numbers for the sectors; None where these do not close."""
    if min(inputs, default=Fraction(0)) < 0:  # the comparison of Collatz and Wielandt is one of numbers >= 0
        return None
    bounds = row_bounds(part, found, inputs)
    count = len(part.outputs)
    for sector, bound, most in zip(part.sectors, bounds[count:], inputs, strict=False):
        half = (sector.slopes[1] - sector.slopes[0]) / 2
        if (half and not half * bound < most) or (sector.within is not None and not bound < sector.within):
            return None
    return bounds[:count] + bounds[count + len(part.sectors) :]


def row_bounds(part: LinearPart, found: ResponseBounds, inputs: Row) -> Row:
    """P_r of every row of the loop: outputs, arguments of sectors, controls."""
    own = [size for _, size in part.disturbances] + [load.rate for load in part.loads]
    halves = [(s.slopes[1] - s.slopes[0]) / 2 for s in part.sectors]
    sizes = [*own, *(w if h else Fraction(0) for w, h in zip(inputs, halves, strict=True))]
    told = [size for size in part.noise if size]
    parts = (*zip(found.inputs, sizes, strict=True), *zip(found.sampled, told, strict=True))
    bounds = list(found.start)
    for gains, size in parts:
        if size:
            bounds = [b + g * size for b, g in zip(bounds, gains, strict=True)]
    return tuple(bounds)


# ----------------------------------------------------------------------
# Files of the kind ``uncertain_plant`` (proofs/FORMAT.md).

_PLANT = ("A", "B", "C", "disturbances", "loads", "sectors", "noise", "start", "outputs")
_LAW = ("step", "delay", "A", "B", "C", "D")


def plant_document(claim: PlantGuarantee) -> dict[str, Any]:
    """Content of the file."""
    part, law = claim.part, claim.law
    sectors = [
        {"entry": texts(s.entry), "row": texts(s.row), "slopes": texts(s.slopes)}
        | ({} if s.within is None else {"within": str(s.within)})
        for s in part.sectors
    ]
    return {
        "format": 1,
        "kind": UNCERTAIN_PLANT,
        "plant": {
            **{name: [texts(row) for row in getattr(part, name)] for name in "ABC"},
            "disturbances": [{"entry": texts(entry), "size": str(size)} for entry, size in part.disturbances],
            "loads": [
                {"control": texts(one.control), "shift": texts(one.shift), "rate": str(one.rate)} for one in part.loads
            ],
            "sectors": sectors,
            "noise": texts(part.noise),
            "start": texts(part.start),
            "outputs": [texts(row) for row in part.outputs],
        },
        "law": {
            "step": str(law.step),
            "delay": str(law.delay),
            "A": [texts(row) for row in law.update],
            "B": [texts(row) for row in law.measured],
            "C": [texts(row) for row in law.output],
            "D": [texts(row) for row in law.feedback],
        },
        "pieces": claim.pieces,
        "inputs": texts(claim.inputs),
        "claims": {
            f"{name}_{i}": bound.exact
            for name, bounds in (("output", claim.claims.outputs), ("control", claim.claims.controls))
            for i, bound in enumerate(bounds, 1)
        },
    }


def read_plant_guarantee(raw: Any) -> PlantGuarantee:
    """Claim from a parsed file.

    Raises
    ------
    CertificateError
        When it breaks a rule of FORMAT.md.
    """
    headed(raw, {"plant", "law", "pieces", "inputs", "claims"}, UNCERTAIN_PLANT)
    try:
        part, law = _read_part(raw["plant"]), _read_law(raw["law"])
        part.loop(law)  # refuses sizes that do not fit, and a load that the law cannot hold
    except ParameterError as error:
        raise CertificateError(str(error)) from None
    need(type(raw["pieces"]) is int and 1 <= raw["pieces"] <= MOST_PIECES, f"pieces must be 1 to {MOST_PIECES}")
    count = {"output": len(part.outputs), "control": len(part.B[0])}
    names = {kind: [f"{kind}_{i}" for i in range(1, most + 1)] for kind, most in count.items()}
    given = read_exactly(raw["claims"], [*names["output"], *names["control"]])
    claims = {f"{kind}s": tuple(UpperBound(given[name]) for name in of) for kind, of in names.items()}
    inputs = read_row(raw["inputs"], "inputs", length=len(part.sectors))
    sizes = (*part.noise, *part.start, *(size for _, size in part.disturbances), *inputs)
    need(min(sizes, default=Fraction(0)) >= 0, "noise, start, sizes of disturbances and inputs must be 0 or more")
    return PlantGuarantee(
        part=part,
        law=law,
        pieces=raw["pieces"],
        inputs=inputs,
        claims=PlantClaims(**claims),
    )


def _matrix(raw: Any, name: str, width: int | None = None, height: int | None = None) -> Matrix:
    rows = listed(raw, name, _MOST_LAW_STATES, height)
    return tuple(read_row(row, name, _MOST_LAW_STATES, width) for row in rows)


def _read_part(raw: Any) -> LinearPart:
    given = with_keys(raw, set(_PLANT))
    A = _matrix(given["A"], "A")
    n = len(A)
    B = _matrix(given["B"], "B", height=n)
    need(1 <= n <= MOST and bool(B[0]), f"1 to {MOST} states, and a control")
    m = len(B[0])
    need(all(len(row) == n for row in A) and all(len(row) == m for row in B), "A and B must fit")
    C = _matrix(given["C"], "C", width=n)
    disturbances = []
    for one in listed(given["disturbances"], "disturbances", MOST):
        with_keys(one, {"entry", "size"})
        disturbances.append((read_row(one["entry"], "entry", length=n), read_rational(one["size"])))
    loads = []
    for one in listed(given["loads"], "loads", MOST):
        with_keys(one, {"control", "shift", "rate"})
        shift = read_row(one["shift"], "shift", length=n)
        load = SlowLoad(
            control=read_row(one["control"], "control", length=m), shift=shift, rate=read_rational(one["rate"])
        )
        seen = any(sum((c * s for c, s in zip(row, shift, strict=True)), Fraction(0)) for row in C)
        need(load.rate >= 0 and not seen, "a load must have a rate of 0 or more and a shift that is not measured")
        loads.append(load)
    return LinearPart(
        A=A,
        B=B,
        C=C,
        disturbances=tuple(disturbances),
        loads=tuple(loads),
        sectors=tuple(_read_sector(one, n, m) for one in listed(given["sectors"], "sectors", MOST)),
        noise=read_row(given["noise"], "noise", length=len(C)),
        start=read_row(given["start"], "start", length=n),
        outputs=_matrix(given["outputs"], "outputs", width=n),
    )


def _read_sector(raw: Any, n: int, m: int) -> ExactSector:
    bounded = {"within"} & set(raw) if isinstance(raw, dict) else set[str]()
    with_keys(raw, {"entry", "row", "slopes"} | bounded)
    sector = ExactSector(
        entry=read_row(raw["entry"], "entry", length=n),
        row=read_row(raw["row"], "row", length=n + m),
        slopes=read_ends(raw["slopes"], "slopes"),
        within=read_rational(raw["within"]) if bounded else None,
    )
    need(sector.slopes[0] <= sector.slopes[1], "slopes must be in order")
    need(not bounded or (sector.within or 0) > 0, "a bound of a sector must be positive")
    need(not bounded or not any(sector.row[n:]), "a sector that holds up to a bound must be of the states alone")
    return sector


def _read_law(raw: Any) -> MatrixLaw:
    given = with_keys(raw, set(_LAW))
    A = _matrix(given["A"], "A of the law")
    return MatrixLaw(
        step=read_rational(given["step"]),
        delay=read_rational(given["delay"]),
        update=A,
        measured=_matrix(given["B"], "B of the law", height=len(A)),
        output=_matrix(given["C"], "C of the law"),
        feedback=_matrix(given["D"], "D of the law"),
    )


def named(claim: PlantGuarantee, plant: "UncertainPlant") -> PlantGuarantee:
    """A claim with the names and units of its plant, for people."""
    outputs, controls, units = tuple(plant.outputs or ()), tuple(plant.controls), plant.units
    told = tuple(units.get(name, "") for name in (*outputs, *controls, *plant.disturbances)) if units else ()
    return replace(claim, outputs=outputs, controls=controls, units=told, name=plant.name, remarks=plant.remarks)
