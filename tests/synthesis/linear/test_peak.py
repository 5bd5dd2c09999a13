"""Statements about peaks: every part of one matters, and what they say is true of trajectories."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest

from quakedesign.certificates import Verdict
from quakedesign.errors import CertificateError
from quakedesign.synthesis.linear.peak import Ellipsoid, PeakBound, tightest_bound
from quakedesign.synthesis.linear.peak_search import find_peak_bound
from quakedesign.synthesis.linear.plant.polytope import ErrorLoop

# time in 1/omega_n, slip in metres: the real fault's designed gains, rounded
LOOP = ErrorLoop(
    gains=(F(104), F(14), F(150), F(78)),
    authority=F(1),
    beta=(F(1), F(57, 40)),
    slip=(F(-1), F(29, 10)),
    rate=(F(23, 10), F(23, 10)),
)
OUTPUTS = ("slip_error", "slip_rate_error", "pressure_offset")


@pytest.fixture(scope="module")
def amplitude():
    return {o: find_peak_bound(LOOP, {"force": F(1)}, o) for o in OUTPUTS}


@pytest.fixture(scope="module")
def limited():
    return find_peak_bound(LOOP, {"force": F(1), "force_rate": F(1)}, "slip_rate_error")


def test_every_output_is_bounded_and_checks(amplitude, limited):
    assert all(b.check() is Verdict.PROVED for b in (*amplitude.values(), limited))


def test_a_bounded_rate_lowers_the_peak_and_a_slower_one_more(amplitude, limited):
    slower = find_peak_bound(LOOP, {"force": F(1), "force_rate": F(1, 10)}, "slip_rate_error")
    assert slower.bound < limited.bound < amplitude["slip_rate_error"].bound / 2


def test_a_slow_force_is_never_bounded_below_the_response_to_a_step():
    # the force may start anywhere within its bound, so a step at the start belongs to the class whatever the rate
    from scipy.linalg import expm

    found = find_peak_bound(LOOP, {"force": F(1), "force_rate": F(1, 100)}, "slip_rate_error")
    A, column = LOOP.polytope().floats()[0], np.array([[0.0], [1], [0], [0]])
    step = expm(np.block([[A, column], [np.zeros((1, 5))]]) * 1e-2)
    state, top = np.zeros(4), 0.0
    for _ in range(1000):
        state = step[:4, :4] @ state + step[:4, 4]
        top = max(top, abs(state[1]))
    assert top < float(found.bound) < 2 * top


def test_a_rate_that_is_no_limit_gives_the_amplitude_class_back(amplitude):
    fast = find_peak_bound(LOOP, {"force": F(1), "force_rate": F(10**6)}, "slip_rate_error")
    assert float(fast.bound / amplitude["slip_rate_error"].bound) == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize("factor", [F(1, 1000), F(10**6)])
def test_bounds_are_proportional_to_the_input(amplitude, factor):
    found = find_peak_bound(LOOP, {"force": factor}, "slip_rate_error")
    assert float(found.bound / factor / amplitude["slip_rate_error"].bound) == pytest.approx(1, rel=1e-3)


@pytest.mark.parametrize(("metre", "second", "pascal"), [(1000, F(1, 100), F(1, 7)), (F(1, 3), 60, 10**6)])
def test_bounds_do_not_depend_on_units(amplitude, metre, second, pascal):
    # a quantity of unit U counted in units that are U/c is c times larger
    k1, k2, k3, k4 = LOOP.gains
    other = ErrorLoop(
        gains=(
            k1 * pascal / metre,
            k2 * pascal * second / metre,
            k3 * pascal / (metre * second),
            k4 * pascal / (metre * second**2),
        ),
        authority=LOOP.authority * metre / second**2 / pascal,
        beta=LOOP.beta,
        slip=tuple(s / second**2 for s in LOOP.slip),
        rate=tuple(w / second for w in LOOP.rate),
    )
    found = find_peak_bound(other, {"force": metre / second**2}, "slip_rate_error")
    assert float(found.bound * second / metre / amplitude["slip_rate_error"].bound) == pytest.approx(1, rel=1e-3)


def test_the_bound_is_between_the_response_norm_and_a_classical_estimate(amplitude):
    # ∫|g|dt of every vertex is a lower bound; with P = 1 vertex the ellipsoid is at most twice as far (same order)
    from scipy.linalg import expm

    for output, found in amplitude.items():
        row = np.array([float(v) for v in LOOP.outputs()[output]])
        norms = []
        for A in LOOP.polytope().floats():
            step = 2e-3
            move = expm(np.block([[A * step, np.array([[0], [1], [0], [0]]) * step], [np.zeros((1, 5))]]))
            state, total = move[:4, 4], 0.0
            for _ in range(20000):
                total += abs(row @ state)
                state = move[:4, :4] @ state
            norms.append(total)
        assert max(norms) < float(found.bound) < 2.2 * max(norms)


def test_v_never_exceeds_one_under_the_worst_inputs_and_switching(amplitude):
    # greedy: at every instant the vertex and the force that raise V most; classical Runge–Kutta, fine step
    found = amplitude["slip_rate_error"]
    from quakedesign.sos.exact.definiteness import full_matrix

    P = np.array([[float(v) for v in row] for row in full_matrix(found.ellipsoids[0].shape, 4)])
    vertices, x, top, step = LOOP.polytope().floats(), np.array([0.0, 1e-9, 0, 0]), 0.0, 2e-3
    for _ in range(8000):
        g = P @ x
        A = max(vertices, key=lambda M: g @ (M @ x))
        push = np.array([0, np.sign(g[1]), 0, 0])
        k1 = A @ x + push
        k2 = A @ (x + step / 2 * k1) + push
        k3 = A @ (x + step / 2 * k2) + push
        x = x + step / 6 * (k1 + 2 * k2 + 2 * k3 + A @ (x + step * k3) + push)
        top = max(top, x @ P @ x)
    assert 0.3 < top < 1


def test_a_smaller_bound_does_not_check(amplitude, limited):
    for found in (*amplitude.values(), limited):
        with pytest.raises(CertificateError, match="do not bound the output"):
            replace(found, bound=found.bound * F(99999, 100000)).check()


def mutants(found):
    own = found.ellipsoids[0]
    loop = found.loop

    def with_own(**changes):
        return replace(found, ellipsoids=(replace(own, **changes),))

    scaled = {n: v * F(101, 100) for n, v in own.shares.items()}
    yield "shares", with_own(shares=scaled)
    yield "missing share", with_own(shares={})
    yield "negative share", with_own(shares=dict.fromkeys(own.shares, F(-1)))
    yield "decay", with_own(decay=own.decay * F(11, 10))
    yield "no decay", with_own(decay=F(0), shares=dict.fromkeys(own.shares, F(0)))
    yield "self", with_own(borrowed=(F(1, 10**6),))
    yield "short", with_own(shape=own.shape[:-1])
    yield "indefinite", with_own(shape=(-own.shape[0], *own.shape[1:]))
    yield "tilted", with_own(shape=(own.shape[0], own.shape[1] * F(21, 20), *own.shape[2:]))
    yield "larger input", replace(found, inputs={n: v * F(21, 20) for n, v in found.inputs.items()})
    yield "no input", replace(found, inputs={})
    yield "unknown input", replace(found, inputs={"wind": F(1)})
    yield "unknown output", replace(found, output="opinion")
    yield "other output", replace(found, output="pressure_offset")
    yield "weights", replace(found, weights=(F(11, 10),))
    yield "no weight", replace(found, weights=())
    yield "wider slip", replace(found, loop=replace(loop, slip=(loop.slip[0], loop.slip[1] * 2)))
    yield "wider beta", replace(found, loop=replace(loop, beta=(loop.beta[0] / 2, loop.beta[1])))
    yield "gains", replace(found, loop=replace(loop, gains=(loop.gains[0] / 2, *loop.gains[1:])))


def test_every_part_of_a_statement_matters(amplitude, limited):
    for found in (amplitude["slip_rate_error"], limited):
        for name, mutant in mutants(found):
            with pytest.raises(CertificateError):
                raise AssertionError(f"{name}: {mutant.check()}")


def test_a_rate_needs_a_force_and_a_start_inside(limited):
    with pytest.raises(CertificateError, match="a bound of the force"):
        replace(limited, inputs={"force_rate": F(1)}).check()
    own = limited.ellipsoids[0]
    assert 0 < limited.start_level(0) <= 1
    outside = tuple(v / limited.start_level(0) * F(101, 100) for v in own.shape)
    with pytest.raises(CertificateError, match="start is outside"):
        replace(limited, ellipsoids=(replace(own, shape=outside),)).check()


def test_two_ellipsoids_may_support_each_other():
    # V1 bounded through V2 and the input, V2 through the input alone; the statement is the small-gain one
    found = find_peak_bound(LOOP, {"force": F(1)}, "slip_error")
    own = found.ellipsoids[0]
    first = replace(own, shares=own.shares, borrowed=(F(0), F(0)))
    both = replace(found, ellipsoids=(first, first), weights=(F(1, 2), F(1, 2)))
    assert both.check() is Verdict.PROVED
    lending = replace(own, shares=own.shares, borrowed=(F(0), own.decay / 100))
    with pytest.raises(CertificateError, match="add to more"):
        replace(both, ellipsoids=(lending, first)).check()


def test_an_unstable_vertex_has_no_bound():
    weak = replace(LOOP, gains=tuple(g / 100 for g in LOOP.gains))
    assert find_peak_bound(weak, {"force": F(1)}, "slip_error") is None


def test_the_tightest_bound_of_a_known_ellipse():
    # x²/4 + y²/9 ≤ 1: largest x is 2, largest x + y is √13
    rows = ((F(1, 4), F(0)), (F(0), F(1, 9)))
    assert 2 < tightest_bound(rows, (F(1), F(0))) < F(2) + F(1, 10**5)
    root = tightest_bound(rows, (F(1), F(1)))
    assert F(0) < root**2 - 13 < F(1, 10**4)


def test_a_statement_is_a_value(limited):
    assert isinstance(limited.ellipsoids[0], Ellipsoid)
    assert isinstance(limited, PeakBound)
    assert replace(limited) == limited
    assert limited.states[-1] == "force"
    assert limited.free == ("force_rate",)
