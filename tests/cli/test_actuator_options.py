"""Actuators as the command line makes them."""

import pytest

from quakedesign.cli.hardware import ActuatorOptions
from quakedesign.errors import ParameterError
from quakedesign.simulation import Delay, Diffusion, Lag, Quantisation, RateLimit, Saturation, stages


def actuator(step, **options):
    return ActuatorOptions(**options).build(step)


def test_nothing_asked_for_is_no_stage():
    assert actuator(0.1).stages == ()


def test_every_stage_of_the_package_can_be_asked_for_in_the_order_of_the_signal():
    found = actuator(
        0.1,
        delay=0.3,
        quantum=1e3,
        saturation=2e7,
        rate_limit=1e6,
        lag=1.0,
        diffusion=60.0,
        storage=1e-4,
        cells=8,
    ).stages
    assert {stage.name for stage in found} == set(stages())
    assert found[:5] == (
        Delay(samples=3),
        Quantisation(quantum=1e3),
        Saturation(lowest=-2e7, highest=2e7),
        RateLimit(rate=1e6),
        Lag(time_constant=1.0),
    )
    assert isinstance(found[5], Diffusion)
    assert found[5].time == pytest.approx(60.0, rel=1e-15)
    assert (found[5].storage, found[5].cells) == (1e-4, 8)


def test_a_pump_that_only_injects():
    assert actuator(0.1, saturation=2e7, withdrawal=0.0).stages == (Saturation(lowest=0.0, highest=2e7),)


def test_rock_of_unknown_storage_has_no_volume():
    assert not actuator(0.1, diffusion=60.0).stores
    assert actuator(0.1, diffusion=60.0, storage=1e-4).stores


@pytest.mark.parametrize("delay", [-0.1, 0.05, 0.1001, float("nan"), float("inf"), 1e300])
def test_a_delay_is_a_whole_number_of_periods(delay):
    with pytest.raises(ParameterError, match=r"whole number of sampling periods of 0\.1 s"):
        actuator(0.1, delay=delay)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"storage": 1.0}, "storage belongs to a diffusion"),
        ({"withdrawal": 1.0}, "withdrawal belongs to a saturation"),
        ({"saturation": -1.0}, "lowest and highest"),
        ({"quantum": 0.0}, "quantum"),
        ({"diffusion": 0.0}, "time"),
        ({"diffusion": 1.0, "storage": -1.0}, "storage"),
        ({"delay": 100.0}, "0 to 100"),
    ],
)
def test_what_a_stage_refuses_is_refused(more, said):
    with pytest.raises(ParameterError, match=said):
        actuator(0.1, **more)
