"""Re-checking certificate files: a verdict and the statement that was verified."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from quakedesign import fault as faults
from quakedesign import guarantees, lyapunov
from quakedesign import plant as plants
from quakedesign.arguments import checked
from quakedesign.errors import CertificateError, WorkError
from quakedesign.exact import UpperBound, apart, rational
from quakedesign.lyapunov.exact.certificate import Certificate
from quakedesign.lyapunov.exact.certificate_files import (
    ATTRACTION,
    GUARANTEE,
    LOOP,
    SLOW_SLIDING,
    STICK_SLIP,
    UNCERTAIN_PLANT,
    entry_lines,
    evidence_of,
    kind_of,
    read_json,
)
from quakedesign.lyapunov.exact.claim import Verdict
from quakedesign.sos.exact.answer import Answer, Positivity
from quakedesign.sos.exact.attraction import read as read_attraction
from quakedesign.sos.exact.polynomial_files import read as read_polynomial_file
from quakedesign.sos.exact.words import claim_words, sentences, statement_words
from quakedesign.symbolic.terms import written

if TYPE_CHECKING:
    from quakedesign.fault import Fault


__all__ = ["check_files"]


@checked
def check_files(paths: Sequence[Path], fault: str | None = None) -> dict[str, tuple[str, list[str]]]:
    """Verdict (``proved``, ``refuted``, ``undecided: reason``, ``invalid: reason``) and statement, by file.

    Parameters
    ----------
    paths : sequence of Path
    fault : str, optional
        Name of a preset or path of a fault file; the statement must be about this fault.

    Returns
    -------
    dict of str to (str, list of str)
        Verdict and lines of the statement, by path; no lines for ``undecided`` and ``invalid``.

    Raises
    ------
    CertificateError
        For a path that is not a file.
    QuakedesignError
        For a fault that cannot be read.
    """
    plant = faults.load_fault(fault) if fault else None
    return {str(path): _checked(path, plant) for path in paths}


def _checked(path: Path, fault: "Fault | None") -> tuple[str, list[str]]:
    try:
        is_file = path.is_file()
    except (OSError, ValueError):
        is_file = False
    if not is_file:
        raise CertificateError(f"certificate must be a file. Received {path}, which is not a file. Check the path.")
    try:
        raw = read_json(path)
        kind = kind_of(raw)
        if kind in (GUARANTEE, SLOW_SLIDING, STICK_SLIP):
            return _guarantee(raw, fault)
        if kind == UNCERTAIN_PLANT:
            return _plant(raw, fault)
        if kind != LOOP:
            verdict_of, said = _attraction(raw) if kind == ATTRACTION else _polynomial(raw)
            return verdict_of, said if fault is None else [
                *said,
                f'the file names no fault: not compared with "{fault.name}"',
            ]
        certificate = Certificate.of(evidence_of(raw))
        verdict = certificate.check()
        more = lyapunov.covers(certificate, fault) if fault is not None and verdict is Verdict.PROVED else []
    except WorkError as error:
        return f"undecided: {error}", []
    except CertificateError as error:
        return f"invalid: {' '.join(str(error).split())}", []
    return str(verdict), [*statement(certificate), *more]


def _guarantee(raw: Any, fault: "Fault | None") -> tuple[str, list[str]]:
    """Verdict on a file about a sampled loop, and whether its data are those of a fault."""
    claim: Any = guarantees.read_guarantee(raw)
    if claim.check() is not Verdict.PROVED:
        raise CertificateError("the claims do not follow from the loop and the fault's data")
    about = entry_lines(guarantees.guarantee_document(claim))
    lines = [f'fault "{claim.task.name}", by the data in the file', claim.sentence(), *about]
    if fault is not None:
        task, healing = plants.plant_like(claim.task, fault, wide=True), rational(fault.friction.rest_excess)
        covers = claim.covers_healing and healing > 0
        if covers:
            task, covered_healing = claim.beside_healing(task, healing)
            if covered_healing is not None:
                raise CertificateError(
                    f'healing of "{fault.name}" must be at most {covered_healing:.3g}, the largest that the proof '
                    f"covers together with the disturbance of the fault. Received {UpperBound(healing):.3g}"
                )
        if claim.task != replace(task, name=claim.task.name):
            raise CertificateError(f'the data are not those of "{fault.name}"')
        lines.append(f'the data are those of "{fault.name}"{_other_step(claim, fault)}')
        if healing:
            above = f"friction at rest up to {UpperBound(healing):.3g} above friction in slip"
            lines.append(f"{'' if covers else 'not '}covered: {above} (healing of the fault file)")
    return str(Verdict.PROVED), lines


def _plant(raw: Any, fault: "Fault | None") -> tuple[str, list[str]]:
    """Verdict on a file about an uncertain plant, which names no fault."""
    claim = guarantees.read_guarantee(raw)
    if claim.check() is not Verdict.PROVED:
        raise CertificateError("the claims do not follow from the plant and the law")
    lines = [claim.sentence(), *entry_lines(guarantees.guarantee_document(claim))]
    return str(Verdict.PROVED), lines if fault is None else [
        *lines,
        f'the file names no fault: not compared with "{fault.name}"',
    ]


def _other_step(claim: Any, fault: "Fault") -> str:
    """The box, and a remark if the sampling time of the loop differs from that of the fault."""
    if claim.slides:
        return ""
    text = f", box {fault.box.name}"
    own = rational(fault.sampling_time)
    if not claim.sampled or claim.sampled_loop.step == own:
        return text
    proved, its = apart(claim.sampled_loop.step, own)
    return f"{text}; proved at T_s = {proved} s, NOT at the T_s of the fault, {its} s"


def _polynomial(raw: Any) -> tuple[str, list[str]]:
    """Verdict on a file about a plain polynomial."""
    statement, proof = read_polynomial_file(raw)
    answer = Answer(statement=statement, proof=proof)
    if not answer.check():
        raise CertificateError("the proof does not decide the statement")
    kind = "proved" if answer.verdict is Positivity.SOS else "refuted"
    lines = [line for line in sentences(answer) if not line.endswith("exact arithmetic")]
    return kind, [*lines, *statement_words(answer)]


def _attraction(raw: Any) -> tuple[str, list[str]]:
    """Verdict on a file about a region of attraction."""
    claim = read_attraction(raw)
    if not claim.check():
        raise CertificateError("the proof does not decide the claim")
    return claim.verdict, claim_words(claim)


def statement(certificate: Certificate) -> list[str]:
    """Statement of a certificate as lines of text."""
    loop = certificate.loop
    lines = ["in continuous time, for the equations below: sampling with zero-order hold is not covered"]
    lines.append(f"law {loop.law}, vector field equal to that of the law")
    lines.append(", ".join(f"{name} = {v}" for name, v in loop.parameters.items()))
    weights = ", ".join(f"{name} = {weight}" for name, weight in loop.states.items())
    lines.append(f"domain: {loop.domain}; states with weights: {weights}")
    lines.append(", ".join(f"{name} in [{low}, {high}]" for name, (low, high) in loop.uncertain.items()))
    lines += [
        f"{name} in [{low}, {high}] is the positive square root of {of}"
        for name, (of, (low, high)) in loop.roots.items()
    ]
    lines += [f"argument of a nested power: {lift} = {written(terms)}" for lift, terms in loop.lifts.items()]
    lines += [f"{state}' = {written(terms)}" for state, terms in loop.field.items()]
    if certificate.refutation is not None:
        equilibrium = certificate.refutation
        point = ", ".join(f"{name}: {v}" for name, v in equilibrium.point.items())
        lines.append(f"Filippov equilibrium away from the origin, in cell coordinates {point}")
        for of, values in (("parameters", equilibrium.parameters), ("weights of the cells", equilibrium.weights)):
            lines += [f"{of}: {', '.join(f'{name} = {v}' for name, v in values.items())}"] if values else []
        return lines
    lines.append("V = " + " + ".join(f"({written([term])})" for term in certificate.lyapunov))
    lines.append("SignedPower(x, a) is |x|^a with the sign of x, AbsolutePower(x, a) is |x|^a")
    lines.append("claims: " + ", ".join(f"{name} {v}" for name, v in certificate.claims.items()))
    return lines
