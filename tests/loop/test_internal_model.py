"""A law that knows its path, against its recursion in exact arithmetic."""

from dataclasses import replace
from fractions import Fraction as F
from random import Random

import pytest

from quakedesign.errors import ParameterError
from quakedesign.loop import PathModel, estimate_through_path

MODEL = PathModel(
    of_slip=F(1, 12),
    of_rate=F(3, 4),
    of_pressures=(F(1, 6), F(-1, 5), F(2, 7)),
    of_asked=F(1, 9),
    kept=((F(1, 2), F(1, 3), F(0)), (F(1, 7), F(2, 5), F(-1, 4)), (F(0), F(3, 8), F(1, 6))),
)
GAINS = (F(4), F(2), F(3, 2), F(-5, 3), F(7, 4))
WEIGHT, GAIN = F(2, 5), F(3, 11)


def dot(row, values):
    return sum((a * b for a, b in zip(row, values, strict=True)), F(0))


def by_hand(state, slip, rate, more=F(0)):
    """One sample: the states after it, and the pressure that is asked for; so much more is applied."""
    predicted, level, *scaled = state
    pressures, constant = [q / GAIN for q in scaled], sum(MODEL.of_pressures) + MODEL.of_asked
    level += WEIGHT * (rate - predicted) / constant
    k1, k2, *others = GAINS
    asked = -k1 * slip - k2 * rate - dot(others, [q + level / GAIN for q in pressures]) - level / GAIN
    predicted = MODEL.of_slip * slip + MODEL.of_rate * rate + constant * level
    predicted += GAIN * (dot(MODEL.of_pressures, pressures) + MODEL.of_asked * (asked + more))
    after = [dot(row, pressures) + (1 - sum(row)) * (asked + more) for row in MODEL.kept]
    return [predicted, level, *(GAIN * q for q in after)], asked


def test_a_sample_does_what_is_written():
    law, random = estimate_through_path(GAINS, WEIGHT, MODEL, GAIN), Random(3)
    assert law.states == ("predicted_rate", "disturbance", "path0", "path1", "path2")
    for _ in range(5):
        state, seen = ([F(random.randint(-9, 9), 7) for _ in range(n)] for n in (5, 2))
        after, asked = by_hand(state, *seen)
        assert [dot(row, state) + dot(fed, seen) for row, fed in zip(law.update, law.measured, strict=True)] == after
        assert dot(law.output, state) + dot(law.feedback, seen) == asked
        told = by_hand(state, *seen, more=F(7, 3))[0]
        assert told == [v + F(7, 3) * gained for v, gained in zip(after, law.applied, strict=True)]


def test_a_constant_pressure_against_a_disturbance_is_a_steady_state():
    """e = 0, q = p = −d/(βb) and nothing to learn: π = βbΓp + Γd = 0."""
    law = estimate_through_path(GAINS, WEIGHT, MODEL, GAIN)
    state = [F(0), F(5), F(-5), F(-5), F(-5)]
    assert [dot(row, state) for row in law.update] == state
    assert dot(law.output, state) == F(-5) / GAIN


@pytest.mark.parametrize(
    "wrong",
    [
        {"kept": MODEL.kept[:2]},
        {"kept": (*MODEL.kept, MODEL.kept[0])},
        {"kept": tuple(row[:2] for row in MODEL.kept)},
        {"of_asked": -sum(MODEL.of_pressures)},
    ],
)
def test_sizes_that_do_not_fit_and_pressures_that_move_nothing_are_refused(wrong):
    assert replace(MODEL, of_slip=F(1)).of_slip == 1
    with pytest.raises(ParameterError, match="a model of 3 pressures needs 3 × 3 numbers"):
        replace(MODEL, **wrong)


@pytest.mark.parametrize(("gains", "gain"), [(GAINS[:4], GAIN), ((*GAINS, F(1)), GAIN), (GAINS, F(0)), (GAINS, F(-1))])
def test_other_gains_are_refused(gains, gain):
    with pytest.raises(ParameterError, match="a model of 3 pressures needs 5 gains and a positive gain"):
        estimate_through_path(gains, WEIGHT, MODEL, gain)
