"""Positivity of polynomials with exact proofs; knows nothing of faults."""

from typing import Any

from quakedesign.arguments import check_arguments, checked
from quakedesign.sos.exact.answer import Answer, Positivity
from quakedesign.sos.exact.polynomial import Polynomial
from quakedesign.sos.exact.proofs import Functional, Point, Square, SumOfSquares, holds
from quakedesign.sos.exact.statement import Statement, statement

_SEARCH = {
    "prove": "engine",
    "decide": "engine",
    "Program": "program",
    "largest": "program",
    "Membership": "membership",
}

__all__ = [
    "Answer",
    "Functional",
    "Membership",
    "Point",
    "Polynomial",
    "Positivity",
    "Program",
    "Square",
    "Statement",
    "SumOfSquares",
    "decide",
    "holds",
    "largest",
    "prove",
    "statement",
]


def __getattr__(name: str) -> Any:
    """Part of the search, loaded on first use: what decides needs no solver."""
    if name not in _SEARCH:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return checked(getattr(import_module(f"quakedesign.sos.solve.{_SEARCH[name]}"), name))


check_arguments(__name__)
