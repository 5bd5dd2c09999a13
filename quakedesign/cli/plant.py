"""Commands about the fault itself: what it is, its equations, its scaling, the paper's errata."""

import re
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from quakedesign.cli.shared import Gains, Json, app, console, print_json, print_lines, progress


@app.command
def fault(fault: str, /, *, box: str | None = None, json: Json = False) -> int:
    """Show derived quantities of a fault and why it is unstable.

    Parameters
    ----------
    fault
        Preset (real-fault, lab-fault) or path of a .toml file.
    box
        Uncertainty box: paper or ten-percent.
    json
        Print JSON with SI values.
    """
    from quakedesign.fault import load_fault
    from quakedesign.studies.facts import fault_dict, fault_sentences

    found = load_fault(fault, box=box)
    if json:
        print_json(fault_dict(found))
        return 0
    screen = console()
    screen.print(found.name, style="bold", end=" ")
    screen.print(f"({found.source})")
    for line in fault_sentences(found):
        screen.print(f"  {line}")
    return 0


def _plain(expression: Any) -> str:
    """Text of a SymPy expression with its LaTeX names made plain, such as k_hat."""
    return re.sub(r"\\hat\{\\?(\w+)\}", r"\1_hat", str(expression)).replace("\\", "")


@app.command
def derive(fault: str, /, *, latex: Annotated[bool, Parameter(negative="")] = False, json: Json = False) -> int:
    """Derive the equations of a fault from its force balance.

    Parameters
    ----------
    fault
        Preset or path of a .toml file.
    latex
        Print LaTeX instead of plain text.
    json
        Print JSON.
    """
    import sympy as sp

    from quakedesign.fault import load_fault
    from quakedesign.symbolic import derive as derive_model

    model = derive_model(load_fault(fault))
    write = sp.latex if latex else _plain
    found: dict[str, Any] = {
        "error_dynamics": {"beta": write(model.error_dynamics.beta), "h": write(model.error_dynamics.h)},
        "jacobian": write(model.jacobian),
        "instability": write(model.instability),
        "unstable": model.unstable,
    }
    if json:
        print_json(found)
        return 0
    screen = console()
    screen.print("e1' = e2, e2' = beta (nu + h)")
    for name in ("beta", "h"):
        screen.print(f"{name} = {found['error_dynamics'][name]}")
    for name in ("jacobian", "instability", "unstable"):
        screen.print(f"{name}: {found[name]}")
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
    json: Json = False,
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
    json
        Print JSON.
    """
    from quakedesign.report.scaling import scale_lines
    from quakedesign.studies.scaling import scale_answer

    clocks = {None: None, "operation-time": "reference.operation_time", "natural-period": "shear_modulus"}
    answer = scale_answer(source, target, controller, gains, clock=clocks[clock])
    if json:
        print_json(answer)
    else:
        print_lines(scale_lines(answer))
    return 0


@app.command
def errata(*rows: int, json: Json = False) -> int:
    """Show where the paper cannot be taken literally, each row checked again now.

    Parameters
    ----------
    rows
        Numbers of rows; all unless given.
    json
        Print JSON.
    """
    from quakedesign.studies.errata import errata_rows, run_rows

    numbers = list(rows) or [row.number for row in errata_rows()]
    found = []
    with progress() as tell:
        for i, number in enumerate(numbers):
            tell(f"row {number}", i / len(numbers))
            found += run_rows([number])
    if json:
        print_json({"errata": found})
    else:
        for row in found:
            held = "holds" if row["holds"] else "DOES NOT HOLD"
            told = f"{row['row']}. {held} ({row['kind']}): {row['evidence']}"
            print_lines([told, f"    printed: {row['printed']}", f"    correct: {row['correct']}"])
    return 0
