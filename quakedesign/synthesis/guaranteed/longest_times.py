"""How long a sampling time and a delay may be for a designed loop to have a guarantee."""

from collections.abc import Callable
from fractions import Fraction
from math import sqrt
from typing import Any, Unpack

import numpy as np

from quakedesign.cache import search_once
from quakedesign.certificates.guarantee import Guarantee, NoGuarantee, Task
from quakedesign.certificates.guarantee.held import Around
from quakedesign.synthesis.guaranteed.design import MOST_DELAY, design_held, first_held
from quakedesign.synthesis.guaranteed.families import MEASURED, measured_by
from quakedesign.synthesis.guaranteed.slowly import tightened

Search = Callable[[Fraction, np.ndarray | None], tuple[Guarantee | NoGuarantee, np.ndarray | None]]
Attempt = Callable[[Fraction], Guarantee | NoGuarantee]
_ATTEMPTS = 12
_SHARE = 0.5  # of the time in which the fastest unstable pole grows e-fold, near which the longest T_s was seen
_NEAR = Fraction(1, 16)  # share of the longest time by which the end of the reach is left open


def longest_step(
    task: Task,
    step: Fraction,
    *,
    most: Fraction | None = None,
    measured: str = MEASURED[0],
    **around: Unpack[Around],
) -> Guarantee | None:
    """A guarantee at nearly the longest T_s that has one; None where none is found.

    Parameters
    ----------
    task : Task
    step : Fraction
        T_s of the fault [s], tried first where the fault is stable.
    most : Fraction, optional
        Longest T_s to try [s].
    measured, **around
        As in `design_held`.
    """
    attempt = _attempt(lambda held, near: first_held(task, held, near=near, measured=measured, **around))
    return reached_step(task, step, attempt, most)


def reached_step(task: Task, step: Fraction, attempt: Attempt, most: Fraction | None = None) -> Guarantee | None:
    """The same for any kind of design, an attempt at a T_s [s]."""
    pole = _fastest_pole(task)
    first = Fraction(f"{_SHARE / pole:.3g}") if pole > 0 else step
    return _last(reached(attempt, first if most is None else min(first, most), most=most))


def _fastest_pole(task: Task) -> float:
    """Fastest unstable pole over the box [1/s]; at most 0 for a stable fault."""
    slip, rate = float(task.slip_chord[1]), float(task.rate_chord[0])
    return (sqrt(max(rate**2 + 4 * slip, 0.0)) - rate) / 2 if slip > 0 or rate < 0 else 0.0


def design_at(task: Task, longest: Guarantee, objective: str) -> Guarantee:
    """Design for an objective at T_s and all else of a guarantee, which stays where there is none."""
    held = longest.held
    measured = measured_by(held.law)
    found = design_held(task, held.step, objective=objective, measured=measured, **held.around)
    return found if isinstance(found, Guarantee) else tightened(longest)


def longest_delay(
    task: Task, step: Fraction, *, measured: str = MEASURED[0], **around: Unpack[Around]
) -> Guarantee | None:
    """A guarantee with nearly the longest delay that has one, at most 7 periods; None where none is found."""

    def search(delay: Fraction, near: np.ndarray | None) -> tuple[Guarantee | NoGuarantee, np.ndarray | None]:
        return first_held(task, step, near=near, measured=measured, **(around | {"delay": delay}))

    _, near = search(Fraction(0), None)
    return reached_delay(step, _attempt(search, near), step / 2)


def reached_delay(step: Fraction, attempt: Attempt, first: Fraction) -> Guarantee | None:
    """The same for any kind of design, an attempt at a delay [s], and the one to try first."""
    return _last(reached(attempt, first, most=MOST_DELAY * step))


def reached_again(attempt: Attempt, search: Callable[[Attempt], Guarantee | None], *question: Any) -> Guarantee | None:
    """What a search for the longest time ends with, tried at once where it ended before; each attempt is for itself.

    Parameters
    ----------
    attempt : callable
        What it answers depends on the time [s] and the question alone.
    search : callable
        Of an attempt.
    *question
        Values that say everything, see `quakedesign.cache`.
    """
    made: dict[Fraction, Guarantee | NoGuarantee] = {}

    def once(time: Fraction) -> Guarantee | NoGuarantee:
        if time not in made:
            made[time] = attempt(time)
        return made[time]

    def ended() -> list[str]:
        last = search(once)
        return [str(time) for time, found in made.items() if found is last]

    for time in search_once(ended, "reach", *question):
        if isinstance(found := once(Fraction(time)), Guarantee):
            return found
    return search(once)


def _attempt(search: Search, near: np.ndarray | None = None) -> Attempt:
    """Attempt that begins near a law, then where the one before it was good."""

    def attempt(time: Fraction) -> Guarantee | NoGuarantee:
        nonlocal near
        found, numbers = search(time, near)
        near = numbers if isinstance(found, Guarantee) else near
        return found

    return attempt


def _last(found: tuple[Guarantee, ...]) -> Guarantee | None:
    return found[-1] if found else None


def reached(
    attempt: Attempt, first: Fraction, *, most: Fraction | None = None, attempts: int = _ATTEMPTS
) -> tuple[Guarantee, ...]:
    """Guarantees at growing times: twice the first and so on or half of it, then by bisection.

    It ends without any where half the time brings the small gain too little nearer to 1.

    Parameters
    ----------
    attempt : callable
    first : Fraction
        Time to try first [s].
    most : Fraction, optional
        Longest time to try [s].
    attempts : int
        Number of times at most.
    """
    found: list[Guarantee] = []
    time, good, bad, small_gain = first, None, None, None
    for _ in range(attempts):
        answer = attempt(time)
        if isinstance(answer, Guarantee):
            found.append(answer)
            good = time
        else:
            if good is None and not _nearer(answer.small_gain, small_gain):
                break
            bad, small_gain = time, answer.small_gain
        if good is not None and (good == most or (bad is not None and bad - good <= _NEAR * bad)):
            break
        time = _next(good, bad, most)
    return tuple(found)


def _nearer(now: Fraction | None, before: Fraction | None) -> bool:
    """Whether twice what half the time has brought would bring the small gain below 1, or may: nothing is known."""
    return now is None or before is None or now - 2 * (before - now) < 1


def _next(good: Fraction | None, bad: Fraction | None, most: Fraction | None) -> Fraction:
    """Time to try, in three digits between two others."""
    if good is not None and bad is not None:
        return Fraction(f"{float(good + bad) / 2:.3g}")
    if good is None:
        assert bad is not None
        return bad / 2
    return 2 * good if most is None else min(2 * good, most)
