"""The loop setup: quantities with units in, exact numbers out; its fields are the options of the command line."""

from dataclasses import fields
from fractions import Fraction as F

import pytest

from quakedesign.cli.options import SetupOptions
from quakedesign.errors import ParameterError, UnitError
from quakedesign.exact import LowerBound, UpperBound
from quakedesign.fault import load_fault
from quakedesign.guarantees.exact.sampled_loop import ExactSetup, SampledLoop
from quakedesign.laws import summed_integrals
from quakedesign.loop.loop_setup import IDEAL, MEASURED, LoopSetup, Pump, quantities, require_step


def test_quantities_with_units_become_exact_numbers_in_si_units():
    setup = LoopSetup(step="184 ms", delay="20 ms", lag="3/10", slip_noise=5e-6, saturation="20 MPa")
    exact = (setup.step, setup.delay, setup.lag, setup.slip_noise, setup.saturation)
    assert exact == (F(23, 125), F(1, 50), F(3, 10), F(1, 200000), F(20000000))
    assert setup.to_dict()["step"] == "23/125"
    assert setup == LoopSetup(**{name: value for name, value in setup.given().items()})
    assert repr(LoopSetup(delay="20 ms", measured="slip")) == "LoopSetup(measured='slip', delay='0.02 s')"


@pytest.mark.parametrize(
    ("wrong", "error", "said"),
    [
        ({"delay": "-1 ms"}, ParameterError, "delay must be 0 or more. Received -0.001 s"),
        ({"lag": "8 MPa"}, UnitError, "lag must be a quantity in s"),
        ({"step": "0 s"}, ParameterError, "step must be positive"),
        ({"step": "-1 s"}, ParameterError, "step must be positive"),
        ({"rate_limit": "-1 Pa/s"}, ParameterError, "rate limit of a pump must be positive"),
        ({"step": "1e10 s"}, ParameterError, "step must be positive, between 1e-9 s and 1e9 s"),
        ({"measured": "slips"}, ParameterError, "measured must be .*slip"),
        ({"withdrawal": "1 MPa"}, ParameterError, "withdrawal needs saturation"),
        ({"saturation": "0 Pa"}, ParameterError, "the largest 0 or more"),
        ({"rate_limit": "0 Pa/s"}, ParameterError, "rate limit of a pump must be positive"),
    ],
)
def test_every_refusal_names_quantity_condition_and_value(wrong, error, said):
    with pytest.raises(error, match=said):
        LoopSetup(**wrong)


def test_another_name_is_refused_with_the_nearest():
    with pytest.raises(ParameterError, match="slip_noise"):
        IDEAL.with_given(slip_nois="1 um")
    assert IDEAL.with_given(delay=None) is IDEAL


def test_what_is_given_reaches_the_loop_and_the_delay_counts_from_the_middle_of_a_mean():
    law = summed_integrals(tuple(map(F, (1, 2, 3, 4))), F(1, 10))
    setup = LoopSetup(delay="1 ms", averaging_time="4 ms", jitter="1 ms", rate_noise=1e-7, saturation=5, withdrawal=0)
    held = ExactSetup.of(setup).with_law(law, F(1, 10))
    assert (held.delay, held.averaging, held.jitter, held.rate_noise) == (
        F(3, 1000),
        F(1, 250),
        F(1, 1000),
        F(1, 10**7),
    )
    assert held.pump == Pump(least=F(0), largest=F(5))
    assert ExactSetup.of(IDEAL).with_law(law, F(1, 10)) == SampledLoop(law=law, step=F(1, 10))


def test_every_quantity_is_an_option_with_its_unit_and_help():
    """Names, units and help texts are stated once: the command line reads them off the fields."""
    options = {part.name for part in fields(SetupOptions)}
    assert options == {*quantities(), "well", "diffusivity"}
    assert {part.name for part in fields(LoopSetup)} == {*quantities(), "measured"}
    for name, part in quantities().items():
        assert part["unit"] in ("s", "m", "m/s", "Pa", "Pa/s"), name
        assert part["help"].endswith("."), name
    assert SetupOptions(slip_noise="1/1000000", delay="0.02").setup(measured=MEASURED[1]) == LoopSetup(
        slip_noise="1 um", delay="20 ms", measured="slip"
    )


def test_a_step_is_from_a_nanosecond_to_a_gigasecond():
    for step in (F(1, 10**9), F(10**9)):
        require_step(step)
        with pytest.raises(ParameterError, match="between 1e-9 s and 1e9 s"):
            require_step(step + (step - 1) / 10**12)


def test_the_step_of_a_setup_is_that_of_the_fault():
    fault = load_fault("real-fault")
    timed, rest = LoopSetup(step="50 ms", delay="20 ms").at_step(fault)
    assert (timed.sampling_time, rest) == (0.05, LoopSetup(delay="20 ms"))
    assert LoopSetup(delay="20 ms").at_step(fault) == (fault, LoopSetup(delay="20 ms"))


def test_only_what_differs_from_an_ideal_loop_is_on_its_path_and_in_its_noise():
    assert IDEAL.path == IDEAL.noise == IDEAL.given() == {}
    assert IDEAL.measured == "slip-and-rate"
    assert {getattr(IDEAL, name) for name in quantities()} == {0, None}
    setup = LoopSetup(delay=1, lag=2, diffusion=3, slip_noise=4, rate_noise=5)
    assert setup.path == {"delay": 1, "lag": 2, "diffusion": 3}
    assert setup.noise == {"slip_noise": 4, "rate_noise": 5}


def test_one_limit_of_a_pump_may_be_zero():
    assert Pump(least=F(0), largest=F(5)).limits == (0, 5)
    assert Pump(least=F(-5), largest=F(0)).limits == (-5, 0)
    assert Pump(rate=F(3)).limits is None


@pytest.mark.parametrize(
    ("low", "high", "within"), [(-3, 5, True), (-4, 5, False), (-3, 6, False), (-4, 6, False)], ids=str
)
def test_pressures_stay_within_both_limits(low, high, within):
    said = Pump(least=F(-3), largest=F(5)).exceeded(LowerBound(F(low)), UpperBound(F(high)))
    assert (said == "") is within
    assert within or f"pressures from {low} Pa to {high} Pa may be commanded, but the pump supplies only -3 Pa" in said
    assert Pump(rate=F(1)).exceeded(LowerBound(F(low)), UpperBound(F(high))) == ""


def test_a_pump_makes_its_rate_times_the_time():
    pump = Pump(rate=F(3))
    assert pump.too_slow(UpperBound(F(6)), F(2)) == ""
    assert "changes of 6.01 Pa from one sample" in pump.too_slow(UpperBound(F("6.01")), F(2))
    assert "changes of any size from one sample" in pump.too_slow(None, F(2))
    assert Pump(least=F(-1), largest=F(1)).too_slow(None, F(2)) == ""


@pytest.mark.parametrize(
    ("pump", "said"),
    [
        (Pump(least=F(-3), largest=F(5)), "with a pump of -3 Pa to 5 Pa, whose limits"),
        (Pump(rate=F(2)), "with a pump of 2 Pa/s, whose limits"),
        (Pump(least=F(-3), largest=F(5), rate=F(2)), "with a pump of -3 Pa to 5 Pa, 2 Pa/s, whose limits"),
    ],
    ids=["pressures", "rate", "both"],
)
def test_the_clause_on_a_pump_names_each_of_its_limits(pump, said):
    assert pump.words().startswith(said)
