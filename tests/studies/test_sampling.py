"""The sampling report: rows, orders, sensitivities; and what issue and README promise for the real fault."""

import importlib
import io
import json
import math
from dataclasses import replace
from types import SimpleNamespace

import pytest
from rich.console import Console

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.laws import control_law
from quakedesign.laws.feed_forward import feed_forward
from quakedesign.report import sampling_table
from quakedesign.report.sampling_table import COLUMNS, order_rows, print_sampling, row_cells, study_rows, write_sampling
from quakedesign.simulation import Study
from quakedesign.studies.sampling import noise_levels, sampling_report

REAL, LAB = load_fault("real-fault"), load_fault("lab-fault")
OWN = replace(LAB, name="own")  # without published gains
BASE = control_law("cta").from_values(("7", "5", "2.3", "1.1"), divisor="4/1385")
LINEAR = control_law("elqr").from_values(("4.17e7", "6.94e5", "4.17e6", "1.39e4"))


@pytest.fixture(scope="module")
def report(kept):
    return sampling_report(OWN, LINEAR, schemes=("implicit", "explicit"), duration=0.2)


@pytest.mark.slow
def test_every_scheme_has_a_row_and_every_question_a_study(report):
    assert [row.scheme for row in report.rows] == ["implicit", "explicit"]
    assert list(report.studies) == ["slip_noise", "rate_noise", "input_gain"]
    assert {len(row_cells(row)) for row in report.rows} == {len(COLUMNS)}


@pytest.mark.slow
def test_json_holds_all_of_it(report):
    found = json.loads(json.dumps(report.to_dict(), allow_nan=False))
    assert set(found) == {"fault", "schemes", "orders", "slip_noise", "rate_noise", "input_gain"}
    assert found["orders"] is None
    first = found["schemes"][0]
    assert (first["law"], first["origin"], first["scale"], first["on_trajectory"]) == ("elqr", "given", None, None)
    assert first["metrics"]["max_slip_error"] > 0
    assert first["energy_residual"] < 1e-3
    assert len(found["input_gain"]["levels"]) == 3


@pytest.mark.slow
def test_the_folder_and_the_terminal_show_it(report, tmp_path):
    from quakedesign.cli.app import console as terminal

    write_sampling(report, tmp_path / "out", ("svg",))
    names = {str(p.relative_to(tmp_path / "out")) for p in (tmp_path / "out").rglob("*.*")}
    assert names == {"results.json", *(f"figures/{n}.svg" for n in report.studies)}
    console = terminal(width=80, record=True, file=io.StringIO())
    print_sampling(report, console)
    said = console.export_text()
    assert "e-LQR" in said
    assert all(len(line) <= 80 for line in said.splitlines() if line.startswith(("implicit", "explicit")))


@pytest.mark.slow
def test_gains_without_a_certificate_are_run_with_other_scales_beside_the_limit_times_the_scale():
    """No certificate of a 2-CTA exceeds λ(k3 − k4), ERRATA after row 29; with feed-forward e3 is not ξ1 + h."""
    law = BASE.with_feedforward(feed_forward("nominal", LAB, BASE.divisor))
    found = sampling_report(OWN, law, scales=("1/2",), schemes=("explicit",), duration=0.1)
    assert [float(row.controller.scale) for row in found.rows] == [1, 0.5]
    assert [(row.premise.certified, row.premise.holds, row.premise.ratio) for row in found.rows] == [
        (0, False, None)
    ] * 2
    assert all(f"exceeds {limit} m/s^3" in row.premise.note for row, limit in zip(found.rows, (1.2, 0.6), strict=True))
    assert {row_cells(row)[-1] for row in found.rows} == {"–"}
    assert "orders" not in found.studies


def test_all_runs_are_on_the_plant_without_stick(monkeypatch):
    """As the orders of accuracy, which are known there alone."""
    module, plants = importlib.import_module("quakedesign.studies.sampling"), []
    for name in ("simulate", "noise_sensitivity", "gain_sensitivity"):
        monkeypatch.setattr(module, name, lambda *_, plant=None, **__: plants.append(plant))
    sampling_report(OWN, LINEAR, schemes=("implicit",), duration=0.1)
    assert plants == ["printed"] * 4


def test_a_linear_law_has_no_scale():
    with pytest.raises(ParameterError, match="scale is for sliding modes"):
        sampling_report(OWN, LINEAR, scales=("2",), duration=0.1)


def study(values):
    errors = {"explicit": {"slip_error": values, "slip_rate_error": (1.0, 10.0, 100.0)}}
    return Study(title="t", label="T_s", unit="s", levels=(0.1, 1.0, 10.0), errors=errors)


def test_orders_are_exponents_and_a_run_that_diverged_has_none():
    cubic, lost = study((1e-3, 1.0, 1e3)), study((1e-3, 1.0, math.inf))
    head, rows = order_rows(cubic)
    assert head[1:3] == ("order of |e1|", "order of |e2|")
    assert rows == [("explicit", "3.00", "1.00", "1.0e-03", "1.0e+00")]
    assert order_rows(lost)[1][0][1] == "–"
    assert lost.to_dict()["errors"]["explicit"]["slip_error"] == [1e-3, 1.0, None]
    assert study_rows(cubic)[1][0] == ("explicit", "|e1| [m]", "1.0e-03", "1.0e+00", "1.0e+03")


def test_events_and_levels_are_printed_with_their_units():
    run = SimpleNamespace(outcome=SimpleNamespace(harmless=False), events={"reverse_slip": 0.0025, "diverged": 12.0})
    rows = [SimpleNamespace(label="e-LQR", scheme="explicit", run=run)]
    noise = replace(study((1e-3, 1.0, 1e3)), label="standard deviation of the slip noise", unit="m")
    console = Console(width=200, record=True, file=io.StringIO())
    with pytest.MonkeyPatch.context() as patch:
        for name in ("row_outcome", "row_cells"):
            patch.setattr(sampling_table, name, lambda _: ("e-LQR",))
        print_sampling(SimpleNamespace(fault=LAB, rows=rows, studies={"slip_noise": noise}), console)
    said = console.export_text()
    assert "e-LQR, explicit, first occurrences: reverse slip at 0.0025 s, diverged at 12 s\n" in said
    assert "largest errors for standard deviation of the slip noise = 0.1 … 10 m\n" in said


def test_levels_of_noise_follow_from_the_task():
    assert noise_levels(REAL, "slip_noise")[0] == pytest.approx(1e-8 * REAL.reference.target_slip, rel=0.05)
    rates = noise_levels(LAB, "rate_noise")
    assert rates[2] == pytest.approx(LAB.reference.target_slip / LAB.reference.operation_time, rel=0.05)
    assert rates == tuple(sorted(rates))


@pytest.fixture(scope="module")
def promised():
    from quakedesign.synthesis import design

    return sampling_report(REAL, design(REAL, "cta", continuous=True), scales=("1/1000",))


def errors(row):
    return row.run.metrics.max_slip_error, row.run.metrics.max_slip_rate_error


def within(row):
    return None not in errors(row) and errors(row)[0] < 1e-5 and errors(row)[1] < 6e-6


@pytest.mark.slow
def test_the_implicit_scheme_keeps_the_rate_error_below_ten_micrometres_per_second(promised):
    """At λ = 1e-3; the designed λ = 2.5e-4 leaves 1.4e-5 m/s."""
    rates = {float(r.controller.scale): errors(r)[1] for r in promised.rows if r.scheme == "implicit"}
    assert rates[1e-3] < 1e-5 < min(rates[s] for s in rates if s < 1e-3) < 1.5e-5


@pytest.mark.slow
def test_the_compensated_scheme_alone_reaches_both_limits_at_once(promised):
    published = [r for r in promised.rows if r.origin == "published"]
    own = [r for r in promised.rows if r.scheme == "compensated" and r not in published]
    assert {r.scheme for r in promised.rows if within(r)} == {"compensated"}
    assert len(own) == 2
    assert all(within(r) and 0 < r.premise.ratio < 1 for r in own)
    assert len(published) == 9


@pytest.mark.slow
def test_its_sensitivity_stands_beside_it(promised):
    gain = promised.studies["input_gain"].errors["compensated"]
    assert max(gain["slip_error"]) < 1e-5
    assert max(gain["slip_rate_error"]) < 6e-6
    for name in ("slip_noise", "rate_noise"):
        found = promised.studies[name].errors["compensated"]
        assert found["slip_error"][1] < 1e-5
        assert found["slip_rate_error"][1] < 6e-6
        assert found["slip_rate_error"][-1] > 1e-4  # noise is not compensated


@pytest.mark.slow
def test_the_orders_of_the_explicit_scheme_are_three_two_and_one(promised):
    assert list(promised.studies["orders"].orders()["explicit"].values()) == pytest.approx((3, 2, 1), abs=0.12)
