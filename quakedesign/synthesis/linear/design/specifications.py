"""What a user may ask of the linear design: weights, or specifications."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from quakedesign.errors import ParameterError
from quakedesign.rationals import rational
from quakedesign.synthesis.linear.plant.problem import Scales
from quakedesign.synthesis.linear.plant.rational_matrices import Matrix, definite, diagonal

SETTLED = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """Q0 and R of the cost, in SI.

    Attributes
    ----------
    Q0 : sequence of 4 sequences of 4, or of 4 numbers for a diagonal
        Symmetric and positive definite, on x1 [m], x2 [m/s], ξ1 [m s], ξ2 [m s²]; V̇ ≤ −xᵀQ0x is what it guarantees.
    R : number or text
        On p [Pa], positive.

    Raises
    ------
    ParameterError
        When Q0 is not symmetric and positive definite (decided exactly), or R not positive.
    """

    Q0: Sequence[Sequence[float | str | Fraction]] | Sequence[float | str | Fraction]
    R: float | str | Fraction

    def __post_init__(self) -> None:
        matrix = self.exact_Q0
        symmetric = all(len(row) == 4 for row in matrix) and all(
            matrix[i][j] == matrix[j][i] for i in range(4) for j in range(4)
        )
        if len(matrix) != 4 or not symmetric or not definite(matrix):
            raise ParameterError(
                "Q0 must be symmetric and positive definite, 4 x 4. Received another matrix. Start from a diagonal "
                "with four positive entries."
            )
        if self.exact_R <= 0:
            raise ParameterError(f"R must be positive. Received {self.R}. A smaller R gives larger gains.")

    @property
    def exact_Q0(self) -> Matrix:
        """Q0 in rationals."""
        rows = list(self.Q0)
        matrix = all(hasattr(row, "__len__") and not isinstance(row, str) for row in rows)
        if not matrix:
            return diagonal([rational(v, "Q0") for v in rows])  # type: ignore[arg-type]
        return tuple(tuple(rational(v, "Q0") for v in row) for row in rows)  # type: ignore[union-attr]

    @property
    def exact_R(self) -> Fraction:
        """R as a rational."""
        return rational(self.R, "R")

    def inside(self, scales: Scales) -> tuple[Matrix, Fraction]:
        """Q0 and R in nondimensional variables, the cost divided by slip² (one factor for both changes nothing)."""
        matrix = scales.form_inside(self.exact_Q0)
        unit = scales.slip**2
        return tuple(tuple(v / unit for v in row) for row in matrix), self.exact_R * scales.pressure**2 / unit


@dataclass(frozen=True, slots=True, kw_only=True)
class Specifications:
    """What the loop shall do, in place of weights.

    Attributes
    ----------
    settling_time : float or str, optional
        T [s] after which √V has fallen to 2 %: the decay rate ln(50)/T is guaranteed over the whole uncertainty.
    largest_gain : float or str, optional
        Bound on |k1| [Pa/m].
    integral_speed : float or str, optional
        ω [rad/s] below which the integrals weigh more than the slip error: q3 = q1ω², q4 = q1ω⁴; ω_n without.

    Raises
    ------
    ParameterError
        For a value that is not positive.
    """

    settling_time: float | str | None = None
    largest_gain: float | str | None = None
    integral_speed: float | str | None = None

    def __post_init__(self) -> None:
        for name in ("settling_time", "largest_gain", "integral_speed"):
            value = getattr(self, name)
            if value is None:
                continue
            number = rational(value, name)
            if number <= 0:
                raise ParameterError(f"{name} must be positive. Received {value}. Leave it out to have no such demand.")
            object.__setattr__(self, name, float(number))

    @property
    def rate(self) -> Fraction:
        """Decay rate a [1/s], V̇ ≤ −2aV."""
        return Fraction(0) if self.settling_time is None else Fraction(-math.log(SETTLED) / float(self.settling_time))

    def default_weight(self, scales: Scales) -> Matrix:
        """Q0, nondimensional: 1 for slip, 1/100 for slip rate, ω² and ω⁴ for the integrals."""
        speed = Fraction(1) if self.integral_speed is None else Fraction(float(self.integral_speed)) * scales.time
        return diagonal((Fraction(1), Fraction(1, 100), speed**2, speed**4))
