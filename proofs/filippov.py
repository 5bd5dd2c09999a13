"""Discontinuous vector fields in Filippov's sense: change of coordinates and derivatives along them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import product

import sympy as sp
from set_valued import Condition, Interval, SetValued, exact_intervals, restrict, solve_signed, substituted

from quakedesign.errors import KinkError, ParameterError
from quakedesign.symbolic.signed_power import normal_form, signs


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
        object.__setattr__(self, "intervals", exact_intervals(self.intervals))

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
        values = [substituted(SetValued(expression=r, intervals=self.intervals), dict(point)) for r in tagged]
        chosen = {s: ends for value in values for s, ends in value.intervals.items() if s in value.selections}
        limits = []
        for ends in product(*chosen.values()):
            choice = dict(zip(chosen, ends, strict=True))
            limits.append(tuple(normal_form(value.expression.subs(choice)) for value in values))
        return tuple(dict(zip(self.states, vertex, strict=True)) for vertex in dict.fromkeys(limits))

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
        if normal_form(old.subs(known, simultaneous=True) - new) != 0:
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
