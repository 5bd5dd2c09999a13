"""What is said of a fault: friction as it was read, its box in numbers, and units that look wrong."""

import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
from thinned import few

from quakedesign.fault import UncertaintyBox, load_fault
from quakedesign.guarantees import load_guarantee
from quakedesign.studies.fault_facts import box_sentence, fault_sentences, stick_slip_latex

CERTIFICATES = Path(__file__).parents[2] / "proofs" / "certificates"
REAL, PATCH = load_fault("real-fault"), load_fault("crustal-patch")


def test_friction_is_told_as_it_was_read_with_its_box_in_numbers():
    """√(30 GPa / 2500 kg/m³) = 3464 m/s; the slope of an exponential is largest at first: 0.1/(276.35 mm)."""
    told = fault_sentences(REAL)
    assert told[1] == (
        "shear waves 3464 m/s, effective normal stress 50 MPa, friction exponential-slip-weakening: residual 0.2353, "
        "drop 0.1, critical_slip 0.2763 m"
    )
    friction = "every friction from 0.2353 to 0.3353 that changes by at most 0.3618 per m of slip"
    assert told[2] == f"box paper: {friction}; stiffness, damping and area per mass are exact"
    wide = box_sentence(REAL.with_box("ten-percent"))
    assert wide == f"box ten-percent: {friction}; stiffness within 10 %, damping within 10 %, area per mass within 10 %"
    third = UncertaintyBox(name="third", stiffness=Fraction(1, 3))
    law = replace(REAL.friction, residual=0.235361, drop=0.100033)
    inside = box_sentence(replace(REAL, friction=law, box=third))
    assert "from 0.2354 to 0.3353 that" in inside  # 0.235361 to 0.335394
    assert "stiffness within 33.33 %" in inside
    assert not any("box" in line for line in fault_sentences(PATCH))


@pytest.mark.slow
@pytest.mark.parametrize(("density", "unlikely"), [(2.5, True), (2500.0, False), (834.0, False), (833.0, True)])
def test_shear_waves_that_no_rock_has_are_pointed_out(density, unlikely):
    """833.3 kg/m³ makes 6000 m/s of 30 GPa; a block in a laboratory may be anything."""
    assert ("UNLIKELY for rock" in fault_sentences(replace(REAL, density=density))[1]) is unlikely
    assert "UNLIKELY" not in fault_sentences(load_fault("lab-fault"))[1]


@few(("slowest", "fastest", "side"), [(2e-6, 1.0, "below"), (1e-9, 9e-7, "above"), (1e-6, 1.0, "")], every=2)
def test_a_task_beyond_the_rates_of_its_friction_is_said_to_be_extrapolated(slowest, fastest, side):
    """The patch slides at 1 µm/s."""
    law = replace(PATCH.friction, slowest_rate=slowest, fastest_rate=fastest, reference_rate=(slowest * fastest) ** 0.5)
    told = [line for line in fault_sentences(replace(PATCH, friction=law)) if "extrapolated" in line]
    assert [f"V = 1e-06 m/s is {side} the rates" in line for line in told] == [True] * bool(side)


def test_the_difference_equations_of_the_report_are_the_recursion_that_runs():
    """The numbers of the LaTeX in the recursion of FORMAT.md against the controller of the scheme."""
    claim = load_guarantee(CERTIFICATES / "stick_slip_real-fault.json")
    law, step = claim.sampled_loop.law, float(claim.sampled_loop.step)
    latex = stick_slip_latex(law, step)

    def numbers(text):
        parts = re.findall(r"(?<![\w_{])(\d+\.?\d*)(?: \\cdot 10\^\{(-?\d+)\})?(?!\})", text)
        return [float(digits) * 10.0 ** int(power or 0) for digits, power in parts]

    half, period = numbers(latex[0])
    assert (half, period) == (pytest.approx(step / 2, rel=1e-3), step)
    assert numbers(latex[2]) == pytest.approx([float(law.level_gain), float(law.slip_gain)], rel=1e-3)
    assert numbers(latex[3])[0] == pytest.approx(float(law.return_rate), rel=1e-3)
    assert numbers(latex[4]) == pytest.approx([float(law.rate_gain), float(law.target_gain)], rel=1e-3)
    assert r"v^+_k = \max(v_k, 0)" in latex[3]
    assert r"\max(i_k, " in latex[1]
    assert r"y_k = 0" in latex[1]
