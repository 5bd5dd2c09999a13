"""Positivity of polynomials with exact proofs; knows nothing of faults. What decides needs no solver."""

from typing import TYPE_CHECKING, Any

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.sos.exact.answer import Answer, Positivity
    from quakedesign.sos.exact.attraction import Attraction, Region
    from quakedesign.sos.exact.attraction_files import save_attraction
    from quakedesign.sos.exact.polynomial import Polynomial
    from quakedesign.sos.exact.proofs import Functional, Point, Square, SumOfSquares, holds
    from quakedesign.sos.exact.statement import Statement, statement

    def __getattr__(name: str) -> Any: ...


__all__ = [
    "Answer",
    "Attraction",
    "Functional",
    "Membership",
    "Point",
    "Polynomial",
    "Positivity",
    "Program",
    "Region",
    "Square",
    "Statement",
    "SumOfSquares",
    "decide",
    "holds",
    "largest",
    "prove",
    "read_gram",
    "region_of_attraction",
    "save_attraction",
    "stability",
    "statement",
    "verify",
]

_SEARCH = "quakedesign.sos.solve"  # no import, not even for type checkers: what decides knows no solver
face(
    __name__,
    prove=f"{_SEARCH}.engine",
    decide=f"{_SEARCH}.engine",
    Program=f"{_SEARCH}.program",
    largest=f"{_SEARCH}.program",
    Membership=f"{_SEARCH}.membership",
    stability=f"{_SEARCH}.attraction",
    region_of_attraction=f"{_SEARCH}.attraction",
    verify=f"{_SEARCH}.verification",
    read_gram=f"{_SEARCH}.gram_files",
)
