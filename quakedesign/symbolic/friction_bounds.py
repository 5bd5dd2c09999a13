"""Bounds and chord slopes of a friction law for proofs: its declared values, checked against its expression."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import inf

import sympy as sp

from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.exact import fraction_of, rational
from quakedesign.fault import FrictionLaw
from quakedesign.symbolic.enclosure import EVERYTHING, Box, Excess, Undecided, upper_limit
from quakedesign.symbolic.rate_and_state_plant import without_overflow
from quakedesign.symbolic.signed_power import SignedPower, slope_off_kinks

SLACK = Fraction(1, 10**9)  # relative tolerance for declared values that are rounded inward
_ZERO = Fraction(0)
_UNITS = {"slip": "m", "rate": "m/s"}


@dataclass(frozen=True, slots=True, kw_only=True)
class FrictionBounds:
    """Proved bounds of a friction law on its domain and, for a law without state, of its continuation."""

    # least, most: Bounds of the friction coefficient [-], 0 < least
    least: Fraction
    most: Fraction
    slip_slope: Fraction  # Largest |chord slope| in slip [1/m]; with states, along a motion in which they evolve
    rate_slope: Fraction  # Largest |chord slope| in slip rate [s/m], at a fixed state
    weakens: bool  # Whether friction is proved not to grow with slip


@dataclass(frozen=True)
class _FrictionRange:
    """Friction and its slopes on a range of slip, slip rate and state."""

    friction: sp.Expr
    slip_slope: sp.Expr
    rate_slope: sp.Expr
    box: Box


@lru_cache(maxsize=256)
def friction_bounds(law: FrictionLaw) -> FrictionBounds:
    """Bounds and chord slopes of a law, proved by interval arithmetic on its `coefficient` and `extended`.

    A declared value is returned if it is proved; otherwise the proved value, if it exceeds the declared one by less
    than 1e-9 relative. `coefficient` is examined for slip ≥ 0 and slip rates ≥ 0 within `working_rates`, with states
    between the steady states at the ends of `working_rates`. `extended` is examined for all slips and slip rates, but
    only for a law without state.

    Raises
    ------
    ParameterError
        If the law exceeds a declared value, or its lower bound is not positive.
    UnsupportedError
        If the law may jump or has a function without an enclosure, or subdivision gives no decision.
    """
    exact = law.exact()
    ranges = list(_friction_ranges(law, exact))
    low, high = exact.bounds
    bounds = FrictionBounds(
        least=-_confirmed(law, ranges, "the lower bound", -_declared(low), lambda c: [-c.friction]),
        most=_confirmed(law, ranges, "the upper bound", _declared(high), lambda c: [c.friction]),
        slip_slope=_confirmed(
            law, ranges, "slip_slope", _declared(exact.slip_slope), lambda c: [c.slip_slope, -c.slip_slope]
        ),
        rate_slope=_confirmed(
            law, ranges, "rate_slope", _declared(exact.rate_slope), lambda c: [c.rate_slope, -c.rate_slope]
        ),
        weakens=all(upper_limit(c.slip_slope, c.box, _ZERO, _ZERO) == 0 for c in ranges),
    )
    if bounds.least <= 0:
        raise ParameterError(
            f"friction of {law.name} must stay positive. Its lower bound is {float(bounds.least):.4g}. "
            "Raise the residual friction; without friction, pressure has no effect."
        )
    return bounds


def _friction_ranges(law: FrictionLaw, exact: FrictionLaw) -> Iterator[_FrictionRange]:
    """The law within its domain, and its continuation if it has no state."""
    slip, rate = sp.symbols("slip rate", nonnegative=True)
    states = sp.symbols([*law.state_names], positive=True)
    low, high = (end if abs(end) == inf else rational(end) for end in law.working_rates)
    box = {slip: (Fraction(0), inf), rate: (max(Fraction(0), low), high)}
    ends = [[rational(value) for value in law.steady_state(end)] for end in law.working_rates]
    box |= {state: (min(pair), max(pair)) for state, *pair in zip(states, *ends, strict=True)}
    friction = _continuous(law, exact.coefficient(slip, rate, *states))
    friction = without_overflow(friction) if states else friction
    changes = exact.state_rates(slip, rate, *states)
    carried = sum(
        (slope_off_kinks(friction, x) * dx / rate for x, dx in zip(states, changes, strict=True)), sp.Integer(0)
    )
    yield _FrictionRange(
        friction, slope_off_kinks(friction, slip) + sp.expand(carried), slope_off_kinks(friction, rate), box
    )
    if not states:
        slip, rate = sp.symbols("slip rate", real=True)
        friction = _continuous(law, exact.extended(slip, rate))
        box = {slip: EVERYTHING, rate: EVERYTHING}
        yield _FrictionRange(friction, slope_off_kinks(friction, slip), slope_off_kinks(friction, rate), box)


def _continuous(law: FrictionLaw, friction: sp.Expr) -> sp.Expr:
    """Return the friction expression unchanged; reject it if it may jump, since slopes do not reveal jumps."""
    continued = sp.sympify(friction)
    signs = [power for power in continued.atoms(SignedPower) if power.args[1] == 0]
    if signs or continued.has(sp.sign, sp.Heaviside, sp.DiracDelta):
        raise UnsupportedError(f"no bounds can be proved: friction of {law.name} may jump. Make the law continuous.")
    return continued


def _confirmed(
    law: FrictionLaw,
    ranges: list[_FrictionRange],
    what: str,
    declared: Fraction,
    parts: Callable[[_FrictionRange], list[sp.Expr]],
) -> Fraction:
    """A declared bound of a law, if no part exceeds it."""
    bound = declared
    for each in ranges:
        for part in parts(each):
            try:
                result = upper_limit(part, each.box, declared, SLACK * abs(declared))
            except UnsupportedError as error:
                raise UnsupportedError(f"no bounds of {law.name} can be proved: {error}") from None
            if isinstance(result, Excess):
                raise ParameterError(_disagreement(law, what, declared, result))
            if isinstance(result, Undecided):
                raise UnsupportedError(_undecided(law, what, declared, result))
            bound = max(bound, result)
    return bound


def _disagreement(law: FrictionLaw, what: str, declared: Fraction, result: Excess) -> str:
    at = ", ".join(f"{x} {float(value):.4g} {_UNITS.get(str(x), '')}".rstrip() for x, value in result.at.items())
    return (
        f"{what} of {law.name} contradicts the law: declared {float(abs(declared)):.6g}, but "
        f"{'at ' + at if at else 'everywhere'} it is {float(abs(result.value)):.6g}. Correct the declared value."
    )


def _undecided(law: FrictionLaw, what: str, declared: Fraction, result: Undecided) -> str:
    at = ", ".join(f"{x} from {float(low):.3g} to {float(high):.3g}" for x, (low, high) in result.where.items())
    return (
        f"no bounds of {law.name} can be proved: {what}, declared as {float(abs(declared)):.6g}, is undecided for "
        f"{at}. Write the law in another form, or limit the slip with Min."
    )


def _declared(value: object) -> Fraction:
    number = sp.sympify(value)
    if number.is_Rational:
        return fraction_of(number)
    return rational(float(number) if number.is_comparable else str(number), "a bound or slope of a friction law")
