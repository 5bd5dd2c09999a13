"""The stick–slip theorem against an independent simulator with exact stops and adversarial friction and disturbance."""

import json
from fractions import Fraction as F
from functools import cache
from pathlib import Path
from random import Random
from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp
from scipy.spatial import HalfspaceIntersection

import quakedesign as qd
from quakedesign.guarantees.exact.guarantee_files import load_guarantee
from quakedesign.guarantees.exact.limit_theorems import smallest_stick_slip_rate
from quakedesign.laws.sampled_controller import integral_symbols, law_expressions, r, r_rate
from quakedesign.laws.stick_slip_controller import StickSlipController
from quakedesign.laws.stick_slip_law import StickSlipLaw
from quakedesign.plant import uncertain_plant
from quakedesign.symbolic import plant

FOLDER = Path(__file__).parents[3] / "proofs" / "certificates"
FILE, NOISY_FILE = FOLDER / "stick_slip_real-fault.json", FOLDER / "stick_slip_noise_real-fault.json"
FILES = {False: FILE, True: NOISY_FILE, "aperiodic": FOLDER / "stick_slip_aperiodic_real-fault.json"}
NOISY = pytest.mark.parametrize("noisy", [False, True], ids=["exact", "noisy"])
EACH = pytest.mark.parametrize("noisy", FILES, ids=["exact", "noisy", "aperiodic"])
ROUNDING = 1e-9  # of n·z, which is 1 exactly where the fault rests on the boundary


@cache
def case(noisy=False):
    """Numbers of a file, in floating point, read without the package; all are about one fault."""
    data = json.loads(FILES[noisy].read_text())
    fault, loop = (
        {k: float(F(v)) for k, v in data[name].items() if isinstance(v, str) and k != "name"}
        for name in ("fault", "loop")
    )
    friction = {k: float(F(v)) for k, v in data["fault"]["friction"].items()}
    per_mass = 1 / (fault["density"] * fault["length"])
    task = {k: float(F(data["reference"][k])) for k in ("target_slip", "operation_time")}
    return SimpleNamespace(
        **loop,
        **friction,
        **task,
        stress=fault["normal_stress"],
        per_mass=per_mass,
        damping=fault["damping"] / (fault["density"] * fault["length"] ** 3),
        stiffness=fault["shear_modulus"] / (fault["density"] * fault["length"] ** 2)
        - float(F(data["disturbance"]["growths"]["slip"])),
        amplitude=float(F(data["disturbance"]["amplitude"])),
        authority=friction["least"] * per_mass,
        # r = target·(10s³ − 15s⁴ + 6s⁵), s = t/t_op: r′ is largest at s = 1/2, |r″| at s = (3 − √3)/6
        fastest=15 / 8 * task["target_slip"] / task["operation_time"],
        bend=10 / np.sqrt(3) * task["target_slip"] / task["operation_time"] ** 2,
        facets=np.array([[float(F(v)) for v in row] for row in data["set"]["facets"]]),
        claims={k: float(F(v)) for k, v in data["claims"].items()},
    )


# ----------------------------------------------------------------------
# A period: pieces with a constant disturbance and a constant slope of G, y′ = −wy + G(ξ) + φ, y ≥ 0.


def flow(rate, force, slope, time):
    """ξ, y and G + φ after a time that is short against 1 s, by Taylor's series."""
    slip, y, total, d_rate, d_force, factor = 0, rate, force, rate, force, time
    slip = time * rate
    for order in range(1, 7):
        d_rate, d_force = d_force - case().damping * d_rate, slope * d_rate
        factor = factor / order
        y, total = y + factor * d_rate, total + factor * d_force
        factor = factor * time
        slip = slip + factor / (order + 1) * d_rate
    return slip, y, total


def piece(rate, force, slope, disturbance, time, healed=0.0):
    """ξ, y and G after a piece; a block that stops in it rests unless the force beyond what is healed pushes it."""
    total = force + disturbance
    moves = (rate > 0) | (total > healed)
    slip, y, after = flow(rate, total, slope, time)
    stops = np.flatnonzero(moves & (y < 0))
    if len(stops):
        begin = rate[stops], total[stops], slope[stops]
        low, high = np.zeros(len(stops)), np.broadcast_to(time, rate.shape)[stops]
        for _ in range(30):
            middle = (low + high) / 2
            forward = flow(*begin, middle)[1] > 0
            low, high = np.where(forward, middle, low), np.where(forward, high, middle)
        slip[stops], _, after[stops] = flow(*begin, low)
        y[stops] = 0
    return np.where(moves, slip, 0), np.where(moves, y, 0), np.where(moves, after, total) - disturbance


def rest_pressure(slip, friction):
    """p*: friction of the effective stress carries what the shear stress has left."""
    at = case()
    return at.stress - (at.static * at.stress - at.stiffness / at.per_mass * slip) / friction


class Blocks:
    """Many faults, each with a friction law that is chosen as it slips: falling as steeply as it may, or flat.

    At rest friction is higher by `healing`.
    """

    def __init__(self, slip, friction, rate, healing=0.0):
        self.healing = healing
        self.slip, self.friction, self.rate = slip.copy(), friction.copy(), rate.copy()
        self.peak = rate.copy()

    def push(self, pressure):
        """Hold a pressure from now on."""
        at = case()
        stress = at.stress - pressure
        self.healed = at.per_mass * self.healing * stress
        self.force = at.per_mass * (at.static * at.stress - self.friction * stress) - at.stiffness * self.slip
        self.flat, self.steep = -at.stiffness, -at.stiffness + at.per_mass * at.weakening * stress

    def advance(self, disturbance, weakens, time):
        """One piece; friction stays above its least value."""
        at = case()
        room = self.friction - at.weakening * 2 * at.claims["peak_slip_rate"] * time > at.least
        falls = weakens & room
        moved, self.rate, self.force = piece(
            self.rate, self.force, np.where(falls, self.steep, self.flat), disturbance, time, self.healed
        )
        self.friction = self.friction - np.where(falls, at.weakening * moved, 0)
        self.slip = self.slip + moved
        self.peak = np.maximum(self.peak, self.rate)


def worst_signs(facets, slip_gain, level_gain, left):
    """Sign by which an impulse now moves n·z at the end of the period, a time `left` from now."""
    at, slope = case(), 0.45
    root = np.sqrt(at.damping**2 / 4 + slope)
    fast, slow = np.exp((root - at.damping / 2) * left), np.exp((-root - at.damping / 2) * left)
    of_slip = (fast - slow) / (2 * root)
    of_rate = ((root - at.damping / 2) * fast + (root + at.damping / 2) * slow) / (2 * root)
    per_slip = facets[:, 0] + facets[:, 2] * (slip_gain + at.stiffness / at.authority)
    return np.where(per_slip * of_slip + (facets[:, 1] + facets[:, 2] * level_gain) * of_rate >= 0, 1.0, -1.0)


# ----------------------------------------------------------------------
# One period from anywhere in P.


@cache
def vertices(noisy=False):
    """Of P with y ≥ 0, slightly drawn in so that rounding leaves them in P."""
    facets = case(noisy).facets
    sizes = 1 / np.abs(facets).max(axis=0)
    rows = np.vstack([np.c_[facets * sizes, -np.ones(len(facets))], [0, -1, 0, 0]])
    inner = np.array([0, 0.1, 0])
    assert (rows[:, :3] @ inner < -rows[:, 3]).all()
    found = HalfspaceIntersection(rows, inner).intersections
    found = np.unique(np.round(found[np.isfinite(found).all(axis=1)], 12), axis=0) * sizes
    found[:, 1] = np.maximum(found[:, 1], 0)
    return found / np.maximum((found @ facets.T).max(axis=1), 1)[:, None]


def intervals(at, random, count):
    """To the next sample of each fault [s]: the same, or of aperiodic sampling either end or anywhere within."""
    if not hasattr(at, "longest"):
        return np.full(count, at.step)
    ends = random.choice([at.step, at.longest], count)
    return np.where(random.random(count) < 0.5, ends, random.uniform(at.step, at.longest, count))


def one_period(random, count, pieces, amplitude=1.0, healing=0.0, noisy=False):
    """States in P before and after a period, the slip in it and the slip rate that it reached."""
    at, corners = case(noisy), vertices(noisy)
    off, later = (at.slip_noise * random.choice([-1.0, -0.3, 1.0], count) for _ in range(2))
    weights = random.dirichlet([0.3] * 4, count)
    weights[: count // 2] = [1, 0, 0, 0]
    state = np.einsum("nk,nkc->nc", weights, corners[random.integers(0, len(corners), (count, 4))])
    error, rate, level = state.T  # the slip error plus the bound of the noise; the level without its own noise
    error, level = error - at.slip_noise, level + at.slip_gain * off
    interval = intervals(at, random, count)
    reference = random.random(count) * at.fastest
    choice = random.integers(0, 4, count)
    reference = np.select(
        [choice == 0, choice == 1, choice == 2],
        [0, at.fastest, np.clip(at.return_rate * (error + off), 0, at.fastest)],
        reference,
    )
    slip = random.random(count) * at.target_slip
    least = np.maximum(at.least, at.static - at.weakening * slip)
    friction = least + np.select([choice == 1, choice == 3], [0, 1], random.random(count)) * (at.static - least)
    blocks, before = Blocks(slip, friction, rate, healing), rest_pressure(slip, friction)
    wanted = reference - at.return_rate * (error + off)
    expected = np.maximum(wanted, 0)
    blocks.push(before - (level + at.rate_gain * rate - at.target_gain * wanted))
    facets = at.facets[random.integers(0, len(at.facets), count)]
    switches, sign, aimed = (
        random.random((count, 4)) * 1.5 * interval[:, None],
        random.choice([-1.0, 1.0], count),
        random.random(count) < 0.5,
    )
    for i in range(pieces):
        now = (i + 0.5) * interval / pieces
        best = worst_signs(facets, at.slip_gain, at.level_gain, interval - now)
        turned = sign * (-1.0) ** (switches < now[:, None]).sum(axis=1)
        way = np.where(aimed, best, turned)
        blocks.advance(amplitude * at.amplitude * way, way > 0, interval / pieces)
    moved = blocks.slip - slip
    innovation = moved + later - off - at.step * (rate + expected) / 2
    innovation = np.where(blocks.rate == 0, np.maximum(innovation, -at.step * expected / 2 - at.rest_slip), innovation)
    change = rest_pressure(blocks.slip, blocks.friction) - before
    late = random.choice([-1, 0, 1], count) * at.bend * interval**2 / 2
    after = np.column_stack(
        [
            error + at.slip_noise + moved - np.maximum(interval * reference + late, 0),
            blocks.rate,
            level + change + at.level_gain * (blocks.rate - expected) + at.slip_gain * (innovation - later),
        ]
    )
    assert blocks.friction.min() >= at.least
    return state, after, moved, blocks.peak


@EACH
def test_vertices_are_those_of_the_file(noisy):
    tops = vertices(noisy) @ case(noisy).facets.T
    assert tops.max() <= 1 + ROUNDING
    assert ((tops > 1 - 1e-6).sum(axis=1) + (vertices(noisy)[:, 1] < 1e-12) >= 3).all()


@EACH
@pytest.mark.parametrize("trials", [2_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
def test_one_period_from_anywhere_in_the_polytope_ends_in_it(trials, noisy):
    at, random, slid = case(noisy), np.random.default_rng(7), 0.0
    for _ in range(trials // 2_000):
        before, after, moved, peak = one_period(random, 2_000, 30, noisy=noisy)
        tops = (after @ at.facets.T).max(axis=1)
        assert (before @ at.facets.T).max() <= 1 + ROUNDING
        assert tops.max() <= 1 + ROUNDING
        assert peak.max() <= at.claims["peak_slip_rate"]
        slid = max(slid, tops[moved > 1e-8].max())
    assert slid > (0.97 if noisy else 0.99)  # the trials come near


@pytest.mark.parametrize("share", [0.0, 0.5])
@pytest.mark.parametrize("trials", [2_000, pytest.param(200_000, marks=pytest.mark.slow)])
def test_friction_that_heals_at_rest_takes_the_place_of_a_part_of_the_disturbance(trials, share):
    at, random, kept, slid = case(), np.random.default_rng(11), 0, 0.0
    claims = load_guarantee(FILE)
    healing = float(claims.covered_healing(F(share) * claims.task.amplitude))
    stress = at.stress - at.claims["least_pressure"]
    assert healing == pytest.approx((1 - share) * at.amplitude / (at.per_mass * stress), rel=1e-9)
    for _ in range(trials // 2_000):
        _, after, moved, peak = one_period(random, 2_000, 30, share, healing)
        tops = (after @ at.facets.T).max(axis=1)
        assert tops.max() <= 1 + ROUNDING
        assert peak.max() <= at.claims["peak_slip_rate"]
        kept, slid = kept + np.sum(moved == 0), max(slid, tops[moved > 1e-8].max())
    assert kept > trials / 50  # rests that last because friction has healed are among them
    assert slid > 0.8


@EACH
def test_a_larger_disturbance_drives_states_out(noisy):
    _, after, _, _ = one_period(np.random.default_rng(7), 2_000, 30, amplitude=1.5, noisy=noisy)
    assert (after @ case(noisy).facets.T).max() > 1.01


def test_a_longer_interval_drives_states_out(monkeypatch):
    at = case("aperiodic")
    monkeypatch.setattr(at, "longest", 1.2 * at.longest)
    _, after, _, _ = one_period(np.random.default_rng(7), 2_000, 30, noisy="aperiodic")
    assert (after @ at.facets.T).max() > 1.1


# ----------------------------------------------------------------------
# Long runs from rest, by the law's own recursion.


def recursion(law, period, states, measured):
    """The law as its documentation states it: pressure, and the states after a sample."""
    level, predicted, last_rate, last_slip = states
    slip, rate, reference, reference_rate = measured
    innovation = slip - last_slip - period * (last_rate + predicted) / 2
    if rate == 0:
        innovation = max(innovation, -period * predicted / 2 - law.rest_slip)
    level = level + law.level_gain * (rate - predicted) + law.slip_gain * innovation
    wanted = reference_rate - law.return_rate * (slip - reference)
    pressure = -law.rate_gain * rate + law.target_gain * wanted - level
    return pressure, (level, max(wanted, 0), rate, slip)


def long_runs(periods, start, seed, noisy=False):
    """Largest shares of the claims (behind, ahead, slip rate, least and largest pressure) of 50 runs, and of n·z."""
    at, random = case(noisy), np.random.default_rng(seed)
    facets = at.facets[np.linspace(0, len(at.facets) - 1, 50).round().astype(int)]
    count, pieces = len(facets), 6
    slip = np.full(count, start)
    least = np.maximum(at.least, at.static - at.weakening * slip)
    blocks = Blocks(slip, least + random.random(count) * (at.static - least), np.zeros(count))
    states = [
        (float(level), 0.0, 0.0, start) for level in -rest_pressure(slip, blocks.friction)
    ]  # d = 0, as at the start from rest
    reference, rates, hold = slip.copy(), np.full(count, at.fastest), np.ones(count)
    shares, tops = np.zeros(5), 0.0
    for k in range(periods):
        if k % 50 == 0:
            rates = random.choice([0.0, at.fastest], count)
        if k % 7 == 0:
            hold = random.choice([-1.0, 1.0], count)
        off = at.slip_noise * random.choice([-1.0, 1.0], count)
        told = zip((blocks.slip + off).tolist(), blocks.rate.tolist(), reference.tolist(), rates.tolist(), strict=True)
        made = [recursion(at, at.step, state, seen) for state, seen in zip(states, told, strict=True)]
        states, pressure = [state for _, state in made], np.array([p for p, _ in made])
        level = np.array([state[0] for state in states]) + rest_pressure(blocks.slip, blocks.friction)
        error = blocks.slip - reference + at.slip_noise
        now = np.column_stack([error, blocks.rate, level - at.slip_gain * off])
        tops = max(tops, (now @ at.facets.T).max())
        blocks.push(pressure)
        follows = np.where(random.random(count) < 0.15, hold, 1)
        time = intervals(at, random, count) / pieces
        for i in range(pieces):
            way = follows * worst_signs(facets, at.slip_gain, at.level_gain, (pieces - i - 0.5) * time)
            blocks.advance(at.amplitude * way, way > 0, time)
            reference = reference + rates * time
            error = blocks.slip - reference
            held = (-error.min(), error.max(), blocks.rate.max(), pressure.min(), pressure.max())
            shares = np.maximum(shares, np.array(held) / list(at.claims.values()))
    return shares, tops


@pytest.mark.parametrize(
    ("periods", "start"), [(100, 0.2), *(pytest.param(10_000, x, marks=pytest.mark.slow) for x in (0.0, 0.5))]
)
@EACH
def test_long_runs_stay_within_the_claims(periods, start, noisy):
    assert list(case(noisy).claims) == [
        "slip_behind",
        "slip_ahead",
        "peak_slip_rate",
        "least_pressure",
        "largest_pressure",
    ]
    shares, tops = long_runs(periods, start, 7, noisy)
    assert shares.max() <= 1
    assert tops <= 1
    assert shares[2] > 0.3  # the disturbances are not idle


@NOISY
def test_a_push_that_turns_as_the_fault_first_moves_beats_every_law(noisy):
    """Under -H until the law first moves the fault, then under H: at least 2H h(T), whatever the law does."""
    at, weakens = case(noisy), np.array([False])

    def run(turned, periods):
        blocks = Blocks(np.zeros(1), np.array([at.static]), np.zeros(1))
        state, reference = (0.0, 0.0, 0.0, 0.0), 0.0
        for k in range(periods):
            seen = float(blocks.slip[0]), float(blocks.rate[0]), reference, at.fastest
            pressure, state = recursion(at, at.step, state, seen)
            blocks.push(np.array([pressure]))
            for _ in range(30):
                blocks.advance(np.array([at.amplitude if k >= turned else -at.amplitude]), weakens, at.step / 30)
            reference += at.fastest * at.step
            if turned > k and blocks.slip[0] > 0:
                return k
        return blocks.peak[0]

    first = run(10_000, 10_000)
    peak = run(first, first + 1)
    assert float(smallest_stick_slip_rate(uncertain_plant(qd.load_fault("real-fault")), F(23, 125))) <= peak
    assert peak <= at.claims["peak_slip_rate"]


# ----------------------------------------------------------------------
# The exported law.


@NOISY
def test_the_controller_of_the_file_has_the_gains_of_the_file(noisy):
    file = NOISY_FILE if noisy else FILE
    controller, loop = load_guarantee(file).controller, json.loads(file.read_text())["loop"]
    assert controller.step == F(loop["step"])
    assert {name: F(loop[name]) for name in controller.gains} == controller.gains


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("case_of_sample", ["slides", "rests", "rests after an early stop"])
def test_the_exported_law_is_the_recursion(case_of_sample, seed):
    random = Random(seed)

    def number(least, largest):
        return F(random.randint(least, largest), random.randint(1, 9))

    law = StickSlipLaw(
        rate_gain=number(1, 9),
        target_gain=number(1, 9),
        return_rate=number(1, 9),
        level_gain=number(1, 9),
        slip_gain=number(1, 9),
        rest_slip=number(0, 9),
    )
    controller = StickSlipController(law=law, step=number(1, 9))
    states = level, predicted, last_rate, last_slip = number(-9, 9), number(1, 9), number(1, 9), number(-9, 9)
    early = case_of_sample == "rests after an early stop"
    lowest = -controller.step * predicted / 2 - law.rest_slip  # of the innovation at rest
    innovation = lowest + (-number(1, 9) if early else number(1, 9))
    slip = last_slip + controller.step * (last_rate + predicted) / 2 + innovation
    measured = slip, number(1, 9) if case_of_sample == "slides" else F(0), number(-9, 9), number(0, 9)
    pressure, states_after = recursion(law, controller.step, states, measured)
    counted = states_after[0] - level - law.level_gain * (measured[1] - predicted)
    assert counted == law.slip_gain * (lowest if early else innovation)
    values = dict(zip(integral_symbols(controller), states, strict=True))
    values |= dict(zip((plant.x1, plant.x2, r, r_rate), measured, strict=True))
    values = {symbol: sp.Rational(v.numerator, v.denominator) for symbol, v in values.items()}
    exported, slopes = law_expressions(controller)
    assert exported.subs(values) == sp.Rational(pressure.numerator, pressure.denominator)
    for slope, before, after in zip(slopes, states, states_after, strict=True):
        change = (after - before) / controller.step
        assert slope.subs(values) == sp.Rational(change.numerator, change.denominator)
