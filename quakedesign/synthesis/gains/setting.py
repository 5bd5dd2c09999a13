"""What a search for gains knows: its setting, the states that it passes, and what makes one better than another."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import ClassVar

import sympy as sp

from quakedesign.certificates import Certificate, Loop
from quakedesign.controllers import Subject
from quakedesign.symbolic.terms import Term
from quakedesign.synthesis.lyapunov.search import find_certificate

MARGIN, FAINT = 1e-6, 1e-9
_ROOM = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """What does not change during a search.

    Attributes
    ----------
    objective : Objective
    exponents : mapping of str to Fraction
        Of gains and states, see `stretch_exponents`.
    degree : int
        Of V.
    units : mapping of str to Expr
        See `LoopField.units`.
    least : float
        Margin that counts; a search over gains steers clear of the edge of what a solver can tell.
    """

    objective: "Objective"
    exponents: Mapping[str, Fraction]
    degree: int
    units: Mapping[str, sp.Expr] = field(default_factory=dict)
    least: float = MARGIN


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """Gains with a V that a solver believes in.

    Attributes
    ----------
    loop : Loop
        With the ranges that the level asks for.
    level : float
        Of the objective.
    lyapunov : tuple of Term
    margin : float
    """

    loop: Loop
    level: float
    lyapunov: tuple[Term, ...]
    margin: float


@dataclass(frozen=True, kw_only=True)
class Objective(ABC):
    """One way in which gains can be better than others.

    Attributes
    ----------
    bound : float, optional
        Largest ‖k_i/L̄^{p_i}‖₂ allowed.
    """

    name: ClassVar[str]
    unit: ClassVar[str]
    meaning: ClassVar[str]
    larger: ClassVar[bool] = True
    bounded: ClassVar[bool] = True
    paced: ClassVar[bool] = False

    bound: float | None = None

    def better(self, level: float, other: float) -> bool:
        """Whether a level is better than another one."""
        return level > other if self.larger else level < other

    def improved(self, level: float, share: float) -> float:
        """Level that is better by a share."""
        return level * (1 + share if self.larger else 1 - share)

    def at(self, loop: Loop, level: float) -> Loop:
        """Loop with the ranges that a level asks for."""
        return loop

    def speed(self, level: float) -> float | None:
        """1/T that a level asks for, see `pace_of`."""
        return None

    def norm_bound(self, level: float) -> float | None:
        """Bound on the norm of the gains."""
        return self.bound

    def kept(self, gains: Mapping[str, float], loop: Loop, exponents: Mapping[str, Fraction]) -> dict[str, float]:
        """Gains drawn back to the bound on their norm, if they are beyond."""
        scale = float(loop.uncertain["d"][1])
        norm = sum((k / scale ** float(exponents[name])) ** 2 for name, k in gains.items()) ** 0.5
        factor = 1.0 if self.bound is None else min(1.0, self.bound * (1 - _ROOM) / norm)
        return {name: k * factor for name, k in gains.items()}

    def reached(self, level: float, loop: Loop, exponents: Mapping[str, Fraction]) -> float:
        """Level of gains that a step for a level has led to."""
        return level

    @abstractmethod
    def start(self, setting: Setting, loop: Loop) -> State | None:
        """First state at given gains; None where the search has nothing to begin with."""

    def proved(self, setting: Setting, state: State, subject: Subject) -> Certificate | None:
        """Exact certificate at the gains of a state, or None."""
        return find_certificate(state.loop, setting.degree, subject=subject)

    def given(self, loop: Loop, degrees: Sequence[int], subject: Subject) -> Certificate | None:
        """Proof of given gains by another way than a climb, to be beaten by that if V is paced; None without one."""
        return None

    @abstractmethod
    def figure(self, certificate: Certificate, setting: Setting) -> float:
        """What a certificate proves, in terms of the objective."""
