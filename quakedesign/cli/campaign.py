"""The command that runs many samples of one closed loop."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from quakedesign.cli.hardware import ActuatorOptions, SensorOptions, surroundings
from quakedesign.cli.option_values import Metres, MetresPerSecond, Whole
from quakedesign.cli.options import PLAIN, Box, FaultName, Force, Formats, LawOptions, Output, RunOptions, Scheduler
from quakedesign.cli.shared import app, console, progress
from quakedesign.cli.state import SpreadOptions
from quakedesign.errors import ParameterError
from quakedesign.interruption import remedy
from quakedesign.output import hold

if TYPE_CHECKING:
    from quakedesign.simulation.campaign import Campaign, Problem

_DIRECT, _EXACT, _LAW, _USUAL = ActuatorOptions(), SensorOptions(), LawOptions(), RunOptions()
_SAME = SpreadOptions()


@app.command
def campaign(
    fault: FaultName,
    /,
    *,
    samples: Whole,
    law: LawOptions = _LAW,
    run: RunOptions = _USUAL,
    box: Box = None,
    actuator: ActuatorOptions = _DIRECT,
    sensors: SensorOptions = _EXACT,
    initial_slip: Metres = 0.0,
    initial_rate: MetresPerSecond = 0.0,
    state: SpreadOptions = _SAME,
    seed: Whole = 0,
    search: str | None = None,
    rerun: str | None = None,
    workers: Whole | None = None,
    scheduler: Scheduler = None,
    out: Path | None = None,
    format: Formats = ("png",),
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Run many samples over the uncertainty box, disturbances, noise and initial states, and report how bad they get.

    Every batch that is done is kept in the folder: interrupted or killed, the same command goes on and gives the same
    answer. Exit code 0 if all samples have a result (one that diverges has), 1 if a batch failed. Quantities have a
    unit, as '20 MPa', or are bare numbers in SI units.

    Parameters
    ----------
    samples
        Number of samples.
    initial_slip
        Largest slip at the start.
    initial_rate
        Largest slip rate at the start.
    seed
        Of samples and noise.
    search
        Metric whose worst value is searched for, such as max_slip_rate_error.
    rerun
        Index of a sample to run again and store as NetCDF in the folder.
    workers
        Number of processes; one per core unless given.
    out
        Folder; ./quakedesign-FAULT-campaign unless given.
    """
    from quakedesign.fault import load_fault
    from quakedesign.report.figure_files import figure_bytes
    from quakedesign.simulation.campaign import campaign_problem, run_campaign
    from quakedesign.simulation.run import sampled_scheme

    if rerun is not None and rerun.isdecimal() and int(rerun) >= samples:
        raise ParameterError(f"rerun must be an index below {samples}, or search-N. Received {rerun}.")
    loaded = load_fault(fault, box=box)
    chosen, told = state.choose(loaded, law, run.step, actuator.path())
    controller = chosen.controller if chosen else None
    way, step, own = run.way(controller)
    period = loaded.sampling_time if step is None else step
    around = surroundings(None if loaded.friction.state_names else chosen, period, run, actuator, sensors, 0)
    problem = campaign_problem(
        loaded,
        controller,
        scheme=sampled_scheme(way, *around, **own),
        step=step,
        method=run.method,
        duration=run.duration,
        plant=run.plant,
        load=run.load(),
        initial_slip=initial_slip,
        initial_slip_rate=initial_rate,
        seed=seed,
        **told,
    )
    folder = out or Path(f"quakedesign-{loaded.name}-campaign")
    hold(folder, make=True)
    options: dict[str, Any] = {"workers": workers, "scheduler": scheduler, "metric": search, "renew": force}
    remedy(f"the same command goes on from {folder}")
    with progress() as tell:
        done = run_campaign(problem, samples, folder, tell=tell, **options)
        drawn = done.plot()
        done.save(folder, {f"distribution.{kind}": figure_bytes(drawn, kind, "distribution") for kind in format})
        answer = done.to_dict() | _again(done, rerun, folder)
    output.show(answer, lambda: _print(problem, done, answer, f"{folder}/ ({_written(answer, format)})"))
    return 1 if done.failures else 0


def _again(done: "Campaign", index: str | None, folder: Path) -> dict[str, Any]:
    """Run one sample again and store it."""
    if index is None:
        return {}
    run = done.trajectory(int(index) if index.isdecimal() else index)
    path = run.save(folder / f"sample-{index}.nc")
    told = {"outcome": run.outcome.to_dict(), "metrics": run.metrics.to_dict(), "events": dict(run.events)}
    return {"rerun": {"index": index, "file": str(path), **told}}


def _print(problem: "Problem", done: "Campaign", answer: dict[str, Any], written: str) -> None:
    from rich.table import Table

    from quakedesign.simulation.metrics import StickMetrics

    out = console()
    happened = ", ".join(f"{len(indices)} {name.replace('_', ' ')}" for name, indices in done.events.items() if indices)
    law = problem.controller.title if problem.controller else "no control"
    out.print(f"{problem.fault.name}, {law}: {answer['samples']} samples, {answer['resumed']} of them from files")
    came_to = ", ".join(f"{len(indices)} {kind}" for kind, indices in done.kinds.items() if indices)
    out.print(f"outcomes (samples): {came_to or 'none'}")
    out.print(f"events (samples): {happened or 'none'}")
    levels = ("0.05", "0.5", "0.95", "1")
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    for column in ("metric", "unit", "5 %", "50 %", "95 %", "worst", "samples"):
        table.add_column(column, no_wrap=column != "samples")
    for name, quantiles in answer["quantiles"].items():
        values = ("diverges" if quantiles[level] is None else f"{quantiles[level]:.2g}" for level in levels)
        worst = ", ".join(str(entry["index"]) for entry in answer["worst"][name][:3])
        table.add_row(name, StickMetrics.unit(name) or "-", *values, worst)
    out.print(table, soft_wrap=False)
    for told in (answer["search"],) if answer["search"] else ():
        value = "diverges" if told["value"] is None else f"{told['value']:.6g} {StickMetrics.unit(told['metric'])}"
        out.print(f"search: {told['metric']} = {value} in {told['index']} of {told['looked_at']} samples")
    for failure in answer["failures"]:
        span = f"{failure['samples'][0]} … {failure['samples'][-1]}"
        out.print(f"failed: samples {span}: {failure['reason']}")
    out.print(f"written: {written}")


def _written(answer: dict[str, Any], formats: Sequence[str]) -> str:
    """Names of the files in the folder."""
    from quakedesign.report.figure_files import file_names

    again = [Path(answer["rerun"]["file"]).name] if "rerun" in answer else []
    return ", ".join(["results.json", "samples.csv", file_names("distribution", formats), *again])
