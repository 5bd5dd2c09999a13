"""What is guaranteed of a controller on a fault as it runs, given or designed for it."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from fractions import Fraction
from typing import TypeVar, Unpack

from quakedesign.certificates.guarantee import NoGuarantee, task_of
from quakedesign.certificates.guarantee.statement import Around
from quakedesign.certificates.impossibility import hopeless
from quakedesign.controllers import Controller, control_law
from quakedesign.errors import ParameterError, QuakedesignError, require_known
from quakedesign.executors import crew_or_here
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.synthesis.guaranteed import CLASSES, MEASURED, Answer
from quakedesign.synthesis.guaranteed.families import require_surroundings
from quakedesign.synthesis.methods.base import Wanted, method_of

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
) -> Answer:
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
        ``slip-and-rate``, or ``slip`` for a designed e-LQR with an observer.
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
    require_surroundings(around)
    task = task_of(fault, rate_limited=disturbance_class == "rate")
    law = control_law(controller)
    late, far = around.get("delay", Fraction(0)), around.get("diffusion", Fraction(0))
    beyond = hopeless(task, rational(fault.effective_normal_stress), late, far)
    if beyond and not gains:
        return Answer(fault=fault, found=NoGuarantee(reason=beyond, small_gain=None))
    wanted = Wanted(gains=gains, objective=objective, scheme=scheme, measured=measured, around=around)
    return method_of(law).sampled(fault, task, law, period, wanted)
