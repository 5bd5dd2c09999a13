"""A closed loop as plain data, as in a certificate file, without values of gains."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

from quakedesign.symbolic.terms import Term


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldTerms:
    """A `LoopField` in terms of states and lifts."""

    states: Mapping[str, int]  # Weight of every state
    field: Mapping[str, tuple[Term, ...]]  # Time derivative of every state
    gains: tuple[str, ...]
    constants: tuple[str, ...]
    uncertain: tuple[str, ...]
    domain: str
    # Gain or constant whose positive square root a name denotes
    roots: Mapping[str, str] = dataclasses.field(default_factory=dict)
    lifts: Mapping[str, tuple[Term, ...]] = dataclasses.field(default_factory=dict)  # Argument of every nested power
