"""What the sampled schemes share: a sensor must be made for the period of the loop."""

import pytest

from quakedesign.controllers import published
from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.simulation import Differentiator, OutputFeedback, simulate, simulation_scheme

LAB = load_fault("lab-fault")
LAW = published("lab-fault")["cta"]
SENSOR = OutputFeedback(differentiator=Differentiator(bound=100.0, step=1e-4))


def test_a_sensor_of_another_period_does_not_pass_silently():
    with pytest.raises(ParameterError, match=r"that of the sensor, 0\.0001 s\. Received 0\.001 s"):
        simulate(LAB, LAW, step=1e-3, scheme="explicit", measurement=SENSOR, duration=0.1)


def test_a_sensor_can_be_told_to_simulate_or_to_the_scheme():
    runs = [
        simulate(LAB, LAW, step=1e-4, duration=0.01, compiled=False, **told)
        for told in (
            {"scheme": "implicit", "measurement": SENSOR},
            {"scheme": simulation_scheme("implicit", measurement=SENSOR)},
        )
    ]
    assert (runs[0].slip == runs[1].slip).all()
    assert runs[0].metrics.peak_slip_rate > 0
