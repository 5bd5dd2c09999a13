"""Long records as means of neighbouring samples, over times that are short against everything that changes."""

from dataclasses import replace

import numpy as np
from scipy import stats

from quakedesign.errors import RecordError
from quakedesign.identification.record import Record
from quakedesign.identification.straight import first_rate, reading_step, scatter, straight_beginning

MOST_PLAIN = 3000  # samples that are taken as they are
MOST_MEANS = 20000
_SHARE = 0.1  # of the time to the nearest bend, that a mean is taken over
_MOST_COUNT = 2500  # samples of a mean, whose noise would otherwise be less than what a bend adds
_ACCIDENT = 0.05  # chance that noise alone makes a bend somewhere in a column
_FRICTION_FLOOR = 1e-4  # of its range, and of a normal load: what no machine measures
_NORMAL_FLOOR = 1e-5
_STEEPEST = 1e4  # of friction over any displacement [1/m]: machines and D_c of laboratories are softer and longer


def thinned(record: Record) -> Record:
    """A record with means in place of samples, and how many samples each stands for; short ones as they are.

    Friction, load point, slip and normal load are cut into pieces in which each is a line but for its noise. A mean is
    taken over at most a tenth of the time to the nearer end of its piece, thus over a twentieth of the piece at most:
    steps and what follows them keep their samples. Where a piece bends by as much as its noise hides, 5 deviations,
    the mean over a time then differs from friction at the mean time by 0.004 deviations of a sample, which is a fifth
    of the noise of the mean of 2500, the most that there are.

    Parameters
    ----------
    record : Record

    Raises
    ------
    RecordError
        When too many means are left.
    """
    if len(record.time) <= MOST_PLAIN:
        return record
    edges = _edges(record.time, _bends(record))
    if len(edges) - 1 > MOST_MEANS:
        raise RecordError(
            f"a record must have at most {MOST_MEANS} samples or means over times in which nothing bends. Received "
            f"{len(record.time)} samples, which need {len(edges) - 1}. Cut out the part that counts."
        )
    counts = np.diff(edges)

    def means(values: "np.ndarray") -> "np.ndarray":
        found: np.ndarray = values[0] + np.add.reduceat(values - values[0], edges[:-1]) / counts
        return found

    return replace(
        record,
        time=means(record.time),
        friction=means(record.friction),
        load_point=None if record.load_point is None else means(record.load_point),
        slip=None if record.slip is None else means(record.slip),
        normal=means(record.normal),
        counts=counts,
        first_rate=None if record.load_point is None else first_rate(record.time, record.load_point),
    )


def _bends(record: Record) -> "np.ndarray":
    """Samples at which a column leaves its line by more than its noise, with the first and the end."""
    friction = max(_noise(record.time, record.friction), _FRICTION_FLOOR * float(np.ptp(record.friction)))
    columns = [(record.friction, friction), (record.normal, _NORMAL_FLOOR * float(np.max(record.normal)))]
    columns += [(moved, friction / _STEEPEST) for moved in (record.load_point, record.slip) if moved is not None]
    bends = {0, len(record.time)}
    for values, floor in columns:
        allowed, begin = max(_noise(record.time, values), floor), 0
        while begin < len(record.time):
            begin += straight_beginning(record.time[begin:], values[begin:], allowed)
            bends.add(begin)
    return np.array(sorted(bends))


def _noise(time: "np.ndarray", values: "np.ndarray") -> float:
    """What noise and steps of reading add to a line at most, but for a small chance."""
    return float(stats.norm.isf(_ACCIDENT / 2 / len(time))) * scatter(time, values) + reading_step(values)


def _edges(time: "np.ndarray", bends: "np.ndarray") -> "np.ndarray":
    """First samples of all means, and the end; nothing bends at the ends of a record, whose first sample stays."""
    edges = [0, 1]
    for begin, end in zip(bends[:-1].tolist(), bends[1:].tolist(), strict=True):
        first = time[begin] if begin > 0 else -np.inf
        last = time[end - 1] if end < len(time) else np.inf
        longest, at = _SHARE / 2 * (time[end - 1] - time[begin]), max(begin, 1)
        while at < end:
            before, after = _SHARE * (time[at] - first), _SHARE * (last - time[at]) / (1 + _SHARE)
            until = time[at] + min(before, after, longest)
            ahead = time[at : min(at + _MOST_COUNT, end)]
            at += max(1, int(np.searchsorted(ahead, until, side="right")))
            edges.append(at)
    return np.array(edges)
