"""The slip to follow, eq. ref."""

from fractions import Fraction

import numpy as np
import pytest
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.fault import Reference, SlidingReference, fault_toml, load_fault
from quakedesign.fault.fault_toml import parse_fault

REFERENCE = Reference(target_slip=0.785, operation_time=3600.0)
s = sp.Symbol("s")


def test_it_starts_and_ends_at_rest():
    shape = REFERENCE.shape(s)
    assert [shape.subs(s, end) for end in (0, 1)] == [0, 1]
    for order in (1, 2):
        assert [sp.diff(shape, s, order).subs(s, end) for end in (0, 1)] == [0, 0]


def test_it_never_goes_back():
    # r' ∝ s²(1 − s)²
    assert sp.expand(sp.diff(REFERENCE.shape(s), s) - 30 * s**2 * (1 - s) ** 2) == 0


def test_slip_is_exact():
    # s = 1/2: (10 − 15/2 + 6/4)/8 = 1/2
    assert REFERENCE.slip(sp.Integer(1800)) == sp.Rational(785, 2000)
    assert REFERENCE.slip(sp.Integer(3600)) == sp.Rational(785, 1000)


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
@pytest.mark.parametrize("name", ["target_slip", "operation_time"])
def test_both_must_be_positive(name, value):
    with pytest.raises(ParameterError, match=f"^{name} must be positive and finite"):
        Reference(**{"target_slip": 1.0, "operation_time": 1.0} | {name: value})


@pytest.mark.parametrize("stage", [None, int, "1/2", [0.5], {}])
def test_a_stage_without_powers_is_refused(stage):
    with pytest.raises(ParameterError, match=r"stage must be a number, an array or an expression\. Received"):
        REFERENCE.shape(stage)


def test_a_sliding_reference_is_a_constant_rate_and_a_smooth_ramp():
    """Half of 1 m within 10 s along the ramp: its rate by differences, its ends and its extremes by hand."""
    reference = SlidingReference(task=Reference(target_slip=1.0, operation_time=10.0, ramp=0.5))
    time = np.linspace(0, 12, 2401)
    slip, rate = reference.slip(time), reference.rate(time)
    assert np.gradient(slip, time)[1:-1] == pytest.approx(rate[1:-1], abs=2e-5)
    assert slip[[0, 2000]] == pytest.approx([0.0, 1.0])
    assert reference.first_rate == Fraction(1, 20)
    assert rate[[0, 2000, 2400]] == pytest.approx([0.05] * 3)
    assert rate.min() == pytest.approx(0.05)
    assert rate.max() == pytest.approx(0.05 * float(1 + reference.swing)) == pytest.approx(0.05 + 0.05 * 15 / 8)
    assert slip[-1] == pytest.approx(1.1)


def test_without_a_ramp_a_sliding_reference_has_one_rate():
    reference = SlidingReference(task=REFERENCE)
    assert reference.swing == 0
    assert reference.first_rate == Fraction("0.785") / 3600
    assert float(reference.slip(1800.0)) == pytest.approx(0.785 / 2)


@pytest.mark.parametrize("ramp", [0.0, 1.0, -0.1, float("nan")])
def test_a_ramp_is_a_share(ramp):
    with pytest.raises(ParameterError, match="ramp must be above 0 and below 1"):
        Reference(target_slip=1.0, operation_time=1.0, ramp=ramp)


def test_a_ramp_needs_friction_with_a_state(tmp_path):
    text = fault_toml(load_fault("crustal-patch")).replace("[task]", "[task]\nramp = 0.05")
    path = tmp_path / "ramp.toml"
    path.write_text(text)
    ramped = load_fault(path)
    assert ramped.reference.ramp == 0.05
    assert parse_fault(fault_toml(ramped), "again") == ramped
    path.write_text(fault_toml(load_fault("real-fault")).replace("[task]", "[task]\nramp = 0.05"))
    with pytest.raises(ParameterError, match="ramp needs friction with a state"):
        load_fault(path)
