"""The command line. Every command returns its exit code; heavy libraries load inside the commands."""

import io
import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import App, CycloptsError, Parameter
from rich.console import Console

from quakedesign.errors import QuakedesignError, UnknownNameError

Json = Annotated[bool, Parameter(name="--json", negative="")]
Force = Annotated[bool, Parameter(negative="")]

app = App(
    name="quakedesign",
    help="Design controllers that let a fault slip slowly instead of in an earthquake, and prove that they do.",
    version_flags=["--version"],
)


def _version() -> str:
    from importlib.metadata import version

    return version("quakedesign")


app.version = _version


def _print(value: dict[str, Any]) -> None:
    print(json.dumps(value, indent=1, allow_nan=False))


def _console() -> Console:
    return Console(highlight=False, soft_wrap=True)


@contextmanager
def _progress() -> Iterator[Callable[[str, float], None]]:
    """Progress bar on stderr, which leaves stdout to the answer."""
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    columns = TextColumn("{task.description:44}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn()
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("starting", total=1.0)

        def tell(what: str, done: float) -> None:
            bar.update(task, description=what, completed=done)

        yield tell


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
    from quakedesign.report.facts import fault_dict, fault_sentences

    found = load_fault(fault, box=box)
    if json:
        _print(fault_dict(found))
        return 0
    console = _console()
    console.print(f"[bold]{found.name}[/bold] ({found.source})")
    for line in fault_sentences(found):
        console.print(f"  {line}")
    return 0


def _plain(expression: Any) -> str:
    """Text of a SymPy expression with its LaTeX names made plain, such as k_hat."""
    import re

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
        _print(found)
        return 0
    console = _console()
    console.print("e1' = e2, e2' = beta (nu + h)", markup=False)
    for name in ("beta", "h"):
        console.print(f"{name} = {found['error_dynamics'][name]}", markup=False)
    for name in ("jacobian", "instability", "unstable"):
        console.print(f"{name}: {found[name]}", markup=False)
    return 0


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

    with _progress() as tell:
        designs = []
        for i, name in enumerate(names):
            tell(f"synthesis and proof of {name}", i / len(names))
            designs.append(synthesise(found, name))
        comparison = compare(found, designs, progress=tell)
        results = write_folder(comparison, folder, force=force, tell=tell)
    if json:
        _print(results)
    else:
        from quakedesign.report.terminal import print_comparison

        print_comparison(comparison, _console())
        _console().print(f"\nwritten: {folder}/ (results.json, report.html, certificates, figures)")
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


@app.command
def certify(
    law: str,
    /,
    *,
    gains: Annotated[tuple[str, str, str, str], Parameter(allow_leading_hyphen=True)],
    lipschitz: Annotated[str, Parameter(allow_leading_hyphen=True)],
    gain_range: tuple[str, str] = ("1", "1"),
    out: Path | None = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Prove or refute given gains of a sliding-mode law. Exit code 0 only if proved.

    Parameters
    ----------
    law
        cta or dia.
    gains
        Four exact numbers: decimals, exponents or p/q.
    lipschitz
        Bound on |h'|, in the unit of ν per second.
    gain_range
        b_m and b_M, the range of the control coefficient β.
    out
        File for the certificate.
    force
        Replace an existing file.
    json
        Print JSON.
    """
    from time import perf_counter

    from quakedesign.errors import OutputError
    from quakedesign.rationals import rational
    from quakedesign.synthesis import certify as decide

    if out is not None and out.exists() and not force:
        raise OutputError(f"certificate file must be new. Received {out}, which exists. Give --force to replace it.")
    began = perf_counter()
    verdict, certificate = decide(law, gains, lipschitz=lipschitz, gain_range=gain_range)
    if certificate is not None and out is not None:
        certificate.save(out)
    found = {
        "verdict": str(verdict),
        "lipschitz": str(rational(lipschitz)),
        "gain_range": [str(rational(v)) for v in gain_range],
        "decay": str(certificate.claims["decrease"]) if certificate and certificate.claims else None,
        "certificate": str(out) if certificate is not None and out is not None else None,
        "seconds": perf_counter() - began,
    }
    if json:
        _print(found)
    else:
        low, high = gain_range
        line = f"{found['verdict']}: {law} {' '.join(gains)}, |h'| <= {lipschitz}, beta from {low} to {high}"
        _console().print(line, markup=False)
    return 0 if found["verdict"] == "proved" else 1


@app.command
def check(*files: Path, fault: str | None = None, json: Json = False) -> int:
    """Re-check certificate files in exact arithmetic. Exit code 0 only if all are proved.

    Parameters
    ----------
    files
        Certificate files (proofs/FORMAT.md).
    fault
        Preset or .toml file whose constants and ranges the certificates must cover as well.
    json
        Print JSON.
    """
    from quakedesign.certificates.command import check_files
    from quakedesign.errors import ParameterError

    if not files:
        raise ParameterError("check needs at least one certificate file. Received none. Give a path.")
    verdicts = check_files(files, fault)
    if json:
        _print({"files": {path: verdict for path, (verdict, _) in verdicts.items()}})
    else:
        for path, (verdict, statement) in verdicts.items():
            print(f"{path}: {verdict}")
            for line in statement:
                print(f"    {line}")
    return 0 if all(verdict == "proved" for verdict, _ in verdicts.values()) else 1


@app.command
def simulate(
    fault: str,
    /,
    *,
    controller: str = "none",
    gains: Annotated[tuple[str, ...], Parameter(allow_leading_hyphen=True, consume_multiple=True)] = ("published",),
    step: float | None = None,
    scheme: str = "continuous",
    method: str = "dormand-prince",
    plant: str = "smooth",
    out: Path | None = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Run one closed loop over the whole task, or the natural earthquake without a controller.

    Parameters
    ----------
    fault
        Preset or path of a .toml file.
    controller
        none, cta, dia or elqr.
    gains
        published, or the gains of the law (λ = 1, divisor μ_res·N̂_min).
    step
        Length of one step in s; the fault's sampling time unless given.
    scheme
        continuous.
    method
        dormand-prince or rk4.
    plant
        smooth (the paper's, for forward slip) or coulomb (set-valued friction: stick, slip, reversal).
    out
        NetCDF file to write.
    force
        Replace an existing file.
    json
        Print JSON.
    """
    from quakedesign.errors import OutputError
    from quakedesign.fault import load_fault
    from quakedesign.report.single import run_single

    if out is not None and out.exists() and not force:
        raise OutputError(f"output file must be new. Received {out}, which exists. Give --force to replace it.")
    found = load_fault(fault)
    with _progress() as tell:
        trajectory, premises = run_single(
            found,
            controller,
            gains,
            step=step,
            scheme=scheme,
            method=method,
            plant=plant,
            tell=lambda done: tell("simulation", done),
        )
    if out is not None:
        trajectory.save(out)
    metrics = trajectory.metrics.to_dict()
    answer = {
        "metrics": metrics,
        "premises": [p.to_dict() for p in premises],
        "events": dict(trajectory.events),
        "steps": metrics["steps"],
        "seconds": metrics["seconds"],
        "run": dict(trajectory.provenance),
    }
    if json:
        _print(answer)
    else:
        from quakedesign.report.terminal import print_run

        print_run(trajectory, premises, _console())
    return 0


@app.command
def scale(
    source: str,
    target: str,
    /,
    *,
    controller: str = "cta",
    gains: Annotated[tuple[str, ...], Parameter(allow_leading_hyphen=True, consume_multiple=True)] = ("published",),
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
    from quakedesign.report.scaling import scale_answer, scale_lines

    clocks = {None: None, "operation-time": "reference.operation_time", "natural-period": "shear_modulus"}
    answer = scale_answer(source, target, controller, gains, clock=clocks[clock])
    if json:
        _print(answer)
    else:
        print("\n".join(scale_lines(answer)))
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
    from quakedesign.report.errata import errata_rows, run_rows

    numbers = list(rows) or [row.number for row in errata_rows()]
    found = []
    with _progress() as tell:
        for i, number in enumerate(numbers):
            tell(f"row {number}", i / len(numbers))
            found += run_rows([number])
    if json:
        _print({"errata": found})
    else:
        for row in found:
            print(f"{row['row']}. {'holds' if row['holds'] else 'DOES NOT HOLD'} ({row['kind']}): {row['evidence']}")
            print(f"    printed: {row['printed']}\n    correct: {row['correct']}")
    return 0


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its code; every refusal is one line on stderr and exit code 2."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        code = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        sys.exit(code if isinstance(code, int) else 0)
    except QuakedesignError as error:
        _refuse(str(error))
    except CycloptsError as error:
        _refuse(str(error))
    except KeyboardInterrupt:
        print("quakedesign: interrupted; nothing was written.", file=sys.stderr)
        sys.exit(130)
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(1)
    except Exception as error:
        if "QUAKEDESIGN_TRACEBACK" in os.environ:
            raise
        defect = " ".join(f"{type(error).__name__}: {error}".split())
        print(f"quakedesign: defect: {defect}. Set QUAKEDESIGN_TRACEBACK=1 for the place.", file=sys.stderr)
        sys.exit(3)


def _refuse(reason: str) -> None:
    print("quakedesign: " + " ".join(reason.split()), file=sys.stderr)
    sys.exit(2)


if __name__ == "__main__":
    main()
