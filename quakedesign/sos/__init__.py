"""Positivity of polynomials with exact proofs; knows nothing of faults. What decides needs no solver."""

from typing import TYPE_CHECKING, Any

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.sos.exact.answer import Answer as Answer
    from quakedesign.sos.exact.answer import Positivity as Positivity
    from quakedesign.sos.exact.attraction import Attraction as Attraction
    from quakedesign.sos.exact.attraction import Region as Region
    from quakedesign.sos.exact.attraction import save_attraction as save_attraction
    from quakedesign.sos.exact.polynomial import Polynomial as Polynomial
    from quakedesign.sos.exact.polynomial_statement import Statement as Statement
    from quakedesign.sos.exact.polynomial_statement import statement as statement
    from quakedesign.sos.exact.proofs import Functional as Functional
    from quakedesign.sos.exact.proofs import Point as Point
    from quakedesign.sos.exact.proofs import Square as Square
    from quakedesign.sos.exact.proofs import SumOfSquares as SumOfSquares
    from quakedesign.sos.exact.proofs import holds as holds

    def __getattr__(name: str) -> Any: ...


_SEARCH = "quakedesign.sos.solve"  # no import, not even for type checkers: what decides knows no solver
face(
    __name__,
    prove=f"{_SEARCH}.engine",
    decide=f"{_SEARCH}.engine",
    Program=f"{_SEARCH}.program",
    NoSolution=f"{_SEARCH}.program",
    largest=f"{_SEARCH}.program",
    Membership=f"{_SEARCH}.program",
    stability=f"{_SEARCH}.attraction_search",
    region_of_attraction=f"{_SEARCH}.attraction_search",
    verify=f"{_SEARCH}.verification",
    read_gram=f"{_SEARCH}.verification",
    stated_problems=f"{_SEARCH}.conic",
)
