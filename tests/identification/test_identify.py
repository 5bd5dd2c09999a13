"""What is said of records: parameters, ends, outliers, what cannot be told, and the fault that covers all of it."""

import importlib.util
import itertools
import sys
from dataclasses import asdict, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from quakedesign.errors import ParameterError, RecordError
from quakedesign.exact import rational
from quakedesign.fault import Disturbance, friction_law, load_fault
from quakedesign.fault.fault_schema import template
from quakedesign.fault.fault_toml import step_assumed
from quakedesign.identification.fault_file import (
    cover,
    identified_fault,
    law_remarks,
    next_command,
    other_parts,
    save_fault,
    task_remarks,
)
from quakedesign.identification.identification_result import OtherLaw, ParameterEstimate
from quakedesign.identification.identify import identify, set_up
from quakedesign.identification.loading import prepared
from quakedesign.identification.record import Record
from quakedesign.plant import slow_sliding_plant
from quakedesign.report.identification_page import identification_lines

SPECIFICATION = importlib.util.spec_from_file_location("synthetic_records", Path(__file__).with_name("synthetic.py"))
synthetic = importlib.util.module_from_spec(SPECIFICATION)
sys.modules[SPECIFICATION.name] = synthetic
SPECIFICATION.loader.exec_module(synthetic)
DATA = Path(__file__).parent.parent / "data"


@pytest.fixture(scope="module")
def weak():
    """Slip weakening with two outliers."""
    record = synthetic.weakening().noisy(3)
    friction = record.friction.copy()
    friction[[50, 300]] += [0.05, -0.03]
    return identify(replace(record, friction=friction), "exponential-slip-weakening")


def test_outliers_are_named_and_left_out(weak):
    found = [(round(o.time, 6), round(o.size, 2)) for o in weak.outliers]
    times = np.linspace(0, 100, 400)[[50, 300]]
    assert found == [(round(times[0], 6), 0.05), (round(times[1], 6), -0.03)]
    assert weak.fit.noise == pytest.approx(2e-3, rel=0.2)
    assert weak.allows({"residual": 0.4, "drop": 0.17, "critical_slip": 2.5e-3})
    assert not weak.allows({"residual": 0.41, "drop": 0.17, "critical_slip": 2.5e-3})
    with pytest.raises(ParameterError, match="drop"):
        weak.allows({"residual": 0.4, "critical_slip": 2.5e-3})


def test_reprs_are_one_line_with_what_was_found(weak):
    assert repr(weak.record) == "Record('made': 400 samples in 100 s)"
    assert repr(weak).startswith("Identification('made', exponential-slip-weakening: residual 0.4")
    assert repr(weak).count(" to ") == 3
    assert len(repr(weak)) < 250


def test_ends_are_those_of_linear_least_squares_where_the_law_is_linear():
    """With a critical slip that is known, friction is linear in the other two: Fisher's ellipsoid in closed form."""
    found = identify(synthetic.weakening().noisy(1), "exponential-slip-weakening")
    assert found.identified
    assert list(found.estimates) == ["residual", "drop", "critical_slip"]
    fit = found.fit
    slopes = fit.experiment.slopes(fit.fitted)[fit.used]
    covariance = np.linalg.inv(slopes.T @ slopes) * fit.noise**2
    for i, estimate in enumerate(found.estimates.values()):
        wide = np.sqrt(covariance[i, i] * np.array([fit.threshold(1), fit.threshold(3)]) * fit.correlation)
        ends = np.log([estimate.low, estimate.high, estimate.least, estimate.most]) - np.log(estimate.value)
        np.testing.assert_allclose(ends, [-wide[0], wide[0], -wide[1], wide[1]], rtol=0.05)


@pytest.mark.slow
def test_sparse_velocity_steps_tell_only_the_difference_of_effects():
    """Every sample is steady: a and b enter by a - b alone."""
    steps = (1e-6, 1e-5, 1e-6, 3e-6)
    rates = np.repeat(steps, 8)
    time = 1e4 * np.arange(len(rates))
    noise = 1e-4 * np.random.default_rng(1).standard_normal(len(rates))
    friction = 0.6 - 0.005 * np.log(rates / 1e-6) + noise
    moved = np.concatenate([[0.0], np.cumsum(np.diff(time) * rates[:-1])])
    record = Record(
        name="sparse",
        time=time,
        friction=np.concatenate([friction[:1], friction[:-1]]),
        load_point=moved,
        slip=None,
        normal=np.ones(len(time)),
        normal_unit="",
    )
    found = identify(record, stiffness=1e4)
    assert not found.identified
    assert any("only direct_effect - evolution_effect = " in told for told in found.undetermined())
    assert found.difference.low < -0.005 < found.difference.high
    assert found.difference.high - found.difference.low < 2e-4
    with pytest.raises(RecordError, match="needs every parameter"):
        identified_fault(found, load_fault("lab-fault"))


def test_the_velocity_step_of_rsfmodel_gives_back_its_parameters():
    """jrleeman/rsfmodel, tests/rsf_tests.py: a = 0.005, b = 0.01, Dc = 10 µm, k = 1e-3 1/µm, printed to 8 decimals."""
    lines = (DATA / "rsfmodel_velocity_step.csv").read_text().splitlines()
    head, *rows = (line.split(",") for line in lines if not line.startswith("#"))
    time, friction = np.array(rows, dtype=float).T
    record = Record(
        name="rsfmodel",
        time=time,
        friction=friction,
        load_point=np.where(time < 10, 1e-6 * time, 1e-5 + 1e-5 * (time - 10)),
        slip=None,
        normal=np.ones(len(time)),
        normal_unit="",
    )
    found = identify(record)
    values = {name: estimate.value for name, estimate in found.estimates.items()}
    assert head == ["time", "friction"]
    truth = {"reference_coefficient": 0.6, "direct_effect": 0.005, "evolution_effect": 0.01, "critical_slip": 1e-5}
    assert values == pytest.approx(truth | {"stiffness": 1e3}, rel=1e-4)
    assert found.fit.noise < 2e-7


def test_the_mass_from_which_inertia_counts_and_the_noise_of_slip_are_told():
    """By hand: noise of 5 MPa over the largest change of rate between samples; the steepest friction times 50 µm."""
    made = synthetic.KINDS["velocity steps, ageing"]()
    record, loading = prepared(made.noisy(0))
    experiment = set_up(record, friction_law(made.law), made.stiffness, loading).experiment
    truth = experiment.near(made.true_at(experiment.law.reference_rate))
    change = np.max(np.abs(np.diff(experiment.rates(truth)))) / 0.2
    (told,) = experiment.remarks(truth, 3e-4)
    assert f"{3e-4 * synthetic.NORMAL / change:.2g} kg/m^2" in told
    slipped = synthetic.weakening()
    measured = set_up(slipped.noisy(0), friction_law(slipped.law), None).experiment
    at = measured.near(slipped.truth)
    assert measured.remarks(at, 2e-3) == ()
    steepest = 0.17 / 2.5e-3 * np.exp(-measured.slip[0] / 2.5e-3)
    (felt,) = replace(measured, slip_noise=50e-6).remarks(at, 2e-3)
    assert f"noise of 5e-05 m changes friction by {steepest * 50e-6:.2g}" in felt


def test_the_same_seed_gives_the_same_answer(weak):
    again = identify(weak.record, "exponential-slip-weakening", seed=0)
    assert again.to_dict() == weak.to_dict()


def test_a_cover_holds_every_law_of_its_ranges():
    """In rationals: each law, scaled to the cover's static friction, keeps its bounds and slope; N̂ is in the box."""
    law = friction_law("exponential-slip-weakening")(residual=0.4, drop=0.17, critical_slip=2.5e-3)
    ranges = {"residual": (0.39, 0.41), "drop": (0.16, 0.18), "critical_slip": (2.3e-3, 2.7e-3)}
    box = load_fault("lab-fault", box="ten-percent").box
    friction, covering = cover(law, ranges, box)
    static = rational(friction.residual) + rational(friction.drop)
    slope = rational(friction.drop) / rational(friction.critical_slip)
    inner = itertools.product(*(np.linspace(*ends, 4) for ends in ranges.values()))
    for residual, drop, critical_slip in ([rational(float(value)) for value in corner] for corner in inner):
        scale = static / (residual + drop)
        assert residual * scale >= rational(friction.residual)
        assert drop / critical_slip * scale <= slope
        assert (1 - box.authority) / scale >= 1 - covering.authority
        assert (1 + box.authority) / scale <= 1 + covering.authority
    assert (covering.stiffness, covering.damping) == (box.stiffness, box.damping)
    assert covering.authority < Fraction(1, 5)


def test_the_file_is_a_fault_that_covers_the_truth(weak, tmp_path):
    path = tmp_path / "found.toml"
    save_fault(weak, load_fault("lab-fault"), path)
    fault = load_fault(path)
    assert fault == identified_fault(weak, load_fault("lab-fault"))
    assert fault.friction.residual < 0.4 < 0.4 + 0.17 < 1.02 * (fault.friction.residual + fault.friction.drop)
    assert fault.friction.slip_slope > 0.17 / 2.5e-3
    assert 0 < fault.box.authority < Fraction(1, 20)
    assert "drop = 0.17" in path.read_text()


@pytest.mark.parametrize("name", ["rate-and-state-aging", "rate-and-state-slip", "regularised-rate-and-state"])
def test_a_file_of_state_friction_says_which_spread_covers_a_b_and_d_c(weak, name, tmp_path):
    """The remark names the worst end of three; the other numbers do not count. Guarantees take each of the laws."""
    patch = load_fault("crustal-patch")
    law = friction_law(name)(**asdict(patch.friction))
    values = {
        name: getattr(law, name)
        for name in ("direct_effect", "evolution_effect", "critical_slip", "reference_coefficient")
    }
    estimates = {
        name: ParameterEstimate(name=name, unit="", value=v, low=v, high=v, least=0.99 * v, most=1.01 * v)
        for name, v in values.items()
    }
    b = estimates["evolution_effect"]
    estimates["evolution_effect"] = replace(b, least=b.value * 0.9377)
    estimates["reference_coefficient"] = replace(estimates["reference_coefficient"], most=2.0)
    path = tmp_path / "state.toml"
    save_fault(replace(weak, law=law, estimates=estimates), patch, path)
    assert "design --spread 0.063 covers a, b and D_c of the box" in path.read_text()
    assert next_command(replace(weak, law=law, estimates=estimates), "my own.toml") == (
        "quakedesign design 'my own.toml' --spread 0.063"
    )
    slip = replace(estimates["critical_slip"], most=1.41 * values["critical_slip"])
    wide = replace(weak, law=law, estimates=estimates | {"critical_slip": slip})
    save_fault(wide, patch, path)
    for told in (next_command(wide, path), path.read_text()):
        assert "too wide for a guarantee: critical_slip within 41%; at most about 20% is admissible" in told
        assert "Fit about 5 such steps together" in told
        assert "--spread 0" not in told
    low, high = slow_sliding_plant(replace(patch, friction=law), Fraction(0), Fraction("0.063")).ranges[
        "evolution_effect"
    ]
    assert low < Fraction(b.value) * Fraction("0.9377") < high


@pytest.mark.parametrize("name", ["rate-and-state-aging", "regularised-rate-and-state"])
def test_a_law_is_told_at_the_rate_at_which_its_fault_is_loaded_and_stays_the_same_friction(weak, name):
    patch = load_fault("crustal-patch")
    law = friction_law(name)(
        **asdict(patch.friction) | {"reference_rate": 1e-6, "slowest_rate": 1e-8, "fastest_rate": 1e-3}
    )
    found = identified_fault(replace(weak, law=law), patch).friction
    assert (found.reference_rate, found.slowest_rate, found.fastest_rate) == (1e-9, 1e-20, 100.0)
    for rate, theta in ((1e-9, 1e6), (1e-6, 3.0), (1e-2, 1e-3)):
        assert float(found.coefficient(0, rate, theta)) == pytest.approx(
            float(law.coefficient(0, rate, theta)), rel=1e-12
        )
    assert identified_fault(replace(weak, law=law), load_fault("lab-fault")).friction == law
    assert "reference rate" in other_parts(replace(weak, law=law), patch)


def test_what_a_task_was_taken_from_and_a_rate_that_the_record_does_not_know_are_told(weak, tmp_path):
    patch, lab, path = load_fault("crustal-patch"), load_fault("lab-fault"), tmp_path / "found.toml"
    assert task_remarks(weak, lab) == []
    assert next_command(weak, "found.toml") == "quakedesign design found.toml"
    aged = replace(weak, law=replace(patch.friction, slowest_rate=1e-10, fastest_rate=9e-7))
    assumed = ("damping 1 kg/s, x", "target slip 1 m, the next rest slip rounded down", "operation time 9 s, y")
    taken, beyond = task_remarks(aged, replace(patch, assumed=assumed))
    assert taken.startswith("assumed for the friction that is replaced: target slip 1 m, the next rest slip")
    assert "operation time 9 s" in taken
    assert "damping" not in taken
    assert beyond.startswith("V = 1e-06 m/s is above the rates of the record, 1e-10 to 9e-07 m/s: a, b and D_c are")
    assert task_remarks(replace(weak, law=patch.friction), patch) == []
    save_fault(weak, replace(lab, assumed=assumed[1:2]), path)
    assert "# assumed for the friction that is replaced: target slip 1 m" in path.read_text()


def test_a_friction_at_another_rate_and_another_law_than_the_faults_are_told(weak):
    """By hand: mu at the rate of the fault is 0.6 - 0.005 ln(1e-9/1e-6) = 0.63454."""
    patch = load_fault("crustal-patch")
    moved = {"reference_rate": 1e-6, "slowest_rate": 1e-8, "fastest_rate": 1e-3, "reference_coefficient": 0.6}
    effects = {"direct_effect": 0.01, "evolution_effect": 0.015}
    slip = friction_law("rate-and-state-slip")(**asdict(patch.friction) | moved | effects)
    found = replace(weak, law=slip, rival=OtherLaw(law=patch.friction.name, squares=2.0, excess=300.0))
    assert "mu0 = 0.6 at 1 µm/s was converted to 0.63454 at 1 nm/s for the file" in task_remarks(found, patch)
    assert "the friction coefficient in steady sliding at 1 µm/s" in " ".join(identification_lines(found, verbose=True))
    assert "aging fits worse: 2 times the sum of squares, AIC higher by 300" in " ".join(
        " ".join(identification_lines(found, verbose=True)).split()
    )
    (said,) = law_remarks(found, patch)
    assert "crustal-patch has rate-and-state-aging, but the record prefers rate-and-state-slip" in said
    assert law_remarks(replace(found, rival=None), patch) == []
    regularised = friction_law("regularised-rate-and-state")(**asdict(patch.friction))
    (said,) = law_remarks(found, replace(patch, friction=regularised))
    assert "has regularised-rate-and-state, but the record was fitted by rate-and-state-slip" in said
    assert law_remarks(found, load_fault("lab-fault")) == []
    assert law_remarks(found, replace(patch, friction=slip)) == []
    assert "hardly distinguishes" in str(OtherLaw(law="x", squares=1.001, excess=3.0))


@pytest.mark.parametrize(("slip", "said"), [(4e-8, "40 nm is far shorter"), (0.02, "2 cm is far longer"), (1e-6, "")])
def test_a_critical_slip_of_no_laboratory_points_at_the_unit(weak, slip, said):
    law = load_fault("crustal-patch").friction
    told = ParameterEstimate(name="critical_slip", unit="m", value=slip, low=slip, high=slip, least=slip, most=slip)
    found = replace(weak, law=law, estimates={"critical_slip": told})
    lines = " ".join(" ".join(identification_lines(found)).split())
    assert ("check the unit" in lines) == bool(said)
    assert said in lines


def test_friction_with_a_state_brings_its_sampling_time_unless_the_fault_has_one_for_it(weak, tmp_path):
    """The laboratory's 1 ms is for slip weakening; D_c/(20 V) with V = 7.1 mm/3600 s is 0.507 s for D_c = 20 µm."""
    lab, patch, written = load_fault("lab-fault"), load_fault("crustal-patch"), tmp_path / "begun.toml"
    written.write_text(template("rate-and-state-aging"))
    aged = replace(weak, law=patch.friction)
    assert identified_fault(aged, lab).sampling_time == 3.6  # a thousandth of the hour; D_c/(20 V) is 203 s
    quick = replace(aged, law=replace(patch.friction, critical_slip=2e-5))
    assert identified_fault(quick, lab).sampling_time == 0.50  # 0.507 s rounded down
    assert identified_fault(quick, patch).sampling_time == patch.sampling_time
    assumed = replace(
        patch, assumed=("sampling time 41 s, at most D_c/(20 V) in slow sliding at the task's mean rate V",)
    )
    assert identified_fault(quick, assumed).sampling_time == 1.0  # 20 µm/(20 · 1 µm/s)
    assert other_parts(quick, assumed) == "normal stress, size, task, disturbance, reference rate, working range"
    assert step_assumed(load_fault(written)) != step_assumed(patch)
    assert identified_fault(weak, lab).sampling_time == lab.sampling_time
    assert other_parts(quick, lab) == "normal stress, size, task"
    assert (
        identified_fault(quick, lab).disturbance == Disturbance()
    )  # a stress is told to what runs it, not to the fault
    assert identified_fault(weak, lab).disturbance == lab.disturbance != Disturbance()
    assert other_parts(weak, lab) == "normal stress, size, task, T_s, disturbance"
    assert other_parts(quick, patch) == "normal stress, size, task, T_s, disturbance, reference rate, working range"


@pytest.mark.parametrize(
    ("law", "changes", "said"),
    [
        ("slip-rate-weakening", {}, "depends on the slip rate alone"),
        ("rate-and-state-aging", {}, "needs the motion of the load point"),
        ("exponential-slip-weakening", {"slip": None}, "needs the column slip"),
        ("exponential-slip-weakening", {"slip": np.zeros(400)}, "slip must exceed its noise"),
        ("exponential-slip-weakening", {"friction": np.ones(400)}, "friction changes"),
        ("rate-and-state-aging", {"load_point": np.zeros(400)}, "must begin in steady sliding"),
    ],
)
def test_records_that_do_not_suit_a_law_are_refused(law, changes, said):
    record = replace(synthetic.weakening().noisy(0), **changes)
    with pytest.raises(RecordError, match=said):
        identify(record, law)
