"""The data of a fault that a guarantee uses."""

from fractions import Fraction

import sympy as sp

from quakedesign.certificates.guarantee.task import Friction, Task
from quakedesign.certificates.matched import static_friction
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.rationals import fraction_of, rational
from quakedesign.symbolic.friction_bounds import friction_bounds


def task_of(fault: Fault, *, rate_limited: bool = False) -> Task:
    """What a guarantee uses of a fault, exactly.

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
            "the class rate needs a disturbance that starts at 0. Received a constant one of "
            f"{given.constant!r} m/s^2. Use the class amplitude."
        )
    stage = sp.Symbol("s")
    shape = sp.Poly(fault.reference.shape(stage), stage).all_coeffs()[::-1]
    return Task(
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
