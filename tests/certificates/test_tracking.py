"""What a task puts into the error loop, against the polynomial of the reference in closed form."""

from dataclasses import replace
from fractions import Fraction as F
from math import sqrt

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.certificates import Certificate, Loop
from quakedesign.certificates.linear_premises import effective_stress, linear_premises, sectors
from quakedesign.certificates.premise import Premise
from quakedesign.certificates.response import InputResponse, OutputBound, Response
from quakedesign.certificates.tracking import (
    disturbance_inputs,
    fed_forward,
    needed_inputs,
    peaks_covered,
    reference_rates,
    tracking_inputs,
)
from quakedesign.controllers import published
from quakedesign.errors import CertificateError
from quakedesign.fault import Disturbance
from quakedesign.fault.friction import friction_law
from quakedesign.symbolic.terms import Term

REAL = qd.load_fault("real-fault")
LAW = published("real-fault")["elqr"]
TARGET, DURATION = 0.785, 663012.0
RATES = (15 / 8 * TARGET / DURATION, 10 / sqrt(3) * TARGET / DURATION**2, 60 * TARGET / DURATION**3)
"""Largest derivatives of d(10 s^3 - 15 s^4 + 6 s^5): at s = 1/2, 1/2 - sqrt(3)/6 and 0."""


def covers(bound, exact):
    return exact * (1 - 1e-12) <= float(bound) <= 1.011 * exact


def test_the_derivatives_of_the_reference():
    found = reference_rates(REAL)
    assert covers(found.first, RATES[0])
    assert covers(found.second, RATES[1])
    assert covers(found.third, RATES[2])


def test_what_the_law_feeds_forward_is_that_of_its_gains():
    state, error = (replace(LAW, feedback=kind) for kind in ("state", "error"))
    assert fed_forward(state) == (LAW.gains["k1"], LAW.gains["k2"])
    assert fed_forward(error) == (0, 0)


def test_the_inputs_of_a_moving_reference_by_hand():
    """Force |r''| + 2|r'|, drift 3|r'|/(beta_min b) with slopes in [-3, 1], rates in [-2, 1]; b as in the sectors."""
    needed = replace(sectors(REAL), slip=(F(-3), F(1)), rate=(F(-2), F(1)), beta=(F(1, 2), F(4)), authority=F(1, 8))
    found = tracking_inputs(REAL, LAW, needed)
    assert covers(found["force"], RATES[1] + 2 * RATES[0])
    assert covers(found["drift"], 3 * RATES[0] * 2 * 8)
    assert covers(found["drift_rate"], 1.88e9 * RATES[1] + 5.79e8 * RATES[2])
    assert set(tracking_inputs(REAL, replace(LAW, feedback="error"), needed)) == {"force", "drift"}


def test_in_a_quick_task_the_third_derivative_counts_too():
    quick = replace(REAL, reference=replace(REAL.reference, operation_time=1.0), sampling_time=1e-3)
    found = tracking_inputs(quick, LAW, sectors(REAL))
    assert covers(found["drift_rate"], TARGET * (1.88e9 * 10 / sqrt(3) + 5.79e8 * 60))


def test_the_drift_is_that_of_the_worst_friction_but_for_a_tenth():
    # friction falls as steeply as the box allows and ends where r' is largest; p* by hand from the balance at rest
    law, N, sigma, task = REAL.friction, REAL.authority, REAL.effective_normal_stress, REAL.reference
    s = np.linspace(0, 1, 200001)
    r = task.target_slip * s**3 * (10 - 15 * s + 6 * s**2)
    begin = task.target_slip / 2 - law.critical_slip
    assert begin > 0
    mu = law.residual + law.drop * np.clip(1 - (r - begin) / law.critical_slip, 0, 1)
    spring = REAL.specific_stiffness - REAL.disturbance.slip_growth
    rest = ((mu - mu[0]) * N * sigma + spring * r) / (mu * N)
    worst = np.abs(np.gradient(rest, s * task.operation_time)).max()
    bound = float(tracking_inputs(REAL, published("real-fault")["elqr"], sectors(REAL))["drift"])
    assert 0.9 * bound < worst <= bound


def disturbed(**parts):
    return REAL.with_disturbance(Disturbance(**parts))


def test_the_inputs_of_a_disturbance_by_hand():
    sine = disturbed(amplitude=0.5, frequency=4.0)
    assert disturbance_inputs(sine, True) == {"force": F(1, 2), "force_rate": F(2)}
    assert disturbance_inputs(sine, False) == {"force": F(1, 2)}
    assert disturbance_inputs(disturbed(constant=0.25), True) == {"force": F(1, 4)}
    assert disturbance_inputs(disturbed(), True) == {}


def test_every_cause_is_an_input_of_its_own():
    error = replace(LAW, feedback="error")
    found = needed_inputs(disturbed(amplitude=0.5, frequency=4.0), error, sectors(REAL), True)
    assert list(found) == ["disturbance", "reference_force", "reference_drift"]
    assert found["disturbance"] == (F(1, 2), F(2))
    assert len(found["reference_force"]) == len(found["reference_drift"]) == 1
    assert "disturbance" not in needed_inputs(disturbed(), error, sectors(REAL), True)


ENTERING = {
    "disturbance": "e2",
    "reference_force": "e2",
    "reference_drift": "zeta",
    "reference_drift_rate": "chi",
}


def certificate(feedback, rate_limited=True, *, share=F(1), places=None, output="e2"):
    """Claims, without a proof, whose inputs are a share of those that the real fault needs."""
    needed = needed_inputs(REAL, replace(LAW, feedback=feedback), sectors(REAL), rate_limited)
    field = {"e1": (), "e2": (), "zeta": (), "chi": ()}
    for name in needed:
        state = (places or ENTERING)[name]
        field[state] = (*field[state], Term(F(1), (name,), ()))
    loop = Loop(
        law="elqr",
        gains=dict(LAW.gains),
        constants={"b": sectors(REAL).authority},
        states=dict.fromkeys(field, 1),
        domain="reals",
        uncertain={},
        field=field,
        inputs={name: tuple(share * limit for limit in limits) for name, limits in needed.items()},
    )
    row = (Term(F(1), (), ((output, F(1), "s"),)),)
    part = InputResponse(sets=(), bounds={"y": OutputBound(bound=F(1, 10**6), weights=())})
    response = Response(outputs={"y": row}, parts=dict.fromkeys(needed, part))
    return Certificate(loop=loop, response=response)


@pytest.mark.parametrize(("feedback", "said"), [("error", "of the error"), ("state", "of the error or state")])
@pytest.mark.parametrize("rate_limited", [True, False])
def test_a_certificate_covers_what_its_inputs_hold(feedback, said, rate_limited):
    assert peaks_covered(certificate(feedback, rate_limited), REAL)[0].endswith(f"feedback {said}")


def test_the_slip_rate_is_that_of_the_reference_and_all_errors():
    """Three inputs of a micrometre a second each."""
    said = peaks_covered(certificate("error"), REAL)[1]
    assert covers(float(said.split()[5]), 3e-6 + RATES[0])
    assert len(peaks_covered(certificate("error", output="e1"), REAL)) == 1


def test_smaller_inputs_and_other_places_are_refused():
    assert peaks_covered(certificate("error", share=F(2)), REAL)
    with pytest.raises(CertificateError, match="smaller"):
        peaks_covered(certificate("error", share=F(999, 1000)), REAL)
    with pytest.raises(CertificateError, match="act elsewhere"):
        peaks_covered(certificate("error", places=ENTERING | {"disturbance": "e1"}), REAL)
    with pytest.raises(CertificateError, match="bounds no outputs"):
        peaks_covered(replace(certificate("error"), response=None), REAL)


def test_an_input_that_also_acts_elsewhere_is_refused():
    one = certificate("error")
    field = one.loop.field | {"e1": (Term(F(1), ("disturbance",), ()),)}
    with pytest.raises(CertificateError, match="act elsewhere"):
        peaks_covered(replace(one, loop=replace(one.loop, field=field)), REAL)


# ---------------------------------------------------------------- premises of the linear feedback


def linear(**ranges):
    """Certificate, without a proof, for the published gains over given sectors."""
    needed = sectors(REAL)
    loop = Loop(
        law="elqr",
        gains=dict(LAW.gains),
        constants={"b": needed.authority},
        states={"e1": 1},
        domain="reals",
        uncertain=needed.ranges() | ranges,
        field={"e1": ()},
    )
    return Certificate(loop=loop)


def holding(**ranges):
    return {p.name: p.holds for p in linear_premises(REAL, LAW, linear(**ranges))}


def test_exactly_the_needed_sectors_are_enough():
    found = holding()
    assert found["control_coefficient"]
    assert found["friction_slope"]
    assert not found["constant_reference"]
    assert not found["vanishing_disturbance"]


@pytest.mark.parametrize("name", ["s", "w", "beta"])
@pytest.mark.parametrize("end", [0, 1])
def test_a_sector_that_is_smaller_at_one_end_is_not(name, end):
    low, high = sectors(REAL).ranges()[name]
    middle = (low + high) / 2 if low < high else low + (F(1, 100) if end == 0 else F(-1, 100))
    smaller = (middle, max(high, middle)) if end == 0 else (min(low, middle), middle)
    premise = "control_coefficient" if name == "beta" else "friction_slope"
    assert not holding(**{name: smaller})[premise]
    wider = {"s": (F(-100), F(100)), "w": (F(-100), F(100)), "beta": (F(1, 100), F(100))}
    assert holding(**wider)[premise]


def test_a_certificate_about_something_else_is_refused():
    one = linear()
    for changes in (
        {"law": "other"},
        {"gains": dict(LAW.gains) | {"k1": F(1)}},
        {"constants": {"b": F(1)}},
        {"constants": {}},
    ):
        with pytest.raises(CertificateError, match="other gains, or another fault"):
            linear_premises(REAL, LAW, replace(one, loop=replace(one.loop, **changes)))
    assert not any(p.holds for p in linear_premises(REAL, LAW, None))


def test_the_reference_asks_for_its_peak_rate():
    found = {p.name: p for p in linear_premises(REAL, LAW, linear())}
    assert found["constant_reference"].required == pytest.approx(RATES[0], rel=1e-12)
    assert found["constant_reference"].certified == found["vanishing_disturbance"].certified == 0
    assert found["vanishing_disturbance"].required == pytest.approx(3.2e-4)


# ---------------------------------------------------------------- sectors


def test_sectors_by_hand_with_a_growing_disturbance_and_every_width():
    """k = 0.48, eta = 1.6 and N = 8e-8, each a tenth up and down; chord N' stress slope, slope 0.1/0.27635."""
    fault = disturbed(slip_growth=0.125, rate_growth=0.25).with_box("ten-percent")
    found = sectors(fault)
    chord = 1.1 * 8e-8 * float(found.largest_effective_stress) * 0.1 / 0.27635
    assert float(found.slip[0]) == pytest.approx(-0.48 * 1.1 + 0.125, rel=1e-12)
    assert float(found.slip[1]) == pytest.approx(chord - 0.48 * 0.9 + 0.125, rel=1e-9)
    assert found.rate == (F(8, 5) * F(9, 10) - F(1, 4), F(8, 5) * F(11, 10) - F(1, 4))
    assert found.authority == F("0.2353") * 8 * F(9, 10) / 10**8
    rows = [max(abs(float(s) + 0.48) for s in found.slip), max(abs(float(w) - 1.6) for w in found.rate)]
    assert [float(bound * found.authority) for bound in found.row_bounds] == pytest.approx(rows, rel=1e-9)
    assert found.ranges() == {"beta": found.beta, "s": found.slip, "w": found.rate}


def test_a_normal_stress_that_turns_leaves_both_signs_of_the_chord():
    """At rest at r the fault bears (mu* N stress - k r)/(mu N), which is negative beyond 2.79 m."""
    near, far = (replace(REAL, reference=replace(REAL.reference, target_slip=slip)) for slip in (2.7, 5.0))
    assert float(sectors(near).slip[0]) == pytest.approx(-0.48 + 3.2e-6, rel=1e-9)
    found = sectors(far)
    chord = 8e-8 * float(found.largest_effective_stress) * 0.1 / 0.27635
    assert float(found.slip[0]) == pytest.approx(-chord - 0.48 + 3.2e-6, rel=1e-9)
    assert float(found.slip[1]) == pytest.approx(chord - 0.48 + 3.2e-6, rel=1e-9)


def test_the_stress_at_rest_by_hand():
    """Anything that weakens at most by slope * r from mu* and not below mu_res bears at most the value at the least."""
    stress, positive = effective_stress(REAL)
    slip = np.linspace(0, TARGET, 20001)
    least = np.maximum(0.2353, 0.3353 - 0.1 / 0.27635 * slip)
    exact = np.abs((0.3353 * 4.0 - (0.48 - 3.2e-6) * slip) / (least * 8e-8)).max()
    assert positive
    assert exact * (1 - 1e-9) <= float(stress) <= 1.011 * exact


def test_the_smallest_bound_of_the_slip_rate_counts():
    one = certificate("error")
    part = InputResponse(
        sets=(),
        bounds={name: OutputBound(bound=F(bound, 10**6), weights=()) for name, bound in (("y", 5), ("z", 1))},
    )
    row = one.response.outputs["y"]
    both = Response(outputs={"y": row, "z": row}, parts=dict.fromkeys(one.response.parts, part))
    assert covers(float(peaks_covered(replace(one, response=both), REAL)[1].split()[5]), 3e-6 + RATES[0])


def test_friction_that_weakens_with_the_rate_widens_the_damping_at_both_ends():
    law = friction_law("slip-rate-weakening")(residual=0.2, drop=0.1, critical_rate=0.5)
    found = sectors(replace(REAL, friction=law))
    chord = 8e-8 * float(found.largest_effective_stress) * float(law.rate_slope)
    assert chord > 0
    assert [float(end) for end in found.rate] == pytest.approx([1.6 - chord, 1.6 + chord], rel=1e-9)


@pytest.mark.parametrize("which", [0, 1])
def test_both_limits_of_a_disturbance_are_needed(which):
    one = certificate("error")
    limits = [F(9, 10) * v if i == which else v for i, v in enumerate(one.loop.inputs["disturbance"])]
    assert len(limits) == 2
    smaller = replace(one.loop, inputs=one.loop.inputs | {"disturbance": tuple(limits)})
    with pytest.raises(CertificateError, match="smaller"):
        peaks_covered(replace(one, loop=smaller), REAL)


def test_a_premise_holds_up_to_its_bound():
    def premise(required, certified, **more):
        return Premise(name="x", required=required, certified=certified, unit="-", **more)

    assert premise(1.0, 1.0).holds
    assert premise(1.0, 1.5).holds
    assert not premise(1.001, 1.0).holds
    assert not premise(1.6, 1.0).holds
    assert not premise(0.5, 1.0, proved=False).holds
    assert not premise(0.5, 1.0).measured
    assert premise(1.0, 4.0).ratio == 0.25
    assert premise(0.0, 1.0).ratio == 0
