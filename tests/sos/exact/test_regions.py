"""Regions of attraction by hand: claims, empty sets, sentences and JSON entries, and the file of a field."""

from dataclasses import replace
from fractions import Fraction as F

import pytest

from quakedesign.errors import CertificateError, PolynomialError
from quakedesign.sos.exact import attraction
from quakedesign.sos.exact.answer import Answer, Positivity
from quakedesign.sos.exact.attraction import Attraction, LyapunovProof, Region, along, read_field
from quakedesign.sos.exact.polynomial_statement import Statement, statement
from quakedesign.sos.exact.proofs import Functional, Point, Square, SumOfSquares
from quakedesign.sos.exact.words import claim_words, region_entries, region_words, sentences, statement_words

ONE = {(0,): F(1)}


def square(*monomials, gram=None):
    """Σ m² of monomials in one variable."""
    count = len(monomials)
    unit = tuple(F(int(i == j)) for i in range(count) for j in range(i, count))
    return Square(product=(), basis=tuple((m,) for m in monomials), gram=gram or unit)


# x' = -x, V = x², V' = -2x²
STABLE = Attraction(
    variables=("x",),
    field=({(1,): F(-1)},),
    lyapunov={(2,): F(1)},
    level=None,
    multiplier=ONE,
    proof=LyapunovProof(
        positive=SumOfSquares(squares=(square(1),)), decrease=SumOfSquares(squares=(square(1, gram=(F(2),)),))
    ),
)
# x' = -x + x³ has the equilibria 0 and ±1; V = x²
CUBIC = replace(STABLE, field=({(1,): F(-1), (3,): F(1)},), level=F(1, 2), proof=None)
EQUILIBRIUM = replace(CUBIC, level=F(2), proof=Point(coordinates=(F(1),)))
BEYOND = replace(CUBIC, level=None, proof=Point(coordinates=(F(2),)))


def test_a_claim_is_decided_by_its_proof():
    assert (STABLE.verdict, STABLE.refutation, STABLE.height, STABLE.equilibrium) == ("proved", None, None, False)
    assert STABLE.check()
    assert (CUBIC.verdict, CUBIC.check()) == ("undecided", True)
    assert (EQUILIBRIUM.verdict, EQUILIBRIUM.height, EQUILIBRIUM.equilibrium) == ("refuted", 1, True)
    assert (BEYOND.verdict, BEYOND.height, BEYOND.equilibrium) == ("refuted", 4, False)
    assert EQUILIBRIUM.check()
    assert BEYOND.check()


@pytest.mark.parametrize(
    ("claim", "point", "refuted"),
    [
        (CUBIC, [F(1, 2)], False),  # V decreases there
        (CUBIC, [F(1)], False),  # V is above the level
        (replace(CUBIC, level=F(1)), [F(1)], False),  # V is the level itself
        (EQUILIBRIUM, [F(1)], True),
        (EQUILIBRIUM, [F(0)], False),
        (EQUILIBRIUM, [F(1), F(0)], False),
        (replace(CUBIC, lyapunov={(2,): F(-1)}), [F(1, 9)], True),  # V <= 0
        (replace(CUBIC, lyapunov={(3,): F(1), (2,): F(1)}), [F(-1)], True),  # V = 0
        (BEYOND, [F(9, 10)], False),
    ],
)
def test_a_point_refutes_where_v_is_not_positive_or_does_not_decrease(claim, point, refuted):
    assert replace(claim, proof=None).refuted_by(Point(coordinates=tuple(point))) == refuted
    assert replace(claim, proof=Point(coordinates=tuple(point))).check() == refuted


@pytest.mark.parametrize("part", ["positive", "decrease"])
def test_both_parts_of_a_proof_must_hold_and_vanish_at_the_origin_only(part):
    wrong = replace(STABLE.proof, **{part: SumOfSquares(squares=(square(1, gram=(F(3),)),))})
    assert not replace(STABLE, proof=wrong).check()
    flat = Attraction(
        variables=("x", "y"),
        field=({(1, 0): F(-1)}, {(0, 1): F(-1)}),
        lyapunov={(2, 0): F(1)},
        level=None,
        multiplier={(0, 0): F(1)},
        proof=LyapunovProof(
            positive=SumOfSquares(squares=(Square(product=(), basis=((1, 0),), gram=(F(1),)),)),
            decrease=SumOfSquares(squares=(Square(product=(), basis=((1, 0),), gram=(F(2),)),)),
        ),
    )
    assert not flat.check()  # V = x² is 0 on the whole y axis


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"field": ()}, "a field of 1 states needs 1 polynomials. Received 0"),
        ({"field": ({(1,): F(1)}, {(1,): F(1)})}, "needs 1 polynomials. Received 2"),
        ({"lyapunov": {(0,): F(1), (2,): F(1)}}, "must vanish at the origin"),
        ({"field": ({(0,): F(1)},)}, "must vanish at the origin"),
        ({"level": F(0)}, "a level must be positive. Received 0"),
        ({"level": F(-1)}, "a level must be positive. Received -1"),
    ],
)
def test_claims_that_are_not_well_formed_are_rejected(change, said):
    with pytest.raises(PolynomialError, match=said):
        replace(STABLE, **change)


def test_one_of_two_rates_with_a_constant_term_is_rejected():
    with pytest.raises(PolynomialError, match="must vanish at the origin"):
        Attraction(
            variables=("x", "y"), field=({(1, 0): F(1)}, {(0, 0): F(1)}), lyapunov={(2, 0): F(1)}, level=None,
            multiplier={(0, 0): F(1)},
        )  # fmt: skip


def test_a_derivative_along_a_field():
    """V = x²y + 3y, x' = y, y' = -x: 2xy·y - x·(x² + 3)."""
    V = {(2, 1): F(1), (0, 1): F(3)}
    assert along(({(0, 1): F(1)}, {(1, 0): F(-1)}), V) == {(1, 2): 2, (3, 0): -1, (1, 0): -3}


def test_statements_of_a_claim():
    """V = x² ≥ 0 everywhere, -V' = 2x² - 2x⁴ ≥ 0 where 1/2 - x² ≥ 0."""
    assert (CUBIC.positive.polynomial, CUBIC.positive.inequalities) == ({(2,): 1}, ())
    assert CUBIC.decrease.polynomial == {(2,): 2, (4,): -2}
    assert CUBIC.decrease.inequalities == ({(0,): F(1, 2), (2,): F(-1)},)
    assert (CUBIC.decrease.degree, CUBIC.decrease.products) == (4, ((), (0,)))
    assert STABLE.decrease.inequalities == ()


# ---------------------------------------------------------------- sentences and entries


INSIDE = Answer(
    statement=Statement(
        variables=("x",), polynomial={(0,): F(1, 2), (2,): F(-1)}, inequalities=({(0,): F(1, 8), (2,): F(-3)},),
        products=((), (0,)), degree=2, multiplier=ONE,
    ),
    proof=None,
)  # fmt: skip
PROVED = replace(STABLE, level=F(1, 3))


def test_words_of_claims():
    field = ["x' = -x", "V = x^2"]
    assert claim_words(STABLE) == [
        *field, "every solution from any initial state tends to the origin, which is asymptotically stable",
    ]  # fmt: skip
    assert claim_words(PROVED) == [
        *field,
        "every solution that starts where V < 1/3 (0.333333 rounded down) tends to the origin, which is "
        "asymptotically stable",
    ]
    cubic = ["x' = x^3 - x", "V = x^2"]
    assert claim_words(CUBIC) == cubic
    assert claim_words(EQUILIBRIUM) == [
        *cubic, "level 2 is refuted for this V", "another equilibrium, which no region of attraction contains: x = 1",
    ]  # fmt: skip
    assert claim_words(BEYOND) == [
        *cubic, "V does not decrease at x = 2, which refutes every level above 4 (rounded up)",
    ]  # fmt: skip
    assert claim_words(replace(BEYOND, lyapunov={(2,): F(1, 8)}))[-1] == (
        "V does not decrease at x = 2, which refutes every level above 0.5 (rounded up)"
    )
    assert claim_words(replace(BEYOND, lyapunov={(2,): F(-1)}))[-1] == "V is not positive at x = 2"
    assert claim_words(replace(BEYOND, lyapunov={(2,): F(1), (1,): F(-2)}))[-1] == "V is not positive at x = 2"


def test_words_and_entries_of_a_region_with_both_ends_and_a_shape():
    region = Region(proved=PROVED, refuted=BEYOND, inclusion=INSIDE)
    assert (region.verdict, region.level, region.shape_level, region.refuted_above) == ("proved", F(1, 3), F(1, 8), 4)
    assert region_words(region) == [
        "proved",
        *claim_words(PROVED),
        "the region contains 3*x^2 <= 1/8 (0.125 rounded down)",
        "V does not decrease at x = 2, which refutes every level above 4 (rounded up)",
    ]
    assert region_entries(region) == {
        "verdict": "proved", "variables": ["x"], "V": "x^2", "everywhere": False, "level": "1/3", "shape": "3*x^2",
        "shape_level": "1/8", "refuted_above": "4", "point": ["2"], "equilibrium": False, "remark": None,
    }  # fmt: skip


def test_a_shape_in_two_variables_is_that_of_the_inclusion():
    disc = {(0, 0): F(1, 8), (2, 0): F(-3), (0, 2): F(-1), (1, 1): F(1)}
    inside = replace(
        INSIDE,
        statement=Statement(
            variables=("x", "y"), polynomial={(0, 0): F(1)}, inequalities=(disc,), products=((), (0,)), degree=2,
            multiplier={(0, 0): F(1)},
        ),
    )  # fmt: skip
    entries = region_entries(Region(proved=PROVED, refuted=None, inclusion=inside))
    assert (entries["shape"], entries["shape_level"]) == ("3*x^2 - x*y + y^2", "1/8")


def test_words_and_entries_of_the_whole_space_a_refutation_and_neither():
    whole = Region.of(STABLE)
    assert region_words(whole) == ["proved", *claim_words(STABLE)]
    assert region_entries(whole) == {
        "verdict": "proved", "variables": ["x"], "V": "x^2", "everywhere": True, "level": None, "shape": None,
        "shape_level": None, "refuted_above": None, "point": None, "equilibrium": None, "remark": None,
    }  # fmt: skip
    refuted = Region.of(BEYOND)
    assert (refuted.verdict, region_words(refuted)) == ("refuted", ["refuted", *claim_words(BEYOND)])
    assert region_entries(refuted) | {"V": ""} == {
        "verdict": "refuted", "variables": ["x"], "V": "", "everywhere": False, "level": None, "shape": None,
        "shape_level": None, "refuted_above": "4", "point": ["2"], "equilibrium": False, "remark": None,
    }  # fmt: skip
    one_level = Region.of(EQUILIBRIUM)
    assert (one_level.verdict, region_entries(one_level)["equilibrium"]) == ("undecided", True)
    nothing = Region.of(CUBIC)
    assert region_words(nothing) == ["undecided", "neither a proof nor a counterexample was found"]
    assert Region.of(replace(CUBIC, reason="too long")).remark == "too long"
    assert region_entries(nothing) == {
        "verdict": "undecided", "variables": None, "V": None, "everywhere": False, "level": None, "shape": None,
        "shape_level": None, "refuted_above": None, "point": None, "equilibrium": None,
        "remark": "neither a proof nor a counterexample was found",
    }  # fmt: skip


def test_a_file_is_ascii_and_its_polynomials_are_in_its_variables():
    text = attraction.text(STABLE)
    assert attraction.load(text) == STABLE
    assert text.isascii()
    accented = attraction.text(STABLE).replace('"x"', '"y"')
    assert attraction.load(accented).variables == ("y",)
    for key in ('"V":{"2":"1"}', '"multiplier":{"0":"1"}'):
        assert key in text
        with pytest.raises(CertificateError, match="a polynomial has another number of variables"):
            attraction.load(text.replace(key, key.replace('":"1"', ',0":"1"')))


# ---------------------------------------------------------------- sets that are evidently empty


SQUARES = SumOfSquares(squares=())


def answer(polynomial, proof=SQUARES, **sets):
    return Answer(statement=statement(("x", "y"), polynomial, **sets), proof=proof)


X2 = {(2, 0): F(1)}
MINUS = {(0, 0): F(-1)}


@pytest.mark.parametrize(
    ("given", "empty"),
    [
        ({"polynomial": MINUS}, True),
        ({"polynomial": {(0, 0): F(1)}}, False),
        ({"polynomial": {(0, 0): F(-1), (2, 0): F(-1)}}, False),  # not constant
        ({"polynomial": {(0, 0): F(-1), (0, 2): F(-1)}}, False),
        ({"polynomial": X2, "inequalities": ({(0, 0): F(-1), (2, 2): F(-3)},)}, True),
        ({"polynomial": X2, "inequalities": ({(0, 0): F(-1), (2, 1): F(-3)},)}, False),  # an odd exponent
        ({"polynomial": X2, "inequalities": ({(0, 0): F(-1), (3, 2): F(-3)},)}, False),
        ({"polynomial": X2, "inequalities": ({(0, 0): F(-1), (1, 1): F(-3)},)}, False),
        ({"polynomial": X2, "inequalities": ({(0, 0): F(-1), (6, 0): F(-3)},)}, True),
        ({"polynomial": X2, "inequalities": ({(0, 0): F(-1), (2, 2): F(3)},)}, False),
        ({"polynomial": X2, "inequalities": ({(0, 0): F(1), (2, 2): F(-3)},)}, False),
        ({"polynomial": X2, "inequalities": ({(2, 0): F(-1), (2, 2): F(-3)},)}, False),  # 0 at the origin
        ({"polynomial": X2, "inequalities": ({(0, 0): F(-1, 2)},)}, True),
        ({"polynomial": X2, "inequalities": ({(0, 0): F(1, 2)},)}, False),
        ({"polynomial": X2, "equalities": ({(0, 0): F(-1), (2, 2): F(-3)},)}, True),
        ({"polynomial": X2, "equalities": ({(0, 0): F(1), (2, 2): F(3)},)}, True),
        ({"polynomial": X2, "equalities": ({(0, 0): F(1), (2, 2): F(-3)},)}, False),
    ],
)
def test_a_set_is_evidently_empty(given, empty):
    assert answer(**given).set_is_empty == empty
    assert not answer(**given, proof=None).set_is_empty
    assert not answer(**given, proof=Point(coordinates=(F(0), F(0)))).set_is_empty


def test_a_proof_on_an_empty_set_says_so():
    assert "the set is empty, so the statement holds trivially" in sentences(answer(MINUS))
    assert "the set is empty, so the statement holds trivially" not in sentences(answer(X2))


def test_a_verdict_is_that_of_the_proof():
    assert [answer(X2, proof=p).verdict for p in (None, SumOfSquares(squares=()), Functional(values={}))] == [
        Positivity.UNDECIDED, Positivity.SOS, Positivity.NOT_SOS,
    ]  # fmt: skip


def test_details_of_an_answer_give_products_degree_and_a_functional():
    asked = Answer(
        statement=Statement(
            variables=("x",), polynomial={(2,): F(1)}, inequalities=({(1,): F(1)}, {(1,): F(-1), (0,): F(1)}),
            products=((), (0,), (0, 1)), degree=4, multiplier=ONE,
        ),
        proof=None,
    )  # fmt: skip
    assert statement_words(asked) == ["products: 1, [0], [0]*[1]; degree: 4"]
    functional = replace(asked, proof=Functional(values={(0,): F(1, 2), (2,): F(-3), (1,): F(4)}))
    assert statement_words(functional)[1:] == [
        "functional, zero on all other monomials: L(x^2) = -3, L(x) = 4, L(1) = 1/2"
    ]
    long = {(i,): F(10**9 + i) for i in range(30)}
    whole = statement_words(replace(asked, statement=statement(("x",), long)))
    assert whole[0].startswith("polynomial: 1000000029*x^29 + 1000000028*x^28")
    assert whole[0].endswith("+ 1000000001*x + 1000000000")


# ---------------------------------------------------------------- the file of a field


@pytest.mark.parametrize(
    ("written", "field"),
    [
        ('[field]\nx = "-x"\n', ({"x": "-x"}, None)),
        ('V = "x^2"\n[field]\nx = "y"\ny = "-x"\n', ({"x": "y", "y": "-x"}, "x^2")),
        ("[field]\n", ({}, None)),
    ],
)
def test_a_field_and_its_function_are_read_as_text(written, field, tmp_path):
    (tmp_path / "field.toml").write_text(written)
    assert read_field(tmp_path / "field.toml") == field


@pytest.mark.parametrize(
    "written",
    ['V = "x"\n', '[field]\nx = "-x"\ny = 1\n', '[field]\nx = 1\ny = "-x"\n', 'W = "x"\n[field]\nx = "-x"\n',
     'V = 3\n[field]\nx = "-x"\n', 'field = "x"\n'],
)  # fmt: skip
def test_other_keys_and_values_of_a_field_are_rejected(written, tmp_path):
    (tmp_path / "field.toml").write_text(written)
    with pytest.raises(PolynomialError, match=r"must have a table \[field\]"):
        read_field(tmp_path / "field.toml")


@pytest.mark.parametrize(("size", "read"), [(1 << 16, True), ((1 << 16) + 1, False)])
def test_a_field_is_read_up_to_64_kibibytes(size, read, tmp_path):
    text = '[field]\nx = "-x"\n'
    (tmp_path / "field.toml").write_text(text + "#" * (size - len(text) - 1) + "\n")
    if read:
        assert read_field(tmp_path / "field.toml") == ({"x": "-x"}, None)
        return
    with pytest.raises(PolynomialError, match="at most 64 KiB"):
        read_field(tmp_path / "field.toml")


def test_what_is_no_toml_is_rejected_in_one_line(tmp_path):
    (tmp_path / "field.toml").write_text("[field]\nx = -x\n")
    with pytest.raises(PolynomialError, match=r"must be TOML\. Received: [^\n]+\. Quote polynomials\.$"):
        read_field(tmp_path / "field.toml")
