"""What is guaranteed of a controller on a fault as it runs, given or designed for it."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import Any, TypeVar, Unpack

from quakedesign.errors import ParameterError, QuakedesignError, require_known
from quakedesign.exact import exact_text, rational
from quakedesign.fault import Fault
from quakedesign.fault.units import exact_value
from quakedesign.guarantees import CLASSES, MEASURED, OBJECTIVES, LoopAnswer, NoGuarantee, task_of
from quakedesign.guarantees.exact.impossibility import hopeless, too_slow
from quakedesign.guarantees.exact.loop import Around, Pump
from quakedesign.guarantees.guarantee_result import SlidingAnswer, answer_sliding
from quakedesign.guarantees.search.linear_design import nearest_setup
from quakedesign.laws import Controller, control_law
from quakedesign.parallel import crew_or_here
from quakedesign.synthesis.method import Wanted, method_of

Found = TypeVar("Found")


def answers(
    questions: Sequence[Callable[[], Found]],
    *,
    workers: int = 1,
    scheduler: str | None = None,
    executor: Executor | None = None,
    tell: Callable[[str, float], None] | None = None,
) -> list[Found | QuakedesignError]:
    """Answers to several questions, each asked where there is room, in the order of the questions; refusals too.

    Parameters
    ----------
    questions : sequence of callable
        Such as ``partial(answer, fault, step=Fraction(1, 20))``; without argument, and known to other processes.
    workers : int
        Number of processes; 1 computes in this one. No digit depends on who computes.
    scheduler : str, optional
        Address of a dask.distributed scheduler that is used instead.
    executor : Executor, optional
        Any other executor of `concurrent.futures` that is used instead.
    tell : callable, optional
        Called with what is being done and the fraction done [-].

    Raises
    ------
    SimulationError
        When the workers cannot be reached, or do not live.
    """
    found: dict[int, Found | QuakedesignError] = {}
    with crew_or_here(workers, scheduler, executor) as crew:
        for place, one in crew.answers(_asked, [(question,) for question in questions]):
            found[place] = one
            if tell is not None:
                tell(f"{len(found)} of {len(questions)} answered", len(found) / len(questions))
    return [found[place] for place in range(len(questions))]


def _asked(question: Callable[[], Found]) -> Found | QuakedesignError:
    try:
        return question()
    except QuakedesignError as refused:
        return refused


def answer(
    fault: Fault,
    *,
    controller: str | type[Controller] = "elqr",
    gains: tuple[str, ...] = (),
    objective: str = "tracking",
    scheme: str | None = None,
    step: Fraction | None = None,
    measured: str = MEASURED[0],
    disturbance_class: str = CLASSES[0],
    **around: Unpack[Around],
) -> LoopAnswer:
    """Guarantee of given e-LQR gains with summed integrals, of a law that is designed for it, or of a sliding mode.

    Nothing is designed for a delay or rock beyond what any controller can do that withdraws at most σ′.

    Parameters
    ----------
    fault : Fault
    controller : str or type of Controller
        ``elqr``, or a sliding mode, ``cta`` or ``dia``.
    gains : tuple of str
        k1 … k4 of the e-LQR, run by the scheme ``explicit``; none to design a law with a disturbance estimate. Base
        gains of a sliding mode; none for those that a design tries first.
    objective : str
        ``tracking`` or ``peak``, of a design.
    scheme : str, optional
        Of a sliding mode: ``compensated`` unless given, the only one with a guarantee; of the e-LQR ``explicit``.
    step : Fraction, optional
        T_s [s]; the fault's unless given.
    measured : str
        ``slip-and-rate``, ``slip`` for a designed e-LQR with an observer, or ``differentiator``.
    disturbance_class : str
        ``amplitude``: any measurable disturbance as large as the fault's; ``rate``: no faster either.
    **around : Fraction
        Delay, lag and L²/D [s], bounds of the noise of slip [m] and slip rate [m/s], and of both at the start, of
        either sign (`initial_slip`, `initial_slip_rate`); 0 unless given.

    Raises
    ------
    ParameterError
    """
    require_known(disturbance_class, CLASSES, "class")
    period = rational(fault.sampling_time) if step is None else step
    if not Fraction(1, 10**9) <= period <= 10**9:
        raise ParameterError(f"step must be positive, between 1e-9 s and 1e9 s. Received {float(period):.4g} s.")
    task = task_of(fault, rate_limited=disturbance_class == "rate")
    law = control_law(controller)
    late, far = around.get("delay", Fraction(0)), around.get("diffusion", Fraction(0))
    beyond = hopeless(task, rational(fault.effective_normal_stress), late, far)
    if beyond and not gains:
        near = nearest_setup(task, period, measured=measured, **around) if controller == "elqr" else None
        return LoopAnswer(fault=fault, found=NoGuarantee(reason=beyond, small_gain=None), nearest=near)
    wanted = Wanted(gains=gains, objective=objective, scheme=scheme, measured=measured, around=around)
    given = method_of(law).sampled(fault, task, law, period, wanted)
    longest = max(period, around.get("longest_step", period))
    slow = "" if gains else too_slow(task, rational(fault.effective_normal_stress), longest, late)
    if not slow or given.proved:
        return given
    return replace(given, found=NoGuarantee(reason=slow, small_gain=None))


_UNITS = {
    "delay": "s",
    "lag": "s",
    "diffusion": "s",
    "slip_noise": "m",
    "rate_noise": "m/s",
    "initial_slip": "m",
    "initial_slip_rate": "m/s",
    "jitter": "s",
    "delay_jitter": "s",
    "averaging_time": "s",
    "longest_step": "s",
}
_SLOWLY = ("delay", "lag", "diffusion", "slip_noise", "pump")
Quantity = str | float | Fraction


def guarantee(
    fault: Fault,
    controller: str | type[Controller] = "elqr",
    *,
    objective: str = "tracking",
    gains: "Sequence[str | float | Fraction] | Sequence[Sequence[float]]" = (),
    scheme: str | None = None,
    step: Quantity | None = None,
    measured: str = MEASURED[0],
    disturbance_class: str = CLASSES[0],
    saturation: Quantity | None = None,
    withdrawal: Quantity | None = None,
    rate_limit: Quantity | None = None,
    stress: Quantity | None = None,
    spread: Quantity = 0,
    **around: Quantity,
) -> LoopAnswer | SlidingAnswer:
    """Prove how far slip, slip rate and pressure of the loop that runs can go, as the command `guarantee` does.

    Every quantity is a number in SI units, a decimal or p/q as text, or a text with its unit, such as ``"80 ms"``.

    Parameters
    ----------
    fault : Fault
    controller : str or type of Controller
        ``elqr``, or a sliding mode, ``cta`` or ``dia``.
    objective : str
        Of a design: ``tracking``, or ``peak`` for the smallest proved slip-rate error.
    gains : sequence or array of str, float or Fraction, optional
        k1 to k4 of an e-LQR whose integrals are summed once per sample, base gains of a sliding mode; none to design. A
        matrix of one row, as the K of ``control.dlqr``, is its row.
    scheme : str, optional
        As in `answer`.
    step : str, float or Fraction, optional
        T_s [s]; the fault's unless given.
    measured : str
        ``slip-and-rate``, ``slip`` for a designed e-LQR with an observer, or ``differentiator``.
    disturbance_class : str
        ``amplitude`` or ``rate``.
    saturation, withdrawal : str, float or Fraction, optional
        Largest pressure of the pump, and largest decrease unless that is the same [Pa]: limits that are never reached.
    rate_limit : str, float or Fraction, optional
        How fast the pump goes from one pressure to the next [Pa/s].
    stress : str, float or Fraction, optional
        Of friction with a state: bound of the shear stress disturbance [Pa]; the largest that the design stands unless
        given.
    spread : str, float or Fraction
        Of friction with a state: by how much of their values a, b and D_c may be off [-].
    **around : str, float or Fraction
        ``delay``, ``lag`` and ``diffusion`` (L²/D) [s], ``slip_noise`` [m] and ``rate_noise`` [m/s] as bounds, and
        ``initial_slip`` [m] and ``initial_slip_rate`` [m/s] as bounds of the start, ``jitter``, ``delay_jitter``
        and ``averaging_time`` [s], and ``longest_step`` [s] where samples follow no clock; 0 unless given.

    Returns
    -------
    LoopAnswer or SlidingAnswer
        Its ``lines()`` are what the command prints; ``found`` is the guarantee, which has a ``controller`` for
        `simulate`, `loop_transfer` and `export_controller`, or the reason why there is none.

    Raises
    ------
    ParameterError, UnsupportedError
    """
    return question(
        fault,
        controller=controller,
        objective=objective,
        gains=_listed(gains),
        scheme=scheme,
        step=None if step is None else exact_value(step, "s", "step"),
        measured=measured,
        disturbance_class=disturbance_class,
        stress=None if stress is None else exact_value(stress, "Pa", "stress"),
        spread=exact_value(spread, "", "spread"),
        **exact_surroundings(saturation=saturation, withdrawal=withdrawal, rate_limit=rate_limit, **around),
    )()


def _listed(gains: "Sequence[str | float | Fraction] | Sequence[Sequence[float]]") -> tuple[str, ...]:
    """Gains as exact texts.

    Raises
    ------
    ParameterError
    """
    given: list[Any] = list(gains)
    row = (
        list(given[0]) if len(given) == 1 and not isinstance(given[0], str) and hasattr(given[0], "__len__") else given
    )
    return tuple(exact_text(rational(value, f"gain k{place}")) for place, value in enumerate(row, start=1))


def exact_surroundings(
    *,
    saturation: Quantity | None = None,
    withdrawal: Quantity | None = None,
    rate_limit: Quantity | None = None,
    **around: Quantity,
) -> dict[str, Any]:
    """What is around a law as rationals in SI units, and the pump, None without limits.

    Raises
    ------
    ParameterError
        For another name, or a withdrawal without a largest pressure.
    """
    for name in around:
        require_known(name, _UNITS, "part of what is around a law")
    values: Any = {name: exact_value(given, _UNITS[name], name.replace("_", " ")) for name, given in around.items()}
    averaging = values.pop("averaging_time", Fraction(0))
    if averaging:
        values |= {"averaging": averaging, "delay": values.get("delay", Fraction(0)) + max(averaging, Fraction(0)) / 2}
    asked = {"saturation": (saturation, "Pa"), "withdrawal": (withdrawal, "Pa"), "rate_limit": (rate_limit, "Pa/s")}
    told = {name: exact_value(given, unit, name) for name, (given, unit) in asked.items() if given is not None}
    largest, rate = told.get("saturation"), told.get("rate_limit")
    if largest is None and "withdrawal" in told:
        raise ParameterError(
            "a withdrawal belongs to a saturation, the largest pressure. Received it alone. Give both."
        )
    least = None if largest is None else -told.get("withdrawal", largest)
    return {**values, "pump": Pump(least=least, largest=largest, rate=rate) if told else None}


def question(
    fault: Fault, *, step: Fraction | None, stress: Fraction | None, spread: Fraction, **asked: Any
) -> Callable[[], LoopAnswer | SlidingAnswer]:
    """What `guarantee` is asked, known to other processes; refuses what the friction of the fault has no use for.

    Raises
    ------
    ParameterError
    """
    if not fault.friction.state_names:
        if stress is not None or spread:
            raise ParameterError(
                f"stress and spread need friction with a state. Received {fault.friction.name}. Leave them out."
            )
        return partial(answer, fault, step=step, **asked)
    usual = {"gains": (), "scheme": None, "objective": OBJECTIVES[0], "disturbance_class": CLASSES[0]}
    foreign = [name for name, value in asked.items() if name not in (*_SLOWLY, "controller", "measured") and value]
    if [name for name in foreign if asked[name] != usual.get(name)]:
        raise ParameterError(
            "slow sliding is guaranteed of a designed law of the slip alone under any stress of an amplitude, from "
            "steady sliding. Received gains, a scheme, noise of the slip rate, an objective, a class, an initial slip "
            "or slip rate, jitter or averaging. Leave them out."
        )
    taken: Any = {name: asked[name] for name in _SLOWLY if name in asked}
    return partial(
        answer_sliding, fault, controller=asked["controller"], step=step, stress=stress, spread=spread, **taken
    )
