"""The command that maps certified gains."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from quakedesign.cli.option_values import Gains, Whole
from quakedesign.cli.options import PLAIN, Force, Formats, Output, Scheduler
from quakedesign.cli.shared import app, progress
from quakedesign.errors import ParameterError
from quakedesign.output import hold

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
    """Map where two gains are certified, at one or more levels of |h'|; certificates, a figure and a table.

    Every point of the grid is screened in floating point. All points at the edges and a random sample inside are then
    proved exactly, with certificates; figure and table keep the two apart. Exit code 0 if something is certified and
    every edge point is proved.

    Parameters
    ----------
    law
        cta, dia or another sliding mode.
    over
        Names of the two gains that vary, such as k1 k2.
    gains
        All gains of the law; those that do not vary keep these values. Those of the literature unless given, if known.
    range
        Four numbers: both ends of the first gain, then of the second; a quarter to four times its value unless given.
    lipschitz
        One or more bounds on |h'|; five shares of the necessary limit unless given.
    gain_range
        b_m and b_M, the range of the control coefficient β.
    points
        Along each axis.
    degree
        Of the Lyapunov functions; the lowest that proves the given gains unless given.
    interior
        Number of random points inside that are proved.
    seed
        Of their choice.
    workers
        Number of processes.
    out
        Folder; ./quakedesign-map-LAW unless given.
    """
    from quakedesign.controllers import family
    from quakedesign.report.figure_files import file_names
    from quakedesign.report.folder import prepare
    from quakedesign.report.gain_map import gain_map_lines, write_gain_map
    from quakedesign.synthesis.analysis.gain_map import gain_map as mapped

    folder = out or Path(f"quakedesign-map-{law}")
    prepare(folder, force=force)
    hold(folder)
    if range is not None and len(range) != 4:
        raise ParameterError(f"range needs four numbers, two for each gain. Received {len(range)}.")
    base = gains or tuple(str(v) for v in family(law)[0].law.gains.values())
    with progress() as tell:
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
            tell=tell,
        )
    facts = write_gain_map(drawn, folder, format)
    written = f"written: {folder}/ ({file_names('map', format)}, map.csv, results.json, certificates)"
    output.show(facts, [*gain_map_lines(drawn), written])
    proved = all(level["edge_proved"] == level["edge"] for level in facts["levels"])
    return 0 if proved and any(level["screened"] for level in facts["levels"]) else 1
