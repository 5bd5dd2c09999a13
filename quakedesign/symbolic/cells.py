"""Sign cells: what an expression in signed powers is on each, as polynomials under polynomial conditions."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product

import sympy as sp

from quakedesign.errors import CertificateError
from quakedesign.rationals import fraction_of

Polynomial = dict[tuple[int, ...], Fraction]


@dataclass(frozen=True, slots=True, kw_only=True)
class Lift:
    """One new variable w ≥ 0 with sign t: t·w^power = argument; without a power only the sign, t·argument ≥ 0.

    Attributes
    ----------
    variable : Symbol or None
        w; None where only the sign of the argument matters.
    sign : Symbol
        t = ±1.
    argument : Expr
        In the states, possibly with further signed powers inside.
    polynomial : Expr
        The argument in cell variables and signs.
    power : int
        0 where only the sign matters.
    """

    variable: sp.Symbol | None
    sign: sp.Symbol
    argument: sp.Expr
    polynomial: sp.Expr
    power: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One sign cell: a polynomial, valid where all equalities vanish and all inequalities are not negative.

    Attributes
    ----------
    signs : mapping of Symbol to int
        ±1 for every state and every lift.
    variables : tuple of Symbol
        Not negative; those of the states first.
    polynomial : Expr
    equalities : tuple of Expr
        Each is 0 on the cell.
    inequalities : tuple of Expr
        Each is ≥ 0 on the cell.
    """

    signs: Mapping[sp.Symbol, int]
    variables: tuple[sp.Symbol, ...]
    polynomial: sp.Expr
    equalities: tuple[sp.Expr, ...] = ()
    inequalities: tuple[sp.Expr, ...] = ()

    @property
    def name(self) -> str:
        """Signs as a word of + and −, states first."""
        return "".join("+" if s > 0 else "-" for s in self.signs.values())

    @property
    def thin(self) -> bool:
        """Whether a condition with coefficients of one known sign confines the cell to its boundary.

        Its points belong to neighbouring cells too, and a Filippov set needs no limit from a cell without interior.
        """
        return any(_one_sign(e, self.variables) for e in self.equalities) or any(
            _one_sign(-e, self.variables) > 0 for e in self.inequalities
        )

    def data(self, parameters: Mapping[sp.Symbol | str, Fraction] | None = None) -> Polynomial:
        """Polynomial as exponents and exact coefficients, the format of `cell_polynomial`.

        Raises
        ------
        CertificateError
            When a coefficient is not a rational number.
        """
        return as_data(self.polynomial, self.variables, parameters or {})

    def _repr_latex_(self) -> str:
        conditions = [f"{sp.latex(e)}=0" for e in self.equalities] + [rf"{sp.latex(e)}\ge 0" for e in self.inequalities]
        return r"$\displaystyle " + r",\;".join([sp.latex(self.polynomial), *conditions]) + "$"


@dataclass(frozen=True, slots=True, kw_only=True)
class Lifted:
    """An expression in cell variables u, w ≥ 0 and signs ±1, polynomial in all of them.

    Attributes
    ----------
    source : Expr
    weights : mapping of Symbol to int
        x_i = s_i·u_i^{r_i}.
    states : mapping of Symbol to (Symbol, Symbol)
        Sign s_i and variable u_i of every state.
    lifts : tuple of Lift
        Inner ones first.
    expression : Expr
    """

    source: sp.Expr
    weights: Mapping[sp.Symbol, int]
    states: Mapping[sp.Symbol, tuple[sp.Symbol, sp.Symbol]]
    expression: sp.Expr
    lifts: tuple[Lift, ...] = field(default=())

    @property
    def variables(self) -> tuple[sp.Symbol, ...]:
        """All cell variables: those of the states, then those of the lifts."""
        lifted = (lift.variable for lift in self.lifts if lift.variable is not None)
        return (*(u for _, u in self.states.values()), *lifted)

    @property
    def relations(self) -> tuple[sp.Eq, ...]:
        """t·w^n = P for every lift."""
        return tuple(
            sp.Eq(lift.sign * lift.variable**lift.power, lift.polynomial, evaluate=False)
            for lift in self.lifts
            if lift.variable is not None
        )

    def cells(self, *, thin: bool = False) -> Iterator[Cell]:
        """Every sign cell, + before −, the last sign varying fastest; those without interior only when asked."""
        owners = {s: state for state, (s, _) in self.states.items()} | {lift.sign: lift.sign for lift in self.lifts}
        for choice in product((1, -1), repeat=len(owners)):
            cell = self._cell(dict(zip(owners, choice, strict=True)), owners)
            if thin or not cell.thin:
                yield cell

    def _cell(self, values: dict[sp.Symbol, int], owners: Mapping[sp.Symbol, sp.Symbol]) -> Cell:
        equalities = [lift.sign * lift.variable**lift.power - lift.polynomial for lift in self.lifts if lift.variable]
        inequalities = [lift.sign * lift.polynomial for lift in self.lifts if lift.variable is None]
        return Cell(
            signs={owners[s]: value for s, value in values.items()},
            variables=self.variables,
            polynomial=sp.expand(self.expression.subs(values)),
            equalities=tuple(sp.expand(e.subs(values)) for e in equalities),
            inequalities=tuple(sp.expand(e.subs(values)) for e in inequalities),
        )

    def _repr_latex_(self) -> str:
        return r"$\displaystyle " + r",\;".join(map(sp.latex, (self.expression, *self.relations))) + "$"


def as_data(
    polynomial: sp.Expr, variables: tuple[sp.Symbol, ...], parameters: Mapping[sp.Symbol | str, Fraction]
) -> Polynomial:
    """Exponents and exact coefficients of a polynomial, parameters (symbols or names) replaced by their values.

    Raises
    ------
    CertificateError
        When a coefficient is not a rational number.
    """
    named = {str(s): sp.Rational(v.numerator, v.denominator) for s, v in parameters.items()}
    values = {s: named[s.name] for s in polynomial.free_symbols if s.name in named}
    data: Polynomial = {}
    for exponents, c in sp.Poly(sp.expand(polynomial.subs(values)), *variables).terms():
        if not c.is_Rational:
            raise CertificateError(
                f"the coefficient {c} must be a rational number. Give a value to every parameter, and write k = κ² "
                "where a root of k occurs."
            )
        if c:
            data[tuple(int(n) for n in exponents)] = fraction_of(c)
    return data


def _one_sign(polynomial: sp.Expr, variables: tuple[sp.Symbol, ...]) -> int:
    """1 or −1 where all coefficients of a polynomial in non-negative variables are known to have that sign, else 0."""
    coefficients = sp.Poly(polynomial, *variables).coeffs()
    if all(c.is_positive for c in coefficients):
        return 1
    return -1 if all(c.is_negative for c in coefficients) else 0
