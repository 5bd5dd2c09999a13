"""Commands that show all controllers of a fault side by side: in a table, and in the figures of the paper."""

from pathlib import Path

from quakedesign.cli.design import DesignOptions, positive
from quakedesign.cli.options import PLAIN, FaultName, Force, Formats, Output
from quakedesign.cli.shared import app, command_line, console, print_json, print_lines, progress
from quakedesign.output import hold

_AS_USUAL = DesignOptions()


@app.command
def compare(
    fault: FaultName,
    /,
    *,
    options: DesignOptions = _AS_USUAL,
    output: Output = PLAIN,
) -> int:
    """Design, prove, simulate and compare with the published gains as `design` does, and write nothing.

    Exit code as `design`.
    """
    from quakedesign.report.comparison import designed_comparison
    from quakedesign.report.folder import results
    from quakedesign.report.terminal import printed_lines
    from quakedesign.studies.paper_numbers import printed, table

    loaded, asked = options.asked(fault)
    with progress() as tell:
        comparison = designed_comparison(loaded, tell=tell, **asked)
    if output.json:
        beside = {"numbers": table(comparison), "printed": printed(comparison)}
        print_json({**results(comparison, stored=False), **beside})
    else:
        from quakedesign.report.terminal import print_comparison

        print_comparison(comparison, console())
        print_lines(printed_lines(printed(comparison)))
    return 0 if positive(comparison) else 1


@app.command
def figures(
    fault: FaultName,
    /,
    *,
    options: DesignOptions = _AS_USUAL,
    out: Path | None = None,
    format: Formats = ("svg",),
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Draw the figures of the paper that show simulations, for any fault, published gains beside designed ones.

    Writes a folder as `design` does, with these figures in addition, and their numbers in numbers.csv and results.json.

    Parameters
    ----------
    out
        Folder to write; ./quakedesign-FAULT-figures unless given.
    """
    from quakedesign.report.folder import prepare, write_folder

    loaded, asked = options.asked(fault)
    folder = out or Path(f"quakedesign-{loaded.name}-figures")
    prepare(folder, force=force)
    hold(folder)
    from quakedesign.report.comparison import designed_comparison
    from quakedesign.report.outcomes import run_sentences
    from quakedesign.report.paper_study import paper_study
    from quakedesign.report.terminal import printed_lines

    with progress() as tell:
        comparison = designed_comparison(loaded, tell=tell, **asked)
        study = paper_study(comparison, progress=tell)
        results = write_folder(
            comparison, folder, force=force, study=study, formats=format, command=command_line(), tell=tell
        )
    if output.json:
        print_json(results)
        return 0
    runs = ((e.label, "; ".join(run_sentences(e.run, loaded))) for e in comparison.entries if e.run)
    print_lines(f"{label}: {said}" for label, said in runs)
    files = [(drawn["file"], drawn["paper"]) for drawn in results["figures"].values()]
    print_lines(f"{folder}/{file}" + (f": {paper} of the paper" if paper else "") for file, paper in files)
    print_lines(printed_lines(results["printed"]))
    print_lines(["", f"written: {folder}/ (also results.json, numbers.csv, report.html, certificates)"])
    return 0
