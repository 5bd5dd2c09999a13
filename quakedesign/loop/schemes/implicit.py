"""Implicit and semi-implicit schemes: backward Euler of the law on the double integrator.

The implicit step is a scalar set-valued equation for the slip-rate error at the end of the step. It has exactly one
solution if the pressure does not increase with the slip-rate error, and is solved without a tolerance. The
semi-implicit scheme takes magnitudes at the start of the step and signs at its end.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial, reduce
from typing import ClassVar

import casadi as ca
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.loop import discrete_law
from quakedesign.loop.discrete_law import DiscreteLaw, Values
from quakedesign.loop.schemes.base import Decision, Sampled
from quakedesign.symbolic import AbsolutePower, SignedPower
from quakedesign.symbolic.casadi_printer import to_casadi

# ----------------------------------------------------------------------
# One implicit step: a scalar set-valued equation for the slip-rate error at the end, solved without a tolerance.
#
# With e2⁺ = w and e1⁺ = e1 + T_s·w (backward Euler on the double integrator e1' = e2, e2' = B0·p) the law turns into
#
#     0 ∈ F(w) = w − e2 − T_s·B0·p(e1 + T_s·w, w, ξ⁺(w)),
#
# where every ⌈·⌋⁰ is the set-valued sign. If p never increases with w (`direction` shows it from the structure of the
# expression: sums and non-negative multiples of odd increasing powers of increasing arguments), then F(w) − w is
# monotone, F is strongly monotone, and there is exactly one solution.
#
# - At a jump of a sign, where its argument vanishes, the two one-sided values of F show on which side the solution
#   lies, or that it lies at the jump; then a linear equation gives the selection from [−1, 1]. All signs then follow.
# - With the signs fixed, w = g(w) with g continuous and non-increasing. The solution lies between 0 and g(0): if
#   g(0) ≥ 0, then w − g(w) is −g(0) ≤ 0 at w = 0, and g(0) − g(g(0)) ≥ 0 at w = g(0), because g(g(0)) ≤ g(0); likewise
#   with the signs reversed. Reducing this bracket to a quarter 27 times leaves |g(0)|·2⁻⁵⁴; three independent
#   evaluations take little longer than one. At a jump the search is skipped, since a loop in sliding mode, which stays
#   at a jump, would spend most of its time on it.

ROUNDS = 27
ROUNDS_PER_LOOP = 3  # rounds per loop body in C: unrolling all of them would take half a second to compile
end_slip, end_rate = sp.symbols("end_slip end_rate", real=True)

InclusionValues = dict[sp.Symbol, ca.SX]


def direction(expression: sp.Expr) -> int | None:
    """1, 0, −1 for an expression non-decreasing, constant, non-increasing in `end_slip` and `end_rate`; else None."""
    if not expression.free_symbols & {end_slip, end_rate}:
        return 0
    if expression in (end_slip, end_rate):
        return 1
    if expression.is_Add or isinstance(expression, sp.Min | sp.Max):
        return _same([direction(part) for part in expression.args])
    if expression.is_Mul:
        moving = [part for part in expression.args if direction(part) != 0]
        fixed = sp.Mul(*(part for part in expression.args if part not in moving))
        way = direction(moving[0])
        if len(moving) > 1 or way is None or not fixed.is_real:
            return None
        return way if fixed.is_nonnegative else -way if fixed.is_nonpositive else None
    if isinstance(expression, SignedPower) and expression.args[1].is_nonnegative:
        return direction(expression.args[0])
    return None


def _same(ways: list[int | None]) -> int | None:
    signs = {way for way in ways if way != 0}
    return signs.pop() if len(signs) == 1 else None if signs else 0


@dataclass(frozen=True)
class Inclusion:
    """0 ∈ end_rate − free − pull(end_slip, end_rate) with end_slip = slip_error + step·end_rate.

    Attributes
    ----------
    free : Expr
        e2 [m/s], the part that does not depend on the end of the step.
    pull : Expr
        T_s·B0·(p − p_f) [m/s], see `backward_euler`; non-increasing in `end_slip` and `end_rate`.
    slip_error, step : Symbol
        e1 [m], T_s [s].

    Raises
    ------
    ParameterError
        When the law is not monotone, or a sign has an argument whose zero cannot be enclosed.
    """

    free: sp.Expr
    pull: sp.Expr
    slip_error: sp.Symbol
    step: sp.Symbol

    def __post_init__(self) -> None:
        if direction(self.pull) not in (0, -1):
            raise ParameterError(
                "an implicit step needs a pressure that never increases with slip and slip rate at the end of the "
                "step. Received one that may increase: change the signs of its gains, or use the scheme explicit."
            )
        for argument in self.arguments:
            self._linear(argument)

    @cached_property
    def arguments(self) -> tuple[sp.Expr, ...]:
        """Arguments of the signs, each increasing in `end_slip` and `end_rate`."""
        signs = (atom for atom in self.pull.atoms(SignedPower) if atom.args[1] == 0)
        return tuple(sorted({_rising(atom.args[0])[0] for atom in signs}, key=sp.default_sort_key))

    @cached_property
    def signs(self) -> tuple[sp.Symbol, ...]:
        """Symbols of the selections of the signs from [−1, 1]."""
        return tuple(sp.Symbol(f"sign_{i}", real=True) for i in range(len(self.arguments)))

    def selected(self, expression: sp.Expr) -> sp.Expr:
        """Expression with the selections in place of the signs."""
        by_argument = dict(zip(self.arguments, self.signs, strict=True))

        def select(base: sp.Expr, exponent: sp.Expr) -> sp.Expr:
            if exponent != 0:
                return SignedPower(base, exponent)
            rising, turn = _rising(base)
            return turn * by_argument[rising]

        return expression.replace(SignedPower, select)

    def solve(self, inputs: InclusionValues) -> InclusionValues:
        """Values (SX) of `end_slip`, `end_rate` and the signs, from those of all other symbols."""
        excess = self.selected(end_rate - self.free - self.pull)
        jumps = [self._jump(argument, inputs) for argument in self.arguments]
        sides, there = [], []
        for number, point in enumerate(jumps):
            low, high = (self._one_sided(excess, inputs, jumps, number, s) for s in (-1.0, 1.0))
            at = ca.logic_and(low <= 0, high >= 0)
            share = -(high + low) / ca.if_else(high > low, high - low, 1)
            there.append((at, point | self._signs(jumps, number, share)))
            sides.append(ca.if_else(high < 0, 1, -1))
        elsewhere = ca.logic_not(reduce(ca.logic_or, (at for at, _ in there), ca.SX(0)))
        smooth = self._smooth(inputs | dict(zip(self.signs, sides, strict=True)), elsewhere)
        return inputs | reduce(lambda other, case: _choose(case[0], case[1], other), reversed(there), smooth)

    def _jump(self, argument: sp.Expr, inputs: InclusionValues) -> InclusionValues:
        """End of the step at which an argument vanishes."""
        if argument == end_slip:
            return {end_slip: 0.0 * inputs[self.slip_error], end_rate: -inputs[self.slip_error] / inputs[self.step]}
        if argument == end_rate:
            return {end_slip: inputs[self.slip_error], end_rate: 0.0 * inputs[self.slip_error]}
        slope = self._linear(argument)
        start = self._value(argument, inputs, 0.0)
        bound = start / to_casadi([slope], inputs)[0]
        return self._ends(inputs, self._quarter(-argument, inputs, -bound))

    def _linear(self, argument: sp.Expr) -> sp.Expr:
        """Lower bound of the slope of an argument: the slope of its linear part."""
        part = argument.subs(end_slip, self.slip_error + self.step * end_rate)
        slope = sp.expand_mul(part).coeff(end_rate)
        if argument not in (end_slip, end_rate) and not slope.is_positive:
            raise ParameterError(
                "every argument of a sign must grow at least linearly with slip or slip rate in an implicit step. "
                f"Received {argument}. Use the scheme explicit."
            )
        return slope

    def _signs(self, jumps: list[InclusionValues], number: int, own: ca.SX | float) -> InclusionValues:
        """Selections at a jump; signs with a coincident jump get the same selection."""
        here = jumps[number][end_rate]
        ways = [ca.sign(here - point[end_rate]) for point in jumps]
        signs = [own if i == number else ca.if_else(way == 0, own, way) for i, way in enumerate(ways)]
        return dict(zip(self.signs, signs, strict=True))

    def _one_sided(
        self, excess: sp.Expr, inputs: InclusionValues, jumps: list[InclusionValues], number: int, side: float
    ) -> ca.SX:
        """F on one side of a jump."""
        return to_casadi([excess], inputs | jumps[number] | self._signs(jumps, number, side))[0]

    def _smooth(self, inputs: InclusionValues, needed: ca.SX) -> InclusionValues:
        """Solution with all signs fixed; any number where it is not needed."""
        target = self.free + self.selected(self.pull)
        moved = (end_slip, self.slip_error + self.step * end_rate)
        straight = sp.Poly(sp.expand(target.subs(*moved)), end_rate) if _is_straight(target) else None
        if straight is None:
            end = _where(needed, self._dependencies(target, inputs), partial(self._free_end, target))
        else:
            end = to_casadi([straight.coeff_monomial(1) / (1 - straight.coeff_monomial(end_rate))], inputs)[0]
        return {sign: inputs[sign] for sign in self.signs} | self._ends(inputs, end)

    def _free_end(self, target: sp.Expr, inputs: InclusionValues) -> ca.SX:
        """Zero of target − w."""
        return self._quarter(target - end_rate, inputs, self._value(target, inputs, 0.0))

    def _quarter(self, falling: sp.Expr, inputs: InclusionValues, width: ca.SX) -> ca.SX:
        """Zero of a function that decreases in `end_rate`, between 0 and `width`."""
        test, inputs = _sign_only(falling), self._dependencies(falling, inputs)
        before = ca.SX.sym("before", 2 + len(inputs))
        low, length, *values = ca.vertsplit(before)
        by_symbol = dict(zip(inputs, values, strict=True))
        for _ in range(ROUNDS_PER_LOOP):
            length = length / 4
            passed = sum(self._value(test, by_symbol, low + share * length) >= 0 for share in (1, 2, 3))
            low = low + passed * length
        rounds = ca.Function("rounds", [before], [ca.vertcat(low, length, *values)])
        start = ca.vertcat(ca.fmin(width, 0), ca.fabs(width), *inputs.values())
        return rounds.fold(ROUNDS // ROUNDS_PER_LOOP, {"never_inline": True})(start)[0]

    def _dependencies(self, expression: sp.Expr, inputs: InclusionValues) -> InclusionValues:
        """Inputs on which an expression depends; for CasADi a call depends on all of its arguments."""
        names = expression.free_symbols | {self.slip_error, self.step}
        return {symbol: value for symbol, value in inputs.items() if symbol in names}

    def _value(self, expression: sp.Expr, inputs: InclusionValues, end: ca.SX | float) -> ca.SX:
        return to_casadi([expression], inputs | self._ends(inputs, end))[0]

    def _ends(self, inputs: InclusionValues, end: ca.SX | float) -> InclusionValues:
        return {end_rate: ca.SX(end), end_slip: inputs[self.slip_error] + inputs[self.step] * end}


def _choose(at: ca.SX, case: InclusionValues, other: InclusionValues) -> InclusionValues:
    return {symbol: ca.if_else(at, case[symbol], other[symbol]) for symbol in other}


def _where(needed: ca.SX, inputs: InclusionValues, solution: Callable[[InclusionValues], ca.SX]) -> ca.SX:
    """Solution (SX) where it is needed, 0 elsewhere."""
    given = ca.SX.sym("given", len(inputs))
    solved = solution(dict(zip(inputs, ca.vertsplit(given), strict=True)))
    return where_needed(ca.Function("solved", [given], [solved]))(needed, ca.vertcat(*inputs.values()))


def where_needed(function: ca.Function) -> ca.Function:
    """CasADi Function (needed, vector) → value of `function` if needed, else 0: a call runs only one of two branches.

    Parameters
    ----------
    function : casadi.Function
        Function of scalar operations, one vector in and one out, named ``solved``.
    """
    vector, needed = ca.SX.sym("given", function.size1_in(0)), ca.MX.sym("needed")
    left_out = ca.Function("left_out", [vector], [ca.SX.zeros(function.size1_out(0))])
    given = ca.MX.sym("given", function.size1_in(0))
    either = ca.Function.if_else("either", function, left_out)(needed, given)
    return ca.Function("where_needed", [needed, given], [either], {"never_inline": True})


def _rising(argument: sp.Expr) -> tuple[sp.Expr, int]:
    """Argument without its constant factor, negated if it decreases; and its direction, 1 or −1."""
    way = direction(argument)
    if not way:
        raise ParameterError(
            "every argument of a sign must increase with slip and slip rate in an implicit step. "
            f"Received {argument}. Use the scheme explicit."
        )
    moving = argument.as_independent(end_slip, end_rate, as_Add=False)[1]
    return (direction(moving) or 1) * moving, way


def _is_straight(expression: sp.Expr) -> bool:
    """Whether an expression is a polynomial of degree at most 1 in `end_slip` and `end_rate`."""
    return all(
        not atom.free_symbols & {end_slip, end_rate} for atom in expression.atoms(SignedPower, AbsolutePower)
    ) and bool(expression.is_polynomial(end_slip, end_rate))


def _sign_only(expression: sp.Expr) -> sp.Expr:
    """Expression with the same sign, without the first cube root: a + c⌈x⌋^⅓ has the sign of a³ + c³x."""
    expanded = sp.expand_mul(expression)
    for term in sp.Add.make_args(expanded):
        factor, root = term.as_independent(end_slip, end_rate, as_Add=False)
        if isinstance(root, SignedPower) and root.args[1] == sp.Rational(1, 3):
            return (expanded - term) ** 3 + factor**3 * root.args[0]
    return expanded


# ----------------------------------------------------------------------
# A law at the end of the step, for the double integrator that the controller assumes.

ERRORS = {discrete_law.slip_error: end_slip, discrete_law.rate_error: end_rate}
AHEAD = {
    discrete_law.slip: end_slip + discrete_law.next_reference,
    discrete_law.rate: end_rate + discrete_law.next_reference_rate,
}


def backward_euler(law: DiscreteLaw) -> tuple[sp.Expr, ...]:
    """Pull [m/s], feed-forward [Pa] and ξ⁺ in `end_slip`, `end_rate` and the symbols of `discrete_law`.

    The pull is T_s·B0·(p − p_f). The feed-forward p_f, the pressure at zero errors and integral states, balances forces
    of the plant that the double integrator lacks. Slip and slip rate themselves are taken at the end of the step if the
    pressure then never increases with them, otherwise at its start. Each ξ' uses the preceding ξ at the end of the
    step, and the others at its start.
    """
    pressure, ends = _at_end(law, ERRORS | AHEAD)
    if direction(pressure) != -1:
        pressure, ends = _at_end(law, ERRORS)
    feed_forward = pressure.xreplace(dict.fromkeys((end_slip, end_rate, *law.integrals), sp.Integer(0)))
    pull = discrete_law.step * discrete_law.authority * (pressure - feed_forward)
    return sp.expand_mul(pull), feed_forward, *map(sp.expand_mul, ends)


def inclusion(pull: sp.Expr) -> Inclusion:
    """The implicit step of a pull from `backward_euler`."""
    return Inclusion(discrete_law.rate_error, pull, discrete_law.slip_error, discrete_law.step)


def _at_end(law: DiscreteLaw, place: dict[sp.Symbol, sp.Expr]) -> tuple[sp.Expr, list[sp.Expr]]:
    """Pressure and ξ⁺ with the signals at the end of the step."""
    ends: dict[sp.Symbol, sp.Expr] = {}
    for symbol, rate in zip(law.integrals, law.rates, strict=True):
        ends[symbol] = symbol + discrete_law.step * rate.xreplace(place | ends)
    return law.pressure.xreplace(place | ends), list(ends.values())


@dataclass(frozen=True, kw_only=True)
class Implicit(Sampled):
    """Evaluates the law at the end of the step, as the double integrator e1' = e2, e2' = B0·p predicts it.

    The equation and its solution are those of `inclusion`. There is no chatter: once the solution lies at the jump e1⁺
    = 0 the pressure is −(e2 + e1/T_s)/(T_s·B0), and a disturbance d [m/s²], which the double integrator does not model,
    leaves e1 ≈ T_s²d and e2 ≈ T_s²d'. Acary and Brogliato (2010), Syst. Control Lett. 59, 284; Brogliato, Polyakov and
    Efimov (2020), IEEE Trans. Autom. Control 65, 3707.
    """

    name: ClassVar[str] = "implicit"

    @staticmethod
    def derive(law: DiscreteLaw) -> tuple[sp.Expr, ...]:
        """See `backward_euler`."""
        return backward_euler(law)

    @classmethod
    def decide(cls, expressions: tuple[sp.Expr, ...], law: DiscreteLaw, values: Values, own: list[ca.SX]) -> Decision:
        """See `Decided.decide`."""
        pull, feed_forward, *ends = expressions
        problem = inclusion(pull)
        solved = problem.solve(values)
        gain = solved[discrete_law.step] * solved[discrete_law.authority]
        pressure = (solved[end_rate] - solved[discrete_law.rate_error]) / gain
        ahead, *after = discrete_law.values((feed_forward, *map(problem.selected, ends)), solved)
        return Decision(pressure + ahead, after, [])


# ----------------------------------------------------------------------
# Magnitudes of the law at the start of the step, signs at its end.

_START = {symbol: sp.Dummy(symbol.name, real=True) for symbol in (discrete_law.slip_error, discrete_law.rate_error)}


@dataclass(frozen=True, kw_only=True)
class SemiImplicit(Implicit):
    """Splits every ⌈x⌋^a into |x|^a at the start and the set-valued sign of x at the end of the step.

    The homogeneous semi-implicit Euler method of Michel, Ghanes, Plestan, Aoustin and Barbot (2021), Automatica 129,
    109582 (a differentiator there), applied to the law. The inclusion is that of `Implicit` with jumps only.
    """

    name: ClassVar[str] = "semi-implicit"

    @staticmethod
    def derive(law: DiscreteLaw) -> tuple[sp.Expr, ...]:
        """See `backward_euler`."""
        split = replace(law, pressure=_split(law.pressure), rates=tuple(map(_split, law.rates)))
        back = {dummy: symbol for symbol, dummy in _START.items()}
        return tuple(part.subs(back) for part in backward_euler(split))


def _split(expression: sp.Expr) -> sp.Expr:
    """Expression with every outermost power split into its size before and its sign after the step."""
    if isinstance(expression, SignedPower) and expression.args[1] != 0:
        base, exponent = expression.args
        return AbsolutePower(base.subs(_START), exponent) * SignedPower(base, 0)
    if expression.is_Add or expression.is_Mul:
        return expression.func(*map(_split, expression.args))
    return expression
