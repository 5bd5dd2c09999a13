"""Comparisons, runs, scaled gains and exported controllers on a terminal."""

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from quakedesign.errors import ParameterError
from quakedesign.files import Json
from quakedesign.report.comparison_table import Comparison
from quakedesign.report.sentences import (
    FEEDFORWARD_COLUMNS,
    cycle_sentences,
    domain_sentence,
    feedforward_rows,
    grade,
    guarantee_lines,
    headline,
    left_out_lines,
    remarks,
    run_sentences,
    scheme_sentence,
    without_stated_reason,
)
from quakedesign.report.summary import summary, summary_lines
from quakedesign.report.tables import COLUMNS, rows
from quakedesign.studies.fault_facts import fault_sentences
from quakedesign.studies.scaling import SCALED

if TYPE_CHECKING:
    from quakedesign.fault import Fault
    from quakedesign.lyapunov.exact.premises import Premise
    from quakedesign.simulation import Trajectory
    from quakedesign.studies.comparison import Entry


def print_comparison(comparison: Comparison, console: Console, *, whole: bool = True) -> None:
    """Print the summary; with `whole` also fault, gains, verdicts with premises, and tables."""
    for line in summary_lines(summary(comparison)):
        console.print(line)
    if not whole:
        return
    console.print()
    console.print(comparison.fault.name, style="bold", end=" ")
    console.print(f"({comparison.fault.source})")
    for entry in comparison.of("designed"):
        console.print(f"  {entry.label}: {grade(entry)}")
    console.print()
    for line in fault_sentences(comparison.fault):
        console.print(f"  {line}")
    for line in cycle_sentences(comparison)[:1]:
        console.print(f"  {line}")
    for line in left_out_lines(comparison):
        console.print(f"  {line}")
    entries = (*comparison.of("designed"), *comparison.of("published"))
    for entry in entries:
        console.print()
        console.print(f"{entry.label}:", style="bold")
        for line in _whole(entry):
            console.print(f"  {line}")
        if entry.variants:
            columns = zip(FEEDFORWARD_COLUMNS, (None,) * len(FEEDFORWARD_COLUMNS), "lrrrr", strict=True)
            console.print(table(columns, feedforward_rows(entry.variants), indent=2))
    console.print()
    console.print("closed loop", style="bold", end=", ")
    console.print("errors after a quarter of the run; p < 0 is withdrawal")
    numbers = zip(COLUMNS, (17, 8, 8, 9, 9, 8, 8, 4), "lrrrrrrr", strict=True)
    console.print(table(numbers, rows(comparison)), soft_wrap=False)
    console.print(f"{scheme_sentence(comparison)}.")


def _whole(entry: "Entry") -> list[str]:
    """All statements about a controller as lines of text."""
    others = [premise for premise in entry.design.premises if premise not in entry.design.conditions]
    return [
        *guarantee_lines(entry),
        *without_stated_reason([headline(entry), *remarks(entry)], entry),
        _gains(entry),
        *map(_line, entry.design.conditions),
        *(["premises of the certificate of its base gains, in continuous time:"] if others else []),
        *map(_line, others),
        *([domain_sentence(entry.design.domain)] if entry.design.domain is not None else []),
    ]


_OF_SLIDING = (
    "; pressure [Pa] per unit of the measured slip error (k1) and slip-rate error (k2: unused), and per unit of the "
    "scaled predictions of the law: slip error, friction state, diffusion modes, and level of the unknown disturbance"
)


def _gains(entry: "Entry") -> str:
    law = entry.design.controller
    units = law.gain_units if law and entry.design.sliding else {}
    gains = ", ".join(
        f"{name} = {float(v):.6g} {units.get(name, '')}".rstrip() for name, v in entry.design.gains.items()
    )
    return f"gains: {gains or 'none'}{_OF_SLIDING if units else ''}"


def table(columns: Iterable[tuple[str, int | None, str]], rows: Iterable[Sequence[str]], indent: int = 0) -> Table:
    """Table from heading, width and alignment (l or r) of each column; within 80 characters no number is cut."""
    made = Table(box=None, pad_edge=False, padding=(0, 1, 0, indent))
    for heading, width, side in columns:
        made.add_column(heading, justify="left" if side == "l" else "right", width=width)
    for row in rows:
        made.add_row(*row)
    return made


def _line(premise: "Premise") -> str:
    required, certified = premise.sides
    if not premise.proved and premise.certified == 0:
        return f"premise {premise.name}: nothing is certified, required {required} ({premise.note})"
    ratio = "nothing is certified" if premise.ratio is None else f"ratio {premise.ratio:.3g}"
    sign = "holds" if premise.holds else "FAILS"
    return f"premise {premise.name} {sign}: required {required}, certified {certified}, {ratio}"


def print_run(run: "Trajectory", fault: "Fault", premises: "Sequence[Premise]", console: Console) -> None:
    """Print outcome, pressure, metrics with units, events and premises of one run."""
    console.print(run.name, style="bold")
    for sentence in run_sentences(run, fault):
        console.print(f"  {sentence}")
    if "longest_interval" in run.provenance:
        soonest, latest = (run.provenance[f"{end}_interval"] for end in ("shortest", "longest"))
        console.print(f"  aperiodic sampling: intervals of {soonest:.4g} s to {latest:.4g} s, drawn at random")
    elif run.provenance["controller"] != "none" and run.provenance["step"] != fault.sampling_time:
        console.print(f"  steps of {run.provenance['step']:.4g} s, not the fault's T_s = {fault.sampling_time:g} s")
    numbers = run.metrics.to_dict()
    if numbers["settled_from"] is not None:
        console.print(f"  errors evaluated from {numbers['settled_from']:.6g} s on")
    for name, number in numbers.items():
        if number is not None:
            console.print(f"  {name} = {number + 0.0:.6g} {run.metrics.unit(name)}".rstrip())
    for name, time in run.events.items():
        console.print(f"  {name} first at {time:.6g} s")
    for premise in premises:
        console.print(f"  {_line(premise)}")


LABORATORY = (
    "no comparison with printed numbers: the paper simulates real-fault only;",
    "  its figures 9 to 12 show experiments on the laboratory fault",
)


def printed_lines(rows: list[Json], fault: str = "") -> list[str]:
    """Numbers printed in the paper and computed numbers, with the plant; empty if the paper has none for the fault."""
    if not rows:
        return ["", *LABORATORY] if fault == "lab-fault" else []
    sticks = any(row["plant"] == "stick-slip" for row in rows)
    plant = " on the stick–slip plant (--plant printed simulates the paper's plant)" if sticks else ""
    return ["", f"printed in the paper, and computed here{plant}:"] + [
        f"  {row['run']}, {row['metric']}: {row['printed']:.3g} {row['unit']} printed ({row['place']}), "
        f"{row['found']:.3g} computed, ratio {row['ratio']:.3g}. {row['note']}"
        if row["ratio"] is not None
        else f"  {row['run']}, {row['metric']}: {row['printed']:.3g} printed ({row['place']}), no run to compare with"
        for row in rows
    ]


# ----------------------------------------------------------------------
# Scaled gains as lines of text.

_THREE_DIGITS = 0.005
_KEYS = {"scale_factors", "title", "from", "to", "source_gains", "gains", "published", "exponents", "unrounded"}


def scale_lines(result: Mapping[str, Any]) -> list[str]:
    """Result of `scale_answer` as lines of text; `ParameterError` for any other result."""
    if lacking := _KEYS - result.keys():
        raise ParameterError(f"result must be that of scale_answer. Received one without {', '.join(sorted(lacking))}.")
    factors = ", ".join(f"{SCALED[n][0]} = {_short(v)}" for n, v in result["scale_factors"].items())
    lines = [f"{result['title']}: {result['from']} → {result['to']}"]
    lines += _gain_lines(result["source_gains"], result["gains"], result["published"], result["exponents"])
    if "divisor" in result:
        same = result["divisor"] == result["source_divisor"]
        before = "" if same else f" (source: {_short(result['source_divisor'])})"
        lines.append(f"with λ = {_short(result['scale'])} and divisor μ0N̂0 = {_short(result['divisor'])} m²/kg{before}")
    if _rounded(result["published"]):
        lines.append("deviations from printed gains are due to their rounding for print (ERRATA 25)")
    if result["unrounded"]:
        more = result["unrounded"]
        lines.append("from the laboratory gains before they were rounded for print (ERRATA 25):")
        lines += _gain_lines(more["source_gains"], more["gains"], more["published"], result["exponents"])
    lines.append(f"scale factors: {factors}")
    return [*lines, *_similarity_lines(result)]


def _rounded(printed: Mapping[str, Any] | None) -> bool:
    """Whether printed gains differ from computed ones, but by no more than rounding to three digits."""
    off = [abs(e["deviation"]) for e in (printed or {}).values() if not e["agrees"] and e["deviation"] is not None]
    return bool(off) and max(off) < _THREE_DIGITS


def _gain_lines(
    before: Mapping[str, str], after: Mapping[str, str], printed: Mapping[str, Any] | None, exponents: Mapping[str, str]
) -> list[str]:
    def comment(name: str) -> str:
        if not printed:
            return ""
        entry = printed[name]
        off = (
            ""
            if entry["agrees"] or entry["deviation"] is None
            else f", deviation {100 * abs(entry['deviation']):.2g} %"
        )
        return f"; printed {entry['printed']}{off}"

    return [f"  {n} = {_short(after[n])} from {_short(before[n])} ({exponents[n]}{comment(n)})" for n in after]


def _similarity_lines(result: Mapping[str, Any]) -> list[str]:
    percent = float(Fraction(result["tolerance"])) * 100
    far = [g for g in result["differing"] if g["group"] in result["violations"]]
    if result["similar"]:
        if not result["differing"]:
            return ["similar exactly: every π-group has the same value"]
        worst = max(abs(group["ratio"] - 1) for group in result["differing"])
        count = len(result["differing"])
        return [f"similar within {percent:g} %: {count} π-groups differ, by at most {100 * worst:.2g} %"]
    lines = [f"NOT similar within {percent:g} %: neither loop is a scaled copy of the other, as these π-groups differ:"]
    lines += [f"  {g['formula']}: {_short(g['source'])} and {_short(g['target'])}{_ratio(g)}" for g in far]
    return lines + [f"  {name} is not the same quantity in both faults" for name in result["unmatched"]]


def _ratio(group: Mapping[str, Any]) -> str:
    return "" if group["ratio"] is None else f", ratio {group['ratio']:.6g}"


def _short(text: str) -> str:
    return f"{float(Fraction(text)):.6g}"


def export_lines(result: Json) -> list[str]:
    """Result of `export_result` as lines of text."""
    measured = ", ".join(f"{name} [{unit}]" for name, unit in result["measurement"].items())
    lines = [
        *result["remarks"],
        f"written: {', '.join(result['files'])}",
        f"every {result['step']:g} s: inputs {measured}; output pressure [Pa]",
    ]
    lines += [f"  {name}: {value}" for name, value in result["facts"].items()]
    lines += [
        f"premise {p['name']} {'holds' if p['holds'] else 'FAILS'}: required {p['required']:.4g} {p['unit']}, "
        f"certified {p['certified']:.4g} {p['unit']}; {p['note']}"
        for p in result["premises"]
    ]
    return lines
