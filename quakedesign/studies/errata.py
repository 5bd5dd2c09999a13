"""Errata of the paper: each row has a computed check in ``proofs/errata``."""

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from time import perf_counter
from types import ModuleType

from quakedesign.errors import ParameterError, UnknownNameError, require_known
from quakedesign.files import Json

KINDS = ("symbolic identity", "counterexample", "numeric reproduction")


@dataclass(frozen=True, slots=True)
class Finding:
    """Result of a check."""

    holds: bool  # Whether the corrected form holds, and the printed one fails if the row states this
    evidence: str  # The numbers, in one line


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrataRow:
    """One correction of the paper, with its check.

    Raises
    ------
    ParameterError
        For an unknown kind.
    """

    number: int
    # printed, correct: Both forms, in one line of text
    printed: str
    correct: str
    kind: str  # One of `KINDS`
    # Returns a `Finding`. Its optional argument replaces the corrected form by another, which must then fail.
    check: Callable[..., Finding]

    def __post_init__(self) -> None:
        require_known(self.kind, KINDS, "kind of an erratum")


def errata_folder() -> Path:
    """Folder of the checks: inside an installed package, or beside the package in a checkout.

    Raises
    ------
    UnknownNameError
        When there is none.
    """
    package = Path(__file__).resolve().parent.parent
    places = [base / "proofs" / "errata" for base in (package, package.parent)]
    for place in places:
        if place.is_dir():
            return place
    raise UnknownNameError(
        f"the checks of the errata must be in {places[0]}. Received no such folder. Install the package again."
    )


@cache
def errata_rows() -> tuple[ErrataRow, ...]:
    """Every row, by number.

    Raises
    ------
    ParameterError
        When two rows carry the same number.
    """
    modules = [_load(path) for path in sorted(errata_folder().glob("*.py"))]
    rows = sorted((row for module in modules for row in module.ROWS), key=lambda row: row.number)
    numbers = [row.number for row in rows]
    if len(set(numbers)) != len(numbers):
        twice = sorted({n for n in numbers if numbers.count(n) > 1})
        raise ParameterError(f"every erratum must have one row. Received {twice} twice. Renumber one of them.")
    return tuple(rows)


def _load(path: Path) -> ModuleType:
    """Module at a path; registered, so that its functions can be imported by name."""
    name = f"quakedesign_errata_{path.stem}"
    spec = spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def find_rows(numbers: Iterable[int | str] = ()) -> tuple[ErrataRow, ...]:
    """Rows of given numbers in the given order, each once; all rows if no number is given.

    Raises
    ------
    UnknownNameError
        For a number without a row, and for a value that is not a whole number.
    """
    rows = {str(row.number): row for row in errata_rows()}
    requested = list(dict.fromkeys(str(n).strip() for n in numbers))
    for number in requested:
        if number not in rows:
            first, last = min(map(int, rows)), max(map(int, rows))
            raise UnknownNameError(
                f"row of the errata must be a whole number from {first} to {last}. Received {number!r}. "
                "Omit the row to run every row."
            )
    return tuple(rows[n] for n in requested) if requested else errata_rows()


def run_rows(numbers: Iterable[int | str] = ()) -> list[Json]:
    """Run the checks of some rows, or of all.

    Parameters
    ----------
    numbers : iterable of int or str
        Requested rows; all rows if empty.

    Returns
    -------
    list of dict
        Keys row, printed, correct, kind, holds, evidence and seconds [s].

    Raises
    ------
    UnknownNameError
        For a number without a row; no check runs then.
    """
    return [_run(row) for row in find_rows(numbers)]


def _run(row: ErrataRow) -> Json:
    began = perf_counter()
    finding = row.check()
    return {
        "row": row.number,
        "printed": row.printed,
        "correct": row.correct,
        "kind": row.kind,
        "holds": bool(finding.holds),
        "evidence": finding.evidence,
        "seconds": perf_counter() - began,
    }
