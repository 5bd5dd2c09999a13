"""Commands `synthesise` and `map`: gains with a proof."""

from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from quakedesign.cli.app import app, console, new_file, progress, reject, specified
from quakedesign.cli.options import PLAIN, Force, Formats, Gains, Output, Scheduler, Seconds, Whole
from quakedesign.errors import ParameterError, UnknownNameError, require_known
from quakedesign.files import Json, lock_folder

if TYPE_CHECKING:
    from quakedesign.lyapunov.gains.synthesise import Synthesis


# ----------------------------------------------------------------------
# The command that finds gains with a proof.


@app.command
def synthesise(
    law: str,
    fault: str | None = None,
    /,
    *,
    objective: str = "norm",
    lipschitz: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    gain_range: tuple[str, str] | None = None,
    bound: float | None = None,
    degree: tuple[Whole, ...] = (),
    starts: Whole | None = None,
    seed: Whole | None = None,
    workers: Whole | None = None,
    scheduler: Scheduler = None,
    step: Seconds | None = None,
    scheme: str | None = None,
    metric: str | None = None,
    out: Path | None = None,
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Search for proved gains that optimise one objective, and compare them with gains from the literature.

    Exit code 0 only if gains are proved. No gains are printed without a proof.

    Parameters
    ----------
    law
        cta, dia, super-twisting or cta3.
    fault
        Objective sampled: preset or path of a .toml file.
    objective
        norm: smallest norm of the gains after scaling to |h'| <= 1 m/s^3. decay: shortest certified settling time from
        all errors |e_i| ≤ L̄ (L̄ the value of --lipschitz; numbers in SI units). beta: widest certified range of the
        input gain β. sampled: smallest error of proved gains in a simulation of a fault.
    lipschitz
        Bound on |h'|, the rate of change of the matched perturbation h, in the unit of the control ν per second; by
        default 1, for sampled 1.1 times the largest |h'| of the fault.
    gain_range
        b_m and b_M, the range of the input gain β; 1 1 by default, for sampled that of the fault. For beta the
        certified range contains this range and has the same geometric mean.
    bound
        Objectives decay and beta: largest norm of the gains; by default the smallest norm in the literature.
    degree
        Degree of the Lyapunov function V; repeat the option for further degrees. By default the two lowest; higher
        degrees yield better gains and take longer.
    starts
        Number of starting points, 4 by default; not for sampled.
    seed
        Seed of the random starting points, 0 by default.
    workers
        Number of processes, 2 by default; results do not depend on this number.
    step
        Objective sampled: sampling time T_s, in s or with a unit; the fault's by default.
    scheme
        Objective sampled: explicit (default), implicit, semi-implicit, compensated or stick-slip.
    metric
        Objective sampled: max_slip_rate_error (default) or another metric that is better when smaller.
    out
        Certificate file to write.
    """
    from quakedesign.lyapunov.gains.synthesise import OBJECTIVES

    require_known(objective, (*OBJECTIVES, "sampled"), "objective", UnknownNameError)
    new_file(out, "certificate file", force=force)
    began = perf_counter()
    of_search = {"starts": starts, "seed": seed, "workers": workers, "scheduler": scheduler}
    of_trial, what = {"step": step, "scheme": scheme, "metric": metric}, f"the objective {objective}"
    if objective == "sampled":
        reject({"--bound": bound, **{f"--{name}": value for name, value in of_search.items()}}, what)
        synthesis, more = _sampled(law, fault, lipschitz, gain_range, degree, specified(of_trial))
    else:
        reject({"FAULT": fault, **{f"--{name}": value for name, value in of_trial.items()}}, what)
        from quakedesign.lyapunov.gains.synthesise import synthesise as search

        ranges = {"lipschitz": lipschitz or "1", "gain_range": gain_range or ("1", "1")}
        options = {"workers": 2, **specified(of_search), "degrees": degree or None, "bound": bound, **ranges}
        synthesis, more = search(law, objective, **options), {}
    if synthesis is not None and out is not None:
        synthesis.certificate.save(out)
    values = _values(synthesis) | more | {
        "certificate": str(out) if synthesis is not None and out is not None else None,
        "seconds": perf_counter() - began,
    }  # fmt: skip
    output.show(values, lambda: _print_synthesis(law, synthesis, more))
    return 0 if synthesis is not None else 1


def _sampled(
    law: str, fault: str | None, lipschitz: str | None, gain_range: tuple[str, str] | None, degree: tuple[int, ...],
    options: Mapping[str, Any],
) -> tuple["Synthesis | None", dict[str, Any]]:  # fmt: skip
    """Gains with the smallest error in a sampled run, and the settings of the runs."""
    from quakedesign.fault import load_fault
    from quakedesign.synthesis.simulated_error import sampling, synthesise_sampled

    if fault is None:
        raise ParameterError(
            f"the objective sampled needs a fault. Received none. Give a preset or a file after {law}."
        )
    trial = sampling(load_fault(fault), law, lipschitz=lipschitz, gain_range=gain_range, **options)
    tried = {"scale": str(trial.scale), "step": trial.step, "duration": trial.duration, "scheme": trial.scheme}
    return synthesise_sampled(trial, degrees=degree or None), {"fault": fault, **tried}


def _values(synthesis: "Synthesis | None") -> Json:
    """Result as JSON: gains and ranges as strings, floating-point values as numbers."""
    if synthesis is None:
        return {"verdict": "undecided", "gains": None, "value": None, "compared": []}
    ranges = synthesis.certificate.loop.uncertain
    return {
        "verdict": "proved",
        "objective": synthesis.objective,
        "gains": {name: str(k) for name, k in synthesis.gains.items()},
        "lipschitz": str(ranges["d"][1]),
        "gain_range": [str(v) for v in ranges["beta"]] if "beta" in ranges else None,
        "value": synthesis.value,
        "unit": synthesis.unit,
        "norm": synthesis.norm,
        "compared": [
            {"gains": {n: str(k) for n, k in c.gains.items()}, "value": c.value, "norm": c.norm, "ratio": c.ratio}
            for c in synthesis.compared
        ],
    }


def _print_synthesis(law: str, synthesis: "Synthesis | None", more: Mapping[str, Any]) -> None:
    from rich.table import Table
    from rich.text import Text

    out = console()
    if synthesis is None:
        out.print(f"undecided: no gains of {law} were proved")
        return
    gains = ", ".join(f"{name} = {k}" for name, k in synthesis.gains.items())
    ranges = synthesis.certificate.loop.uncertain
    beta = f", β in [{ranges['beta'][0]}, {ranges['beta'][1]}]" if "beta" in ranges else ""
    out.print(f"proved: {law} with {gains} for |h'| <= {ranges['d'][1]}{beta}")
    if more:
        of_run = "{scheme} run on {fault} with scale {scale}, T_s = {step:.4g} s, over {duration:.4g} s"
        out.print(f"simulated, not proved: {synthesis.objective} of one {of_run.format(**more)}")
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    unit = "" if synthesis.unit == "-" else f" [{synthesis.unit}]"
    for column in ("gains", f"{synthesis.objective}{unit}", "norm", "improvement factor"):
        table.add_column(Text(column))
    rows: list[tuple[str, float | None, float, float | None]] = [("synthesised", synthesis.value, synthesis.norm, None)]
    rows += [
        (" ".join(f"{float(k):.4g}" for k in c.gains.values()), c.value, c.norm, c.ratio) for c in synthesis.compared
    ]
    for name, value, norm, ratio in rows:
        shown = "not proved" if value is None else f"{value:.4g}"
        table.add_row(name, shown, f"{norm:.4g}", "" if ratio is None else f"{ratio:.3g}")
    out.print(table)


# ----------------------------------------------------------------------
# The command that maps certified gains.

Numbers = Annotated[tuple[str, ...], Parameter(consume_multiple=True)]


@app.command(name="map")
def gain_map(
    law: str,
    /,
    *,
    over: tuple[str, str],
    gains: Gains | None = None,
    range: Numbers | None = None,
    lipschitz: Numbers | None = None,
    gain_range: tuple[str, str] = ("1", "1"),
    points: Whole = 40,
    degree: Whole | None = None,
    interior: Whole = 200,
    seed: Whole = 0,
    workers: Whole = 2,
    scheduler: Scheduler = None,
    out: Path | None = None,
    format: Formats = ("png",),
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Map where two gains are certified, at one or more levels of |h'|, with certificates, figure and table.

    Every grid point is screened in floating point. Exact proofs are then sought: at every level for all points at the
    edge of the screened region, and for a random sample of inner points, each at its highest screened level. Figure and
    table distinguish screened from proved points. Exit code 0 if some point passes the screening and every edge point
    is proved.

    Parameters
    ----------
    law
        cta, dia or another sliding mode.
    over
        Names of the two gains that vary, such as k1 k2.
    gains
        All gains of the law; those that do not vary keep these values. By default those from the literature.
    range
        Four numbers: both ends of the first gain, then of the second; by default 0.25 and 4 times the gain's value in
        --gains.
    lipschitz
        One or more bounds on |h'|, the rate of change of the matched perturbation h, in the unit of the control ν per
        second; by default 25, 50, 75, 90 and 99 % of the largest |h'| for which a proof for --gains can exist.
    gain_range
        b_m and b_M, the range of the input gain β.
    points
        Grid points along each axis.
    degree
        Degree of the Lyapunov functions; by default the lowest for which --gains at the lowest level pass the screening
        with a clear margin, else the lowest.
    interior
        Number of random inner points for which a proof is sought.
    seed
        Seed of the choice of inner points.
    workers
        Number of processes.
    out
        Output folder; ./quakedesign-map-LAW by default.
    """
    from quakedesign.laws import family
    from quakedesign.lyapunov.maps.gain_map import gain_map as mapped
    from quakedesign.report.drawing import file_names
    from quakedesign.report.folder import prepare
    from quakedesign.report.gain_map_drawing import gain_map_lines, write_gain_map

    folder = out or Path(f"quakedesign-map-{law}")
    prepare(folder, force=force)
    lock_folder(folder)
    if range is not None and len(range) != 4:
        raise ParameterError(f"range needs four numbers, two for each gain. Received {len(range)}.")
    base = gains or tuple(str(v) for v in family(law)[0].law.gains.values())
    with progress() as bar:
        drawn = mapped(
            law,
            base,
            over,
            ranges=None if range is None else [(range[0], range[1]), (range[2], range[3])],
            points=points,
            levels=lipschitz,
            gain_range=gain_range,
            degree=degree,
            interior=interior,
            seed=seed,
            workers=workers,
            scheduler=scheduler,
            progress=bar,
        )
    values = write_gain_map(drawn, folder, format)
    written = f"written: {folder}/ ({file_names('map', format)}, map.csv, results.json, certificates)"
    output.show(values, [*gain_map_lines(drawn), written])
    proved = all(level["edge_proved"] == level["edge"] for level in values["levels"])
    return 0 if proved and any(level["screened"] for level in values["levels"]) else 1
