"""The command that finds gains with a proof."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from quakedesign.cli.shared import Force, Json, app, console, new_file, print_json

if TYPE_CHECKING:
    from quakedesign.synthesis.gains import Synthesis


@app.command
def synthesise(
    law: str,
    /,
    *,
    objective: str = "norm",
    lipschitz: Annotated[str, Parameter(allow_leading_hyphen=True)] = "1",
    gain_range: tuple[str, str] = ("1", "1"),
    bound: float | None = None,
    degree: tuple[int, ...] = (),
    starts: int = 4,
    seed: int = 0,
    workers: int = 2,
    out: Path | None = None,
    force: Force = False,
    json: Json = False,
) -> int:
    """Find gains with a proof that are best in one respect, and compare them with those from the literature.

    Exit code 0 only if gains were proved. No gains are printed without a proof.

    Parameters
    ----------
    law
        cta, dia, super-twisting or cta3.
    objective
        norm: smallest norm of the gains, scaled to a bound of one on |h'|. decay: fastest certified decay. beta: widest
        certified range of the control coefficient.
    lipschitz
        Bound on |h'|, in the unit of ν per second.
    gain_range
        b_m and b_M, the range of the control coefficient β; for beta its middle counts, and it is covered at least.
    bound
        Largest norm of the gains for decay and beta; the smallest of the sets from the literature unless given.
    degree
        Degree of V; repeat for more. The two lowest unless given; higher ones find better gains and take longer.
    starts
        Number of starts.
    seed
        Of the random starts.
    workers
        Number of processes; no digit depends on it.
    out
        File for the certificate.
    force
        Replace an existing file.
    json
        Print JSON.
    """
    from time import perf_counter

    from quakedesign.synthesis.gains import synthesise as search

    new_file(out, "certificate file", force=force)
    began = perf_counter()
    found = search(
        law,
        objective,
        lipschitz=lipschitz,
        gain_range=gain_range,
        bound=bound,
        degrees=degree or None,
        starts=starts,
        seed=seed,
        workers=workers,
    )
    if found is not None and out is not None:
        found.certificate.save(out)
    answer = _facts(found, lipschitz) | {
        "certificate": str(out) if found is not None and out is not None else None,
        "seconds": perf_counter() - began,
    }
    if json:
        print_json(answer)
    else:
        _print(law, objective, found)
    return 0 if found is not None else 1


def _facts(found: "Synthesis | None", lipschitz: str) -> dict[str, Any]:
    """Answer as JSON: gains and ranges as texts, measured values as numbers."""
    from quakedesign.rationals import rational

    if found is None:
        return {"verdict": "undecided", "gains": None, "value": None, "compared": []}
    ranges = found.certificate.loop.uncertain
    return {
        "verdict": "proved",
        "objective": found.objective,
        "gains": {name: str(k) for name, k in found.gains.items()},
        "lipschitz": str(rational(lipschitz)),
        "gain_range": [str(v) for v in ranges["beta"]] if "beta" in ranges else None,
        "value": found.value,
        "unit": found.unit,
        "norm": found.norm,
        "compared": [
            {"gains": {n: str(k) for n, k in c.gains.items()}, "value": c.value, "norm": c.norm, "ratio": c.ratio}
            for c in found.compared
        ],
    }


def _print(law: str, objective: str, found: "Synthesis | None") -> None:
    from rich.table import Table

    out = console()
    if found is None:
        out.print(f"undecided: no gains of {law} were proved", markup=False)
        return
    gains = ", ".join(f"{name} = {k}" for name, k in found.gains.items())
    out.print(f"proved: {law} with {gains}", markup=False)
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for column in ("gains", objective if found.unit == "-" else f"{objective} [{found.unit}]", "norm", "better by"):
        table.add_column(column)
    rows: list[tuple[str, float | None, float, float | None]] = [("these", found.value, found.norm, None)]
    rows += [(" ".join(f"{float(k):.4g}" for k in c.gains.values()), c.value, c.norm, c.ratio) for c in found.compared]
    for name, value, norm, ratio in rows:
        shown = "not proved" if value is None else f"{value:.4g}"
        table.add_row(name, shown, f"{norm:.4g}", "" if ratio is None else f"{ratio:.3g}")
    out.print(table)
