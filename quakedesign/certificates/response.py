"""Bounds on outputs for ever, from rest, under bounded inputs: what is claimed (FORMAT.md, "A bound")."""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from quakedesign.symbolic.terms import Term


@dataclass(frozen=True, slots=True, kw_only=True)
class InvariantSet:
    """{V ≤ 1} with V′ + decay·V ≤ Σ_j borrowed_j·V_j + Σ share·(u/limit)², all shares together at most the decay.

    Attributes
    ----------
    function : tuple of Term
        V, a quadratic form in the states and, where its rate is limited, the input.
    decay : Fraction
    shares : tuple of Fraction
        One for every limit of the input.
    borrowed : tuple of Fraction
        One for every set of the same input, zero for this one.
    """

    function: tuple[Term, ...]
    decay: Fraction
    shares: tuple[Fraction, ...]
    borrowed: tuple[Fraction, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputBound:
    """|output| ≤ bound where all V_j ≤ 1, because output² ≤ bound²·Σ weight_j·V_j.

    Attributes
    ----------
    bound : Fraction
    weights : tuple of Fraction
        Not negative, with sum at most 1.
    """

    bound: Fraction
    weights: tuple[Fraction, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class InputResponse:
    """What one input alone can do.

    Attributes
    ----------
    sets : tuple of InvariantSet
        Their intersection holds the start and is never left.
    bounds : mapping of str to OutputBound
        One for every output.
    """

    sets: tuple[InvariantSet, ...]
    bounds: Mapping[str, OutputBound]


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """What all inputs can do together: the loop is linear, so that the bounds of its inputs add.

    Attributes
    ----------
    outputs : mapping of str to tuple of Term
        Linear forms in the states.
    parts : mapping of str to InputResponse
        One for every input of the loop.
    """

    outputs: Mapping[str, tuple[Term, ...]]
    parts: Mapping[str, InputResponse]

    def total(self, output: str) -> Fraction:
        """Bound on |output|, all inputs together."""
        return sum((part.bounds[output].bound for part in self.parts.values()), Fraction(0))
