"""An observer of slip, slip rate and disturbance: what it expects is what its own plant does."""

from fractions import Fraction as F
from random import Random

import numpy as np
import pytest
from scipy.linalg import expm

from quakedesign.errors import ParameterError
from quakedesign.laws import ErrorPrediction, slip_observer

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
    with pytest.raises(ParameterError, match=r"one entry more than ahead_of_pushes\. Received 1 and 1 entries"):
        ErrorPrediction(
            of_errors=((F(1), F(0)), (F(0), F(1))), of_pushes=((F(1), F(1)),), ahead_of_pushes=((F(1), F(1)),)
        )


def test_a_model_that_the_pressure_does_not_move_is_refused():
    prediction = ErrorPrediction(of_errors=((F(1), F(0)), (F(0), F(1))), of_pushes=((F(1), F(1)),))
    with pytest.raises(ParameterError, match="gain of a model must be positive"):
        slip_observer((F(1), F(1)), (F(1), F(1), F(1)), prediction, F(0))


def some(random, *size):
    """Fractions, in rows of rows."""
    return tuple(some(random, *size[1:]) for _ in range(size[0])) if size else F(random.randint(1, 19), 7) - 1


def product(row, column):
    return sum((a * b for a, b in zip(row, column, strict=True)), F(0))


@pytest.mark.parametrize("late", [0, 1, 3])
def test_the_matrices_are_the_recursion(late):
    """ê ← π + l(e1 − π1), d ← d + l3(e1 − π1), p by ê at its arrival, π ← Φê + Σγ_j(gain·p_j + d), exactly."""
    random = Random(late)
    gains, corrections, gain = some(random, 2), some(random, 3), F(3, 7)
    given = ErrorPrediction(
        of_errors=some(random, 2, 2),
        of_pushes=some(random, late + 1, 2),
        ahead=some(random, 2, 2),
        ahead_of_pushes=some(random, late, 2),
    )
    law = slip_observer(gains, corrections, given, gain)
    state, expected, level, before = [F(0)] * len(law.states), [F(0), F(0)], F(0), [F(0)] * late
    for e in some(random, 6, 2):
        new = e[0] - expected[0]
        seen = [v + c * new for v, c in zip(expected, corrections[:2], strict=True)]
        level += corrections[2] * new
        pushes = [gain * p + level for p in before]
        then = [
            product(row, seen) + product([v[i] for v in given.ahead_of_pushes], pushes)
            for i, row in enumerate(given.ahead)
        ]
        asked = -gains[0] * then[0] - gains[1] * then[1] - level / gain
        assert product(law.output, state) + product(law.feedback, e) == asked
        pushes = [gain * asked + level, *pushes]
        expected = [
            product(row, seen) + product([v[i] for v in given.of_pushes], pushes)
            for i, row in enumerate(given.of_errors)
        ]
        before = [asked, *before][:late]
        state = [product(own, state) + product(fed, e) for own, fed in zip(law.update, law.measured, strict=True)]
        assert state == [*expected, level, *before]


def test_without_a_delay_the_errors_of_now_are_those_that_are_met():
    given = ErrorPrediction(of_errors=((F(1), F(1)), (F(0), F(1))), of_pushes=((F(0), F(1)),))
    law = slip_observer((F(2), F(3)), (F(1, 2), F(1, 3), F(1, 5)), given, F(4))
    assert law.feedback == (-1 - 1 - F(1, 20), 0)
    with pytest.raises(ParameterError, match="must be positive"):
        slip_observer((F(2), F(3)), (F(1), F(1), F(1)), given, F(0))
