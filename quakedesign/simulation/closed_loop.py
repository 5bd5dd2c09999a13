"""Plant, law and reference of one closed loop, from SymPy to CasADi functions."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import sympy as sp

from quakedesign.controllers import Controller, Signals, SlidingMode
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.simulation.integrators import Integrator
from quakedesign.symbolic import plant
from quakedesign.symbolic.casadi_printer import to_casadi

Motion = Callable[[Callable[[Any, Any, Any], Any], Any, Any], Any]

phi = sp.Symbol("phi", real=True)
r, r_rate, r_acceleration = sp.symbols("r r_rate r_acceleration", real=True)


def integral_symbols(controller: Controller | None) -> tuple[sp.Symbol, ...]:
    """Symbols ξ1, ξ2 … of the law's own states."""
    count = len(controller.integral_units) if controller else 0
    return tuple(sp.Symbol(f"xi_{i + 1}", real=True) for i in range(count))


def law_expressions(controller: Controller) -> tuple[sp.Expr, tuple[sp.Expr, ...]]:
    """Pressure [Pa] and ξ' of a law, in x1, x2, r, r' and ξ."""
    signals = Signals(
        slip=plant.x1,
        slip_rate=plant.x2,
        slip_error=plant.x1 - r,
        slip_rate_error=plant.x2 - r_rate,
        integrals=integral_symbols(controller),
    )
    return controller.pressure(signals), controller.integral_rates(signals)


def reference_expressions(fault: Fault) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """r [m], r' [m/s] and r'' [m/s²] in the time t, held at rest after the operation time (ERRATA 26)."""
    end = sp.Rational(str(rational(fault.reference.operation_time)))
    slip = fault.reference.slip(plant.t)
    moving = (sp.factor(sp.diff(slip, plant.t, order)) for order in (1, 2))
    rate, acceleration = (sp.Piecewise((part, plant.t < end), (0, True)) for part in moving)
    return slip.subs(plant.t, sp.Min(plant.t, end)), rate, acceleration


def acceleration_expression(fault: Fault) -> sp.Expr:
    """x2' [m/s²] of eq. shift in x1, x2, p and the disturbance φ, with friction continued to slip < 0 (ERRATA 12)."""
    return _with_numbers(plant.shifted_acceleration(), fault)


def friction_expression(fault: Fault) -> sp.Expr:
    """Friction coefficient [-] in x1 and x2, continued to slip < 0."""
    return _with_numbers(plant.mu(plant.x1, plant.x2), fault)


def matched_perturbation(fault: Fault, divisor: sp.Rational) -> sp.Expr:
    """h of eq. esystem3 [unit of ν] along a run, in x1, x2, φ, r, r' and r''."""
    moving, derived = plant.reference(plant.t), plant.error_dynamics()
    position = {plant.e1: plant.x1 - moving, plant.e2: plant.x2 - moving.diff(plant.t)}
    named = ((moving.diff(plant.t, 2), r_acceleration), (moving.diff(plant.t), r_rate), (moving, r))
    unmatched, beta = (
        _with_numbers(part.subs(position, simultaneous=True).subs(named), fault).subs(plant.divisor, divisor)
        for part in (derived.h * derived.beta, derived.beta)
    )
    return unmatched / beta


def _with_numbers(expression: sp.Expr, fault: Fault) -> sp.Expr:
    """Insert the law and exact numbers; e^u becomes 1 + (e^u − 1), so that small slips do not drown in rounding."""
    from sympy.codegen.cfunctions import expm1

    lawful = plant.with_law(expression, fault.friction.exact(), extended=True)
    numbers = lawful.replace(plant.disturbance, lambda *_: phi).subs(plant.plant_values(fault))
    return sp.expand_mul(numbers.replace(sp.exp, lambda u: 1 + expm1(u)))


@dataclass(frozen=True)
class ClosedLoop:
    """One fault under one law, or under a constant pressure.

    Attributes
    ----------
    fault : Fault
    controller : Controller or None
    constant_pressure : float
        p [Pa] where there is no controller.
    """

    plant_name: ClassVar[str] = "smooth"
    plant_title: ClassVar[str] = ""
    sticks: ClassVar[bool] = False

    fault: Fault
    controller: Controller | None = None
    constant_pressure: float = 0.0

    def advance(self, method: type[Integrator], motion: Motion, state: Any, step: float) -> Any:
        """State [x1, x2, ξ] (SX) after one step.

        Parameters
        ----------
        method : type of Integrator
        motion : callable
            Time derivative of the state, given the plant as a function of t [s], x and p [Pa], how much of the step has
            passed [-], and the state.
        state : SX
        step : float
            [s].
        """
        return method.advance(lambda passed, now: motion(self.plant, passed, now), state, step)

    @property
    def integrals(self) -> tuple[sp.Symbol, ...]:
        """Symbols of the law's own states."""
        return integral_symbols(self.controller)

    @property
    def divisor(self) -> sp.Rational:
        """μ0N̂0 [m²/kg]: the law's own, or μ_res·N̂_min for a law without one."""
        if isinstance(self.controller, SlidingMode):
            return sp.Rational(str(self.controller.divisor))
        least = rational(self.fault.friction.bounds[0]) * (1 - self.fault.box.authority)
        return sp.Rational(str(least)) * plant.plant_values(self.fault)[plant.N_hat]

    @cached_property
    def plant(self) -> Any:
        """CasADi Function (t [s], x [m, m/s], p [Pa]) → dx [m/s, m/s²]."""
        rates = [plant.x2, acceleration_expression(self.fault)]
        inputs = {"t": [plant.t], "x": [plant.x1, plant.x2], "p": [plant.p]}
        return casadi_function("plant", inputs, {"dx": rates}, self.shaking)

    @cached_property
    def reference(self) -> Any:
        """CasADi Function t [s] → reference [m, m/s, m/s²]."""
        return casadi_function("reference", {"t": [plant.t]}, {"reference": list(reference_expressions(self.fault))})

    @cached_property
    def law(self) -> Any:
        """CasADi Function (x, xi, reference) → p [Pa], dxi; without a controller p is constant."""
        inputs = {
            "x": [plant.x1, plant.x2],
            "xi": list(self.integrals),
            "reference": [r, r_rate, r_acceleration],
        }
        if self.controller is None:
            return casadi_function("law", inputs, {"p": [sp.Float(self.constant_pressure)], "dxi": []})
        pressure, rates = law_expressions(self.controller)
        return casadi_function("law", inputs, {"p": [pressure], "dxi": list(rates)})

    @cached_property
    def perturbation(self) -> Any:
        """CasADi Function (t, x, reference) → h [unit of ν], mu [-]."""
        inputs = {
            "t": [plant.t],
            "x": [plant.x1, plant.x2],
            "reference": [r, r_rate, r_acceleration],
        }
        outputs = {
            "h": [matched_perturbation(self.fault, self.divisor)],
            "mu": [friction_expression(self.fault)],
        }
        return casadi_function("perturbation", inputs, outputs, self.shaking)

    @property
    def shaking(self) -> dict[sp.Symbol, sp.Expr]:
        """φ̂_e [m/s²] in x1, x2 and t; kept apart, since a tiny constant would drown in SymPy's sum of floats."""
        return {phi: plant.with_disturbance(plant.disturbance(plant.x1, plant.x2, plant.t), self.fault)}


def casadi_function(
    name: str,
    inputs: dict[str, list[sp.Symbol]],
    outputs: dict[str, list[sp.Expr]],
    named: dict[sp.Symbol, sp.Expr] | None = None,
) -> Any:
    """CasADi Function with names; `named` are expressions in the inputs that the outputs refer to."""
    import casadi as ca

    vectors = {key: ca.SX.sym(key, len(symbols)) for key, symbols in inputs.items()}
    values = {symbol: vectors[key][i] for key, symbols in inputs.items() for i, symbol in enumerate(symbols)}
    if named:
        values |= dict(zip(named, to_casadi(list(named.values()), values), strict=True))
    flat = to_casadi([part for parts in outputs.values() for part in parts], values)
    results = [ca.vertcat(*(flat.pop(0) for _ in parts)) if parts else ca.SX(0, 1) for parts in outputs.values()]
    return ca.Function(name, list(vectors.values()), results, list(inputs), list(outputs))
