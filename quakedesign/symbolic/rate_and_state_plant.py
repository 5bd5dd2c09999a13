"""Plant with rate-and-state friction about steady sliding, with and without inertia.

The module contains the third-order and the quasi-dynamic plant with slopes and stability conditions; the error dynamics
about slow sliding, in slip and the logarithms of slip rate and state; and the slip rate of the equilibrium for the
linearisation.
"""

from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property

import sympy as sp

from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.exact import rational, shortly
from quakedesign.fault import Fault, FrictionLaw
from quakedesign.symbolic import plant
from quakedesign.symbolic.plant import N_hat, eta_hat, k_hat, mu_star, p, sigma, stored

# ----------------------------------------------------------------------
# The plant about steady sliding, for friction with state: third order with inertia, quasi-dynamic without.
#
# The force balance is that of `quakedesign.symbolic.plant`, with a far end that moves at the loading rate. For a law
# without state and a loading rate of 0 it gives the equations of that module. Everything else is derived.

loading_rate = sp.Symbol(r"v_\infty", nonnegative=True)
rate = sp.Symbol("v", positive=True)
shear_modulus, density = sp.symbols("G rho", positive=True)
effective_stress = sp.Symbol("s", positive=True)
eigenvalue = sp.Symbol("lambda")


@cache
def state_symbols(names: tuple[str, ...]) -> tuple[sp.Symbol, ...]:
    """Real symbol of every state variable."""
    return tuple(sp.Symbol(name, real=True) for name in names)


def _friction(names: tuple[str, ...]) -> sp.Expr:
    return plant.mu(plant.x1, rate, *state_symbols(names))


def _state_rates(names: tuple[str, ...]) -> list[sp.Expr]:
    return [sp.Function(rf"g_{name}", real=True)(plant.x1, rate, *state_symbols(names)) for name in names]


@stored
def sliding_acceleration(names: tuple[str, ...] = ()) -> sp.Expr:
    """v' [m/s²] from the force balance about steady sliding at v_∞ without pressure and disturbance.

    x1 is the slip relative to steady sliding [m], v the slip rate [m/s], and μ a function of x1, v and the states
    `names`. The far end moves at v_∞; in steady sliding, the constant spring stretch balances μ* and the damping.
    """
    z, v, acceleration, far, z_star, far_start = sp.symbols("z v a delta_far z^* far", real=True)
    ahead = {z: z_star + loading_rate * plant.t + plant.x1, v: rate}
    balance = plant.force_balance().subs(far, far_start + loading_rate * plant.t)
    steady = balance.subs({acceleration: 0, p: 0} | ahead).subs({plant.x1: 0, rate: loading_rate})
    steady = steady.replace(plant.disturbance, lambda *_: sp.Integer(0)).replace(plant.mu, lambda *_: mu_star)
    loaded = balance.subs(far_start, sp.solve(steady, far_start)[0])
    moving = sp.solve(loaded, acceleration)[0].subs(ahead)
    named = moving.replace(plant.mu, lambda *_: _friction(names)).replace(
        plant.disturbance, lambda _, v_, t_: plant.disturbance(plant.x1, v_, t_)
    )
    return sp.expand(named.subs({plant.A: N_hat * plant.m, plant.k: k_hat * plant.m, plant.eta: eta_hat * plant.m}))


@cache
def slope_symbols(names: tuple[str, ...] = ()) -> dict[sp.Expr, sp.Symbol]:
    """Map from every derivative of friction and of the state rates to the real symbol of this slope."""
    states = state_symbols(names)
    tags = ["x_1", "v", *names]
    slopes = dict(
        zip(
            (_friction(names).diff(x) for x in (plant.x1, rate, *states)),
            (plant.slip_slope, plant.rate_slope, *sp.symbols([rf"\mu_{{{n}}}" for n in names], real=True)),
            strict=True,
        )
    )
    for name, g in zip(names, _state_rates(names), strict=True):
        for tag, x in zip(tags, (plant.x1, rate, *states), strict=True):
            slopes[g.diff(x)] = sp.Symbol(rf"g_{{{name}\,{tag}}}", real=True)
    return slopes


@stored
def jacobian(names: tuple[str, ...] = ()) -> sp.Matrix:
    """Jacobian of the rates of (x1, v, states) in the symbols of `slope_symbols`, at an equilibrium with pressure p."""
    quiet = sliding_acceleration(names).replace(plant.disturbance, lambda *_: sp.Integer(0))
    field = sp.Matrix([rate - loading_rate, quiet, *_state_rates(names)])
    J = field.jacobian([plant.x1, rate, *state_symbols(names)]).subs(slope_symbols(names))
    return J.applyfunc(lambda entry: sp.collect(sp.expand(entry), N_hat, sp.factor))


def slopes(law: FrictionLaw, at_rate: sp.Expr = loading_rate) -> dict[sp.Symbol, sp.Expr]:
    """Slopes of a law in steady sliding, keyed by their symbols in `jacobian`.

    Parameters
    ----------
    law : FrictionLaw
        `symbolic()` or `exact()`.
    at_rate : Expr
        Rate of steady sliding [m/s].
    """
    names = law.state_names
    variables = (plant.x1, rate, *state_symbols(names))
    functions = [law.coefficient(*variables), *law.state_rates(*variables)]
    at = dict(zip(variables, (sp.Integer(0), at_rate, *law.steady_state(at_rate)), strict=True))
    values = [_tidy(sp.sympify(f).diff(x).subs(at)) for f in functions for x in variables]
    return dict(zip(slope_symbols(names).values(), values, strict=True))


def _tidy(expression: sp.Expr) -> sp.Expr:
    """Factor a rational function; return any other expression unchanged, since factoring would lengthen it."""
    return sp.factor(expression) if expression.is_rational_function() else expression


@stored
def characteristic(names: tuple[str, ...] = (), *, inertia: bool = True) -> tuple[sp.Expr, ...]:
    """Coefficients of det(λE − J), highest power first, in the slopes and `effective_stress`.

    E is the identity; without inertia its entry for the acceleration is 0: the force balance is then a constraint that
    gives the slip rate, and the degree is one lower.
    """
    J = jacobian(names).subs(sigma, p + effective_stress)
    E = sp.eye(len(names) + 2)
    E[1, 1] = int(inertia)
    determinant = (eigenvalue * E - J).det(method="berkowitz")
    return tuple(sp.Poly(sp.expand(determinant), eigenvalue).all_coeffs())


@cache
def stability_conditions(names: tuple[str, ...] = (), *, inertia: bool = True) -> tuple[sp.Expr, ...]:
    """Expressions that are all positive if and only if all eigenvalues have negative real part (Hurwitz 1895).

    They are the leading coefficient (unless it is 1), the leading minors of the Hurwitz matrix except the last, and the
    last coefficient. If one of them is negative, an eigenvalue has positive real part. Without inertia, a negative
    leading coefficient corresponds to an eigenvalue that tends to +∞ as the inertia tends to 0.
    """
    a = characteristic(names, inertia=inertia)
    n = len(a) - 1
    hurwitz = sp.Matrix(n, n, lambda i, j: a[2 * j - i + 1] if 0 <= 2 * j - i + 1 <= n else 0)
    minors = [sp.expand(hurwitz[:i, :i].det(method="berkowitz")) for i in range(1, n)]
    conditions = [*([] if inertia else [a[0]]), *minors, a[-1]]
    return tuple(f for i, f in enumerate(conditions) if f not in conditions[:i])


def _absent(law: FrictionLaw) -> dict[sp.Symbol, sp.Expr]:
    """Slopes of a law that are zero."""
    return {symbol: value for symbol, value in slopes(law).items() if value == 0}


def _inserted(expression: sp.Expr, law: FrictionLaw) -> sp.Expr:
    return _tidy(sp.sympify(expression).subs(slopes(law)))


def _positive(expression: sp.Expr) -> bool:
    """Whether SymPy proves that an expression is positive for positive parameters, rate and effective stress."""
    return bool(_tidy(expression.subs(loading_rate, rate)).is_positive)


def _with_stresses(expression: sp.Expr) -> sp.Expr:
    """Expression with σ' − p for the effective stress, collected for readability."""
    gathered = expression.replace(lambda e: e.is_Add, lambda e: sp.collect(e, N_hat * effective_stress))
    return gathered.subs(effective_stress, sigma - p)


def critical_stiffness(law: FrictionLaw, *, inertia: bool = True) -> sp.Expr:
    """k̂ [1/s²] above which all stability conditions that depend on the stiffness are met.

    For rate and state: Ruina (1983) without inertia, Rice and Ruina (1983, J. Appl. Mech. 50, 343) with it, here with
    damping as well. Zero if no condition depends on the stiffness; not positive if every stiffness is stable.

    Raises
    ------
    UnsupportedError
        If a condition is not linear in the stiffness (several state variables).
    """
    conditions = stability_conditions(law.state_names, inertia=inertia)
    polynomials = [sp.Poly(condition.subs(_absent(law)), k_hat) for condition in conditions]
    if any(poly.degree() > 1 for poly in polynomials):
        raise UnsupportedError("the critical stiffness has a closed form for at most one state variable")
    linear = [poly.all_coeffs() for poly in polynomials if poly.degree() == 1]
    roots = [_inserted(sp.factor(-offset / slope), law) for slope, offset in linear]
    nontrivial = [_with_stresses(r) for i, r in enumerate(roots) if r != 0 and r not in roots[:i]]
    return sp.Max(*nontrivial) if nontrivial else sp.Integer(0)


def instability(law: FrictionLaw, *, inertia: bool = True) -> sp.Basic:
    """Condition for unstable sliding as inequalities, solved for stiffness or damping if linear in these.

    Stability conditions that are met for all positive parameters and σ' > p are omitted.
    """
    parts = []
    for condition in stability_conditions(law.state_names, inertia=inertia):
        expression = condition.subs(_absent(law))
        if not _positive(_inserted(expression, law)):
            parts.append(_solved(expression, law))
    return sp.Or(*parts)


def _solved(expression: sp.Expr, law: FrictionLaw) -> sp.Basic:
    for symbol in (k_hat, eta_hat):
        poly = sp.Poly(expression, symbol)
        if poly.degree() == 1 and _positive(_inserted(poly.LC(), law)):
            limit = _inserted(sp.factor(-poly.all_coeffs()[1] / poly.LC()), law)
            return sp.StrictLessThan(symbol, _with_stresses(limit))
    return sp.StrictLessThan(_with_stresses(_inserted(expression, law)), 0)


def nucleation_length(law: FrictionLaw) -> sp.Expr:
    """Length L [m] whose stiffness per area G/L is critical without inertia and damping.

    A fault shorter than L slides stably (Dieterich 1992, Tectonophysics 211, 115, with the stiffness G/L of the
    spring-slider in place of that of a crack). Infinite if no stability condition depends on the stiffness; negative if
    no stiffness is unstable.
    """
    critical = critical_stiffness(law, inertia=False).subs(eta_hat, 0)
    return _tidy(shear_modulus * N_hat / critical) if critical != 0 else sp.oo


def quasi_dynamic_rates(law: FrictionLaw) -> tuple[sp.Expr, ...]:
    """(v', θ', …) of the plant without inertia, from the time derivative of the force balance.

    Pressure is constant and the disturbance is zero. Requires η̂ + N̂(σ' − p)μ_v > 0; otherwise the slip rate jumps
    (Rice and Ben-Zion 1996).
    """
    names = law.state_names
    states = state_symbols(names)
    coefficient = law.coefficient(plant.x1, rate, *states)
    state_rates = law.state_rates(plant.x1, rate, *states)
    balance = sliding_acceleration(names).replace(plant.disturbance, lambda *_: sp.Integer(0))
    force = balance.replace(plant.mu, lambda *_: coefficient)
    carried = force.diff(plant.x1) * (rate - loading_rate)
    carried += sum((force.diff(x) * g for x, g in zip(states, state_rates, strict=True)), start=sp.Integer(0))
    return (-carried / force.diff(rate), *state_rates)


def third_order_rates(law: FrictionLaw) -> tuple[sp.Expr, ...]:
    """(x1', v', θ', …) with inertia, law and μ* inserted; the disturbance remains a function."""
    states = state_symbols(law.state_names)
    variables = (plant.x1, rate, *states)
    acceleration = sliding_acceleration(law.state_names).replace(plant.mu, lambda *_: law.coefficient(*variables))
    start = sp.sympify(law.steady_coefficient(loading_rate))
    return (rate - loading_rate, acceleration.subs(mu_star, start), *law.state_rates(*variables))


@cache
def error_dynamics(names: tuple[str, ...] = ()) -> plant.ErrorDynamics:
    """β and h of eq. esystem3 with μ also a function of the state; slip and rate are relative to steady sliding."""
    derived = plant.error_dynamics()
    if not names:
        return derived
    beta, h = (
        part.replace(plant.mu, lambda slip, ahead: plant.mu(slip, loading_rate + ahead, *state_symbols(names)))
        for part in (derived.beta, derived.h)
    )
    return plant.ErrorDynamics(beta=beta, h=h)


def is_steady(law: FrictionLaw) -> bool:
    """Whether sliding at a constant rate is steady: constant state, and no function of the law depends on slip."""
    variables = (plant.x1, rate, *state_symbols(law.state_names))
    parts = [sp.sympify(f) for f in (law.coefficient(*variables), *law.state_rates(*variables))]
    at = dict(zip(variables[2:], law.steady_state(rate), strict=True))
    changes = [g.subs(at) for g in parts[1:]] + [f.diff(plant.x1) for f in parts]
    return all(f == 0 or sp.simplify(f) == 0 for f in changes)


def without_overflow(friction: sp.Expr) -> sp.Expr:
    """Replace arsinh z by L + log(1 + √(1 + e^(−2L))), L = log z, which does not overflow for z such as e^(μ/a)."""

    def of_logarithm(z: sp.Expr) -> sp.Expr:
        positive = {x: sp.Symbol(x.name, positive=True) for x in z.free_symbols}
        back = {new: old for old, new in positive.items()}
        logarithm = sp.expand_log(sp.log(z.subs(positive)), force=True).subs(back)
        return logarithm + sp.log(1 + sp.sqrt(1 + sp.exp(-2 * logarithm)))

    return friction.replace(sp.asinh, of_logarithm)


# ----------------------------------------------------------------------
# Error dynamics about slow sliding with rate-and-state friction, in slip and the logarithms of slip rate and state.
#
# Errors are relative to sliding at V without inertia, with v = Ve^y, θ = θ_ss(V)e^z, the slip error x, the pressure
# error q = p − p* and a shear stress s on the fault, all per unit of area:
#
#     N(μ(y, z) − μ*) + HV(e^y − 1) = −Kx + μ*q + s,    x′ = V(e^y − 1),    z′ = θ′/θ,
#
# with N = σ′ − p, K = k/A, H = η/A. The change of friction is derived here from the law. The slip rate is algebraic: it
# follows from x, z, q and s at the same instant, so that the pressure acts on y directly (relative degree 0) and on x
# through one integration.

log_rate, log_state = sp.symbols("y z", real=True)
sliding_rate = sp.Symbol("V", positive=True)


@dataclass(frozen=True, kw_only=True)
class SlidingErrors:
    """Friction error and rate of the state error about sliding at `sliding_rate`, in `log_rate` y and `log_state` z."""

    friction_change: sp.Expr  # μ(y, z) − μ* [-]
    log_state_rate: sp.Expr  # z′ [1/s]

    @cached_property
    def slopes(self) -> tuple[sp.Expr, sp.Expr]:
        """∂μ/∂y and ∂μ/∂z [-] in steady sliding: a and b of the logarithmic laws."""
        return self._when_steady(self.friction_change, log_rate), self._when_steady(self.friction_change, log_state)

    @cached_property
    def decays(self) -> tuple[sp.Expr, sp.Expr]:
        """−∂z′/∂y and −∂z′/∂z [1/s] in steady sliding."""
        return -self._when_steady(self.log_state_rate, log_rate), -self._when_steady(self.log_state_rate, log_state)

    @staticmethod
    def _when_steady(expression: sp.Expr, variable: sp.Symbol) -> sp.Expr:
        return sp.simplify(expression.diff(variable).subs({log_rate: 0, log_state: 0}))


def sliding_errors(law: FrictionLaw) -> SlidingErrors:
    """Error dynamics about slow sliding for a law with one state.

    Parameters
    ----------
    law : FrictionLaw
        `symbolic()` or `exact()`.

    Raises
    ------
    UnsupportedError
        For a law without a state or with several.
    """
    if len(law.state_names) != 1:
        raise UnsupportedError(f"slow sliding needs friction with one state. Received {law.name}. Use error_dynamics.")
    steady = law.steady_state(sliding_rate)[0]
    rate, state = sliding_rate * sp.exp(log_rate), steady * sp.exp(log_state)
    change = law.coefficient(0, rate, state) - law.steady_coefficient(sliding_rate)
    moved = law.state_rates(0, rate, state)[0] / state
    return SlidingErrors(
        friction_change=_tidy_sliding(change), log_state_rate=sp.simplify(sp.expand_log(sp.simplify(moved), force=True))
    )


def _tidy_sliding(change: sp.Expr) -> sp.Expr:
    """Combine differences of logarithms; return any other expression unchanged."""
    if change.has(sp.asinh):
        return change
    return sp.simplify(sp.expand(sp.expand_log(change, force=True)))


# ----------------------------------------------------------------------
# Slip rate of the equilibrium.


def operating_rate(fault: Fault, rate: float | str | Fraction | None = None) -> Fraction:
    """Slip rate [m/s] of the equilibrium, checked against the law; by default the law's ``operating_rate``.

    Raises
    ------
    ParameterError
        If the rate is outside the law's working range, or sliding at this rate is not steady.
    """
    law = fault.friction
    value = rational(law.operating_rate if rate is None else rate, "loading_rate")
    low, high = law.working_rates
    if value < 0 or not low <= value <= high:
        raise ParameterError(
            f"loading_rate must be zero or positive and in the working range {low!r} to {high!r} m/s of {law.name}. "
            f"Received {shortly(value)} m/s. Choose a rate in this range, or widen the range."
        )
    if value > 0 and not is_steady(law.symbolic()):
        raise ParameterError(
            f"loading_rate must be zero for {law.name}, whose friction changes with slip, so that sliding is never "
            f"steady. Received {shortly(value)} m/s."
        )
    return value
