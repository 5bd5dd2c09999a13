"""Closed loop of plant, control law and reference as CasADi functions.

Chapters: far-field loading and user-defined perturbation; variation of parameters within the uncertainty box, with the
same compiled code; energy budget of a run [J]; closed loop.
"""

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict, astuple, dataclass, fields, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import casadi as ca
import sympy as sp
from sympy.codegen.cfunctions import expm1

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.exact import rational
from quakedesign.fault import Fault, FrictionLaw
from quakedesign.fault.model import require_nonnegative
from quakedesign.laws import Controller
from quakedesign.laws.feed_forward import NONE
from quakedesign.laws.sampled_controller import integral_symbols, law_expressions, r, r_acceleration, r_rate
from quakedesign.loop.schemes.base import Motion, Stepped
from quakedesign.simulation.integrators import Integrator
from quakedesign.symbolic import plant
from quakedesign.symbolic.casadi_printer import to_casadi

Number = ca.SX | float

# ----------------------------------------------------------------------
# Loads in addition to the fault's own disturbance: the far field, and a user-defined perturbation.

SYMBOLS = ("slip", "slip_rate", "time")


@checked_dataclass(frozen=True, kw_only=True)
class Load:
    """Drift of the far end of the spring, and a user-defined perturbation φ_e(slip, slip rate, time).

    At t = 0 the fault is on the verge of slip. From then on the far end moves at the drift rate, which adds k̂·drift·t
    to x2' (ERRATA 24). The perturbation is added to that of the fault.

    Attributes
    ----------
    drift : float
        v_∞ [m/s], not negative.
    perturbation : Expr or None
        φ̂_e [m/s²], a SymPy expression of the symbols ``slip`` [m] (x1), ``slip_rate`` [m/s] (x2) and ``time`` [s].

    Raises
    ------
    ParameterError
        For a drift that is negative or not finite, or a perturbation that is not an expression of these symbols.
    """

    drift: float = 0.0
    perturbation: "sp.Expr | None" = None

    def __post_init__(self) -> None:
        require_nonnegative(drift=self.drift)
        if self.perturbation is None:
            return
        try:
            expression = sp.sympify(self.perturbation, strict=True)
        except sp.SympifyError:
            expression = None
        names = {symbol.name for symbol in expression.free_symbols} if isinstance(expression, sp.Expr) else {"?"}
        if not names <= set(SYMBOLS):
            raise ParameterError(
                f"perturbation must be a SymPy expression of the symbols {', '.join(SYMBOLS)}, in m/s². "
                f"Received {self.perturbation!r}."
            )
        object.__setattr__(self, "perturbation", expression)

    @cached_property
    def acceleration(self) -> "sp.Expr":
        """User-defined φ̂_e [m/s²] alone, in x1, x2 and t of `quakedesign.symbolic.plant`."""
        if self.perturbation is None:
            return sp.Integer(0)
        meant = dict(zip(SYMBOLS, (plant.x1, plant.x2, plant.t), strict=True))
        named = {symbol: meant[symbol.name] for symbol in self.perturbation.free_symbols}
        return self.perturbation.subs(named, simultaneous=True)

    def far_end_acceleration(self, fault: "Fault") -> "sp.Expr":
        """Acceleration k̂·drift·t [m/s²] due to the motion of the far end, in t of `quakedesign.symbolic.plant`."""
        return plant.plant_values(fault)[plant.k_hat] * sp.Rational(str(rational(self.drift))) * plant.t


NO_LOAD = Load()


# ----------------------------------------------------------------------
# Parameters that differ from the nominal ones within the uncertainty box, without a new derivation or compilation.


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Variation:
    """Ratios of true to nominal parameters; the controller keeps the nominal ones of its design.

    Attributes
    ----------
    stiffness, damping, authority : float
        Factors of k̂, η̂ and N̂ [-], each within the fault's box.
    weakening : float
        Fraction of the nominal friction drop [-], 0 … 1: μ = μ_res + weakening·(μ_law − μ_res). Together with
        `authority` it determines β. For every value in 0 … 1, μ and its slopes stay within the bounds of the law.
    amplitude : float
        Ratio of the true to the nominal amplitude of the fault's sinusoidal disturbance [-], 0 … 1.
    phase : float
        Initial phase of this disturbance [rad], 0 … 2π.
    """

    stiffness: float = 1.0
    damping: float = 1.0
    authority: float = 1.0
    weakening: float = 1.0
    amplitude: float = 1.0
    phase: float = 0.0

    def require_within(self, fault: Fault) -> None:
        """Raise a ParameterError for factors outside the fault's uncertainty box."""
        box = fault.box
        for name in ("stiffness", "damping", "authority"):
            width = getattr(box, name)
            _require(name, getattr(self, name), float(1 - width), float(1 + width), f"the box {box.name!r}")
        for name, highest in (("weakening", 1.0), ("amplitude", 1.0), ("phase", 2 * math.pi)):
            _require(name, getattr(self, name), 0.0, highest, "every box")

    @property
    def values(self) -> tuple[float, ...]:
        """The factors in the order of `symbols`."""
        return astuple(self)


def _require(name: str, value: float, low: float, high: float, where: str) -> None:
    if not low - 1e-12 <= value <= high + 1e-12:
        raise ParameterError(
            f"{name} of a variation must be {low:g} to {high:g} in {where}. Received {value!r}. "
            "Choose a value inside, or a fault with a wider box."
        )


def names() -> tuple[str, ...]:
    """Names of the factors, in order."""
    return tuple(field.name for field in fields(Variation))


def complete(factors: tuple[Number, ...]) -> tuple[Number, ...]:
    """All factors; omitted trailing factors take their nominal values."""
    return factors + astuple(Variation())[len(factors) :]


def symbols() -> tuple[sp.Symbol, ...]:
    """Nonnegative symbols of the factors."""
    return tuple(map(symbol, names()))


def symbol(name: str) -> sp.Symbol:
    """Symbol of one factor."""
    return sp.Symbol(f"factor_{name}", nonnegative=True)


@dataclass(frozen=True)
class WeakenedFriction:
    """A friction law whose drop is scaled by a factor, `share`."""

    law: FrictionLaw
    share: sp.Expr

    def coefficient(self, slip: sp.Expr, rate: sp.Expr) -> sp.Expr:
        """Friction coefficient [-]."""
        return self._weakened(self.law.coefficient(slip, rate))

    def extended(self, slip: sp.Expr, rate: sp.Expr) -> sp.Expr:
        """Friction coefficient [-] continued to all slips and rates."""
        return self._weakened(self.law.extended(slip, rate))

    def _weakened(self, value: sp.Expr) -> sp.Expr:
        residual = sp.sympify(self.law.bounds[0])
        return residual + self.share * (value - residual)


def varied_values(fault: Fault) -> dict[sp.Symbol, sp.Expr]:
    """Value of every hatted parameter: nominal number times symbol of its factor."""
    stiffness, damping, authority, *_ = symbols()
    factors = {plant.k_hat: stiffness, plant.eta_hat: damping, plant.N_hat: authority}
    return {hatted: value * factors.get(hatted, 1) for hatted, value in plant.plant_values(fault).items()}


# ----------------------------------------------------------------------
# Energy budget of a run: works of forces against changes of stored energies.

WORKS = ("work_weakening", "work_injection", "work_viscous", "work_disturbance", "sum_slip")


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class EnergyBudget:
    """Energies of a run from its beginning to its end [J]: the stored and dissipated energies balance the works.

    kinetic + elastic + frictional + viscous − far_field − disturbance − residual = 0.

    Attributes
    ----------
    kinetic, elastic : float
        Change of ½m·x2², and of ½k times the square of the elongation of the spring [J].
    frictional : float
        Frictional heat under the applied pressure, ∫μA(σ' − p)·x2 dt [J].
    injection : float
        Reduction of the frictional work by the pressure, ∫μAp·x2 dt [J]: without pressure the work on the same slip
        path would be frictional + injection.
    viscous : float
        Energy dissipated by the dashpot, or radiated if `damping` is the radiation damping: ∫η(x2 − v_∞)² dt [J].
    far_field : float
        Work of the drifting far end on spring and dashpot [J]; 0 without drift.
    disturbance : float
        Work of φ_e, ∫mφ̂_e·x2 dt [J].
    """

    kinetic: float
    elastic: float
    frictional: float
    injection: float
    viscous: float
    far_field: float
    disturbance: float

    @property
    def residual(self) -> float:
        """Residual of the balance [J]: the integration error, since works are integrated along with the motion."""
        return self.kinetic + self.elastic + self.frictional + self.viscous - self.far_field - self.disturbance

    @property
    def relative_residual(self) -> float:
        """Ratio of |residual| to the largest absolute value of the other entries [-]; 0 if all entries are 0."""
        entries = self.to_dict()
        return abs(entries.pop("residual")) / largest if (largest := max(map(abs, entries.values()))) else 0.0

    def to_dict(self) -> dict[str, float]:
        """Energies and residual [J] by name."""
        return asdict(self) | {"residual": self.residual}

    @staticmethod
    def unit(name: str) -> str:
        """SI unit of one entry."""
        return "" if name == "relative_residual" else "J"


class Meter:
    """Wrapper of a loop that also accumulates the works of the forces during the steps, as CasADi expressions.

    Attributes
    ----------
    works : SX
        Accumulated works per unit mass [J/kg] and ∫x1 dt [m·s], in the order of `WORKS`.
    """

    def __init__(self, loop: "ClosedLoop", works: ca.SX) -> None:
        self.loop, self.works = loop, works

    def __getattr__(self, name: str) -> Any:
        return getattr(self.loop, name)

    def advance(self, method: type[Integrator], motion: Motion, state: ca.SX, step: float) -> ca.SX:
        """See `Stepped.advance`; the works are integrated along with the motion."""
        size = state.shape[0]

        def with_powers(plant: Motion, passed: ca.SX, now: ca.SX) -> ca.SX:
            seen: list[ca.SX] = []

            def watched(time: ca.SX, x: ca.SX, pressure: ca.SX) -> ca.SX:
                seen[:] = [self.loop.powers(time, x, pressure)]
                return plant(time, x, pressure)

            return ca.vertcat(motion(watched, passed, now[:size]), seen[0])

        end = self.loop.advance(method, with_powers, ca.vertcat(state, ca.SX.zeros(len(WORKS))), step, works=len(WORKS))
        self.works = self.works + end[size:]
        return end[:size]

    def advance_often(
        self, method: type[Integrator], motion: Motion, given: ca.SX, state: ca.SX, step: float, times: int
    ) -> ca.SX:
        """See `Stepped.advance_often`."""
        state, self.works = self.loop.metered_often(method, motion, given, (state, self.works), step, times)
        return state


class Metered(Stepped):
    """A loop that integrates the works of its forces along with its motion.

    Attributes
    ----------
    factors : tuple of float or SX
        Ratios of true to nominal parameters; empty for the nominal fault.
    """

    load: Load
    factors: tuple[Number, ...]

    @property
    @abstractmethod
    def friction(self) -> Motion:
        """Function x [m, m/s] → friction coefficient [-]."""

    @property
    @abstractmethod
    def static_friction(self) -> Number:
        """Friction coefficient [-] on the verge of slip."""

    @property
    @abstractmethod
    def disturbance_function(self) -> Motion:
        """Function (t [s], x [m, m/s]) → φ̂_e [m/s²]."""

    def powers(self, time: ca.SX, x: ca.SX, pressure: ca.SX) -> ca.SX:
        """Integrands in the order of `WORKS` (SX): powers per unit mass [W/kg], and x1 [m] as the last one.

        The first integrand is the frictional power at p = 0 minus that of static friction, which `budget` adds exactly.
        """
        _, normal, damping, stress = self.hats()
        relief = ca.fmin(pressure, stress) if self.sticks else pressure
        friction = self.friction(ca.vertcat(x[0], x[1]))
        return ca.vertcat(
            normal * stress * (friction * x[1] - self.static_friction * x[1]),
            normal * friction * relief * x[1],
            damping * x[1] * x[1],
            self.disturbance_function(time, x) * x[1],
            x[0],
        )

    def budget(self, integrals: Mapping[str, float], time: float, slip: float, rate: float) -> EnergyBudget:
        """Energy budget of a run from rest; `integrals` as in `WORKS`, time [s], slip [m] and rate [m/s] at its end."""
        mass, drift = self.fault.mass, self.load.drift
        stiffness, normal, damping, stress = map(float, self.hats())
        static = normal * stress * float(self.static_friction)
        tension, opened = static - damping * drift, drift * time - slip
        pull = tension * time + stiffness * (drift * time**2 / 2 - integrals["sum_slip"]) + damping * opened
        return EnergyBudget(
            kinetic=mass * rate**2 / 2,
            elastic=mass * (tension + stiffness * opened / 2) * opened,
            frictional=mass * (integrals["work_weakening"] + static * slip - integrals["work_injection"]),
            injection=mass * integrals["work_injection"],
            viscous=mass * (integrals["work_viscous"] + damping * drift * (drift * time - 2 * slip)),
            far_field=mass * drift * pull,
            disturbance=mass * integrals["work_disturbance"],
        )

    def hats(self) -> tuple[Number, Number, Number, float]:
        """k̂ [1/s²], N̂ [m²/kg], η̂ [1/s] with the factors of the loop, and σ' [Pa]."""
        numbers = plant.plant_values(self.fault)
        stiffness, damping, authority = self.factors[:3] or (1.0,) * 3
        k, eta, N, sigma = (float(numbers[s]) for s in (plant.k_hat, plant.eta_hat, plant.N_hat, plant.sigma))
        return k * stiffness, N * authority, eta * damping, sigma


# ----------------------------------------------------------------------
# Plant, law and reference of one closed loop, from SymPy to CasADi functions.


phi = sp.Symbol("phi", real=True)


def reference_expressions(fault: Fault) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """r [m], r' [m/s] and r'' [m/s²] as functions of t; r is constant after the operation time (ERRATA 26)."""
    end = sp.Rational(str(rational(fault.reference.operation_time)))
    slip = fault.reference.slip(plant.t)
    moving = (sp.factor(sp.diff(slip, plant.t, order)) for order in (1, 2))
    rate, acceleration = (sp.Piecewise((part, plant.t < end), (0, True)) for part in moving)
    return slip.subs(plant.t, sp.Min(plant.t, end)), rate, acceleration


def acceleration_expression(fault: Fault, varied: bool = False) -> sp.Expr:
    """x2' [m/s²] of the paper's equation ``shift``, in x1, x2, p and the disturbance φ.

    Friction is continued to slip < 0 (ERRATA 12).

    If `varied` is True, here and in the functions below, the expression also contains the factors of `symbols`.
    """
    return _with_numbers(plant.shifted_acceleration(), fault, varied)


def friction_expression(fault: Fault, varied: bool = False) -> sp.Expr:
    """Friction coefficient [-] in x1 and x2, continued to slip < 0."""
    return _with_numbers(plant.mu(plant.x1, plant.x2), fault, varied)


def matched_perturbation(fault: Fault, divisor: sp.Rational, varied: bool = False) -> sp.Expr:
    """h [m/s²] of eq. ``esystem3`` for a divisor μ0N̂0 [m²/kg], in x1, x2, φ, r, r' and r''."""
    moving, derived = plant.reference(plant.t), plant.error_dynamics()
    position = {plant.e1: plant.x1 - moving, plant.e2: plant.x2 - moving.diff(plant.t)}
    named = ((moving.diff(plant.t, 2), r_acceleration), (moving.diff(plant.t), r_rate), (moving, r))
    unmatched, beta = (
        _with_numbers(part.subs(position, simultaneous=True).subs(named), fault, varied).subs(plant.divisor, divisor)
        for part in (derived.h * derived.beta, derived.beta)
    )
    return unmatched / beta


def acceleration_with_parameters(fault: Fault, names: Sequence[str]) -> tuple[sp.Expr, list[sp.Symbol]]:
    """x2' [m/s²] as in `acceleration_expression`, with the named parameters as symbols; and these symbols."""
    law = fault.friction
    free = law.symbols() | {name: sp.Symbol(name, positive=True) for name in plant.PARAMETERS}
    numbers = {name: sp.Rational(str(rational(getattr(fault, name)))) for name in plant.PARAMETERS}
    hatted = plant.hatted_parameters(fault, numbers | {name: free[name] for name in names if name in numbers})
    fixed = {symbol: value for symbol, value in law.values().items() if symbol not in {free[name] for name in names}}
    symbols = [free[name] for name in names]
    return _inserted(plant.shifted_acceleration(), law.symbolic(), hatted).subs(fixed), symbols


def _with_numbers(expression: sp.Expr, fault: Fault, varied: bool) -> sp.Expr:
    """Insert the law and exact numbers."""
    law: Any = fault.friction.exact()
    law = WeakenedFriction(law, symbol("weakening")) if varied else law
    return _inserted(expression, law, varied_values(fault) if varied else plant.plant_values(fault))


def _inserted(expression: sp.Expr, law: FrictionLaw, values: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    """Insert the law and the values; e^u becomes 1 + expm1(u), which avoids cancellation for small slips."""
    lawful = plant.with_law(expression, law, extended=True)
    numbers = lawful.replace(plant.disturbance, lambda *_: phi).subs(values)
    return sp.expand_mul(numbers.replace(sp.exp, lambda u: 1 + expm1(u)))


@dataclass(frozen=True)
class ClosedLoop(Metered):
    """One fault under one law, or under a constant pressure."""

    plant_name: ClassVar[str] = "printed"
    plant_title: ClassVar[str] = ", plant without stick"

    fault: Fault
    controller: Controller | None = None
    constant_pressure: float = 0.0  # p [Pa] without a controller
    load: Load = NO_LOAD  # In addition to the fault's own disturbance
    # Ratios of true to nominal parameters as in `Variation.values`; empty for the nominal fault
    factors: tuple[Number, ...] = ()

    def with_factors(self, factors: tuple[Number, ...]) -> Self:
        """Return the same loop with other true parameters, which may be CasADi symbols (SX)."""
        return replace(self, factors=factors) if factors else self

    def advance(self, method: type[Integrator], motion: Motion, state: ca.SX, step: float, works: int = 0) -> ca.SX:
        """State [x1, x2, ξ] (SX) after one step.

        Parameters
        ----------
        method : type of Integrator
        motion : callable
            Time derivative of the state. Its arguments are the plant, a function of t [s], x and p [Pa]; `passed`, the
            elapsed share of the step [-]; and the state.
        step : float
            [s].
        works : int
            Number of trailing entries of the state that are works of forces; no derivative depends on them.
        """
        return method.advance(lambda passed, now: motion(self.plant, passed, now), state, step)

    def advance_often(
        self, method: type[Integrator], motion: Motion, given: ca.SX, state: ca.SX, step: float, times: int
    ) -> ca.SX:
        """State (SX) after `times` steps; in generated C the steps are a loop that calls one function.

        Parameters
        ----------
        method, state, step
            See `advance`.
        motion : callable
            As in `advance`, but `passed` counts steps from the first one, and `given` is an additional last argument.
        given : SX
            Further arguments of the motion, constant over the steps.
        """
        return self.metered_often(method, motion, given, (state, ca.SX(0, 1)), step, times)[0]

    def metered_often(
        self,
        method: type[Integrator],
        motion: Motion,
        given: ca.SX,
        start: tuple[ca.SX, ca.SX],
        step: float,
        times: int,
    ) -> tuple[ca.SX, ca.SX]:
        """State and works (SX) after `times` steps; see `advance_often`. Empty works stay empty."""

        def once(loop: Self, moving: Motion, state: ca.SX, works: ca.SX) -> tuple[ca.SX, ca.SX]:
            if not works.shape[0]:
                return loop.advance(method, moving, state, step), works
            meter = Meter(loop, works)
            return meter.advance(method, moving, state, step), meter.works

        if times == 1:
            return once(self, lambda plant, passed, now: motion(plant, passed, now, given), *start)
        initial = *start, ca.SX(0), given, _column(self.factors)
        before, so_far, number, inputs, factors = (ca.SX.sym("z", part.shape[0]) for part in initial)
        loop = self.with_factors(tuple(ca.vertsplit(factors)))
        moved = once(loop, lambda plant, passed, now: motion(plant, number + passed, now, inputs), before, so_far)
        after = ca.vertcat(*moved, number + 1, inputs, factors)
        substep = ca.Function("substep", [ca.vertcat(before, so_far, number, inputs, factors)], ca.cse([after]))
        end = substep.fold(times, {"never_inline": True})(ca.vertcat(*initial))
        first, last = before.shape[0], before.shape[0] + so_far.shape[0]
        return end[:first], end[first:last]

    @property
    def integrals(self) -> tuple[sp.Symbol, ...]:
        """Symbols of the states of the law."""
        return integral_symbols(self.controller)

    @property
    def divisor(self) -> sp.Rational:
        """Divisor μ0N̂0 of the control [m²/kg]: that of the law, or μ_res·N̂_min if the law has none."""
        if self.controller is not None and self.controller.divisor is not None:
            return sp.Rational(str(self.controller.divisor))
        least = rational(self.fault.friction.bounds[0]) * (1 - self.fault.box.authority)
        return sp.Rational(str(least)) * plant.plant_values(self.fault)[plant.N_hat]

    @property
    def plant(self) -> Motion:
        """CasADi Function (t [s], x [m, m/s], p [Pa]) → dx [m/s, m/s²]."""
        return self.printed

    @cached_property
    def printed(self) -> Motion:
        """Plant as printed in the paper (equation ``shift``), which is valid for slip rates ≥ 0."""
        rates = [plant.x2, acceleration_expression(self.fault, bool(self.factors))]
        inputs = {"t": [plant.t], "x": [plant.x1, plant.x2], "p": [plant.p]}
        return self.function("plant", inputs, {"dx": rates})

    @cached_property
    def reference(self) -> ca.Function:
        """CasADi Function t [s] → reference [m, m/s, m/s²]."""
        return casadi_function("reference", {"t": [plant.t]}, {"reference": list(reference_expressions(self.fault))})

    @cached_property
    def law(self) -> ca.Function:
        """CasADi Function (x, xi, reference) → p [Pa], dxi; without a controller p is constant."""
        inputs = {"x": [plant.x1, plant.x2], "xi": list(self.integrals), "reference": [r, r_rate, r_acceleration]}
        if self.controller is None:
            return casadi_function("law", inputs, {"p": [sp.Float(self.constant_pressure)], "dxi": []})
        pressure, rates = law_expressions(self.controller)
        return casadi_function("law", inputs, {"p": [pressure], "dxi": list(rates)})

    @property
    def feedforward(self) -> sp.Expr:
        """Feed-forward of known plant terms [m/s²]; the law adds it to ν, so that it is part of h."""
        compensated = self.controller.feedforward if self.controller is not None else NONE
        return compensated.acceleration(plant.x1, plant.x2, r_acceleration)

    @cached_property
    def perturbation(self) -> Motion:
        """CasADi Function (t [s], x [m, m/s], reference) → h [m/s²] including the feed-forward, and mu [-]."""
        inputs = {"t": [plant.t], "x": [plant.x1, plant.x2], "reference": [r, r_rate, r_acceleration]}
        outputs = {
            "h": [matched_perturbation(self.fault, self.divisor, bool(self.factors)) + self.feedforward],
            "mu": [friction_expression(self.fault, bool(self.factors))],
        }
        return self.function("perturbation", inputs, outputs)

    @cached_property
    def friction(self) -> Motion:
        """CasADi Function x [m, m/s] → friction coefficient [-]."""
        law = friction_expression(self.fault, bool(self.factors))
        return self.function("friction", {"x": [plant.x1, plant.x2]}, {"mu": [law]})

    @property
    def static_friction(self) -> Number:
        """Friction coefficient [-] on the verge of slip; an SX with symbolic factors, else a float."""
        value = self.friction([0, 0])
        return value if type(value).__name__ == "SX" else float(value)

    @cached_property
    def disturbance_function(self) -> Motion:
        """CasADi Function (t [s], x [m, m/s]) → φ̂_e [m/s²], without the load of the far end."""
        return self.function("shaken", {"t": [plant.t], "x": [plant.x1, plant.x2]}, {"phi": [self.disturbance]})

    def reversing(self, time: ca.SX, state: ca.SX, pressure: ca.SX) -> ca.SX:
        """Whether the load at rest exceeds friction in the backward direction (SX); 0 on a plant without stick."""
        return ca.SX(0)

    def shear_stress(self, time: ca.SX, state: ca.SX, pressure: ca.SX, friction: ca.SX) -> ca.SX:
        """Shear stress τ = μ(σ' − p) [Pa] with which friction resists slip (SX)."""
        return friction * (self.fault.effective_normal_stress - pressure)

    def function(self, name: str, inputs: dict[str, list[sp.Symbol]], outputs: dict[str, list[sp.Expr]]) -> Motion:
        """CasADi Function with the disturbance inserted, or a callable with the factors of the loop inserted too."""
        shaking = self.shaking if plant.t in inputs.get("t", ()) else None
        if not self.factors:
            return casadi_function(name, inputs, outputs, shaking)
        whole = casadi_function(name, inputs | {"factors": list(symbols())}, outputs, shaking)
        return lambda *arguments: whole(*arguments, _column(complete(self.factors)))

    @property
    def shaking(self) -> dict[sp.Symbol, sp.Expr]:
        """Substitution of `phi` by φ̂_e plus the far end's load [m/s²], made last to keep tiny terms exact."""
        loading = self.load.far_end_acceleration(self.fault) * (symbol("stiffness") if self.factors else 1)
        return {phi: self.disturbance + loading}

    @property
    def disturbance(self) -> sp.Expr:
        """φ̂_e [m/s²] of the fault plus the user-defined one, in x1, x2 and t."""
        own = plant.with_disturbance(plant.disturbance(plant.x1, plant.x2, plant.t), self.fault)
        if self.factors:
            own = own.replace(sp.sin, lambda angle: symbol("amplitude") * sp.sin(angle + symbol("phase")))
        return own + self.load.acceleration


def _column(values: tuple[Number, ...]) -> Any:  # SX, or DM if all are numbers
    return ca.vertcat(*values)


def casadi_function(
    name: str,
    inputs: dict[str, list[sp.Symbol]],
    outputs: dict[str, list[sp.Expr]],
    named: dict[sp.Symbol, sp.Expr] | None = None,
) -> ca.Function:
    """CasADi Function with named inputs and outputs; derivatives at a kink are right-sided in x1 and x2.

    `named` maps further symbols of the outputs to expressions in the inputs.
    """
    vectors = {key: ca.SX.sym(key, len(symbols)) for key, symbols in inputs.items()}
    values = {symbol: vectors[key][i] for key, symbols in inputs.items() for i, symbol in enumerate(symbols)}
    if named:
        values |= dict(zip(named, to_casadi(list(named.values()), values), strict=True))
    motion = [values[moving] for moving in (plant.x1, plant.x2) if moving in values]
    flat = to_casadi([part for parts in outputs.values() for part in parts], values, motion)
    results = [ca.vertcat(*(flat.pop(0) for _ in parts)) if parts else ca.SX(0, 1) for parts in outputs.values()]
    return ca.Function(name, list(vectors.values()), results, list(inputs), list(outputs))
