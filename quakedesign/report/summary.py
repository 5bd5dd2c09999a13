"""Summary of a comparison for terminal and report: main result in a sentence, a table, and notes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isnan
from textwrap import wrap
from typing import TYPE_CHECKING

from quakedesign.exact import Bound, UpperBound
from quakedesign.fault.fault_toml import mean_rate, rate_out_of_range
from quakedesign.report.sentences import cycle_sentences, grade, left_out_lines
from quakedesign.studies.comparison import pressure_extremes
from quakedesign.studies.fault_facts import box_sentences
from quakedesign.text import PREFIXES, plain, power_of, quantity

if TYPE_CHECKING:
    from quakedesign.guarantees import FaultProof, Guarantee
    from quakedesign.simulation import Trajectory
    from quakedesign.studies.comparison import Compared, Entry

WIDTH = 80
_NAME, _OUTCOME, _NUMBERS, _PRESSURE = 17, 10, (7, 6, 6), 15
Number = Bound | float | None


@dataclass(frozen=True, kw_only=True)
class Row:
    """Proved bounds, worst case found and simulated values of one controller."""

    name: str
    outcome: str
    # slip_rate, slip: Proved bound, worst case found, and largest value of the run, for slip rate [m/s] and slip error
    # [m]; None where there is no such value
    slip_rate: tuple[Number, Number, Number]
    slip: tuple[Number, Number, Number]
    pressure: tuple[Bound | float, Bound | float] | None  # Range [Pa]: the proved one, or that of the run


@dataclass(frozen=True, kw_only=True)
class Summary:
    """First part of the text of a comparison."""

    guarantee: str  # Main sentence: guarantee relative to the natural earthquake
    rows: tuple[Row, ...]
    conditions: str  # Sentence of this guarantee, or the reason why there is none
    notes: tuple[str, ...]  # Limitations of the guarantee


def summary(comparison: "Compared") -> Summary:
    """Main sentence, table and notes of a comparison."""
    designed = comparison.of("designed")
    proved = [(bool(e.design.other_step), e.proof.peak_slip_rate, e) for e in designed if e.proof]
    best = min(proved, key=lambda one: one[:2])[2] if proved else None
    rows = [_uncontrolled(comparison.uncontrolled), *map(_row, (*designed, *comparison.of("published")))]
    return Summary(
        guarantee=_first_sentence(comparison, best),
        rows=tuple(rows),
        conditions=_conditions(designed, best),
        notes=tuple(_notes(comparison, best)),
    )


def _first_sentence(comparison: "Compared", best: "Entry | None") -> str:
    natural, name = comparison.uncontrolled, comparison.fault.name
    if best is None or best.proof is None:
        kinds = " or ".join(dict.fromkeys(e.kind for e in comparison.of("designed"))) or "designed"
        return f"{name}: no guarantee for any {kinds} controller"
    earthquake = natural.outcome.peak_slip_rate if natural.outcome.kind == "earthquake" else None
    first = best.design.other_step_first or "guaranteed"
    magnitude = comparison.fault.magnitude
    return guaranteed_sentence(f"{name}: {first}", best.proof, earthquake, magnitude, f"with the {best.label}")


def guaranteed_sentence(
    first: str, proof: "FaultProof", earthquake: float | None, magnitude: float, law: str = ""
) -> str:
    """The guarantee in a sentence, relative to slip rate [m/s] and magnitude of a natural earthquake.

    The magnitude is NaN where the fault alone does not determine it.
    """
    rate, share = proof.peak_slip_rate, ""
    if earthquake:
        ratio = UpperBound(100 * Fraction(rate) / Fraction(earthquake))
        size = "" if isnan(magnitude) else f", magnitude {magnitude:.1f}"
        share = f" ({ratio:.2g} % of the natural earthquake's {quantity(earthquake, 'm/s')}{size})"
    under = ", ".join(filter(None, (proof.scope, law)))
    under = f"{under[:1].upper()}{under[1:]}{',' if proof.scope else ''} the" if under else "The"
    return (
        f"{first}. {under} slip rate never exceeds {rate.quantity('m/s')}{share}{proof.motion}, and the slip stays "
        f"within {proof.claims.slip_error.quantity('m')} of the reference{proof.task.course}"
    )


def _conditions(designed: Sequence["Entry"], best: "Entry | None") -> str:
    if best is not None and best.proof is not None:
        return f"{best.label}, proved: {best.proof.sentence()}"
    reasons = (e.guarantee.lines()[0] if e.guarantee else str(e.design.details.get("reason", "")) for e in designed)
    return "; ".join(f"{e.label}: {reason or 'undecided'}" for e, reason in zip(designed, reasons, strict=True))


def _uncontrolled(run: "Trajectory") -> Row:
    peak = run.outcome.peak_slip_rate
    return Row(
        name="uncontrolled",
        outcome=run.outcome.kind,
        slip_rate=(None, None, peak),
        slip=(None, None, None),
        pressure=pressure_extremes(run),
    )


def _row(entry: "Entry") -> Row:
    proof, run = entry.proof, entry.run
    worst = entry.guarantee.worst if entry.guarantee else None
    seen = pressure_extremes(run) if run else None
    pressure: tuple[Bound | float, Bound | float] | None = proof.valve_pressures if proof else seen
    label = entry.label.removesuffix(" (designed)").removesuffix(" (given)").replace(" (published)", " published")
    return Row(
        name=label,
        outcome=run.outcome.kind if run else "not run",
        slip_rate=(
            proof.peak_slip_rate if proof else None,
            worst.peak_slip_rate if worst else None,  # None if the falsification searched the errors only
            run.outcome.peak_slip_rate if run else None,
        ),
        slip=(
            proof.claims.slip_error if proof else None,
            None if worst is None else worst.slip_error,
            run.metrics.max_slip_error if run else None,
        ),
        pressure=pressure,
    )


def _notes(comparison: "Compared", best: "Entry | None") -> Iterator[str]:
    fault, designed = comparison.fault, comparison.of("designed")
    if fault.source.startswith("poor fit accepted"):
        yield f"{fault.source}"
    yield from cycle_sentences(comparison)
    yield from (f"assumed: {text}" for text in fault.assumed)
    if beyond := rate_out_of_range(fault.friction, mean_rate(fault.reference)):
        yield beyond
    if best is not None:
        yield from box_sentences(fault)
        yield "model: one block under a uniform pressure"
    for entry in designed:
        if (entry.proof is None and best is not None) or ", but " in grade(entry):
            unproved = entry.given and entry.guarantee is not None and entry.proof is None
            yield f"{entry.label}: {entry.guarantee.lines()[0] if unproved and entry.guarantee else grade(entry)}"
        if assumed := entry.design.details.get("assumed"):
            yield f"{entry.label} assumes {assumed}"
    others = [(e.design.title, e.proof.scope) for e in designed if e.proof and e.proof.scope]
    if others and best is not None and best.proof is not None and not best.proof.scope:
        yield f"{', '.join(title for title, _ in others)}: proved {others[0][1]}"
    yield from _equal_bounds(designed)
    published: dict[str, list[str]] = {}
    for entry in comparison.of("published"):
        published.setdefault(_published(grade(entry)), []).append(entry.design.title)
    yield from (f"{', '.join(names)} (published): {text}" for text, names in published.items())
    if any(e.run is not None and e.run.provenance["scheme"] == "continuous" for e in comparison.of("published")):
        yield "runs of published gains are in continuous time, without zero-order hold"
    yield from left_out_lines(comparison)
    if best is not None and best.guarantee is not None:
        yield from _with_stick(best.guarantee)
        yield from best.guarantee.limit_lines()


def _with_stick(guarantee: "Guarantee") -> Iterator[str]:
    """Worst case found on the stick–slip plant, why there is no proof on it, and the limits of the search."""
    seen, why = guarantee.worst_with_stick, guarantee.not_at_rest
    if seen is not None:
        yield (
            f"worst case found on the stick-slip plant: slip error {quantity(seen.slip_error, 'm')}, slip-rate error "
            f"{quantity(seen.slip_rate_error or 0.0, 'm/s')}{f'; no proof there: {why}' if why else ''}"
        )
    if guarantee.stick_slip_gap:
        yield guarantee.stick_slip_gap


def _published(verdict: str) -> str:
    """Verdict on published gains, without the names of failed premises, which the report explains."""
    if not verdict.startswith("proved, but "):
        return verdict
    missing = verdict.removeprefix("proved, but ").split("; ")
    others = [part for part in missing if " fails" not in part]
    verdict = "; ".join(["", *others]).replace("UNSTABLE", "unstable")
    violated = ", and this task violates its conditions" if len(others) < len(missing) else ""
    return f"not proved here: the proof is for continuous time{violated}{verdict}"


def _equal_bounds(designed: Sequence["Entry"]) -> Iterator[str]:
    """Reason why two sliding modes have the same bounds."""
    sliding = [(e, e.proof, e.guarantee.compensation) for e in designed if e.guarantee and e.guarantee.compensation]
    same = [entry for entry, proof, law in sliding if proof and law.deadbeat]
    if len(same) > 1 and len({str(proof.claims) for _, proof, law in sliding if proof and law.deadbeat}) == 1:
        names = " and ".join(entry.design.title for entry in same)
        yield (
            f"{names} act identically in this loop: within the proved errors both compute the same pressures; in "
            "continuous time (--continuous) they differ"
        )


# ----------------------------------------------------------------------
# The table with units in its cells, for pages.

_NUMBERED = (f"{of} {kind}" for of in ("slip rate", "slip error") for kind in ("proved", "worst case found", "run"))
SUMMARY_COLUMNS = ("controller", "outcome", *_NUMBERED, "pressure")


def summary_cells(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    """Cells under `SUMMARY_COLUMNS`."""

    def shown(value: Number, unit: str) -> str:
        return "–" if value is None else value.quantity(unit) if isinstance(value, Bound) else quantity(value, unit)

    cells = []
    for row in rows:
        numbers = [shown(value, "m/s") for value in row.slip_rate] + [shown(value, "m") for value in row.slip]
        cells.append((row.name, row.outcome, *numbers, _range(row)))
    return cells


def _range(row: Row) -> str:
    """Range of the pressure of a row, with a common unit."""
    if row.pressure is None:
        return "–"
    power = power_of(max(abs(float(end)) for end in row.pressure))
    return f"{' … '.join(_cell(end, power, coarse=True) for end in row.pressure)} {PREFIXES[power]}Pa"


# ----------------------------------------------------------------------
# The summary on a terminal of 80 columns.


LEGEND = (
    "worst: worst case found; pressure (p < 0: withdrawal): proved, else simulated",
    "tracked: slip error <= 2 % of target, rate <= reference + 1 % of natural peak",
)
_LAWS = "2-CTA, 2-DIA: sliding modes; e-LQR: feedback with disturbance estimate"


def summary_lines(first: Summary) -> list[str]:
    """Lines of at most 80 characters."""
    lines = [*wrap(f"{first.guarantee}.", WIDTH), "", *_table(first.rows), *LEGEND]
    lines += [_LAWS, ""] if any(row.name.startswith("2-") for row in first.rows) else [""]
    lines += wrap(first.conditions, WIDTH, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    for note in first.notes:
        lines += wrap(note, WIDTH, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    return lines


def _table(rows: Sequence[Row]) -> list[str]:
    rates, slips = (_scale([getattr(row, name) for row in rows]) for name in ("slip_rate", "slip"))
    power = power_of(max((abs(float(end)) for row in rows if row.pressure for end in row.pressure), default=0.0))
    wide = sum(_NUMBERS)
    heads = (f"slip rate [{PREFIXES[rates]}m/s]", f"slip error [{PREFIXES[slips]}m]", "pressure")
    first = f"{'':{_NAME + _OUTCOME}}{heads[0]:>{wide}}{heads[1]:>{wide}}{heads[2]:>{_PRESSURE}}"
    columns = "".join(f"{head:>{width}}" for head, width in zip(("proved", "worst", "run"), _NUMBERS, strict=True))
    second = f"{'controller':{_NAME}}{'outcome':{_OUTCOME}}{columns}{columns}{f'[{PREFIXES[power]}Pa]':>{_PRESSURE}}"
    lines = [first, second]
    for row in rows:
        ends = "–" if row.pressure is None else " … ".join(_cell(end, power, coarse=True) for end in row.pressure)
        numbers = _cells(row.slip_rate, rates, "m/s") + _cells(row.slip, slips, "m")
        if len(row.name) >= _NAME:
            lines.append(row.name)
        name = row.name if len(row.name) < _NAME else ""
        lines.append(f"{name:{_NAME}}{row.outcome:{_OUTCOME}}{numbers}{ends:>{_PRESSURE}}")
    return [line.rstrip() for line in lines]


def _scale(groups: Sequence[Sequence[Number]]) -> int:
    """Power of ten for the proved bounds or, without any, for the simulated values under control."""
    proved = [float(group[0]) for group in groups if group[0] is not None]
    seen = [float(group[2]) for group in groups[1:] if group[2] is not None]
    return power_of(max(proved, default=max(seen, default=0.0)))


def _cells(group: Sequence[Number], power: int, unit: str) -> str:
    """Three cells; if there is a single number and it is too wide, it has its own unit."""
    numbers = [value for value in group if value is not None]
    if len(numbers) == 1 and len(_cell(numbers[0], power)) >= _NUMBERS[-1]:
        return f"{quantity(float(numbers[0]), unit):>{sum(_NUMBERS)}}"
    return "".join(f"{_fitted(value, power, width):>{width}}" for value, width in zip(group, _NUMBERS, strict=True))


def _fitted(value: Number, power: int, width: int) -> str:
    """Number in three digits, or in fewer if otherwise no blank precedes it."""
    shown = (_cell(value, power, digits) for digits in (3, 2, 1))
    return next((cell for cell in shown if len(cell) < width), "–" if value is None else f"{_scaled(value, power):.0e}")


def _scaled(value: Bound | float, power: int) -> Bound | float:
    """Number divided by a power of ten; a bound remains a bound."""
    if isinstance(value, Bound):
        return type(value)(value / Fraction(10) ** power)
    return float(value / 10.0**power)


def _cell(value: Number, power: int, digits: int = 3, *, coarse: bool = False) -> str:
    if value is None:
        return "–"
    scaled = _scaled(value, power)
    if isinstance(scaled, Bound):
        return plain(float(format(scaled, f".{digits}g")), digits)
    return plain(round(scaled, 3) if coarse else scaled, digits)
