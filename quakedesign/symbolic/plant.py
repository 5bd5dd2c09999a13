"""Symbolic plant and error dynamics, derived from the force balance of the spring-slider.

SymPy derives the shifted plant, the error dynamics, the matched perturbation and the instability conditions. The module
also contains the notation in LaTeX and plain text, and stored derivations (`derived.json`, which a test derives again).
"""

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, wraps
from importlib import import_module
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import sympy as sp
from sympy.printing.latex import LatexPrinter
from sympy.printing.str import StrPrinter

from quakedesign.cache import shipped
from quakedesign.exact import rational
from quakedesign.fault import Fault, FrictionLaw


def _read(text: str) -> sp.Basic:
    """Expression from its ``srepr``, which does not record that the functions of the plant are real."""
    return eval(text, vars(sp) | {"Function": lambda name: sp.Function(name, real=True)})


# ----------------------------------------------------------------------
# Stored derivations, which are the same for every fault.
#
# `derived.json` contains the results that take SymPy half a second or more, keyed by the names of function and states;
# the others are derived at run time. A test derives all again; ``write_whole(FILE, derived_again())`` updates the file.

FILE = Path(__file__).parent / "derived.json"
_Given = ParamSpec("_Given")
_Result = TypeVar("_Result")


def stored(derivation: Callable[_Given, _Result]) -> Callable[_Given, _Result]:
    """Decorator that reads stored results of a derivation, whose only positional argument, if any, is the state names.

    With keyword options, or without a stored result, the derivation is run.
    """
    home = derivation.__module__.rpartition(".")[2]

    @cache
    @wraps(derivation)
    def result(*names: Any, **options: Any) -> Any:
        text = None if options else shipped(FILE).get(" ".join([f"{home}.{derivation.__name__}", *sum(names, ())]))
        return derivation(*names, **options) if text is None else _read(text)

    return result  # type: ignore[return-value]


def derived_again() -> str:
    """Content of `derived.json`, derived again."""
    shipped_texts = shipped(FILE)
    before, derived = dict(shipped_texts), {}
    shipped_texts.clear()
    try:
        for key in before:
            name, *states = key.split()
            home, function = name.split(".")
            derivation = getattr(import_module(f"{__package__}.{home}"), function)
            derivation.cache_clear()
            derived[key] = sp.srepr(derivation(*([tuple(states)] if states else [])))
    finally:
        shipped_texts.update(before)
    return json.dumps(derived, indent=1) + "\n"


# ----------------------------------------------------------------------
# From the force balance to the shifted plant, the error dynamics and the instability conditions.
#
# Only the force balance is entered by hand; SymPy derives the rest.

PARAMETERS = ("density", "shear_modulus", "damping", "effective_normal_stress")

t = sp.Symbol("t", nonnegative=True)
x1, x2 = sp.symbols("x_1 x_2", real=True)
p = sp.Symbol("p", real=True)
m, k, A, eta, sigma = sp.symbols(r"m k A eta \sigma'_n", positive=True)
k_hat, eta_hat, N_hat = sp.symbols(r"\hat{k} \hat{\eta} \hat{N}", positive=True)
mu_star = sp.Symbol(r"\mu^*", positive=True)
divisor = sp.Symbol(r"\mu_0\hat{N}_0", positive=True)
nu = sp.Symbol("nu", real=True)
e1, e2 = sp.symbols("e_1 e_2", real=True)
mu = sp.Function("mu", real=True)
disturbance = sp.Function(r"\hat{\varphi}_e", real=True)
reference = sp.Function("r", real=True)


@dataclass(frozen=True, slots=True)
class ErrorDynamics:
    """e1' = e2, e2' = β(ν + h), eqs. esystem3: control coefficient and matched perturbation."""

    beta: sp.Expr  # Control coefficient β [-]
    h: sp.Expr  # Matched perturbation [m/s²], the unit of ν

    def _repr_latex_(self) -> str:
        return (
            rf"$\displaystyle \dot e_1=e_2,\; \dot e_2=\beta(\nu+h),\; \beta={sp.latex(self.beta)},\; "
            rf"h={sp.latex(self.h)}$"
        )


@cache
def force_balance() -> sp.Eq:
    """Eq. springmodel for slip z and slip rate v, with a fixed far end (its drift is slow: ERRATA 24)."""
    z, v, acceleration, far = sp.symbols("z v a delta_far", real=True)
    friction_force = mu(z, v) * A * (sigma - p)
    return sp.Eq(m * acceleration, -friction_force + k * (far - z) - eta * v + m * disturbance(z, v, t))


@stored
def shifted_acceleration() -> sp.Expr:
    """x2' [m/s²] of eq. shift: slip is relative to the equilibrium without pressure and disturbance."""
    z, v, acceleration, far, z_star = sp.symbols("z v a delta_far z^*", real=True)
    balance = force_balance()
    rest = balance.subs({acceleration: 0, v: 0, p: 0, z: z_star})
    rest = rest.replace(disturbance, lambda *_: sp.Integer(0)).replace(mu, lambda *_: mu_star)
    far_end = sp.solve(rest, far)[0]
    moving = sp.solve(balance.subs(far, far_end), acceleration)[0].subs({z: x1 + z_star, v: x2})
    origin = moving.replace(mu, lambda z_, v_: mu(z_ - z_star, v_)).replace(
        disturbance, lambda z_, v_, t_: disturbance(z_ - z_star, v_, t_)
    )
    hats = {A: N_hat * m, k: k_hat * m, eta: eta_hat * m}
    f = sp.expand(sp.simplify(origin.subs(hats)))
    return sum((sp.factor(sp.collect(part, N_hat)) for part in _by_kind(f)), start=sp.Integer(0))


def _by_kind(f: sp.Expr) -> list[sp.Expr]:
    """Group into friction without pressure, friction with pressure, and the rest, for readability."""
    with_pressure = sp.expand(f.coeff(p)) * p
    friction = sp.expand(f.coeff(p, 0).coeff(N_hat)) * N_hat
    rest = sp.expand(f - with_pressure - friction)
    return [friction, with_pressure, *sp.Add.make_args(rest)]


slip_slope, rate_slope = sp.symbols(r"\mu_{x_1} \mu_{x_2}", real=True)


@cache
def jacobian() -> sp.Matrix:
    """Jacobian of eq. shift without disturbance at the origin, with pressure p (ERRATA 1).

    μ_x1 [1/m] and μ_x2 [s/m] stand for the slopes of friction at the origin, μ* for friction there.
    """
    field = sp.Matrix([x2, shifted_acceleration().replace(disturbance, lambda *_: sp.Integer(0))])
    friction = mu(x1, x2)
    named = {friction.diff(x1): slip_slope, friction.diff(x2): rate_slope, friction: mu_star}
    return field.jacobian([x1, x2]).subs(named).subs({x1: 0, x2: 0})


@stored
def instability() -> sp.Or:
    """Condition for an unstable origin: det J < 0 or trace J > 0, solved for k̂ and η̂ (ERRATA 2)."""
    J = jacobian()
    determinant, trace = sp.expand(J.det()), sp.expand(J.trace())
    stiffness_limit = sp.factor(sp.solve(determinant, k_hat)[0])
    damping_limit = sp.factor(sp.solve(trace, eta_hat)[0])
    return sp.Or(sp.StrictLessThan(k_hat, stiffness_limit), sp.StrictLessThan(eta_hat, damping_limit))


@cache
def error_dynamics() -> ErrorDynamics:
    """β and h of eq. esystem3, from eq. shift, p = ν/(μ0N̂0) and e = x − (r, r')."""
    return ErrorDynamics(beta=control_coefficient(), h=matched_perturbation())


@cache
def _error_acceleration() -> sp.Expr:
    """e2' in e and ν."""
    r = reference(t)
    shifted = shifted_acceleration().subs(p, nu / divisor).subs({x1: e1 + r, x2: e2 + r.diff(t)}, simultaneous=True)
    return shifted - r.diff(t, 2)


@stored
def control_coefficient() -> sp.Expr:
    """Control coefficient β [-] of eq. esystem3."""
    return sp.simplify(sp.expand(_error_acceleration()).coeff(nu))


@stored
def matched_perturbation() -> sp.Expr:
    """Matched perturbation h [m/s²] of eq. esystem3."""
    return _error_acceleration().subs(nu, 0) / control_coefficient()


def with_law(expression: sp.Expr, law: FrictionLaw, *, extended: bool = False) -> sp.Expr:
    """Insert a friction law (with symbols, or `law.exact()` with numbers) for μ, and μ(0, 0) for μ*.

    With `extended`, the law's continuation `law.extended` is inserted for μ.
    """
    coefficient = law.extended if extended else law.coefficient
    start = sp.sympify(law.coefficient(sp.Integer(0), sp.Integer(0)))
    return expression.replace(mu, coefficient).subs(mu_star, start)


def with_disturbance(expression: sp.Expr, fault: Fault) -> sp.Expr:
    """Insert the fault's disturbance for φ̂_e."""
    return expression.replace(disturbance, fault.disturbance.acceleration)


@cache
def plant_values(fault: Fault) -> dict[sp.Symbol, sp.Rational]:
    """Exact nominal values of k̂ [1/s²], η̂ [1/s], N̂ [m²/kg] and σ'_n [Pa]."""
    return hatted_parameters(fault, {name: sp.Rational(str(rational(getattr(fault, name)))) for name in PARAMETERS})


def hatted_parameters(fault: Fault, values: Mapping[str, Any]) -> dict[sp.Symbol, Any]:
    """k̂, η̂, N̂, σ'_n from values (SI) or symbols of `PARAMETERS`; n squares of side ℓ: m = nρℓ³, A = nℓ², k = nGℓ."""
    rho, G, damping, stress = (values[name] for name in PARAMETERS)
    h = sp.Rational(str(rational(fault.side)))
    mass, shared = rho * h**3, damping / sp.Rational(str(fault.squares))
    return {k_hat: G * h / mass, eta_hat: shared / mass, N_hat: h**2 / mass, sigma: stress}


phi, phi_t, phi_1, phi_2 = sp.symbols(r"\varphi \varphi_t \varphi_1 \varphi_2", real=True)
friction_value = sp.Symbol("mu", positive=True)
r0, r1, r2, r3 = sp.symbols("r_0 r_1 r_2 r_3", real=True)
acceleration_error = sp.Symbol(r"\dot{e}_2", real=True)


@stored
def matched_rate() -> sp.Expr:
    """Rate h' [m/s³] along a solution, from friction and its slopes, the reference and its derivatives, e1, e2 and e2'.

    The disturbance enters by its value φ and its partial derivatives φ_t in time, φ_1 in slip and φ_2 in slip rate. The
    control acts on h' through e2' = β(ν + h) (ERRATA 16).
    """
    a, b = sp.Function("a", real=True)(t), sp.Function("b", real=True)(t)
    r = reference(t)
    slip, rate = a + r, b + r.diff(t)
    h = error_dynamics().h.subs({e1: a, e2: b}, simultaneous=True)
    value = sp.Function("m_v", positive=True)(t)
    force = sp.Function("f_v", real=True)(t)
    h = h.replace(lambda e: isinstance(e, sp.core.function.AppliedUndef) and e.func == mu, lambda _: value)
    h = h.replace(lambda e: isinstance(e, sp.core.function.AppliedUndef) and e.func == disturbance, lambda _: force)
    chain = {
        value.diff(t): slip_slope * slip.diff(t) + rate_slope * rate.diff(t),
        force.diff(t): phi_t + phi_1 * slip.diff(t) + phi_2 * rate.diff(t),
    }
    total = h.diff(t).subs(chain)
    steps: list[dict[sp.Expr, sp.Expr]] = [
        {r.diff(t, 3): r3},
        {r.diff(t, 2): r2},
        {r.diff(t): r1},
        {b.diff(t): acceleration_error, a.diff(t): e2},
        {a: e1, b: e2, r: r0, value: friction_value, force: phi},
    ]
    for step in steps:
        total = total.subs(step)
    inner = sp.expand(sp.simplify(total * N_hat * friction_value**2 / divisor))
    return divisor / N_hat * sp.collect(inner, [slip_slope, rate_slope, r3, phi_t]) / friction_value**2


@stored
def matched_rate_in_parts() -> sp.Tuple:
    """h' [m/s³] as two parts: the contribution of the friction slopes (collected), and the rest (expanded)."""
    slopes = (slip_slope, rate_slope)
    total = sp.expand(matched_rate())
    without_slopes = sp.expand(total.subs(dict.fromkeys(slopes, 0)))
    with_slopes = sp.factor_terms(sp.collect(sp.expand(total - total.subs(dict.fromkeys(slopes, 0))), slopes))
    return sp.Tuple(with_slopes, without_slopes)


@stored
def sensitivities() -> sp.Tuple:
    """∂h/∂e1 [1/s²] and ∂h/∂e2 [1/s] at a fixed time, each as two parts: the term in the friction slope, and the rest.

    Slopes are chord slopes where friction has no derivative.
    """
    value = sp.Function("m_v", positive=True)(e1, e2)
    force = sp.Function("f_v", real=True)(e1, e2)
    kinds = {mu: value, disturbance: force}
    h = matched_perturbation().replace(lambda e: e.func in kinds, lambda e: kinds[e.func])
    parts = []
    for error, slope, growth in ((e1, slip_slope, phi_1), (e2, rate_slope, phi_2)):
        derivative = h.diff(error).subs({value.diff(error): slope, force.diff(error): growth})
        derivative = sp.expand(_named(derivative.subs({value: friction_value, force: phi})))
        part = sp.expand(derivative.coeff(slope))
        # separate parts, so that N̂ cancels where possible and occurs once elsewhere
        stressed = sp.simplify(part.coeff(sigma)) * sigma
        parts += [slope * (stressed + sp.factor(part.coeff(sigma, 0))), derivative.coeff(slope, 0)]
    return sp.Tuple(*parts)


def _named(h: sp.Expr) -> sp.Expr:
    """Expression with symbols for the reference and its derivatives."""
    r = reference(t)
    for part, name in ((r.diff(t, 2), r2), (r.diff(t), r1), (r, r0)):
        h = h.subs(part, name)
    return h


# ----------------------------------------------------------------------
# Notation of derived equations: dots (LaTeX) or primes (plain text) for rates, the reference without its argument.


class _Latex(LatexPrinter):  # type: ignore[misc]
    def _print_Derivative(self, rate: sp.Derivative) -> str:
        dots = {1: r"\dot", 2: r"\ddot"}.get(rate.derivative_count)
        return f"{dots} r" if dots and rate.expr == reference(t) else str(super()._print_Derivative(rate))

    def _print_Function(self, call: sp.Function, exp: Any = None) -> str:
        return "r" if call == reference(t) else str(super()._print_Function(call, exp))


class _Plain(StrPrinter):  # type: ignore[misc]
    def _print_Derivative(self, rate: sp.Derivative) -> str:
        of_reference = rate.expr == reference(t)
        return "r" + "'" * rate.derivative_count if of_reference else str(super()._print_Derivative(rate))

    def _print_Function(self, call: sp.Function) -> str:
        return "r" if call == reference(t) else str(super()._print_Function(call))


def latex(expression: Any) -> str:
    r"""LaTeX of a derived expression: r, \dot r and \ddot r for the reference and its rates."""
    return str(_Latex().doprint(expression))


def plain(expression: Any) -> str:
    """Text of a derived expression: r, r' and r'' for the reference and its rates, k_hat for k̂."""
    if isinstance(expression, sp.MatrixBase):
        return f"Matrix({plain(expression.tolist())})"
    text = _Plain().doprint(expression).replace(r"\mu_0\hat{N}_0", "(mu_0*N_hat_0)").replace(r"\mu^*", "mu_star")
    return re.sub(r"\\hat\{\\?(\w+)\}", r"\1_hat", text).replace("\\", "")
