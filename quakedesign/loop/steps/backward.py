"""A law at the end of the step, for the double integrator that the controller has in mind."""

import sympy as sp

from quakedesign.loop.steps import discrete_law
from quakedesign.loop.steps.discrete_law import Law
from quakedesign.loop.steps.inclusion import Inclusion, direction, end_rate, end_slip

ERRORS = {discrete_law.slip_error: end_slip, discrete_law.rate_error: end_rate}
AHEAD = {
    discrete_law.slip: end_slip + discrete_law.next_reference,
    discrete_law.rate: end_rate + discrete_law.next_reference_rate,
}


def backward_euler(law: Law) -> tuple[sp.Expr, ...]:
    """Pull [m/s], feed-forward [Pa] and ξ⁺ in `end_slip`, `end_rate` and the symbols of `discrete_law`.

    The pull is T_s·B0·p without the feed-forward, which is what the law asks for at zero errors and integral states: it
    answers to forces of the plant that the double integrator does not have. Slip and slip rate themselves are taken at
    the end of the step if the pressure then never rises with them, at its start otherwise. Every ξ' has the ξ before it
    at the end, and the others at the start of the step.
    """
    pressure, ends = _at_end(law, ERRORS | AHEAD)
    if direction(pressure) != -1:
        pressure, ends = _at_end(law, ERRORS)
    feed_forward = pressure.xreplace(dict.fromkeys((end_slip, end_rate, *law.integrals), sp.Integer(0)))
    pull = discrete_law.step * discrete_law.authority * (pressure - feed_forward)
    return sp.expand_mul(pull), feed_forward, *map(sp.expand_mul, ends)


def inclusion(pull: sp.Expr) -> Inclusion:
    """The implicit step of a pull from `backward_euler`."""
    return Inclusion(discrete_law.rate_error, pull, discrete_law.slip_error, discrete_law.step)


def _at_end(law: Law, place: dict[sp.Symbol, sp.Expr]) -> tuple[sp.Expr, list[sp.Expr]]:
    """Pressure and ξ⁺ with the signals at the end of the step."""
    ends: dict[sp.Symbol, sp.Expr] = {}
    for symbol, rate in zip(law.integrals, law.rates, strict=True):
        ends[symbol] = symbol + discrete_law.step * rate.xreplace(place | ends)
    return law.pressure.xreplace(place | ends), list(ends.values())
