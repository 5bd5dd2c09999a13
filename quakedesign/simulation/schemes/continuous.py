"""The law as a differential equation."""

from typing import Any, ClassVar

from quakedesign.simulation.closed_loop import ClosedLoop
from quakedesign.simulation.integrators import Integrator
from quakedesign.simulation.schemes.base import Scheme


class Continuous(Scheme):
    """Evaluates the law in every Runge–Kutta stage and integrates ξ with the plant, as the paper's runs do.

    It hides what a sampled controller would do (ERRATA 22).
    """

    name: ClassVar[str] = "continuous"

    @classmethod
    def pressure(cls, loop: ClosedLoop, counter: Any, state: Any, step: float) -> Any:
        """Pressure [Pa] that the law asks for now."""
        return loop.law(state[:2], state[2:], loop.reference(counter * step))[0]

    @classmethod
    def advance(cls, loop: ClosedLoop, method: type[Integrator], counter: Any, state: Any, step: float) -> Any:
        """State after one step of the integrator on plant and law together."""
        import casadi as ca

        def motion(plant: Any, passed: Any, now: Any) -> Any:
            time = (counter + passed) * step
            pressure, integral_rates = loop.law(now[:2], now[2:], loop.reference(time))
            return ca.vertcat(plant(time, now[:2], pressure), integral_rates)

        return loop.advance(method, motion, state, step)
