"""Campaigns of faults held in slow sliding: samples are runs of `simulate`, whoever computes them."""

import json
import math
from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from quakedesign import simulate, synthesis
from quakedesign.cli import main
from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.fault import load_fault
from quakedesign.guarantees import SampledLoop
from quakedesign.guarantees.search.lqg import sliding_law, sliding_model
from quakedesign.laws import LinearLaw, SampledController, published, summed_integrals
from quakedesign.loop import Actuator, Lag, simulation_scheme
from quakedesign.loop.sensing import Measurement
from quakedesign.parallel import SerialExecutor, UserExecutor
from quakedesign.simulation import Load, Tide
from quakedesign.simulation.campaign import Campaign, campaign_problem, run_campaign, running
from quakedesign.simulation.campaign.ledger import Ledger
from quakedesign.simulation.state_plant import SlidingVariation

PATCH, STEP, PATH = load_fault("crustal-patch"), Fraction(300), Fraction(800)
LAW = sliding_law(sliding_model(PATCH), STEP, diffusion=PATH)
CONTROLLER = SampledLoop(law=LAW, step=STEP, diffusion=PATH).controller
TOLD = {"duration": 3000.0, "spread": Fraction(1, 10), "stress": 40e3, "stress_period": 9000.0, "seed": 3}
PROBLEM = campaign_problem(PATCH.with_box("ten-percent"), CONTROLLER, **TOLD)


@pytest.fixture(scope="module")
def serial(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sliding")
    return run_campaign(PROBLEM, 6, folder, executor=SerialExecutor(), batch=2), folder


def test_a_sample_is_the_run_of_its_numbers(serial):
    found, _ = serial
    numbers = dict(PROBLEM.sample(4).numbers)
    share, phase = numbers.pop("amplitude"), numbers.pop("phase")
    tide = Tide(amplitude=share * 40e3, period=9000.0, phase=phase)
    run = simulate(PATCH, CONTROLLER, duration=3000.0, tide=tide, variation=SlidingVariation(**numbers))
    assert found.results[4].figures == {k: v for k, v in run.metrics.to_dict().items() if k in found.metrics}
    assert (found.results[4].events, found.outcomes[4], found.metrics) == ({}, run.outcome, PROBLEM.metrics)
    again = found.trajectory(4, samples=5)
    assert (len(again.time), again.slip_rate[-1]) == (6, run.slip_rate[-1])
    assert again.metrics.max_slip_error == run.metrics.max_slip_error


def test_samples_fill_the_box_of_friction_plant_and_stress():
    problem = campaign_problem(PATCH.with_box("ten-percent"), CONTROLLER, **TOLD)
    numbers = [problem.sample(i).numbers for i in range(256)]
    ends = {name: (min(n[name] for n in numbers), max(n[name] for n in numbers)) for name in numbers[0]}
    wide = ("direct_effect", "evolution_effect", "critical_slip", "normal_stress", "stiffness", "damping")
    for name in wide:
        assert ends.pop(name) == pytest.approx((0.9, 1.1), abs=0.005)
    assert ends.pop("amplitude") == pytest.approx((0, 1), abs=0.02)
    assert ends.pop("phase") == pytest.approx((0, 2 * math.pi), abs=0.1)
    assert not ends
    certain = campaign_problem(PATCH, CONTROLLER, duration=3000.0)
    assert certain.sample(1).numbers["critical_slip"] == 1.0


@pytest.mark.slow
def test_processes_have_the_same_digits_and_files_answer(serial, tmp_path):
    found, folder = serial
    other = run_campaign(PROBLEM, 6, tmp_path, workers=1, batch=3)
    assert other.results == found.results
    more = run_campaign(PROBLEM, 7, folder, executor=SerialExecutor())
    assert (more.resumed, more.results[:6]) == (6, found.results)
    assert more.metrics == PROBLEM.metrics


def test_a_batch_over_a_whole_task_is_a_few_samples(tmp_path):
    """At most 10 000 steps of T_s = 300 s, all of which a worker that dies loses; of the shortest runs an eighth."""
    for duration, most in ((1e6, 3), (30000.0, 100), (3000.0, 250)):
        problem = campaign_problem(PATCH, CONTROLLER, duration=duration)
        with UserExecutor(SerialExecutor(), width=1) as crew:
            runner = running._Runner(problem, Ledger(tmp_path, ""), problem.program, crew, None, lambda *_: None)
            assert runner._batch_size(2000) == most


@pytest.mark.slow
def test_the_search_finds_the_largest_share_of_the_stress(tmp_path):
    problem = campaign_problem(PATCH, CONTROLLER, duration=1200.0, stress=40e3, stress_period=9000.0)
    found = run_campaign(problem, 2, tmp_path, executor=SerialExecutor(), metric="max_slip_rate_error", rounds=3)
    assert found.search.sample.numbers["amplitude"] == 1.0
    assert found.search.value > max(found.values("max_slip_rate_error"))


def test_a_law_that_opens_the_fault_or_leaves_all_sizes_is_a_result(tmp_path):
    zero = Fraction(0)
    greedy = LinearLaw(
        states=("a",), update=((zero,),), measured=((zero, zero),), output=(zero,), feedback=(Fraction(10) ** 15, zero)
    )
    problem = campaign_problem(PATCH, SampledLoop(law=greedy, step=STEP).controller, duration=9000.0, stress=40e3)
    found = run_campaign(problem, 2, tmp_path, executor=SerialExecutor())
    by_kind = dict(zip((outcome.kind for outcome in found.outcomes), found.results, strict=True))
    assert set(by_kind) == {"opened", "diverged"}  # by injection, or where withdrawal without end stops the solver
    assert set(by_kind["opened"].events) == {"opening"}
    assert (set(by_kind["diverged"].events), by_kind["diverged"].figures) == ({"diverged"}, {})
    assert found.to_dict()["quantiles"]["peak_slip_rate"]["1"] is None
    run = found.trajectory([outcome.kind for outcome in found.outcomes].index("diverged"), samples=3)
    told = {name: value for name, value in run.metrics.to_dict().items() if value is not None}
    assert set(told) == {"settled_from", "steps", "seconds"}
    assert told["steps"] == round(run.time[-1] / (STEP / 4))


def test_what_a_run_goes_through_is_the_actuators(tmp_path):
    late = simulation_scheme("explicit", actuator=Actuator(stages=(Lag(time_constant=200.0),)))
    problem = campaign_problem(PATCH, CONTROLLER, scheme=late, duration=3000.0, stress=40e3)
    assert (problem.program.path.lag, problem.program.path.diffusion) == (200, 0)
    assert (
        problem.inputs["arithmetic"]
        != campaign_problem(PATCH, CONTROLLER, duration=3000.0, stress=40e3).inputs["arithmetic"]
    )


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"controller": None}, "needs a sampled law that measures the slip alone"),
        ({"controller": published("real-fault")["elqr"]}, "needs a sampled law"),
        ({"load": Load(drift=1e-9)}, "load, initial_slip and initial_slip_rate do not apply"),
        ({"initial_slip": 1e-3}, "load, initial_slip and initial_slip_rate do not apply"),
        ({"initial_slip_rate": 1e-9}, "load, initial_slip and initial_slip_rate do not apply"),
        (
            {"scheme": simulation_scheme("explicit", measurement=Measurement(slip_noise=1e-6))},
            "needs the scheme explicit, .*Received scheme explicit, substeps 1, measurement .*slip_noise=1e-06.*Omit",
        ),
        (
            {"scheme": simulation_scheme("explicit", substeps=3, actuator=Actuator(stages=(Lag(time_constant=9.0),)))},
            r"Received scheme explicit, substeps 3\. Omit scheme",
        ),
        ({"spread": 1}, "a spread must be from 0 to below 1"),
        ({"stress": -1.0}, "stress must be zero or positive"),
        ({"stress_period": 0.0}, "stress_period must be positive"),
        ({"method": "rk4"}, "method must be one of"),
        ({"plant": "stick-slip"}, "one of smooth, quasi-dynamic"),
    ],
)
def test_what_does_not_apply_is_refused(wrong, said):
    with pytest.raises((ParameterError, UnknownNameError), match=said):
        campaign_problem(**({"fault": PATCH, "controller": CONTROLLER, "duration": 3000.0} | wrong))
    for given in ({"stress": 1.0}, {"spread": 0.1}):
        with pytest.raises(ParameterError, match="apply only to friction with a state"):
            campaign_problem(load_fault("real-fault"), None, **given)


def test_a_law_that_is_told_more_than_the_slip_or_has_no_samples_is_refused(monkeypatch):
    told_the_rate = SampledController(law=summed_integrals((Fraction(1),) * 4, STEP), step=STEP)
    said = "needs a sampled law that measures the slip alone"
    with pytest.raises(ParameterError, match=said):
        replace(PROBLEM, controller=told_the_rate)
    monkeypatch.setattr(SampledController, "sampling", None)
    with pytest.raises(ParameterError, match=said):
        replace(PROBLEM, controller=CONTROLLER)


def test_the_command_samples_what_design_found(tmp_path, monkeypatch, capsys):
    asked = {}

    def designed(fault, name, **told):
        asked.update(told, name=name, box=fault.box.name)
        task = SimpleNamespace(stress=Fraction(25000))
        return SimpleNamespace(controller=CONTROLLER, sliding=SimpleNamespace(task=task))

    monkeypatch.setattr(synthesis, "design", designed)
    monkeypatch.setattr(running, "crew_of", lambda *_: UserExecutor(SerialExecutor()))
    monkeypatch.setattr(Campaign, "plot", lambda _: Figure())
    call = [
        "campaign",
        "crustal-patch",
        "--controller",
        "elqr",
        "--samples",
        "2",
        "--duration",
        "3000 s",
        "--spread",
        "0.1",
    ]
    with pytest.raises(SystemExit) as stop:
        main([*call, "--box", "ten-percent", "--diffusion", "800 s", "--out", str(tmp_path / "out"), "--json"])
    said = capsys.readouterr()
    found = json.loads(said.out)
    assert (stop.value.code, found["samples"], found["outcomes"]["tracked"]["count"]) == (0, 2, 2)
    assert asked == {"diffusion": 800.0, "stress": None, "spread": Fraction(1, 10), "name": "elqr", "box": "paper"}
    assert {"direct_effect", "normal_stress", "amplitude"} <= set(found["worst"]["max_slip_error"][0]["sample"])
    manifest = json.loads((tmp_path / "out" / "campaign.json").read_text())
    assert manifest["stress"] == 25e3
    assert manifest["ranges"]["critical_slip"] == [0.9, 1.1]
    assert np.isfinite(found["quantiles"]["peak_slip_rate"]["1"])
