"""From a fault to gains with a proof, and from given gains to a verdict."""

from collections.abc import Callable
from fractions import Fraction
from typing import Any

from quakedesign.certificates.guarantee.held import Around
from quakedesign.certificates.premises import least_authority
from quakedesign.controllers import Controller, control_law
from quakedesign.controllers.feed_forward import NONE, feed_forward
from quakedesign.errors import ParameterError, UnsupportedError, require_known
from quakedesign.fault import Fault, require_fault
from quakedesign.rationals import rational
from quakedesign.synthesis.designed import Design
from quakedesign.synthesis.guaranteed import CLASSES, MEASURED, OBJECTIVES
from quakedesign.synthesis.methods.base import Problem, Sliding, method_of


def design(
    fault: Fault,
    controller: str | type[Controller] = "cta",
    *,
    feedforward: str = "none",
    objective: str = "tracking",
    continuous: bool = False,
    measured: str = MEASURED[0],
    slip_noise: str | float | Fraction = 0,
    rate_noise: str | float | Fraction = 0,
    delay: str | float | Fraction = 0,
    lag: str | float | Fraction = 0,
    diffusion: str | float | Fraction | None = None,
    stress: str | float | Fraction | None = None,
    spread: str | float | Fraction = 0,
    disturbance_class: str = CLASSES[0],
    progress: Callable[[str, float], None] | None = None,
) -> Design:
    """Find gains with a proof for a fault.

    All of them run as they are guaranteed, measured and held over the fault's T_s, or over the longest T_s with a
    guarantee where the fault's own has none; see `Design.guarantee`.

    2-CTA, 2-DIA: base gains (families.toml) are proved in continuous time for the fault's range of β; λ = ρ⁶ (ρ
    rational, so that every scaled gain is rational), weight and authority of the scheme ``compensated`` are chosen by
    what is guaranteed. e-LQR: feedback with an estimate of the disturbance.

    With `continuous` those of the paper, without a guarantee of the loop that runs. 2-CTA, 2-DIA: λ grows until L̄
    exceeds by a tenth what the reference and the disturbance need; so does it where no T_s has a guarantee. e-LQR:
    Riccati equation with the sound bound on the uncertainty, then an exact proof about any constant reference.

    A fault whose friction has a state is held in slow sliding along its task by an e-LQR of the slip alone, through
    the rock between well and fault (`Design.sliding`); sliding modes do not apply to it.

    Parameters
    ----------
    fault : Fault
    controller : str or type of Controller
        ``"cta"``, ``"dia"`` or ``"elqr"``; or a law of your own, also as ``"module:Class"``, which says how it is
        designed or derives from one of these.
    feedforward : str
        What a sliding mode adds to ν from what is known of the plant: ``"none"``, ``"nominal"`` or ``"centred"``, see
        `quakedesign.controllers.feed_forward`. It enlarges the certified domain in continuous time and has no guarantee
        as it runs, so it needs `continuous`; the e-LQR takes none.
    objective : str
        ``"tracking"`` for small errors under slow disturbances, ``"peak"`` for the smallest guaranteed slip-rate error.
    continuous : bool
        The paper's design in continuous time.
    measured : str
        What the e-LQR of samples is told: ``"slip-and-rate"``, or ``"slip"``, from which it estimates the slip rate.
    slip_noise, rate_noise : str, float or Fraction
        Bounds of what a law of samples is told wrongly of slip [m] and slip rate [m/s], for its guarantee.
    delay, lag : str, float or Fraction
        From measurement to valve, and time constant of the pump [s], for which an e-LQR is designed and behind which it
        runs.
    diffusion : str, float or Fraction, optional
        The same of rock between well and fault: L²/D [s]. Of friction with a state a tenth of D_c/V unless given.
    stress : str, float or Fraction, optional
        Of friction with a state: bound of the shear stress disturbance [Pa]; the largest that the design stands unless
        given.
    spread : str, float or Fraction
        Of friction with a state: by how much of their values a, b and D_c may be off [-].
    disturbance_class : str
        Of the guarantee: ``"amplitude"``, any disturbance as large as the fault's, or ``"rate"``, one that starts at 0
        and is no faster either, such as a tide.
    progress : callable, optional
        Called with what the search for a law around friction with a state is doing, and the fraction done [-].

    Returns
    -------
    Design
        With verdict ``UNDECIDED`` and ``reason`` in its details when no proof was found.

    Raises
    ------
    UnknownNameError
        For a controller that cannot be designed, or an unknown feed-forward.
    ParameterError
        For a feed-forward with a law that takes none or runs sampled, an unknown objective, or one of a design in
        continuous time; for stress or spread without a state of friction, a delay or a lag with one.
    UnsupportedError
        For a law that does not apply to friction with a state.
    """
    require_fault(fault)
    law = control_law(controller)
    times = {"delay": delay, "lag": lag, "diffusion": diffusion or 0}
    path = {name: rational(time, name) for name, time in times.items()}
    sliding = _sliding(fault, law, path, diffusion, stress, spread)
    added = NONE if feedforward == NONE.name else feed_forward(feedforward, fault, least_authority(fault))
    noise = Around(slip_noise=rational(slip_noise, "slip_noise"), rate_noise=rational(rate_noise, "rate_noise"))
    require_known(objective, OBJECTIVES, "objective")
    require_known(disturbance_class, CLASSES, "class")
    if continuous and objective != OBJECTIVES[0]:
        raise ParameterError(
            f"the objective of a design in continuous time must be {OBJECTIVES[0]}. Received {objective!r}. "
            "Leave it out, or continuous."
        )
    told: Any = {"objective": objective, "continuous": continuous, "measured": measured, "noise": noise}
    told |= {"disturbance_class": disturbance_class, "path": {} if fault.friction.state_names else path}
    told |= {"tell": progress} if progress else {}
    return law.design(Problem(fault=fault, answer=Design, feedforward=added, sliding=sliding, **told))


def _sliding(
    fault: Fault, law: type[Controller], path: dict[str, Fraction], diffusion: Any, stress: Any, spread: Any
) -> Sliding:
    """What is asked of slow sliding, which only friction with a state has; refuses laws that do not apply to it."""
    if min(path.values()) < 0:
        raise ParameterError(
            "delay, lag and diffusion must be 0 s or more. Received "
            f"{', '.join(f'{float(time):g} s' for time in path.values())}. Check their signs."
        )
    asked = Sliding(
        diffusion=path["diffusion"] or None,
        stress=None if stress is None else rational(stress, "stress"),
        spread=rational(spread, "spread"),
    )
    if not fault.friction.state_names:
        if asked.stress is not None or asked.spread:
            raise ParameterError(
                f"stress and spread of a design need friction with a state. Received {fault.friction.name}. "
                "Leave them out."
            )
        return Sliding()
    if diffusion is not None and not path["diffusion"]:
        raise ParameterError("a diffusion must be above 0 s. Received 0 s. Leave it out for a well near the fault.")
    if path["delay"] or path["lag"]:
        raise ParameterError(
            f"a design for friction with a state goes through rock alone. Received a delay or lag with "
            f"{fault.friction.name}. Leave them out; guarantee takes both."
        )
    if why := method_of(law).without_state:
        raise UnsupportedError(f"{why}. Received {law.name}. Design an elqr.")
    return asked


def assess(fault: Fault, controller: Controller) -> Design:
    """Judge given gains on a fault: verdict, certificate and premises.

    Sliding modes are tried at 99, 90 and 50 % of the bound on |h'| that no V can exceed; the e-LQR over the fault's
    sectors. A law that certificates cannot express yet is ``UNDECIDED``. The verdict on a law of samples is that on its
    guarantee.

    Parameters
    ----------
    fault : Fault
    controller : Controller

    Returns
    -------
    Design
    """
    fault.require_memoryless("a verdict on gains")
    return Problem(fault=fault, answer=Design).assessed(controller)
