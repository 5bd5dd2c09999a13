"""Search for linear sampled laws with the best guaranteed bounds.

Chapters: guarantees with a slowly varying input gain; design of a law with a disturbance estimate; longest sampling
period, delay and diffusion time that have a guarantee; certified peaks of an e-LQR in continuous time.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import hypot, inf, log, log10, sqrt
from typing import Any, overload

import numpy as np
from scipy.linalg import LinAlgError
from scipy.optimize import OptimizeResult, minimize

from quakedesign.cache import search_once
from quakedesign.errors import ParameterError, UnknownNameError, require_known
from quakedesign.exact import UpperBound
from quakedesign.fault import Fault
from quakedesign.fault.model import require_ordinary
from quakedesign.files import Json
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.exact.sampled_loop import PLAIN, ExactSetup, SampledLoop
from quakedesign.guarantees.exact.small_gain import Bounds, VaryingGain
from quakedesign.guarantees.exact.tracking_proof import (
    ContinuousProof,
    TrackingProof,
    above,
    continuous_peaks,
    guarantee,
)
from quakedesign.guarantees.search.aperiodic_search import aperiodic_guarantee, unclocked_estimate
from quakedesign.guarantees.search.float_bounds import (
    PARTS,
    BoundsEstimate,
    distance,
    distance_of_bounds,
    estimated,
    own_poles,
    short,
    spectral_radius,
    varying_gain_estimate,
)
from quakedesign.guarantees.search.lqg import LawFamily, family_of, measured_by, require_setup, why_no_law
from quakedesign.laws.elqr import ExtendedLQR
from quakedesign.loop import PeriodicLoop, exact_integrals
from quakedesign.loop.loop_setup import MEASURED, Pump, require_step
from quakedesign.lyapunov.exact.claim import Verdict
from quakedesign.plant.fault_plant import FaultPlant
from quakedesign.plant.of_fault import uncertain_plant

# ----------------------------------------------------------------------
# Guarantees with a slowly varying input gain, for friction that depends on the slip alone.

_SHARE = 0.5  # growth α as a share of the slowest decay rate


def best_guarantee(task: FaultPlant, sampled_loop: SampledLoop) -> TrackingProof | NoProof:
    """Guarantee with a slowly varying input gain if that helps, else with an arbitrary one.

    With aperiodic sampling the guarantee uses an invariant set.
    """
    if sampled_loop.longest_step:
        return aperiodic_guarantee(task, sampled_loop)
    slow = varying_gain(task, sampled_loop)
    proof = guarantee(task, sampled_loop) if slow is None else guarantee(task, sampled_loop, slow)
    if slow is None or proof.available:
        return proof
    arbitrary = guarantee(task, sampled_loop)
    # a pressure violation is easier to remedy than a small gain above 1, so it is the reason reported
    return arbitrary if arbitrary.available or arbitrary.only_pressure_fails else proof


@overload
def with_varying_gain(proof: TrackingProof) -> TrackingProof: ...
@overload
def with_varying_gain(proof: TrackingProof | NoProof) -> TrackingProof | NoProof: ...
def with_varying_gain(proof: TrackingProof | NoProof) -> TrackingProof | NoProof:
    """Guarantee with a slowly varying input gain in place of one with an arbitrary gain, if one is found."""
    if not proof.available or proof.varying_gain is not None or proof.invariant_set is not None:
        return proof
    better = best_guarantee(proof.task, proof.sampled_loop)
    return better if better.available else proof


def varying_gain(task: FaultPlant, sampled_loop: SampledLoop) -> VaryingGain | None:
    """Parts and growth of a slowly varying input gain; None where the theorem excludes one.

    Friction must not depend on the slip rate, and all nominal loops must be stable.
    """
    if task.friction.rate_slope:
        return None
    decay = min(_decay(sampled_loop.loop(task, model)) for model in PARTS.models(task))
    return replace(PARTS, growth=short(_SHARE * decay, 2)) if decay > 0 else None


def _decay(loop: PeriodicLoop) -> float:
    """Decay rate of the slowest mode [1/s]."""
    return -log(max(spectral_radius(loop), 1e-12)) / float(loop.period)


# ----------------------------------------------------------------------
# Design of a sampled law with a disturbance estimate by its guaranteed bounds.

OBJECTIVES = ("tracking", "peak")
_EVALUATIONS = 150
_FEW = 45  # evaluations near a law that has a guarantee at another T_s or delay
_SURE = 0.9  # distance that is sufficient
_NARROW = 1.25  # `allowance` with aperiodic sampling: a larger one increases the bound of the slip error too
_FEWER = 80  # evaluations with aperiodic sampling
_CREEPING = 0.1  # weight of slip error per period over that of slip-rate error, to avoid slow convergence
MOST_DELAY = 7  # periods: law and loop then have 20 states, the most that a file may have
_MOST_GROWTH = 50.0  # logarithm of growth per period that no sampled law stabilises; far above it predictions overflow
_FAILED = 1e6
_TOO_FAR = 1.2  # diffusion path: no other start is tried above this final small gain
_SETTLES = 0.9  # largest decay factor per period of the law's poles, fault at rest, except the integral's
_WIDE = 0.05  # initial range around a small number
_FAR, _ENOUGH = 3.0, 40  # a search stops if the small gain is still above _FAR after _ENOUGH evaluations


@dataclass(frozen=True, slots=True)
class Closest:
    """The law of a family that comes nearest to a guarantee of one loop.

    Attributes
    ----------
    distance : float
        Distance from a guarantee in floats: small gain (below 1) if a proof is expected, else 1 plus the small gain.
    numbers : numpy.ndarray
        Parameters of the law in its family.
    sampled_loop : SampledLoop
    """

    distance: float
    numbers: np.ndarray
    sampled_loop: SampledLoop

    @property
    def small_gain(self) -> float:
        """Small gain at zero errors, or at the fixed point of the errors [-]."""
        return self.distance if self.distance < 1 else self.distance - 1


def closest(
    task: FaultPlant,
    step: Fraction,
    *,
    near: np.ndarray | None = None,
    measured: str = MEASURED[0],
    setup: ExactSetup = PLAIN,
) -> Closest | NoProof:
    """Law closest to a guarantee, or `NoProof` if there is no law; the search stops at a distance below 0.9.

    The search begins near the parameters of another law if given, else near those of good laws of the family.
    """
    if setup.delay > MOST_DELAY * step:
        return NoProof(reason=f"the delay is longer than {MOST_DELAY} periods")
    laws = _Laws.of(task, step, measured, setup)
    if isinstance(laws, NoProof):
        return laws
    least, x = inf, np.array(laws.family.starts[0])
    starts = sorted(laws.family.starts, key=lambda start: laws.close(np.array(start))[0])
    for start in starts if near is None else (near,):
        least, x = min((least, x), laws.closest(start, _FEW if near is not None else _EVALUATIONS), key=lambda v: v[0])
        if least < _SURE:
            break
    return Closest(least, x, laws.sampled_loop(x))


def nearby(
    task: FaultPlant, step: Fraction, near: np.ndarray, *, measured: str = MEASURED[0], setup: ExactSetup = PLAIN
) -> TrackingProof | NoProof:
    """Design for the least certified slip-rate error near the parameters of another law.

    Near the longest T_s or delay only proofs with a slowly varying input gain succeed; this search optimises for them.
    """
    laws = _Laws.of(task, step, measured, setup)
    if isinstance(laws, NoProof):
        return laws
    proof = best_guarantee(task, laws.sampled_loop(laws.least_peak_near(near)))
    return proof if proof.available else best_guarantee(task, laws.sampled_loop(near))


def design_sampled_law(
    task: FaultPlant,
    step: Fraction,
    *,
    objective: str = "tracking",
    allowance: float | None = None,
    measured: str = MEASURED[0],
    setup: ExactSetup = PLAIN,
) -> TrackingProof | NoProof:
    """Feedback with a disturbance estimate; gains and weight minimise estimated bounds, which are then proved.

    If the slip alone is measured, the law has a steady-state Kalman observer of slip, slip rate and disturbance; its
    gains and process noise are chosen in the same way.

    ``peak``: the smallest estimated bound of slip-rate error + 0.1·slip error/T_s. ``tracking``: the smallest slip
    error under a drifting disturbance, among laws whose estimated slip-rate error is at most `allowance` times that of
    ``peak``. With a lag or a diffusion path the law contains a model of the path.

    Parameters
    ----------
    task : FaultPlant
    step : Fraction
        T_s [s].
    objective : str
    allowance : float, optional
        Largest slip-rate error of ``tracking``, relative to the smallest certified one [-]. Default 1.6; with an
        observer, whose smallest error is larger, 1.4; with aperiodic sampling 1.25.
    measured : str
        One of `MEASURED`; the differentiator is implicit, of order 2, and starts from zero.
    setup : ExactSetup
        Delay, lag and L²/D [s], bounds of the noise of slip [m] and slip rate [m/s]; 0 unless given.

    Raises
    ------
    ParameterError
        For an unknown objective or measurement, negative noise, or a time that is negative or too long.
    """
    delay, lag = setup.delay, setup.lag
    require_known(objective, OBJECTIVES, "objective")
    if step <= 0 or not 0 <= delay <= MOST_DELAY * step or lag < 0:
        raise ParameterError(
            f"step must be positive, delay 0 to {MOST_DELAY} steps, and lag 0 or more. Received the step "
            f"{float(step):.4g} s, the delay {float(delay):.4g} s and the lag {float(lag):.4g} s. Correct these times."
        )
    laws = _Laws.of(task, step, measured, setup)
    if isinstance(laws, NoProof):
        return laws
    behind_path, starts = bool(laws.template.diffusion), laws.family.starts
    least, x = 10 * _FAILED, np.array(starts[0])
    for start in starts:
        least, x = min((least, x), laws.least_peak(start), key=lambda reached: reached[0])
        if behind_path and _far_from_proof(least):
            break
    if behind_path and (none := laws.without_bounds(x)) is not None and _far_from_proof(least):
        return none  # such a proof takes a minute
    seen = laws.seen(x)
    if objective == "tracking" and seen is not None and seen.bounds.available:
        limit = (allowance or laws.allowance) * float(seen.bounds.slip_rate_error)
        _, x = min((laws.least_drift(start, limit) for start in (x, starts[1])), key=lambda reached: reached[0])
    proof = best_guarantee(task, laws.sampled_loop(x))
    if not proof.available and seen is not None and seen.bounds.available and proof.only_pressure_fails:
        leaner = best_guarantee(task, laws.sampled_loop(laws.least_pressure(x)[1]))
        proof = leaner if leaner.available else proof
    noise = {name: v for name, v in laws.template.noise.items() if v}
    if proof.available or not noise:
        return proof
    quiet = replace(setup, slip_noise=Fraction(0), rate_noise=Fraction(0))
    without = design_sampled_law(task, step, objective=objective, allowance=allowance, measured=measured, setup=quiet)
    return proof if not without.available else _with_noise(without, noise)


def _with_noise(without: TrackingProof, noise: Mapping[str, Fraction]) -> TrackingProof | NoProof:
    """Guarantee, with noise, for a law that is proved without noise."""
    sampled_loop = replace(without.sampled_loop, **noise)  # type: ignore[arg-type]
    proof = best_guarantee(without.task, sampled_loop)
    if proof.available:
        return proof
    arbitrary = guarantee(without.task, sampled_loop)  # arbitrary input gain: its small gain does not depend on noise
    why = arbitrary.reason if not arbitrary.available and arbitrary.small_gain is None else "no bounds are proved"
    units = {"slip_noise": "m", "rate_noise": "m/s"}
    noises = " and ".join(f"{name.replace('_', ' ')} of {UpperBound(v):.3g} {units[name]}" for name, v in noise.items())
    return replace(proof, reason=f"with {noises}: {why}; without noise a law is proved")


@dataclass(frozen=True)
class _Laws:
    """Candidate laws of a search for one loop, with their estimates."""

    task: FaultPlant
    family: LawFamily
    template: SampledLoop
    problem: tuple[Any, ...]

    @classmethod
    def of(cls, task: FaultPlant, step: Fraction, measured: str, setup: ExactSetup) -> "_Laws | NoProof":
        """Laws for a T_s [s] and a loop setup, or the reason why there are none."""
        require_setup(setup)
        require_step(step)
        if (none := unpredictable(task, step)) is not None:
            return none
        if reason := why_no_law(step, measured, setup):
            return NoProof(reason=reason)
        require_known(measured, MEASURED, "measured")
        # the law cannot measure the interval; it predicts over the mean one
        middle = (step + (setup.longest_step or step)) / 2
        family = family_of(task, middle, measured, setup)
        template = setup.with_law(family.law(np.array(family.starts[0])), step)
        return cls(task, family, template, (task, step, measured, setup))

    def sampled_loop(self, x: np.ndarray) -> SampledLoop:
        """The loop of a law."""
        return replace(self.template, law=self.family.law(x))

    def seen(self, x: np.ndarray) -> BoundsEstimate | None:
        """Estimate of the law with these parameters; None if they give no law."""
        judged = varying_gain_estimate if self.template.diffusion and not self.task.friction.rate_slope else estimated
        judged = unclocked_estimate if self.template.longest_step else judged
        try:
            return judged(self.task, self.sampled_loop(x)) if self.family.admits(x) else None
        except LinAlgError:  # of a Riccati equation
            return None

    def closest(self, start: Sequence[float] | np.ndarray, evaluations: int) -> tuple[float, np.ndarray]:
        """Smallest distance from a guarantee near a start, with the parameters of the law."""

        def cost(x: np.ndarray) -> float:
            return self.penalised(x, _FAILED * min(self.close(x)[0], 9.0)) / _FAILED

        return search_near(
            ("closest", *self.problem), cost, start, enough=_SURE, evaluations=evaluations, far=1 + _FAR, wide=True
        )

    def least_peak_near(self, start: Sequence[float] | np.ndarray) -> np.ndarray:
        """Parameters with the smallest peak near a law that needs a slowly varying input gain."""

        def cost(x: np.ndarray) -> float:
            distance, bounds = self.close(x)
            peak = _FAILED * min(distance, 9.0) if bounds is None else _decibels(bounds, self.family.period)
            return self.penalised(x, peak)

        return search_near(("near peak", *self.problem), cost, start, evaluations=_FEW, wide=True)[1]

    def close(self, x: np.ndarray) -> tuple[float, Bounds | None]:
        """Distance from a guarantee; bounds if a proof is expected."""
        if self.template.longest_step:
            seen = self.seen(x)
            return (inf, None) if seen is None else distance_of_bounds(seen.bounds)
        try:
            return distance(self.task, self.sampled_loop(x)) if self.family.admits(x) else (inf, None)
        except LinAlgError:  # of a Riccati equation
            return inf, None

    def without_bounds(self, x: np.ndarray) -> NoProof | None:
        """Reason why a law has no bounds; None if it has bounds or does not exist."""
        seen = self.seen(x)
        return seen.bounds if seen is not None and not seen.bounds.available else None

    def least_peak(self, start: Sequence[float] | np.ndarray, **settings: Any) -> tuple[float, np.ndarray]:
        """Smallest peak cost near a start, with its numbers.

        With a diffusion path, where an evaluation takes 0.1 s, the search ends early if it is far from a guarantee.
        """
        far = _FAR * _FAILED if self.template.diffusion else inf
        settings = self._effort | settings

        def cost(x: np.ndarray) -> float:
            return self.penalised(x, _peak_cost(self.seen(x), self.family.period))

        return search_near(("peak", *self.problem), cost, start, far=far, **settings)

    def least_pressure(self, start: Sequence[float] | np.ndarray) -> tuple[float, np.ndarray]:
        """Smallest estimated change of the pressure near a start, in decibels, with its parameters."""

        def cost(x: np.ndarray) -> float:
            seen = self.seen(x)
            if seen is None or not seen.bounds.available:
                return 10 * _FAILED
            most = seen.bounds.push if seen.bounds.valve_push is None else seen.bounds.valve_push
            return self.penalised(x, 10 * log10(float(most)))

        return search_near(("pressure", *self.problem), cost, start, **self._effort)

    def least_drift(self, start: Sequence[float] | np.ndarray, limit: float) -> tuple[float, np.ndarray]:
        """Smallest drift cost near a start, for a bounded slip-rate error [m/s]."""

        def cost(x: np.ndarray) -> float:
            return self.penalised(x, _drift_cost(self.seen(x), limit))

        return search_near(("drift", limit, *self.problem), cost, start, **self._effort)

    @property
    def allowance(self) -> float:
        """Largest slip-rate error of ``tracking`` over the smallest certified one, see `design_sampled_law`."""
        return _NARROW if self.template.longest_step else self.family.allowance

    @property
    def _effort(self) -> Json:
        """Number of evaluations (0.05 s each) with aperiodic sampling; empty, for the default, otherwise."""
        return {"evaluations": _FEWER} if self.template.longest_step else {}

    def penalised(self, x: np.ndarray, cost: float) -> float:
        """Cost of a law, with a penalty if the law settles too slowly while the fault is at rest."""
        if cost >= 10 * _FAILED:
            return cost
        slowest = _SETTLES ** float(self.template.step / self.family.period)
        over = float(np.abs(own_poles(self.family.law(x))[1:]).max(initial=0)) / slowest
        return cost if over <= 1 else max(cost, min(over, 9.0) * _FAILED)


def _far_from_proof(cost: float) -> bool:
    """Whether the small gain at the end of a search is too large for a guarantee."""
    return _TOO_FAR * _FAILED < cost < 9 * _FAILED


def unpredictable(task: FaultPlant, step: Fraction) -> NoProof | None:
    """`NoProof` if the errors grow too much within a period for any sampled law; else None."""
    require_ordinary(step=step)
    rate, slip = float(task.model.rate), max(float(task.model.slip), 0.0)
    growth = float(step) * (hypot(rate, 2 * sqrt(slip)) - rate) / 2
    if growth <= _MOST_GROWTH:
        return None
    return NoProof(reason=f"errors grow by a factor of e^{growth:.3g} within T_s = {float(step):.4g} s")


def search_near(
    problem: tuple[Any, ...], cost: Callable[[np.ndarray], float], start: Sequence[float] | np.ndarray, **settings: Any
) -> tuple[float, np.ndarray]:
    """Result of `_search`, cached by a key that determines the cost; see `quakedesign.cache`."""

    def search() -> list[Any]:
        least, x = _search(cost, start, **settings)
        return [least, x.tolist()]

    least, x = search_once(search, *problem, np.array(start).tolist(), sorted(settings.items()))
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
    """Smallest cost and its parameters; stops at a cost below `enough`, or early if it stays above `far`.

    Each side of the initial simplex is 1/20 of its parameter; with `wide` it is at least `_WIDE`.
    """
    least, count = inf, 0

    def counted(x: np.ndarray) -> float:
        nonlocal least, count
        count, value = count + 1, cost(x)
        least = min(least, value)
        return value

    def stop(intermediate_result: OptimizeResult) -> None:
        if intermediate_result.fun < enough or (count >= _ENOUGH and far < least < 9 * _FAILED):
            raise StopIteration

    options: dict[str, Any] = {"maxfev": evaluations, "xatol": 2e-3, "fatol": 1e-3}
    if wide:
        first = np.array(start, dtype=float)
        options["initial_simplex"] = np.vstack([first, first + np.diag(np.maximum(np.abs(first) / 20, _WIDE))])
    minimum = minimize(counted, np.array(start), method="Nelder-Mead", options=options, callback=stop)
    return float(minimum.fun), minimum.x


def _peak_cost(estimate: BoundsEstimate | None, period: Fraction) -> float:
    """Peak cost [dB] of slip-rate error + 0.1·slip error/period; without bounds, a penalty by the small gain."""
    if estimate is None:
        return 10 * _FAILED
    if not estimate.bounds.available:
        return _FAILED * min(float(estimate.bounds.small_gain or 9), 9.0)
    return _decibels(estimate.bounds, period)


def _decibels(bounds: Bounds, period: Fraction) -> float:
    return 10 * log10(float(bounds.slip_rate_error) + _CREEPING * float(bounds.slip_error / period))


def _drift_cost(estimate: BoundsEstimate | None, limit: float) -> float:
    if estimate is None or not estimate.bounds.available:
        return 10 * _FAILED
    over = max(0.0, float(estimate.bounds.slip_rate_error) / limit - 1)
    return 10 * log10(estimate.drift_gain) + 1000 * over


# ----------------------------------------------------------------------
# Longest sampling time, delay and diffusion time for which a designed loop has a guarantee.

Attempt = Callable[[Fraction], TrackingProof | NoProof]
_ATTEMPTS = 12
_NEAR = Fraction(1, 16)  # relative width of the final bracket of the longest time
_CLOSE = Fraction(1, 16)  # the same where each search starts from the last law found
_LOOSE = Fraction(1, 10)  # the same for delays and other quantities that may be 0, whose designs take longer
_BACK = Fraction(39, 40)  # factor applied to a time whose law could not be proved
_EDGE, _AIM = 0.92, 0.985  # small gain accepted as the end of the range, and target of the search for a time
_POWER = 1.3  # observed exponent of the small gain as a function of the time
_LEAST = 0.01  # least small gain in an extrapolation
_LONGEST_TIMES_FAR = 2.0  # small gain above which a time is halved


RATE, SATURATION, LONGEST, BOX, AMPLITUDE = "rate_limit", "saturation", "longest_step", "box", "amplitude"
LIMITING = (RATE, LONGEST, "delay_jitter", "jitter", "averaging", "delay", "lag", "diffusion", BOX)
"""Quantities that may prevent any design, those easiest to change first; pressures are checked before them."""
_LONGEST_TIMES_FEWER = 8  # attempts, each with a second start where the first fails
_ANY_RATE = Fraction(10**30)  # [Pa/s]


@dataclass(frozen=True, slots=True)
class Longest:
    """A guarantee at nearly the longest feasible time, and the parameters of its law."""

    guarantee: TrackingProof
    numbers: np.ndarray


DesignProblem = tuple[FaultPlant, Fraction, ExactSetup]
"""Task, T_s [s] and loop setup of a design."""


class LawSearch(ABC):
    """A family of laws for a search for the largest feasible value of a quantity."""

    @abstractmethod
    def closest(self, task: FaultPlant, step: Fraction, near: np.ndarray | None, setup: ExactSetup = PLAIN) -> Any:
        """`Closest` to a guarantee, or `NoProof`; `near` gives the parameters of another law."""

    @abstractmethod
    def proved(self, task: FaultPlant, candidate: Closest) -> TrackingProof | NoProof:
        """Proof about a law that is close enough to a guarantee."""

    @abstractmethod
    def low_pressure_loop(self, task: FaultPlant, step: Fraction, setup: ExactSetup = PLAIN) -> SampledLoop | None:
        """Loop of a law with small pressure changes; None without a law."""


@dataclass(frozen=True, slots=True)
class LinearLawSearch(LawSearch):
    """Linear laws with a disturbance estimate from the measurements."""

    measured: str = MEASURED[0]

    def closest(self, task: FaultPlant, step: Fraction, near: np.ndarray | None, setup: ExactSetup = PLAIN) -> Any:
        """Closest law by a search over the parameters of the family."""
        return closest(task, step, near=near, measured=self.measured, setup=setup)

    def proved(self, task: FaultPlant, candidate: Closest) -> TrackingProof | NoProof:
        """Proof with a slowly varying input gain if that helps."""
        return best_guarantee(task, candidate.sampled_loop)

    def low_pressure_loop(self, task: FaultPlant, step: Fraction, setup: ExactSetup = PLAIN) -> SampledLoop | None:
        """Loop of the law with the smallest pressure change, searched near the law with the smallest peak."""
        laws = _Laws.of(task, step, self.measured, setup)
        if isinstance(laws, NoProof):
            return None
        peak = min((laws.least_peak(start) for start in laws.family.starts), key=lambda reached: reached[0])[1]
        return laws.sampled_loop(laws.least_pressure(peak)[1])


def longest_step(
    task: FaultPlant, *, measured: str = MEASURED[0], kind: LawSearch | None = None, setup: ExactSetup = PLAIN
) -> Longest | None:
    """Guarantee at nearly the longest T_s that has one; None if the search fails.

    The law at each T_s is that nearest to a guarantee; its search starts from the law at the previous T_s.

    Parameters
    ----------
    task : FaultPlant
    measured, setup
        As in `design_sampled_law`.
    kind : LawSearch, optional
        Family of laws; linear unless given.
    """
    late = sum(map(float, setup.path.values()))
    return _farthest(kind or LinearLawSearch(measured), lambda step: (task, step, setup), _first_step(task, late), None)


def _first_step(task: FaultPlant, late: float = 0.0) -> Fraction:
    """First T_s [s] of a search, from the fastest pole or the spring, for a pressure delay [s]."""
    slip, rate = float(task.slip_chord[1]), float(task.rate_chord[0])
    pole = (sqrt(max(rate**2 + 4 * slip, 0.0)) - rate) / 2 if slip > 0 or rate < 0 else 0.0
    pace = pole if pole > 0 else sqrt(abs(slip)) or 1 / float(task.operation_time)
    return Fraction(f"{_SHARE / pace / (1 + pace * late):.3g}")


def design_near_longer_step(
    task: FaultPlant, step: Fraction, longest: Longest | None, *, measured: str = MEASURED[0], setup: ExactSetup = PLAIN
) -> TrackingProof | None:
    """Design at T_s by a search near the law for a longer T_s; for a failed direct design. None without a proof."""
    if longest is None or longest.guarantee.sampled_loop.step < step:
        return None
    proof = nearby(task, step, longest.numbers, measured=measured, setup=setup)
    return proof if proof.available else None


def design_at(task: FaultPlant, longest: Longest) -> TrackingProof:
    """Design for a small slip-rate error at the T_s and setup of a guarantee."""
    sampled_loop = longest.guarantee.sampled_loop
    proof = nearby(
        task, sampled_loop.step, longest.numbers, measured=measured_by(sampled_loop.law), setup=sampled_loop.setup
    )
    return min((longest.guarantee, *([proof] if proof.available else [])), key=lambda g: g.claims.slip_rate_error)


def longest_delay(
    task: FaultPlant,
    step: Fraction,
    *,
    measured: str = MEASURED[0],
    kind: LawSearch | None = None,
    setup: ExactSetup = PLAIN,
) -> TrackingProof | None:
    """Guarantee with nearly the longest delay, at most 7 periods; None if the search fails."""

    def problem_with(delay: Fraction) -> DesignProblem:
        return task, step, replace(setup, delay=delay)

    longest = _farthest(kind or LinearLawSearch(measured), problem_with, Fraction(0), MOST_DELAY * step, unit=step / 2)
    return None if longest is None else longest.guarantee


def longest_diffusion_time(
    task: FaultPlant, step: Fraction, *, measured: str = MEASURED[0], setup: ExactSetup = PLAIN
) -> TrackingProof | None:
    """Guarantee with nearly the largest L²/D of a diffusion path; None if the search fails."""

    def problem_with(time: Fraction) -> DesignProblem:
        return task, step, replace(setup, diffusion=time)

    farthest = _farthest(LinearLawSearch(measured), problem_with, max(_first_step(task), step), None)
    return None if farthest is None else farthest.guarantee


def nearest_setup(
    task: FaultPlant,
    step: Fraction,
    *,
    measured: str = MEASURED[0],
    kind: LawSearch | None = None,
    pressed: bool = False,
    setup: ExactSetup = PLAIN,
) -> tuple[str, TrackingProof] | None:
    """The quantity of the setup that prevents a guarantee, and a guarantee for nearly its largest possible value.

    If `pressed`, the pressure condition failed (pump limit or opening of the fault). The quantity is then the pressure
    range of the pump, with limits that suffice for a design, or else the largest admissible disturbance. Otherwise it
    is the first quantity of `LIMITING` without which a design has a guarantee at T_s; None if there is none. For a pump
    rate the value is nearly the lowest sufficient one, for the box a factor of all half-widths.
    """
    laws = kind or LinearLawSearch(measured)
    if pressed and (less := _less_pressed(laws, task, step, setup)) is not None:
        return less
    pump = setup.pump
    for name in LIMITING:
        limit: Any = getattr(setup, name, None)
        if name in (RATE, BOX, LONGEST):
            limit = {RATE: pump and pump.rate, BOX: Fraction(any(task.spreads)), LONGEST: _slack(step, setup)}[name]
        if not limit:
            continue

        def problem_with(value: Fraction, name: str = name) -> DesignProblem:
            other: Any = {name: value}
            if name == BOX:
                return replace(task, spreads=_narrowed(task, value)), step, setup
            if name == RATE:
                other = {"pump": _ramped(pump, value), "ramp": value}
            elif name == LONGEST:
                other = {LONGEST: step + value}
            return task, step, replace(setup, **other)

        most = step / 2 if name == RATE else limit
        first, unit = Fraction(0), min(limit, step) / 2
        if name == RATE or "jitter" in name:
            unit = min(most, step) / 16
        elif name == "diffusion":
            first, unit = min(max(_first_step(task), step), limit), Fraction(0)
        elif name == LONGEST:
            first, unit = limit / 2, Fraction(0)
        elif name == BOX:
            unit = Fraction(1, 2)
        nearest = _farthest(laws, problem_with, first, most, unit=unit, attempts=_LONGEST_TIMES_FEWER)
        if nearest is not None:
            return name, with_lowest_rate(nearest.guarantee) if name == RATE else nearest.guarantee
    return None


def _slack(step: Fraction, setup: ExactSetup) -> Fraction:
    """Longest sampling interval minus T_s [s]."""
    return max(setup.longest_step - step, Fraction(0))


def _narrowed(task: FaultPlant, share: Fraction) -> tuple[Fraction, Fraction, Fraction]:
    """Half-widths of a box scaled by a factor."""
    first, second, third = (share * width for width in task.spreads)
    return first, second, third


def _less_pressed(
    laws: LawSearch, task: FaultPlant, step: Fraction, setup: ExactSetup
) -> tuple[str, TrackingProof] | None:
    """Narrowest pump limits, or largest disturbance, for which a low-pressure law is proved."""
    pump, sampled_loop = setup.pump, laws.low_pressure_loop(task, step, setup=setup)
    if sampled_loop is None:
        return None
    if pump is not None and pump.limits is not None:
        proof = best_guarantee(task, replace(sampled_loop, pump=_unlimited(pump)))
        if proof.available:
            low, high = map(Fraction, proof.claims.pressures[-1])
            wider = replace(pump, least=min(pump.limits[0], low), largest=max(pump.limits[1], high))
            return SATURATION, replace(proof, sampled_loop=replace(proof.sampled_loop, pump=wider))

    def attempt(amplitude: Fraction) -> TrackingProof | NoProof:
        return best_guarantee(replace(task, amplitude=amplitude), sampled_loop)

    if not task.amplitude:
        return None
    less = reached(attempt, task.amplitude / 2, most=task.amplitude, attempts=_LONGEST_TIMES_FEWER)
    return (AMPLITUDE, less[-1]) if less else None


def _unlimited(pump: Pump) -> Pump | None:
    """The same pump without pressure limits."""
    return None if pump.rate is None else replace(pump, least=None, largest=None)


def _ramped(pump: Pump | None, ramp: Fraction) -> Pump | None:
    """Pump that makes any change within a time [s], or instantaneously."""
    limited = replace(pump or Pump(), rate=_ANY_RATE if ramp else None)
    return None if limited == Pump() else limited


def with_lowest_rate(proof: TrackingProof) -> TrackingProof:
    """The same guarantee for the slowest pump that makes the largest change within the ramp."""
    sampled_loop, step = proof.sampled_loop, proof.claims.largest_step
    if sampled_loop.pump is None or step is None or not sampled_loop.ramp:
        return proof
    slower = replace(
        proof, sampled_loop=replace(sampled_loop, pump=replace(sampled_loop.pump, rate=above(step / sampled_loop.ramp)))
    )
    return slower if slower.check() is Verdict.PROVED else proof


def _farthest(
    laws: LawSearch,
    problem_with: Callable[[Fraction], DesignProblem],
    first: Fraction,
    most: Fraction | None,
    unit: Fraction = Fraction(0),
    attempts: int = _ATTEMPTS,
) -> Longest | None:
    """Proof at nearly the largest value of a quantity for which laws come close to a guarantee.

    Parameters
    ----------
    laws : LawSearch
    problem_with : callable
        Plant, T_s and setup of the design for a value: a time [s], or a factor of the half-widths of the box [-].
    first : Fraction
        Value to try first.
    most : Fraction, optional
        Largest value to try.
    unit : Fraction
        Value to try after 0.
    attempts : int
        Largest number of attempts.
    """

    def search(time: Fraction, near: np.ndarray | None) -> Closest | NoProof:
        task, step, setup = problem_with(time)
        candidate: Closest | NoProof = laws.closest(task, step, near, setup=setup)
        return candidate

    good: Closest | None = None
    time, at, bad, before = first, first, None, None
    for _ in range(attempts):
        candidate = search(time, None if good is None else good.numbers)
        if attempts < _ATTEMPTS and good is not None and bad is None and not _within(candidate):
            candidate = search(time, None)
        small = None if isinstance(candidate, NoProof) else candidate.small_gain
        if isinstance(candidate, Closest) and _within(candidate):
            good, at = candidate, time
        else:
            if good is None and (not time or not _nearer(small, before)):
                return None
            bad, before = (time, small), small
        open_end = (_LOOSE if unit else _CLOSE) * bad[0] if bad is not None else Fraction(0)
        edge = good is not None and good.distance > _EDGE and not unit
        if good is not None and (at == most or edge or (bad is not None and bad[0] - at <= open_end)):
            break
        time = _time_between(good, at, bad, most, unit)
    for _ in range(_ATTEMPTS if good is not None else 0):
        assert good is not None
        proof = laws.proved(problem_with(at)[0], good)
        if proof.available:
            return Longest(proof, good.numbers)
        at = Fraction(f"{float(at * _BACK):.3g}")
        nearer = search(at, good.numbers)
        if isinstance(nearer, Closest):
            good = nearer
    return None


def _within(candidate: Closest | NoProof) -> bool:
    return isinstance(candidate, Closest) and candidate.distance < 1


def _time_between(
    good: Closest | None, at: Fraction, bad: tuple[Fraction, float | None] | None, most: Fraction | None, unit: Fraction
) -> Fraction:
    """Next value to try, rounded to three digits, by linear interpolation of the small gain.

    Bisection applies far from the target, or if a nominal loop is unstable.
    """
    if good is None:
        assert bad is not None
        time, small = bad
        return (
            time / 2
            if small is None or small > _LONGEST_TIMES_FAR
            else Fraction(f"{0.9 * float(time) / max(small, 1.0):.3g}")
        )
    if bad is None:
        grown = 2.0 if unit else min((_AIM / max(good.small_gain, _LEAST)) ** (1 / _POWER), 2.0)
        ahead = float(at) * grown if at else float(unit)
        time = Fraction(f"{ahead:.3g}")
        return time if most is None else min(time, most)
    width, share = float(bad[0] - at), 0.5
    if bad[1] is not None and max(1.0, good.small_gain) < bad[1] <= _LONGEST_TIMES_FAR:
        share = min(max((_AIM - good.small_gain) / (bad[1] - good.small_gain), 0.2), 0.8)
    return Fraction(f"{float(at) + share * width:.3g}")


def reached(
    attempt: Attempt, first: Fraction, *, most: Fraction | None = None, attempts: int = _ATTEMPTS
) -> tuple[TrackingProof, ...]:
    """Guarantees at increasing values: the first value is halved or doubled, then the limit is bisected.

    The search ends without a guarantee if halving the value reduces the small gain too little.

    Parameters
    ----------
    attempt : callable
        Proof for a value: a time [s], or an amplitude [m/s²].
    first : Fraction
        Value to try first.
    most : Fraction, optional
        Largest value to try.
    attempts : int
        Largest number of attempts.
    """
    proofs: list[TrackingProof] = []
    time, good, bad, small_gain = first, None, None, None
    for _ in range(attempts):
        proof = attempt(time)
        if proof.available:
            proofs.append(proof)
            good = time
        else:
            if good is None and not _nearer(proof.small_gain, small_gain):
                break
            bad, small_gain = time, proof.small_gain
        if good is not None and (good == most or (bad is not None and bad - good <= _NEAR * bad)):
            break
        time = _next(good, bad, most)
    return tuple(proofs)


def _nearer(now: Fraction | float | None, before: Fraction | float | None) -> bool:
    """Whether two more decreases like the last one would bring the small gain below 1; True if unknown."""
    return now is None or before is None or now - 2 * (before - now) < 1


def _next(good: Fraction | None, bad: Fraction | None, most: Fraction | None) -> Fraction:
    """Next time to try; between a proved and a failed one, it is their mean, rounded to three digits."""
    if good is not None and bad is not None:
        return Fraction(f"{float(good + bad) / 2:.3g}")
    if good is None:
        assert bad is not None
        return bad / 2
    return 2 * good if most is None else min(2 * good, most)


# ----------------------------------------------------------------------
# Proved peaks of slip and slip rate under a given e-LQR in continuous time, with a pressure without delay.

CLASSES = ("amplitude", "rate")


def certified_peaks(
    fault: Fault, controller: ExtendedLQR, *, disturbance_class: str = "amplitude"
) -> ContinuousProof | NoProof:
    """Bounds of slip, slip rate and pressure of an e-LQR in continuous time.

    Parameters
    ----------
    fault : Fault
    controller : ExtendedLQR
        With ``error`` or ``state`` feedback.
    disturbance_class : str
        ``"amplitude"``: any measurable disturbance within the fault's bound; ``"rate"``: within its rate bound too.

    Raises
    ------
    UnknownNameError
        For an unknown class.
    ParameterError
        For a law that starts with a pressure other than zero, friction with a state, or the class ``rate`` and a
        disturbance that does not start at 0.
    """
    require_known(disturbance_class, CLASSES, "disturbance class", UnknownNameError)
    if controller.offset:
        raise ParameterError(
            "a certified peak needs p = 0 initially. Received the offset "
            f"{float(controller.offset):.4g} Pa. Use the offset 0."
        )
    law = exact_integrals(tuple(controller.gains.values()), of_state=controller.feedback == "state")
    needed = 1 + any(law.of_reference)
    if len(law.states) < needed:
        few = f"too few integrals for feedback of the {controller.feedback}: {needed} needed, {len(law.states)} in use"
        return NoProof(reason=few)
    peaks, limits = (
        continuous_peaks(uncertain_plant(fault, rate_limited=disturbance_class == "rate"), law),
        controller.limits,
    )
    if limits is None or not peaks.available:
        return peaks
    low, high = peaks.claims.least_pressure, peaks.claims.largest_pressure
    if limits.lowest < low and high < limits.highest:
        return peaks
    reason = f"the pressure may reach a limit of the law, from {low.quantity('Pa')} to {high.quantity('Pa')}"
    return NoProof(reason=reason)
