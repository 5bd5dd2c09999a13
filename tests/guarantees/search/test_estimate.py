"""Estimates of gains against trapezoidal sums that are simulated impulse by impulse."""

from fractions import Fraction as F

import numpy as np
import pytest
from scipy.linalg import expm

from quakedesign.guarantees.exact.norms import BALLS, START, norms
from quakedesign.guarantees.search.float_bounds import FLOATS, gains_of
from quakedesign.loop import Fading, PeriodicLoop, Segment

FLOW = ((F(-1), F(2), F(0)), (F(-2), F(-3), F(1)), (F(0), F(1, 2), F(-1, 2)))
HOLD = ((F(1), F(0), F(1, 4)), (F(0), F(1), F(0)), (F(1, 5), F(-1, 3), F(1, 2)))
SLOW = ((F(1), F(0), F(0)), (F(0), F(1), F(0)), (F(0), F(1, 3), F(148, 100)))  # a mode of 0.9947
ROWS = {"y": (F(1), F(0), F(2)), "z": (F(0), F(-3), F(1))}
PIECES = 4


def loop_of(*segments):
    return PeriodicLoop(
        states=("a", "b", "c"),
        flow=FLOW,
        segments=tuple(Segment(jump=jump, duration=time) for jump, time in segments),
        inputs={"flows": (F(1), F(0), F(-2))},
        outputs=ROWS,
        sampled={"enters": (F(0), F(2), F(1))},
        feedthrough={("z", "flows"): F(1, 7)},
        start=((F(1, 2), F(0), F(0)), (F(0), F(0), F(1, 3))),
    )


def simulated(loop, periods):
    """Sums of the absolute responses to all impulses so far, at every end of a piece, and the free responses."""
    flow, rows = np.array(FLOW, float), np.array(list(ROWS.values()), float)
    entry, jumped = (np.array([row], float).T for row in (loop.inputs["flows"], loop.sampled["enters"]))
    columns = {"flows": np.zeros((3, 0)), "enters": np.zeros((3, 0)), START: np.array(loop.start, float).T}
    found = {name: [] for name in columns}
    for _ in range(periods):
        for number, segment in enumerate(loop.segments):
            piece = float(segment.duration) / PIECES
            step = expm(flow * piece)
            columns = {name: np.array(segment.jump, float) @ now for name, now in columns.items()}
            if number == 0:
                columns["enters"] = np.hstack([columns["enters"], jumped])
            for end in range(PIECES + 1):
                if end:
                    columns["flows"] = np.hstack([columns["flows"], entry * piece / 2])
                    columns = {name: step @ now for name, now in columns.items()}
                    columns["flows"] = np.hstack([columns["flows"], entry * piece / 2])
                for name, now in columns.items():
                    found[name].append(np.abs(rows @ now).sum(axis=1))
    return {name: np.array(heights).reshape(periods, -1, 2) for name, heights in found.items()}


@pytest.mark.parametrize(
    ("periods", "segments"), [(100, [(HOLD, F(1))]), (100, [(HOLD, F(2, 5)), (SLOW, F(1, 10))]), (1800, [(SLOW, F(1))])]
)
def test_an_estimate_is_the_trapezoidal_sum_of_all_responses(periods, segments):
    loop = loop_of(*segments)
    estimated, seen = gains_of(loop), simulated(loop, periods)
    assert estimated.keys() == {(y, name) for y in ROWS for name in seen}
    for (y, name), values in estimated.items():
        expected = (seen[name].max(axis=0) if name == START else seen[name][-1])[:, list(ROWS).index(y)]
        assert values == pytest.approx(expected + (y == "z" and name == "flows") / 7, rel=2e-3)
    proved = norms(loop)
    assert all(max(estimated[key]) <= float(max(proved[key])) * 1.001 for key in estimated)


def test_an_estimate_of_a_loop_that_grows_is_none():
    assert gains_of(loop_of((tuple(tuple(4 * v for v in row) for row in HOLD), F(1)))) is None


def test_balls_prove_and_floats_do_not():
    assert (BALLS.proves, FLOATS.proves) == (True, False)


def test_a_decaying_input_is_estimated_by_an_impulse_of_its_area():
    """x is halved every 4 s, after which the input b·(h·e^{−λθ} + f) begins: b(h/λ + fT)(1 + 1/2 + …)."""
    fading = Fading(entry=(F(3),), first=0, height=F(5), rate=F(2), floor=F(1, 7))
    loop = PeriodicLoop(
        states=("x",),
        flow=((F(0),),),
        segments=(Segment(jump=((F(1, 2),),), duration=F(4)),),
        inputs={},
        outputs={"x": (F(1),)},
        fading={"w": fading},
    )
    assert gains_of(loop)["x", "w"] == pytest.approx([3 * (5 / 2 + 4 / 7) * 2] * (PIECES + 1), rel=1e-4)
