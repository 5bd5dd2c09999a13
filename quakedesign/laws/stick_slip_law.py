"""Sampled law for the stick–slip plant: its predicted slip rate is never negative."""

from dataclasses import dataclass
from fractions import Fraction

from quakedesign.errors import ParameterError
from quakedesign.exact import shortly
from quakedesign.laws.implicit_root import Power

GAIN_UNITS = {
    "rate_gain": "Pa s/m",
    "target_gain": "Pa s/m",
    "return_rate": "1/s",
    "level_gain": "Pa s/m",
    "slip_gain": "Pa/m",
    "rest_slip": "m",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class StickSlipLaw:
    """Feedback of slip and slip rate with an estimate of the disturbance that does not wind up at rest.

    At a sample let x be the measured slip, y the measured slip rate, e = x − r the slip error, and x⁻, y⁻, v⁺⁻ the
    measurements and the predicted slip rate of the sample before. T [s] is the sampling interval, and D [Pa], the
    level, is the estimate of the disturbance. Then

        i = x − x⁻ − T(y⁻ + v⁺⁻)/2,   D ← D + level_gain·(y − v⁺⁻) + slip_gain·i,
        but max(i, −T·v⁺⁻/2 − rest_slip) in place of i where y ≤ 0,
        v = r′ − return_rate·e,   v⁺ = max(v, 0),
        p = −rate_gain·y + target_gain·v − D.

    v is the target slip rate at the next sample. The plant cannot slip backward, so v⁺ is the slip rate predicted for
    that sample. Without the innovation i of the slip, a disturbance that changes sign within a period could move the
    fault between samples at which it rests, without an effect on D. At rest i is limited from below, because a fault
    that stopped before the sample slips less than predicted, and D must not decrease for this reason. Slip noise would
    accumulate in D at rest if rest_slip were less than twice the noise bound.

    A sliding mode has v = r′ + w instead, where w solves its implicit step, see `quakedesign.laws.implicit_root`. If
    that step is deadbeat, w = −e/T, the law is the one above with return_rate = 1/T.

    Attributes
    ----------
    rate_gain, target_gain : Fraction
        [Pa·s/m], positive.
    return_rate : Fraction
        [1/s], positive.
    level_gain : Fraction
        [Pa·s/m], 0 or more.
    slip_gain : Fraction
        [Pa/m], 0 or more.
    rest_slip : Fraction
        [m], 0 or more: largest difference of measured slips of a fault at rest; 0 for exact ones.
    pull : tuple of Power
        q [m/s] of the implicit step of a sliding mode; empty for a law whose target rate is linear.

    Raises
    ------
    ParameterError
        For a gain of the wrong sign.
    """

    rate_gain: Fraction
    target_gain: Fraction
    return_rate: Fraction
    level_gain: Fraction
    slip_gain: Fraction
    rest_slip: Fraction = Fraction(0)
    pull: tuple[Power, ...] = ()

    def __post_init__(self) -> None:
        for name in GAIN_UNITS:
            value, positive = getattr(self, name), name in ("rate_gain", "target_gain", "return_rate")
            if value < 0 or (positive and not value):
                least = "positive" if positive else "0 or more"
                raise ParameterError(
                    f"{name} of a stick-slip law must be {least}. Received {shortly(value)} {GAIN_UNITS[name]}."
                )
