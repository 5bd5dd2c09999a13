"""The main job."""

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from quakedesign.cli.shared import Force, Json, app, console, print_json, print_lines, progress
from quakedesign.errors import ParameterError, UnknownNameError


@app.command
def design(
    fault: str,
    /,
    *,
    controller: str = "all",
    box: str | None = None,
    held: Annotated[bool, Parameter(negative="")] = False,
    scheme: str = "continuous",
    published_scheme: str = "continuous",
    out: Path | None = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Derive, synthesise, prove, simulate, compare with the published gains, and write a report.

    Exit code 0 if every designed controller is proved, its premise along the reference holds, and its run is neither an
    earthquake nor diverges nor opens the fault; 1 otherwise.

    Parameters
    ----------
    fault
        Preset or path of a .toml file.
    controller
        cta, dia, elqr or all.
    box
        Uncertainty box: paper or ten-percent.
    held
        Gains of the e-LQR that are proved with p held over the sampling time as well.
    scheme
        Of the runs of designed gains: continuous, as in the paper, or sampled and held: explicit, implicit,
        semi-implicit, compensated.
    published_scheme
        Of the runs of published gains.
    out
        Folder to write; ./quakedesign-FAULT unless given.
    force
        Replace a folder of earlier results.
    json
        Print results.json on stdout.
    """
    from quakedesign.fault import load_fault
    from quakedesign.report.folder import prepare

    names = controllers(controller)
    if held and "elqr" not in names:
        raise ParameterError(f"--held is for the e-LQR. Received --controller {controller}. Leave it out.")
    found = load_fault(fault, box=box)
    folder = out or Path(f"quakedesign-{found.name}")
    prepare(folder, force=force)
    from quakedesign.report.comparison import designed_comparison
    from quakedesign.report.folder import write_folder

    with progress() as tell:
        comparison = designed_comparison(
            found, names, tell, held=held, scheme=scheme, published_scheme=published_scheme
        )
        results = write_folder(comparison, folder, force=force, tell=tell)
    if json:
        print_json(results)
    else:
        from quakedesign.report.terminal import print_comparison

        print_comparison(comparison, console())
        print_lines(["", f"written: {folder}/ (results.json, report.html, certificates, figures)"])
    return 0 if positive(comparison) else 1


def controllers(name: str) -> list[str]:
    """Laws to design: the one named, or all.

    Raises
    ------
    UnknownNameError
    """
    from quakedesign.synthesis import DESIGNABLE

    if name not in (*DESIGNABLE, "all"):
        raise UnknownNameError(f"controller must be one of {', '.join(DESIGNABLE)}, all. Received {name!r}.")
    return list(DESIGNABLE) if name == "all" else [name]


def positive(comparison: Any) -> bool:
    """Whether every design is proved and its premises hold but for those on run and start, and its run is harmless."""
    needed = {"along_reference", "control_coefficient", "friction_slope"}
    return all(
        str(entry.design.verdict) == "proved"
        and all(p.holds for p in entry.design.premises if p.name in needed)
        and (entry.run is None or entry.run.outcome.harmless)
        for entry in comparison.of("designed")
    )
