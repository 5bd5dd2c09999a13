"""Joint improvement of gains and Lyapunov function by path-following.

Bilinear inequalities are linearised about the current gains and V (Hassibi, How and Boyd, American Control Conference
1999). The module contains the linearised programme, the decay rate as a convex programme, the scaling exponents of the
gains, state and objective of the search, and the trust region. All results are in floating point, without proof.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
import sympy as sp
from scipy.optimize import nnls

from quakedesign.errors import CertificateError, ParameterError
from quakedesign.exact import fraction_of
from quakedesign.laws import Subject
from quakedesign.lyapunov.exact.certificate import Certificate
from quakedesign.lyapunov.exact.claim import Loop, root_enclosure
from quakedesign.lyapunov.exact.loop_expressions import unit_ranges
from quakedesign.lyapunov.exact.obligations import Obligation, Obligations, obligation_degree, power_sum, statement_of
from quakedesign.lyapunov.search.lyapunov_search import (
    balance,
    exponents_of,
    find_certificate,
    lifted_scale,
    normal,
    scaled,
    sum_of,
)
from quakedesign.lyapunov.search.parametric_forms import FormRow, StructureKey, float_rows, values_of
from quakedesign.sos import Polynomial, Statement
from quakedesign.sos.solve.joint import DecisionBounds, Demand, JointProgram, joint_program
from quakedesign.symbolic.term_expressions import signed_monomials
from quakedesign.symbolic.terms import Term

# ----------------------------------------------------------------------
# Polynomials of V and −V̇ near one set of gains, affine in the coefficients of V and in changes of the gains.
#
# All numbers are floating point, for a search without proof.

Form = dict[tuple[int, ...], Any]
"""Polynomial with floats."""
Values = Mapping[str, float]
Template = tuple[FormRow, Statement, tuple[Fraction, ...]]
_GRID = 1 << 40


@dataclass(frozen=True, slots=True, kw_only=True)
class RequiredRate:
    """Required rate κ, by −w^{m−n}V̇ ≥ κ((n/m)V + (1 − n/m)w^m), which is linear in V and implies V̇ ≤ −κV^{n/m}.

    By Young's inequality V^{n/m} ≤ (n/m)V/w^{m−n} + (1 − n/m)w^n for every w > 0, with equality at w = V^{1/m}. A
    relative error ε of w causes a relative loss of order ε².
    """

    rate: float  # κ > 0
    degrees: tuple[int, int]  # m and n, of V and V̇
    forms: Mapping[str, Form]  # w on every sign cell of the states, by name: linear with coefficients > 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Neighbourhood:
    """Constraints on the coefficients a_j of V and on the fractions x_k of given changes of the gains."""

    # monomials, sizes: V = Σ a_j·monomial_j/size_j
    monomials: tuple[Term, ...]
    sizes: tuple[Fraction, ...]
    program: JointProgram  # For the demands
    demands: tuple[Demand, ...]  # Constraints, with one part per a_j, then one per change, for the current V
    fixed: tuple[Form, ...]  # Constant parts

    def function(self, decision: Sequence[float]) -> tuple[Term, ...]:
        """V of a decision, rounded to multiples of 2^−40 in the scaled variables."""
        return sum_of(self.monomials, self.sizes, decision[: len(self.monomials)], _GRID)


def neighbourhood(
    loop: Loop,
    degree: int,
    scale: tuple[Fraction, ...],
    *,
    required: RequiredRate | None = None,
    lyapunov: tuple[Term, ...] = (),
    changed: Sequence[Loop] = (),
) -> Neighbourhood:
    """Constraints V > 0 and V̇ < 0 (or the required rate of decrease), linearised about one set of gains.

    Parameters
    ----------
    loop : Loop
        Loop with the current gains.
    degree : int
        Degree of V.
    scale : tuple of Fraction
        Scale of the variables.
    required : RequiredRate, optional
        Required rate of decrease.
    lyapunov : tuple of Term
        Current V, with which the changes of the gains are linearised.
    changed : sequence of Loop
        Loops with one changed gain each. The difference from `loop` is one part, exact if the field is affine in the
        gain. The conditions of the cells stay those of `loop`, so a search must re-check its resulting gains.
    """
    monomials = signed_monomials(loop.states, degree, loop.domain)
    sizes = tuple(Fraction(_power(scale, exponents_of(term, loop.states))) for term in monomials)
    key = StructureKey(loop, degree)
    now = {(t.parameters, t.factors): float(t.coefficient) for t in lyapunov}
    present = [now.get((t.parameters, t.factors), 0.0) for t in monomials]
    values = values_of(loop)
    others = [values_of(other) for other in changed]
    demands, fixed = [], []
    for row, template, whole in _templates(key, scale, required is not None):
        parts = [_part_in_v(row, j, values, required, 1 / float(size)) for j, size in enumerate(sizes)]
        moves = [_moved(row, present, values, other, required) for other in others]
        rest = _rest(row, required)
        grown = [{e: c * float(_power(whole, e)) for e, c in p.items()} for p in (*parts, *moves, rest)]
        size = max((abs(c) for p in grown[:-1] for c in p.values()), default=1.0)
        *grown, rest = [{e: c / size for e, c in p.items()} for p in grown]
        power = sum(next(iter(template.polynomial)))
        margin = power_sum(len(loop.states), power, len(whole))
        demands.append(Demand(template=template, parts=grown, margin=margin))
        fixed.append(rest)
    program = _program(key, scale, required is not None, len(changed))
    return Neighbourhood(monomials=monomials, sizes=sizes, program=program, demands=tuple(demands), fixed=tuple(fixed))


def _power(base: Sequence[Fraction], exponents: Sequence[int]) -> Fraction | int:
    return math.prod(b**e for b, e in zip(base, exponents, strict=True) if e)


def _columns(row: FormRow, j: int | None, values: Values, weights: Sequence[float] = ()) -> tuple[Form, Form]:
    """V and −V̇ of one monomial, or of all monomials with weights."""
    columns: tuple[Form, Form] = ({}, {})
    for total, parts in zip(columns, (row.function, row.decrease), strict=True):
        for k, e, names, c in parts:
            if j is None or k == j:
                value = c * (weights[k] if j is None else 1.0) * math.prod(values[n] for n in names)
                total[e] = total.get(e, 0.0) + value
    return columns


def _part_in_v(
    row: FormRow,
    j: int | None,
    values: Values,
    required: RequiredRate | None,
    factor: float,
    weights: Sequence[float] = (),
) -> Form:
    """Part of a row that depends on V: V, −V̇, or −w^{m−n}V̇ − κ(n/m)V."""
    function, decrease = _columns(row, j, values, weights)
    if not row.decrease:
        form = function
    elif required is None:
        form = decrease
    else:
        m, n = required.degrees
        size = len(row.decrease[0][1])
        form = decrease
        for _ in range(m - n):
            form = _times(form, _wide(required.forms[row.cell], size))
        for e, c in _wide(function, size).items():
            form[e] = form.get(e, 0.0) - required.rate * n / m * c
    return {e: c * factor for e, c in form.items()}


def _moved(
    row: FormRow, present: Sequence[float], values: Values, other: Values, required: RequiredRate | None
) -> Form:
    """Change of a row at the current V when the values of the loop change."""
    before = _part_in_v(row, None, values, required, 1.0, present)
    after = _part_in_v(row, None, other, required, 1.0, present)
    return {e: after.get(e, 0.0) - before.get(e, 0.0) for e in {**before, **after}}


def _rest(row: FormRow, required: RequiredRate | None) -> Form:
    """Part of a row that does not depend on V: −κ(1 − n/m)w^m."""
    if required is None or not row.decrease:
        return {}
    m, n = required.degrees
    form = _wide(required.forms[row.cell], len(row.decrease[0][1]))
    result = form
    for _ in range(m - 1):
        result = _times(result, form)
    return {e: -required.rate * (m - n) / m * c for e, c in result.items()}


def _wide(form: Form, size: int) -> Form:
    return {(*e, *(0,) * (size - len(e))): c for e, c in form.items()}


def _times(left: Form, right: Form) -> Form:
    product: Form = {}
    for e, c in left.items():
        for f, d in right.items():
            key = tuple(map(sum, zip(e, f, strict=True)))
            product[key] = product.get(key, 0.0) + c * d
    return product


@lru_cache(maxsize=32)
def _templates(key: StructureKey, scale: tuple[Fraction, ...], has_rate: bool) -> tuple[Template, ...]:
    """Every row with its set and monomials in scaled variables, and the scale of all variables."""
    templates = []
    loop = key.loop
    for row in float_rows(key):
        whole = lifted_scale(row.equalities, scale)
        parts = row.decrease or row.function
        degree = sum(parts[0][1])
        support = dict.fromkeys(e for _, e, _, _ in parts)
        if row.decrease and has_rate:
            power, size = sum(row.function[0][1]), len(parts[0][1])
            unit = dict.fromkeys((tuple(int(i == j) for j in range(size)) for i in range(len(loop.states))), 1.0)
            form = dict(unit)
            for _ in range(power - 1):
                form = _times(form, unit)
            support, degree = (
                {**{e: None for e in _raised(support, unit, power - degree)}, **dict.fromkeys(form)},
                power,
            )
        margin = power_sum(len(loop.states), degree, len(whole))
        conditions = (tuple(normal(p, whole) for p in group) for group in (row.equalities, row.inequalities))
        one = Obligation("", dict.fromkeys((*support, *margin), Fraction(1)), *conditions)
        templates.append((row, statement_of(one, loop.domain), whole))
    return tuple(templates)


def _raised(support: Iterable[tuple[int, ...]], unit: Form, times: int) -> Form:
    """Monomials of a product with a linear form to a power."""
    form = dict.fromkeys(support, 1.0)
    for _ in range(times):
        form = _times(form, unit)
    return form


@lru_cache(maxsize=32)
def _program(key: StructureKey, scale: tuple[Fraction, ...], has_rate: bool, changes: int) -> JointProgram:
    loop, degree = key.loop, key.structure.degree
    count = len(signed_monomials(loop.states, degree, loop.domain)) + changes
    return JointProgram(
        [Demand(template=t, parts=[{}] * count, margin={}) for _, t, _ in _templates(key, scale, has_rate)]
    )


# ----------------------------------------------------------------------
# Settling speed from V̇ ≤ −κV^{n/m}, and the linear forms w ≈ V^{1/m} with which the search for κ is convex.

_POINTS, _SEED = 400, 5


def box(loop: Loop, units: Mapping[str, sp.Expr]) -> tuple[float, ...]:
    """Largest u_i for x_i = ±u_i^{r_i} if all errors satisfy |e_i| ≤ L̄.

    Parameters
    ----------
    units : mapping of str to Expr
        Error that equals one unit of each state, see `LoopField.units`.
    """
    bound, ranges = loop.uncertain["d"][1], unit_ranges(loop, units)
    return tuple(float(bound / ranges[state][0]) ** (1 / weight) for state, weight in loop.states.items())


def on_box(lyapunov: Sequence[Term], states: Mapping[str, int], sizes: Sequence[float]) -> float:
    """Upper bound on V in a box: Σ |α_j|·|monomial_j| at its far corner."""
    return sum(abs(float(term.coefficient)) * _at(exponents_of(term, states), sizes) for term in lyapunov)


def _at(exponents: Sequence[int], sizes: Sequence[float]) -> float:
    value = 1.0
    for size, e in zip(sizes, exponents, strict=True):
        value *= size**e
    return value


def rounded(lyapunov: Sequence[Term], bits: int, divisor: float = 1.0) -> tuple[Term, ...]:
    """V divided by `divisor`, with coefficients rounded to `bits` significant binary digits."""
    terms = []
    for term in lyapunov:
        value = float(term.coefficient) / divisor
        grid = Fraction(2) ** (bits - math.floor(math.log2(abs(value))))
        terms.append(Term(round(Fraction(value) * grid) / grid, term.parameters, term.factors))
    return tuple(terms)


def degrees_of(obligations: Obligations) -> tuple[int, int]:
    """Degrees m of V and n of V̇."""
    m = obligation_degree([p for _, p in obligations.function()], "V")
    return m, obligation_degree([one.polynomial for _, one in obligations.decrease("")], "V̇")


def required_rate(loop: Loop, lyapunov: tuple[Term, ...], speed: float, power: int) -> RequiredRate:
    """Rate with which V ≤ 1 of degree m = `power` settles within T = 1/speed: κ = speed·m/(m−n), for n < m.

    w is fitted on every cell to the root V^{1/m} of the given `lyapunov`, whose degree may differ from `power`.
    """
    obligations = Obligations(loop, lyapunov)
    m, n = degrees_of(obligations)
    forms = {cell.name: _form(obligations.potential(cell.signs), m) for cell in obligations.sign_cells()}
    return RequiredRate(rate=speed * power / (m - n), degrees=(power, power + n - m), forms=forms)


def least_margins(loop: Loop, lyapunov: tuple[Term, ...], scale: Sequence[Fraction]) -> tuple[float, float]:
    """Largest t with V ≥ tΣu_i^m, and largest t with −V̇ ≥ tΣu_i^n, as computed by the conic solver without proof."""
    obligations = Obligations(loop, lyapunov)
    function = [Obligation(name, p) for name, p in obligations.function()]
    decrease = [one for _, one in obligations.decrease("")]
    positive, falling = (
        min(_margin(one, loop, scale) for one in {one.key: one for one in part}.values())
        for part in (function, decrease)
    )
    return positive, falling


def _margin(one: Obligation, loop: Loop, scale: Sequence[Fraction]) -> float:
    whole = lifted_scale(one.equalities, scale)
    moved = scaled(one.polynomial, whole)
    size = max(map(abs, moved.values()))
    power = obligation_degree([one.polynomial], "a form")
    margin = power_sum(len(loop.states), power, len(whole))
    conditions = (tuple(scaled(p, whole) for p in group) for group in (one.equalities, one.inequalities))
    support = Obligation("", dict.fromkeys((*moved, *margin), Fraction(1)), *conditions)
    parts = [{e: c / size for e, c in moved.items()}]
    demand = Demand(template=statement_of(support, loop.domain), parts=parts, margin=margin)
    proposal = joint_program([demand]).solve([demand])
    return 0.0 if proposal is None else max(0.0, proposal.margin) * float(size * min(1 / r**power for r in scale))


def fastest(loop: Loop, lyapunov: tuple[Term, ...]) -> float:
    """Smallest −V̇/V^{n/m} over sampled points, an upper estimate of the largest κ."""
    obligations = Obligations(loop, lyapunov)
    m = obligation_degree([p for _, p in obligations.function()], "V")
    least = [np.inf]
    for cell, one in obligations.decrease(""):
        potential = obligations.potential(cell.signs)
        points = _points(potential, m)
        values = np.maximum(_values(potential, points), 1e-300)
        whole, inside = _lifted(points, one)
        rates = _values(one.polynomial, whole) / values ** (obligation_degree([one.polynomial], "V̇") / m)
        least.append(float(rates[inside].min(initial=np.inf)))
    return min(least)


def _lifted(points: np.ndarray, one: Obligation) -> tuple[np.ndarray, np.ndarray]:
    """Points extended by the variables of nested powers, and a mask of the points in the cell."""
    inside = np.full(len(points), True)
    for equality in one.equalities:
        position = points.shape[1]
        power = max(e[position] for e in equality)
        zero = np.zeros((len(points), max(len(e) for e in equality) - position))
        (sign,) = (float(c) for e, c in equality.items() if e[position])
        value = -sign * _values(equality, np.hstack([points, zero]))
        inside &= value >= 0
        points = np.hstack([points, np.maximum(value, 0)[:, None] ** (1 / power)])
    for inequality in one.inequalities:
        inside &= _values(inequality, points) >= 0
    return points, inside


def _form(potential: Polynomial, m: int) -> dict[tuple[int, ...], float]:
    """Linear form with coefficients > 0 near the m-th root of a form, by least squares of relative errors."""
    points = _points(potential, m)
    roots = np.maximum(_values(potential, points), 1e-300) ** (1 / m)
    coefficients, _ = nnls(points / roots[:, None], np.ones(len(points)))
    least = 1e-3 * coefficients.max()
    size = len(coefficients)
    return {tuple(int(i == j) for j in range(size)): max(float(c), least) for i, c in enumerate(coefficients)}


def _points(potential: Polynomial, m: int) -> np.ndarray:
    """Points in the directions of a cell (k × n), each variable in the unit for which V is 1 on its axis."""
    size = len(next(iter(potential)))
    corners = [abs(float(potential.get(tuple(m * (i == j) for j in range(size)), 0))) for i in range(size)]
    units = np.array([c ** (-1 / m) if c > 0 else 1.0 for c in corners])
    rng = np.random.default_rng(_SEED)
    return np.asarray(rng.dirichlet(np.full(size, 0.5), _POINTS) * units)


def _values(polynomial: Polynomial, points: np.ndarray) -> np.ndarray:
    exponents = np.array(list(polynomial), dtype=float)
    coefficients = np.array([float(c) for c in polynomial.values()])
    return np.asarray(np.prod(points[:, None, :] ** exponents[None, :, :], axis=2) @ coefficients)


# ----------------------------------------------------------------------
# Scaling of the gains with the uncertain parameters: exponents that the terms of the loop determine.


def scaling_exponents(loop: Loop, sizes: Mapping[str, int]) -> dict[str, Fraction]:
    """Exponents p and q with which gains k → s^p·k and states x → s^q·x compensate scaled uncertain parameters.

    Every term of a rate must scale like its state, and all terms of a nested argument alike. With d → s·d this is the
    λ-scaling of a sliding mode (⅔, ½, 1, 1 for the 2-CTA), so that k/L̄^p is a set of gains for L̄ = 1.

    Parameters
    ----------
    loop : Loop
        Only its structure is used.
    sizes : mapping of str to int
        Exponent of s in every scaled uncertain parameter, such as ``{"d": 1}``.

    Returns
    -------
    dict of str to Fraction
        Exponent of every gain and every state.

    Raises
    ------
    ParameterError
        When the terms do not determine the exponents.
    """
    names = (*loop.gains, *loop.states, *loop.lifts)
    unknown = {name: sp.Dummy(name) for name in names}
    fixed = {name: sp.Integer(sizes.get(name, 0)) for name in (*loop.uncertain, *loop.constants)}
    fixed |= {root: unknown[of] / 2 for root, (of, _) in loop.roots.items()}

    def size(term: Term) -> sp.Expr:
        powers = [unknown[name] * sp.Rational(e.numerator, e.denominator) for name, e, _ in term.factors]
        return sum([*({**unknown, **fixed}[p] for p in term.parameters), *powers], start=sp.Integer(0))

    parts = {**loop.field, **loop.lifts}
    equations = [size(term) - unknown[name] for name, terms in parts.items() for term in terms]
    solution = next(iter(sp.linsolve(equations, *unknown.values())), ())
    if not solution or not all(v.is_Rational for v in solution):
        raise ParameterError(
            f"the terms of {loop.law} must determine how its gains scale. Received {solution or 'a contradiction'}. "
            "Remove gains that have no effect on the loop."
        )
    exponents = {name: fraction_of(v) for name, v in zip(unknown, solution, strict=True)}
    return {name: exponents[name] for name in (*loop.gains, *loop.states)}


def scaled_norm(loop: Loop, exponents: Mapping[str, Fraction]) -> float:
    """Norm ‖(k_i/L̄^{p_i})‖₂ of a loop's gains, invariant under λ-scaling; L̄ is the upper end of d."""
    bound = float(loop.uncertain["d"][1])
    return float(sum((float(k) / bound ** float(exponents[name])) ** 2 for name, k in loop.gains.items()) ** 0.5)


# ----------------------------------------------------------------------
# Setting of a search for gains, its states, and its objective.

MARGIN, FAINT = 1e-6, 1e-9  # least accepted margins of a search; of its initial state and of given gains
_ROOM = 1e-3  # relative distance of clipped gains from the bound on their norm


@dataclass(frozen=True, slots=True, kw_only=True)
class PathSetting:
    """Settings of a search, which stay constant during it."""

    objective: "Objective"
    exponents: Mapping[str, Fraction]  # Exponents of gains and states, see `scaling_exponents`
    degree: int  # Degree of V
    units: Mapping[str, sp.Expr] = field(default_factory=dict)  # See `LoopField.units`
    least: float = MARGIN  # Least accepted margin; well above the accuracy of the solver


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """Gains with a V whose margin is positive in floating point.

    Attributes
    ----------
    loop : Loop
        Closed loop with the ranges that the level requires.
    level : float
        Level of the objective.
    lyapunov : tuple of Term
        V.
    margin : float
        Margin of V in the scaled programme.
    """

    loop: Loop
    level: float
    lyapunov: tuple[Term, ...]
    margin: float


@dataclass(frozen=True, kw_only=True)
class Objective(ABC):
    """Objective of a search, which ranks gains by a level."""

    name: ClassVar[str]
    unit: ClassVar[str]
    meaning: ClassVar[str]  # The objective in words
    larger: ClassVar[bool] = True  # Whether a larger level is better
    bounded: ClassVar[bool] = True  # Whether the norm of the gains is bounded
    has_rate: ClassVar[bool] = False  # Whether a level requires a rate of decrease

    bound: float | None = None  # Largest ‖k_i/L̄^{p_i}‖₂ allowed

    def better(self, level: float, other: float) -> bool:
        """Whether a level is better than another one."""
        return level > other if self.larger else level < other

    def improved(self, level: float, share: float) -> float:
        """Level improved by a relative share."""
        return level * (1 + share if self.larger else 1 - share)

    def at(self, loop: Loop, level: float) -> Loop:
        """Loop with the ranges that a level requires."""
        return loop

    def speed(self, level: float) -> float | None:
        """Settling speed 1/T [1/s] that a level requires, see `required_rate`; None without one."""
        return None

    def norm_bound(self, level: float) -> float | None:
        """Bound on the norm of the gains."""
        return self.bound

    def clipped(self, gains: Mapping[str, float], loop: Loop, exponents: Mapping[str, Fraction]) -> dict[str, float]:
        """Gains scaled down to the bound on their norm if they exceed it."""
        scale = float(loop.uncertain["d"][1])
        norm = sum((k / scale ** float(exponents[name])) ** 2 for name, k in gains.items()) ** 0.5
        factor = 1.0 if self.bound is None else min(1.0, self.bound * (1 - _ROOM) / norm)
        return {name: k * factor for name, k in gains.items()}

    def reached(self, level: float, loop: Loop, exponents: Mapping[str, Fraction]) -> float:
        """Level attained by the gains of `loop` after a step with the target `level`."""
        return level

    @abstractmethod
    def start(self, setting: PathSetting, loop: Loop) -> State | None:
        """Initial state at given gains; None if no V is found."""

    def proved(self, setting: PathSetting, state: State, subject: Subject) -> Certificate | None:
        """Exact certificate for the gains of a state; None if none is found."""
        return find_certificate(state.loop, setting.degree, subject=subject)

    def given(self, loop: Loop, degrees: Sequence[int], subject: Subject) -> Certificate | None:
        """Certificate for fixed gains without a climb; None if there is none."""
        return None

    @abstractmethod
    def figure(self, certificate: Certificate, setting: PathSetting) -> float:
        """Value of the objective that a certificate proves."""


# ----------------------------------------------------------------------
# Joint improvement of gains and V by steps of linearised inequalities, each re-checked at its resulting gains.
#
# At gains k0 with V0 the products of changes of V and of k are omitted, so that one programme with the largest margin
# changes both V and k (the path-following of Hassibi, How and Boyd, American Control Conference 1999). A step is
# accepted only if a programme with the resulting gains fixed also has a positive margin. Nothing here is proved.

_ROUNDS = 100  # largest number of steps


@dataclass(frozen=True, slots=True, kw_only=True)
class TrustRegion:
    """Step sizes for which the linearisation is trusted, as shares: relative improvements of the level."""

    # First share. The omitted terms are of second order, about (`gains`·share)², which is 0.3 of the linear terms here
    initial: float = 0.1
    largest: float = 0.35  # Share at which the omitted terms are as large as the linear terms
    # Share below which a centring step is made: one to ten units of the fourth digit, to which gains are rounded
    least: float = 1e-3
    # grow, shrink: Factor of the share after a successful step, and its divisor after a failed one; increases are slow
    # and decreases fast, since a failed programme takes as long as a successful one
    grow: float = 1.5
    shrink: float = 3.0
    # Largest relative change of a gain per share, as several gains must change more than the level
    gains: float = 3.0
    again: float = 0.03  # Share after centring; smaller than `initial`, since larger shares have failed
    # Improvement of the level since the last centring that justifies another one: three times `least`
    worthwhile: float = 3e-3
    # Factor by which centring must increase the margin; otherwise no step is possible and the search ends
    margin: float = 1.2
    under_root: float = 0.5  # Largest relative change of a gain under a root, so that the root stays real

    def longer(self, share: float) -> float:
        """Share after a successful step."""
        return min(self.largest, self.grow * share)


TRUST = TrustRegion()


def with_gains(loop: Loop, gains: Mapping[str, Fraction]) -> Loop:
    """Loop with other gains and their roots."""
    parameters = {**loop.constants, **gains}
    roots = {name: (of, root_enclosure(parameters[of])) for name, (of, _) in loop.roots.items()}
    return replace(loop, gains=dict(gains), roots=roots)


def short(loop: Loop, gains: Mapping[str, float]) -> dict[str, Fraction]:
    """Gains rounded to four digits; a gain under a root is the square of such a number, so its root is exact."""
    rooted = {of for of, _ in loop.roots.values()}
    return {name: _digits(math.sqrt(max(k, 0.0))) ** 2 if name in rooted else _digits(k) for name, k in gains.items()}


def _digits(number: float) -> Fraction:
    return Fraction(f"{number:.4g}")


def climb(setting: PathSetting, state: State, *, free: bool = True, until: float | None = None) -> list[State]:
    """States of improving level, beginning with the given one.

    Parameters
    ----------
    setting : PathSetting
        Settings of the search.
    state : State
        Initial state.
    free : bool
        Whether the gains may change.
    until : float, optional
        Level at which the climb stops.
    """
    states, share, centred = [state], TRUST.initial, None
    objective = setting.objective
    for _ in range(_ROUNDS):
        if until is not None and not objective.better(until, state.level):
            break
        if share < TRUST.least:
            worthwhile = centred is None or objective.better(state.level, objective.improved(centred, TRUST.worthwhile))
            better = _step(setting, state, 0.0) if free and worthwhile else None
            if better is None or better.margin < TRUST.margin * state.margin:
                break
            state, share, centred = better, TRUST.again, better.level
            continue
        better = _step(setting, state, share) if free else _level(setting, state, share)
        if better is None:
            share /= TRUST.shrink
            continue
        state, share = better, TRUST.longer(share)
        if objective.better(state.level, states[-1].level):
            states.append(state)
    return states


def _level(setting: PathSetting, state: State, share: float) -> State | None:
    """State with the same gains at a better level; None if none is found."""
    level = setting.objective.improved(state.level, share)
    level = setting.objective.reached(level, state.loop, setting.exponents)
    return state_at(setting, state.loop, level, state.lyapunov, state.level)


def _step(setting: PathSetting, state: State, share: float) -> State | None:
    """State with a level better by a relative share; for share 0, the state of largest margin at a similar level."""
    objective = setting.objective
    level = objective.improved(state.level, share)
    loop = objective.at(state.loop, level)
    changes = _changes(setting, loop, TRUST.gains * (share or TRUST.again))
    base = [float(k) for k in loop.gains.values()]
    changed = [with_gains(loop, g) for g in changes.values()]
    sizes = [float(changes[name][name] - loop.gains[name]) for name in changes]
    neighbourhood = _neighbourhood(setting, loop, level, state.lyapunov, changed)
    if neighbourhood is None:
        return None
    limits = _limits(setting, loop, level, neighbourhood, dict(zip(changes, sizes, strict=True)))
    proposal = neighbourhood.program.solve(neighbourhood.demands, neighbourhood.fixed, limits)
    if proposal is None:
        return None
    chosen = dict(zip(loop.gains, base, strict=True))
    first = len(neighbourhood.monomials)
    for name, size, x in zip(changes, sizes, proposal.decision[first : first + len(sizes)], strict=True):
        chosen[name] += size * x
    moved = with_gains(loop, short(loop, objective.clipped(chosen, loop, setting.exponents)))
    beyond = state.level if share else None
    return state_at(setting, moved, objective.reached(level, moved, setting.exponents), state.lyapunov, beyond)


def _changes(setting: PathSetting, loop: Loop, trust: float) -> dict[str, dict[str, Fraction]]:
    """Gains with one gain increased, for every gain that may change; zero gains do not change."""
    norm = scaled_norm(loop, setting.exponents)
    bound = float(loop.uncertain["d"][1])
    rooted = {of for of, _ in loop.roots.values()}
    changes = {}
    for name, k in loop.gains.items():
        unit = bound ** float(setting.exponents[name])
        step = trust * math.sqrt(abs(float(k)) * norm * unit)
        step = min(step, TRUST.under_root * float(k)) if name in rooted else step
        larger = short(loop, {name: float(k) + step})
        if k and larger[name] != k:
            changes[name] = {**loop.gains, **larger}
    return changes


def _neighbourhood(
    setting: PathSetting, loop: Loop, level: float, lyapunov: tuple[Term, ...], changed: Sequence[Loop] = ()
) -> Neighbourhood | None:
    speed = setting.objective.speed(level)
    try:
        required = required_rate(loop, lyapunov, speed, setting.degree) if speed else None
        return neighbourhood(loop, setting.degree, balance(loop), required=required, lyapunov=lyapunov, changed=changed)
    except (CertificateError, ValueError):
        return None


def _limits(
    setting: PathSetting, loop: Loop, level: float, neighbourhood: Neighbourhood, sizes: Mapping[str, float]
) -> DecisionBounds:
    """Bounds: |a_j| and fractions |x_k| at most one, and the norm of the gains within the objective's bound."""
    count = len(neighbourhood.monomials)
    bound = setting.objective.norm_bound(level)
    rows, bounds = [], []
    if bound is not None and sizes:
        norm = scaled_norm(loop, setting.exponents)
        unit = float(loop.uncertain["d"][1])
        slopes = [float(loop.gains[n]) / unit ** (2 * float(setting.exponents[n])) / norm * s for n, s in sizes.items()]
        rows.append([*[0.0] * count, *slopes])
        bounds.append(bound - norm)
    return DecisionBounds(
        radii=[1.0] * (count + len(sizes)), rows=rows, bounds=bounds, shares=_shares(setting, loop, neighbourhood)
    )


def _shares(setting: PathSetting, loop: Loop, neighbourhood: Neighbourhood) -> list[float]:
    """Bounds on the terms of V in the box per unit of a_j, which ensure V ≤ 1 there; empty without a rate."""
    if not setting.objective.has_rate:
        return []
    sizes = box(loop, setting.units)
    shares = [on_box((term,), loop.states, sizes) for term in neighbourhood.monomials]
    return [share / float(size) for size, share in zip(neighbourhood.sizes, shares, strict=True)]


def state_at(
    setting: PathSetting,
    loop: Loop,
    level: float,
    lyapunov: tuple[Term, ...] = (),
    beyond: float | None = None,
    least: float | None = None,
) -> State | None:
    """State at fixed gains and level with the largest margin; None if none exists or it is not better than `beyond`.

    Parameters
    ----------
    lyapunov : tuple of Term
        V of a nearby state, needed only for a required rate.
    least : float, optional
        Least accepted margin; by default that of the setting.
    """
    objective = setting.objective
    if beyond is not None and not objective.better(level, beyond):
        return None
    loop = objective.at(loop, level)
    neighbourhood = _neighbourhood(setting, loop, level, lyapunov)
    if neighbourhood is None:
        return None
    limits = _limits(setting, loop, level, neighbourhood, {})
    proposal = neighbourhood.program.solve(neighbourhood.demands, neighbourhood.fixed, limits)
    if proposal is None or not proposal.margin > (setting.least if least is None else least):
        return None
    function = neighbourhood.function(proposal.decision)
    return State(loop=loop, level=level, lyapunov=function, margin=proposal.margin)
