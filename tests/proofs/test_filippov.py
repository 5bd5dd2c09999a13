"""Derivatives along discontinuous fields, sets where signs vanish, changes of coordinates, equations solved."""

import importlib
import itertools
import random
import sys
from pathlib import Path

import mpmath as mp
import pytest
import sympy as sp

from quakedesign.errors import KinkError, ParameterError
from quakedesign.laws import control_law
from quakedesign.symbolic import SignedPower, off_kinks
from quakedesign.symbolic.signed_power import AbsolutePower, normal_form

sys.path.insert(0, str(Path(__file__).parents[2] / "proofs"))
filippov, sets = map(importlib.import_module, ("filippov", "set_valued"))
FilippovField, filippov_derivative = filippov.FilippovField, filippov.filippov_derivative
inverse, lie_derivative = filippov.inverse, filippov.lie_derivative
SetValued, restrict, solve_signed = sets.SetValued, sets.restrict, sets.solve_signed

R = sp.Rational
x, y, z = sp.symbols("x y z", real=True)
a, b, k, L = sp.symbols("a b k L", positive=True)
d = sp.Symbol("d", real=True)
TWISTING = FilippovField(rates={x: y, y: -a * SignedPower(x, 0) - b * SignedPower(y, 0) + d}, intervals={d: (-L, L)})
SUPER_TWISTING = FilippovField(
    rates={x: -a * SignedPower(x, R(1, 2)) + y, y: -b * SignedPower(x, 0) + d}, intervals={d: (-L, L)}
)
NESTED = SignedPower(z + SignedPower(y**3 + SignedPower(x, 2), R(1, 6)), 0)
OWN_LAW = FilippovField(rates={x: y, y: z, z: -k * NESTED}, intervals={})


def signed(v, n):
    return mp.sign(v) * abs(v) ** n if v else mp.mpf(0)


POWERS = [{"SignedPower": signed, "AbsolutePower": lambda v, n: abs(v) ** n}, "mpmath"]


def drawn(seed, size):
    numbers = random.Random(seed)
    return [mp.mpf(numbers.uniform(-2, 2)) for _ in range(size)]


SMOOTH = AbsolutePower(x, R(5, 3)) + x * y + AbsolutePower(y, R(5, 2)) + AbsolutePower(x - z**3, R(4, 3))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("law", [OWN_LAW, "cta", "dia"], ids=["third order", "cta", "dia"])
def test_the_derivative_is_the_slope_along_the_flow(law, seed):
    """Against mpmath's derivative of V(x + t·f(x)) at t = 0, 50 digits."""
    rates = law.rates if isinstance(law, FilippovField) else loop(law).rates
    symbols = sorted(set().union(*(r.free_symbols for r in rates.values())) - set(rates), key=str)
    function = SMOOTH.subs(dict(zip((x, y, z), rates, strict=True)), simultaneous=True)
    exact = lie_derivative(function, rates)
    with mp.workdps(50):
        point, values = drawn(seed, 3), [abs(v) + 1 for v in drawn(seed + 100, len(symbols))]
        V = sp.lambdify([*rates], function, POWERS)
        flow = [sp.lambdify([*rates, *symbols], r, POWERS)(*point, *values) for r in rates.values()]
        expected = mp.diff(lambda t: V(*(p + t * f for p, f in zip(point, flow, strict=True))), 0)
        got = sp.lambdify([*rates, *symbols], exact, POWERS)(*point, *values)
        assert abs(got - expected) < mp.mpf(10) ** -20 * (1 + abs(expected))


def loop(name):
    field = control_law(name).loop_field()
    positive = {g: sp.Symbol(g.name, positive=True) for g in field.gains}
    return FilippovField(rates={s: r.subs(positive) for s, r in field.field.items()})


def test_off_its_switching_surfaces_only_the_disturbance_is_left_to_choose():
    value = filippov_derivative(y**2 / 2, TWISTING)
    assert value.selections == (d,)
    kept = -a * y * SignedPower(x, 0) - b * AbsolutePower(y, 1)
    assert normal_form(value.upper - (kept + L * AbsolutePower(y, 1))) == 0


def test_twisting_energy_has_a_kink_and_is_differentiated_only_when_asked():
    energy = a * AbsolutePower(x, 1) + y**2 / 2
    with pytest.raises(KinkError, match="off_kinks"):
        filippov_derivative(energy, TWISTING)
    with off_kinks():
        value = filippov_derivative(energy, TWISTING)
    # Levant's energy argument: V' = −b|y| + d·y, at most −(b − L)|y|
    assert normal_form(value.expression - (-b * AbsolutePower(y, 1) + d * y)) == 0
    assert normal_form(value.upper + (b - L) * AbsolutePower(y, 1)) == 0
    assert normal_form(value.lower + (b + L) * AbsolutePower(y, 1)) == 0


def test_products_without_a_kink_need_no_permission():
    assert lie_derivative(x * sp.Abs(x), {x: y}) == normal_form(2 * AbsolutePower(x, 1) * y)
    with pytest.raises(KinkError):
        lie_derivative(sp.Abs(x), {x: y})
    for function in (sp.sign(x) * y, sp.sqrt(x**2 + y**2), SignedPower(x + y, R(1, 2)), x ** R(1, 3)):
        with pytest.raises(KinkError):
            lie_derivative(function, {x: y, y: x})
    assert lie_derivative((x**2 + 1) ** R(1, 2), {x: y}) == normal_form(x * y / sp.sqrt(x**2 + 1))


def test_a_sign_that_vanishes_becomes_an_interval():
    V = x**2 / 2 + y**2 / 2
    value = filippov_derivative(V, SUPER_TWISTING, [(x, x)])
    (sigma,) = (s for s in value.selections if s != d)
    assert value.intervals[sigma] == (-1, 1)
    assert normal_form(value.expression - (-b * sigma * y + d * y)) == 0
    assert normal_form(value.upper - (b + L) * AbsolutePower(y, 1)) == 0
    with pytest.raises(KinkError, match="set-valued"):
        _ = value.single


def test_bounds_are_attained_and_never_exceeded():
    s, t = sp.symbols("s t", real=True)
    value = SetValued(expression=3 * x * s - 2 * s * t + t * y, intervals={s: (-1, 1), t: (0, 2)})
    numbers = random.Random(7)
    for _ in range(20):
        at = {x: R(numbers.randint(-9, 9), 4), y: R(numbers.randint(-9, 9), 4)}
        low, high = value.at(at)
        inner = [
            (3 * at[x] * p - 2 * p * q + q * at[y]) for p in (R(-1), R(-1, 3), R(1)) for q in (R(0), R(1, 2), R(2))
        ]
        corners = [3 * at[x] * p - 2 * p * q + q * at[y] for p, q in itertools.product((-1, 1), (0, 2))]
        assert low == min(corners) <= min(inner)
        assert high == max(corners) >= max(inner)
        assert value.upper.subs(at) == high
        assert value.lower.subs(at) == low


def test_asymmetric_intervals_have_exact_ends():
    value = SetValued(expression=x * d + 1, intervals={d: (-1, 3)})
    for number in (-2, 0, 5):
        assert value.upper.subs(x, number) == 1 + max(-number, 3 * number)
        assert value.lower.subs(x, number) == 1 + min(-number, 3 * number)
    assert SetValued(expression=d, intervals={d: (-0.1, 0.3)}).upper == R(3, 10)
    with pytest.raises(ParameterError, match="lower end first"):
        SetValued(expression=d, intervals={d: (L, -L)})


def test_squares_of_a_selection_are_refused():
    value = SetValued(expression=d**2, intervals={d: (-1, 1)})
    with pytest.raises(KinkError, match="not affine"):
        _ = value.upper
    with pytest.raises(KinkError, match="not affine"):
        _ = SetValued(expression=SignedPower(d + x, R(1, 2)), intervals={d: (-1, 1)}).upper


def test_one_sign_in_two_places_is_one_selection():
    both = restrict(SignedPower(x, 0) * y + 2 * SignedPower(x, 0), (x, x))
    assert len(both.selections) == 1
    assert both.upper.subs(y, -2) == 0


def test_different_arguments_that_vanish_together_are_independent():
    value = restrict(SignedPower(x, 0) - SignedPower(x + y, 0), (x, x), (y, y))
    assert len(value.selections) == 2
    assert (value.lower, value.upper) == (-2, 2)


def test_restriction_simplifies_nested_powers():
    surface = (k ** R(3, 2) * x + SignedPower(y, R(3, 2)), x)
    assert restrict(AbsolutePower(x, R(2, 3)), surface).single == normal_form(AbsolutePower(y, 1) / k)
    nested = SignedPower(x + k ** R(-3, 2) * SignedPower(y, R(3, 2)) + z**3, R(1, 3))
    assert restrict(nested, surface).single == z
    assert restrict(nested, surface, (y, y), (z - a, z)).single == a
    assert restrict(x, (x - y, x), (2 * x - 2 * y, x)).single == y


def test_restriction_to_what_has_several_branches_is_refused():
    with pytest.raises(ParameterError, match="sign cells"):
        restrict(x, (x + SignedPower(x, R(1, 2)) - y, x))
    with off_kinks(), pytest.raises(KinkError, match="negative power"):
        restrict(lie_derivative(SignedPower(x, R(1, 2)), {x: y}), (x, x))


def test_the_set_at_a_point_has_the_limits_from_all_sides_as_vertices():
    at_origin = TWISTING.at({x: 0, y: 0})
    assert {v[y] for v in at_origin} == {s * a + t * b + u * L for s, t, u in itertools.product((1, -1), repeat=3)}
    (single,) = {v[y] for v in FilippovField(rates=TWISTING.rates).at({x: 1, y: -3, d: 0})}
    assert single == b - a
    assert set(TWISTING.switching) == {x, y}


def test_an_equilibrium_of_the_paper_law_off_the_origin_lies_in_the_hull():
    """2-CTA with k3 = k4: e2 = 0, e3 = k1⌈e1⌋^⅓ is a continuum of Filippov equilibria (ERRATA, end)."""
    field = control_law("cta").loop_field()
    numbers = dict(zip(field.gains, (7, 5, 2, 2), strict=True))
    e1, e2, e3 = field.field
    rates = {
        s: r.subs(numbers).subs({sp.Symbol("d", real=True): 0, sp.Symbol("beta", real=True): 1})
        for s, r in field.field.items()
    }
    vertices = FilippovField(rates=rates).at({e1: 8, e2: 0, e3: 14})
    assert {(v[e1], v[e2]) for v in vertices} == {(0, 0)}
    assert min(v[e3] for v in vertices) <= 0 <= max(v[e3] for v in vertices)


def test_zeros_of_irrational_numbers_are_found_exactly():
    value = SetValued(expression=SignedPower(x**2 - y, 0))
    assert value.at({x: sp.sqrt(2) + sp.sqrt(3), y: 5 + 2 * sp.sqrt(6)}) == (-1, 1)
    assert value.at({x: sp.sqrt(2), y: R(14142136, 10**7) ** 2}) == (-1, -1)


def test_coordinates_are_inverted_and_checked():
    p, q, r = sp.symbols("p q r", real=True)
    forward = {p: x - SignedPower(z / k, 3), q: y, r: z / k}
    back = inverse(forward, (x, y, z))
    assert back == {y: q, z: k * r, x: p + r**3}
    field = OWN_LAW.transformed(forward)
    assert normal_form(field.rates[r] + NESTED.subs(back, simultaneous=True)) == 0
    round_trip = field.transformed({x: back[x], y: back[y], z: back[z]})
    assert all(normal_form(round_trip.rates[s] - rate) == 0 for s, rate in OWN_LAW.rates.items())


def test_coordinates_that_are_not_triangular_are_refused():
    p, q = sp.symbols("p q", real=True)
    with pytest.raises(ParameterError, match="triangular"):
        inverse({p: x + y, q: x - y}, (x, y))
    with pytest.raises(ParameterError):
        inverse({p: x**2, q: y}, (x, y))
    with pytest.raises(KinkError):
        TWISTING.transformed({p: SignedPower(x, R(1, 2)), q: y})


def test_fields_and_sets_are_shown_as_latex():
    assert r"\dot{x}" in TWISTING._repr_latex_()
    assert r"\in" in filippov_derivative(y**2, TWISTING)._repr_latex_()
    assert r"\in" not in SetValued(expression=x)._repr_latex_()


@pytest.mark.parametrize(
    ("condition", "variable"),
    [
        (k ** R(3, 2) * x + SignedPower(y, R(3, 2)), x),
        (k ** R(3, 2) * x + SignedPower(y, R(3, 2)), y),
        (SignedPower(SignedPower(y, R(3, 2)) + k * x, R(1, 3)) - z, y),
        (x**3 - y, x),
        (sp.Eq(2 * y, k), y),
    ],
    ids=str,
)
def test_solutions_satisfy_their_equation(condition, variable):
    left = condition.lhs - condition.rhs if isinstance(condition, sp.Equality) else condition
    solution = solve_signed(condition, variable)
    assert not solution.has(variable)
    assert normal_form(left.subs(variable, solution)) == 0


@pytest.mark.parametrize(
    ("condition", "complaint"),
    [
        (AbsolutePower(x, R(1, 2)) - k, "takes a value twice"),
        (x**2 - k, "takes a value twice"),
        (SignedPower(x, 0) - y, "takes a value twice or jumps"),
        (x + SignedPower(x, R(1, 2)) - y, "occurs in 2"),
        (y - z, "occurs in 0"),
        (y * x - 1, "must not vanish"),
    ],
    ids=str,
)
def test_what_has_no_single_solution_is_refused(condition, complaint):
    with pytest.raises(ParameterError, match=complaint):
        solve_signed(condition, x)
