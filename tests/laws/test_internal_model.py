"""Compensators with a model of the path, against their recursion in exact arithmetic."""

from dataclasses import replace
from fractions import Fraction as F
from random import Random

import pytest

from quakedesign.errors import ParameterError
from quakedesign.laws import ErrorModel, disturbance_estimate, slip_observer

OF_ERRORS = (F(9, 8), F(2, 13)), (F(1, 12), F(3, 4))
OF_PRESSURES = (F(1, 5), F(1, 8), F(-1, 9)), (F(1, 6), F(-1, 5), F(2, 7))
OF_COMMAND = F(1, 30), F(1, 9)
PATH = (F(1, 2), F(1, 3), F(0)), (F(1, 7), F(2, 5), F(-1, 4)), (F(0), F(3, 8), F(1, 6))
GAINS = (F(4), F(2), F(3, 2), F(-5, 3), F(7, 4))
WEIGHT, GAIN = F(2, 5), F(3, 11)
CORRECTIONS = F(2, 3), F(5, 4), F(-7, 6)


def dot(row, values):
    return sum((a * b for a, b in zip(row, values, strict=True)), F(0))


MODEL = ErrorModel(
    update=(
        *((*now, *pushed) for now, pushed in zip(OF_ERRORS, OF_PRESSURES, strict=True)),
        *((F(0), F(0), *row) for row in PATH),
    ),
    command=tuple(GAIN * v for v in (*OF_COMMAND, *(1 - sum(row) for row in PATH))),
    gain=GAIN,
    pressures=("path0", "path1", "path2"),
    unit=GAIN,
)


def pressed(errors, level, scaled, more):
    """The commanded pressure, the prediction of both errors, and the path if the pressure is `more` than commanded."""
    pressures, constant = [q / GAIN for q in scaled], [sum(OF_PRESSURES[i]) + OF_COMMAND[i] for i in (0, 1)]
    k1, k2, *others = GAINS
    commanded = -k1 * errors[0] - k2 * errors[1] - dot(others, [q + level / GAIN for q in pressures]) - level / GAIN
    expected = [
        dot(OF_ERRORS[i], errors)
        + constant[i] * level
        + GAIN * (dot(OF_PRESSURES[i], pressures) + OF_COMMAND[i] * (commanded + more))
        for i in (0, 1)
    ]
    after = [dot(row, pressures) + (1 - sum(row)) * (commanded + more) for row in PATH]
    return commanded, expected, [GAIN * q for q in after]


def of_both(state, seen, more):
    """One sample of slip and slip rate: the states after it, and the commanded pressure."""
    predicted, level, *scaled = state
    level += WEIGHT * (seen[1] - predicted) / (sum(OF_PRESSURES[1]) + OF_COMMAND[1])
    asked, expected, after = pressed(seen, level, scaled, more)
    return [expected[1], level, *after], asked


def of_slip(state, seen, more):
    """The same of the slip alone."""
    slip, rate, level, *scaled = state
    wrong = seen[0] - slip
    slip, rate, level = (v + correction * wrong for v, correction in zip((slip, rate, level), CORRECTIONS, strict=True))
    asked, expected, after = pressed((slip, rate), level, scaled, more)
    return [*expected, level, *after], asked


FEEDBACK = (*GAINS[:2], *(k / GAIN for k in GAINS[2:]))  # of the states βb·q
ESTIMATE = disturbance_estimate(FEEDBACK, WEIGHT, MODEL)
OBSERVER = slip_observer(FEEDBACK, CORRECTIONS, MODEL)


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
        ({"update": MODEL.update[:4]}, "matrix A of an error model with 5 states must be 5 × 5. Received 4 rows"),
        ({"update": (*MODEL.update, MODEL.update[0])}, "must be 5 × 5. Received 6 rows"),
        ({"update": tuple(row[:4] for row in MODEL.update)}, "5 × 5. Received 5 rows of 4, 4, 4, 4, 4 entries"),
        ({"pressures": ()}, "matrix A of an error model with 2 states must be 2 × 2"),
        ({"command": MODEL.command[:2]}, "matrix B of an error model with 5 states must be 1 × 5. .* of 2 entries"),
        ({"command": (F(0), -GAIN * sum(OF_PRESSURES[1]), F(1), F(1), F(1))}, "must not be 0. Received 0"),
        ({"gain": F(0)}, "input gain of a model must be positive"),
        ({"gain": F(-1)}, "input gain of a model must be positive"),
    ],
)
def test_sizes_that_do_not_fit_and_pressures_that_move_nothing_are_rejected(wrong, said):
    with pytest.raises(ParameterError, match=said):
        replace(MODEL, **wrong)


@pytest.mark.parametrize("gains", [FEEDBACK[:4], (*FEEDBACK, F(1))])
def test_other_numbers_of_gains_are_rejected(gains):
    with pytest.raises(ParameterError, match=r"matrix k of an error model with 5 states must be 1 × 5"):
        disturbance_estimate(gains, WEIGHT, MODEL)
    with pytest.raises(ParameterError, match=r"matrix l of an error model .* must be 3 × 2. Received 2 rows"):
        MODEL.compensator(FEEDBACK, ((F(1), F(0)), (F(0), F(1))))
