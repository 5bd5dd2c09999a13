"""The laboratory experiment of the paper under conditions that it does not print: table and figures of the docs.

Run with ``python benchmarks/laboratory.py FOLDER [conditions|whole|runs|guaranteed]``; an hour on one core. Findings go
to FOLDER/findings.jsonl as they come. The numbers are the same in every run on one machine.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import json
import sys
from dataclasses import asdict, replace
from pathlib import Path

from quakedesign.guarantees import Guarantee
from quakedesign.laws import published
from quakedesign.report.laboratory_figure import conditions_figure, runs_figure
from quakedesign.studies.laboratory import (
    Apparatus,
    LaboratoryFinding,
    as_proved,
    conditions,
    explain,
    guaranteed_in,
    guaranteed_problem,
    guarantees,
)

DURATION = 600.0  # s, in which friction weakens most steeply: its slope is still 0.86 of the first one at the end
WHOLE = ("stick, quick λ_d, as printed", "apparatus")
TITLE = "Published laboratory gains under conditions that the paper does not print"


def keep(folder: Path, findings: list[LaboratoryFinding]) -> None:
    """Print findings, and write them one a line."""
    with (folder / "findings.jsonl").open("a", encoding="utf-8") as file:
        for found in findings:
            print(told(found), flush=True)
            file.write(json.dumps(asdict(found)) + "\n")


def told(found: LaboratoryFinding) -> str:
    """Row of a table: median (least to largest)."""
    kinds = ", ".join(f"{count} {kind}" for kind, count in found.outcomes.items() if count)
    sizes = found.slip_error, found.peak_slip_rate, found.rms_pressure
    numbers = " | ".join(f"{middle:.2g} ({low:.2g} to {high:.2g})" for low, middle, high in sizes)
    return f"| {found.condition} | {found.law} | {kinds} | {numbers} |"


def all_conditions(folder: Path) -> None:
    """Campaign of every condition and law, sixteen specimens each, and their figure."""
    findings = explain(conditions(), duration=DURATION, tell=lambda found: keep(folder, [found]))
    note = (
        f"first {DURATION:g} s of the task; median and range of 16 specimens; an error beyond the axis is at its edge"
    )
    conditions_figure(findings, TITLE, note).savefig(folder / "laboratory-conditions.png")


def whole(folder: Path) -> None:
    """Some of them over the whole task."""
    explain({name: conditions()[name] for name in WHOLE}, tell=lambda found: keep(folder, [whole_task(found)]))


def whole_task(found: LaboratoryFinding) -> LaboratoryFinding:
    """Finding whose condition says that it is about the whole task."""
    return replace(found, condition=f"{found.condition}, one hour")


def runs(folder: Path) -> None:
    """One specimen over the whole task, in what is printed, with stick, and in the apparatus."""
    stick, drawn = replace(Apparatus.printed(), stick=1), {}
    proof = guarantees()["1 ms late, lag 1 ms, readings off by 500 nm, amplitude"].found
    assert isinstance(proof, Guarantee)
    for name, one in {"stick, λ_d = 1e-5 m/s³": stick, "apparatus, λ_d = 1e-5 m/ms³": Apparatus.known()}.items():
        problems = {law: one.problem(gains, 0) for law, gains in published("lab-fault").items()}
        if one.bound == Apparatus.known().bound:
            problems["guaranteed"] = guaranteed_problem(one, proof, 0)
        drawn[name] = {law: problem.trajectory(problem.sample(0), 4000) for law, problem in problems.items()}
    note = "one specimen; slip rates are those at the 4000 instants that are drawn, and higher in between"
    runs_figure(drawn, "The experiment in its apparatus", note).savefig(folder / "laboratory-runs.png")


def guaranteed(folder: Path) -> None:
    """What is guaranteed, and what the law does in the apparatus beyond the conditions of its proof."""
    known = Apparatus.known()
    for name, answer in guarantees().items():
        print(name, *answer.lines(), sep="\n  ", flush=True)
        if isinstance(answer.found, Guarantee):
            for where, one in (("as proved", as_proved(known, answer.found)), ("apparatus", known)):
                keep(folder, [guaranteed_in(one, answer.found, duration=DURATION, name=f"{where}: {name}")])


if __name__ == "__main__":
    where = Path(sys.argv[1])
    where.mkdir(parents=True, exist_ok=True)
    for part in sys.argv[2:] or ("conditions", "whole", "runs", "guaranteed"):
        {"conditions": all_conditions, "whole": whole, "runs": runs, "guaranteed": guaranteed}[part](where)
