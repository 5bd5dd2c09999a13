"""Option types of the command line, and options that several commands share.

Chapters: numbers with units, exact numbers and gains; options of laws, runs and output; actuator and sensors; runs of
faults with friction state. Quantities of the loop setup, and stages of actuators, declare their unit and help text
themselves (`quakedesign.loop`).
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, is_dataclass, make_dataclass, replace
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

from cyclopts import Group, Parameter, Token

from quakedesign.cli.app import print_json, print_lines, reject, set_output, specified
from quakedesign.errors import ParameterError, UnitError
from quakedesign.exact import rational
from quakedesign.fault.equilibrium import by_equilibrium
from quakedesign.files import Json
from quakedesign.loop import Actuator, stages
from quakedesign.loop.actuators.base import Option, Stage
from quakedesign.loop.loop_setup import IDEAL, LoopSetup, quantities

if TYPE_CHECKING:
    from quakedesign.fault import Fault
    from quakedesign.laws import Controller
    from quakedesign.loop.sensing import Sensor
    from quakedesign.simulation import Load
    from quakedesign.simulation.trajectory import Trajectory
    from quakedesign.studies.single_runs import Choice


# ----------------------------------------------------------------------
# Values of options: numbers with units, exact numbers, whole numbers, gains.

# Negative decimals are accepted anyway. With leading hyphens allowed, later options would be read as values.
Texts = Annotated[tuple[str, ...], Parameter(consume_multiple=True)]


def _gains(_type: object, tokens: Sequence[Token]) -> tuple[str, ...]:
    """Texts of --gains as typed: one keyword, or numbers, each of which is checked."""
    texts = tuple(token.value for token in tokens)
    for place, text in enumerate(texts if len(texts) > 1 else (), start=1):
        rational(text, f"gain k{place}")
    return texts


Gains = Annotated[tuple[str, ...], Parameter(consume_multiple=True, converter=_gains)]


def quantity(unit: str) -> Callable[[object, Sequence[Token]], float]:
    """Converter of an option's text: a number with a unit, or a bare number in the SI unit `unit`."""

    def read(_type: object, tokens: Sequence[Token]) -> float:
        return in_unit(tokens[0].value, unit, (tokens[0].keyword or "value").strip("-").replace("-", " "))

    return read


def in_unit(text: str, unit: str, name: str) -> float:
    """Value in the SI unit `unit` of a text: a number with a unit, or a bare number."""
    try:
        return float(text)
    except ValueError:
        return _with_unit(text, unit, name)


def whole(_type: object, tokens: Sequence[Token]) -> int:
    """Whole number from an option's text. Raises ParameterError for any other text."""
    text, name = tokens[0].value, (tokens[0].keyword or "value").strip("-").replace("-", " ")
    try:
        return int(text)
    except ValueError:
        raise ParameterError(f"{name} must be a whole number. Received {text!r}. Write for example 8.") from None


def _exact_reader(unit: str) -> Callable[[object, Sequence[Token]], str]:
    """Converter to an exact number: a number or p/q as typed, or the SI value of a text with a unit."""

    def read(_type: object, tokens: Sequence[Token]) -> str:
        text, name = tokens[0].value, (tokens[0].keyword or "value").strip("-").replace("-", " ")
        try:
            rational(text)
        except ParameterError:
            return repr(_with_unit(text, unit, name))
        return str(text)

    return read


def diffusion_time(diffusion: str | None, well: str | None, diffusivity: str | None) -> str | None:
    """Diffusion time L²/D [s], as given or from the distance L of a well [m] and the diffusivity D [m²/s].

    Raises
    ------
    ParameterError
        If both forms are given, if only one of distance and diffusivity is given, or if one is not positive.
    """
    if well is None and diffusivity is None:
        return diffusion
    if well is None or diffusivity is None or diffusion not in (None, "0"):
        units = {"well": "m", "diffusivity": "m^2/s", "diffusion": "s"}
        entries = {"well": well, "diffusivity": diffusivity, "diffusion": diffusion}
        received = " and ".join(
            f"--{name} of {value} {units[name]}" for name, value in entries.items() if value not in (None, "0")
        )
        alone = " alone" if " and " not in received else ""
        raise ParameterError(
            "the diffusion path needs the distance of the well and the diffusivity, or L^2/D alone. Received "
            f"{received}{alone}. Give --well and --diffusivity, or --diffusion alone."
        )
    distance, spread = rational(well, "well"), rational(diffusivity, "diffusivity")
    if distance <= 0 or spread <= 0:
        raise ParameterError(
            f"--well and --diffusivity must be positive. Received {well} m and {diffusivity} m^2/s. "
            "Omit both for a well at the fault."
        )
    return str(distance**2 / spread)


def _with_unit(text: str, unit: str, name: str) -> float:
    from quakedesign.fault.units import si_value

    if unit == "Hz" and "rad" in text:
        raise UnitError(f"{name} must be a frequency in Hz. Received {text!r}. Divide it by 2π.")
    return si_value(text, unit, name)


Seconds = Annotated[float, Parameter(converter=quantity("s"))]
Hertz = Annotated[float, Parameter(converter=quantity("Hz"))]
Metres = Annotated[float, Parameter(converter=quantity("m"))]
MetresPerSecond = Annotated[float, Parameter(converter=quantity("m/s"))]
Pascals = Annotated[float, Parameter(converter=quantity("Pa"))]
ExactSeconds = Annotated[str, Parameter(converter=_exact_reader("s"))]
ExactPascals = Annotated[str, Parameter(converter=_exact_reader("Pa"))]
Whole = Annotated[int, Parameter(converter=whole)]
Perturbation = Annotated[str, Parameter(allow_leading_hyphen=True)]


# ----------------------------------------------------------------------
# Options that several commands share, each defined once.


def _fault_name(_type: object, tokens: Sequence[Token]) -> str:
    """Name of a fault; an unknown one is rejected before anything else loads."""
    from quakedesign.fault.fault_toml import require_source

    return require_source(tokens[0].value)


FaultName = Annotated[
    str,
    Parameter(
        help="Preset (real-fault, lab-fault, lab-apparatus, crustal-patch, creeping-patch, geothermal-fault, "
        "double-direct-shear) or path of a .toml file.",
        converter=_fault_name,
    ),
]
DisturbanceClass = Annotated[Literal["amplitude", "rate"], Parameter(name="--class")]
Shaking = Annotated[
    str | None,
    Parameter(
        name="--disturbance",
        help="Disturbance amplitude instead of the fault's, such as '1e-4 m/s^2', or '35 kPa' of shear stress.",
    ),
]
Box = Annotated[
    str | None, Parameter(help="Uncertainty box: paper (friction alone) or ten-percent (also k/m, η/m and A/m).")
]
Scheduler = Annotated[
    str | None, Parameter(help="Address of a dask.distributed scheduler to use instead of local processes.")
]
Formats = Annotated[
    tuple[Literal["svg", "pdf", "png"], ...],
    Parameter(consume_multiple=True, help="File formats of the figures, one or several: svg, pdf, png."),
]
Force = Annotated[bool, Parameter(help="Replace the output of an earlier run.")]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Output:
    """Form of the output.

    Parameters
    ----------
    json
        Print JSON in SI units.
    quiet
        Print no text and no progress; the exit code gives the result.
    log_level
        Messages on stderr: info for every step, debug for all progress.
    no_cache
        Do not read or write the cache of searches, compiled code and long runs; same as QUAKEDESIGN_CACHE=off.
    allow_code
        Allow fault files to run code: friction as module:Class. Only for files that you trust.
    """

    json: bool = False
    quiet: bool = False
    log_level: Literal["warning", "info", "debug"] = "warning"
    no_cache: bool = False
    allow_code: bool = False

    def __post_init__(self) -> None:
        if self.no_cache:
            from quakedesign.cache import switch_off

            switch_off()
        if self.allow_code:
            from quakedesign.discovery import allow_code

            allow_code(True)
        if (self.quiet, self.log_level) != (False, "warning"):
            set_output(quiet=self.quiet, level=self.log_level)

    def show(self, values: Json, text: Iterable[str] | Callable[[], object]) -> None:
        """Print a result as JSON, or else as text: lines, or a function that prints them."""
        if self.json:
            print_json(values)
        elif callable(text):
            text()
        else:
            print_lines(text)


PLAIN = Output()


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class LawOptions:
    """Control law with its gains.

    Parameters
    ----------
    controller
        cta, dia or elqr, or a user-defined law as module:Class; none (not for export): a run without control. For
        several blocks: centralised (used also for the default and for none, unless friction has a state) or
        decentralised.
    gains
        published, designed (for the T_s, delay, lag and diffusion path of the command), continuous (designed in
        continuous time), or the numbers of the gains in SI units (of a sliding mode: with scale λ = 1 and control ν =
        p·μ_res·N̂_min, p the pressure, μ_res the residual friction coefficient, N̂_min the smallest A/m of the box).
        Rate-and-state faults (not in export): always designed, in simulate for T_s and the diffusion path, in campaign
        for the fault's T_s, the diffusion path, --spread and --stress.
    scale
        Scale λ of a sliding mode, decimal or p/q; replaces that of --gains.
    feedforward
        none, nominal or centred: feed-forward of a sliding mode from the plant model; not with designed gains.
    certificate
        Certificate file that guarantee --out wrote; it replaces --controller, --gains, --scale and --feedforward. The
        law runs with the T_s, pressure limit at rest, noise, delay, lag and diffusion path of the file. In slow sliding
        simulate applies a sinusoidal shear stress of the certified amplitude, and campaign of at most this amplitude;
        --stress replaces it.
    law
        File of a user-defined sampled linear law (.json or .npz, see SampledLaw.load) instead of these options.
    """

    controller: str = "cta"
    gains: Gains = ("published",)
    scale: str | None = None
    feedforward: str = "none"
    certificate: Path | None = None
    law: Path | None = None

    def choose(
        self, fault: "Fault", step: float | None = None, path: dict[str, float] | None = None
    ) -> "Choice | None":
        """Controller for a fault, with its certified bounds; None if none is requested.

        A controller is designed for `step` (T_s [s], by default the fault's) and `path` (delay, lag, diffusion [s]).
        Raises ParameterError for a law file or a certificate together with another option of the law.
        """
        from quakedesign.laws import SampledLaw
        from quakedesign.studies.single_runs import Choice, certified_choice, optional_choice

        entries = {"scale": self.scale, "feedforward": self.feedforward}
        if self.law is not None:
            if self != replace(type(self)(), law=self.law):
                raise ParameterError(
                    f"--law contains the law with its T_s. Received --law {self.law} together with another option of "
                    "the law, such as --controller or --certificate. Omit the other options."
                )
            return Choice(controller=SampledLaw.load(self.law))
        if self.certificate is None:
            return optional_choice(fault, self.controller, self.gains, **entries, step=step, path=path)
        usual, own = type(self)(), {"gains": " ".join(self.gains)}
        values = {"controller": self.controller, **own, **entries}
        unlike = [
            f"--{name} {value}"
            for name, value in values.items()
            if getattr(self, name) != getattr(usual, name) and (name, value) != ("controller", "elqr")
        ]
        if unlike:
            raise ParameterError(
                f"--certificate contains the law. Received {', '.join(unlike)} with {self.certificate}. "
                "Omit these options."
            )
        return certified_choice(fault, self.certificate)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class NoLawOptions(LawOptions):
    """Law with its gains; none by default."""

    controller: str = "none"


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """Simulation of a closed loop, and loads on the fault.

    Parameters
    ----------
    scheme
        Sampled with a zero-order hold: explicit, implicit, semi-implicit, compensated or stick-slip; or continuous,
        with the law evaluated in every stage of the integrator. By default continuous in simulate and explicit in
        campaign. Designed laws have their own scheme.
    method
        Integrator: dormand-prince or rk4; in simulate with --plant printed, and not for sliding modes, also cvodes or
        idas. Rate-and-state faults: radau (by default), dop853, cvodes or idas without control; cvodes (by default) or
        idas with control.
    plant
        stick-slip (by default; friction holds the fault at rest) or printed (the paper's plant, without stick).
        Rate-and-state faults never rest: smooth or quasi-dynamic (without inertia), by default smooth for one block and
        quasi-dynamic for several.
    step
        Sampling time T_s, or integration step of the scheme continuous; the fault's T_s by default.
    duration
        Duration of the run; the operation time by default. In simulate, if neither a controller nor a duration is
        given, the run of a fault whose friction has no state is its natural earthquake, without disturbance and with an
        automatically chosen duration.
    substeps
        Integrator steps per sample.
    drift
        Loading velocity, such as '3 cm/year'; 0 by default. Rate-and-state faults: only in simulate without control, by
        default the reference rate; under control the far end is fixed.
    perturbation
        Additional disturbance in m/s^2: an expression in slip, slip_rate and time.
    """

    scheme: str | None = None
    method: str = "dormand-prince"
    plant: str | None = None
    step: Seconds | None = None
    duration: Seconds | None = None
    substeps: Whole = 1
    drift: MetresPerSecond | None = None
    perturbation: Perturbation | None = None

    def way(self, law: "Controller | None", usual: str = "explicit") -> "tuple[Any, float | None, dict[str, Any]]":
        """Scheme, step [s] and settings of a run, see `quakedesign.loop.schemes.scheme_of_run`."""
        from quakedesign.loop.schemes import scheme_of_run

        return scheme_of_run(law, self.scheme, self.step, usual)

    def load(self) -> "Load":
        """Load on the fault in addition to its own disturbance."""
        from quakedesign.simulation import Load, perturbation

        return Load(drift=self.drift or 0.0, perturbation=self.perturbation and perturbation(self.perturbation))


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class StartOptions:
    """Initial state and target of a closed loop.

    Parameters
    ----------
    initial_slip
        Initial slip, such as '7.5 mm'; 0 by default.
    initial_slip_rate
        Initial slip rate, such as '1 mm/s'; 0 by default.
    target_slip
        Slip at the end of the task, such as '5 cm', instead of the fault's.
    """

    initial_slip: Metres = 0.0
    initial_slip_rate: MetresPerSecond = 0.0
    target_slip: Metres | None = None

    def state(self) -> dict[str, float]:
        """Initial slip [m] and slip rate [m/s], each only if not zero."""
        entries = {"initial_slip": self.initial_slip, "initial_slip_rate": self.initial_slip_rate}
        return {name: value for name, value in entries.items() if value}

    def task(self, fault: "Fault") -> "Fault":
        """The fault, with the target slip of these options if given."""
        if self.target_slip is None:
            return fault
        return replace(fault, reference=replace(fault.reference, target_slip=self.target_slip))


# ----------------------------------------------------------------------
# Loop setup of a guarantee or a design.

Options = TypeVar("Options")


def of_the_setup(*names: str) -> Callable[[type[Options]], type[Options]]:
    """Add options for quantities of `LoopSetup`, with their unit and help text, to a frozen dataclass.

    Parameters
    ----------
    *names : str
        Names of fields of `LoopSetup`.
    """

    def added(options: type[Options]) -> type[Options]:
        parts = [(name, quantities()[name]) for name in names]
        new = [(name, _exact_option(part["unit"], part["help"]), None) for name, part in parts]
        doc = {"__doc__": options.__doc__, "__module__": options.__module__}
        return make_dataclass(options.__name__, new, bases=(options,), namespace=doc, frozen=True, kw_only=True)

    return added


def _exact_option(unit: str, text: str) -> Any:
    return Annotated[str | None, Parameter(converter=_exact_reader(unit), help=text)]


@dataclass(frozen=True, kw_only=True)
class WellOptions:
    """Diffusion path given by the distance of a well and the diffusivity."""

    well: Annotated[
        str | None,
        Parameter(
            converter=_exact_reader("m"),
            help="Distance between well and fault, such as '40 m', instead of --diffusion. Give --diffusivity too; in "
            "limits it is 1 m^2/s by default.",
        ),
    ] = None
    diffusivity: Annotated[
        str | None,
        Parameter(
            converter=_exact_reader("m^2/s"),
            help="Hydraulic diffusivity of the rock between well and fault, such as '0.5 m^2/s'.",
        ),
    ] = None

    def setup(self, **more: Any) -> LoopSetup:
        """Loop setup of the options, with further fields of `LoopSetup`."""
        names = quantities()
        entries = {name: value for name, value in vars(self).items() if name in names}
        entries["diffusion"] = diffusion_time(entries["diffusion"], self.well, self.diffusivity)
        return IDEAL.with_given(**entries, **more)


@Parameter(name="*")
@of_the_setup(*quantities())
@dataclass(frozen=True, kw_only=True)
class SetupOptions(WellOptions):
    """Loop setup: sampling time, delay, actuator, diffusion path, noise, jitter and initial errors."""


# ----------------------------------------------------------------------
# Options of the loop setup of a controller: actuator and sensors, the same for every command that runs one.

_ACTUATOR = Group("Actuator stages, in signal order (sampled schemes)")
_SENSORS = Group("Sensors (sampled schemes)")


def _with_stage_options(options: type[Options]) -> type[Options]:
    """Frozen dataclass with the options that the stages of the package declare."""
    declared = [option for stage in stages().values() for option in stage.options]
    fields = [(option.name, _annotation(option), option.default) for option in declared]
    doc = {"__doc__": options.__doc__, "__module__": options.__module__}
    return make_dataclass(options.__name__, fields, bases=(options,), namespace=doc, frozen=True, kw_only=True)


def _annotation(option: Option) -> Any:
    read: Any = quantity(option.unit) if option.unit else whole
    kind: Any = float if option.unit else int
    return Annotated[kind if option.default is not None else kind | None, Parameter(converter=read, help=option.help)]


@Parameter(name="*", group=_ACTUATOR)
@_with_stage_options
class ActuatorOptions:
    """Options of the stages between law and fault, for sampled schemes; each stage declares its own."""

    def values(self) -> dict[str, Any]:
        """Values in SI units, by the names of the options."""
        return dict(vars(self))

    def path(self) -> dict[str, float]:
        """Given delay, lag and diffusion [s], for which a law can be designed."""
        values = self.values()
        return {name: values[name] for name in ("delay", "lag", "diffusion") if values[name]}

    def build(self, step: float, seed: int = 0) -> Actuator:
        """Actuator with its stages in signal order, for a sampling period [s] and a seed of the jitter.

        Raises
        ------
        ParameterError
            For values that a stage rejects, or for options of a stage without its first option.
        """
        chosen = (_stage(stage, self.values(), step) for stage in stages().values() if stage.options)
        chain = Actuator(stages=tuple(stage for stage in chosen if stage is not None))
        if not self.values()["jitter"]:
            return chain
        from quakedesign.simulation.campaign.problem import reseeded

        return reseeded(chain, seed)


def _stage(stage: type[Stage], values: Mapping[str, Any], step: float) -> Stage | None:
    """One stage; None if it is not requested."""
    first, *others = stage.options
    if values[first.name] != first.default:
        return stage.from_options(step, **{option.name: values[option.name] for option in stage.options})
    for other in others:
        if values[other.name] is not None and other.default is None:
            raise ParameterError(
                f"{other.name} needs {first.name}. Received {other.name} {values[other.name]:g} {other.unit} alone. "
                f"Add {first.name}, or omit {other.name}."
            )
    return None


@Parameter(name="*", group=_SENSORS)
@dataclass(frozen=True, kw_only=True)
class EstimateOptions:
    """Estimation of slip and slip rate from readings of the slip alone.

    Parameters
    ----------
    averaging
        Number of latest readings that are averaged for the differentiator.
    differentiator_bound
        Bound λ_d on the derivative of order n_d + 1 of the slip, in m/s^(n_d + 1); with this option the law uses
        estimates of a differentiator.
    differentiator_order
        n_d, the number of derivatives. For 2, as in the paper, the premise named 'differentiator' fails for every λ_d
        with a zero-order hold; guarantee --measured differentiator proves such a loop without this premise.
    filter_order
        n_f, the filter order.
    differentiator_steps
        Steps of the differentiator per reading.
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

    def values(self) -> dict[str, Any]:
        """Options in SI units."""
        return asdict(self) | {"differentiator_bound": self.bound}


@Parameter(name="*", group=_SENSORS)
@dataclass(frozen=True, kw_only=True)
class SensorOptions(EstimateOptions):
    """Measurement of slip and slip rate, for sampled schemes.

    Parameters
    ----------
    slip_noise
        Standard deviation of Gaussian noise of the measured slip, such as '1 um'. --slip-noise of guarantee and design
        is a bound.
    rate_noise
        Standard deviation of Gaussian noise of the measured slip rate, such as '1 um/s'.
    bandwidth
        Bandwidth of the transducer before a differentiator, such as '100 Hz'.
    slip_quantum
        Resolution of the transducer, such as '0.15 um'.
    """

    slip_noise: Annotated[Metres, Parameter(name="--slip-noise-deviation")] = 0.0
    rate_noise: Annotated[MetresPerSecond, Parameter(name="--rate-noise-deviation")] = 0.0
    bandwidth: Hertz | None = None
    slip_quantum: Metres = 0.0

    def build(self, step: float, seed: int = 0) -> "Sensor":
        """Measurement or sensor for a sampling period [s] and a seed of the noise."""
        from quakedesign.loop.sensing import Measurement
        from quakedesign.studies.single_runs import sensor

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


def loop_elements(
    chosen: "Choice | None",
    step: float,
    run: "RunOptions",
    actuator: ActuatorOptions,
    sensors: SensorOptions,
    seed: int,
) -> "tuple[int, Actuator, Sensor]":
    """Substeps, actuator and sensor of a run with a sampling period [s].

    Stages that are not given are replaced by those for which a sampled law is designed, with the substeps that these
    stages need. If no noise is given, the sensor has the noise of the certificate.
    """
    from quakedesign.simulation.run_settings import designed_path

    chain, seen = actuator.build(step, seed), sensors.build(step, seed)
    if chosen is None:
        return run.substeps, chain, seen
    meant, substeps = designed_path(chosen.controller, None, run.substeps)
    return substeps, chain.completed(meant) if meant else chain, seen if seen.noisy else chosen.noise(seed)


# ----------------------------------------------------------------------
# Options of runs of faults whose friction has a state.

_GROUP = Group("Friction with a state (rate-and-state)")
_BOTH = {"duration": "duration", "plant": "plant", "method": "method"}
_FREE = {"drift": "loading_rate", **_BOTH}
_CONTROLLED = {"step": "step", "lag": "lag", "diffusion": "diffusion", **_BOTH}
_OF_LAW = ("step", "delay", "lag", "diffusion")  # given by a certificate
_PUMP = ("delay", "jitter", "quantum", "saturation", "withdrawal", "rate_limit")
_READING = {"slip_noise": "deviation", "bandwidth": "bandwidth", "slip_quantum": "quantum", "seed": "seed"}
_COMMON = ("fault", "controller", "gains", "state", "out", "force", "json")


@Parameter(name="*", group=_GROUP)
@dataclass(frozen=True, kw_only=True)
class StateOptions:
    """Initial state, pressure and stress of a rate-and-state fault, loaded at --drift or the reference rate.

    Parameters
    ----------
    pressure
        Fluid pressure, such as '5 MPa'; or pressures at times, linear in between, with a step at a repeated time: '0 s:
        0 MPa, 1 day: 0 MPa, 1 day: 5 MPa'; or FILE.csv with columns 'time [s]' and 'pressure [Pa]' in any units.
    start
        Initial state: steady (sliding; default), locked (far end of the spring at rest for --hold) or late (in the
        seismic cycle, see --share).
    hold
        Time for which the far end is at rest before the run, such as '100 year'.
    share
        Fraction of the recurrence interval that has passed when the run starts; 0.9 by default.
    stress
        With --controller elqr or --certificate: amplitude of a sinusoidal shear stress, such as '20 kPa'.
    stress_period
        Period of this stress; by default that of the tide, 12.42 hours.
    """

    pressure: str | None = None
    start: str | None = None
    hold: Seconds | None = None
    share: float | None = None
    stress: Pascals | None = None
    stress_period: Seconds | None = None

    def free_options(self) -> list[str]:
        """Given options that apply only to a run without control."""
        return [f"--{name}" for name in ("pressure", "start", "hold", "share") if getattr(self, name) is not None]

    def of_control(self) -> dict[str, Any]:
        """Given options of a controlled run. Raises ParameterError for options of a run without control."""
        if free := self.free_options():
            raise ParameterError(
                "--pressure, --start, --hold and --share are for runs without a controller. Received "
                f"{', '.join(free)} with a controller. Omit these options."
            )
        return specified({"stress": self.stress, "stress_period": self.stress_period})

    def of_free(self) -> dict[str, Any]:
        """Given options of a run without control. Raises ParameterError for options of a controlled run."""
        from quakedesign.simulation import pressure_history

        if self.stress is not None or self.stress_period is not None:
            raise ParameterError(
                "--stress and --stress-period need a controller. Received none. Give --controller elqr."
            )
        values = specified({"start": self.start, "hold": self.hold, "share": self.share})
        return values | ({} if self.pressure is None else {"pressure": pressure_history(self.pressure)})


NO_STATE = StateOptions()


def require_no_state_options(state: StateOptions, fault: "Fault") -> None:
    """Raise ParameterError for given options that do not apply to friction without a state."""
    if state != NO_STATE:
        raise ParameterError(
            "pressure, start, hold, share and stress need friction with a state. "
            f"Received {fault.friction.name}. Omit these options."
        )


def show_state_run(fault: "Fault", command: Any, options: dict[str, Any]) -> int:
    """Run a fault whose friction has a state, with the options of `simulate`, and print the result."""
    from quakedesign.report.sentences import sliding_run_lines, state_run_lines
    from quakedesign.studies.single_runs import run_sliding, run_state

    single, changed = _single(options), changed_options(command, options)
    run: Trajectory
    certificate = changed.pop("certificate", None)
    if certificate is not None:
        entries = _as_proved(fault, certificate, changed, options)
        more, (run, result) = entries["stress"] > entries["claim"].task.stress, run_sliding(fault, **entries)
        outside = [*(["stress"] if more else []), *(name for name in changed if name in (*_PUMP, *_READING, "plant"))]
        result |= {"outside": [n for n in outside if n != "seed"]}
        lines = sliding_run_lines
    elif "controller" in changed:
        _require_designed(single)
        run, result = run_sliding(fault, **_instruments(fault, changed, options), **options["state"].of_control())
        lines = sliding_run_lines
    else:
        run, result = run_state(fault, **_argument_names(fault, changed, _FREE), **options["state"].of_free())
        lines = state_run_lines
    if options["out"] is not None:
        run.save(Path(options["out"]))
    options["output"].show(result, [run.name, *(f"  {line}" for line in lines(result))])
    return 0


def changed_options(command: Any, options: dict[str, Any]) -> dict[str, Any]:
    """Options of a command that differ from their defaults, by name; option groups are expanded, except `state`."""
    usual = _single({name: option.default for name, option in signature(command).parameters.items()})
    return {name: value for name, value in _single(options).items() if value != usual[name]}


@Parameter(name="*", group=_GROUP)
@dataclass(frozen=True, kw_only=True)
class SpreadOptions:
    """Variation in a campaign of a rate-and-state fault.

    Parameters
    ----------
    spread
        Rate-and-state faults: largest relative deviation of a, b and D_c, such as 0.1; with --certificate by default
        the certified one. Normal stress, stiffness and damping vary within the box.
    stress
        Largest amplitude of a sinusoidal shear stress, such as '25 kPa'; amplitude and phase vary from sample to
        sample. By default the certified bound of the design.
    stress_period
        Period of this stress; by default that of the tide, 12.42 hours.
    """

    spread: str = "0"
    stress: Pascals | None = None
    stress_period: Seconds | None = None

    def choose(
        self, fault: "Fault", law: "LawOptions", step: float | None, path: dict[str, float]
    ) -> tuple["Choice | None", dict[str, Any]]:
        """Law of a campaign and, for friction with a state, spread [-] and stress [Pa] of the samples.

        For friction with a state the law is that of the certificate or, without one, the law that `design` gives for
        the nominal normal stress, stiffness and damping, for every box of the campaign. Raises ParameterError if no
        such law exists, the certificate is of another fault, or spread or stress is given without a friction state.
        """

        def tracking(fault: "Fault") -> tuple["Choice | None", dict[str, Any]]:
            if self != SpreadOptions():
                raise ParameterError(
                    f"spread and stress need friction with a state. Received {fault.friction.name}. Omit both."
                )
            return law.choose(fault, step, path), {}

        def sliding(fault: "Fault") -> tuple["Choice | None", dict[str, Any]]:
            from quakedesign.exact import rational
            from quakedesign.plant import slow_sliding_plant
            from quakedesign.studies.single_runs import Choice
            from quakedesign.synthesis import design

            period = {} if self.stress_period is None else {"stress_period": self.stress_period}
            if law.certificate is not None and (chosen := law.choose(fault.with_box("paper"))):
                task: Any = chosen.claim.task  # type: ignore[union-attr]
                if slow_sliding_plant(fault, task.stress).ramp != task.ramp:
                    raise ParameterError(
                        "the fault of a campaign of slow sliding must have the constants of the fault in the "
                        f"certificate, {task.name}. Received {fault.name}, whose constants differ. Give the fault of "
                        "the certificate, or use simulate --certificate."
                    )
                return chosen, _of_proof(chosen.claim, self.spread, self.stress) | period
            _require_designed({"controller": law.controller, "gains": law.gains})
            off = rational(self.spread, "spread")
            diffusion = path.get("diffusion")
            designed = design(fault.with_box("paper"), "elqr", diffusion=diffusion, stress=self.stress, spread=off)
            if designed.controller is None or designed.sliding is None:
                reason = designed.details["reason"]
                raise ParameterError(f"a campaign needs a law. Received a design without one: {reason}.")
            entries = {"spread": off, "stress": float(designed.sliding.task.stress)}
            return Choice(controller=designed.controller), entries | period

        return by_equilibrium(rest=tracking, sliding=sliding)(fault)


def _of_proof(claim: Any, spread: str, stress: float | None) -> dict[str, Any]:
    """Spread [-] and stress [Pa] of a campaign with the law of a certificate; by default the largest proved ones.

    Raises
    ------
    ParameterError
        For a certificate with delay or slip noise, which campaigns of slow sliding do not simulate.
    """
    from quakedesign.exact import rational

    if claim.sampled_loop.delay or claim.sampled_loop.slip_noise:
        raise ParameterError(
            "a campaign of slow sliding needs a loop without delay and slip noise. Received a certificate with a delay "
            f"of {float(claim.sampled_loop.delay):g} s and slip noise of {float(claim.sampled_loop.slip_noise):g} m. "
            "Use simulate --certificate."
        )
    low, high = claim.task.ranges["direct_effect"]
    off = rational(spread, "spread") or (high - low) / (high + low)
    return {"spread": off, "stress": float(claim.task.stress) if stress is None else stress}


def _as_proved(fault: "Fault", certificate: Path, changed: dict[str, Any], options: dict[str, Any]) -> dict[str, Any]:
    """Arguments of `run_sliding` for a certified law, by default under a sinusoidal stress of the certified amplitude.

    By default readings are rounded to multiples of twice the certified noise bound, so that the measurement error is at
    most this bound.
    """
    from quakedesign.loop.sensing import Transducer

    claim = options["law"].choose(fault).claim
    reject({name: changed.get(name) for name in _OF_LAW}, f"{certificate}, which specifies the loop")
    entries = {"stress": float(claim.task.stress)} | options["state"].of_control()
    entries |= _instruments(fault, {**changed, "step": float(claim.sampled_loop.step)}, options)
    if entries["transducer"] is None and claim.sampled_loop.slip_noise:
        entries["transducer"] = Transducer(quantum=2 * float(claim.sampled_loop.slip_noise))
    return {**entries, "step": None, "claim": claim}


def _instruments(fault: "Fault", changed: dict[str, Any], options: dict[str, Any]) -> dict[str, Any]:
    """Arguments of `run_sliding`, with actuator stages and transducer built from their options."""
    from quakedesign.loop.sensing import Transducer

    others = {name: value for name, value in changed.items() if name not in (*_PUMP, *_READING)}
    entries = _argument_names(fault, others, _CONTROLLED, (*_PUMP, *_READING))
    chain = options["actuator"].build(entries.get("step", fault.sampling_time), options["seed"])
    reading: dict[str, Any] = {_READING[name]: value for name, value in changed.items() if name in _READING}
    transducer = Transducer(**reading) if set(reading) - {"seed"} else None
    return entries | {"stages": chain.sampled, "transducer": transducer}


def _argument_names(
    fault: "Fault", changed: dict[str, Any], taken: dict[str, str], more: Sequence[str] = ()
) -> dict[str, Any]:
    """Given options under the argument names of a run. Raises ParameterError for options that do not apply."""
    if foreign := [name for name in changed if name not in (*taken, *_COMMON)]:
        kind = f"friction with a state in a run {'with' if taken is _CONTROLLED else 'without'} control"
        raise ParameterError(
            f"{', '.join(foreign)} cannot be used for {kind}. Received {fault.friction.name}. "
            f"Use {', '.join((*taken, *more))} and the options of friction with a state only."
        )
    return {taken[name]: value for name, value in changed.items() if name in taken}


def _require_designed(options: dict[str, Any]) -> None:
    if options["controller"] != "elqr" or tuple(options["gains"]) not in (("published",), ("designed",)):
        raise ParameterError(
            "friction with a state needs the controller elqr with designed gains; sliding modes do not apply, since "
            f"the slip rate responds to the pressure instantaneously. Received {options['controller']} with the gains "
            f"{' '.join(map(str, options['gains']))}. Give --controller elqr, and omit --gains."
        )


def _single(options: dict[str, Any]) -> dict[str, Any]:
    """Options by name; those of option groups except `state` are expanded."""
    groups = [name for name, value in options.items() if is_dataclass(value) and name != "state"]
    alone = {name: value for name, value in options.items() if name not in groups}
    return alone | {name: value for group in groups for name, value in asdict(options[group]).items()}
