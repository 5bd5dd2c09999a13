"""What no controller can do with a linearised fault in slow sliding: closed forms, and no guarantee against it."""

from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from quakedesign.fault import load_fault
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee
from quakedesign.guarantees.exact.limit_theorems import (
    DisturbedSliding,
    longest_diffusion,
    longest_reaction,
    smallest_withdrawal,
)
from quakedesign.guarantees.search.lqg import sliding_model
from quakedesign.studies import limits

PATCH = load_fault("crustal-patch")
PUSH = DisturbedSliding(model=sliding_model(PATCH), amplitude=F(25_000))
V, D, N, A, B, K = 1e-6, 8e-3, 50e6, 0.010, 0.015, 32.04e9 / 15e3
MU = 0.63454 + (A - B) * np.log(1e3)
S = N * A + 1.0405e15 / 15e3**2 * V


def field(_, state, stress):
    """(x, z) typed in again: y = (d − Kx − Nbz)/S."""
    x, z = state
    y = (stress - K * x - N * B * z) / S
    return [V * y, -V / D * (y + z)]


def pole():
    rows = np.array([field(0.0, unit, 0.0) for unit in np.eye(2)]).T
    return max(np.linalg.eigvals(rows).real)


def test_reaction_path_and_pressure_are_bounded_by_the_unstable_pole():
    """ln(μP/D)/λ, acosh(μPe^(−λT)/D)²/λ and De^(λT)/μ."""
    power, step = F(50 * 10**6), F(300)
    assert float(longest_reaction(PUSH, power)) == pytest.approx(np.log(MU * 50e6 / 25e3) / pole(), rel=1e-9)
    reached = np.arccosh(MU * 50e6 / 25e3 * np.exp(-pole() * 300))
    assert float(longest_diffusion(PUSH, power, step)) == pytest.approx(reached**2 / pole(), rel=1e-9)
    assert float(smallest_withdrawal(PUSH, step)) == pytest.approx(25e3 / MU * np.exp(pole() * 300), rel=1e-9)


@pytest.mark.parametrize("late", [0.999, 1.001])
def test_a_pressure_that_answers_later_than_the_limit_loses_the_fault(late):
    """All of 20 MPa is withdrawn for ever from then on: errors turn just before the limit, and never beyond it."""
    limit = float(longest_reaction(PUSH, F(20 * 10**6)))
    before = solve_ivp(field, (0, late * limit), [0, 0], args=(25e3,), rtol=1e-11, atol=1e-14).y[:, -1]
    after = solve_ivp(field, (0, 12 / pole()), before, args=(25e3 - MU * 20e6,), rtol=1e-11, atol=1e-14).y[0]
    assert (after[-1] > before[0]) == (late > 1)


@pytest.mark.parametrize("step", [F(300), F(20_000)])
def test_the_surprise_is_the_answer_of_the_rate_to_a_step_of_stress(step):
    x, z = solve_ivp(field, (0, float(step)), [0, 0], args=(25e3,), rtol=1e-11, atol=1e-16).y[:, -1]
    rate_error = V * (25e3 - K * x - N * B * z) / S
    found = float(PUSH.smallest_rate_error(step))
    assert found == pytest.approx(rate_error, rel=1e-7)
    assert found > V * 25e3 / S


def test_no_guarantee_contradicts_the_limits():
    path = Path(__file__).parents[3] / "proofs" / "certificates" / "sliding_crustal-patch.json"
    proved = parse_guarantee(path.read_text())
    push = DisturbedSliding(model=PUSH.model, amplitude=proved.task.stress)
    assert push.smallest_rate_error(proved.sampled_loop.step) < proved.peak_slip_rate - proved.task.rate
    assert smallest_withdrawal(push, proved.sampled_loop.step) < proved.claims.push
    assert longest_diffusion(push, F(50 * 10**6), proved.sampled_loop.step) > proved.sampled_loop.diffusion


def test_a_fault_that_creeps_has_a_smallest_rate_error_and_no_other_limit():
    found = limits(load_fault("creeping-patch"), stress=1e5, prove=False)
    assert not found.disturbed.grows
    assert found.peak_slip_rate_error.impossible_beyond >= 0
    assert found.largest_step.impossible_beyond is found.farthest_well.impossible_beyond is None
    assert found.smallest_pressure.impossible_beyond is None
    assert len(found.smallest_peaks()) > 10


@pytest.mark.parametrize(
    ("kappa", "beta", "grows"),
    [
        (1, 4, True),  # s² − 2s + 1: both roots are 1
        (1, F("3.999"), False),  # they are complex
        (4, 7, False),  # s² − 2s + 4
        (4, 10, True),  # s² − 5s + 4
        (F(1, 4), F(1, 8), False),  # s² + (9/8)s + 1/4: both are negative
        (4, F(1, 2), False),  # s² + (9/2)s + 4: both are negative, with κ > 1
        (F(1, 4), F(5, 4), False),  # s² + 1/4: imaginary
        (F(1, 100), F("1.1"), False),  # s² − 0.09s + 0.01
        (F(1, 100), F("1.21"), True),  # s² − 0.2s + 0.01: both are 0.1
        (0, 1, False),  # s²: no λ above 0
    ],
)
def test_a_push_grows_exactly_where_an_eigenvalue_is_real_and_positive(kappa, beta, grows):
    model = PUSH.model
    stiffness = kappa * model.state_rate * model.strength / model.rate
    push = replace(PUSH, model=replace(model, stiffness=stiffness, weakening=beta * model.strength))
    assert push.grows is grows
    if grows:
        root = (beta - 1 - kappa + ((beta - 1 - kappa) ** 2 - 4 * kappa) ** 0.5) / 2
        assert float(push.pole) == pytest.approx(float(model.state_rate) * float(root), rel=1e-12)
