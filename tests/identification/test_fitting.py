"""Least squares by hand: straight lines, wells whose bottoms are known, tables of distributions."""

from dataclasses import dataclass, replace
from statistics import NormalDist
from types import SimpleNamespace

import numpy as np
import pytest

from quakedesign.errors import RecordError
from quakedesign.identification import fitting
from quakedesign.identification.experiment import Coordinate, Experiment
from quakedesign.identification.fitting import (
    BetterFit,
    Fit,
    Profile,
    _finite,
    _starts,
    advantage,
    fit,
    minimised,
    outliers,
)


def coordinate(name, low=-10.0, high=10.0, start=(-1.0, 1.0)):
    return Coordinate(name=name, unit="", low=low, high=high, start=start, logarithmic=False)


@dataclass(frozen=True)
class Linear(Experiment):
    """Friction is a matrix times what is fitted."""

    matrix: np.ndarray
    law = None

    @property
    def coordinates(self):
        return tuple(coordinate(f"q{i}") for i in range(self.matrix.shape[1]))

    def friction(self, fitted):
        return self.matrix @ fitted

    def slopes(self, _fitted):
        return self.matrix


@dataclass(frozen=True)
class Wells(Experiment):
    """Two bottoms, at -1 and at 1, where the second sample is off by `depth` and by nothing."""

    depth: float
    samples: int
    law = None
    coordinates = (coordinate("q", start=(0.8, 1.2)),)

    def friction(self, fitted):
        (q,) = fitted
        return np.array([q * q - 1, self.depth * (1 - q) / 2, *[0.0] * (self.samples - 2)])

    def slopes(self, fitted):
        (q,) = fitted
        return np.array([[2 * q], [-self.depth / 2], *[[0.0]] * (self.samples - 2)])


def line(samples):
    return Linear(np.column_stack([np.ones(samples), np.arange(samples)]))


def made(experiment, measured, *, fitted=None, counts=None, used=None):
    samples = len(measured)
    return Fit(
        experiment=experiment,
        fitted=np.zeros(experiment.matrix.shape[1]) if fitted is None else fitted,
        measured=measured,
        counts=np.ones(samples) if counts is None else counts,
        used=np.ones(samples, dtype=bool) if used is None else used,
        agreeing=1,
        starts=1,
    )


def test_three_samples_a_coordinate_are_enough():
    measured = np.array([0.1, 0.0, 0.3, 0.2, 0.5, 0.4])
    found = fit(line(6), measured, seed=0)
    assert found.fitted == pytest.approx(np.polyfit(range(6), measured, 1)[::-1], abs=1e-6)
    with pytest.raises(RecordError, match="at least 6 samples for the fitted parameters"):
        fit(line(5), measured[:5], seed=0)


@pytest.mark.parametrize(("share", "searches"), [(0.75e-3, 2), (1.5e-3, 3)])
def test_searches_agree_when_their_squares_differ_by_less_than_a_thousandth(share, searches, monkeypatch):
    """The noise leaves 1; the first search ends at -1 with `share` more than that, all others at 1."""
    noise = np.resize([1.0, -1.0], 20) / 20**0.5
    measured = np.concatenate([[0.0, 0.0], noise])
    wells, start = Wells(share**0.5, 22), np.array([-1.0])
    found = fit(wells, measured, seed=0, near=start, least=2)
    assert (found.starts, found.agreeing) == (searches, 2)
    assert found.fitted[0] == pytest.approx(1, abs=1e-4)
    assert fit(wells, measured, seed=0, near=start).starts == 4
    alone = fit(wells, measured, seed=0, near=start, least=1, most=1)
    assert alone.starts == 2
    monkeypatch.setattr(fitting, "_AGREEMENT", 0.0)
    itself = fit(wells, measured, seed=0, least=1, most=1)
    assert (itself.starts, itself.agreeing) == (1, 1)


def test_a_mean_of_four_counts_as_four_in_a_fit():
    measured, counts = np.array([1.0, 0.0, 0.0, 2.0]), np.array([4.0, 1.0, 1.0, 1.0])
    found = fit(Linear(np.ones((4, 1))), measured, seed=0, counts=counts)
    assert found.fitted == pytest.approx([(4 + 2) / 7], abs=1e-3)


def test_searches_start_from_the_sixteen_nearest_of_many_between_the_ends():
    """By the sum of absolute residuals, each with the root of its count."""
    experiment, measured, roots = Linear(np.array([[1.0], [-1.0], [0.5]])), np.array([0.7, 0.1, 0.2]), np.arange(1, 4)
    _, starts = _starts(experiment, measured, roots, 5, 16)
    _, every = _starts(experiment, measured, roots, 5, 100)
    assert (len(starts), len(every)) == (16, 64)
    assert [q[0] for q in starts] == [q[0] for q in every[:16]]
    costs = [abs(0.7 - q) + 2 * abs(0.1 + q) + 3 * abs(0.2 - q / 2) for (q,) in every]
    assert costs == sorted(costs)
    assert -1 < min(every)[0] < -0.8 < 0.8 < max(every)[0] < 1


@dataclass(frozen=True)
class Restless(Linear):
    """Never simulated accurately enough: with every simulation the best fit moves away."""

    asked: list
    away: float = 0.0

    def friction(self, fitted):
        return super().friction(fitted) + self.away * len(self.asked)

    def resolved(self, fitted, accuracy):
        self.asked.append((fitted, accuracy))
        return replace(self)


def test_steps_suit_the_scatter_between_samples_first_and_no_more_than_six_rounds_follow():
    """Second differences of noise scatter by the root of six times as much; those of a line not at all.

    Steps are made again only for coordinates more than a deviation off.
    """
    asked = []
    noise = 0.01 * np.random.default_rng(2).standard_normal(4000)
    fit(Restless(line(4000).matrix, asked, 0.1), noise + 0.5 * np.arange(4000), seed=0)
    assert len(asked) == 2 + 6
    asked.clear()
    fit(Restless(line(4000).matrix, asked), noise + 0.5 * np.arange(4000), seed=0)
    assert len(asked) == 2 + 1
    assert asked[0][0].tolist() == [0.0, 0.0]
    assert [accuracy for _, accuracy in asked[:2]] == pytest.approx([0.01, 0.01], rel=0.05)
    assert asked[-1][1] == pytest.approx(3e-3 * 0.01, rel=0.05)
    asked.clear()
    _starts(Restless(line(9).matrix, asked), np.arange(9.0), np.ones(9), 0, 16)
    assert [accuracy for _, accuracy in asked] == [1e-9, 1e-9]


def test_slopes_without_a_value_are_none():
    assert _finite(np.array([np.inf, -np.inf, np.nan, 2.0])).tolist() == [0.0, 0.0, 0.0, 2.0]


def test_where_there_is_no_experiment_between_the_ends_nothing_is_fitted():
    class Jumping(Wells):
        def friction(self, fitted):
            return np.full(self.samples, np.nan)

    with pytest.raises(RecordError, match="without a jump"):
        fit(Jumping(0.1, 9), np.arange(9.0), seed=0)
    start = np.array([0.5])
    at, squares = minimised(Jumping(0.1, 9), np.arange(9.0), np.ones(9), start)
    assert (at.tolist(), squares) == ([0.5], np.inf)


def test_what_is_fixed_stays_and_what_has_no_weight_does_not_count():
    """With a slope of 2 held, the best height is the mean of y - 2x, weighted by squares."""
    measured, weights = np.array([1.0, 2.0, 7.0, np.nan]), np.array([1.0, 2.0, 1.0, 0.0])
    start, held = np.array([0.0, 2.0]), np.array([False, True])
    at, squares = minimised(line(4), measured, weights, start, fixed=held)
    height = (1 * 1 + 4 * 0 + 1 * 3) / 6
    assert at == pytest.approx([height, 2.0], abs=1e-8)
    assert squares == pytest.approx((1 - height) ** 2 + 4 * height**2 + (3 - height) ** 2, rel=1e-8)


def test_an_outlier_is_one_that_noise_makes_in_one_record_of_twenty():
    """Of 11 samples; half of all normal numbers are closer than 0.6745 to their middle, here than 1."""
    limit = NormalDist().inv_cdf(1 - 0.05 / 2 / 11) / NormalDist().inv_cdf(0.75)
    within = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 0.0, 1.0, -1.0, 1.0, -1.0])
    for share, far in ((0.999, False), (1.001, True)):
        for sign in (1, -1):
            found = outliers(sign * np.append(within, share * limit) + 5.0)
            assert found.tolist() == [False] * 10 + [far]


@pytest.mark.parametrize(("run", "left_out"), [(1, True), (2, True), (3, False)])
def test_more_than_two_in_a_row_are_no_accident(run, left_out):
    for first in (0, 7, 40 - run):
        residuals = np.resize([1.0, -1.0], 40)
        residuals[first : first + run] = 50.0
        assert outliers(residuals).nonzero()[0].tolist() == (list(range(first, first + run)) if left_out else [])


def test_runs_are_told_apart():
    residuals = np.resize([1.0, -1.0], 40)
    residuals[[3, 10, 11, 12, 20, 21, 30, 31, 32, 33, 38]] = -50.0
    assert outliers(residuals).nonzero()[0].tolist() == [3, 20, 21, 38]


@pytest.mark.parametrize(("beside", "left_out"), [(3.9, True), (4.1, False), (-4.1, True)])
def test_what_rises_from_a_neighbour_by_less_than_three_fifths_is_a_peak_and_stays(beside, left_out):
    """The neighbour is no outlier itself: 4.8 is one among 42 of size 1."""
    for place, neighbour in ((7, 8), (7, 6), (0, 1), (41, 40)):
        residuals = np.resize([1.0, -1.0, 0.0], 42)
        residuals[[place, neighbour]] = 10.0, beside
        assert outliers(residuals).nonzero()[0].tolist() == [place] * left_out


def test_searches_go_on_where_a_deviation_is_wider_than_what_is_searched():
    """Two agree at once; the deviation of the noise over 1e-9 is far beyond the limits of 10."""
    noise = np.resize([1.0, -1.0], 10)
    assert fit(Linear(np.full((10, 1), 1e-9)), noise, seed=0).starts == 16
    assert fit(Linear(np.ones((10, 1))), noise, seed=0).starts == 4


def test_a_profile_that_comes_upon_a_better_fit_hands_it_on():
    """The height is off by 0.08, which the profile of the slope sets right near the best slope."""
    noise = np.resize([0.1, -0.1], 10)
    best = np.linalg.lstsq(line(10).matrix, noise, rcond=None)[0]
    with pytest.raises(BetterFit) as better:
        Profile(made(line(10), noise, fitted=best + np.array([0.08, 0.0])), 1).interval(0.1)
    left = noise - line(10).matrix @ better.value.fitted
    assert left @ left < 10 * (0.1**2 + 0.08**2)
    Profile(made(line(10), noise, fitted=best), 1).interval(0.1)


def test_fits_with_correlated_noise_compare_by_their_whitened_squares():
    one, other = (
        SimpleNamespace(used=np.ones(10, dtype=bool), sum_of_squares=squares, correlation=correlation, correlated=noise)
        for squares, correlation, noise in ((2.0, 2.0, None), (3.0, 5.0, object()))
    )
    assert advantage(one, other) == pytest.approx((1.5, 10 / 2 * np.log(1.5)), rel=1e-12)


def test_the_freedom_of_noise_is_that_of_the_fewest_pieces():
    found = made(Linear(np.ones((11, 1))), np.resize([1.0, -1.0], 11))
    assert found.freedom_of_noise == 10
    assert replace(found, pieces=3.5).freedom_of_noise == 3.5
    assert replace(found, pieces=3.5, correlated=SimpleNamespace(pieces=2.5)).freedom_of_noise == 2.5
    assert replace(found, pieces=20.0, correlated=SimpleNamespace(pieces=30.0)).freedom_of_noise == 10


@dataclass(frozen=True)
class Softening(Linear):
    """Grows a little less than what is fitted."""

    def friction(self, fitted):
        return self.matrix @ (fitted - 1e-4 * fitted**3)

    def slopes(self, fitted):
        return self.matrix * (1 - 3e-4 * fitted**2)


@dataclass(frozen=True)
class Breaking(Linear):
    """There is no such experiment beyond 2."""

    def friction(self, fitted):
        return self.matrix @ np.where(fitted > 2, np.nan, fitted)


def test_an_end_where_the_experiment_cannot_be_followed_is_none():
    size = 3.0 * 11**0.5 / 4.9646**0.5
    low, high = Profile(made(Breaking(np.ones((11, 1))), size * np.array([1.0, -1.0] * 5 + [0.0])), 0).interval(4.9646)
    assert -3 * 1.0101 < low < -3 * 0.9999  # a hundredth of the distance is close enough
    assert high == np.inf


@pytest.mark.parametrize(("first", "followed"), [(9.414, True), (9.8515, False)])
def test_an_end_at_the_limit_of_a_coordinate_is_none(first, followed):
    """Of 11 means, with F(1, 10) = 4.965 at 95 %; the first trial falls short of the limit of 10, the next beyond."""
    size = first * 11**0.5 / 4.9646**0.5
    low, high = Profile(made(Softening(np.ones((11, 1))), size * np.array([1.0, -1.0] * 5 + [0.0])), 0).interval(4.9646)
    assert (np.isfinite(low), np.isfinite(high)) == (followed, followed)
    assert not followed or high == pytest.approx(9.5, rel=0.01)


@dataclass(frozen=True)
class Watched(Linear):
    """Simulated accurately enough from the start; counts how often it is asked."""

    asked: list

    def resolved(self, _fitted, _accuracy):
        self.asked.append(None)
        return self


@pytest.mark.parametrize(("outlier", "rounds"), [(0.0, 1), (0.1, 2)])
def test_rounds_end_when_one_has_left_out_nothing_new(outlier, rounds):
    measured, asked = np.resize([1e-3, -1e-3], 30), []
    measured[12] += outlier
    assert fit(Watched(line(30).matrix, asked), measured, seed=1).used.all() == (rounds == 1)
    assert len(asked) == 2 + rounds


def test_a_fit_without_an_outlier_is_that_of_the_others():
    draw = np.random.default_rng(5)
    measured = 0.5 + 0.01 * np.arange(30) + 1e-3 * draw.standard_normal(30)
    measured[12] += 0.1
    found = fit(line(30), measured, seed=1)
    others = np.delete(np.arange(30), 12)
    assert (~found.used).nonzero()[0].tolist() == [12]
    assert found.fitted == pytest.approx(np.polyfit(others, measured[others], 1)[::-1], rel=1e-6)
    assert found.degrees_of_freedom == 29 - 2
    residuals = measured[others] - np.polyval(np.polyfit(others, measured[others], 1), others)
    assert found.noise == pytest.approx((np.sum(residuals**2) / 27) ** 0.5, rel=1e-9)


def test_a_mean_of_many_measurements_weighs_by_the_root_of_their_number():
    counts = np.array([4.0, 1.0, 9.0, 1.0])
    found = made(Linear(np.ones((4, 1))), np.array([1.0, 2.0, -1.0, 50.0]), counts=counts, used=np.arange(4) < 3)
    assert found.scaled.tolist() == [2.0, 2.0, -3.0, 50.0]
    assert found.weights.tolist() == [2.0, 1.0, 3.0, 0.0]
    assert (found.sum_of_squares, found.degrees_of_freedom, found.noise) == (17.0, 2, 8.5**0.5)
    assert found.accuracy == pytest.approx(3e-3 * 8.5**0.5 / (15 / 4) ** 0.5, rel=1e-14)


def test_the_threshold_is_fishers():
    """Of tables at 95 %: F(1, 10) = 4.965, F(2, 10) = 4.103; the excess at a distance d of the mean of n is n d²/s²."""
    draw = np.resize([0.5, -0.5], 11) + 0.0
    found = made(Linear(np.ones((11, 1))), draw, fitted=np.array([draw.mean()]))
    assert found.degrees_of_freedom == 10
    assert [found.threshold(1), found.threshold(2)] == pytest.approx([4.965, 2 * 4.103], abs=1e-3)
    assert found.correlation == 1.0  # what alternates is not counted as more than independent
    assert found.distance(found.fitted + 0.3) == pytest.approx(11 * 0.3**2 / np.var(draw, ddof=1), rel=1e-12)
    assert found.standard_errors == pytest.approx([(np.var(draw, ddof=1) / 11) ** 0.5], rel=1e-12)


def test_samples_that_follow_each_other_count_as_fewer():
    """By direct sums; of noise that decays by 0.8 from sample to sample about (1 + 0.8)/(1 - 0.8) = 9 are one."""
    draw, found = np.random.default_rng(7).standard_normal(3000), np.zeros(3000)
    for i in range(1, 3000):
        found[i] = 0.8 * found[i - 1] + draw[i]
    told = made(Linear(np.ones((3000, 1))), found).correlation
    covariance = [float(np.dot(found[: 3000 - lag], found[lag:])) for lag in range(200)]
    sums = [1.0]
    while len(sums) - 1 < 5 * sums[-1]:
        sums.append(sums[-1] + 2 * covariance[len(sums)] / covariance[0])
    assert told == pytest.approx(sums[-1], rel=1e-9)
    assert told == pytest.approx(9, rel=0.25)


@pytest.mark.parametrize("samples", [8, 9, 16, 33, 64])
def test_few_samples_are_summed_over_half_of_them_at_most_and_not_around_their_ends(samples):
    """What drifts is like itself over the whole record, or alike at both ends."""
    draw = np.random.default_rng(samples).standard_normal(samples)
    ends = np.concatenate([[3.0, 3.0], draw[4:], [3.0, 3.0]])
    for found in (np.cumsum(draw), ends, np.arange(samples) - 2.0):
        covariance = [float(np.dot(found[: samples - lag], found[lag:])) for lag in range(samples // 2)]
        sums = [2 * sum(covariance[: lag + 1]) / covariance[0] - 1 for lag in range(samples // 2)]
        far = [total for lag, total in enumerate(sums) if lag >= 5 * total]
        expected = max(1.0, far[0] if far else sums[-1])
        assert made(Linear(np.ones((samples, 1))), found).correlation == pytest.approx(expected, rel=1e-9)


def test_samples_that_follow_each_other_widen_what_is_allowed():
    """Four samples for an independent one: twice the deviation, a quarter of the excess; counts weigh the samples."""
    counts, measured = np.array([1.0, 4.0, 1.0, 4.0]), np.array([2.0, 1.0, -2.0, -1.0])
    found = made(Linear(np.ones((4, 1))), measured, counts=counts)
    vars(found)["correlation"] = 4.0
    noise = ((4 + 4 + 4 + 4) / 3) ** 0.5
    assert found.noise == pytest.approx(noise, rel=1e-14)
    assert found.excess(16 + 3.0) == pytest.approx(3.0 / (4 * noise**2), rel=1e-14)
    assert found.distance(np.array([0.5])) == pytest.approx(10 * 0.25 / (4 * noise**2), rel=1e-12)
    assert found.distance(np.array([np.nan])) == np.inf
    assert found.standard_errors == pytest.approx([2 * noise / 10**0.5], rel=1e-12)
    across = made(Linear(np.array([[1.0, 1], [1, -1], [1, 1], [1, -1]])), np.array([3.0, 1.0, -3.0, -1.0]))
    vars(across)["correlation"] = 1.0
    assert across.standard_errors == pytest.approx([across.noise / 2, across.noise / 2], rel=1e-12)


def test_deviations_are_those_of_the_inverse_and_infinite_along_what_is_not_told():
    matrix = np.column_stack([np.ones(8), np.arange(8.0), np.zeros(8)])
    measured = np.resize([1.0, -1.0], 8)
    known = made(Linear(matrix[:, :2]), measured)
    expected = np.sqrt(np.diag(np.linalg.inv(matrix[:, :2].T @ matrix[:, :2]))) * known.noise
    assert known.standard_errors == pytest.approx(expected, rel=1e-9)
    told = made(Linear(matrix), measured).standard_errors
    assert np.isfinite(told).tolist() == [True, True, False]
    twice = made(Linear(matrix[:, [0, 1, 1]]), measured).standard_errors
    assert np.isfinite(twice).tolist() == [True, False, False]


def test_the_advantage_is_of_the_samples_that_both_count():
    """Squares of 4 and of 8 over three samples, two for an independent one: 3/2 ln 2."""
    matrix = Linear(np.ones((5, 1)))
    one = made(matrix, np.array([1.0, -1.0, 2**0.5, -9.0, 0.1]), used=np.array([1, 1, 1, 0, 1], dtype=bool))
    other = replace(one, measured=2**0.5 * one.measured, used=np.array([1, 1, 1, 1, 0], dtype=bool))
    vars(one)["correlation"], vars(other)["correlation"] = 2.0, 3.0
    assert advantage(one, other) == pytest.approx((2.0, 3 / 2 * np.log(2)), rel=1e-12)
    assert advantage(other, one) == pytest.approx((0.5, -3 / 2 * np.log(2)), rel=1e-12)


def test_a_move_along_a_valley_leaves_what_is_not_felt():
    """With columns (1, 1, 0 but for rounding) of slopes, moving the second by 1 moves the first by -1 and no other."""
    from types import SimpleNamespace

    slopes = np.array([[1.0, 1.0, 1e-17], [2.0, 2.0, -1e-17], [3.0, 3.0, 0.0], [4.0, 4.0, 0.0]])
    experiment = SimpleNamespace(slopes=lambda fitted: slopes, friction=lambda fitted: np.zeros(4))
    told = Fit(
        experiment=experiment,
        fitted=np.zeros(3),
        measured=np.ones(4),
        counts=np.ones(4),
        used=np.ones(4, dtype=bool),
        agreeing=1,
        starts=1,
    )
    assert told.along(1) == pytest.approx([-1.0, 1.0, 0.0])


def test_the_profile_of_a_line_is_straight_and_its_ends_are_those_of_students_t():
    """Root of the excess: |q - best| over its deviation, which NumPy's inverse gives; ends within 1 % beyond it."""
    matrix, measured = line(12).matrix, np.sin(np.arange(12.0))
    best = np.linalg.lstsq(matrix, measured, rcond=None)[0]
    found = made(line(12), measured, fitted=best)
    deviation = (np.linalg.inv(matrix.T @ matrix)[1, 1] * np.sum((measured - matrix @ best) ** 2) / 10) ** 0.5
    profile = Profile(found, 1)
    low, high = profile.interval(2.228**2)  # Student's t of 10 at 97.5 %
    assert [best[1] - low, high - best[1]] == pytest.approx([2.239 * deviation] * 2, rel=6e-3)
    wide = profile.interval(9.0)
    assert [best[1] - wide[0], wide[1] - best[1]] == pytest.approx([3.015 * deviation] * 2, rel=6e-3)
    assert len(profile.points) <= 6
    for point in profile.points:
        assert point.distance == pytest.approx(abs(point.step) / deviation, rel=1e-6)


def test_a_profile_without_an_end_is_tried_at_the_limit_and_not_again():
    """Friction of a sample of q alone in the noise of others, for q from -10 to 10."""
    found = made(Linear(np.column_stack([np.ones(8), 1e-3 * np.arange(8.0)])), np.resize([1.0, -1.0], 8))
    profile = Profile(found, 1)
    assert profile.interval(4.0) == (-np.inf, np.inf)
    tried = len(profile.points)
    assert profile.interval(9.0) == (-np.inf, np.inf)
    assert len(profile.points) == tried
    assert {abs(point.step) for point in profile.points} >= {10.0}
