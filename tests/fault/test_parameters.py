"""Derived quantities against the paper's table and against hand calculation."""

import math
from dataclasses import replace
from itertools import product

import pytest
from scipy.optimize import brentq

from quakedesign.errors import ParameterError
from quakedesign.fault import Disturbance, friction_law, load_fault
from quakedesign.fault.model import magnitude as magnitude_of
from quakedesign.studies.fault_facts import fault_dict, fault_sentences

REAL, LAB = load_fault("real-fault"), load_fault("lab-fault")
PLANT = ("density", "shear_modulus", "length", "damping", "effective_normal_stress")


@pytest.mark.parametrize(("fault", "frequency"), [(REAL, 0.6928), (LAB, 127.6)], ids=lambda v: getattr(v, "name", ""))
def test_natural_frequency(fault, frequency):
    # √(k/m) = √(G/ρ)/L: √1.2e7/5000 = 0.69282, √162.8159/0.1 = 127.599
    assert fault.natural_frequency == pytest.approx(frequency, rel=1e-4)


def test_stiffness_is_modulus_times_length():
    # ERRATA 3: G/L, as printed, would give 6e6 N/m and ω_n = 1.4e-4 rad/s
    assert REAL.stiffness == 30e9 * 5000
    assert LAB.stiffness == pytest.approx(225.5e3 * 0.1)
    printed = math.sqrt(30e9 / 5000 / REAL.mass)
    assert printed == pytest.approx(1.4e-4, rel=0.02)
    assert LAB.natural_frequency / REAL.natural_frequency == pytest.approx(184.17, rel=1e-4)  # λ_t of the table


@pytest.mark.parametrize(
    ("fault", "moment", "magnitude"), [(REAL, 6.25e17, 5.79), (LAB, 17, -5.25)], ids=lambda v: getattr(v, "name", "")
)
def test_moment_and_magnitude_of_the_table(fault, moment, magnitude):
    """Of a fault on which friction loses all that it can, as the paper has it."""
    assert fault.side**3 * fault.stress_drop == pytest.approx(moment, rel=1e-12)
    assert round(magnitude_of(moment), 2) == magnitude


@pytest.mark.parametrize("fault", [REAL, LAB], ids=lambda fault: fault.name)
def test_the_moment_is_that_of_the_slip_at_which_the_fault_rests(fault):
    """Spring k and friction μ_res + Δμ e^(−D/d_c) balance: kD = Δμ(1 − e^(−D/d_c))σ'A."""
    law, load = fault.friction, fault.effective_normal_stress * fault.area
    lost = law.drop * load / fault.stiffness
    slip = brentq(lambda x: x - lost * -math.expm1(-x / law.critical_slip), lost / 100, lost)
    assert fault.seismic_moment == pytest.approx(fault.shear_modulus * fault.area * slip, rel=1e-9)
    assert fault.magnitude == pytest.approx(magnitude_of(fault.seismic_moment))


def test_a_stable_fault_has_neither_moment_nor_magnitude():
    stable = replace(REAL, friction=replace(REAL.friction, critical_slip=3.0))
    assert stable.stress_drop > 0
    assert (stable.seismic_moment, stable.magnitude) == (0, -math.inf)
    assert "no earthquake, so no seismic moment and no magnitude" in fault_sentences(stable)
    assert (fault_dict(stable)["seismic_moment"], fault_dict(stable)["magnitude"]) == (None, None)


def test_magnitudes_differ_by_two_thirds_of_the_logarithm_of_the_ratio():
    # ERRATA 4: 2/3·log10(3.68e16) = 11.044
    assert magnitude_of(6.25e17) - magnitude_of(17) == pytest.approx(2 / 3 * math.log10(6.25e17 / 17))
    assert REAL.magnitude - LAB.magnitude == pytest.approx(11.044, abs=5e-4)


def test_everything_per_unit_mass_follows_from_density_and_length():
    # m = 2500·1.25e11 = 3.125e14 kg; N̂ = 1/(ρL); k̂ = G/(ρL²); η̂ = η/m = 1.6 1/s
    assert REAL.mass == 3.125e14
    assert REAL.area == 2.5e7
    assert REAL.authority == pytest.approx(8e-8)
    assert REAL.specific_stiffness == pytest.approx(0.48)
    assert REAL.specific_damping == pytest.approx(1.6)
    assert REAL.damping_ratio == pytest.approx(1.6 / (2 * math.sqrt(0.48)))
    assert REAL.stress_drop == pytest.approx(5e6)


def test_friction_with_a_state_has_no_drop_of_its_own():
    """The ends of its working range say nothing about an event; the moment of a slip is G A D."""
    aging = friction_law("rate-and-state-aging")(
        reference_coefficient=0.6,
        direct_effect=0.01,
        evolution_effect=0.015,
        critical_slip=0.01,
        reference_rate=1e-6,
        slowest_rate=1e-12,
        fastest_rate=1.0,
    )
    fault = replace(REAL, friction=aging)
    assert all(math.isnan(v) for v in (fault.stress_drop, fault.seismic_moment, fault.magnitude, fault.rest_slip))
    assert fault.moment_of(0.1) == pytest.approx(30e9 * 5000**2 * 0.1)
    assert magnitude_of(fault.moment_of(0.1)) == pytest.approx(2 / 3 * math.log10(7.5e16) - 6.07)


def test_without_a_stress_drop_there_is_no_earthquake():
    calm = replace(REAL, friction=replace(REAL.friction, drop=0.0))
    assert calm.seismic_moment == 0
    assert calm.magnitude == -math.inf
    assert calm.rest_slip == 0


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize("name", ["density", "shear_modulus", "length", "effective_normal_stress", "sampling_time"])
def test_unphysical_values_are_refused(name, value):
    with pytest.raises(ParameterError, match=rf"^{name} must be positive and finite\. Received {value!r}"):
        replace(REAL, **{name: value})


def test_what_a_length_is_in_is_said():
    with pytest.raises(ParameterError, match=r"length must be .* It is in m here; check sign and unit\."):
        replace(REAL, length=-800.0)


def test_the_sign_of_stress_is_explained():
    with pytest.raises(ParameterError, match=r"Compression is positive here; check the sign\."):
        replace(REAL, effective_normal_stress=-5e7)


def test_damping_may_vanish_but_not_be_negative():
    assert replace(REAL, damping=0.0).damping_ratio == 0
    with pytest.raises(ParameterError, match="damping must be zero or positive"):
        replace(REAL, damping=-1.0)


@pytest.mark.parametrize(
    "extreme", [{"length": 1e300}, {"length": 1e-150}, {"density": 1e300, "length": 1e6}, {"shear_modulus": 1e307}]
)
def test_numbers_that_overflow_are_refused(extreme):
    with pytest.raises(ParameterError, match="must have a magnitude between 1e-40 and 1e\\+40 in SI units"):
        replace(REAL, **extreme)


@pytest.mark.parametrize("name", ["constant", "amplitude", "frequency", "slip_growth", "rate_growth"])
def test_a_disturbance_of_no_size_is_refused(name):
    with pytest.raises(ParameterError, match=f"{name} must have a magnitude between"):
        Disturbance(**{name: 3.2e160})


def test_every_fault_of_ordinary_numbers_has_derived_quantities():
    """At the corners of what is let pass nothing overflows or vanishes."""
    for extremes in product((1e-40, 1e40), repeat=5):
        fault = replace(REAL, **dict(zip(PLANT, extremes, strict=True)))
        for name in (*("mass", "stiffness", "authority", "specific_stiffness", "natural_frequency"), "damping_ratio"):
            assert 0 < getattr(fault, name) < math.inf
        assert 0 <= fault.seismic_moment < math.inf


def test_sampling_is_fine_against_the_operation():
    with pytest.raises(ParameterError, match="sampling_time must be at most a thousandth of the operation time"):
        replace(REAL, sampling_time=REAL.reference.operation_time / 999)


def test_a_fault_is_a_value():
    assert replace(REAL) == REAL
    assert hash(replace(REAL)) == hash(REAL)
    assert REAL.with_box("ten-percent").box.name == "ten-percent"
    assert REAL.box.name == "paper"
    assert REAL.with_disturbance(LAB.disturbance).disturbance == LAB.disturbance
    with pytest.raises(AttributeError):
        REAL.density = 1.0


def test_a_name_in_place_of_a_fault_is_refused_with_the_remedy():
    import quakedesign as qd

    for call in (
        lambda: qd.design("real-fault", "cta"),
        lambda: qd.simulate("real-fault"),
        lambda: qd.derive("real-fault"),
    ):
        with pytest.raises(ParameterError, match=r"Received 'real-fault'\. Give for example load_fault"):
            call()
