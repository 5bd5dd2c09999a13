"""Options about what lies around a controller: actuator and sensors, the same for every command that runs one."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, make_dataclass
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from cyclopts import Group, Parameter

from quakedesign.cli.option_values import Hertz, Metres, MetresPerSecond, Whole, in_unit, quantity, whole
from quakedesign.errors import ParameterError
from quakedesign.loop.actuators import Actuator, Stage, stages
from quakedesign.loop.actuators.base import Option

if TYPE_CHECKING:
    from quakedesign.cli.options import RunOptions
    from quakedesign.simulation import Sensor
    from quakedesign.studies.single import Choice

_ACTUATOR = Group("Actuator, in the order of the signal (schemes that sample)")
_SENSORS = Group("Sensors (schemes that sample)")
Options = TypeVar("Options")


def _asks_every_stage(options: type[Options]) -> type[Options]:
    """Frozen dataclass with the options that the stages of the package declare."""
    asked = [option for stage in stages().values() for option in stage.options]
    fields = [(option.name, _annotation(option), option.default) for option in asked]
    doc = {"__doc__": options.__doc__, "__module__": options.__module__}
    return make_dataclass(options.__name__, fields, bases=(options,), namespace=doc, frozen=True, kw_only=True)


def _annotation(option: Option) -> Any:
    read: Any = quantity(option.unit) if option.unit else whole
    kind: Any = float if option.unit else int
    return Annotated[kind if option.default is not None else kind | None, Parameter(converter=read, help=option.help)]


@Parameter(name="*", group=_ACTUATOR)
@_asks_every_stage
class ActuatorOptions:
    """Stages between law and fault, for schemes that sample: what each declares where it is defined."""

    def told(self) -> dict[str, Any]:
        """Values in SI units, by the names of the options."""
        return dict(vars(self))

    def path(self) -> dict[str, float]:
        """Delay, lag and diffusion [s] that are given: what a law can be designed for."""
        told = self.told()
        return {name: told[name] for name in ("delay", "lag", "diffusion") if told[name]}

    def build(self, step: float, seed: int = 0) -> Actuator:
        """Stages of an actuator in the order of the signal, for a sampling period [s] and a seed of the jitter.

        Raises
        ------
        ParameterError
            For values that a stage refuses, or for a part of a stage that is not there.
        """
        chosen = (_stage(stage, self.told(), step) for stage in stages().values() if stage.options)
        chain = Actuator(stages=tuple(stage for stage in chosen if stage is not None))
        if not self.told()["jitter"]:
            return chain
        from quakedesign.simulation.campaign.reseeding import reseeded

        return reseeded(chain, seed)


def _stage(stage: type[Stage], told: Mapping[str, Any], step: float) -> Stage | None:
    """One stage; None where it is not asked for."""
    first, *others = stage.options
    if told[first.name] != first.default:
        return stage.asked(step, **{option.name: told[option.name] for option in stage.options})
    for other in others:
        if told[other.name] is not None and other.default is None:
            raise ParameterError(
                f"a {other.name} belongs to a {first.name}. Received {told[other.name]:g} {other.unit} alone. "
                "Give both."
            )
    return None


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
    differentiator_steps
        Of it inside the controller, for every reading.
    """

    averaging: Whole = 1
    differentiator_bound: str | None = None
    differentiator_order: Whole = 1
    filter_order: Whole = 0
    differentiator_steps: Whole = 1

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
        more. --slip-noise is a bound, of guarantee and design.
    rate_noise
        The same of the slip rate, where it is measured, such as '1 um/s'.
    bandwidth
        Of the transducer in front of a differentiator, such as '100 Hz'.
    slip_quantum
        Steps in which that transducer reads, such as '0.15 um'.
    """

    slip_noise: Annotated[Metres, Parameter(name="--slip-noise-deviation")] = 0.0
    rate_noise: Annotated[MetresPerSecond, Parameter(name="--rate-noise-deviation")] = 0.0
    bandwidth: Hertz | None = None
    slip_quantum: Metres = 0.0

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
            quantum=self.slip_quantum,
            inner_steps=self.differentiator_steps,
        )


def surroundings(
    chosen: "Choice | None",
    step: float,
    run: "RunOptions",
    actuator: ActuatorOptions,
    sensors: SensorOptions,
    seed: int,
) -> "tuple[int, Actuator, Sensor]":
    """Substeps, actuator and sensor of a run with a sampling period [s].

    Stages for which a law of samples is designed, with the substeps that they need, and the noise of its certificate
    stand where none is given.
    """
    from quakedesign.simulation.run import own_path

    told, seen = actuator.build(step, seed), sensors.build(step, seed)
    if chosen is None:
        return run.substeps, told, seen
    meant, substeps = own_path(chosen.controller, None, run.substeps)
    return substeps, told.completed(meant) if meant else told, seen if seen.noisy else chosen.noise(seed)
