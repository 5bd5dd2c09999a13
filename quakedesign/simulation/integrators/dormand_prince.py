"""Dormand and Prince's method of fifth order with a fixed step."""

from fractions import Fraction as F
from typing import ClassVar

from quakedesign.simulation.integrators.base import RungeKutta


class DormandPrince(RungeKutta):
    """Fifth-order weights of the 5(4) pair, six stages, as Simulink's ode5."""

    name: ClassVar[str] = "dormand-prince"
    source: ClassVar[str] = "Dormand and Prince (1980), J. Comput. Appl. Math. 6, 19"
    order: ClassVar[int] = 5

    nodes = (F(0), F(1, 5), F(3, 10), F(4, 5), F(8, 9), F(1))
    matrix = (
        (),
        (F(1, 5),),
        (F(3, 40), F(9, 40)),
        (F(44, 45), F(-56, 15), F(32, 9)),
        (F(19372, 6561), F(-25360, 2187), F(64448, 6561), F(-212, 729)),
        (F(9017, 3168), F(-355, 33), F(46732, 5247), F(49, 176), F(-5103, 18656)),
    )
    weights = (F(35, 384), F(0), F(500, 1113), F(125, 192), F(-2187, 6784), F(11, 84))
