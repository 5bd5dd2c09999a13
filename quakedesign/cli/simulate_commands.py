"""Commands `simulate`, `sampling`, `export` and `campaign`: runs of one closed loop."""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from quakedesign.cli.app import app, console, new_file, print_lines, progress, specified
from quakedesign.cli.options import (
    NO_STATE,
    PLAIN,
    ActuatorOptions,
    Box,
    EstimateOptions,
    FaultName,
    Force,
    Formats,
    Gains,
    LawOptions,
    Metres,
    MetresPerSecond,
    NoLawOptions,
    Output,
    RunOptions,
    Scheduler,
    Seconds,
    SensorOptions,
    SpreadOptions,
    StartOptions,
    StateOptions,
    Texts,
    Whole,
    changed_options,
    loop_elements,
    require_no_state_options,
    show_state_run,
)
from quakedesign.errors import ParameterError, require_known
from quakedesign.fault.equilibrium import by_equilibrium
from quakedesign.files import Json, lock_folder
from quakedesign.parallel import remedy

if TYPE_CHECKING:
    from quakedesign.fault import Fault
    from quakedesign.lyapunov.exact.premises import Premise
    from quakedesign.simulation import Trajectory
    from quakedesign.simulation.campaign import Campaign, CampaignProblem


# ----------------------------------------------------------------------
# Commands about one closed loop: simulate it, study the effect of sampling, export its controller.

_DIRECT, _EXACT, _MEASURED = ActuatorOptions(), SensorOptions(), EstimateOptions()
_RUN_OPTIONS = ("scheme", "plant", "drift", "perturbation", "initial_slip", "initial_slip_rate", "weight", "authority")
_NONE, _LAW, _USUAL, _REST = NoLawOptions(), LawOptions(), RunOptions(), StartOptions()


@app.command
def simulate(
    fault: FaultName,
    /,
    *,
    law: NoLawOptions = _NONE,
    run: RunOptions = _USUAL,
    start: StartOptions = _REST,
    weight: float | None = None,
    authority: float | None = None,
    actuator: ActuatorOptions = _DIRECT,
    sensors: SensorOptions = _EXACT,
    state: StateOptions = NO_STATE,
    seed: Whole = 0,
    out: Path | None = None,
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Simulate a closed loop over the whole task, or a fault without a controller.

    Give quantities with a unit, such as '20 MPa', or as numbers in SI units.

    Parameters
    ----------
    weight
        Weight of the disturbance estimate in the schemes compensated and stick-slip, above 0, at most 1.
    authority
        Nominal input gain B0 of a sampled scheme in m^2/kg; guarantee prints weight and authority of the sliding modes
        that it proves.
    seed
        Seed of noise and jitter.
    out
        NetCDF file to write; for a fault of several blocks, a folder.
    """
    options = dict(locals())
    from quakedesign.cli.block_commands import block_law, run_chain, several_blocks
    from quakedesign.fault import load_fault
    from quakedesign.report.sentences import exceeded_line, proved_line
    from quakedesign.simulation import Load
    from quakedesign.studies.single_runs import run_single

    accepted = ("duration", "out", "controller", "certificate", "plant", "drift", "stress", "stress_period", "state")
    if (blocks := several_blocks(fault, simulate, options, accepted)) is not None:
        kind = block_law(law.controller, "none", law.certificate)
        loads = specified({"stress": state.stress, "stress_period": state.stress_period})
        if free := state.free_options():
            raise ParameterError(
                "--pressure, --start, --hold and --share do not apply to several blocks. Received "
                f"{', '.join(free)}. Omit these options."
            )
        if blocks.has_state and law.controller != "none":
            raise ParameterError(
                "blocks in slow sliding run under the law of a certificate. Received --controller. Use guarantee with "
                "--out, then simulate with --certificate."
            )
        if blocks.has_state:
            from quakedesign.simulation.slow_sliding import PLANTS as SLIDING

            plant = run.plant or "quasi-dynamic"
            require_known(plant, SLIDING, "plant of rate-and-state friction")
            loads |= {"certificate": law.certificate, "loading_rate": run.drift, "inertia": SLIDING[plant]}
            return run_chain(blocks, out, force, output, duration=run.duration, **loads)
        if run.plant or run.drift is not None or loads:
            raise ParameterError(
                "--plant, --drift and --stress of several blocks need friction with a state. Received "
                f"{blocks.blocks[0].friction.name}. Omit these options."
            )
        of_law: dict[str, Any] = {"controller": kind, "certificate": law.certificate}
        return run_chain(blocks, out, force, output, duration=run.duration, **of_law)
    new_file(out, "output file", force=force)

    def run_loop(loaded_fault: "Fault") -> int:
        require_no_state_options(state, loaded_fault)
        loaded = start.task(loaded_fault)
        chosen, load = law.choose(loaded, run.step, actuator.path()), run.load()
        way, step, _ = run.way(chosen.controller if chosen else None, "continuous")
        period = loaded.sampling_time if step is None else step
        substeps, chain, sensor = loop_elements(chosen, period, run, actuator, sensors, seed)
        with progress() as bar:
            bar("compiling", 0.0)
            trajectory, premises = run_single(
                loaded,
                chosen,
                progress=lambda done: bar("simulation", done),
                duration=run.duration,
                load=load if load != Load() else None,
                step=step,
                scheme=way,
                method=run.method,
                plant=run.plant,
                substeps=substeps,
                actuator=chain,
                noise=sensor,
                initial=start.state(),
                tuning=specified({"weight": weight, "authority": authority}),
            )
        if out is not None:
            trajectory.save(out)
        proved, outside, exceeded = None, list[str](), ""
        if chosen and chosen.claim:
            changed = changed_options(simulate, options)
            proved, outside = chosen.claim.sentence(), _outside(changed, chosen.claim, trajectory.provenance["plant"])
            pressures = getattr(chosen.claim.claims, "pressures", ())
            exceeded = exceeded_line(trajectory.metrics, *pressures[-1]) if trajectory.metrics and pressures else ""
        result = _values(trajectory, loaded, premises) | {
            "guarantee": {"sentence": proved} if proved else None,
            "outside": outside,
        }
        warning = chosen.controller.warning_at_rest if chosen else ""
        output.show(
            result, lambda: _print_run(trajectory, loaded, premises, proved_line(proved, outside, exceeded), warning)
        )
        return 0

    def run_with_state(loaded_fault: "Fault") -> int:
        return show_state_run(loaded_fault, simulate, options)

    return by_equilibrium(rest=run_loop, sliding=run_with_state)(load_fault(fault))


def _outside(changed: dict[str, Any], claim: Any, plant: str) -> list[str]:
    """Options of a run, including its plant, that the proof of its law does not cover."""
    sampled, changed = claim.sampled_loop, changed | {"plant": plant}
    times = {name: float(time) for name, time in sampled.path.items()}
    starts = zip(("initial_slip", "initial_slip_rate"), map(float, sampled.initial_errors), strict=True)
    within = {name for name, most in starts if abs(changed.get(name, 0.0)) <= most}
    within |= {name for name, time in times.items() if changed.get(name) == time}
    within |= {"plant"} if plant == claim.plant else set()
    kinds: tuple[Any, ...] = (ActuatorOptions, SensorOptions)
    groups = (option.name for kind in kinds for option in fields(kind))
    return [name for name in (*_RUN_OPTIONS, *groups) if name in changed and name not in within]


def _values(trajectory: "Trajectory", fault: "Fault", premises: "Sequence[Premise]") -> Json:
    from quakedesign.simulation.earthquake import waiting
    from quakedesign.studies.comparison import shortfall

    metrics, energy = trajectory.metrics.to_dict(), trajectory.energy
    begins = waiting(trajectory, fault)
    return {
        "outcome": trajectory.outcome.to_dict(),
        "waiting": begins.to_dict() if begins else None,
        "shortfall": shortfall(trajectory, fault),
        "metrics": metrics,
        "units": {name: trajectory.metrics.unit(name) for name in metrics},
        "premises": [p.to_dict() for p in premises],
        "events": dict(trajectory.events),
        "energy": energy.to_dict() | {"relative_residual": energy.relative_residual} if energy else None,
        "steps": metrics["steps"],
        "seconds": metrics["seconds"],
        "run": dict(trajectory.provenance),
    }


def _print_run(trajectory: "Trajectory", fault: "Fault", premises: "Sequence[Premise]", *texts: str) -> None:
    from quakedesign.report.terminal import print_run

    print_run(trajectory, fault, premises, console())
    if trajectory.energy:
        error = f"{trajectory.energy.relative_residual:.2g} of the largest energy"
        print_lines([f"  energy error of the integration: {error}"])
    print_lines([f"  {line}" for line in texts if line])


@app.command
def sampling(
    fault: FaultName,
    /,
    *,
    controller: str = "cta",
    gains: Gains = ("designed",),
    scale: Texts = (),
    schemes: Texts = ("explicit", "implicit", "semi-implicit", "compensated"),
    duration: Seconds | None = None,
    out: Path | None = None,
    format: Formats = ("png",),
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Show effects of sampling on a law and on the published laws: errors by scheme, orders of accuracy, sensitivities.

    Runs are on the plant without stick. Errors are evaluated after the first quarter of a run, or of the task if that
    is shorter; for the orders of accuracy, in the second half of shorter runs. Runs with noise last 1/16 of the
    duration. Writes results.json and figures.

    Parameters
    ----------
    controller
        cta, dia or elqr.
    gains
        designed or continuous (both: designed in continuous time), published, or the numbers of the gains in SI units
        (of a sliding mode: with scale λ = 1 and control ν = p·μ_res·N̂_min, p the pressure, μ_res the residual friction
        coefficient, N̂_min the smallest A/m of the box).
    scale
        Further values of λ for a sliding mode, decimal or p/q.
    schemes
        Schemes of the runs of the law; published laws run in continuous, explicit and compensated.
    duration
        Duration of the runs, such as '1 hour' or in s; the operation time by default.
    out
        Output folder; ./quakedesign-FAULT-sampling by default.
    """
    from quakedesign.fault import load_fault
    from quakedesign.report.folder import prepare
    from quakedesign.report.sampling_table import print_sampling, write_sampling
    from quakedesign.studies.sampling import sampling_report
    from quakedesign.studies.single_runs import CONTINUOUS, DESIGNED, choice
    from quakedesign.synthesis import design

    loaded = load_fault(fault)
    loaded.require_memoryless("a study of sampling")
    folder = out or Path(f"quakedesign-{loaded.name}-sampling")
    prepare(folder, force=force)
    lock_folder(folder)
    with progress() as bar:
        bar("gains", 0.0)
        law = (
            design(loaded, controller, continuous=True)
            if gains in (DESIGNED, CONTINUOUS)
            else choice(loaded, controller, gains).controller
        )
        report = sampling_report(loaded, law, scales=scale, schemes=schemes, duration=duration, progress=bar)
        results = write_sampling(report, folder, format)

    def printed() -> None:
        print_sampling(report, console())
        print_lines(["", f"written: {folder}/ (results.json, figures)"])

    output.show(results, printed)
    return 0


@app.command
def export(
    fault: FaultName,
    /,
    *,
    law: LawOptions = _LAW,
    step: Seconds | None = None,
    scheme: str | None = None,
    sensors: EstimateOptions = _MEASURED,
    fmu: bool = False,
    out: Path | None = None,
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Write a controller as a C function that is called once per sample.

    Parameters
    ----------
    step
        Sampling time T_s of the exported controller, such as '184 ms', for which gains are also designed; the fault's
        by default.
    scheme
        explicit (default), implicit, semi-implicit, compensated or stick-slip. Designed laws, and those of a
        certificate, have their own scheme.
    fmu
        Also write controller.fmu for co-simulation (FMI 2.0).
    out
        Output folder; ./quakedesign-FAULT-CONTROLLER by default.
    """
    options = dict(locals())
    from quakedesign.cli.block_commands import export_chain, several_blocks
    from quakedesign.fault import load_fault
    from quakedesign.report.terminal import export_lines
    from quakedesign.studies.exporting import export_result

    if (
        chain := several_blocks(fault, globals()["export"], options, ("controller", "certificate", "fmu", "out"))
    ) is not None:
        return export_chain(chain, law, fmu, out, force, output)
    loaded = load_fault(fault)
    chosen = law.choose(loaded, step)
    if chosen is None:
        raise ParameterError("export needs a controller. Received none. Give --controller.")
    folder = out or Path(f"quakedesign-{loaded.name}-{chosen.controller.name}")
    values = export_result(
        loaded,
        chosen.controller,
        folder,
        step=step,
        scheme=scheme,
        **sensors.values(),
        remarks=(f"proved: {chosen.claim.sentence()}" if chosen.claim else _WITHOUT_CLAIM,),
        fmu=fmu,
        force=force,
    )
    output.show(values, export_lines(values))
    return 0


_WITHOUT_CLAIM = (
    "no guarantee is stated here: quakedesign guarantee --out FILE, then export --certificate FILE, gives one"
)


# ----------------------------------------------------------------------
# The command that runs many samples of one closed loop.

_CAMPAIGN_DIRECT, _CAMPAIGN_EXACT, _CAMPAIGN_LAW, _CAMPAIGN_USUAL = (
    ActuatorOptions(),
    SensorOptions(),
    LawOptions(),
    RunOptions(),
)
_NO_SPREAD = SpreadOptions()


@app.command
def campaign(
    fault: FaultName,
    /,
    *,
    samples: Whole,
    law: LawOptions = _CAMPAIGN_LAW,
    run: RunOptions = _CAMPAIGN_USUAL,
    box: Box = None,
    actuator: ActuatorOptions = _CAMPAIGN_DIRECT,
    sensors: SensorOptions = _CAMPAIGN_EXACT,
    initial_slip: Metres = 0.0,
    initial_rate: MetresPerSecond = 0.0,
    state: SpreadOptions = _NO_SPREAD,
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
    """Simulate many samples of the uncertainty box, disturbances, noise and initial states, and report the worst.

    Finished batches are stored in the folder; after an interruption the same command continues, with the same result.

    Exit code 0 if all samples have a result (divergence counts as one), 1 if a batch failed. Give quantities with a
    unit, such as '20 MPa', or as numbers in SI units.

    Parameters
    ----------
    samples
        Number of samples.
    initial_slip
        Largest initial slip; samples range from 0 to this value.
    initial_rate
        Largest initial slip rate; samples range from 0 to this value.
    seed
        Seed of samples and noise.
    search
        Metric to maximise by search, such as max_slip_rate_error.
    rerun
        Index of a sample, or search-N for sample N of the search, to simulate again and store as NetCDF in the folder.
    workers
        Number of processes; by default one per core.
    out
        Output folder; ./quakedesign-FAULT-campaign by default.
    """
    from quakedesign.fault import load_fault
    from quakedesign.report.drawing import figure_bytes
    from quakedesign.simulation.campaign import campaign_problem, run_campaign
    from quakedesign.simulation.run_settings import sampled_scheme

    if rerun is not None and rerun.isdecimal() and int(rerun) >= samples:
        raise ParameterError(f"rerun must be an index below {samples}, or search-N. Received {rerun}.")
    loaded = load_fault(fault, box=box)
    chosen, variation = state.choose(loaded, law, run.step, actuator.path())
    controller = chosen.controller if chosen else None
    way, step, own = run.way(controller)
    period = loaded.sampling_time if step is None else step
    elements = loop_elements(None if variation else chosen, period, run, actuator, sensors, 0)
    problem = campaign_problem(
        loaded,
        controller,
        scheme=sampled_scheme(way, *elements, **own),
        step=step,
        method=run.method,
        duration=run.duration,
        plant=run.plant,
        load=run.load(),
        initial_slip=initial_slip,
        initial_slip_rate=initial_rate,
        seed=seed,
        **variation,
    )
    folder = out or Path(f"quakedesign-{loaded.name}-campaign")
    lock_folder(folder, make=True)
    options: dict[str, Any] = {"workers": workers, "scheduler": scheduler, "metric": search, "renew": force}
    remedy(f"run the same command again to continue from {folder}")
    with progress() as bar:
        done = run_campaign(problem, samples, folder, progress=bar, **options)
        drawn = done.plot()
        done.save(folder, {f"distribution.{kind}": figure_bytes(drawn, kind, "distribution") for kind in format})
        values = done.to_dict() | _rerun(done, rerun, folder)
    output.show(values, lambda: _print_campaign(problem, done, values, f"{folder}/ ({_written(values, format)})"))
    return 1 if done.failures else 0


def _rerun(done: "Campaign", index: str | None, folder: Path) -> Json:
    """Run one sample again and store it."""
    if index is None:
        return {}
    run = done.trajectory(int(index) if index.isdecimal() else index)
    path = run.save(folder / f"sample-{index}.nc")
    entries = {"outcome": run.outcome.to_dict(), "metrics": run.metrics.to_dict(), "events": dict(run.events)}
    return {"rerun": {"index": index, "file": str(path), **entries}}


def _print_campaign(problem: "CampaignProblem", done: "Campaign", result: Json, written: str) -> None:
    from rich.table import Table

    from quakedesign.simulation.recorder import Metrics

    out = console()
    happened = ", ".join(f"{len(indices)} {name.replace('_', ' ')}" for name, indices in done.events.items() if indices)
    law = problem.controller.title if problem.controller else "no control"
    out.print(
        f"{problem.fault.name}, {law}: {result['samples']} samples, {result['resumed']} of them from an earlier run"
    )
    came_to = ", ".join(f"{len(indices)} {kind}" for kind, indices in done.kinds.items() if indices)
    out.print(f"outcomes (samples): {came_to or 'none'}")
    out.print(f"events (samples): {happened or 'none'}")
    levels = ("0.05", "0.5", "0.95", "1")
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    for column in ("metric", "unit", "5 %", "50 %", "95 %", "worst", "samples"):
        table.add_column(column, no_wrap=column != "samples")
    for name, quantiles in result["quantiles"].items():
        values = ("diverges" if quantiles[level] is None else f"{quantiles[level]:.2g}" for level in levels)
        worst = ", ".join(str(entry["index"]) for entry in result["worst"][name][:3])
        table.add_row(name, Metrics.unit(name) or "-", *values, worst)
    out.print(table, soft_wrap=False)
    for search in (result["search"],) if result["search"] else ():
        value = "diverges" if search["value"] is None else f"{search['value']:.6g} {Metrics.unit(search['metric'])}"
        out.print(
            f"search: worst {search['metric']} = {value}, in sample {search['index']}; "
            f"{search['looked_at']} samples evaluated"
        )
    for failure in result["failures"]:
        span = f"{failure['samples'][0]} … {failure['samples'][-1]}"
        out.print(f"failed: samples {span}: {failure['reason']}")
    out.print(f"written: {written}")


def _written(values: Json, formats: Sequence[str]) -> str:
    """Names of the files in the folder."""
    from quakedesign.report.drawing import file_names

    again = [Path(values["rerun"]["file"]).name] if "rerun" in values else []
    return ", ".join(["results.json", "samples.csv", file_names("distribution", formats), *again])
