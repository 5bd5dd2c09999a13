"""An observer of slip, slip rate and disturbance: what it expects is what its own plant does."""

from fractions import Fraction as F
from random import Random

import numpy as np
import pytest
from scipy.linalg import expm

from quakedesign.laws import ErrorModel, slip_observer

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
    model = ErrorModel.delayed(rows(expm(FLOW * STEP)[:2, :2]), rows(pushes), F(GAIN))
    arrival = np.column_stack([expm(FLOW * delay)[:2, :2], *(GAIN * v for v in arriving)])
    gains = tuple(map(F, np.array([4, 2]) @ arrival))
    return slip_observer(gains, tuple(map(F, deadbeat())), model), whole, part, ages


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


def some(random, *size):
    """Fractions, in rows of rows."""
    return tuple(some(random, *size[1:]) for _ in range(size[0])) if size else F(random.randint(1, 19), 7) - 1


def product(row, column):
    return sum((a * b for a, b in zip(row, column, strict=True)), F(0))


@pytest.mark.parametrize("late", [0, 1, 3])
def test_the_matrices_are_the_recursion(late):
    """ê ← π + l(e1 − π1), d ← d + l3(e1 − π1), p = −kê − Σκ_j(p_j + d/b) − d/b, π ← Φê + Σγ_j(b·p_j + d), exactly."""
    random = Random(late)
    gains, corrections, gain = some(random, 2 + late), some(random, 3), F(3, 7)
    of_errors, of_commands = some(random, 2, 2), some(random, late + 1, 2)
    law = slip_observer(gains, corrections, ErrorModel.delayed(of_errors, of_commands, gain))
    state, expected, level, before = [F(0)] * len(law.states), [F(0), F(0)], F(0), [F(0)] * late
    for e in some(random, 6, 2):
        innovation = e[0] - expected[0]
        errors = [v + c * innovation for v, c in zip(expected, corrections[:2], strict=True)]
        level += corrections[2] * innovation
        commanded = -product(gains, [*errors, *(p + level / gain for p in before)]) - level / gain
        assert product(law.output, state) + product(law.feedback, e) == commanded
        pushes = [gain * p + level for p in (commanded, *before)]
        expected = [
            product(row, errors) + product([v[i] for v in of_commands], pushes) for i, row in enumerate(of_errors)
        ]
        before = [commanded, *before][:late]
        state = [product(own, state) + product(fed, e) for own, fed in zip(law.update, law.measured, strict=True)]
        assert state == [*expected, level, *before]


def test_without_a_delay_the_estimates_are_fed_back():
    model = ErrorModel.delayed(((F(1), F(1)), (F(0), F(1))), ((F(0), F(1)),), F(4))
    law = slip_observer((F(2), F(3)), (F(1, 2), F(1, 3), F(1, 5)), model)
    assert law.feedback == (-1 - 1 - F(1, 20), 0)
