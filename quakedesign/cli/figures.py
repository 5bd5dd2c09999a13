"""Commands that show all controllers of a fault side by side: in a table, and in the figures of the paper."""

from pathlib import Path

from quakedesign.cli.design import LinearOptions, controllers, positive
from quakedesign.cli.shared import Force, Json, app, console, print_json, print_lines, progress

_AS_USUAL = LinearOptions()


@app.command
def compare(
    fault: str,
    /,
    *,
    controller: str = "all",
    box: str | None = None,
    linear: LinearOptions = _AS_USUAL,
    scheme: str | None = None,
    published_scheme: str = "continuous",
    json: Json = False,
) -> int:
    """Design, prove, simulate and compare with the published gains as `design` does, and write nothing.

    Exit code as `design`: 0 if every designed controller is proved, its premise along the reference holds, and its run
    is neither an earthquake nor diverges nor opens the fault.

    Parameters
    ----------
    fault
        Preset or path of a .toml file.
    controller
        Law to design: cta, dia, elqr or all.
    box
        Uncertainty box: paper or ten-percent.
    scheme
        Of the runs of designed gains: continuous (unless given), as in the paper, or sampled and held: explicit,
        implicit, semi-implicit, compensated. The e-LQR that samples runs as it was designed.
    published_scheme
        Of the runs of published gains.
    json
        Print JSON with the keys of design's results.json.
    """
    from quakedesign.fault import load_fault
    from quakedesign.report.comparison import designed_comparison
    from quakedesign.report.folder import results
    from quakedesign.report.numbers import printed, printed_lines, table

    names, found = controllers(controller), load_fault(fault, box=box)
    options = linear.told(names)
    with progress() as tell:
        comparison = designed_comparison(
            found, names, tell, linear=options, scheme=scheme, published_scheme=published_scheme
        )
    if json:
        beside = {"numbers": table(comparison), "printed": printed(comparison)}
        print_json({**results(comparison, stored=False), **beside})
    else:
        from quakedesign.report.terminal import print_comparison

        print_comparison(comparison, console())
        print_lines(printed_lines(printed(comparison)))
    return 0 if positive(comparison) else 1


@app.command
def figures(
    fault: str,
    /,
    *,
    controller: str = "all",
    box: str | None = None,
    linear: LinearOptions = _AS_USUAL,
    scheme: str | None = None,
    published_scheme: str = "continuous",
    out: Path | None = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Draw the figures of the paper that show simulations, for any fault, published gains beside designed ones.

    Writes a folder as `design` does, with these figures in addition, and their numbers in numbers.csv and results.json.

    Parameters
    ----------
    fault
        Preset or path of a .toml file.
    controller
        Law to design: cta, dia, elqr or all.
    box
        Uncertainty box: paper or ten-percent.
    scheme
        Of the runs of designed gains: continuous (unless given), as in the paper, or sampled and held: explicit,
        implicit, semi-implicit, compensated. The e-LQR that samples runs as it was designed.
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
    from quakedesign.report.folder import prepare, write_folder

    names, found = controllers(controller), load_fault(fault, box=box)
    options = linear.told(names)
    folder = out or Path(f"quakedesign-{found.name}")
    prepare(folder, force=force)
    from quakedesign.report.comparison import designed_comparison
    from quakedesign.report.numbers import printed_lines
    from quakedesign.report.outcomes import run_sentences
    from quakedesign.report.paper_study import paper_study

    with progress() as tell:
        comparison = designed_comparison(
            found, names, tell, linear=options, scheme=scheme, published_scheme=published_scheme
        )
        study = paper_study(comparison, progress=tell)
        results = write_folder(comparison, folder, force=force, study=study, tell=tell)
    if json:
        print_json(results)
        return 0
    told = ((e.label, "; ".join(run_sentences(e.run, found))) for e in comparison.entries if e.run)
    print_lines(f"{label}: {said}" for label, said in told)
    files = [(drawn["file"], drawn["paper"]) for drawn in results["figures"].values()]
    print_lines(f"{folder}/{file}" + (f": {paper} of the paper" if paper else "") for file, paper in files)
    print_lines(printed_lines(results["printed"]))
    print_lines(["", f"written: {folder}/ (also results.json, numbers.csv, report.html, certificates)"])
    return 0
