from dataclasses import replace
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from quakedesign.errors import PolynomialError
from quakedesign.sos.exact import polynomial_text as text
from quakedesign.sos.exact.polynomial_statement import statement
from quakedesign.sos.exact.proofs import full_bases, invariant, parity_classes, reduced_bases


def asked(polynomial, *, on=(), **options):
    names = text.names_in_text(polynomial, *on)
    g = tuple(text.parse_constraint(c, names)[2] for c in on)
    return statement(names, text.parse(polynomial, names)[1], inequalities=g, **options)


def in_hull(point, vertices):
    """Membership in a convex hull by linear programming: another algorithm than the reduction's."""
    A = np.vstack([np.array(vertices, dtype=float).T, np.ones(len(vertices))])
    return linprog(np.zeros(len(vertices)), A_eq=A, b_eq=[*point, 1.0], method="highs").status == 0


def test_motzkin_keeps_the_four_monomials_of_the_literature():
    found = reduced_bases(asked("x^4*y^2 + x^2*y^4 + z^6 - 3*x^2*y^2*z^2"))
    assert set(found[0]) == {(2, 1, 0), (1, 2, 0), (0, 0, 3), (1, 1, 1)}  # Reznick 1989


supports = st.sets(st.tuples(st.integers(0, 3), st.integers(0, 3)), min_size=1, max_size=6)


@settings(max_examples=40)
@given(supports)
def test_basis_lies_in_half_the_newton_polytope(support):
    even = {(2 * a, 2 * b) for a, b in support}
    found = reduced_bases(statement(("x", "y"), dict.fromkeys(even, Fraction(1))))[0]
    assert all(in_hull((2 * a, 2 * b), sorted(even)) for a, b in found)
    assert {(a, b) for a, b in support} <= set(found)


@settings(max_examples=25)
@given(
    st.lists(
        st.dictionaries(st.tuples(st.integers(0, 2), st.integers(0, 2)), st.integers(1, 5), min_size=1),
        min_size=1,
        max_size=3,
    )
)
def test_monomials_of_known_squares_survive(squares):
    total = {}
    for square in squares:
        for a, c in square.items():
            for b, d in square.items():
                key = (a[0] + b[0], a[1] + b[1])
                total[key] = total.get(key, Fraction(0)) + c * d
    found = reduced_bases(statement(("x", "y"), total))[0]
    assert {e for square in squares for e in square} <= set(found)


def test_what_only_a_condition_took_from_goes_after_it():
    """Of x − x² the basis {1} goes with x; only then x·x alone feeds x², so that x goes, where the rest went before."""
    found = statement(
        ("x",), {(4,): Fraction(-1)}, inequalities=({(1,): Fraction(1), (2,): Fraction(-1)},), degree_bound=2
    )
    assert reduced_bases(found) == ((), ())


def test_a_product_beyond_the_degree_has_no_basis():
    quartic = asked("x^4 + 1", on=("1 - x^4 >= 0",))
    assert list(map(len, full_bases(quartic))) == [3, 1]
    assert list(map(len, full_bases(replace(quartic, degree=0)))) == [1, 0]


def test_on_the_orthant_parity_of_the_degree_is_kept():
    found = asked("x^2 + y^2 - x*y", on=("x >= 0", "y >= 0"))
    sizes = dict(zip(found.products, map(len, reduced_bases(found)), strict=True))
    assert sizes == {(): 2, (0,): 0, (1,): 0, (0, 1): 1}


def test_an_equality_keeps_what_it_may_feed():
    free = statement(("x",), {(0,): Fraction(1)}, degree_bound=2)
    tied = statement(("x",), {(0,): Fraction(1)}, equalities=({(2,): Fraction(1), (0,): Fraction(-1)},))
    assert reduced_bases(free)[0] == ((0,),)
    assert reduced_bases(tied)[0] == ((0,), (1,))


def test_sign_symmetry_splits_even_polynomials_completely():
    motzkin = asked("x^4*y^2 + x^2*y^4 + 1 - 3*x^2*y^2")
    classes = parity_classes(motzkin, reduced_bases(motzkin)[0])
    assert sorted(map(len, classes)) == [1, 1, 1, 1]
    assert not invariant(motzkin, (1, 0))
    assert invariant(motzkin, (2, 4))


def test_too_large_a_basis_is_refused_before_it_is_built():
    with pytest.raises(PolynomialError, match="at most 2000 monomials"):
        full_bases(statement(tuple(f"x{i}" for i in range(14)), {(8,) + (0,) * 13: Fraction(1)}))


# ---------------------------------------------------------------- the rule word by word


def reduced_by_definition(found):
    """Drop by the words of the rule, one monomial at a time, with everything counted anew each time."""
    size = len(found.variables)

    def total(*exponents):
        return tuple(map(sum, zip(*exponents, strict=True)))

    kept = set(found.target)
    for h in found.equalities:
        room = found.degree - max(map(sum, h))
        kept |= {total(m, e) for m in product(range(room + 1), repeat=size) if sum(m) <= room for e in h}
    alive = []
    for weight in found.weights:
        half = (found.degree - max(map(sum, weight))) // 2
        alive.append([m for m in product(range(max(half, -1) + 1), repeat=size) if sum(m) <= half])
    while True:
        entries = {}
        for k, (weight, basis) in enumerate(zip(found.weights, alive, strict=True)):
            for (i, b), (j, c), (e, number) in product(enumerate(basis), enumerate(basis), weight.items()):
                entries.setdefault(total(b, c, e), []).append((k, b) if i == j and number > 0 else None)
        gone = next((group for e, group in entries.items() if e not in kept and None not in group), None)
        if gone is None:
            return [set(basis) for basis in alive]
        for k, b in set(gone):
            alive[k].remove(b)


forms = st.dictionaries(
    st.tuples(st.integers(0, 2), st.integers(0, 2)),
    st.sampled_from((-2, -1, 1, 3)).map(Fraction),
    min_size=1,
    max_size=3,
)


@settings(max_examples=60, deadline=None)
@given(forms, st.lists(forms, max_size=2), st.lists(forms, max_size=1), st.booleans(), st.integers(0, 5))
def test_the_bases_are_those_of_the_rule(polynomial, inequalities, equalities, products, bound):
    found = statement(
        ("x", "y"), polynomial, inequalities=tuple(inequalities), equalities=tuple(equalities), products=products,
        degree_bound=bound,
    )  # fmt: skip
    bases = reduced_bases(found)
    assert [set(basis) for basis in bases] == reduced_by_definition(found)
    assert all(len(set(basis)) == len(basis) for basis in bases)


def test_the_largest_bases_that_are_built():
    """C(n + h, n) monomials for the degree 2h: 1891 of 60 variables and degree 4, 2016 of 62; and their squares."""

    def built(size, degree, *on):
        names = tuple(f"x{i}" for i in range(size))
        unit = {(degree,) + (0,) * (size - 1): Fraction(1)}
        return full_bases(statement(names, unit, inequalities=on, products=False))

    assert len(built(60, 4)[0]) == 1891
    with pytest.raises(PolynomialError, match="at most 2000 monomials"):
        built(62, 4)
    with pytest.raises(PolynomialError, match="8000000 pairs"):
        built(
            60,
            4,
            *({(0,) * i + (2,) + (0,) * (59 - i): Fraction(1)} for i in range(60)),
            *({(2,) + (0,) * i + (1,) + (0,) * (58 - i): Fraction(1)} for i in range(59)),
            *({(0,) * 60: Fraction(n)} for n in (1, 2)),
        )
    assert reduced_bases(statement(("x",), {(0,): Fraction(1)}, inequalities=({(3,): Fraction(1)},), degree_bound=2))


def test_what_a_product_of_neighbours_feeds_is_kept():
    """x (1·x) is x^2, so that the x of a square alone stays although x^2 is not in x^3 + 1."""
    assert reduced_bases(asked("x^3 + 1", on=("x >= 0",), degree_bound=3)) == (((0,), (1,)), ((0,), (1,)))
