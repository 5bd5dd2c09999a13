"""Laws for several blocks and their wells, designed by estimates of provable bounds.

Linear-quadratic feedback of the measurements, with an estimate of the disturbance from the innovation of the slip
rates: of all blocks if each has a well, else of one average per well. In a decentralised law all wells have the same
feedback of their own slip and slip rate. If pressures diffuse along the fault, the law contains a model of the
diffusion.
"""

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from scipy.linalg import block_diag, expm, solve_discrete_are
from scipy.optimize import minimize

from quakedesign.errors import ParameterError
from quakedesign.exact import rational, shortly
from quakedesign.guarantees.exact.plant_loop import LinearPart, MatrixLaw
from quakedesign.guarantees.search.plant_search import linear_part, pieces_of
from quakedesign.plant.block_plant import inverse_of, product
from quakedesign.plant.plant_values import Matrix, Row, unit
from quakedesign.plant.user_plant import UncertainPlant

_START = (0.0325, 1.6e-4, 0.13, 0.88, 1.2)
"""Weights of slip rates and of pressures, gain of the innovation, ratio of the model's input gain to the midpoint, and
additional weight of differences between neighbours."""
_STEPS = (0.5, 0.7, 0.5, 0.1, 0.5)
# largest number of evaluations, and largest product of this number and the cubed number of blocks
_EVALUATIONS = (300, 40000)
_DIGITS = 8
_SLOWEST = 0.92  # largest eigenvalue of a period: slower loops take longer to prove
_FORGET, _LEFT = 400, 1e-4  # largest number of summed periods; relative size of an addend at which the sum ends


@np.errstate(over="ignore", invalid="ignore")
def block_law(plant: UncertainPlant, step: Fraction, *, decentralised: bool = False) -> MatrixLaw:
    """Law for `UncertainPlant.from_blocks` with the least estimated slip-rate errors.

    Parameters
    ----------
    plant : UncertainPlant
        From `UncertainPlant.from_blocks`.
    step : Fraction
        T_s [s].
    decentralised : bool
        Whether the pressure of each well depends on its own measurements alone.

    Raises
    ------
    ParameterError
        For a step for which the design fails in floating point.
    """
    part, scale = linear_part(plant, {}), np.array(_START)

    def cost(x: np.ndarray) -> float:
        values = scale * np.exp(x)
        if values[2] >= 1:
            return 1e3
        try:
            bounds = estimate(part, _law_of(part, step, values, decentralised))
        except ValueError:  # overflow of a growing mode, or no solution of the Riccati equation
            return 1e3
        return bounds[0] if bounds[1] is None else float(np.log(bounds[1][blocks : 2 * blocks].max())) - 100

    blocks = len(part.outputs) // 2
    simplex = np.vstack([np.zeros(len(_STEPS)), np.diag(_STEPS)])
    most = min(_EVALUATIONS[0], _EVALUATIONS[1] // blocks**3)
    options = {"maxfev": most, "xatol": 1e-2, "fatol": 1e-3, "initial_simplex": simplex}
    best = minimize(cost, np.zeros(len(_STEPS)), method="Nelder-Mead", options=options)
    try:
        return _law_of(part, step, scale * np.exp(best.x), decentralised)
    except ValueError:
        raise ParameterError(
            "the growth of the errors of several blocks within one step must be within the range of floats. Received a "
            f"step of {shortly(step)} s, for which this fails. Shorten the step, or check units of blocks and friction."
        ) from None


def middle(part: LinearPart) -> tuple[np.ndarray, np.ndarray]:
    """A and B with every sector at its midpoint."""
    A, B = np.array(part.A, dtype=float), np.array(part.B, dtype=float)
    for sector in part.sectors:
        entry, row = (np.array(values, dtype=float) for values in (sector.entry, sector.row))
        share = float(sum(sector.slopes)) / 2 * np.outer(entry, row)
        A, B = A + share[:, : len(A)], B + share[:, len(A) :]
    return A, B


def _with_hold(A: np.ndarray, E: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    n, m = E.shape
    whole = expm(np.block([[A, E], [np.zeros((m, n + m))]]) * step)
    return whole[:n, :n], whole[:n, n:]


def _feedback(A: np.ndarray, G: np.ndarray, x: np.ndarray) -> np.ndarray:
    count = G.shape[1]
    chain = 2 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1)
    chain[0, 0] = chain[-1, -1] = min(count - 1, 1)
    apart = np.eye(count) + x[4] * chain
    Q = block_diag(apart, x[0] * np.eye(count), np.zeros([len(A) - 2 * count] * 2))
    P = solve_discrete_are(A, G, Q, x[1] * apart)
    gain: np.ndarray = np.linalg.solve(x[1] * apart + G.T @ P @ G, G.T @ P @ A)
    return gain


def _law_of(part: LinearPart, step: Fraction, x: np.ndarray, decentralised: bool) -> MatrixLaw:
    """Feedback of the measurements: π⁺ = P(e, q), d⁺ = d + M(e2 − π), p = −g⁻¹(K(e, q) + d⁺).

    Measurements are all errors e, or their means for each well; q models diffusing pressures, g is the input gain.
    """
    blocks, count = len(part.outputs) // 2, len(part.C) // 2
    A, B = middle(part)
    weights = np.array(part.C, dtype=float)[:count, :blocks]
    flow, fed, read = A[2 * blocks :, 2 * blocks :], B[2 * blocks :], A[blocks : 2 * blocks, 2 * blocks :]
    acting = B[blocks : 2 * blocks] - read @ np.linalg.solve(flow, fed)  # at steady pressure
    spread = acting @ np.linalg.inv(weights @ acting) if count < blocks else np.eye(blocks)
    own = np.kron(np.eye(2), weights) @ A[: 2 * blocks, : 2 * blocks] @ np.kron(np.eye(2), spread)
    gain, read = weights @ acting * x[3], weights @ read * x[3]
    if decentralised:  # each well uses its own measurements and treats the others as a disturbance
        own, gain = own * np.kron(np.ones((2, 2)), np.eye(count)), np.diag(np.diag(gain))
        flow, fed, read = block_diag(*[flow] * count), block_diag(*fed.T[:, :, None]), block_diag(*read[:, None])
    still, more, size = np.zeros((count, count)), len(flow), 2 * count
    largest = 1 / np.abs(gain).max()  # pressure for an acceleration of 1 m/s² [Pa]
    whole = np.block([[own, np.vstack([np.zeros_like(read), read * largest])], [np.zeros((more, size)), flow]])
    wells = np.linalg.inv(gain) / largest
    at_once = np.eye(count) + read @ np.linalg.solve(flow, fed) @ wells * largest if more else np.eye(count)
    phi, input_map = _with_hold(whole, np.vstack([still, at_once, fed @ wells]), float(step))
    K = _feedback(phi, input_map, x * (1, 1, 1, 1, not decentralised))
    scale = np.r_[np.ones(size), np.full(more, 1 / largest)]  # scales of the states, for pressures in Pa
    feedback = rounded(K * scale)
    pushed = _with_hold(own, np.vstack([still, np.eye(count)]), float(step))[1]
    corrections = rounded(float(x[2]) * np.linalg.inv(pushed[count:]))
    closed = (phi - input_map @ (np.array(feedback, dtype=float) / scale)) * scale / scale[:, None]
    return _law(step, rounded(gain), feedback, corrections, rounded(closed[count:]))


def _law(
    step: Fraction, gains: Matrix, feedback: tuple[Row, ...], corrections: tuple[Row, ...], expected: tuple[Row, ...]
) -> MatrixLaw:
    """Law with states π [m/s], diffusing pressures [Pa], d [m/s²]; p = −g⁻¹d balances d."""
    size, zero, inverse = len(feedback), Fraction(0), inverse_of(gains)
    still, more = (zero,) * size, len(expected) - size
    if inverse is None:
        raise ValueError("the input gains are singular after rounding")

    def acting(rows: Sequence[Row]) -> Matrix:
        return tuple(tuple(-v for v in row) for row in product(inverse, rows, len(rows[0])))

    estimated = [(*(-v for v in row), *[zero] * more, *unit(size, i)) for i, row in enumerate(corrections)]
    by_pressures = [(*still, *row[2 * size :], *still) for row in feedback]
    return MatrixLaw(
        step=step,
        delay=zero,
        update=(*((*still, *row[2 * size :], *still) for row in expected), *estimated),
        measured=(*(row[: 2 * size] for row in expected), *((*still, *row) for row in corrections)),
        output=acting([_sum(*rows) for rows in zip(estimated, by_pressures, strict=True)]),
        feedback=acting([_sum(row[: 2 * size], (*still, *by)) for row, by in zip(feedback, corrections, strict=True)]),
    )


def _sum(one: Row, other: Row) -> Row:
    return tuple(a + b for a, b in zip(one, other, strict=True))


def rounded(values: np.ndarray, digits: int = _DIGITS) -> tuple[Row, ...]:
    """Rows of a matrix as decimals."""
    return tuple(tuple(rational(f"{v:.{digits}g}") for v in row) for row in values)


def estimate(
    part: LinearPart, law: MatrixLaw, slowest: float = _SLOWEST, forget: int = _FORGET
) -> tuple[float, np.ndarray | None]:
    """Small gain and bounds of a loop without delay, noise and initial states, in floats.

    Bounds are None if the small gain is 1 or more; the conditions `within` of sectors are not checked. They are also
    None if an eigenvalue of the map of a period exceeds `slowest` in magnitude; 100 times this magnitude then replaces
    the small gain. Responses are summed over at most
    `forget` periods.
    """
    loop = part.loop(law)
    flow, rows = np.array(loop.flow, dtype=float), np.array(loop.rows, dtype=float)
    jump, time = np.array(loop.segments[0][0], dtype=float), float(loop.segments[0][1])
    kinds: dict[Row, int] = {}
    kind = [kinds.setdefault(entry, len(kinds)) for entry in loop.inputs]
    entries, pieces = np.array(list(kinds), dtype=float).T, max(pieces_of(loop) // 2, 2)
    h = time / pieces
    powers = [np.linalg.matrix_power(expm(flow * h), i) for i in range(pieces + 1)]
    period = powers[-1] @ jump
    radius = float(max(abs(np.linalg.eigvals(period))))
    if radius > slowest:
        return 1e2 * radius, None
    widths = [h / 2, *[h] * (pieces - 1), h / 2]
    columns = np.hstack([power @ entries * width for power, width in zip(powers, widths, strict=True)])
    now = np.vstack([rows @ power @ jump for power in powers])
    sums = np.zeros((len(now), len(kinds)))
    for _ in range(forget):
        added = np.abs(now @ columns).reshape(len(now), pieces + 1, -1).sum(axis=1)
        sums += added
        if (added <= _LEFT * sums).all():
            break
        now = now @ period
    ends = sums.reshape(pieces + 1, len(rows), -1)
    heights = [np.abs(rows @ power @ entries) for power in powers]
    since, largest = np.zeros_like(heights[0]), ends[0]
    for i in range(pieces):
        since = since + (heights[i] + heights[i + 1]) * h / 2
        largest = np.maximum(largest, ends[i + 1] + since)
    gains = largest[:, kind]
    count, first = len(part.outputs), len(part.disturbances) + len(part.loads)
    span = slice(count, count + len(part.sectors))
    halves = np.array([float(s.slopes[1] - s.slopes[0]) / 2 for s in part.sectors])
    matrix = halves[:, None] * gains[span, first:]
    small = float(max(abs(np.linalg.eigvals(matrix))))
    if small >= 1:
        return small, None
    own = np.array([float(size) for _, size in part.disturbances] + [float(load.rate) for load in part.loads])
    numbers = np.linalg.solve(np.eye(len(halves)) - matrix, halves * (gains[span, :first] @ own))
    bounds = gains[:, :first] @ own + gains[:, first:] @ numbers
    return small, np.delete(bounds, span)
