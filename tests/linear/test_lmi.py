"""Robust stability and design by matrix inequalities: both checkers agree, answers as good as they can be."""

import subprocess
import sys
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import pytest

import quakedesign as qd
from quakedesign.laws import published
from quakedesign.linear.linear_problem import Polytope, polytope_of
from quakedesign.linear.riccati import riccati_design, vertex_poles
from quakedesign.linear.robust_stability import CommonQuadratic, robust_stability, sector_loop
from quakedesign.lyapunov import Verdict
from quakedesign.lyapunov.exact.perturbation_bounds import sectors

CHECKER = Path(__file__).parents[2] / "proofs" / "check.py"


@pytest.fixture(scope="module")
def real():
    return qd.load_fault("real-fault")


@pytest.mark.parametrize("fault_name", ["real-fault", "lab-fault"])
@pytest.mark.parametrize("origin", ["published", "designed"])
def test_one_v_proves_the_whole_box_and_nearly_the_slowest_pole(fault_name, origin):
    fault = qd.load_fault(fault_name)
    controller = published(fault_name)["elqr"] if origin == "published" else riccati_design(fault).controller
    needed = sectors(fault)
    certificate = robust_stability(sector_loop(controller, needed), fastest=True)
    slowest = -max(z.real for z in vertex_poles(needed, list(controller.gains.values())))
    assert certificate.check() is Verdict.PROVED
    assert 0.95 * slowest < float(certificate.claims["rate"]) <= slowest


def test_the_independent_checker_agrees(real, tmp_path):
    certificate = robust_stability(sector_loop(published("real-fault")["elqr"], sectors(real)))
    path = tmp_path / "elqr.json"
    certificate.save(path)
    done = subprocess.run([sys.executable, "-I", str(CHECKER), str(path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_destabilising_k_has_no_proof(real):
    good = published("real-fault")["elqr"]
    bad = replace(good, gains={n: -k for n, k in good.gains.items()})
    assert robust_stability(sector_loop(bad, sectors(real))) is None


def test_stable_vertices_alone_are_not_enough():
    # two stable matrices with an unstable mean (Liberzon 2003, Switching in Systems and Control, section 2.1)
    first = ((F(-1), F(10)), (F(0), F(-1)))
    second = ((F(-1), F(0)), (F(10), F(-1)))
    polytope = Polytope(states=("x", "y"), vertices={"a": first, "b": second})
    assert polytope.slowest() < 0
    assert CommonQuadratic(polytope)() is None


def test_the_decay_rate_of_a_known_pair():
    # A and A rotated by 90 degrees: V = |x|² is optimal, its rate −λ_max((A + Aᵀ)/2) = 1 − 1/2
    first = ((F(-1), F(1)), (F(0), F(-1)))
    second = ((F(-1), F(0)), (F(-1), F(-1)))
    found = CommonQuadratic(Polytope(states=("x", "y"), vertices={"a": first, "b": second})).fastest(1e-5)
    assert found.rate == pytest.approx(0.5, abs=2e-3)


def test_one_vertex_is_one_vertex(real):
    needed = sectors(real)
    point = replace(needed, beta=(F(1), F(1)), slip=(needed.slip[0],) * 2)
    assert len(polytope_of(sector_loop(published("real-fault")["elqr"], point)).vertices) == 1
    assert robust_stability(sector_loop(published("real-fault")["elqr"], point)) is not None
