"""How many derivatives of an output it takes until the control appears."""

from collections.abc import Mapping

import sympy as sp

from quakedesign.symbolic.term_expressions import lie_derivative


def relative_degree(output: sp.Expr, field: Mapping[sp.Symbol, sp.Expr], control: sp.Symbol) -> int | None:
    """Least n for which the nth derivative of the output along the field depends on the control.

    Parameters
    ----------
    output : Expr
    field : mapping of Symbol to Expr
        Rate of every state.
    control : Symbol

    Returns
    -------
    int or None
        None where as many derivatives as there are states do not depend on it, and so no later one does at all points.
    """
    for degree, _ in enumerate(field, start=1):
        output = sp.expand(lie_derivative(output, field))
        if output.has(control):
            return degree
    return None
