"""What a law is told of fault and reference, by symbols."""

import sympy as sp

from quakedesign.laws import Signals
from quakedesign.laws.sampled_controller import integral_symbols, law_expressions, r, r_acceleration, r_rate
from quakedesign.symbolic import plant


class Told:
    """A law that answers with what it is told."""

    integral_units = ("m s", "m s2")

    def pressure(self, signals):
        return signals

    def integral_rates(self, signals):
        return signals.integrals[::-1]


def test_errors_are_those_of_the_fault_against_the_reference():
    xi = sp.symbols("xi_1 xi_2", real=True)
    told, rates = law_expressions(Told())
    assert told == Signals(
        slip=plant.x1,
        slip_rate=plant.x2,
        slip_error=plant.x1 - r,
        slip_rate_error=plant.x2 - r_rate,
        integrals=xi,
        reference_acceleration=r_acceleration,
    )
    assert rates == xi[::-1]
    assert integral_symbols(None) == ()
