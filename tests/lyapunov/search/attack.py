"""Tries to break a certificate, knowing only its text: samples V and V̇, and runs the loop against its worst case.

Everything here is floating point and shares no code with the package. It proves nothing; a violation refutes.
"""

import json
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

import numpy as np

TOLERANCE = 1e-9  # relative to the sum of the sizes of all terms


@dataclass(frozen=True)
class Claim:
    """A certificate's statement, in floats."""

    states: list[str]
    weights: np.ndarray
    lifts: list
    field: list
    V: list
    ranges: dict[str, tuple[float, float]]
    claims: dict[str, float]

    @classmethod
    def read(cls, text):
        raw = json.loads(text)
        numbers = {n: float(Fraction(v)) for n, v in (raw["gains"] | raw["constants"]).items()}
        order = {s: i for i, s in enumerate([*raw["states"], *raw["lifts"]])}
        roots = {n: ends for n, (_, *ends) in raw["roots"].items()}
        numbers |= {n: float(Fraction(low)) for n, (low, high) in roots.items() if low == high}

        def term(entry):
            coefficient, names, factors = entry
            known = float(Fraction(coefficient)) * np.prod([numbers[n] for n in names if n in numbers])
            powers = {order[s]: (float(Fraction(a)), kind == "s") for s, a, kind in factors}
            return float(known), [n for n in names if n not in numbers], powers

        return cls(
            states=list(raw["states"]),
            weights=np.array(list(raw["states"].values()), dtype=float),
            lifts=[[t for t in map(term, terms) if t[0]] for terms in raw["lifts"].values()],
            field=[[term(t) for t in raw["field"][s]] for s in raw["states"]],
            V=[term(t) for t in raw["V"]],
            ranges={n: tuple(float(Fraction(v)) for v in ends) for n, ends in (raw["uncertain"] | roots).items()},
            claims={n: float(Fraction(v)) for n, v in raw["claims"].items()},
        )

    @property
    def degree(self):
        """Degree m of V."""
        _, _, powers = self.V[0]
        return sum(a * self.weights[i] for i, (a, _) in powers.items())

    @property
    def vertices(self):
        return [dict(zip(self.ranges, ends, strict=True)) for ends in product(*self.ranges.values())]


class Points:
    """Points by size and sign of every state, so that 0 has a sign: the limit from that side; then the lifts alike."""

    def __init__(self, claim, sizes, signs, rng):
        self.sizes, self.signs, self._powers = list(sizes), list(signs), {}
        self.sides = list(signs)
        for terms in claim.lifts:
            argument, size = value(terms, self)
            self.sizes.append(np.abs(argument))
            self.signs.append(np.sign(argument))
            at_random = rng.choice((-1.0, 1.0), size=argument.shape)
            self.sides.append(np.where(np.abs(argument) <= 1e-14 * size, at_random, np.sign(argument)))

    def power(self, i, exponent, signed):
        key = i, exponent
        if key not in self._powers:
            self._powers[key] = self.sizes[i] ** exponent
        return self._powers[key] * (self.signs if exponent else self.sides)[i] if signed else self._powers[key]


def gradient(V, points, i):
    """∂V/∂x_i by the power rule, and the sum of the sizes of its terms."""
    total = magnitude = 0.0
    for coefficient, _, powers in V:
        if i not in powers:
            continue
        part = coefficient
        for j, (exponent, signed) in powers.items():
            if j == i:
                part = part * exponent * points.power(j, exponent - 1, not signed)
            else:
                part = part * points.power(j, exponent, signed)
        total, magnitude = total + part, magnitude + np.abs(part)
    return total, magnitude


def value(terms, points, parameters=None):
    """Sum of terms, and the sum of their sizes."""
    total = magnitude = np.zeros(points.sizes[0].shape)
    for coefficient, names, powers in terms:
        part = coefficient * (parameters[names[0]] if len(names) == 1 else np.prod([parameters[n] for n in names]))
        for j, (exponent, signed) in powers.items():
            part = part * points.power(j, exponent, signed)
        total, magnitude = total + part, magnitude + np.abs(part)
    return total, magnitude


def sphere(claim, count, rng):
    """Points with Σ|x_i|^{1/r_i} = 1: spread out, very near to the switching surfaces, and on them from either side."""
    n = len(claim.states)
    u = rng.exponential(size=(n, count))
    third = count // 3
    u[:, third:] *= 10.0 ** rng.uniform(-6, 0, size=(n, count - third))
    u[:, 2 * third :] *= rng.random((n, count - 2 * third)) > 0.4
    lost = u.sum(axis=0) == 0
    u[rng.integers(n, size=lost.sum()), np.flatnonzero(lost)] = 1.0
    signs = rng.choice((-1.0, 1.0), size=(n, count))
    for lift in range(len(claim.lifts)):
        _onto(claim, lift, u[:, lift::4], signs[:, lift::4], rng)
    u /= u.sum(axis=0)
    return u, Points(claim, u ** claim.weights[:, None], signs, rng)


def _onto(claim, lift, u, signs, rng):
    """Move points, in place, onto a zero of a lift's argument between them and their shuffled neighbours, if any."""

    def argument(v):
        points = Points(claim, np.abs(v) ** claim.weights[:, None], np.sign(v), rng)
        return points.sizes[len(v) + lift] * points.signs[len(v) + lift]

    low, high = u * signs, np.roll(u * signs, 1, axis=1)
    crossing = argument(low) * argument(high) < 0
    for _ in range(60):
        middle = (low + high) / 2
        same = argument(middle) * argument(low) > 0
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    u[:, crossing], signs[:, crossing] = np.abs(low[:, crossing]), np.where(low < 0, -1.0, 1.0)[:, crossing]


def sample(claim, count=100_000, seed=0, chunk=100_000):
    """Names of the claims that fail somewhere on the sphere, with the worst excess; empty if none does."""
    rng = np.random.default_rng(seed)
    worst = {}
    for begin in range(0, count, chunk):
        for name, excess in _excesses(claim, *sphere(claim, min(chunk, count - begin), rng), rng):
            top = float(excess.max())
            if top > 0:
                worst[name] = max(top, worst.get(name, 0.0))
    return worst


def _excesses(claim, u, points, rng):
    """By how much every claim is missed at each point, beyond rounding; not positive where it holds."""
    m = claim.degree
    V, size = value(claim.V, points)
    yield "positive", claim.claims["positive"] * (u**m).sum(axis=0) - V - TOLERANCE * size
    for i, state in enumerate(claim.states):
        if f"bound_{state}" in claim.claims:
            yield f"bound_{state}", claim.claims[f"bound_{state}"] * u[i] ** m - V - TOLERANCE * size
    gradients = [gradient(claim.V, points, i) for i in range(len(claim.states))]
    inside = {n: rng.uniform(low, high) for n, (low, high) in claim.ranges.items()}
    needed = claim.claims["decrease"] * (u ** (m - 1)).sum(axis=0)
    for parameters in (*claim.vertices, inside):
        rate = size = 0.0
        for terms, (slope, slope_size) in zip(claim.field, gradients, strict=True):
            speed, speed_size = value(terms, points, parameters)
            rate, size = rate + slope * speed, size + slope_size * speed_size
        yield "decrease", rate + needed - TOLERANCE * size
        if "decay" in claim.claims:
            yield "decay", rate + claim.claims["decay"] * np.maximum(V, 0) ** (1 - 1 / m) - TOLERANCE * size


def settling_bound(claim, V):
    """T(V0) from the claims alone: V̇ ≤ −κV^{(m−1)/m}, κ claimed or at least that of the crudest estimate of V.

    V ≤ CΣu^m with C the sum of |coefficients|, and Σu^{m−1} ≥ (V/C)^{(m−1)/m}.
    """
    m, C = claim.degree, sum(abs(c) for c, _, _ in claim.V)
    crude = claim.claims["decrease"] / C ** ((m - 1) / m)
    return m * V ** (1 / m) / claim.claims.get("decay", crude)


def simulate(claim, trajectories=24, steps=3_000, pace=4e-3, seed=0):
    """Run the loop while parameters jump between their ends: against V, against the size, and at random.

    Time steps follow the size of the state, pace·Σ|x_i|^{1/r_i}, so that chatter stays small beside it.

    Returns
    -------
    share : float
        Longest time until V^{1/m} fell to a half, or time run without, as a share of the certified settling time.
    rise : float
        Largest V over its smallest value before, less 1: what the steps' chatter explains, or a violation.
    settled : bool
        Whether V^{1/m} fell to a half in every run.
    """
    rng = np.random.default_rng(seed)
    _, points = sphere(claim, trajectories, rng)
    x = np.array([size * sign for size, sign in zip(points.sizes, points.signs, strict=True)][: len(claim.states)])
    strategy, everyone = np.arange(trajectories) % 3, np.arange(trajectories)
    corners, m = claim.vertices, claim.degree
    first = least = value(claim.V, points)[0]
    time, reached, rise = np.zeros(trajectories), np.full(trajectories, np.inf), 0.0
    for _ in range(steps):
        at = Points(claim, np.abs(x), np.sign(x), rng)
        V = value(claim.V, at)[0]
        rise, least = max(rise, float((V / least).max()) - 1), np.minimum(least, V)
        reached[(V <= first / 2**m) & np.isinf(reached)] = time[(V <= first / 2**m) & np.isinf(reached)]
        if np.isfinite(reached).all():
            break
        speeds = np.array([[value(f, at, corner)[0] for f in claim.field] for corner in corners])
        slopes = np.array([gradient(claim.V, at, i)[0] for i in range(len(x))])
        outward = np.sign(x) * np.abs(x) ** (2 / claim.weights[:, None] - 1 + 2 * (x == 0))
        choices = np.array(
            [
                np.argmax((speeds * slopes).sum(axis=1), axis=0),
                np.argmax((speeds * outward).sum(axis=1), axis=0),
                rng.integers(len(corners), size=trajectories),
            ]
        )
        step = pace * (np.abs(x) ** (1 / claim.weights[:, None])).sum(axis=0)
        x = x + step * speeds[choices[strategy, everyone], :, everyone].T
        time = time + step
    share = float((np.minimum(reached, time) / settling_bound(claim, first)).max())
    return share, rise, bool(np.isfinite(reached).all())
