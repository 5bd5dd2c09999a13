"""Actuators as the command line makes them, from quantities in SI units."""

from quakedesign.errors import ParameterError
from quakedesign.loop.actuators import (
    Actuator,
    Delay,
    Diffusion,
    Lag,
    Quantisation,
    RateLimit,
    Saturation,
    Stage,
)

_SAME = 1e-9  # of a sampling period


def actuator(
    step: float,
    *,
    delay: float = 0.0,
    quantum: float | None = None,
    saturation: float | None = None,
    withdrawal: float | None = None,
    rate_limit: float | None = None,
    lag: float | None = None,
    diffusion: float | None = None,
    storage: float | None = None,
    cells: int = 16,
) -> Actuator:
    """Stages between law and fault, in this order; those that are None are left out.

    Parameters
    ----------
    step : float
        Sampling period [s].
    delay : float
        A whole number of sampling periods [s].
    quantum : float, optional
        Resolution [Pa].
    saturation, withdrawal : float, optional
        Largest increase and largest decrease of the pressure [Pa]; equal unless both are given.
    rate_limit : float, optional
        Fastest change [Pa/s].
    lag : float, optional
        Time constant [s].
    diffusion : float, optional
        L²/D of the rock between well and fault [s].
    storage : float, optional
        Fluid that this rock takes up per pressure [m³/Pa].
    cells : int
        Of the model of the rock.

    Raises
    ------
    ParameterError
        For values that a stage refuses, or for a part of a stage that is not there.
    """
    if storage is not None and diffusion is None:
        raise ParameterError(f"a storage belongs to a diffusion. Received {storage:g} m³/Pa alone. Give both.")
    if withdrawal is not None and saturation is None:
        raise ParameterError(f"a withdrawal belongs to a saturation. Received {withdrawal:g} Pa alone. Give both.")
    stages: list[Stage] = [Delay(samples=_periods(delay, step))] if delay else []
    stages += [] if quantum is None else [Quantisation(quantum=quantum)]
    if saturation is not None:
        stages.append(Saturation(lowest=0.0 - (saturation if withdrawal is None else withdrawal), highest=saturation))
    stages += [] if rate_limit is None else [RateLimit(rate=rate_limit)]
    stages += [] if lag is None else [Lag(time_constant=lag)]
    stages += [] if diffusion is None else [Diffusion.of_time(diffusion, storage=storage, cells=cells)]
    return Actuator(stages=tuple(stages))


def _periods(delay: float, step: float) -> int:
    """Number of sampling periods in a delay [s]."""
    count = round(delay / step) if step > 0 and 0 <= delay < 1e9 * step else -1
    if count < 0 or abs(delay - count * step) > _SAME * step:
        raise ParameterError(
            f"delay must be a whole number of sampling periods of {step:g} s, since p is held over each. "
            f"Received {delay:g} s. Change the delay or the step."
        )
    return count
