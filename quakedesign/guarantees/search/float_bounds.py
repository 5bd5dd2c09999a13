"""Floating-point estimates of guaranteed bounds and eigenvalues, and rounding of designs.

Used by searches only; nothing is proved here. The last chapter rounds proposed numbers to short rationals.
"""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from math import floor, inf, log10
from typing import Any, cast

import numpy as np
from scipy.linalg import expm

from quakedesign.errors import ParameterError
from quakedesign.guarantees.exact.norms import START, Arithmetic, LoopResponses, SlowestMode, unstable
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.exact.sampled_loop import Gains, GainSpread, SampledLoop
from quakedesign.guarantees.exact.small_gain import Bounds, VaryingGain, bounds_from
from quakedesign.laws import LinearLaw
from quakedesign.loop import PeriodicLoop
from quakedesign.plant.fault_plant import FaultPlant

# ----------------------------------------------------------------------
# Floating-point estimates of the bounds of a guarantee, for searches; no decision depends on them.

_PIECES = 4
_MOST_PERIODS = 4096
_FORGOTTEN = 1e-4  # relative size of the neglected tail of the response
_ALIKE = 0.99  # ratio of decays above which two modes are not separated
_SOON = 1024  # periods
_ENDS = (Fraction(0), Fraction(1, 2), Fraction(1))  # positions of nominal loops in the range of a slowly varying gain
_SPREAD = Fraction(1, 16)  # deviation of the gain from those of the nominal loops, relative to its range
# parts of the gain range in estimates and proofs; `growth` is only for proofs, as estimates neglect the input ``aged``
PARTS = VaryingGain(parts=8, growth=Fraction(1))
# largest number of fixed-point iterations of the slip error; least growth factor in late iterations
_TURNS, _LEAP = 10, 1.4
_FEW = 2


@dataclass(frozen=True, slots=True)
class BoundsEstimate:
    """Estimated bounds, and the slip error [m] per drift b·dp*/dt [m/s³]."""

    bounds: Bounds | NoProof
    drift_gain: float


def estimated(task: FaultPlant, sampled_loop: SampledLoop) -> BoundsEstimate | None:
    """Bounds of the theorem by trapezoidal sums; None for an unstable or very slow loop."""
    gains = gains_of(sampled_loop.loop(task))
    if gains is None:
        return None
    return BoundsEstimate(_bounds(task, sampled_loop, gains), max(gains["slip_error", "drift"]))


def varying_gain_estimate(task: FaultPlant, sampled_loop: SampledLoop) -> BoundsEstimate | None:
    """Estimate with a slowly varying input gain, at the ends and the middle of its range."""
    low, high = task.beta
    every = []
    for share in _ENDS:
        gains = gains_of(
            sampled_loop.loop(task, replace(task.model, gain=(low + share * (high - low)) * task.authority))
        )
        if gains is None:
            return None
        every.append(gains | {(y, "aged"): v for (y, name), v in gains.items() if name == "acceleration"})
    whole = {key: tuple(v for gains in every for v in gains[key]) for key in every[0]}
    spread = GainSpread(present=_SPREAD * (high - low), past=Fraction(0))
    return BoundsEstimate(_bounds(task, sampled_loop, whole, spread), max(whole["slip_error", "drift"]))


def _bounds(
    task: FaultPlant, sampled_loop: SampledLoop, gains: Gains, spread: GainSpread | None = None
) -> Bounds | NoProof:
    """Bounds of a sampled loop with given gains."""
    law, noise = sampled_loop.law, sampled_loop.noise
    return bounds_from(task, gains, law.implicit_step, sampled_loop.step, noise, spread, sampled_loop.timing_error)


def distance(task: FaultPlant, sampled_loop: SampledLoop) -> tuple[float, Bounds | None]:
    """Small gain [-] with bounds if a proof is expected; else 1 + the small gain at zero error.

    For friction that depends on the slip alone the input gain varies slowly. Its deviation depends on the slip-error
    bound, which is computed as a fixed point for the nominal loops of the first and the last part of the range. The
    result is infinite for an unstable or very slow nominal loop.
    """
    if task.friction.rate_slope:
        values = estimated(task, sampled_loop)
        bounds = None if values is None else values.bounds
        return _distance(bounds, inf if bounds is None else _small(bounds))
    whole: dict[tuple[str, str], tuple[float, ...]] = {}
    for model in (PARTS.models(task)[0], PARTS.models(task)[-1]):
        gains = gains_of(sampled_loop.loop(task, model))
        if gains is None:
            return inf, None
        whole = {key: whole.get(key, ()) + values for key, values in gains.items()}
    whole |= {(y, "aged"): values for (y, name), values in whole.items() if name == "acceleration"}
    slip_error, least = 0.0, inf
    for turn in range(_TURNS):
        spread = replace(PARTS.spread(task, Fraction(slip_error)), past=Fraction(0))
        bounds = _bounds(task, sampled_loop, whole, spread)
        least = min(least, _small(bounds))
        if not bounds.available or bounds.slip_error <= slip_error:
            return _distance(bounds, least)
        slip_error = max(1.01 * float(bounds.slip_error), _LEAP * slip_error * (turn >= _FEW))
    return _distance(None, least)


def distance_of_bounds(bounds: Bounds | NoProof) -> tuple[float, Bounds | None]:
    """Distance of given bounds."""
    return _distance(bounds, _small(bounds))


def _small(bounds: Bounds | NoProof) -> float:
    return inf if bounds.small_gain is None else float(bounds.small_gain)


def _distance(bounds: Bounds | NoProof | None, least: float) -> tuple[float, Bounds | None]:
    return (_small(bounds), bounds) if bounds is not None and bounds.available else (1 + least, None)


def gains_of(loop: PeriodicLoop) -> dict[tuple[str, str], tuple[float, ...]] | None:
    """Gains from every input to every output at the ends of all pieces; None for an unstable or very slow loop."""
    try:
        of, gains = LoopResponses(FLOATS, loop), dict[str, list[Any]]()
        for name in (*loop.inputs, *loop.sampled, *loop.fading, *loop.pulses):
            gains[name] = [v for part in of.sums(name) for v in (part[0][0], *(end for _, end, _ in part))]
        if loop.start:
            gains[START] = of.free()
    except ParameterError:
        return None
    lines = {name: np.concatenate(values, axis=1).tolist() for name, values in gains.items()}
    values = {
        (y, name): tuple(line) for name, part in lines.items() for y, line in zip(loop.outputs, part, strict=True)
    }
    return values | {key: tuple(v + float(size) for v in values[key]) for key, size in loop.feedthrough.items()}


class _FloatMatrix(np.ndarray):
    """Matrix of floats with the operators and methods of `flint.arb_mat` that the algorithm of `norms` needs."""

    __array_priority__ = 1.0  # for the type of concatenations

    @classmethod
    def of(cls, rows: Iterable[Iterable[Fraction]]) -> "_FloatMatrix":
        return np.array([[v.numerator / v.denominator for v in row] for row in rows]).view(cls)

    def __mul__(self, other: Any) -> Any:
        return self.dot(other) if isinstance(other, _FloatMatrix) else np.multiply(self, other)

    def exp(self) -> "_FloatMatrix":
        return np.asarray(expm(self.view(np.ndarray))).view(_FloatMatrix)

    def nrows(self) -> int:
        return len(self)

    def ncols(self) -> int:
        return len(self[0])


def floats(values: np.ndarray) -> Any:
    """Array as a matrix with the operators of `flint.arb_mat`."""
    return values.view(_FloatMatrix)


def _slowest(period: _FloatMatrix) -> SlowestMode:
    """Slowest mode, whose tail is summed in closed form.

    If it is complex, or not separated from the next mode, or decays fast, responses are summed period by period.
    """
    values, vectors = np.linalg.eig(period.view(np.ndarray))
    first, *rest = np.argsort(-abs(values))
    decay, others = float(abs(values[first])), float(max(abs(values[rest]), default=0.0))
    seen = along = np.zeros(len(period))
    if not (decay >= 1 or values[first].imag or others > _ALIKE * decay or decay**_SOON < _FORGOTTEN):
        with suppress(np.linalg.LinAlgError):
            seen, along = np.linalg.solve(vectors.T, np.eye(len(period))[first]).real, vectors[:, first].real
    if not seen.any():
        decay, others = 0.0, decay
    if not max(decay, others) < 1 - np.log(1 / _FORGOTTEN) / _MOST_PERIODS:
        raise unstable()
    doublings = int(np.ceil(np.log2(max(np.log(_FORGOTTEN) / np.log(max(others, 0.1)), 2))))
    left = decay**2**doublings / (1 - decay)
    return SlowestMode(
        doublings=doublings,
        left_eigenvector=floats(seen[None]),
        right_eigenvector=floats(along[:, None]),
        remainder=left,
    )


FLOATS: Arithmetic = cast("Any", Arithmetic)(
    slowest=_slowest,
    number=float,
    matrix=_FloatMatrix.of,
    column=lambda values: _FloatMatrix.of([(v,) for v in values]),
    identity=lambda size: floats(np.eye(size)),
    pieces=lambda segment, _: (float(segment.duration) / _PIECES,) * _PIECES,
    hstack=lambda parts: np.concatenate(parts, axis=1),
    vstack=np.concatenate,
    majorant=lambda flow: floats(np.asarray(np.where(np.eye(len(flow)), np.maximum(flow, 0), np.abs(flow)))),
    absolute=np.abs,
    modulus=np.abs,
    larger=np.maximum,
    scaled=lambda whole, weights: np.multiply(whole, weights),
    part=lambda whole, first, end: whole[first:end],
    sums=lambda whole: np.add.reduce(np.abs(whole), axis=1, keepdims=True),
    grouped=lambda sizes, weights: sizes.reshape(len(sizes), -1, len(weights)).dot(weights),
    highest=lambda whole: np.maximum.reduce(whole, axis=1, keepdims=True),
)


# ----------------------------------------------------------------------
# Eigenvalues of sampled laws and loops, in floats.

PERIODS = 64
"""Least number of periods of an adversarial trajectory."""
_MOST_POLE_PERIODS = 512
_FORGOTTEN_POLE = 100  # a trajectory ends when the initial state has decayed by this factor


def own_poles(law: LinearLaw) -> np.ndarray:
    """Eigenvalues of the law's `update`, nearest to 1 (integral) first: its poles while the fault is at rest."""
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
    """Periods after which a mode with a given decay factor per period is below 1/100, within limits."""
    pace = -np.log(np.clip(radius, 1e-9, 1 - 1e-9))
    return int(np.clip(np.ceil(np.log(_FORGOTTEN_POLE) / pace), PERIODS, _MOST_POLE_PERIODS))


def spectral_radius(loop: PeriodicLoop) -> float:
    """Spectral radius of the map over a period."""
    flow, period = np.array(loop.flow, dtype=float), np.eye(len(loop.flow))
    for part in loop.segments:
        period = expm(flow * float(part.duration)) @ np.array(part.jump, dtype=float) @ period
    return float(max(abs(np.linalg.eigvals(period))))


# ----------------------------------------------------------------------
# Rationals with few digits for the numbers of a design.

_DIGITS = 4


def short(value: float, digits: int = _DIGITS) -> Fraction:
    """Rational with few decimal digits near a float."""
    if not value:
        return Fraction(0)
    unit = Fraction(10) ** (floor(log10(abs(value))) + 1 - digits)
    return round(Fraction(value) / unit) * unit


def rounded(rows: Iterable[Iterable[float]]) -> tuple[tuple[Fraction, ...], ...]:
    """Rationals with few digits near every entry of a matrix."""
    return tuple(tuple(short(float(v)) for v in row) for row in rows)
