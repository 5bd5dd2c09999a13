"""Bad disturbances for the e-LQR's error loop: lower bounds on any certified peak, found by search."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from quakedesign.errors import ParameterError
from quakedesign.synthesis.linear.plant.polytope import ErrorLoop

Corner = tuple[Fraction, Fraction, Fraction]
_STEPS = 2000
_NODES = 240
_SWEEPS = 30
_HORIZONS = tuple(0.66**n for n in range(13))


@dataclass(frozen=True, slots=True, kw_only=True)
class BadDisturbance:
    """A force of a disturbance class and what it reaches; feasible by construction, so a lower bound.

    Attributes
    ----------
    peak : float
        |output| at the end, in the unit of the output.
    step : float
        [s].
    force : ndarray, shape (n,)
        Constant over each step, or (for the rate-limited class) n nodes joined by straight lines [m/s²].
    parameters : ndarray, shape (n, 3)
        β, s and w over each step.
    """

    peak: float
    step: float
    force: Any
    parameters: Any


def bang_bang(loop: ErrorLoop, corner: Corner, amplitude: float, output: str) -> BadDisturbance:
    """Worst |φ_e| ≤ amplitude for constant parameters: the sign of the impulse response, backwards in time.

    Parameters
    ----------
    loop : ErrorLoop
    corner : (Fraction, Fraction, Fraction)
        β, s, w.
    amplitude : float
        [m/s²].
    output : str
    """
    import numpy as np

    step, count = _grid([_matrix(loop, corner)], _STEPS)
    move, push = _sampled(_matrix(loop, corner), step, 0)
    kernel, row = np.empty(count), _output(loop, output)
    for k in range(count):
        kernel[count - 1 - k] = row @ push
        row = row @ move
    return BadDisturbance(
        peak=float(amplitude * np.abs(kernel).sum()),
        step=step,
        force=amplitude * np.sign(kernel),
        parameters=np.tile([float(v) for v in corner], (count, 1)),
    )


def rate_limited(loop: ErrorLoop, corner: Corner, amplitude: float, rate: float, output: str) -> BadDisturbance:
    """Worst |φ_e| ≤ amplitude, |φ_e′| ≤ rate among polygons, for constant parameters: linear programs (HiGHS).

    The force may start anywhere within its bound, so short horizons, where that start counts most, are tried as well.

    Parameters
    ----------
    loop : ErrorLoop
    corner : (Fraction, Fraction, Fraction)
    amplitude, rate : float
        [m/s²], [m/s³].
    output : str

    Raises
    ------
    ParameterError
        When a linear program has no answer.
    """
    step, count = _grid([_matrix(loop, corner)], _NODES)
    found = [_polygon(loop, corner, amplitude, rate, output, step * part, count) for part in _HORIZONS]
    return max(found, key=lambda bad: bad.peak)


def _polygon(
    loop: ErrorLoop, corner: Corner, amplitude: float, rate: float, output: str, step: float, count: int
) -> BadDisturbance:
    import numpy as np
    from scipy.optimize import linprog
    from scipy.sparse import csr_matrix, vstack

    move, push = _sampled(_matrix(loop, corner), step, 0)
    _, ramp = _sampled(_matrix(loop, corner), step, 1)
    gain, row = np.zeros(count + 1), _output(loop, output)
    for k in range(count - 1, -1, -1):
        slope = float(row @ ramp) / step
        gain[k] += float(row @ push) - slope
        gain[k + 1] += slope
        row = row @ move
    places = np.arange(count)
    entries = np.concatenate([-np.ones(count), np.ones(count)])
    change = csr_matrix((entries, (np.tile(places, 2), np.concatenate([places, places + 1]))))
    both, limits = vstack([change, -change]), np.full(2 * count, rate * step / amplitude)
    answer = linprog(-gain / np.abs(gain).max(), A_ub=both, b_ub=limits, bounds=(-1, 1), method="highs")
    if answer.x is None:
        raise ParameterError(f"the linear program of the worst rate-limited force failed: {answer.message}")
    return BadDisturbance(
        peak=float(abs(gain @ answer.x) * amplitude),
        step=step,
        force=amplitude * answer.x,
        parameters=np.tile([float(v) for v in corner], (count, 1)),
    )


def switched(loop: ErrorLoop, amplitude: float, output: str, seed: int = 0) -> BadDisturbance:
    """Bad |φ_e| ≤ amplitude together with bad switching of β, s and w: sweeps of the maximum principle.

    Forward for the states, backward for the costates, and every parameter to the end that the costate asks for; the
    best of the sweeps is kept, started from random parameters.

    Parameters
    ----------
    loop : ErrorLoop
    amplitude : float
        [m/s²].
    output : str
    seed : int
    """
    import numpy as np

    corners = list(loop.corners())
    step, count = _grid([_matrix(loop, c) for c in corners], _STEPS // 2)
    sampled = [_sampled(_matrix(loop, c), step, 0) for c in corners]
    rng = np.random.default_rng(seed)
    choice, force = rng.integers(len(corners), size=count), amplitude * np.ones(count)
    best = BadDisturbance(peak=0.0, step=step, force=force, parameters=np.empty((0, 3)))
    values = np.array([[float(v) for v in c] for c in corners])
    for _ in range(_SWEEPS):
        rows = _backward(sampled, choice, _output(loop, output))
        force = amplitude * np.sign([rows[k + 1] @ sampled[choice[k]][1] for k in range(count)])
        states = _forward(sampled, choice, force)
        peak = float(abs(_output(loop, output) @ states[-1]))
        if peak > best.peak:
            best = BadDisturbance(peak=peak, step=step, force=force, parameters=values[choice])
        pushed = np.array([[rows[k + 1] @ (m @ states[k] + p * force[k]) for m, p in sampled] for k in range(count)])
        wanted = pushed.argmax(axis=1)
        if np.array_equal(wanted, choice):
            break
        change = rng.random(count) < 0.5
        choice = np.where(change, wanted, choice)
    return best


def response(loop: ErrorLoop, found: BadDisturbance, output: str) -> Any:
    """Output after every step of a disturbance that is constant over the steps, from rest (n,)."""
    import numpy as np

    kinds, choice = np.unique(found.parameters, axis=0, return_inverse=True)
    corners = [(Fraction(float(b)), Fraction(float(s)), Fraction(float(w))) for b, s, w in kinds]
    sampled = [_sampled(_matrix(loop, corner), found.step, 0) for corner in corners]
    states = _forward(sampled, choice.ravel(), found.force)
    return np.array(states[1:]) @ _output(loop, output)


def _forward(sampled: Sequence[Any], choice: Any, force: Any) -> list[Any]:
    import numpy as np

    states = [np.zeros(len(sampled[0][1]))]
    for k, push in zip(choice, force, strict=True):
        states.append(sampled[k][0] @ states[-1] + sampled[k][1] * push)
    return states


def _backward(sampled: Sequence[Any], choice: Any, row: Any) -> list[Any]:
    rows = [row]
    for k in reversed(choice):
        rows.append(rows[-1] @ sampled[k][0])
    return rows[::-1]


def _matrix(loop: ErrorLoop, corner: Corner) -> Any:
    import numpy as np

    return np.array([[float(v) for v in row] for row in loop.matrix(*corner)])


def _output(loop: ErrorLoop, output: str) -> Any:
    import numpy as np

    return np.array([float(v) for v in loop.outputs()[output]])


def _grid(matrices: Sequence[Any], most: int) -> tuple[float, int]:
    """Step and number of steps: the fastest pole resolved, ten time constants of the slowest unless too many."""
    import numpy as np

    poles = np.concatenate([np.linalg.eigvals(A) for A in matrices])
    slowest, fastest = float(-poles.real.max()), float(np.abs(poles).max())
    if slowest <= 0:
        raise ParameterError("a worst disturbance needs a stable loop. Received one with a pole that is not.")
    horizon = min(10 / slowest, most / (8 * fastest) * 4)
    return horizon / most, most


def _sampled(A: Any, step: float, order: int) -> tuple[Any, Any]:
    """Exact transition of the states over a step, and the response to a force tᵒʳᵈᵉʳ."""
    import numpy as np
    from scipy.linalg import expm

    size = len(A)
    chain = np.zeros((size + 1 + order, size + 1 + order))
    chain[:size, :size] = A
    chain[1, size] = 1.0
    if order:
        chain[size, size + 1] = 1.0
    full = expm(chain * step)
    return full[:size, :size], full[:size, -1]
