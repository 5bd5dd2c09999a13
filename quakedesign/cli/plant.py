"""Commands about the fault itself: what it is, its equations, its scaling, the paper's errata."""

from typing import Annotated, Any, Literal

from cyclopts import Parameter

from quakedesign.cli.option_values import Gains
from quakedesign.cli.options import PLAIN, Box, FaultName, Output
from quakedesign.cli.shared import app, console, print_json, progress


@app.command
def fault(fault: FaultName, /, *, box: Box = None, output: Output = PLAIN) -> int:
    """Show derived quantities of a fault and why it is unstable."""
    from quakedesign.fault import load_fault
    from quakedesign.studies.facts import fault_dict, fault_sentences

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
def derive(
    fault: FaultName, /, *, latex: Annotated[bool, Parameter(negative="")] = False, output: Output = PLAIN
) -> int:
    """Derive the equations of a fault from its force balance.

    Parameters
    ----------
    latex
        Print LaTeX instead of plain text.
    """
    from quakedesign.fault import load_fault
    from quakedesign.symbolic import derive as derive_model
    from quakedesign.symbolic.notation import latex as in_latex
    from quakedesign.symbolic.notation import plain

    model = derive_model(load_fault(fault))
    write = in_latex if latex else plain
    equations: dict[str, Any] = {
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
    """Carry gains from one fault to a similar one, and say which dimensionless groups differ.

    Parameters
    ----------
    source
        Fault that the gains are for: preset or path of a .toml file.
    target
        Fault to carry them to.
    controller
        cta, dia or elqr.
    gains
        published, or the gains of the law (λ = 1, divisor μ_res·N̂_min of the source).
    clock
        What fixes the scale of time: operation-time or natural-period; chosen by their agreement unless given.
    """
    from quakedesign.report.scaling import scale_lines
    from quakedesign.studies.scaling import scale_answer

    clocks = {None: None, "operation-time": "reference.operation_time", "natural-period": "shear_modulus"}
    answer = scale_answer(source, target, controller, gains, clock=clocks[clock])
    output.show(answer, scale_lines(answer))
    return 0


@app.command
def errata(*rows: int, output: Output = PLAIN) -> int:
    """Show where the paper cannot be taken literally, each row checked again now.

    Parameters
    ----------
    rows
        Numbers of rows; all unless given.
    """
    from quakedesign.studies.errata import errata_rows, run_rows

    numbers = list(rows) or [row.number for row in errata_rows()]
    checked = []
    with progress() as tell:
        for i, number in enumerate(numbers):
            tell(f"row {number}", i / len(numbers))
            checked += run_rows([number])
    output.show({"errata": checked}, (line for row in checked for line in _row_lines(row)))
    return 0


def _row_lines(row: dict[str, Any]) -> list[str]:
    held = "holds" if row["holds"] else "DOES NOT HOLD"
    told = f"{row['row']}. {held} ({row['kind']}): {row['evidence']}"
    return [told, f"    printed: {row['printed']}", f"    correct: {row['correct']}"]
