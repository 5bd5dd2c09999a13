"""The sampled law that runs, against adversaries that switch its parameters inside a period."""

import itertools
from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_lyapunov

import quakedesign as qd
from quakedesign import cache
from quakedesign.laws import published
from quakedesign.linear import linear_problem as m
from quakedesign.linear import sampled_stability as clock_dependent
from quakedesign.linear import sampled_stability as input_delay
from quakedesign.linear.linear_problem import LinearProblem
from quakedesign.linear.riccati import riccati_design
from quakedesign.linear.sampled_stability import (
    clock_proof,
    delay_proof,
    largest_varying_step,
    sampled_stability,
    varying_verdict,
)
from quakedesign.lyapunov import Verdict

REAL, LAB = qd.load_fault("real-fault"), qd.load_fault("lab-fault")
PROBLEM = LinearProblem.of(REAL)
NEAR_LIMIT = tuple(F(k) for k in (2376609605, 471405875, 2383177616, 861366758))


def period(problem, gains, step, course):
    """One period of the scheme explicit: x, ξ at a sample to the next; the parameters take a course in equal parts."""
    b, row = float(problem.sectors.authority), np.array([float(k) for k in gains])
    whole = np.eye(3)
    for beta, s, w in course:
        motion = np.array([[0, 1, 0], [float(s), -float(w), float(beta) * b], [0, 0, 0]])
        whole = expm(motion * step / len(course)) @ whole
    start = np.vstack([np.eye(4)[:2], -row])  # x1, x2 and the pressure that is held
    return np.vstack([(whole @ start)[:2], [step, 0, 1, 0], [0, 0, step, 1]])


def periods(problem, gains, step, parts=2):
    return np.array([period(problem, gains, step, c) for c in itertools.product(problem.vertices(), repeat=parts)])


def radius(matrices):
    return np.abs(np.linalg.eigvals(matrices)).max()


def greedy_growth(choices, count=600):
    """Growth when an adversary always takes what is largest in the norm of the least stable of its choices."""
    worst = max(choices, key=radius)
    norm = solve_discrete_lyapunov((worst / (1.001 * max(radius(worst), 1))).T, np.diag([1, 0.01, 0.01, 0.01]))
    state, sizes = np.array([1.0, -1, 1, 1]), []
    for _ in range(count):
        state = max((matrix @ state for matrix in choices), key=lambda x: x @ norm @ x)
        sizes.append(np.sqrt(state @ norm @ state))
    return sizes[-1] / sizes[100]


def longest_of(problem, gains):
    return largest_varying_step(problem, gains)


def test_a_programme_is_solved_once_and_what_it_proposed_is_decided_each_time(tmp_path, monkeypatch):
    monkeypatch.setenv(cache.PLACE, str(tmp_path / "kept"))
    first = delay_proof(PROBLEM, NEAR_LIMIT, "0.1"), clock_proof(PROBLEM, NEAR_LIMIT, (F(1, 10), F(11, 100)), degree=4)
    assert None not in first
    with qd.stated_problems() as problems:
        assert delay_proof(PROBLEM, NEAR_LIMIT, "0.1") == first[0]
    assert len(problems) == 1
    for module in (input_delay, clock_dependent):
        monkeypatch.setattr(module, "solved", None)
    assert delay_proof(PROBLEM, NEAR_LIMIT, "0.1") == first[0]
    assert clock_proof(PROBLEM, NEAR_LIMIT, (F(1, 10), F(11, 100)), degree=4) == first[1]
    with pytest.raises(TypeError):
        delay_proof(PROBLEM, NEAR_LIMIT, "0.11")
    indefinite = [np.diag([1.0, 1, 1, -1]).tolist(), np.eye(3).tolist()]
    monkeypatch.setattr(input_delay, "search_once", lambda *_: indefinite)
    assert delay_proof(PROBLEM, NEAR_LIMIT, "0.1") is None


@pytest.fixture(scope="module")
def near_limit():
    return sampled_stability(PROBLEM, NEAR_LIMIT, "0.158")


def test_every_shorter_period_is_proved_exactly_by_one_of_the_proofs(near_limit):
    longest = near_limit.longest
    assert longest.proofs[0].covers(F(1, 10**9))
    assert all(one.covers(other.longest) for other, one in itertools.pairwise(longest.proofs))
    assert longest.proofs[-1].longest == longest.proved
    assert all(proof.holds(PROBLEM, NEAR_LIMIT) for proof in longest.proofs)
    assert longest.proof_at(longest.proved + F(1, 10**9)) is None


def test_just_below_the_proved_period_no_switching_diverges_and_at_the_refuted_one_it_does(near_limit):
    proved, refuted = float(near_limit.largest_step), float(near_limit.refuted_step)
    assert 0.97 * refuted < proved < refuted
    below, beyond = (periods(PROBLEM, NEAR_LIMIT, step) for step in (proved, refuted))
    twice = np.einsum("aij,bjk->abik", below, below).reshape(-1, 4, 4)
    assert radius(below) < 1
    assert radius(twice) < 1
    assert greedy_growth(below) < 1e-6
    assert radius(beyond) > 1
    assert greedy_growth(beyond) > 2


def test_the_law_that_runs_is_refuted_just_beyond_its_limit(near_limit):
    assert near_limit.verdict_at_step.verdict is Verdict.REFUTED
    assert radius(periods(PROBLEM, NEAR_LIMIT, 0.158, parts=1)) > 1
    between = varying_verdict(PROBLEM, NEAR_LIMIT, "0.157")
    assert between.verdict is Verdict.REFUTED
    assert radius(period(PROBLEM, NEAR_LIMIT, 0.157, [between.witness])) > 1


@pytest.mark.parametrize("fault", [REAL, LAB], ids=lambda f: f.name)
def test_published_gains_are_proved_at_half_their_task_s_period_and_refuted_at_the_whole(fault):
    problem, gains = LinearProblem.of(fault), tuple(published(fault.name)["elqr"].gains.values())
    step = F(str(fault.sampling_time))
    good, bad = (varying_verdict(problem, gains, t) for t in (step / 2, step))
    assert (good.verdict, bad.verdict) == (Verdict.PROVED, Verdict.REFUTED)
    switched = periods(problem, gains, float(step / 2))
    assert radius(np.einsum("aij,bjk->abik", switched, switched).reshape(-1, 4, 4)) < 1
    assert radius(period(problem, gains, float(step), [bad.witness])) > 1


@pytest.mark.slow
def test_the_designed_gains_run_up_to_the_proved_period_and_not_at_the_refuted_one():
    law = riccati_design(REAL).controller
    longest = longest_of(PROBLEM, tuple(law.gains.values()))
    proved, refuted = float(longest.proved), float(longest.refuted)
    assert proved < 0.1415  # at which the fault opens
    good = qd.simulate(REAL, law, scheme="explicit", step=proved, plant="printed")
    bad = qd.simulate(REAL, law, scheme="explicit", step=refuted, plant="printed")
    assert not {"opening", "diverged"} & set(good.events)
    assert good.metrics.max_slip_error < 1e-4
    assert {"opening", "diverged"} & set(bad.events)


def test_parameters_that_switch_can_destroy_what_constant_ones_leave_stable():
    # a spring between 1 and 9 with little damping: every constant one is stable, and switched twice a cycle it grows
    sectors = replace(PROBLEM.sectors, authority=F(1), beta=(F(1), F(1)), slip=(F(-8), F(0)), rate=(F(1, 20),) * 2)
    problem = LinearProblem(stiffness=F(5), damping=F(1, 20), sectors=sectors)
    gains = (F(1), F(1, 20), F(3, 100), F(2, 1000))
    constant = [period(problem, gains, 0.05, [(1, s, 0.05)]) for s in np.linspace(-8, 0, 81)]
    assert radius(np.array(constant)) < 1
    soft, stiff = (period(problem, gains, 0.05, [(1, s, 0.05)]) for s in (0, -8))
    cycle = np.linalg.matrix_power(soft, 31) @ np.linalg.matrix_power(stiff, 10)  # a quarter of either oscillation
    assert radius(cycle) > 1.5
    assert varying_verdict(problem, gains, "0.05").verdict is Verdict.UNDECIDED
    narrow = replace(problem, sectors=replace(sectors, slip=(F(-5), F(-5))))
    assert varying_verdict(narrow, gains, "0.05").verdict is Verdict.PROVED


LAB_PROBLEM, LAB_GAINS = LinearProblem.of(LAB), tuple(published("lab-fault")["elqr"].gains.values())
STEP = F("0.5e-3")


@pytest.mark.parametrize("share", ["1", "0.96", "0.9", "0.8", "0.7", "0.6"])
def test_one_v_is_found_for_every_shorter_period(share):
    """At some of them the solver breaks down, at which depends on the processor."""
    assert delay_proof(LAB_PROBLEM, LAB_GAINS, F(share) * STEP).longest == F(share) * STEP


def test_one_v_proves_and_breaks_when_a_number_changes():
    found = delay_proof(LAB_PROBLEM, LAB_GAINS, STEP)
    assert found.holds(LAB_PROBLEM, LAB_GAINS)
    changed = [
        replace(found, longest=2 * found.longest),
        replace(found, P=m.times(-1, found.P)),
        replace(found, W=m.times(-1, found.W)),
        replace(found, W=m.times(100, found.W)),
        replace(found, W=m.times(F(1, 100), found.W)),
        replace(found, P=_swapped(found.P)),
    ]
    assert not any(proof.holds(LAB_PROBLEM, LAB_GAINS) for proof in changed)
    assert not found.holds(LAB_PROBLEM, tuple(2 * k for k in LAB_GAINS))
    assert delay_proof(LAB_PROBLEM, LAB_GAINS, 2 * STEP) is None


@pytest.mark.slow
def test_a_v_that_depends_on_the_clock_proves_and_breaks_when_a_number_changes():
    found = clock_proof(LAB_PROBLEM, LAB_GAINS, (STEP, F("0.6e-3")), degree=4)
    assert found.holds(LAB_PROBLEM, LAB_GAINS)
    changed = [
        replace(found, longest=2 * found.longest),
        replace(found, shortest=found.shortest / 4),
        replace(found, shortest=-found.longest),
        replace(found, P=found.P[::-1]),
        replace(found, P=found.P[:1] * 5),
        replace(found, P=tuple(m.times(-1, p) for p in found.P)),
        replace(found, P=(*found.P[:2], m.times(F(11, 10), found.P[2]), *found.P[3:])),
        replace(found, P=(*found.P[:4], m.times(F(9, 10), found.P[4]))),
    ]
    assert not any(proof.holds(LAB_PROBLEM, LAB_GAINS) for proof in changed)
    assert not found.holds(LAB_PROBLEM, tuple(2 * k for k in LAB_GAINS))
    assert clock_proof(LAB_PROBLEM, LAB_GAINS, (F("0.75e-3"),) * 2) is None


def _swapped(P):
    """Signs of the products of slip with the rest turned."""
    return tuple(tuple(-v if (i == 0) != (j == 0) else v for j, v in enumerate(row)) for i, row in enumerate(P))


@pytest.mark.parametrize("kind", ["delay", "clock"])
def test_the_forms_are_what_the_derivation_says(kind):
    # V along a period in floating point, the parameters switched at random: it falls by what the forms promise
    rng = np.random.default_rng(4)
    proof = delay_proof(LAB_PROBLEM, LAB_GAINS, STEP) if kind == "delay" else clock_proof(
        LAB_PROBLEM, LAB_GAINS, (STEP, STEP), degree=4
    )  # fmt: skip
    P = np.array(proof.P if kind == "delay" else proof.P[0], dtype=float)
    state = rng.normal(size=4) / np.sqrt(np.diag(P))[:4]
    vertices, row = LAB_PROBLEM.vertices(), np.array([float(k) for k in LAB_GAINS])
    for _ in range(300):
        course = [vertices[i] for i in rng.integers(len(vertices), size=3)]
        new = period(LAB_PROBLEM, LAB_GAINS, float(STEP), course) @ state
        assert _level(kind, P, row, new) < _level(kind, P, row, state)
        state = new


def _level(kind, P, row, state):
    if kind == "delay":
        return state @ P @ state
    x1, x2, xi1, xi2 = state
    whole = np.array([x1, x2, xi1 + float(STEP) * x1, xi2 + float(STEP) * xi1, -row @ state])
    return whole @ P @ whole


def test_a_loop_that_is_unstable_itself_has_no_period():
    assert longest_of(LAB_PROBLEM, tuple(-k for k in LAB_GAINS)) is None
    assert varying_verdict(LAB_PROBLEM, tuple(-k for k in LAB_GAINS), STEP).verdict is Verdict.REFUTED
