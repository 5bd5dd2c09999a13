"""How gains change when a loop is stretched: exponents that its terms leave no choice about."""

from collections.abc import Mapping
from fractions import Fraction

import sympy as sp

from quakedesign.certificates import Loop
from quakedesign.errors import ParameterError
from quakedesign.rationals import fraction_of
from quakedesign.symbolic.terms import Term


def stretch_exponents(loop: Loop, sizes: Mapping[str, int]) -> dict[str, Fraction]:
    """Exponents p with which gains k → s^p·k and states x → s^q·x undo a stretch of the uncertain parameters.

    Every term of a rate must grow like its state, and every term of a nested argument like the others. With d → s·d
    this is the λ-scaling of a sliding mode (⅔, ½, 1, 1 for the 2-CTA), so that k/L̄^p is a set of gains for L̄ = 1.

    Parameters
    ----------
    loop : Loop
        Its numbers do not matter.
    sizes : mapping of str to int
        Exponent of s in every uncertain parameter that grows, such as ``{"d": 1}``.

    Returns
    -------
    dict of str to Fraction
        Of every gain and every state.

    Raises
    ------
    ParameterError
        When the terms do not determine the exponents.
    """
    names = (*loop.gains, *loop.states, *loop.lifts)
    unknown = {name: sp.Dummy(name) for name in names}
    known = {name: sp.Integer(sizes.get(name, 0)) for name in (*loop.uncertain, *loop.constants)}
    known |= {root: unknown[of] / 2 for root, (of, _) in loop.roots.items()}

    def size(term: Term) -> sp.Expr:
        powers = [unknown[name] * sp.Rational(e.numerator, e.denominator) for name, e, _ in term.factors]
        return sum([*({**unknown, **known}[p] for p in term.parameters), *powers], start=sp.Integer(0))

    parts = {**loop.field, **loop.lifts}
    equations = [size(term) - unknown[name] for name, terms in parts.items() for term in terms]
    solution = next(iter(sp.linsolve(equations, *unknown.values())), ())
    if not solution or not all(v.is_Rational for v in solution):
        raise ParameterError(
            f"the terms of {loop.law} must determine how its gains scale. Received {solution or 'a contradiction'}. "
            "Leave out gains without effect."
        )
    exponents = {name: fraction_of(v) for name, v in zip(unknown, solution, strict=True)}
    return {name: exponents[name] for name in (*loop.gains, *loop.states)}


def scaled_norm(loop: Loop, exponents: Mapping[str, Fraction]) -> float:
    """‖(k_i/L̄^{p_i})‖₂ of a loop's gains; no λ changes it. L̄ is the upper end of d."""
    bound = float(loop.uncertain["d"][1])
    return float(sum((float(k) / bound ** float(exponents[name])) ** 2 for name, k in loop.gains.items()) ** 0.5)
