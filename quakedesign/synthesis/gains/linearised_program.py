"""One set of gains and its neighbourhood as polynomials, affine in the coefficients of V and in changes of the gains.

Floating point throughout: for a search, which proves nothing.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

from quakedesign.certificates import Loop
from quakedesign.certificates.obligations import Obligation, power_sum
from quakedesign.certificates.witnesses import statement_of
from quakedesign.sos.solve.joint import Demand, JointProgram
from quakedesign.symbolic.candidates import signed_monomials
from quakedesign.symbolic.terms import Term
from quakedesign.synthesis.lyapunov.balancing import exponents_of, lifted_scale, normal
from quakedesign.synthesis.lyapunov.gain_forms import Kin, float_rows
from quakedesign.synthesis.lyapunov.parametric_forms import Row, values_of
from quakedesign.synthesis.lyapunov.search import sum_of

Form = dict[tuple[int, ...], Any]
"""Polynomial with floats."""
_GRID = 1 << 40


@dataclass(frozen=True, slots=True, kw_only=True)
class Pace:
    """A rate κ to prove, by −w^{m−n}V̇ ≥ κ((n/m)V + (1 − n/m)w^m), which is linear in V and implies V̇ ≤ −κV^{n/m}.

    By Young's inequality V^{n/m} ≤ (n/m)V/w^{m−n} + (1 − n/m)w^n for every w > 0, an equality at w = V^{1/m}; an error
    ε of w costs a share of order ε².

    Attributes
    ----------
    rate : float
        κ > 0.
    degrees : (int, int)
        m and n, of V and V̇.
    forms : mapping of str to polynomial
        w on every cell of the states, by its signs: linear with coefficients > 0.
    """

    rate: float
    degrees: tuple[int, int]
    forms: Mapping[str, Form]


@dataclass(frozen=True, slots=True, kw_only=True)
class Neighbourhood:
    """Demands on a_j and on shares of given changes of the gains.

    Attributes
    ----------
    monomials, sizes
        V = Σ a_j·monomial_j/size_j.
    program : JointProgram
        For the demands.
    demands : tuple of Demand
        Parts: those of a_j, then those of the changes, with V as it is now.
    fixed : tuple of Polynomial
        Parts without a decision.
    """

    monomials: tuple[Term, ...]
    sizes: tuple[Fraction, ...]
    program: JointProgram
    demands: tuple[Demand, ...]
    fixed: tuple[Form, ...]

    def function(self, decision: Sequence[float]) -> tuple[Term, ...]:
        """V of a decision, to 2^−40 in the scaled variables."""
        return sum_of(self.monomials, self.sizes, decision[: len(self.monomials)], _GRID)


def neighbourhood(
    loop: Loop,
    degree: int,
    scale: tuple[Fraction, ...],
    *,
    pace: Pace | None = None,
    lyapunov: tuple[Term, ...] = (),
    changed: Sequence[Loop] = (),
) -> Neighbourhood:
    """Demands V > 0 and V̇ < 0 (or the faster decrease of a pace) around one set of gains.

    Parameters
    ----------
    loop : Loop
    degree : int
        Of V.
    scale : tuple of Fraction
        Of the variables.
    pace : Pace, optional
    lyapunov : tuple of Term
        V as it is now, which the changes act on.
    changed : sequence of Loop
        The loop with one gain changed each; its difference to `loop` is one part, exact where the field is affine in
        the gain. Conditions on cells are kept as they are, so that a search must look again at the gains it finds.
    """
    monomials = signed_monomials(loop.states, degree, loop.domain)
    sizes = tuple(Fraction(_power(scale, exponents_of(term, loop.states))) for term in monomials)
    kin = Kin(loop, degree)
    now = {(t.parameters, t.factors): float(t.coefficient) for t in lyapunov}
    present = [now.get((t.parameters, t.factors), 0.0) for t in monomials]
    values = values_of(loop)
    others = [values_of(other) for other in changed]
    demands, fixed = [], []
    for row, template, whole in _templates(kin, scale, pace is not None):
        parts = [_faster(row, j, values, pace, 1 / float(size)) for j, size in enumerate(sizes)]
        moves = [_moved(row, present, values, other, pace) for other in others]
        rest = _rest(row, pace)
        grown = [{e: c * float(_power(whole, e)) for e, c in p.items()} for p in (*parts, *moves, rest)]
        size = max((abs(c) for p in grown[:-1] for c in p.values()), default=1.0)
        *grown, rest = [{e: c / size for e, c in p.items()} for p in grown]
        power = sum(next(iter(template.polynomial)))
        margin = power_sum(len(loop.states), power, len(whole))
        demands.append(Demand(template=template, parts=grown, margin=margin))
        fixed.append(rest)
    program = _program(kin, scale, pace is not None, len(changed))
    return Neighbourhood(monomials=monomials, sizes=sizes, program=program, demands=tuple(demands), fixed=tuple(fixed))


def _power(base: Sequence[Any], exponents: Sequence[int]) -> Any:
    return math.prod(b**e for b, e in zip(base, exponents, strict=True) if e)


def _columns(row: Row, j: int | None, values: Mapping[str, float], weights: Sequence[float] = ()) -> tuple[Form, Form]:
    """V and −V̇ of one monomial, or of all with weights."""
    columns: tuple[Form, Form] = ({}, {})
    for total, parts in zip(columns, (row.function, row.fall), strict=True):
        for k, e, names, c in parts:
            if j is None or k == j:
                value = c * (weights[k] if j is None else 1.0) * math.prod(values[n] for n in names)
                total[e] = total.get(e, 0.0) + value
    return columns


def _faster(
    row: Row, j: int | None, values: Mapping[str, float], pace: Pace | None, factor: float, weights: Any = ()
) -> Form:
    """Part of a row that V decides: V, −V̇, or −w^{m−n}V̇ − κ(n/m)V."""
    function, fall = _columns(row, j, values, weights)
    if not row.fall:
        form = function
    elif pace is None:
        form = fall
    else:
        m, n = pace.degrees
        size = len(row.fall[0][1])
        form = fall
        for _ in range(m - n):
            form = _times(form, _wide(pace.forms[row.cell], size))
        for e, c in _wide(function, size).items():
            form[e] = form.get(e, 0.0) - pace.rate * n / m * c
    return {e: c * factor for e, c in form.items()}


def _moved(row: Row, present: Sequence[float], values: Any, other: Any, pace: Pace | None) -> Form:
    """What changed numbers add to a row for V as it is."""
    before = _faster(row, None, values, pace, 1.0, present)
    after = _faster(row, None, other, pace, 1.0, present)
    return {e: after.get(e, 0.0) - before.get(e, 0.0) for e in {**before, **after}}


def _rest(row: Row, pace: Pace | None) -> Form:
    """Part of a row without V: −κ(1 − n/m)w^m."""
    if pace is None or not row.fall:
        return {}
    m, n = pace.degrees
    form = _wide(pace.forms[row.cell], len(row.fall[0][1]))
    found = form
    for _ in range(m - 1):
        found = _times(found, form)
    return {e: -pace.rate * (m - n) / m * c for e, c in found.items()}


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
def _templates(kin: Kin, scale: tuple[Fraction, ...], paced: bool) -> Any:
    """Every row with its set and monomials in scaled variables, and the scale of all of these."""
    templates = []
    loop = kin.loop
    for row in float_rows(kin):
        whole = lifted_scale(row.equalities, scale)
        parts = row.fall or row.function
        degree = sum(parts[0][1])
        support = dict.fromkeys(e for _, e, _, _ in parts)
        if row.fall and paced:
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


def _raised(support: Any, unit: Form, times: int) -> Any:
    """Monomials of a product with a linear form to a power."""
    form = dict.fromkeys(support, 1.0)
    for _ in range(times):
        form = _times(form, unit)
    return form


@lru_cache(maxsize=32)
def _program(kin: Kin, scale: tuple[Fraction, ...], paced: bool, changes: int) -> JointProgram:
    loop, degree = kin.loop, kin.structure.degree
    count = len(signed_monomials(loop.states, degree, loop.domain)) + changes
    return JointProgram(
        [Demand(template=t, parts=[{}] * count, margin={}) for _, t, _ in _templates(kin, scale, paced)]
    )
