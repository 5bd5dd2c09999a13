"""Commands that prove, refute and re-check."""

from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

from cyclopts import Parameter

from quakedesign.cli.option_values import ExactSeconds, Gains
from quakedesign.cli.options import PLAIN, Box, Force, Output
from quakedesign.cli.shared import app, new_file, refuse
from quakedesign.errors import ParameterError


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
    """Prove or refute given gains: of a sliding mode for a bound on |h'|, of the e-LQR on a fault.

    Exit code 0 only if proved, and if the peaks that were asked for are certified.

    Parameters
    ----------
    law
        cta or another sliding mode; or elqr.
    fault
        For the e-LQR: preset or path of a .toml file.
    gains
        Exact numbers: decimals, exponents or p/q; four for cta and elqr (SI).
    lipschitz
        For a sliding mode: bound on |h'|, in the unit of ν per second.
    maximize
        For a sliding mode: lipschitz (the largest bound on |h'|; with --lipschitz also the smallest scale for that),
        beta (the upper end of its range), beta-factor (f in [b/f, b·f]) or decay (with a bound on the settling time).
    gain_range
        For a sliding mode: b_m and b_M, the range of the control coefficient β; 1 1 unless given. One value b twice to
        maximise the range.
    box
        For the e-LQR: uncertainty box, paper or ten-percent.
    feedback
        For the e-LQR: error (k1 and k2 act on x1 - r and x2 - r', the default) or state (on x1 and x2, as printed).
    step
        For the e-LQR: sampling period for which p is held, such as '140 ms' or 7/50 (s); the fault's unless given.
    peaks
        For the e-LQR: certify how fast the fault can slip at most, for every disturbance of a class, amplitude or rate,
        if the pressure acts at once (see the command guarantee for the loop that runs).
    out
        File for the certificate. Other proofs of an e-LQR go beside it, with their names added.
    """
    from quakedesign.controllers import law as law_of

    new_file(out, "certificate file", force=force)
    about_fault = {"FAULT": fault, "--box": box, "--feedback": feedback, "--step": step, "--peaks": peaks}
    about_rate = {"--lipschitz": lipschitz, "--maximize": maximize, "--gain-range": gain_range}
    if law_of(law).loop_field().domain == "reals":
        refuse(about_rate, f"{law}, which needs a FAULT instead")
        if fault is None:
            raise ParameterError(f"certify {law} needs a fault. Received none. Give a preset or a file after {law}.")
        return _certify_on_fault(fault, gains, box, feedback or "error", step, peaks, out, force, output)
    refuse(about_fault, f"{law}, which needs --lipschitz instead")
    return _certify_for_rate(law, gains, lipschitz, maximize, gain_range or ("1", "1"), out, output)


def _certify_for_rate(
    law: str, gains: tuple[str, ...], lipschitz: str | None, maximize: str | None, gain_range: tuple[str, str],
    out: Path | None, output: Output,
) -> int:  # fmt: skip
    """Verdict on a sliding mode, or how far its gains reach."""
    from quakedesign.studies.certified import certified

    answer = certified(law, gains, lipschitz=lipschitz, maximize=maximize, gain_range=gain_range)
    if answer.certificate is not None and out is not None:
        answer.certificate.save(out)
    output.show(
        {**answer.facts, "certificate": str(out) if answer.certificate is not None and out else None}, answer.lines
    )
    return 0 if str(answer.verdict) == "proved" else 1


def _certify_on_fault(
    fault: str, gains: tuple[str, ...], box: str | None, feedback: str, step: str | None, peaks: str | None,
    out: Path | None, force: bool, output: Output,
) -> int:  # fmt: skip
    """Verdict on an e-LQR."""
    from quakedesign.controllers.elqr import ExtendedLQR
    from quakedesign.fault import load_fault
    from quakedesign.report.elqr_sentences import verdict_lines
    from quakedesign.synthesis.linear.analysis.verdict import judge

    began = perf_counter()
    controller = ExtendedLQR.from_values(gains, feedback=feedback)
    judged = judge(load_fault(fault, box=box), controller, step=step, peaks=peaks)
    files = judged.save(out, force=force) if out is not None else {}
    facts = {
        **judged.to_dict(),
        "certificate": files.get("stability"),
        "certificates": files,
        "seconds": perf_counter() - began,
    }
    output.show(facts, verdict_lines(judged))
    return 0 if facts["verdict"] == "proved" and (peaks is None or facts["peaks"] is not None) else 1


@app.command
def check(
    *files: Path,
    fault: str | None = None,
    rocq: Annotated[bool, Parameter(negative="")] = False,
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
        Preset or .toml file whose constants and ranges the certificates must cover as well.
    rocq
        Write a file that Rocq's compiler, coqc, verifies, for every certificate that is not invalid. Exit code 1 if a
        kind of certificate has none.
    out
        With --rocq: folder for its files; ./quakedesign-rocq unless given.
    """
    from quakedesign.certificates.command import check_files

    if not files:
        raise ParameterError("check needs at least one certificate file. Received none. Give a path.")
    if out is not None and not rocq:
        raise ParameterError("--out is the folder of --rocq. Received it alone. Add --rocq or leave it out.")
    verdicts = check_files(files, fault)
    kept = [path for path in dict.fromkeys(files) if verdicts[str(path)][0] in ("proved", "refuted")]
    written = _write_rocq(kept, out or Path("quakedesign-rocq"), force) if rocq else {}
    said = (
        line
        for path, (verdict, statement) in verdicts.items()
        for line in (f"{path}: {verdict}", *(f"    {line}" for line in (*statement, *written.get(path, ())[1:])))
    )
    facts: dict[str, Any] = {"files": {path: verdict for path, (verdict, _) in verdicts.items()}}
    if rocq:
        facts["rocq"] = {path: written[path][0] if path in written else None for path in verdicts}
    output.show(facts, said)
    complete = not rocq or None not in facts["rocq"].values()
    return 0 if complete and all(verdict == "proved" for verdict, _ in verdicts.values()) else 1


def _write_rocq(files: list[Path], folder: Path, force: bool) -> dict[str, tuple[str | None, str]]:
    """Path of the file for coqc, or None, and what is said of it, by certificate."""
    from quakedesign.certificates.rocq import write_rocq

    return {
        str(path): (None, f"no file for coqc: {made}") if isinstance(made, str) else (str(made), f"for coqc: {made}")
        for path, made in write_rocq(files, folder, force=force).items()
    }
