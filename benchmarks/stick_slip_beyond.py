"""Loops beyond the theorem of the stick–slip plant: which states disturbances reach, and how large a polytope would be.

    python benchmarks/stick_slip_beyond.py [WORDS OF ROWS]

Floating point; nothing here is a proof. For each loop a law like that of the theorem is run on the real fault at 184 ms
under disturbances that turn within periods, friction at either end of its slopes, and either end of the input gain. In
each round the states that are farthest in 600 directions are continued. Printed are the dimension of the state at the
samples, the largest slip rate and slip errors that are reached, whether these have stopped growing, and the facets of
the convex hull of the reached states: a polytope of the theorem needs about as many, and the theorem takes at most 400.

A delay of one period adds the pressure that is under way to the state. A lag adds the pressure in the fault. With a
slip rate that is measured within M the law reads max(measured − M, 0), so that it reads 0 at rest.

Rock between well and fault has eight modes, which make 12 states. *One mode*: the slowest and the well's pressure are
states, and the others an input, bounded by the largest step of the well so far; 5 states. *Held at rest*: while the law
expects rest, the well holds what it takes for the pressure of release, raised by 0.2H a period while the fault is
behind. The hull is that of slip error, slip rate, level, slowest mode and well alone, of at most 600 states.
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
    level: float = 0.5
    slip: float = 0.5
    back: float = 0.3
    gain: float = 1.3
    path: float = 0.0  # L²/D [s] of the rock between well and fault
    reduced: bool = False  # of the path one mode alone, the others as bounded inputs
    rounds: int = ROUNDS
    ramp: float = 0.0  # share of H that the held pressure gains in a period at rest


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
        self.step_seen = 0.0  # largest step of the well
        self.held = (1 - self.decay) / self.damping


def slide(fault, loop, y, pressed, random):
    """Slip rate, slip and rise of p* after a period; `pressed` is U in the fault at a time of it."""
    count = len(y)
    beta = random.choice([1.0, fault.beta], count)
    slope, other = random.choice(fault.slopes, (2, count))
    turn, sign = random.uniform(0, 1, count), random.choice([-1.0, 1.0], count)
    turn = np.where(random.random(count) < 0.3, 1.0, turn)
    h, moved, now, lost = fault.step / SUBSTEPS, np.zeros(count), y.copy(), np.zeros(count)
    for i in range(SUBSTEPS):
        early = (i + 0.5) / SUBSTEPS < turn
        push = np.where(early, sign, -sign) * fault.amplitude
        force = push - fault.authority * beta * pressed((i + 1) * h) + lost - fault.damping * now
        rests = (now <= 0) & (force <= 0)
        end = now + h * force
        stops = end < 0
        way = np.where(stops, np.where(force < 0, now**2 / (2 * np.maximum(-force, 1e-300)), 0), h * (now + end) / 2)
        way = np.where(rests, 0, way)
        now = np.where(rests | stops, 0, end)
        moved, lost = moved + way, lost + np.where(early, slope, other) * way
    return now, moved, lost / (fault.authority * beta)


def through_rock(fault, loop, states, random):
    """As `period`, behind a diffusion path; columns e1, y, d and then U, which stands for p* less a pressure.

    It is that of the slowest mode less d, of the well less the slowest mode, and of faster modes less the slowest.

    The law knows the slowest mode alone. It expects the slip rate of half the path's time and a period later, under the
    pressure of now, and moves the pressure so that this slip rate becomes the target.
    """
    count = len(states)
    e1, y, d, slow, held = states[:, :5].T
    slow = slow + d
    held, faster = held + slow, states[:, 5:] + slow[:, None]
    rates, shares = modes(loop.path)
    slip, ahead, behind, effect = e1, y, held - slow, 0.0  # what the fault lacks of the well's pressure, over c0
    r_rate = fault.fastest * random.choice([0.0, 1.0], count)
    per_rate = 1 / (loop.gain * fault.held * fault.authority)
    fades = np.exp(-rates[0] * fault.step)
    mean = shares[0] * (1 - fades) / (rates[0] * fault.step)  # of what is lacking, in a period
    many, left = round(loop.path / 2 / fault.step), 1.0
    for i in range(many + 1):
        before, ahead = ahead, fault.decay * ahead + (d - held + mean * behind) / per_rate
        effect = fault.decay * effect + (1 - mean * left) / per_rate
        behind, left = behind * fades, left * fades
        if i < many:
            ahead = np.maximum(ahead, 0)
            slip = slip + fault.step * ((before + ahead) / 2 - r_rate)
    target = r_rate - loop.back / fault.step * slip
    asked = held + (ahead - target) / effect
    if loop.ramp:  # at rest and expected to rest: the well holds what releases the fault, and more if it is behind
        more = loop.ramp * fault.amplitude / fault.authority
        rest = (y <= 0) & (np.maximum(ahead, 0) <= 0)
        asked = np.where(rest, np.where(slip < 0, np.minimum(held, d) - more, d), asked)
    predicted = np.maximum(fault.decay * y + (d - asked + mean * (asked - slow)) / per_rate, 0)
    lacks = asked[:, None] - np.column_stack([slow, faster])
    fault.step_seen = max(fault.step_seen, float(np.abs(asked - held).max()))
    sign, turn = random.choice([-1.0, 1.0], count), fault.step * random.uniform(0, 1, count)

    def pressed(time):
        kept = sum(c * np.exp(-k * time) * v for c, k, v in zip(shares, rates, lacks.T, strict=False))
        if not loop.reduced:
            return asked - kept
        most = fault.step_seen * abs(shares[1]) * np.exp(-rates[1] * time) / (1 - np.exp(-rates[1] * fault.step))
        return asked - kept + np.where(time < turn, sign, -sign) * most

    now, moved, lifted = slide(fault, loop, y, pressed, random)
    innovation = moved - fault.step * (y + predicted) / 2
    innovation = np.where(now <= 0, np.maximum(innovation, -fault.step * predicted / 2), innovation)
    level = d + per_rate * (loop.level * (now - predicted) + loop.slip / fault.step * innovation) - lifted
    after = asked[:, None] - lacks * np.exp(-rates[: lacks.shape[1]] * fault.step)
    slow = after[:, 0]
    first = [e1 + moved - fault.step * r_rate, now, level, slow - lifted - level, asked - slow]
    return np.column_stack([*first, after[:, 1:] - slow[:, None]])


def modes(path):
    """Rates and shares of the modes of a layer."""
    odd = 2 * np.arange(8) + 1
    return (odd * np.pi / 2) ** 2 / path, 4 / np.pi * (-1.0) ** np.arange(8) / odd


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

    def pressed(time):
        return asked + (under_way - asked) * np.exp(-time / loop.lag) if loop.lag else acting

    now, moved, lifted = slide(fault, loop, y, pressed, random)
    innovation = moved - fault.step * (seen + predicted) / 2
    innovation = np.where(now <= loop.creep, np.maximum(innovation, -fault.step * predicted / 2), innovation)
    read = np.maximum(now - loop.creep * random.choice([0.0, 1.0], count), 0)
    level = d + per_rate * loop.level * (read - predicted) + per_rate * loop.slip / fault.step * innovation - lifted
    columns = [e1 + moved - fault.step * r_rate, now, level]
    if states.shape[1] > 3:
        columns.append(pressed(fault.step) - lifted)
    return np.column_stack(columns)


def reached(fault, loop, seed=0):
    """Extents of the reached states, whether they have settled, and the facets of their hull."""
    random = np.random.default_rng(seed)
    size, after = 4 if loop.late or loop.lag else 3, period
    if loop.path:
        size, after = 5 if loop.reduced else 12, through_rock
    directions = random.normal(size=(DIRECTIONS, size))
    directions[:, 5:] *= 0.2  # the faster modes of a path are nearly one
    states, before, settled = np.zeros((1, size)), None, False
    for _ in range(loop.rounds):
        more = [after(fault, loop, np.repeat(states, 12, axis=0), random) for _ in range(4)]
        states = np.vstack([states, *more])
        scale = np.abs(states).max(axis=0) + 1e-300
        states = states[np.unique((directions @ (states / scale).T).argmax(axis=1))]
        extent = np.concatenate([states.max(axis=0), -states.min(axis=0)])
        settled = before is not None and bool(np.all(extent <= before + SETTLED * np.tile(scale, 2)))
        before = extent
        if not np.isfinite(extent).all() or extent[1] > 1:
            return extent, False, None
    return before, settled, len(ConvexHull((states / scale)[:, :5], qhull_options="QJ").equations)


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
    for path in (0.3, 1.0, 2.0):
        rock = Loop(f"rock of {path:g} s, all modes", path=path, rounds=100)
        yield rock
        yield replace(rock, name=f"rock of {path:g} s, one mode", reduced=True, rounds=300)
        yield replace(rock, name=f"rock of {path:g} s, held at rest", ramp=0.2, rounds=300)
    slower = replace(rock, level=0.2, slip=0.2, back=0.1, gain=1.425)
    yield replace(slower, name="rock of 2 s, all modes, slower estimate")
    yield replace(slower, name="rock of 2 s, one mode, slower estimate", reduced=True, rounds=300)


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
