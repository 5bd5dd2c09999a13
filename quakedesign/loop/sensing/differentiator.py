"""Robust exact filtering differentiator (eq. dif of the paper)."""

import math
import sys
from dataclasses import dataclass
from typing import Any

from quakedesign.errors import ParameterError, require_known
from quakedesign.fault.checks import require_positive
from quakedesign.loop.sensing.coefficients import LONGEST, TABLES
from quakedesign.loop.sensing.differentiator_step import explicit_step, implicit_step, lag_free

DISCRETISATIONS = ("euler", "homogeneous", "implicit")


@dataclass(frozen=True, kw_only=True)
class Differentiator:
    """Estimates slip and its first n_d derivatives exactly once |x1^(n_d+1)| ≤ L_d < λ_d, and filters with order n_f.

    With a reading off by ε at most, sampled every T, the estimate of derivative i is off by a multiple of
    λ_d·δ^(n_d+1−i), δ = max(T, (ε/λ_d)^(1/(n_d+1))); ``euler`` has this for n_d = 1 only. Levant and Livne (2020),
    European Journal of Control 55, 33. The paper takes n_d = n_f = 2, for which a sliding mode has no λ_d; n_d = 1 has
    (ERRATA 21). See `quakedesign.loop.sensing.differentiator_step` for the equations.

    Attributes
    ----------
    bound : float
        λ_d [m/s^(n_d+1)].
    step : float
        Sampling period T [s].
    order : int
        n_d, at least 1.
    filter_order : int
        n_f; n_d + n_f is 12 at most.
    discretisation : str
        ``"euler"``, ``"homogeneous"`` (both estimate from earlier readings), or ``"implicit"`` (with the latest too).
    inner_steps : int
        n, at least 1: so many steps of T/n per reading, which is held in between.

    Raises
    ------
    ParameterError
    """

    bound: float
    step: float
    order: int = 1
    filter_order: int = 0
    discretisation: str = "implicit"
    inner_steps: int = 1

    def __post_init__(self) -> None:
        require_positive(bound=self.bound, step=self.step)
        for name, least in (("order", 1), ("filter_order", 0), ("inner_steps", 1)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                raise ParameterError(f"{name} must be a whole number of at least {least}. Received {value!r}.")
        if self.order + self.filter_order > LONGEST:
            raise ParameterError(
                f"order + filter_order must be at most {LONGEST}, the end of the published table. "
                f"Received {self.order} + {self.filter_order}."
            )
        require_known(self.discretisation, DISCRETISATIONS, "discretisation")
        size = math.log(self.bound) + (self.size + 1) * math.log(self.step / self.inner_steps)
        if not math.log(sys.float_info.min) < size < math.log(sys.float_info.max):
            raise ParameterError(
                f"bound·step^{self.size + 1} must not vanish in double precision, nor overflow. "
                f"Received {self.bound!r}, {self.step!r} s. Take another order or step."
            )

    @property
    def size(self) -> int:
        """N = n_d + n_f + 1, the number of states."""
        return self.order + self.filter_order + 1

    @property
    def table(self) -> tuple[float, ...]:
        """λ̃_0 … λ̃_(N−1)."""
        return TABLES[self.size - 1]

    @property
    def start(self) -> tuple[float, ...]:
        """States before the first sample, for a fault at rest at slip 0."""
        return (0.0,) * self.size

    @property
    def numbers(self) -> tuple[float, ...]:
        """T/n, the N gains of such a step, and for an implicit one λ_d·(T/n)^N."""
        size, step, bound = self.size, self.step / self.inner_steps, self.bound
        places = range(1, size + 1)
        if self.discretisation == "implicit":
            gains = tuple(self.table[size - j] * bound * step ** (size - j + 1) for j in places)
            return (step, *gains, bound * step**size)
        return (step, *(step * self.table[size - j] * bound ** (j / size) for j in places))

    def estimate(self, numbers: list[Any], memory: list[Any], slip: Any) -> tuple[list[Any], list[Any]]:
        """Estimates (SX) of slip and its derivatives at the time of a reading, and the states afterwards.

        Parameters
        ----------
        numbers, memory : list of SX
        slip : SX
            Reading [m].

        Returns
        -------
        list of SX
            n_d + 1 entries [m], [m/s] ….
        list of SX
        """
        step, gains, after = numbers[0], numbers[1 : self.size + 1], memory
        for _ in range(self.inner_steps):
            if self.discretisation == "implicit":
                after = implicit_step(gains, numbers[-1], self.table, step, after, slip, self.filter_order)
            else:
                taylor = self.discretisation == "homogeneous"
                after = explicit_step(gains, step, after, slip, self.filter_order, taylor)
        if self.discretisation == "implicit":
            return _without_lag(after[self.filter_order :], step), after
        return memory[self.filter_order :], after


def _without_lag(derivatives: list[Any], step: Any) -> list[Any]:
    found = []
    for i, shares in enumerate(lag_free(len(derivatives) - 1)):
        total: Any = 0.0
        for share, value in reversed(list(zip(shares, derivatives[i:], strict=True))):
            total = total * step + float(share) * value
        found.append(total)
    return found
