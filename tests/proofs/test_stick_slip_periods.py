"""Bounds of a period of the stick-slip plant in both checkers, against courses of such plants."""

from collections import defaultdict
from contextlib import nullcontext
from copy import copy
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import chain

import numpy as np
import pytest
from flint import ctx
from stick_slip_box import CHECK, STICK, box, period_of
from thinned import few

from quakedesign.guarantees import read_guarantee
from quakedesign.guarantees.exact import stick_slip_set as package

ONE = float(STICK.ONE)
COURSES, STEPS = 3000, 400


PERIODIC = pytest.mark.parametrize("noisy", [False, True], ids=["exact", "noisy"])
NOISY = pytest.mark.parametrize("noisy", [False, True, "aperiodic"], ids=["exact", "noisy", "aperiodic"])


@cache
def period(noisy=False):
    return period_of(box(noisy))


def slides(p, row, given, cut):
    """What a facet becomes in a slide over each of the intervals that decide, by the standalone checker."""
    for interval in p.law.intervals:
        p.respond(interval)
        yield from p.sliding(row, given, cut)


def switching(random, low, high, often):
    """A number in a range that jumps between its ends, or stays at one of them."""
    flips = np.cumsum(random.random((STEPS, COURSES)) < often * random.integers(0, 2, COURSES) * 4 / STEPS, axis=0)
    at = (flips + random.integers(0, 2, COURSES)) % 2
    return low + (high - low) * at


def noise(random, size):
    """Errors within a bound, many of them as large as it."""
    share = np.where(random.random(COURSES) < 0.7, random.choice([-1, 1], COURSES), random.uniform(-1, 1, COURSES))
    return size * share


@cache
def courses(seed, noisy=False):
    """One period each of many plants: state, slice and target rate before, state after, slip, and how it ended."""
    p, random = period(noisy), np.random.default_rng(seed)
    names = ("step", "rate", "target", "back", "level", "slip", "rest_slip", "slip_noise")
    law = {name: float(getattr(p.law, name)) for name in names}
    b, beta1, force = float(p.task.b), float(p.task.beta[1]), float(p.force)
    corner = random.integers(0, 2, (3, COURSES)) + 0.0
    share = np.where(random.random((3, COURSES)) < 0.5, corner, random.random((3, COURSES)))
    e1 = -float(p.behind) + share[0] * float(p.behind + p.ahead)
    e1 = np.where(random.random(COURSES) < 0.2, random.uniform(0, 0.15, COURSES), e1)
    y, d = share[1] * float(p.peak), (2 * share[2] - 1) * float(p.level)
    off, later = (noise(random, law["slip_noise"]) for _ in range(2))
    interval = np.full(COURSES, law["step"])
    if p.law.longest:
        interval = random.uniform(law["step"], float(p.law.longest), COURSES)
    turn, rate = float(p.rate / p.law.back), float(p.task.reference_rate)
    place = np.where(e1 <= 0, 0, np.where(e1 <= turn, 1, 2))
    # r' at an end of its range, where v changes its sign, and where the reference may just have come to rest
    way = random.integers(0, 4, COURSES)
    r = np.select([way == 0, way == 1, (way == 2) & (place == 1)], [0.0, rate, np.clip(law["back"] * e1, 0, rate)], 0.0)
    kink = (way == 3) & (interval * float(p.bend) / 2 <= rate)
    r = np.where(kink, interval * float(p.bend) / 2, r)
    late = float(p.bend) * interval**2 / 2 * random.choice([-1, 1], COURSES)
    moved = np.maximum(interval * r + np.where(kink, -abs(late), late), 0)
    v = r - law["back"] * (e1 - law["slip_noise"] + off)
    level = d + law["slip"] * off
    push = level + law["rate"] * y - law["target"] * v
    beta = np.where(random.random(COURSES) < 0.7, random.choice([1, beta1], COURSES), random.uniform(1, beta1, COURSES))
    chord = random.choice([float(c) for c in p.chord], COURSES)
    slope = switching(random, *map(float, p.slope), 1.0)
    damping = switching(random, *map(float, p.damping), 1.0)
    phi = switching(random, -force, force, 1.0)
    rate_now, slip, pull, h = y.copy(), np.zeros(COURSES), -b * beta * push, interval / STEPS
    for k in range(STEPS):
        gain = pull + phi[k] - damping[k] * rate_now
        after = np.maximum(rate_now + h * gain, 0)
        step = h * (rate_now + after) / 2
        slip, pull, rate_now = slip + step, pull + slope[k] * step, after
    rests = (rate_now == 0) & (pull < -force)
    predicted = np.maximum(v, 0)
    innovation = slip + later - off - law["step"] * (y + predicted) / 2
    lowest = -law["step"] * predicted / 2 - law["rest_slip"]
    innovation = np.where(rate_now == 0, np.maximum(innovation, lowest), innovation)
    level = level + law["level"] * (rate_now - predicted) + law["slip"] * innovation
    sigma = chord / b / beta
    after = np.array([
        e1 + slip - moved,
        rate_now,
        level - law["slip"] * later - sigma * slip,
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


@few("seed", [1, 2], every=2)
@few("facet", range(11), every=2)
@NOISY
def test_no_plant_that_slides_is_beyond_its_bound(facet, seed, noisy):
    p, (before, place, _, after, _, rests) = period(noisy), courses(seed, noisy)
    row, given = p.reach.facets[facet], p.reach.multipliers[facet]
    reached = np.array([float(n) for n in row]) @ after
    nearest = []
    for one in range(3):
        bounds = {}
        for cut in (False, True) if row[2] > 0 else (False,):
            every = [f for slot, f in slides(p, row, given, cut) if slot == one]
            bounds[cut] = values(every, before)
        mine = (place == one) & ~rests
        bound = bounds[False]
        if row[2] > 0:
            bound = np.where(after[1] == 0, np.maximum(bound, bounds[True]), bound)
        over = (reached - bound)[mine]
        assert over.max() <= SLACK
        nearest.append(over.max())
    assert max(nearest) > {False: -0.04, True: -0.2, "aperiodic": -0.4}[noisy]  # as sharp as that


@pytest.mark.parametrize("facet", range(11))
@NOISY
def test_no_plant_that_ends_at_rest_is_beyond_its_bound(facet, noisy):
    p, (before, place, v, after, slip, rests) = period(noisy), courses(3, noisy)
    row, given = p.reach.facets[facet], p.reach.multipliers[facet]
    reached = np.array([float(n) for n in row]) @ after
    points = np.vstack([before, slip])
    assert rests.sum() > 200
    assert (slip[rests] > 0.01).sum() > 40
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


@pytest.mark.parametrize("apart", [8, pytest.param(2, marks=pytest.mark.slow)])
def test_bounds_at_the_intervals_that_decide_hold_for_all_between(apart):
    """Beside a grid of intervals, where the bounds of some facets are larger than at the intervals that decide."""
    p, (before, place, *_) = period("aperiodic"), courses(1, "aperiodic")
    plain, larger = copy(p), set()
    plain.margin = [STICK.Near.of(Fraction(0))] * 2
    for facet, (row, given) in enumerate(zip(p.reach.facets, p.reach.multipliers, strict=True)):
        for one in range(3):
            mine = before[:, place == one]

            def bound(functions, one=one, mine=mine):
                return values([f for slot, f in functions if slot == one], mine)

            decided, alone = (bound(slides(each, row, given, cut=False)) for each in (p, plain))
            for share in range(1, 24, apart):
                plain.respond(p.law.step + Fraction(share, 24) * (p.law.longest - p.law.step))
                found = bound(plain.sliding(row, given, cut=False))
                assert (found - decided).max() <= 1e-9
                larger |= {facet} if (found - alone).max() > 1e-6 else set()
    assert len(larger) >= 3


@cache
def packages(noisy=False):
    """What every facet becomes by the package's functions, by slice or combination and whether the cut-off counts."""
    claim = read_guarantee(box(noisy))
    task, held, reach, own = claim.task, claim.sampled_loop, claim.invariant_set, period(noisy)
    moved = task.reference_rates[0] * held.longest
    found = package.ranges(task, reach.box[0] + moved, own.push, reach.box[1] * held.longest)
    given = [[list(row) for row in rows] for rows in (reach.facets, reach.multipliers)]
    functions = defaultdict(list)
    with ctx.workprec(package.BITS):
        periods = package.Period.deciding(package.BALLS, task, held, found, reach.box[1], own.push)
        sliding = [package.sliding_rows(one, *map(package._ball_array, given)) for one in periods]
        resting = package.resting_rows(package.EXACT, task, held, found, *map(package._exact_array, given))
        for rows in chain(*sliding, resting):
            for facet, row, constant in zip(rows.which, rows.factors, rows.constants, strict=True):
                functions[rows.place, facet, rows.cut].append(([float(v) for v in row], float(constant)))
    return functions


def most(listed, points):
    return np.max([np.dot(row, points) + constant for row, constant in listed], axis=0)


@pytest.mark.parametrize("facet", range(11))
@NOISY
def test_no_plant_is_beyond_the_bounds_of_the_package(facet, noisy):
    functions, row = packages(noisy), period(noisy).reach.facets[facet]
    for seed in (1, 2, 3):
        before, place, v, after, slip, rests = courses(seed, noisy)
        reached = np.array([float(n) for n in row]) @ after
        for one in range(3):
            bound = most(functions[one, facet, False], before)
            if row[2] > 0:
                cut = most(functions[one, facet, True], before)
                bound = np.where(after[1] == 0, np.maximum(bound, cut), bound)
            assert (reached - bound)[(place == one) & ~rests].max() <= SLACK
        for one, signs, combination in ((0, (True, False), 0), (1, (True,), 2), (1, (False,), 4), (2, (False,), 5)):
            mine = (place == one) & rests & np.isin(v >= 0, signs)
            bound = most(functions[package.SLICES + combination, facet, False], np.vstack([before, slip]))
            assert (reached - bound)[mine].max(initial=-1.0) <= SLACK


def by_formula(p, facet, given, chord, beta, pair):
    """F, what multiplies y, what multiplies H and what noise adds, without a cut-off, as FORMAT.md writes them."""
    step, level, slip = (float(v) for v in (p.law.step, p.law.level, p.law.slip))
    (s, ds), (w, dw) = ((float(low + high) / 2, float(high - low) / 2) for low, high in (p.slope, p.damping))
    steep = float(p.slope[1])
    times = np.linspace(0, step, 2001)
    roots = np.roots([1, w, -s])
    x_of = ((np.exp(roots[0] * times) - np.exp(roots[1] * times)) / (roots[0] - roots[1])).real
    y_of = np.gradient(x_of, times, edge_order=2)

    def parts(m1, m2):
        response = np.abs(m1 * x_of + m2 * y_of)[::-1]
        area = [np.trapezoid(response * times**j, times) for j in range(4)]
        q = 1 / (1 - steep * step**2 / 2)
        of_y = ds * q * area[1] + dw * (area[0] + steep * q * area[2])
        return area[0], of_y, (ds * q * area[2] + dw * steep * q * area[3]) / 2 + dw * area[1]

    n1, _, n3 = (float(v) for v in facet)
    b, flag = float(p.task.b), float(given[1])
    m2 = float(facet[1]) + n3 * level
    m2 = (max(m2, 0) if flag else m2) + float(given[0])
    factors = [n1 + n3 * (slip - chord / (b * at)) for at in pair]
    factors = [max(m, 0) if flag else m for m in factors]
    m1 = factors[pair.index(beta)]
    off = abs(n3 * chord) * (pair[1] - 1) ** 2 / (4 * b * pair[1]) if any(factors) else 0
    area, of_y, of_force = parts(m1, m2)
    _, lone_y, lone_force = parts(1, 0)
    whole = [np.trapezoid(v, times) for v in (x_of, y_of)]
    pushed = -b * beta * (m1 * whole[0] + m2 * whole[1] + of_force)
    by_rate = m1 * x_of[-1] + m2 * y_of[-1] - n3 * slip * step / 2 + of_y + off * (x_of[-1] + lone_y)
    noise = abs(pushed) * slip * float(p.law.slip_noise)
    return pushed, by_rate, area + of_force + off * (whole[0] + lone_force), noise


@pytest.mark.parametrize("facet", range(11))
@PERIODIC
def test_bounds_of_a_slide_are_those_that_are_written(facet, noisy):
    """In the slice where the fault is behind, at r' = 0, where v is -return_rate times the slip error."""
    p = period(noisy)
    row, given = p.reach.facets[facet], p.reach.multipliers[facet]
    found = [function for place, function in slides(p, row, given, cut=False) if place == 0][::2]
    pair = [float(beta) for beta in p.task.beta]
    wanted = [by_formula(p, row, given, float(chord), beta, pair) for chord in p.chord for beta in pair]
    for function, (pushed, by_rate, by_force, noise) in zip(found, wanted, strict=True):
        values_of = [number(v) for v in function.more]
        size = 1e-3 * (abs(pushed) + abs(by_rate) + 0.01)
        assert values_of[2] == pytest.approx(pushed, abs=size)
        assert values_of[1] == pytest.approx(by_rate + pushed * float(p.law.rate), abs=3 * size)
        still = float(p.law.step * p.bend / 2 + 2 * p.law.back * p.law.slip_noise) * max(
            0, -float(p.law.target) * pushed - float(row[2] * (p.law.level + p.law.slip * p.law.step / 2))
        )
        late = 0 if row[0] <= 0 else still
        assert number(function.beside) == pytest.approx(by_force * float(p.force) + noise + late, abs=size)


@pytest.mark.parametrize("cut", [False, True])
@few("facet", [*range(5), *range(10, 4, -1)], every=2)
@NOISY
def test_both_checkers_bound_a_slide_alike(facet, cut, noisy):
    """The same functions on every slice: two programs, written apart, with the numbers of one format."""
    p = period(noisy)
    own = [
        (
            [float(v) + number(m) for v, m in zip(f.row, f.more, strict=True)],
            float(f.constant) + number(f.beside),
            place,
        )
        for place, f in slides(p, p.reach.facets[facet], p.reach.multipliers[facet], cut)
    ]
    for place in range(3):
        mine = [(row, constant) for row, constant, at in own if at == place]
        theirs = packages(noisy)[place, facet, cut]
        if not theirs:  # the innovation is cut off only where that raises the facet
            assert cut
            assert p.reach.facets[facet][2] <= 0
            continue
        for (row, constant), (other, rest) in zip(sorted(mine), sorted(theirs), strict=True):
            assert [*row, constant] == pytest.approx([*other, rest], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("facet", range(11))
@NOISY
def test_both_checkers_bound_a_period_that_ends_at_rest_alike(facet, noisy):
    """At corners of their variables, where the largest of all functions of a combination must agree."""
    p, random = period(noisy), np.random.default_rng(5)
    points = random.uniform(-1, 1, (4, 40))
    points[[1, 3]] = abs(points[[1, 3]])
    for least, (_, ends) in zip((0, 2, 4, 5), p.resting(), strict=True):
        row, given = p.reach.facets[facet], p.reach.multipliers[facet]
        own = values([f for end in ends for f in p.stopped(row, given, end)], points)
        theirs = most(packages(noisy)[package.SLICES + least, facet, False], points)
        assert own == pytest.approx(theirs, rel=1e-9, abs=1e-12)


def test_noise_of_the_slip_may_put_a_fault_at_rest_in_both_checkers():
    """U is up to m·N larger than the state tells, so that the condition of rest gives way by b·β1·m·N."""
    quiet, noisy = period(), period(noisy=True)
    more = quiet.task.b * quiet.task.beta[1] * quiet.law.slip / 90
    ends = [[polytope.lines[-7][1] for polytope, _ in p.resting()] for p in (quiet, noisy)]
    assert [after - before for before, after in zip(*ends, strict=True)] == [more] * 4
    found = []
    for with_noise in (False, True):
        claim = read_guarantee(box(with_noise))
        nothing = (Fraction(0), Fraction(0))
        known = package.ranges(claim.task, Fraction(1), nothing, Fraction(1))
        lines = package.polytopes(claim.task, claim.sampled_loop, claim.invariant_set.facets, known)[package.SLICES :]
        found.append([line[-7][1] for line in lines])
    assert [after - before for before, after in zip(*found, strict=True)] == [more] * 7


class Held:
    """A polytope on which every function has the same largest value."""

    def __init__(self, value):
        self.value = value

    def largest(self, *_):
        return self.value


def bare(monkeypatch, *facets, law=None, value=0, **fields):
    """A period in which every map of some facets has one value, and the facets and maps that were asked for."""
    p, asked = copy(period()), []
    p.law = replace(p.law, **(law or {}))
    rows = [[Fraction(v) for v in facet] for facet in facets]
    p.reach = replace(p.reach, facets=rows, multipliers=[[Fraction(0)] * 5 for _ in rows])
    p.flat, p.force = [Held(value)] * 3, Fraction(10**9)
    vars(p).update(fields)
    monkeypatch.setattr(p, "respond", lambda _: None)
    monkeypatch.setattr(p, "sliding", lambda row, _, cut: asked.append((tuple(row), cut)) or iter([(0, None)]))
    monkeypatch.setattr(p, "resting", list)
    return p, asked


def test_a_limited_innovation_counts_for_facets_that_grow_with_the_estimate(monkeypatch):
    p, asked = bare(monkeypatch, (0, 0, 1), (0, 0, 0), (0, 0, -1), (1, 0, 2))
    p.verify()
    cut = [(0, 0, 1), (1, 0, 2)]
    assert sorted(asked) == sorted(
        [(facet, False) for facet in (*cut, (0, 0, 0), (0, 0, -1))] + [(facet, True) for facet in cut]
    )


def test_a_facet_may_be_reached_and_not_passed(monkeypatch):
    bare(monkeypatch, (0, 1, 0), value=STICK.ONE)[0].verify()
    p, _ = bare(monkeypatch, (0, 1, 0), value=STICK.ONE + 1)
    with pytest.raises(CHECK.Refused, match="facet 0 must hold after a sliding period"):
        p.verify()
    p, _ = bare(monkeypatch, (0, 1, 0))
    monkeypatch.setattr(p, "stopped", lambda *_: iter([None]))
    for value, holds in ((STICK.ONE, True), (STICK.ONE + 1, False)):
        monkeypatch.setattr(p, "resting", lambda value=value: [(Held(value), p.ends[:1])])
        with nullcontext() if holds else pytest.raises(CHECK.Refused, match="after a period that ends at rest"):
            p.verify()


@pytest.mark.parametrize(("noise", "inside"), [("1/4", True), ("251/1000", False)])
def test_the_first_state_lies_in_the_set_with_its_noise(noise, inside, monkeypatch):
    """Of two facets the first has e1 + 3d/2 at most 1/2: 1/4 + 1/4 for a noise of 1/4 and a slip gain of 2/3."""
    law = {"slip_noise": Fraction(noise), "slip": Fraction(2, 3)}
    p, _ = bare(monkeypatch, (2, 0, 3), (-1, 0, -1), law=law)
    with nullcontext() if inside else pytest.raises(CHECK.Refused, match="must contain the initial state"):
        p.verify()


@pytest.mark.parametrize(("longest", "least"), [("0", 1), ("3", 0)])
@pytest.mark.parametrize("share", ["1", "999999/1000000"])
@pytest.mark.parametrize("push", ["4", "-4"])
def test_the_range_of_beta_has_at_most_the_effect_of_the_disturbance(longest, least, share, push, monkeypatch):
    """(δS·q·T²/2 + δw·T(1 + S⁺q·T²))·b·(β1 − 1)·U⁺, with β1 for β1 − 1 and the longest T of several."""
    T = max(Fraction(2), Fraction(longest))
    of_push = Fraction(1, 3) * T**2 / 2 + Fraction(1, 5) * T * (1 + Fraction(1, 7) * Fraction(3, 2) * T**2)
    needed = of_push * 5 * (Fraction(3, 2) - least) * max(Fraction(push), 0)
    p, _ = bare(
        monkeypatch, (0, 1, 0),
        law={"step": Fraction(2), "longest": Fraction(longest)},
        per_slip=Fraction(1, 3), per_rate=Fraction(1, 5), slope=(Fraction(-1), Fraction(1, 7)), growth=Fraction(3, 2),
        push=(Fraction(-9), Fraction(push)), force=needed * Fraction(share),
        task=replace(period().task, b=Fraction(5), beta=(Fraction(1), Fraction(3, 2))),
    )  # fmt: skip
    with nullcontext() if share == "1" or not needed else pytest.raises(CHECK.Refused, match="range of beta"):
        p.verify()


def test_bounds_contain_the_noise_on_either_side():
    """The state contains the slip plus its largest error: behind by that much more, ahead by that much less."""
    p = copy(period())
    p.law = replace(p.law, slip_noise=Fraction(1, 100))
    found, plain = p.bounds(), period().bounds()
    moved = {name: found[name] - plain[name] for name in found}
    assert moved == {**dict.fromkeys(found, 0), "slip_behind": Fraction(1, 100), "slip_ahead": -Fraction(1, 100)}


@pytest.mark.parametrize("name", STICK.CLAIMS)
def test_every_claim_may_be_what_follows_and_no_less(name, monkeypatch):
    document, exact = box(), period().bounds()
    monkeypatch.setattr(STICK.Period, "verify", lambda _: None)
    for share, holds in ((0, True), (1, False)):
        away = Fraction(share, 10**9) * (1 if name.startswith("least") else -1)
        claims = {key: str(value + (away if key == name else 0)) for key, value in exact.items()}
        given = dict(document, claims=claims)
        with nullcontext() if holds else pytest.raises(CHECK.Refused, match=f"claim {name} must follow"):
            STICK.verify(given)


# ---------------------------------------------------------------- what the standalone checker reads


def test_a_basis_names_constraints_of_its_polytope_alone(monkeypatch):
    """Facets, y >= 0 and the ends of a slice: one, two and one. At rest slip >= 0, the condition and six bounds."""
    asked, read = {}, STICK.read_bases
    monkeypatch.setattr(
        STICK, "read_bases", lambda given, where, size, counts: asked.update({where: (size, counts)}) or read(
            given, where, size, counts
        )
    )  # fmt: skip
    document = box()
    STICK.read_reach(document["set"])
    plain = [len(document["set"]["facets"]) + 1 + ends for ends in (1, 2, 1)]
    assert asked == {"sliding": (3, tuple(plain)), "resting": (4, tuple(plain[s] + 8 for s in (0, 0, 1, 1, 1, 2, 2)))}


@pytest.mark.parametrize(
    "bases", [5, "ab", {"a": 1}, [5, []], [[], [[0, 1, 2]]], [[[0, 1, 2]], {"a": 1}], [[[0, 1, 2]], ["012"]],
              [[[0, 1, 2]], [{0: 1, 1: 1, 2: 2}]], [[[0, 1, 2]], [[0, 1]]], [[[0, 1, 2]], [[0, 1, 9]]],
              [[[0, 1, 2]], [[0, 1, -1]]], [[[0, 1, 2]], [[0, 1, True]]], [[[0, 1, 8]], [[0, 1, 2]]]]
)  # fmt: skip
def test_bases_are_lists_of_numbers_of_constraints(bases):
    assert STICK.read_bases([[[0, 1, 7]], [[8, 1, 2]]], "sliding", 3, (8, 9)) == [[[0, 1, 7]], [[8, 1, 2]]]
    with pytest.raises(CHECK.Refused, match="sliding"):
        STICK.read_bases(bases, "sliding", 3, (8, 9))


def test_a_set_has_five_facets_at_least_and_a_law_may_have_gains_of_zero():
    document = box()
    five = {name: document["set"][name][:5] for name in ("facets", "multipliers")}
    five |= {"sliding": [[[0, 1, 2]]] * 3, "resting": [[[0, 1, 2, 3]]] * 7}
    assert len(STICK.read_reach(document["set"] | five).facets) == 5
    for value in (5, "facets", None):
        with pytest.raises(CHECK.Refused, match="there must be 5 to 400 facets"):
            STICK.read_reach(document["set"] | {"facets": value})
    for name in ("level_gain", "slip_gain"):
        for value in ("0", "1/2"):
            assert STICK.read_law(document["loop"] | {name: value})
        with pytest.raises(CHECK.Refused, match="level_gain and slip_gain must be >= 0"):
            STICK.read_law(document["loop"] | {name: "-1/2"})
    for value in (5, None, ["pull"]):
        with pytest.raises(CHECK.Refused, match="loop"):
            STICK.read_law(value)


def test_an_implicit_step_has_at_most_sixteen_terms():
    term = {"factor": ["1", "1"], "power": "1", "of": "slip"}
    law = box()["loop"] | {"target_gain": "2", "return_rate": "2"}
    assert len(STICK.read_law(law | {"pull": [term] * 16}).pull) == 16
    assert STICK.read_law(law | {"pull": [term | {"of": [term] * 15}]}).pull
    for beyond in ([term] * 17, [term | {"of": [term] * 16}]):
        with pytest.raises(CHECK.Refused, match="at most 16"):
            STICK.read_law(law | {"pull": beyond})


def test_states_of_a_slice_have_the_sizes_and_signs_of_the_first_facets():
    p = period.__wrapped__(True)
    ahead, peak, up, behind, down = (1 / abs(next(v for v in row if v)) for row in p.reach.facets[:5])
    turn = (p.task.reference_rate + 2 * p.law.back * p.law.slip_noise) / p.law.back
    assert [sizes[0] for sizes in p.sizes] == [behind, min(ahead, turn), ahead]
    assert {tuple(sizes[1:]) for sizes in p.sizes} == {(peak, max(up, down))}
    assert p.signs == [(-1, 1, 0), (1, 1, 0), (1, 1, 0)]


class Rock:
    """A fault with given ranges: at rest, of the slope with and without the pressure, and of the damping."""

    def __init__(self, still=(10, 12), slopes=(-2, "1/8"), chords=(-3, "1/9"), damping=(1, 2)):
        self.still, self.damping = (tuple(map(Fraction, pair)) for pair in (still, damping))
        self.slopes, self.chords = (tuple(map(Fraction, pair)) for pair in (slopes, chords))
        self.stiffness, self.area = (Fraction(1), Fraction(3)), (Fraction(2), Fraction(5))
        self.mu, self.asked = {"static": Fraction(1, 2)}, []

    def stress(self, slip, growth):
        self.asked.append((slip, growth))
        return self.still

    def of_slip(self, stress, growth):
        self.asked.append((stress, growth))
        return self.chords if stress == self.still else self.slopes

    def of_rate(self, stress, growth):
        self.asked.append((stress, growth))
        return self.damping


def ranged(rock, growth=1, force=9, normal=200, **law):
    """A period with the ranges of a fault; steps of 1/2, pressures from 4 below to 5 above those at rest."""
    p = copy(period())
    p.law, p.push, p.force = replace(p.law, step=Fraction(1, 2), **law), (Fraction(-4), Fraction(5)), Fraction(force)
    p.task = replace(p.task, normal_stress=Fraction(normal))
    p.find_ranges(rock, Fraction(3), [Fraction(growth), Fraction(1, 7)])
    return p


def test_ranges_are_those_of_the_fault_at_the_pressures_and_contain_zero():
    rock = Rock()
    p = ranged(rock)
    slip = 3 + p.ahead + p.task.reference_rate / 2
    assert rock.asked == [(slip, 1), ((6, 17), 1), ((6, 17), Fraction(1, 7)), ((10, 12), 1)]
    assert (p.rest, p.slope, p.damping) == ((188, 190), (-2, Fraction(1, 8)), (1, 2))
    moves = 1 + p.task.slope_of_beta * p.peak / 2
    assert p.chord == (-3 * moves, moves / 9)
    assert p.longest == min(g * p.peak + h for g, h in p.stops())
    assert ranged(Rock(slopes=("1/9", "1/8"), chords=("1/9", "1/8"))).slope == (0, Fraction(1, 8))
    assert ranged(Rock(slopes=(-2, -1), chords=(-2, -1))).slope == (-2, 0)
    assert ranged(Rock(chords=(-2, -1))).chord == (-2 * moves, 0)
    assert ranged(Rock(chords=("1/9", "1/8"))).chord == (0, moves / 8)


@pytest.mark.parametrize(
    ("rock", "given", "reason"),
    [
        (Rock(still=(4, 12)), {}, "must not open"),
        (Rock(damping=("-1/100", 2)), {}, "damping must not be negative"),
        (Rock(slopes=(-2, 4)), {}, "short against the weakening"),
        (Rock(slopes=(-2, "1/8"), still=("401/100", 12)), {"normal": "1/100"}, "must not reverse"),
        (Rock(slopes=(-40, "1/8")), {}, "stops|condition of rest"),
    ],
)
def test_each_condition_on_the_ranges_is_asked_for(rock, given, reason):
    with pytest.raises(CHECK.Refused, match=reason):
        ranged(rock, **given)


def test_conditions_on_the_ranges_hold_up_to_their_ends():
    assert ranged(Rock(still=("401/100", 12)))
    assert ranged(Rock(damping=(0, 2)))
    assert ranged(Rock(slopes=(-2, "399/100")))
    p = ranged(Rock())
    slip = 3 + p.ahead + p.task.reference_rate / 2
    for growth, stiffness in ((1, 2), (3, 0), (4, 0), (-1, 4)):  # load = 2·(1/2)·normal, stiffness from 3 less growth
        least = stiffness * slip + 9
        assert ranged(Rock(), growth, normal=least + Fraction(1, 10**9))
        with pytest.raises(CHECK.Refused, match="must not reverse"):
            ranged(Rock(), growth, normal=least)


def test_weights_are_sixty_times_the_integrals_of_hat_functions():
    """∫ (1 − |t − i|)·t^j over the pieces beside i, from the antiderivatives of t^j and t^(j+1)."""
    pieces = range(STICK.PIECES)
    for j, line in enumerate(STICK.weights()):
        whole, first = (lambda t, j=j: Fraction(t ** (j + 1), j + 1)), (lambda t, j=j: Fraction(t ** (j + 2), j + 2))
        rises = [first(i + 1) - first(i) - i * (whole(i + 1) - whole(i)) for i in pieces]
        falls = [whole(i + 1) - whole(i) - rise for i, rise in zip(pieces, rises, strict=True)]
        assert line == [60 * (a + b) for a, b in zip([0, *rises], [*falls, 0], strict=True)]
    assert STICK.weights() == STICK.WEIGHTS
    assert len(STICK.WEIGHTS) == 4


@pytest.mark.parametrize(
    ("loop", "task", "said", "unsaid"),
    [
        ({}, {}, ["any acceleration of at most 0.125 m/s^2", "law for the stick-slip plant, every 1/2 s",
                  "slip and slip rate measured exactly", "any function of slip and slip rate within"],
         ["any order", "deadbeat", "slip measured within", "none (amplitude 0)"]),
        ({"slip_noise": "1/90", "rest_slip": "1/40"}, {"amplitude": Fraction(0)},
         ["slip measured within 0.01111 m, slip rate exactly", "disturbance: none (amplitude 0); from rest"],
         ["measured exactly", "any acceleration"]),
        ({"longest": "5/8"}, {"steady_beta": True},
         ["every 1/2 s to 5/8 s in any order", "any function of the slip alone"],
         ["slip and slip rate within"]),
        ({"target_gain": "2", "return_rate": "2", "pull": [{"factor": ["1", "1"], "power": "1", "of": "slip"}]}, {},
         ["sliding mode for the stick-slip plant", "its implicit step is deadbeat, w = -e1/step, on this set"], []),
    ],
)  # fmt: skip
def test_the_statement_says_what_is_assumed_and_bounds_outward(loop, task, said, unsaid):
    document = box()
    document["loop"] |= loop
    p = copy(period())
    p.law, p.task = STICK.read_law(document["loop"]), replace(p.task, **task)
    p.slope, p.damping = (Fraction(-2, 3), Fraction(1, 3)), (Fraction(1, 3), Fraction(2, 3))
    numbers = (Fraction(n, 3) for n in (1, 2, 4, -5, 7))
    lines = STICK.statement(document, p, dict(zip(STICK.CLAIMS, numbers, strict=True)))
    text = "\n".join(lines)
    assert [words for words in said if words not in text] == []
    assert [words for words in unsaid if words in text] == []
    assert lines[0].startswith('fault "a box" (a label; ')
    assert lines[1].startswith(
        "derived accelerations: per slip within a period [-0.6667, 0.3334] 1/s^2, per slip rate "
    )
    assert "minus [0.3333, 0.6667] 1/s, per pressure " in lines[1]
    assert f"{float(p.task.b):.4g} m^2/kg times [1, " in lines[1]
    assert float(lines[1].split("[1, ")[1].rstrip("]")) >= p.task.beta[1]
    assert f"a set of {len(p.reach.facets)} facets" in lines[2]
    assert lines[-3:] == [
        "the slip rate of this fault never exceeds 1.334 m/s",
        "the slip is at most 0.3334 m behind and 0.6667 m ahead of the reference",
        "pressure from -1.667 Pa to 2.334 Pa",
    ]


def test_polytopes_at_rest_have_the_bases_of_their_slice_and_sign(monkeypatch):
    """Four of them, each with the bases of its least r' and, but for (1, -), of its largest, which is its own."""
    p, made = period(), []
    monkeypatch.setattr(STICK, "Polytope", lambda *given: made.append(given) or given)
    p.resting()
    listed = p.reach.resting
    expected = [listed[0] + listed[1], listed[2] + listed[3], listed[4], listed[5] + listed[6]]
    assert [bases for *_, bases in made] == expected
    for (_, sizes, signs, _), place in zip(made, (0, 1, 1, 2), strict=True):
        assert sizes == [*p.sizes[place], p.longest]
        assert signs == [*p.signs[place], 1]


def test_an_integral_has_the_error_of_its_worst_node():
    p, nodes = copy(period()), STICK.PIECES + 1
    p.interval, p.bent = Fraction(1), [STICK.Near.of(Fraction(0))] * 2
    p.nodes = [[STICK.Near(STICK.ONE, 10**6 * i), STICK.Near(0, 0)] for i in range(nodes)]
    for j, found in enumerate(p.integrals(Fraction(1), Fraction(0))):
        piece = Fraction(1, STICK.PIECES) ** (j + 1) / 60
        assert found.off >= sum(w * 10**6 * i for i, w in enumerate(STICK.WEIGHTS[j])) * piece


@pytest.mark.parametrize(("damping", "short"), [(5, True), (12, False), (24, False)])
def test_a_step_is_short_against_the_damping(damping, short):
    """1/2 + wT/24 < 1, which 24 meets for T = 1/2, and w(1 − 1/2 − wT/24)T < 1, which is 3/2 for 12."""
    with nullcontext() if short else pytest.raises(CHECK.Refused, match="short against damping"):
        ranged(Rock(slopes=("-1/100", "1/8"), damping=(damping, damping)))
