"""The classic Runge–Kutta method."""

from fractions import Fraction as F
from typing import ClassVar

from quakedesign.simulation.integrators.base import RungeKutta


class ClassicRungeKutta(RungeKutta):
    """Fourth order with four stages."""

    name: ClassVar[str] = "rk4"
    source: ClassVar[str] = "Kutta (1901), Z. Math. Phys. 46, 435"
    order: ClassVar[int] = 4

    nodes = (F(0), F(1, 2), F(1, 2), F(1))
    matrix = ((), (F(1, 2),), (F(0), F(1, 2)), (F(0), F(0), F(1)))
    weights = (F(1, 6), F(1, 3), F(1, 3), F(1, 6))
