"""A law that knows its path, against its recursion in exact arithmetic."""

from dataclasses import replace
from fractions import Fraction as F
from random import Random

import pytest

from quakedesign.errors import ParameterError
from quakedesign.laws import PathModel, estimate_through_path, observer_through_path

MODEL = PathModel(
    of_errors=((F(9, 8), F(2, 13)), (F(1, 12), F(3, 4))),
    of_pressures=((F(1, 5), F(1, 8), F(-1, 9)), (F(1, 6), F(-1, 5), F(2, 7))),
    of_asked=(F(1, 30), F(1, 9)),
    kept=((F(1, 2), F(1, 3), F(0)), (F(1, 7), F(2, 5), F(-1, 4)), (F(0), F(3, 8), F(1, 6))),
)
GAINS = (F(4), F(2), F(3, 2), F(-5, 3), F(7, 4))
WEIGHT, GAIN = F(2, 5), F(3, 11)
CORRECTIONS = F(2, 3), F(5, 4), F(-7, 6)


def dot(row, values):
    return sum((a * b for a, b in zip(row, values, strict=True)), F(0))


def pressed(errors, level, scaled, more):
    """The pressure asked for, what is expected of both errors, and the path after so much more than asked for."""
    pressures, constant = [q / GAIN for q in scaled], [sum(MODEL.of_pressures[i]) + MODEL.of_asked[i] for i in (0, 1)]
    k1, k2, *others = GAINS
    asked = -k1 * errors[0] - k2 * errors[1] - dot(others, [q + level / GAIN for q in pressures]) - level / GAIN
    expected = [
        dot(MODEL.of_errors[i], errors)
        + constant[i] * level
        + GAIN * (dot(MODEL.of_pressures[i], pressures) + MODEL.of_asked[i] * (asked + more))
        for i in (0, 1)
    ]
    after = [dot(row, pressures) + (1 - sum(row)) * (asked + more) for row in MODEL.kept]
    return asked, expected, [GAIN * q for q in after]


def of_both(state, seen, more):
    """One sample of slip and slip rate: the states after it, and the pressure that is asked for."""
    predicted, level, *scaled = state
    level += WEIGHT * (seen[1] - predicted) / (sum(MODEL.of_pressures[1]) + MODEL.of_asked[1])
    asked, expected, after = pressed(seen, level, scaled, more)
    return [expected[1], level, *after], asked


def of_slip(state, seen, more):
    """The same of the slip alone."""
    slip, rate, level, *scaled = state
    wrong = seen[0] - slip
    slip, rate, level = (v + correction * wrong for v, correction in zip((slip, rate, level), CORRECTIONS, strict=True))
    asked, expected, after = pressed((slip, rate), level, scaled, more)
    return [*expected, level, *after], asked


ESTIMATE = estimate_through_path(GAINS, WEIGHT, MODEL, GAIN)
OBSERVER = observer_through_path(GAINS, CORRECTIONS, MODEL, GAIN)


@pytest.mark.parametrize(("law", "by_hand"), [(ESTIMATE, of_both), (OBSERVER, of_slip)], ids=["estimate", "observer"])
def test_a_sample_does_what_is_written(law, by_hand):
    random = Random(3)
    for _ in range(5):
        state, seen = ([F(random.randint(-9, 9), 7) for _ in range(n)] for n in (len(law.states), 2))
        after, asked = by_hand(state, seen, F(0))
        assert [dot(row, state) + dot(fed, seen) for row, fed in zip(law.update, law.measured, strict=True)] == after
        assert dot(law.output, state) + dot(law.feedback, seen) == asked
        told = by_hand(state, seen, F(7, 3))[0]
        assert told == [v + F(7, 3) * gained for v, gained in zip(after, law.applied, strict=True)]


def test_states_are_named_and_an_observer_does_without_the_slip_rate():
    path = ("path0", "path1", "path2")
    assert ESTIMATE.states == ("predicted_rate", "disturbance", *path)
    assert OBSERVER.states == ("predicted_slip", "predicted_rate", "disturbance", *path)
    assert (ESTIMATE.of_slip_alone, OBSERVER.of_slip_alone) == (False, True)


def test_a_constant_pressure_against_a_disturbance_is_a_steady_state():
    """e = 0, q = p = −d/(βb) and nothing to learn: π = βbΓp + Γd = 0."""
    for law, predicted in ((ESTIMATE, 1), (OBSERVER, 2)):
        state = [*[F(0)] * predicted, F(5), F(-5), F(-5), F(-5)]
        assert [dot(row, state) for row in law.update] == state
        assert dot(law.output, state) == F(-5) / GAIN


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"kept": MODEL.kept[:2]}, "kept of 3 × 3, .* Received 2 and 2 rows"),
        ({"kept": (*MODEL.kept, MODEL.kept[0])}, "kept of 3 × 3, .* Received 4 and 2 rows"),
        ({"kept": tuple(row[:2] for row in MODEL.kept)}, "rows of 2, 2, 2, 3, 3 entries"),
        ({"of_pressures": MODEL.of_pressures[::-1] * 2}, "of_pressures of 2 × 3 .* Received 3 and 4 rows"),
        ({"of_asked": (F(1),)}, "of_asked of 2 entries.* 1 entries of of_asked"),
        ({"of_asked": (F(1), -sum(MODEL.of_pressures[1]))}, "must not be 0. Received 0"),
    ],
)
def test_sizes_that_do_not_fit_and_pressures_that_move_nothing_are_refused(wrong, said):
    assert replace(MODEL, of_asked=(F(-1), F(1))).of_asked == (-1, 1)
    with pytest.raises(ParameterError, match=said):
        replace(MODEL, **wrong)


@pytest.mark.parametrize(("gains", "gain"), [(GAINS[:4], GAIN), ((*GAINS, F(1)), GAIN), (GAINS, F(0)), (GAINS, F(-1))])
def test_other_gains_are_refused(gains, gain):
    with pytest.raises(ParameterError, match="a path model of 3 pressures needs 5 gains and a positive input gain"):
        estimate_through_path(gains, WEIGHT, MODEL, gain)
    with pytest.raises(ParameterError, match="a path model of 3 pressures needs 5 gains and a positive input gain"):
        observer_through_path(gains, CORRECTIONS, MODEL, gain)
