"""Floating-point estimates of guaranteed bounds and eigenvalues, and rounding of designs.

Used by searches only; nothing is proved here. The last chapter rounds proposed numbers to short
rationals.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import reduce
from math import floor, inf, log10

import numpy as np
from scipy.linalg import expm

from quakedesign.guarantees.exact.loop import GainSpread, SampledLoop
from quakedesign.guarantees.exact.norms import START
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.exact.small_gain import Bounds, SlowGain, bounds_from
from quakedesign.laws import LinearLaw
from quakedesign.loop import PeriodicLoop
from quakedesign.plant.ranges import FaultPlant

# ----------------------------------------------------------------------
# Floating-point estimates of the bounds of a guarantee, for searches; no decision depends on them.

_PIECES = 4
_MOST_PERIODS = 4096
_FORGOTTEN = 1e-4  # relative size of the neglected tail of the response
_ALIKE = 0.99  # ratio of decays above which two modes are not separated
_SOON = 1024  # periods
_ENDS = (Fraction(0), Fraction(1, 2), Fraction(1))  # places in the range of a slow input gain of the nominal loops
_SPREAD = Fraction(1, 16)  # deviation of the gain from theirs, relative to its range
_PARTS = SlowGain(parts=8, growth=Fraction(1))  # as in proofs; the input ``aged`` is neglected
_TURNS, _LEAP = 10, 1.4  # iterations of the slip error to its fixed point, and least factor of a late one
_FEW = 2


@dataclass(frozen=True, slots=True)
class BoundsEstimate:
    """Bounds, and the slip error [m] per drift of p* [m/s³]."""

    bounds: Bounds | NoProof
    drift_gain: float


def estimated(task: FaultPlant, held: SampledLoop) -> BoundsEstimate | None:
    """Bounds of the theorem by trapezoidal sums; None for an unstable or very slow loop."""
    gains = gains_of(held.loop(task))
    if gains is None:
        return None
    bounds = bounds_from(task, gains, held.law.root, held.step, held.noise, None, held.off)
    return BoundsEstimate(bounds, max(gains["slip_error", "drift"]))


def slowly_estimated(task: FaultPlant, held: SampledLoop) -> BoundsEstimate | None:
    """Estimate with a slowly varying input gain, at the ends and the middle of its range."""
    low, high = task.beta
    every = []
    for share in _ENDS:
        gains = gains_of(held.loop(task, replace(task.model, gain=(low + share * (high - low)) * task.authority)))
        if gains is None:
            return None
        every.append(gains | {(y, "aged"): v for (y, name), v in gains.items() if name == "acceleration"})
    whole = {key: tuple(v for gains in every for v in gains[key]) for key in every[0]}
    spread = GainSpread(half=_SPREAD * (high - low), aged=Fraction(0))
    bounds = bounds_from(task, whole, held.law.root, held.step, held.noise, spread, held.off)
    return BoundsEstimate(bounds, max(whole["slip_error", "drift"]))


def closeness(task: FaultPlant, held: SampledLoop) -> tuple[float, Bounds | None]:
    """Small gain [-] with bounds if a proof is expected; else 1 + the small gain at zero error.

    For friction that depends on the slip alone the input gain varies slowly. Its deviation depends on the bound of the
    slip error, a fixed point for the nominal loops of the first and the last part of the range. The result is infinite
    for an unstable or very slow nominal loop.
    """
    if task.friction.rate_slope:
        values = estimated(task, held)
        bounds = None if values is None else values.bounds
        return _closeness(bounds, inf if bounds is None else _small(bounds))
    whole: dict[tuple[str, str], tuple[float, ...]] = {}
    for model in (_PARTS.models(task)[0], _PARTS.models(task)[-1]):
        gains = gains_of(held.loop(task, model))
        if gains is None:
            return inf, None
        whole = {key: whole.get(key, ()) + values for key, values in gains.items()}
    whole |= {(y, "aged"): values for (y, name), values in whole.items() if name == "acceleration"}
    slip_error, least = 0.0, inf
    for turn in range(_TURNS):
        spread = replace(_PARTS.spread(task, Fraction(slip_error)), aged=Fraction(0))
        bounds = bounds_from(task, whole, held.law.root, held.step, held.noise, spread, held.off)
        least = min(least, _small(bounds))
        if not bounds.proved or bounds.slip_error <= slip_error:
            return _closeness(bounds, least)
        slip_error = max(1.01 * float(bounds.slip_error), _LEAP * slip_error * (turn >= _FEW))
    return _closeness(None, least)


def closeness_of_bounds(bounds: Bounds | NoProof) -> tuple[float, Bounds | None]:
    """Closeness of bounds that are computed already."""
    return _closeness(bounds, _small(bounds))


def _small(bounds: Bounds | NoProof) -> float:
    return inf if bounds.small_gain is None else float(bounds.small_gain)


def _closeness(bounds: Bounds | NoProof | None, least: float) -> tuple[float, Bounds | None]:
    return (_small(bounds), bounds) if bounds is not None and bounds.proved else (1 + least, None)


@dataclass(frozen=True, slots=True)
class _Flow:
    """Jump, e^{Ah}, the map of the segment, and the length h [s] of a piece."""

    jump: np.ndarray
    step: np.ndarray
    whole: np.ndarray
    piece: float


def gains_of(loop: PeriodicLoop) -> dict[tuple[str, str], tuple[float, ...]] | None:
    """Gains at every end of a piece."""
    flow = np.array(loop.flow, dtype=float)
    flows, period = [], np.eye(len(flow))
    for segment in loop.segments:
        piece = float(segment.duration) / _PIECES
        jump, step = np.array(segment.jump, dtype=float), expm(flow * piece)
        flows.append(_Flow(jump, step, np.linalg.matrix_power(step, _PIECES) @ jump, piece))
        period = flows[-1].whole @ period
    slowest = _Slowest.of(period)
    if not max(slowest.decay, slowest.others) < 1 - np.log(1 / _FORGOTTEN) / _MOST_PERIODS:
        return None
    doublings = int(np.ceil(np.log2(max(np.log(_FORGOTTEN) / np.log(max(slowest.others, 0.1)), 2))))
    rows = np.array(list(loop.outputs.values()), dtype=float)
    gains = {name: _of_input(entry, flows, doublings, rows, enters, slowest) for name, entry, enters in _entries(loop)}
    for name, entries in _pulses(loop, flows):
        sides = [_of_input(entry, flows, doublings, rows, loop.pulses[name].first, slowest) for entry in entries]
        gains[name] = np.sum(sides, axis=0)
    gains |= {START: _free(np.array(loop.start, dtype=float).T, flows, doublings, rows)} if loop.start else {}
    return {
        (output, name): tuple(float(v + loop.at_once.get((output, name), 0)) for v in values)
        for name, of in gains.items()
        for output, values in zip(loop.outputs, of, strict=True)
    }


@dataclass(frozen=True, slots=True)
class _Slowest:
    """Decay per period of the slowest mode and of all others, with its eigenvectors.

    All modes count as others where the slowest is a complex pair, where two modes decay almost equally, and where all
    modes decay within a few periods.
    """

    decay: float
    others: float
    along: np.ndarray
    seen: np.ndarray

    @classmethod
    def of(cls, period: np.ndarray) -> "_Slowest":
        values, vectors = np.linalg.eig(period)
        first, *rest = np.argsort(-abs(values))
        decay, others = float(abs(values[first])), float(max(abs(values[rest]), default=0.0))
        none = np.zeros(len(period))
        if decay >= 1 or values[first].imag or others > _ALIKE * decay or decay**_SOON < _FORGOTTEN:
            return cls(0.0, decay, none, none)
        try:
            seen = np.linalg.solve(vectors.T, np.eye(len(period))[first]).real
        except np.linalg.LinAlgError:
            return cls(0.0, decay, none, none)
        return cls(decay, others, vectors[:, first].real, seen)

    def left(self, columns: np.ndarray, periods: int) -> np.ndarray:
        """Sum over all later periods of the responses to the columns, after a number of periods."""
        size = np.abs(self.seen @ columns).sum() * self.decay**periods / (1 - self.decay)
        return np.asarray(self.along * size)


def _entries(loop: PeriodicLoop) -> Iterator[tuple[str, np.ndarray, int | None]]:
    """Inputs and the segment whose jump they enter with; fading inputs enter with a jump."""
    for name, row in loop.inputs.items():
        yield name, np.array(row, float), None
    for name, row in loop.sampled.items():
        yield name, np.array(row, float), 0
    for name, fading in loop.fading.items():
        area = fading.height / fading.rate + fading.floor * loop.period
        yield name, np.array(fading.entry, float) * float(area), fading.first


def _pulses(loop: PeriodicLoop, flows: list[_Flow]) -> Iterator[tuple[str, list[np.ndarray]]]:
    """Inputs that act near a jump, with half the sum and half the difference of both sides."""
    for name, pulse in loop.pulses.items():
        entry = np.array(pulse.entry, float)
        before, after = flows[pulse.first].jump @ entry * float(pulse.before), entry * float(pulse.after)
        yield name, [(before + after) / 2, (before - after) / 2]


def _of_input(
    entry: np.ndarray, flows: list[_Flow], doublings: int, rows: np.ndarray, enters: int | None, slowest: _Slowest
) -> np.ndarray:
    responses = [_response(entry * (enters in (None, i)), flow) for i, flow in enumerate(flows)]
    sums = [_Sums(response, flow.piece, enters is not None) for response, flow in zip(responses, flows, strict=True)]
    own, later = [], np.eye(len(entry))
    for flow, part in zip(flows[::-1], sums[::-1], strict=True):
        own.append(later @ part.columns)
        later = later @ flow.whole
    before = np.hstack(own)
    left = slowest.left(before, 2**doublings)[:, None]
    for _ in range(doublings):
        before, later = np.hstack([before, later @ before]), later @ later
    before = np.hstack([before, left])
    peaks = []
    for flow, part in zip(flows, sums, strict=True):
        since, row = part.since(rows), rows
        for i in range(_PIECES + 1):
            peaks.append(np.abs(row @ flow.jump @ before).sum(axis=1) + since[:, i])
            row = row @ flow.step
        before = np.hstack([flow.whole @ before, part.columns])
    return np.array(peaks).T


def _free(start: np.ndarray, flows: list[_Flow], doublings: int, rows: np.ndarray) -> np.ndarray:
    """Largest outputs of the free response from the box of the columns of `start`."""
    columns, period = start[None], reduce(lambda now, flow: flow.whole @ now, flows, np.eye(len(start)))
    for _ in range(doublings):
        columns, period = np.concatenate([columns, period @ columns]), period @ period
    peaks = []
    for flow in flows:
        now = flow.jump @ columns
        for _ in range(_PIECES + 1):
            peaks.append(np.abs(rows @ now).sum(axis=2).max(axis=0))
            now = flow.step @ now
        columns = flow.whole @ columns
    return np.array(peaks).T


@dataclass(frozen=True, slots=True)
class _Sums:
    """Response over one segment to an input that flows, or that enters with the jump."""

    response: np.ndarray
    piece: float
    sudden: bool

    @property
    def columns(self) -> np.ndarray:
        """Factor for the sums of all later periods."""
        weights = np.array([0.5, *[1.0] * (_PIECES - 1), 0.5])
        return self.response[:, -1:] if self.sudden else self.response * weights * self.piece

    def since(self, rows: np.ndarray) -> np.ndarray:
        """From the jump to every end of a piece."""
        size: np.ndarray = np.abs(rows @ self.response)
        if self.sudden:
            return size
        return np.insert(np.cumsum((size[:, 1:] + size[:, :-1]) * self.piece / 2, axis=1), 0, 0, axis=1)


def _response(entry: np.ndarray, flow: _Flow) -> np.ndarray:
    """e^{Ahi}b at the ends of the pieces, one column each."""
    ends = [entry]
    for _ in range(_PIECES):
        ends.append(flow.step @ ends[-1])
    return np.array(ends).T


# ----------------------------------------------------------------------
# Eigenvalues of sampled laws and loops, in floats.

PERIODS = 64
"""Least number of periods of an adversarial trajectory."""
_MOST_POLE_PERIODS = 512
_FORGOTTEN_POLE = 100  # a trajectory ends when the initial state has decayed by this factor


def own_poles(law: LinearLaw) -> np.ndarray:
    """Eigenvalues of F, the integral's first: poles of the law while the fault is at rest."""
    poles = np.linalg.eigvals(np.array(law.update, dtype=float).reshape((len(law.states),) * 2))
    return np.asarray(poles[np.argsort(np.abs(poles - 1), kind="stable")])


def moved(flow: np.ndarray, inputs: np.ndarray, length: float) -> tuple[np.ndarray, np.ndarray]:
    """e^{Ah}, and the response to inputs (columns) with zero-order hold over a time h [s]."""
    size, count = inputs.shape
    whole = np.zeros((size + count, size + count))
    whole[:size, :size], whole[:size, size:] = flow, inputs
    exponential = np.asarray(expm(whole * length))
    return exponential[:size, :size], exponential[:size, size:]


def periods_to_forget(radius: float) -> int:
    """Periods until a decay factor per period reaches 1/100, within limits."""
    pace = -np.log(np.clip(radius, 1e-9, 1 - 1e-9))
    return int(np.clip(np.ceil(np.log(_FORGOTTEN_POLE) / pace), PERIODS, _MOST_POLE_PERIODS))


def spectral_radius(loop: PeriodicLoop) -> float:
    """Spectral radius of the map over a period."""
    flow, period = np.array(loop.flow, dtype=float), np.eye(len(loop.flow))
    for part in loop.segments:
        period = expm(flow * float(part.duration)) @ np.array(part.jump, dtype=float) @ period
    return float(max(abs(np.linalg.eigvals(period))))


# ----------------------------------------------------------------------
# Rationals with few digits for numbers that a design proposes.

_DIGITS = 4


def short(value: float, digits: int = _DIGITS) -> Fraction:
    """Rational with few decimal digits near a float."""
    if not value:
        return Fraction(0)
    unit = Fraction(10) ** (floor(log10(abs(value))) + 1 - digits)
    return round(Fraction(value) / unit) * unit


def rounded(rows: Iterable[Iterable[float]]) -> tuple[tuple[Fraction, ...], ...]:
    """The same of every entry of a matrix."""
    return tuple(tuple(short(float(v)) for v in row) for row in rows)
