"""Loops beyond the theorem of the stick–slip plant: which states disturbances reach, and how large a polytope would be.

    python benchmarks/stick_slip_beyond.py [WORDS OF ROWS]

Floating point; nothing here is a proof. For each loop a law like that of the theorem is run on the real fault at 184 ms
under disturbances that turn within periods, friction at either end of its slopes, and either end of the input gain. In
each round the states that are farthest in 600 directions are continued. Printed are the dimension of the state at the
samples, the largest slip rate and slip errors that are reached, whether these have stopped growing, and the facets of
the convex hull of the reached states: a polytope of the theorem needs about as many, and the theorem takes at most 400.

A delay of one period adds the pressure that is under way to the state. A lag adds the pressure in the fault. With a
slip rate that is measured within M the law reads max(measured − M, 0), so that it reads 0 at rest. Samples T to 2T
apart are those of a law that takes T for the interval.
"""

import sys
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import ConvexHull

import quakedesign as qd
from quakedesign.plant import uncertain_plant

SUBSTEPS, DIRECTIONS, ROUNDS, SETTLED = 24, 600, 60, 2e-3
HEAD = ("loop", "dimension", "slip rate", "slip behind … ahead", "settled", "facets of the hull")


@dataclass(frozen=True)
class Loop:
    """A law and what is around it; SI units."""

    name: str
    late: bool = False  # the pressure acts one period late
    lag: float = 0.0
    creep: float = 0.0  # twice the bound of the noise of the slip rate
    longest: float = 1.0  # period over T_s
    level: float = 0.5
    slip: float = 0.5
    back: float = 0.3
    gain: float = 1.3


class Fault:
    """Numbers of the real fault at 184 ms, in the coordinates of the theorem."""

    def __init__(self):
        fault = qd.load_fault("real-fault")
        task = uncertain_plant(fault)
        self.step, self.amplitude = float(fault.sampling_time), float(task.amplitude)
        self.damping, self.authority = float(sum(task.rate_chord)) / 2, float(task.authority)
        self.beta = float(task.beta[1])
        self.slopes = [float(v) for v in task.slip_slopes(task.stress)]
        self.fastest = float(task.reference_rates[0])
        self.decay = np.exp(-self.damping * self.step)
        self.held = (1 - self.decay) / self.damping


def period(fault, loop, states, random):
    """States a period later: columns e1, y, d and, behind a delay or a lag, the pressure under way or in the fault.

    Pressures stand for what they are less than p* at the slip of the sample, so that d is D + p*.
    """
    count = len(states)
    e1, y, d = states[:, :3].T
    under_way = states[:, 3] if states.shape[1] > 3 else np.zeros(count)
    r_rate = fault.fastest * random.choice([0.0, 1.0], count)
    per_rate = 1 / (loop.gain * fault.held * fault.authority)
    seen = np.maximum(y - loop.creep * random.choice([0.0, 1.0], count), 0)
    if loop.late:  # what the law expects of the next sample, under the pressure that begins to act now
        ahead = np.maximum(fault.decay * seen + (d - under_way) / per_rate, 0)
        expected = e1 + fault.step * ((seen + ahead) / 2 - r_rate)
    else:
        ahead, expected = seen, e1
    target = r_rate - loop.back / fault.step * expected
    asked = per_rate * (fault.decay * ahead - target) + d  # U of the pressure that is asked for
    acting = under_way if loop.late else asked
    predicted = ahead if loop.late else np.maximum(target, 0)
    beta = random.choice([1.0, fault.beta], count)
    slope, other = random.choice(fault.slopes, (2, count))
    turn, sign = random.uniform(0, 1, count), random.choice([-1.0, 1.0], count)
    turn = np.where(random.random(count) < 0.3, 1.0, turn)
    length = fault.step * (random.choice([1.0, loop.longest], count) if loop.longest > 1 else 1.0)
    h, moved, now, pressed = length / SUBSTEPS, np.zeros(count), y.copy(), 0 * y + (under_way if loop.lag else acting)
    lost, fades = np.zeros(count), np.exp(-h / loop.lag) if loop.lag else 0.0
    for i in range(SUBSTEPS):
        early = (i + 0.5) / SUBSTEPS < turn
        pressed = asked + (pressed - asked) * fades if loop.lag else pressed
        push = np.where(early, sign, -sign) * fault.amplitude
        force = push - fault.authority * beta * pressed + lost - fault.damping * now
        rests = (now <= 0) & (force <= 0)
        end = now + h * force
        stops = end < 0
        way = np.where(stops, np.where(force < 0, now**2 / (2 * np.maximum(-force, 1e-300)), 0), h * (now + end) / 2)
        way = np.where(rests, 0, way)
        now = np.where(rests | stops, 0, end)
        moved, lost = moved + way, lost + np.where(early, slope, other) * way
    innovation = moved - fault.step * (seen + predicted) / 2
    innovation = np.where(now <= loop.creep, np.maximum(innovation, -fault.step * predicted / 2), innovation)
    lifted = lost / (fault.authority * beta)  # p* of the slip at the end less that at the start
    read = np.maximum(now - loop.creep * random.choice([0.0, 1.0], count), 0)
    level = d + per_rate * loop.level * (read - predicted) + per_rate * loop.slip / fault.step * innovation - lifted
    columns = [e1 + moved - length * r_rate, now, level]
    if states.shape[1] > 3:
        columns.append((asked if loop.late else pressed) - lifted)
    return np.column_stack(columns)


def reached(fault, loop, seed=0):
    """Extents of the reached states, whether they have settled, and the facets of their hull."""
    random = np.random.default_rng(seed)
    size = 4 if loop.late or loop.lag else 3
    directions = random.normal(size=(DIRECTIONS, size))
    states, before, settled = np.zeros((1, size)), None, False
    for _ in range(ROUNDS):
        more = [period(fault, loop, np.repeat(states, 12, axis=0), random) for _ in range(4)]
        states = np.vstack([states, *more])
        scale = np.abs(states).max(axis=0) + 1e-300
        states = states[np.unique((directions @ (states / scale).T).argmax(axis=1))]
        extent = np.concatenate([states.max(axis=0), -states.min(axis=0)])
        settled = before is not None and bool(np.all(extent <= before + SETTLED * np.tile(scale, 2)))
        before = extent
        if not np.isfinite(extent).all() or extent[1] > 1:
            return extent, False, None
    return before, settled, len(ConvexHull(states / scale, qhull_options="QJ").equations)


def rows():
    """Loops by name."""
    yield Loop("as in the theorem")
    for noise in (1e-6, 5e-6, 2e-5):
        yield Loop(f"slip rate within {noise:g} m/s", creep=2 * noise)
    late = Loop("one period of delay", late=True)
    yield late
    yield replace(late, name="one period of delay, slower estimate", level=0.2, slip=0.2, back=0.1, gain=1.425)
    yield Loop("lag of 0.05 s", lag=0.05)
    yield Loop("lag of 0.05 s, slower estimate", lag=0.05, level=0.3, slip=0.3, back=0.1, gain=1.425)
    yield Loop("lag of 0.2 s, slower estimate", lag=0.2, level=0.2, slip=0.2, back=0.1, gain=1.425)
    yield Loop("samples T to 1.2T apart", longest=1.2)
    yield Loop("samples T to 2T apart", longest=2.0)
    yield Loop("samples T to 2T apart, slower estimate", longest=2.0, level=0.2, slip=0.2, back=0.1, gain=1.425)


def row(loop):
    """Cells of a row."""
    extent, settled, facets = reached(Fault(), loop)
    half = len(extent) // 2
    if facets is None:
        return loop.name, str(half), "diverges", "", "", ""
    errors = f"{extent[half]:.2g} … {extent[0]:.2g} m"
    return loop.name, str(half), f"{extent[1]:.2g} m/s", errors, "yes" if settled else "no", str(facets)


if __name__ == "__main__":
    print(f"| {' | '.join(HEAD)} |\n|{'---|' * len(HEAD)}")
    for one in rows():
        if not sys.argv[1:] or any(word in one.name for word in sys.argv[1:]):
            print(f"| {' | '.join(row(one))} |", flush=True)
