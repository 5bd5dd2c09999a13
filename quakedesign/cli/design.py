"""The main job."""

from pathlib import Path
from typing import Any

from quakedesign.cli.shared import Force, Json, app, console, print_json, progress
from quakedesign.errors import UnknownNameError


@app.command
def design(
    fault: str,
    /,
    *,
    controller: str = "all",
    box: str | None = None,
    out: Path | None = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Derive, synthesise, prove, simulate, compare with the published gains, and write a report.

    Exit code 0 if every designed controller is proved and its premise along the reference holds, 1 otherwise.

    Parameters
    ----------
    fault
        Preset or path of a .toml file.
    controller
        cta, elqr or all.
    box
        Uncertainty box: paper or ten-percent.
    out
        Folder to write; ./quakedesign-FAULT unless given.
    force
        Replace a folder of earlier results.
    json
        Print results.json on stdout.
    """
    from quakedesign.fault import load_fault
    from quakedesign.report.folder import prepare

    names = _controllers(controller)
    found = load_fault(fault, box=box)
    folder = out or Path(f"quakedesign-{found.name}")
    prepare(folder, force=force)
    from quakedesign.report.comparison import compare
    from quakedesign.report.folder import write_folder
    from quakedesign.synthesis import design as synthesise

    with progress() as tell:
        designs = []
        for i, name in enumerate(names):
            tell(f"synthesis and proof of {name}", i / len(names))
            designs.append(synthesise(found, name))
        comparison = compare(found, designs, progress=tell)
        results = write_folder(comparison, folder, force=force, tell=tell)
    if json:
        print_json(results)
    else:
        from quakedesign.report.terminal import print_comparison

        print_comparison(comparison, console())
        console().print(f"\nwritten: {folder}/ (results.json, report.html, certificates, figures)")
    return 0 if _positive(comparison) else 1


def _controllers(name: str) -> list[str]:
    designable = ["cta", "elqr"]
    if name not in (*designable, "all"):
        raise UnknownNameError(f"controller must be one of {', '.join(designable)}, all. Received {name!r}.")
    return designable if name == "all" else [name]


def _positive(comparison: Any) -> bool:
    needed = {"along_reference", "control_coefficient", "friction_slope"}
    return all(
        str(entry.design.verdict) == "proved" and all(p.holds for p in entry.design.premises if p.name in needed)
        for entry in comparison.of("designed")
    )
