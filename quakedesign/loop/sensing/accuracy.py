"""How far the estimates of a differentiator are off, measured against adverse signals.

What is proved of the implicit one, from rest, is in `quakedesign.loop.sensing.differences`.
"""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from quakedesign.loop.sensing.differentiator import Differentiator

SAMPLES = 1000
SETTLED = 400
STRETCH = 10.0  # δ/T where the noise decides
HALF_PERIODS = (1, 2, 3, 5, 8, 13, 30, 100, SAMPLES)


def error_scale(differentiator: Differentiator, noise: float) -> float:
    """δ = max(T, (ε/λ_d)^(1/(n_d+1))) [s], which sets the accuracy, for readings off by ε [m] at most."""
    return float(max(differentiator.step, (noise / differentiator.bound) ** (1 / (differentiator.order + 1))))


def worst_errors(differentiator: Differentiator, noise: float = 0.0) -> tuple[float, ...]:
    """Errors of the estimates of slip [m], slip rate [m/s] … in the settled differentiator, c_i·λ_d·δ^(n_d+1−i).

    The constants c_i are the largest that were met with |x1^(n_d+1)| = λ_d against a number of adverse signals, and so
    are lower bounds of the worst ones.

    Parameters
    ----------
    differentiator : Differentiator
    noise : float
        ε, bound of the error of a reading [m].

    Returns
    -------
    tuple of float
        One entry for each derivative 0 … n_d.
    """
    unit = replace(differentiator, bound=1.0, step=1.0)
    factors = constants(unit, noisy=noise > 0)
    scale, order = error_scale(differentiator, noise), differentiator.order
    return tuple(c * differentiator.bound * scale ** (order + 1 - i) for i, c in enumerate(factors))


@lru_cache(maxsize=64)
def constants(unit: Differentiator, noisy: bool) -> tuple[float, ...]:
    """c_0 … c_nd of a differentiator with λ_d = T = 1, without and, if noisy, also with dominating noise."""
    ratios = [_errors(unit, scale) / _orders(unit, scale) for scale in ((1.0, STRETCH) if noisy else (1.0,))]
    return tuple(float(max(column)) for column in zip(*ratios, strict=True))


def _orders(unit: Differentiator, scale: float) -> "np.ndarray":
    return scale ** np.arange(unit.order + 1, 0, -1.0)


def _errors(unit: Differentiator, scale: float) -> "np.ndarray":
    """Largest settled errors; with a scale above 1 under the noise that has it."""
    random = np.random.default_rng(0)
    noise = scale ** (unit.order + 1) if scale > 1 else 0.0
    acceleration, sign = (part.ravel() for part in np.meshgrid(*[np.arange(_kinds(unit))] * 2))
    columns = len(acceleration) if noise else _kinds(unit)
    step = _function(unit).map(columns)
    memory = np.zeros((unit.size, columns))
    true, errors, worst = (np.zeros((unit.order + 1, columns)) for _ in range(3))
    for sample in range(SAMPLES):
        signs = _signs(sample, errors, random)
        highest = signs[acceleration[:columns], np.arange(columns)]
        off = noise * signs[sign[:columns], np.arange(columns)]
        after, estimates = step(memory, true[:1] + off)
        memory, errors = after.full(), estimates.full() - true
        if sample >= SETTLED:
            worst = np.maximum(worst, abs(errors))
        true = _moved(true, highest)
    return np.asarray(worst.max(axis=1))


def _kinds(unit: Differentiator) -> int:
    return len(HALF_PERIODS) + 2 * (unit.order + 1) + 1


def _signs(sample: int, errors: "np.ndarray", random: Any) -> "np.ndarray":
    """One row an adversary: square waves, for and against every error, and chance; one column a run."""
    columns = errors.shape[1]
    waves = [np.full(columns, 1.0 if sample // half % 2 else -1.0) for half in HALF_PERIODS]
    chasing = [way * np.where(error > 0, 1.0, -1.0) for error in errors for way in (1, -1)]
    return np.array([*waves, *chasing, random.choice([-1.0, 1.0], columns)])


def _moved(derivatives: "np.ndarray", highest: "np.ndarray") -> "np.ndarray":
    """Derivatives one time unit later, with a constant next one."""
    whole = [*derivatives, highest]
    after = []
    for i in range(len(derivatives)):
        total = np.zeros_like(highest)
        for degree in range(len(whole) - 1 - i, 0, -1):
            total = (total + whole[i + degree]) / degree
        after.append(whole[i] + total)
    return np.array(after)


def _function(unit: Differentiator) -> Any:
    """CasADi Function (memory, slip) → memory, estimates."""
    memory, slip = ca.SX.sym("memory", unit.size), ca.SX.sym("slip")
    estimates, after = unit.estimate([*map(ca.SX, unit.numbers)], ca.vertsplit(memory), slip)
    return ca.Function("differentiator", [memory, slip], [ca.vertcat(*after), ca.vertcat(*estimates)])
