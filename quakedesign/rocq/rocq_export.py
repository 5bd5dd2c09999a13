"""Self-contained files for Rocq: the library of ``proofs/rocq``, a statement and its proof."""

import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import cast

from quakedesign.errors import OutputError, UnsupportedError
from quakedesign.files import made_folder, sole_writer, write_whole
from quakedesign.guarantees.exact.guarantee_files import read_guarantee
from quakedesign.guarantees.exact.stick_slip_proof import StickSlipProof
from quakedesign.lyapunov.exact.certificate_files import (
    ATTRACTION,
    POLYNOMIAL,
    STICK_SLIP,
    evidence_of,
    kind_of,
    read_json,
)
from quakedesign.lyapunov.exact.claim import Evidence, Witness
from quakedesign.lyapunov.exact.obligations import claimed, different, statement_of
from quakedesign.rocq import gallina
from quakedesign.rocq.gallina import in_integers, multiplier_reason
from quakedesign.rocq.loops import loop_theorems
from quakedesign.rocq.polytopes import polytope_theorem
from quakedesign.sos.exact.attraction import LyapunovProof
from quakedesign.sos.exact.attraction import read as read_attraction_file
from quakedesign.sos.exact.polynomial import evaluate
from quakedesign.sos.exact.polynomial_files import read as read_polynomial_file
from quakedesign.sos.exact.polynomial_statement import Statement
from quakedesign.sos.exact.proofs import Point, SumOfSquares

_LIBRARY = ("squares.v", "positivity.v", "loops.v")
_POLYTOPES = "polytope.v"  # of the stick–slip plant
_KINDS = (
    "a certificate for coqc must be sos, negative, stick_slip or a proof for a closed loop or a region of attraction."
)
_DATA = "(* " + "=" * 16 + " the certificate *)\n\nLocal Open Scope nat_scope.\n"


def rocq_text(raw: object) -> str:
    """Text of the file for ``coqc``, from a parsed certificate file alone.

    Raises
    ------
    CertificateError
        If the certificate violates a rule of FORMAT.md.
    UnsupportedError
        For a kind without a theorem in ``proofs/rocq``.
    """
    parts = (_POLYTOPES,) if kind_of(raw) == STICK_SLIP else _LIBRARY
    return "\n".join([*library(parts), _DATA, statement_text(raw)])


def statement_text(raw: object) -> str:
    """Statement, data and theorem, without the library. Raises as `rocq_text`."""
    written = {ATTRACTION: _attraction, POLYNOMIAL: _polynomial, STICK_SLIP: _stick_slip}.get(kind_of(raw), _loop)
    return "\n".join(written(raw)) + "\n"


def write_rocq(paths: Iterable[Path], folder: Path, *, force: bool = False) -> dict[Path, Path | str]:
    """Write a file for ``coqc`` for every certificate file, each atomically.

    Parameters
    ----------
    paths : iterable of Path
        Certificate files that were checked.
    folder : Path
        Folder for NAME.v, with an underscore for every character of the certificate's name that Rocq rejects.
    force : bool
        Replace files that exist.

    Returns
    -------
    dict of Path to Path or str
        The file, or the reason why there is none.

    Raises
    ------
    OutputError
        If a file exists (without `force`) or cannot be written, or two certificates would have the same file NAME.v.
    CertificateError
        If a certificate cannot be read, or violates a rule of FORMAT.md.
    """
    targets: dict[Path, Path] = {}
    for path in paths:
        target = folder / f"{module_name(path.stem)}.v"
        if target in targets.values():
            raise OutputError(f"files for coqc must differ in name. Received {target} twice. Use two folders.")
        if target.exists() and not force:
            raise OutputError(
                f"file for coqc must be new. Received {target}, which exists. Give --force to replace it."
            )
        targets[path] = target
    written: dict[Path, Path | str] = {}
    for path, target in targets.items():
        try:
            text = rocq_text(read_json(path))
        except UnsupportedError as error:
            written[path] = str(error)
            continue
        with made_folder(folder), sole_writer(folder):
            write_whole(target, text)
        written[path] = target
    return written


def module_name(stem: str) -> str:
    """File name that Rocq accepts."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", stem)
    return name if name[:1].isalpha() else f"certificate_{name}"


def library(names: Sequence[str] = _LIBRARY) -> list[str]:
    """Text of files of ``proofs/rocq``, in order.

    Raises
    ------
    UnsupportedError
        If the library is missing.
    """
    package = Path(__file__).resolve().parents[1]
    places = [base / "proofs" / "rocq" for base in (package, package.parent)]
    for place in places:
        if place.is_dir():
            return [(place / name).read_text(encoding="utf-8") for name in names]
    raise UnsupportedError(f"the Rocq library must be in {places[0]}. Received none. Install quakedesign again.")


def _stick_slip(raw: object) -> Iterator[str]:
    yield from polytope_theorem(cast(StickSlipProof, read_guarantee(raw)))


def _polynomial(raw: object) -> Iterator[str]:
    statement, proof = read_polynomial_file(raw)
    yield f"(* variables 0, 1, ...: {', '.join(statement.variables)} *)"
    yield f"Definition asked : question := {gallina.question(statement)}."
    if isinstance(proof, Point):
        yield from _negative(statement, proof)
    elif isinstance(proof, SumOfSquares):
        yield from _nonnegative(statement, proof)
    else:
        raise UnsupportedError(f"{_KINDS} Received kind not-sos. Use check.py.")


def _negative(statement: Statement, proof: Point) -> Iterator[str]:
    yield f"Definition point : list Q := {gallina.listed(map(gallina.rational, proof.coordinates))}."
    values = (evaluate(p, proof.coordinates) for p in (statement.polynomial, *statement.inequalities))
    yield f"Definition values : list Q := {gallina.listed(map(gallina.rational, values))}."
    yield gallina.accepted("negative asked point values")
    yield (
        "Theorem certificate :\n"
        "  within (real_point point) asked /\\ (at_point (real_point point) (target asked) < 0)%R.\n"
        "Proof. exact (negative_sound asked point values accepted). Qed.\nPrint Assumptions certificate."
    )


def _nonnegative(statement: Statement, proof: SumOfSquares) -> Iterator[str]:
    why = multiplier_reason(statement, proof.multiplier)
    yield f"Definition proof : witness := {gallina.witness(in_integers(statement, proof.squares, proof.cofactors))}."
    yield f"Definition why : reason := {gallina.reason(why)}."
    yield gallina.accepted("nonnegative asked proof why")
    yield (
        "Theorem certificate : forall x, within x asked -> (0 <= at_point x (target asked))%R.\n"
        "Proof. exact (nonnegative_sound asked proof why accepted). Qed.\nPrint Assumptions certificate."
    )


def _attraction(raw: object) -> Iterator[str]:
    claim = read_attraction_file(raw)
    if not isinstance(claim.proof, LyapunovProof):
        raise UnsupportedError(f"{_KINDS} Received a refutation of an attraction. Use check.py.")
    yield f"(* variables 0, 1, ...: {', '.join(claim.variables)} *)"
    yield "(* V, and minus its derivative where V is at most the level *)"
    parts = ((claim.positive, claim.proof.positive), (claim.decrease, claim.proof.decrease))
    for number, (statement, proof) in enumerate(parts):
        why = f" ({gallina.reason(multiplier_reason(statement, proof.multiplier))})"
        yield _part(statement, proof, "nonnegative", why).replace("@", str(number))
    yield from _everywhere(range(len(parts)))


def _everywhere(numbers: Sequence[int]) -> Iterator[str]:
    """Theorem that the polynomial of every question is non-negative on its set."""
    yield f"Definition questions : list question := {gallina.listed(f'asked_{n}' for n in numbers)}."
    holds = "Forall (fun q => forall x, within x q -> (0 <= at_point x (target q))%R)"
    yield f"Theorem certificate : {holds} questions.\nProof. exact ({_all(numbers)}). Qed."
    yield "Print Assumptions certificate."


def _all(numbers: Sequence[int]) -> str:
    return f"{''.join(f'Forall_cons _ holds_{n} (' for n in numbers)}Forall_nil _{')' * len(numbers)}"


def _part(statement: Statement, proof: SumOfSquares | Witness, check: str, tail: str = "") -> str:
    """One question with its proof, with @ as placeholder for its number."""
    data = in_integers(statement, proof.squares, proof.cofactors)
    return "\n".join(
        [
            f"Definition asked_@ : question := {gallina.question(statement)}.",
            f"Definition proof_@ : witness := {gallina.witness(data)}.",
            gallina.accepted(f"{check} asked_@ proof_@{tail}", "accepted_@"),
            f"Definition holds_@ := {check}_sound asked_@ proof_@{tail} accepted_@.\n",
        ]
    )


def _loop(raw: object) -> Iterator[str]:
    if isinstance(raw, dict) and ("kind" in raw or "refutation" in raw):
        raise UnsupportedError(f"{_KINDS} Received kind {raw.get('kind', 'refutation')}. Use check.py.")
    evidence = evidence_of(raw)
    names = []
    for number, (name, text) in enumerate(_obligations(evidence)):
        names.append(number)
        yield f"(* {name} *)\n{text.replace('@', str(number))}"
    if evidence.loop.domain == "reals":
        yield from _everywhere(names)
        return
    yield f"Definition questions : list question := {gallina.listed(f'asked_{n}' for n in names)}."
    yield f"Theorem certificate : all_hold questions.\nProof. exact ({_all(names)}). Qed."
    yield from loop_theorems(evidence)


def _obligations(evidence: Evidence) -> Iterator[tuple[str, str]]:
    """Name of every obligation, and its question and proof with @ as placeholder for its number."""
    domain = evidence.loop.domain
    for one in different(claimed(evidence.loop, evidence.lyapunov, evidence.claims)):
        given = evidence.witnesses[one.name]
        statement = statement_of(one, domain, given.multiplier)
        how = ("nonnegative", " Terms") if domain == "reals" else ("on_cell",)
        yield one.name, _part(statement, given, *how)
