"""Orders of accuracy, measured against theory."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from thinned import few

from quakedesign.errors import ParameterError
from quakedesign.loop.sensing import Differentiator
from quakedesign.loop.sensing.choice import constants, error_scale, worst_errors
from quakedesign.loop.sensing.differentiator import DISCRETISATIONS

PAIRS = [(1, 0), (2, 0), (1, 1), (2, 2)]


def settled_errors(d, samples, noise=0.0, wave=0.0):
    """Largest errors on sin(t) over the second half of 12 s, with readings off by ±noise at random."""
    memory, slip = ca.SX.sym("memory", d.size), ca.SX.sym("slip")
    estimates, after = d.estimate([*map(ca.SX, d.numbers)], ca.vertsplit(memory), slip)
    function = ca.Function("d", [memory, slip], [ca.vertcat(*after), ca.vertcat(*estimates)])
    time = d.step * np.arange(samples)
    readings = np.sin(time) + noise * np.random.default_rng(1).choice([-1.0, 1.0], samples) + wave
    start = np.zeros(d.size)
    start[d.filter_order + 1] = 1.0
    _, found = function.mapaccum(samples)(start, readings[None, :])
    true = np.array([np.sin(time + i * np.pi / 2) for i in range(d.order + 1)])
    return abs(found.full() - true)[:, samples // 2 :].max(axis=1)


def slopes(errors, scales):
    return [np.polyfit(np.log(scales), np.log(column), 1)[0] for column in np.array(errors).T]


@pytest.mark.parametrize("discretisation", ["homogeneous", "implicit"])
@pytest.mark.parametrize(("order", "filters"), PAIRS)
def test_errors_fall_with_the_powers_of_the_sampling_period_that_theory_gives(order, filters, discretisation):
    steps = [0.02, 0.01, 0.005, 0.0025]
    made = [
        Differentiator(bound=1.3, step=t, order=order, filter_order=filters, discretisation=discretisation)
        for t in steps
    ]
    errors = [settled_errors(d, int(12 / d.step)) for d in made]
    found = slopes(errors, steps)
    first = 1 if discretisation == "implicit" else 0  # the implicit one passes exact readings on
    assert found[first:] == pytest.approx([order + 1 - i for i in range(first, order + 1)], abs=0.25)
    if first:
        assert np.array(errors)[:, 0].max() < 1e-14


def test_plain_euler_loses_an_order_between_the_first_and_the_last_estimate():
    """z_1 settles at x1' + T/2·x1'', as the Taylor expansion of z_0 tells."""
    steps = [0.02, 0.01, 0.005, 0.0025]
    euler = [Differentiator(bound=1.3, step=t, order=2, discretisation="euler") for t in steps]
    found = slopes([settled_errors(d, int(12 / d.step)) for d in euler], steps)
    assert found == pytest.approx([3, 1, 1], abs=0.25)


@few(
    ("order", "filters", "discretisation"),
    [(1, 0, "homogeneous"), (1, 0, "implicit"), (2, 0, "implicit"), (1, 2, "homogeneous")],
    every=2,
)
def test_errors_grow_with_the_powers_of_the_noise_that_theory_gives(order, filters, discretisation):
    """|ε_i| ~ ε^((n + 1 − i)/(n + 1)): never above the constants that adverse noise gave, of the same order."""
    noises, step = [1e-5, 1e-4, 1e-3, 1e-2], 2e-3
    d = Differentiator(bound=1.3, step=step, order=order, filter_order=filters, discretisation=discretisation)
    errors = [settled_errors(d, 6000, noise) for noise in noises]
    limits = [worst_errors(d, noise) for noise in noises]
    assert (np.array(errors) <= 1.05 * np.array(limits)).all()
    if filters == 0 and discretisation == "implicit":
        scales = [error_scale(d, noise) for noise in noises]
        assert slopes(errors, scales) == pytest.approx([order + 1 - i for i in range(order + 1)], abs=0.35)


@pytest.mark.parametrize("discretisation", ["homogeneous", "implicit"])
def test_a_wave_of_amplitude_one_at_high_frequency_is_filtered_out(discretisation):
    """Levant and Livne 2020: large noise whose local mean is small passes without a filter, and not with one."""
    samples, period = 12000, 8
    wave = np.cos(2 * np.pi * np.arange(samples) / period)
    errors = [
        settled_errors(
            Differentiator(bound=2.0, step=1e-3, filter_order=n, discretisation=discretisation), samples, wave=wave
        )
        for n in (0, 1, 2)
    ]
    assert errors[0][0] > 0.5
    assert errors[1][0] < 0.03 * errors[0][0]
    assert errors[2][0] < 0.5 * errors[1][0]
    assert errors[0][1] > 5 * errors[1][1] > 5 * errors[2][1]


@pytest.mark.slow
@pytest.mark.parametrize(("order", "theory"), [(1, [0, 1 / 2]), (2, [0, 1 / 3, 1]), (3, [0, 1 / 4, 11 / 12, 3 / 2])])
@pytest.mark.parametrize("filters", [0, 1])
def test_constants_of_the_implicit_one_are_the_next_terms_of_the_powers_of_the_logarithm(order, theory, filters):
    unit = Differentiator(bound=1.0, step=1.0, order=order, filter_order=filters)
    assert constants(unit, noisy=False) == pytest.approx(theory, abs=3e-3)


def test_errors_scale_with_bound_and_step():
    d = Differentiator(bound=50.0, step=1e-3)
    assert worst_errors(d)[1] == pytest.approx(0.5 * 50 * 1e-3)
    assert error_scale(d, 50 * 4e-6) == pytest.approx(2e-3)
    assert error_scale(d, 0.0) == 1e-3


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"bound": 0.0}, "bound"),
        ({"step": -1.0}, "step"),
        ({"order": 0}, "order"),
        ({"order": True}, "order"),
        ({"filter_order": -1}, "filter_order"),
        ({"order": 7, "filter_order": 6}, "at most 12"),
        ({"inner_steps": 0}, "inner_steps"),
        ({"discretisation": "exact"}, "discretisation"),
        ({"step": 1e-30, "order": 11}, "double precision"),
    ],
)
def test_what_cannot_be_is_refused(settings, named):
    with pytest.raises(ParameterError, match=named):
        Differentiator(**{"bound": 1.0, "step": 1e-3, **settings})


@pytest.mark.parametrize("discretisation", DISCRETISATIONS)
def test_steps_inside_are_those_of_a_faster_one_that_is_told_every_reading_often(discretisation):
    inside = Differentiator(bound=3.0, step=0.01, order=2, filter_order=1, discretisation=discretisation, inner_steps=4)
    faster = replace(inside, step=0.0025, inner_steps=1)
    states, after = [], []
    for d, times in ((inside, 1), (faster, 4)):
        memory, slip = ca.SX.sym("memory", d.size), ca.SX.sym("slip")
        estimates, end = d.estimate([*map(ca.SX, d.numbers)], ca.vertsplit(memory), slip)
        step = ca.Function("step", [memory, slip], [ca.vertcat(*end), ca.vertcat(*estimates)])
        state, told = ca.DM.zeros(d.size), None
        for reading in (0.1, 0.3, -0.2):
            for _ in range(times):
                state, told = step(state, reading)
        states.append(state.full().ravel())
        after.append(told.full().ravel())
    assert states[0] == pytest.approx(states[1], rel=1e-12)
    if discretisation == "implicit":  # the others estimate from earlier readings, not from this one's first steps
        assert after[0] == pytest.approx(after[1], rel=1e-12)
