"""What is typed after an option becomes the value that the package is given."""

import json
import math
from dataclasses import FrozenInstanceError, dataclass, replace
from fractions import Fraction as F
from types import SimpleNamespace
from typing import get_args

import pytest

from quakedesign.cli import main, options
from quakedesign.cli.options import (
    ActuatorOptions,
    EstimateOptions,
    LawOptions,
    NoLawOptions,
    Output,
    RunOptions,
    SensorOptions,
    SetupOptions,
    SpreadOptions,
    StartOptions,
    StateOptions,
)
from quakedesign.errors import ParameterError, QuakedesignError, UnitError
from quakedesign.fault import load_fault
from quakedesign.loop import Delay, Diffusion, Lag, Saturation
from quakedesign.loop.actuators.base import Option
from quakedesign.loop.sensing import Measurement, OutputFeedback, Transducer
from quakedesign.studies import single_runs as runs

LAB, CRUSTAL = load_fault("lab-fault"), load_fault("crustal-patch")


def tokens(*texts, keyword="--initial-slip"):
    return [SimpleNamespace(value=text, keyword=keyword) for text in texts]


@pytest.mark.parametrize(
    ("read", "text", "value"),
    [
        (options.quantity("m"), "7.5 mm", 0.0075),
        (options.quantity("m"), "0.5", 0.5),
        (options.quantity("Hz"), "2 kHz", 2000.0),
        (options.quantity("m/s"), "1 mm/s", 0.001),
        (options.whole, "12", 12),
        (options._exact_reader("s"), "7/50", "7/50"),
        (options._exact_reader("s"), "0.184", "0.184"),
        (options._exact_reader("s"), "184 ms", "0.184"),
    ],
)
def test_numbers_have_units_or_are_in_si(read, text, value):
    found = read(None, tokens(text))
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    ("read", "text", "said"),
    [
        (options.quantity("m"), "1 s", "initial slip"),
        (options.quantity("m"), "x", "initial slip"),
        (options.quantity("Hz"), "10 rad/s", r"initial slip must be a frequency in Hz. Received '10 rad/s'"),
        (options.whole, "1.5", r"initial slip must be a whole number. Received '1.5'"),
        (options._exact_reader("s"), "1 m", "initial slip"),
    ],
)
def test_what_is_no_number_is_refused_by_the_name_of_the_option(read, text, said):
    with pytest.raises(QuakedesignError, match=f"^{said}"):
        read(None, tokens(text))
    with pytest.raises(QuakedesignError, match=f"^{said.replace('initial slip', 'value')}"):
        read(None, tokens(text, keyword=None))


def test_radians_are_wrong_where_a_frequency_is_meant_alone():
    with pytest.raises(UnitError, match="Divide it by 2π"):
        options.in_unit("10 rad/s", "Hz", "bandwidth")
    with pytest.raises(UnitError) as wrong:
        options.in_unit("10 rad", "m", "slip")
    assert "2π" not in str(wrong.value)


def test_gains_are_a_word_or_exact_numbers():
    assert options._gains(None, tokens("designed")) == ("designed",)
    assert options._gains(None, tokens("1.5", "7/2")) == ("1.5", "7/2")
    for texts, place in ((("x", "2"), 1), (("1", "x"), 2)):
        with pytest.raises(ParameterError, match=f"^gain k{place} "):
            options._gains(None, tokens(*texts))


@pytest.mark.parametrize(
    ("given", "value"),
    [
        ((None, None, None), None),
        (("3", None, None), "3"),
        ((None, "40", "0.5"), "3200"),
        (("0", "40", "0.5"), "3200"),
        ((None, "1/2", "0.1"), "5/2"),
    ],
)
def test_diffusion_is_the_square_of_the_distance_over_the_diffusivity(given, value):
    assert options.diffusion_time(*given) == value


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("3", "40", "0.5"), r"Received --well of 40 m and --diffusivity of 0.5 m\^2/s and --diffusion of 3 s\. Give"),
        ((None, "40", None), r"Received --well of 40 m alone\. Give"),
        (("0", "40", None), r"Received --well of 40 m alone\. Give"),
        ((None, None, "0.5"), r"Received --diffusivity of 0.5 m\^2/s alone\. Give"),
        (("3", None, "0.5"), r"Received --diffusivity of 0.5 m\^2/s and --diffusion of 3 s\. Give"),
        ((None, "0", "0.5"), "must be positive"),
        ((None, "40", "0"), "must be positive"),
        ((None, "-1", "0.5"), "must be positive"),
        ((None, "40", "-1/2"), "must be positive"),
        ((None, "x", "1"), "^well "),
        ((None, "1", "x"), "^diffusivity "),
    ],
)
def test_a_well_that_is_none_is_refused(given, said):
    with pytest.raises(ParameterError, match=said):
        options.diffusion_time(*given)


def test_a_setup_is_made_of_what_is_given():
    assert SetupOptions().setup() == options.IDEAL
    found = SetupOptions(step="0.184", delay="0.02", well="40", diffusivity="0.5", lag="1/2").setup(measured="slip")
    assert found == options.IDEAL.with_given(delay="0.02", diffusion="3200", lag="1/2", step="0.184", measured="slip")


# Output


@pytest.mark.parametrize(
    ("given", "heard"),
    [
        ({}, None),
        ({"quiet": True}, {"quiet": True, "level": "warning"}),
        ({"log_level": "info"}, {"quiet": False, "level": "info"}),
    ],
)
def test_output_is_set_where_it_is_asked_for(monkeypatch, given, heard):
    calls = []
    monkeypatch.setattr(options, "set_output", lambda **told: calls.append(told))
    Output(**given)
    assert calls == ([] if heard is None else [heard])


@pytest.mark.parametrize("given", [{}, {"no_cache": True}, {"allow_code": True}])
def test_the_cache_is_switched_off_and_code_allowed_where_that_is_asked_for(monkeypatch, given):
    calls = []
    monkeypatch.setattr("quakedesign.cache.switch_off", lambda: calls.append("no_cache"))
    monkeypatch.setattr("quakedesign.discovery.allow_code", lambda allowed: calls.append(("allow_code", allowed)))
    Output(**given)
    assert calls == [name if name == "no_cache" else (name, True) for name in given]


def test_an_answer_is_json_or_lines_or_what_prints_itself(capsys):
    for said in (["one", "two"], lambda: print("one\ntwo")):
        Output().show({"a": 1}, said)
        assert capsys.readouterr().out == "one\ntwo\n"
        Output(json=True).show({"a": 1}, said)
        assert json.loads(capsys.readouterr().out) == {"a": 1}


# Laws and runs


@pytest.fixture
def choices(monkeypatch):
    """What the law of a command is chosen with."""
    monkeypatch.setattr(runs, "optional_choice", lambda *given, **more: (given, more))
    monkeypatch.setattr(runs, "certified_choice", lambda fault, path: (fault.name, path))


@pytest.mark.usefixtures("choices")
def test_a_law_is_chosen_by_its_options_or_by_its_certificate():
    law = LawOptions(controller="dia", gains=("1", "2"), scale="3", feedforward="nominal")
    more = {"scale": "3", "feedforward": "nominal", "step": 0.1, "path": {"lag": 1.0}}
    assert law.choose(LAB, 0.1, {"lag": 1.0}) == ((LAB, "dia", ("1", "2")), more)
    for law in (
        LawOptions(certificate="a"),
        NoLawOptions(certificate="a"),
        LawOptions(certificate="a", controller="elqr"),
    ):
        assert law.choose(LAB) == ("lab-fault", "a")
    assert NoLawOptions().choose(LAB)[0] == (LAB, "none", ("published",))


@pytest.mark.usefixtures("choices")
@pytest.mark.parametrize(
    ("kind", "wrong", "received"),
    [
        (LawOptions, {"controller": "dia"}, "--controller dia with a"),
        (LawOptions, {"controller": "none"}, "--controller none with a"),
        (NoLawOptions, {"controller": "cta"}, "--controller cta with a"),
        (LawOptions, {"gains": ("1", "2")}, "--gains 1 2 with a"),
        (LawOptions, {"controller": "elqr", "scale": "1"}, "--scale 1 with a"),
        (LawOptions, {"feedforward": "nominal", "scale": "2"}, "--scale 2, --feedforward nominal with a"),
    ],
)
def test_a_certificate_holds_its_law(kind, wrong, received):
    with pytest.raises(ParameterError, match=rf"--certificate contains the law\. Received {received}\."):
        kind(certificate="a", **wrong).choose(LAB)


def test_loads_start_and_target_are_those_that_are_given():
    assert RunOptions().load().drift == 0.0
    assert RunOptions().load().perturbation is None
    load = RunOptions(drift=0.5, perturbation="2*time").load()
    assert load.drift == 0.5
    assert load.perturbation is not None
    assert StartOptions().state() == {}
    assert StartOptions(initial_slip=1e-3).state() == {"initial_slip": 1e-3}
    assert StartOptions(initial_slip_rate=-1.0).state() == {"initial_slip_rate": -1.0}
    assert StartOptions().task(LAB) is LAB
    assert StartOptions(target_slip=0.5).task(LAB).reference == replace(LAB.reference, target_slip=0.5)


# Actuator and sensors


def test_a_law_is_designed_for_the_times_that_are_given():
    assert ActuatorOptions().path() == {}
    assert ActuatorOptions(delay=0.1, lag=2.0, diffusion=3.0, saturation=1e6).path() == {
        "delay": 0.1,
        "lag": 2.0,
        "diffusion": 3.0,
    }


def test_an_option_of_a_stage_has_its_unit_and_may_be_left_out_where_it_has_no_default():
    for unit, default, text, value in (
        ("s", None, "20 ms", 0.02),
        ("s", 1.0, "20 ms", 0.02),
        ("", None, "8", 8),
        ("", 4, "8", 8),
    ):
        option = Option(name="lag", unit=unit, help="A time.", default=default)
        kind, parameter = get_args(options._annotation(option))
        plain = int if unit == "" else float
        assert kind == (plain | None if default is None else plain)
        assert parameter.converter(None, tokens(text)) == value
        assert parameter.help == "A time."
        if unit == "":
            with pytest.raises(ParameterError, match="must be a whole number"):
                parameter.converter(None, tokens("0.5"))


@pytest.mark.parametrize(
    ("added", "usual"), [(options.of_the_setup("delay"), None), (options._with_stage_options, 0.0)]
)
def test_options_are_added_to_a_class_whose_values_are_frozen_and_named(added, usual):
    @dataclass(frozen=True, kw_only=True)
    class Plain:
        """Plain."""

    made = added(Plain)
    assert (made.__name__, made.__doc__, made.__module__) == ("Plain", "Plain.", __name__)
    assert made(delay="3").delay == "3"
    assert made().delay == usual
    with pytest.raises(FrozenInstanceError):
        made().delay = "3"
    with pytest.raises(TypeError):
        made("3")


def test_an_exact_option_may_be_left_out():
    kind, parameter = get_args(options._exact_option("s", "A time."))
    assert kind == str | None
    assert (parameter.converter(None, tokens("20 ms")), parameter.help) == ("0.02", "A time.")


def test_a_stage_without_options_is_for_python_alone(monkeypatch):
    known = {"none": SimpleNamespace(options=()), **options.stages()}
    monkeypatch.setattr(options, "stages", lambda: known)
    assert ActuatorOptions(lag=1.0).build(0.1).stages == (Lag(time_constant=1.0),)


def test_nothing_is_added_unless_it_is_asked_for():
    told = {"averaging": 1, "differentiator_order": 1, "filter_order": 0, "differentiator_steps": 1}
    assert EstimateOptions().values() == told | {"differentiator_bound": None}
    assert (RunOptions().substeps, RunOptions().step, RunOptions().scheme) == (1, None, None)


def test_jitter_has_the_seed_of_the_run():
    plain = ActuatorOptions(delay=0.1, jitter=1).build(0.1)
    seeds = [stage.seed for seed in (0, 3, 4) for stage in ActuatorOptions(delay=0.1, jitter=1).build(0.1, seed).stages]
    assert len(set(seeds)) == 3
    assert plain.stages[0].seed == seeds[0]
    assert ActuatorOptions(lag=1.0).build(0.1, 3).stages == (Lag(time_constant=1.0),)


def test_a_stage_is_made_of_its_options_and_no_part_stands_alone():
    told = ActuatorOptions(diffusion=2.0, storage=3.0).values()
    assert options._stage(Delay, told, 0.1) is None
    assert options._stage(Diffusion, told, 0.1).storage == 3.0
    with pytest.raises(
        ParameterError, match=r"^storage needs diffusion\. Received storage 3 .* alone\. Add diffusion, or omit storage"
    ):
        options._stage(Diffusion, ActuatorOptions(storage=3.0).values(), 0.1)
    assert options._stage(Diffusion, ActuatorOptions().values(), 0.1) is None


@pytest.mark.parametrize(("order", "text", "value"), [(1, "2", 2.0), (1, "3 mm/s^2", 0.003), (2, "3 mm/s^3", 0.003)])
def test_the_bound_of_a_differentiator_has_the_unit_of_its_order(order, text, value):
    found = EstimateOptions(differentiator_bound=text, differentiator_order=order)
    assert found.bound == value
    told = found.values()
    assert (told["differentiator_bound"], told["averaging"], told["differentiator_order"]) == (value, 1, order)
    assert EstimateOptions().bound is None
    with pytest.raises(UnitError, match="differentiator bound"):
        EstimateOptions(differentiator_bound="3 mm/s^3", differentiator_order=1).values()


def test_a_sensor_is_made_of_its_options():
    assert SensorOptions().build(0.1) == Measurement()
    assert SensorOptions(slip_noise=1e-6, rate_noise=1e-5).build(0.1, 3) == Measurement(
        slip_noise=1e-6, rate_noise=1e-5, seed=3
    )
    assert SensorOptions(slip_noise=1e-6).build(0.1) == Measurement(slip_noise=1e-6, seed=0)
    told = {
        "averaging": 2,
        "differentiator_bound": "4",
        "differentiator_order": 2,
        "filter_order": 3,
        "differentiator_steps": 5,
    }
    found = SensorOptions(**told, slip_noise=1e-6, bandwidth=100.0, slip_quantum=1e-7).build(0.1, 3)
    same = runs.sensor(
        0.1,
        Measurement(slip_noise=1e-6, seed=3),
        4.0,
        3,
        order=2,
        bandwidth=100.0,
        averaging=2,
        quantum=1e-7,
        inner_steps=5,
    )
    assert isinstance(found, OutputFeedback)
    assert found == same
    slow = runs.sensor(0.1, Measurement(), 4.0, bandwidth=math.inf)
    assert SensorOptions(differentiator_bound="4").build(0.1) == slow


def test_what_a_law_is_designed_for_stands_where_nothing_is_given(monkeypatch):
    free = options.loop_elements(None, 0.1, RunOptions(substeps=3), ActuatorOptions(lag=1.0), SensorOptions(), 2)
    assert free == (3, ActuatorOptions(lag=1.0).build(0.1), Measurement(seed=2))
    law = SimpleNamespace(controller=object(), noise=lambda seed: ("noise of the proof", seed))
    meant = ActuatorOptions(delay=0.1).build(0.1)
    path = "quakedesign.simulation.run_settings.designed_path"
    monkeypatch.setattr(path, lambda *given: (meant, 7) if given[0] else None)
    assert options.loop_elements(law, 0.1, RunOptions(), ActuatorOptions(), SensorOptions(), 2) == (
        7,
        ActuatorOptions().build(0.1).completed(meant),
        ("noise of the proof", 2),
    )
    noisy = options.loop_elements(law, 0.1, RunOptions(), ActuatorOptions(), SensorOptions(slip_noise=1e-6), 2)
    assert noisy[2] == Measurement(slip_noise=1e-6, seed=2)
    monkeypatch.setattr("quakedesign.simulation.run_settings.designed_path", lambda *_: (None, 1))
    pump = ActuatorOptions(saturation=1e6)
    assert options.loop_elements(law, 0.1, RunOptions(), pump, SensorOptions(), 0)[1] == pump.build(0.1)


# Friction with a state


@pytest.mark.parametrize("given", [{"pressure": "1 MPa"}, {"start": "steady"}, {"hold": 1.0}, {"share": 0.5}])
def test_a_controlled_run_sets_pressure_and_start_itself(given):
    with pytest.raises(ParameterError, match=f"are for runs without a controller. Received --{next(iter(given))} with"):
        StateOptions(**given).of_control()
    assert StateOptions(**given).of_free().keys() == given.keys()
    with pytest.raises(ParameterError, match=r"need friction with a state\. Received exponential-slip-weakening"):
        options.require_no_state_options(StateOptions(**given), LAB)


@pytest.mark.parametrize("given", [{"stress": 1e3}, {"stress_period": 60.0}, {"stress": 0.0, "stress_period": 1.0}])
def test_a_stress_needs_a_controller(given):
    assert StateOptions(**given).of_control() == given
    with pytest.raises(ParameterError, match="--stress and --stress-period need a controller"):
        StateOptions(**given).of_free()


def test_nothing_is_nothing():
    assert StateOptions().of_control() == StateOptions().of_free() == {}
    assert options.require_no_state_options(StateOptions(), LAB) is None


@pytest.mark.parametrize(
    ("controller", "gains", "accepted"),
    [
        ("elqr", ("published",), True),
        ("elqr", ["designed"], True),
        ("elqr", ("continuous",), False),
        ("elqr", ("1", "2"), False),
        ("cta", ("designed",), False),
    ],
)
def test_a_designed_elqr_alone_controls_friction_with_a_state(controller, gains, accepted):
    told = {"controller": controller, "gains": gains}
    if accepted:
        assert options._require_designed(told) is None
    else:
        with pytest.raises(ParameterError, match="friction with a state needs the controller elqr with designed gains"):
            options._require_designed(told)


def test_what_has_no_meaning_with_a_state_is_named():
    told = options._argument_names(CRUSTAL, {"drift": 1.0, "method": "idas", "json": True, "out": "a"}, options._FREE)
    assert told == {"loading_rate": 1.0, "method": "idas"}
    with pytest.raises(
        ParameterError,
        match=r"^scheme, averaging cannot be used for friction with a state in a run without control\.",
    ):
        options._argument_names(CRUSTAL, {"scheme": "explicit", "averaging": 2, "plant": "smooth"}, options._FREE)
    with pytest.raises(
        ParameterError,
        match=r"^drift cannot be used for friction with a state in a run with control\. .*, saturation and",
    ):
        options._argument_names(CRUSTAL, {"drift": 1.0}, options._CONTROLLED, ("saturation",))


def test_spread_and_stress_are_for_friction_with_a_state(monkeypatch):
    law = LawOptions(controller="none")
    monkeypatch.setattr(LawOptions, "choose", lambda *given: given[1:])
    assert SpreadOptions().choose(LAB, law, 0.1, {"lag": 1.0}) == ((LAB, 0.1, {"lag": 1.0}), {})
    for given in ({"spread": "0.1"}, {"stress": 1.0}, {"stress_period": 1.0}):
        with pytest.raises(ParameterError, match=r"^spread and stress need friction with a state\."):
            SpreadOptions(**given).choose(LAB, law, None, {})


@pytest.mark.parametrize(("controller", "sliding"), [(None, object()), (object(), None)])
def test_a_campaign_with_a_state_runs_what_is_designed(monkeypatch, controller, sliding):
    asked = {}

    def design(fault, name, **told):
        asked.update(told, fault=fault, name=name)
        return SimpleNamespace(controller=controller, sliding=sliding, details={"reason": "it does not stand"})

    monkeypatch.setattr("quakedesign.synthesis.design", design)
    chosen = SpreadOptions(spread="0.1", stress=5.0, stress_period=60.0)
    law = LawOptions(controller="elqr")
    with pytest.raises(ParameterError, match=r"needs a law\. Received a design without one: it does not stand\."):
        chosen.choose(CRUSTAL, law, None, {"diffusion": 2.0})
    assert asked == {
        "fault": CRUSTAL.with_box("paper"),
        "name": "elqr",
        "diffusion": 2.0,
        "stress": 5.0,
        "spread": F(1, 10),
    }
    controller = controller or object()
    sliding = SimpleNamespace(task=SimpleNamespace(stress=F(3)))
    found, told = chosen.choose(CRUSTAL, law, None, {})
    assert found.controller is controller
    assert told == {"spread": F(1, 10), "stress": 3.0, "stress_period": 60.0}
    assert SpreadOptions().choose(CRUSTAL, law, None, {})[1] == {"spread": 0, "stress": 3.0}
    with pytest.raises(ParameterError, match="needs the controller elqr"):
        chosen.choose(CRUSTAL, LawOptions(controller="cta"), None, {})


@pytest.mark.parametrize(
    ("delay", "noise", "refused"), [(F(0), F(0), False), (F(1), F(0), True), (F(0), F(1), True), (F(1), F(1), True)]
)
def test_a_campaign_runs_a_certificate_without_delay_and_noise(delay, noise, refused):
    held = SimpleNamespace(delay=delay, slip_noise=noise)
    task = SimpleNamespace(ranges={"direct_effect": (F(3), F(5))}, stress=F(7))
    claim = SimpleNamespace(sampled_loop=held, task=task)
    if refused:
        with pytest.raises(ParameterError, match=f"a delay of {delay} s and slip noise of {noise} m"):
            options._of_proof(claim, "0", None)
    else:
        assert options._of_proof(claim, "0", None) == {"spread": F(1, 4), "stress": 7.0}
        assert options._of_proof(claim, "1/8", 0.0) == {"spread": F(1, 8), "stress": 0.0}


@pytest.mark.parametrize(
    ("given", "noise", "quantum"),
    [(None, F(0), None), (None, F(1, 4), 0.5), ("own", F(0), "own"), ("own", F(1), "own")],
)
def test_a_reading_is_off_by_the_noise_of_the_proof_unless_a_transducer_is_given(monkeypatch, given, noise, quantum):
    held = SimpleNamespace(step=F(1, 2), slip_noise=noise)
    claim = SimpleNamespace(sampled_loop=held, task=SimpleNamespace(stress=F(3)))
    asked = {}
    monkeypatch.setattr(options, "_instruments", lambda _, told, __: asked.update(told) or {"transducer": given})
    command = {"law": SimpleNamespace(choose=lambda _: SimpleNamespace(claim=claim)), "state": StateOptions()}
    found = options._as_proved(CRUSTAL, "a.json", {"plant": "smooth"}, command)
    assert asked == {"plant": "smooth", "step": 0.5}
    assert (found["claim"], found["stress"], found["step"]) == (claim, 3.0, None)
    assert getattr(found["transducer"], "quantum", found["transducer"]) == quantum
    stressed = {**command, "state": StateOptions(stress=7.0)}
    assert options._as_proved(CRUSTAL, "a.json", {}, stressed)["stress"] == 7.0
    for name in ("step", "delay", "lag", "diffusion"):
        with pytest.raises(ParameterError, match=f"^{name} cannot be used with a.json, which specifies the loop"):
            options._as_proved(CRUSTAL, "a.json", {name: 1.0}, command)


@pytest.fixture
def run_with_state(monkeypatch, tmp_path, capsys):
    """Runs `simulate` on a fault with a state; returns what was run, with what, and what was said."""
    asked = {}

    def done(kind):
        saved = SimpleNamespace(name="the run", save=lambda path: path.write_text(kind))

        def run(_fault, **told):
            asked.clear()
            asked.update(told, kind=kind)
            return saved, {"kind": kind}

        return run

    for kind in ("sliding", "state"):
        monkeypatch.setattr(runs, f"run_{kind}", done(kind))
    for name in ("sliding_run_lines", "state_run_lines"):
        monkeypatch.setattr(f"quakedesign.report.sentences.{name}", lambda answer, name=name: [name, str(answer)])

    def call(*options):
        with pytest.raises(SystemExit) as end:
            main(["simulate", "crustal-patch", *options, "--out", str(tmp_path / "run.nc"), "--force"])
        return end.value.code, capsys.readouterr().out, asked, (tmp_path / "run.nc").read_text()

    return call


@pytest.mark.parametrize(
    ("given", "kind", "told"),
    [
        ((), "state", {}),
        (("--drift", "1 mm/s", "--hold", "2 s"), "state", {"loading_rate": 0.001, "hold": 2.0}),
        (("--controller", "elqr"), "sliding", {"stages": (), "transducer": None}),
        (("--controller", "elqr", "--seed", "3"), "sliding", {"stages": (), "transducer": None}),
        (
            ("--controller", "elqr", "--lag", "2 s", "--stress", "1 kPa"),
            "sliding",
            {"stages": (), "transducer": None, "lag": 2.0, "stress": 1e3},
        ),
        (
            ("--controller", "elqr", "--slip-noise-deviation", "1 um", "--seed", "3", "--saturation", "1 MPa"),
            "sliding",
            {"stages": (Saturation(lowest=-1e6, highest=1e6),), "transducer": Transducer(deviation=1e-6, seed=3)},
        ),
        (
            ("--controller", "elqr", "--slip-quantum", "1 um", "--step", "2 s"),
            "sliding",
            {"stages": (), "transducer": Transducer(quantum=1e-6), "step": 2.0},
        ),
    ],
)
def test_a_run_with_a_state_is_free_or_sliding(run_with_state, given, kind, told):
    code, out, asked, saved = run_with_state(*given)
    assert (code, saved) == (0, kind)
    assert asked == {**told, "kind": kind}
    lines = "sliding_run_lines" if kind == "sliding" else "state_run_lines"
    assert out.splitlines() == ["the run", f"  {lines}", f"  { ({'kind': kind}) }"]
    assert json.loads(run_with_state(*given, "--json")[1]) == {"kind": kind}


def test_options_of_groups_are_told_by_their_own_names():
    given = {"seed": 3, "run": RunOptions(substeps=2), "state": StateOptions(hold=1.0), "start": StartOptions()}
    found = options._single(given)
    assert (found["seed"], found["substeps"], found["initial_slip"]) == (3, 2, 0.0)
    assert found["state"] == StateOptions(hold=1.0)
    assert not {"run", "start", "hold"} & found.keys()

    def command(*, seed=0, run=RunOptions(), state=StateOptions(), start=StartOptions()):  # noqa: B008
        """A command."""

    assert options.changed_options(command, given) == {"seed": 3, "substeps": 2, "state": StateOptions(hold=1.0)}


def test_a_fault_is_looked_for_before_anything_else_is_loaded(capsys):
    with pytest.raises(SystemExit) as end:
        main(["simulate", "nowhere", "--duration", "x"])
    assert end.value.code == 2
    assert "nowhere" in capsys.readouterr().err


def test_an_option_of_several_words_takes_all_that_follow(capsys):
    with pytest.raises(SystemExit) as end:
        main(["sampling", "lab-fault", "--schemes", "explicit", "nonsense", "--gains", "published"])
    err = capsys.readouterr().err
    assert end.value.code == 2
    assert "nonsense" in err
    assert "--help" not in err, "it is no second fault"


def test_a_perturbation_may_begin_with_a_sign(capsys):
    with pytest.raises(SystemExit) as end:
        main(["simulate", "lab-fault", "--perturbation", "-2*nonsense", "--duration", "1 ms"])
    err = capsys.readouterr().err
    assert end.value.code == 2
    assert "nonsense" in err
    assert "--help" not in err, "it is no option"
