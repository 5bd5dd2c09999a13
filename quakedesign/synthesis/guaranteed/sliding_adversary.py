"""The worst that a search finds on the loop of a guarantee of slow sliding: what is seen, beside what is proved."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product
from typing import Any

import numpy as np
from scipy.linalg import expm

from quakedesign.cache import search_once
from quakedesign.certificates.slow_sliding import SlidingGuarantee, SlidingTask
from quakedesign.certificates.slow_sliding.small_gain import loop_of, model_of
from quakedesign.loop import PeriodicLoop
from quakedesign.synthesis.guaranteed.poles import moved, periods_to_forget

_PIECES = 4  # of a part of the period
_SLOPES = (1.0, 1.15)  # of e^y − 1 over y, in the linear loop that a course is found for
_NEWTON = 4
_AXES = ("direct_effect", "evolution_effect", "critical_slip")


@dataclass(frozen=True, slots=True, kw_only=True)
class WorstSliding:
    """Largest errors that were reached, absolute values.

    Attributes
    ----------
    log_rate : float
        Of ln(v/V) [-].
    slip_error : float
        [m].
    """

    log_rate: float
    slip_error: float


def worst_sliding(claim: SlidingGuarantee) -> WorstSliding:
    """Adversarial stresses at the corners of the box of a, b and D_c, on the plant without inertia.

    For every corner and every piece at which a course may end, the stress, and the rate of the reference within its
    swing, are at their ends as the impulse response of the loop, linearised, says, which is the worst for the linear
    loop; what it comes to is seen on the exponentials themselves, with four Runge–Kutta steps a part of the period.
    Both may jump at every end of a piece. The normal stress is that at the start; noise is none. A rate below V counts
    by its logarithm as one above it.
    """
    rate, slip = search_once(lambda: _searched(claim), "worst sliding", claim)
    return WorstSliding(log_rate=rate, slip_error=slip)


def _searched(claim: SlidingGuarantee) -> list[float]:
    found = [[0.0, 0.0]]
    for corner in corners(claim.task):
        plant = SlidingPieces(claim, corner)
        found += [plant.largest(*course).tolist() for course in courses(claim, plant)]
    return [max(values) for values in zip(*found, strict=True)]


def corners(task: SlidingTask) -> list[SlidingTask]:
    """The task at every corner of the box of a, b and D_c."""
    ends = [dict.fromkeys(task.ranges[axis]) for axis in _AXES]
    points = [dict(zip(_AXES, ((v, v) for v in corner), strict=True)) for corner in product(*ends)]
    return [replace(task, ranges={**task.ranges, **point}) for point in points]


def courses(claim: SlidingGuarantee, plant: "SlidingPieces") -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Stresses [Pa] and r′/V − 1 [-] for every piece, shape (pieces, courses): worst for the linear loop."""
    for slope in _SLOPES:
        loop, maps = plant.linear(slope)
        aims = np.array([np.array(loop.outputs["log_rate"], dtype=float), np.eye(len(loop.states))[0]])
        count = len(maps)
        signs = np.ones((2, _remembered(maps) * count, 2 * count))
        for last in range(count):
            costates = aims
            for number in range(signs.shape[1] - count + last, -1, -1):
                step, pushes, jump = maps[number % count]
                signs[:, number, [2 * last, 2 * last + 1]] = np.sign(costates @ pushes).T
                costates = costates @ step @ jump
        yield float(claim.task.stress) * signs[0], float(claim.task.swing) * signs[1]


def _remembered(maps: list[tuple[Any, Any, Any]]) -> int:
    whole = np.eye(len(maps[0][0]))
    for step, _, jump in maps:
        whole = step @ jump @ whole
    return periods_to_forget(np.abs(np.linalg.eigvals(whole)).max())


class SlidingPieces:
    """The plant at a corner, in pieces of its periods: exact pressures, Runge–Kutta steps of slip and state."""

    def __init__(self, claim: SlidingGuarantee, corner: SlidingTask) -> None:
        self._claim, self._corner = claim, corner
        model: Any = model_of(claim.task, claim.claims)
        self._loop = loop_of(claim.held, model, claim.task)
        normal = float(corner.ranges["normal_stress"][0])
        self._strength, self._weakening = (normal * float(corner.ranges[a][0]) for a in _AXES[:2])
        self._rate, self._stiffness = float(corner.rate), float(corner.stiffness)
        self._radiation, self._coefficient = float(corner.radiation), float(corner.ranges["coefficient"][0])
        self._ageing = self._rate / float(corner.ranges["critical_slip"][0])
        self._friction = float(corner.ranges["direct_effect"][0]), float(corner.ranges["evolution_effect"][0])

    def linear(self, slope: float) -> tuple[PeriodicLoop, list[tuple[Any, Any, Any]]]:
        """Linear loop, and of every piece e^{Ah}, what 1 Pa of stress and r′ = 2V add, and the jump before it."""
        model: Any = model_of(self._corner, self._claim.claims)
        steep = Fraction(slope).limit_denominator(1000)
        strength = Fraction(self._strength) + self._corner.radiation * self._corner.rate * steep
        plain = replace(
            model,
            slope=steep,
            state_slope=Fraction(1),
            strength=strength.limit_denominator(10**9),
            weakening=Fraction(self._weakening).limit_denominator(10**9),
        )
        loop = loop_of(self._claim.held, plain, self._corner)
        flow, pushes = np.array(loop.flow, dtype=float), np.zeros((len(loop.states), 2))
        pushes[:, 0], pushes[0, 1] = np.array(loop.inputs["stress"], dtype=float), -self._rate
        return loop, [(*moved(flow, pushes, length), jump) for length, jump in _parts(loop)]

    def largest(self, stress: np.ndarray, ahead: np.ndarray) -> np.ndarray:
        """Largest |ln(v/V)| and slip error [m] of courses of the stress [Pa] and of r′/V − 1, (pieces, courses)."""
        parts, size = _parts(self._loop), len(self._loop.states)
        flow, row = np.array(self._loop.flow, dtype=float)[2:, 2:], np.array(self._loop.outputs["push"], float)[2:]
        halves = [expm(flow * length / 2) for length, _ in parts]
        state, found = np.zeros((size, stress.shape[1])), np.zeros(2)
        for number, (pushed, faster) in enumerate(zip(stress, ahead, strict=True)):
            length, jump = parts[number % len(parts)]
            state = jump @ state
            half = halves[number % len(parts)]
            middle = half @ state[2:]
            after = half @ middle
            pressures = [row @ v for v in (state[2:], middle, after)]
            moved = self._step(state[:2], pressures, pushed, faster, length)
            state = np.vstack([moved, after])
            reached = [self.log_rate(moved, pressures[2], end) for end in (pushed, -pushed)]
            found = np.maximum(found, [np.max(np.abs(reached)), np.max(np.abs(moved[0]))])
        return found

    def _step(self, now: Any, pressures: list[Any], stress: Any, ahead: Any, length: float) -> Any:
        """Slip error and log state after a piece."""
        first = self._rates(now, pressures[0], stress, ahead)
        second = self._rates(now + length / 2 * first, pressures[1], stress, ahead)
        third = self._rates(now + length / 2 * second, pressures[1], stress, ahead)
        fourth = self._rates(now + length * third, pressures[2], stress, ahead)
        return now + length / 6 * (first + 2 * second + 2 * third + fourth)

    def _rates(self, now: Any, pressure: Any, stress: Any, ahead: Any) -> Any:
        y = self.log_rate(now, pressure, stress)
        slips = self._corner.state_law == "slip"
        aged = self._ageing * (-np.exp(y) * (y + now[1]) if slips else np.expm1(-now[1]) - np.expm1(y))
        return np.array([self._rate * (np.expm1(y) - ahead), aged])

    def log_rate(self, now: Any, pressure: Any, stress: Any) -> Any:
        """ln(v/V) of slip error [m], log state, pressure error [Pa] and stress [Pa], by Newton's method."""
        a, b = self._friction
        normal = self._strength / a - pressure
        driving = stress - self._stiffness * now[0] + self._coefficient * pressure - normal * b * now[1]
        y = driving / (normal * a + self._radiation * self._rate)
        for _ in range(_NEWTON):
            excess = normal * a * y + self._radiation * self._rate * np.expm1(y) - driving
            y = y - excess / (normal * a + self._radiation * self._rate * np.exp(y))
        return y


def _parts(loop: PeriodicLoop) -> list[tuple[float, np.ndarray]]:
    """Length [s] of every piece of a period, and the jump before it."""
    still, found = np.eye(len(loop.states)), []
    for segment in loop.segments:
        jumps = [np.array(segment.jump, dtype=float), *[still] * (_PIECES - 1)]
        found += [(float(segment.duration) / _PIECES, jump) for jump in jumps]
    return found
