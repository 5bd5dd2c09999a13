"""The public question of a guarantee takes quantities as the command line does, and asks the same."""

from fractions import Fraction as F

import pytest

import quakedesign as qd
from quakedesign.errors import ParameterError, UnitError
from quakedesign.loop.loop_setup import LoopSetup

REAL, LAB, CRUSTAL = map(qd.load_fault, ("real-fault", "lab-fault", "crustal-patch"))
STATIC_LAW = qd.SampledLaw.from_gains([1, 1, 1], step="0.1")
GAINS = ("6.96e8", "2.53e8", "6.02e8", "2.16e8")


def test_texts_with_units_are_the_exact_numbers_of_a_setup():
    told = {"step": "100 ms", "lag": "8 ms", "slip_noise": "0.1 um", "rate_noise": 1e-7}
    setup = LoopSetup(saturation="20 MPa", withdrawal="15e6", **told)
    same = {"step": F(1, 10), "lag": F(1, 125), "slip_noise": F(1, 10**7), "rate_noise": F(1, 10**7)}
    assert setup == LoopSetup(saturation=2 * 10**7, withdrawal=F(15 * 10**6), **same)
    assert (setup.pump.least, setup.pump.largest) == (-15 * 10**6, 20 * 10**6)


@pytest.mark.slow
def test_texts_with_units_are_the_exact_numbers_of_an_answer():
    told = {"step": "100 ms", "lag": "8 ms", "slip_noise": "0.1 um", "rate_noise": 1e-7}
    found = qd.guarantee(REAL, gains=GAINS, saturation="20 MPa", withdrawal="15e6", **told).proof
    held = found.sampled_loop
    assert (held.step, held.lag, held.slip_noise, held.rate_noise) == (F(1, 10), F(1, 125), F(1, 10**7), F(1, 10**7))
    assert (held.pump.least, held.pump.largest) == (-15 * 10**6, 20 * 10**6)
    same = {"step": held.step, "lag": held.lag, "slip_noise": held.slip_noise, "rate_noise": held.rate_noise}
    setup = LoopSetup(saturation=2 * 10**7, withdrawal=F(15 * 10**6), **same)
    assert qd.guarantee(REAL, "elqr", setup, gains=GAINS).proof == found


@pytest.mark.parametrize(
    ("more", "error", "said"),
    [
        ({"lag": "8 MPa"}, UnitError, "lag must be a quantity in s"),
        ({"slip_noise": "two um"}, UnitError, "slip noise must be a quantity in m"),
        ({"latency": "8 ms"}, ParameterError, "quantity of the loop setup must be"),
        ({"withdrawal": "1 MPa"}, ParameterError, "withdrawal needs saturation"),
        ({"stress": "25 kPa"}, ParameterError, "stress and spread need friction with a state"),
        ({"spread": 0.1}, ParameterError, "stress and spread need friction with a state"),
    ],
)
def test_what_is_no_quantity_and_belongs_to_another_friction_is_refused(more, error, said):
    with pytest.raises(error, match=said):
        qd.guarantee(REAL, gains=GAINS, **more)


PLANT = ({"plant": "stick-slip"}, "plant 'stick-slip'")
OBJECTIVE = ({"objective": "peak"}, "objective 'peak'")
CLASS = ({"disturbance_class": "rate"}, "class 'rate'")
GIVEN = ({"gains": GAINS}, "gains")
SCHEME = ({"scheme": "explicit"}, "scheme 'explicit'")
SPREAD = ({"spread": "0.1"}, "spread 1/10")
STRESS = ({"stress": "25 kPa"}, "stress '25 kPa'")


@pytest.mark.parametrize(
    ("more", "said"),
    [OBJECTIVE, CLASS, GIVEN, SCHEME, ({"rate_noise": "1 um/s"}, "rate_noise"), ({"jitter": "1 ms"}, "jitter")],
)
def test_slow_sliding_rejects_what_does_not_apply(more, said):
    with pytest.raises(ParameterError, match=f"slow sliding has a guarantee .*Received {said}. Omit"):
        qd.guarantee(CRUSTAL, lag="1 s", spread="0.1", **more)


@pytest.mark.parametrize(
    ("more", "said"),
    [PLANT, OBJECTIVE, CLASS, SCHEME, SPREAD, STRESS, ({"controller": "cta"}, "controller 'cta'")],
)
def test_an_uncertain_plant_rejects_options_of_a_fault(more, said):
    with pytest.raises(ParameterError, match=f"do not apply to an uncertain plant. Received {said}. Omit"):
        qd.guarantee(qd.UncertainPlant(A=[[-1]], B=[[1]]), gains=[[1]], step="0.1", **more)


@pytest.mark.parametrize(("more", "said"), [PLANT, OBJECTIVE, GIVEN, SCHEME, SPREAD, STRESS])
def test_a_given_law_rejects_options_of_a_design(more, said):
    with pytest.raises(ParameterError, match=f"a given law has guarantees .*Received {said}. Omit"):
        qd.guarantee(LAB, law=STATIC_LAW, **more)


def test_a_given_law_needs_friction_without_a_state():
    with pytest.raises(ParameterError, match=r"Received rate-and-state-aging friction\. Omit"):
        qd.guarantee(CRUSTAL, law=STATIC_LAW, disturbance_class="rate")


@pytest.mark.parametrize(
    ("controller", "more", "said"),
    [
        ("elqr", *GIVEN),
        ("elqr", *SCHEME),
        ("elqr", *SPREAD),
        ("elqr", *STRESS),
        ("cta", *SCHEME),
        ("cta", *STRESS),
        (qd.SampledLaw, {}, "controller 'user-law'"),
    ],
)
def test_the_stick_slip_plant_rejects_what_does_not_apply(controller, more, said):
    with pytest.raises(ParameterError, match=f"a guarantee on the stick-slip plant .*Received {said}. Omit"):
        qd.guarantee(LAB, controller, plant="stick-slip", **more)


def test_a_pump_withdraws_as_much_as_it_injects_unless_told():
    assert LoopSetup().pump is None
    pump = LoopSetup(saturation="3/2").pump
    assert (pump.least, pump.largest) == (-F(3, 2), F(3, 2))
