"""Weights found from a field's terms, instead of guessed."""

from collections.abc import Mapping

import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.symbolic.homogeneity import homogeneous
from quakedesign.symbolic.normal_form import normal_form
from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower


def weights_for(rates: Mapping[sp.Symbol, sp.Expr], degree: int | sp.Rational) -> dict[sp.Symbol, sp.Rational]:
    """Weights that make a field homogeneous of a degree, from the linear equations that its terms impose, then proved.

    Parameters
    ----------
    rates : mapping of Symbol to Expr
        Of the field.
    degree : int or Rational
        Such as −1 for sliding modes with a discontinuous integral.

    Returns
    -------
    dict of Symbol to Rational

    Raises
    ------
    ParameterError
        When no weights exist, or they are not unique.
    """
    unknown = {state: sp.Dummy(f"r_{state}", positive=True) for state in rates}
    equations: list[sp.Expr] = []
    for state, rate in rates.items():
        for term in sp.Add.make_args(normal_form(rate)):
            if term != 0:
                equations.append(_weight(term, unknown, equations) - unknown[state] - degree)
    solution = sp.linsolve([e for e in equations if e != 0], *unknown.values())
    values = next(iter(solution), ())
    if not values or not all(v.is_Rational and v > 0 for v in values):
        raise ParameterError(
            f"the terms impose no unique positive weights for degree {degree}. Solving gives {solution}. "
            "Try another degree."
        )
    weights = dict(zip(rates, values, strict=True))
    if not homogeneous(rates, weights, degree):
        raise ParameterError(
            f"with the weights {weights} that the terms impose, homogeneity of degree {degree} is not proved."
        )
    return weights


def _weight(e: sp.Expr, unknown: Mapping[sp.Symbol, sp.Symbol], equations: list[sp.Expr]) -> sp.Expr:
    """Degree of a product in the unknown weights; sums inside powers add equations for their terms."""
    if not e.has(*unknown):
        return sp.Integer(0)
    if e in unknown:
        return unknown[e]
    if e.is_Mul:
        return sum((_weight(factor, unknown, equations) for factor in e.args), start=sp.Integer(0))
    if e.is_Add:
        first, *others = (_weight(term, unknown, equations) for term in e.args)
        equations += [first - other for other in others]
        return first
    if e.is_Pow or isinstance(e, SignedPower | AbsolutePower):
        return _weight(e.args[0], unknown, equations) * e.args[1]
    raise ParameterError(f"{e} is not built from signed powers; it has no weight.")
