"""The commands simulate, sampling and export."""

import json

import pytest

from quakedesign.cli import main


@pytest.fixture
def run(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        with pytest.raises(SystemExit) as stop:
            main(list(arguments))
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


SHORT = ("simulate", "lab-fault", "--duration", "0.1", "--json")


@pytest.mark.parametrize("scheme", ["explicit", "implicit", "semi-implicit", "compensated"])
def test_every_scheme_runs_with_options_after_the_gains(run, scheme):
    gains = ("--controller", "cta", "--gains", "7", "5", "2.3", "1.1", "--scale", "10")
    code, out, _ = run(*SHORT, *gains, "--scheme", scheme, "--substeps", "2", "--feedforward", "nominal")
    answer = json.loads(out)
    assert code == 0
    assert (answer["run"]["scheme"], answer["run"]["substeps"], answer["steps"]) == (scheme, 2, 100)
    assert {p["name"] for p in answer["premises"]} == {"on_trajectory"}
    assert 0 <= answer["energy"]["relative_residual"] < 1e-2
    assert isinstance(answer["events"], dict)


def test_a_start_and_a_target_are_told(run):
    begin = ("--initial-slip", "0.2 mm", "--initial-slip-rate", "1 mm/s", "--target-slip", "2 mm")
    code, out, _ = run(*SHORT, "--controller", "elqr", *begin)
    answer = json.loads(out)
    assert (code, answer["run"]["initial_slip"], answer["run"]["initial_slip_rate"]) == (0, 2e-4, 1e-3)
    assert answer["metrics"]["peak_slip_rate"] >= 1e-3
    code, _, err = run("simulate", "lab-fault", "--initial-slip", "1 mm")
    assert code == 2
    assert "initial_slip" in err
    assert run(*SHORT, "--controller", "elqr", "--target-slip", "0 m")[0] == 2


def test_a_run_says_from_when_errors_count_and_that_its_step_is_not_the_fault_s(run):
    plain = ("simulate", "lab-fault", "--duration", "0.1", "--controller", "elqr")
    own, other = run(*plain)[1], run(*plain, "--step", "0.5 ms")[1]
    assert "errors evaluated from 0.025 s on" in own
    assert "not the fault's T_s" not in own
    assert "steps of 0.0005 s, not the fault's T_s = 0.001 s" in other


def test_the_adaptive_method_and_a_perturbation_are_chosen(run):
    pushed = ("--drift", "1e-6", "--perturbation", "1e-3*sin(9*time)")
    code, out, _ = run(*SHORT, "--controller", "elqr", "--method", "cvodes", "--plant", "printed", *pushed)
    answer = json.loads(out)
    assert code == 0
    assert (answer["run"]["method"], answer["run"]["drift"]) == ("cvodes", 1e-6)
    assert "sin(9*time)" in answer["run"]["perturbation"]
    assert answer["energy"]["relative_residual"] < 1e-6


@pytest.mark.slow
def test_a_differentiator_is_told_and_judged(run):
    estimates = ("--differentiator-bound", "100", "--filter-order", "1", "--slip-noise-deviation", "1e-7")
    code, out, _ = run(*SHORT, "--controller", "cta", "--scheme", "implicit", *estimates)
    answer = json.loads(out)
    assert code == 0
    assert [p["name"] for p in answer["premises"]] == ["on_trajectory", "differentiator"]
    assert "filter_order=1" in answer["run"]["measurement"]


@pytest.mark.parametrize("bound", ["100", "100 m/s^3"])
def test_the_printed_differentiator_is_told_and_has_no_bound_under_a_held_pressure(run, bound):
    """n_d = n_f = 2, as the paper prints."""
    orders = ("--differentiator-order", "2", "--filter-order", "2")
    code, out, _ = run(*SHORT, "--controller", "cta", "--scheme", "implicit", "--differentiator-bound", bound, *orders)
    answer = json.loads(out)
    assert code == 0
    assert "order=2, filter_order=2" in answer["run"]["measurement"]
    (premise,) = (p for p in answer["premises"] if p["name"] == "differentiator")
    assert (premise["required"], premise["certified"], premise["unit"]) == (None, 100.0, "m/s^3")
    assert not premise["holds"]
    assert "jumps at every step of the pressure" in premise["note"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--differentiator-order", "2"), "differentiator order needs a differentiator"),
        (("--differentiator-order", "2", "--differentiator-bound", "1 m/s^2"), "differentiator bound"),
        (("--differentiator-order", "0", "--differentiator-bound", "1"), "order must be a whole number of at least 1"),
        (("--differentiator-bound", "1 m/s^3"), "differentiator bound"),
    ],
)
def test_orders_that_do_not_fit_are_one_line(run, options, said):
    code, _, err = run(*SHORT, "--controller", "cta", "--scheme", "implicit", *options)
    assert code == 2
    assert said in err


def test_a_divergence_is_an_event_and_no_metric(run):
    unstable = ("--scheme", "explicit", "--duration", "400", "--plant", "printed")
    code, out, _ = run("simulate", "real-fault", "--controller", "elqr", *unstable, "--json")
    answer = json.loads(out)
    assert code == 0
    assert answer["events"]["diverged"] > answer["events"]["opening"] > 0
    assert answer["metrics"]["max_slip_error"] is None
    assert answer["energy"] is None


def test_people_are_told_the_energy_that_is_lost(run):
    code, out, _ = run(*SHORT[:-1])
    assert code == 0
    assert "energy error of the integration" in out


@pytest.mark.slow
def test_a_sampling_report_is_a_folder(run, tmp_path):
    import importlib.resources

    text = (importlib.resources.files("quakedesign.fault") / "presets" / "lab-fault.toml").read_text()
    (tmp_path / "own.toml").write_text(text.replace('"lab-fault"', '"own"'))
    gains = ("--controller", "elqr", "--gains", "4.17e7", "6.94e5", "4.17e6", "1.39e4")
    command = ("sampling", "own.toml", *gains, "--schemes", "implicit", "--duration", "0.2")
    code, out, _ = run(*command, "--json")
    assert code == 0
    assert json.loads((tmp_path / "quakedesign-own-sampling" / "results.json").read_text()) == json.loads(out)
    code, _, err = run(*command)
    assert code == 2
    assert "--force" in err


def test_an_exported_controller_is_a_folder(run, tmp_path):
    command = ("export", "lab-fault", "--controller", "cta", "--scheme", "compensated", "--step", "0.002", "--out", "c")
    code, out, _ = run(*command, "--json")
    answer = json.loads(out)
    assert code == 0
    assert (answer["step"], answer["facts"]["scheme"]) == (0.002, "compensated")
    assert answer["files"] == ["c/controller.h", "c/controller.c"]
    assert "0.002" in (tmp_path / "c" / "controller.h").read_text()
    assert run(*command)[0] == 2
    code, out, _ = run(*command, "--force", "--feedforward", "centred", "--differentiator-bound", "100")
    assert code == 0
    assert "premise differentiator" in out
    assert {p.name for p in tmp_path.iterdir()} == {"c"}


BAD = {
    "feed-forward of a linear law": (*SHORT, "--controller", "elqr", "--feedforward", "nominal"),
    "unknown feed-forward": (*SHORT, "--controller", "cta", "--feedforward", "magic"),
    "no substeps": (*SHORT, "--controller", "cta", "--scheme", "explicit", "--substeps", "0"),
    "substeps of the continuous scheme": (*SHORT, "--controller", "cta", "--substeps", "2"),
    "a sliding mode with an adaptive method": (*SHORT, "--controller", "cta", "--method", "cvodes"),
    "code as a perturbation": (*SHORT, "--perturbation", "__import__('os')"),
    "a rate that is not measured": (
        *(*SHORT, "--controller", "cta", "--scheme", "explicit"),
        *("--rate-noise-deviation", "1e-3", "--differentiator-bound", "1"),
    ),
    "a filter without a differentiator": (*SHORT, "--controller", "cta", "--scheme", "explicit", "--filter-order", "1"),
    "options of the natural earthquake": ("simulate", "lab-fault", "--drift", "1e-9"),
    "no designed 2-DIA or no such gains": ("export", "lab-fault", "--controller", "dia", "--gains", "1", "2"),
    "a scheme that does not sample": ("export", "lab-fault", "--controller", "cta", "--scheme", "continuous"),
    "a study of nothing": ("sampling", "lab-fault", "--controller", "pid"),
    "a scale that is no number": ("sampling", "lab-fault", "--gains", "published", "--scale", "much"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line_and_code_two(case, run, tmp_path):
    code, out, err = run(*BAD[case])
    assert (code, out) == (2, "")
    assert len(err.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
