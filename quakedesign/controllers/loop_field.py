"""A closed loop in symbols, as a law derives it, and its terms."""

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import sympy as sp

from quakedesign.controllers.field_terms import FieldTerms
from quakedesign.controllers.soundness import (
    require_names,
    require_roots,
    require_units,
    sound_field,
    sound_states,
)
from quakedesign.errors import CertificateError
from quakedesign.symbolic.term_expressions import to_terms, without_nesting
from quakedesign.symbolic.terms import Term


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopField:
    """A closed loop as an uncertain vector field, the subject of a certificate.

    Attributes
    ----------
    states : dict of Symbol to int
        States and their weights.
    field : dict of Symbol to Expr
        Time derivative of every state, in gains, constants and uncertain parameters.
    gains, constants, uncertain : tuple of Symbol
    domain : str
        ``"cells"`` for signed powers, ``"reals"`` for polynomials.
    roots : mapping of Symbol to Symbol
        Symbols that stand for the positive square root of a gain.
    units : mapping of Symbol to Expr
        Error that one unit of a state stands for, where it is not one unit; in gains.

    Raises
    ------
    ParameterError
        For names that are equal or that a certificate file cannot hold, an unknown domain, states of one sign, weights
        that are no integers from 1 to 12, a rate that is missing, inexact or holds an unknown symbol, a root of
        anything but a gain or constant, a unit of anything but a state.
    """

    states: dict[sp.Symbol, int]
    field: dict[sp.Symbol, sp.Expr]
    gains: tuple[sp.Symbol, ...]
    constants: tuple[sp.Symbol, ...]
    uncertain: tuple[sp.Symbol, ...]
    domain: str
    roots: Mapping[sp.Symbol, sp.Symbol] = dataclasses.field(default_factory=dict)
    units: Mapping[sp.Symbol, sp.Expr] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        numbers = (*self.gains, *self.constants)
        known = (*self.states, *numbers, *self.uncertain, *self.roots)
        object.__setattr__(self, "states", sound_states(self.states, self.domain))
        require_names(known)
        require_roots(self.roots, numbers)
        require_units(self.units, self.states, (*numbers, *self.roots))
        object.__setattr__(self, "field", sound_field(self.field, known, self.states))

    @property
    def degree(self) -> int:
        """Lowest degree of the Lyapunov functions to try, see `lowest_degree`."""
        return lowest_degree(self.states.values(), self.domain)

    @property
    def terms(self) -> FieldTerms:
        """The same as plain data, with a name for the argument of every nested power.

        Raises
        ------
        CertificateError
            For parts that certificates cannot express, and rates that are unbounded near the origin.
        """
        states = tuple(self.states)
        names = [s.name for s in (*self.gains, *self.constants, *self.uncertain, *self.roots, *states)]
        lifts, rates = without_nesting([self.field[s] for s in states], states, names)
        powers = (*states, *lifts)
        speeds = {s.name: to_terms(rate, powers) for s, rate in zip(states, rates, strict=True)}
        _require_bounded(speeds)
        arguments = {lift.name: to_terms(argument, powers) for lift, argument in lifts.items()}
        gains, constants, uncertain = (tuple(s.name for s in g) for g in (self.gains, self.constants, self.uncertain))
        return FieldTerms(
            states={s.name: weight for s, weight in self.states.items()},
            field=speeds,
            gains=gains,
            constants=constants,
            uncertain=uncertain,
            domain=self.domain,
            roots={root.name: of.name for root, of in self.roots.items()},
            lifts=_occurring(arguments, speeds),
        )


def lowest_degree(weights: Iterable[int], domain: str) -> int:
    """Degree of the product of the two heaviest states, from where on a V can couple them; 2 on the reals."""
    *_, first, second = (1, *sorted(weights))
    return first + second if domain == "cells" else 2


def _require_bounded(speeds: Mapping[str, Iterable[Term]]) -> None:
    """Refuse a negative power that no other factor of its product makes up for."""
    for state, terms in speeds.items():
        for of, exponent, kind in (factor for term in terms for factor in term.factors if factor[1] < 0):
            power = f"|{of}|^({exponent})" if kind == "a" else f"⌈{of}⌋^({exponent})"
            raise CertificateError(
                f"every rate must be bounded near the origin. Received one of {state} with {power}, which is unbounded "
                f"where {of} = 0. Multiply it by a power of {of} that makes up for it."
            )


def _occurring(
    lifts: Mapping[str, tuple[Term, ...]], speeds: Mapping[str, Iterable[Term]]
) -> dict[str, tuple[Term, ...]]:
    """Lifts that the field, or one of these, needs: a sign squared is 1, and leaves its argument unused."""
    used = {name for terms in speeds.values() for term in terms for name, _, _ in term.factors}
    for lift, terms in reversed(list(lifts.items())):
        used |= {name for term in terms for name, _, _ in term.factors} if lift in used else set()
    return {lift: terms for lift, terms in lifts.items() if lift in used}
