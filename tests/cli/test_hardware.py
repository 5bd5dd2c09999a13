"""Actuators and sensors on the command line: units, results with units, and what is refused in one line."""

import json

import numpy as np
import pytest
import xarray as xr

from quakedesign.cli import main
from quakedesign.parallel import SerialExecutor, UserExecutor
from quakedesign.simulation.campaign import running


def no_number(text):
    raise AssertionError(f"JSON has {text}")


def strict(text):
    """JSON without NaN and Infinity."""
    return json.loads(text, parse_constant=no_number)


@pytest.fixture
def run(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        with pytest.raises(SystemExit) as stop:
            main(list(arguments))
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


SHORT = ("simulate", "lab-fault", "--controller", "cta", "--duration", "200 ms", "--scheme", "explicit")
PUMP = ("--delay", "2 ms", "--quantum", "1 Pa", "--saturation", "20 kPa", "--withdrawal", "5 kPa", "--rate-limit")
ROCK = ("--lag", "2 ms", "--diffusion", "50 ms", "--storage", "1e-9 m^3/Pa", "--cells", "2")


def test_an_actuator_in_units_gives_volume_and_flow_rate_in_units(run, tmp_path):
    code, out, _ = run(*SHORT, *PUMP, "1 MPa/s", *ROCK, "--out", "run.nc", "--json")
    answer = strict(out)
    assert code == 0
    told = answer["run"]["actuator"]
    for stage in (
        "Delay(samples=2, jitter=0, seed=0, part=0.0)",
        "Quantisation(quantum=1.0)",
        "Saturation(lowest=-5000.0, highest=20000.0)",
        "RateLimit(rate=1000000.0)",
        "Lag(time_constant=0.002)",
    ):
        assert stage in told
    metrics, units = answer["metrics"], answer["units"]
    assert (units["max_injected_volume"], units["max_flow_rate"], units["rms_pressure"]) == ("m^3", "m^3/s", "Pa")
    assert set(units) == set(metrics)
    assert -5e3 <= metrics["min_well_pressure"] < 0 <= metrics["max_well_pressure"] <= 2e4
    assert 1e-9 * metrics["min_well_pressure"] <= metrics["min_injected_volume"] < 0
    with xr.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as data:
        assert data.flow_rate.attrs["units"] == "m^3/s"
        assert float(data.injected_volume.min()) == metrics["min_injected_volume"]
        assert np.all(data.well_pressure[:2] == 0)


@pytest.mark.slow
def test_jitter_steps_of_a_reading_and_of_a_differentiator_are_those_of_python(run):
    late = ("--delay", "1 ms", "--jitter", "1")
    read = ("--differentiator-bound", "1e4", "--slip-quantum", "0.15 um", "--differentiator-steps", "10")
    told = strict(run(*SHORT, *late, *read, "--json")[1])["run"]
    again = strict(run(*SHORT, *late, *read, "--seed", "1", "--json")[1])["run"]
    assert "Delay(samples=1, jitter=1, seed=" in told["actuator"] != again["actuator"]
    for part in ("quantum=1.5e-07", "inner_steps=10"):
        assert part in told["measurement"]
    for alone, said in (
        (("--jitter", "1"), "jitter needs delay"),
        (("--slip-quantum", "1 um"), "the quantum of the slip needs a differentiator"),
        (("--differentiator-steps", "2"), "the number of inner steps needs a differentiator"),
    ):
        code, _, err = run(*SHORT, *alone)
        assert code == 2
        assert said in err


def test_a_bare_number_is_in_si_units(run):
    given = [("--saturation", "0.02 MPa", "--lag", "2 ms", "--drift", "1 um/s", "--step", "1 ms")]
    given.append(("--saturation", "2e4", "--lag", "0.002", "--drift", "1e-6", "--step", "1e-3"))
    found = [strict(run(*SHORT, *options, "--json")[1]) for options in given]
    for answer in found:
        answer["metrics"].pop("seconds")
    assert found[0]["metrics"] == found[1]["metrics"]
    assert found[0]["run"]["actuator"] == found[1]["run"]["actuator"]


def test_people_see_the_units_of_what_flows(run):
    code, out, _ = run(*SHORT, *ROCK)
    assert code == 0
    lines = {line.split(" = ")[0].strip(): line for line in out.splitlines() if " = " in line}
    assert lines["max_injected_volume"].endswith(" m^3")
    assert lines["min_flow_rate"].endswith(" m^3/s")
    assert "premise on_trajectory: nothing is certified" in out


@pytest.mark.parametrize(("command", "kind", "other"), [
    ("simulate", "Standard deviation of Gaussian noise", "--slip-noise of guarantee and design is a bound"),
    ("campaign", "Standard deviation of Gaussian noise", "--slip-noise of guarantee and design is a bound"),
    ("guarantee", "Bound of the measurement error of the slip", "--slip-noise-deviation of simulate"),
    ("design", "Bound of the measurement error of the slip", "--slip-noise-deviation of simulate"),
])  # fmt: skip
def test_help_says_which_kind_of_number_noise_is(command, kind, other, capsys):
    with pytest.raises(SystemExit):
        main([command, "--help"])
    said = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert kind in said
    assert other in said


def test_noise_has_units_and_a_seed(run):
    noisy = (*SHORT, "--slip-noise-deviation", "1 um", "--rate-noise-deviation", "1 mm/s", "--json")
    found = {seed: strict(run(*noisy, "--seed", seed)[1]) for seed in ("0", "1")}
    assert "slip_noise=1e-06, rate_noise=0.001, seed=1" in found["1"]["run"]["measurement"]
    assert found["0"]["metrics"]["max_slip_error"] != found["1"]["metrics"]["max_slip_error"]


def test_transducer_mean_and_differentiator_are_a_chain(run):
    seen = (
        "--slip-noise-deviation",
        "0.1 um",
        "--bandwidth",
        "200 Hz",
        "--averaging",
        "3",
        "--differentiator-bound",
        "100",
    )
    answer = strict(run(*SHORT, *seen, "--json")[1])
    told = answer["run"]["measurement"]
    assert told.index("bandwidth=200.0") < told.index("Averaging(samples=3)")
    assert [p["name"] for p in answer["premises"]] == ["on_trajectory", "differentiator"]


def test_a_mean_goes_into_an_exported_controller(run, tmp_path):
    mean = ("--averaging", "3", "--differentiator-bound", "100 m/s^2")
    sizes = {}
    for options in (mean, mean[2:]):
        code, out, _ = run("export", "lab-fault", *options, "--out", "c", "--force", "--json")
        assert code == 0
        sizes[options] = len(strict(out)["memory"])
    assert sizes[mean] >= sizes[mean[2:]]


@pytest.mark.slow
def test_a_campaign_takes_the_same_options(run, monkeypatch, tmp_path):
    monkeypatch.setattr(running, "crew_of", lambda *_: UserExecutor(SerialExecutor()))
    options = (
        "--saturation",
        "20 kPa",
        *ROCK,
        "--slip-noise-deviation",
        "1 um",
        "--feedforward",
        "nominal",
        "--drift",
        "1 um/s",
    )
    command = ("campaign", "lab-fault", "--samples", "3", "--duration", "50 ms", "--scale", "100", *options)
    code, out, _ = run(*command, "--rerun", "1", "--json")
    answer = strict(out)
    assert code == 0
    highest = answer["quantiles"]["max_flow_rate"]["1"]
    assert highest > 0
    assert answer["worst"]["max_injected_volume"][0]["value"] <= 1e-9 * 2e4
    again = answer["rerun"]["metrics"]
    told = next(entry for entry in answer["worst"]["max_flow_rate"] if entry["index"] == 1)
    assert again["max_flow_rate"] == told["value"]
    assert "max_flow_rate [m^3/s]" in (tmp_path / "quakedesign-lab-fault-campaign" / "samples.csv").read_text()
    code, out, _ = run(*command)
    assert code == 0
    assert "m^3/s" in out


# What happens is named with its time, whatever causes it, and no JSON has a number that is none.
EVENTS = {
    "divergence of gains that sampling makes unstable (ERRATA 22)": (
        ("real-fault", "--controller", "elqr", "--scheme", "explicit", "--duration", "400", "--plant", "printed"),
        ("opening", "reverse_slip", "diverged"),
    ),
    "divergence behind an actuator": (
        (
            *("real-fault", "--controller", "elqr", "--scheme", "explicit", "--duration", "400"),
            *("--rate-limit", "1e99", "--plant", "printed"),
        ),
        ("opening", "reverse_slip", "diverged"),
    ),
    "opening with estimates, and divergence in the run without that their premise needs": (
        (
            *("lab-fault", "--controller", "elqr", "--scheme", "explicit", "--step", "2 ms", "--duration", "1"),
            *("--differentiator-bound", "1e6", "--plant", "printed"),
        ),
        ("opening", "reverse_slip"),
    ),
    "opening by a push that only injection can balance": (
        ("real-fault", "--controller", "elqr", "--duration", "60", "--perturbation", "-0.1*time", "--plant", "printed"),
        ("opening", "reverse_slip"),
    ),
    "opening by gains alone": (
        (
            *("lab-fault", "--controller", "elqr", "--gains", "1e12", "1e9", "1e9", "1e7", "--duration", "2"),
            *("--scheme", "explicit", "--saturation", "1 MPa", "--plant", "printed"),
        ),
        ("opening", "reverse_slip"),
    ),
    "reverse slip by a push": (
        ("real-fault", "--duration", "5 s", "--perturbation", "-1e-3", "--plant", "printed"),
        ("reverse_slip",),
    ),
    "rest": (
        ("real-fault", "--duration", "5 s", "--perturbation", "-1e-3"),
        ("stick",),
    ),
    "a load beyond what friction carries backward": (
        ("real-fault", "--duration", "5 s", "--perturbation=-9*time"),
        ("stick", "load_reversed"),
    ),
}


@pytest.mark.parametrize("cause", EVENTS)
def test_what_happened_is_named_with_its_time_and_every_number_is_one(cause, run, tmp_path):
    arguments, expected = EVENTS[cause]
    code, out, _ = run("simulate", *arguments, "--out", "run.nc", "--json")
    answer = strict(out)
    assert code == 0
    assert set(expected) <= set(answer["events"])
    end = answer["events"].get("diverged", answer["run"]["step"] * answer["steps"])
    assert all(0 < time <= end + 1e-9 for time in answer["events"].values())
    assert (answer["metrics"]["peak_slip_rate"] is None) == ("diverged" in answer["events"])
    with xr.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as data:
        assert all(np.all(np.isfinite(values)) for values in data.values())
        assert strict(data.attrs["events"]) == answer["events"]


def test_people_are_told_what_happened_and_when(run):
    arguments, expected = next(iter(EVENTS.values()))
    events = strict(run("simulate", *arguments, "--json")[1])["events"]
    code, said, _ = run("simulate", *arguments)
    assert code == 0
    assert all(f"{name} first at {events[name]:.6g} s" in said for name in expected)
    assert "nan" not in said.lower().split()


BAD = {
    "an actuator without samples": (*SHORT[:-2], "--saturation", "20 MPa"),
    "a unit of another dimension": (*SHORT, "--saturation", "20 s"),
    "an unknown unit": (*SHORT, "--lag", "2 foo"),
    "no number": (*SHORT, "--lag", "long"),
    "not a number": (*SHORT, "--quantum", "nan"),
    "an angular frequency": (*SHORT, "--bandwidth", "3 rad/s", "--differentiator-bound", "1"),
    "a delay of no periods": (*SHORT, "--step", "0", "--delay", "1"),
    "a storage of nothing": (*SHORT, "--storage", "1"),
    "a withdrawal of nothing": (*SHORT, "--withdrawal", "1"),
    "a mean of nothing": (*SHORT, "--averaging", "3"),
    "a negative saturation": (*SHORT, "--saturation", "-1"),
    "a lag that steps are too long for": (*SHORT, "--lag", "10 us"),
    "an actuator of the natural earthquake": ("simulate", "lab-fault", "--lag", "1"),
    "a step of the wrong unit": ("campaign", "lab-fault", "--samples", "2", "--step", "1 m"),
    "an actuator of a continuous campaign": (
        *("campaign", "lab-fault", "--samples", "2", "--scheme", "continuous", "--lag", "1"),
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line_and_code_two(case, run, tmp_path):
    code, out, err = run(*BAD[case])
    assert (code, out) == (2, "")
    assert len(err.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
