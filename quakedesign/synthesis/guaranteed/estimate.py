"""The bounds of a guarantee in floats, for searches: proposes, decides nothing."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from quakedesign.certificates.guarantee import Bounds, NoGuarantee, Task
from quakedesign.certificates.guarantee.theorem import bounds_from
from quakedesign.loop import PeriodicLoop

_PIECES = 4
_MOST_PERIODS = 4096
_FORGOTTEN = 1e-4  # share of the past that is left out


@dataclass(frozen=True, slots=True)
class Estimate:
    """Bounds, and the slip error [m] per drift of p* [m/s³]."""

    bounds: Bounds | NoGuarantee
    drift_gain: float


def estimated(task: Task, loop: PeriodicLoop) -> Estimate | None:
    """Bounds of the theorem with sums in place of upper sums; None where the nominal loop is unstable or very slow."""
    gains = _gains(loop)
    if gains is None:
        return None
    return Estimate(bounds_from(task, gains), max(gains["slip_error", "drift"]))


@dataclass(frozen=True, slots=True)
class _Flow:
    """Jump, e^{Ah}, the map of the segment, and the length h [s] of a piece."""

    jump: np.ndarray
    step: np.ndarray
    whole: np.ndarray
    piece: float


def _gains(loop: PeriodicLoop) -> dict[tuple[str, str], tuple[float, ...]] | None:
    """Gains at every end of a piece."""
    flow = np.array(loop.flow, dtype=float)
    flows, period = [], np.eye(len(flow))
    for segment in loop.segments:
        piece = float(segment.duration) / _PIECES
        jump, step = np.array(segment.jump, dtype=float), expm(flow * piece)
        flows.append(_Flow(jump, step, np.linalg.matrix_power(step, _PIECES) @ jump, piece))
        period = flows[-1].whole @ period
    radius = max(abs(np.linalg.eigvals(period)))
    if not radius < 1 - np.log(1 / _FORGOTTEN) / _MOST_PERIODS:
        return None
    doublings = int(np.ceil(np.log2(max(np.log(_FORGOTTEN) / np.log(max(radius, 0.1)), 2))))
    rows = np.array(list(loop.outputs.values()), dtype=float)
    return {
        (output, name): tuple(map(float, found))
        for name, entry in loop.inputs.items()
        for output, found in zip(loop.outputs, _of_input(np.array(entry, float), flows, doublings, rows), strict=True)
    }


def _of_input(entry: np.ndarray, flows: list[_Flow], doublings: int, rows: np.ndarray) -> np.ndarray:
    responses = [_response(entry, flow) for flow in flows]
    weights = np.array([0.5, *[1.0] * (_PIECES - 1), 0.5])
    own, later = [], np.eye(len(entry))
    for flow, response in zip(flows[::-1], responses[::-1], strict=True):
        own.append(later @ response * weights * flow.piece)
        later = later @ flow.whole
    before = np.hstack(own)
    for _ in range(doublings):
        before, later = np.hstack([before, later @ before]), later @ later
    found = []
    for flow, response in zip(flows, responses, strict=True):
        size, row = np.abs(rows @ response), rows
        since = np.cumsum((size[:, 1:] + size[:, :-1]) * flow.piece / 2, axis=1)
        for i in range(_PIECES + 1):
            found.append(np.abs(row @ flow.jump @ before).sum(axis=1) + (since[:, i - 1] if i else 0))
            row = row @ flow.step
        before = np.hstack([flow.whole @ before, response * weights * flow.piece])
    return np.array(found).T


def _response(entry: np.ndarray, flow: _Flow) -> np.ndarray:
    """e^{Ahi}b at the ends of the pieces, one column each."""
    ends = [entry]
    for _ in range(_PIECES):
        ends.append(flow.step @ ends[-1])
    return np.array(ends).T
