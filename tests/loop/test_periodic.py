"""Parts of a period, by hand."""

from fractions import Fraction as F

from quakedesign.loop import PeriodicLoop, Segment

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
