"""Statement of a Lyapunov certificate, and its evidence."""

import dataclasses
from collections.abc import Mapping
from dataclasses import field
from enum import Enum
from fractions import Fraction
from math import isqrt
from typing import TYPE_CHECKING

from quakedesign import symbolic
from quakedesign.arguments import checked_dataclass
from quakedesign.errors import CertificateError, ParameterError
from quakedesign.exact import six_digits
from quakedesign.laws.field_terms import FieldTerms
from quakedesign.sos.exact.polynomial import Polynomial
from quakedesign.sos.exact.proofs import Square
from quakedesign.symbolic.terms import Term

if TYPE_CHECKING:
    import sympy as sp

    from quakedesign.laws.loop_field import LoopField


Range = tuple[Fraction, Fraction]


class Verdict(Enum):
    """Outcome of a proof about a closed loop: proved, refuted or undecided."""

    PROVED = "all witnesses are valid in exact arithmetic"
    REFUTED = "the counterexample is valid in exact arithmetic"
    UNDECIDED = "neither a proof nor a counterexample was found"

    def __str__(self) -> str:
        return self.name.lower()


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """A closed loop with exact gains and ranges: the subject of a claim.

    Attributes
    ----------
    law : str
        Name of the law.
    gains, constants : mapping of str to Fraction
        Exact values by name.
    states : mapping of str to int
        Weight r_i of every state.
    domain : str
        ``"cells"`` (signed powers, one polynomial per sign cell) or ``"reals"`` (polynomials).
    uncertain : mapping of str to (Fraction, Fraction)
        Range of every uncertain parameter.
    field : mapping of str to tuple of Term
        Rate of every state, a sum of terms in powers of states and lifts.
    roots : mapping of str to (str, (Fraction, Fraction))
        For every name, the gain or constant whose positive square root it denotes, and an enclosure of the root.
    lifts : mapping of str to tuple of Term
        For every lift, a variable that replaces the argument of a nested power, this argument.
    """

    law: str
    gains: Mapping[str, Fraction]
    constants: Mapping[str, Fraction]
    states: Mapping[str, int]
    domain: str
    uncertain: Mapping[str, Range]
    field: Mapping[str, tuple[Term, ...]]
    roots: Mapping[str, tuple[str, Range]] = dataclasses.field(default_factory=dict)
    lifts: Mapping[str, tuple[Term, ...]] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, (low, high) in self.uncertain.items():
            if low > high:
                raise ParameterError(f"range of {name} must be ordered. Received [{low}, {high}].")

    def __repr__(self) -> str:
        gains = ", ".join(f"{name} ≈ {six_digits(value)}" for name, value in self.gains.items())
        ranges = ", ".join(f"{name} in [{six_digits(a)}, {six_digits(b)}]" for name, (a, b) in self.uncertain.items())
        return f"Loop({'; '.join(part for part in (self.law, gains, ranges) if part)})"

    @property
    def symbols(self) -> "dict[str, sp.Symbol]":
        """SymPy symbol of every name."""
        names = (*self.states, *self.gains, *self.constants, *self.uncertain, *self.roots, *self.lifts)
        return symbolic.real_symbols(names)

    @property
    def ranges(self) -> dict[str, Range]:
        """Range of every parameter that is not a single exact value: uncertain parameters, then roots."""
        return {**self.uncertain, **{name: ends for name, (_, ends) in self.roots.items()}}

    @property
    def parameters(self) -> dict[str, Fraction]:
        """Exact values of gains and constants."""
        return {**self.gains, **self.constants}


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Witness:
    """multiplier · P = Σ squares + Σ cofactor_k · h_k on one cell.

    Attributes
    ----------
    multiplier : mapping of exponents to Fraction
        Polynomial with positive coefficients.
    squares : tuple of Square
        Sums of squares, each times a product of variables (their indices) and of sign conditions (indices after those
        of the variables).
    cofactors : tuple of Polynomial
        Cofactor of every equality h_k = 0 of the cell.
    conditions : int
        Number of sign conditions of the cell.
    """

    multiplier: Polynomial
    squares: tuple[Square, ...] = ()
    cofactors: tuple[Polynomial, ...] = ()
    conditions: int = 0

    def __repr__(self) -> str:
        return f"Witness({len(self.squares)} squares, {len(self.cofactors)} cofactors)"


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Equilibrium:
    """A Filippov equilibrium away from the origin, for admissible constant parameters.

    Attributes
    ----------
    parameters : mapping of str to Fraction
        Value of every uncertain parameter.
    point : mapping of str to Fraction
        Coordinates v_i with x_i = sign(v_i)|v_i|^{r_i}.
    weights : mapping of str to Fraction
        Convex weight of every sign cell that touches the point.
    """

    parameters: Mapping[str, Fraction]
    point: Mapping[str, Fraction]
    weights: Mapping[str, Fraction]


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """The parts of a `Certificate`, as in its file."""

    loop: Loop
    lyapunov: tuple[Term, ...] = ()
    claims: Mapping[str, Fraction] = field(default_factory=dict)
    witnesses: Mapping[str, Witness] = field(default_factory=dict)
    refutation: Equilibrium | None = None

    def __repr__(self) -> str:
        claimed = f"claims {', '.join(self.claims)} with {len(self.witnesses)} witnesses"
        return (
            f"{type(self).__name__}({self.loop}; {claimed if self.refutation is None else 'refuted by an equilibrium'})"
        )


def loop_of(
    law: str,
    model: "LoopField | FieldTerms",
    *,
    gains: Mapping[str, Fraction],
    uncertain: Mapping[str, Range],
    constants: Mapping[str, Fraction] | None = None,
) -> Loop:
    """Closed loop with exact numbers for the symbols of its model.

    Parameters
    ----------
    law : str
        Name of the law.
    model : LoopField or FieldTerms
        Vector field in symbols.
    gains, constants : mapping of str to Fraction
        Exact values by name.
    uncertain : mapping of str to (Fraction, Fraction)
        Range of every uncertain parameter.


    Raises
    ------
    CertificateError
        If the format cannot express a part of the law, such as a factor that is not a signed power.
    """
    terms = model if isinstance(model, FieldTerms) else model.terms
    values = {**gains, **(constants or {})}
    return Loop(
        law=law,
        gains=dict(gains),
        constants=dict(constants or {}),
        states=dict(terms.states),
        domain=terms.domain,
        uncertain=dict(uncertain),
        field=dict(terms.field),
        roots={root: (of, root_enclosure(values[of])) for root, of in terms.roots.items()},
        lifts=dict(terms.lifts),
    )


def root_enclosure(number: Fraction) -> Range:
    """Rational enclosure of the square root of a number ≥ 0: a point if rational, else of relative width 2e-6.

    Raises
    ------
    ParameterError
        When the number is negative.
    """
    if number < 0:
        raise ParameterError(f"the argument of a square root must not be negative. Received {number}.")
    top, bottom = isqrt(number.numerator), isqrt(number.denominator)
    if Fraction(top, bottom) ** 2 == number:
        return Fraction(top, bottom), Fraction(top, bottom)
    scale = 2 ** max(0, 20 + (number.denominator.bit_length() - number.numerator.bit_length()) // 2)
    low = Fraction(isqrt(number.numerator * scale**2 // number.denominator), scale)
    return low, low + Fraction(1, scale)


def require(condition: bool, reason: str) -> None:
    """Raise CertificateError unless a condition holds."""
    if not condition:
        raise CertificateError(reason)
