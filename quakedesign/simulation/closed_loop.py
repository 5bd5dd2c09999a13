"""Plant, law and reference of one closed loop, from SymPy to CasADi functions."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import casadi as ca
import sympy as sp
from sympy.codegen.cfunctions import expm1

from quakedesign.controllers import Controller
from quakedesign.controllers.feed_forward import NONE
from quakedesign.fault import Fault
from quakedesign.loop.law_expressions import integral_symbols, law_expressions, r, r_acceleration, r_rate
from quakedesign.rationals import rational
from quakedesign.simulation.energy import Meter, Metered
from quakedesign.simulation.integrators import Integrator
from quakedesign.simulation.loading import NOTHING, Load
from quakedesign.simulation.variation import (
    WeakenedFriction,
    complete,
    symbol,
    symbols,
    varied_disturbance,
    varied_values,
)
from quakedesign.symbolic import plant
from quakedesign.symbolic.casadi_printer import to_casadi

Motion = Callable[[Callable[[Any, Any, Any], Any], Any, Any], Any]

phi = sp.Symbol("phi", real=True)


def reference_expressions(fault: Fault) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """r [m], r' [m/s] and r'' [m/s²] in the time t, held at rest after the operation time (ERRATA 26)."""
    end = sp.Rational(str(rational(fault.reference.operation_time)))
    slip = fault.reference.slip(plant.t)
    moving = (sp.factor(sp.diff(slip, plant.t, order)) for order in (1, 2))
    rate, acceleration = (sp.Piecewise((part, plant.t < end), (0, True)) for part in moving)
    return slip.subs(plant.t, sp.Min(plant.t, end)), rate, acceleration


def acceleration_expression(fault: Fault, varied: bool = False) -> sp.Expr:
    """x2' [m/s²] of eq. shift in x1, x2, p and the disturbance φ, with friction continued to slip < 0 (ERRATA 12).

    With `varied` also in the factors of `quakedesign.simulation.variation.symbols`, here and below.
    """
    return _with_numbers(plant.shifted_acceleration(), fault, varied)


def friction_expression(fault: Fault, varied: bool = False) -> sp.Expr:
    """Friction coefficient [-] in x1 and x2, continued to slip < 0."""
    return _with_numbers(plant.mu(plant.x1, plant.x2), fault, varied)


def matched_perturbation(fault: Fault, divisor: sp.Rational, varied: bool = False) -> sp.Expr:
    """h of eq. esystem3 [unit of ν] along a run, in x1, x2, φ, r, r' and r''."""
    moving, derived = plant.reference(plant.t), plant.error_dynamics()
    position = {plant.e1: plant.x1 - moving, plant.e2: plant.x2 - moving.diff(plant.t)}
    named = ((moving.diff(plant.t, 2), r_acceleration), (moving.diff(plant.t), r_rate), (moving, r))
    unmatched, beta = (
        _with_numbers(part.subs(position, simultaneous=True).subs(named), fault, varied).subs(plant.divisor, divisor)
        for part in (derived.h * derived.beta, derived.beta)
    )
    return unmatched / beta


def acceleration_with_parameters(fault: Fault, names: Sequence[str]) -> tuple[sp.Expr, list[sp.Symbol]]:
    """x2' [m/s²] as `acceleration_expression`, and the symbols in it of named parameters of plant and friction."""
    law = fault.friction
    free = law.symbols() | {name: sp.Symbol(name, positive=True) for name in plant.PARAMETERS}
    known = {name: sp.Rational(str(rational(getattr(fault, name)))) for name in plant.PARAMETERS}
    hatted = plant.hatted_parameters(fault, known | {name: free[name] for name in names if name in known})
    held = {symbol: value for symbol, value in law.values().items() if symbol not in {free[name] for name in names}}
    symbols = [free[name] for name in names]
    return _inserted(plant.shifted_acceleration(), law.symbolic(), hatted).subs(held), symbols


def _with_numbers(expression: sp.Expr, fault: Fault, varied: bool) -> sp.Expr:
    """Insert the law and exact numbers."""
    law: Any = fault.friction.exact()
    law = WeakenedFriction(law, symbol("weakening")) if varied else law
    return _inserted(expression, law, varied_values(fault) if varied else plant.plant_values(fault))


def _inserted(expression: sp.Expr, law: Any, values: Mapping[Any, Any]) -> sp.Expr:
    """Insert law and values; e^u becomes 1 + (e^u − 1), so that small slips do not drown in rounding."""
    lawful = plant.with_law(expression, law, extended=True)
    numbers = lawful.replace(plant.disturbance, lambda *_: phi).subs(values)
    return sp.expand_mul(numbers.replace(sp.exp, lambda u: 1 + expm1(u)))


@dataclass(frozen=True)
class ClosedLoop(Metered):
    """One fault under one law, or under a constant pressure.

    Attributes
    ----------
    fault : Fault
    controller : Controller or None
    constant_pressure : float
        p [Pa] where there is no controller.
    load : Load
        What acts on the fault beside its own disturbance.
    factors : tuple of float or SX
        True over nominal parameters as in `Variation.values`; empty for the nominal fault.
    """

    plant_name: ClassVar[str] = "smooth"
    plant_title: ClassVar[str] = ""

    fault: Fault
    controller: Controller | None = None
    constant_pressure: float = 0.0
    load: Load = NOTHING
    factors: tuple[Any, ...] = ()

    def with_factors(self, factors: tuple[Any, ...]) -> Self:
        """Return the same loop with other true parameters, which may be symbols of CasADi (SX)."""
        return replace(self, factors=factors) if factors else self

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

    def advance_often(
        self, method: type[Integrator], motion: Any, given: Any, state: Any, step: float, times: int
    ) -> Any:
        """State (SX) after a number of steps; what happens in one is a function in generated C, called in a loop.

        Parameters
        ----------
        method, state, step
            See `advance`.
        motion : callable
            As there, with `passed` counting steps, and with `given`.
        given : SX
            What else the motion depends on.
        times : int
        """
        return self.metered_often(method, motion, given, (state, ca.SX(0, 1)), step, times)[0]

    def metered_often(
        self, method: type[Integrator], motion: Any, given: Any, start: tuple[Any, Any], step: float, times: int
    ) -> tuple[Any, Any]:
        """State and works so far (SX) after a number of steps, see `advance_often`; works without entries stay so."""

        def once(loop: Self, moving: Motion, state: Any, works: Any) -> tuple[Any, Any]:
            if not works.shape[0]:
                return loop.advance(method, moving, state, step), works
            meter = Meter(loop, works)
            return meter.advance(method, moving, state, step), meter.works

        if times == 1:
            return once(self, lambda plant, passed, now: motion(plant, passed, now, given), *start)
        carried = *start, ca.SX(0), given, _column(self.factors)
        before, so_far, number, told, factors = (ca.SX.sym("z", part.shape[0]) for part in carried)
        loop = self.with_factors(tuple(ca.vertsplit(factors)))
        moved = once(loop, lambda plant, passed, now: motion(plant, number + passed, now, told), before, so_far)
        after = ca.vertcat(*moved, number + 1, told, factors)
        substep = ca.Function("substep", [ca.vertcat(before, so_far, number, told, factors)], ca.cse([after]))
        end = substep.fold(times, {"never_inline": True})(ca.vertcat(*carried))
        first, last = before.shape[0], before.shape[0] + so_far.shape[0]
        return end[:first], end[first:last]

    @property
    def integrals(self) -> tuple[sp.Symbol, ...]:
        """Symbols of the law's own states."""
        return integral_symbols(self.controller)

    @property
    def divisor(self) -> sp.Rational:
        """μ0N̂0 [m²/kg]: the law's own, or μ_res·N̂_min for a law without one."""
        if self.controller is not None and self.controller.divisor is not None:
            return sp.Rational(str(self.controller.divisor))
        least = rational(self.fault.friction.bounds[0]) * (1 - self.fault.box.authority)
        return sp.Rational(str(least)) * plant.plant_values(self.fault)[plant.N_hat]

    @cached_property
    def plant(self) -> Any:
        """CasADi Function (t [s], x [m, m/s], p [Pa]) → dx [m/s, m/s²]."""
        rates = [plant.x2, acceleration_expression(self.fault, bool(self.factors))]
        inputs = {"t": [plant.t], "x": [plant.x1, plant.x2], "p": [plant.p]}
        return self.function("plant", inputs, {"dx": rates})

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

    @property
    def known(self) -> sp.Expr:
        """What the law adds to ν, and so to h, from what is known of the plant [unit of ν]."""
        known = self.controller.feedforward if self.controller is not None else NONE
        return known.acceleration(plant.x1, plant.x2, r_acceleration)

    @cached_property
    def perturbation(self) -> Any:
        """CasADi Function (t, x, reference) → h [unit of ν], the law's feed-forward included, and mu [-]."""
        inputs = {
            "t": [plant.t],
            "x": [plant.x1, plant.x2],
            "reference": [r, r_rate, r_acceleration],
        }
        outputs = {
            "h": [matched_perturbation(self.fault, self.divisor, bool(self.factors)) + self.known],
            "mu": [friction_expression(self.fault, bool(self.factors))],
        }
        return self.function("perturbation", inputs, outputs)

    @cached_property
    def friction(self) -> Any:
        """CasADi Function x [m, m/s] → friction coefficient [-]."""
        law = friction_expression(self.fault, bool(self.factors))
        return self.function("friction", {"x": [plant.x1, plant.x2]}, {"mu": [law]})

    @property
    def static_friction(self) -> Any:
        """Friction coefficient [-] on the verge of slip; an SX with symbolic factors, else a float."""
        value = self.friction([0, 0])
        return value if type(value).__name__ == "SX" else float(value)

    @cached_property
    def shaken(self) -> Any:
        """CasADi Function (t [s], x [m, m/s]) → φ̂_e [m/s²], without the push of the far end."""
        return self.function("shaken", {"t": [plant.t], "x": [plant.x1, plant.x2]}, {"phi": [self.disturbance]})

    def shear_stress(self, time: Any, state: Any, pressure: Any, friction: Any) -> Any:
        """Shear stress τ = μ(σ' − p) [Pa] that friction sets against slip (SX)."""
        return friction * (self.fault.effective_normal_stress - pressure)

    def function(self, name: str, inputs: dict[str, list[sp.Symbol]], outputs: dict[str, list[sp.Expr]]) -> Any:
        """CasADi Function with the disturbance inserted; with factors, a callable that has inserted those too."""
        shaking = self.shaking if plant.t in inputs.get("t", ()) else None
        if not self.factors:
            return casadi_function(name, inputs, outputs, shaking)
        whole = casadi_function(name, inputs | {"factors": list(symbols())}, outputs, shaking)
        return lambda *arguments: whole(*arguments, _column(complete(self.factors)))

    @property
    def shaking(self) -> dict[sp.Symbol, sp.Expr]:
        """φ̂_e and the far end's push [m/s²] in x1, x2 and t; kept apart, since a tiny constant would drown in a sum."""
        push = self.load.push(self.fault) * (symbol("stiffness") if self.factors else 1)
        return {phi: self.disturbance + push}

    @property
    def disturbance(self) -> sp.Expr:
        """φ̂_e [m/s²] of the fault and of the user, in x1, x2 and t."""
        own = plant.with_disturbance(plant.disturbance(plant.x1, plant.x2, plant.t), self.fault)
        return (varied_disturbance(own) if self.factors else own) + self.load.acceleration


def _column(values: tuple[Any, ...]) -> Any:
    return ca.vertcat(*values)


def casadi_function(
    name: str,
    inputs: dict[str, list[sp.Symbol]],
    outputs: dict[str, list[sp.Expr]],
    named: dict[sp.Symbol, sp.Expr] | None = None,
) -> Any:
    """CasADi Function with names; `named` are expressions in the inputs that the outputs refer to.

    Derivatives at a kink are those of the side on which x1 and x2 grow.
    """
    vectors = {key: ca.SX.sym(key, len(symbols)) for key, symbols in inputs.items()}
    values = {symbol: vectors[key][i] for key, symbols in inputs.items() for i, symbol in enumerate(symbols)}
    if named:
        values |= dict(zip(named, to_casadi(list(named.values()), values), strict=True))
    motion = [values[moving] for moving in (plant.x1, plant.x2) if moving in values]
    flat = to_casadi([part for parts in outputs.values() for part in parts], values, motion)
    results = [ca.vertcat(*(flat.pop(0) for _ in parts)) if parts else ca.SX(0, 1) for parts in outputs.values()]
    return ca.Function(name, list(vectors.values()), results, list(inputs), list(outputs))
