"""What no controller can do with a fault, beside what a designed one is proved to do."""

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction

from quakedesign.bounds import Bound, LowerBound, UpperBound
from quakedesign.certificates.guarantee import Guarantee, NoGuarantee, Task, task_of
from quakedesign.certificates.guarantee.held import Around
from quakedesign.certificates.impossibility import (
    farthest_well,
    longest_diffusion,
    longest_reaction,
    smallest_peak,
    smallest_withdrawal,
)
from quakedesign.certificates.slow_sliding import SlidingGuarantee
from quakedesign.certificates.slow_sliding.push import SlidingPush
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.rationals import rational, shortly
from quakedesign.studies.fundamental_limits import (
    KNOWING,
    QUANTITIES,
    WAITING,
    Limit,
    Limits,
    SlidingLimits,
    Told,
    above_the_reference,
)
from quakedesign.synthesis.guaranteed import MEASURED, design_held, longest_delay, reached
from quakedesign.synthesis.guaranteed.sliding_answer import SlidingAnswer, answer_sliding
from quakedesign.synthesis.linear.plant.sliding_model import near_path, sliding_model

_ATTEMPTS = 6  # designs for one time


def limits(
    fault: Fault,
    *,
    pressure: float | None = None,
    diffusivity: float = 1.0,
    lag: float | str | Fraction = 0,
    diffusion: float | str | Fraction | None = None,
    stress: float | None = None,
    spread: float | str | Fraction = 0,
    measured: str = MEASURED[0],
    slip_noise: float | str | Fraction = 0,
    rate_noise: float | str | Fraction = 0,
    prove: bool = True,
) -> Limits:
    """What no controller can do with a fault whose disturbance is of the class ``amplitude``.

    With friction that has a state: in slow sliding along its task, of the nominal plant linearised there.

    There are none of the class ``rate``: every proof pushes the fault with a disturbance that jumps.

    Parameters
    ----------
    fault : Fault
    pressure : float, optional
        Largest withdrawal [Pa]; the effective normal stress unless given. In slow sliding: largest pressure beside what
        the reference needs, in both directions.
    diffusivity : float
        Of the rock between well and fault [m²/s].
    lag : float, str or Fraction
        Of friction with a state: time constant of pump and pipe [s] behind which a design is proved.
    diffusion : float, str or Fraction, optional
        The same of L²/D of the rock [s]; that of a well near the fault without it and a lag.
    stress : float, optional
        Of friction with a state: bound of the shear stress disturbance [Pa]; the largest that a design stands unless
        given.
    spread : float, str or Fraction
        Of friction with a state: by how much of their values a, b and D_c may be off [-] for a design that is proved;
        what is impossible is so for the nominal ones.
    measured : str
        What controllers are told: ``slip-and-rate`` or ``slip``.
    slip_noise, rate_noise : float, str or Fraction
        Bounds of what that is off [m], [m/s], whatever the course, for the slip-rate error and designs. With friction
        that has a state no limit of noise is known.
    prove : bool
        Whether to look for designs with a guarantee, which takes a minute.

    Returns
    -------
    Limits

    Raises
    ------
    ParameterError
        For a negative pressure, a diffusivity that is not positive, a stress, lag or rock without friction that has a
        state, no stress where no design stands any, noise with it, negative noise, or noise of a slip rate that is
        not measured.
    """
    told = Told(
        measured=measured,
        slip_noise=rational(slip_noise, "slip noise"),
        rate_noise=rational(rate_noise, "rate noise"),
    )
    off = rational(spread, "spread")
    if fault.friction.state_names:
        _require_no_noise(fault, told)
        path: Around = {"lag": rational(lag, "lag"), "diffusion": rational(diffusion or 0, "diffusion")}
        return _sliding_limits(fault, pressure, diffusivity, stress, path if prove else None, off)
    if stress is not None or off:
        raise ParameterError(
            f"{'a spread' if off else 'stress'} needs friction with a state. Received {fault.friction.name}. Leave it "
            "out: the box and the disturbance of the fault are meant."
        )
    if rational(lag, "lag") or diffusion is not None:
        raise ParameterError(
            "designs of limits stand behind a lag or rock with rate-and-state friction alone. Received "
            f"{fault.friction.name}. Leave them out; guarantee proves a law behind them, or that none can be."
        )
    task, step = task_of(fault), rational(fault.sampling_time)
    withdrawal, spread = _given(fault, pressure, diffusivity)
    held = _proved_steps(task, step, told) if prove else ()
    if own := next((g for g in held if g.held.step == step), None):
        own = _best_at(own, told)
        held = tuple(own if g.held.step == step else g for g in held)
    peak, proved = smallest_peak(task, step, **told.bounds), dict[str, Bound | None]()
    if held:
        proved["largest_step"] = LowerBound(held[-1].held.step)
    if own is not None:
        proved["peak_slip_rate_error"] = own.claims.slip_rate_error
        proved["largest_delay"] = _proved_delay(task, step, told)
        proved["smallest_pressure"] = UpperBound(max(-own.claims.least_pressure, Fraction(0)))
    return Limits(
        fault=fault,
        withdrawal=withdrawal,
        diffusivity=spread,
        slip_error=peak.slip_error if peak else None,
        **_limits(
            _impossible(task, withdrawal, step, spread, peak.slip_rate_error if peak else None), proved, told.knowing()
        ),
        proved=held,
        told=told,
    )


def _impossible(
    push: Task | SlidingPush, withdrawal: Fraction, step: Fraction, diffusivity: Fraction, peak: Bound | None
) -> dict[str, Bound | None]:
    """What no controller can do, by name; nothing where no limit is known."""
    reaction, path = longest_reaction(push, withdrawal), longest_diffusion(push, withdrawal, step)
    return {
        "peak_slip_rate_error": peak,
        "largest_step": reaction,
        "largest_delay": None if reaction is None else UpperBound(max(reaction - step, Fraction(0))),
        "largest_diffusion_time": path,
        "farthest_well": None if path is None else farthest_well(path, diffusivity),
        "smallest_pressure": smallest_withdrawal(push, step),
    }


def _limits(
    impossible: Mapping[str, Bound | None], proved: Mapping[str, Bound | None], knowing: str, plant: str = ""
) -> dict[str, Limit]:
    """Limits by name, of a plant that is not the fault itself if one is named."""
    return {
        name: Limit(
            title=title,
            unit=unit,
            impossible_beyond=impossible[name],
            proved_up_to=proved.get(name),
            holds_for=(knowing if name == "peak_slip_rate_error" else WAITING) + plant,
        )
        for name, (title, unit) in QUANTITIES.items()
    }


def _require_no_noise(fault: Fault, told: Told) -> None:
    if told != Told():
        raise ParameterError(
            f"no limit of slow sliding is known for noise. Received {fault.friction.name}, told {told.words()}. "
            "Leave noise out: what cannot be done without it cannot be done with it."
        )


def _given(fault: Fault, pressure: float | None, diffusivity: float) -> tuple[Fraction, Fraction]:
    withdrawal = rational(fault.effective_normal_stress if pressure is None else pressure, "pressure")
    spread = rational(diffusivity, "diffusivity")
    if withdrawal <= 0 or spread <= 0:
        raise ParameterError(
            f"pressure and diffusivity must be positive. Received {shortly(withdrawal)} Pa and {shortly(spread)} "
            "m^2/s. Give the size of the largest withdrawal."
        )
    return withdrawal, spread


def _sliding_limits(
    fault: Fault,
    pressure: float | None,
    diffusivity: float,
    stress: float | None,
    path: Around | None,
    off: Fraction,
) -> SlidingLimits:
    """Beside what is proved of a design behind a path, or behind that of a near well; of none without a path.

    Unless a stress is told, it is that which the design stands, or that with a near well where none is found behind the
    path; behind a path that is impossible under the latter no design is looked for.
    """
    withdrawal, spread = _given(fault, pressure, diffusivity)
    model, step = sliding_model(fault), rational(fault.sampling_time)
    asked = None if stress is None else rational(stress, "stress")
    told = path if path is not None and any(path.values()) else None
    near: Around = {"diffusion": near_path(model)}
    answer = None if path is None else answer_sliding(fault, stress=asked, spread=off, **near)
    found = answer.found if answer is not None and isinstance(answer.found, SlidingGuarantee) else None
    amplitude = asked if asked is not None or found is None else found.task.stress
    if amplitude is None or amplitude <= 0:
        raise ParameterError(
            "limits of slow sliding need a shear stress above 0 that pushes the fault. Received none, and no design "
            f"was found that stands any{_why(answer)}. Give --stress, such as '25 kPa'."
        )
    push = SlidingPush(model=model, amplitude=amplitude)
    farthest, rock = longest_diffusion(push, withdrawal, step), (told or {}).get("diffusion", Fraction(0))
    if told is not None and (farthest is None or rock <= farthest):
        behind = answer_sliding(fault, stress=asked, spread=off, **told).found
        found = behind if isinstance(behind, SlidingGuarantee) else None
        push = replace(push, amplitude=found.task.stress) if found else push
    impossible = _impossible(push, withdrawal, step, spread, push.smallest_rate_error(step))
    proved: dict[str, Bound | None] = {}
    if found is not None:
        proved["peak_slip_rate_error"] = above_the_reference(found)
        proved["largest_step"] = LowerBound(step)
        proved["largest_diffusion_time"] = LowerBound(found.held.diffusion)
        proved["smallest_pressure"] = found.claims.push
    known = _limits(impossible, proved, KNOWING, ", of the linearised plant")
    return SlidingLimits(
        fault=fault,
        withdrawal=withdrawal,
        diffusivity=spread,
        slip_error=None,
        **known | {"smallest_pressure": replace(known["smallest_pressure"], title="pressure")},
        proved=(),
        told=Told(),
        push=push,
        guarantee=found,
        rock=rock,
    )


def _why(answer: SlidingAnswer | None) -> str:
    return f": {answer.found.reason}" if answer is not None and isinstance(answer.found, NoGuarantee) else ""


def _proved_steps(task: Task, step: Fraction, told: Told) -> tuple[Guarantee, ...]:
    return reached(lambda held: design_held(task, held, objective="peak", **told.around), step, attempts=_ATTEMPTS)


def _best_at(least_peak: Guarantee, told: Told) -> Guarantee:
    """Of a design for the smallest slip-rate error and one that tracks, that with the smaller one that is proved."""
    tracking = design_held(least_peak.task, least_peak.held.step, objective="tracking", **told.around)
    found = [least_peak, *([tracking] if isinstance(tracking, Guarantee) else [])]
    return min(found, key=lambda g: g.claims.slip_rate_error)


def _proved_delay(task: Task, step: Fraction, told: Told) -> LowerBound | None:
    longest = longest_delay(task, step, **told.around)
    return LowerBound(longest.held.delay) if longest else None
