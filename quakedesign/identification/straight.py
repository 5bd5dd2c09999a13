"""Straight parts of what was measured: its noise from sample to sample, and how far a line goes through it."""

import numpy as np

FAR_OFF = 4.0  # deviations of a displacement that no noise explains
_FIRST = 20  # samples
_BENDS = 2  # among the first samples, which a change of rate alone may have
_MEDIAN = 0.6745  # of the size of a normal deviate


def scatter(time: "np.ndarray", values: "np.ndarray") -> float:
    """Standard deviation of noise from sample to sample: the median distance from the line between both neighbours."""
    if len(time) < 3:
        return 0.0
    share = (time[1:-1] - time[:-2]) / (time[2:] - time[:-2])
    off = values[1:-1] - (1 - share) * values[:-2] - share * values[2:]
    return float(np.median(np.abs(off) / np.sqrt(1 + share**2 + (1 - share) ** 2))) / _MEDIAN


def reading_step(values: "np.ndarray") -> float:
    """Step in which values are read, if the first ones stay now and then, or bend often by it; else next to nothing."""
    levels, first = np.unique(values), np.diff(values[:_FIRST])
    step = float(np.min(np.diff(levels))) if len(levels) > 1 else 0.0
    read_in_steps = np.any(first == 0) or np.sum(np.abs(np.diff(first)) > step / 2) > _BENDS
    return step if read_in_steps else 1e-9 * float(np.ptp(values))


def straight_beginning(time: "np.ndarray", values: "np.ndarray", allowed: float) -> int:
    """Samples from the first on that lie within `allowed` of their line, at least two."""

    def straight(count: int) -> bool:
        t, x = time[:count] - np.mean(time[:count]), values[:count] - np.mean(values[:count])
        return bool(np.max(np.abs(x - t * (t @ x) / (t @ t))) <= allowed)

    good, bad = 2, 4
    while bad <= len(time) and straight(bad):
        good, bad = bad, 2 * bad
    bad = min(bad, len(time) + 1)
    while bad - good > 1:
        count = (good + bad) // 2
        good, bad = (count, bad) if straight(count) else (good, count)
    return min(good, len(time))


def first_rate(time: "np.ndarray", position: "np.ndarray") -> float:
    """Rate [m/s] of a position that moves steadily at first: of the longest beginning that is a line but for noise."""
    allowed = FAR_OFF * scatter(time, position) + reading_step(position)
    count = straight_beginning(time, position, allowed)
    return float(np.polyfit(time[:count], position[:count], 1)[0])
