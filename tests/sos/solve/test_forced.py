"""Programs in which a requirement forces decisions; every expected equation is derived by hand."""

from fractions import Fraction

import numpy as np
import pytest
import sympy as sp

from quakedesign import sos

x, y, v = sp.symbols("x y v")


def program(*requirements, variables=("x", "y"), decisions=("a", "b"), **sets):
    asked = sos.Program(variables, decisions)
    for requirement in requirements:
        asked.require(requirement, **sets)
    return asked


def ansatz(terms, field):
    """V = Σ c_i·term_i with V − (x² + v²)/10 and −V̇ to be sums of squares."""
    names = [f"c{i}" for i in range(len(terms))]
    V = sum(sp.Symbol(n) * m for n, m in zip(names, terms, strict=True))
    rate = sp.diff(V, x) * field[0] + sp.diff(V, v) * field[1]
    return program(V - (x**2 + v**2) / 10, -rate, variables=("x", "v"), decisions=names).solve()


def test_a_decision_that_must_vanish_leaves_the_solution_of_the_others():
    field, terms = (v, -v - x - x**3), [x**2, x * v, v**2, x**4]
    without, along = ansatz(terms, field), ansatz([*terms, v**4], field)
    assert along.values == without.values | {"c4": 0}
    # −V̇ has (2·c2 − 4·c3)·x³·v and 4·c4·x³·v³, but neither x⁶ nor v⁶ nor x²·v²: no product of two of its terms' halves
    own, more = (
        "requirement 2: no certificate contains " + end for end in ("x^3*v, so c2 = 2*c3", "x^3*v^3, so c4 = 0")
    )
    assert without.forced == (own,)
    assert set(along.forced) == {own, more}
    assert all(answer.check() for answer in along.answers)


def test_equations_are_repeated_on_the_smaller_basis():
    # without a constant y is in no product; then y² is gone, with it x·y
    found = program("x^2 + a*y + a*y^2 + b*x*y").solve()
    assert found.values == {"a": 0, "b": 0}
    assert [sentence.split(" contains ")[1] for sentence in found.forced] == ["y, so a = 0", "x*y, so b = 0"]


def test_equations_that_contradict_each_other_name_their_monomials():
    found = program("(1 - a)*x^3 + a*y + x^2 + y^2").solve()
    assert not found
    assert "x^3, so a = 1; " in found.reason
    assert "contains y, but its coefficient is 1; hence the requirements" in found.reason


def test_a_square_whose_coefficient_is_negative_is_named():
    found = program("-x^2 + a*x + b*y + y^2").solve()
    assert not found
    assert "x, so a = 0" in found.reason
    assert "only squares contain x^2, but its coefficient is -1" in found.reason


@pytest.mark.parametrize("seed", range(40))
def test_decisions_that_have_squares_satisfy_every_forced_equation(seed):
    # p(d) = Σ g²+ (x − 1)·h² + Σ_j (d_j − known_j)·p_j is in the cone for d = known
    random = np.random.default_rng(seed)
    terms = [sp.Integer(1), x, y, x * y, x**2, y**2, x**2 * y, x * y**2, x**3]
    known = [sp.Rational(int(n), 3) for n in random.integers(-3, 4, 4)]
    squares = [
        sum(int(c) * m for c, m in zip(random.integers(-1, 2, 2), random.choice(terms, 2), strict=True)) for _ in "12"
    ]
    weight, on = (x - 1, ("x >= 1",)) if seed % 2 else (sp.Integer(1), ())
    names = sp.symbols("d:4")
    free = sum((d - k) * random.choice(terms) * random.choice(terms) for d, k in zip(names, known, strict=True))
    asked = program(
        sp.expand(squares[0] ** 2 + weight * squares[1] ** 2 + free), decisions=list(map(str, names)), on=on
    )
    asked.problem()
    forced, values = asked._forced, [Fraction(int(k.p), int(k.q)) for k in known]
    assert not forced.contradiction
    assert forced.refuted() == ""
    assert forced.completed(values) == values


def test_no_solution_says_that_the_optimum_is_unbounded():
    asked = program("x^2 + 1")
    asked.maximize("a")
    assert "unbounded" in asked.solve().reason


def test_infeasible_requirements_are_not_said_to_be_refuted():
    # two conditions on a, neither impossible alone: a floating-point answer only
    found = program("a - 2", "1 - a").solve()
    assert not found
    assert "infeasible in floating point" in found.reason


def test_opposite_inequalities_are_an_equation():
    assert program("a - 1/3", "1/3 - a").solve().values["a"] == Fraction(1, 3)


def test_an_irrational_zero_for_all_decisions_is_one_of_the_derivative():
    # p(±√2) = 0, hence p'(±√2) = 4b ± 2√2·a = 0, hence a = b = 0
    asked = program("(x^2 - 2)^2 + a*(x^2 - 2) + b*(x^3 - 2*x)", variables=("x",))
    asked.maximize("b")
    assert asked.solve().values == {"a": 0, "b": 0}


def test_a_tangent_half_plane_leaves_one_point():
    # x²·(a·x² + b·x + 1) ≥ 0 means b² ≤ 4a; with b ≥ 1 + a only (1 − a)² ≤ 0, so a = 1 and b = 2
    assert program("a*x^4 + b*x^3 + x^2", "b - a - 1", variables=("x",)).solve().values == {"a": 1, "b": 2}


@pytest.mark.parametrize("on", [(), ("x == 0", "y == 0")])
def test_a_cone_without_squares(on):
    found = program("a*x + b*y", on=on).solve()
    assert found.answers[0].check()
    if not on:
        assert found.values == {"a": 0, "b": 0}


def test_global_lyapunov_function_of_the_stiff_duffing_oscillator():
    found = sos.stability({"x": "v", "v": "-v - x - 5/2*x^3"})
    assert found.verdict == "proved"
    assert found.check()
    V = sum(sp.Rational(c.numerator, c.denominator) * x**i * v**j for (i, j), c in found.lyapunov.items())
    rate = sp.diff(V, x) * v + sp.diff(V, v) * (-v - x - sp.Rational(5, 2) * x**3)
    points = np.random.default_rng(1).standard_normal((2, 2000)) * np.logspace(-3, 3, 2000)
    assert (sp.lambdify((x, v), V)(*points) > 0).all()
    assert (sp.lambdify((x, v), rate)(*points) < 0).all()


def test_barrier_between_a_disc_of_starts_and_an_unsafe_disc():
    powers = [(i, j) for i in range(5) for j in range(5 - i)]
    names = [f"c{i}{j}" for i, j in powers]
    B = sum(sp.Symbol(n) * x**i * y**j for n, (i, j) in zip(names, powers, strict=True))
    asked = sos.Program(["x", "y"], names)
    asked.require(B - sp.Rational(1, 1000), on=["4/25 - (x + 1)^2 - (y + 1)^2 >= 0"])
    asked.require(-B, on=["1/4 - (x - 3/2)^2 - y^2 >= 0"])
    asked.require(-(sp.diff(B, x) * y + sp.diff(B, y) * (-x + x**3 / 3 - y)))
    found = asked.solve()
    B = B.subs({sp.Symbol(n): sp.Rational(c.numerator, c.denominator) for n, c in found.values.items()})
    # B does not grow near an equilibrium only where its gradient vanishes
    equilibria = [(0, 0), (sp.sqrt(3), 0), (-sp.sqrt(3), 0)]
    assert all(sp.diff(B, s).subs({x: p, y: q}) == 0 for s in (x, y) for p, q in equilibria)
    turn, radius = np.meshgrid(np.linspace(0, 2 * np.pi, 200), np.linspace(0, 1, 20))
    value = sp.lambdify((x, y), B)
    assert value(-1 + 0.4 * radius * np.cos(turn), -1 + 0.4 * radius * np.sin(turn)).min() > 0
    assert value(1.5 + 0.5 * radius * np.cos(turn), 0.5 * radius * np.sin(turn)).max() <= 0
