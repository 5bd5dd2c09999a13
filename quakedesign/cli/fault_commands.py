"""Commands about a fault, its records and the shell.

`fault`, `derive`, `scale`, `errata`, `init`, `identify`, `schema` and `completion`.
"""

import json
import sys
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from quakedesign.cli.app import app, console, new_file, print_json, progress, require_different
from quakedesign.cli.options import PLAIN, Box, FaultName, Force, Gains, Output, Pascals, Whole, in_unit
from quakedesign.errors import UnknownNameError, require_known
from quakedesign.files import Json

# ----------------------------------------------------------------------
# Commands about the fault itself: its data, its equations, its scaling, the paper's errata.


@app.command
def fault(fault: FaultName, /, *, box: Box = None, output: Output = PLAIN) -> int:
    """Show derived quantities of a fault, and whether and why it is unstable."""
    options, name = dict(locals()), fault
    from quakedesign.cli.block_commands import several_blocks, show_chain
    from quakedesign.fault import load_fault
    from quakedesign.studies.fault_facts import fault_dict, fault_sentences

    if (chain := several_blocks(name, globals()["fault"], options, box=box)) is not None:
        return show_chain(chain, output)
    loaded = load_fault(fault, box=box)
    if output.json:
        print_json(fault_dict(loaded))
        return 0
    screen = console()
    screen.print(loaded.name, style="bold", end=" ")
    screen.print(f"({loaded.source})")
    for line in fault_sentences(loaded):
        screen.print(f"  {line}")
    return 0


@app.command
def derive(fault: FaultName, /, *, latex: bool = False, output: Output = PLAIN) -> int:
    """Derive the equations of a fault from its force balance.

    Parameters
    ----------
    latex
        Print LaTeX instead of plain text.
    """
    from quakedesign.fault import load_fault
    from quakedesign.symbolic import derive as derive_model
    from quakedesign.symbolic.plant import latex as in_latex
    from quakedesign.symbolic.plant import plain

    model = derive_model(load_fault(fault))
    write = in_latex if latex else plain
    equations: Json = {
        "error_dynamics": {"beta": write(model.error_dynamics.beta), "h": write(model.error_dynamics.h)},
        "jacobian": write(model.jacobian),
        "instability": write(model.instability),
        "unstable": model.unstable,
    }
    beta, h = equations["error_dynamics"].values()
    lines = [
        r"\dot e_1 = e_2, \quad \dot e_2 = \beta (\nu + h)" if latex else "e_1' = e_2, e_2' = beta*(nu + h)",
        rf"\beta = {beta}" if latex else f"beta = {beta}",
        f"h = {h}",
        rf"J(0, 0) = {equations['jacobian']}" if latex else f"jacobian = {equations['jacobian']}",
        rf"\text{{unstable}} \iff {equations['instability']}" if latex else f"unstable if {equations['instability']}",
    ]
    output.show(
        equations, [*lines, f"{'% ' if latex else ''}this fault is {'unstable' if model.unstable else 'stable'}"]
    )
    return 0


@app.command
def scale(
    source: str,
    target: str,
    /,
    *,
    controller: str = "cta",
    gains: Gains = ("published",),
    clock: Literal["operation-time", "natural-period"] | None = None,
    output: Output = PLAIN,
) -> int:
    """Scale gains from one fault to a similar one, and list the dimensionless groups that differ.

    Parameters
    ----------
    source
        Fault of the gains: preset or path of a .toml file.
    target
        Fault to scale them to.
    controller
        cta, dia or elqr.
    gains
        published, or the numbers of the gains in SI units (of a sliding mode: with scale λ = 1 and control ν =
        p·μ_res·N̂_min, p the pressure, μ_res the residual friction coefficient, N̂_min the smallest A/m of the source).
    clock
        Time scale from operation-time or natural-period; by default operation-time, or natural-period if the ratio of
        the operation times differs from that of the natural periods.
    """
    from quakedesign.report.terminal import scale_lines
    from quakedesign.studies.scaling import scale_answer

    clocks = {None: None, "operation-time": "reference.operation_time", "natural-period": "shear_modulus"}
    result = scale_answer(source, target, controller, gains, clock=clocks[clock])
    output.show(result, scale_lines(result))
    return 0


@app.command
def errata(*rows: int, output: Output = PLAIN) -> int:
    """List the statements of the paper that need a correction; every correction is re-checked by computation.

    Parameters
    ----------
    rows
        Row numbers; all by default.
    """
    from quakedesign.studies.errata import errata_rows, run_rows

    numbers = list(rows) or [row.number for row in errata_rows()]
    checked = []
    with progress() as bar:
        for i, number in enumerate(numbers):
            bar(f"row {number}", i / len(numbers))
            checked += run_rows([number])
    output.show({"errata": checked}, (line for row in checked for line in _row_lines(row)))
    return 0


def _row_lines(row: Json) -> list[str]:
    outcome = "correction confirmed" if row["holds"] else "CORRECTION NOT CONFIRMED"
    text = f"{row['row']}. {outcome} ({row['kind']}): {row['evidence']}"
    return [text, f"    printed: {row['printed']}", f"    correct: {row['correct']}"]


@app.command
def init(
    file: Path = Path("my-fault.toml"),
    /,
    *,
    law: str = "exponential-slip-weakening",
    schema: bool = False,
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Write a commented fault file: every key with its unit and its default.

    Parameters
    ----------
    file
        Path of the .toml file.
    law
        Friction law.
    schema
        Also write a JSON Schema, with which editors complete and check the file.
    """
    import json

    from quakedesign.errors import OutputError
    from quakedesign.fault.fault_schema import SCHEMA_NAME, fault_schema, template
    from quakedesign.files import write_whole

    if file.suffix != ".toml":
        raise OutputError(f"the file of a fault must end in .toml. Received {file}. Write {file.stem or 'fault'}.toml.")
    schema_file = file.parent / SCHEMA_NAME if schema else None
    text = template(law, schema=schema)
    for path in (file, schema_file):
        new_file(path, "fault file" if path == file else "schema", force=force)
    write_whole(file, text)
    if schema_file is not None:
        write_whole(schema_file, json.dumps(fault_schema(), indent=1, ensure_ascii=False) + "\n")
    written = [str(path) for path in (file, schema_file) if path is not None]
    entries = {"file": str(file), "schema": str(schema_file) if schema_file else None}
    output.show(entries, [f"written: {', '.join(written)}", f"next: edit it, then quakedesign fault {file}"])
    return 0


_SOURCE = (
    "Preset or .toml file from which --out takes everything except friction. If the identified friction has a state "
    "and the friction of this fault has none, the disturbance is omitted and T_s is chosen for the identified "
    "friction. T_s is also chosen if both have a state and this fault specifies no T_s."
)


@app.command
def identify(
    data: Path,
    /,
    *more: Path,
    law: str | None = None,
    stiffness: str | None = None,
    normal_stress: Pascals | None = None,
    columns: str = "",
    begin: Annotated[str | None, Parameter(name="--from")] = None,
    end: Annotated[str | None, Parameter(name="--to")] = None,
    steps: str = "",
    rates: str = "",
    states: Whole = 1,
    trend: Literal["auto", "displacement", "time", "none"] = "auto",
    seed: Whole = 0,
    fault: Annotated[FaultName, Parameter(help=_SOURCE)] = "lab-fault",
    out: Path | None = None,
    figure: Path | None = None,
    force: Force = False,
    verbose: bool = False,
    output: Output = PLAIN,
) -> int:
    """Identify friction parameters, with confidence regions, from a laboratory record.

    Velocity steps and slide-hold-slide tests give rate-and-state parameters; a measured slip, or a test on a stiff
    machine, gives slip-weakening parameters. The first line is the verdict: the fit explains the record, does not
    explain it, or the record does not suffice to decide. Exit code 0 only if the fit explains the record and every
    parameter is determined.

    Parameters
    ----------
    data
        Text with headings and units, such as 'time [s], load_point_displacement [um], shear_stress [MPa],
        normal_stress [MPa]' (load_point_rate, shear_force, normal_force, friction and slip are accepted too), with any
        column separator; or text or reduced binary of xlook; or vectors of a MATLAB file. A column weight,
        proportional to 1/variance of the friction coefficient, weights the samples.
    more
        Further files, each with one velocity step of the same experiment. Each step is fitted alone; then one law is
        fitted to all steps.
    law
        Friction law. By default rate-and-state-aging and rate-and-state-slip are fitted and the better one is chosen;
        others are regularised-rate-and-state, exponential-slip-weakening and linear-slip-weakening.
    stiffness
        Machine stiffness, such as '5 GPa/m' ('2 kN/um' for forces, '1e-3 1/um' for friction); fitted by default.
    normal_stress
        Constant normal stress, such as '5 MPa', if the record has no such column.
    columns
        Headings of the columns, such as 'time=Time(s), friction=mu_corr'; a number is the position of a column, and a
        unit may follow: 'time=1 [s]'.
    begin
        Start of the part to fit: a time ('8110 s') or a load-point displacement ('1600 um') of the file.
    end
        End of the part to fit.
    steps
        Windows of a file that are separate steps, such as '0 s to 60 s, 60 s to 120 s', or auto, which cuts midway
        between changes of rate.
    rates
        Successive rates of the load point, such as '1 um/s, 10 um/s', if known; by default they are computed from the
        displacement of the load point.
    states
        Number of friction states; 2 may explain a record that 1 does not, but a fault file can have only 1.
    trend
        Drift of friction, linear in displacement or time, or none; by default included if significant (F test at 1 %).
    seed
        Seed of the random starting points.
    out
        Fault file to write; its friction covers the whole confidence region if a fault file can express it.
    figure
        Figure of data, fit and residuals to write: .svg, .png or .pdf.
    verbose
        Also print every test, the noise, the searches and the assumptions.
    """
    from textwrap import wrap

    from quakedesign.errors import RecordError
    from quakedesign.fault import load_fault
    from quakedesign.identification.fault_file import law_remarks, next_command, other_parts, save_fault, task_remarks
    from quakedesign.identification.identify import identify as fitted
    from quakedesign.identification.several_steps import identify_steps, read_steps
    from quakedesign.report.identification_page import identification_lines, require_format, save_figure

    for path, what in ((out, "fault file"), (figure, "figure")):
        new_file(path, what, force=force)
    if figure is not None:
        require_format(figure)
    further = {f"record {i}": path for i, path in enumerate(more, start=2)}
    require_different({"--out": out, "--figure": figure, "the record": data, "--fault": Path(fault), **further})
    base_fault = load_fault(fault)
    records = [
        record
        for path in (data, *more)
        for record in read_steps(path, steps, normal_stress=normal_stress, columns=columns, begin=begin, end=end)
    ]
    spring = None if stiffness is None else in_unit(stiffness, records[0].stiffness_unit, "stiffness")
    speeds = [in_unit(part.strip(), "m/s", "rates") for part in rates.split(",") if part.strip()]
    settings: dict[str, Any] = {"stiffness": spring, "rates": speeds, "states": states, "trend": trend, "seed": seed}
    several = identify_steps(records, law, **settings) if len(records) > 1 else None
    identification = fitted(records[0], law, **settings) if several is None else several.common
    result = several or identification
    file, remarks = out, list[str]()
    if out is not None:
        try:
            save_fault(identification, base_fault, out)
            remarks.append(f"from {base_fault.name}, not from the record: {other_parts(identification, base_fault)}")
            remarks += task_remarks(identification, base_fault)
        except RecordError as error:
            file = None
            remarks.append(f"not written: {out}: {error}")
    if figure is not None:
        save_figure(result, figure)
    written = ", ".join(str(path) for path in (figure, file) if path is not None)
    remarks = [*law_remarks(identification, base_fault), *([f"written: {written}"] if written else []), *remarks]
    remarks = [line for each in remarks for line in wrap(each, 80, subsequent_indent="  ", break_long_words=False)]
    usable = file is not None or (out is None and identification.explained)
    remarks += [f"next: {next_command(identification, file)}"] if usable else []
    entries = result.to_dict() | {"figure": figure and str(figure), "file": file and str(file)}
    remarks += [] if verbose else ["tests, noise and assumptions: --verbose"]
    output.show(entries, [*identification_lines(result, verbose=verbose), *remarks])
    return 0 if identification.explained else 1


# ----------------------------------------------------------------------
# For scripts and shells: JSON Schema of every output, and names of commands and options.


@app.command
def schema(command: str, /, *, output: Output = PLAIN) -> int:
    """Print the JSON Schema (draft 2020-12) of the --json output of a command.

    Where the output for several blocks differs, the schema has a branch for it. Required keys of a branch are in every
    output of its kind; options add further keys, whose values may be null. Units are in the table of keys
    (docs/reference/json.md).

    Parameters
    ----------
    command
        Name of the command, such as design.
    """
    schemas = json.loads(resources.files("quakedesign.cli").joinpath("output_schemas.json").read_text(encoding="utf-8"))
    require_known(command, schemas, "command with a schema", UnknownNameError)
    output.show(schemas[command], lambda: print_json(schemas[command]))
    return 0


@app.command
def completion(shell: Literal["bash", "zsh", "fish"], /, *, output: Output = PLAIN) -> int:
    """Print a script that completes commands and options in a shell.

    For example: quakedesign completion bash > ~/.local/share/bash-completion/completions/quakedesign

    Parameters
    ----------
    shell
        bash, zsh or fish.
    """
    script = app.generate_completion(shell=shell)
    output.show({"shell": shell, "script": script}, lambda: sys.stdout.write(f"{script}\n"))
    return 0
