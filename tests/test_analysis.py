"""Verdicts on a K, and what is said where no V was found."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.laws import published
from quakedesign.linear.linear_problem import FeedbackLoop, floats
from quakedesign.linear.robust_stability import analysis, why_undecided
from quakedesign.lyapunov import Verdict
from quakedesign.lyapunov.exact.perturbation_bounds import Sectors, sectors

LAB = qd.load_fault("lab-fault")
GOOD = published("lab-fault")["elqr"]


@pytest.mark.slow
def test_good_gains_have_every_certificate():
    found = analysis(LAB, GOOD)
    assert found.verdict is Verdict.PROVED
    assert found.unstable_at is None
    assert list(found.certificates) == ["stability", "friction-slope", "low-beta", "high-beta"]
    assert all(c.check() is Verdict.PROVED for c in found.certificates.values())


def test_a_destabilising_gain_is_refuted_at_a_vertex_with_an_unstable_pole():
    bad = replace(GOOD, gains={n: -k for n, k in GOOD.gains.items()})
    found = analysis(LAB, bad)
    assert found.verdict is Verdict.REFUTED
    assert found.certificates == {}
    loop = FeedbackLoop(gains=tuple(bad.gains.values()), sectors=sectors(LAB))
    assert np.linalg.eigvals(floats(loop.matrix(found.unstable_at))).real.max() > 0
    assert "not stable near beta" in why_undecided(loop)


def test_stable_vertices_without_a_v_are_said_to_be_so():
    # a wide range of s: every constant loop is stable, what varies may not be
    wide = Sectors(
        authority=F(1), beta=(F(1), F(1)), slip=(F(-50), F(3)), rate=(F(1, 10), F(1, 10)), row_bounds=(F(0), F(0)),
        largest_effective_stress=F(1),
    )  # fmt: skip
    loop = FeedbackLoop(gains=(F(4), F(1, 10), F(1, 100), F(1, 1000)), sectors=wide)
    assert loop.unstable_vertex() is None
    assert "every constant vertex" in why_undecided(loop)
