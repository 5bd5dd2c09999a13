"""The derived model of one fault, for people: equations, eigenvalues, and why it is unstable."""

from dataclasses import dataclass
from functools import cached_property

import mpmath
import sympy as sp

from quakedesign.fault import Fault, require_fault
from quakedesign.symbolic import plant, state_plant
from quakedesign.symbolic.equilibrium import operating_rate
from quakedesign.symbolic.plant import ErrorDynamics
from quakedesign.symbolic.stability import Stability, StabilityVerdict, stability

_DIGITS = 50


@dataclass(frozen=True)
class Model:
    """Equations of one fault, derived from its force balance.

    A law without state is studied at rest, a law with state (rate and state) in steady sliding at its
    ``operating_rate``; then the plant has one more dimension for every state variable.

    Attributes
    ----------
    fault : Fault
    """

    fault: Fault

    @property
    def _names(self) -> tuple[str, ...]:
        return self.fault.friction.state_names

    @cached_property
    def acceleration(self) -> sp.Expr:
        """x2' of eq. shift [m/s²] with the fault's friction law, in symbols; v' about steady sliding with state."""
        law = self.fault.friction.symbolic()
        if self._names:
            return state_plant.third_order_rates(law)[1]
        return plant.with_law(plant.shifted_acceleration(), law)

    @cached_property
    def error_dynamics(self) -> ErrorDynamics:
        """β and h of eq. esystem3, in symbols; with state, slip is ahead of steady sliding at v_∞."""
        return state_plant.error_dynamics(self._names)

    @cached_property
    def jacobian(self) -> sp.Matrix:
        """Jacobian at the origin (ERRATA 1), or in steady sliding, in symbols."""
        return state_plant.jacobian(self._names) if self._names else plant.jacobian()

    @cached_property
    def instability(self) -> sp.Basic:
        """Condition for an unstable origin (ERRATA 2) or unstable steady sliding (Routh–Hurwitz), in symbols."""
        return state_plant.instability(self.fault.friction.symbolic()) if self._names else plant.instability()

    @cached_property
    def values(self) -> dict[sp.Symbol, sp.Expr]:
        """Exact value of every symbol of `jacobian` and `instability` at zero pressure."""
        law = self.fault.friction.exact()
        at = sp.Rational(str(operating_rate(self.fault)))
        return {
            **plant.plant_values(self.fault),
            **self.fault.friction.values(),
            plant.p: sp.Integer(0),
            state_plant.loading_rate: at,
            plant.mu_star: sp.sympify(law.steady_coefficient(at)),
            **state_plant.slopes(law, at),
        }

    @cached_property
    def stability(self) -> StabilityVerdict:
        """Verdict at zero pressure, with the margin of every condition."""
        return stability(self.fault)

    @property
    def unstable(self) -> bool:
        """Whether the fault is unstable without control; decided in exact or ball arithmetic."""
        return self.stability.outcome is Stability.UNSTABLE

    @cached_property
    def reasons(self) -> tuple[str, ...]:
        """Which of the conditions for instability hold, with their numbers [1/s², 1/s]."""
        if not self.unstable:
            return ()
        said = {
            plant.k_hat: "the spring unloads slower than friction weakens with slip: stiffness {} < {} 1/s²",
            plant.eta_hat: "damping is weaker than the rate weakening of friction: {} < {} 1/s",
        }
        if self._names:
            said[plant.k_hat] = "the spring is softer than steady sliding needs: stiffness {} < {} 1/s²"
        other = "a condition of Routh and Hurwitz fails: {} < {}"
        conditions = self.instability.args if isinstance(self.instability, sp.Or) else (self.instability,)
        found = [(c, [sp.N(side.subs(self.values), _DIGITS) for side in c.args]) for c in conditions]
        return tuple(
            said.get(c.args[0], other).format(*(f"{float(side):.4g}" for side in (low, high)))
            for c, (low, high) in found
            if low < high
        )

    @cached_property
    def eigenvalues(self) -> tuple[complex, ...]:
        """Eigenvalues of the uncontrolled fault [1/s], largest real part first."""
        values = self.values | {state_plant.effective_stress: self.values[plant.sigma]}
        coefficients = [c.subs(values) for c in state_plant.characteristic(self._names)]
        with mpmath.workdps(_DIGITS):
            numbers = [mpmath.mpmathify(sp.N(c, _DIGITS)) for c in coefficients]
            roots = mpmath.polyroots(numbers, maxsteps=500, extraprec=400)
        return tuple(sorted((complex(z) for z in roots), key=lambda z: (-z.real, -z.imag)))

    def _repr_latex_(self) -> str:
        acceleration = state_plant.sliding_acceleration(self._names) if self._names else plant.shifted_acceleration()
        rows = [
            rf"\ddot x_1 &= {sp.latex(acceleration)}",
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
    return Model(require_fault(fault))
