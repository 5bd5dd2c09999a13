"""What a certificate is about, and what it consists of."""

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from math import isqrt

import sympy as sp

from quakedesign.controllers import LoopField, laws
from quakedesign.errors import CertificateError, ParameterError
from quakedesign.rationals import fraction_of, six_digits
from quakedesign.sos.exact.polynomial import Polynomial
from quakedesign.sos.exact.proofs import Square
from quakedesign.symbolic.balls import enclose
from quakedesign.symbolic.terms import Term, from_terms, to_terms, without_nesting

Range = tuple[Fraction, Fraction]


class Verdict(Enum):
    """Outcome of a question about a closed loop."""

    PROVED = "the witness checks in exact arithmetic"
    REFUTED = "a counterexample checks in exact arithmetic"
    UNDECIDED = "neither was found"

    def __str__(self) -> str:
        return self.name.lower()


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """A closed loop with exact gains and ranges: the subject of a claim.

    Attributes
    ----------
    law : str
    gains, constants : mapping of str to Fraction
    states : mapping of str to int
        Weight of every state.
    domain : str
        ``"cells"`` or ``"reals"``.
    uncertain : mapping of str to (Fraction, Fraction)
    field : mapping of str to tuple of Term
        Powers of states and of lifts.
    roots : mapping of str to (str, (Fraction, Fraction))
        The gain or constant whose positive square root a name stands for, and an interval that holds it.
    lifts : mapping of str to tuple of Term
        Argument of every nested power.
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
    def symbols(self) -> dict[str, sp.Symbol]:
        """SymPy symbol of every name."""
        names = (*self.states, *self.gains, *self.constants, *self.uncertain, *self.roots, *self.lifts)
        return {n: sp.Symbol(n, real=True) for n in names}

    @property
    def ranges(self) -> dict[str, Range]:
        """Ends of everything whose value is not known exactly: uncertain parameters, then roots."""
        return {**self.uncertain, **{name: ends for name, (_, ends) in self.roots.items()}}

    @property
    def parameters(self) -> dict[str, Fraction]:
        """Exact values of gains and constants."""
        return {**self.gains, **self.constants}


@dataclass(frozen=True, slots=True, kw_only=True)
class Witness:
    """multiplier · P = Σ squares + Σ cofactor_k · h_k on one cell.

    Attributes
    ----------
    multiplier : mapping of exponents to Fraction
        Positive coefficients.
    squares : tuple of Square
        Products of variables (their indices) and of sign conditions (indices after those of the variables).
    cofactors : tuple of Polynomial
        One for every equality of the cell.
    conditions : int
        Number of sign conditions of the cell.
    """

    multiplier: Polynomial
    squares: tuple[Square, ...] = ()
    cofactors: tuple[Polynomial, ...] = ()
    conditions: int = 0

    def __repr__(self) -> str:
        return f"Witness({len(self.squares)} squares, {len(self.cofactors)} cofactors)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Equilibrium:
    """A Filippov equilibrium away from the origin, for admissible constant parameters.

    Attributes
    ----------
    parameters : mapping of str to Fraction
    point : mapping of str to Fraction
        v_i with x_i = sign(v_i)|v_i|^{r_i}.
    weights : mapping of str to Fraction
        Convex weight of every sign cell that touches the point.
    """

    parameters: Mapping[str, Fraction]
    point: Mapping[str, Fraction]
    weights: Mapping[str, Fraction]


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """The parts of a `Certificate`, as they stand in a file."""

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
    model: LoopField,
    *,
    gains: Mapping[str, Fraction],
    uncertain: Mapping[str, Range],
    constants: Mapping[str, Fraction] | None = None,
) -> Loop:
    """Bind a symbolic loop to exact numbers.

    Raises
    ------
    CertificateError
        When the law has parts that this format cannot express, such as nested powers.
    """
    states = tuple(model.states)
    names = [s.name for s in (*model.gains, *model.constants, *model.uncertain, *model.roots, *states)]
    lifts, rates = without_nesting([model.field[s] for s in states], states, names)
    powers = (*states, *lifts)
    values = {**gains, **(constants or {})}
    speeds = {s.name: to_terms(rate, powers) for s, rate in zip(states, rates, strict=True)}
    _require_bounded(speeds)
    arguments = {lift.name: to_terms(argument, powers) for lift, argument in lifts.items()}
    return Loop(
        law=law,
        gains=dict(gains),
        constants=dict(constants or {}),
        states={s.name: w for s, w in model.states.items()},
        domain=model.domain,
        uncertain=dict(uncertain),
        field=speeds,
        roots={root.name: (of.name, root_enclosure(values[of.name])) for root, of in model.roots.items()},
        lifts=_occurring(arguments, speeds),
    )


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


def root_enclosure(number: Fraction) -> Range:
    """Rational interval around the square root of a number ≥ 0: a point if rational, else of relative width 2e-6.

    Raises
    ------
    ParameterError
        When the number is negative.
    """
    if number < 0:
        raise ParameterError(f"a root needs a number that is not negative. Received {number}.")
    top, bottom = isqrt(number.numerator), isqrt(number.denominator)
    if Fraction(top, bottom) ** 2 == number:
        return Fraction(top, bottom), Fraction(top, bottom)
    scale = 2 ** max(0, 20 + (number.denominator.bit_length() - number.numerator.bit_length()) // 2)
    low = Fraction(isqrt(number.numerator * scale**2 // number.denominator), scale)
    return low, low + Fraction(1, scale)


def sympy_field(loop: Loop) -> dict[sp.Symbol, sp.Expr]:
    """Vector field of a loop as SymPy expressions."""
    symbols = loop.symbols
    return {symbols[state]: from_terms(terms, symbols) for state, terms in loop.field.items()}


def full_field(loop: Loop) -> dict[sp.Symbol, sp.Expr]:
    """Vector field of a loop with every nested power written out."""
    symbols = loop.symbols
    field = sympy_field(loop)
    for lift, terms in reversed(list(loop.lifts.items())):
        argument = from_terms(terms, symbols)
        field = {state: rate.subs(symbols[lift], argument) for state, rate in field.items()}
    return field


def error_units(loop: Loop, model: LoopField | None = None) -> dict[str, Range]:
    """Interval of the error that one unit of each state stands for; one where the law says nothing else.

    The units are those of a model, or of the law of the package that the loop names.
    """
    if model is None and loop.law in laws():
        model = laws()[loop.law].loop_field()
    return unit_ranges(loop, {str(state): unit for state, unit in model.units.items()} if model is not None else {})


def unit_ranges(loop: Loop, units: Mapping[str, sp.Expr]) -> dict[str, Range]:
    """Interval of the value of every unit, by the name of its state; one where there is none.

    Raises
    ------
    CertificateError
        For a unit that is not positive.
    """
    values = {**{n: (v, v) for n, v in loop.parameters.items()}, **{n: ends for n, (_, ends) in loop.roots.items()}}
    ranges: dict[str, Range] = dict.fromkeys(loop.states, (Fraction(1), Fraction(1)))
    for state, unit in units.items():
        ball = enclose(unit, {s: values[str(s)] for s in unit.free_symbols})
        low, high = (fraction_of(end.fmpq()) for end in (ball.lower(), ball.upper()))
        require(low > 0, f"the unit of {state} must be positive. Received {unit}.")
        ranges[state] = (low, high)
    return ranges


def require(condition: bool, reason: str) -> None:
    """Refuse a certificate.

    Raises
    ------
    CertificateError
    """
    if not condition:
        raise CertificateError(reason)
