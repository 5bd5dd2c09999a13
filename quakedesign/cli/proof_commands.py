"""Commands `certify`, `check`, `sos` and `attraction`: proof, refutation and re-check."""

from pathlib import Path
from time import perf_counter
from typing import Annotated

from cyclopts import Parameter

from quakedesign.cli.app import app, new_file, reject
from quakedesign.cli.options import PLAIN, Box, ExactSeconds, Force, Gains, Output
from quakedesign.errors import ParameterError, PolynomialError
from quakedesign.files import Json

# ----------------------------------------------------------------------
# Commands that prove, refute and re-check.


@app.command
def certify(
    law: str,
    fault: str | None = None,
    /,
    *,
    gains: Gains,
    lipschitz: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    maximize: str | None = None,
    gain_range: tuple[str, str] | None = None,
    box: Box = None,
    feedback: str | None = None,
    step: ExactSeconds | None = None,
    peaks: str | None = None,
    out: Path | None = None,
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Prove or refute stability with given gains: of a sliding mode under a bound on |h'|, or of the e-LQR on a fault.

    Exit code 0 only if proved, including requested peaks.

    Parameters
    ----------
    law
        cta or another sliding mode; or elqr.
    fault
        e-LQR: preset or path of a .toml file.
    gains
        Exact numbers: decimals, with or without exponent, or p/q; four for cta and for elqr (elqr: in SI units).
    lipschitz
        Sliding mode: bound on |h'|, the rate of change of the matched perturbation h, in the unit of the control ν per
        second.
    maximize
        Sliding mode: quantity to maximise: lipschitz (the bound on |h'|; also gives the smallest λ for the bound of
        --lipschitz), beta (the upper end of the range of β), beta-factor (f in the range [b/f, b·f] of β) or decay (the
        decay rate; also gives a bound of the settling time).
    gain_range
        Sliding mode: b_m and b_M, the range of the input gain β; 1 1 by default. For --maximize beta give b_m twice;
        for beta-factor give b, the centre of the range, twice.
    box
        e-LQR: uncertainty box, paper or ten-percent.
    feedback
        e-LQR: error (k1 and k2 act on x1 - r and x2 - r', default) or state (on x1 and x2, as in the paper).
    step
        e-LQR: sampling time of the zero-order hold, such as '140 ms' or 7/50 (s); the fault's by default.
    peaks
        e-LQR: certify peak slip and slip rate for every disturbance of a class, amplitude or rate, in continuous time
        (for the sampled loop use the command guarantee).
    out
        Certificate file to write. Further proofs of an e-LQR go into files beside it.
    """
    from quakedesign.laws import law as law_of

    new_file(out, "certificate file", force=force)
    about_fault = {"FAULT": fault, "--box": box, "--feedback": feedback, "--step": step, "--peaks": peaks}
    about_rate = {"--lipschitz": lipschitz, "--maximize": maximize, "--gain-range": gain_range}
    if law_of(law).loop_field().domain == "reals":
        reject(about_rate, f"{law}, which needs a FAULT instead")
        if fault is None:
            raise ParameterError(f"certify {law} needs a fault. Received none. Give a preset or a file after {law}.")
        return _certify_on_fault(fault, gains, box, feedback or "error", step, peaks, out, force, output)
    reject(about_fault, f"{law}, which needs --lipschitz instead")
    return _certify_for_rate(law, gains, lipschitz, maximize, gain_range or ("1", "1"), out, output)


def _certify_for_rate(
    law: str, gains: tuple[str, ...], lipschitz: str | None, maximize: str | None, gain_range: tuple[str, str],
    out: Path | None, output: Output,
) -> int:  # fmt: skip
    """Verdict on a sliding mode, or the largest certified value of a quantity."""
    from quakedesign.studies.certified import certified

    result = certified(law, gains, lipschitz=lipschitz, maximize=maximize, gain_range=gain_range)
    if result.certificate is not None and out is not None:
        result.certificate.save(out)
    output.show(
        {**result.facts, "certificate": str(out) if result.certificate is not None and out else None}, result.lines
    )
    return 0 if str(result.verdict) == "proved" else 1


def _certify_on_fault(
    fault: str, gains: tuple[str, ...], box: str | None, feedback: str, step: str | None, peaks: str | None,
    out: Path | None, force: bool, output: Output,
) -> int:  # fmt: skip
    """Verdict on an e-LQR."""
    from quakedesign.fault import load_fault
    from quakedesign.laws.elqr import ExtendedLQR
    from quakedesign.linear.verdict import judge
    from quakedesign.report.sentences import verdict_lines

    began = perf_counter()
    controller = ExtendedLQR.from_values(gains, feedback=feedback)
    judged = judge(load_fault(fault, box=box), controller, step=step, peaks=peaks)
    files = judged.save(out, force=force) if out is not None else {}
    entries = {
        **judged.to_dict(),
        "certificate": files.get("stability"),
        "certificates": files,
        "seconds": perf_counter() - began,
    }
    output.show(entries, verdict_lines(judged))
    return 0 if entries["verdict"] == "proved" and (peaks is None or entries["peaks"] is not None) else 1


@app.command
def check(
    *files: Path,
    fault: str | None = None,
    rocq: bool = False,
    out: Path | None = None,
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Re-check certificate files in exact arithmetic. Exit code 0 only if all are proved.

    Parameters
    ----------
    files
        Certificate files (proofs/FORMAT.md).
    fault
        Preset or .toml file: the certificates must also cover its constants and ranges.
    rocq
        For every valid certificate, write a file that Rocq's compiler, coqc, verifies. Exit code 1 if a certificate is
        of a kind for which there is no such file.
    out
        With --rocq: output folder; ./quakedesign-rocq by default.
    """
    from quakedesign.checking import check_files

    if not files:
        raise ParameterError(
            "check needs at least one certificate file. Received none. Give the path of a certificate."
        )
    if out is not None and not rocq:
        raise ParameterError("--out needs --rocq. Received --out alone. Add --rocq, or omit --out.")
    verdicts = check_files(files, fault)
    decided = [path for path in dict.fromkeys(files) if verdicts[str(path)][0] in ("proved", "refuted")]
    written = _write_rocq(decided, out or Path("quakedesign-rocq"), force) if rocq else {}
    text = (
        line
        for path, (verdict, statement) in verdicts.items()
        for line in (f"{path}: {verdict}", *(f"    {line}" for line in (*statement, *written.get(path, ())[1:])))
    )
    entries: Json = {"files": {path: verdict for path, (verdict, _) in verdicts.items()}}
    if rocq:
        entries["rocq"] = {path: written[path][0] if path in written else None for path in verdicts}
    output.show(entries, text)
    complete = not rocq or None not in entries["rocq"].values()
    return 0 if complete and all(verdict == "proved" for verdict, _ in verdicts.values()) else 1


def _write_rocq(files: list[Path], folder: Path, force: bool) -> dict[str, tuple[str | None, str]]:
    """Path of the file for coqc, or None, and a message about it, by certificate."""
    from quakedesign.rocq.rocq_export import write_rocq

    return {
        str(path): (None, f"no file for coqc: {made}") if isinstance(made, str) else (str(made), f"for coqc: {made}")
        for path, made in write_rocq(files, folder, force=force).items()
    }


# ----------------------------------------------------------------------
# Commands about polynomials and polynomial fields.

Text = Annotated[str, Parameter(allow_leading_hyphen=True)]


@app.command
def sos(
    polynomial: Text | None = None,
    /,
    *,
    on: Annotated[tuple[str, ...], Parameter(allow_leading_hyphen=True)] = (),
    multiplier: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    margin: str = "0",
    degree: int | None = None,
    products: Annotated[bool | None, Parameter(negative="--no-products")] = None,
    gram: Path | None = None,
    verbose: bool = False,
    out: Path | None = None,
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Decide whether a polynomial is a sum of squares or, with --on or --multiplier, proved non-negative by such sums.

    Exit code 0 only if this is proved.

    Parameters
    ----------
    polynomial
        Polynomial, such as "x^4 * y^2 + x^2 * y^4 + 1 - 3 * x^2 * y^2": numbers, names, + - * / ^ ** and parentheses.
    on
        A constraint such as "x >= 0", "x^2 + y^2 <= 1" or "x + y == 1"; repeat the option for more. ℝⁿ by default.
    multiplier
        Positive polynomial multiplier, or auto to search for one and to try powers of 1 + x² + y² + … (x² + y² + …, or
        x + y + … if all constraints are signs of variables, for forms).
    margin
        Decide polynomial − margin·(1 + Σ x_i^d) instead (without the 1 for forms), d the degree of the polynomial.
    degree
        Largest degree of a summand; by default the smallest possible, and under constraints also the next even one.
    products
        Use all products of constraints, or none; by default only of constraints such as x >= 0.
    gram
        Instead of a polynomial: JSON or .mat file with a polynomial and a Gram matrix of another program.
    verbose
        Print sizes of the Gram matrices before and after the exact reduction.
    out
        Proof file to write (proofs/FORMAT.md).
    """
    from quakedesign.sos import prove, read_gram
    from quakedesign.sos.exact.polynomial_files import proof_entries
    from quakedesign.sos.exact.words import sentences

    new_file(out, "proof file", force=force)
    entered = (polynomial, on, multiplier, margin, degree, products)
    if gram is not None and entered != (None, (), None, "0", None, None):
        raise PolynomialError(
            "--gram FILE contains the polynomial and its options. Received --gram with a polynomial or options. "
            "Give --gram alone."
        )
    if gram is not None:
        result = read_gram(gram).verify()
    elif polynomial is None:
        raise PolynomialError("sos needs a polynomial, or --gram FILE. Received neither. Give for example 'x^2 + 1'.")
    else:
        result = prove(polynomial, on=on, multiplier=multiplier, margin=margin, degree_bound=degree, products=products)
    if out is not None and result.proof is not None:
        result.save(out)
    entries: Json = {
        "verdict": str(result.verdict),
        "variables": list(result.statement.variables),
        "degree": result.statement.degree,
        "blocks": dict(result.blocks),
        "witness": proof_entries(result.proof) if result.proof is not None else None,
        "file": str(out) if out is not None and result.proof is not None else None,
        "remark": result.remark or None,
        "empty_set": result.set_is_empty,
        "seconds": result.seconds,
        "versions": dict(result.versions),
    }
    output.show(entries, sentences(result, verbose=verbose))
    return 0 if entries["verdict"] == "sos" else 1


@app.command
def attraction(
    field: Path,
    /,
    *,
    everywhere: bool = False,
    relative: float = 1e-4,
    degree: int | None = None,
    shape: Text | None = None,
    out: Path | None = None,
    above: Path | None = None,
    inclusion: Path | None = None,
    force: Force = False,
    output: Output = PLAIN,
) -> int:
    """Find the largest sublevel set of a Lyapunov function from which convergence to the origin is proved.

    Exit code 0 if a level, or with --everywhere global convergence, is proved.

    Parameters
    ----------
    field
        TOML file with a table [field]: the rate of every state, such as x = "-y" and y = "x + (x^2 - 1)*y", as a
        polynomial that vanishes at the origin. A line V = "..." before this table is optional. By default V = x^T P x
        with A^T P + P A = -I, A the Jacobian of the field at the origin; with --everywhere a V of degree 2 or 4 is
        searched for.
    everywhere
        Prove global convergence. If that fails, look for a refutation: a point that refutes the given V or, without a
        given V, a second equilibrium, which refutes every V.
    relative
        Relative width of the last bisection interval, from 1e-6 to below 1.
    degree
        Also search for V of at most this even degree (or that of the given V, if higher), to enlarge the sublevel set
        of --shape that lies in the proved region of attraction.
    shape
        Positive definite polynomial, such as "x^2 + 2*y^2": proves the largest b whose sublevel set shape <= b lies in
        the proved region. With --degree the default is the sum of squares of the states.
    out
        Proof file to write; the refutation if nothing is proved, unless --above is given.
    above
        File for the point that refutes every level above the value of V there.
    inclusion
        File for the proof that the sublevel set of the shape lies in the region.
    """
    from quakedesign.sos import Answer, Attraction, Region, region_of_attraction, save_attraction, stability
    from quakedesign.sos.exact.attraction import read_field
    from quakedesign.sos.exact.words import region_entries, region_words

    began = perf_counter()
    for path, what in ((out, "proof file"), (above, "refutation file"), (inclusion, "proof file")):
        new_file(path, what, force=force)
    rates, function = read_field(field)
    if everywhere and (degree, shape) != (None, None):
        raise PolynomialError(
            "--degree and --shape cannot be used with --everywhere. Received at least one of them. "
            "Omit --everywhere, or --degree and --shape."
        )
    if everywhere:
        region = Region.of(stability(rates, function))
    else:
        region = region_of_attraction(rates, function, relative=relative, degree=degree, shape=shape)
    files: dict[str, tuple[Path | None, Attraction | Answer | None]] = {
        "file": (out, region.proved or (None if above else region.refuted)),
        "file_above": (above, region.refuted),
        "file_inclusion": (inclusion, region.inclusion),
    }
    written: dict[str, str | None] = dict.fromkeys(files)
    for key, (path, proof) in files.items():
        if path is not None and proof is not None:
            written[key] = str(path)
            proof.save(path) if isinstance(proof, Answer) else save_attraction(proof, path)
    seconds = perf_counter() - began
    lines = [*region_words(region), f"{seconds:.2f} s; checked in exact arithmetic"]
    output.show({**region_entries(region), **written, "seconds": seconds}, lines)
    return 0 if region.proved is not None else 1
