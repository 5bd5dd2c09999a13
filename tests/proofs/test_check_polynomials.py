"""Certificates of plain polynomials, small enough to verify by hand, and every way to break them."""

import copy
import importlib.util
import itertools
import json
import random
import re
import time
from fractions import Fraction
from math import comb
from pathlib import Path

import cvxpy as cp
import numpy as np
import pytest
import sympy as sp
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from thinned import few, some_or_all, spread

ROOT = Path(__file__).parents[2]
SPECIFICATION = importlib.util.spec_from_file_location("polynomial_check", ROOT / "proofs" / "check.py")
checker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(checker)
exact_numbers, squares, polynomials, functionals = map(
    checker.beside, ("numbers", "squares", "polynomials", "functionals")
)

REMOVED = object()


# ---------------------------------------------------------------- certificates made by hand


def file(polynomial, kind, proof, *, names="xy", on=(), equal=(), products=((),), degree=2, multiplier=None):
    document = {
        "format": 1,
        "variables": list(names),
        "polynomial": polynomial,
        "inequalities": list(on),
        "equalities": list(equal),
        "products": list(map(list, products)),
        "degree": degree,
        "multiplier": multiplier or {",".join("0" * len(names)): "1"},
        kind: proof,
    }
    return copy.deepcopy(document)


def sos(*squares, cofactors=(), multiplier=()):
    return {"squares": list(squares), "cofactors": list(cofactors), "multiplier": list(multiplier)}


def square(basis, *gram, product=()):
    return {"product": list(product), "basis": basis, "gram": list(gram)}


def functional(**values):
    """Return a functional; the name x2y stands for the monomial x^2 y, one for 1."""
    keys = (re.fullmatch("(?:one)?(x?)([0-9]?)(y?)([0-9]?)", name).groups() for name in values)
    monomials = (f"{int(a or 1) if x else 0},{int(b or 1) if y else 0}" for x, a, y, b in keys)
    return {"functional": dict(zip(monomials, values.values(), strict=True))}


X, Y, CIRCLE = {"1,0": "1"}, {"0,1": "1"}, {"2,0": "1", "0,2": "1", "0,0": "-1"}
DISC = {"0,0": "1", "2,0": "-1", "0,2": "-1"}
MOTZKIN = {"4,2": "1", "2,4": "1", "2,2": "-3", "0,0": "1"}


def quadratic():
    """(x - y)^2 + y^2 = x^2 - 2xy + 2y^2."""
    proof = sos(square([[1, 0], [0, 1]], "1", "-1", "2"))
    return file({"2,0": "1", "1,1": "-2", "0,2": "2"}, "sos", proof)


def two_squares():
    """The same with x - y as an element of a basis of its own."""
    proof = sos(square([{"1,0": "1", "0,1": "-1"}], "1"), square([[0, 1]], "1"))
    return quadratic() | {"sos": proof}


def shifted():
    """1/2 (1 + x)^2 + 1/2 y^2 - 1/2 (x^2 + y^2 - 1) = 1 + x on the circle."""
    squares = square([{"0,0": "1", "1,0": "1"}], "1/2"), square([[0, 1]], "1/2")
    return file({"0,0": "1", "1,0": "1"}, "sos", sos(*squares, cofactors=[{"0,0": "-1/2"}]), equal=[CIRCLE])


def disc():
    """2 - x - y = (1 - x^2 - y^2) + (1 - x - y + x^2 + y^2), a matrix of determinant 1/2."""
    squares = square([[0, 0], [1, 0], [0, 1]], "1", "-1/2", "-1/2", "1", "0", "1"), square([[0, 0]], "1", product=[0])
    return file({"0,0": "2", "1,0": "-1", "0,1": "-1"}, "sos", sos(*squares), on=[DISC], products=[[], [0]])


def orthant():
    """3xy + (x - y)^2 + 2x as it stands."""
    squares = square([{"1,0": "1", "0,1": "-1"}], "1"), square([[0, 0]], "2", product=[0])
    proof = sos(*squares, square([[0, 0]], "3", product=[0, 1]))
    polynomial = {"2,0": "1", "1,1": "1", "0,2": "1", "1,0": "2"}
    return file(polynomial, "sos", proof, on=[X, Y], products=[[], [0], [1], [0, 1]])


def odd_multiplier():
    """(2/3) x * y = (2/3) xy on the orthant, where x may be a multiplier, so that y >= 0."""
    proof = sos(square([[0, 0]], "2/3", product=[0, 1]))
    return file(Y, "sos", proof, on=[X, Y], products=[[], [0, 1]], multiplier={"1,0": "2/3"})


def motzkin_multiplied():
    """The five squares below add up to (x^2 + y^2 + 1) M, M positive and no sum of squares itself."""
    squares = [
        square([{"2,1": "1", "0,1": "-1"}], "1"),
        square([{"1,2": "1", "1,0": "-1"}], "1"),
        square([{"2,2": "1", "0,0": "-1"}], "1"),
        square([{"1,3": "1", "3,1": "-1"}], "1/4"),
        square([{"1,3": "1", "3,1": "1", "1,1": "-2"}], "3/4"),
    ]
    return file(MOTZKIN, "sos", sos(*squares), degree=8, multiplier={"2,0": "1", "0,2": "1", "0,0": "1"})


def multiplier_of_squares():
    """((x - y)^2 + 1)(1 + x^2) = (x - y)^2 + 1 + x^2 (x - y)^2 + x^2, on the circle for a multiplier above 0."""
    multiplier = [square([{"1,0": "1", "0,1": "-1"}, [0, 0]], "1", "0", "1")]
    squares = square([{"1,0": "1", "0,1": "-1"}, [0, 0]], "1", "0", "1"), square([{"2,0": "1", "1,1": "-1"}], "1")
    proof = sos(*squares, square([[1, 0]], "1"), cofactors=[{}], multiplier=multiplier)
    mu = {"2,0": "1", "1,1": "-2", "0,2": "1", "0,0": "1"}
    return file({"0,0": "1", "2,0": "1"}, "sos", proof, equal=[CIRCLE], multiplier=mu)


def zero():
    """0 is an empty sum."""
    return file({}, "sos", sos())


def multiple():
    """x (x^2 + y^2 - 1) is zero on the circle."""
    polynomial = {"3,0": "1", "1,2": "1", "1,0": "-1"}
    return file(polynomial, "sos", sos(cofactors=[X]), equal=[CIRCLE], degree=3)


def motzkin():
    """The reduction leaves 1, x^2y, xy^2, xy; the matrix of L is diagonal with 1, 1, 1, 2, and L(M) = 1 + 1 - 6 + 1."""
    return file(MOTZKIN, "not-sos", functional(one="1", x4y2="1", x2y4="1", x2y2="2"), degree=6)


def circle():
    """L(x^2 + y^2 - 1) = 1/2 + 1/2 - 1 = 0; the matrix has the blocks 1, -1/2, 1/2 of determinant 1/4, and 1/2."""
    return file(X, "not-sos", functional(one="1", x="-1/2", x2="1/2", y2="1/2"), equal=[CIRCLE])


def evaluation():
    """L is the value at (1, 1), of a matrix of ones; 1 + x^2 + y^2 - 4xy has the value -1."""
    values = functional(one="1", x="1", y="1", x2="1", xy="1", y2="1")
    return file({"0,0": "1", "2,0": "1", "0,2": "1", "1,1": "-4"}, "not-sos", values)


def disc_point():
    """L is the value at (1/2, 0), where 1 - x^2 - y^2 = 3/4 and 1/4 - x = -1/4."""
    values = functional(one="1", x="1/2", x2="1/4")
    return file({"0,0": "1/4", "1,0": "-1"}, "not-sos", values, on=[DISC], products=[[], [0]])


def orthant_without_product():
    """xy is no combination of squares, x times squares and y times squares of degree 2: everything drops out."""
    return file({"1,1": "1"}, "not-sos", functional(xy="-1"), on=[X, Y], products=[[], [0], [1]])


def multiplied_functional():
    """3 * (x^2 - y^2): L = -1 at x^2 would be no square, L = 1 at y^2 is."""
    return file({"2,0": "1", "0,2": "-1"}, "not-sos", functional(y2="1"), multiplier={"0,0": "3"})


def below():
    """x^2 - 2 = -1 at x = 1."""
    return file({"2,0": "1", "0,0": "-2"}, "negative", {"point": ["1", "-1/2"]})


def below_on_set():
    """x - y < 0 at (3/5, 4/5), a point of the circle with x >= 0."""
    proof = {"point": ["3/5", "4/5"]}
    return file({"1,0": "1", "0,1": "-1"}, "negative", proof, on=[X], equal=[CIRCLE], products=[[], [0]])


PROOFS = [quadratic, two_squares, shifted, disc, orthant, odd_multiplier, motzkin_multiplied]
PROOFS += [multiplier_of_squares, zero, multiple]
FUNCTIONALS = [motzkin, circle, evaluation, disc_point, orthant_without_product, multiplied_functional]
POINTS = [below, below_on_set]
ALL = PROOFS + FUNCTIONALS + POINTS


@pytest.fixture(autouse=True)
def all_steps_left():
    exact_numbers.budget.renew()


def verify(document):
    return checker.check(json.dumps(document))


def edited(document, *steps):
    """Return a copy with the value at each path replaced; a step is (*path, value)."""
    document = copy.deepcopy(document)
    for *path, last, value in steps:
        target = document
        for key in path:
            target = target[key]
        if value is REMOVED:
            del target[last]
        else:
            target[last] = value
    return document


def refusal(document):
    """Return the reason, one line of ASCII."""
    with pytest.raises(checker.Refused) as refused:
        verify(document)
    reason = str(refused.value)
    assert reason.isascii()
    assert reason.isprintable()
    assert len(reason) < 500
    return reason


# ---------------------------------------------------------------- true statements are verified


@pytest.mark.parametrize("make", PROOFS)
def test_a_proof_by_hand_is_proved(make):
    assert verify(make()).verdict == "proved"


@pytest.mark.parametrize("make", FUNCTIONALS + POINTS)
def test_a_refutation_by_hand_is_refuted(make):
    assert verify(make()).verdict == "refuted"


def test_the_example_of_the_format_is_proved():
    text = (ROOT / "proofs" / "FORMAT.md").read_text(encoding="utf-8")
    example = text[text.index("## A plain polynomial") :].split("```json")[1].split("```")[0]
    assert checker.check(example).verdict == "proved"


def test_the_statement_of_a_proof_says_everything_that_was_verified():
    assert verify(odd_multiplier()).statement == (
        "variables, all real: x, y",
        "polynomial: 1*y",
        "set: [0] = 1*x >= 0",
        "set: [1] = 1*y >= 0",
        "multiplier: 2/3*x",
        "products: 1, [0]*[1]; degree: 2",
        "conclusion: the polynomial is >= 0 on the set (the degree of the identity is not verified)",
    )


def test_the_statement_of_a_functional_says_everything_that_was_verified():
    assert verify(circle()).statement == (
        "variables, all real: x, y",
        "polynomial: 1*x",
        "set: 1*x^2 + 1*y^2 + -1 = 0",
        "multiplier: 1",
        "products: 1; degree: 2",
        "functional, zero on all other monomials: L(x^2) = 1/2, L(x) = -1/2, L(y^2) = 1/2, L(1) = 1",
        "conclusion: multiplier times polynomial is not a sum, with terms up to the degree, of products times sums of "
        "squares and multiples of the equalities",
    )


def test_the_statement_of_a_point_says_everything_that_was_verified():
    assert verify(below()).statement == (
        "variables, all real: x, y",
        "polynomial: 1*x^2 + -2",
        "set: all points",
        "multiplier: 1",
        "products: 1; degree: 2",
        "point: x = 1, y = -1/2",
        "conclusion: the polynomial is < 0 at this point of the set, so that no degree and no positive multiplier help",
    )


def test_a_proof_needs_no_degree():
    """The identity decides."""
    assert verify(edited(motzkin_multiplied(), ("degree", 0))).verdict == "proved"


def test_equal_conditions_on_sets_are_told_apart_by_their_multipliers():
    """A multiplier that vanishes somewhere proves nothing on a set without interior: x^2 * (-1) = 0 where x = 0."""
    proof = sos(cofactors=[{"1,0": "-1"}])
    false = file({"0,0": "-1"}, "sos", proof, equal=[X], multiplier={"2,0": "1"})
    assert "positive everywhere" in refusal(false)
    spaced = edited(false, ("multiplier", {"2,0": "1", "0,0": "1"}))
    assert "identity" in refusal(spaced)
    squares = edited(false, ("sos", "multiplier", [square([[1, 0]], "1")]))
    assert "positive everywhere" in refusal(squares)


def test_opposite_half_spaces_are_no_orthant():
    """x >= 0 and -x >= 0 leave x = 0, where x^2 * (-1) = x * (-x) proves nothing."""
    proof = sos(square([[0, 0]], "1", product=[0, 1]))
    false = file({"0,0": "-1"}, "sos", proof, on=[X, {"1,0": "-1"}], products=[[], [0, 1]], multiplier={"2,0": "1"})
    assert "positive everywhere" in refusal(false)


def test_a_square_of_one_needs_the_empty_product():
    """x * 1^2 vanishes where x = 0, and there -1 < 0: x (-1) = -1 (x)."""
    proof = sos(cofactors=[{"0,0": "-1"}], multiplier=[square([[0, 0]], "1", product=[0])])
    false = file({"0,0": "-1"}, "sos", proof, on=[X], equal=[X], products=[[], [0]], multiplier=X)
    assert "positive everywhere" in refusal(false)


def test_squares_of_the_multiplier_that_cancel_are_refused():
    """x * 1^2 + (-x) * 1^2 = 0 is not the multiplier."""
    squares = [square([[0, 0]], "1", product=[index]) for index in (0, 1)]
    document = edited(
        quadratic(),
        ("inequalities", [X, {"1,0": "-1"}]),
        ("products", [[], [0], [1]]),
        ("sos", "multiplier", squares),
    )
    assert "multiplier identity" in refusal(document)


def test_a_margin_decides_motzkin_above_its_multiplier():
    """M - 1/1000 is negative at (1, 1), so no multiplier may prove it."""
    false = edited(motzkin_multiplied(), ("polynomial", "0,0", "999/1000"))
    assert "identity" in refusal(false)
    point = file(false["polynomial"], "negative", {"point": ["1", "1"]}, degree=6)
    assert verify(point).verdict == "refuted"


def test_the_hand_made_identities_hold_by_another_algebra():
    for make in PROOFS:
        document = make()
        ring = ring_of(document)
        left = polynomial_in(ring, document["multiplier"]) * polynomial_in(ring, document["polynomial"])
        right = sum_of(ring, document, document["sos"]["squares"])
        for cofactor, equality in zip(document["sos"]["cofactors"], document["equalities"], strict=True):
            right += polynomial_in(ring, cofactor) * polynomial_in(ring, equality)
        assert sp.expand(left - right) == 0
        if document["sos"]["multiplier"]:
            squares = sum_of(ring, document, document["sos"]["multiplier"])
            assert sp.expand(squares - polynomial_in(ring, document["multiplier"])) == 0


def ring_of(document):
    return sp.symbols(document["variables"], real=True)


def polynomial_in(ring, entries):
    total = sp.Integer(0)
    for key, number in entries.items():
        total += sp.Rational(number) * sp.prod(x**a for x, a in zip(ring, map(int, key.split(",")), strict=True))
    return total


def sum_of(ring, document, squares):
    total = sp.Integer(0)
    for entry in squares:
        basis = [
            polynomial_in(ring, b if isinstance(b, dict) else {",".join(map(str, b)): "1"}) for b in entry["basis"]
        ]
        gram, numbers = sp.zeros(len(basis)), iter(entry["gram"])
        for i, j in itertools.combinations_with_replacement(range(len(basis)), 2):
            gram[i, j] = gram[j, i] = sp.Rational(next(numbers))
        factor = sp.prod(polynomial_in(ring, document["inequalities"][i]) for i in entry["product"])
        total += factor * (sp.Matrix(basis).T * gram * sp.Matrix(basis))[0]
    return total


# ---------------------------------------------------------------- definiteness


def principal_minors(matrix):
    size = len(matrix)
    for count in range(1, size + 1):
        for chosen in itertools.combinations(range(size), count):
            yield sp.Matrix([[matrix[i][j] for j in chosen] for i in chosen]).det()


@pytest.mark.parametrize("rank", [1, 2, 3])
def test_semidefiniteness_agrees_with_all_principal_minors(rank):
    generator, verdicts = random.Random(rank), set()
    for _ in range(60):
        rows = [[generator.randint(-2, 2) * generator.randint(0, 1) for _ in range(4)] for _ in range(rank)]
        matrix = [[sum(row[i] * row[j] for row in rows) for j in range(4)] for i in range(4)]
        i = generator.randrange(4)
        matrix[i][i] += generator.choice((-1, 0, 0, 1))
        expected = all(minor >= 0 for minor in principal_minors(matrix))
        found = {
            squares.is_positive_definite(copy.deepcopy(matrix), or_singular=True),
            all(squares.is_positive_definite(block, or_singular=True) for block in functionals.blocks(matrix)),
        }
        assert found == {expected}
        verdicts.add(expected)
    assert verdicts == {True, False}


def test_blocks_are_the_connected_components():
    upper = [[1, 0, 2, 0], [0, 0, 0, 0], [0, 0, 3, 4], [0, 0, 0, 5]]
    assert sorted(map(len, functionals.blocks(upper))) == [1, 3]
    assert list(functionals.blocks([[7, 0], [0, 8]])) == [[[7]], [[8]]]


# ---------------------------------------------------------------- the reduction


def decoded(codes, size):
    mask = (1 << functionals.DIGIT) - 1
    return {tuple(m >> functionals.DIGIT * i & mask for i in range(size)) for m in codes}


def coded(monomials):
    return {sum(a << functionals.DIGIT * i for i, a in enumerate(m)) for m in monomials}


def survivors(size, degree, kept, inequalities=(), products=((),)):
    """Return the monomials that survive, by product, with the checker's reduction."""
    one = {(0,) * size: Fraction(1)}
    names = [f"x{i}" for i in range(size)]
    statement = polynomials.Statement(names, one, one, list(inequalities), [], list(products), degree)
    found = functionals.survivors(statement, coded(kept))
    return {chosen: decoded(basis, size) for chosen, _, basis in found}


def monomials(size, degree):
    return [m for m in itertools.product(range(degree + 1), repeat=size) if sum(m) <= degree]


def times(*factors):
    return tuple(map(sum, zip(*factors, strict=True)))


def expanded(factors, size):
    """Multiply polynomials."""
    total = {(0,) * size: Fraction(1)}
    for factor in factors:
        products = itertools.product(total.items(), factor.items())
        total = {}
        for (a, x), (b, y) in products:
            total[times(a, b)] = total.get(times(a, b), 0) + x * y
    return {m: number for m, number in total.items() if number}


def reduced_by_definition(size, degree, kept, inequalities, products, generator):
    """Drop by the words of the format, one monomial after the other, in random order."""
    factors = {chosen: expanded([inequalities[i] for i in chosen], size) for chosen in products}
    alive = {}
    for chosen in products:
        room = degree - sum(max(map(sum, inequalities[i])) for i in chosen)
        if room >= 0:
            alive[chosen] = set(monomials(size, room // 2))
    while True:
        contributions = {}
        for chosen, basis in alive.items():
            for b, c in itertools.combinations_with_replacement(sorted(basis), 2):
                for t, number in factors[chosen].items():
                    entry = (chosen, b) if b == c and number > 0 else None
                    contributions.setdefault(times(b, c, t), []).append(entry)
        droppable = [e for e, entries in contributions.items() if e not in kept and None not in entries]
        if not droppable:
            return alive
        for chosen, b in contributions[generator.choice(sorted(droppable))]:
            alive[chosen].discard(b)


@pytest.mark.parametrize("seed", range(25))
def test_the_reduction_is_that_of_the_format_in_any_order(seed):
    generator = random.Random(seed)
    size, degree = generator.choice([(1, 8), (2, 5), (2, 6), (3, 4)])
    inequalities = []
    for _ in range(generator.randrange(3)):
        support = generator.sample(monomials(size, 2), generator.randint(1, 3))
        inequalities.append({m: Fraction(generator.choice((-2, -1, 1, 1, 3))) for m in support})
    products = [
        c for count in range(len(inequalities) + 1) for c in itertools.combinations(range(len(inequalities)), count)
    ]
    everything = monomials(size, degree)
    kept = set(generator.sample(everything, generator.randrange(len(everything) // 2)))
    found = survivors(size, degree, kept, inequalities, products)
    for _ in range(3):
        assert found == reduced_by_definition(size, degree, kept, inequalities, products, generator)


def in_hull(point, points):
    """Decide by a linear programme whether a point is in the convex hull."""
    matrix = np.vstack([np.array(points, dtype=float).T, np.ones(len(points))])
    result = linprog(np.zeros(len(points)), A_eq=matrix, b_eq=[*point, 1.0], bounds=(0, None), method="highs")
    return result.status == 0


@pytest.mark.parametrize("seed", range(12))
def test_on_the_whole_space_survivors_lie_in_half_the_newton_polytope(seed):
    generator = random.Random(seed)
    size, degree = generator.choice([(2, 8), (3, 6)])
    support = generator.sample(monomials(size, degree), generator.randint(2, 9))
    for basis in survivors(size, degree, set(support)).values():
        for b in basis:
            assert in_hull([2 * a for a in b], support)


@pytest.mark.parametrize("seed", range(12))
def test_all_monomials_of_a_known_sum_of_squares_survive(seed):
    """Whatever cancels: p = sum of products times squares, with coefficients that often do."""
    generator = random.Random(seed)
    size, degree = generator.choice([(1, 8), (2, 6), (3, 6)])
    limits = [
        {(0,) * size: Fraction(1), (2,) + (0,) * (size - 1): Fraction(-1)},
        {(0,) * (size - 1) + (1,): Fraction(1)},
    ]
    inequalities, total, used = limits[: generator.randrange(3)], {}, {}
    products = [
        c for count in range(len(inequalities) + 1) for c in itertools.combinations(range(len(inequalities)), count)
    ]
    for _ in range(3):
        chosen = generator.choice(products)
        room = (degree - sum(max(map(sum, inequalities[i])) for i in chosen)) // 2
        support = generator.sample(monomials(size, room), min(3, comb(size + room, size)))
        squared = {m: Fraction(generator.choice((-1, 1))) for m in support}
        used.setdefault(chosen, set()).update(support)
        for m, number in expanded([*(inequalities[i] for i in chosen), squared, squared], size).items():
            total[m] = total.get(m, 0) + number
    kept = {m for m, number in total.items() if number}
    found = survivors(size, degree, kept, inequalities, products)
    for chosen, support in used.items():
        assert support <= found[chosen]


def test_multiples_of_equalities_are_kept():
    """x is no square, but x + (x^2 - x) is: without the equality everything drops out."""
    values = functional(x="-1")
    assert verify(file(X, "not-sos", values)).verdict == "refuted"
    equal = file(X, "not-sos", values, equal=[{"2,0": "1", "1,0": "-1"}])
    assert "multiples of the equalities" in refusal(equal)
    spread = edited(equal, ("not-sos", functional(x="-1", x2="-1")))
    assert "moment matrix" in refusal(spread)
    proof = sos(square([[1, 0]], "1"), cofactors=[{"0,0": "-1"}])
    assert verify(file(X, "sos", proof, equal=[{"2,0": "1", "1,0": "-1"}])).verdict == "proved"


def test_beyond_the_degree_multiples_of_equalities_do_not_count():
    """y (x^2 - x) has degree 3: L need not vanish there for degree 2."""
    equal = [{"2,0": "1", "1,0": "-1"}]
    values = functional(one="1", y="-1", y2="1", x2y="5")
    assert verify(file(Y, "not-sos", values, equal=equal)).verdict == "refuted"
    assert "multiples of the equalities" in refusal(file(Y, "not-sos", values, equal=equal, degree=3))


def test_motzkin_needs_the_reduction():
    """With x and y in the basis the same functional has an indefinite matrix: L(x^2) = 0 and L(x * xy^2) = 2."""
    assert survivors(2, 6, {(4, 2), (2, 4), (2, 2), (0, 0)}) == {(): {(0, 0), (2, 1), (1, 2), (1, 1)}}
    kept = edited(motzkin(), ("polynomial", "2,0", "1/1000"), ("polynomial", "0,2", "1/1000"))
    assert "moment matrix" in refusal(kept)
    assert "moment matrix" in refusal(edited(motzkin(), ("not-sos", "functional", "2,4", "-1")))


# ---------------------------------------------------------------- every rule, broken once


def first(*path):
    return ("sos", "squares", 0, *path)


UNUSUAL = ["2/2", "-0", "0/1", "02", "+2", " 2", "2.0", "2e0", "", "²", "1" + "0" * 400]
SHARED = [{"1,0": "1", "0,1": "-1"}, [0, 1]]

BROKEN = {
    # header
    "format 2": (quadratic, [("format", 2)], "format"),
    "format true": (quadratic, [("format", True)], "format"),
    "format missing": (quadratic, [("format", REMOVED)], "format"),
    "unknown key": (quadratic, [("note", "x")], "unknown keys"),
    "key of a loop": (quadratic, [("law", "x")], "unknown keys"),
    "missing key": (quadratic, [("products", REMOVED)], "products is missing"),
    "no proof": (quadratic, [("sos", REMOVED)], "missing"),
    "two proofs": (quadratic, [("negative", {"point": ["0", "0"]})], "unknown keys"),
    "no polynomial": (quadratic, [("polynomial", REMOVED)], "missing"),
    # variables
    "no variables": (quadratic, [("variables", [])], "variables"),
    "17 variables": (quadratic, [("variables", [f"x{i}" for i in range(17)])], "variables"),
    "variables equal": (quadratic, [("variables", ["x", "x"])], "different"),
    "variable with a digit first": (quadratic, [("variables", ["x", "1y"])], "name"),
    "variable with a newline": (quadratic, [("variables", ["x", "y\n"])], "name"),
    "variable a list": (quadratic, [("variables", ["x", ["y"]])], "name"),
    "variables an object": (quadratic, [("variables", {"x": 1, "y": 1})], "a list"),
    # polynomials
    **{f"rational {text!r}": (quadratic, [("polynomial", "2,0", text)], "polynomial must be") for text in UNUSUAL},
    "coefficient zero": (quadratic, [("polynomial", "5,0", "0")], "without zeros"),
    "coefficient an integer": (quadratic, [("polynomial", "2,0", 1)], "a string"),
    "key short": (quadratic, [("polynomial", "2", "1")], "keys such as"),
    "key long": (quadratic, [("polynomial", "2,0,0", "1")], "keys such as"),
    "key padded": (quadratic, [("polynomial", "02,0", "1")], "keys such as"),
    "key spaced": (quadratic, [("polynomial", "2, 0", "1")], "keys such as"),
    "key negative": (quadratic, [("polynomial", "-2,0", "1")], "keys such as"),
    "key Arabic": (quadratic, [("polynomial", "٢,0", "1")], "keys such as"),
    "key huge": (quadratic, [("polynomial", "1000,0", "1")], "keys such as"),
    "key of commas": (quadratic, [("polynomial", "," * 10**6, "1")], "keys such as"),
    "polynomial a list": (quadratic, [("polynomial", [])], "an object"),
    "multiplier zero": (quadratic, [("multiplier", {})], "nonzero"),
    "inequality zero": (disc, [("inequalities", [{}])], "nonzero"),
    "equality zero": (shifted, [("equalities", [{}])], "nonzero"),
    "inequality twice": (orthant, [("inequalities", [X, X])], "different"),
    "33 inequalities": (disc, [("inequalities", [{"0,0": str(i)} for i in range(1, 34)])], "0 to 32"),
    "20 and 20": (
        disc,
        [("inequalities", [{"0,0": str(i)} for i in range(1, 21)]), ("equalities", [X] * 20)],
        "0 to 12",
    ),
    # products and degree
    "products without the empty one": (disc, [("products", [[0]])], "empty one"),
    "products empty": (disc, [("products", [])], "products"),
    "product twice": (disc, [("products", [[], [0], [0]])], "different"),
    "product decreasing": (orthant, [("products", [[], [1, 0]])], "increasing"),
    "product squared": (orthant, [("products", [[], [0, 0]])], "increasing"),
    "product unknown": (disc, [("products", [[], [1]])], "indices below 1"),
    "product true": (orthant, [("products", [[], [True]])], "indices below"),
    "product in a string": (orthant, [("products", [[], ["0"]])], "indices below"),
    "product of lists": (orthant, [("products", [[], [[0]]])], "indices below"),
    "product long": (orthant, [("products", [[], [0, 1, 1]])], "0 to 2"),
    "1025 products": (orthant, [("products", [[]] * 1025)], "1 to 1024"),
    "degree 1000": (quadratic, [("degree", 1000)], "an integer"),
    "degree in a string": (quadratic, [("degree", "2")], "degree"),
    "degree true": (quadratic, [("degree", True)], "degree"),
    # squares
    "square without product": (quadratic, [first("product", REMOVED)], "product is missing"),
    "square with times": (quadratic, [first("times", [0, 0])], "unknown keys"),
    "square of no product": (orthant, [("products", [[], [0]])], "one of the products"),
    "square of another product": (orthant, [("sos", "squares", 1, "product", [1])], "identity"),
    "square of no inequality": (orthant, [("sos", "squares", 1, "product", [2])], "indices below"),
    "squares an object": (quadratic, [("sos", "squares", {})], "a list"),
    "squares empty": (quadratic, [("sos", "squares", [])], "identity"),
    "basis empty": (quadratic, [first(square([]))], "basis"),
    "basis repeated": (quadratic, [first(square([[1, 0], [1, 0]], "1", "0", "1"))], "repetitions"),
    "basis without a term of its own": (quadratic, [first(square(SHARED, "1", "0", "1"))], "repetitions"),
    "element zero": (two_squares, [first("basis", 0, {})], "nonzero"),
    "element a monomial": (two_squares, [first("basis", 0, {"1,0": "1"})], "a list where"),
    "element of negative sign": (two_squares, [first("basis", 0, {"1,0": "-1", "0,1": "-1"})], "positive term"),
    "element a string": (two_squares, [first("basis", 0, "x")], "an object"),
    "element rational": (quadratic, [first("basis", 0, ["1", 0])], "integers"),
    "element long": (quadratic, [first("basis", 0, [1, 0, 0])], "basis"),
    "basis of 401": (quadratic, [first("basis", [[i, 0] for i in range(401)])], "1 to 400"),
    "gram short": (quadratic, [first("gram", ["1", "-1"])], "gram"),
    "gram full": (quadratic, [first("gram", ["1", "-1", "-1", "2"])], "gram"),
    "gram singular": (
        quadratic,
        [("sos", "squares", [square([[1, 0], [0, 1]], "1", "-1", "1"), square([[0, 1]], "1")])],
        "positive definite",
    ),
    "gram negative beside a positive one": (
        quadratic,
        [("sos", "squares", [*quadratic()["sos"]["squares"], square([[0, 0]], "1"), square([[0, 0]], "-1")])],
        "positive definite",
    ),
    "cofactors missing": (shifted, [("sos", "cofactors", [])], "1 to 1"),
    "cofactors too many": (shifted, [("sos", "cofactors", [{}, {}])], "1 to 1"),
    "cofactor zero": (shifted, [("sos", "cofactors", [{}])], "identity"),
    "cofactor a string": (shifted, [("sos", "cofactors", ["0"])], "an object"),
    "another polynomial": (quadratic, [("polynomial", "0,0", "1")], "identity"),
    # multipliers
    "multiplier negative": (quadratic, [("multiplier", "0,0", "-1")], "positive even terms"),
    "multiplier odd": (quadratic, [("multiplier", {"1,0": "1"})], "positive even terms"),
    "multiplier odd in a free variable": (odd_multiplier, [("inequalities", 0, "1,0", "-1")], "positive even terms"),
    "multiplier odd with a shifted one": (
        odd_multiplier,
        [("inequalities", 0, {"1,0": "1", "0,0": "1"})],
        "positive even terms",
    ),
    "multiplier of other squares": (
        multiplier_of_squares,
        [("sos", "multiplier", 0, "gram", ["1", "0", "2"])],
        "multiplier identity",
    ),
    "multiplier of a basis without 1": (
        multiplier_of_squares,
        [
            ("sos", "multiplier", [square([{"1,0": "1", "0,1": "-1"}], "1")]),
            ("multiplier", {"2,0": "1", "1,1": "-2", "0,2": "1"}),
        ],
        "positive everywhere",
    ),
    "multiplier that is missing": (quadratic, [("sos", "multiplier", REMOVED)], "multiplier is missing"),
    "multiplier null": (quadratic, [("sos", "multiplier", None)], "a list"),
    # functionals
    "functional positive": (motzkin, [("not-sos", "functional", "2,2", "1")], "negative at"),
    "functional of value zero": (below, [("negative", REMOVED), ("not-sos", functional(x="1"))], "negative at"),
    "functional empty": (motzkin, [("not-sos", "functional", {})], "negative at"),
    "functional with zeros": (motzkin, [("not-sos", "functional", "2,0", "0")], "without zeros"),
    "functional a list": (motzkin, [("not-sos", "functional", [])], "an object"),
    "functional missing": (motzkin, [("not-sos", {})], "functional is missing"),
    "functional and more": (motzkin, [("not-sos", "note", "x")], "unknown keys"),
    "functional off the equality": (circle, [("not-sos", "functional", "0,2", "1/3")], "equalities"),
    "functional of an indefinite matrix": (
        circle,
        [("not-sos", functional(one="1", x="-2", x2="1/2", y2="1/2"))],
        "moment matrix of product []",
    ),
    "zero pivot with a row": (
        evaluation,
        [("not-sos", functional(one="1", xy="1", y2="1"))],
        "moment matrix",
    ),
    "functional off the set": (disc_point, [("not-sos", functional(one="1", x="2", x2="4"))], "product [0]"),
    "product in the statement": (
        orthant_without_product,
        [("products", [[], [0], [1], [0, 1]])],
        "product [0, 1]",
    ),
    "basis too large": (motzkin, [("degree", 140)], "2000 monomials"),
    "reduced basis too large": (
        motzkin,
        [
            ("degree", 60),
            ("polynomial", {f"{60 - i},{i}": "1" for i in range(61)} | {"0,0": "-1"}),
            ("not-sos", functional(one="1")),
        ],
        "400 monomials",
    ),
    # points
    "point where it is zero": (below, [("polynomial", "0,0", "-1")], "negative at the point"),
    "point off the equality": (below_on_set, [("negative", "point", ["1", "1"])], "equality"),
    "point off the inequality": (below_on_set, [("negative", "point", ["-3/5", "4/5"])], "inequality"),
    "point short": (below, [("negative", "point", ["1"])], "point"),
    "point of integers": (below, [("negative", "point", [1, 0])], "a string"),
    "point an object": (below, [("negative", "point", {"x": "1", "y": "0"})], "a list"),
    "point and more": (below, [("negative", "value", "-1")], "unknown keys"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_rule_is_refused_for_its_reason(case):
    make, steps, reason = BROKEN[case]
    assert verify(make()).verdict in ("proved", "refuted")
    assert reason in refusal(edited(make(), *steps))


@pytest.mark.parametrize(("one", "other"), list(itertools.permutations([quadratic, disc, shifted, motzkin, circle], 2)))
def test_a_witness_paired_with_another_polynomial_is_refused(one, other):
    document = edited(one(), ("polynomial", other()["polynomial"]))
    assert refusal(document)


# ---------------------------------------------------------------- mutation


def leaves(value, path=(), *, every=False):
    """Yield every path to a number, or to every value."""
    if every and path:
        yield path, value
    if isinstance(value, dict):
        for key, entry in value.items():
            yield from leaves(entry, (*path, key), every=every)
    elif isinstance(value, list):
        for index, entry in enumerate(value):
            yield from leaves(entry, (*path, index), every=every)
    elif not every and (isinstance(value, int) or re.fullmatch("-?[0-9]+(/[0-9]+)?", value)):
        yield path, value


def keys(value, path=()):
    """Yield every path to a monomial that is a key."""
    for key, entry in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        if isinstance(key, str) and "," in key:
            yield (*path, key)
        yield from keys(entry, (*path, key))


def other_numbers(value):
    number, small = Fraction(value), Fraction(1, 1000)
    changed = {Fraction(0), -number, number / 2, number * 2, number * 10}
    changed |= {1 / number} if number else {Fraction(3)}
    changed |= {number + 1, number - 1, number + small, number - small}
    for other in sorted(changed - {number}):
        if isinstance(value, str):
            yield str(other)
        elif other.denominator == 1 and 0 <= other <= 6:  # a semidefinite programme of degree 6 takes a moment
            yield int(other)


def is_witness(path):
    return path[0] == "sos"


def check_mutation(original, document, path):
    """A change is refused, or it is visible and the statement is true; a changed proof is always refused."""
    try:
        result = verify(document)
    except checker.Refused:
        return False
    assert not is_witness(path)
    assert result.statement != original.statement
    assert looks_true(document)
    return True


@pytest.mark.parametrize("make", ALL)
@some_or_all
def test_a_changed_number_is_refused_or_changes_the_statement(make, most):
    original, refusals = verify(make()), 0
    for path, value in spread(leaves(make()), most):
        for other in other_numbers(value):
            refusals += not check_mutation(original, edited(make(), (*path, other)), path)
    assert refusals > 3


@pytest.mark.parametrize("make", ALL)
@some_or_all
def test_a_changed_monomial_is_refused_or_changes_the_statement(make, most):
    original, outcomes = verify(make()), []
    for *path, key in spread(keys(make()), most and most // 2):
        for other in ("0,0", "1,0", "0,1", "1,1", "2,0", "0,2", "2,2", "3,1"):
            document = make()
            target = document
            for step in path:
                target = target[step]
            if other not in target:
                target[other] = target.pop(key)
                outcomes.append(check_mutation(original, document, path))
    assert False in outcomes


@settings(max_examples=settings.default.max_examples, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_any_change_of_any_entry_is_refused_or_visible_and_true(data):
    make = data.draw(st.sampled_from(ALL))
    path, value = data.draw(st.sampled_from(list(leaves(make()))))
    if isinstance(value, str):
        other = str(data.draw(st.fractions(-9, 9, max_denominator=12)))
    else:
        other = data.draw(st.integers(0, 9))
    changed = edited(make(), (*path, other))
    if other == value:
        assert verify(changed).statement == verify(make()).statement
    else:
        assert not (check_mutation(verify(make()), changed, path) and is_witness(path))


@pytest.mark.parametrize("make", ALL)
def test_a_renamed_variable_is_visible(make):
    renamed = edited(make(), ("variables", ["x", "z"]))
    assert verify(renamed).statement != verify(make()).statement


def test_the_same_square_has_no_second_spelling():
    """(x)^2 + y^2 with the bases x + y, y or y - x, y, or with x and x + y or y and x + y, Gram matrix as needed."""
    circle_square = {"2,0": "1", "0,2": "1"}
    for one, other in (("1", "-1"), ("-1", "1")):
        basis = [{"1,0": one, "0,1": "1"}, [0, 1]]
        assert "positive term" in refusal(file(circle_square, "sos", sos(square(basis, "1", other, "2"))))
    for monomial in ([1, 0], [0, 1]):
        basis = [monomial, {"1,0": "1", "0,1": "1"}]
        assert "positive term" in refusal(file(circle_square, "sos", sos(square(basis, "2", "-1", "1"))))


def test_sampling_tells_true_statements_from_false_ones():
    """The oracle of the mutation test must be able to fail."""
    assert all(looks_true(make()) for make in ALL)
    assert not looks_true(edited(quadratic(), ("polynomial", "1,1", "-3")))
    assert not looks_true(edited(shifted(), ("polynomial", "0,0", "9/10")))
    assert not looks_true(edited(disc(), ("polynomial", "0,0", "1/2")))
    assert not looks_true(edited(motzkin(), ("polynomial", "2,2", "3")))
    assert not looks_true(edited(circle(), ("polynomial", "0,0", "2")))
    assert not looks_true(edited(orthant_without_product(), ("products", [[], [0, 1]])))
    assert not looks_true(edited(below(), ("polynomial", "0,0", "2")))


KNOWN = {}


def looks_true(document):
    """Decide the conclusion without its witness: by sampling, by a semidefinite programme, by substitution."""
    oracles = {"negative": is_below, "not-sos": has_no_squares, "sos": samples_are_above}
    (kind,) = document.keys() & oracles.keys()
    without = {"not-sos"} if kind == "not-sos" else {"sos", "multiplier", "degree", "products"}
    text = json.dumps([kind, {key: entry for key, entry in document.items() if key not in without}])
    if text not in KNOWN:
        KNOWN[text] = oracles[kind](document)
    return KNOWN[text]


def is_below(document):
    ring = ring_of(document)
    point = dict(zip(ring, map(sp.Rational, document["negative"]["point"]), strict=True))
    values = {
        key: [polynomial_in(ring, entry).subs(point) for entry in document[key]]
        for key in ("inequalities", "equalities")
    }
    inside = all(value >= 0 for value in values["inequalities"]) and not any(values["equalities"])
    return inside and polynomial_in(ring, document["polynomial"]).subs(point) < 0


def value_at(entries, point):
    powers = np.array([list(map(int, key.split(","))) for key in entries]).reshape(-1, len(point))
    return float(np.array([float(Fraction(number)) for number in entries.values()]) @ np.prod(point**powers, axis=1))


def gradient_at(entries, point):
    step = 1e-6 * np.eye(len(point))
    return np.array([(value_at(entries, point + h) - value_at(entries, point - h)) / 2e-6 for h in step])


def samples_are_above(document, count=60):
    """Sample the set, on equalities by Newton's method from random points."""
    generator = np.random.default_rng(5)
    for _ in range(count):
        point = generator.normal(size=len(document["variables"])) * generator.choice([0.3, 1.0, 3.0])
        for equality in document["equalities"] * 12:
            gradient = gradient_at(equality, point)
            point = point - value_at(equality, point) * gradient / (gradient @ gradient + 1e-12)
        inside = all(abs(value_at(equality, point)) < 1e-9 for equality in document["equalities"])
        inside = inside and all(value_at(g, point) >= 0 for g in document["inequalities"])
        if inside and value_at(document["polynomial"], point) < -1e-6:
            return False
    return True


def has_no_squares(document):
    """Ask Clarabel how much of sum of b^2 must be added before the statement becomes true."""
    return slack(document) > 1e-5


def terms_of(entries):
    return {tuple(map(int, key.split(","))): float(Fraction(number)) for key, number in entries.items()}


def slack(document):
    size, degree, rows, free = len(document["variables"]), document["degree"], {}, cp.Variable(nonneg=True)

    def put(monomial, term):
        rows[monomial] = rows.get(monomial, 0) + term

    for (a, x), (b, y) in itertools.product(*(terms_of(document[key]).items() for key in ("multiplier", "polynomial"))):
        put(times(a, b), -x * y)
    for b in monomials(size, degree // 2):
        put(times(b, b), -free)
    for chosen in document["products"]:
        factor = expanded([terms_of(document["inequalities"][index]) for index in chosen], size)
        room = degree - max(map(sum, factor))
        basis = monomials(size, room // 2) if room >= 0 else []
        gram = cp.Variable((len(basis), len(basis)), PSD=True) if basis else None
        for (i, b), (j, c), (t, number) in itertools.product(enumerate(basis), enumerate(basis), factor.items()):
            put(times(b, c, t), float(number) * gram[i, j])
    for equality in map(terms_of, document["equalities"]):
        room = degree - max(map(sum, equality))
        for m in monomials(size, room) if room >= 0 else []:
            cofactor = cp.Variable()
            for t, number in equality.items():
                put(times(m, t), number * cofactor)
    if any(isinstance(row, float) and row for row in rows.values()):
        return np.inf  # a monomial beyond the degree
    problem = cp.Problem(cp.Minimize(free), [row == 0 for row in rows.values() if not isinstance(row, float)])
    problem.solve(solver=cp.CLARABEL)
    return np.inf if problem.status in ("infeasible", "infeasible_inaccurate") else float(free.value)


# ---------------------------------------------------------------- hostile files


OTHERS = [None, True, False, 0, 1, 7, 1.5, "", "1", "x", [], [[]], [{}], ["1", "2"], {}, {"x": []}, {"1,0": "1"}]


@few("make", [multiplier_of_squares, disc, circle, below_on_set], every=2)
def test_any_other_type_anywhere_is_refused_or_visible(make):
    """Replace each value by values of every type: no exception but Refused may escape."""
    original = verify(make())
    for path, value in leaves(make(), every=True):
        for other in OTHERS:
            try:
                result = verify(edited(make(), (*path, other)))
            except checker.Refused:
                continue
            assert value == other or result.statement != original.statement


@pytest.mark.parametrize("make", ALL)
def test_every_truncation_is_refused(make):
    text = json.dumps(make())
    for end in range(0, len(text), 5):
        with pytest.raises(checker.Refused, match="JSON"):
            checker.check(text[:end])


def test_duplicate_keys_are_refused_at_any_level():
    text = json.dumps(multiplier_of_squares())
    for fragment in ('"degree": 2', '"0,0": "1"', '"product": []', '"cofactors": [{}]'):
        assert fragment in text
        with pytest.raises(checker.Refused, match="unique"):
            checker.check(text.replace(fragment, f"{fragment}, {fragment}", 1))


@pytest.mark.parametrize(
    ("before", "after", "reason"),
    [
        ('"degree": 2', '"degree": 2.0', "a number"),
        ('"degree": 2', '"degree": 2e0', "a number"),
        ('"degree": 2', '"degree": 1e400', "a number"),
        ('"degree": 2', '"degree": -0', "an integer"),
        ('"degree": 2', '"degree": ' + "9" * 5000, "an integer"),
        ('"degree": 2', '"degree": NaN', "a number"),
        ("[1, 0]", "[1.0, 0]", "a number"),
        ("[1, 0]", "[1000, 0]", "an integer"),
        ("[1, 0]", "[-1, 0]", "an integer"),
        ("[1, 0]", "[" * 100_000, "nesting"),
        ("[1, 0]", "[" * 13 + "]" * 13, "nesting"),
        ('"gram": ["1", "-1", "2"]', '"gram": [0.1, "-1", "2"]', "a number"),
        ('"2,0": "1"', '"2,0": "' + "9" * 401 + '"', "400 digits"),
        ('"2,0": "1"', '"2,0": "1/' + "9" * 401 + '"', "400 digits"),
    ],
)
def test_hostile_text_is_refused(before, after, reason):
    text = json.dumps(quadratic())
    assert before in text
    with pytest.raises(checker.Refused, match=reason) as refused:
        checker.check(text.replace(before, after, 1))
    assert len(str(refused.value)) < 300


GENERATOR = random.Random(3)


def digits(count):
    return str(GENERATOR.randrange(10 ** (count - 1), 10**count) | 1)


def fraction(count):
    return f"{digits(count)}/{2 ** (3 * count)}"


def pairs(count):
    return itertools.combinations_with_replacement(range(count), 2)


def grid(count, number=lambda: "1", step=1):
    return {f"{step * i},{step * j}": number() for i, j in itertools.product(range(count), repeat=2)}


def many_small_squares():
    return file({"0": "1"}, "sos", sos(*[square([[0]], "1")] * 80_000), names="x")


def large_elimination():
    gram = ["9" * 120 if i == j else digits(110) for i, j in pairs(250)]
    return file({"0": "1"}, "sos", sos(square([[i] for i in range(250)], *gram)), names="x")


def large_product():
    """2500 times 2500 terms of 300 digits."""
    document = file(grid(50, lambda: fraction(300)), "sos", sos())
    return document | {"multiplier": grid(50, lambda: fraction(300), step=2)}


def small_product():
    document = file(grid(70), "sos", sos())
    return document | {"multiplier": grid(70, step=2)}


def repeated_products():
    squares = [square([[i, i] for i in range(10)], *("1" if i == j else "0" for i, j in pairs(10)), product=[0])] * 8000
    return file({"0,0": "1"}, "sos", sos(*squares), on=[grid(70)], products=[[], [0]])


def dense_elements():
    basis = [grid(60) | {f"{100 + i},0": "1"} for i in range(80)]
    return file({"0,0": "1"}, "sos", sos(square(basis, *("9" if i == j else "1" for i, j in pairs(80)))))


def long_chain_of_inequalities():
    limits = [grid(40, lambda: digits(30)) | {"0,0": str(i)} for i in range(1, 20)]
    everything = list(range(19))
    proof = sos(square([[0, 0]], "1", product=everything))
    return file({"0,0": "1"}, "sos", proof, on=limits, products=[[], everything])


def high_powers():
    polynomial = {f"{i},{999 - i}": "1" for i in range(1000)}
    return file(polynomial, "negative", {"point": [f"{10**399 + 1}/{10**399 + 3}"] * 2})


def many_pairs(count=16, **limit):
    """1820 monomials for each of the products, and all of them drop out."""
    limits = [{"0,0,0,0": str(i + 1)} | limit for i in range(count)]
    products = [[], *([i] for i in range(count))]
    proof = {"functional": {"0,0,0,0": "1"}}
    return file({"0,0,0,0": "-1"}, "not-sos", proof, names="abcd", on=limits, products=products, degree=24)


def too_many_pairs():
    return many_pairs(22, **{"1,0,0,0": "1"})


def many_products():
    limits = [grid(3) | {"0,0": str(i + 1)} for i in range(10)]
    products = [list(c) for count in range(11) for c in itertools.combinations(range(10), count)]
    proof = {"functional": {"0,0": "1"}}
    return file({"0,0": "-1"}, "not-sos", proof, on=limits, products=products, degree=120)


def many_multiples():
    names = [f"x{i}" for i in range(12)]
    support = [m for m in itertools.product(range(2), repeat=12) if 0 < sum(m) <= 2]
    equal = [{",".join(map(str, m)): str(k) for m in support} for k in range(1, 11)]
    one = ",".join("0" * 12)
    return file({one: "-1"}, "not-sos", {"functional": {one: "1"}}, names=names, equal=equal, degree=9)


def hilbert_matrix():
    """The moments of [0, 1]: 400 by 400 with long pivots."""
    values = {str(i): str(Fraction(1, i + 1)) for i in range(799)}
    return file({str(i): "-1" for i in range(799)}, "not-sos", {"functional": values}, names="x", degree=798)


def long_moments():
    polynomial = {f"{i},{j}": "-1" for i in range(53) for j in range(53) if i + j <= 52}
    values = {key: fraction(390) for key in polynomial}
    return file(polynomial, "not-sos", {"functional": values}, degree=52)


HOSTILE = {
    "many small squares": (many_small_squares, "identity"),
    "large elimination": (large_elimination, "fewer steps"),
    "large product": (large_product, "fewer steps"),
    "small product": (small_product, "20000 terms"),
    "repeated products": (repeated_products, "fewer steps"),
    "dense elements": (dense_elements, "fewer steps"),
    "long chain of inequalities": (long_chain_of_inequalities, "fewer steps"),
    "high powers": (high_powers, "fewer steps"),
    "too many pairs": (too_many_pairs, "fewer steps"),
    "many products": (many_products, "fewer steps"),
    "many multiples": (many_multiples, "fewer steps"),
    "Hilbert matrix": (hilbert_matrix, "fewer steps"),
    "long moments": (long_moments, "moment matrix"),
}


@pytest.mark.parametrize(
    "case", ["large product", "repeated products", "high powers", "too many pairs", "many multiples"]
)
def test_work_is_bounded(case, monkeypatch):
    monkeypatch.setattr(exact_numbers, "MAX_STEPS", 20_000)
    make, reason = HOSTILE[case]
    assert reason in refusal(make())


@pytest.mark.slow
@pytest.mark.parametrize("case", HOSTILE)
def test_the_worst_files_end_within_a_minute(case):
    make, reason = HOSTILE[case]
    text = json.dumps(make(), separators=(",", ":"))
    assert len(text) <= exact_numbers.MAX_BYTES
    start = time.process_time()
    with pytest.raises(checker.Refused, match=reason):
        checker.check(text)
    assert time.process_time() - start < 60


@pytest.mark.slow
def test_the_largest_reduction_ends_within_a_minute():
    start = time.process_time()
    assert verify(many_pairs()).verdict == "refuted"
    assert time.process_time() - start < 60


NEGATIVE, BY_X, BY_Y = {(0, 0): Fraction(-1)}, {(2, 0): Fraction(-1)}, {(0, 2): Fraction(-3)}


@pytest.mark.parametrize(
    ("inequalities", "equalities", "polynomial", "empty"),
    [
        ([NEGATIVE | BY_X], [], {}, True),  # -1 - x^2 >= 0
        ([{(1, 0): Fraction(1)}, NEGATIVE | BY_X | BY_Y], [], {}, True),
        ([NEGATIVE], [], {}, True),
        ([BY_X], [], {}, False),  # at x = 0
        ([NEGATIVE | {(2, 0): Fraction(1)}], [], {}, False),
        ([NEGATIVE | {(2, 0): Fraction(1, 2)}], [], {}, False),
        ([NEGATIVE | {(1, 0): Fraction(-1)}], [], {}, False),  # at x = -1
        ([NEGATIVE | {(2, 1): Fraction(-1)}], [], {}, False),
        ([], [{(0, 0): Fraction(1), (2, 0): Fraction(1)}], {}, True),  # 1 + x^2 = 0
        ([], [NEGATIVE | BY_X], {}, True),
        ([], [{(0, 0): Fraction(1)} | BY_X], {}, False),
        ([], [], NEGATIVE, True),  # -1 >= 0, proved
        ([], [], NEGATIVE | BY_X, False),
        ([], [], BY_X, False),
        ([], [], {(0, 0): Fraction(1)}, False),
        ([], [], {}, False),
    ],
)
def test_a_set_without_points_is_seen_by_signs_and_even_powers_alone(inequalities, equalities, polynomial, empty):
    found = polynomials.Statement(["x", "y"], polynomial, {(0, 0): Fraction(1)}, inequalities, equalities, [], 2)
    assert polynomials.is_empty(found) is empty


def test_a_number_is_as_long_as_the_longer_of_numerator_and_denominator():
    assert [exact_numbers.length(Fraction(*parts)) for parts in ((9, 2), (2, 9), (-9, 2))] == [4, 4, 4]


def test_a_proof_on_an_empty_set_says_so():
    """-1 = x^2 + (-1 - x^2), where the set of the second has no point; the disc is not empty."""
    nowhere = {"0,0": "-1", "2,0": "-1"}
    proof = sos(square([[1, 0]], "1"), square([[0, 0]], "1", product=[0]))
    said = checker.check(json.dumps(file({"0,0": "-1"}, "sos", proof, on=[nowhere], products=[[], [0]]))).statement
    assert said[-1] == "the set is empty, so the statement holds trivially"
    assert not any("empty" in line for line in checker.check(json.dumps(disc())).statement)
