"""One run of one controller, as the command line asks for it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from quakedesign.certificates.premises import Premise, least_authority
from quakedesign.controllers import Controller, control_law, published
from quakedesign.controllers.feed_forward import feed_forward
from quakedesign.errors import ParameterError, UnknownNameError, require_known
from quakedesign.fault import Fault
from quakedesign.loop.actuators import DIRECT
from quakedesign.loop.schemes import simulation_scheme
from quakedesign.loop.sensing import OutputFeedback, Sensor
from quakedesign.loop.sensing.measurement import EXACT
from quakedesign.rationals import rational
from quakedesign.simulation import Actuator, Load, Trajectory, natural_earthquake
from quakedesign.simulation import simulate as run_loop
from quakedesign.studies.estimation import differentiator_premise
from quakedesign.studies.on_trajectory import certified_bound, trajectory_premise
from quakedesign.synthesis import design

PUBLISHED, DESIGNED, CONTINUOUS = ("published",), ("designed",), ("continuous",)


@dataclass(frozen=True, kw_only=True)
class Choice:
    """Controller, and what is certified of it without asking a solver.

    Attributes
    ----------
    controller : Controller
    lipschitz : Fraction or None
        Certified bound on |h'| [m/s³]; None for gains that come without a certificate, and for a linear law.
    """

    controller: Controller
    lipschitz: Fraction | None = None


def chosen_controller(
    fault: Fault, name: str, gains: tuple[str, ...], *, scale: str | None = None, feedforward: str = "none"
) -> Controller:
    """Controller of a `choice`, which see."""
    return choice(fault, name, gains, scale=scale, feedforward=feedforward).controller


def optional_choice(
    fault: Fault, name: str, gains: tuple[str, ...], *, scale: str | None = None, feedforward: str = "none"
) -> Choice | None:
    """A `choice`, which see, or None for the name ``none``.

    Raises
    ------
    UnknownNameError, ParameterError
        Also for gains, a scale or a feed-forward of no controller.
    """
    if name != "none":
        return choice(fault, name, gains, scale=scale, feedforward=feedforward)
    if gains != PUBLISHED or scale is not None or feedforward != "none":
        raise ParameterError("gains, scale and feedforward need a controller. Received none. Give --controller.")
    return None


def choice(
    fault: Fault, name: str, gains: tuple[str, ...], *, scale: str | None = None, feedforward: str = "none"
) -> Choice:
    """Controller from a law's name and ``("published",)``, ``("designed",)``, ``("continuous",)`` or exact gains.

    Designed ones run as they are guaranteed, with their own scheme and T_s; those designed in continuous time, as in
    the paper, run with any.

    Parameters
    ----------
    fault : Fault
    name : str
    gains : tuple of str
    scale : str, optional
        λ of a sliding mode in place of that of the gains.
    feedforward : str
        ``none``, ``nominal`` or ``centred``; for a sliding mode.

    Raises
    ------
    UnknownNameError, ParameterError
    """
    law, base = _with_gains(fault, name, gains)
    if law.divisor is None:
        if scale is None and feedforward == "none":
            return Choice(controller=law, lipschitz=base)
        raise ParameterError(f"a scale and a feed-forward belong to a sliding mode. Received {name}. Leave them out.")
    if law.sampling is not None and feedforward != "none":
        raise ParameterError(
            "a feed-forward has no guarantee with the pressure held over T_s, as designed gains run. "
            f"Received {feedforward}. Give --gains continuous, or leave it out."
        )
    scaled = law if scale is None else law.scaled(rational(scale, "scale"))
    known = feed_forward(feedforward, fault, law.divisor)
    return Choice(
        controller=law if scaled is law and feedforward == "none" else scaled.with_feedforward(known),
        lipschitz=None if base is None else base * (scaled.scale or 1),
    )


def _with_gains(fault: Fault, name: str, gains: tuple[str, ...]) -> tuple[Controller, Fraction | None]:
    """Law, and the bound on |h'| that is certified for λ = 1."""
    law = control_law(name)
    if len(gains) == 1 and gains[0].isalpha():
        require_known(gains[0], (*PUBLISHED, *DESIGNED, *CONTINUOUS), "gains in a word", UnknownNameError)
    if gains == PUBLISHED:
        known = published(fault.name)
        if name not in known:
            raise UnknownNameError(
                f"published gains exist for real-fault and lab-fault. Received {fault.name!r}. "
                "Give --gains designed, or the gains of the law."
            )
        return known[name], None
    if gains in (DESIGNED, CONTINUOUS):
        designed = design(fault, name, continuous=gains == CONTINUOUS)
        if designed.controller is None:
            raise ParameterError(f"no gains with a proof were found for {name} on {fault.name}. Give --gains.")
        return designed.controller, certified_bound(designed)
    return law.for_authority(gains, least_authority(fault)), None


def run_single(
    fault: Fault,
    law: Controller | Choice | None,
    *,
    tell: Callable[[float], None],
    duration: float | None = None,
    load: Load | None = None,
    noise: Sensor = EXACT,
    actuator: Actuator = DIRECT,
    tuning: Mapping[str, float] | None = None,
    initial: Mapping[str, float] | None = None,
    **settings: Any,
) -> tuple[Trajectory, list[Premise]]:
    """Run a loop, and say which premises hold that a run decides.

    Parameters
    ----------
    fault : Fault
    law : Controller, Choice or None
        Of a choice it is known what is certified. None with a duration: the fault under its own disturbance. None
        without: the natural earthquake.
    tell : callable
        Progress.
    duration : float, optional
        [s]; the operation time unless given.
    load : Load, optional
    noise : Measurement or Sensor
        What the law is told.
    actuator : Actuator
        What lies between law and fault.
    tuning : mapping of str to float, optional
        Settings of the scheme itself, such as ``weight`` and ``authority`` of ``compensated``.
    initial : mapping of str to float, optional
        ``initial_slip`` [m] and ``initial_slip_rate`` [m/s], where the run does not start from rest.
    **settings
        ``step, scheme, method, plant, substeps`` of `quakedesign.simulation.simulate`.

    Returns
    -------
    Trajectory
    list of Premise
        `on_trajectory` of a sliding mode, certified or not, and `differentiator`.

    Raises
    ------
    UnknownNameError, ParameterError
    """
    around: dict[str, Any] = {"measurement": noise} if noise.noisy else {}
    around |= {"actuator": actuator} if actuator.stages else {}
    if law is None and duration is None:
        more = dict(tuning or {}) | dict(initial or {}) | ({"load": load} if load else {})
        return _natural(fault, settings, around | more), []
    name = settings["scheme"]
    if tuning:
        substeps = settings.pop("substeps")
        around |= {"substeps": substeps} if substeps != 1 else {}
        settings, around = settings | {"scheme": simulation_scheme(name, **tuning, **around)}, {}
    known = law if isinstance(law, Choice) or law is None else Choice(controller=law)
    own = known.controller if known else None
    around |= dict(initial or {})
    run = run_loop(fault, own, duration=duration, load=load, progress=tell, **settings, **around)
    if known is None:
        return run, []
    return run, _premises(fault, known, run, noise, name)


def _premises(fault: Fault, known: Choice, run: Trajectory, seen: Sensor, scheme: str) -> list[Premise]:
    """Premises that a run decides, or a differentiator needs."""
    law, bound = known.controller, known.lipschitz
    premises = [trajectory_premise(law, None if bound is None else float(bound), run)]
    if isinstance(seen, OutputFeedback):
        premises.append(differentiator_premise(fault, law, seen, scheme=scheme))
    return [premise for premise in premises if premise is not None]


def _natural(fault: Fault, settings: dict[str, Any], around: dict[str, Any]) -> Trajectory:
    """Natural earthquake, to which nothing but the plant can be told."""
    usual = {"step": None, "scheme": "continuous", "method": "dormand-prince", "substeps": 1}
    given = [name for name, value in settings.items() if name != "plant" and value != usual[name]]
    given += list(around)
    if given:
        raise ParameterError(
            f"the natural earthquake is run as the fault asks for. Received {', '.join(given)}. "
            "Choose a controller, or give a duration."
        )
    return natural_earthquake(fault, plant=settings["plant"])
