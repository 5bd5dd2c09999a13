"""Any expression in signed powers as polynomials on sign cells, nested powers lifted to polynomial equalities."""

from collections.abc import Mapping
from functools import reduce
from math import lcm
from typing import Any

import sympy as sp

from quakedesign.errors import CertificateError
from quakedesign.symbolic.cells import Lift, Lifted
from quakedesign.symbolic.normal_form import normal_form
from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower


def lift(expression: sp.Expr, weights: Mapping[sp.Symbol, int] | tuple[sp.Symbol, ...]) -> Lifted:
    """Polynomial form of any expression in signed powers, however nested.

    x_i = s_i·u_i^{r_i}; every ⌈P⌋^a and |P|^a of a sum P becomes t·w^{na} and w^{na} with t·w^n = P, where n is the
    degree of a homogeneous P if that makes all its powers whole, else their common denominator; ⌈P⌋⁰ alone becomes t
    with t·P ≥ 0. All such powers of one P share one w.

    Parameters
    ----------
    expression : Expr
        In the states and parameters; parameters may stand under any power.
    weights : mapping of Symbol to int, or tuple of Symbol
        r_i of every state; given only the states, the least weights that make all their powers whole.

    Returns
    -------
    Lifted

    Raises
    ------
    CertificateError
        When a power of a state does not become whole, is negative, or a part is no sum of products of powers.
    """
    source = normal_form(expression)
    states = tuple(weights)
    chosen = dict(weights) if isinstance(weights, Mapping) else least_weights(source, states)
    names = {x: (sp.Symbol(f"s_{x}", real=True), sp.Symbol(f"u_{x}", nonnegative=True)) for x in states}
    work = _Lifting(chosen, names, _exponents(source, states))
    polynomial = _reduced(work.of(source), work.signs())
    new = {one.variable for one in work.lifts.values()} | work.signs() | {u for _, u in names.values()}
    if taken := {s.name for s in source.free_symbols} & {s.name for s in new if s is not None}:
        raise CertificateError(
            f"the names {', '.join(sorted(taken))} are those of cell variables. Rename these symbols."
        )
    return Lifted(source=source, weights=chosen, states=names, lifts=tuple(work.lifts.values()), expression=polynomial)


def least_weights(expression: sp.Expr, states: tuple[sp.Symbol, ...]) -> dict[sp.Symbol, int]:
    """Least common denominators of the powers of every state, so that x_i = s_i·u_i^{r_i} makes them whole."""
    source, weights = normal_form(expression), dict.fromkeys(states, 1)
    for power in source.atoms(SignedPower, AbsolutePower):
        base, exponent = power.args
        if base in weights and exponent.is_Rational:
            weights[base] = lcm(weights[base], int(exponent.q))
    return weights


def is_zero_on_cells(expression: sp.Expr, states: tuple[sp.Symbol, ...]) -> bool:
    """Whether an expression vanishes identically, by reduction modulo the lifts; stronger than `is_identity`.

    False does not mean that it differs from zero.
    """
    lifted = lift(expression, states)
    rules = {lift.variable: lift for lift in lifted.lifts if lift.variable is not None}
    current = lifted.expression
    for variable, one in reversed(rules.items()):
        divisor = variable**one.power - one.sign * one.polynomial
        current = sp.rem(sp.expand(current), sp.expand(divisor), variable)
    signs = {s for s, _ in lifted.states.values()} | {one.sign for one in lifted.lifts}
    return bool(_reduced(current, signs) == 0)


def _exponents(source: sp.Expr, states: tuple[sp.Symbol, ...]) -> dict[sp.Expr, set[sp.Rational]]:
    """Exponents with which every sum P occurs inside a power."""
    exponents = dict[sp.Expr, set[sp.Rational]]()
    for power in sp.preorder_traversal(source):
        if (_is_power(power) or _is_root(power)) and power.has(*states) and power.args[0] not in states:
            exponents.setdefault(power.args[0], set()).add(power.args[1])
    return exponents


class _Lifting:
    """Walk over one expression, collecting the lifts, inner ones first."""

    def __init__(self, weights: Mapping[Any, Any], names: Mapping[Any, Any], exponents: Mapping[Any, Any]) -> None:
        self.weights, self.names, self.exponents = weights, names, exponents
        self.lifts: dict[sp.Expr, Lift] = {}

    def signs(self) -> set[sp.Symbol]:
        return {s for s, _ in self.names.values()} | {one.sign for one in self.lifts.values()}

    def of(self, e: sp.Expr) -> sp.Expr:
        """Polynomial in cell variables and signs."""
        if not e.has(*self.names):
            return e
        if e in self.names:
            s, u = self.names[e]
            return s * u ** self.weights[e]
        if _is_power(e) or _is_root(e):
            return self._power(e)
        if e.is_Add or e.is_Mul or (e.is_Pow and e.exp.is_Integer and e.exp > 0):
            return e.func(*(self.of(a) for a in e.args))
        raise CertificateError(f"{e} is not a sum of products of signed powers. Polynomials on cells need those.")

    def _power(self, e: sp.Expr) -> sp.Expr:
        base, exponent = e.args
        odd = isinstance(e, SignedPower)
        if base in self.names:
            s, u = self.names[base]
            return (s if odd else 1) * u ** _whole(exponent * self.weights[base], e)
        lifted = self._lift(base)
        if lifted.variable is None:
            return lifted.sign
        return (lifted.sign if odd else 1) * lifted.variable ** _whole(exponent * lifted.power, e)

    def _lift(self, argument: sp.Expr) -> Lift:
        if argument not in self.lifts:
            polynomial = _reduced(self.of(argument), self.signs())
            n = self._root(polynomial, self.exponents[argument])
            i = len(self.lifts) + 1
            self.lifts[argument] = Lift(
                variable=sp.Symbol(f"w_{i}", nonnegative=True) if n else None,
                sign=sp.Symbol(f"t_{i}", real=True),
                argument=argument,
                polynomial=polynomial,
                power=n,
            )
        return self.lifts[argument]

    def _root(self, polynomial: sp.Expr, exponents: set[sp.Rational]) -> int:
        """n in t·w^n = P: the degree of P where that keeps w of weight 1, else the common denominator."""
        if exponents == {sp.Integer(0)}:
            return 0
        if not all(a.is_Rational for a in exponents):
            raise CertificateError(f"the exponents {exponents} must be rational numbers to be lifted.")
        common = reduce(lcm, (int(a.q) for a in exponents), 1)
        variables = [v for _, v in self.names.values()] + [one.variable for one in self.lifts.values() if one.variable]
        degrees = {sum(powers) for powers in sp.Poly(polynomial, *variables).monoms()}
        weight_one = all(one.power in (0, _degree(one, variables)) for one in self.lifts.values())
        return degrees.pop() if weight_one and len(degrees) == 1 and max(degrees) % common == 0 else common


def _is_power(e: sp.Expr) -> bool:
    return isinstance(e, SignedPower | AbsolutePower)


def _is_root(e: sp.Expr) -> bool:
    """Whether it is an ordinary power of a sum that is known to be positive."""
    return e.is_Pow and e.base.is_Add and bool(e.base.is_positive) and not e.exp.is_Integer


def _degree(one: Lift, variables: list[sp.Symbol]) -> int:
    return int(sp.Poly(one.polynomial, *variables).total_degree())


def _whole(exponent: sp.Expr, e: sp.Expr) -> int:
    if not (exponent.is_Integer and exponent >= 0):
        raise CertificateError(
            f"{e} becomes the power {exponent} on a cell, which must be a whole number, not negative. "
            "Choose other weights, or multiply by the power that is missing."
        )
    return int(exponent)


def _reduced(polynomial: sp.Expr, signs: set[sp.Symbol]) -> sp.Expr:
    """Expand with s² = 1 for every sign."""
    expanded = sp.expand(polynomial)
    return sp.expand(expanded.replace(lambda e: e.is_Pow and e.base in signs, lambda e: e.base ** (e.exp % 2)))
