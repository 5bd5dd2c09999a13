"""One run of one controller, as the command line asks for it."""

from collections.abc import Callable

from quakedesign.certificates.premises import Premise, least_authority
from quakedesign.controllers import Controller, SlidingMode, control_law, published
from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.fault import Fault
from quakedesign.simulation import Trajectory, natural_earthquake
from quakedesign.simulation import simulate as run_loop
from quakedesign.synthesis.sampling import on_trajectory


def chosen_controller(fault: Fault, name: str, gains: tuple[str, ...]) -> Controller:
    """Controller from a law's name and ``("published",)`` or exact gains.

    Raises
    ------
    UnknownNameError, ParameterError
    """
    law = control_law(name)
    if gains == ("published",):
        known = published(fault.name)
        if name not in known:
            raise UnknownNameError(
                f"published gains exist for real-fault and lab-fault. Received {fault.name!r}. Give --gains."
            )
        return known[name]
    if issubclass(law, SlidingMode):
        return law.from_values(gains, divisor=least_authority(fault))
    return law.from_values(gains)


def run_single(
    fault: Fault,
    controller: str,
    gains: tuple[str, ...],
    *,
    step: float | None,
    scheme: str,
    method: str,
    plant: str,
    tell: Callable[[float], None],
) -> tuple[Trajectory, list[Premise]]:
    """Run a loop; the premise `on_trajectory` of a sliding mode is against the limit of its gains.

    Raises
    ------
    UnknownNameError, ParameterError
    """
    if controller == "none":
        if step is not None or gains != ("published",):
            raise ParameterError("without a controller there are no gains and the step follows from the fault.")
        return natural_earthquake(fault, plant=plant), []
    law = chosen_controller(fault, controller, gains)
    run = run_loop(fault, law, step=step, scheme=scheme, method=method, plant=plant, progress=tell)
    if not isinstance(law, SlidingMode):
        return run, []
    premise = on_trajectory(law, float(law.lipschitz_limit), run)
    return run, [premise] if premise else []
