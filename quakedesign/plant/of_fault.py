"""Uncertain plants of a fault that follows a reference; in slow sliding for rate-and-state friction."""

from dataclasses import replace
from fractions import Fraction

import sympy as sp

from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.exact import fraction_of, rational
from quakedesign.fault import Fault, SlidingReference
from quakedesign.loop import StateLaw
from quakedesign.plant.fault_plant import FaultPlant, Friction
from quakedesign.plant.sliding_plant import AXES, SlidingPlant
from quakedesign.symbolic.friction_bounds import friction_bounds

_LAWS: dict[str, tuple[StateLaw, bool]] = {
    "rate-and-state-aging": ("ageing", False),
    "rate-and-state-slip": ("slip", False),
    "regularised-rate-and-state": ("ageing", True),
}
"""State law, unless the friction law specifies one itself, and whether friction is regularised."""
_DIGITS = 12
_LARGEST_RAMP = Fraction(8, 23)


def static_friction(fault: Fault) -> Fraction:
    """Static friction coefficient μ* [-] at the initial slip, exact or rounded to 50 digits."""
    start = sp.nsimplify(fault.friction.exact().coefficient(sp.Integer(0), sp.Integer(0)), rational=True)
    return fraction_of(start) if start.is_Rational else rational(str(sp.N(start, 50)))


def slow_sliding_plant(fault: Fault, stress: Fraction, spread: Fraction = Fraction(0)) -> SlidingPlant:
    """Slow-sliding plant at V, the first rate of the reference, with a stress disturbance up to `stress` [Pa].

    The ranges of a, b and D extend to both sides by the fraction `spread` [-]; the range of μ* follows from those of a
    and b, as μ* depends on a − b if V is not the reference rate of friction.

    Raises
    ------
    UnsupportedError
        For friction without a state, or whose state depends on the normal stress, and for a reference whose `ramp` is
        at least 8/23: its rate would deviate from V by V or more.
    """
    if fault.friction.name not in _LAWS or fault.friction.stress_sensitivity:  # type: ignore[attr-defined]
        sensitivity = getattr(fault.friction, "stress_sensitivity", 0)
        raise UnsupportedError(
            f"a guarantee of slow sliding needs a friction law among {', '.join(_LAWS)}, with stress_sensitivity 0. "
            f"Received {fault.friction.name}{f', stress_sensitivity {sensitivity:g}' * bool(sensitivity)}. "
            "Simulate this fault instead."
        )
    state_law, regularised = _LAWS[fault.friction.name]
    if getattr(fault.friction, "evolution", "") == "slip":
        state_law = "slip"
    friction = fault.friction.exact()
    reference = SlidingReference(task=fault.reference)
    if reference.swing >= 1:
        raise UnsupportedError(
            f"a guarantee of slow sliding needs a ramp below {_LARGEST_RAMP}, at which the reference rate doubles. "
            f"Received the ramp {fault.reference.ramp:g}. Reduce the ramp, or simulate this fault instead."
        )
    rate = reference.first_rate
    named = {axis: rational(getattr(fault.friction, axis)) for axis in AXES[:3]}
    steady = friction.steady_coefficient(sp.Rational(rate.numerator, rate.denominator))
    middle = _near(steady)
    per_effect = abs(_near(sp.log(sp.Rational(rate.numerator, rate.denominator) / friction.reference_rate)))  # type: ignore[attr-defined]
    off = spread * per_effect * (named["direct_effect"] + named["evolution_effect"])
    off += Fraction(1, 10**_DIGITS) * middle if off or not steady.is_Rational else 0
    ends = {name: (value * (1 - spread), value * (1 + spread)) for name, value in named.items()}
    normal = rational(fault.effective_normal_stress)
    stiffness = rational(fault.shear_modulus) / rational(fault.side)
    return SlidingPlant(
        name=fault.name,
        density=rational(fault.density),
        shear_modulus=rational(fault.shear_modulus),
        length=rational(fault.side),
        damping=rational(fault.damping) / fault.squares,
        ranges={**ends, "coefficient": (middle - off, middle + off), "normal_stress": (normal, normal)},
        rate=rate,
        distance=rational(fault.reference.target_slip),
        ramp=stiffness * rate / middle,
        stress=stress,
        swing=reference.swing,
        state_law=state_law,
        regularised=regularised,
    )


def plant_like(plant: FaultPlant | SlidingPlant, fault: Fault, *, wide: bool = False) -> FaultPlant | SlidingPlant:
    """Plant of a fault, of the same kind as a given plant, with the disturbance class or stress of that plant.

    In slow sliding, by default the constants of friction are exact and the planned pressure has the rate `ramp` of the
    given plant. With `wide` the constants of friction have the relative uncertainty of those of the given plant, and
    the planned pressure has the rate that follows from the fault.
    """
    if isinstance(plant, FaultPlant):
        return uncertain_plant(fault, rate_limited=plant.change is not None)
    low, high = plant.ranges["direct_effect"]
    if wide:
        return slow_sliding_plant(fault, plant.stress, (high - low) / (high + low))
    return replace(slow_sliding_plant(fault, plant.stress), ramp=plant.ramp)


def _near(expression: sp.Expr) -> Fraction:
    """A rational within 10^-14 of a number; itself if it is rational."""
    value = sp.nsimplify(expression, rational=True) if expression.is_Rational else sp.N(expression, 40)
    return fraction_of(value) if value.is_Rational else Fraction(str(value)).limit_denominator(10**18)


# ----------------------------------------------------------------------
# Friction of slip and slip rate: the plant that follows a reference.


def uncertain_plant(fault: Fault, *, rate_limited: bool = False) -> FaultPlant:
    """Plant of a fault with its reference and disturbance, in exact numbers.

    Parameters
    ----------
    fault : Fault
    rate_limited : bool
        Whether the disturbance is bounded in its rate of change as well (class ``rate``).

    Raises
    ------
    ParameterError
        For friction with a state, or a disturbance of the class ``rate`` that does not start at 0.
    """
    fault.require_memoryless("a guarantee of tracking")
    law, given, box = friction_bounds(fault.friction), fault.disturbance, fault.box
    amplitude, change = fault.disturbance_bounds
    if rate_limited and given.constant:
        raise ParameterError(
            "the disturbance class rate needs a disturbance that is 0 at t = 0. Received a constant disturbance of "
            f"{given.constant!r} m/s^2. Use the class amplitude."
        )
    stage = sp.Symbol("s")
    shape = sp.Poly(fault.reference.shape(stage), stage).all_coeffs()[::-1]
    return FaultPlant(
        name=fault.name,
        density=rational(fault.density),
        shear_modulus=rational(fault.shear_modulus),
        length=rational(fault.side),
        damping=rational(fault.damping) / fault.squares,
        normal_stress=rational(fault.effective_normal_stress),
        spreads=(box.stiffness, box.damping, box.authority),
        friction=Friction(
            static=static_friction(fault),
            least=law.least,
            largest=law.most,
            weakening=law.slip_slope,
            strengthening=Fraction(0) if law.weakens else law.slip_slope,
            rate_slope=law.rate_slope,
        ),
        shape=tuple(fraction_of(sp.Rational(c)) for c in shape),
        target_slip=rational(fault.reference.target_slip),
        operation_time=rational(fault.reference.operation_time),
        amplitude=amplitude,
        change=change if rate_limited else None,
        growths=(rational(given.slip_growth), rational(given.rate_growth)),
    )
