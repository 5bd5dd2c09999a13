"""One run of one controller, as the command line asks for it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from quakedesign.certificates import Verdict, load_guarantee
from quakedesign.certificates.guarantee import ContinuousPeaks, Guarantee, task_of
from quakedesign.certificates.guarantee.about import differences
from quakedesign.certificates.premises import Premise, least_authority
from quakedesign.certificates.slow_sliding import SlidingGuarantee, sliding_task
from quakedesign.controllers import Controller, Sampling, control_law, published
from quakedesign.controllers.feed_forward import feed_forward
from quakedesign.errors import CertificateError, ParameterError, UnknownNameError, require_known
from quakedesign.fault import Fault
from quakedesign.loop.actuators import DIRECT
from quakedesign.loop.schemes import simulation_scheme
from quakedesign.loop.sensing import OutputFeedback, Sensor
from quakedesign.loop.sensing.measurement import EXACT, Measurement
from quakedesign.rationals import rational
from quakedesign.simulation import Actuator, Load, Trajectory, natural_earthquake
from quakedesign.simulation import simulate as run_loop
from quakedesign.studies.estimation import differentiator_premise
from quakedesign.studies.on_trajectory import certified_bound, trajectory_premise
from quakedesign.synthesis import answer, design
from quakedesign.synthesis.guaranteed.compensated import recovered

PUBLISHED, DESIGNED, CONTINUOUS = ("published",), ("designed",), ("continuous",)


@dataclass(frozen=True, kw_only=True)
class Choice:
    """Controller, and what is certified of it without asking a solver.

    Attributes
    ----------
    controller : Controller
    lipschitz : Fraction or None
        Certified bound on |h'| [m/s³]; None for gains that come without a certificate, and for a linear law.
    claim : Guarantee, SlidingGuarantee or None
        What is proved of the law as it runs, where it comes from the file of that.
    """

    controller: Controller
    lipschitz: Fraction | None = None
    claim: Guarantee | SlidingGuarantee | None = None

    def noise(self, seed: int) -> Measurement:
        """What the controller is told wrongly at most by its guarantee, anywhere within that; none without one."""
        held = self.claim.held if self.claim else None
        off = {name: float(bound) for name, bound in held.noise.items()} if held else {}
        return Measurement(**off, seed=seed, bounded=True) if off else EXACT


def chosen_controller(
    fault: Fault, name: str, gains: tuple[str, ...], *, scale: str | None = None, feedforward: str = "none"
) -> Controller:
    """Controller of a `choice`, which see."""
    return choice(fault, name, gains, scale=scale, feedforward=feedforward).controller


def certified_choice(fault: Fault, path: str | Path) -> Choice:
    """Law of a file of `guarantee`, which must be about the fault and hold; its proof is checked anew.

    Raises
    ------
    CertificateError
        When the file cannot be read, is about something else, or does not hold.
    UnsupportedError
        For a sliding mode whose gains cannot be read off its implicit step.
    """
    claim = load_guarantee(path)
    if isinstance(claim, ContinuousPeaks) or isinstance(claim, SlidingGuarantee) != bool(fault.friction.state_names):
        raise CertificateError(
            "the law of a certificate runs once per sample, and is about friction with a state where that of the fault "
            f"has one. Received {path} and {fault.name}. Give a file of guarantee {fault.name} --out FILE."
        )
    if apart := _apart(fault, claim):
        raise CertificateError(
            f"a certificate must be about the fault. Received {path} about {claim.task.name}, and {fault.name}: "
            f"{'; '.join(apart)}. Give the fault that it is about, or prove a new one with guarantee."
        )
    if isinstance(claim, Guarantee) and claim.held.law.root is not None:
        controller: Controller = recovered(claim).limited
    else:
        controller = claim.controller
    if claim.check() is not Verdict.PROVED:
        raise CertificateError(f"a certificate must hold. Received {path}, whose claims do not follow. Prove it anew.")
    return Choice(controller=controller, claim=claim)


def _apart(fault: Fault, claim: Guarantee | SlidingGuarantee) -> list[str]:
    """What of a fault a certificate does not cover."""
    if isinstance(claim, SlidingGuarantee):
        return claim.task.differences(sliding_task(fault, claim.task.stress))
    return differences(claim.task, task_of(fault, rate_limited=claim.task.change is not None))


def optional_choice(fault: Fault, name: str, gains: tuple[str, ...], **more: Any) -> Choice | None:
    """A `choice`, which see, or None for the name ``none``.

    Raises
    ------
    UnknownNameError, ParameterError
        Also for gains, a scale or a feed-forward of no controller.
    """
    if name != "none":
        return choice(fault, name, gains, **more)
    if gains != PUBLISHED or more.get("scale") is not None or more.get("feedforward", "none") != "none":
        raise ParameterError("gains, scale and feedforward need a controller. Received none. Give --controller.")
    return None


def choice(
    fault: Fault,
    name: str,
    gains: tuple[str, ...],
    *,
    scale: str | None = None,
    feedforward: str = "none",
    step: float | None = None,
    path: Mapping[str, float] | None = None,
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
    step : float, optional
        T_s [s] of a design; the fault's unless given.
    path : mapping of str to float, optional
        Delay, lag and diffusion [s] for which a law is designed as it runs, as `answer` does; none unless given.

    Raises
    ------
    UnknownNameError, ParameterError
    """
    law, base = _with_gains(fault, name, gains, step, path or {})
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


def _with_gains(
    fault: Fault, name: str, gains: tuple[str, ...], step: float | None, path: Mapping[str, float]
) -> tuple[Controller, Fraction | None]:
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
    if gains == DESIGNED and step is not None:
        fault = replace(fault, sampling_time=step)
    if gains == DESIGNED and path:
        return _designed_behind(fault, name, path), None
    if gains in (DESIGNED, CONTINUOUS):
        designed = design(fault, name, continuous=gains == CONTINUOUS)
        if designed.controller is None:
            raise ParameterError(f"no gains with a proof were found for {name} on {fault.name}. Give --gains.")
        return designed.controller, certified_bound(designed)
    return law.for_authority(gains, least_authority(fault)), None


def _designed_behind(fault: Fault, name: str, path: Mapping[str, float]) -> Controller:
    """Law that is designed for a delay, a lag and rock, as it runs at the fault's T_s.

    Raises
    ------
    ParameterError
        Where none has a proof, or the delay is more than a run takes.
    """
    around: Any = {part: rational(time, part) for part, time in path.items()}
    Actuator.meant_for(Sampling(step=rational(fault.sampling_time), **around))
    found = answer(fault, controller=name, **around)
    if not isinstance(found.found, Guarantee):
        told = ", ".join(f"{part} {time:g} s" for part, time in path.items())
        sooner = f"--step '{float(found.shorter.held.step):g} s', where it has, " if found.shorter else ""
        raise ParameterError(
            f"designed gains must have a proof behind what is around them. Received {name} with {told}, "
            f"T_s = {fault.sampling_time:g} s: {found.found.reason}. Give {sooner}gains as numbers, or see limits."
        )
    return found.compensation.limited if found.compensation else found.found.controller


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
