"""Options about what lies around a controller: actuator and sensors, the same for every command that runs one."""

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from cyclopts import Group, Parameter

from quakedesign.cli.shared import (
    CubicMetresPerPascal,
    Hertz,
    Metres,
    MetresPerSecond,
    Pascals,
    PascalsPerSecond,
    Seconds,
    Whole,
    in_unit,
)
from quakedesign.errors import ParameterError

if TYPE_CHECKING:
    from quakedesign.loop.actuators import Stage
    from quakedesign.simulation import Actuator, Sensor

_SAME = 1e-9  # of a sampling period

_ACTUATOR = Group("Actuator, in the order of the signal (schemes that sample)")
_SENSORS = Group("Sensors (schemes that sample)")


@Parameter(name="*", group=_ACTUATOR)
@dataclass(frozen=True, kw_only=True)
class ActuatorOptions:
    """Stages between law and fault, for schemes that sample.

    Parameters
    ----------
    delay
        Time that the computation takes, a whole number of steps, such as '2 ms'.
    quantum
        Resolution of the pressure, such as '1 kPa'.
    saturation
        Largest pressure, such as '20 MPa', and largest withdrawal unless that is given.
    withdrawal
        Largest decrease of the pressure; 0 for a pump that only injects.
    rate_limit
        Fastest change of the pressure, such as '1 MPa/s'.
    lag
        Time constant of pump and pipe, such as '1 s'.
    diffusion
        L^2/D of the rock between well and fault, such as '100 s'; the smaller, the more substeps it needs.
    storage
        Fluid that this rock takes up per pressure, such as '1e-4 m^3/Pa'; gives injected volume and flow rate.
    cells
        Of the model of this rock.
    """

    delay: Seconds = 0.0
    quantum: Pascals | None = None
    saturation: Pascals | None = None
    withdrawal: Pascals | None = None
    rate_limit: PascalsPerSecond | None = None
    lag: Seconds | None = None
    diffusion: Seconds | None = None
    storage: CubicMetresPerPascal | None = None
    cells: Whole = 16

    def build(self, step: float) -> "Actuator":
        """Stages of an actuator in the order of the signal, for a sampling period [s].

        Raises
        ------
        ParameterError
            For values that a stage refuses, or for a part of a stage that is not there.
        """
        from quakedesign.simulation import Actuator, Delay, Diffusion, Lag, Quantisation, RateLimit, Saturation

        if self.storage is not None and self.diffusion is None:
            raise ParameterError(f"a storage belongs to a diffusion. Received {self.storage:g} m³/Pa alone. Give both.")
        if self.withdrawal is not None and self.saturation is None:
            raise ParameterError(
                f"a withdrawal belongs to a saturation. Received {self.withdrawal:g} Pa alone. Give both."
            )
        stages: list[Stage] = [Delay(samples=_periods(self.delay, step))] if self.delay else []
        stages += [] if self.quantum is None else [Quantisation(quantum=self.quantum)]
        if self.saturation is not None:
            least = 0.0 - (self.saturation if self.withdrawal is None else self.withdrawal)
            stages.append(Saturation(lowest=least, highest=self.saturation))
        stages += [] if self.rate_limit is None else [RateLimit(rate=self.rate_limit)]
        stages += [] if self.lag is None else [Lag(time_constant=self.lag)]
        if self.diffusion is not None:
            stages.append(Diffusion.of_time(self.diffusion, storage=self.storage, cells=self.cells))
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


@Parameter(name="*", group=_SENSORS)
@dataclass(frozen=True, kw_only=True)
class EstimateOptions:
    """How a controller gets slip and slip rate from readings of the slip alone.

    Parameters
    ----------
    averaging
        Number of the latest readings whose mean the differentiator gets.
    differentiator_bound
        λ_d in m/s^(n_d + 1): tell the law what a differentiator estimates from the slip.
    differentiator_order
        n_d; the paper prints 2, for which a held pressure has no λ_d.
    filter_order
        n_f of the differentiator.
    """

    averaging: Whole = 1
    differentiator_bound: str | None = None
    differentiator_order: Whole = 1
    filter_order: Whole = 0

    @property
    def bound(self) -> float | None:
        """λ_d [m/s^(n_d + 1)]."""
        if self.differentiator_bound is None:
            return None
        return in_unit(self.differentiator_bound, f"m/s^{self.differentiator_order + 1}", "differentiator bound")

    def told(self) -> dict[str, Any]:
        """Options in SI units."""
        return asdict(self) | {"differentiator_bound": self.bound}


@Parameter(name="*", group=_SENSORS)
@dataclass(frozen=True, kw_only=True)
class SensorOptions(EstimateOptions):
    """What a controller is told of slip and slip rate, for schemes that sample.

    Parameters
    ----------
    slip_noise
        Standard deviation of normal noise of the measured slip, such as '1 um': a third of the readings are off by
        more. guarantee and design take a bound by this name.
    rate_noise
        The same of the slip rate, where it is measured, such as '1 um/s'.
    bandwidth
        Of the transducer in front of a differentiator, such as '100 Hz'.
    """

    slip_noise: Metres = 0.0
    rate_noise: MetresPerSecond = 0.0
    bandwidth: Hertz | None = None

    def build(self, step: float, seed: int = 0) -> "Sensor":
        """Measurement or sensor for a sampling period [s] and a seed of the noise; raises `ParameterError`."""
        from quakedesign.simulation import Measurement
        from quakedesign.studies.estimation import sensor

        return sensor(
            step,
            Measurement(slip_noise=self.slip_noise, rate_noise=self.rate_noise, seed=seed),
            self.bound,
            self.filter_order,
            order=self.differentiator_order,
            bandwidth=math.inf if self.bandwidth is None else self.bandwidth,
            averaging=self.averaging,
        )
