"""What `design` says and writes of a fault with rate-and-state friction: outcome, guarantee, cycle, one report."""

import io
import json
import math
import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from quakedesign import compare
from quakedesign.cli import main
from quakedesign.cli.app import console as terminal
from quakedesign.errors import ParameterError, SimulationError, UnsupportedError
from quakedesign.exact import UpperBound
from quakedesign.fault import load_fault
from quakedesign.guarantees import NoProof
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.sliding_result import SlidingGuarantee
from quakedesign.report.figures import cycle, errors, overviews, slow_sliding
from quakedesign.report.folder import write_folder
from quakedesign.report.page import accounts, parameter_rows
from quakedesign.report.sentences import (
    cycle_sentences,
    part_of_task,
    sentences,
    state_run_lines,
    steady_start_sentence,
)
from quakedesign.report.summary import summary
from quakedesign.report.terminal import print_comparison
from quakedesign.simulation import simulate_state
from quakedesign.studies import comparison as compared_in
from quakedesign.studies import single_runs as state_runs
from quakedesign.synthesis import design, designable, left_out, state_feedback

PROOF = Path(__file__).parents[2] / "proofs" / "certificates" / "sliding_crustal-patch.json"
PATCH = load_fault("crustal-patch")
SHORT = replace(PATCH, reference=replace(PATCH.reference, target_slip=0.3, operation_time=3e5))


@pytest.fixture(scope="module")
def comparison():
    """A law whose proof is known, over a third of its task, beside a fault that nothing has disturbed yet."""
    guarantee = parse_guarantee(PROOF.read_text())
    answer = SlidingGuarantee(proof=guarantee, task=guarantee.task, sampled_loop=guarantee.sampled_loop)
    still = simulate_state(SHORT, 1e-9, duration=1e7, inertia=False, method="dop853")
    of_runs = {"scheme": "continuous", "step": None, "plant": "quasi-dynamic", "controller": "none"}
    natural = replace(still, provenance={**still.provenance, **of_runs})
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(state_feedback, "guarantee_sliding", lambda fault, **asked: answer)
        patched.setattr(compared_in, "natural_run", lambda fault: natural)
        return compare(SHORT, [design(SHORT, "elqr")])


@pytest.fixture(scope="module")
def folder(comparison, tmp_path_factory):
    out = tmp_path_factory.mktemp("design") / "patch"
    write_folder(comparison, out, force=False)
    return out


def test_the_run_is_told_by_the_outcomes_of_all_faults_and_stays_inside_its_guarantee(comparison):
    (entry,) = comparison.entries
    run, claims = entry.run, entry.proof.claims
    assert run.outcome.kind == "tracked"
    assert run.outcome.peak_slip_rate == np.max(run.slip_rate) < entry.proof.peak_slip_rate
    assert run.metrics.max_slip_error <= np.max(np.abs(run.slip - 1e-6 * run.time)) <= claims.slip_error
    assert float(np.max(run.stress)) == pytest.approx(float(entry.proof.task.stress), rel=1e-4)
    late = run.slip_error[run.time > 7.5e4]
    assert run.metrics.rms_slip_error == pytest.approx(np.linalg.norm(late) / len(late) ** 0.5, rel=1e-12)
    assert run.metrics.settled_from == 7.5e4
    balance = run.friction * (50e6 - run.pressure)
    assert run.shear_stress == pytest.approx(balance)


def test_the_folder_holds_the_certificate_the_figures_and_the_keys_of_all_designs(folder, comparison):
    found = json.loads((folder / "results.json").read_text())
    elqr = found["controllers"]["elqr"]
    assert elqr["verdict"] == "proved"
    assert elqr["outcome"]["kind"] == "tracked"
    assert elqr["guarantee"]["stress"] == str(comparison.entries[0].proof.task.stress)
    assert parse_guarantee((folder / elqr["certificate"]).read_text()).claims == comparison.entries[0].proof.claims
    assert found["uncontrolled"]["cycle"] == {"recurrence_interval": None, "slip": None, "magnitude": None}
    assert set(found["not_applicable"]) == {"cta", "dia"}
    assert {path.stem for path in (folder / "figures").iterdir()} == {
        "overview",
        "cycle",
        "slow-sliding",
        "sliding-errors",
    }
    page = (folder / "report.html").read_text()
    assert "state of rate-and-state friction, the age of contacts" in page
    assert "signed power" not in page  # of sliding modes, which such faults have not


def test_the_terminal_says_first_what_came_of_it(comparison):
    told = io.StringIO()
    print_comparison(comparison, terminal(file=told, width=80), whole=False)
    lines = told.getvalue().splitlines()
    assert len(lines) <= 40
    assert max(map(len, lines)) <= 80
    said = " ".join(told.getvalue().split())
    proved = "With the e-LQR (designed) the slip rate never exceeds 1.2 µm/s during the 1 m of slip of the task, under"
    assert said.startswith(f"crustal-patch: guaranteed. {proved}")
    assert "the slip stays within 83.3 µm of the reference" in said
    (row,) = (line.split() for line in lines if line.startswith("e-LQR  "))
    claims, worst = comparison.entries[0].proof.claims, comparison.entries[0].guarantee.worst
    assert row[2] == f"{UpperBound(10**6 * Fraction(comparison.entries[0].proof.peak_slip_rate)):.3g}"
    assert row[3] == f"{1e6 * math.exp(worst.log_rate) * float(comparison.entries[0].proof.task.rate):.3g}"
    ends = comparison.entries[0].proof.valve_pressures
    assert [row[-3], row[-1]] == [f"{type(end)(Fraction(end) / 10**6):.3g}" for end in ends]
    assert "Without control: the fault creeps" in said
    assert "Run and proof begin in steady sliding at V = 1 µm/s; the transition from rest is not covered" in said
    assert row[5:7] == [f"{UpperBound(10**6 * Fraction(claims.slip_error)):.3g}", f"{1e6 * worst.slip_error:.3g}"]
    print_comparison(comparison, terminal(file=told, width=200))
    gains = next(line for line in told.getvalue().splitlines() if "gains: " in line)
    assert re.search(r"k1 = \S+ Pa/m, k2 = 0 Pa s/m, slip = \S+ Pa, ", gains)
    assert "slip error, friction state, diffusion modes" in " ".join(told.getvalue().split())


def test_a_cycle_that_is_not_known_has_no_overview(comparison):
    assert list(overviews(comparison)) == ["overview"]
    failed = replace(comparison.uncontrolled, failed="the integration stopped.")
    without = type(comparison)(fault=SHORT, uncontrolled=failed, entries=comparison.entries)
    assert overviews(without) == {}


def test_why_nothing_is_proved_is_said_once_and_at_the_head_of_the_report(comparison, monkeypatch):
    why = (
        "no law with a hold over 300 s was found whose loop is stable; a proof was found for a stress of at most 7 kPa"
    )
    guarantee = comparison.entries[0].proof
    none = SlidingGuarantee(proof=NoProof(reason=why), task=guarantee.task, sampled_loop=None)
    monkeypatch.setattr(state_feedback, "guarantee_sliding", lambda fault, **asked: none)
    monkeypatch.setattr(compared_in, "natural_run", lambda fault: comparison.uncontrolled)
    without, told = compare(SHORT, [design(SHORT, "elqr")]), io.StringIO()
    assert accounts(without)[0].verdict == ["undecided"]
    assert accounts(without)[0].guarantee == [f"guarantee: none: {why}"]
    print_comparison(without, terminal(file=told, width=80), whole=False)
    said = " ".join(told.getvalue().split())
    assert said.startswith("crustal-patch: no guarantee for any designed controller. ")
    assert said.count("whose loop is stable") == 1
    assert summary(without).conditions == f"e-LQR (designed): none: {why}"


def test_the_report_is_the_one_of_all_faults(folder):
    page = (folder / "report.html").read_text()
    parts = ("limits", "figures", "fault", "outcome", "proof", "parameters", "again")
    places = [page.index(f'<section id="{part}"') for part in parts]
    assert places == sorted(places)
    first = page[page.index('<div class="answer">') : page.index("<nav>")]
    assert first.index("Without control: the fault creeps") < first.index("With the e-LQR (designed) the slip rate")
    assert first.index("never exceeds") < first.index("Not designed, 2-CTA, 2-DIA")
    assert "the slip rate responds to the pressure without delay" in first
    assert "guaranteed for the sampled loop" in page
    assert "Uncertainty box" not in page
    assert not re.search(r"for ever\b", page[: page.index("Glossary")])
    assert first.index("of slip of the task") < first.index("under every shear stress disturbance of at most")
    assert first.index("for every shear stress disturbance of at most") < first.rindex("of slip of the task")
    assert "the transition from rest is not covered" in first
    plain = re.sub("<[^>]+>", "", first)
    assert "a well near the fault, L2/D = 800 s (28.3 m at D = 1 m2/s)" in plain
    assert "in which the fault slides forward throughout" in first
    assert "plant without stick" not in page
    assert "continued to negative slip rates" not in page


def test_a_fault_that_nothing_disturbs_creeps_and_has_no_event(comparison):
    assert comparison.uncontrolled.natural_peak is None
    assert comparison.uncontrolled.outcome.kind == "creep"


def test_laws_that_do_not_apply_are_left_out_with_their_reason():
    assert designable(PATCH) == ("elqr",)
    assert left_out(load_fault("real-fault")) == {}
    assert set(left_out(PATCH)) == {"cta", "dia"}
    with pytest.raises(UnsupportedError, match=r"the slip rate responds to the pressure without delay .* Received cta"):
        design(PATCH, "cta")


@pytest.mark.parametrize(
    ("fault", "asked", "said"),
    [
        ("real-fault", {"stress": 1e3}, "need friction with a state"),
        ("real-fault", {"spread": "0.1"}, "need friction with a state"),
        ("crustal-patch", {"diffusion": 0}, "above 0 s"),
        ("crustal-patch", {"continuous": True}, "designed for the sampled loop"),
        ("crustal-patch", {"disturbance_class": "rate"}, "designed for the sampled loop without noise"),
        ("crustal-patch", {"slip_noise": "1e-6"}, "guarantee, which takes slip noise"),
        ("crustal-patch", {"spread": 1}, "spread must be from 0 to below 1"),
    ],
)
def test_what_does_not_apply_is_refused(fault, asked, said):
    with pytest.raises(ParameterError, match=said):
        design(load_fault(fault), "elqr", **asked)


def test_without_a_diffusion_the_well_is_near(monkeypatch):
    """A tenth of D_c/V: 8 mm over 1 µm/s."""
    asked = {}

    def answer(fault, **told):
        asked.update(told)
        raise ParameterError("enough")

    monkeypatch.setattr(state_feedback, "guarantee_sliding", answer)
    with pytest.raises(ParameterError, match="enough"):
        design(PATCH, "elqr", stress="25000")
    setup = ExactSetup(diffusion=Fraction(800))
    assert asked | {"progress": None} == {"stress": Fraction(25000), "spread": 0, "progress": None, "setup": setup}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("preset", "natural", "in_event"),
    [
        ("crustal-patch", "earthquake", 0.9),
        ("creeping-patch", "creep", None),
        ("geothermal-fault", "earthquake", 0.9),
        ("double-direct-shear", "earthquake", 0.8),  # near its critical stiffness more of it creeps before
    ],
)
def test_one_command_takes_a_preset_from_file_to_a_guaranteed_controller(preset, natural, in_event, tmp_path, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["design", preset, "--out", str(tmp_path / "out"), "--json"])
    found = json.loads(capsys.readouterr().out)
    assert stop.value.code == 0
    assert found["uncontrolled"]["outcome"]["kind"] == natural
    elqr, cycle = found["controllers"]["elqr"], found["uncontrolled"]["cycle"]
    assert (elqr["verdict"], elqr["outcome"]["kind"]) == ("proved", "tracked")
    if in_event:  # what is loaded in a cycle is slipped in it, nearly all of it in its event
        loaded = load_fault(preset).friction.reference_rate * cycle["recurrence_interval"]
        assert in_event < cycle["slip"] / loaded < 1


@pytest.mark.parametrize(("last", "unit"), [(3264.0, "min"), (30.0, "s"), (168 * 31_557_600.0, "years")])
def test_a_cycle_is_drawn_in_a_unit_that_suits_it(last, unit):
    time = np.linspace(0, last, 5)
    moved = {"min": "smooth", "s": "quasi-dynamic", "years": "smooth"}[unit]
    made = {"method": "radau", "rtol": 1e-8, "plant": moved}
    natural = SimpleNamespace(time=time, slip=time / last, slip_rate=1 + time, provenance=made)
    drawn = cycle(SimpleNamespace(fault=SHORT, uncontrolled=natural))
    assert drawn.texts[-1].get_text().endswith({"smooth": "with inertia", "quasi-dynamic": "quasi-dynamic"}[moved])
    assert not any(axis.get_legend() for axis in drawn.axes)  # it would hide events
    assert drawn.axes[1].get_xlabel() == f"time [{unit}]"
    assert drawn.axes[0].lines[0].get_xdata()[-1] == pytest.approx(
        last / {"min": 60, "s": 1, "years": 31_557_600}[unit]
    )


def test_a_cycle_that_one_method_cannot_follow_is_computed_by_another(monkeypatch):
    still = simulate_state(SHORT, 1e-9, duration=1e7, inertia=False, method="dop853")
    tried = []

    def cycles(fault, rate, *, inertia, method, rtol):
        tried.append((inertia, method))
        if inertia:
            raise SimulationError("the integration stopped")
        return still

    monkeypatch.setattr(state_runs, "cycles", cycles)
    assert state_runs.natural_run(SHORT).slip is still.slip
    assert tried == [(True, "radau"), (True, "cvodes"), (False, "cvodes")]
    monkeypatch.setattr(state_runs, "_NATURAL", ((True, "radau"),))
    unknown = state_runs.natural_run(SHORT)
    assert (unknown.failed, unknown.natural_peak, unknown.outcome.kind) == ("the integration stopped", None, "unknown")
    assert unknown.metrics.peak_slip_rate is None


@pytest.mark.slow
def test_a_design_goes_on_where_no_cycle_can_be_computed(comparison, monkeypatch, tmp_path):
    def stopped(*_, **__):
        raise SimulationError("the integration stopped.")

    monkeypatch.setattr(state_runs, "cycles", stopped)
    natural, told = state_runs.natural_run(SHORT), io.StringIO()
    without = type(comparison)(fault=SHORT, uncontrolled=natural, entries=comparison.entries)
    found = write_folder(without, tmp_path / "patch", force=False)
    assert found["uncontrolled"]["outcome"]["kind"] == "unknown"
    assert {path.stem for path in (tmp_path / "patch" / "figures").iterdir()} == {"slow-sliding", "sliding-errors"}
    print_comparison(without, terminal(file=told, width=200))
    said = "Without control: unknown, since its cycle could not be computed (the integration stopped)"
    assert said in told.getvalue()
    assert said in (tmp_path / "patch" / "report.html").read_text()


@pytest.mark.parametrize(("rate", "length", "warned"), [(1e-6, 4e3, True), (1e-6, 1.0, False), (1e-9, 4e3, False)])
def test_a_fault_that_is_loaded_faster_than_any_plate_is_told_which_key_says_so(rate, length, warned):
    event = {"magnitude": 5.7, "recurrence_interval": 9e5}
    outcome = SimpleNamespace(kind="earthquake", peak_slip_rate=0.3)
    run = {"cycle": event | {"slip": 0.6}, "outcome": outcome, "natural_peak": 0.3, "provenance": {"plant": "smooth"}}
    friction = SimpleNamespace(operating_rate=rate)
    fault = SimpleNamespace(length=length, friction=friction, reference=SHORT.reference)
    said, _ = cycle_sentences(SimpleNamespace(fault=fault, uncontrolled=SimpleNamespace(failed="", **run)))
    assert f"loaded at {rate:.3g} m/s (with inertia)" in said
    assert ("FASTER than any plate: that is reference_rate of [friction]" in said) == warned


@pytest.mark.parametrize(("slip", "locked"), [(0.001, True), (0.009, False)])
def test_a_locked_fault_whose_run_ends_before_its_event_is_not_said_to_creep_for_good(slip, locked):
    outcome = {"kind": "creep", "peak_slip_rate": 1e-9, "earthquake_from": 0.02}
    answer = {"outcome": outcome, "slip_events": [], "duration": 1e7, "slip": slip, "loading_rate": 1e-9}
    answer |= {"start": {"slip_rate": 1e-12, "state": {"state": 1e6}}, "pressure": [0.0, 0.0], "resting": False}
    answer |= {"cycle": {"recurrence_interval": None, "slip": None}, "energy": {"relative_residual": 0.0}}
    assert any("this is not steady creep" in line for line in state_run_lines(answer)) == locked


def test_figures_of_slow_sliding_show_rates_over_the_reference_and_errors_with_their_sign(comparison):
    (entry,) = comparison.entries
    rate = slow_sliding(entry, entry.run).axes[1]
    assert (rate.get_yscale(), rate.get_ylabel()) == ("linear", "slip rate / V [-]")
    (never,) = (line.get_ydata()[0] for line in rate.lines if line.get_label() == "proved upper bound")
    assert never == pytest.approx(float(entry.proof.peak_slip_rate) / 1e-6)
    slip, speed = errors(entry, entry.run).axes
    assert (slip.get_yscale(), slip.get_ylabel(), speed.get_ylabel()) == (
        "linear",
        "slip error [µm]",
        "slip-rate error [nm/s]",
    )
    seen = slip.collections[0].get_paths()[0].vertices[:, 1]
    assert seen.min() == pytest.approx(1e6 * entry.run.slip_error.min())
    assert seen.max() == pytest.approx(1e6 * entry.run.slip_error.max())
    assert seen.min() < 0 < seen.max()
    assert not [row for row in parameter_rows(SHORT) if row[-1] == "disturbance"]


@pytest.mark.slow
def test_of_a_slow_task_the_beginning_is_run_and_the_report_says_so(comparison, monkeypatch):
    (entry,) = comparison.entries
    ageing = 8e-3 / 1e-6
    slow = replace(PATCH, reference=replace(PATCH.reference, target_slip=5.0, operation_time=5e6))
    assert state_runs.shown_time(slow) == 500 * ageing < 5e6
    assert state_runs.shown_time(slow, whole=True) == 5e6
    assert state_runs.shown_time(replace(slow, reference=replace(slow.reference, ramp=0.05))) == 5e6
    assert state_runs.shown_time(SHORT) == 3e5
    assert part_of_task(entry.run, SHORT) == ""
    monkeypatch.setattr(state_runs, "_SHOWN", 3)
    run = state_runs.designed_run(entry.design, None, lambda done: None)
    assert 0 <= run.time[-1] - 3 * ageing <= 300
    lowest = np.interp(3 / 4 * (3 * ageing / 4), run.time, run.stress)  # of a sine whose period is a quarter of the run
    assert lowest == pytest.approx(-float(entry.proof.task.stress), rel=1e-3)
    said = "shown: the first 2.43e+04 s (6.75 hours) of 3e+05 s (3.47 days); --whole-task runs all of it"
    assert part_of_task(run, SHORT) == said
    assert said in sentences(replace(entry, run=run))
    whole = state_runs.designed_run(entry.design, None, lambda done: None, whole=True)
    assert whole.time[-1] == 3e5
    assert part_of_task(replace(run, events={"opening": 1.0}), SHORT) == ""


def test_the_figure_of_a_long_run_has_no_more_bands_than_are_seen(comparison):
    (entry,) = comparison.entries
    run = entry.run
    many = 40
    arrays = {
        name: np.tile(value, many)
        for name, value in vars(run).items()
        if isinstance(value, np.ndarray) and value.shape == run.time.shape
    }
    long = replace(run, **arrays | {"time": np.linspace(0, 3e5, many * len(run.time))})
    bands = slow_sliding(entry, long).axes[2].collections[0].get_paths()[0].vertices
    assert len(bands) < 2 * 650 + 8


def test_the_slip_that_a_task_takes_stands_beside_that_of_an_earthquake(comparison):
    """0.3 m at 1 µm/s of a cycle whose last event slipped 0.65 m; nothing of an event that is not known."""
    run = comparison.uncontrolled
    whole = SimpleNamespace(cycle={"slip": 0.649})
    said = steady_start_sentence(whole, SHORT)
    assert said.endswith("; the task releases 0.3 m of the 0.649 m of slip of an earthquake")
    for other in (run, SimpleNamespace(cycle=None)):
        assert steady_start_sentence(other, SHORT).endswith("the transition from rest is not covered")
