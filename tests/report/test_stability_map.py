"""The map's boundary is the critical stiffness, its colours are the verdicts, its labels carry units."""

from dataclasses import replace

import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import friction_law, load_fault
from quakedesign.report.figures import stability_map
from quakedesign.symbolic.stability import Stability, stability

REAL = load_fault("real-fault")
AGING = friction_law("rate-and-state-aging")(
    reference_coefficient=0.6,
    direct_effect=0.01,
    evolution_effect=0.015,
    critical_slip=0.03,
    reference_rate=1e-6,
    slowest_rate=1e-9,
    fastest_rate=1e-3,
)
RATE = friction_law("slip-rate-weakening")(residual=0.3, drop=0.1, critical_rate=0.1)


def line(axis, label):
    return next(found for found in axis.lines if found.get_label() == label)


def test_the_boundary_of_slip_weakening_is_a_straight_line_through_zero_effective_stress():
    drawing = stability_map(REAL, pressure=10e6)
    left, right = drawing.axes
    stress, stiffness = line(left, "critical stiffness").get_data()
    assert stiffness == pytest.approx(0.1 * (stress - 10) / 0.27635, rel=1e-9)
    pressure, stiffness = line(right, "critical stiffness").get_data()
    assert stiffness == pytest.approx(0.1 * (50 - pressure) / 0.27635, rel=1e-9)


def test_the_boundary_of_rate_and_state_is_that_of_ruina_but_for_damping():
    left, right = stability_map(replace(REAL, friction=AGING, damping=0.0), inertia=False).axes
    stress, stiffness = line(left, "critical stiffness").get_data()
    assert stiffness == pytest.approx(0.005 * stress / 0.03, rel=1e-9)
    pressure, stiffness = line(right, "critical stiffness").get_data()
    assert stiffness == pytest.approx(0.005 * (50 - pressure) / 0.03, rel=1e-9)


def test_slip_rate_weakening_is_bounded_by_damping():
    left, right = stability_map(replace(REAL, friction=RATE)).axes
    # η/A = σ'·drop/v_c at 20 MPa
    assert line(left, "damping limit").get_xdata()[0] == pytest.approx(5e14 / 5000**2 * 0.1 / 0.1 / 1e6, rel=1e-6)
    assert line(right, "damping limit").get_xdata()[0] == pytest.approx(30, rel=1e-6)
    assert "no critical stiffness" in left.texts[0].get_text()


@pytest.mark.parametrize("friction", [REAL.friction, AGING])
def test_the_fault_lies_on_the_side_of_its_verdict(friction):
    fault = replace(REAL, friction=friction)
    for axis in stability_map(fault).axes:
        (mark,) = (found for found in axis.lines if found.get_label().startswith("real-fault"))
        boundary = line(axis, "critical stiffness")
        critical = np.interp(mark.get_xdata()[0], *boundary.get_data())
        stable = stability(fault).outcome is Stability.STABLE
        assert bool(mark.get_ydata()[0] > critical) is stable
        assert mark.get_label().endswith(stability(fault).outcome.name.lower())


def test_critical_stiffness_and_nucleation_length_are_written_with_units(tmp_path):
    drawing = stability_map(REAL)
    said = drawing.axes[0].texts[0].get_text()
    assert "critical stiffness per area 18.09 MPa/m" in said
    assert "nucleation length 1.658 km" in said
    assert "fault length 5 km" in said
    assert drawing.axes[0].get_ylabel() == "stiffness per area k/A [MPa/m]"
    assert "unstable, margin -0.502" in drawing.get_suptitle()
    drawing.savefig(tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 10_000


def test_a_pressure_that_opens_the_fault_is_refused():
    with pytest.raises(ParameterError, match="pressure must be below"):
        stability_map(REAL, pressure=60e6)
