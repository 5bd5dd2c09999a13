"""Every row of suite.toml is true: proved in rational arithmetic from the stored matrices, without the engine."""

import itertools
import json
import math
import tomllib
from collections import Counter
from fractions import Fraction as F
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from quakedesign.sos.exact.polynomial_text import names_in_text, parse, parse_constraint

HERE = Path(__file__).parent
ROWS = {row["name"]: row for row in tomllib.loads((HERE / "suite.toml").read_text(encoding="utf-8"))["row"]}
PROOFS = json.loads((HERE / "suite_proofs.json").read_text(encoding="utf-8"))


def of(verdict):
    return pytest.mark.parametrize("name", [n for n, row in ROWS.items() if row["verdict"] == verdict])


def times(*polynomials):
    total = polynomials[0]
    for other in polynomials[1:]:
        product = Counter()
        for (e, a), (f, b) in itertools.product(total.items(), other.items()):
            product[tuple(map(sum, zip(e, f, strict=True)))] += a * b
        total = {e: c for e, c in product.items() if c}
    return total


def plus(*polynomials):
    total = Counter()
    for p in polynomials:
        for e, c in p.items():
            total[e] += c
    return {e: c for e, c in total.items() if c}


def at(polynomial, point):
    return sum((c * math.prod(x**k for x, k in zip(point, e, strict=True)) for e, c in polynomial.items()), F(0))


def degree(polynomial):
    return max(map(sum, polynomial), default=0)


def exponents(text):
    return tuple(map(int, text.split()))


def read(row):
    """Variables, polynomial, multiplier, inequalities and equalities of a row."""
    order = variables(row)
    polynomial = parse(row["polynomial"], order)[1]
    multiplier = parse(row.get("multiplier", "1"), order)[1]
    constraints = [parse_constraint(text, order) for text in row.get("on", [])]
    return (
        order,
        polynomial,
        multiplier,
        [g for kind, _, g in constraints if kind == "inequality"],
        [h for kind, _, h in constraints if kind == "equality"],
    )


def variables(row):
    texts = [row["polynomial"], *row.get("on", []), row.get("multiplier", "0"), row.get("denominator", "0")]
    return names_in_text(*texts)


def bound(target, inequalities, equalities):
    """Smallest even degree that holds everything."""
    least = max(map(degree, [target, *inequalities, *equalities]))
    return least + least % 2


def weights(inequalities, size, largest):
    """Products of the constraints that are variables, and every other constraint alone, up to a degree."""
    plain = [i for i, g in enumerate(inequalities) if len(g) == 1 and degree(g) == 1 and min(g.values()) > 0]
    sets = [s for k in range(len(plain) + 1) for s in itertools.combinations(plain, k)]
    sets += [(i,) for i in range(len(inequalities)) if i not in plain]
    found = {s: times({(0,) * size: F(1)}, *(inequalities[i] for i in s)) for s in sets}
    return {s: w for s, w in found.items() if degree(w) <= largest}


def semidefinite(matrix):
    """Whether a symmetric rational matrix is positive semidefinite, by symmetric elimination."""
    rows = [list(row) for row in matrix]
    for i, pivot_row in enumerate(rows):
        pivot = pivot_row[i]
        if pivot < 0 or (pivot == 0 and any(pivot_row[i:])):
            return False
        for row in rows[i + 1 :]:
            if row[i]:
                factor = row[i] / pivot
                row[i:] = [a - factor * b for a, b in zip(row[i:], pivot_row[i:], strict=True)]
    return True


def proved(proof, target, inequalities, equalities):
    """Whether stored Gram matrices show that the target is in the cone at the smallest even degree."""
    size = len(next(iter(target)))
    largest = bound(target, inequalities, equalities)
    allowed = weights(inequalities, size, largest)
    total = {}
    for square in proof["squares"]:
        basis = [exponents(text) for text in square["basis"]]
        entries = iter(map(F, square["gram"]))
        gram = [[F(0)] * len(basis) for _ in basis]
        for i, j in itertools.combinations_with_replacement(range(len(basis)), 2):
            gram[i][j] = gram[j][i] = next(entries)
        weight = allowed[tuple(square["times"])]
        pairs = itertools.product(range(len(basis)), repeat=2)
        terms = plus(*({tuple(map(sum, zip(basis[i], basis[j], strict=True))): gram[i][j]} for i, j in pairs))
        total = plus(total, times(weight, terms))
        if not semidefinite(gram) or degree(weight) + 2 * max(map(sum, basis)) > largest:
            return False
    for h, cofactor in zip(equalities, proof.get("cofactors", []), strict=True):
        q = {exponents(text): F(c) for text, c in cofactor.items()}
        total = plus(total, times(h, q)) if q else total
        if degree(h) + degree(q) > largest:
            return False
    return total == target


def monomials(size, largest):
    return [e for e in itertools.product(range(largest + 1), repeat=size) if sum(e) <= largest]


def reduced_bases(target, allowed, largest):
    """Monomials that squares can have: one whose square nothing can balance or match is dropped, until none is left."""
    size = len(next(iter(target)))
    bases = {s: set(monomials(size, (largest - degree(w)) // 2)) for s, w in allowed.items()}
    while True:
        crossed, squared = set(), {}
        for s, w in allowed.items():
            for e in w:
                for b in bases[s]:
                    own = tuple(2 * x + y for x, y in zip(b, e, strict=True))
                    squared.setdefault(own, []).append((s, b, w[e]))
                pairs = itertools.combinations(bases[s], 2)
                crossed |= {tuple(map(sum, zip(b, c, e, strict=True))) for b, c in pairs}
        dropped = [
            (s, b)
            for own, found in squared.items()
            if own not in target and own not in crossed and all(c > 0 for _, _, c in found)
            for s, b, _ in found
        ]
        if not dropped:
            return bases, crossed | set(squared)
        for s, b in dropped:
            bases[s].discard(b)


def refuted(functional, target, inequalities):
    """Whether no square can give a monomial of the target, or the functional separates it from the cone."""
    size = len(next(iter(target)))
    largest = bound(target, inequalities, [])
    allowed = weights(inequalities, size, largest)
    bases, within_reach = reduced_bases(target, allowed, largest)
    if not set(target) <= within_reach:
        return True
    values = {exponents(text): F(v) for text, v in functional.items()}

    def moments(s):
        for b in bases[s]:
            yield [
                sum(c * values.get(tuple(map(sum, zip(b, d, e, strict=True))), 0) for e, c in allowed[s].items())
                for d in bases[s]
            ]

    negative = sum(c * values.get(e, 0) for e, c in target.items()) < 0
    return negative and all(semidefinite(list(moments(s))) for s in allowed)


def test_the_suite_is_large_named_and_sourced():
    counted = Counter(row["verdict"] for row in ROWS.values())
    listed = tomllib.loads((HERE / "suite.toml").read_text(encoding="utf-8"))["row"]
    assert len(listed) == len(ROWS) >= 250
    assert counted.keys() == {"sos", "not-sos", "negative", "undecided"}
    assert min(counted["sos"], counted["not-sos"], counted["negative"]) >= 30
    assert all(len(row["source"]) > 3 and len(row["reason"]) > 3 for row in ROWS.values())
    known = {"name", "polynomial", "on", "multiplier", "verdict", "point", "denominator", "source", "reason"}
    assert all(row.keys() <= known for row in ROWS.values())
    assert PROOFS.keys() == {name for name, row in ROWS.items() if row["verdict"] in ("sos", "not-sos")}


@of("negative")
def test_the_polynomial_is_negative_at_a_rational_point_of_the_set(name):
    order, polynomial, _, inequalities, equalities = read(ROWS[name])
    point = [F(text) for text in ROWS[name]["point"]]
    assert len(point) == len(order)
    assert at(polynomial, point) < 0
    assert all(at(g, point) >= 0 for g in inequalities)
    assert all(at(h, point) == 0 for h in equalities)


@of("sos")
def test_the_product_is_in_the_cone_by_exact_gram_matrices(name):
    _, polynomial, multiplier, inequalities, equalities = read(ROWS[name])
    target = times(multiplier, polynomial)
    assert not target or proved(PROOFS[name]["sos"], target, inequalities, equalities)


@of("not-sos")
def test_the_product_is_not_in_the_cone_by_an_exact_functional(name):
    _, polynomial, multiplier, inequalities, equalities = read(ROWS[name])
    assert not equalities
    assert refuted(PROOFS[name].get("functional", {}), times(multiplier, polynomial), inequalities)


@of("not-sos")
def test_what_is_not_a_sum_of_squares_is_nonnegative_all_the_same(name):
    order, polynomial, _, inequalities, _ = read(ROWS[name])
    denominator = parse(ROWS[name]["denominator"], order)[1]
    assert denominator
    assert proved(PROOFS[name]["denominator"], denominator, inequalities, [])
    assert proved(PROOFS[name]["nonnegative"], times(denominator, polynomial), inequalities, [])


@pytest.mark.slow
def test_harris_decic_has_thirty_zeros():
    form = symbolic("harris decic")
    mirrors = {X: sp.factor_list(form.subs({Y: X, Z: 1})), Y: sp.factor_list(form.subs({Y: 0, Z: 1}))}
    assert all(power % 2 == 0 or not sp.real_roots(f) for _, fs in mirrors.values() for f, power in fs)
    on_diagonal = {r for f, _ in mirrors[X][1] for r in sp.real_roots(f)}
    on_axis = {r for f, _ in mirrors[Y][1] for r in sp.real_roots(f)}
    points = {
        tuple(sign * c for sign, c in zip(signs, place, strict=True))
        for base in [
            *((r, r, sp.Integer(1)) for r in on_diagonal),
            *((r, sp.Integer(0), sp.Integer(1)) for r in on_axis),
        ]
        for place in itertools.permutations(base)
        for signs in itertools.product((1, -1), repeat=3)
    }
    assert all(
        sp.expand(form.subs(dict(zip((X, Y, Z), point, strict=True)), simultaneous=True)) == 0 for point in points
    )
    directions = {tuple(round(float(c / max(p, key=abs)), 9) + 0.0 for c in p) for p in points}
    lines = {max(d, tuple(0.0 - c for c in d)) for d in directions}
    assert len(lines) == 30


def test_a_changed_entry_of_a_stored_proof_is_noticed():
    _, polynomial, multiplier, _, _ = read(ROWS["motzkin times x^2+y^2"])
    target = times(multiplier, polynomial)
    proof = json.loads(json.dumps(PROOFS["motzkin times x^2+y^2"]["sos"]))
    assert proved(proof, target, [], [])
    proof["squares"][0]["gram"][0] = str(F(proof["squares"][0]["gram"][0]) + F(1, 10**6))
    assert not proved(proof, target, [], [])
    functional = dict(PROOFS["robinson"]["functional"])
    _, polynomial, _, _, _ = read(ROWS["robinson"])
    assert refuted(functional, polynomial, [])
    functional["0 0"] = "1/100000"
    assert not refuted(functional, polynomial, [])


# ------------------------------------------------------------ the rows are what their names say


def symbolic(name):
    row = ROWS[name]
    order, polynomial, _, _, _ = read(row)
    symbols = sp.symbols(order)
    terms = [sp.Rational(c.numerator, c.denominator) * sp.prod([s**k for s, k in zip(symbols, e, strict=True)])
             for e, c in polynomial.items()]  # fmt: skip
    return sp.Add(*terms)


def same(left, right):
    return sp.expand(left - right) == 0


A, B, C, D, E = sp.symbols("a b c d e")
X, Y, Z, W = sp.symbols("x y z w")


@pytest.mark.parametrize(
    ("form", "affine"),
    [("motzkin form", "motzkin"), ("robinson form", "robinson"), ("schmuedgen form", "schmuedgen"),
     ("stengle", "stengle dehomogenised"), ("hurwitz quartic", "hurwitz quartic dehomogenised")],
)  # fmt: skip
def test_forms_at_one_are_their_dehomogenisations(form, affine):
    last = W if form == "hurwitz quartic" else Z
    assert same(symbolic(form).subs(last, 1), symbolic(affine))


@pytest.mark.parametrize(
    ("cubic", "sextic"),
    [("schur cubic on the orthant", "robinson form"), ("motzkin cubic on the orthant", "motzkin form"),
     ("mean of three numbers on the orthant", "hurwitz sextic"), ("horn on the orthant", "horn form of squares"),
     ("hildebrand on the orthant", "hildebrand form of squares")],
)  # fmt: skip
def test_forms_on_the_orthant_and_their_forms_of_squares_belong_together(cubic, sextic):
    squares = {s: s**2 for s in (A, B, C, D, E, X, Y, Z)}
    assert same(symbolic(cubic).subs(squares, simultaneous=True), symbolic(sextic))


def test_parrilo_and_sturmfels_took_motzkins_form_at_one():
    assert same(symbolic("motzkin form").subs(Y, 1), symbolic("parrilo-sturmfels at 0"))
    squares = (Z**3 - Z * 9 / 8) ** 2 + (X**2 - sp.Rational(3, 2) * Z**2 + sp.Rational(27, 64)) ** 2
    assert same(squares + sp.Rational(5, 32) * X**2, symbolic("parrilo-sturmfels at its threshold"))


def test_lax_forms_are_sums_over_products_of_differences():
    def lax(points):
        return sum(sp.prod([p - q for j, q in enumerate(points) if j != i]) for i, p in enumerate(points))

    assert same(lax([X, Y, Z, W, 0]), symbolic("lax-lax"))
    assert same(lax([X, Y, Z]), symbolic("lax-lax in three variables"))


def test_the_hessian_form_is_that_of_the_convex_form():
    convex = symbolic("ahmadi-parrilo convex form")
    direction = sp.Matrix(sp.symbols("u v w"))
    hessian = sp.hessian(convex, (X, Y, Z))
    assert same((direction.T * hessian * direction)[0], symbolic("ahmadi-parrilo hessian form"))
    assert same(hessian[0, 0], symbolic("ahmadi-parrilo second derivative"))


def test_hildebrand_matrix_has_the_stated_angles():
    angle = sp.acos(sp.Rational(12, 13))
    assert 5 * angle.evalf() < math.pi
    first = [1, -sp.cos(angle), sp.expand_trig(sp.cos(2 * angle)), sp.expand_trig(sp.cos(2 * angle)), -sp.cos(angle)]
    variables_ = (A, B, C, D, E)
    form = sum(169 * first[(j - i) % 5] * variables_[i] * variables_[j] for i in range(5) for j in range(5))
    assert same(form, symbolic("hildebrand on the orthant"))
    assert same(symbolic("hildebrand on the orthant").subs({A: 13, B: 24, C: 13, D: 0, E: 0}), 0)


@pytest.mark.parametrize(
    ("name", "grid", "left_out", "largest"),
    [("robinson", (-1, 0, 1), (0, 0), 3), ("hilbert perturbation 1e-3", (-1, 0, 1), (0, 0), 3),
     ("hilbert perturbation 1/2", (-1, 0, 1), (0, 0), 3), ("schmuedgen", (-2, 0, 2), (2, 0), 3)],
)  # fmt: skip
def test_cubics_through_eight_points_of_a_grid_pass_through_the_ninth(name, grid, left_out, largest):
    """Cayley and Bacharach: an argument of its own that these are no sums of squares."""
    polynomial = symbolic(name)
    eight = [p for p in itertools.product(grid, repeat=2) if p != left_out]
    powers = monomials(2, largest)
    through = sp.Matrix([[sp.Integer(p[0]) ** i * p[1] ** j for i, j in powers] for p in eight])
    ninth = sp.Matrix([[sp.Integer(left_out[0]) ** i * left_out[1] ** j for i, j in powers]])
    assert all(polynomial.subs({X: p[0], Y: p[1]}) == 0 for p in eight)
    assert polynomial.subs({X: left_out[0], Y: left_out[1]}) > 0
    assert through.rank() == through.col_join(ninth).rank() == 8


def test_scheiderers_form_is_a_norm_that_rational_quadrics_cannot_square_to():
    """Two of four conjugate lines meet in six conjugate points; a quadric through them contains the four lines."""
    t = sp.Symbol("t")
    minimal = sp.Poly(t**4 - t + 1, t)
    norm = sp.resultant(minimal.as_expr(), X + t * Y + t**2 * Z, t)
    assert same(norm, symbolic("scheiderer"))  # hence two squares over the reals: no root is real
    assert not sp.real_roots(minimal)
    assert minimal.is_irreducible
    roots = [complex(r) for r in minimal.nroots(n=40)]
    sums = sp.Poly(sp.Mul(*[t - sp.N(p + q, 30) for p, q in itertools.combinations(minimal.nroots(n=40), 2)]), t)
    exact = sp.Poly([round(float(sp.re(c))) for c in sums.all_coeffs()], t)
    assert max(abs(complex(c) - d) for c, d in zip(sums.all_coeffs(), exact.all_coeffs(), strict=True)) < 1e-9
    assert exact.is_irreducible  # so the Galois group moves any pair of roots to any other
    meets = [(p * q, -(p + q), 1) for p, q in itertools.combinations(roots, 2)]
    quadrics = [[a**i * b**j * c**k for i, j, k in itertools.product(range(3), repeat=3) if i + j + k == 2]
                for a, b, c in meets]  # fmt: skip
    assert all(abs(a + r * b + r**2 * c) < 1e-9 for (a, b, c), (p, q) in
               zip(meets, itertools.combinations(roots, 2), strict=True) for r in (p, q))  # fmt: skip
    assert abs(np.linalg.det(np.array(quadrics))) > 1e-3
