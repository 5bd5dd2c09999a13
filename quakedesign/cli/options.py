"""Options that several commands share, each told once."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from quakedesign.cli.option_values import Gains, Metres, MetresPerSecond, Push, Seconds, Whole
from quakedesign.cli.shared import hush, print_json, print_lines
from quakedesign.errors import ParameterError

if TYPE_CHECKING:
    from quakedesign.controllers import Controller
    from quakedesign.fault import Fault
    from quakedesign.simulation import Load
    from quakedesign.studies.single import Choice


def _fault_name(_type: Any, tokens: Sequence[Any]) -> str:
    """Name of a fault, refused before anything else is loaded if there is none."""
    from quakedesign.fault.sources import require_source

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
        help="Amplitude in place of the fault's, such as '1e-4 m/s^2', or '35 kPa' of shear stress on the fault.",
    ),
]
Box = Annotated[str | None, Parameter(help="Uncertainty box: paper or ten-percent.")]
Scheduler = Annotated[
    str | None, Parameter(help="Address of a dask.distributed scheduler to use instead of processes of this machine.")
]
Formats = Annotated[
    tuple[Literal["svg", "pdf", "png"], ...],
    Parameter(consume_multiple=True, negative="", help="Of the figures, one or several: svg, pdf, png."),
]
Force = Annotated[bool, Parameter(negative="", help="Replace what an earlier run has written.")]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Output:
    """How an answer is printed.

    Parameters
    ----------
    json
        Print JSON, in SI units; results.json where that is written.
    quiet
        Print nothing for people, not even progress: the exit code is the answer.
    log_level
        What to say on stderr while it works: info for every step, debug for all progress.
    no_cache
        Neither take nor keep what searches find, compiled code and long runs; as QUAKEDESIGN_CACHE=off.
    allow_code
        Let fault files name friction of your own as module:Class, whose module is run. Only for files that you trust.
    """

    json: Annotated[bool, Parameter(negative="")] = False
    quiet: Annotated[bool, Parameter(negative="")] = False
    log_level: Literal["warning", "info", "debug"] = "warning"
    no_cache: Annotated[bool, Parameter(negative="")] = False
    allow_code: Annotated[bool, Parameter(negative="")] = False

    def __post_init__(self) -> None:
        if self.no_cache:
            from quakedesign.cache import switch_off

            switch_off()
        if self.allow_code:
            from quakedesign.discovery import allow_code

            allow_code(True)
        if (self.quiet, self.log_level) != (False, "warning"):
            hush(quiet=self.quiet, level=self.log_level)

    def show(self, facts: dict[str, Any], said: Iterable[str] | Callable[[], object]) -> None:
        """Print facts as JSON, or else what is said for people: lines, or a call that prints them."""
        if self.json:
            print_json(facts)
        elif callable(said):
            said()
        else:
            print_lines(said)


PLAIN = Output()


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class LawOptions:
    """Law with its gains.

    Parameters
    ----------
    controller
        cta, dia or elqr, or module:Class of your own; none where a command can do without.
    gains
        published, designed (for the T_s, delay, lag and diffusion of the command), continuous (designed in continuous
        time), or those of the law (λ = 1, divisor μ_res·N̂_min); for friction with a state designed.
    scale
        λ of a sliding mode in place of that of the gains, decimal or p/q.
    feedforward
        none, nominal or centred: what a sliding mode adds to ν from what is known of the fault; not to designed gains.
    certificate
        File that guarantee --out has written of an e-LQR, in place of the above: its law runs, with its T_s, limit and
        noise, behind the delay, lag and rock that it is proved for; in slow sliding under a sine of all the stress that
        it is proved for unless --stress is told.
    """

    controller: str = "cta"
    gains: Gains = ("published",)
    scale: str | None = None
    feedforward: str = "none"
    certificate: Path | None = None

    def choose(
        self, fault: "Fault", step: float | None = None, path: dict[str, float] | None = None
    ) -> "Choice | None":
        """Controller for a fault and what is certified of it; None where none is asked for.

        A designed one is for a T_s [s], the fault's unless given, and a path, see `quakedesign.studies.single.choice`.
        """
        from quakedesign.studies.single import certified_choice, optional_choice

        told = {"scale": self.scale, "feedforward": self.feedforward}
        if self.certificate is None:
            return optional_choice(fault, self.controller, self.gains, **told, step=step, path=path)
        usual = [type(self)().controller, "elqr"]
        if (
            self.controller not in usual
            or self.gains != ("published",)
            or told != {"scale": None, "feedforward": "none"}
        ):
            raise ParameterError(
                "a certificate holds its law, an e-LQR. Received another controller, gains, a scale or a feedforward "
                f"with {self.certificate}. Leave them out."
            )
        return certified_choice(fault, self.certificate)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class NoLawOptions(LawOptions):
    """Law with its gains; none unless given."""

    controller: str = "none"


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """How a closed loop is run, and what acts on the fault.

    Parameters
    ----------
    scheme
        Sampled and held: explicit, implicit, semi-implicit or compensated; or continuous, the law in every stage of the
        integrator. Unless given, simulate takes continuous, campaign explicit. Designed laws have their own.
    method
        dormand-prince or rk4; for single runs of smooth loops cvodes or idas; for friction with a state cvodes or idas,
        and for single runs without control radau or dop853.
    plant
        smooth (the paper's, for forward slip) or coulomb (set-valued friction: stick, slip, reversal); for friction
        with a state smooth or quasi-dynamic (without inertia).
    step
        Length of one step; the fault's sampling time unless given.
    duration
        The operation time unless given. Without a controller: the fault under its own disturbance.
    substeps
        Steps of the integrator per sample.
    drift
        Velocity of the far end, such as '3 cm/year'; unless given none, or of friction with a state the reference rate.
    perturbation
        Of the user's in m/s^2, added to the fault's own: an expression of slip, slip_rate and time.
    """

    scheme: str | None = None
    method: str = "dormand-prince"
    plant: str = "smooth"
    step: Seconds | None = None
    duration: Seconds | None = None
    substeps: Whole = 1
    drift: MetresPerSecond | None = None
    perturbation: Push | None = None

    def way(self, law: "Controller | None", usual: str = "explicit") -> "tuple[Any, float | None, dict[str, Any]]":
        """Scheme, step [s] and settings of a run, see `quakedesign.loop.schemes.own_way`."""
        from quakedesign.loop.schemes import own_way

        return own_way(law, self.scheme, self.step, usual)

    def load(self) -> "Load":
        """What acts on the fault beside its own disturbance."""
        from quakedesign.simulation import Load, perturbation

        return Load(drift=self.drift or 0.0, perturbation=self.perturbation and perturbation(self.perturbation))


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class StartOptions:
    """Where a closed loop starts, and where it is to go.

    Parameters
    ----------
    initial_slip
        Slip at the start, such as '7.5 mm'; none unless given.
    initial_slip_rate
        Slip rate at the start, such as '1 mm/s'.
    target_slip
        Slip at the end of the task, such as '5 cm', instead of the fault's own.
    """

    initial_slip: Metres = 0.0
    initial_slip_rate: MetresPerSecond = 0.0
    target_slip: Metres | None = None

    def state(self) -> dict[str, float]:
        """Slip and slip rate at the start, where they are given."""
        told = {"initial_slip": self.initial_slip, "initial_slip_rate": self.initial_slip_rate}
        return {name: value for name, value in told.items() if value}

    def task(self, fault: "Fault") -> "Fault":
        """The fault with the target that is given."""
        if self.target_slip is None:
            return fault
        return replace(fault, reference=replace(fault.reference, target_slip=self.target_slip))
