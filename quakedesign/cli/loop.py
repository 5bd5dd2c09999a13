"""Commands about one closed loop: simulate it, see what sampling does to it, export its controller."""

from pathlib import Path
from typing import Any

from quakedesign.cli.hardware import ActuatorOptions, EstimateOptions, SensorOptions
from quakedesign.cli.options import FaultName
from quakedesign.cli.shared import (
    Force,
    Gains,
    Json,
    MetresPerSecond,
    Push,
    Seconds,
    Texts,
    Whole,
    app,
    console,
    new_file,
    print_json,
    print_lines,
    progress,
)
from quakedesign.cli.state import NO_STATE, StateOptions, require_no_state_options, show_state_run

_DIRECT, _EXACT, _TOLD = ActuatorOptions(), SensorOptions(), EstimateOptions()


@app.command
def simulate(
    fault: FaultName,
    /,
    *,
    controller: str = "none",
    gains: Gains = ("published",),
    scale: str | None = None,
    feedforward: str = "none",
    step: Seconds | None = None,
    duration: Seconds | None = None,
    scheme: str | None = None,
    weight: float | None = None,
    authority: float | None = None,
    substeps: Whole = 1,
    method: str = "dormand-prince",
    plant: str = "smooth",
    drift: MetresPerSecond = 0.0,
    perturbation: Push | None = None,
    actuator: ActuatorOptions = _DIRECT,
    sensors: SensorOptions = _EXACT,
    state: StateOptions = NO_STATE,
    seed: Whole = 0,
    out: Path | None = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Run one closed loop over the whole task, or the natural earthquake without a controller.

    Quantities have a unit, as '20 MPa', or are bare numbers in SI units.

    Parameters
    ----------
    controller
        none, cta, dia or elqr.
    gains
        published, designed, continuous (designed in continuous time), or those of the law (λ = 1, divisor μ_res·N̂_min).
    scale
        λ of a sliding mode in place of that of the gains, decimal or p/q.
    feedforward
        none, nominal or centred: what a sliding mode adds to ν from what is known of the fault; not to designed gains.
    step
        Length of one step; the fault's sampling time unless given.
    duration
        The operation time unless given. Without a controller: the fault under its own disturbance.
    scheme
        continuous (unless given; the law in every stage of the integrator), or sampled and held: explicit, implicit,
        semi-implicit, compensated. Designed laws are sampled and have their own.
    weight
        Of the estimate of the disturbance in the scheme compensated, above 0, at most 1.
    authority
        B0 of a sampled scheme in m^2/kg; guarantee says weight and authority of the sliding modes that it proves.
    substeps
        Steps of the integrator per sample.
    method
        dormand-prince or rk4; cvodes or idas for smooth loops; for friction with a state radau, dop853, cvodes or idas.
    plant
        smooth (the paper's, for forward slip) or coulomb (set-valued friction: stick, slip, reversal); for friction
        with a state smooth or quasi-dynamic (without inertia).
    drift
        Velocity of the far end, such as '3 cm/year'.
    perturbation
        Of the user's in m/s^2, added to the fault's own: an expression of slip, slip_rate and time.
    seed
        Of the noise.
    out
        NetCDF file to write.
    force
        Replace an existing file.
    json
        Print JSON.
    """
    options = dict(locals())
    from quakedesign.fault import load_fault
    from quakedesign.loop.schemes import own_way
    from quakedesign.simulation import Load
    from quakedesign.simulation import perturbation as read_perturbation
    from quakedesign.studies.single import optional_choice, run_single

    new_file(out, "output file", force=force)
    found = load_fault(fault)
    if found.friction.state_names:
        return show_state_run(found, simulate, options)
    require_no_state_options(state, found)
    law = optional_choice(found, controller, gains, scale=scale, feedforward=feedforward)
    pushed = None if perturbation is None else read_perturbation(perturbation)
    way, step, _ = own_way(law.controller if law else None, scheme, step, "continuous")
    period = found.sampling_time if step is None else step
    chain, told = actuator.build(period), sensors.build(period, seed)
    with progress() as tell:
        trajectory, premises = run_single(
            found,
            law,
            tell=lambda done: tell("simulation", done),
            duration=duration,
            load=Load(drift=drift, perturbation=pushed) if drift or pushed is not None else None,
            step=step,
            scheme=way,
            method=method,
            plant=plant,
            substeps=substeps,
            actuator=chain,
            noise=told,
            tuning={name: v for name, v in {"weight": weight, "authority": authority}.items() if v is not None},
        )
    if out is not None:
        trajectory.save(out)
    if json:
        print_json(_answer(trajectory, found, premises))
    else:
        _print_run(trajectory, found, premises)
    return 0


def _answer(trajectory: Any, fault: Any, premises: Any) -> dict[str, Any]:
    from quakedesign.simulation.waiting import waiting
    from quakedesign.studies.needed_pressure import shortfall

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


def _print_run(trajectory: Any, fault: Any, premises: Any) -> None:
    from quakedesign.report.terminal import print_run

    print_run(trajectory, fault, premises, console())
    if trajectory.energy:
        lost = f"{trajectory.energy.relative_residual:.2g} of the largest share"
        print_lines([f"  energy that the integration loses: {lost}"])


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
    force: Force = False,
    json: Json = False,
) -> int:
    """Show what sampling does: every scheme beside the published controllers, orders of accuracy, sensitivities.

    Writes results.json and figures. Errors count after a quarter of each run; those with noise last a sixteenth of
    the task.

    Parameters
    ----------
    controller
        cta, dia or elqr.
    gains
        designed (in continuous time), published, or the gains of the law (λ = 1, divisor μ_res·N̂_min).
    scale
        Further values of λ for a sliding mode, decimal or p/q.
    schemes
        To run the law with.
    duration
        Of the runs; the operation time unless given.
    out
        Folder to write; ./quakedesign-FAULT-sampling unless given.
    force
        Replace a folder of earlier results.
    json
        Print results.json on stdout.
    """
    from quakedesign.fault import load_fault
    from quakedesign.report.folder import prepare
    from quakedesign.report.sampling import print_sampling, write_sampling
    from quakedesign.studies.sampling import sampling_report
    from quakedesign.studies.single import CONTINUOUS, DESIGNED, chosen_controller
    from quakedesign.synthesis import design

    found = load_fault(fault)
    folder = out or Path(f"quakedesign-{found.name}-sampling")
    prepare(folder, force=force)
    with progress() as tell:
        tell("gains", 0.0)
        law = (
            design(found, controller, continuous=True)
            if gains in (DESIGNED, CONTINUOUS)
            else chosen_controller(found, controller, gains)
        )
        report = sampling_report(found, law, scales=scale, schemes=schemes, duration=duration, progress=tell)
        results = write_sampling(report, folder)
    if json:
        print_json(results)
    else:
        print_sampling(report, console())
        print_lines(["", f"written: {folder}/ (results.json, figures)"])
    return 0


@app.command
def export(
    fault: FaultName,
    /,
    *,
    controller: str = "cta",
    gains: Gains = ("published",),
    scale: str | None = None,
    feedforward: str = "none",
    step: Seconds | None = None,
    scheme: str | None = None,
    sensors: EstimateOptions = _TOLD,
    out: Path | None = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Write a controller as C for the computer of a laboratory: one function, called once per sample.

    Parameters
    ----------
    controller
        cta, dia or elqr.
    gains
        published, designed, continuous (designed in continuous time), or those of the law (λ = 1, divisor μ_res·N̂_min).
    scale
        λ of a sliding mode in place of that of the gains, decimal or p/q.
    feedforward
        none, nominal or centred.
    step
        Sampling period; the fault's unless given.
    scheme
        explicit (unless given), implicit, semi-implicit or compensated.
    out
        Folder to write; ./quakedesign-FAULT-CONTROLLER unless given.
    force
        Replace a folder that holds an earlier export.
    json
        Print JSON.
    """
    from quakedesign.fault import load_fault
    from quakedesign.report.exporting import export_lines
    from quakedesign.studies.exporting import export_answer
    from quakedesign.studies.single import chosen_controller

    found = load_fault(fault)
    law = chosen_controller(found, controller, gains, scale=scale, feedforward=feedforward)
    folder = out or Path(f"quakedesign-{found.name}-{controller}")
    answer = export_answer(
        found,
        law,
        folder,
        step=step,
        scheme=scheme,
        **sensors.told(),
        force=force,
    )
    if json:
        print_json(answer)
    else:
        print_lines(export_lines(answer))
    return 0
