"""Correlated noise of records: white noise and an Ornstein–Uhlenbeck process.

Servos, filters, screws and the rock itself drift; least squares for independent noise gives intervals that are then too
narrow. The correlation decays with time or displacement, whichever has the larger restricted likelihood.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy import ndarray
from scipy.linalg import cho_solve_banded, cholesky, cholesky_banded
from scipy.linalg.lapack import dtrtri
from scipy.optimize import minimize

from quakedesign.files import Json

_LEAST_GAIN = 3.0  # least gain of the log-likelihood by two parameters: AIC with a margin of 1
_MOST_DENSE = 1500  # samples whose covariance is factored as a full matrix
_SHARES = (-2.0, 0.0, 3.0)  # initial values of the logarithm of the share
_LENGTHS = (0.003, 0.03)  # initial values of the decay length, relative to the whole span
_LONGEST = 0.05  # relative to the whole span: noise of longer decay looks like the response of the rock
_LARGEST = 9.0  # natural logarithm of the largest share


@dataclass(frozen=True)
class CorrelatedNoise:
    """Covariance of samples, in variances of the white noise of one measurement."""

    share: float  # variance of the correlated process [-]
    length: float  # its decay length, in units of `along`
    along: ndarray  # position of every sample: time [s] or displacement [m]
    counts: ndarray  # measurements in every sample
    of_time: bool  # whether `along` is time
    common: ndarray | None = (
        None  # columns: effect of one standard deviation of each uncertain load-point rate on all samples
    )

    def to_dict(self, noise: float) -> Json | None:
        """Size and length with units, for white noise `noise` [-] of one measurement; None without correlated noise."""
        if not self.share:
            return None
        size = noise * self.share**0.5
        return {"size": size, "size_unit": "", "length": self.length, "length_unit": "s" if self.of_time else "m"}

    @property
    def pieces(self) -> float:
        """Degrees of freedom of the estimated slow noise: one per four decay lengths of the span.

        By Satterthwaite, 2 over the relative variance of the spectral density at frequency zero, 2·share·length. For
        the likeliest process over a span T this variance is 8·length/T: share/length is well determined, and 1/length
        has the variance 2/(length·T).
        """
        return float(np.ptp(self.along)) / (4 * self.length) if self.share else np.inf

    @cached_property
    def covariance(self) -> ndarray:
        """Covariance matrix of all samples."""
        apart = np.abs(self.along[:, None] - self.along[None, :]) / self.length
        whole: ndarray = self.share * np.exp(-apart)
        whole[np.diag_indices(len(self.along))] += 1 / self.counts
        return whole if self.common is None else whole + self.common @ self.common.T

    def deletion(self, residuals: ndarray, used: ndarray) -> ndarray:
        """Residuals minus their predictions from the other used residuals, in standard deviations of this difference.

        Both follow from the inverse covariance (Martin 1992, Commun. Stat. Theory Methods 21, 1183).
        """
        whitener, beside = self.whitener(used)[:, used], self.covariance[:, used]
        inverse = whitener.T @ whitener
        prediction = beside @ inverse
        off = residuals - prediction @ residuals[used]
        variance = np.diag(self.covariance) - np.sum(prediction * beside, axis=1)
        off[used], variance[used] = (inverse @ residuals[used]) / np.diag(inverse), 1 / np.diag(inverse)
        return np.asarray(off / np.sqrt(variance))

    def whitener(self, used: ndarray) -> ndarray:
        """Matrix (used, samples) that makes used residuals independent, with the variance of one measurement."""
        if (key := used.tobytes()) not in self._whiteners:
            factor = cholesky(self.covariance[np.ix_(used, used)], lower=True)
            self._whiteners[key] = np.zeros((int(used.sum()), len(used)))
            self._whiteners[key][:, used] = dtrtri(factor, lower=1)[0]
        return self._whiteners[key]

    @cached_property
    def _whiteners(self) -> dict[bytes, ndarray]:
        """Cached matrices, by the used samples."""
        return {}


def restricted_likelihood(
    residuals: ndarray, slopes: ndarray, counts: ndarray, steps: ndarray, share: float, length: float
) -> float:
    """Logarithm of the restricted likelihood of residuals, up to a constant.

    From the tridiagonal inverse covariance of the process, maximised over the size of the noise. `steps` are distances
    of neighbouring samples, `slopes` derivatives in the fitted coordinates (columns); a share of 0 means no process.
    """
    number, size = slopes.shape
    together = np.column_stack([residuals, slopes])
    weighted = together * counts[:, None]
    log_det = -float(np.sum(np.log(counts)))
    if share > 0:
        fading = np.exp(-np.maximum(steps, 1e-12 * length) / length)
        left = -np.expm1(-2 * np.maximum(steps, 1e-12 * length) / length)
        bands = np.zeros((2, number))
        bands[1] = counts
        bands[1, 0] += 1 / share
        bands[1, 1:] += 1 / (share * left)
        bands[1, :-1] += fading**2 / (share * left)
        bands[0, 1:] = -fading / (share * left)
        factor = cholesky_banded(bands)
        log_det += 2 * float(np.sum(np.log(factor[1]))) + number * np.log(share) + float(np.sum(np.log(left)))
        weighted = weighted - counts[:, None] * cho_solve_banded((factor, False), weighted)
    inner = together.T @ weighted
    sign, log_slopes = np.linalg.slogdet(inner[1:, 1:])
    if sign <= 0:
        return -np.inf
    squares = inner[0, 0] - inner[0, 1:] @ np.linalg.solve(inner[1:, 1:], inner[1:, 0])
    freedom = number - size
    return float(-0.5 * (log_det + log_slopes + freedom * np.log(max(squares, 1e-300) / freedom)))


def noise_of(
    residuals: ndarray,
    slopes: ndarray,
    counts: ndarray,
    time: ndarray,
    path: ndarray | None,
    used: ndarray,
    most: int = _MOST_DENSE,
) -> CorrelatedNoise | None:
    """Likeliest noise of residuals, given the slopes in the fitted coordinates; None if white noise is about as likely.

    None as well if at most three samples per coordinate, or more than `most` samples, are used.
    """
    if not 3 * slopes.shape[1] < used.sum() <= most:
        return None
    scale = np.linalg.norm(slopes[used], axis=0)
    basis, values, _ = np.linalg.svd(slopes[used][:, scale > 0] / scale[scale > 0], full_matrices=False)
    sample = (residuals[used], basis[:, values > 1e-8 * values[0]], counts[used])
    white = restricted_likelihood(*sample, np.ones(len(sample[0]) - 1), 0.0, 1.0)
    best, noise = white + _LEAST_GAIN, None
    for along, of_time in ((time, True), (path, False)):
        if along is None or not np.ptp(along) > 0:
            continue
        way, steps = float(np.ptp(along)), np.abs(np.diff(along[used]))

        def lost(at: ndarray, steps: ndarray = steps, way: float = way) -> float:
            inside = np.clip(at, (-30, -30), (_LARGEST, np.log(_LONGEST)))
            share, length = np.exp(inside) * [1, way]
            return -restricted_likelihood(*sample, steps, share, length) + 10 * float(np.sum(np.abs(at - inside)))

        trials = [np.array([share, np.log(length)]) for share in _SHARES for length in _LENGTHS]
        start = min(trials, key=lost)
        simplex = start + np.array([[0.0, 0.0], [1.5, 0.0], [0.0, 1.0]])
        how = {"initial_simplex": simplex, "xatol": 0.03, "fatol": 0.02, "maxfev": 120}
        ended = minimize(lost, start, method="Nelder-Mead", options=how)
        if -ended.fun > best:
            share, length = np.exp(np.minimum(ended.x, (_LARGEST, np.log(_LONGEST)))) * [1, way]
            best, noise = -ended.fun, CorrelatedNoise(float(share), float(length), along, counts, of_time)
    return noise
