"""``simulate`` of faults whose friction has a state: outcome first, and one line for what does not apply."""

import json

import pytest

from quakedesign.cli import main

TEXT = """
name = "patch"
source = "of the tests"
density = "2500 kg/m^3"
shear_modulus = "30 GPa"
length = "5 km"
damping = "5e14 kg/s"
effective_normal_stress = "50 MPa"

[friction]
law = "rate-and-state-aging"
reference_coefficient = 0.6
direct_effect = 0.010
evolution_effect = 0.015
critical_slip = "20 mm"
reference_rate = "1e-9 m/s"
slowest_rate = "1e-14 m/s"
fastest_rate = "1 m/s"
stress_sensitivity = 0.1

[task]
target_slip = "785 mm"
operation_time = "184 hour"
sampling_time = "40 s"
"""
QUASI = ("--plant", "quasi-dynamic", "--method", "dop853")


@pytest.fixture
def patch(tmp_path):
    path = tmp_path / "patch.toml"
    path.write_text(TEXT)
    return str(path)


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as stop:
        main(list(arguments))
    told = capsys.readouterr()
    return stop.value.code, told.out, told.err


def test_a_pressure_step_that_makes_an_earthquake_is_said_first(capsys, patch, tmp_path):
    out = tmp_path / "run.nc"
    course = ("--pressure", "0 s: 0 MPa, 30 day: 0 MPa, 30 day: 20 MPa", "--duration", "1 year")
    code, said, _ = run(capsys, "simulate", patch, *QUASI, *course, "--out", str(out))
    assert code == 0
    assert said.splitlines()[1].strip().startswith("earthquake: peak slip rate")
    assert out.exists()
    found = json.loads(run(capsys, "simulate", patch, *QUASI, *course, "--json")[1])
    assert found["outcome"]["kind"] == "earthquake"
    assert found["outcome"]["peak_slip_rate"] > found["outcome"]["earthquake_from"]
    assert found["pressure"] == [0.0, 20e6]
    (event,) = found["slip_events"]
    assert event["onset"] >= 30 * 86400.0
    assert found["cycle"]["magnitude"] == event["magnitude"]
    assert found["cycle"]["recurrence_interval"] is None


def test_steady_sliding_that_nothing_disturbs_is_said_to_be_so(capsys, patch):
    code, said, _ = run(capsys, "simulate", patch, *QUASI)
    assert code == 0
    assert "creep: " in said
    assert "nothing disturbs it" in said


def test_a_locked_fault_starts_with_an_aged_state(capsys, patch):
    given = ("--start", "locked", "--hold", "10 year", "--drift", "3 cm/year", "--duration", "1 day", "--json")
    found = json.loads(run(capsys, "simulate", patch, *QUASI, *given)[1])
    assert found["loading_rate"] == pytest.approx(0.03 / 31557600, rel=1e-12)
    assert found["start"]["state"]["theta"] > 5 * 0.02 / found["loading_rate"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("--controller", "cta"), "sliding modes do not apply"),
        (("--controller", "elqr", "--gains", "1", "2"), "designed gains"),
        (
            ("--controller", "elqr", "--rate-noise-deviation", "1 um/s"),
            "rate_noise cannot be used for friction with a state in a run with control",
        ),
        (
            ("--controller", "elqr", "--storage", "1e-4 m^3/Pa"),
            "storage cannot be used for friction with a state in a run with control",
        ),
        (("--controller", "elqr", "--start", "late"), "are for runs without a controller"),
        (
            ("--controller", "elqr", "--drift", "1e-9"),
            "drift cannot be used for friction with a state in a run with control",
        ),
        (("--controller", "elqr", "--method", "radau"), "method must be one of"),
        (
            ("--diffusion", "10 s"),
            "diffusion cannot be used for friction with a state in a run without control",
        ),
        (("--stress", "1 kPa"), "need a controller"),
        (("--saturation", "1 MPa"), "saturation cannot be used for friction with a state"),
        (("--plant", "stick-slip"), "one of smooth, quasi-dynamic"),
        (("--start", "early"), "one of steady, locked, late"),
        (("--start", "locked"), "Give --hold"),
        (("--hold", "1 year"), "hold cannot be used with the start steady"),
        (("--pressure", "50 MPa"), "opens"),
        (("--drift=-1e-9",), "loading_rate must be positive"),
        (("--method", "rk4"), "method must be one of"),
    ],
)
def test_what_does_not_apply_is_refused_in_one_line(capsys, patch, given, said):
    code, out, err = run(capsys, "simulate", patch, *given)
    assert (code, out) == (2, "")
    assert said in err
    assert len(err.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (("sampling",), "a study of sampling needs a friction law of slip and slip rate alone"),
        (
            ("guarantee", "--controller", "cta"),
            "sliding modes do not apply, since the slip rate responds",
        ),
    ],
)
def test_commands_that_do_not_apply_say_why(capsys, patch, command, said):
    code, out, err = run(capsys, command[0], patch, *command[1:])
    assert (code, out) == (2, "")
    assert said in err


def test_a_controlled_run_says_that_it_tracks(capsys, patch, tmp_path):
    out = tmp_path / "run.nc"
    given = ("--controller", "elqr", "--plant", "quasi-dynamic", "--duration", "1 hour", "--step", "100 s")
    more = ("--diffusion", "500 s", "--stress", "10 kPa", "--stress-period", "1 hour")
    code, said, _ = run(capsys, "simulate", patch, *given, *more, "--out", str(out))
    assert code == 0
    assert said.splitlines()[1].strip().startswith("tracked: peak slip rate")
    assert "through a diffusion path of L^2/D = 500 s" in said
    assert "no guarantee" in said
    assert out.exists()
    found = json.loads(run(capsys, "simulate", patch, *given, *more, "--json")[1])
    assert found["outcome"]["kind"] == "tracked"
    assert found["outcome"]["peak_slip_rate"] < found["outcome"]["earthquake_from"]
    assert found["reference_rate"] == pytest.approx(0.785 / (184 * 3600), rel=1e-12)
    assert found["stress"] == pytest.approx(1e4, rel=1e-3)
    assert 0 < found["metrics"]["max_log_rate"] < 0.1


def test_a_controlled_run_goes_through_pump_and_transducer(capsys, patch):
    given = ("--controller", "elqr", "--plant", "quasi-dynamic", "--duration", "20 min", "--step", "100 s", "--json")
    more = ("--delay", "100 s", "--saturation", "1 MPa", "--slip-quantum", "1 um", "--stress", "10 kPa")
    plain = json.loads(run(capsys, "simulate", patch, *given, "--stress", "10 kPa")[1])
    found = json.loads(run(capsys, "simulate", patch, *given, *more)[1])
    assert (plain["stages"], found["stages"]) == ([], ["delay", "saturation"])
    assert plain["metrics"] != found["metrics"]
    noisy = [
        json.loads(run(capsys, "simulate", patch, *given, "--slip-noise-deviation", "1 um", "--seed", s)[1])
        for s in "01"
    ]
    assert noisy[0]["metrics"] != noisy[1]["metrics"]
    told = run(capsys, "simulate", patch, *given[:-1], *more)[1]
    assert "through a delay, through a saturation" in told


def test_a_disturbance_of_acceleration_is_not_ignored(capsys, patch, tmp_path):
    path = tmp_path / "shaken.toml"
    path.write_text(TEXT + '\n[disturbance]\namplitude = "1e-4 m/s^2"\n')
    code, _, err = run(capsys, "simulate", str(path))
    assert code == 2
    assert "is disturbed by a pressure or a shear stress alone" in err


def test_friction_without_a_state_has_no_use_for_such_options(capsys):
    code, _, err = run(capsys, "simulate", "lab-fault", "--start", "late")
    assert code == 2
    assert "need friction with a state" in err
