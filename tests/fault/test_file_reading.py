"""Fault descriptions: the presets are the paper's table; everything wrong is one clear message."""

import math
import os
from dataclasses import replace
from fractions import Fraction as F
from importlib.resources import files

import pytest

from quakedesign.errors import ParameterError, ScenarioError, UnitError, UnknownNameError
from quakedesign.exact import rational
from quakedesign.fault import friction_law, load_fault, parse_fault, presets
from quakedesign.fault.fault_toml import fault_toml
from quakedesign.plant import uncertain_plant

REAL = (files("quakedesign.fault") / "presets" / "real-fault.toml").read_text(encoding="utf-8")
REGULAR = """law = "regularised-rate-and-state"
evoluton = "slip"
reference_coefficient = 0.6
direct_effect = 0.01
evolution_effect = 0.015
critical_slip = "2 cm"
reference_rate = "1 um/s"
slowest_rate = "1e-12 m/s"
fastest_rate = "1 m/s"
"""
LAW = 'law = "exponential-slip-weakening"\nresidual = 0.2353\ndrop = 0.1\ncritical_slip = "276.35 mm"'
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
    assert presets() == [
        "creeping-patch",
        "crustal-patch",
        "double-direct-shear",
        "geothermal-fault",
        "lab-apparatus",
        "lab-fault",
        "real-fault",
    ]
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
    patches = dict.fromkeys(("crustal-patch", "creeping-patch"), "Erickson et al. (2020)")
    others = {"geothermal-fault": "Valley and Evans (2007", "double-direct-shear": "Leeman et al. (2016"}
    assert (patches | others).get(name, "Earthquake Control") in load_fault(name).source
    assert load_fault(name).name == name


@pytest.mark.parametrize(
    ("name", "direct", "change"),
    [("crustal-patch", 0.010, 0.005), ("creeping-patch", 0.025, -0.010)],
)
def test_patches_have_the_numbers_of_the_benchmark(name, direct, change):
    """BP1-QD: ρ, c_s, σ_n, a, b, D_c, and f0 = 0.6 at 1 µm/s carried to the plate rate of 1 nm/s."""
    fault = load_fault(name)
    law, speed = fault.friction, 3464.0
    assert (fault.density, fault.effective_normal_stress, fault.length) == (2670.0, 50e6, 15e3)
    assert fault.shear_modulus == pytest.approx(2670 * speed**2, rel=1e-4)
    assert fault.damping == pytest.approx(fault.area * 2670 * speed / 2, rel=1e-4)
    assert (law.direct_effect, law.evolution_effect, law.critical_slip) == (direct, 0.015, 8e-3)
    assert law.reference_coefficient == pytest.approx(0.6 + change * math.log(1e3), abs=5e-6)
    assert law.reference_rate == 1e-9


def test_the_geothermal_fault_is_loaded_as_the_stresses_of_its_site_say():
    """Valley and Evans (2007) in MPa and km: Sv = 25.5z − 1.3, Sh = 14.06z − 1.78, pore pressure 9.8z + 0.9."""
    fault, depth, angle = load_fault("geothermal-fault"), 4.7, math.radians(60)
    largest, least, pore = 25.5 * depth - 1.3, 14.06 * depth - 1.78, 9.8 * depth + 0.9
    normal = largest * math.cos(angle) ** 2 + least * math.sin(angle) ** 2 - pore
    assert fault.effective_normal_stress == pytest.approx(1e6 * normal, rel=0.01)
    assert (largest - least) * math.sin(2 * angle) / 2 / normal == pytest.approx(
        fault.friction.reference_coefficient, abs=0.02
    )
    assert fault.friction.direct_effect - fault.friction.evolution_effect == pytest.approx(-0.004)
    assert fault.damping == pytest.approx(fault.area * math.sqrt(fault.density * fault.shear_modulus) / 2, rel=1e-3)
    moment = fault.moment_of(fault.reference.target_slip)
    assert (math.log10(moment) - 9.1) / 1.5 == pytest.approx(3.2, abs=0.05)


def test_the_apparatus_is_near_its_critical_stiffness():
    fault = load_fault("double-direct-shear")
    law, normal, stiffness = fault.friction, fault.effective_normal_stress, fault.stiffness / fault.area
    assert (normal, law.reference_rate) == (12e6, 1e-5)
    critical = (law.evolution_effect - law.direct_effect) * normal / law.critical_slip
    assert stiffness == pytest.approx(6e9)
    assert stiffness / critical == pytest.approx(0.83, abs=0.005)
    assert fault.damping / fault.area == pytest.approx(math.sqrt(stiffness * 785) / 2, rel=1e-3)


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
    "unknown unit": ("30 GPa", "30 GPaa", UnitError, "'30 GPaa', whose unit is unknown. Did you mean GPa"),
    "unit far from any": ("30 GPa", "30 wheel", UnitError, "'30 wheel', whose unit is unknown. Check its spelling"),
    "wrong dimension": ("30 GPa", "30 m", UnitError, "shear_modulus .* another dimension"),
    "no unit in the text": ("30 GPa", "30", UnitError, "shear_modulus .* without a unit"),
    "number without unit": ('"30 GPa"', "30", UnitError, "shear_modulus .* Received 30 without a unit"),
    "no number": ("30 GPa", "GPa", UnitError, "shear_modulus .* without a number"),
    "nan": ("30 GPa", "nan GPa", ParameterError, "shear_modulus must be positive and finite. Received nan"),
    "inf": ("30 GPa", "inf GPa", ParameterError, "shear_modulus must be positive and finite. Received inf"),
    "nan friction": ("residual = 0.2353", "residual = nan", ParameterError, "residual must be positive and finite"),
    "logical friction": (DROP, "drop = true", UnitError, "friction.drop must be a plain number. Received True"),
    "the paper's sign": (DROP, "drop = -0.1", ParameterError, "the paper's Δμ has the opposite sign"),
    "missing key": (LENGTH, "", ScenarioError, "length must be given. Received no value"),
    "missing table": ("[task]", "[job]", ScenarioError, "job is not a known key"),
    "extra key": (LENGTH, LENGTH + '\nheight = "1 km"', ScenarioError, "height is not a known key"),
    "missing parameter": (DROP, "", ScenarioError, "friction.drop must be given. Received no value"),
    "misspelt source": (
        'name = "real-fault"',
        'name = "x"\nsorce = "y"',
        ScenarioError,
        "sorce .* mean source.* poor_fit",
    ),
    "misspelt option": (LAW, REGULAR, ScenarioError, "evoluton .* mean evolution"),
    "extra parameter": (DROP, DROP + "\na = 1", ScenarioError, "friction.a is not a known key. Use one of .* drop"),
    "no law": ('law = "exponential-slip-weakening"', "", ScenarioError, "friction.law must be given. Received no"),
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
    "number as box": (BOX, "uncertainty = 3", ScenarioError, "uncertainty must be a name or a table. Received 3"),
    "path as name": (
        'name = "real-fault"',
        'name = "a/../b"',
        ParameterError,
        "name must be a string of at most 60 letters",
    ),
    "number as name": ('name = "real-fault"', "name = 3", ScenarioError, "name must be a string. Received 3"),
    "no operation": ("184.17 hour", "0 hour", ParameterError, "operation_time must be positive"),
    "coarse sampling": ("184 ms", "1 hour", ParameterError, "sampling_time must be at most a thousandth"),
    "overflow": (LENGTH, 'length = "1e300 m"', ParameterError, "a magnitude between"),
    "hertz": ("0.69 rad/s", "0.11 Hz", UnitError, "frequency must be an angular frequency"),
    "broken TOML": (LENGTH, 'length = "5 km', ScenarioError, "own.toml is not valid TOML"),
    "unit without quotes": (LENGTH, "length = 5 km", ScenarioError, "Put values with a unit in quotes"),
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
    assert len(raised.value.parts) == 0
    assert "\n" not in message


@pytest.mark.parametrize("source", ["nope", "", "/", "real-fault.json"])
def test_neither_preset_nor_file(source):
    with pytest.raises(
        UnknownNameError,
        match=r"must be a preset \(creeping-patch, crustal-patch, .*, real-fault\) or the path of a \.toml file",
    ):
        load_fault(source)


def test_an_unknown_box_for_a_preset():
    with pytest.raises(UnknownNameError, match="uncertainty box must be one of"):
        load_fault("real-fault", box="wide")


def test_files_that_cannot_be_read(tmp_path):
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "latin.toml").write_bytes("name = 'Gutiérrez'".encode("latin-1"))
    with (tmp_path / "huge.toml").open("wb") as handle:
        handle.truncate(2**16 + 1)
    reasons = {
        "missing.toml": "No such file or directory",
        "folder.toml": "Is a directory",
        "latin.toml": "must be UTF-8 text",
        "zero\0.toml": "no file can have this name",
        "huge.toml": "at most 64 KiB|at most 65536 characters",
    }
    for name, reason in reasons.items():
        with pytest.raises(ScenarioError, match=reason) as raised:
            load_fault(tmp_path / name)
        assert name.replace("\0", r"\x00") in str(raised.value)


def test_everything_that_is_wrong_is_said_at_once():
    text = edited('density = "2500 kg/m^3"', 'density = "-1 kg/m^3"').replace("shear_modulus", "shear_modulous")
    text = text.replace("50 MPa", "50 MPas").replace(DROP, "dorp = -0.1").replace("0.69 rad/s", "0.11 Hz")
    text = text.replace(BOX, "uncertainty = { damping = 1.5, stifness = 0.1 }").replace('"real-fault"', '"a/b"')
    with pytest.raises(ScenarioError) as raised:
        parse_fault(text, "own.toml")
    said = str(raised.value)
    for expected in (
        "own.toml: 8 errors. (1) ",
        "density must be positive and finite. Received -1.0",
        "shear_modulous is not a known key. Did you mean shear_modulus?",
        "effective_normal_stress must be a quantity in Pa, such as '30 GPa'. Received '50 MPas'",
        "friction.dorp is not a known key. Did you mean drop?",
        "frequency must be an angular frequency",
        "damping of the uncertainty box must be in [0, 1)",
        "uncertainty.stifness is not a known key. Did you mean stiffness?",
        "name must be a string of at most 60 letters",
    ):
        assert expected in said
    assert "shear_modulus must be given" not in said
    assert len(raised.value.parts) == 8
    assert said.count("errors.") == 1


def test_all_half_widths_that_are_wrong_are_named():
    with pytest.raises(ParameterError, match=r"2 errors. \(1\) uncertainty.stiffness .*\(2\) uncertainty.authority"):
        parse_fault(edited(BOX, "uncertainty = { stiffness = nan, authority = inf }"), "own.toml")


def test_an_empty_file_lacks_every_key_in_one_sentence():
    with pytest.raises(
        ScenarioError, match=r"name, density, shear_modulus, length, effective_normal_stress, friction must"
    ):
        parse_fault("", "empty.toml")


ENDLESS = {
    "integer of 310 digits": (DROP, "drop = 1" + "0" * 309, UnitError, "too large"),
    "integer of 5000 digits": (DROP, "drop = 1" + "0" * 4999, ScenarioError, "not valid TOML"),
    "60 letters of four bytes": ('name = "real-fault"', f'name = "{chr(0x1D49C) * 60}"', ParameterError, "120 bytes"),
    "300 letters": ('name = "real-fault"', f'name = "{"a" * 300}"', ParameterError, "at most 60 letters"),
    "400 kB of dots": (DROP, "a." * 200_000 + "a = 1", ScenarioError, "at most 65536 characters"),
}


@pytest.mark.parametrize(("old", "new", "kind", "match"), ENDLESS.values(), ids=ENDLESS)
def test_nothing_endless_is_read(old, new, kind, match):
    with pytest.raises(kind, match=match) as raised:
        parse_fault(edited(old, new), "own.toml")
    assert len(str(raised.value)) < 500


@pytest.mark.parametrize("make", ["pipe", "device"])
def test_a_pipe_or_a_device_is_no_fault_file(make, tmp_path):
    path = tmp_path / "endless.toml"
    os.mkfifo(path) if make == "pipe" else path.symlink_to("/dev/zero")
    with pytest.raises(ScenarioError, match="must be a regular file"):
        load_fault(path)


def test_a_preset_is_found_again_by_its_nearest_name():
    with pytest.raises(UnknownNameError, match=r"Did you mean real-fault\?"):
        load_fault("real-falt")


@pytest.mark.parametrize(("target", "said"), [("785 mm", ""), ("1569 mm", "2 times the rest slip")])
def test_a_target_beyond_the_rest_slip_is_said(target, said):
    # the preset comes to rest at 784.6 mm; its target is the paper's rounded 785 mm
    from quakedesign.studies.fault_facts import fault_sentences

    told = " ".join(fault_sentences(parse_fault(edited("785 mm", target), "own.toml")))
    assert "the uncontrolled earthquake slips 0.7846 m (next rest slip)" in told
    assert ("times the rest slip" in told) is bool(said)
    assert said in told


AMPLITUDE = 'amplitude = "3.2e-4 m/s^2"'


@pytest.mark.parametrize(
    ("told", "amplitude"),
    [
        ('amplitude = "35 kPa"', 0.0028),  # τA/m = 35 kPa/(2500 kg/m³ · 5 km)
        ('amplitude = "4000 Pa"', 3.2e-4),
        ('amplitude = "0 Pa"', 0.0),
        ('amplitude = "0.35 bar"', 0.0028),
        ('amplitude = "0.32 mm/s^2"', 3.2e-4),
    ],
)
def test_a_disturbance_is_an_acceleration_or_a_shear_stress_on_the_fault(told, amplitude):
    fault = parse_fault(edited(AMPLITUDE, told), "own.toml")
    assert fault.disturbance.amplitude == amplitude
    assert amplitude == pytest.approx(amplitude * fault.mass / fault.area * fault.authority)
    again = load_fault("real-fault", disturbance=told.split('"')[1])
    assert again == parse_fault(REAL, "x").with_disturbance(fault.disturbance)


def test_a_constant_stress_keeps_its_sign_and_a_wider_patch_its_shorter_side():
    text = edited(AMPLITUDE, 'constant = "-35 kPa"').replace(LENGTH, 'length = "50 km"\nwidth = "5 km"')
    assert parse_fault(text, "own.toml").disturbance.constant == -0.0028


STRESSED = [("2 kPa", "1e-4 m/s^2", ("amplitude",)), ("1e-4 m/s^2", "-3 kPa", ("constant",)),
            ("2 kPa", "-3 kPa", ("amplitude", "constant")), ("1e-4 m/s^2", "1e-4 m/s^2", ())]  # fmt: skip


@pytest.mark.parametrize(("amplitude", "constant", "stresses"), STRESSED)
@pytest.mark.parametrize("width", ["0", "1/10"])
def test_a_stress_is_covered_for_every_area_per_mass_of_the_box(amplitude, constant, stresses, width):
    """τ accelerates by τ/(ρL), ρL = 2500 kg/m³ · 5 km, and by up to a tenth more where that is uncertain."""
    text = edited(AMPLITUDE, f'amplitude = "{amplitude}"\nconstant = "{constant}"')
    fault = parse_fault(text, "own.toml").with_box("paper" if width == "0" else "ten-percent")
    sizes = {"2 kPa": F(2000, 12500000), "-3 kPa": F(3000, 12500000), "1e-4 m/s^2": F(1, 10000)}
    wide = {name: sizes[said] * (1 + F(width) * said.endswith("Pa")) for name, said in
            (("amplitude", amplitude), ("constant", constant))}  # fmt: skip
    assert fault.disturbance.stresses == stresses
    assert fault.disturbance_bounds == (sum(wide.values()), wide["amplitude"] * F("0.69"))
    assert uncertain_plant(fault).amplitude == sum(wide.values())
    assert fault.disturbance.largest_explicit == pytest.approx(float(sizes[amplitude] + sizes[constant]))


def test_another_disturbance_takes_the_place_of_a_stress_and_a_stress_that_of_another(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(edited(AMPLITUDE, 'amplitude = "2 kPa"'))
    assert load_fault(path, disturbance="1e-4 m/s^2").disturbance.stresses == ()
    path.write_text(REAL)
    assert load_fault(path).disturbance.stresses == ()
    assert load_fault(path, disturbance="3 kPa").disturbance.stresses == ("amplitude",)


@pytest.mark.parametrize(
    ("stress", "density"), [("2 kPa", "2500"), ("-0.35 bar", "2617.3"), ("0 Pa", "3"), ("7 Pa", "0.3")]
)
def test_a_stress_is_written_as_one_and_read_again(stress, density):
    text = edited(AMPLITUDE, f'constant = "{stress}"').replace("2500 kg", f"{density} kg")
    fault = parse_fault(text, "own.toml")
    assert parse_fault(fault_toml(fault), "again.toml") == fault


def test_a_stress_is_never_made_a_smaller_acceleration():
    """So that what is proved of the float is proved of the stress: 1 Pa/(3 kg/m³ · 7 m) is no float."""
    text = edited(LENGTH, 'length = "7 m"').replace("2500 kg/m^3", "3 kg/m^3")
    for stress in range(1, 60):
        fault = parse_fault(text.replace(AMPLITUDE, f'amplitude = "{stress} Pa"'), "own.toml")
        told, exact = rational(fault.disturbance.amplitude), F(stress, 21)
        assert exact <= told <= exact * (1 + F(1, 2**51))


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ("3 m", "amplitude must be a quantity in m/s.2.* another dimension.* A shear stress in Pa is accepted too"),
        ("35 kPaa", "whose unit is unknown. Did you mean kPa?"),
        ("35", "without a unit. Add the unit. A shear stress"),
    ],
)
def test_a_disturbance_of_another_kind_is_refused(told, said):
    with pytest.raises(UnitError, match=said):
        parse_fault(edited(AMPLITUDE, f'amplitude = "{told}"'), "own.toml")
    with pytest.raises(UnitError, match=said.replace("amplitude", "disturbance")):
        load_fault("real-fault", disturbance=told)


def test_a_push_is_not_negative_and_friction_with_a_state_has_a_stress_of_its_own():
    with pytest.raises(ParameterError, match="amplitude must be zero or positive"):
        load_fault("real-fault", disturbance="-35 kPa")
    with pytest.raises(ParameterError, match="Give --stress"):
        load_fault("crustal-patch", disturbance="35 kPa")
    with pytest.raises(ParameterError, match="density must be positive"):
        parse_fault(edited(AMPLITUDE, 'amplitude = "35 kPa"').replace("2500 kg/m^3", "0 kg/m^3"), "own.toml")


@pytest.mark.parametrize(
    ("stress", "density", "said"), [("1e200 Pa", "2500", "amplitude"), ("35 kPa", "1e-250", "density")]
)
def test_a_stress_that_no_fault_feels_is_refused_by_its_size(stress, density, said):
    text = edited(AMPLITUDE, f'amplitude = "{stress}"').replace("2500 kg", f"{density} kg")
    with pytest.raises(ParameterError, match=f"{said} must have a magnitude between 1e-40 and 1e.40 in SI units"):
        parse_fault(text, "own.toml")
    with pytest.raises(ParameterError, match=r"(amplitude|density) must have a magnitude"):
        parse_fault(edited(AMPLITUDE, 'amplitude = "1e200 Pa"').replace("2500 kg", "1e-250 kg"), "own.toml")


def test_all_values_of_a_friction_law_that_are_wrong_are_said_at_once():
    with pytest.raises(ParameterError) as refused:
        friction_law("exponential-slip-weakening")(residual=-0.4, drop=-0.1, critical_slip=-0.02)
    told = [str(part) for part in refused.value.parts]
    assert [part.split()[0] for part in told] == ["residual", "drop", "critical_slip"]
    patch = load_fault("crustal-patch").friction
    with pytest.raises(ParameterError) as refused:
        replace(patch, direct_effect=-1.0, stress_sensitivity=-1.0, reference_rate=1e3)
    told = [str(part).split()[0] for part in refused.value.parts]
    assert told == ["direct_effect", "stress_sensitivity", "reference_rate"]
    with pytest.raises(ParameterError) as refused:
        friction_law("slip-rate-weakening")(residual=-0.4, drop=0.1, critical_rate=0.0)
    assert len(refused.value.parts) == 2


def test_a_byte_order_mark_is_no_part_of_the_file(tmp_path):
    text = (files("quakedesign.fault") / "presets" / "lab-fault.toml").read_text(encoding="utf-8")
    (tmp_path / "marked.toml").write_text(text, encoding="utf-8-sig")
    assert load_fault(tmp_path / "marked.toml").stiffness == load_fault("lab-fault").stiffness
