"""A law at the end of the step, for the double integrator that the controller has in mind."""

import sympy as sp

from quakedesign.simulation.schemes import lawful
from quakedesign.simulation.schemes.inclusion import Inclusion, direction, end_rate, end_slip
from quakedesign.simulation.schemes.lawful import Law

ERRORS = {lawful.slip_error: end_slip, lawful.rate_error: end_rate}
AHEAD = {lawful.slip: end_slip + lawful.next_reference, lawful.rate: end_rate + lawful.next_reference_rate}


def backward_euler(law: Law) -> tuple[sp.Expr, ...]:
    """Pull [m/s], feed-forward [Pa] and ξ⁺ in `end_slip`, `end_rate` and the symbols of `lawful`.

    The pull is T_s·B0·p without the feed-forward, which is what the law asks for at zero errors and integral states: it
    answers to forces of the plant that the double integrator does not have. Slip and slip rate themselves are taken at
    the end of the step if the pressure then never rises with them, at its start otherwise. Every ξ' has the ξ before it
    at the end, and the others at the start of the step.
    """
    pressure, ends = _at_end(law, ERRORS | AHEAD)
    if direction(pressure) not in (0, -1):
        pressure, ends = _at_end(law, ERRORS)
    feed_forward = pressure.subs(dict.fromkeys((end_slip, end_rate, *law.integrals), 0), simultaneous=True)
    pull = lawful.step * lawful.authority * (pressure - feed_forward)
    return sp.expand_mul(pull), feed_forward, *map(sp.expand_mul, ends)


def inclusion(pull: sp.Expr) -> Inclusion:
    """The implicit step of a pull from `backward_euler`."""
    return Inclusion(lawful.rate_error, pull, lawful.slip_error, lawful.step)


def _at_end(law: Law, place: dict[sp.Symbol, sp.Expr]) -> tuple[sp.Expr, list[sp.Expr]]:
    """Pressure and ξ⁺ with the signals at the end of the step."""
    ends: dict[sp.Symbol, sp.Expr] = {}
    for symbol, rate in zip(law.integrals, law.rates, strict=True):
        ends[symbol] = symbol + lawful.step * rate.subs(place | ends, simultaneous=True)
    return law.pressure.subs(place | ends, simultaneous=True), list(ends.values())
