"""Inverse optimality decided exactly, against the Riccati equation and against the return difference."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest
from own.printed_examples import printed_design, printed_row_example
from own.printed_theorem import TheoremProblem, inverse_optimality, moment_matrix, refutes

import quakedesign as qd
from quakedesign.linear import linear_problem as m
from quakedesign.linear.linear_problem import LinearProblem
from quakedesign.linear.riccati import riccati_design
from quakedesign.lyapunov import Verdict

RNG = np.random.default_rng(64)


def random_problem(g1, g2, k, eta):
    base = printed_row_example().problem
    bounds = (F(float(g1)).limit_denominator(1000), F(float(g2)).limit_denominator(1000))
    return replace(base, stiffness=F(float(k)).limit_denominator(1000), damping=F(float(eta)).limit_denominator(1000),
                   sectors=replace(base.sectors, row_bounds=bounds))  # fmt: skip


def margin(problem, gains):
    """Largest over the split w of the least over frequency of (|1 + L|² − 1)|den|² − what W asks for, relative."""
    k, eta, (g1, g2) = float(problem.stiffness), float(problem.damping), (float(g) for g in problem.bounds)
    K = [float(v) for v in gains]
    X = np.logspace(-7, 7, 4001)
    omega = 1j * np.sqrt(X)
    plant = omega**2 * (omega**2 + eta * omega + k)
    loop = K[0] * omega**2 + K[1] * omega**3 + K[2] * omega + K[3]
    size = K[1] ** 2 * X**3 + K[0] ** 2 * X**2 + K[2] ** 2 * X + K[3] ** 2
    left = np.abs(plant + loop) ** 2 - np.abs(plant) ** 2
    if not g1 or not g2:
        return np.min((left - (g1**2 + g2**2 * X) * X**2) / size)
    return max(
        np.min((left - (g1**2 / w + g2**2 * X / (1 - w)) * X**2) / size)
        for w in 1 / (1 + np.exp(-np.linspace(-7, 7, 141)))
    )


@pytest.mark.parametrize("bounds", ["both", "slip only", "none"])
def test_the_verdict_is_that_of_the_return_difference(bounds):
    decided = {Verdict.PROVED: 0, Verdict.REFUTED: 0}
    for _ in range(25):
        g1, g2 = {"both": RNG.uniform(0.1, 2, 2), "slip only": (RNG.uniform(0.1, 2), 0), "none": (0, 0)}[bounds]
        problem = random_problem(g1, g2, RNG.uniform(-1, 2), RNG.uniform(-0.5, 2))
        gains = [F(float(v)).limit_denominator(10**6) for v in 10 ** RNG.uniform([0, 0, -1, -2], [1.5, 1.2, 0.8, 0.3])]
        found = inverse_optimality(problem, gains)
        loop = np.array(problem.loop((F(1), -problem.stiffness, problem.damping), gains), dtype=float)
        stable = np.linalg.eigvals(loop).real.max() < 0
        room = margin(problem, gains)
        if abs(room) > 2e-2:
            assert found.verdict is (Verdict.PROVED if stable and room > 0 else Verdict.REFUTED)
            decided[found.verdict] += 1
    assert min(decided.values()) >= 2


@pytest.mark.parametrize("name", ["real-fault", "lab-fault"])
@pytest.mark.parametrize("box", ["paper", "ten-percent"])
def test_the_published_gains_are_optimal_for_a_q_that_covers_the_uncertainty(name, box):
    problem = LinearProblem.of(qd.load_fault(name, box=box))
    gains = tuple(qd.published(name)["elqr"].gains.values())
    found = inverse_optimality(problem, gains)
    assert found.verdict is Verdict.PROVED
    scales = found.scales
    inside, K = problem.nondimensional(scales), scales.gains_inside(gains)
    assert margin(inside, K) > 0
    # P solves the Riccati equation with Q = Q0 + D and R = 1, and gives K back: all exact
    Q = m.total(found.Q0, found.bound)
    unit = (F(0), F(1), F(0), F(0))
    residual = m.riccati_residual(inside.nominal(), m.outer(unit, unit), Q, found.P)
    assert all(v == 0 for row in residual for v in row)
    assert tuple(row[1] for row in found.P) == K
    assert m.definite(found.Q0)
    g1, g2 = inside.bounds
    D = [found.bound[0][0], found.bound[1][1]]
    assert g1**2 / D[0] + (g2**2 / D[1] if g2 else 0) <= 1


def test_a_riccati_design_is_recognised():
    fault = qd.load_fault("real-fault", box="ten-percent")
    gains = tuple(riccati_design(fault).controller.gains.values())
    assert inverse_optimality(LinearProblem.of(fault), gains).verdict is Verdict.PROVED


def test_a_destabilising_gain_is_refuted():
    problem = LinearProblem.of(qd.load_fault("real-fault"))
    gains = tuple(-k for k in qd.published("real-fault")["elqr"].gains.values())
    found = inverse_optimality(problem, gains)
    assert found.verdict is Verdict.REFUTED
    assert "Routh" in found.reason


def test_a_refuting_signal_is_checked_in_every_part():
    problem = printed_row_example().problem
    gains = printed_design(printed_row_example()).gains
    found = inverse_optimality(problem, gains)
    assert found.verdict is Verdict.REFUTED
    question = TheoremProblem(problem, gains, None)
    z = found.moments
    assert refutes(question, z)
    # tr(Z(AᵀP + PA)) is the same for every P with the second column K
    Z = moment_matrix(z)
    traces = {
        m.trace_of_product(Z, m.lyapunov(problem.nominal(), question.P([F(int(v)) for v in RNG.integers(-9, 9, 6)])))
        for _ in range(20)
    }
    assert len(traces) == 1
    assert not refutes(question, (z[0] * 2, *z[1:]))  # no longer positive semidefinite
    assert not refutes(question, (F(0),) * 4)
    assert not refutes(question, (F(1), F(10**6), F(10**6), F(10**6)))  # a signal that proves nothing
    assert found.frequency > 0


def test_two_frequencies_refute_where_one_does_not():
    # needs w near 1 at one frequency and near 0 at another: every single frequency admits some split
    problem = random_problem(1, 1, 0, 0)
    gains = (F(2), F(26, 11), F(1, 6), F(1, 71))
    found = inverse_optimality(problem, gains)
    assert found.verdict is Verdict.REFUTED
    z1, z2, z3, _ = found.moments
    assert z2 * z3 > z1**2  # not of one frequency
    k1, k2, k3, k4 = (float(k) for k in gains)
    X = np.logspace(-7, 7, 20001)
    w = 1j * np.sqrt(X)
    left = np.abs(w**4 + k2 * w**3 + k1 * w**2 + k3 * w + k4) ** 2 - X**4
    assert np.min(left - (X + X**1.5) ** 2) > 0  # each frequency alone admits a split: (g1 + g2ω)² is the least
    assert margin(problem, gains) < 0
