"""Synthesis against what is known exactly, against the literature, and never without a proof."""

import importlib.util
import math
from fractions import Fraction as F
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.laws import LoopField
from quakedesign.lyapunov import Verdict, certificate_text
from quakedesign.lyapunov.gains.path_following import scaled_norm
from quakedesign.lyapunov.gains.synthesise import OBJECTIVES, compared_gains, initial_loops, problem_of, synthesise
from quakedesign.symbolic import SignedPower

FAST = {"degrees": (5,), "starts": 1, "compare": False}


def helper(name):
    found = importlib.util.spec_from_file_location(name, Path(__file__).parents[1] / "search" / f"{name}.py")
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


attack, region = helper("attack"), helper("super_twisting_region")


@pytest.fixture(scope="module")
def small():
    return synthesise("cta", "norm", degrees=(5,), starts=1)


@pytest.mark.slow
def test_the_smallest_gains_are_proved_and_beat_the_published_ones(small):
    assert small.certificate.check() is Verdict.PROVED
    assert small.certificate.loop.gains == small.gains
    assert small.certificate.loop.uncertain == {"beta": (1, 1), "d": (-1, 1)}
    assert small.value == pytest.approx(math.dist([float(k) for k in small.gains.values()], (0, 0, 0, 0)))
    published = [math.sqrt(sum(k * k for k in s)) for s in ((7, 5, 2.3, 1.1), (13, 7.5, 2.3, 1.1), (19, 10, 2.3, 1.1))]
    assert [c.value for c in small.compared[:3]] == pytest.approx(published)
    assert [c.ratio for c in small.compared[:3]] == pytest.approx([n / small.value for n in published])
    assert len(small.compared) == 4
    assert small.compared[0].ratio > 1.2
    # necessary whatever V (ERRATA, end)
    assert small.gains["k3"] - abs(small.gains["k4"]) > 1


@pytest.mark.slow
def test_synthesised_gains_withstand_the_sampler(small):
    assert not attack.sample(attack.Claim.read(certificate_text(small.certificate)), 50_000)


@pytest.mark.slow
def test_every_bound_on_the_disturbance_gives_the_same_norm(small):
    lipschitz = "1e-4"
    # the λ-scaling maps the loops onto each other, so that the optimum is the same number; rounding moves the search
    other = synthesise("cta", "norm", lipschitz=lipschitz, **FAST)
    assert other.certificate.loop.uncertain["d"] == (-F(lipschitz), F(lipschitz))
    assert other.value == pytest.approx(small.value, rel=0.05)


@pytest.mark.slow
def test_super_twisting_comes_near_the_smallest_gains_that_are_stable_at_all():
    found = synthesise("super-twisting", "norm", degrees=(4, 8), starts=1)
    k1, k2 = (float(k) for k in found.gains.values())
    assert region.stable(k1, k2, 1)
    grid = [(a, b) for a in np.linspace(0.3, 3, 60) for b in np.linspace(1.01, 3, 60)]
    least = min(math.hypot(a, b) for a, b in grid if region.stable(a, b, 1))
    assert least * 0.97 < found.value < least * 1.08
    assert found.compared == ()


@pytest.mark.slow
def test_a_tighter_bound_on_beta_needs_larger_gains(small):
    wide = synthesise("cta", "norm", gain_range=(1, "1.425"), **FAST)
    assert wide.certificate.loop.uncertain["beta"] == (1, F("1.425"))
    assert wide.value > small.value


@pytest.mark.slow
def test_the_fastest_decay_at_equal_norm():
    found = synthesise("cta", "decay", degrees=(5,), starts=1, compare=False)
    assert found.norm <= math.hypot(7, 5, 2.3, 1.1) * (1 + 1e-9)
    assert found.certificate.check() is Verdict.PROVED
    # by the other room's bound on the settling time from all |e_i| ≤ 1, with V enclosed there in its own way
    from quakedesign.lyapunov.search.settling_time import settling

    bound = settling(found.certificate, 1)
    assert bound.seconds == pytest.approx(1 / found.value, rel=0.01)
    # κ = 1/66 is known for a V of (7, 5, 2.3, 1.1) that is α1 = 1 at e1 = 1, hence larger on the box; T = 5/κ
    assert found.value > 1 / (5 * 66)


@pytest.mark.slow
def test_gains_of_the_literature_are_returned_where_the_search_finds_nothing_better(monkeypatch):
    from quakedesign.lyapunov.gains import synthesise as gains

    monkeypatch.setattr(gains, "_climbed", lambda *_: [])
    kept = synthesise("cta", "norm", degrees=(5,), starts=1)
    assert tuple(kept.gains.values()) == (7, 5, F(23, 10), F(11, 10))
    assert kept.certificate.check() is Verdict.PROVED
    assert [c.ratio for c in kept.compared] == sorted(c.ratio for c in kept.compared)
    assert kept.compared[0].ratio == 1
    assert synthesise("cta", "norm", degrees=(5,), starts=1, compare=False) is None


@pytest.mark.slow
def test_no_set_beyond_the_bound_on_the_norm_takes_the_place_of_gains_found(monkeypatch):
    from quakedesign.lyapunov.gains import synthesise as gains

    monkeypatch.setattr(gains, "_climbed", lambda *_: [])
    kept = synthesise("cta", "beta", degrees=(5,), starts=1)
    assert kept.norm == pytest.approx(math.hypot(7, 5, 2.3, 1.1))  # the others reach farther, with larger norms
    assert kept.compared[0].ratio == 1
    assert all(c.ratio < 1 for c in kept.compared[1:])


def test_the_range_of_given_gains_is_the_largest_of_their_family():
    asked = problem_of("cta", "beta", lipschitz=1, gain_range=(1, 1), degrees=(5,))
    reached = compared_gains(asked, asked.published[0])
    low, high = reached.certificate.loop.uncertain["beta"]
    assert reached.value == pytest.approx(math.sqrt(high / low))
    from quakedesign.lyapunov.search.certify import closed_loop
    from quakedesign.lyapunov.search.lyapunov_search import find_certificate

    ends = (low * F(999, 1000), high * F(1001, 1000))
    assert find_certificate(closed_loop("cta", (7, 5, "2.3", "1.1"), lipschitz=1, gain_range=ends), 5) is None


@pytest.mark.slow
def test_the_paper_ratio_is_compared_at_its_best():
    # with generated V it is known to be proved for β in [1, 1.425] and 0.97 kI3 (METHODS), and to settle
    asked = problem_of("dia", "beta", lipschitz=1, gain_range=(1, 1), degrees=(5,))
    assert compared_gains(asked, asked.published[0]).value > math.sqrt(1.425)


@pytest.mark.slow
def test_the_widest_range_covers_what_is_asked_and_more():
    found = synthesise("cta", "beta", gain_range=("0.9", "1.1"), **FAST)
    low, high = found.certificate.loop.uncertain["beta"]
    assert low < F("0.9")
    assert high > F("1.1")
    assert found.value == pytest.approx(math.sqrt(high / low))
    assert low * high == pytest.approx(0.99, rel=1e-4)  # around the geometric middle
    assert found.norm <= math.hypot(7, 5, 2.3, 1.1) * 1.05


@pytest.mark.slow
def test_a_law_of_the_users_own():
    # ⌈⌈e2⌋² + e1⌋^½ inside: neither a law of the package nor in the literature's list, so that starts are random
    e1, e2, a, b, beta, d = sp.symbols("e1 e2 a b beta d", real=True)
    field = {e1: beta * (e2 - a * SignedPower(e1, sp.Rational(1, 2))), e2: d - b * SignedPower(e1, 0)}
    mine = LoopField(
        states={e1: 2, e2: 1}, field=field, gains=(a, b), constants=(), uncertain=(beta, d), domain="cells"
    )
    found = synthesise(mine, "norm", degrees=(4,), starts=1, seed=3)
    assert found.law == "custom"
    assert found.certificate.check(mine) is Verdict.PROVED
    again = synthesise("super-twisting", "norm", degrees=(4,), starts=1, seed=3, compare=False)
    assert found.gains == {"a": again.gains["k1"], "b": again.gains["k2"]}  # the same loop in other letters


def test_without_a_proof_there_are_no_gains(monkeypatch):
    monkeypatch.setattr("quakedesign.lyapunov.gains.path_following.find_certificate", lambda *a, **k: None)
    assert synthesise("super-twisting", "norm", degrees=(4,), starts=1) is None


def test_starts_depend_on_the_seed_alone():
    asked = problem_of("cta", "norm", lipschitz=1, gain_range=(1, 1))

    def draw(seed, count=7):
        return [loop.gains for loop, _ in zip(initial_loops(asked, seed), range(count), strict=False)]

    assert draw(1) == draw(1)
    assert draw(1)[:4] == draw(2)[:4]  # the literature
    assert draw(1)[4:] != draw(2)[4:]
    assert draw(1)[0] == {"k1": 7, "k2": 5, "k3": F(23, 10), "k4": F(11, 10)}


def test_gains_from_the_literature_are_carried_over_to_other_ranges():
    # e3 → βe3 maps β = b, |d| ≤ L onto β = 1, |d| ≤ bL, with gains times 1/b: k1 ∝ (bL)^⅔/b, k2 ∝ (bL)^½/b, k3 ∝ L
    asked = problem_of("cta", "norm", lipschitz="0.01", gain_range=("8", "8"))
    moved = asked.published[0].gains
    wanted = (7 * 0.08 ** (2 / 3) / 8, 5 * 0.08**0.5 / 8, 0.023, 0.011)
    assert [float(k) for k in moved.values()] == pytest.approx(wanted, rel=1e-3)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"objective": "speed"}, UnknownNameError, "objective must be one of norm, decay, beta"),
        ({"lipschitz": 0}, ParameterError, "positive bound on"),
        ({"starts": 0}, ParameterError, "starts must be a whole number from 1"),
        ({"objective": "beta", "bound": -1}, ParameterError, "positive bound on the norm"),
        ({"gain_range": (2, 1)}, ParameterError, "0 < b_m <= b_M"),
        ({"degrees": (-1,)}, ParameterError, "degree of V must be from 5 to 12"),
        ({"degrees": (5, 100)}, ParameterError, "degree of V must be from 5 to 12"),
        ({"degrees": ()}, ParameterError, "degree of V must be from 5 to 12"),
    ],
)
def test_bad_input_gets_one_clear_message(options, error, message):
    with pytest.raises(error, match=message):
        synthesise("cta", **options)


def test_a_law_without_literature_needs_a_bound_on_the_norm():
    with pytest.raises(ParameterError, match="needs a positive bound on the norm"):
        synthesise("super-twisting", "decay")


@pytest.mark.slow
def test_every_objective_beats_every_published_set():
    assert OBJECTIVES == ("norm", "decay", "beta")
    sets = [(7, 5, 2.3, 1.1), (13, 7.5, 2.3, 1.1), (19, 10, 2.3, 1.1), (25, 15, 2.3, 1.1)]
    for objective in OBJECTIVES:
        asked = problem_of("cta", objective, lipschitz=1, gain_range=(1, 1), degrees=(5,))
        for place, known in enumerate(sets):
            norm = scaled_norm(asked.published[place], asked.setting.exponents) * (1 + 1e-9)
            bound = norm if asked.setting.objective.bounded else None
            theirs = synthesise("cta", objective, bound=bound, degrees=(5,), starts=1).compared[place]
            assert tuple(map(float, theirs.gains.values())) == known
            assert theirs.ratio is not None
            assert theirs.ratio > 1.2


@pytest.mark.slow
def test_workers_change_no_digit(small):
    options = {"degrees": (5,), "starts": 3, "compare": False, "seed": 2}
    one, two = (synthesise("cta", "norm", workers=n, **options) for n in (1, 2))
    assert certificate_text(one.certificate) == certificate_text(two.certificate)


@pytest.mark.slow
def test_the_nested_law_needs_far_smaller_gains_than_the_paper_ratio():
    found = synthesise("dia", "norm", degrees=(5,), starts=1)
    assert found.certificate.check() is Verdict.PROVED
    assert found.gains["kI3"] > 1  # necessary whatever V (ERRATA, end)
    assert found.value < 6
    assert found.compared[0].norm > 400
