"""At which slip rate a fault is studied."""

from fractions import Fraction

from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.symbolic import state_plant


def operating_rate(fault: Fault, rate: float | str | Fraction | None = None) -> Fraction:
    """Slip rate [m/s] of the equilibrium that is studied, checked against the law.

    Raises
    ------
    ParameterError
        When the rate is outside of the law's working range, or sliding at it is not steady.
    """
    law = fault.friction
    value = rational(law.operating_rate if rate is None else rate, "loading_rate")
    low, high = law.working_rates
    if value < 0 or not low <= value <= high:
        raise ParameterError(
            f"loading_rate must be zero or positive and in the working range {low!r} to {high!r} m/s of {law.name}. "
            f"Received {float(value)!r} m/s. Change it, or widen the range of the law."
        )
    if value > 0 and not state_plant.is_steady(law.symbolic()):
        raise ParameterError(
            f"loading_rate must be zero for {law.name}, whose friction changes with slip, so that sliding is never "
            f"steady. Received {float(value)!r} m/s."
        )
    return value
