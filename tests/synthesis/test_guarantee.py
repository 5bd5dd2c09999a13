"""The public question of a guarantee takes quantities as the command line does, and asks the same."""

from fractions import Fraction as F

import pytest

import quakedesign as qd
from quakedesign.errors import ParameterError, UnitError
from quakedesign.loop.loop_setup import LoopSetup

REAL = qd.load_fault("real-fault")
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


@pytest.mark.parametrize(
    "more", [{"gains": GAINS}, {"objective": "peak"}, {"rate_noise": "1 um/s"}, {"jitter": "1 ms"}]
)
def test_slow_sliding_refuses_what_it_has_no_use_for(more):
    with pytest.raises(ParameterError, match="slow sliding has a guarantee for a designed law of the slip alone"):
        qd.guarantee(qd.load_fault("crustal-patch"), lag="1 s", **more)


def test_a_pump_withdraws_as_much_as_it_injects_unless_told():
    assert LoopSetup().pump is None
    pump = LoopSetup(saturation="3/2").pump
    assert (pump.least, pump.largest) == (-F(3, 2), F(3, 2))
