"""A patch of two sides is a row of squares that slip as one."""

from dataclasses import replace
from fractions import Fraction

import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault, parse_fault, scaled_fault
from quakedesign.fault.fault_toml import fault_toml
from quakedesign.fault.similarity import similarity
from quakedesign.plant import uncertain_plant
from quakedesign.symbolic.plant import plant_values

SQUARE = load_fault("real-fault")
ROW = replace(SQUARE, length=15e3, width=5e3, damping=3 * SQUARE.damping)


def test_a_row_of_squares_moves_as_one_of_them():
    assert plant_values(ROW) == plant_values(SQUARE)
    assert replace(uncertain_plant(ROW), name="") == replace(uncertain_plant(SQUARE), name="")
    assert ROW.natural_frequency == pytest.approx(SQUARE.natural_frequency, rel=1e-15)
    assert ROW.rest_slip == pytest.approx(SQUARE.rest_slip, rel=1e-12)
    assert ROW.authority == pytest.approx(SQUARE.authority, rel=1e-15)


def test_and_weighs_and_releases_as_much_as_all():
    assert ROW.squares == 3
    assert (ROW.area, ROW.side) == (15e3 * 5e3, 5e3)
    assert ROW.mass == pytest.approx(2500 * 15e3 * 5e3 * 5e3, rel=1e-15)
    assert ROW.stiffness == pytest.approx(30e9 * 15e3, rel=1e-15)  # G A/h
    assert ROW.seismic_moment == 30e9 * ROW.area * ROW.rest_slip  # G A D
    assert ROW.moment_of(0.5) == 30e9 * ROW.area * 0.5


def test_density_and_shear_modulus_from_mass_and_stiffness_per_area():
    """The line of docs/reference/fault_file.md: 5e5 kg/m² and 60 MPa/m with h = 200 m."""
    patch = replace(SQUARE, density=5e5 / 200, shear_modulus=60e6 * 200, length=300.0, width=200.0)
    assert (patch.density, patch.shear_modulus) == (2500, 12e9)
    assert (patch.mass / patch.area, patch.stiffness / patch.area) == pytest.approx((5e5, 60e6), rel=1e-14)


def test_the_sides_have_no_order():
    turned = replace(ROW, length=5e3, width=15e3)
    assert plant_values(turned) == plant_values(ROW)
    assert turned.mass == ROW.mass


def test_a_patch_shares_its_damping():
    half = replace(ROW, damping=SQUARE.damping)
    assert half.specific_damping == pytest.approx(SQUARE.specific_damping / 3, rel=1e-15)
    assert uncertain_plant(half).damping == Fraction(5 * 10**14, 3)


def test_a_square_of_two_sides_is_the_papers():
    assert plant_values(replace(SQUARE, width=5e3)) == plant_values(SQUARE)
    assert replace(SQUARE, width=5e3).mass == SQUARE.mass


@pytest.mark.parametrize("width", [0, -1.0, float("nan"), 1e50, "5 km"])
def test_an_unphysical_width_is_refused(width):
    with pytest.raises(ParameterError, match=r"width .*must"):
        replace(SQUARE, width=width)


@pytest.mark.parametrize("name", ["length", "width", "sampling_time"])
def test_the_message_of_a_negative_number_has_its_unit(name):
    unit = "s" if name == "sampling_time" else "m"
    with pytest.raises(ParameterError, match=f"{name} must be .* It is in {unit} here; check sign and unit"):
        replace(ROW, **{name: -1.0})


def test_a_patch_is_written_and_read_and_scaled():
    read = parse_fault(fault_toml(ROW), "row")
    assert read == ROW
    scales = similarity(ROW, replace(ROW, length=150.0, width=50.0)).scales
    small = scaled_fault(ROW, scales)
    assert (small.length, small.width) == pytest.approx((150, 50))
    assert similarity(ROW, SQUARE).unmatched == ("width",)
