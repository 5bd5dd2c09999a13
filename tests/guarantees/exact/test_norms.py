"""L1 norms against closed forms; every bound must lie above, and close."""

from dataclasses import replace
from fractions import Fraction as F
from math import exp

import pytest

from quakedesign.errors import ParameterError
from quakedesign.guarantees.exact.norms import norms
from quakedesign.loop import PeriodicLoop, Segment


def loop(flow, jumps, durations, entry, row):
    matrix = lambda rows: tuple(tuple(F(v) for v in r) for r in rows)  # noqa: E731
    return PeriodicLoop(
        states=tuple(f"x{i}" for i in range(len(flow))),
        flow=matrix(flow),
        segments=tuple(Segment(jump=matrix(j), duration=F(d)) for j, d in zip(jumps, durations, strict=True)),
        inputs={"w": tuple(map(F, entry))},
        outputs={"y": tuple(map(F, row))},
    )


def gain(*arguments):
    return float(max(norms(loop(*arguments))["y", "w"]))


def just_above(found, exact, share=2e-3):
    return exact <= found <= exact * (1 + share)


def test_a_lag_without_jumps_has_gain_one():
    """∫ e^{−t} dt."""
    assert just_above(gain([[-1]], [[[1]]], ["1/2"], [1], [1]), 1)


def test_a_lag_that_is_halved_at_every_sample():
    """Worst just before a jump: (1 − e^{−T})(1 + q + q² …), q = e^{−T}/2."""
    assert just_above(gain([[-1]], [[["1/2"]]], ["1/2"], [1], [1]), (1 - exp(-0.5)) / (1 - exp(-0.5) / 2))


def test_an_integrator_that_is_reset_counts_one_period_only():
    found = norms(loop([[0]], [[[0]]], [3], [1], [1]))["y", "w"]
    assert [round(float(v), 6) for v in found] == [3 * (i + 1) / 8 for i in range(8)]


def test_two_jumps_in_a_period():
    """x → x/2 and x → x/3 after 1 s and 2 s: before the first jump 2 + 1/3·(1 + …), period map 1/6."""
    before_first = (2 + 1 / 3) / (1 - 1 / 6)
    before_second = 1 + before_first / 2
    assert just_above(gain([[0]], [[["1/2"]], [["1/3"]]], [1, 2], [1], [1]), max(before_first, before_second))


def test_an_oscillator_that_changes_sign_between_the_ends_of_pieces():
    """y″ + y′/10 + y = w has the gain coth(πζ/(2√(1 − ζ²))), ζ = 1/20; its impulse response changes sign for ever."""
    from math import pi, sqrt, tanh

    exact = 1 / tanh(pi / 20 / 2 / sqrt(1 - 1 / 400))
    assert just_above(gain([[0, 1], [-1, "-1/10"]], [[[1, 0], [0, 1]]], ["1/2"], [0, 1], [1, 0]), exact)
    coarse = gain([[0, 1], [-1, "-1/10"]], [[[1, 0], [0, 1]]], [20], [0, 1], [1, 0])
    assert coarse >= exact


def test_an_unstable_loop_has_no_gain():
    with pytest.raises(ParameterError, match="stable"):
        norms(loop([[1]], [[[1]]], [1], [1], [1]))


def test_a_loop_that_is_barely_stable_has_its_large_gain():
    assert just_above(gain([["-1/100"]], [[[1]]], [1], [1], [1]), 100)


def test_a_loop_that_first_grows_and_then_falls_slowly_has_its_gain():
    """x → qx, y → x + y/2 at every second, q = 1 − 2⁻¹⁵: all of 1/((1 − q)(1 − 1/2)) is positive."""
    assert just_above(gain([[0, 0], [0, 0]], [[["32767/32768", 0], [1, "1/2"]]], [1], [1, 0], [0, 1]), 2**16)


def sampled_gain(flow, jumps, durations, entry, row):
    given = loop(flow, jumps, durations, [0] * len(entry), row)
    return norms(replace(given, sampled={"v": tuple(map(F, entry))}))["y", "v"]


def test_a_sampled_input_is_a_sum_over_the_samples():
    """x → x/2 + v at every sample and x′ = −x: 1 + q + q² …, q = e^{−T}/2, worst just after a sample."""
    found = sampled_gain([[-1]], [[["1/2"]]], ["1/2"], [1], [1])
    assert just_above(float(max(found)), 1 / (1 - exp(-0.5) / 2))
    assert just_above(float(found[-1]), exp(-0.5 * 7 / 8) / (1 - exp(-0.5) / 2))


def test_a_sampled_input_of_an_integrator_chain_grows_between_samples():
    """A reset at every sample leaves |c·e^{Aθ}j| of the last one: y = θ, at most T."""
    found = sampled_gain([[0, 1], [0, 0]], [[[0, 0], [0, 0]]], [3], [0, 1], [1, 0])
    assert [round(float(v), 6) for v in found] == [3 * (i + 1) / 8 for i in range(8)]


def test_a_sampled_input_enters_once_a_period_of_two_jumps():
    """x → x/2 + v after the first, x → x/3 after the second: 1/(1 − 1/6) after the first jump, a third after that."""
    found = [round(float(v), 6) for v in sampled_gain([[0]], [[["1/2"]], [["1/3"]]], [1, 2], [1], [1])]
    assert found == [round(6 / 5, 6)] * 8 + [round(2 / 5, 6)] * 8


def test_a_sampled_input_that_bends_between_the_ends_of_pieces_is_bounded_there():
    """y″ = −y, reset at every sample: |sin θ| reaches 1 between the ends of pieces of 1 s, and never more."""
    found = sampled_gain([[0, 1], [-1, 0]], [[[0, 0], [0, 0]]], [8], [0, 1], [1, 0])
    assert 1 <= max(found) <= F(13, 10)


def test_norms_of_a_loop_are_computed_once(monkeypatch):
    first = norms(loop([[-3]], [[[1]]], [1], [1], [1]))
    kept = dict(first)
    first.clear()
    monkeypatch.setattr("quakedesign.guarantees.exact.norms.responses", None)
    assert norms(loop([[-3]], [[[1]]], [1], [1], [1])) == kept
    other = loop([[-3]], [[[1]]], [1], [1], [1])
    for part in ("inputs", "outputs", "sampled"):
        with pytest.raises(TypeError):
            norms(replace(other, **{part: getattr(other, part) | {"u": (F(1),)}}))
