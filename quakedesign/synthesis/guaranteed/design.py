"""A law with a disturbance estimate for the loop as it runs, chosen by what can be guaranteed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import hypot, inf, log10, sqrt
from typing import Any, Unpack

import numpy as np
from scipy.linalg import LinAlgError
from scipy.optimize import OptimizeResult, minimize

from quakedesign.bounds import UpperBound
from quakedesign.cache import search_once
from quakedesign.certificates.guarantee import Bounds, Guarantee, Held, NoGuarantee, Task, guarantee
from quakedesign.certificates.guarantee.held import Around
from quakedesign.errors import ParameterError, require_known
from quakedesign.fault.checks import require_ordinary
from quakedesign.synthesis.guaranteed.estimate import Estimate, closeness, estimated, slowly_estimated
from quakedesign.synthesis.guaranteed.families import MEASURED, Family, family_of, require_surroundings, why_no_law
from quakedesign.synthesis.guaranteed.poles import own_poles
from quakedesign.synthesis.guaranteed.slowly import best_guarantee
from quakedesign.synthesis.guaranteed.unclocked import unclocked_estimate

OBJECTIVES = ("tracking", "peak")
_EVALUATIONS = 150
_FEW = 45  # evaluations near a law that has a guarantee at another time
_SURE = 0.9  # closeness that is near enough
_NARROW = 1.25  # room of those: more of it costs what is proved of the slip error too
_FEWER = 80  # evaluations where samples follow no clock
_CREEPING = 0.1  # what the slip error over a period counts beside the slip-rate error, so that the loop does not creep
MOST_DELAY = 7  # periods: law and loop then have 20 states, the most of a file
_MOST_GROWTH = 50.0  # logarithm; no law of samples answers that, and predictions far beyond it overflow
_FAILED = 1e6
_HOPELESS = 1.2  # small gain of a whole search after which no other start is tried
_SETTLES = 0.9  # per period of the family, of what a law does by itself while the fault sticks, but for its integral
_WIDE = 0.05  # around a small number, at first
_FAR, _ENOUGH = 3.0, 40  # small gain that a search gives up at after so many evaluations


@dataclass(frozen=True, slots=True)
class Closest:
    """Of a family of laws for one loop that which comes nearest to a guarantee.

    Attributes
    ----------
    closeness : float
        As `closeness` in floats: below 1 where a proof is to be expected, else 1 more than the small gain.
    numbers : numpy.ndarray
        Of the law in its family.
    held : Held
    """

    closeness: float
    numbers: np.ndarray
    held: Held

    @property
    def small_gain(self) -> float:
        """Of errors that are 0, or those that follow from themselves [-]."""
        return self.closeness if self.closeness < 1 else self.closeness - 1


def closest(
    task: Task,
    step: Fraction,
    *,
    near: np.ndarray | None = None,
    measured: str = MEASURED[0],
    **around: Unpack[Around],
) -> Closest | NoGuarantee:
    """The law that comes nearest to a guarantee, or one that is well within it; why there is no law at all.

    The search begins near the numbers of another law, if there is one, else where good laws of the family were seen.
    """
    if around.get("delay", 0) > MOST_DELAY * step:
        return NoGuarantee(reason=f"the delay is longer than {MOST_DELAY} periods", small_gain=None)
    laws = _Laws.of(task, step, measured, around)
    if isinstance(laws, NoGuarantee):
        return laws
    least, x = inf, np.array(laws.family.starts[0])
    starts = sorted(laws.family.starts, key=lambda start: laws.close(np.array(start))[0])
    for start in starts if near is None else (near,):
        least, x = min((least, x), laws.closest(start, _FEW if near is not None else _EVALUATIONS), key=lambda v: v[0])
        if least < _SURE:
            break
    return Closest(least, x, laws.held(x))


def nearby(
    task: Task, step: Fraction, near: np.ndarray, *, measured: str = MEASURED[0], **around: Unpack[Around]
) -> Guarantee | NoGuarantee:
    """Design for the smallest certified slip-rate error, sought near the numbers of a law for another T_s or delay.

    Near the longest of these a law is proved with a slow input gain alone, of which `design_held` knows too late.
    """
    laws = _Laws.of(task, step, measured, around)
    if isinstance(laws, NoGuarantee):
        return laws
    found = best_guarantee(task, laws.held(laws.least_peak_near(near)))
    return found if isinstance(found, Guarantee) else best_guarantee(task, laws.held(near))


def design_held(
    task: Task,
    step: Fraction,
    *,
    objective: str = "tracking",
    room: float | None = None,
    measured: str = MEASURED[0],
    **around: Unpack[Around],
) -> Guarantee | NoGuarantee:
    """Feedback with a disturbance estimate, its two gains and its weight chosen over certified bounds.

    Where the slip alone is measured, a steady-state Kalman observer of slip, slip rate and disturbance, its two gains
    and the sizes of its process noise chosen in the same way.

    ``peak``: the smallest certified slip-rate error. ``tracking``: the smallest slip error under a disturbance that
    drifts, among laws whose certified slip-rate error is at most `room` times the smallest. With a lag, or a layer
    between well and fault, the law carries a model of the path.

    Parameters
    ----------
    task : Task
    step : Fraction
        T_s [s].
    objective : str
    room : float, optional
        What ``tracking`` may spend of the smallest certified slip-rate error [-]; 1.6 unless given, of an observer,
        whose smallest is larger, 1.4, by no clock 1.25.
    measured : str
        One of `MEASURED`; the differentiator is the implicit one of order 2, from rest.
    **around : Fraction
        Delay, lag and L²/D [s], bounds of the noise of slip [m] and slip rate [m/s], as in `Held`; 0 unless given.

    Raises
    ------
    ParameterError
        For another objective or other measurements, or times and noise that are negative or too long.
    """
    delay, lag = around.get("delay", Fraction(0)), around.get("lag", Fraction(0))
    require_known(objective, OBJECTIVES, "objective")
    if step <= 0 or not 0 <= delay <= MOST_DELAY * step or lag < 0:
        raise ParameterError(
            f"a design needs a positive step, a delay of 0 to {MOST_DELAY} steps and a lag of 0 or more. Received "
            f"{float(step):.4g} s, {float(delay):.4g} s, {float(lag):.4g} s. Shorten the delay."
        )
    laws = _Laws.of(task, step, measured, around)
    if isinstance(laws, NoGuarantee):
        return laws
    behind_rock, starts = bool(laws.template.diffusion), laws.family.starts
    least, x = 10 * _FAILED, np.array(starts[0])
    for start in starts:
        least, x = min((least, x), laws.least_peak(start), key=lambda reached: reached[0])
        if behind_rock and _hopeless(least):
            break
    if behind_rock and (none := laws.without_bounds(x)) is not None and _hopeless(least):
        return none  # a proof of that takes a minute
    seen = laws.seen(x)
    if objective == "tracking" and seen is not None and isinstance(seen.bounds, Bounds):
        limit = (room or laws.room) * float(seen.bounds.slip_rate_error)
        _, x = min((laws.least_drift(start, limit) for start in (x, starts[1])), key=lambda reached: reached[0])
    found = best_guarantee(task, laws.held(x))
    noise = {name: v for name, v in laws.template.noise.items() if v}
    if isinstance(found, Guarantee) or not noise:
        return found
    quiet = around | dict.fromkeys(noise, Fraction(0))
    without = design_held(task, step, objective=objective, room=room, measured=measured, **quiet)  # type: ignore[arg-type]
    return found if isinstance(without, NoGuarantee) else _with_noise(without, noise)


def _with_noise(without: Guarantee, noise: Mapping[str, Fraction]) -> Guarantee | NoGuarantee:
    """What a law that is proved without noise comes to with it: no small gain depends on noise."""
    held = replace(without.held, **noise)  # type: ignore[arg-type]
    found = best_guarantee(without.task, held)
    if isinstance(found, Guarantee):
        return found
    anyhow = guarantee(without.task, held)  # with an input gain that may jump, which noise does not move
    why = anyhow.reason if isinstance(anyhow, NoGuarantee) and anyhow.small_gain is None else "nothing is proved"
    units = {"slip_noise": "m", "rate_noise": "m/s"}
    said = " and ".join(f"{name.replace('_', ' ')} of {UpperBound(v):.3g} {units[name]}" for name, v in noise.items())
    return replace(found, reason=f"with {said} {why}; without it a law is proved")


@dataclass(frozen=True)
class _Laws:
    """Laws among which a search chooses for one loop, and what is seen of each."""

    task: Task
    family: Family
    template: Held
    question: tuple[Any, ...]

    @classmethod
    def of(cls, task: Task, step: Fraction, measured: str, around: Around) -> "_Laws | NoGuarantee":
        """Laws for a T_s [s] and what is around them, or why there are none."""
        require_surroundings(around)
        if (none := _unpredictable(task, step)) is not None:
            return none
        if reason := why_no_law(step, measured, around):
            return NoGuarantee(reason=reason, small_gain=None)
        require_known(measured, MEASURED, "measured")
        middle = (step + (around.get("longest_step") or step)) / 2  # for which a law predicts that is told no time
        family = family_of(task, middle, measured, around)
        template = Held(law=family.law(np.array(family.starts[0])), step=step, **around)
        return cls(task, family, template, (task, step, measured, tuple(sorted(around.items()))))

    def held(self, x: np.ndarray) -> Held:
        """The loop of a law."""
        return replace(self.template, law=self.family.law(x))

    def seen(self, x: np.ndarray) -> Estimate | None:
        """What is estimated of a law; None where there is none of these numbers."""
        judged = slowly_estimated if self.template.diffusion and not self.task.friction.rate_slope else estimated
        judged = unclocked_estimate if self.template.longest_step else judged
        try:
            return judged(self.task, self.held(x)) if self.family.admits(x) else None
        except LinAlgError:  # of a Riccati equation
            return None

    def closest(self, start: Sequence[float] | np.ndarray, evaluations: int) -> tuple[float, np.ndarray]:
        """Smallest closeness to a guarantee near a start, and where."""

        def cost(x: np.ndarray) -> float:
            return self.quiet(x, _FAILED * min(self.close(x)[0], 9.0)) / _FAILED

        return _search_once(
            ("closest", *self.question), cost, start, enough=_SURE, evaluations=evaluations, far=1 + _FAR, wide=True
        )

    def least_peak_near(self, start: Sequence[float] | np.ndarray) -> np.ndarray:
        """Where the cost of a peak is smallest near a law that may be proved with a slow input gain alone."""

        def cost(x: np.ndarray) -> float:
            found, bounds = self.close(x)
            peak = _FAILED * min(found, 9.0) if bounds is None else _decibels(bounds, self.family.period)
            return self.quiet(x, peak)

        return _search_once(("near peak", *self.question), cost, start, evaluations=_FEW, wide=True)[1]

    def close(self, x: np.ndarray) -> tuple[float, Bounds | None]:
        try:
            return closeness(self.task, self.held(x)) if self.family.admits(x) else (inf, None)
        except LinAlgError:  # of a Riccati equation
            return inf, None

    def without_bounds(self, x: np.ndarray) -> NoGuarantee | None:
        """Why a law has no bounds; None where it has, or is none."""
        seen = self.seen(x)
        return seen.bounds if seen is not None and isinstance(seen.bounds, NoGuarantee) else None

    def least_peak(self, start: Sequence[float] | np.ndarray, **settings: Any) -> tuple[float, np.ndarray]:
        """Smallest cost of a peak near a start, and where; given up where it stays far from a guarantee.

        Through a layer every evaluation takes a tenth of a second.
        """
        far = _FAR * _FAILED if self.template.diffusion else inf
        settings = self._effort | settings

        def cost(x: np.ndarray) -> float:
            return self.quiet(x, _peak_cost(self.seen(x), self.family.period))

        return _search_once(("peak", *self.question), cost, start, far=far, **settings)

    def least_drift(self, start: Sequence[float] | np.ndarray, limit: float) -> tuple[float, np.ndarray]:
        """Smallest cost of a drift near a start, and where, within a limit of the slip-rate error [m/s]."""

        def cost(x: np.ndarray) -> float:
            return self.quiet(x, _drift_cost(self.seen(x), limit))

        return _search_once(("drift", limit, *self.question), cost, start, **self._effort)

    @property
    def room(self) -> float:
        """What ``tracking`` may spend of the smallest certified slip-rate error, see `design_held`."""
        return _NARROW if self.template.longest_step else self.family.room

    @property
    def _effort(self) -> dict[str, Any]:
        """Evaluations of a search, where one takes a twentieth of a second."""
        return {"evaluations": _FEWER} if self.template.longest_step else {}

    def quiet(self, x: np.ndarray, cost: float) -> float:
        """The cost of a law; that of none where the law, left to itself while the fault sticks, settles too slowly."""
        if cost >= 10 * _FAILED:
            return cost
        slowest = _SETTLES ** float(self.template.step / self.family.period)
        over = float(np.abs(own_poles(self.family.law(x))[1:]).max(initial=0)) / slowest
        return cost if over <= 1 else max(cost, min(over, 9.0) * _FAILED)


def _hopeless(cost: float) -> bool:
    """Whether a whole search ends at a small gain from which nothing was seen to lead to a guarantee."""
    return _HOPELESS * _FAILED < cost < 9 * _FAILED


def _unpredictable(task: Task, step: Fraction) -> NoGuarantee | None:
    """No law of samples, where the errors of the model outgrow within a period what a prediction can hold."""
    require_ordinary(step=step)
    rate, slip = float(task.model.rate), max(float(task.model.slip), 0.0)
    growth = float(step) * (hypot(rate, 2 * sqrt(slip)) - rate) / 2
    if growth <= _MOST_GROWTH:
        return None
    return NoGuarantee(reason=f"errors grow by e^{growth:.3g} within T_s = {float(step):.4g} s", small_gain=None)


def _search_once(
    question: tuple[Any, ...], cost: Callable[[np.ndarray], float], start: Sequence[float] | np.ndarray, **settings: Any
) -> tuple[float, np.ndarray]:
    """What `_search` finds, or has found for a question that says all about the cost, see `quakedesign.cache`."""

    def search() -> list[Any]:
        least, x = _search(cost, start, **settings)
        return [least, x.tolist()]

    least, x = search_once(search, *question, np.array(start).tolist(), sorted(settings.items()))
    return least, np.array(x)


def _search(
    cost: Callable[[np.ndarray], float],
    start: Sequence[float] | np.ndarray,
    *,
    enough: float = -inf,
    evaluations: int = _EVALUATIONS,
    far: float = inf,
    wide: bool = False,
) -> tuple[float, np.ndarray]:
    """Smallest cost found and where; the search ends below `enough`, or after a while still above `far`.

    It begins a twentieth of each number around the start; if `wide`, as far around those that are small.
    """
    least, count = inf, 0

    def counted(x: np.ndarray) -> float:
        nonlocal least, count
        count, found = count + 1, cost(x)
        least = min(least, found)
        return found

    def stop(intermediate_result: OptimizeResult) -> None:
        if intermediate_result.fun < enough or (count >= _ENOUGH and far < least < 9 * _FAILED):
            raise StopIteration

    options: dict[str, Any] = {"maxfev": evaluations, "xatol": 2e-3, "fatol": 1e-3}
    if wide:
        first = np.array(start, dtype=float)
        options["initial_simplex"] = np.vstack([first, first + np.diag(np.maximum(np.abs(first) / 20, _WIDE))])
    found = minimize(counted, np.array(start), method="Nelder-Mead", options=options, callback=stop)
    return float(found.fun), found.x


def _peak_cost(found: Estimate | None, period: Fraction) -> float:
    """Decibels of the slip-rate error; where there is no bound, how far from one."""
    if found is None:
        return 10 * _FAILED
    if isinstance(found.bounds, NoGuarantee):
        return _FAILED * min(float(found.bounds.small_gain or 9), 9.0)
    return _decibels(found.bounds, period)


def _decibels(bounds: Bounds, period: Fraction) -> float:
    return 10 * log10(float(bounds.slip_rate_error) + _CREEPING * float(bounds.slip_error / period))


def _drift_cost(found: Estimate | None, limit: float) -> float:
    if found is None or isinstance(found.bounds, NoGuarantee):
        return 10 * _FAILED
    over = max(0.0, float(found.bounds.slip_rate_error) / limit - 1)
    return 10 * log10(found.drift_gain) + 1000 * over
