"""Loading of an experiment: load point and normal stress as piecewise linear functions of time.

A load point that followed the transducer sample by sample would drive the simulated spring with its noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy import ndarray
from scipy.optimize import differential_evolution

from quakedesign.errors import RecordError
from quakedesign.identification.correlated_noise import noise_of
from quakedesign.identification.experiment import Drive
from quakedesign.identification.record import FAR_OFF, Record, reading_step, scatter, thinned

_MOST_POINTS = 2000  # largest number of means in the search for changes of rate
_CANDIDATES = 400
_FEWEST = 8  # smallest number of samples for a search for changes
_MOST_PIECES = 40
_PATIENCE = 4  # successive pieces without improvement that end the search
_TIMELY = 0.01  # error of the time of a change, in sampling periods, that has no visible effect
_MOST_DELAYS = 4
# A piece is a hold if its rate is within 3 standard deviations of 0, and these are below 5 % of the largest rate.
_HOLD, _SLOW = 3.0, 0.05
_LARGE_CHANGE = 1.25  # ratio of rates above which a change is a step, not a drift
_LEAST_CHANGE = 0.03  # relative to the faster rate: changes friction by 3 % of a or b
_PIECE_PENALTY = 4.0  # required improvement of a fit by a new piece, in variances times log n
_ROUGH = 6.0  # ratio of the deviations from the pieces to the noise from sample to sample above which pieces do not fit
_PATH_TOLERANCE = 0.01  # share of the whole path


@dataclass(frozen=True, kw_only=True)
class Pieces:
    """A load point that moves at a constant rate in every piece."""

    begins: ndarray  # times at which pieces begin [s], from the first time of the record
    rates: ndarray  # [m/s]
    noise: float  # standard deviation of the displacement from the pieces [m]
    given: bool = False  # whether the rates are given
    rough: bool = False  # whether a few such pieces do not describe the motion
    errors: ndarray | None = None  # standard deviations of the logarithms of the rates [-]; None for known rates

    @property
    def large_changes(self) -> ndarray:
        """Whether the rate changes by more than a quarter, at the beginning of every piece but the first."""
        slow, fast = np.sort(np.abs([self.rates[1:], self.rates[:-1]]), axis=0)
        return np.asarray(fast > _LARGE_CHANGE * slow)

    def position(self, time: ndarray) -> ndarray:
        """Displacement since the first time [m]."""
        corners = np.concatenate([[0.0], np.cumsum(np.diff(self.begins) * self.rates[:-1])])
        piece = np.clip(np.searchsorted(self.begins, time, side="right") - 1, 0, None)
        return np.asarray(corners[piece] + self.rates[piece] * (time - self.begins[piece]))


def staircase(time: ndarray, rates: ndarray) -> Pieces:
    """Pieces of a column of rates, each commanded from its sample on."""
    new = np.concatenate([[True], np.diff(rates) != 0])
    return Pieces(begins=time[new], rates=rates[new], noise=0.0)


def straight_pieces(time: ndarray, position: ndarray, scatter: float, step: float) -> Pieces:
    """The fewest pieces that explain the positions within their noise (`scatter`) and reading step (`step`) [m]."""
    if len(time) < _FEWEST or not np.ptp(position) > 0:
        rate = (position[-1] - position[0]) / max(time[-1] - time[0], 1e-300)
        return Pieces(begins=time[:1], rates=np.array([rate]), noise=0.0, rough=bool(np.ptp(position) > 0))
    t, x = _means(time, position)
    size, span = float(np.ptp(x)) or 1.0, float(np.ptp(t))
    u, y = (t - t[0]) / span, (x - x[0]) / size
    candidates = np.unique(u[np.linspace(1, len(u) - 2, min(_CANDIDATES, len(u) - 2)).astype(int)])
    columns = np.maximum(u[:, None] - candidates, 0)
    floor = (max(scatter * np.sqrt(len(t) / len(time)), 0.3 * step / np.sqrt(len(time) / len(t))) / size) ** 2
    knots, squares = np.empty(0), [_squares(u, y, np.empty(0))]
    while len(knots) < _MOST_PIECES:
        basis, _ = np.linalg.qr(_design(u, knots))
        across = columns - basis @ (basis.T @ columns)
        norms = np.einsum("ij,ij->j", across, across)
        gains = np.where(norms > 1e-9 * norms.max(), (across.T @ y) ** 2 / np.maximum(norms, 1e-300), 0)
        knots = _refined(u, y, np.unique(np.append(knots, candidates[np.argmax(gains)])))
        left = y - _hinges(u, y, knots)[1]
        squares.append(float(left @ left))
        noise = max(squares[-1] / len(u) * _spread(left), floor)
        before = squares[max(len(squares) - 1 - _PATIENCE, 0)]
        little = _PATIENCE * _PIECE_PENALTY * np.log(len(u)) * noise
        if squares[-1] < floor * len(u) or (len(squares) > _PATIENCE and before - squares[-1] < little):
            break
    knots = _needed(u, y, knots, floor)
    rates, line = _hinges(u, y, knots)
    off = np.abs(y - line) * size
    rough = len(knots) >= _MOST_PIECES or np.percentile(off, 99) > max(_ROUGH * scatter + step, _PATH_TOLERANCE * size)
    begins = np.concatenate([[time[0]], t[0] + knots * span])
    nearest = time[np.clip(np.searchsorted(time, begins - 1e-6 * span / len(time)), 0, len(time) - 1)]
    begins = np.where(np.abs(begins - nearest) < 1e-4 * span / len(time), nearest, begins)
    errors = _rate_errors(u, y - line, knots)
    most = float(np.max(np.abs(rates)))
    at_rest = (np.abs(rates) < _HOLD * errors) & (_HOLD * errors < _SLOW * most) & (np.arange(len(rates)) > 0)
    rates = np.where(at_rest | (np.abs(rates) < 1e-9 * most), 0.0, rates)
    errors = np.where(rates == 0, 0.0, errors / np.maximum(np.abs(rates), 1e-300))
    pieces = Pieces(begins=begins, rates=rates * size / span, noise=0.0, rough=bool(rough), errors=errors)
    return replace(pieces, noise=float(np.std(position - pieces.position(time))))


def given_pieces(time: ndarray, position: ndarray, rates: ndarray) -> Pieces:
    """Pieces with known rates, and beginnings that fit the positions best; `RecordError` if they do not fit."""
    t, x = _means(time, position, most=400)

    def off(begins: ndarray) -> float:
        begins = np.concatenate([t[:1], np.sort(begins)])
        return float(np.std(x - Pieces(begins=begins, rates=rates, noise=0.0).position(t)))

    bounds = [(t[0], t[-1])] * (len(rates) - 1)
    begins = differential_evolution(off, bounds, rng=0, tol=1e-10, maxiter=400).x if bounds else np.empty(0)
    noise, begins = off(begins), np.concatenate([time[:1], np.sort(begins)])
    if noise > 0.03 * np.ptp(x):
        parts = zip(np.array_split(t, 8), np.array_split(x, 8), strict=True)
        moved = [np.polyfit(*part, 1)[0] for part in parts]
        given, actual = (", ".join(f"{rate:.3g}" for rate in each) for each in (rates, moved))
        raise RecordError(
            f"--rates must be those of the load point. Received {given} m/s; in eighths of the record it moves at "
            f"{actual} m/s. Correct the rates, or cut out the part with --from and --to."
        )
    return Pieces(begins=begins, rates=rates, noise=noise, given=True)


@dataclass(frozen=True, kw_only=True)
class Loading:
    """Motion of the load point of a record, and its normal load."""

    pieces: Pieces
    normal: Pieces | None  # pieces of the normal load, in its unit instead of m; None if constant or as measured
    level: float | None  # normal load at the first sample, or its constant value; None if as measured
    notes: tuple[str, ...]  # assumptions

    @property
    def first_rate(self) -> float:
        """Initial rate of the load point [m/s]."""
        return float(self.pieces.rates[0])

    @property
    def steps(self) -> ndarray:
        """Times of large changes of rate [s]."""
        return np.asarray(self.pieces.begins[1:][self.pieces.large_changes])

    @property
    def before(self) -> float:
        """Displacement of the load point before the first large change of rate [m]."""
        return float(self.pieces.position(self.steps[:1])[0]) if len(self.steps) else 0.0

    @property
    def first_step(self) -> float | None:
        """Logarithm of the ratio of rates at the first large change; None without one, or unless both are positive."""
        if not len(places := np.flatnonzero(self.pieces.large_changes)):
            return None
        slow, fast = self.pieces.rates[places[0] : places[0] + 2]
        return float(np.log(fast / slow)) if slow > 0 and fast > 0 else None

    def delays(self, record: Record) -> tuple[ndarray, ndarray]:
        """Columns of `Widened` for changes of rate whose times are uncertain, and the largest delay of each [s]."""
        begins, rates = self.pieces.begins, self.pieces.rates
        ends = np.append(begins[1:], np.inf)
        off = self.pieces.noise / np.maximum(np.abs(np.diff(rates)), 1e-300)
        count = len(record.time) if record.counts is None else float(np.sum(record.counts))
        period = (record.time[-1] - record.time[0]) / count
        late = self.pieces.large_changes & (off > _TIMELY * period)
        hidden = [] if self.pieces.rough else np.flatnonzero(late).tolist()
        hidden = sorted(sorted(hidden, key=lambda i: -abs(rates[i + 1] - rates[i]))[:_MOST_DELAYS])
        after = [(record.time >= begins[i + 1]) & (record.time < ends[i + 1]) for i in hidden]
        windows = [(samples, 3 * off[i] + period) for samples, i in zip(after, hidden, strict=True) if samples.any()]
        table = np.array([samples for samples, _ in windows]).T.reshape(len(record.time), len(windows)).astype(float)
        return table, np.array([most for _, most in windows])

    def drive(self, record: Record) -> tuple[Drive, ndarray]:
        """Drive between all samples and changes of rate, and whether each of these instants is a sample."""
        assert record.load_point is not None
        inside = self.pieces.begins[(self.pieces.begins > record.time[0]) & (self.pieces.begins < record.time[-1])]
        changes = np.array([]) if self.pieces.rough else np.setdiff1d(inside, record.time)
        instants = np.union1d(record.time, changes)
        lengths = np.diff(instants)
        if self.pieces.rough:
            rates = np.diff(record.load_point) / lengths
        else:
            middles = (instants[1:] + instants[:-1]) / 2
            rates = self.pieces.rates[np.searchsorted(self.pieces.begins, middles, side="right") - 1]
        normal = np.log(np.interp(instants, record.time, record.normal))
        growth, compliance = np.diff(normal) / lengths, np.exp(-(normal[1:] + normal[:-1]) / 2)
        columns = {"lengths": lengths, "rates": rates, "growth": growth, "compliance": compliance}
        return Drive(first_rate=self.first_rate, **columns), np.isin(instants, record.time)


def prepared(record: Record, rates: Sequence[float] = (), fixed: Pieces | None = None) -> tuple[Record, Loading | None]:
    """The record as means of its samples, with load point and normal load that drive the model; and their `Loading`.

    `rates` of the load point [m/s], or the pieces, may be given. Raises `RecordError` if the record contradicts them.
    """
    time, load = record.time, record.load_point
    if load is None:
        if len(rates):
            raise RecordError(
                "--rates needs a column of the load point for the times of changes. Received none. Add this column."
            )
        return thinned(record), None
    if fixed is not None:
        pieces = fixed
    elif len(rates):
        pieces = given_pieces(time, load, np.asarray(rates, dtype=float))
    elif record.load_rates is not None:
        pieces = staircase(time, record.load_rates)
    else:
        pieces = straight_pieces(time, load, scatter(time, load), reading_step(load))
    relative = FAR_OFF * scatter(time, record.friction) / abs(float(np.median(record.friction)))
    allowed, mean = relative * float(np.median(record.normal)), float(np.mean(record.normal))
    loading = Loading(pieces=pieces, normal=None, level=mean, notes=(_in_words(pieces),))
    if np.percentile(np.abs(record.normal - mean), 99) > max(allowed, 1e-9 * mean):
        size = scatter(time, record.normal)
        normal = straight_pieces(time, record.normal, max(size, allowed / FAR_OFF), reading_step(record.normal))
        if normal.noise > max(allowed, 2 * size):
            normal_load = replace(loading, level=None), "the normal load is followed sample by sample"
        else:
            level = float(np.mean(record.normal - normal.position(time)))
            normal_load = replace(loading, normal=normal, level=level), "the normal load is piecewise linear"
        loading = replace(normal_load[0], notes=(*loading.notes, normal_load[1]))
    means = thinned(record, pieces.begins, follow=pieces.rough)
    load = means.load_point if pieces.rough else pieces.position(means.time)
    pressed = means.normal if loading.level is None else np.full_like(means.normal, loading.level)
    moved = 0.0 if loading.normal is None else loading.normal.position(means.time)
    return replace(means, load_point=load, normal=pressed + moved), loading


def _in_words(pieces: Pieces) -> str:
    if pieces.rough:
        return "the measured motion of the load point is used with its noise; give known rates with --rates"
    lines = [f"{rate:.4g}" for rate in pieces.rates[:6]] + ["…"] * (len(pieces.rates) > 6)
    return f"the load point moves at {', then '.join(lines)} m/s{', as given' if pieces.given else ''}"


def _means(time: ndarray, position: ndarray, most: int = _MOST_POINTS) -> tuple[ndarray, ndarray]:
    """Times and positions, or means of neighbours so that at most `most` remain."""
    each = -(-len(time) // most)
    edges = np.arange(0, len(time), each)
    counts = np.diff([*edges, len(time)])
    t, x = (np.add.reduceat(values - values[0], edges) / counts + values[0] for values in (time, position))
    return t, x


def _design(u: ndarray, knots: ndarray) -> ndarray:
    return np.column_stack([np.ones_like(u), u, np.maximum(u[:, None] - knots, 0)])


def _hinges(u: ndarray, y: ndarray, knots: ndarray) -> tuple[ndarray, ndarray]:
    """Rates of all pieces, and the fitted piecewise linear function at all u."""
    design = _design(u, knots)
    coefficients, *_ = np.linalg.lstsq(design, y, rcond=None)
    return np.cumsum(coefficients[1:]), design @ coefficients


def _squares(u: ndarray, y: ndarray, knots: ndarray) -> float:
    """Sum of squares of the residuals of the fitted piecewise linear function."""
    return float(np.sum((y - _hinges(u, y, knots)[1]) ** 2))


def _refined(u: ndarray, y: ndarray, knots: ndarray) -> ndarray:
    """Knots at which the piecewise linear function fits best (Muggeo 2003, Stat. Med. 22, 3055)."""
    best, least = knots, np.inf
    for _ in range(8 if len(knots) else 0):
        squares = _squares(u, y, knots)
        if squares < least:
            best, gained, least = knots, least - squares, squares
            if gained < 1e-6 * least:
                break
        design = np.hstack([_design(u, knots), -1.0 * (u[:, None] > knots)])
        coefficients, *_ = np.linalg.lstsq(design, y, rcond=None)
        bends = coefficients[2 : 2 + len(knots)]
        moved = np.where(np.abs(bends) > 1e-12, coefficients[2 + len(knots) :] / np.where(bends == 0, 1, bends), 0)
        knots = np.sort(np.clip(knots + np.clip(moved, -0.05, 0.05), u[1], u[-2]))
        if len(np.unique(knots)) < len(knots):
            break
    return best


def _needed(u: ndarray, y: ndarray, knots: ndarray, floor: float) -> ndarray:
    """Knots except those that explain no more than noise or at which the rate hardly changes.

    Two knots less than two points apart count as one: a mean of samples before and after a change fits neither line.
    """
    left = y - _hinges(u, y, knots)[1]
    noise = max(float(left @ left) / len(u) * _spread(left), floor)
    allowed = _PIECE_PENALTY * np.log(len(u)) * noise
    while len(knots):
        rates, _ = _hinges(u, y, knots)
        changes = np.abs(np.diff(rates)) / np.maximum(np.maximum(np.abs(rates[1:]), np.abs(rates[:-1])), 1e-300)
        fewer = [_refined(u, y, np.delete(knots, i)) for i in range(len(knots))]
        losses = np.array([_squares(u, y, others) for others in fewer]) - _squares(u, y, knots)
        losses, near = np.maximum(losses, 0), np.diff(knots) < 2 / len(u)
        doubled = np.append(near, False) | np.insert(near, 0, False)
        losses = np.where(changes < _LEAST_CHANGE, -1.0, np.where(doubled, -1 / (1 + losses), losses))
        least = int(np.argmin(losses))
        if losses[least] >= allowed:
            break
        knots = fewer[least]
    return knots


def _rate_errors(u: ndarray, left: ndarray, knots: ndarray) -> ndarray:
    """Standard deviation of the slope of each piece: that of a separate line, because the knots are free.

    From the long-run variance of the residuals, the sum of their covariance over all lags, for the likeliest sum of
    white noise and a decaying process; for quantised readings, the lag-one correlation does not give the decay length.
    """
    ends = np.concatenate([u[:1], knots, u[-1:]])
    inside = np.maximum(np.histogram(u, ends)[0], 1)
    unknowns = np.hstack([_design(u, knots), -1.0 * (u[:, None] > knots)])
    ones = np.ones(len(u))
    shared = noise_of(left, unknowns, ones, u, None, ones > 0, most=len(u)) if np.any(left) else None
    spread = 1.0
    if shared is not None:
        fading = np.exp(-np.mean(np.diff(u)) / shared.length)
        spread = (1 + shared.share * (1 + fading) / (1 - fading)) / (1 + shared.share)
    noise = np.std(left) * np.sqrt(spread)
    return np.asarray(noise * np.sqrt(12 / inside) / np.maximum(np.diff(ends), 1e-300))


def _spread(residuals: ndarray) -> float:
    """Number of samples per independent sample for AR(1) residuals, from their lag-one correlation."""
    first = float(residuals[1:] @ residuals[:-1] / max(residuals @ residuals, 1e-300))
    first = min(max(first, 0.0), 0.95)
    return (1 + first) / (1 - first)
