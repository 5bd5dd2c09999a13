"""The implicit step against the inclusion solved with mpmath at 50 digits, law by law typed in by hand."""

from fractions import Fraction as F

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from thinned import few

from quakedesign.errors import ParameterError
from quakedesign.laws import control_law
from quakedesign.loop import discrete_law
from quakedesign.loop.discrete_law import DiscreteLaw
from quakedesign.loop.schemes.implicit import backward_euler, direction, end_rate, end_slip, inclusion
from quakedesign.symbolic import SignedPower

STEP = 0.184
GAINS = {"cta": ("7", "5", "2.3", "1.1"), "dia": ("2", "5", "1.44", "0"), "dia with kI4": ("2", "5", "1.44", "0.3")}
SCALES = ("1/4000", "500")


def signed(x, a):
    return mp.sign(x) * abs(x) ** a


def jump_terms(name, gains, scale):
    """Smooth part ν0(e1⁺, e2⁺), and the arguments of the signs in ξ' with their weights."""
    k1, k2, k3, k4 = map(mp.mpf, gains)
    lam = mp.mpf(scale.numerator) / scale.denominator
    root = mp.sqrt(lam)

    def twisting(a, b):
        return -(lam ** (mp.mpf(2) / 3)) * k1 * signed(a, mp.mpf(1) / 3) - root * k2 * signed(b, mp.mpf(1) / 2)

    def integral(a, b):
        return -root * k2 * signed(signed(b, mp.mpf(3) / 2) + root * k1 ** mp.mpf("1.5") * a, mp.mpf(1) / 3)

    if name == "cta":
        return twisting, [(lambda a, b: a, lam * k3), (lambda a, b: b, lam * k4)]
    return integral, [(lambda a, b: a + k4 / root * signed(b, mp.mpf(3) / 2), lam * k3)]


def bisect(f, low, high):
    for _ in range(170):
        middle = (low + high) / 2
        low, high = (low, middle) if f(middle) > 0 else (middle, high)
    return (low + high) / 2


def oracle(name, gains, scale, e1, e2, xi):
    """ν and ξ⁺: F rises, so that bisection finds the point where it changes sign, be it a zero or a jump."""
    with mp.workdps(50):
        e1, e2, xi, step = map(mp.mpf, (e1, e2, xi, STEP))
        smooth, jumps = jump_terms(name, gains, scale)

        def excess(w):
            a = e1 + step * w
            rate = -sum(size * mp.sign(argument(a, w)) for argument, size in jumps)
            return w - e2 - step * (smooth(a, w) + xi + step * rate)

        bound = 1 + abs(e2) + abs(excess(mp.mpf(0))) + abs(e1) / step
        w = bisect(excess, -bound, bound)
        nu = (w - e2) / step
        # the exact point of a jump, where rounding in the 50th digit would be magnified by the cube root
        for argument, _ in jumps:
            at = bisect(lambda v, f=argument: f(e1 + step * v, v), -bound, bound)
            w = at if abs(at - w) < mp.mpf(10) ** -40 * bound else w
        a = mp.mpf(0) if abs(e1 + step * w) < mp.mpf(10) ** -35 * bound else e1 + step * w
        b = mp.mpf(0) if abs(w) < mp.mpf(10) ** -35 * bound else w
        return float(nu), float(nu - smooth(a, b))


def step_function(name, scale):
    """ν and ξ⁺ of the package as a CasADi Function of e1, e2, ξ."""
    law = DiscreteLaw.of(control_law(name.split()[0]).from_values(GAINS[name], scale=scale), 0.0)
    pull, feed_forward, end = backward_euler(law)
    assert feed_forward == 0
    e1, e2, xi = ca.SX.sym("e1"), ca.SX.sym("e2"), ca.SX.sym("xi")
    known = {discrete_law.slip_error: e1, discrete_law.rate_error: e2, law.integrals[0]: xi}
    known |= {discrete_law.step: ca.SX(STEP), discrete_law.authority: ca.SX(1)}
    problem = inclusion(pull)
    solved = problem.solve(known)
    after = discrete_law.values((problem.selected(end),), solved)[0]
    return ca.Function("step", [e1, e2, xi], [(solved[end_rate] - e2) / STEP, after])


def states(scale, count=16):
    """Errors over many magnitudes, from far away to deep in the discretised sliding mode, and the exact zeros."""
    rng = np.random.default_rng(3)
    size = float(scale) * 10 ** rng.uniform(-6, 1, (count, 3))
    points = rng.choice([-1, 1], (count, 3)) * size
    points[0] = 0
    points[1, 0] = points[2, 1] = points[3, 2] = 0
    points[4, :2] = 0
    return [tuple(map(float, point)) for point in points]


@few("scale", SCALES, every=2)
@pytest.mark.parametrize("name", GAINS)
def test_pressure_and_integral_are_those_of_the_inclusion(name, scale):
    exact = F(scale)
    step = step_function(name, exact)
    for e1, e2, xi in states(exact):
        nu, after = (float(v) for v in step(e1, e2, xi))
        expected_nu, expected_after = oracle(name, GAINS[name], exact, e1, e2, xi)
        # rounding of the data: e2, T_s·ξ and e1/T_s are what the slip rate at the end is made of
        rounding = 1e-30 + 8 * 2.3e-16 * (abs(e2) + STEP * abs(xi) + abs(e1) / STEP) / STEP
        assert nu == pytest.approx(expected_nu, rel=4e-15, abs=rounding)
        assert after == pytest.approx(expected_after, rel=1e-12, abs=1e-12 * abs(xi) + 1e-12 * float(exact) * STEP)


@pytest.mark.parametrize("name", GAINS)
def test_the_step_is_odd(name):
    step = step_function(name, F(1))
    for e1, e2, xi in states(F(1), 8):
        there, back = step(e1, e2, xi), step(-e1, -e2, -xi)
        assert [float(a) for a in there] == pytest.approx([-float(b) for b in back], rel=1e-13, abs=1e-18)


def test_the_states_reach_every_branch():
    """Sliding on e1⁺ = 0, on e2⁺ = 0 and neither must all occur, else the comparison above shows little."""
    step, found = step_function("cta", F(1)), set()
    for e1, e2, xi in [*states(F(1), 40), (1e-3, -1e-7, -1e-2), (0.5, 1e-4, 3.98)]:
        nu, after = (float(v) for v in step(e1, e2, xi))
        w = e2 + STEP * nu
        selection = (xi - after) / STEP
        corners = [abs(abs(selection) - c) < 1e-9 for c in (3.4, 1.2)]
        found.add("free" if any(corners) else "slip" if abs(e1 + STEP * w) < abs(w) else "rate")
    assert found == {"free", "slip", "rate"}


def calls(function):
    """Names of the functions that are called in a function itself."""
    return [f.name() for f in function.find_functions(0)]


@pytest.mark.parametrize("name", GAINS)
def test_the_smooth_solution_is_computed_only_where_it_is_needed(name):
    step = step_function(name, F(1))
    assert "where_needed" in calls(step)
    assert "solved" not in calls(step)
    assert calls(step.find_function("solved")) == ["fold_rounds"]  # a loop in C
    assert step.find_function("rounds").n_instructions() < 27 * 3 * 5  # rounds, points, and a few operations for each
    called = step.find_function("where_needed")
    known = np.linspace(0.1, 0.9, called.size1_in(1))
    assert float(called(0, known)) == 0
    assert float(called(1, known)) == float(step.find_function("solved")(known)) != 0


@pytest.mark.parametrize("name", GAINS)
def test_a_step_depends_on_nothing_that_its_law_does_not_name(name):
    """The call in which the root is looked for is told what it needs, and nothing else."""
    law = DiscreteLaw.of(control_law(name.split()[0]).from_values(GAINS[name]), 0.0)
    problem, unknown = inclusion(backward_euler(law)[0]), ca.SX.sym("unknown")
    symbols = (discrete_law.slip_error, discrete_law.rate_error, discrete_law.step, discrete_law.authority)
    known = {symbol: ca.SX.sym(symbol.name) for symbol in (*symbols, *law.integrals)}
    solved = problem.solve(known | {discrete_law.acceleration: unknown, discrete_law.next_reference: unknown})
    assert not ca.depends_on(solved[end_rate], unknown)
    assert ca.depends_on(solved[end_rate], known[discrete_law.authority])


def test_direction_knows_odd_powers_and_gives_up_on_the_rest():
    k = sp.Symbol("k", positive=True)
    assert direction(k * end_rate + SignedPower(end_slip, sp.Rational(1, 3))) == 1
    assert direction(-k * SignedPower(SignedPower(end_rate, sp.Rational(3, 2)) + end_slip, 0)) == -1
    assert direction(sp.Max(end_rate, k)) == 1
    assert direction(k) == 0
    assert direction(end_rate - end_slip) is None
    assert direction(end_rate * end_slip) is None
    assert direction(end_rate**2) is None


def test_a_law_that_pushes_is_refused():
    law = DiscreteLaw.of(control_law("cta").from_values(("7", "5", "2.3", "-1.1")), 0.0)
    with pytest.raises(ParameterError, match="never increases"):
        inclusion(backward_euler(law)[0])
