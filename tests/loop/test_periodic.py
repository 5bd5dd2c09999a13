"""Parts of a period, by hand."""

from fractions import Fraction as F
from math import exp, factorial

import pytest

from quakedesign.errors import ParameterError
from quakedesign.loop import PeriodicLoop, Segment
from quakedesign.loop.periodic import Fading, Instants

ONE = ((F(1),),)


def test_a_flow_is_cut_into_eight_equal_pieces_unless_told():
    even = Segment(jump=ONE, duration=F(2))
    assert even.pieces() == even.pieces(past=True) == (F(1, 4),) * 8


def test_pieces_for_outputs_and_for_what_is_past_are_shares_of_the_duration():
    cut = Segment(jump=ONE, duration=F(6), ends=(F(0), F(1, 3), F(1)), past_ends=(F(0), F(1, 2), F(2, 3), F(1)))
    assert cut.pieces() == (2, 4)
    assert cut.pieces(past=True) == (3, 1, 2)


def test_a_period_is_as_long_as_its_segments_together():
    parts = tuple(Segment(jump=ONE, duration=F(time)) for time in ("1/2", "1/3"))
    loop = PeriodicLoop(states=("x",), flow=ONE, segments=parts, inputs={}, outputs={})
    assert loop.period == F(5, 6)
    assert PeriodicLoop(states=("x",), flow=ONE, segments=(), inputs={}, outputs={}).period == 0


def test_loops_that_are_alike_are_one_key():
    one, other = (
        PeriodicLoop(states=("x",), flow=ONE, segments=(), inputs=dict(given), outputs={})
        for given in ({"v": (F(1),), "w": (F(2),)}, {"w": (F(2),), "v": (F(1),)})
    )
    assert {one: "first"}[other] == "first"


@pytest.mark.parametrize("time", ["0", "1/9", "1/2", "5/3"])
def test_an_input_that_decays_is_below_its_bound_by_five_terms_of_the_series(time):
    input_ = Fading(entry=(F(1),), first=0, height=F(3), rate=F(3, 2), floor=F(1, 7))
    x = F(3, 2) * F(time)
    assert input_.weight(F(time)) == 3 / sum(x**k / factorial(k) for k in range(5)) + F(1, 7)
    assert input_.weight(F(time)) >= 3 * exp(-x) + 1 / 7 - 1e-12


STEP = F(1, 5)


@pytest.mark.parametrize(
    ("part", "times"),
    [
        ("0", {}),
        ("0", {"measured": STEP / 2}),
        ("0", {"arrived": STEP / 2}),
        ("0", {"ramp": STEP}),
        ("0", {"arrived": STEP / 4, "ramp": STEP / 2}),
        ("1/20", {"arrived": F(1, 20), "ramp": F(1, 10)}),
        ("1/8", {"ramp": F(3, 40)}),
    ],
)
def test_timing_errors_may_fill_the_interval(part, times):
    Instants(**times).require_within(STEP, F(part))
    for name in times:
        said = "jitter and ramp must not be" if name == "measured" else "begin and end between"
        with pytest.raises(ParameterError, match=said):
            Instants(**times | {name: times[name] + F(1, 10**9)}).require_within(STEP, F(part))


@pytest.mark.parametrize("name", ["measured", "arrived", "ramp"])
def test_a_timing_error_is_a_size(name):
    assert getattr(Instants(), name) == 0
    with pytest.raises(ParameterError, match=r"jitter and ramp must not be negative, .* at most half a step of 0\.2 s"):
        Instants(**{name: F(-1, 10**9)}).require_within(STEP, F(0))
