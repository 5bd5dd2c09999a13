"""One ellipsoid for every time scale: the published gains, whose poles lie six decades apart."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.certificates import Verdict
from quakedesign.certificates.linear_premises import sectors
from quakedesign.certificates.tracking import disturbance_inputs, tracking_inputs
from quakedesign.controllers import published
from quakedesign.errors import CertificateError
from quakedesign.sos.exact.definiteness import full_matrix
from quakedesign.synthesis.linear.certified_peaks import loop_for
from quakedesign.synthesis.linear.design.riccati import riccati_design
from quakedesign.synthesis.linear.disturbance_search import bang_bang, rate_limited, switched
from quakedesign.synthesis.linear.peak_cascade import cascade, separated


@pytest.fixture(scope="module")
def real():
    return qd.load_fault("real-fault")


@pytest.fixture(scope="module")
def loop(real):
    return loop_for(real, published("real-fault")["elqr"])


@pytest.fixture(scope="module")
def found(real, loop):
    return cascade(loop, disturbance_inputs(real, False), "slip_rate_error")


def test_it_is_used_where_the_poles_lie_apart(real, loop):
    assert separated(loop)
    assert not separated(loop_for(real, riccati_design(real).controller))


def test_the_published_gains_are_bounded_within_a_factor_four_of_what_was_found(real, loop, found):
    a = real.disturbance.largest_explicit
    worst = max(bang_bang(loop, corner, a, "slip_rate_error").peak for corner in loop.corners())
    assert found.check() is Verdict.PROVED
    assert len(found.ellipsoids) == 3
    assert max(worst, switched(loop, a, "slip_rate_error").peak) < float(found.bound) < 4 * worst


def test_the_rate_limited_class_too(real, loop):
    limited = cascade(loop, disturbance_inputs(real, True), "slip_rate_error")
    a, change = real.disturbance.largest_explicit, real.disturbance.largest_rate
    worst = max(rate_limited(loop, corner, a, change, "slip_rate_error").peak for corner in loop.corners())
    assert limited.check() is Verdict.PROVED
    assert worst < float(limited.bound) < 10 * worst


def test_a_slow_input_that_pushes_no_fast_mode_is_bounded(real, loop):
    # feedback on the state: in the long run e1 = −(k1r″ + k2r‴)/k4, the millimetre of ERRATA 29
    law = published("real-fault")["elqr"]
    drift = {"drift_rate": tracking_inputs(real, law, sectors(real))["drift_rate"]}
    slow = cascade(loop, drift, "slip_error")
    settled = drift["drift_rate"] / law.gains["k4"]
    assert settled < slow.bound < 2 * settled


def test_the_ellipsoids_need_each_other(found):
    assert all(sum(e.borrowed) > 0 for e in found.ellipsoids)
    for n, own in enumerate(found.ellipsoids):
        alone = replace(own, borrowed=(F(0),) * 3)
        rest = (*found.ellipsoids[:n], alone, *found.ellipsoids[n + 1 :])
        with pytest.raises(CertificateError):
            replace(found, ellipsoids=rest).check()
        more = replace(own, borrowed=tuple(b * 2 for b in own.borrowed))
        with pytest.raises(CertificateError):
            replace(found, ellipsoids=(*found.ellipsoids[:n], more, *found.ellipsoids[n + 1 :])).check()
    with pytest.raises(CertificateError):
        replace(found, ellipsoids=found.ellipsoids[:2], weights=found.weights[:2]).check()


def test_no_v_exceeds_one_under_random_switching(real, loop, found):
    forms = [np.array([[float(v) for v in row] for row in full_matrix(e.shape, 4)]) for e in found.ellipsoids]
    vertices, rng = np.array(loop.polytope().floats()), np.random.default_rng(4)
    a, step, runs = real.disturbance.largest_explicit, 0.02, 100
    x, top = np.zeros((runs, 4)), np.zeros(3)
    which, sign = rng.integers(len(vertices), size=runs), np.ones(runs)
    for _ in range(2500):
        fresh = rng.random(runs) < 0.03
        which = np.where(fresh, rng.integers(len(vertices), size=runs), which)
        sign = np.where(rng.random(runs) < 0.02, -sign, sign)
        push = np.zeros((runs, 4))
        push[:, 1] = a * sign
        M = vertices[which]
        first = np.einsum("nij,nj->ni", M, x) + push
        second = np.einsum("nij,nj->ni", M, x + step / 2 * first) + push
        x = x + step * second
        top = np.maximum(top, [np.einsum("ni,ij,nj->n", x, P, x).max() for P in forms])
    assert 0.05 < top[0] < 1
    assert (top < 1).all()
