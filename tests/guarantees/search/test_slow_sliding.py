"""Guarantees of slow sliding claim as little as follows; where that is too little, what was claimed first is proved."""

import importlib.util
import math
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import lambertw
from thinned import few

from quakedesign.exact import UpperBound
from quakedesign.fault import load_fault
from quakedesign.guarantees import SampledLoop, SlidingClaims
from quakedesign.guarantees.exact.guarantee_files import guarantee_text, parse_guarantee
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.exact.sliding_small_gain import cell_bounds
from quakedesign.guarantees.search import sliding_design as slow_sliding
from quakedesign.guarantees.search.lqg import Weights, sliding_law
from quakedesign.guarantees.search.sliding_design import LOG_RATES, proved_sliding
from quakedesign.guarantees.search.worst_case import SlidingPieces, corners, courses, worst_sliding
from quakedesign.guarantees.sliding_result import guarantee_sliding
from quakedesign.loop import SlidingModel
from quakedesign.lyapunov import Verdict
from quakedesign.plant import SlidingPlant

PROOFS = Path(__file__).parents[3] / "proofs"
SPECIFICATION = importlib.util.spec_from_file_location("smallest_check", PROOFS / "check.py")
checker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(checker)
NAMES = tuple(SlidingClaims.__dataclass_fields__)
MODEL = SlidingModel(
    rate=F("1.2e-6"), state_rate=F("1.2e-3"), slope=F(1), state_slope=F(1), strength=F(500024), weakening=F(1100000),
    direct=F("0.01"), evolution=F("0.022"), stiffness=F(6 * 10**6), coefficient=F("0.6"),
)  # fmt: skip
WEIGHTS = Weights(slip=3.0, state=0.18, pressure=9000.0, slip_noise=3.0, state_noise=0.006, level_noise=20.0)
HELD = SampledLoop(law=sliding_law(MODEL, F(50), weights=WEIGHTS), step=F(50), lag=F(10))


def task(half, stress):
    """The fault of the issue of slow sliding: a = 0.010, b = 0.015, 1 mm, 50 MPa, 5 km, 1.2 µm/s."""
    known = {"direct_effect": F("0.01"), "evolution_effect": F("0.015"), "critical_slip": F("0.001")}
    ranges = {name: (value * (1 - F(half)), value * (1 + F(half))) for name, value in known.items()}
    exact = {"coefficient": (F("0.6"),) * 2, "normal_stress": (F(50 * 10**6),) * 2}
    plant = {"density": F(2700), "shear_modulus": F(30 * 10**9), "length": F(5000), "damping": F(5 * 10**14)}
    moved = {"rate": F("1.2e-6"), "distance": F("0.01"), "ramp": F(12), "stress": F(stress)}
    return SlidingPlant(name="a patch", ranges=ranges | exact, **plant, **moved)


def sizes(claims):
    return {name: getattr(claims, name) for name in NAMES}


@pytest.mark.slow
@pytest.mark.parametrize("half", ["0", "0.02"])
def test_claims_are_followed_down_to_what_both_checkers_still_prove(half):
    found = proved_sliding(task(half, 8000), HELD)
    assert found.check() is Verdict.PROVED
    assert checker.check(guarantee_text(found)).verdict == "proved"
    assert found.claims.log_rate < F(1, 4)
    every = [cell_bounds(cell, found.sampled_loop, found.claims) for cell in found.cells]
    reached = {name: max(bounds[name] for bounds in every) for name in NAMES}
    assert all(reached[name] > F(9, 10) * v for name, v in sizes(found.claims).items())  # there is not much left
    smaller = SlidingClaims(**{name: UpperBound(F(9, 10) * v) for name, v in sizes(found.claims).items()})
    assert replace(found, claims=smaller).check() is Verdict.UNDECIDED


@few("half", ["0", "0.02"], every=2)
def test_what_was_claimed_first_is_proved_where_too_little_is_claimed_then(half, monkeypatch):
    def too_small(found):
        return SlidingClaims(**{name: UpperBound(v / 100) for name, v in sizes(found.claims).items()})

    monkeypatch.setattr(slow_sliding, "_smallest_claims", too_small)
    found = proved_sliding(task(half, 8000), HELD)
    assert found.claims.log_rate == F(1, 2)
    assert found.check() is Verdict.PROVED


def test_a_stress_that_the_law_does_not_stand_has_no_claims():
    assert proved_sliding(task("0.02", 80000), HELD).reason.startswith("a stress of 8e+04 Pa is not shown")


def replayed(plant_task, stress, ahead, pieces=4, normal=50e6):
    """Largest |ln(v/V)| of one course, by Lambert's function and LSODA, the stress at either end at every instant.

    The slip is that from the reference Vt; what the law is told, and p - p*, are about r with r' = V(1 + ahead).
    """
    a, b, d = (float(plant_task.ranges[n][0]) for n in ("direct_effect", "evolution_effect", "critical_slip"))
    stiffness, damping, speed, mu, lag = 6e6, 2e7, 1.2e-6, 0.6, 10.0
    own, fed, output = (np.array(part, float) for part in (HELD.law.update, HELD.law.measured, HELD.law.output))

    def log_rate(x, z, p, s):
        driving, scale = (
            (s - stiffness * x + mu * p + damping * speed) / (normal - p) - b * z,
            a * (normal - p) / damping,
        )
        return math.log(scale / speed * lambertw(math.exp(driving / a) * speed / scale).real)

    def field(_, state, s, held):
        x, z, p = state
        y = log_rate(x, z, p, s)
        ages = math.exp(-z) - math.exp(y) if plant_task.state_law == "ageing" else -math.exp(y) * (y + z)
        return [speed * math.expm1(y), speed / d * ages, (held - p) / lag]

    state, law, held, largest, r = np.zeros(3), np.zeros(len(output)), 0.0, 0.0, 0.0
    for number, (pushed, faster) in enumerate(zip(stress, ahead, strict=True)):
        if number % pieces == 0:
            held = float(output @ law) + float(HELD.law.feedback[0]) * (state[0] - r)
            law = own @ law + fed[:, 0] * (state[0] - r)

        def moving(t, state, s, held, r=r, faster=faster):
            x, z, p = state
            off = r + speed * faster * t
            slips, ages, fills = field(t, (x - off, z, p), s, held)
            return [slips, ages, fills]

        span = (0.0, 50.0 / pieces)
        state = solve_ivp(moving, span, state, method="LSODA", args=(pushed, held), rtol=1e-9, atol=1e-14).y[:, -1]
        r += speed * faster * 50.0 / pieces
        largest = max(largest, *(abs(log_rate(state[0] - r, *state[1:], s)) for s in (pushed, -pushed)))
    return largest


@pytest.mark.slow
@few(
    ("law", "room", "swing"),
    [("ageing", LOG_RATES[0], F(0)), ("slip", LOG_RATES[2], F(0)), ("ageing", F(1, 2), F(1, 20))],
    every=3,
)
def test_what_the_search_finds_is_reached_by_another_integrator_and_stays_below_what_is_proved(law, room, swing):
    found = proved_sliding(replace(task("0", 8000), state_law=law, swing=swing), HELD, log_rate=room)
    plant, worst = SlidingPieces(found, found.task), worst_sliding(found)
    stress, ahead = next(courses(found, plant))
    every = [plant.largest(stress[:, [k]], ahead[:, [k]])[0] for k in range(stress.shape[1])]
    best = int(np.argmax(every))
    assert np.all(np.abs(stress) == 8000)
    assert np.all(np.abs(ahead) == float(swing))
    assert replayed(found.task, stress[:, best], ahead[:, best]) == pytest.approx(every[best], rel=2e-3)
    assert every[best] <= worst.log_rate < 1.01 * every[best]  # after 1 cm there is hardly less normal stress
    assert worst.log_rate < found.claims.log_rate < 2.5 * worst.log_rate
    assert worst.slip_error < found.claims.slip_error
    swings = 8000 * np.sin(2 * math.pi * np.arange(len(stress))[:, None] / np.array([[8, 40, 200]]))
    pushed = np.where(swings < 0, -8000.0, 8000.0)
    assert plant.largest(pushed, pushed / 8000 * float(swing))[0] <= worst.log_rate


@pytest.mark.slow
def test_where_the_way_has_taken_normal_stress_the_same_stress_does_more():
    """40 cm of it leave 46 of 50 MPa: what is found is reached there by another integrator."""
    found = proved_sliding(replace(task("0", 8000), distance=F("0.4")), HELD)
    here, there = (SlidingPieces(found, found.task, slip) for slip in (F(0), F("0.4")))
    stress, ahead = next(courses(found, there))
    every = [there.largest(stress[:, [k]], ahead[:, [k]])[0] for k in range(stress.shape[1])]
    best = int(np.argmax(every))
    seen = replayed(found.task, stress[:, best], ahead[:, best], normal=46e6)
    assert seen == pytest.approx(every[best], rel=2e-3)
    assert seen > 1.05 * here.largest(*next(courses(found, here)))[0]
    assert seen <= worst_sliding(found).log_rate * 1.002
    assert worst_sliding(found).log_rate < found.claims.log_rate


@pytest.mark.slow
def test_on_a_preset_the_search_comes_to_what_an_adversary_with_inertia_found():
    """1.220 V, by an ascent along the adjoint of the plant with inertia; 1.202 V before the way counted."""
    found = guarantee_sliding(load_fault("crustal-patch"), setup=ExactSetup(diffusion=F(833)))
    assert 1.2195 < math.exp(worst_sliding(found.proof).log_rate)
    assert worst_sliding(found.proof).log_rate < found.proof.claims.log_rate


def followed(stress, corner, pieces=4):
    """Largest |ln(v/V)|, |slip error|, |ln(state)| and |p - p*| of many courses at once, of stress by small step.

    By Lambert's function and RK4; `corner` has a, b and D_c of every course.
    """
    normal, stiffness, damping, speed, mu, lag, period = 50e6, 6e6, 2e7, 1.2e-6, 0.6, 10.0, 50.0
    own, fed, output = (np.array(part, float) for part in (HELD.law.update, HELD.law.measured, HELD.law.output))
    (a, b, d), courses, h = corner, stress.shape[1], period / pieces

    def log_rate(x, z, p, s):
        driving = (s - stiffness * x + mu * p + damping * speed) / (normal - p) - b * z
        scale = a * (normal - p) / damping
        return np.log(scale / speed * lambertw(np.exp(driving / a) * speed / scale).real)

    def rates(x, z, p, s):
        y = log_rate(x, z, p, s)
        return np.array([speed * np.expm1(y), speed / d * (np.exp(-z) - np.exp(y))])

    state, p, law, held = np.zeros((2, courses)), np.zeros(courses), np.zeros((len(output), courses)), np.zeros(courses)
    largest, half, whole = np.zeros((4, courses)), math.exp(-h / 2 / lag), math.exp(-h / lag)
    for number, s in enumerate(stress):
        if number % pieces == 0:
            held = output @ law + float(HELD.law.feedback[0]) * state[0]
            law = own @ law + np.outer(fed[:, 0], state[0])
        middle, end = held + (p - held) * half, held + (p - held) * whole
        k1 = rates(*state, p, s)
        k2 = rates(*(state + h / 2 * k1), middle, s)
        k3 = rates(*(state + h / 2 * k2), middle, s)
        k4 = rates(*(state + h * k3), end, s)
        state, p = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), end
        moved = np.maximum(*(np.abs(log_rate(*state, p, way * s)) for way in (1, -1)))
        largest = np.maximum(largest, np.abs([moved, *state, p]))
    return largest, log_rate(*state, p, 0 * p)


def corners_of(ranges, courses, random):
    ends = [ranges[name] for name in ("direct_effect", "evolution_effect", "critical_slip")]
    return [np.array(end, float)[random.integers(2, size=courses)] for end in ends]


@pytest.mark.slow
@pytest.mark.parametrize("courses", [200, pytest.param(10_000, marks=pytest.mark.slow)])
def test_no_course_of_many_leaves_what_is_proved(courses):
    """Stresses that push along a nominal response up to a random time, with random turns or without, or turn alone."""
    stress, count, random = 8000, 160, np.random.default_rng(7)  # small steps for which a response is followed
    found = proved_sliding(task("0.02", stress), HELD)
    _, response = followed(np.eye(count), corners_of(task("0", stress).ranges, count, random))
    end = np.where(random.random(courses) < 0.5, count, random.integers(1, count + 1, size=courses))
    place = (np.arange(2 * count)[:, None] + count - end) % count
    share = np.where(random.random(courses) < 0.5, 10.0 ** random.uniform(-2.5, 0, courses), 0)
    turns = np.cumsum(random.random(place.shape) < share, axis=0) + random.integers(2, size=courses)
    along = np.where(random.random(courses) < 0.8, np.sign(response)[place], 1)
    largest, _ = followed(stress * along * (1 - 2 * (turns % 2)), corners_of(found.task.ranges, courses, random))
    claims = found.claims
    for seen, most in zip(largest, (claims.log_rate, claims.slip_error, claims.log_state, claims.push), strict=True):
        assert seen.max() <= most
    assert largest[0].max() > claims.log_rate / 3


def test_the_box_is_searched_at_its_corners():
    ends = [(c.ranges["direct_effect"][0], c.ranges["critical_slip"][1]) for c in corners(task("0.1", 8000))]
    assert len(ends) == 8
    assert set(ends) == {(F(a), F(d)) for a in ("0.009", "0.011") for d in ("0.0009", "0.0011")}


@pytest.mark.slow
def test_ten_percent_of_a_b_and_d_c_are_certified_to_within_three_times_the_worst_found():
    """a = 0.010, b = 0.015, D_c = 1 mm, 50 MPa, 5 km, V = 1.2 µm/s, L²/D = 833 s, under 25 kPa."""
    wide = parse_guarantee((PROOFS / "certificates" / "boxes" / "sliding_ten-percent.json").read_text())
    loose = replace(wide.claims, log_rate=UpperBound(F(1, 2)), log_state=UpperBound(F(1, 5)))
    loose = replace(loose, slip_error=UpperBound(F(1, 2000)), push=UpperBound(F(600000)), asked=UpperBound(F(1800000)))
    wide = replace(wide, claims=loose)
    smaller = replace(wide, claims=slow_sliding._smallest_claims(wide))
    assert smaller.check() is Verdict.PROVED
    assert smaller.peak_slip_rate < F(132, 100) * wide.task.rate
    assert worst_sliding(smaller).log_rate < smaller.claims.log_rate < 2 * worst_sliding(smaller).log_rate


def test_the_proof_of_a_box_ends_where_its_bounds_are_larger_than_their_estimate(monkeypatch):
    """However small a box is cut: once at the worst corner, and at a box after as many cuts as there may be."""
    asked, wide = [], task("0.02", 8000)
    monkeypatch.setattr(slow_sliding, "_smallest_claims", lambda found: replace(found.claims, push=UpperBound(F(1))))
    monkeypatch.setattr(slow_sliding, "cell_bounds", lambda *told: asked.append(told) or {})
    monkeypatch.setattr(slow_sliding, "follows", lambda bounds, claims: False)
    assert "in 64 cells of the box" in proved_sliding(wide, HELD).reason
    assert len(asked) == 1
    monkeypatch.setattr(slow_sliding, "_excess", lambda *told: 0.5)
    monkeypatch.setattr(slow_sliding, "follows", lambda bounds, claims: len(asked) == 2)
    assert "in 64 cells of the box" in proved_sliding(wide, HELD).reason
    assert len(asked) == 2 + 64
    monkeypatch.setattr(slow_sliding, "_excess", lambda plant, *told: 1.0 if plant == wide else 0.95)
    monkeypatch.setattr(slow_sliding, "_cut", None)
    assert proved_sliding(wide, HELD).reason.endswith("with the laws that were tried")


@pytest.mark.parametrize(("cost", "least", "most"), [(2.5, 41, 55), (1.5, 60, 72)])
def test_a_search_ends_whose_best_law_stays_too_far_from_what_is_asked(monkeypatch, cost, least, most):
    """A stress far beyond what laws stand: told before a proof is tried."""
    costs = []

    def estimated(loop, corner, held, claims):
        costs.append(cost - len(costs) / 1000)
        return {"log_rate": costs[-1] / 2}

    monkeypatch.setattr(slow_sliding, "spectral_radius", lambda loop: 0.5)
    monkeypatch.setattr(slow_sliding, "_estimate_of", estimated)
    slow_sliding.searched_sliding(task("0", 8000), F(50), F(1, 2), ExactSetup(lag=F(10)), most=70)
    assert least <= len(costs) <= most
