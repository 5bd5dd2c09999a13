"""How far a well may be, or how fast a fault may slide, for a law to hold it: from near and slow on, law after law.

Times in D_c/V, the loop hardly depends on V: a proof for a share of the rock's L²/D is nearly one for that share of V.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from quakedesign.certificates.guarantee import Held, NoGuarantee
from quakedesign.certificates.guarantee.held import Around
from quakedesign.certificates.slow_sliding import SlidingGuarantee, SlidingTask, sliding_task
from quakedesign.fault import Fault
from quakedesign.fault.defaults import AGEINGS, beyond_rates, sliding_step
from quakedesign.rationals import rational
from quakedesign.synthesis.guaranteed.rounding import short
from quakedesign.synthesis.guaranteed.slow_sliding import LOG_RATES, searched_sliding, two_digits

Prove = Callable[[SlidingTask, Held, Fraction], SlidingGuarantee | NoGuarantee]
"""Of a task, a law as it runs and a bound of |ln(v/V)|."""

PATH = {"diffusion": "L^2/D", "lag": "the lag"}
_EASY = Fraction(1)  # D_c/V through which laws are found at once
_FARTHER = Fraction(13, 10), Fraction(9, 8), Fraction(17, 16)  # the next one where no law is found farther
_ROOM = Fraction(3, 4)
_NEARER = 3  # times that half the path is tried
_LAWS = 40  # that are tried for a share of the path
_ENOUGH = 0.5  # of the bound of |ln(v/V)|, by the estimate
_SLOWER = 1.05  # spare, as damping does not scale with V
_DIGITS = 2
_SUITABLE = 2


@dataclass(frozen=True, kw_only=True)
class Reach:
    """How far a well was followed with a law.

    Attributes
    ----------
    share : Fraction
        Of the path [-]; 0 where no law was found.
    held : Held or None
        The law there.
    numbers : array or None
        Its numbers, near which a search may begin.
    log_rate : Fraction
        Bound of |ln(v/V)| of its estimate.
    """

    share: Fraction = Fraction(0)
    held: Held | None = None
    numbers: np.ndarray | None = None
    log_rate: Fraction = LOG_RATES[-1]


def suitable(task: SlidingTask, step: Fraction) -> Fraction:
    """T_s [s] if it is within twice D_c/(20 V), or else that."""
    suits = task.ranges["critical_slip"][0] / task.rate / int(AGEINGS)
    return step if suits / _SUITABLE <= step <= _SUITABLE * suits else two_digits(suits)


def farthest(
    task: SlidingTask, step: Fraction, around: Around, *, stressed: bool, most: Fraction = Fraction(1)
) -> Reach:
    """How much of a path, lag and rock, a law can be followed along, from where one is easily found.

    Parameters
    ----------
    task : SlidingTask
    step : Fraction
        T_s [s].
    around : Fraction
        As of `designed_sliding`; with a lag or rock.
    stressed : bool
        Whether the stress of the task is given, so that larger bounds of |ln(v/V)| may be needed.
    most : Fraction
        Largest share.
    """
    ageing = task.ranges["critical_slip"][0] / task.rate
    rates = LOG_RATES[::-1] if stressed else LOG_RATES[-1:]
    reached = Reach()
    share = min(most, _EASY * ageing / (around.get("lag", Fraction(0)) + around.get("diffusion", Fraction(0))))
    for _ in range(1 + _NEARER):
        reached = _followed(task, step, around, share, reached, rates)
        if reached.share:
            break
        share /= 2
    farther = list(_FARTHER)
    while 0 < reached.share < most and farther:
        share = min(most, farther[0] * reached.share)
        reached = _followed(task, step, around, share, reached, rates)
        if reached.share < share:
            farther.pop(0)
    if 0 < reached.share < most:  # with room for a proof, whose bounds are larger than their estimate
        return _followed(task, step, around, _ROOM * reached.share, reached, rates)
    return reached


def _followed(
    task: SlidingTask, step: Fraction, around: Around, share: Fraction, before: Reach, rates: tuple[Fraction, ...]
) -> Reach:
    """A law for a share of the path, near the one before, or that one where none is found."""
    for log_rate in rates:
        held, numbers = searched_sliding(
            task, step, log_rate, shortened(around, share), near=before.numbers, enough=_ENOUGH, most=_LAWS
        )
        if held is not None:
            return Reach(share=share, held=held, numbers=numbers, log_rate=log_rate)
    return before


def shortened(around: Around, share: Fraction) -> Around:
    """Share of lag and rock."""
    nearer = around.copy()
    if "lag" in around:
        nearer["lag"] = share * around["lag"]
    if "diffusion" in around:
        nearer["diffusion"] = share * around["diffusion"]
    return nearer


def what_would_do(
    fault: Fault, task: SlidingTask, reach: Reach, around: Around, prove: Prove, *, spread: Fraction
) -> str:
    """For which part of a path, and for which V through all of it, a proof was found; in words, for a `reach` below 1.

    Parameters
    ----------
    fault : Fault
    task : SlidingTask
        Of the fault.
    reach : Reach
    around : Fraction
        As of `designed_sliding`.
    prove : callable
    spread : Fraction
        Of the task.
    """
    if reach.held is None or reach.numbers is None:
        return "none was found with a well that is much nearer either: a smaller spread, stress or noise may do"
    held, proof = reach.held, prove(task, reach.held, reach.log_rate)
    said = [_slower(fault, task, reach, around, prove, spread)]
    if isinstance(proof, SlidingGuarantee):
        path = " and ".join(f"{title} = {float(v):.3g} s" for name, title in PATH.items() if (v := getattr(held, name)))
        said.append(f"at this V for {path} with T_s = {float(held.step):.3g} s{_under(proof)}")
    found = ", and ".join(filter(None, said))
    return f"a proof was found {found}" if found else "a smaller spread, stress or noise may do"


def _slower(fault: Fault, task: SlidingTask, reach: Reach, around: Around, prove: Prove, spread: Fraction) -> str:
    """A task with the same target slip that takes longer, through the whole path; empty where none is proved."""
    time = float(short(_SLOWER * fault.reference.operation_time / float(reach.share), _DIGITS))
    reference = replace(fault.reference, operation_time=time)
    slow = replace(fault, reference=reference, sampling_time=sliding_step(fault.friction, reference))
    asked, step = sliding_task(slow, task.stress, spread), rational(slow.sampling_time)
    held, _ = searched_sliding(asked, step, reach.log_rate, around, near=reach.numbers, enough=_ENOUGH, most=_LAWS)
    proof = None if held is None else prove(asked, held, reach.log_rate)
    if not isinstance(proof, SlidingGuarantee):
        return ""
    return (
        f"with this path for V = {float(asked.rate):.3g} m/s{_under(proof)}: in [task] target_slip = "
        f"'{fault.reference.target_slip:g} m', operation_time = '{time:g} s', sampling_time = '{float(step):g} s'"
        f"{f' (but {beyond})' if (beyond := beyond_rates(fault.friction, float(asked.rate))) else ''}"
    )


def _under(proof: SlidingGuarantee) -> str:
    return f" under a stress of at most {float(proof.task.stress):.3g} Pa (a law designed for it alone may stand more)"
