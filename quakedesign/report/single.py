"""One run of one controller, as the command line asks for it."""

from collections.abc import Callable
from typing import Any

from quakedesign.certificates.premises import Premise, least_authority
from quakedesign.controllers import Controller, SlidingMode, control_law, published
from quakedesign.controllers.feed_forward import feed_forward
from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.fault import Fault
from quakedesign.report.estimation import differentiator_premise, sensor
from quakedesign.simulation import Load, Trajectory, natural_earthquake
from quakedesign.simulation import simulate as run_loop
from quakedesign.simulation.measurement import EXACT, Measurement
from quakedesign.simulation.sensing import OutputFeedback
from quakedesign.synthesis import design
from quakedesign.synthesis.sampling import on_trajectory

PUBLISHED, DESIGNED = ("published",), ("designed",)


def chosen_controller(
    fault: Fault, name: str, gains: tuple[str, ...], *, scale: str | None = None, feedforward: str = "none"
) -> Controller:
    """Controller from a law's name and ``("published",)``, ``("designed",)`` or exact gains.

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
    law = _with_gains(fault, name, gains)
    if scale is None and feedforward == "none":
        return law
    if not isinstance(law, SlidingMode):
        raise ParameterError(f"a scale and a feed-forward belong to a sliding mode. Received {name}. Leave them out.")
    scaled = law if scale is None else law.scaled(_rational(scale))
    return scaled.with_feedforward(feed_forward(feedforward, fault, scaled.divisor))


def _rational(scale: str) -> Any:
    from quakedesign.rationals import rational

    return rational(scale, "scale")


def _with_gains(fault: Fault, name: str, gains: tuple[str, ...]) -> Controller:
    law = control_law(name)
    if gains == PUBLISHED:
        known = published(fault.name)
        if name not in known:
            raise UnknownNameError(
                f"published gains exist for real-fault and lab-fault. Received {fault.name!r}. Give --gains."
            )
        return known[name]
    if gains == DESIGNED:
        found = design(fault, name).controller
        if found is None:
            raise ParameterError(f"no gains with a proof were found for {name} on {fault.name}. Give --gains.")
        return found
    if issubclass(law, SlidingMode):
        return law.from_values(gains, divisor=least_authority(fault))
    return law.from_values(gains)


def run_single(
    fault: Fault,
    law: Controller | None,
    *,
    tell: Callable[[float], None],
    duration: float | None = None,
    load: Load | None = None,
    noise: Measurement = EXACT,
    differentiator_bound: float | None = None,
    filter_order: int = 0,
    **settings: Any,
) -> tuple[Trajectory, list[Premise]]:
    """Run a loop, and say which premises hold that a run decides.

    Parameters
    ----------
    fault : Fault
    law : Controller or None
        None with a duration: the fault under its own disturbance. None without: the natural earthquake.
    tell : callable
        Progress.
    duration : float, optional
        [s]; the operation time unless given.
    load : Load, optional
    noise : Measurement
        Of what the law is told.
    differentiator_bound : float, optional
        λ_d [m/s²]: the law is told what a differentiator with n_d = 1 (ERRATA 21) estimates from the slip alone.
    filter_order : int
        n_f of it.
    **settings
        ``step, scheme, method, plant, substeps`` of `quakedesign.simulation.simulate`.

    Returns
    -------
    Trajectory
    list of Premise
        `on_trajectory` of a sliding mode against the limit of its gains, and `differentiator`.

    Raises
    ------
    UnknownNameError, ParameterError
    """
    if law is None and duration is None:
        return _natural(fault, settings, load, noise, differentiator_bound), []
    step = settings.get("step") or fault.sampling_time
    seen = sensor(step, noise, differentiator_bound, filter_order)
    told: dict[str, Any] = {"measurement": seen} if seen.noisy else {}
    run = run_loop(fault, law, duration=duration, load=load, progress=tell, **settings, **told)
    if law is None:
        return run, []
    found = [on_trajectory(law, float(law.lipschitz_limit), run)] if isinstance(law, SlidingMode) else []
    if isinstance(seen, OutputFeedback):
        found.append(differentiator_premise(fault, law, seen, scheme=settings["scheme"]))
    return run, [premise for premise in found if premise is not None]


def _natural(
    fault: Fault, settings: dict[str, Any], load: Load | None, noise: Measurement, bound: float | None
) -> Trajectory:
    """Natural earthquake, to which nothing but the plant can be told."""
    usual = {"step": None, "scheme": "continuous", "method": "dormand-prince", "substeps": 1}
    given = [name for name, value in settings.items() if name != "plant" and value != usual[name]]
    given += ["load"] if load else []
    given += ["measurement"] if noise.noisy or bound is not None else []
    if given:
        raise ParameterError(
            f"the natural earthquake is run as the fault asks for. Received {', '.join(given)}. "
            "Choose a controller, or give a duration."
        )
    return natural_earthquake(fault, plant=settings["plant"])
