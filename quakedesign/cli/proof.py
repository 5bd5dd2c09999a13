"""Commands that prove, refute and re-check."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from quakedesign.cli.shared import Force, Json, app, console, new_file, print_json


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

    from quakedesign.rationals import rational
    from quakedesign.synthesis import certify as decide

    new_file(out, "certificate file", force=force)
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
        print_json(found)
    else:
        low, high = gain_range
        line = f"{found['verdict']}: {law} {' '.join(gains)}, |h'| <= {lipschitz}, beta from {low} to {high}"
        console().print(line, markup=False)
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
        print_json({"files": {path: verdict for path, (verdict, _) in verdicts.items()}})
    else:
        for path, (verdict, statement) in verdicts.items():
            print(f"{path}: {verdict}")
            for line in statement:
                print(f"    {line}")
    return 0 if all(verdict == "proved" for verdict, _ in verdicts.values()) else 1
