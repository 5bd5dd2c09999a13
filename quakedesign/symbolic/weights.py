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
            if any(f.has(*rates) for f in term.atoms(sp.Function) - term.atoms(SignedPower, AbsolutePower)):
                raise ParameterError(f"{term} is not built from signed powers; it has no weight.")
            if term != 0:
                equations.append(size_of(term, unknown, equations) - unknown[state] - degree)
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


def size_of(e: sp.Expr, sizes: Mapping[sp.Symbol, sp.Expr], equations: list[sp.Expr]) -> sp.Expr:
    """How an expression grows with what its symbols grow with: exponents that add up in products.

    What sums, extremes and arguments of functions ask of the sizes is added to `equations`, as expressions that vanish.

    Parameters
    ----------
    e : Expr
    sizes : mapping of Symbol to Expr
        Linear in what is unknown; any other symbol does not grow.
    equations : list of Expr
    """
    if e in sizes or not e.has(*sizes):
        return sizes.get(e, sp.Integer(0))
    parts = [size_of(part, sizes, equations) for part in e.args]
    if e.is_Mul:
        return sum(parts, start=sp.Integer(0))
    if e.is_Pow or isinstance(e, SignedPower | AbsolutePower):
        if not e.args[1].is_Rational:
            raise ParameterError(f"an exponent must be rational. Received {e.args[1]} in {e}.")
        return parts[0] * e.args[1]
    if isinstance(e, sp.Add | sp.Max | sp.Min | sp.Abs):
        equations += [parts[0] - other for other in parts[1:]]
        return parts[0]
    if not isinstance(e, sp.sign):
        equations += parts
    return sp.Integer(0)
