"""Fault descriptions: the presets are the paper's table; everything wrong is one clear message."""

from fractions import Fraction as F
from importlib.resources import files

import pytest

from quakedesign.errors import ParameterError, ScenarioError, UnitError, UnknownNameError
from quakedesign.fault import load_fault, parse_fault, presets

REAL = (files("quakedesign.fault") / "presets" / "real-fault.toml").read_text(encoding="utf-8")
LENGTH, BOX, DROP = 'length = "5 km"', 'uncertainty = "paper"', "drop = 0.1"


def edited(old, new):
    assert REAL.count(old) == 1
    return REAL.replace(old, new)


def plain(fault):
    law, task = fault.friction, fault.reference
    return (
        *(fault.density, fault.shear_modulus, fault.damping, fault.length, fault.effective_normal_stress),
        *(law.residual, law.drop, law.critical_slip),
        *(task.target_slip, task.operation_time, fault.sampling_time),
    )


def test_presets_are_the_columns_of_the_table():
    # Table I, in its order; Δμ = −drop
    hour = 3600
    real = (2500, 30e9, 5e14, 5000, 50e6, 0.2353, 0.1, 0.27635, 0.785, 184.17 * hour, 0.184)
    lab = (1385, 225.5e3, 408, 0.1, 0.1e6, 0.4, 0.17, 2.5e-3, 7.1e-3, hour, 1e-3)
    assert presets() == ["lab-fault", "real-fault"]
    assert plain(load_fault("real-fault")) == pytest.approx(real, rel=1e-15)
    assert plain(load_fault("lab-fault")) == pytest.approx(lab, rel=1e-15)


def test_the_laboratory_disturbance_is_that_of_the_real_fault_by_similarity():
    real, lab = (load_fault(name).disturbance for name in ("real-fault", "lab-fault"))
    slip, time = 110.54, 184.17
    assert lab.amplitude == pytest.approx(real.amplitude / slip * time**2, rel=1e-3)
    assert lab.frequency == pytest.approx(real.frequency * time, rel=1e-3)
    assert lab.slip_growth == pytest.approx(real.slip_growth * time**2, rel=1e-3)


@pytest.mark.parametrize("name", presets())
def test_every_preset_has_a_source(name):
    assert "Earthquake Control" in load_fault(name).source
    assert load_fault(name).name == name


def test_a_file_is_read_like_a_preset(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(REAL, encoding="utf-8")
    assert load_fault(path) == load_fault(str(path)) == load_fault("real-fault")
    assert load_fault(path, box="ten-percent") == load_fault("real-fault").with_box("ten-percent")


def test_an_own_uncertainty_box():
    text = edited(BOX, 'uncertainty = { stiffness = 0.1, authority = "5 %" }')
    box = parse_fault(text, "own").box
    assert (box.name, box.stiffness, box.damping, box.authority) == ("own", F(1, 10), 0, F(1, 20))


WRONG = {
    "negative density": ("2500 kg/m^3", "-2500 kg/m^3", ParameterError, "density must be positive and finite"),
    "unknown unit": ("30 GPa", "30 GPaa", UnitError, "shear_modulus .* Received '30 GPaa', whose unit is unknown"),
    "wrong dimension": ("30 GPa", "30 m", UnitError, "shear_modulus .* another dimension"),
    "no unit in the text": ("30 GPa", "30", UnitError, "shear_modulus .* without a unit"),
    "number without unit": ('"30 GPa"', "30", ScenarioError, "shear_modulus has the wrong type. Received '30'"),
    "no number": ("30 GPa", "GPa", UnitError, "shear_modulus .* without a number"),
    "nan": ("30 GPa", "nan GPa", ParameterError, "shear_modulus must be positive and finite. Received nan"),
    "inf": ("30 GPa", "inf GPa", ParameterError, "shear_modulus must be positive and finite. Received inf"),
    "nan friction": ("residual = 0.2353", "residual = nan", ParameterError, "residual must be positive and finite"),
    "logical friction": (DROP, "drop = true", ScenarioError, "friction.drop has the wrong type. Received 'True'"),
    "the paper's sign": (DROP, "drop = -0.1", ParameterError, "the paper's Δμ has the opposite sign"),
    "missing key": (LENGTH, "", ScenarioError, "length must be given. Received nothing"),
    "missing table": ("[task]", "[job]", ScenarioError, "task must be given|job is not a known key"),
    "extra key": (LENGTH, LENGTH + '\nwidth = "1 km"', ScenarioError, "width is not a known key"),
    "missing parameter": (DROP, "", ScenarioError, "exactly the parameters residual, drop, critical_slip"),
    "extra parameter": (DROP, DROP + "\na = 1", ScenarioError, "exactly the parameters .* Received .*a"),
    "no law": ('law = "exponential-slip-weakening"', "", ScenarioError, "friction.law must name a friction law"),
    "unknown law": ("exponential-slip-weakening", "magic", UnknownNameError, "one of exponential.*Received 'magic'"),
    "unknown box": (
        BOX,
        'uncertainty = "wide"',
        UnknownNameError,
        "must be one of paper, ten-percent. Received 'wide'",
    ),
    "wide box": (BOX, "uncertainty = { damping = 1.5 }", ParameterError, r"in \[0, 1\). Received 3/2"),
    "nan box": (BOX, "uncertainty = { damping = nan }", ParameterError, "uncertainty.damping must be a finite number"),
    "unknown box part": (BOX, "uncertainty = { mass = 0.1 }", ScenarioError, "uncertainty.mass is not a known key"),
    "number as box": (BOX, "uncertainty = 3", ScenarioError, "uncertainty has the wrong type. Received '3'"),
    "path as name": ('name = "real-fault"', 'name = "a/../b"', ScenarioError, "name must be of at most 60 letters"),
    "number as name": ('name = "real-fault"', "name = 3", ScenarioError, "name has the wrong type"),
    "no operation": ("184.17 hour", "0 hour", ParameterError, "operation_time must be positive"),
    "coarse sampling": ("184 ms", "1 hour", ParameterError, "sampling_time must be at most a thousandth"),
    "overflow": (LENGTH, 'length = "1e300 m"', ParameterError, "derived quantities overflow"),
    "hertz": ("0.69 rad/s", "0.11 Hz", UnitError, "frequency must be an angular frequency"),
    "broken TOML": (LENGTH, 'length = "5 km', ScenarioError, "own.toml is not valid TOML"),
    "nested TOML": (LENGTH, "length = " + "[" * 5000, ScenarioError, "own.toml is not valid TOML"),
}


@pytest.mark.parametrize(("old", "new", "kind", "match"), WRONG.values(), ids=WRONG)
def test_wrong_descriptions(old, new, kind, match):
    with pytest.raises(kind, match=match) as raised:
        parse_fault(edited(old, new), "own.toml")
    message = str(raised.value)
    assert type(raised.value) is kind
    assert message.startswith("own.toml")
    assert len(message) < 400
    assert "\n" not in message


@pytest.mark.parametrize("source", ["nope", "", "/", "real-fault.json"])
def test_neither_preset_nor_file(source):
    with pytest.raises(
        UnknownNameError, match=r"must be a preset \(lab-fault, real-fault\) or the path of a \.toml file"
    ):
        load_fault(source)


def test_an_unknown_box_for_a_preset():
    with pytest.raises(UnknownNameError, match="uncertainty box must be one of"):
        load_fault("real-fault", box="wide")


def test_files_that_cannot_be_read(tmp_path):
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "latin.toml").write_bytes("name = 'Gutiérrez'".encode("latin-1"))
    with (tmp_path / "huge.toml").open("wb") as handle:
        handle.truncate(2**20 + 1)
    reasons = {
        "missing.toml": "No such file or directory",
        "folder.toml": "Is a directory",
        "latin.toml": "its name or its text is not UTF-8",
        "zero\0.toml": "its name or its text is not UTF-8",
        "huge.toml": "at most 1 MiB",
    }
    for name, reason in reasons.items():
        with pytest.raises(ScenarioError, match=rf"{reason}.*Give a ") as raised:
            load_fault(tmp_path / name)
        assert name in str(raised.value)
