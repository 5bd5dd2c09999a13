"""Load points as straight pieces: rates and times of made-up motions come back, in noise that is white or shared."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from quakedesign.errors import RecordError
from quakedesign.identification.loading import (
    Loading,
    Pieces,
    _needed,
    given_pieces,
    prepared,
    staircase,
    straight_pieces,
)
from quakedesign.identification.record import Record, reading_step, scatter

TIME = np.arange(0.0, 120.0, 0.05)
STEPS = ((0.0, 1e-6), (40.0, 1e-5), (60.0, 0.0), (80.0, 3e-6))


def moved(steps=STEPS, time=TIME):
    begins = [begin for begin, _ in steps]
    whole = np.zeros_like(time)
    for (begin, rate), end in zip(steps, [*begins[1:], np.inf], strict=True):
        whole += rate * np.clip(time - begin, 0, end - begin)
    return whole


def shared(size, fading, seed=1):
    draw, noise = np.random.default_rng(seed).standard_normal(len(TIME)), np.zeros(len(TIME))
    for i in range(1, len(TIME)):
        noise[i] = fading * noise[i - 1] + (1 - fading**2) ** 0.5 * draw[i]
    return size * noise


NOISES = {
    "none": np.zeros_like(TIME),
    "white, 0.3 um": 3e-7 * np.random.default_rng(0).standard_normal(len(TIME)),
    "shared, 0.45 um": shared(4.5e-7, 0.95),
}


@pytest.mark.parametrize("noise", NOISES)
def test_rates_and_times_come_back(noise):
    x = moved() + NOISES[noise]
    pieces = straight_pieces(TIME, x, scatter(TIME, x), reading_step(x))
    close = 1e-4 if noise == "none" else 0.7  # s; 0.5 um are 0.5 s at 1 um/s
    np.testing.assert_allclose(pieces.begins, [0, 40, 60, 80], atol=close)
    np.testing.assert_allclose(pieces.rates, [rate for _, rate in STEPS], rtol=0.02, atol=5e-8)
    assert not pieces.rough
    assert pieces.noise == pytest.approx(np.std(NOISES[noise]), abs=3e-8)
    np.testing.assert_allclose(pieces.position(TIME), moved(), atol=8e-7)


@pytest.mark.slow
@pytest.mark.parametrize("fading", [0.0, 0.9])
def test_errors_of_rates_are_as_large_as_rates_scatter(fading):
    """Over 40 noises, against the scatter of the rates that are found; none of them makes a change of rate."""
    time, found, told = np.arange(0.0, 55.0, 0.05), [], []
    for seed in range(40):
        noise = shared(4.5e-7, fading, seed)[: len(time)]
        x = moved(((0.0, 1e-6), (30.0, 1e-5)), time) + noise
        pieces = straight_pieces(time, x, scatter(time, x), reading_step(x))
        assert len(pieces.rates) == 2
        found.append(np.log(pieces.rates))
        told.append(pieces.errors)
    np.testing.assert_allclose(np.mean(told, axis=0), np.std(found, axis=0), rtol=0.35)
    assert staircase(time, np.full(len(time), 1e-6)).errors is None


def test_a_piece_between_two_samples_has_no_delay():
    record, loading = prepared(made(moved(((0.0, 1e-6), (10.02, 1e-5), (10.03, 3e-6))) + NOISES["white, 0.3 um"]))
    pieces = replace(
        loading.pieces, begins=np.array([0.0, 10.02, 10.03]), rates=np.array([1e-6, 1e-5, 3e-6]), noise=3e-7
    )
    plain = replace(record, time=TIME, counts=np.ones(len(TIME)))
    after, most = replace(loading, pieces=replace(pieces, rough=False)).delays(plain)
    assert after.shape == (len(TIME), 1)
    assert np.flatnonzero(after[:, 0])[0] == np.searchsorted(TIME, 10.03)
    assert len(most) == 1


def test_readings_in_steps_leave_no_more_pieces():
    x = np.round(moved() / 1e-7) * 1e-7
    pieces = straight_pieces(TIME, x, scatter(TIME, x), reading_step(x))
    np.testing.assert_allclose(pieces.begins, [0, 40, 60, 80], atol=0.05)


def test_a_motion_of_no_straight_pieces_is_rough_and_followed_as_it_was_measured():
    x = 1e-6 * TIME + 2e-5 * np.sin(TIME / 2)
    assert straight_pieces(TIME, x, scatter(TIME, x), reading_step(x)).rough
    record, loading = prepared(made(x))
    assert "with its noise" in loading.notes[0]
    np.testing.assert_allclose(record.load_point, np.interp(record.time, TIME, x), atol=2e-7)
    drive, measured = loading.drive(record)
    np.testing.assert_allclose(drive.rates, np.diff(record.load_point) / np.diff(record.time))
    assert measured.all()


def made(load_point, **more):
    ones = np.ones_like(TIME)
    friction = 0.6 + 3e-4 * np.random.default_rng(2).standard_normal(len(TIME))
    told = {"normal": 5e6 * ones, "normal_unit": "Pa"} | more
    return Record(name="made", time=TIME, friction=friction, load_point=load_point, slip=None, **told)


@pytest.mark.parametrize("noise", NOISES)
def test_given_rates_are_taken_exactly_and_their_times_found(noise):
    x = moved() + NOISES[noise]
    pieces = given_pieces(TIME, x, np.array([rate for _, rate in STEPS]))
    assert pieces.rates.tolist() == [rate for _, rate in STEPS]
    np.testing.assert_allclose(pieces.begins, [0, 40, 60, 80], atol=0.3)
    assert "as given" in prepared(made(x), [rate for _, rate in STEPS])[1].notes[0]
    with pytest.raises(RecordError, match="must be those of the load point"):
        given_pieces(TIME, x, np.array([1e-5, 1e-6]))
    with pytest.raises(RecordError, match="needs a column of the load point"):
        prepared(replace(made(x), load_point=None), [1e-6])


def test_a_column_of_rates_is_a_staircase():
    rates = np.where(TIME < 40, 1e-6, 1e-5)
    pieces = staircase(TIME, rates)
    assert pieces.begins.tolist() == [0.0, 40.0]
    assert pieces.rates.tolist() == [1e-6, 1e-5]
    _, loading = prepared(made(pieces.position(TIME), load_rates=rates))
    assert loading.pieces.begins.tolist() == [0.0, 40.0]


def test_two_knots_within_two_points_are_one():
    """Means of pairs of samples without noise, of which one pair has the change in its middle."""
    fine = np.arange(400) / 400
    u, y = (each.reshape(-1, 2).mean(axis=1) for each in (fine, np.maximum(fine - 200.5 / 400, 0)))
    left = np.array([200.2 / 400, 203.8 / 400])
    (knot,) = _needed(u, y, left, 1e-30)
    assert knot == pytest.approx(200.5 / 400, abs=1 / 400)
    apart = np.array([0.25, 0.5])
    bent = np.maximum(u - apart[0], 0) + np.maximum(u - apart[1], 0)
    assert _needed(u, bent, apart, 1e-30) == pytest.approx(apart, abs=1e-9)


def test_changes_of_rate_between_samples_are_instants_of_their_own():
    steps = ((0.0, 1e-6), (40.02, 1e-5))
    record, loading = prepared(made(moved(steps)))
    drive, measured = loading.drive(record)
    assert measured.sum() == len(record.time) < len(measured)
    assert np.all(np.abs(np.union1d(record.time, loading.pieces.begins)[~measured] - 40.02) < 0.03)
    assert np.sum(drive.lengths * drive.rates) == pytest.approx(record.load_point[-1], rel=1e-9)
    assert drive.first_rate == pytest.approx(1e-6, rel=1e-6)
    ends = np.cumsum(drive.lengths)
    np.testing.assert_allclose(drive.rates[ends < 39.9], 1e-6, rtol=1e-5)
    np.testing.assert_allclose(drive.rates[ends > 40.2], 1e-5, rtol=1e-5)


def test_normal_stress_within_the_noise_of_friction_is_constant():
    """3e-4 of 0.6 are 2.5 kPa of 5 MPa: 1 kPa of wandering is none, 100 kPa of drift a line, waves are followed."""
    for wandering, kind in (
        (shared(1e3, 0.99), "constant"),
        (1e5 * TIME / 120, "line"),
        (1e5 * np.sin(TIME), "followed"),
    ):
        record, loading = prepared(made(moved(), normal=5e6 + wandering))
        if kind == "constant":
            assert np.ptp(record.normal) == 0
            assert len(loading.notes) == 1
        else:
            assert ("sample by sample" in loading.notes[1]) == (kind == "followed")
            counts = np.concatenate([[0], np.cumsum(record.counts)])
            means = np.add.reduceat(5e6 + wandering, counts[:-1]) / record.counts
            np.testing.assert_allclose(record.normal, means, atol=3e3)


def test_a_rest_after_sliding_is_a_hold_without_an_error_and_one_at_the_beginning_is_not():
    """Within 0.3 um of noise; a record that begins at rest has no steady sliding to begin with."""
    time = np.arange(0, 60, 0.1)
    noise = 3e-7 * np.random.default_rng(0).standard_normal(len(time))
    x = 1e-5 * (np.minimum(time, 20) + np.maximum(time - 40, 0)) + noise
    pieces = straight_pieces(time, x, scatter(time, x), reading_step(x))
    assert pieces.rates == pytest.approx([1e-5, 0.0, 1e-5], rel=0.01, abs=0.0)
    assert pieces.errors[1] == 0 < pieces.errors[0]
    x = 1e-5 * np.maximum(time - 20, 0) + noise
    pieces = straight_pieces(time, x, scatter(time, x), reading_step(x))
    assert 0 < abs(pieces.rates[0]) < 1e-7


def loading(begins, rates, **more):
    pieces = Pieces(begins=np.array(begins), rates=np.array(rates), **({"noise": 0.0} | more))
    return Loading(pieces=pieces, normal=None, level=1.0, notes=())


def test_a_step_is_a_change_of_rate_by_more_than_a_quarter():
    made = loading([0.0, 10.0, 20.0, 30.0, 40.0, 50.0], [1.0, 1.25, 1.0, 1.2501, 0.0, -1.0])
    assert made.pieces.large_changes.tolist() == [False, False, True, True, True]
    assert made.steps.tolist() == [30.0, 40.0, 50.0]
    assert made.before == pytest.approx(10 + 12.5 + 10, rel=1e-12)
    assert made.first_step == pytest.approx(np.log(1.2501), rel=1e-12)


@pytest.mark.parametrize(
    ("rates", "step"),
    [
        ([1.0, 1.2], None),
        ([1.0, 0.0], None),
        ([0.0, 1.0], None),
        ([1.0, 10.0, 1.0], np.log(10)),
        ([10.0, 1.0], -np.log(10)),
    ],
)
def test_a_first_step_has_a_ratio_unless_it_is_a_hold(rates, step):
    made = loading(10.0 * np.arange(len(rates)), rates)
    assert made.first_step == (step if step is None else pytest.approx(step, rel=1e-12))
    assert (made.before > 0) == (rates[0] > 0 and abs(rates[1] - rates[0]) > 0.3)


def test_a_time_that_noise_hides_by_a_hundredth_of_a_period_has_a_delay():
    """The noise over the change of rate is how far the time may be off; three times that and a period are allowed."""
    record = SimpleNamespace(time=np.arange(0.0, 100.0, 1.0), counts=None)
    period = 99.0 / 100
    for share, found in ((0.0099, 0), (0.0101, 1)):
        noise = share * period * 9.0
        after, most = loading([0.0, 40.0], [1.0, 10.0], noise=noise).delays(record)
        assert after.shape == (100, found)
        assert most.tolist() == [pytest.approx(3 * share * period + period, rel=1e-12)] * found
    assert np.flatnonzero(after[:, 0]).tolist() == list(range(40, 100))
    means = SimpleNamespace(time=record.time, counts=np.full(100, 2.0))
    assert loading([0.0, 40.0], [1.0, 10.0], noise=9.0).delays(means)[1] == pytest.approx([3.0 + period / 2], rel=1e-12)
    assert loading([0.0, 40.0], [1.0, 10.0], noise=9.0, rough=True).delays(record)[1].size == 0
    assert loading([0.0, 40.0], [1.0, 1.2], noise=9.0).delays(record)[1].size == 0
    assert loading([0.0, 99.5], [1.0, 10.0], noise=9.0).delays(record)[1].size == 0


def test_only_the_four_largest_changes_of_rate_have_delays_in_their_order():
    record = SimpleNamespace(time=np.arange(0.0, 70.0, 1.0), counts=None)
    made = loading(10.0 * np.arange(7), [1.0, 9.0, 1.5, 8.0, 2.0, 4.0, 1.0], noise=1.0)
    after, _ = made.delays(record)
    assert [int(np.argmax(column)) for column in after.T] == [10, 20, 30, 40]
    assert after.sum(axis=0).tolist() == [10.0] * 4


@pytest.mark.parametrize(("drift", "followed"), [(3e-4, False), (3e-2, True)])
def test_a_normal_load_that_noise_of_friction_hides_is_its_mean(drift, followed):
    time = np.arange(0.0, 60.0, 0.1)
    friction = 0.6 + 1e-3 * np.random.default_rng(3).standard_normal(len(time))
    normal = 5e6 * (1 + drift * (time / 60 - 0.5))
    made = Record(
        name="made",
        time=time,
        friction=friction,
        load_point=1e-6 * time,
        slip=None,
        normal=normal,
        normal_unit="Pa",
    )
    means, found = prepared(made)
    assert (found.normal is not None) == followed
    assert len(found.notes) == 1 + followed
    expected = np.interp(means.time, time, normal) if followed else np.full(len(means.time), 5e6)
    np.testing.assert_allclose(means.normal, expected, rtol=1e-6)
