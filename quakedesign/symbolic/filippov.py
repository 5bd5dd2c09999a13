"""Discontinuous vector fields in Filippov's sense: coordinates, derivatives along them, restriction to sets."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import product

import sympy as sp

from quakedesign.errors import KinkError, ParameterError
from quakedesign.rationals import rational
from quakedesign.symbolic.normal_form import is_identity, normal_form, signs, solve_signed
from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower

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
        object.__setattr__(self, "intervals", _exact(self.intervals))

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
        here = _substituted(self, dict(point))
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


@dataclass(frozen=True, slots=True, kw_only=True)
class FilippovField:
    """ẋ ∈ F(x): rates with signs ⌈·⌋⁰ and parameters in intervals.

    Attributes
    ----------
    rates : mapping of Symbol to Expr
        Time derivative of every state.
    intervals : mapping of Symbol to (Expr, Expr)
        Parameters that may be anywhere in an interval at every time, such as ḣ ∈ [−L, L].
    """

    rates: Mapping[sp.Symbol, sp.Expr]
    intervals: Mapping[sp.Symbol, Interval] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "rates", {state: sp.sympify(rate) for state, rate in self.rates.items()})
        object.__setattr__(self, "intervals", _exact(self.intervals))

    @property
    def states(self) -> tuple[sp.Symbol, ...]:
        """States in order."""
        return tuple(self.rates)

    @property
    def switching(self) -> tuple[sp.Expr, ...]:
        """Arguments of the signs; the field jumps where one of them vanishes."""
        return tuple(dict.fromkeys(p for rate in self.rates.values() for p in signs(normal_form(rate))))

    def at(self, point: Mapping[sp.Symbol, sp.Expr]) -> tuple[dict[sp.Symbol, sp.Expr], ...]:
        """Vertices of a convex set that contains the Filippov set at a point: all independent choices of the signs.

        It is the Filippov set itself where every combination of signs occurs next to the point.
        """
        tagged = sp.Tuple(*(normal_form(rate) for rate in self.rates.values()))
        values = [_substituted(SetValued(expression=r, intervals=self.intervals), dict(point)) for r in tagged]
        chosen = {s: ends for value in values for s, ends in value.intervals.items() if s in value.selections}
        found = []
        for ends in product(*chosen.values()):
            choice = dict(zip(chosen, ends, strict=True))
            found.append(tuple(normal_form(value.expression.subs(choice)) for value in values))
        return tuple(dict(zip(self.states, vertex, strict=True)) for vertex in dict.fromkeys(found))

    def transformed(self, coordinates: Mapping[sp.Symbol, sp.Expr]) -> "FilippovField":
        """Return the field in new coordinates, each given by the states; the map is inverted by back-substitution.

        Raises
        ------
        KinkError
            When a coordinate is not continuously differentiable.
        ParameterError
            When the map is not triangular in odd powers.
        """
        back = inverse(coordinates, self.states)
        rates = {new: lie_derivative(old, self.rates) for new, old in coordinates.items()}
        return FilippovField(
            rates={new: normal_form(rate.subs(back, simultaneous=True)) for new, rate in rates.items()},
            intervals=self.intervals,
        )

    def _repr_latex_(self) -> str:
        rows = [rf"\dot{{{sp.latex(s)}}} &\in {sp.latex(rate)}" for s, rate in self.rates.items()]
        rows += [rf"{sp.latex(s)} &\in {sp.latex(list(ends))}" for s, ends in self.intervals.items()]
        return r"$\displaystyle\begin{aligned}" + r"\\".join(rows) + r"\end{aligned}$"


def inverse(coordinates: Mapping[sp.Symbol, sp.Expr], states: Iterable[sp.Symbol]) -> dict[sp.Symbol, sp.Expr]:
    """States in terms of new coordinates, for a triangular map in odd signed powers, checked by substitution.

    Raises
    ------
    ParameterError
        When no equation with a single unknown is left.
    """
    unknown, known = list(states), dict[sp.Symbol, sp.Expr]()
    while unknown:
        for new, old in coordinates.items():
            left = normal_form(old.subs(known, simultaneous=True) - new)
            missing = [s for s in unknown if left.has(s)]
            if len(missing) == 1:
                known[missing[0]] = solve_signed(left, missing[0])
                unknown.remove(missing[0])
                break
        else:
            raise ParameterError(
                f"the coordinates {dict(coordinates)} cannot be inverted by back-substitution: every equation that is "
                f"left holds several of {unknown}. Use a triangular map, one new state at a time."
            )
    for new, old in coordinates.items():
        if not is_identity(old.subs(known, simultaneous=True), new):
            raise ParameterError(f"the inverse {known} does not give {new} back; the map is not invertible.")
    return known


def lie_derivative(function: sp.Expr, rates: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    """Σ ∂V/∂x_i · f_i in normal form.

    Raises
    ------
    KinkError
        When the function is not continuously differentiable, unless inside `off_kinks`.
    """
    smooth = normal_form(function)
    for power in smooth.atoms(sp.Pow):
        if power.base.has(*rates) and not power.exp.is_Integer and not power.base.is_positive:
            raise KinkError(
                f"{power} is not real, or not smooth, for every sign of its base. Use a signed or absolute power."
            )
    return normal_form(sum((smooth.diff(state) * rate for state, rate in rates.items()), start=sp.Integer(0)))


def filippov_derivative(function: sp.Expr, field: FilippovField, on: Iterable[Condition] = ()) -> SetValued:
    """Values that V̇ may take along the solutions of a Filippov field, off the switching surfaces or on a set.

    The field lies in the convex hull over independent choices of the signs whose arguments vanish; for a C¹ function so
    does V̇, and `lower` and `upper` bound it.

    Parameters
    ----------
    function : Expr
        Continuously differentiable.
    field : FilippovField
    on : iterable of (Expr, Symbol)
        Conditions expression = 0, each with the variable to eliminate. Signs that vanish there become selections in
        [−1, 1]; all other signs keep their arguments, taken not to vanish.

    Returns
    -------
    SetValued

    Raises
    ------
    KinkError
        When the function is not continuously differentiable, unless inside `off_kinks`.
    """
    return restrict(SetValued(expression=lie_derivative(function, field.rates), intervals=field.intervals), *on)


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
        current = _substituted(current, solution)
    return current


def _exact(intervals: Mapping[sp.Symbol, tuple]) -> dict[sp.Symbol, Interval]:
    """Ends as SymPy numbers or expressions; a float means the decimal that Python prints for it."""

    def end(value) -> sp.Expr:
        return sp.Rational(str(rational(value))) if isinstance(value, float) else sp.sympify(value)

    return {symbol: (end(low), end(high)) for symbol, (low, high) in intervals.items()}


def _left(condition: sp.Expr | sp.Eq) -> sp.Expr:
    return condition.lhs - condition.rhs if isinstance(condition, sp.Equality) else condition


def _substituted(value: SetValued, solution: dict[sp.Symbol, sp.Expr]) -> SetValued:
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
        return argument == 0
    decided = argument.equals(0)
    if decided is None:
        raise KinkError(f"whether {argument} vanishes cannot be decided; give the point in other numbers.")
    return bool(decided)
