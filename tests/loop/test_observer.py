"""An observer of slip, slip rate and disturbance: what it expects is what its own plant does."""

from fractions import Fraction as F

import numpy as np
import pytest
from scipy.linalg import expm

from quakedesign.errors import ParameterError
from quakedesign.loop import ErrorPrediction, slip_observer

STEP, GAIN, PUSH = 0.2, 2.4, 0.3
FLOW = np.array([[0, 1, 0], [0.5, -1.5, 1], [0, 0, 0]])  # e1, e2 and a constant push


def pushed(duration):
    return expm(FLOW * duration)[:2, 2]


def deadbeat():
    """Corrections with which three readings of a plant that is known tell its state and its push."""
    whole, slip = expm(FLOW * STEP), np.array([1.0, 0, 0])
    readings = np.array([slip, slip @ whole, slip @ whole @ whole])
    return whole @ whole @ np.linalg.solve(readings, [0, 0, 1])


def observer(delay):
    """Law for a delay, and how many whole and part periods that is."""
    whole, part = int(delay // STEP), delay % STEP
    ages = whole + (part > 0)
    pushes = [np.zeros(2)] * (ages + 1)
    pushes[whole] = pushed(STEP - part)
    if part:
        pushes[whole + 1] = pushed(STEP) - pushes[whole]
    arriving = [pushed(min(j * STEP, delay)) - pushed((j - 1) * STEP) for j in range(1, ages + 1)]
    rows = lambda m: tuple(tuple(map(F, row)) for row in m)  # noqa: E731
    prediction = ErrorPrediction(
        of_errors=rows(expm(FLOW * STEP)[:2, :2]),
        of_pushes=rows(pushes),
        ahead=rows(expm(FLOW * delay)[:2, :2]),
        ahead_of_pushes=rows(arriving),
    )
    return slip_observer((F(4), F(2)), tuple(map(F, deadbeat())), prediction, F(GAIN)), whole, part, ages


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.2, 0.27])
def test_it_knows_all_after_three_readings_and_then_places_the_poles_of_its_gains(delay):
    """No reading is new from then on, and e at the arrivals follows the plant with u = −k1e1 − k2e2."""
    law, whole, part, ages = observer(delay)
    f, g, c, d = (np.array(m, float) for m in (law.update, law.measured, law.output, law.feedback))
    z, e, asked, found = np.zeros(len(c)), np.array([0.1, -0.2]), [0.0] * (ages + 1), []
    assert d[1] == 0
    for k in range(12):
        if k > 2:
            assert z[0] == pytest.approx(e[0], abs=1e-9)
            assert z[1] == pytest.approx(e[1], abs=1e-9)
            assert z[2] == pytest.approx(PUSH, abs=1e-9)
        asked = [c @ z + d @ e, *asked][: ages + 1]
        z = f @ z + g @ e
        before = asked[whole + 1] if part else asked[whole]
        for duration, p in ((part, before), (STEP - part, asked[whole])):
            if p is asked[whole] and duration == STEP - part:
                found.append(e)
            e = expm(FLOW * duration)[:2, :2] @ e + pushed(duration) * (GAIN * p + PUSH)
    closed = expm(FLOW * STEP)[:2, :2] - np.outer(pushed(STEP), GAIN * np.array([4, 2]))
    for here, there in zip(found[ages + 3 : -1], found[ages + 4 :], strict=True):
        assert np.allclose(there, closed @ here, atol=1e-9)


def test_it_does_without_the_slip_rate():
    law = observer(0.05)[0]
    assert law.of_slip_alone
    assert law.states == ("predicted_slip", "predicted_rate", "disturbance", "asked_1_ago")


def test_a_prediction_of_one_push_too_few_is_refused():
    with pytest.raises(ParameterError, match=r"pushes from 0 and from 1 sample ago on\. Received 1 and 1"):
        ErrorPrediction(
            of_errors=((F(1), F(0)), (F(0), F(1))), of_pushes=((F(1), F(1)),), ahead_of_pushes=((F(1), F(1)),)
        )


def test_a_model_that_the_pressure_does_not_move_is_refused():
    prediction = ErrorPrediction(of_errors=((F(1), F(0)), (F(0), F(1))), of_pushes=((F(1), F(1)),))
    with pytest.raises(ParameterError, match="gain of a model must be positive"):
        slip_observer((F(1), F(1)), (F(1), F(1), F(1)), prediction, F(0))
