"""How fast a fault can slip at most under a given e-LQR whose pressure acts at once, as the theorem proves it."""

from quakedesign.certificates.guarantee import ContinuousPeaks, NoGuarantee, continuous_peaks, task_of
from quakedesign.controllers.elqr import ExtendedLQR
from quakedesign.errors import ParameterError, UnknownNameError, require_known
from quakedesign.fault import Fault
from quakedesign.loop import exact_integrals

CLASSES = ("amplitude", "rate")


def certified_peaks(
    fault: Fault, controller: ExtendedLQR, *, disturbance_class: str = "amplitude"
) -> ContinuousPeaks | NoGuarantee:
    """Bounds of slip, slip rate and pressure in continuous time, of everything that reference and disturbance cause.

    Parameters
    ----------
    fault : Fault
    controller : ExtendedLQR
        With either feedback.
    disturbance_class : str
        ``"amplitude"``: any measurable disturbance as large as the fault's; ``"rate"``: no faster either.

    Raises
    ------
    UnknownNameError
        For an unknown class.
    ParameterError
        For a law that starts with a pressure other than zero, friction with a state, or the class ``rate`` and a
        disturbance that does not start at 0.
    """
    require_known(disturbance_class, CLASSES, "disturbance class", UnknownNameError)
    if controller.offset:
        raise ParameterError("a certified peak needs a law that starts with p = 0. Received one with an offset.")
    law = exact_integrals(tuple(controller.gains.values()), of_state=controller.feedback == "state")
    needed = 1 + any(law.of_reference)
    if len(law.states) < needed:
        few = f"too few integrals for feedback of the {controller.feedback}: {needed} needed, {len(law.states)} in use"
        return NoGuarantee(reason=few, small_gain=None)
    found, limits = continuous_peaks(task_of(fault, rate_limited=disturbance_class == "rate"), law), controller.limits
    if limits is None or isinstance(found, NoGuarantee):
        return found
    low, high = found.claims.least_pressure, found.claims.largest_pressure
    if limits.lowest < low and high < limits.highest:
        return found
    reason = f"the pressure may reach a limit of the law, from {low.quantity('Pa')} to {high.quantity('Pa')}"
    return NoGuarantee(reason=reason, small_gain=None)
