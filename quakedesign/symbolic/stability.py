"""Stability of steady sliding, critical stiffness, and the derived model of a fault.

Decisions use exact rationals where these suffice and ball arithmetic otherwise. `derive` returns the equations of one
fault, its eigenvalues and the cause of its instability.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

import mpmath
import sympy as sp
from flint import arb, ctx

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.exact import end_of, fraction_of, rational, shortly, to_sympy
from quakedesign.fault import Fault, FrictionLaw, require_fault
from quakedesign.fault.equilibrium import by_equilibrium
from quakedesign.symbolic import plant
from quakedesign.symbolic import rate_and_state_plant as state_plant
from quakedesign.symbolic.enclosure import BallBox, enclose
from quakedesign.symbolic.plant import ErrorDynamics, N_hat, eta_hat, k_hat, p, sigma
from quakedesign.symbolic.rate_and_state_plant import effective_stress, operating_rate

# ----------------------------------------------------------------------
# Decision on stable sliding, with exact rationals where these suffice and in ball arithmetic otherwise.

Interval = tuple[Fraction, Fraction]
Pressure = float | str | Fraction | tuple[float | str | Fraction, float | str | Fraction]
_PRECISIONS = (64, 256, 1024, 4096)
_PIECES = 200


class Stability(Enum):
    """Outcome of a stability test; ``UNDECIDED`` is a valid result at a stability boundary."""

    STABLE = "every condition is positive"
    UNSTABLE = "a condition is negative"
    UNDECIDED = "the enclosure of a condition contains zero, and no condition is proved negative"


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """One expression that must be positive for stability, and its value."""

    expression: sp.Expr  # In the symbols of the plant and the slopes of friction (`state_plant.stability_conditions`)
    # Enclosure of the expression divided by the sum of the magnitudes of its parts [-], in [−1, 1]. The parts are the
    # coefficients of the powers of the stiffness k, each times its power, so that k > k_c has the margin (k − k_c)/(k +
    # |k_c|). The parts of a condition without stiffness are its terms.
    margin: Interval
    exact: bool  # Whether both ends are the same exact rational

    @property
    def holds(self) -> bool | None:
        """True if positive, False if negative, None if the enclosure contains zero."""
        low, high = self.margin
        return True if low > 0 else (False if high < 0 else None)


@dataclass(frozen=True, slots=True, kw_only=True)
class StabilityVerdict:
    """Whether sliding at a loading rate is stable, with the margin of every condition."""

    outcome: Stability
    conditions: tuple[Condition, ...]
    pressure: Interval  # Range of the pressure [Pa]
    loading_rate: Fraction  # Slip rate of the equilibrium [m/s]
    inertia: bool

    @property
    def margin(self) -> Interval:
        """Enclosure of the smallest margin of all conditions [-]; its sign is rigorous if the outcome is decided."""
        return min(c.margin[0] for c in self.conditions), min(c.margin[1] for c in self.conditions)

    def _repr_latex_(self) -> str:
        signs = {True: ">0", False: "<0", None: r"\gtrless 0"}
        rows = [f"{sp.latex(c.expression)} &{signs[c.holds]} && ({float(c.margin[0]):+.3g})" for c in self.conditions]
        return r"$\displaystyle\begin{aligned}" + r"\\".join(rows) + r"\end{aligned}$"


def stability(
    fault: Fault,
    *,
    pressure: Pressure = 0,
    loading_rate: float | str | Fraction | None = None,
    inertia: bool = True,
    uncertain: bool = False,
) -> StabilityVerdict:
    """Decide whether the equilibrium of a fault is stable.

    Parameters
    ----------
    fault : Fault
    pressure : number, text, or pair of them
        Injected pressure p [Pa], below σ'; withdrawal is negative and increases the softening (ERRATA 1). For a pair
        the verdict holds for the whole range.
    loading_rate : number or text, optional
        Slip rate v_∞ [m/s] of steady sliding; without it the law's ``operating_rate`` (rest for a law without state).
    inertia : bool
        Whether the plant has inertia; without it, the plant is quasi-dynamic.
    uncertain : bool
        Whether stiffness, damping and control authority vary over the fault's uncertainty box.

    Raises
    ------
    ParameterError
        If the pressure is not below σ', a range of pressures does not ascend, the rate is outside the law's working
        range, or sliding at this rate is not steady.
    """
    at = operating_rate(fault, loading_rate)
    pressures = _interval(pressure, fault)
    ranges = _ranges(fault, pressures, uncertain)
    slopes = state_plant.slopes(fault.friction.symbolic(), state_plant.loading_rate if at else sp.Integer(0))
    parameters = {**fault.friction.values(), state_plant.loading_rate: sp.Rational(str(at))}
    conditions = tuple(
        _condition(expression, slopes, parameters, ranges)
        for expression in state_plant.stability_conditions(fault.friction.state_names, inertia=inertia)
    )
    return StabilityVerdict(
        outcome=_outcome(conditions), conditions=conditions, pressure=pressures, loading_rate=at, inertia=inertia
    )


def _outcome(conditions: tuple[Condition, ...]) -> Stability:
    signs = [c.holds for c in conditions]
    if False in signs:
        return Stability.UNSTABLE
    return Stability.STABLE if all(signs) else Stability.UNDECIDED


def _interval(pressure: Pressure, fault: Fault) -> Interval:
    low, high = pressure if isinstance(pressure, tuple) else (pressure, pressure)
    ends = rational(low, "pressure"), rational(high, "pressure")
    if not ends[0] <= ends[1] < rational(fault.effective_normal_stress):
        raise ParameterError(
            f"pressure must be below the effective normal stress {fault.effective_normal_stress!r} Pa, and a range "
            f"must ascend. Received {shortly(ends[0])} to {shortly(ends[1])} Pa. At this stress the fault opens."
        )
    return ends


def _ranges(fault: Fault, pressure: Interval, uncertain: bool) -> dict[sp.Symbol, Interval]:
    """Range of effective stress, stiffness, damping and authority."""
    values = {s: fraction_of(v) for s, v in plant.plant_values(fault).items()}
    stress = values.pop(sigma)
    box = fault.box
    widths = {k_hat: box.stiffness, eta_hat: box.damping, N_hat: box.authority}
    spread = {s: (v * (1 - widths[s] * uncertain), v * (1 + widths[s] * uncertain)) for s, v in values.items()}
    return {effective_stress: (stress - pressure[1], stress - pressure[0]), **spread}


def _condition(
    expression: sp.Expr,
    slopes: Mapping[sp.Symbol, sp.Expr],
    parameters: Mapping[sp.Symbol, sp.Rational],
    ranges: Mapping[sp.Symbol, Interval],
) -> Condition:
    fixed = {s: to_sympy(low) for s, (low, high) in ranges.items() if low == high}
    names = {s: sp.sympify(v).subs(parameters) for s, v in slopes.items() if s in expression.free_symbols}
    parts = _parts(expression.subs({s: v for s, v in slopes.items() if v == 0}))
    terms = [t.subs(names).subs(fixed) for t in parts]
    if all(t.is_Rational for t in terms):
        values = [fraction_of(t) for t in terms]
        size = sum(abs(v) for v in values)
        exact = sum(values, start=Fraction(0)) / size if size else Fraction(0)
        return Condition(expression=expression, margin=(exact, exact), exact=True)
    inserted = [t.subs(slopes) for t in parts]
    points = {s: (fraction_of(v), fraction_of(v)) for s, v in parameters.items()}
    try:
        margin = _enclosed(inserted, {**points, **ranges})
    except UnsupportedError:  # such as a parameter as exponent: its number may have an enclosure
        margin = _enclosed([t.subs(parameters) for t in inserted], {**points, **ranges})
    return Condition(expression=expression, margin=margin, exact=False)


def _parts(expression: sp.Expr) -> list[sp.Expr]:
    """Factored summands of a condition by powers of the stiffness: fewer repeated symbols give tighter enclosures."""
    if k_hat not in expression.free_symbols:
        return list(sp.Add.make_args(expression))
    powers = sp.Poly(expression, k_hat).terms()
    return [sp.factor(c) * k_hat**n for (n,), c in powers if c != 0]


def _enclosed(terms: list[sp.Expr], box: BallBox) -> Interval:
    """Enclosure of Σ terms/Σ |terms| over a box, refined by precision at a point and by subdivision on a range."""
    before = ctx.prec
    try:
        for ctx.prec in _PRECISIONS:
            low, high = _over_pieces(terms, box)
            if low > 0 or high < 0:
                break
            if any(a != b for a, b in box.values()):
                break
    finally:
        ctx.prec = before
    return low, high


def _over_pieces(terms: list[sp.Expr], box: BallBox) -> Interval:
    pieces, done = [dict(box)], list[Interval]()
    while pieces:
        piece = pieces.pop()
        low, high = _ratio(terms, piece)
        wide = {s: (b - a) / abs(a + b) for s, (a, b) in piece.items() if a != b}
        if low > 0 or high < 0 or not wide or len(done) + len(pieces) > _PIECES:
            done.append((low, high))
            continue
        widest = max(wide, key=lambda s: wide[s])
        a, b = piece[widest]
        pieces += [piece | {widest: (a, (a + b) / 2)}, piece | {widest: ((a + b) / 2, b)}]
    return min(low for low, _ in done), max(high for _, high in done)


def _ratio(terms: list[sp.Expr], box: BallBox) -> Interval:
    balls = [enclose(t, box) for t in terms]
    total, size = sum(balls, start=arb(0)), sum((abs(b) for b in balls), start=arb(0))
    whole = (Fraction(-1), Fraction(1))
    if not (total.is_finite() and size.is_finite()):
        return whole
    if not size > 0:
        return (Fraction(0), Fraction(0)) if size.is_zero() else whole
    ratio = total / size
    return max(end_of(ratio.lower()), whole[0]), min(end_of(ratio.upper()), whole[1])


def critical_stiffness(
    fault: Fault, *, pressure: float = 0, loading_rate: float | None = None, inertia: bool = True
) -> float:
    """Critical stiffness k_c [N/m] in closed form: a fault with a smaller stiffness is unstable.

    Zero if no stability condition depends on the stiffness; zero or negative if every stiffness is stable.

    Parameters
    ----------
    fault : Fault
    pressure, loading_rate, inertia
        As in `stability`, but with one pressure [Pa], not a range.

    Raises
    ------
    ParameterError
        As in `stability`.
    UnsupportedError
        If the friction law has several state variables.
    """
    expression = state_plant.critical_stiffness(fault.friction.symbolic(), inertia=inertia)
    return float(_number(expression, fault, pressure, loading_rate)) * fault.mass


def nucleation_length(fault: Fault, *, pressure: float = 0, loading_rate: float | None = None) -> float:
    """Length [m] below which a fault with this friction slides stably; infinite if every length is stable.

    Parameters
    ----------
    fault : Fault
    pressure, loading_rate
        As in `stability`, but with one pressure [Pa], not a range.

    Raises
    ------
    ParameterError
        As in `stability`.
    UnsupportedError
        If the friction law has several state variables.
    """
    expression = state_plant.nucleation_length(fault.friction.symbolic())
    length = float(_number(expression, fault, pressure, loading_rate))
    return length if length > 0 else float("inf")


def _number(expression: sp.Expr, fault: Fault, pressure: float, rate: float | None) -> sp.Expr:
    constant = _interval(pressure, fault)[0]
    values = {
        **plant.plant_values(fault),
        **fault.friction.values(),
        p: sp.Rational(str(constant)),
        state_plant.loading_rate: sp.Rational(str(operating_rate(fault, rate))),
        state_plant.shear_modulus: sp.Rational(str(rational(fault.shear_modulus))),
    }
    return sp.N(sp.sympify(expression).subs(values), 30)


# ----------------------------------------------------------------------
# Derived model of one fault, for display: equations, eigenvalues, and cause of instability.

_DIGITS = 50


class _Forms(NamedTuple):
    """Derivations of a plant; `general` and `jacobian` take state names, `acceleration` and `instability` a law."""

    general: Callable[[tuple[str, ...]], sp.Expr]
    jacobian: Callable[[tuple[str, ...]], sp.Matrix]
    acceleration: Callable[[FrictionLaw], sp.Expr]
    instability: Callable[[FrictionLaw], sp.Basic]
    soft: str  # Text of the cause if the stiffness is below its limit


_AT_REST = _Forms(
    general=lambda names: plant.shifted_acceleration(),
    jacobian=lambda names: plant.jacobian(),
    acceleration=lambda law: plant.with_law(plant.shifted_acceleration(), law),
    instability=lambda law: plant.instability(),
    soft="the spring unloads more slowly than friction weakens with slip",
)
_SLIDING = _Forms(
    general=state_plant.sliding_acceleration,
    jacobian=state_plant.jacobian,
    acceleration=lambda law: state_plant.third_order_rates(law)[1],
    instability=state_plant.instability,
    soft="the stiffness of the spring is below its critical value",
)
_forms_of = by_equilibrium(rest=lambda fault: _AT_REST, sliding=lambda fault: _SLIDING)


@checked_dataclass(frozen=True)
class Model:
    """Equations of one fault, derived from its force balance.

    The equilibrium is at rest for a law without state, and steady sliding at the ``operating_rate`` for a law with
    state (rate and state); the plant then has one more dimension for every state variable.
    """

    fault: Fault

    @property
    def _names(self) -> tuple[str, ...]:
        return self.fault.friction.state_names

    @property
    def _forms(self) -> "_Forms":
        return _forms_of(self.fault)

    @cached_property
    def acceleration(self) -> sp.Expr:
        """x2' of eq. shift [m/s²] with the fault's friction law, in symbols; with state, v' about steady sliding."""
        return self._forms.acceleration(self.fault.friction.symbolic())

    @cached_property
    def error_dynamics(self) -> ErrorDynamics:
        """β and h of eq. esystem3, in symbols; with state, slip is relative to steady sliding at v_∞."""
        return state_plant.error_dynamics(self._names)

    @cached_property
    def jacobian(self) -> sp.Matrix:
        """Jacobian at the origin (ERRATA 1), or in steady sliding, in symbols."""
        return self._forms.jacobian(self._names)

    @cached_property
    def instability(self) -> sp.Basic:
        """Condition for an unstable origin (ERRATA 2) or unstable steady sliding (Routh–Hurwitz), in symbols."""
        return self._forms.instability(self.fault.friction.symbolic())

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
        """Whether the fault is proved unstable without control, in exact or ball arithmetic; False if undecided."""
        return self.stability.outcome is Stability.UNSTABLE

    @cached_property
    def reasons(self) -> tuple[str, ...]:
        """Texts of the instability conditions that are met, with the values of both sides [1/s² or 1/s]."""
        if not self.unstable:
            return ()
        templates = {
            plant.k_hat: self._forms.soft + ": stiffness {} < {} 1/s²",
            plant.eta_hat: "damping is weaker than the rate weakening of friction: {} < {} 1/s",
        }
        other = "a Routh–Hurwitz condition for stability fails: {} < {}"
        conditions = self.instability.args if isinstance(self.instability, sp.Or) else (self.instability,)
        sides = [(c, [sp.N(side.subs(self.values), _DIGITS) for side in c.args]) for c in conditions]
        return tuple(
            templates.get(c.args[0], other).format(*(f"{float(side):.4g}" for side in (low, high)))
            for c, (low, high) in sides
            if low < high
        )

    @cached_property
    def eigenvalues(self) -> tuple[complex, ...]:
        """Eigenvalues [1/s] of the uncontrolled fault at zero pressure, largest real part first."""
        values = self.values | {state_plant.effective_stress: self.values[plant.sigma]}
        coefficients = [c.subs(values) for c in state_plant.characteristic(self._names)]
        with mpmath.workdps(_DIGITS):
            numbers = [mpmath.mpmathify(sp.N(c, _DIGITS)) for c in coefficients]
            roots = mpmath.polyroots(numbers, maxsteps=500, extraprec=400)
        return tuple(sorted((complex(z) for z in roots), key=lambda z: (-z.real, -z.imag)))

    def __str__(self) -> str:
        return f"x1'' = {self.acceleration}\nunstable without control if {self.instability}"

    def _repr_latex_(self) -> str:
        rows = [
            rf"\ddot x_1 &= {sp.latex(self._forms.general(self._names))}",
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
        Model with the SymPy properties ``instability``, ``error_dynamics`` and ``jacobian``; displays as LaTeX.
    """
    return Model(require_fault(fault))
