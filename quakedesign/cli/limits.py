"""The command about what no controller can do."""

from pathlib import Path
from typing import Literal

from quakedesign.cli.guarantee import Surroundings
from quakedesign.cli.option_values import Pascals
from quakedesign.cli.options import PLAIN, Box, FaultName, Force, Formats, Output, Shaking
from quakedesign.cli.shared import app
from quakedesign.output import hold
from quakedesign.rationals import rational

_ALONE = Surroundings()


@app.command
def limits(
    fault: FaultName,
    /,
    *,
    pressure: Pascals | None = None,
    around: Surroundings = _ALONE,
    stress: Pascals | None = None,
    spread: str = "0",
    measured: Literal["slip-and-rate", "slip"] = "slip-and-rate",
    box: Box = None,
    disturbance: Shaking = None,
    out: Path | None = None,
    format: Formats = ("png",),
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Say what no controller whatever can do with a fault, beside what a designed one is proved to do.

    The smallest slip-rate error, the longest T_s, delay and diffusion time, the farthest well and the smallest
    withdrawal, for any disturbance as large as the fault's.

    Parameters
    ----------
    pressure
        Largest withdrawal, such as '20 MPa'; the effective normal stress unless given.
    around
        What designs are proved with. The diffusivity, 1 m²/s unless given, is that of the farthest well too; noise says
        how far it limits the slip-rate error of any controller as well.
    stress
        Of a fault with rate-and-state friction, whose limits are those of its linearisation about slow sliding: bound
        of the shear stress disturbance, such as '25 kPa'; the largest that a design stands unless given.
    spread
        Of such a fault: by how much of their values a, b and D_c may be off in what is proved, such as 0.1; what is
        impossible is so for the nominal ones.
    measured
        What controllers are told: slip-and-rate, or slip.
    out
        Folder for a figure and results.json; nothing is written unless given.
    """
    from quakedesign.fault import load_fault

    loaded = load_fault(fault, box=box, disturbance=disturbance)
    if out is not None:
        from quakedesign.report.folder import prepare

        prepare(out, force=force)
        hold(out)
    from quakedesign.report.figure_files import file_names
    from quakedesign.report.impossibility_table import limits_lines, write_limits
    from quakedesign.studies import limits as all_limits

    answer = all_limits(
        loaded,
        pressure=pressure,
        diffusivity=float(rational(around.diffusivity or "1")),
        stress=stress,
        spread=spread,
        measured=measured,
        **around.plain(),
    )
    if out is not None:
        write_limits(answer, out, format)
    written = [] if out is None else [f"written: {out}/ ({file_names('limits', format)}, results.json)"]
    output.show(answer.to_dict(), [*limits_lines(answer), *written])
    return 0
