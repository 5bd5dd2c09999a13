"""Restricted likelihood against dense matrices, and noises that come back."""

import numpy as np
import pytest

from quakedesign.identification.correlated_noise import CorrelatedNoise, noise_of, restricted_likelihood
from quakedesign.identification.fitting import outliers

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
    known, kept = CorrelatedNoise(30.0, 8.0, ALONG, COUNTS, True), np.ones(NUMBER, dtype=bool)
    kept[50] = False
    weights = known.whitener(kept)
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
    known, kept = CorrelatedNoise(0.5, 50.0, ALONG, COUNTS, True), np.ones(NUMBER, dtype=bool)
    slow = np.sin(ALONG / 60)
    slow[200] += 1.0
    kept[[200, 300]] = False
    own = known.deletion(slow, kept)
    assert np.argmax(np.abs(own)) == 200
    assert own[200] > 5 * np.max(np.abs(np.delete(own, 200)))
    rest = np.flatnonzero(kept & (np.arange(NUMBER) != 100))
    for place, others in ((100, rest), (300, np.flatnonzero(kept))):
        beside = known.covariance[place, others] @ np.linalg.inv(known.covariance[np.ix_(others, others)])
        left = known.covariance[place, place] - beside @ known.covariance[others, place]
        assert own[place] == pytest.approx((slow[place] - beside @ slow[others]) / left**0.5, rel=1e-6)


def test_correlated_noise_makes_no_outliers():
    known, everything = CorrelatedNoise(5.0, 8.0, ALONG, COUNTS, True), np.ones(NUMBER, dtype=bool)
    each = [known.deletion(noise(5.0, 8.0, seed), everything) for seed in range(20)]
    assert np.std(each) == pytest.approx(1, rel=0.03)
    assert sum(outliers(one, 2).sum() for one in each) <= 4


@pytest.mark.parametrize(("share", "length", "pieces"), [(0.5, 2.0, 10.0), (0.5, 30.0, 4.0), (0.0, 2.0, np.inf)])
def test_noise_that_fades_has_pieces_of_twice_its_length_and_at_least_four(share, length, pieces):
    assert CorrelatedNoise(share, length, np.linspace(5, 45, 9), np.ones(9), True).pieces == pieces
