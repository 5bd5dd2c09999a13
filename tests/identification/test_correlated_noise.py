"""Restricted likelihood against dense matrices, and noises that come back."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from quakedesign.identification.correlated_noise import CorrelatedNoise, noise_of, restricted_likelihood
from quakedesign.identification.experiment import Coordinate, Experiment
from quakedesign.identification.fitting import Fit, outliers, weighted
from quakedesign.identification.identify import needed

NUMBER = 400
ALONG = np.cumsum(np.random.default_rng(0).uniform(0.2, 2.0, NUMBER))
COUNTS = np.random.default_rng(1).integers(1, 20, NUMBER).astype(float)
SLOPES = np.column_stack([np.ones(NUMBER), ALONG / 400, np.exp(-ALONG / 30)])


def noise(share, length, seed, of_time=True):
    known = CorrelatedNoise(share, length, ALONG, COUNTS, of_time)
    return np.linalg.cholesky(known.covariance) @ np.random.default_rng(seed).standard_normal(NUMBER)


@pytest.mark.parametrize(("share", "length"), [(0.0, 1.0), (0.5, 3.0), (40.0, 12.0)])
def test_the_likelihood_is_that_of_dense_matrices(share, length):
    """Patterson and Thompson (1971), with the size of the noise at its best."""
    residuals = noise(2.0, 5.0, 3)
    found = restricted_likelihood(residuals, SLOPES, COUNTS, np.diff(ALONG), share, length)
    covariance = np.diag(1 / COUNTS) + share * np.exp(-np.abs(ALONG[:, None] - ALONG) / length)
    inverse = np.linalg.inv(covariance)
    inner = SLOPES.T @ inverse @ SLOPES
    projected = inverse - inverse @ SLOPES @ np.linalg.solve(inner, SLOPES.T @ inverse)
    freedom = NUMBER - 3
    logs = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(inner)[1]
    expected = -0.5 * (logs + freedom * np.log(residuals @ projected @ residuals / freedom))
    assert found == pytest.approx(expected, rel=1e-9)


def test_a_noise_comes_back_and_white_noise_has_no_other_part():
    everything, other = np.ones(NUMBER, dtype=bool), ALONG**2
    shares, lengths = [], []
    for seed in range(10):
        found = noise_of(noise(3.0, 8.0, seed), SLOPES, COUNTS, ALONG, other, everything)
        assert found.of_time
        shares.append(found.share)
        lengths.append(found.length)
    assert np.median(shares) == pytest.approx(3, rel=0.25)
    assert np.median(lengths) == pytest.approx(8, rel=0.25)
    white = [np.random.default_rng(seed).standard_normal(NUMBER) / np.sqrt(COUNTS) for seed in range(10)]
    assert sum(noise_of(one, SLOPES, COUNTS, ALONG, other, everything) is not None for one in white) <= 1
    of_path = noise_of(noise(30.0, 8.0, 1, of_time=False), SLOPES, COUNTS, other, ALONG, everything)
    assert not of_path.of_time
    assert of_path.to_dict(1e-3)["length_unit"] == "m"


def test_whitened_noise_is_independent_with_the_variance_of_one_measurement():
    known, used = CorrelatedNoise(30.0, 8.0, ALONG, COUNTS, True), np.ones(NUMBER, dtype=bool)
    used[50] = False
    weights = known.whitener(used)
    assert weights.shape == (NUMBER - 1, NUMBER)
    assert np.all(weights[:, 50] == 0)
    np.testing.assert_allclose(weights @ known.covariance @ weights.T, np.eye(NUMBER - 1), atol=1e-9)


def test_what_all_samples_share_is_part_of_the_covariance():
    """An unknown with a known spread widens what is fitted as much as if it were fitted with that spread."""
    common = SLOPES[:, 2:] * 0.3
    known = CorrelatedNoise(0.0, 1.0, ALONG, COUNTS, True, common)
    np.testing.assert_allclose(known.covariance, np.diag(1 / COUNTS) + common @ common.T)
    assert known.to_dict(1e-3) is None
    weights = known.whitener(np.ones(NUMBER, dtype=bool))
    marginal = np.linalg.inv((weights @ SLOPES[:, :2]).T @ (weights @ SLOPES[:, :2]))
    fitted = np.vstack([np.sqrt(COUNTS)[:, None] * SLOPES, [0.0, 0.0, 1 / 0.3]])
    np.testing.assert_allclose(marginal, np.linalg.inv(fitted.T @ fitted)[:2, :2], rtol=1e-9)


def test_what_neighbours_tell_is_taken_away():
    known, used = CorrelatedNoise(0.5, 50.0, ALONG, COUNTS, True), np.ones(NUMBER, dtype=bool)
    slow = np.sin(ALONG / 60)
    slow[200] += 1.0
    used[[200, 300]] = False
    own = known.deletion(slow, used)
    assert np.argmax(np.abs(own)) == 200
    assert own[200] > 5 * np.max(np.abs(np.delete(own, 200)))
    rest = np.flatnonzero(used & (np.arange(NUMBER) != 100))
    for place, others in ((100, rest), (300, np.flatnonzero(used))):
        beside = known.covariance[place, others] @ np.linalg.inv(known.covariance[np.ix_(others, others)])
        left = known.covariance[place, place] - beside @ known.covariance[others, place]
        assert own[place] == pytest.approx((slow[place] - beside @ slow[others]) / left**0.5, rel=1e-6)


def test_correlated_noise_makes_no_outliers():
    known, everything = CorrelatedNoise(5.0, 8.0, ALONG, COUNTS, True), np.ones(NUMBER, dtype=bool)
    each = [known.deletion(noise(5.0, 8.0, seed), everything) for seed in range(20)]
    assert np.std(each) == pytest.approx(1, rel=0.03)
    assert sum(outliers(one).sum() for one in each) <= 4


def test_pieces_of_noise_that_fades_are_satterthwaites_of_its_slow_part():
    """The spectral density of an AR(1) process at frequency zero, from its likelihood.

    Of n samples, the variance of the innovations has the relative variance 2/n, and the coefficient f the variance
    (1 - f^2)/n (Box and Jenkins 1976, section 7.2.6). White noise has as many degrees of freedom as samples.
    """
    samples, fading = 5000, 0.99
    relative = 2 / samples + 4 * (1 - fading**2) / samples / (1 - fading) ** 2
    along = np.arange(samples) + 5.0
    known = CorrelatedNoise(0.5, -1 / np.log(fading), along, np.ones(samples), True)
    assert known.pieces == pytest.approx(2 / relative, rel=0.01)
    assert CorrelatedNoise(0.0, 2.0, along, np.ones(samples), True).pieces == np.inf


@dataclass(frozen=True, kw_only=True)
class Linear(Experiment):
    """Friction of a level, a step with what fades after it, and a trend."""

    columns: np.ndarray
    coordinates: tuple

    def friction(self, fitted):
        return self.columns @ fitted

    def slopes(self, fitted):
        return self.columns


def fitted(columns, measured, noise=None):
    coordinates = tuple(
        Coordinate(name=str(i), unit="", low=-99, high=99, start=(-1, 1), logarithmic=False)
        for i in range(columns.shape[1])
    )
    ones = np.ones(len(measured))
    best = Fit(
        experiment=Linear(columns=columns, coordinates=coordinates),
        fitted=np.zeros(columns.shape[1]),
        measured=measured,
        counts=ones,
        used=ones > 0,
        agreeing=1,
        starts=1,
        correlated=noise,
    )
    solution = np.linalg.lstsq(weighted(best.weights, columns), weighted(best.weights, measured), rcond=None)[0]
    return replace(best, fitted=solution)


def trends(records, trend, fading, white):
    """In how many records of AR(1) and white noise a trend is kept."""
    time, count = np.linspace(0, 1, 200), 0
    after = np.maximum(time - 0.5, 0)
    columns = np.column_stack([np.ones(200), time > 0.5, (time > 0.5) * np.exp(-after / 0.03), time])
    for seed in range(records):
        draw = np.random.default_rng(seed)
        noise = draw.standard_normal(200)
        for i in range(1, 200):
            noise[i] = fading * noise[i - 1] + (1 - fading**2) ** 0.5 * noise[i]
        measured = noise + white * draw.standard_normal(200) + trend * time
        plain = fitted(columns, measured)
        likely = noise_of(plain.residuals, columns, plain.counts, time, None, plain.used)
        best = fitted(columns, measured, likely)
        without = np.linalg.lstsq(weighted(best.weights, columns[:, :-1]), weighted(best.weights, measured), rcond=None)
        left = weighted(best.weights, measured - columns[:, :-1] @ without[0])
        count += needed(best, float(left @ left))
    return count


def test_noise_without_a_trend_has_one_in_a_record_of_100_and_a_trend_is_seen():
    """Of 25 records, one in 100 gives more than 2 with a chance of 0.2 %; the trend is of 20 deviations."""
    deviation = (12 / 200 * ((1 + 0.8) / (1 - 0.8) + 0.3**2)) ** 0.5
    assert trends(25, 0.0, 0.8, 0.3) <= 2
    assert trends(8, 20 * deviation, 0.8, 0.3) == 8


@pytest.mark.slow
@pytest.mark.parametrize(("fading", "white", "most"), [(0.0, 0.0, 8), (0.5, 0.0, 8), (0.9, 0.0, 8), (0.9, 0.6, 12)])
def test_of_300_records_without_a_trend_about_3_have_one(fading, white, most):
    """At most 8, which 3 in 300 exceed with a chance of 0.4 %; 1 in 25 where white noise hides how the other fades."""
    assert trends(300, 0.0, fading, white) <= most
