"""What every integrator with a step of its own choice offers: solvers of the SUNDIALS family through CasADi."""

from abc import ABC
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from quakedesign.errors import ParameterError

TIGHTEST = 1e-13
LOOSEST = 1e-3
FLOOR = 1e-4
_MOST_STEPS = 20000  # between two instants that are asked for
_ITERATION_ERROR = 1e-3  # share of the tolerance; the usual 0.33 lets the slip of stiff earthquakes drift by a percent


class StoppedError(RuntimeError):
    """The solver could not go on; the run that asked for it says where."""


class AdaptiveIntegrator(ABC):
    """A solver of smooth, possibly stiff problems that meets a tolerance and answers at any instants.

    Discontinuities are not located: CasADi's events are not used, so that a discontinuous field is the caller's to
    refuse.

    Attributes
    ----------
    name : str
        Also that of CasADi's plugin.
    source : str
    """

    name: ClassVar[str]
    source: ClassVar[str]

    @classmethod
    def flow(
        cls,
        rates: Any,
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
            (t [s], y, parameters) → dy/dt, and what is to be integrated along with it where there is any.
        scales : sequence of float
            Size of each variable; its error counts absolutely below `FLOOR` of that.
        shares : sequence of float
            Ascending instants in (0, 1], as shares of the interval, at which values are wanted.
        rtol : float
            Tolerance of one step relative to a variable, 1e-13 … 1e-3.
        quadratures : int
            How many integrals the second output of `rates` holds; they take no part in the choice of the step.

        Raises
        ------
        ParameterError
            For another tolerance.
        """
        require_tolerance(rtol)
        size, count = rates.size1_in(1), rates.size1_in(2)
        start, length = ca.SX.sym("start"), ca.SX.sym("length")
        parameters, y, share = ca.SX.sym("parameters", count), ca.SX.sym("y", size), ca.SX.sym("share")
        sizes = ca.DM(np.asarray(scales, dtype=float))
        found = rates(start + share * length, y * sizes, parameters)
        field, *more = found if isinstance(found, tuple | list) else (found,)
        problem = {"x": y, "t": share, "p": ca.vertcat(start, length, parameters), "ode": length * field / sizes}
        if quadratures:
            problem["quad"] = length * more[0]
        options = {
            "reltol": rtol,
            "abstol": rtol * FLOOR,
            "max_num_steps": _MOST_STEPS,
            "nonlin_conv_coeff": _ITERATION_ERROR,
            "disable_internal_warnings": True,
            "show_eval_warnings": False,  # of trial steps that are too long, and rejected for it
        }
        solver = ca.integrator("flow", cls.name, problem, 0.0, [float(s) for s in shares], options)
        return Flow(solver, np.asarray(scales, dtype=float))


@dataclass(frozen=True)
class Flow:
    """Solution over intervals of one subdivision.

    Attributes
    ----------
    solver : casadi.Function
    scales : ndarray
    """

    solver: Any
    scales: "np.ndarray"

    def follow(
        self, time: float, length: float, y: "np.ndarray", parameters: Sequence[float] = ()
    ) -> "tuple[np.ndarray, np.ndarray]":
        """Values and integrals at the instants of an interval that starts at a time [s] and has a length [s].

        Returns
        -------
        tuple of ndarray
            Shapes (variables, instants) and (integrals, instants); the latter since the start of the interval.

        Raises
        ------
        StoppedError
            When the tolerance cannot be met, or a value is not finite.
        """
        try:
            found = self.solver(x0=y / self.scales, p=[time, length, *parameters])
        except RuntimeError as error:
            raise StoppedError(_reason(str(error))) from None
        values, integrals = found["xf"].full() * self.scales[:, None], found["qf"].full()
        if not (np.all(np.isfinite(values)) and np.all(np.isfinite(integrals))):
            raise StoppedError("a value is not finite")
        return values, integrals


def require_tolerance(rtol: float) -> None:
    """Refuse a tolerance that no solver meets or that means nothing.

    Raises
    ------
    ParameterError
    """
    if not TIGHTEST <= rtol <= LOOSEST:
        raise ParameterError(f"rtol must be between {TIGHTEST} and {LOOSEST}. Received {rtol!r}.")


def _reason(text: str) -> str:
    """Name of the solver's own message, as in ``CV_TOO_MUCH_WORK``."""
    quoted = text.split('"')
    return quoted[1] if len(quoted) > 2 else text.strip().splitlines()[-1]
