"""An e-LQR that holds slow sliding: LQ on the sampled plant through its path, fed by a Kalman observer of the slip.

The model is scaled: slip error in D, pressures and stresses in N, time in 1/ρ = D/V; the law carries the slow modes of
the layer of rock and a level of everything that it does not know. Whatever the numbers, its states rest where it asks
for a constant pressure without errors: the gain of the level, and how the level moves the slip, follow from that.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import exp
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError, expm, solve_discrete_are

from quakedesign.errors import ParameterError
from quakedesign.loop import Layer, LinearLaw, SlidingModel
from quakedesign.synthesis.guaranteed.rounding import short

MODES = 4
_DIGITS = 9
_LEAST = 1e-12  # cost of what costs nothing, so that Riccati's equation has one solution
_ZERO, _ONE = Fraction(0), Fraction(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """What LQ and observer trade, in the scaled model.

    Attributes
    ----------
    slip, state, pressure : float
        LQ weights of x², z² and u² beside y².
    slip_noise, state_noise, level_noise : float
        Variances of what moves x, z and the level from sample to sample, beside that of the measured x.
    """

    slip: float
    state: float
    pressure: float
    slip_noise: float
    state_noise: float
    level_noise: float


FAVOURED = Weights(slip=4.4e-3, state=5.5e-3, pressure=344.0, slip_noise=5.9e3, state_noise=1.4e-4, level_noise=162.0)
"""Of a search for the smallest worst peak of y under bounded stresses: a = 0.01, b = 0.015, ρL²/D = 1, ρT_s = 0.05."""


def sliding_law(
    model: SlidingModel, step: Fraction, *, diffusion: Fraction = _ZERO, weights: Weights = FAVOURED
) -> LinearLaw:
    """Law of samples of the slip error, its pressure held over a step [s] and brought through rock of L²/D [s].

    The pressure is what the law adds to that which the reference needs. States: predicted x, z, the modes of the layer
    and the level; all scaled.

    Raises
    ------
    ParameterError
        When no gains are found: the step, or the way through the rock, is too long for the instability.
    """
    layer = Layer(time=diffusion * model.state_rate) if diffusion else None
    modes = MODES if layer else 0
    shares = [layer.share(i) for i in range(modes)] if layer else []
    scaled_step = step * model.state_rate
    fades = [short(exp(-float(layer.rate(i) * scaled_step)), _DIGITS) for i in range(modes)] if layer else []
    seen = _reading(model, shares)
    moved = expm(_flow(seen, layer, modes) * float(scaled_step))
    size = 2 + modes
    own = [[short(v, _DIGITS) for v in row[: size + 2]] for row in moved[:2]]
    for row in own:  # (x, z, modes, level, pressure): a level that the pressure balances moves nothing
        row[size] = (sum(row[2:size], _ZERO) + row[size + 1]) / model.coefficient
    update = [
        *own,
        *([*[_ZERO] * (2 + i), fade, *[_ZERO] * (size - 1 - i - 1), 1 - fade] for i, fade in enumerate(fades)),
        [*[_ZERO] * size, _ONE, _ZERO],
    ]
    gains, corrections = _gains(update, seen, weights)
    gains.append((1 + sum(gains[2:], _ZERO)) / model.coefficient)
    stress, length = model.weakening / model.evolution, model.rate / model.state_rate
    return _law(update, gains, corrections, length=length, stress=stress)


def _reading(model: SlidingModel, shares: Sequence[Fraction]) -> Any:
    """y of (x, z, modes, level, pressure), scaled."""
    normal, length = model.weakening / model.evolution, model.rate / model.state_rate
    pressure = [*shares, _ZERO, 1 - sum(shares, _ZERO)]
    row = [-model.stiffness * length / normal, -model.evolution, *(model.coefficient * c for c in pressure)]
    row[-2] = _ONE
    return np.array([float(v * normal / model.strength) for v in row])


def _flow(seen: Any, layer: Layer | None, modes: int) -> Any:
    """Generator of (x, z, modes, level, pressure): x′ = y, z′ = −y − z."""
    flow = np.zeros((4 + modes, 4 + modes))
    flow[0], flow[1] = seen, -seen
    flow[1, 1] -= 1
    for i in range(modes):
        speed = float(layer.rate(i)) if layer else 0.0
        flow[2 + i, 2 + i], flow[2 + i, -1] = -speed, speed
    return flow


def _gains(update: list[list[Fraction]], seen: Any, w: Weights) -> tuple[list[Fraction], list[Fraction]]:
    """LQ gains on (x, z, modes), and how the observer corrects x, z and the level."""
    moved = np.array(update, dtype=float)
    size = len(moved) - 1
    cost = np.outer(seen[:size], seen[:size]) + np.diag([w.slip, w.state, *[0.0] * (size - 2)]) + _LEAST * np.eye(size)
    of_state, of_pressure, held = moved[:size, :size], moved[:size, -1:], [0, 1, size]
    own, told = moved[np.ix_(held, held)], np.array([[1.0, 0.0, 0.0]])
    try:
        value = solve_discrete_are(of_state, of_pressure, cost, np.array([[w.pressure]]))
        spread = solve_discrete_are(own.T, told.T, np.diag([w.slip_noise, w.state_noise, w.level_noise]), np.eye(1))
    except (LinAlgError, ValueError):
        raise ParameterError(
            "slow sliding needs a step and a path that its instability lets be. Received ones for which Riccati's "
            "equation has no solution. Shorten them."
        ) from None
    gains = of_pressure.T @ value @ of_state / (w.pressure + of_pressure.T @ value @ of_pressure)
    corrections = spread[:, 0] / (spread[0, 0] + 1)
    return [short(v, _DIGITS) for v in gains[0]], [short(v, _DIGITS) for v in corrections]


def _law(
    update: list[list[Fraction]],
    gains: list[Fraction],
    corrections: list[Fraction],
    *,
    length: Fraction,
    stress: Fraction,
) -> LinearLaw:
    """u = −K(π + l(x − π_x)), π⁺ = A(π + l(x − π_x)) + Bu, with the slip in m and the pressure in Pa outside."""
    size = len(gains)
    spread = [corrections[0], corrections[1], *[_ZERO] * (size - 3), corrections[2]]
    closed = [[row[j] - row[size] * gains[j] for j in range(size)] for row in update]

    def of_measured(row: Sequence[Fraction]) -> Fraction:
        return sum((v * c for v, c in zip(row, spread, strict=True)), _ZERO)

    def of_predicted(row: Sequence[Fraction]) -> list[Fraction]:
        return [v - of_measured(row) * (j == 0) for j, v in enumerate(row)]

    return LinearLaw(
        states=("slip", "state", *(f"mode{i}" for i in range(size - 3)), "level"),
        update=tuple(tuple(of_predicted(row)) for row in closed),
        measured=tuple((of_measured(row) / length, _ZERO) for row in closed),
        output=tuple(-stress * v for v in of_predicted(gains)),
        feedback=(-stress * of_measured(gains) / length, _ZERO),
    )
