"""A budget of work: what a file can cost is counted before it is done, and only while it is checked."""

import json
import random
import time
from contextlib import nullcontext
from fractions import Fraction as F
from pathlib import Path

import pytest

from quakedesign.checking import check_files
from quakedesign.errors import WorkError
from quakedesign.lyapunov import load_certificate
from quakedesign.sos import Answer, Positivity
from quakedesign.sos.exact import work_budget as work
from quakedesign.sos.exact.polynomial import (
    _eliminates,
    evaluate,
    nonnegative_definite,
    positive_definite,
    positive_definite_integers,
    product,
)
from quakedesign.sos.exact.polynomial_files import read as read_polynomial_file
from quakedesign.sos.exact.polynomial_statement import Statement
from quakedesign.sos.exact.polynomial_statement import statement as usual
from quakedesign.sos.exact.proofs import (
    Functional,
    IntegerGram,
    Square,
    _contributions,
    _functional_holds,
    _sum,
    equality_monomials,
    form,
    integer_gram,
    localizing_matrix,
)
from quakedesign.sos.exact.work_budget import STEPS, TERMS, expanded, length, limited, longest, spend
from quakedesign.sos.solve.engine import prove

RANDOM = random.Random(5)


def long():
    return str(RANDOM.randrange(10**398, 10**399) | 1)


def file(polynomial, proof, names="x", **more):
    one = ",".join("0" * len(names))
    whole = {
        "format": 1, "variables": list(names), "polynomial": polynomial, "inequalities": [], "equalities": [],
        "products": [[]], "degree": 999, "multiplier": {one: "1"},
    }  # fmt: skip
    return whole | proof | more


def sos(*squares):
    return {"sos": {"squares": list(squares), "cofactors": [], "multiplier": []}}


def verdict(document, tmp_path):
    path = tmp_path / "file.json"
    path.write_text(json.dumps(document))
    ((found, said),) = check_files([path]).values()
    return found, said


def grid(count, number=lambda: "1", step=1):
    return {f"{step * i},{step * j}": number() for i in range(count) for j in range(count)}


HOSTILE = {
    "a thousand different denominators at a point": lambda: file(
        {str(i): f"1/{long()}" for i in range(1000)}, {"negative": {"point": ["-1/3"]}}
    ),
    "high powers of long numbers": lambda: file(
        {f"{i},{999 - i}": "1" for i in range(1000)},
        {"negative": {"point": [f"{10**399 + 1}/{10**399 + 3}"] * 2}},
        "xy",
    ),
    "a thousand different denominators in an identity": lambda: file(
        {str(i): f"1/{long()}" for i in range(1000)}, sos({"product": [], "basis": [[0]], "gram": ["1"]})
    ),
    "a product of too many terms": lambda: file(grid(70), sos(), "xy", multiplier=grid(70, step=2)),
    "many multiples of equalities": lambda: file(
        {",".join("0" * 12): "-1"}, {"not-sos": {"functional": {",".join("0" * 12): "1"}}}, "abcdefghijkl",
        equalities=[
            {",".join("1" if i in (j, k) else "0" for i in range(12)): "1" for j in range(k, 12)} for k in range(9)
        ],
        degree=9,
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", HOSTILE)
def test_a_file_that_would_take_too_long_is_undecided_within_seconds(case, tmp_path):
    start = time.process_time()
    found, said = verdict(HOSTILE[case](), tmp_path)
    assert found.startswith("undecided: ")
    assert "budget of exact arithmetic" in found or f"more than {TERMS} terms" in found
    assert said == []
    assert time.process_time() - start < 20


def test_a_value_of_more_digits_than_python_prints_is_shown_rounded(tmp_path):
    document = file({str(i): f"-1/{long()}" for i in range(12)}, {"negative": {"point": ["3"]}})
    found, said = verdict(document, tmp_path)
    assert found == "refuted"
    shown = next(line for line in said if line.startswith("value at most -"))
    exact = sum(F(c) * F(3) ** int(e) for e, c in document["polynomial"].items())
    assert exact <= F(shown.removeprefix("value at most ")) < exact * F(999, 1000)


def test_nothing_is_counted_outside():
    for needed in (lambda: spend(10 * STEPS), lambda: expanded(10 * TERMS)):
        needed()
        with limited(), pytest.raises(WorkError):
            needed()


def test_a_budget_ends_where_it_is_used_up_and_the_outer_one_goes_on():
    with limited(10):
        spend(10)
        with limited(3), pytest.raises(WorkError, match="budget of exact arithmetic"):
            spend(4)
        with pytest.raises(WorkError):
            spend(1)


def test_long_numbers_cost_the_square_of_their_length():
    # 2048² = 4·2^20
    with limited(16 * 5):
        spend(16, 2**11)
        with pytest.raises(WorkError):
            spend(1)


def test_the_common_denominator_counts():
    with limited():
        assert longest([F(1, 2), F(1, 3), F(5, 7)]) == 3 + (2 * 3 * 7).bit_length()
        assert [longest([F(0)]), longest([F(1)]), longest([F(1, 2)])] == [0 + 1, 1 + 1, 1 + 2]
    assert longest([F(5, 7)]) == 0, "where nothing is counted"
    assert [length(F(1, 8)), length(F(8, 3)), length(F(0))] == [4, 4, 1]
    with limited(2), pytest.raises(WorkError):
        longest([F(1), F(2), F(3)])


def test_as_many_terms_as_allowed_are_expanded():
    with limited():
        expanded(TERMS)
        with pytest.raises(WorkError, match=f"more than {TERMS} terms"):
            expanded(TERMS + 1)


@pytest.mark.parametrize(
    "work",
    [
        lambda: evaluate({(i,): F(1, 10**300 + i) for i in range(40)}, [F(1, 3)]),
        lambda: product(2, [{(i, j): F(1) for i in range(30) for j in range(30)}] * 2),
        lambda: positive_definite([[F(1000 * (i == j) + 1) for j in range(60)] for i in range(60)]),
        lambda: nonnegative_definite([[F(1, i + j + 1) for j in range(40)] for i in range(40)]),
    ],
)
def test_every_kind_of_work_is_counted(work):
    work()
    with limited(200), pytest.raises(WorkError):
        work()


def statement(*equalities):
    """-1 >= 0 with squares of degree 2 in x, on where the equalities hold."""
    return Statement(
        variables=("x",), polynomial={(0,): F(-1)}, equalities=equalities, degree=2, multiplier={(0,): F(1)}
    )  # fmt: skip


ONE, X, LINE = (0,), (1,), {(0,): F(1), (1,): F(1)}
UNIT = IntegerGram([[1, 0], [0, 1]], 1)
STEPS_BY_HAND = {
    "four entries, their common denominator, and a determinant": (lambda: positive_definite([[F(3), F(1)]] * 2), 9),
    "a determinant of integers": (lambda: positive_definite_integers([[2]]), 1),
    "one of thirty rows of 90 bits": (
        lambda: positive_definite_integers([[2**89 * (i == j) for j in range(30)] for i in range(30)]),
        1 + 30**4 * (90 + 10) // 100_000,
    ),
    "an elimination of three rows, of two, of one": (
        lambda: _eliminates([[F(i == j) for j in range(3)] for i in range(3)]), 6 * (9 + 4 + 1),
    ),
    "three products of monomials": (lambda: form([ONE, X], UNIT, 1), 3),
    "two coefficients, two of another element, 2*2*(2 + 2) for their products, and three": (
        lambda: form([LINE, {ONE: F(2)}], UNIT, 1), 3 + 16 + 3,
    ),
    "three entries for each of two pairs of a weight of two terms": (
        lambda: localizing_matrix(LINE, [ONE, X], {ONE: F(1)}), 2**2 * 2,
    ),
    "pairs of a basis of two": (lambda: _contributions(statement(), [{ONE: None, X: None}]), 3),
    "two multiples of an equality of two terms": (lambda: equality_monomials(statement(LINE)), 2 * 2),
    "one of one term, of the whole degree": (lambda: equality_monomials(statement({(2,): F(1)})), 1),
    "a square of two terms, times one, added": (
        lambda: _sum(statement(), [(Square(basis=(ONE, X), gram=(F(1), F(0), F(1))), UNIT)]), 3 + 2 + 2,
    ),
    "each coefficient twice of values, target, equality and weight, and two multiples of the equality": (
        lambda: _functional_holds(statement(LINE), Functional(values={ONE: F(1), X: F(-1)})),
        2 * (2 + 1 + 2 + 1) + 10 * 2 * 2 + 2,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", STEPS_BY_HAND)
def test_work_is_counted_before_it_is_done(name):
    work, steps = STEPS_BY_HAND[name]
    with limited(steps):
        work()
    with limited(steps - 1), pytest.raises(WorkError):
        work()


def test_the_terms_of_a_sum_are_counted_beyond_those_of_its_squares(monkeypatch):
    """Three of either square, six of their sum."""
    squares = tuple(
        Square(product=(), basis=((low,), (high,)), gram=(F(1), F(1), F(2))) for low, high in ((0, 1), (3, 5))
    )
    for terms, fits in ((6, True), (5, False)):
        monkeypatch.setattr(work, "TERMS", terms)
        with limited(), nullcontext() if fits else pytest.raises(WorkError, match="more than 5 terms"):
            assert len(_sum(usual(("x",), {}), [(square, integer_gram(square)) for square in squares])) == 6


CERTIFICATES = Path(__file__).parents[3] / "proofs" / "certificates"
SQUARE = file({"2": "1", "1": "-2", "0": "2"}, sos({"product": [], "basis": [[0], [1]], "gram": ["2", "-1", "1"]}))


def decides(check):
    try:
        check()
    except WorkError:
        return False
    return True


@pytest.mark.parametrize("name", ["super-twisting_1.5_1.1", "polynomial"])
def test_the_command_and_python_refuse_the_same_work_to_the_last_step(name, tmp_path, monkeypatch):
    path = CERTIFICATES / f"{name}.json"
    if name == "polynomial":
        path = tmp_path / "polynomial.json"
        path.write_text(json.dumps(SQUARE | {"degree": 2}))
        statement, proof = read_polynomial_file(json.loads(path.read_text()))
        evidence = Answer(statement=statement, proof=proof)
    else:
        evidence = load_certificate(path)

    def fits(steps):
        monkeypatch.setattr(work, "STEPS", steps)
        return decides(evidence.check)

    low, high = 0, 10**6
    assert (fits(low), fits(high)) == (False, True)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if fits(middle) else (middle, high)
    for steps, expected in ((high, "proved"), (low, "undecided: the check exceeds its budget")):
        assert fits(steps) == (expected == "proved")
        ((found, _),) = check_files([path]).values()
        assert found.startswith(expected)


def test_what_would_take_too_long_to_check_is_not_found(monkeypatch):
    """A search does not count; the check of what it finds does."""
    monkeypatch.setattr(work, "STEPS", 1)
    assert prove("x^2 - 2*x + 2").verdict is Positivity.UNDECIDED
