"""Verdict on the positivity of a polynomial, with its proof, which is re-checked without a solver."""

from collections.abc import Mapping
from dataclasses import field
from enum import Enum
from pathlib import Path

from quakedesign.arguments import checked_dataclass
from quakedesign.sos.exact.polynomial import Polynomial
from quakedesign.sos.exact.polynomial_files import save
from quakedesign.sos.exact.polynomial_statement import Statement
from quakedesign.sos.exact.proofs import Functional, Point, Proof, SumOfSquares, holds
from quakedesign.sos.exact.work_budget import limited


class Positivity(Enum):
    """Verdict: proved by sums of squares, no such proof of this degree exists, negative at a point, or undecided."""

    SOS = "sos"
    NOT_SOS = "not-sos"
    NEGATIVE = "negative"
    UNDECIDED = "undecided"

    def __str__(self) -> str:
        return self.value


_KIND = {SumOfSquares: Positivity.SOS, Functional: Positivity.NOT_SOS, Point: Positivity.NEGATIVE}


@checked_dataclass(frozen=True, kw_only=True)
class Answer:
    """Verdict on one statement.

    Attributes
    ----------
    statement : Statement
        The statement, with the multiplier and the degree that were used.
    proof : SumOfSquares, Functional, Point or None
        Proof or refutation; None if the statement is undecided.
    blocks : mapping of str to list of int
        Sizes of the Gram matrices before and after reduction.
    seconds : float
        Wall time of the search [s].
    versions : mapping of str to str
        Versions of this package, the solver and the arithmetic, by package name.
    remark : str
        Note that is reported with the verdict, such as whether a given Gram matrix was used; may be empty.
    """

    statement: Statement
    proof: Proof | None
    blocks: Mapping[str, list[int]] = field(default_factory=dict)
    seconds: float = 0.0
    versions: Mapping[str, str] = field(default_factory=dict)
    remark: str = ""

    @property
    def verdict(self) -> Positivity:
        """``sos``, ``not-sos``, ``negative`` or ``undecided``."""
        return Positivity.UNDECIDED if self.proof is None else _KIND[type(self.proof)]

    @property
    def set_is_empty(self) -> bool:
        """Whether the set is evidently empty, so that a proof of positivity on it is vacuous.

        True if a negative constant is proved to be non-negative on the set, or if a constraint has only even exponents
        and a constant term, and its coefficients are all negative (inequality) or all of one sign (equality).
        """
        statement = self.statement
        below = [
            *statement.inequalities,
            *statement.equalities,
            *({exponents: -c for exponents, c in h.items()} for h in statement.equalities),
        ]
        constant = [p for p in (statement.polynomial,) if not any(map(any, p))]
        return self.verdict is Positivity.SOS and any(_is_below_zero(p) for p in (*constant, *below))

    def check(self) -> bool:
        """Whether the proof decides the statement, in exact arithmetic and without a solver.

        True for an undecided answer, which claims nothing.

        Raises
        ------
        WorkError
            When the check exceeds its work budget (proofs/FORMAT.md).
        """
        with limited():
            return self.proof is None or holds(self.statement, self.proof)

    def save(self, path: str | Path) -> None:
        """Write the proof file (proofs/FORMAT.md) atomically.

        Raises
        ------
        CertificateError
            When the answer is undecided, or the proof is too large for the format.
        """
        save(self.statement, self.proof, path)


def _is_below_zero(polynomial: Polynomial) -> bool:
    """Whether all exponents are even and all coefficients negative, with a constant term."""
    even = all(x % 2 == 0 for exponents in polynomial for x in exponents)
    return even and any(not any(e) for e in polynomial) and all(c < 0 for c in polynomial.values())
