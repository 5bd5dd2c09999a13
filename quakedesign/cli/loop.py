"""Commands that simulate closed loops."""

from pathlib import Path

from quakedesign.cli.shared import Force, Gains, Json, app, console, new_file, print_json, progress


@app.command
def simulate(
    fault: str,
    /,
    *,
    controller: str = "none",
    gains: Gains = ("published",),
    step: float | None = None,
    scheme: str = "continuous",
    method: str = "dormand-prince",
    plant: str = "smooth",
    out: Path | None = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Run one closed loop over the whole task, or the natural earthquake without a controller.

    Parameters
    ----------
    fault
        Preset or path of a .toml file.
    controller
        none, cta, dia or elqr.
    gains
        published, or the gains of the law (λ = 1, divisor μ_res·N̂_min).
    step
        Length of one step in s; the fault's sampling time unless given.
    scheme
        continuous.
    method
        dormand-prince or rk4.
    plant
        smooth (the paper's, for forward slip) or coulomb (set-valued friction: stick, slip, reversal).
    out
        NetCDF file to write.
    force
        Replace an existing file.
    json
        Print JSON.
    """
    from quakedesign.fault import load_fault
    from quakedesign.report.single import run_single

    new_file(out, "output file", force=force)
    found = load_fault(fault)
    with progress() as tell:
        trajectory, premises = run_single(
            found,
            controller,
            gains,
            step=step,
            scheme=scheme,
            method=method,
            plant=plant,
            tell=lambda done: tell("simulation", done),
        )
    if out is not None:
        trajectory.save(out)
    metrics = trajectory.metrics.to_dict()
    answer = {
        "metrics": metrics,
        "premises": [p.to_dict() for p in premises],
        "events": dict(trajectory.events),
        "steps": metrics["steps"],
        "seconds": metrics["seconds"],
        "run": dict(trajectory.provenance),
    }
    if json:
        print_json(answer)
    else:
        from quakedesign.report.terminal import print_run

        print_run(trajectory, premises, console())
    return 0
