"""How long a sampling time and a delay may be for a designed loop to have a guarantee."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from math import sqrt
from typing import Any, Unpack

import numpy as np

from quakedesign.cache import search_once
from quakedesign.certificates.claim import Verdict
from quakedesign.certificates.guarantee import Guarantee, NoGuarantee, Task
from quakedesign.certificates.guarantee.claims import above
from quakedesign.certificates.guarantee.held import Around
from quakedesign.certificates.guarantee.pump import Pump
from quakedesign.synthesis.guaranteed.design import MOST_DELAY, Closest, closest, nearby
from quakedesign.synthesis.guaranteed.families import MEASURED, measured_by
from quakedesign.synthesis.guaranteed.slowly import best_guarantee

Search = Callable[[Fraction, np.ndarray | None], Closest | NoGuarantee]
Attempt = Callable[[Fraction], Guarantee | NoGuarantee]
_ATTEMPTS = 12
_SHARE = 0.5  # of the time in which the fastest unstable pole grows e-fold, near which the longest T_s was seen
_NEAR = Fraction(1, 16)  # share of the longest time by which the end of the reach is left open
_CLOSE = Fraction(1, 16)  # the same where designs are continued
_LOOSE = Fraction(1, 10)  # the same of delays and what else may be 0, each of which takes longer
_BACK = Fraction(39, 40)  # of a time whose law is not proved after all
_EDGE, _AIM = 0.92, 0.985  # small gain that is at the end of the reach, and that which a time is sought for
_POWER = 1.3  # of a time with which the small gain was seen to grow
_LEAST = 0.01  # small gain that is counted with
_FAR = 2.0  # small gain from which a time is halved


RATE = "rate_limit"
LIMITING = (RATE, "delay_jitter", "jitter", "averaging", "delay", "lag", "diffusion")
"""What of a setup may be too much for any design, what is easiest to change first."""
_FEWER = 8  # attempts, each of which begins anew where its first law fails
_ANY_RATE = Fraction(10**30)  # [Pa/s]


@dataclass(frozen=True, slots=True)
class Longest:
    """A guarantee at nearly the longest time that has one, and the numbers of its law."""

    guarantee: Guarantee
    numbers: np.ndarray


def longest_step(task: Task, *, measured: str = MEASURED[0], **around: Unpack[Around]) -> Longest | None:
    """A guarantee at nearly the longest T_s that has one, whatever the T_s of the fault; None where none is found.

    Laws are those that come nearest to a guarantee, each sought near that of the T_s before.

    Parameters
    ----------
    task : Task
    measured, **around
        As in `design_held`.
    """

    def search(step: Fraction, near: np.ndarray | None) -> Closest | NoGuarantee:
        return closest(task, step, near=near, measured=measured, **around)

    path: dict[str, Any] = {**around}
    late = sum(float(path.get(name) or 0) for name in ("delay", "lag", "diffusion"))
    return _farthest(task, search, _first_step(task, late), None)


def reached_step(task: Task, attempt: Attempt, most: Fraction | None = None) -> Guarantee | None:
    """The same for any kind of design, an attempt at a T_s [s]."""
    first = _first_step(task)
    return _last(reached(attempt, first if most is None else min(first, most), most=most))


def _first_step(task: Task, late: float = 0.0) -> Fraction:
    """T_s to begin with [s], where a pressure acts late [s]: of the fastest pole, of a stable fault of its spring."""
    slip, rate = float(task.slip_chord[1]), float(task.rate_chord[0])
    pole = (sqrt(max(rate**2 + 4 * slip, 0.0)) - rate) / 2 if slip > 0 or rate < 0 else 0.0
    pace = pole if pole > 0 else sqrt(abs(slip)) or 1 / float(task.operation_time)
    return Fraction(f"{_SHARE / pace / (1 + pace * late):.3g}")


def continued(
    task: Task, step: Fraction, longest: Longest | None, *, measured: str = MEASURED[0], **around: Unpack[Around]
) -> Guarantee | None:
    """Design for a T_s [s] near one for a longer T_s, where a search at T_s alone found none; None without one."""
    if longest is None or longest.guarantee.held.step < step:
        return None
    found = nearby(task, step, longest.numbers, measured=measured, **around)
    return found if isinstance(found, Guarantee) else None


def design_at(task: Task, longest: Longest) -> Guarantee:
    """Design for a small slip-rate error at T_s and all else of a guarantee, which stays where there is none."""
    held = longest.guarantee.held
    found = nearby(task, held.step, longest.numbers, measured=measured_by(held.law), **held.around)
    return min(
        (longest.guarantee, *([found] if isinstance(found, Guarantee) else [])), key=lambda g: g.claims.slip_rate_error
    )


def longest_delay(
    task: Task, step: Fraction, *, measured: str = MEASURED[0], **around: Unpack[Around]
) -> Guarantee | None:
    """A guarantee with nearly the longest delay that has one, at most 7 periods; None where none is found."""

    def search(delay: Fraction, near: np.ndarray | None) -> Closest | NoGuarantee:
        return closest(task, step, near=near, measured=measured, **(around | {"delay": delay}))

    found = _farthest(task, search, Fraction(0), MOST_DELAY * step, unit=step / 2)
    return None if found is None else found.guarantee


def farthest_rock(
    task: Task, step: Fraction, *, measured: str = MEASURED[0], **around: Unpack[Around]
) -> Guarantee | None:
    """A guarantee through nearly the largest L²/D of rock that has one; None where none is found."""

    def search(time: Fraction, near: np.ndarray | None) -> Closest | NoGuarantee:
        return closest(task, step, near=near, measured=measured, **(around | {"diffusion": time}))

    found = _farthest(task, search, max(_first_step(task), step), None)
    return None if found is None else found.guarantee


def nearest_setup(
    task: Task, step: Fraction, *, measured: str = MEASURED[0], **around: Unpack[Around]
) -> tuple[str, Guarantee] | None:
    """Of a loop without a guarantee: a quantity of its setup, and a guarantee with nearly the most of it that has one.

    It is the first of `LIMITING` without which a design has a guarantee at T_s and with all else as it is; None without
    one. Of a pump it is the rate, with nearly the lowest that will do.
    """
    pump, told = around.get("pump"), measured
    for name in LIMITING:
        rated = name == RATE
        asked: Any = (pump.rate if pump else None) if rated else around.get(name)
        if not asked:
            continue

        def search(value: Fraction, near: np.ndarray | None, name: str = name, rated: bool = rated) -> Any:
            other: Any = {"pump": _ramped(pump, value), "ramp": value} if rated else {name: value}
            return closest(task, step, near=near, measured=told, **(around | other))

        most = step / 2 if rated else asked
        first, unit = Fraction(0), min(asked, step) / 2
        if rated or "jitter" in name:
            unit = min(most, step) / 16
        elif name == "diffusion":
            first, unit = min(max(_first_step(task), step), asked), Fraction(0)
        found = _farthest(task, search, first, most, unit=unit, attempts=_FEWER)
        if found is not None and rated:
            return name, with_lowest_rate(found.guarantee)
        if found is not None:
            return name, found.guarantee
    return None


def _ramped(pump: Pump | None, ramp: Fraction) -> Pump | None:
    """A pump that makes any change within a time [s], or at once."""
    limited = replace(pump or Pump(), rate=_ANY_RATE if ramp else None)
    return None if limited == Pump() else limited


def with_lowest_rate(found: Guarantee) -> Guarantee:
    """The same guarantee of the slowest pump that makes the largest change within the ramp."""
    held, step = found.held, found.claims.largest_step
    if held.pump is None or step is None or not held.ramp:
        return found
    slower = replace(found, held=replace(held, pump=replace(held.pump, rate=above(step / held.ramp))))
    return slower if slower.check() is Verdict.PROVED else found


def _farthest(
    task: Task,
    search: Search,
    first: Fraction,
    most: Fraction | None,
    unit: Fraction = Fraction(0),
    attempts: int = _ATTEMPTS,
) -> Longest | None:
    """A proof at nearly the longest time for which laws come near enough to a guarantee.

    Parameters
    ----------
    search : callable
        Of a time [s] and the numbers of a law for another one.
    first : Fraction
        Time to try first [s].
    most : Fraction, optional
        Longest time to try [s].
    unit : Fraction
        Time to try after 0 [s].
    attempts : int
        Number of times at most.
    """
    good: Closest | None = None
    time, at, bad, before = first, first, None, None
    for _ in range(attempts):
        found = search(time, None if good is None else good.numbers)
        if attempts < _ATTEMPTS and good is not None and bad is None and not _within(found):
            found = search(time, None)
        small = None if isinstance(found, NoGuarantee) else found.small_gain
        if isinstance(found, Closest) and _within(found):
            good, at = found, time
        else:
            if good is None and (not time or not _nearer(small, before)):
                return None
            bad, before = (time, small), small
        open_end = (_LOOSE if unit else _CLOSE) * bad[0] if bad is not None else Fraction(0)
        edge = good is not None and good.closeness > _EDGE and not unit
        if good is not None and (at == most or edge or (bad is not None and bad[0] - at <= open_end)):
            break
        time = _time_between(good, at, bad, most, unit)
    return None if good is None else _proved_near(task, search, good, at)


def _within(found: Closest | NoGuarantee) -> bool:
    return isinstance(found, Closest) and found.closeness < 1


def _proved_near(task: Task, search: Search, good: Closest, time: Fraction) -> Longest | None:
    """A proof at a time or a little below."""
    for _ in range(_ATTEMPTS):
        found = best_guarantee(task, good.held)
        if isinstance(found, Guarantee):
            return Longest(found, good.numbers)
        time = Fraction(f"{float(time * _BACK):.3g}")
        nearer = search(time, good.numbers)
        if isinstance(nearer, Closest):
            good = nearer
    return None


def _time_between(
    good: Closest | None, at: Fraction, bad: tuple[Fraction, float | None] | None, most: Fraction | None, unit: Fraction
) -> Fraction:
    """Time to try next [s], in three digits: where the small gain, drawn straight, is that of the end of the reach."""
    if good is None:
        assert bad is not None
        time, small = bad
        return time / 2 if small is None or small > _FAR else Fraction(f"{0.9 * float(time) / max(small, 1.0):.3g}")
    if bad is None:
        grown = 2.0 if unit else min((_AIM / max(good.small_gain, _LEAST)) ** (1 / _POWER), 2.0)
        ahead = float(at) * grown if at else float(unit)
        time = Fraction(f"{ahead:.3g}")
        return time if most is None else min(time, most)
    width, share = float(bad[0] - at), 0.5
    if bad[1] is not None and bad[1] > max(1.0, good.small_gain):
        share = min(max((_AIM - good.small_gain) / (bad[1] - good.small_gain), 0.2), 0.8)
    return Fraction(f"{float(at) + share * width:.3g}")


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


def _nearer(now: Fraction | float | None, before: Fraction | float | None) -> bool:
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
