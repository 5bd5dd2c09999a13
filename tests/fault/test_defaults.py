"""What a file may leave out, and what stands in its place."""

import math

import numpy as np
import pytest

from quakedesign.errors import ParameterError, ScenarioError
from quakedesign.fault import friction_laws, load_fault, parse_fault
from quakedesign.fault.fault_toml import radiation_damping
from quakedesign.symbolic import derive

PLAIN = """name = "own"
density = "2600 kg/m^3"
shear_modulus = "25 GPa"
length = "1.5 km"
effective_normal_stress = "25 MPa"
[friction]
law = "linear-slip-weakening"
residual = 0.45
drop = 0.15
critical_slip = "2 cm"
"""
TASK = '[task]\ntarget_slip = "5 cm"\noperation_time = "2 days"\nsampling_time = "7 ms"\n'


def test_radiation_damping_is_the_impedance_of_both_sides():
    # a half-space driven at v answers with ρ c_s v; two of them in series share the slip
    speed = math.sqrt(25e9 / 2600)
    assert radiation_damping(2600, 25e9, 1.5e3**2) == pytest.approx(2600 * speed / 2 * 1.5e3**2, rel=1e-14)


def test_a_fault_of_four_numbers_and_a_friction_law_has_a_task_like_the_papers():
    fault = parse_fault(PLAIN, "own.toml")
    assert fault.damping == pytest.approx(radiation_damping(2600, 25e9, 2.25e6), rel=1e-2)
    assert fault.damping <= radiation_damping(2600, 25e9, 2.25e6)
    assert fault.reference.target_slip == pytest.approx(0.15 * 25e6 * 1.5e3 / 25e9, rel=1e-2)  # all of the drop
    paper = load_fault("real-fault")
    ours, theirs = (f.natural_frequency * f.reference.operation_time for f in (fault, paper))
    assert ours == pytest.approx(theirs, rel=0.01)
    pole = max(z.real for z in derive(fault).eigenvalues)
    assert fault.sampling_time * pole <= 0.1
    assert (fault.source, len(fault.assumed)) == ("no source given", 5)


def floored(value, digits):
    """The first digits of a number, as text has them."""
    mantissa, exponent = f"{value:.15e}".split("e")
    return float(f"{mantissa[: digits + 1]}e{exponent}")


def test_numbers_are_rounded_down_so_that_they_stay_true():
    fault = parse_fault(PLAIN, "own.toml")
    assert fault.damping == floored(2600 * math.sqrt(25e9 / 2600) / 2 * 1.5e3**2, 3)
    assert fault.reference.operation_time == floored(4.6e5 * math.sqrt(2600 * 1.5e3**2 / 25e9), 3)
    assert fault.reference.target_slip == floored(fault.rest_slip, 3)
    pole = max(z.real for z in derive(fault).eigenvalues)  # this law is as steep at the start as anywhere
    assert fault.sampling_time == floored(0.1 / pole, 2)


RATE_WEAKENING = """law = "slip-rate-weakening"
residual = 0.45
drop = 0.15
critical_rate = "2 cm/s"
"""


@pytest.mark.parametrize("damping", ["1e12 kg/s", "9e14 kg/s"])
def test_the_period_follows_poles_of_the_rate_too(damping):
    """A real pole where the rate weakens friction faster than damping resists, no growth with more damping."""
    head = PLAIN[: PLAIN.index("law =")].replace("effective", f'damping = "{damping}"\neffective')
    fault = parse_fault(f'{head}{RATE_WEAKENING}[task]\ntarget_slip = "1 cm"\n', "own.toml")
    m, push = 2600 * 1.5e3**3, 25e6 * 1.5e3**2
    lost = fault.damping / m - push / m * 0.15 / 0.02
    k = 25e9 * 1.5e3 / m
    pace = max(math.sqrt(k), *np.roots([1, lost, k]).real)
    assert fault.sampling_time == floored(0.1 / pace, 2)


def test_complex_poles_grow_by_their_real_part():
    head = (
        PLAIN[: PLAIN.index("law =")].replace("25 MPa", "2.5 MPa").replace("effective", 'damping = "0 kg/s"\neffective')
    )
    law = RATE_WEAKENING.replace('"2 cm/s"', '"25 cm/s"')
    fault = parse_fault(f'{head}{law}[task]\ntarget_slip = "1 cm"\n', "own.toml")
    assert fault.sampling_time == floored(0.1 / fault.natural_frequency, 2)


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ('target_slip = "5 cm"', "target slip"),
        ('operation_time = "2 days"', "operation time"),
        ('sampling_time = "7 ms"', "sampling time"),
    ],
)
def test_what_is_given_is_not_assumed(given, word):
    told = " ".join(parse_fault(f"{PLAIN}[task]\n{given}\n", "own.toml").assumed)
    assert word not in told
    assert {"target slip", "operation time", "sampling time"} - {word} == {
        other for other in ("target slip", "operation time", "sampling time") if other in told
    }


def test_a_whole_file_assumes_nothing():
    assert load_fault("real-fault").assumed == ()
    text = PLAIN.replace("effective", 'damping = "1e13 kg/s"\neffective')
    whole = parse_fault(f'{text}{TASK}[disturbance]\namplitude = "1e-4 m/s^2"\nfrequency = "1 rad/s"\n', "own.toml")
    assert (whole.assumed, whole.damping, whole.sampling_time) == ((), 1e13, 0.007)
    assert whole.reference.operation_time == 2 * 86400


def test_a_sampling_time_is_not_longer_than_the_task_allows():
    fault = parse_fault(f'{PLAIN}[task]\noperation_time = "1 s"\n', "own.toml")
    assert fault.sampling_time == 0.001


def test_a_stable_fault_has_no_slip_of_its_own():
    stable = PLAIN.replace('"2 cm"', '"2 m"')
    with pytest.raises(ScenarioError, match=r"a stable fault has none .* friction weakens by at most .*check units"):
        parse_fault(stable, "own.toml")
    assert parse_fault(f'{stable}[task]\ntarget_slip = "5 cm"\n', "own.toml").reference.target_slip == 0.05


@pytest.mark.parametrize("value", ["0 s", "-1 s", "nan s"])
def test_a_wrong_task_is_not_replaced(value):
    with pytest.raises(ParameterError, match="sampling_time must be positive and finite"):
        parse_fault(f'{PLAIN}[task]\nsampling_time = "{value}"\n', "own.toml")


RATE = """law = "rate-and-state-aging"
reference_coefficient = 0.6
a = 0.01
b = 0.015
Dc = "1 mm"
V0 = "1 um/s"
slowest_rate = "1e-12 m/s"
fastest_rate = "1 m/s"
"""


def test_with_a_state_the_sampling_time_is_a_twentieth_of_the_ageing_time():
    """D_c/(20 V) at the task's mean rate, whatever the mass; a thousandth of the task where that is shorter."""
    head = PLAIN[: PLAIN.index("law =")]
    for days, expected in ((2, 1e-3 * 2 * 86400 / (20 * 0.05)), (0.0002, None)):
        task = f'[task]\ntarget_slip = "5 cm"\noperation_time = "{days} days"\n'
        fault = parse_fault(f"{head}{RATE}{task}", "own.toml")
        assert fault.sampling_time == floored(expected or 86.4 * days, 2)
        assert any("at most D_c/(20 V) in slow sliding" in said for said in fault.assumed)


def test_symbols_are_names():
    head = PLAIN[: PLAIN.index("law =")]
    law = parse_fault(f"{head}{RATE}{TASK}", "own.toml").friction
    assert (law.direct_effect, law.evolution_effect) == (0.01, 0.015)
    assert (law.critical_slip, law.reference_rate) == (1e-3, 1e-6)
    for spelt in ("d_c", "dc", "DC"):
        again = parse_fault(f"{head}{RATE.replace('Dc', spelt)}{TASK}", "own.toml").friction
        assert again == law
    with pytest.raises(ScenarioError, match=r"given, .* and friction with a state has none"):
        parse_fault(f"{head}{RATE}", "own.toml")
    with pytest.raises(ScenarioError, match=r"direct_effect must be given once. Received a and direct_effect"):
        parse_fault(f"{head}{RATE}direct_effect = 0.01\n{TASK}", "own.toml")
    assert set(friction_laws()) >= {law.name}


@pytest.mark.parametrize(
    ("more", "still"), [("", True), ('frequency = "1 rad/s"', False), ('constant = "1 kPa"', False)]
)
def test_a_sine_without_a_frequency_is_said_to_be_none(more, still):
    fault = parse_fault(f'{PLAIN}[disturbance]\namplitude = "5 kPa"\n{more}\n', "own.toml")
    assert any("its sine is 0 in every run" in said for said in fault.assumed) is still
