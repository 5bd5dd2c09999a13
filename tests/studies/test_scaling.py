"""The answer of the command ``scale``."""

import json
from dataclasses import replace
from fractions import Fraction

import pytest

from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.exact import rational
from quakedesign.fault import load_fault
from quakedesign.lyapunov.exact.perturbation_bounds import least_authority
from quakedesign.report.terminal import scale_lines
from quakedesign.studies.scaling import scale_answer

LAB, REAL = load_fault("lab-fault"), load_fault("real-fault")


@pytest.mark.parametrize("law", ["cta", "dia", "elqr"])
def test_the_answer_is_json_and_every_number_in_it_is_exact_or_has_twelve_digits(law):
    answer = scale_answer("lab-fault", "real-fault", law)
    assert json.loads(json.dumps(answer, allow_nan=False)) == answer
    for name, text in answer["gains"].items():
        assert float(rational(text)) == pytest.approx(answer["gains_decimal"][name], rel=1e-11)
    assert answer["scale_factors"]["pressure"] == "500"
    assert answer["scale_factors"]["slip"] == "110.54"
    assert answer["scale_factors"]["time"] == "184.17"
    assert rational(answer["scale_factors"]["slip_rate"]) == Fraction(11054, 18417)


def test_published_gains_of_the_twisting_law():
    answer = scale_answer(LAB, REAL, "cta", "published")
    assert (answer["from"], answer["to"], answer["controller"]) == ("lab-fault", "real-fault", "cta")
    # 7.5·500/110.54^(1/3) and 5·500/√(110.54/184.17), by bc with 20 digits
    assert answer["gains"]["k1"] == "781.372485470"
    assert answer["gains"]["k2"] == "3226.93132261"
    assert Fraction(answer["gains"]["k3"]) == Fraction("1.66e-4") * 500 / Fraction("184.17")
    assert Fraction(answer["gains"]["k4"]) == Fraction("7.92e-5") * 500 / Fraction("184.17")
    assert answer["source_gains"] == {"k1": "7.5", "k2": "5", "k3": "0.000166", "k4": "0.0000792"}
    assert answer["divisor"] == answer["source_divisor"] == "4/1385"
    assert answer["integrals"] == {"xi1": "500"}
    assert {name: entry["agrees"] for name, entry in answer["published"].items()} == {
        "k1": True,
        "k2": False,  # ERRATA 25
        "k3": True,
        "k4": True,
    }


def test_the_linear_law_is_told_with_and_without_rounding():
    answer = scale_answer(LAB, REAL, "elqr")
    assert {name: f"{value:.4g}" for name, value in answer["gains_decimal"].items()} == {
        "k1": "1.886e+09",
        "k2": "5.781e+08",
        "k3": "1.024e+06",
        "k4": "18.54",
    }
    assert all(entry["agrees"] for entry in answer["unrounded"]["published"].values())
    assert "scale" not in answer
    text = "\n".join(scale_lines(answer))
    assert "printed 1.88e9, deviation 0.33 %" in text
    assert "before they were rounded" in text


def test_given_gains_come_out_for_the_divisor_of_the_target():
    gains = ("7", "5", "2.3", "1.1")
    answer = scale_answer(LAB, REAL, "cta", gains)
    assert answer["published"] is None
    assert Fraction(answer["source_divisor"]) == least_authority(LAB)
    assert Fraction(answer["divisor"]) == least_authority(REAL)
    # pressures agree with the same law under the divisor of the source
    ratio = least_authority(REAL) / least_authority(LAB)
    assert Fraction(answer["gains"]["k3"]) == Fraction("2.3") * 500 / Fraction("184.17") * ratio
    # there and back to the given digits
    back = scale_answer(REAL, LAB, "cta", tuple(answer["gains"].values()))
    assert [float(rational(v)) for v in back["gains"].values()] == pytest.approx([7, 5, 2.3, 1.1], rel=1e-11)
    assert back["gains"]["k3"] == "2.3"


def test_differing_groups_carry_both_values_and_their_ratio():
    answer = scale_answer(LAB, REAL, "dia")
    assert answer["similar"] is True
    assert answer["violations"] == answer["unmatched"] == []
    sampling = next(g for g in answer["differing"] if g["group"] == "sampling_time")
    assert Fraction(sampling["source"]) == Fraction(1, 3600000)
    assert Fraction(sampling["target"]) == Fraction("0.184") / 663012
    assert sampling["ratio"] == pytest.approx(184 / 184.17, rel=1e-15)


def test_violations_are_loud():
    stiff = replace(REAL, damping=0.0, disturbance=replace(REAL.disturbance, constant=1e-4))
    answer = scale_answer(LAB, stiff, "elqr")
    assert answer["similar"] is False
    assert set(answer["violations"]) == {"damping", "disturbance.constant"}
    lines = scale_lines(answer)
    assert any(line.startswith("NOT similar within 1 %") for line in lines)
    assert any(line.strip().startswith("damping·") and ", ratio 0" in line for line in lines)
    assert any(line.strip().startswith("disturbance.constant·") and ", ratio" not in line for line in lines)


def test_identical_faults_keep_their_gains():
    answer = scale_answer(LAB, LAB, "cta")
    assert answer["gains"] == answer["source_gains"]
    assert set(answer["scale_factors"].values()) == {"1"}
    assert answer["differing"] == []
    assert scale_lines(answer)[-1] == "similar exactly: every π-group has the same value"


def test_the_clock_can_be_chosen():
    answer = scale_answer(LAB, REAL, "elqr", clock="shear_modulus")
    assert float(answer["scale_factors"]["time"]) == pytest.approx(LAB.natural_frequency / REAL.natural_frequency)
    assert "shear_modulus" in answer["fixed_by"]
    assert answer["similar"]


def test_lines_tell_gains_factors_and_similarity():
    lines = scale_lines(scale_answer("lab-fault", "real-fault", "cta"))
    assert lines[0] == "2-CTA: lab-fault → real-fault"
    assert lines[1] == "  k1 = 781.372 from 7.5 (pressure·slip^(-1/3); printed 781.37)"
    assert any("λ = 500" in line for line in lines)
    assert any("λ_δ = 110.54, λ_t = 184.17, λ_p = 500" in line for line in lines)
    assert lines[-1].startswith("similar within 1 %: 9 π-groups differ, by at most 0.092 %")


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (("lab-fault", "real-fault", "pid", "published"), UnknownNameError, "controller must be one of"),
        (("lab-fault", "moon-fault", "cta", "published"), UnknownNameError, "fault must be a preset"),
        (("lab-fault", "real-fault", "cta", ("1", "2")), ParameterError, "needs 4 gains"),
        (("lab-fault", "real-fault", "cta", ("1", "2", "3", "x")), ParameterError, "must be a finite number"),
    ],
)
def test_what_cannot_be_understood_is_refused(arguments, error, message):
    with pytest.raises(error, match=message):
        scale_answer(*arguments)


def test_published_gains_exist_for_the_faults_of_the_paper_only():
    with pytest.raises(UnknownNameError, match="published gains exist"):
        scale_answer(replace(LAB, name="mine"), REAL, "cta")
    assert scale_answer(LAB, replace(REAL, name="mine"), "cta")["published"] is None
