"""The data of a fault with rate-and-state friction that a guarantee of slow sliding uses."""

from fractions import Fraction

import sympy as sp

from quakedesign.certificates.slow_sliding.task import AXES, SlidingTask
from quakedesign.errors import UnsupportedError
from quakedesign.fault import Fault, SlidingReference
from quakedesign.loop import StateLaw
from quakedesign.rationals import fraction_of, rational

_LAWS: dict[str, tuple[StateLaw, bool]] = {
    "rate-and-state-aging": ("ageing", False),
    "rate-and-state-slip": ("slip", False),
    "regularised-rate-and-state": ("ageing", True),
}
"""Law of the state, unless the friction tells one itself, and whether friction is regularised."""
_DIGITS = 12
_LARGEST_RAMP = Fraction(8, 23)


def sliding_task(fault: Fault, stress: Fraction, spread: Fraction = Fraction(0)) -> SlidingTask:
    """The task of a fault that slides at V, the first rate of its reference, under a stress of at most `stress` [Pa].

    The ranges of a, b and D are their values and `spread` of them to both sides [-]; that of μ* follows from a − b.

    Raises
    ------
    UnsupportedError
        For friction without a state, or whose state feels the normal stress, and for a ramp from 8/23 on.
    """
    if fault.friction.name not in _LAWS or fault.friction.stress_sensitivity:  # type: ignore[attr-defined]
        sensitivity = getattr(fault.friction, "stress_sensitivity", 0)
        raise UnsupportedError(
            f"a guarantee of slow sliding needs friction of a law {', '.join(_LAWS)}, its state deaf to the normal "
            f"stress. Received {fault.friction.name}{f', stress_sensitivity {sensitivity:g}' * bool(sensitivity)}. "
            "Simulate it."
        )
    state_law, regularised = _LAWS[fault.friction.name]
    if getattr(fault.friction, "evolution", "") == "slip":
        state_law = "slip"
    law = fault.friction.exact()
    reference = SlidingReference(task=fault.reference)
    if reference.swing >= 1:
        raise UnsupportedError(
            f"a guarantee of slow sliding needs a ramp below {_LARGEST_RAMP}, with which the rate of the reference "
            f"doubles. Received {fault.reference.ramp:g}. Make it smaller, or simulate it."
        )
    rate = reference.first_rate
    named = {axis: rational(getattr(fault.friction, axis)) for axis in AXES[:3]}
    steady = law.steady_coefficient(sp.Rational(rate.numerator, rate.denominator))
    middle = _near(steady)
    per_effect = abs(_near(sp.log(sp.Rational(rate.numerator, rate.denominator) / law.reference_rate)))  # type: ignore[attr-defined]
    off = spread * per_effect * (named["direct_effect"] + named["evolution_effect"])
    off += Fraction(1, 10**_DIGITS) * middle if off or not steady.is_Rational else 0
    ends = {name: (value * (1 - spread), value * (1 + spread)) for name, value in named.items()}
    normal = rational(fault.effective_normal_stress)
    stiffness = rational(fault.shear_modulus) / rational(fault.side)
    return SlidingTask(
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


def _near(expression: sp.Expr) -> Fraction:
    """A rational within 10^-14 of a number; itself if it is rational."""
    value = sp.nsimplify(expression, rational=True) if expression.is_Rational else sp.N(expression, 40)
    return fraction_of(value) if value.is_Rational else Fraction(str(value)).limit_denominator(10**18)
