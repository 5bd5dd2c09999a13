"""Positivity of polynomials with exact proofs; knows nothing of faults."""

from typing import Any

from quakedesign.sos.exact.answer import Answer, Positivity
from quakedesign.sos.exact.witness import Block, Polynomial, Witness, proves

_SEARCH = {
    "prove": "engine",
    "decide": "engine",
    "Program": "program",
    "largest": "program",
    "Membership": "membership",
}

__all__ = [
    "Answer",
    "Block",
    "Membership",
    "Polynomial",
    "Positivity",
    "Program",
    "Witness",
    "decide",
    "largest",
    "prove",
    "proves",
]


def __getattr__(name: str) -> Any:
    """Part of the search, loaded on first use: what decides needs no solver."""
    if name not in _SEARCH:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"quakedesign.sos.solve.{_SEARCH[name]}"), name)
