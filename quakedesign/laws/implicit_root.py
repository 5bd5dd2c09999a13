"""Implicit step of a sampled law: w solves w = e2 − q(e1 + T_s·w, w), with q odd and non-decreasing.

q is a sum of signed powers with non-negative factors, whose arguments are the slip error or the slip-rate error at the
end of the step, or such sums again. So q is monotone by construction; ⌈x⌋⁰ is the set-valued sign. F(w) = w − e2 + q is
strongly monotone and has one root, which decreases with e1 and increases with e2.
"""

from collections.abc import Iterator
from fractions import Fraction
from typing import Any

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.exact import shortly

SIGNALS = ("slip", "rate")
MOST_TERMS = 16
MOST_EXPONENT = 6
_TINY = 1e-300
_HALVINGS = 50


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Power:
    """One term c⌈x⌋^a of a monotone sum.

    Attributes
    ----------
    factor : (Fraction, Fraction)
        Ends of a range that contains c ≥ 0; equal for a rational c.
    exponent : Fraction
        a ≥ 0, numerator and denominator at most 6.
    argument : str or tuple of Power
        x: ``slip``, e1 at the end of the step [m], ``rate``, e2 there [m/s], or a sum.
    """

    factor: tuple[Fraction, Fraction]
    exponent: Fraction
    argument: "str | tuple[Power, ...]"

    def __post_init__(self) -> None:
        low, high = self.factor
        power = self.exponent
        sound = 0 <= low <= high and 0 <= power.numerator <= MOST_EXPONENT and power.denominator <= MOST_EXPONENT
        if not sound or (self.argument not in SIGNALS and (isinstance(self.argument, str) or not self.argument)):
            raise ParameterError(
                f"a term of an implicit step needs a factor of 0 or more, an exponent p/q with 0 <= p, q <= "
                f"{MOST_EXPONENT}, and the argument slip, rate or a sum. Received the factor {shortly(low)} to "
                f"{shortly(high)}, the exponent {power} and the argument {self.argument!r:.60}."
            )


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class ImplicitStep:
    """Implicit step: the sum q, and a sector bound of the solution w for the errors that a claim covers.

    Attributes
    ----------
    pull : tuple of Power
        Terms of the sum q [m/s], 1 to 16 including nested terms.
    slopes : (Fraction, Fraction)
        γ0 ≤ γ1 in [0, 1]: |T_s·w + γ·e1| ≤ T_s·ε for some γ between them.
    remainder : Fraction
        ε [m/s], 0 or more.
    """

    pull: tuple[Power, ...]
    slopes: tuple[Fraction, Fraction] = (Fraction(1), Fraction(1))
    remainder: Fraction = Fraction(0)

    def __post_init__(self) -> None:
        count = sum(1 for _ in _all_terms(self.pull))
        if not 0 < count <= MOST_TERMS:
            raise ParameterError(f"an implicit step must have 1 to {MOST_TERMS} terms. Received {count}.")
        if not 0 <= self.slopes[0] <= self.slopes[1] <= 1 or self.remainder < 0:
            raise ParameterError(
                "slopes of an implicit step must be ordered within [0, 1], and its remainder 0 or more. Received the "
                f"slopes {self.slopes[0]} and {self.slopes[1]}, and the remainder {self.remainder}."
            )

    @property
    def middle(self) -> Fraction:
        """Slope of the nominal loop."""
        return (self.slopes[0] + self.slopes[1]) / 2

    @property
    def half_range(self) -> Fraction:
        """Half the range of the slope."""
        return (self.slopes[1] - self.slopes[0]) / 2


def pulled(terms: tuple[Power, ...], slip: Any, rate: Any) -> Any:
    """q [m/s] at the errors slip [m] and rate [m/s], floats or arrays, with factors at their midpoints and ⌈0⌋⁰ = 0."""
    signals, total = {"slip": slip, "rate": rate}, 0.0
    for term in terms:
        nested = term.argument
        value = signals[nested] if isinstance(nested, str) else pulled(nested, slip, rate)
        sign = (value > 0) * 1.0 - (value < 0)
        total = total + float(sum(term.factor)) / 2 * sign * abs(value) ** float(term.exponent)
    return total


def step_solution(terms: tuple[Power, ...], step: float, slip: Any, rate: Any) -> Any:
    """w [m/s], float or array, by bisection down to rounding; −e1/T_s where the sign keeps the next slip error at 0.

    `step` is T_s [s], `slip` and `rate` are the measured errors e1 [m] and e2 [m/s], floats or arrays.
    """
    deadbeat = -slip / step
    after, before = (deadbeat - rate + pulled(terms, way * _TINY, deadbeat) for way in (1, -1))
    first = -rate + pulled(terms, slip, 0 * rate)
    low, high = (first > 0) * -first, (first < 0) * -first
    at_zero = (before <= 0) & (after >= 0)
    if not (at_zero | (low == high)).all():
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            above = middle - rate + pulled(terms, slip + step * middle, middle) > 0
            low, high = low + (middle - low) * ~above, high + (middle - high) * above
    return deadbeat * at_zero + (low + high) / 2 * ~at_zero


def _all_terms(terms: tuple[Power, ...]) -> Iterator[Power]:
    for term in terms:
        yield term
        if not isinstance(term.argument, str):
            yield from _all_terms(term.argument)
