"""Super-twisting against its exactly known region of stability; the region itself against simulation."""

import importlib.util
import math
from fractions import Fraction as F
from pathlib import Path

import numpy as np
import pytest

from quakedesign.laws import law
from quakedesign.lyapunov import Verdict, loop_of
from quakedesign.lyapunov.search.certify import certify
from quakedesign.lyapunov.search.lyapunov_search import candidate_degrees, find_certificate

SPECIFICATION = importlib.util.spec_from_file_location(
    "super_twisting_region", Path(__file__).with_name("super_twisting_region.py")
)
region = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(region)

LAW = law("super-twisting")
GAINS = [(1.5, 1.1, 1), (0.7, 2, 1), (1, 3, 0.5), (3, 1.2, 1), (0.4, 1.5, 1), (0.3, 1.02, 0)]


@pytest.mark.parametrize(("k1", "k2", "L"), GAINS)
def test_the_closed_form_agrees_with_runs_against_the_worst_disturbance(k1, k2, L):
    rho = region.contraction(k1, k2, L)
    assert region.half_turn(k1, k2, region.worst(k1, L)) == pytest.approx(rho, rel=1e-8)
    assert region.half_turn_in_time(k1, k2, region.worst(k1, L), steps=60_000) == pytest.approx(rho, rel=3e-3)


def test_no_other_disturbance_is_worse():
    rng = np.random.default_rng(5)
    for k1, k2, L in GAINS[:3] * 4:
        reached = region.half_turn_in_time(k1, k2, region.random_disturbance(L, rng), steps=20_000)
        assert reached <= region.contraction(k1, k2, L) * (1 + 3e-3)


def test_an_uncertain_coefficient_is_worst_at_its_ends():
    k1, k2, L, low, high = 0.9, 2.0, 0.6, 0.8, 1.3

    def beta(z, xi):
        return high if xi > k1 * z else low

    rho = region.contraction(k1, k2, L, low, high)
    assert region.half_turn(k1, k2, region.worst(k1, L), beta) == pytest.approx(rho, rel=1e-8)
    assert rho > region.contraction(k1, k2, L)


def test_without_disturbance_all_positive_gains_do():
    # Levant (1993); the signals_delayed loop contracts by exp(−π·cot) a turn
    for k1, k2 in np.exp(np.random.default_rng(1).uniform(-3, 3, (50, 2))):
        assert region.stable(k1, k2, 0)


def test_known_sufficient_gains_lie_inside():
    # Seeber and Horn (2017), Automatica 84: k2 > L and k1 > √(k2 + L); Levant (1998): k1 ≥ 2√(…) is stricter still
    for k2, L in np.exp(np.random.default_rng(2).uniform(-2, 2, (100, 2))):
        assert (k2 <= L) or region.stable(1.0001 * math.sqrt(k2 + L), k2, L)
        assert not region.stable(1e3, 0.999 * L, L)
    assert region.stable(1.5, 1.1, 1)


def loop(k1, k2):
    uncertain = {"beta": (F(1), F(1)), "d": (F(-1), F(1))}
    return loop_of(LAW.name, LAW.loop_field(), gains={"k1": F(k1), "k2": F(k2)}, uncertain=uncertain)


def proved_and_stable(points):
    proved = [find_certificate(loop(*p)) is not None for p in points]
    return proved, [region.stable(float(a), float(b), 1.0) for a, b in points]


def test_proved_gains_lie_in_the_exact_region():
    inside, outside = region.grid()[65::59], [(F("0.62"), F(2)), (F("0.3"), F(4))]
    proved, stable = proved_and_stable([*inside, *outside])
    assert stable == [True] * len(inside) + [False, False]
    assert proved == stable


@pytest.mark.slow
def test_at_least_95_percent_of_the_stable_grid_are_proved_and_nothing_else():
    proved, stable = proved_and_stable(region.grid())
    assert all(s for p, s in zip(proved, stable, strict=True) if p)
    assert sum(proved) >= 0.95 * sum(stable)


def test_an_uncertain_coefficient_is_proved_only_within_its_exact_region():
    verdicts = {high: certify("super-twisting", ("1.2", "2"), lipschitz=1, gain_range=(1, high))[0] for high in (2, 40)}
    assert verdicts[2] is Verdict.PROVED
    assert region.stable(1.2, 2, 1, 1, 2)
    assert verdicts[40] is Verdict.UNDECIDED
    assert not region.stable(1.2, 2, 1, 1, 40)


def test_too_little_integral_action_is_refuted():
    assert certify("super-twisting", ("2", "1"), lipschitz=1)[0] is Verdict.REFUTED


def test_degrees_begin_where_the_states_can_be_coupled():
    assert candidate_degrees(loop(1, 2)) == (3, 4, 6, 8, 10)
