"""What every fixed-step integrator offers, and the explicit Runge–Kutta family."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from fractions import Fraction
from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:
    pass


class Integrator(ABC):
    """One step of a fixed length.

    Attributes
    ----------
    name : str
    source : str
    order : int
        Order of convergence on smooth problems.
    """

    name: ClassVar[str]
    source: ClassVar[str]
    order: ClassVar[int]

    @classmethod
    @abstractmethod
    def advance(cls, field: Callable[[float, Any], Any], state: Any, step: float) -> Any:
        """State after one step.

        Parameters
        ----------
        field : callable
            Time derivative of the state [1/s of its unit], given how much of the step has passed
            [-, 0 to 1] and the state.
        state : SX, float or ndarray
        step : float
            [s].
        """


class RungeKutta(Integrator):
    """An explicit Runge–Kutta method.

    Attributes
    ----------
    nodes : tuple of Fraction
    matrix : tuple of tuple of Fraction
        Row i holds the shares of the stages before i.
    weights : tuple of Fraction
    """

    nodes: ClassVar[tuple[Fraction, ...]]
    matrix: ClassVar[tuple[tuple[Fraction, ...], ...]]
    weights: ClassVar[tuple[Fraction, ...]]

    @classmethod
    def advance(cls, field: Callable[[float, Any], Any], state: Any, step: float) -> Any:
        """State after one step; see `Integrator.advance`."""
        stages: list[Any] = []
        for node, row in zip(cls.nodes, cls.matrix, strict=True):
            stages.append(field(float(node), cls._moved(state, row, stages, step)))
        return cls._moved(state, cls.weights, stages, step)

    @staticmethod
    def _moved(state: Any, shares: tuple[Fraction, ...], stages: list[Any], step: float) -> Any:
        parts = [float(share) * stage for share, stage in zip(shares, stages, strict=True) if share]
        return state + step * sum(parts[1:], start=parts[0]) if parts else state
