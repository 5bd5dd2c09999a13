"""The command from a laboratory record to friction parameters."""

from pathlib import Path

from quakedesign.cli.option_values import Pascals, Whole, in_unit
from quakedesign.cli.options import PLAIN, FaultName, Force, Output
from quakedesign.cli.shared import app, new_file, require_different


@app.command
def identify(
    data: Path,
    /,
    *,
    law: str | None = None,
    stiffness: str | None = None,
    normal_stress: Pascals | None = None,
    seed: Whole = 0,
    fault: FaultName = "lab-fault",
    out: Path | None = None,
    figure: Path | None = None,
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Identify friction parameters, with confidence regions, from a laboratory record.

    Velocity steps and slide-hold-slide give the laws with state, slip or a stiffly drawn block those that weaken with
    slip. Exit code 1 where the record cannot tell every parameter.

    Parameters
    ----------
    data
        CSV file with units in its first line, such as 'time [s], load_point_displacement [um], shear_stress [MPa],
        normal_stress [MPa]'; load_point_rate, shear_force, normal_force, friction and slip are known, too.
    law
        Friction law: rate-and-state-aging and rate-and-state-slip are both fitted, and the better one taken, unless
        told; regularised-rate-and-state, exponential-slip-weakening or linear-slip-weakening, say, are others.
    stiffness
        Of the machine, such as '5 GPa/m' ('2 kN/um' for forces, '1e-3 1/um' for friction); fitted unless given.
    normal_stress
        Constant, such as '5 MPa', where there is no such column.
    seed
        Of the draw of the starts.
    fault
        Preset or .toml file that gives all but the friction to the file that is written.
    out
        Fault file to write, with a friction that covers every law of the box where a fault file can hold it.
    figure
        Figure of the residuals to write: .svg, .png or .pdf.
    """
    from quakedesign.fault import load_fault
    from quakedesign.identification import identify as fitted
    from quakedesign.identification import (
        law_remarks,
        next_command,
        other_parts,
        read_record,
        save_fault,
        task_remarks,
    )
    from quakedesign.report.identification import identification_lines, require_format, save_figure

    for path, what in ((out, "fault file"), (figure, "figure")):
        new_file(path, what, force=force)
    if figure is not None:
        require_format(figure)
    require_different({"--out": out, "--figure": figure, "the record": data, "--fault": Path(fault)})
    around = load_fault(fault)
    record = read_record(data, normal_stress=normal_stress)
    spring = None if stiffness is None else in_unit(stiffness, record.stiffness_unit, "stiffness")
    identification = fitted(record, law, stiffness=spring, seed=seed)
    written = [path for path in (figure, out if identification.identified else None) if path is not None]
    if figure is not None:
        save_figure(identification, figure)
    if out is not None and identification.identified:
        save_fault(identification, around, out)
    told = law_remarks(identification, around)
    told += [f"written: {', '.join(map(str, written))}"] if written else []
    if out in written:
        told.append(f"from {around.name}, not from the record: {other_parts(identification, around)}")
        ahead = "next:" if identification.explained else "next, if nothing above explains the record better:"
        told += [*task_remarks(identification, around), f"{ahead} {next_command(identification, out)}"]
    if out is not None and not identification.identified:
        told.append(f"not written: {out}, which needs every parameter")
    places = {"figure": figure, "file": out if identification.identified else None}
    facts = identification.to_dict() | {name: None if path is None else str(path) for name, path in places.items()}
    output.show(facts, [*identification_lines(identification), *told])
    return 0 if identification.identified else 1
