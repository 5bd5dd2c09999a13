"""Laws of samples as matrices, against their recursions in exact arithmetic, and what makes no law."""

from fractions import Fraction as F
from random import Random

import pytest

from quakedesign.errors import ParameterError
from quakedesign.laws import ErrorModel, ImplicitStep, LinearLaw, Power, disturbance_estimate, summed_integrals
from quakedesign.loop import PeriodicLoop, Segment

ROOT = ImplicitStep(pull=(Power(factor=(F(1), F(1)), exponent=F(1), argument="slip"),))


def some(random):
    return F(random.choice([-1, 1]) * random.randint(1, 9), random.randint(1, 9))


def product(row, column):
    return sum((a * b for a, b in zip(row, column, strict=True)), F(0))


def pressures(law, errors):
    """p = Cz + Dy and z ← Fz + Gy, exactly."""
    z, asked = [F(0)] * len(law.states), []
    for y in errors:
        asked.append(product(law.output, z) + product(law.feedback, y))
        z = [product(own, z) + product(fed, y) for own, fed in zip(law.update, law.measured, strict=True)]
    return asked


def test_sums_of_the_error_are_those_of_the_recursion():
    random = Random(1)
    gains, step = tuple(some(random) for _ in range(4)), F(2, 7)
    errors = [(some(random), some(random)) for _ in range(6)]
    xi1, xi2, asked = F(0), F(0), []
    for e1, e2 in errors:
        asked.append(-gains[0] * e1 - gains[1] * e2 - gains[2] * xi1 - gains[3] * xi2)
        xi1, xi2 = xi1 + step * e1, xi2 + step * xi1
    law = summed_integrals(gains, step)
    assert pressures(law, errors) == asked
    assert law.states == ("xi1", "xi2")


@pytest.mark.parametrize("number", [3, 5])
def test_sums_take_four_gains(number):
    with pytest.raises(ParameterError, match=f"must be four. Received {number}"):
        summed_integrals((F(1),) * number, F(1))


@pytest.mark.parametrize("late", [0, 1, 3])
def test_the_estimate_is_its_recursion(late):
    """d ← d + a(e2 − π)/Σγ, p = −k1·e1 − k2·e2 − Σκ_j(p_j + d/b) − d/b, π ← Φ2e + Σγ_j(b·p_j + d), exactly."""
    random = Random(late)
    gains, weight, gain = tuple(some(random) for _ in range(2 + late)), some(random), abs(some(random))
    of_errors = tuple((some(random), some(random)) for _ in range(2))
    of_commands = tuple((some(random), some(random)) for _ in range(late + 1))
    share = weight / sum(of_rate for _, of_rate in of_commands)
    errors = [(some(random), some(random)) for _ in range(5)]
    expected, level, before, commanded = F(0), F(0), [F(0)] * late, []
    for e in errors:
        level += share * (e[1] - expected)
        commanded.append(-product(gains, [*e, *(p + level / gain for p in before)]) - level / gain)
        before = [commanded[-1], *before]
        pushed = sum(of_rate * (gain * p + level) for (_, of_rate), p in zip(of_commands, before, strict=True))
        expected = product(of_errors[1], e) + pushed
        before = before[:late]
    law = disturbance_estimate(gains, weight, ErrorModel.delayed(of_errors, of_commands, gain))
    assert pressures(law, errors) == commanded
    assert law.states == ("predicted_rate", "disturbance", *(f"asked_{j}_ago" for j in range(1, late + 1)))


EYE = ((F(1), F(0)), (F(0), F(1)))


def test_without_a_delay_the_measured_errors_are_fed_back():
    law = disturbance_estimate((F(2), F(3)), F(1, 2), ErrorModel.delayed(EYE, ((F(0), F(1)),), F(1)))
    assert law.feedback == (-2, -3 - F(1, 2))


@pytest.mark.parametrize("gain", [F(0), F(-1)])
def test_the_gain_of_a_model_is_positive(gain):
    with pytest.raises(ParameterError, match="must be positive"):
        ErrorModel.delayed(EYE, ((F(0), F(1)),), gain)


@pytest.mark.parametrize(
    ("of_commands", "said"),
    [
        ((), "γ of a delayed error model must be 1 × 2. Received 0 rows"),
        (((F(1),),), "γ of a delayed error model must be 1 × 2. Received 1 rows of 1 entries"),
        (((F(1), F(0)),), "effect of a constant pressure on the slip rate of an error model must not be 0"),
        (((F(1), F(1)), (F(1), F(-1))), "effect of a constant pressure on the slip rate of an error model must not"),
    ],
)
def test_commands_that_do_not_fit_or_do_not_act_are_rejected(of_commands, said):
    with pytest.raises(ParameterError, match=said):
        ErrorModel.delayed(EYE, of_commands, F(1))


def sizes(n, seen=2):
    return {
        "states": tuple(f"z{i}" for i in range(n)),
        "update": ((F(0),) * n,) * n,
        "measured": ((F(0),) * seen,) * n,
        "output": (F(1),) * n,
        "feedback": (F(1),) * seen,
    }


def test_as_many_states_as_are_said_fit():
    assert LinearLaw(**sizes(12)).implicit_step is None
    assert len(LinearLaw(**sizes(2, 3), implicit_step=ROOT).feedback) == 3


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (sizes(13), "must have at most 12 states, .*Received 13"),
        (sizes(2, 3), "matrix G of a linear law with 2 states must be 2 × 2. Received 2 rows of 3, 3 entries"),
        (sizes(2) | {"states": ("z", "z")}, "different names. Received 2: z, z"),
        (sizes(2) | {"update": ((F(0), F(0)), (F(0),))}, "matrix F .* 2 × 2. Received 2 rows of 2, 1 entries"),
        (sizes(2) | {"update": ((F(0), F(0)),)}, "matrix F .* 2 × 2. Received 1 rows of 2 entries"),
        (sizes(2) | {"measured": ((F(0), F(0)), (F(0), F(0), F(0)))}, "matrix G .* Received 2 rows of 2, 3 entries"),
        (sizes(2) | {"measured": ((F(0), F(0)),)}, "matrix G .* Received 1 rows of 2 entries"),
        (sizes(2) | {"output": (F(1),)}, "matrix C .* 1 × 2. Received 1 rows of 1 entries"),
        (sizes(2) | {"feedback": (F(1),)}, "matrix D .* 1 × 2. Received 1 rows of 1 entries"),
        (sizes(2) | {"implicit_step": ROOT}, "matrix G of a linear law with 2 states must be 2 × 3"),
    ],
)
def test_sizes_that_do_not_fit_are_refused(wrong, said):
    with pytest.raises(ParameterError, match=said):
        LinearLaw(**wrong)


def test_a_law_of_the_slip_alone_reads_no_slip_rate():
    blind = sizes(1) | {"feedback": (F(1), F(0))}
    assert LinearLaw(**blind).of_slip_alone is True
    assert LinearLaw(**sizes(1)).of_slip_alone is False
    assert LinearLaw(**blind | {"measured": ((F(0), F(2)),)}).of_slip_alone is False
    assert LinearLaw(**sizes(1, 3) | {"feedback": (F(1), F(0), F(1))}, implicit_step=ROOT).of_slip_alone is False


def test_a_period_is_the_sum_of_its_parts():
    parts = tuple(Segment(jump=((F(1),),), duration=F(1, n)) for n in (2, 3, 6))
    loop = PeriodicLoop(states=("x",), flow=((F(0),),), segments=parts, inputs={}, outputs={})
    assert (loop.period, loop.sampled) == (1, {})


def test_a_part_is_cut_where_it_says_or_into_eighths():
    part = Segment(jump=((F(1),),), duration=F(2))
    assert part.pieces() == part.pieces(past=True) == (F(1, 4),) * 8
    ends = {"ends": (F(0), F(1, 4), F(1)), "past_ends": (F(0), F(1, 2), F(1))}
    part = Segment(jump=((F(1),),), duration=F(2), **ends)
    assert part.pieces() == (F(1, 2), F(3, 2))
    assert part.pieces(past=True) == (1, 1)
