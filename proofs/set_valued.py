"""Sets of values: expressions with selections in intervals, their exact bounds, and restriction to surfaces."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import sympy as sp

from quakedesign.errors import KinkError, ParameterError
from quakedesign.exact import rational
from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower, normal_form, signs

Interval = tuple[sp.Expr, sp.Expr]
Condition = tuple[sp.Expr, sp.Symbol]
"""Expression that vanishes, and the variable to eliminate with it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetValued:
    """{expression : every selection in its interval}, the selections independent of each other.

    Attributes
    ----------
    expression : Expr
    intervals : mapping of Symbol to (Expr, Expr)
        Lower and upper end of every selection: [−1, 1] for a sign on its switching surface.
    """

    expression: sp.Expr
    intervals: Mapping[sp.Symbol, Interval] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "expression", sp.sympify(self.expression))
        object.__setattr__(self, "intervals", exact_intervals(self.intervals))

    @property
    def selections(self) -> tuple[sp.Symbol, ...]:
        """Selections that the expression contains."""
        return tuple(s for s in self.intervals if s in self.expression.free_symbols)

    @property
    def single(self) -> sp.Expr:
        """The value, where there is only one.

        Raises
        ------
        KinkError
            When the set may hold more than one value.
        """
        if self.selections:
            raise KinkError(f"{self.expression} is set-valued in {self.selections}. Use `lower` and `upper`.")
        return self.expression

    @property
    def lower(self) -> sp.Expr:
        """Least value, exact."""
        return -SetValued(expression=-self.expression, intervals=self.intervals).upper

    @property
    def upper(self) -> sp.Expr:
        """Largest value, exact: from centre and radius where the selections enter linearly, else over all vertices.

        Raises
        ------
        KinkError
            When a selection enters other than to the first power, so that the ends of its interval do not decide.
        """
        chosen = self.selections
        polynomial = self._multi_affine()
        if all(sum(powers) <= 1 for powers in polynomial.monoms()):
            centre = normal_form(self.expression.subs({s: sum(self.intervals[s]) / 2 for s in chosen}))
            slopes = {s: normal_form(polynomial.coeff_monomial(s)) for s in chosen}
            radii = {s: normal_form((self.intervals[s][1] - self.intervals[s][0]) / 2) for s in chosen}
            return normal_form(centre + sum(radii[s] * AbsolutePower(slopes[s], 1) for s in chosen))
        return sp.Max(*self.vertices())

    def vertices(self) -> tuple[sp.Expr, ...]:
        """Values at all ends of all selections; their convex hull is the convex hull of the set."""
        chosen = self.selections
        self._multi_affine()
        ends = product(*(self.intervals[s] for s in chosen))
        values = (normal_form(self.expression.subs(dict(zip(chosen, end, strict=True)))) for end in ends)
        return tuple(dict.fromkeys(values))

    def at(self, point: Mapping[sp.Symbol, sp.Expr]) -> Interval:
        """Exact least and largest value at a point; signs whose arguments vanish there become selections."""
        here = substituted(self, dict(point))
        values = here.vertices()
        return sp.Min(*values), sp.Max(*values)

    def _multi_affine(self) -> sp.Poly:
        chosen = self.selections
        try:
            polynomial = sp.Poly(self.expression, *chosen) if chosen else sp.Poly(0, sp.Dummy())
        except sp.PolynomialError:
            polynomial = None
        if polynomial is None or any(n > 1 for powers in polynomial.monoms() for n in powers):
            raise KinkError(
                f"{self.expression} is not affine in each of {chosen}; the ends of the intervals do not decide."
            )
        return polynomial

    def _repr_latex_(self) -> str:
        ranges = r",\;".join(rf"{sp.latex(s)}\in{sp.latex(sp.Tuple(*self.intervals[s]))}" for s in self.selections)
        return rf"$\displaystyle {sp.latex(self.expression)}{',' + chr(92) + ';' + ranges if ranges else ''}$"


def restrict(value: sp.Expr | SetValued, *conditions: Condition) -> SetValued:
    """Value on the set where all conditions vanish.

    Each condition, an expression and a variable, is solved for the variable in signed powers and substituted. A sign
    whose argument vanishes on the set becomes a selection in [−1, 1], the same for the same argument.

    Parameters
    ----------
    value : Expr or SetValued
    conditions : (Expr, Symbol)
        Applied in order; such as ``(k**Rational(3, 2)*x + SignedPower(y, Rational(3, 2)), x)``.

    Returns
    -------
    SetValued

    Raises
    ------
    ParameterError
        When a condition has no unique solution in signed powers.
    KinkError
        When the value is not defined on the set.
    """
    current = value if isinstance(value, SetValued) else SetValued(expression=sp.sympify(value))
    current = SetValued(expression=normal_form(current.expression), intervals=current.intervals)
    solved = dict[sp.Symbol, sp.Expr]()
    for condition, variable in conditions:
        here = normal_form(sp.sympify(_left(condition)).subs(solved, simultaneous=True))
        if here == 0:
            continue
        solution = {variable: solve_signed(here, variable)}
        solved = {v: normal_form(e.subs(solution)) for v, e in solved.items()} | solution
        current = substituted(current, solution)
    return current


def solve_signed(condition: sp.Expr | sp.Eq, variable: sp.Symbol) -> sp.Expr:
    """Only real solution of condition = 0 for a variable that occurs in one signed power.

    c·⌈Q⌋^a + rest = 0 becomes Q = −⌈rest/c⌋^{1/a}, again and again, until the variable stands alone.

    Parameters
    ----------
    condition : Expr or Eq
    variable : Symbol

    Returns
    -------
    Expr

    Raises
    ------
    ParameterError
        When the variable occurs not at all, in several terms, in an even power, or with a coefficient that may vanish.
    """
    left = condition.lhs - condition.rhs if isinstance(condition, sp.Equality) else condition
    left = normal_form(left)
    terms = sp.Add.make_args(left)
    own = [term for term in terms if term.has(variable)]
    if len(own) != 1:
        raise ParameterError(
            f"{variable} must occur in exactly one term of {left} = 0 to be solved for. It occurs in {len(own)}. "
            "Solve for another variable, or split into sign cells."
        )
    coefficient, power = own[0].as_independent(variable, as_Add=False)
    inner, exponent = _odd_power(power, left)
    if not coefficient.is_nonzero:
        raise ParameterError(f"the coefficient {coefficient} of {power} must not vanish. Declare its symbols positive.")
    target = -SignedPower(normal_form((left - own[0]) / coefficient), 1 / exponent)
    return normal_form(target) if inner == variable else solve_signed(inner - target, variable)


def _odd_power(power: sp.Expr, left: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    base, n = power.as_base_exp()
    inner, a = base.args if isinstance(base, SignedPower) else (base, sp.Integer(1))
    if n.is_Integer and n % 2 == 1 and (a * n).is_positive and not isinstance(base, AbsolutePower):
        return inner, a * n
    raise ParameterError(
        f"{power} in {left} = 0 takes a value twice or jumps. Only odd powers ⌈·⌋^a, a > 0, are solved."
    )


def exact_intervals(intervals: Mapping[sp.Symbol, tuple[Any, ...]]) -> dict[sp.Symbol, Interval]:
    """Ends as SymPy numbers or expressions; a float means the decimal that Python prints for it.

    Raises
    ------
    ParameterError
        When an upper end is below its lower end.
    """

    def end(value: Any) -> sp.Expr:
        return sp.Rational(str(rational(value))) if isinstance(value, float) else sp.sympify(value)

    exact = {symbol: (end(low), end(high)) for symbol, (low, high) in intervals.items()}
    for symbol, (low, high) in exact.items():
        if (high - low).is_negative:
            raise ParameterError(f"the interval of {symbol} must have its lower end first. Received [{low}, {high}].")
    return exact


def _left(condition: sp.Expr | sp.Eq) -> sp.Expr:
    return condition.lhs - condition.rhs if isinstance(condition, sp.Equality) else condition


def substituted(value: SetValued, solution: dict[sp.Symbol, sp.Expr]) -> SetValued:
    """Substitute; signs whose arguments vanish become selections named after the argument."""
    selections = dict[sp.Expr, sp.Symbol]()
    for argument in signs(normal_form(value.expression)):
        if _zero(normal_form(argument.subs(solution, simultaneous=True))):
            selections[argument] = sp.Symbol(f"sigma_{{{argument}}}", real=True)
    expression = normal_form(value.expression).xreplace({SignedPower(p, 0): s for p, s in selections.items()})
    result = normal_form(expression.subs(solution, simultaneous=True))
    one = sp.Integer(1)
    return SetValued(
        expression=result, intervals={**value.intervals, **dict.fromkeys(selections.values(), (-one, one))}
    )


def _zero(argument: sp.Expr) -> bool:
    """Whether an argument is exactly zero.

    Raises
    ------
    KinkError
        When that cannot be decided for a number.
    """
    if not argument.is_number:
        return bool(argument == 0)
    decided = argument.equals(0)
    if decided is None:
        raise KinkError(f"whether {argument} vanishes cannot be decided; give the point in other numbers.")
    return bool(decided)
