"""Limits in the frequency domain against eigenvalues, closed forms and another library."""

from dataclasses import replace
from fractions import Fraction as F
from itertools import product

import control
import numpy as np
import pytest
from scipy.optimize import brentq

from quakedesign.errors import ParameterError
from quakedesign.linear.frequency import circle_limit, frequency_properties, slip_limit
from quakedesign.linear.linear_problem import FeedbackLoop, floats
from quakedesign.lyapunov.exact.perturbation_bounds import Sectors


def loop_of(gains, *, beta, slip, rate):
    sectors = Sectors(
        authority=F(1), beta=beta, slip=slip, rate=rate, row_bounds=(F(0), F(0)), largest_effective_stress=F(1)
    )
    return FeedbackLoop(gains=tuple(F(k) for k in gains), sectors=sectors)


LOOP = loop_of((104, 14, 150, 78), beta=(F(1), F(57, 40)), slip=(F(-1), F(29, 10)), rate=(F(23, 10), F(23, 10)))


def eigenvalues(loop, *corner):
    return np.linalg.eigvals(floats(loop.matrix(corner)))


def test_a_loop_is_stable_where_its_eigenvalues_are_and_its_worst_vertex_is_told():
    rng = np.random.default_rng(3)
    verdicts = set()
    for _ in range(400):
        loop = loop_of(rng.integers(-4, 80, size=4).tolist(), beta=(F(1), F(2)), slip=(F(-1), F(3)), rate=(F(1), F(2)))
        found = {corner: eigenvalues(loop, *corner).real.max() for corner in loop.sectors.vertices()}
        assert len(found) == 8
        if min(map(abs, found.values())) > 1e-6:
            verdicts.add(loop.unstable_vertex() is None)
            assert {corner: loop.stable(corner) for corner in found} == {c: value < 0 for c, value in found.items()}
            assert loop.unstable_vertex() == next((c for c, value in found.items() if value > 0), None)
    assert verdicts == {True, False}


def test_ranges_that_are_not_ordered_are_refused():
    with pytest.raises(ParameterError, match="ordered"):
        loop_of((1,) * 4, beta=(F(2), F(1)), slip=(F(0), F(1)), rate=(F(1), F(1)))


@pytest.mark.parametrize(
    "gains", [(104, 14, 150, 78), (74, F(157, 10), F(58, 1000), F(15, 10**7)), (10, 1, 30, 40), (20, 3, 19, 1)]
)
def test_the_slip_limit_is_where_an_eigenvalue_crosses(gains):
    loop = loop_of(tuple(F(g) for g in gains), beta=(F(1), F(4)), slip=(F(-1), F(-1)), rate=(F(23, 10),) * 2)
    limit, beta = slip_limit(loop, F(23, 10))
    assert loop.sectors.beta[0] <= beta <= loop.sectors.beta[1]
    assert eigenvalues(loop, beta, limit + abs(limit) / 1000, F(23, 10)).real.max() > 0
    below = limit - abs(limit) / 1000
    dense = [F(1) + F(i, 20) for i in range(61)]
    assert max(eigenvalues(loop, b, below, F(23, 10)).real.max() for b in dense) < 0


def test_the_least_limit_may_lie_inside_the_range_of_beta():
    # k1·k3 only just above k2·k4: the limit falls, then rises with β, and is least where (2 + 3β)² = 200
    loop = loop_of((F("4.3"), F(3), F(30), F(40)), beta=(F(1), F(10)), slip=(F(-1), F(-1)), rate=(F(2),) * 2)
    limit, beta = slip_limit(loop, F(2))

    def at(b):
        damping = 2 + 3 * b
        return 4.3 * b - 30 * b / damping - damping * 40 / 30

    assert float(beta) == pytest.approx((200**0.5 - 2) / 3, abs=1e-5)
    assert float(limit) == pytest.approx(at(float(beta)), rel=1e-12)
    assert at(float(beta)) < min(at(1), at(10)) - 0.1
    for ends in ((F(1), F(2)), (F(5), F(10))):  # the least point lies outside
        limit, beta = slip_limit(replace(loop, sectors=replace(loop.sectors, beta=ends)), F(2))
        assert beta in ends
        assert float(limit) == pytest.approx(min(at(float(b)) for b in ends), rel=1e-12)


def test_a_loop_without_double_integral_action_has_no_limit():
    loop = loop_of((F(104), F(14), F(150), F(-1)), beta=(F(1),) * 2, slip=(F(-1),) * 2, rate=(F(2),) * 2)
    assert slip_limit(loop, F(2)) is None


def test_no_limit_is_given_where_one_end_of_the_range_has_no_damping():
    loop = loop_of((F(4), F(3, 10), F(1), F(1)), beta=(F(1), F(4)), slip=(F(-1),) * 2, rate=(F(-1, 2),) * 2)
    assert slip_limit(loop, F(-1, 2)) is None


@pytest.mark.parametrize(
    ("gains", "rate"),
    [
        (("4", "0", "3", "2"), "2"),  # no feedback of the slip rate
        (("4", "3", "3", "4"), "2"),  # k1·k3 = k2·k4
        (("1", "3", "2", "40"), "2"),  # k1·k3 < k2·k4
        (("0.24", "0.2", "1", "1"), "0.01"),  # the least limit lies inside the range, for a small damping
    ],
)
def test_the_limit_is_the_least_of_all_beta(gains, rate):
    k1, k2, k3, k4 = map(float, gains)
    loop = loop_of(tuple(map(F, gains)), beta=(F(1), F(4)), slip=(F(-1),) * 2, rate=(F(rate),) * 2)
    limit, beta = slip_limit(loop, F(rate))
    b = np.linspace(1, 4, 300001)
    damping = float(rate) + b * k2
    every = b * k1 - b * k3 / damping - damping * k4 / k3
    assert float(limit) == pytest.approx(every.min(), rel=1e-7)
    assert float(beta) == pytest.approx(b[every.argmin()], abs=1e-3)


def test_the_circle_criterion_allows_every_slope_where_the_real_part_is_nowhere_positive():
    # characteristic polynomial z⁴ + 2z³ + 2z² + z + 10: Re D(jω) = ω⁴ − 2ω² + 10 > 0
    loop = loop_of((1, 0, 1, 10), beta=(F(1),) * 2, slip=(F(-1),) * 2, rate=(F(2),) * 2)
    assert circle_limit(loop, F(1), F(2), F(-1)) == float("inf")


@pytest.mark.parametrize("share", [F(1, 2), F(2)])
def test_margins_of_one_integral_in_closed_form(share):
    """L = K/(z(z² + 3z + 2)): the phase is −180° at ω = √2, where |L| = K/6."""
    loop = loop_of((0, 0, 6 * share, 0), beta=(F(1),) * 2, slip=(F(-2),) * 2, rate=(F(3),) * 2)
    facts = frequency_properties(loop, (F(1), F(-2), F(3)))
    expected = float(1 / share)
    found = {"gain_margin": facts.gain_margin, "gain_reduction": facts.gain_reduction}
    assert found == {
        "gain_margin": pytest.approx(expected) if expected > 1 else None,
        "gain_reduction": pytest.approx(expected) if expected < 1 else None,
    }
    at = brentq(lambda w: w * abs(2 - w**2 + 3j * w) - float(6 * share), 1e-3, 10)
    phase = 90 - np.degrees(np.arctan2(3 * at, 2 - at**2))
    assert facts.phase_margin == pytest.approx(abs(phase), rel=1e-6)
    assert facts.delay_margin == pytest.approx(np.radians(phase % 360) / at, rel=1e-6)


def test_margins_of_feedback_of_the_slip_in_closed_form():
    """L = 10/(z² + z + 1): |L| = 1 where ω⁴ − ω² − 99 = 0, and both integrals cancel."""
    loop = loop_of((10, 0, 0, 0), beta=(F(1),) * 2, slip=(F(-1),) * 2, rate=(F(1),) * 2)
    facts = frequency_properties(loop, (F(1), F(-1), F(1)))
    at = np.sqrt((1 + np.sqrt(397)) / 2)
    phase = 180 - np.degrees(np.arctan2(at, 1 - at**2))
    assert (facts.gain_margin, facts.gain_reduction) == (None, None)
    assert facts.phase_margin == pytest.approx(phase, rel=1e-6)
    assert facts.delay_margin == pytest.approx(np.radians(phase) / at, rel=1e-6)


def test_the_nearest_of_several_crossings_is_the_margin():
    """An unstable plant with integrals has a gain reduction from statics and one from the integrals."""
    corner, gains = (F(1), F(29, 10), F(23, 10)), (104, 14, 150, 78)
    loop = loop_of(gains, beta=(F(1),) * 2, slip=(F(29, 10),) * 2, rate=(F(23, 10),) * 2)
    facts = frequency_properties(loop, corner)
    w = np.logspace(-2, 3, 2_000_001)
    z = 1j * w
    L = (14 * z**3 + 104 * z**2 + 150 * z + 78) / (z**2 * (z**2 + 2.3 * z - 2.9))
    crossings = np.flatnonzero((L.imag[:-1] * L.imag[1:] < 0) & (L.real[:-1] < 0))
    factors = 1 / np.abs(L[crossings])
    assert facts.gain_margin is None
    assert not (factors > 1).any()
    assert facts.gain_reduction == pytest.approx(factors[factors < 1].max(), rel=1e-4)
    passing = np.flatnonzero((np.abs(L[:-1]) - 1) * (np.abs(L[1:]) - 1) < 0)
    phases = np.degrees(np.angle(-L[passing]))
    assert facts.phase_margin == pytest.approx(np.abs(phases).min(), rel=1e-4)
    assert facts.delay_margin == pytest.approx((np.radians(phases % 360) / w[passing]).min(), rel=1e-4)


def test_without_feedback_nothing_crosses():
    loop = loop_of((0, 0, 0, 0), beta=(F(1),) * 2, slip=(F(-1),) * 2, rate=(F(2),) * 2)
    facts = frequency_properties(loop, (F(1), F(-1), F(2)))
    assert (facts.gain_margin, facts.gain_reduction, facts.phase_margin, facts.delay_margin) == (None,) * 4


def test_the_circle_criterion_is_never_above_the_linear_limit_and_here_close():
    limit, beta = slip_limit(LOOP, F(23, 10))
    circle = circle_limit(LOOP, beta, F(23, 10), F(-1))
    linear = float(limit + 1)
    assert 0.99 * linear < circle <= linear * (1 + 1e-12)


@pytest.mark.parametrize("corner", list(product((F(1), F(57, 40)), (F(-1), F(29, 10)), (F(23, 10),))))
def test_margins_move_a_pole_onto_the_axis(corner):
    facts = frequency_properties(LOOP, corner)
    beta, slip, rate = (float(v) for v in corner)
    assert facts.stable
    if facts.gain_reduction is not None:
        scaled = loop_of(
            tuple(k * F(facts.gain_reduction) for k in LOOP.gains),
            beta=LOOP.sectors.beta,
            slip=LOOP.sectors.slip,
            rate=LOOP.sectors.rate,
        )
        assert abs(eigenvalues(scaled, *corner).real.max()) < 1e-6
    assert facts.gain_margin is None
    # delay: 1 + L(jω)e^{−jωτ} = 0 at the crossing
    omega = np.logspace(-3, 3, 400001)
    z = 1j * omega
    L = beta * (14 * z**3 + 104 * z**2 + 150 * z + 78) / (z**2 * (z**2 + rate * z - slip))
    distance = np.abs(1 + L * np.exp(-z * facts.delay_margin)).min()
    assert distance < 1e-3
    assert np.abs(1 + L * np.exp(-z * facts.delay_margin * 0.9)).min() > 0.02
    assert facts.return_difference == pytest.approx(np.abs(1 + L).min(), rel=1e-4)


def test_norms_agree_with_python_control():
    for corner in LOOP.sectors.vertices():
        A = floats(LOOP.matrix(corner))
        facts = frequency_properties(LOOP, corner)
        for row, value in ((0, facts.disturbance_peak_slip), (1, facts.disturbance_peak_rate)):
            system = control.ss(A, np.array([[0.0], [1], [0], [0]]), np.eye(4)[[row]], [[0.0]])
            peak = np.abs(control.frequency_response(system, np.logspace(-2, 2, 4001)).frdata).max()
            assert value == pytest.approx(peak, rel=1e-3)


def test_an_optimal_k_has_a_return_difference_of_at_least_one():
    A = np.array([[0, 1, 0, 0], [-1, -2.3, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0]], dtype=float)
    K, _, _ = control.lqr(A, np.array([[0.0], [1], [0], [0]]), np.eye(4), [[1.0]], method="scipy")
    loop = loop_of(
        tuple(F(float(k)) for k in K[0]),
        beta=(F(1),) * 2,
        slip=(F(-1),) * 2,
        rate=(F(23, 10),) * 2,
    )
    facts = frequency_properties(loop, loop.sectors.vertices()[0])
    assert facts.return_difference > 1 - 1e-6
    assert facts.phase_margin >= 60
    assert facts.gain_reduction is None or facts.gain_reduction <= 0.5
