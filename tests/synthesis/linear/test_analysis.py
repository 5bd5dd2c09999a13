"""Verdicts on a K, and what is said where no V was found."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np

import quakedesign as qd
from quakedesign.certificates import Verdict
from quakedesign.certificates.sectors import sectors
from quakedesign.controllers import published
from quakedesign.synthesis.linear.analysis.robust_stability import analysis, unstable_vertex, why_undecided
from quakedesign.synthesis.linear.plant.polytope import ErrorLoop, error_loop
from quakedesign.synthesis.linear.plant.problem import loop_matrix

LAB = qd.load_fault("lab-fault")
GOOD = published("lab-fault")["elqr"]


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
    loop = error_loop(tuple(bad.gains.values()), sectors(LAB))
    matrix = np.array([[float(v) for v in row] for row in loop_matrix(found.unstable_at, loop.authority, loop.gains)])
    assert np.linalg.eigvals(matrix).real.max() > 0
    assert "not stable near beta" in why_undecided(loop)


def test_stable_vertices_without_a_v_are_said_to_be_so():
    # a wide range of s: every constant loop is stable, what varies may not be
    loop = ErrorLoop(
        gains=(F(4), F(1, 10), F(1, 100), F(1, 1000)), authority=F(1), beta=(F(1), F(1)), slip=(F(-50), F(3)),
        rate=(F(1, 10), F(1, 10)),
    )  # fmt: skip
    assert unstable_vertex(loop) is None
    assert "every constant vertex" in why_undecided(loop)
