"""Bounds of a period of the stick-slip plant in the standalone checker, against courses of such plants."""

from functools import cache

import numpy as np
import pytest
from stick_slip_box import STICK, box, period_of

ONE = float(STICK.ONE)
COURSES, STEPS = 3000, 400


@cache
def period():
    return period_of(box())


def switching(random, low, high, often):
    """A number in a range that jumps between its ends, or stays at one of them."""
    flips = np.cumsum(random.random((STEPS, COURSES)) < often * random.integers(0, 2, COURSES) * 4 / STEPS, axis=0)
    at = (flips + random.integers(0, 2, COURSES)) % 2
    return low + (high - low) * at


@cache
def courses(seed):
    """One period each of many plants: state, slice and target rate before, state after, slip, and how it ended."""
    p, random = period(), np.random.default_rng(seed)
    law = {name: float(getattr(p.law, name)) for name in ("step", "rate", "target", "back", "level", "slip")}
    b, beta1, force = float(p.task.b), float(p.task.beta[1]), float(p.force)
    corner = random.integers(0, 2, (3, COURSES)) + 0.0
    share = np.where(random.random((3, COURSES)) < 0.5, corner, random.random((3, COURSES)))
    e1 = -float(p.behind) + share[0] * float(p.behind + p.ahead)
    e1 = np.where(random.random(COURSES) < 0.2, random.uniform(0, 0.15, COURSES), e1)
    y, d = share[1] * float(p.peak), (2 * share[2] - 1) * float(p.level)
    turn, rate = float(p.rate / p.law.back), float(p.rate)
    place = np.where(e1 <= 0, 0, np.where(e1 <= turn, 1, 2))
    # r' at an end of its range, where v changes its sign, and where the reference may just have come to rest
    way = random.integers(0, 4, COURSES)
    r = np.select([way == 0, way == 1, (way == 2) & (place == 1)], [0.0, rate, law["back"] * e1], 0.0)
    kink = (way == 3) & (law["step"] * float(p.bend) / 2 <= rate)
    r = np.where(kink, law["step"] * float(p.bend) / 2, r)
    late = float(p.bend) * law["step"] ** 2 / 2 * random.choice([-1, 1], COURSES)
    moved = np.maximum(law["step"] * r + np.where(kink, -abs(late), late), 0)
    v = r - law["back"] * e1
    push = d + law["rate"] * y - law["target"] * v
    beta = np.where(random.random(COURSES) < 0.7, random.choice([1, beta1], COURSES), random.uniform(1, beta1, COURSES))
    chord = random.choice([float(c) for c in p.chord], COURSES)
    slope = switching(random, *map(float, p.slope), 1.0)
    damping = switching(random, *map(float, p.damping), 1.0)
    phi = switching(random, -force, force, 1.0)
    rate_now, slip, pull, h = y.copy(), np.zeros(COURSES), -b * beta * push, law["step"] / STEPS
    for k in range(STEPS):
        gain = pull + phi[k] - damping[k] * rate_now
        after = np.maximum(rate_now + h * gain, 0)
        step = h * (rate_now + after) / 2
        slip, pull, rate_now = slip + step, pull + slope[k] * step, after
    rests = (rate_now == 0) & (pull < -force)
    predicted = np.maximum(v, 0)
    innovation = slip - law["step"] * (y + predicted) / 2
    innovation = np.where(rate_now == 0, np.maximum(innovation, -law["step"] * predicted / 2), innovation)
    sigma = chord / b / beta
    after = np.array([
        e1 + slip - moved,
        rate_now,
        d + law["level"] * (rate_now - predicted) + law["slip"] * innovation - sigma * slip,
    ])  # fmt: skip
    return np.array([e1, y, d]), place, v, after, slip, rests


def number(value):
    return value.at / ONE


def values(functions, points):
    """Largest of some functions at every point."""
    found = []
    for function in functions:
        row = [float(v) + number(m) for v, m in zip(function.row, function.more, strict=True)]
        found.append(np.dot(row, points) + float(function.constant) + number(function.beside))
    return np.max(found, axis=0)


SLACK = 2e-4  # of the integration, in units of a facet


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("facet", range(11))
def test_no_plant_that_slides_is_beyond_its_bound(facet, seed):
    p, (before, place, _, after, _, rests) = period(), courses(seed)
    row, given = p.reach.facets[facet], p.reach.multipliers[facet]
    reached = np.array([float(n) for n in row]) @ after
    nearest = []
    for one in range(3):
        bounds = {}
        for cut in (False, True) if row[2] > 0 else (False,):
            every = [f for slot, f in p.sliding(row, given, cut) if slot == one]
            bounds[cut] = values(every, before)
        mine = (place == one) & ~rests
        bound = bounds[False]
        if row[2] > 0:
            bound = np.where(after[1] == 0, np.maximum(bound, bounds[True]), bound)
        over = (reached - bound)[mine]
        assert over.max() <= SLACK
        nearest.append(over.max())
    assert max(nearest) > -0.04  # as sharp as that


@pytest.mark.parametrize("facet", range(11))
def test_no_plant_that_ends_at_rest_is_beyond_its_bound(facet):
    p, (before, place, v, after, slip, rests) = period(), courses(3)
    row, given = p.reach.facets[facet], p.reach.multipliers[facet]
    reached = np.array([float(n) for n in row]) @ after
    points = np.vstack([before, slip])
    assert rests.sum() > 200
    assert (slip[rests] > 0.01).sum() > 50
    for one, positive, (polytope, ends) in zip((0, 1, 1, 2), (1, 1, 0, 0), p.resting(), strict=True):
        mine = (place == one) & rests & ((v >= 0) == positive)
        if one == 0:
            mine = (place == 0) & rests
        if not mine.any():
            continue
        bound = values([f for end in ends for f in p.stopped(row, given, end)], points)
        assert (reached - bound)[mine].max() <= SLACK
        rows = np.array([[float(v) for v in line] for line, _ in polytope.lines])
        limits = np.array([float(end) for _, end in polytope.lines])
        assert (rows @ points - limits[:, None])[-7:, mine].max() <= SLACK  # condition of rest, slip until the stop
