"""A closed loop as plain data, as in a certificate file, without gains."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

from quakedesign.symbolic.terms import Term


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldTerms:
    """A `LoopField` in terms of states and lifts.

    Attributes
    ----------
    states : mapping of str to int
        Weight of every state.
    field : mapping of str to tuple of Term
        Time derivative of every state.
    roots : mapping of str to str
        The gain or constant whose positive square root a name stands for.
    lifts : mapping of str to tuple of Term
        Argument of every nested power.
    """

    states: Mapping[str, int]
    field: Mapping[str, tuple[Term, ...]]
    gains: tuple[str, ...]
    constants: tuple[str, ...]
    uncertain: tuple[str, ...]
    domain: str
    roots: Mapping[str, str] = dataclasses.field(default_factory=dict)
    lifts: Mapping[str, tuple[Term, ...]] = dataclasses.field(default_factory=dict)
