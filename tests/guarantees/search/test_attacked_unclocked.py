"""Guarantees of samples by no clock against thousands of courses of a simulator that knows the file's numbers alone."""

import json
from dataclasses import replace
from fractions import Fraction as F
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from quakedesign.guarantees import worst_tracking
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee

FILE = Path(__file__).parents[3] / "proofs" / "certificates" / "guarantee_no-clock_lab-fault.json"
LENGTHS = (F(1), F("5/4"), F("3/2"), F("7/4"), F(2))  # of intervals, over the shortest
PARTS = 4  # of an interval, in each of which all that is unknown is constant


@cache
def claim():
    return parse_guarantee(FILE.read_text())


def numbers(rows):
    return np.array([[float(F(v)) for v in row] for row in rows])


@cache
def flows():
    """For every length and vertex of (β, s), a part of an interval on e1, e2, p, p* and pushes of size 1."""
    task, step = claim().task, float(claim().sampled_loop.step)
    b, force = float(task.authority), float(task.reference_force + task.amplitude)
    found = np.empty((len(LENGTHS), 4, 4, 6))
    for vertex, (beta, slip) in enumerate(product(map(float, task.beta), map(float, task.slip_chord))):
        flow = np.zeros((6, 6))
        flow[0, 1] = 1
        flow[1] = [slip, -float(task.rate_chord[0]), beta * b, -beta * b, force, 0]
        flow[3, 5] = float(task.drift) / b
        for i, length in enumerate(LENGTHS):
            found[i, vertex] = expm(flow * step * float(length) / PARTS)[:4]
    return found


@cache
def sample():
    """Map of a sample on e1, e2, p, p* and the law's states, as the file has it."""
    loop = json.loads(FILE.read_text())["loop"]
    n = len(loop["states"])
    whole = np.diag([1.0, 1, 0, 1, *[0] * n])
    whole[2] = [*numbers([loop["feedback"]])[0], 0, 0, *numbers([loop["output"]])[0]]
    whole[4:, :2], whole[4:, 4:] = numbers(loop["measured"]), numbers(loop["update"])
    return whole


def attacked(periods, courses, seed, sweeps=4, lengths=(0, 1, 2, 3, 4)):
    """Largest |e1| and |e2|: intervals, slopes, gains and pushes follow the costate of the course before."""
    random = np.random.default_rng(seed)
    costates = random.standard_normal((periods, courses, len(sample()))) * [1e3, 1, 0, 0, *[0] * (len(sample()) - 4)]
    largest, options = np.zeros(2), np.array(list(lengths))
    for _ in range(sweeps):
        state, chosen = np.zeros((courses, len(sample()))), []
        for costate in costates:
            state = state @ sample().T
            ways = [followed(state, costate, np.full(courses, i)) for i in options]
            best = np.argmax([(costate * after).sum(axis=1) for after, _, _ in ways], axis=0)
            row = np.arange(courses)
            state = np.array([after for after, _, _ in ways])[best, row]
            chosen.append((options[best], np.array([way for _, way, _ in ways])[best, row]))
            largest = np.maximum(largest, np.array([peaks for _, _, peaks in ways])[best, row].max(axis=0))
        costates = backward(chosen, courses)
    return largest


def followed(state, costate, length):
    """After an interval of some length: the state, the vertices that were best, and the largest errors."""
    state, peaks, vertices, row = state.copy(), np.abs(state[:, :2]), [], np.arange(len(state))
    for _ in range(PARTS):
        maps = flows()[length]
        pushes = np.einsum("cvij,ci->cvj", maps[..., 4:], costate[:, :4])
        ahead = np.einsum("cvij,cj->cvi", maps[..., :4], state[:, :4]) + np.einsum(
            "cvij,cvj->cvi", maps[..., 4:], np.sign(pushes)
        )
        best = np.einsum("cvi,ci->cv", ahead, costate[:, :4]).argmax(axis=1)
        state[:, :4] = ahead[row, best]
        peaks = np.maximum(peaks, np.abs(state[:, :2]))
        vertices.append(best)
    return state, np.array(vertices).T, peaks


def backward(chosen, courses):
    """Costates at the ends of intervals, half of them of the slip error at the end, half of the slip-rate error."""
    costate, found = np.zeros((courses, len(sample()))), []
    costate[: courses // 2, 0] = costate[courses // 2 :, 1] = 1
    for length, vertices in reversed(chosen):
        found.append(costate)
        costate = costate.copy()
        for vertex in vertices.T[::-1]:
            costate[:, :4] = np.einsum("cij,ci->cj", flows()[length, vertex][..., :4], costate[:, :4])
        costate = costate @ sample()
    return np.array(found[::-1])


@pytest.mark.parametrize("courses", [250, pytest.param(2500, marks=pytest.mark.slow)])
def test_no_course_leaves_the_claims_and_some_come_near(courses):
    runs = [attacked(periods, courses // 2, seed) for periods, seed in ((8, 1), (40, 2))]
    slip, rate = np.max(runs, axis=0)
    assert slip <= claim().claims.slip_error <= 2 * slip
    assert rate <= claim().claims.slip_rate_error <= F("1.6") * rate


def test_intervals_that_change_do_more_than_the_longest_or_the_shortest_alone():
    changing = attacked(40, 60, 3)
    alone = np.maximum(*(attacked(40, 60, 3, lengths=[i]) for i in (0, len(LENGTHS) - 1)))
    assert (changing > alone * [1.02, 1.05]).all()


@pytest.mark.slow
def test_the_search_stays_inside_and_finds_more_than_by_a_clock():
    held = claim().sampled_loop
    seen = worst_tracking(claim())
    clocks = [replace(held, step=v, longest_step=F(0)) for v in (held.step, held.longest_step)]
    before = [worst_tracking(replace(claim(), sampled_loop=clock, reach=None)) for clock in clocks]
    assert max(v.slip_error for v in before) < seen.slip_error <= claim().claims.slip_error
    assert max(v.slip_rate_error for v in before) < seen.slip_rate_error <= claim().claims.slip_rate_error
    stuck = worst_tracking(claim(), sticks=True)
    assert stuck.slip_error <= claim().claims.slip_error
    assert stuck.slip_rate_error <= claim().claims.slip_rate_error
