"""The loop in continuous time against the law itself and against the limit of the held one."""

from fractions import Fraction as F

import numpy as np
import pytest
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.laws import NominalModel, Signals, summed_integrals
from quakedesign.laws.elqr import ExtendedLQR
from quakedesign.loop import ContinuousLaw, continuous_loop, exact_integrals, sampled_error_loop

GAINS = tuple(map(F, ("2e9", "5e8", "3e9", "1e9")))
MODEL = NominalModel(slip=F("0.45"), rate=F("1.6"), gain=F("2.3e-8"))
AUTHORITY = F("1.9e-8")


def test_the_flow_is_that_of_the_e_lqr():
    """e2′ = s·e1 − w·e2 + βb·p with the package's own expression of p."""
    e1, e2, xi1, xi2 = states = sp.symbols("e1 e2 xi1 xi2")
    law = ExtendedLQR(gains=dict(zip(("k1", "k2", "k3", "k4"), GAINS, strict=True)))
    signals = Signals(slip=e1, slip_rate=e2, slip_error=e1, slip_rate_error=e2, integrals=(xi1, xi2))
    pressure = law.pressure(signals)
    rates = [e2, F("0.45") * e1 - F("1.6") * e2 + F("2.3e-8") * pressure, *law.integral_rates(signals)]
    loop = continuous_loop(exact_integrals(GAINS), MODEL, AUTHORITY)
    for row, rate in zip(loop.flow, rates, strict=True):
        assert [sp.Rational(v) for v in row] == [sp.nsimplify(sp.expand(rate).coeff(x), rational=True) for x in states]
    push = sp.expand(sp.Rational(AUTHORITY) * pressure)
    assert [sp.Rational(v) for v in loop.outputs["push"]] == [push.coeff(x) for x in states]


def test_a_drift_of_the_pressure_at_rest_enters_where_the_integrals_carry_it():
    """With p* = t the states less ξ(p*) = (0, −p*/k4) leave e at rest only through their own rate."""
    loop = continuous_loop(exact_integrals(GAINS), MODEL, AUTHORITY)
    assert loop.inputs["drift"] == (0, 0, 0, 1 / (AUTHORITY * GAINS[3]))
    assert loop.inputs["acceleration"] == (0, 1, 0, 0)
    assert loop.inputs.keys() == {"acceleration", "drift"}
    assert (loop.outputs["slip_error"], loop.outputs["slip_rate_error"]) == ((1, 0, 0, 0), (0, 1, 0, 0))
    assert loop.segments == ()


def test_a_law_that_uses_the_reference_follows_it_with_its_states():
    """z* = ζ(p* − f) − ηf′ asks for p* with f fed forward, and moves by nothing but p*′, r″ and r‴."""
    t, zero = sp.Symbol("t"), sp.zeros(2, 1)
    law = exact_integrals(GAINS, of_state=True)
    loop = continuous_loop(law, MODEL, AUTHORITY)
    k1, k2, k3, k4 = map(sp.Rational, GAINS)
    r, rest = 1 + 4 * t + 5 * t**2 / 2 + 7 * t**3, 2 + 3 * t
    fed = -k1 * r - k2 * r.diff(t)
    steady = sp.Matrix([fed.diff(t) / k4, -(rest - fed) / k4 - k3 * fed.diff(t) / k4**2])
    assert sp.simplify(-k3 * steady[0] - k4 * steady[1] + fed - rest) == 0
    drift, bent, jerk = (
        sp.Matrix([sp.Rational(v) for v in loop.inputs[name][2:]])
        for name in ("drift", "reference_acceleration", "reference_jerk")
    )
    left = sp.Matrix(law.rates) * steady - steady.diff(t)
    inputs = drift * sp.Rational(AUTHORITY) * rest.diff(t) + bent * r.diff(t, 2) + jerk * r.diff(t, 3)
    assert sp.simplify(left - inputs) == zero
    assert loop.flow == continuous_loop(exact_integrals(GAINS), MODEL, AUTHORITY).flow


def test_the_held_loop_tends_to_it():
    """Poles of the map of a short period, (λ − 1)/T_s, against those of the flow."""
    step = F(1, 10**5)
    held = sampled_error_loop(summed_integrals(GAINS, step), MODEL, AUTHORITY, step)
    (segment,) = held.segments
    flow, jump = np.array(held.flow, dtype=float) * float(step), np.array(segment.jump, dtype=float)
    period = (np.eye(5) + flow + flow @ flow / 2) @ jump
    slow = sorted(np.linalg.eigvals(period), key=abs)[1:]
    poles = np.linalg.eigvals(np.array(continuous_loop(exact_integrals(GAINS), MODEL, AUTHORITY).flow, dtype=float))
    found = np.array([np.log(complex(v)) / float(step) for v in slow])
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(poles), rel=1e-3)


def test_a_law_without_an_integral_is_refused():
    law = ContinuousLaw(states=(), rates=(), measured=(), output=(), feedback=(F(-1), F(-1)))
    with pytest.raises(ParameterError, match="zero errors and a constant pressure"):
        continuous_loop(law, MODEL, AUTHORITY)


def test_sizes_that_do_not_fit_and_missing_gains_are_refused():
    with pytest.raises(ParameterError, match="four"):
        exact_integrals(GAINS[:3])
    with pytest.raises(ParameterError, match="matrix G of a linear law with 1 states must be 1 × 2"):
        ContinuousLaw(states=("a",), rates=((F(0),),), measured=((F(0),),), output=(F(1),), feedback=(F(0), F(0)))


def test_integrals_that_are_not_used_are_left_out():
    one, zero = F(1), F(0)
    single = ContinuousLaw(
        states=("xi1",), rates=((zero,),), measured=((one, zero),), output=(F(-4),), feedback=(F(-2), F(-3))
    )
    assert exact_integrals((F(2), F(3), F(4), zero)) == single
    assert single.of_reference == (0, 0)
    none = exact_integrals((F(2), F(3), zero, zero), of_state=True)
    assert (none.states, none.rates, none.measured, none.output) == ((), (), (), ())
    assert none.of_reference == none.feedback == (-2, -3)
    assert exact_integrals((F(2), F(3), zero, F(5))).output == (0, -5)
