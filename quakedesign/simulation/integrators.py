"""Integrators by name: fixed-step Runge–Kutta, and adaptive CVODES and IDAS.

Fixed step: Dormand–Prince (order 5) and classic Runge–Kutta. Adaptive: backward differentiation formulas of SUNDIALS,
called through CasADi. The last function gives the growth per step of a linear loop.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction as F
from functools import cache
from typing import Any, ClassVar, TypeVar

import casadi as ca
import numpy as np

from quakedesign.errors import ParameterError, require_known
from quakedesign.text import nearest_name

# ----------------------------------------------------------------------
# Explicit Runge–Kutta methods with a fixed step.


State = TypeVar("State")


class Integrator:
    """An explicit Runge–Kutta method with a fixed step.

    Attributes
    ----------
    name : str
    source : str
    order : int
        Order of convergence on smooth problems.
    nodes, matrix, weights
        Butcher tableau c, A and b; row i of A contains the weights of the stages before i.
    """

    name: ClassVar[str]
    source: ClassVar[str]
    order: ClassVar[int]
    nodes: ClassVar[tuple[F, ...]]
    matrix: ClassVar[tuple[tuple[F, ...], ...]]
    weights: ClassVar[tuple[F, ...]]

    @classmethod
    def advance(cls, field: Callable[[float, State], State], state: State, step: ca.SX | float) -> State:
        """State after one step.

        Parameters
        ----------
        field : callable
            Time derivative of the state as a function of the elapsed fraction of the step [-], 0 … 1, and of the state.
        state : SX, float or ndarray
        step : SX or float
            [s].
        """
        stages: list[State] = []
        for node, row in zip(cls.nodes, cls.matrix, strict=True):
            stages.append(field(float(node), cls._moved(state, row, stages, step)))
        end: State = cls._moved(state, cls.weights, stages, step)
        return end

    @staticmethod
    def _moved(state: Any, shares: tuple[F, ...], stages: Sequence[Any], step: ca.SX | float) -> Any:
        parts = [float(share) * stage for share, stage in zip(shares, stages, strict=True) if share]
        return state + step * sum(parts[1:], start=parts[0]) if parts else state


class DormandPrince(Integrator):
    """Fifth-order, six-stage method of the 5(4) pair, the same as Simulink's ode5."""

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


class ClassicRungeKutta(Integrator):
    """Classic Runge–Kutta method of fourth order with four stages."""

    name: ClassVar[str] = "rk4"
    source: ClassVar[str] = "Kutta (1901), Z. Math. Phys. 46, 435"
    order: ClassVar[int] = 4

    nodes = (F(0), F(1, 2), F(1, 2), F(1))
    matrix = ((), (F(1, 2),), (F(0), F(1, 2)), (F(0), F(0), F(1)))
    weights = (F(1, 6), F(1, 3), F(1, 3), F(1, 6))


# ----------------------------------------------------------------------
# Adaptive integrators: solvers of the SUNDIALS family through CasADi.

TIGHTEST, LOOSEST = 1e-13, 1e-3  # relative tolerances that a run may have
RTOL = 1e-9  # default relative tolerance
TIGHT_RTOL = 1e-11  # default for velocity steps and controlled slow sliding (small differences)
CYCLE_RTOL = 1e-8  # default of the commands that simulate seismic cycles
FLOOR = 1e-4  # fraction of the scale of a variable below which its tolerance is absolute
_MOST_STEPS = 20000  # between two requested instants
_ITERATION_ERROR = 1e-3  # fraction of the tolerance; the default 0.33 gives 1 % error of slip in stiff runs


class StoppedError(RuntimeError):
    """The solver stopped. The caller adds the time to the message."""


class AdaptiveIntegrator:
    """An adaptive solver for smooth, possibly stiff problems, with output at arbitrary instants.

    Discontinuities are not located, since CasADi's events are not used: the caller must reject a discontinuous field.

    Attributes
    ----------
    name : str
        Name of CasADi's plugin.
    """

    name: ClassVar[str]
    source: ClassVar[str]

    @classmethod
    def flow(
        cls,
        rates: ca.Function,
        scales: "Sequence[float] | np.ndarray",
        shares: "Sequence[float] | np.ndarray",
        *,
        rtol: float,
        quadratures: int = 0,
    ) -> "Flow":
        """Solver over one interval, built once and used for any start and length.

        Parameters
        ----------
        rates : casadi.Function
            (t [s], y, parameters) → dy/dt, and optional integrands of quadratures.
        scales : sequence of float
            Scale of each variable; below `FLOOR` times this scale its tolerance is absolute.
        shares : sequence of float
            Ascending output instants in (0, 1], as shares of the interval.
        rtol : float
            Relative tolerance of one step, 1e-13 … 1e-3.
        quadratures : int
            Number of integrands in the second output of `rates`; they do not influence the step size.

        Raises
        ------
        ParameterError
            For a tolerance outside 1e-13 … 1e-3.
        """
        require_tolerance(rtol)
        size, count = rates.size1_in(1), rates.size1_in(2)
        start, length = ca.SX.sym("start"), ca.SX.sym("length")
        parameters, y, share = ca.SX.sym("parameters", count), ca.SX.sym("y", size), ca.SX.sym("share")
        sizes = ca.DM(np.asarray(scales, dtype=float))
        outputs: Any = rates(start + share * length, y * sizes, parameters)
        field, *integrands = outputs if isinstance(outputs, tuple | list) else (outputs,)
        problem = {"x": y, "t": share, "p": ca.vertcat(start, length, parameters), "ode": length * field / sizes}
        if quadratures:
            problem["quad"] = length * integrands[0]
        options = {
            "reltol": rtol,
            "abstol": rtol * FLOOR,
            "max_num_steps": _MOST_STEPS,
            "nonlin_conv_coeff": _ITERATION_ERROR,
            "disable_internal_warnings": True,
            "show_eval_warnings": False,  # trial steps that are too long give warnings and are rejected
        }
        solver = ca.integrator("flow", cls.name, problem, 0.0, [float(s) for s in shares], options)
        return Flow(solver, np.asarray(scales, dtype=float))


@dataclass(frozen=True)
class Flow:
    """Solver over intervals with a fixed subdivision."""

    solver: ca.Function  # casadi.Function
    scales: "np.ndarray"

    def follow(
        self, time: float, length: float, y: "np.ndarray", parameters: Sequence[float] = ()
    ) -> "tuple[np.ndarray, np.ndarray]":
        """Values and integrals at the output instants of an interval from `time` [s] with `length` [s] and initial y.

        Returns
        -------
        tuple of ndarray
            Shapes (variables, instants) and (integrals, instants); integrals are 0 at the beginning of the interval.

        Raises
        ------
        StoppedError
            If the tolerance cannot be met, or a value is not finite.
        """
        try:
            solution = self.solver(x0=y / self.scales, p=[time, length, *parameters])
        except RuntimeError as error:
            raise StoppedError(_reason(str(error))) from None
        values, integrals = solution["xf"].full() * self.scales[:, None], solution["qf"].full()
        if not (np.all(np.isfinite(values)) and np.all(np.isfinite(integrals))):
            raise StoppedError("a value is not finite")
        return values, integrals


def require_tolerance(rtol: float) -> None:
    """Reject a tolerance outside 1e-13 … 1e-3."""
    if not TIGHTEST <= rtol <= LOOSEST:
        raise ParameterError(f"rtol must be between {TIGHTEST} and {LOOSEST}. Received {rtol!r}.")


def _reason(text: str) -> str:
    """Name of the error in the solver's message, such as ``CV_TOO_MUCH_WORK``."""
    quoted = text.split('"')
    return quoted[1] if len(quoted) > 2 else text.strip().splitlines()[-1]


# ----------------------------------------------------------------------
# Integrators by name: with a fixed step, or adaptive.


@cache
def integrators() -> dict[str, type[Integrator]]:
    """Every integrator with a fixed step, by name."""
    return {kind.name: kind for kind in (DormandPrince, ClassicRungeKutta)}


@cache
def adaptive_integrators() -> dict[str, type[AdaptiveIntegrator]]:
    """Every adaptive integrator, by name."""
    return {kind.name: kind for kind in (Cvodes, Idas)}


def integrator(name: str) -> type[Integrator]:
    """Integrator with a fixed step, by its name.

    Raises
    ------
    ParameterError
        For an unknown name.
    """
    require_known(name, sorted(integrators()), "method")
    return integrators()[name]


def any_integrator(name: str) -> type[Integrator] | type[AdaptiveIntegrator]:
    """Integrator by its name, with a fixed step or adaptive.

    Raises
    ------
    ParameterError
        For an unknown name.
    """
    available = integrators() | adaptive_integrators()
    if name not in available:
        raise ParameterError(
            f"method must be one of {', '.join(sorted(integrators()))} (fixed step) or "
            f"{', '.join(sorted(adaptive_integrators()))} (adaptive step, smooth loops only). Received {name!r}."
            f"{nearest_name(name, available)}"
        )
    return available[name]


class Cvodes(AdaptiveIntegrator):
    """Backward differentiation formulas of orders 1 to 5, Newton's iteration with the exact Jacobian."""

    name: ClassVar[str] = "cvodes"
    source: ClassVar[str] = (
        "Cohen and Hindmarsh (1996), Comput. Phys. 10, 138; Hindmarsh et al. (2005), ACM TOMS 31, 363"
    )


class Idas(AdaptiveIntegrator):
    """Backward differentiation formulas of orders 1 to 5 for the implicit equation 0 = f − y', from IDAS."""

    name: ClassVar[str] = "idas"
    source: ClassVar[str] = "Hindmarsh et al. (2005), ACM TOMS 31, 363; Brenan, Campbell and Petzold (1996), SIAM"


def amplification(poles: Iterable[complex], step: float, method: str = "dormand-prince") -> float:
    """Largest growth factor per step over the modes of given poles [1/s], for a step [s]; stable below 1.

    Valid for the scheme ``continuous``, where the law is part of the integrated field, not for a sampled law.
    """
    advance = integrator(method).advance

    def growth(pole: complex) -> float:
        end: complex = advance(lambda _, x: pole * x, 1.0 + 0.0j, step)
        return float(abs(end))

    return max(map(growth, poles))
