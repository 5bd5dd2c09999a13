"""The implicit differentiator from rest is a filter of differences: its own step against both."""

from fractions import Fraction as F

import casadi as ca
import numpy as np
import pytest

from quakedesign.laws import LinearLaw
from quakedesign.loop.sensing.differentiator import (
    Differentiator,
    by_differences,
    lag_free,
    least_bound,
    names_before,
    rate_shares,
)

ACCELERATION, NOISE, STEP = F("2e-3"), F("2e-6"), F("0.184")


def test_shares_are_those_of_the_terms_without_lag():
    assert rate_shares(1) == (1, -1)
    assert rate_shares() == (F(3, 2), -2, F(1, 2))
    for order in (1, 2, 3, 5):
        ones = [F(1, j) for j in range(1, order + 1)]
        assert tuple(ones) == lag_free(order)[1]
        cubes = [sum(share * (-back) ** power for back, share in enumerate(rate_shares(order))) for power in (0, 1)]
        assert cubes == [0, 1]  # of a constant and of a straight line


def readings(order, seed):
    """Slips of accelerations at their ends with noise at its ends, from rest; of the last one all adds up."""
    random, h = np.random.default_rng(seed), float(STEP) / 2
    turns = random.random((400, 4)) < np.array([0.05, 0.3, 0.7, 0])
    signs = 1 - 2 * (np.cumsum(turns, axis=0) % 2)
    signs[:, 3] = 1 if order == 1 else 1 - 2 * (np.arange(400) // 3 % 2)
    x, v, found = np.zeros(4), np.zeros(4), []
    for k, sign in enumerate(signs):
        if k % 2 == 0:
            found.append(x + float(NOISE) * (-1) ** (k // 2))
        a = sign * float(ACCELERATION)
        x, v = x + h * v + h**2 / 2 * a, v + h * a
    return np.array(found)


def estimated(differentiator, x):
    """Slips and slip rates of the package's own step."""
    memory, slip = ca.SX.sym("memory", differentiator.size), ca.SX.sym("slip")
    told, after = differentiator.estimate([*map(ca.SX, differentiator.numbers)], ca.vertsplit(memory), slip)
    step = ca.Function("step", [memory, slip], [ca.vertcat(*after), ca.vertcat(*told[:2])]).map(x.shape[1])
    state, found = np.tile(np.array(differentiator.start)[:, None], x.shape[1]), []
    for row in x:
        state, both = (part.full() for part in step(state, row[None]))
        found.append(both)
    return np.array(found).swapaxes(0, 1)


@pytest.mark.parametrize("filters", [0, 1, 2])
@pytest.mark.parametrize("order", [1, 2])
def test_from_rest_it_is_that_filter_for_ever_with_a_bound_as_large(order, filters):
    x = readings(order, seed=order)
    past = np.vstack([np.zeros((order, 4)), x])
    rate = sum(float(share) * past[order - i : len(past) - i] for i, share in enumerate(rate_shares(order))) / 0.184
    bound = least_bound(ACCELERATION, NOISE, STEP, order)
    options = {"step": 0.184, "order": order, "filter_order": filters}
    slips, rates = estimated(Differentiator(bound=float(bound), **options), x)
    assert slips == pytest.approx(x, abs=1e-9 * np.abs(x).max())
    assert rates == pytest.approx(rate, abs=1e-7 * np.abs(rate).max())
    _, late = estimated(Differentiator(bound=float(bound) / 2, **options), x)
    assert np.abs(late - rate).max() > 1e-2 * np.abs(rate).max()


@pytest.mark.parametrize("order", [1, 2])
def test_the_least_bound_counts_differences_of_slips_and_of_noise(order):
    x = readings(order, seed=3)
    past = np.vstack([np.zeros((order + 1, 4)), x])
    largest = np.abs(np.diff(past, order + 1, axis=0)).max() / (1.1 * 0.184 ** (order + 1))
    assert largest == pytest.approx(float(least_bound(ACCELERATION, NOISE, STEP, order)), rel=1e-9)


def test_a_law_that_is_told_so_is_a_law_of_the_slip_alone():
    law = LinearLaw(
        states=("a", "b"),
        update=((F(1, 2), F(1, 3)), (F(0), F(-1, 4))),
        measured=((F(2), F(3)), (F(-1), F(5))),
        output=(F(7), F(-2)),
        feedback=(F(4), F(6)),
        applied=(F(1), F(9)),
    )
    told = by_differences(law, STEP)
    assert told.of_slip_alone
    assert (told.states, told.applied) == (("a", "b", *names_before()), (1, 9, 0, 0))
    slips = [F(0), F(0), *(F(int(v), 1000) for v in np.random.default_rng(1).integers(-99, 99, 8))]
    z, y = [F(0)] * 2, [F(0)] * 4
    dot = lambda row, values: sum(a * b for a, b in zip(row, values, strict=True))  # noqa: E731
    for k in range(2, len(slips)):
        seen = slips[k], (3 * slips[k] - 4 * slips[k - 1] + slips[k - 2]) / (2 * STEP)
        alone = slips[k], F(0)
        assert dot(law.output, z) + dot(law.feedback, seen) == dot(told.output, y) + dot(told.feedback, alone)
        z = [dot(own, z) + dot(fed, seen) for own, fed in zip(law.update, law.measured, strict=True)]
        y = [dot(own, y) + dot(fed, alone) for own, fed in zip(told.update, told.measured, strict=True)]
