"""The laboratory experiment in its own apparatus: the preset, its numbers, and what explains that it worked."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
import sympy as sp
from laboratory import (  # beside the package
    Apparatus,
    LaboratoryFinding,
    as_proved,
    conditions,
    explain,
    guaranteed_in,
    guarantees,
    numbers,
)
from scipy.integrate import solve_ivp
from thinned import few

from quakedesign.fault import load_fault
from quakedesign.fault.model import rest_slip
from quakedesign.laws import published
from quakedesign.simulation.campaign import Campaign
from quakedesign.simulation.campaign.problem import SampleResult

PRINTED, KNOWN = Apparatus.printed(), Apparatus.known()
TABLE, BOTH = load_fault("lab-fault"), load_fault("lab-apparatus")


def test_both_interfaces_move_as_one_with_the_spring_of_the_footnote():
    assert BOTH.stiffness == pytest.approx(45.1e3, rel=1e-12)
    assert BOTH.area == pytest.approx(2 * 0.01, rel=1e-12)
    for name in ("specific_stiffness", "specific_damping", "authority"):
        assert getattr(BOTH, name) == pytest.approx(getattr(TABLE, name), rel=1e-12)


def test_the_printed_slip_of_7_mm_needs_the_printed_area_at_each_interface():
    """With 100 cm² for both, k = 45.1 N/mm leaves a rest at 2.2 mm; the whole drop over k is the 7.5 mm of the text."""
    law, load, spring = BOTH.friction, 0.1e6 * 0.01, 45.1e3
    assert rest_slip(law, 2 * load, spring) == pytest.approx(7.1e-3, abs=0.05e-3)
    once = rest_slip(law, load, spring)
    assert once == pytest.approx(2.2e-3, abs=0.05e-3)
    assert 0.17 * load * (1 - math.exp(-once / 2.5e-3)) == pytest.approx(spring * once, rel=1e-9)
    assert 0.17 * 2 * load / spring == pytest.approx(7.5e-3, abs=0.05e-3)


def test_every_number_says_how_it_is_known_and_lies_in_its_range():
    assert list(numbers()) == [field.name for field in fields(Apparatus)]
    for name, one in numbers().items():
        low, high = one["range"]
        assert low <= one["value"] <= high, name
        assert one["how"] in ("printed", "read", "assumed"), name
        assert one["unit"], name
        assert one["why"].endswith("."), name
    for name, one in conditions().items():
        for number, known in numbers().items():
            assert known["range"][0] <= getattr(one, number) <= known["range"][1], (name, number)


def test_roughness_is_as_large_as_told_and_another_seed_is_another_pair_of_surfaces():
    slip = sp.Symbol("slip", real=True)
    size = KNOWN.roughness * KNOWN.fault().authority * 0.1e6
    one, other = (sp.lambdify(slip, KNOWN.load(seed).perturbation)(np.linspace(0, 0.0075, 20001)) for seed in (0, 1))
    for waves in (one, other):
        assert 0.6 * size < np.max(np.abs(waves)) <= size
        assert abs(np.mean(waves)) < 0.1 * size
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.2
    assert PRINTED.load(0).perturbation is None


def test_a_deficit_is_a_stress_on_both_interfaces():
    """At the verge less 1 kPa times 200 cm², over 2.77 kg times the mass's factor."""
    fault = replace(KNOWN, deficit=1e3, mass=2.0).fault()
    assert fault.disturbance.constant == pytest.approx(-1e3 * 0.02 / (2 * 2.77), rel=1e-12)
    assert fault.mass == pytest.approx(2 * 2.77, rel=1e-12)


def natural(damping, critical_slip):
    """Slip [m] and time of its middle four fifths [s] by SciPy, from 1 nm on; per interface, m = 1.385 kg."""

    def rates(_, x):
        drop = 0.17 * (1 - math.exp(-max(x[0], 0.0) / critical_slip))
        return x[1], (1e3 * drop - 22550 * x[0] - damping * x[1]) / 1.385

    run = solve_ivp(rates, (0, 8), (1e-9, 0), method="LSODA", rtol=1e-9, atol=1e-13, max_step=0.01)
    end = run.y[0, -1]
    at = [np.interp(share * end, run.y[0][: np.argmax(run.y[0])], run.t[: np.argmax(run.y[0])]) for share in (0.1, 0.9)]
    return end, at[1] - at[0]


@pytest.mark.slow
@few(
    ("changed", "slip", "time"),
    [
        ({}, 7.1e-3, (50e-3, 80e-3)),  # printed: 50 ms, around 80 ms
        ({"damping": 10.0}, 7.1e-3, (0.5, 0.8)),
        ({"critical_slip": 5e-3}, 4.4e-3, (0.15, 0.2)),
    ],
    every=3,
)
def test_the_natural_earthquake_takes_the_printed_time_with_the_printed_numbers_alone(changed, slip, time):
    one = replace(PRINTED, **changed)
    found = one.response()
    assert found == pytest.approx(natural(408 * one.damping, one.critical_slip), rel=0.01)
    assert found[0] == pytest.approx(slip, abs=0.05e-3)
    assert time[0] < found[1] < time[1]
    assert replace(PRINTED, critical_slip=8e-3).response() == (0, 0)


@pytest.mark.slow
def test_what_is_printed_ends_in_an_earthquake_within_seconds():
    problem = PRINTED.problem(published("lab-fault")["cta"], 0, duration=4.0)
    run = problem.trajectory(problem.sample(1), 200)
    assert run.outcome.kind == "earthquake"
    assert run.outcome.share_of_natural > 1


def test_a_finding_is_least_median_and_largest_of_the_specimens():
    problem = PRINTED.problem(published("lab-fault")["dia"], 0)
    peak = problem.criterion.natural_peak
    shares = (0.5, 0.001, 0.05, 0.002)
    figures = [
        {"max_slip_error": 1e-5 * n, "peak_slip_rate": share * peak, "rms_pressure": 1e3 * n}
        for n, share in enumerate(shares, start=1)
    ]
    results = [SampleResult(figures=one, events={}) for one in figures]
    found = LaboratoryFinding.of("any", "dia", Campaign(problem=problem, results=tuple(results)))
    assert found.outcomes == {"tracked": 2, "slow slip": 1, "earthquake": 1, "diverged": 0, "opened": 0}
    assert found.harmless == 3
    assert found.slip_error == pytest.approx((1e-5, 2e-5, 4e-5))
    assert found.peak_slip_rate == pytest.approx((0.001 * peak, 0.002 * peak, 0.5 * peak))
    assert found.rms_pressure == pytest.approx((1e3, 2e3, 4e3))
    broken = Campaign(problem=problem, results=(*results[1:], SampleResult(figures={}, events={"diverged": 3.0})))
    assert LaboratoryFinding.of("any", "dia", broken).slip_error == pytest.approx((2e-5, 3e-5, math.inf))


@pytest.mark.slow  # some minutes of simulated loops
def test_stick_and_a_quick_differentiator_explain_it_together_and_not_alone():
    for printed in explain({"printed": PRINTED}, specimens=4, duration=60.0, laws=["cta", "dia"]):
        assert printed.outcomes["earthquake"] == 4
        assert printed.slip_error[1] == pytest.approx(0.011, rel=0.1)
    stick = replace(PRINTED, stick=1)
    quick = replace(stick, bound=KNOWN.bound)
    chosen = {"stick": stick, "both": quick, "quick": replace(quick, stick=0)}
    found: dict[tuple[str, str], LaboratoryFinding] = {}
    for one in explain(chosen, specimens=4, duration=600.0):
        found[one.condition, one.law] = one
    assert {f.harmless for (name, _), f in found.items() if name == "both"} == {4}
    assert {f.harmless for (name, _), f in found.items() if name == "stick"} == {0}
    assert found["quick", "elqr"].harmless == 0


@pytest.mark.slow  # five designs with proof, and a loop of some minutes
def test_the_guaranteed_law_slips_as_slowly_as_proved_where_it_is_proved():
    """The proof is about a plant that does not stick: this is seen, not proved."""
    found = guarantees()
    longest = found["2 ms late, lag 1 ms, readings off by 500 nm, rate"]
    assert longest.proved
    assert longest.proof.claims.peak_slip_rate < 6e-3
    proof = found["1 ms late, lag 1 ms, readings off by 500 nm, amplitude"].proof
    inside = as_proved(KNOWN, proof)
    assert (inside.delay, inside.jitter, inside.lag) == (1, 0, 1e-3)
    run = guaranteed_in(inside, proof, specimens=4, duration=300.0)
    assert run.harmless == 4
    assert run.slip_error[2] <= proof.claims.slip_error
    assert run.peak_slip_rate[2] <= proof.claims.peak_slip_rate
    for delay in (1, 2):  # without a lag, 2 ms late with a law that settles by itself
        proof = found[f"{delay} ms late, lag 0 ms, readings off by 500 nm, amplitude"].proof
        run = guaranteed_in(as_proved(KNOWN, proof), proof, specimens=4, duration=60.0)
        assert run.harmless == 4
        assert run.slip_error[2] <= proof.claims.slip_error
        assert run.peak_slip_rate[2] <= proof.claims.peak_slip_rate
        assert run.rms_pressure[2] <= proof.claims.largest_pressure
