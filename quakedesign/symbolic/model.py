"""The derived model of one fault, for people: equations, eigenvalues, and why it is unstable."""

from dataclasses import dataclass
from functools import cached_property

import sympy as sp

from quakedesign.fault import Fault
from quakedesign.symbolic import plant
from quakedesign.symbolic.plant import ErrorDynamics


@dataclass(frozen=True)
class Model:
    """Equations of one fault, derived from its force balance.

    Attributes
    ----------
    fault : Fault
    """

    fault: Fault

    @cached_property
    def acceleration(self) -> sp.Expr:
        """x2' of eq. shift [m/s²] with the fault's friction law, in symbols."""
        return plant.with_law(plant.shifted_acceleration(), self.fault.friction.symbolic())

    @cached_property
    def error_dynamics(self) -> ErrorDynamics:
        """β and h of eq. esystem3, in symbols."""
        return plant.error_dynamics()

    @cached_property
    def jacobian(self) -> sp.Matrix:
        """Jacobian at the origin (ERRATA 1), in symbols."""
        return plant.jacobian()

    @cached_property
    def instability(self) -> sp.Or:
        """Condition for an unstable origin (ERRATA 2), in symbols."""
        return plant.instability()

    @cached_property
    def values(self) -> dict[sp.Symbol, sp.Rational]:
        """Exact value of every symbol of `jacobian` and `instability` at zero pressure."""
        x1, x2 = plant.x1, plant.x2
        coefficient = sp.sympify(self.fault.friction.exact().coefficient(x1, x2))
        origin = {x1: 0, x2: 0}
        return plant.plant_values(self.fault) | {
            plant.p: sp.Integer(0),
            plant.slip_slope: coefficient.diff(x1).subs(origin),
            plant.rate_slope: coefficient.diff(x2).subs(origin),
            plant.mu_star: coefficient.subs(origin),
        }

    @cached_property
    def unstable(self) -> bool:
        """Whether the origin is unstable without control; decided in exact arithmetic."""
        return bool(self.instability.subs(self.values))

    @cached_property
    def reasons(self) -> tuple[str, ...]:
        """Which of the two conditions hold, with their numbers [1/s², 1/s]."""
        said = {
            plant.k_hat: "the spring unloads slower than friction weakens with slip: stiffness {} < {} 1/s²",
            plant.eta_hat: "damping is weaker than the rate weakening of friction: {} < {} 1/s",
        }
        return tuple(
            said[c.lhs].format(*(f"{float(side.subs(self.values)):.4g}" for side in (c.lhs, c.rhs)))
            for c in self.instability.args
            if bool(c.subs(self.values))
        )

    @cached_property
    def eigenvalues(self) -> tuple[complex, complex]:
        """Eigenvalues of the uncontrolled fault at the origin [1/s], largest real part first."""
        J = self.jacobian.subs(self.values)
        half = J.trace() / 2
        root = sp.sqrt(half**2 - J.det())
        first, second = complex(sp.N(half + root)), complex(sp.N(half - root))
        return first, second

    def _repr_latex_(self) -> str:
        rows = [
            rf"\ddot x_1 &= {sp.latex(plant.shifted_acceleration())}",
            rf"J(0,0) &= {sp.latex(self.jacobian)}",
            rf"\text{{unstable}} &\iff {sp.latex(self.instability)}",
        ]
        return r"$\displaystyle\begin{aligned}" + r"\\".join(rows) + r"\end{aligned}$"


def derive(fault: Fault) -> Model:
    """Derive the equations of a fault from its force balance.

    Parameters
    ----------
    fault : Fault

    Returns
    -------
    Model
        With ``instability``, ``error_dynamics``, ``jacobian`` (SymPy) and ``_repr_latex_``.
    """
    return Model(fault)
