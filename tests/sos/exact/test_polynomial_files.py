import dataclasses
import json
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quakedesign import sos
from quakedesign.errors import CertificateError
from quakedesign.sos.exact.answer import Answer
from quakedesign.sos.exact.polynomial_files import load, save, text
from quakedesign.sos.exact.proofs import Functional, Point, holds

QUESTIONS = {
    "square": ("(x - y)^2 + y^2", {}),
    "face": ("(x - y)^2", {}),
    "interval": ("x - x^2 + 1", {"on": ("x >= 0", "x <= 1")}),
    "circle": ("2 - x*y", {"on": ("x^2 + y^2 == 1",)}),
    "motzkin": ("x^4*y^2 + x^2*y^4 + 1 - 3*x^2*y^2", {"multiplier": "1 + x^2 + y^2"}),
    "refuted": ("x^4*y^2 + x^2*y^4 + 1 - 3*x^2*y^2", {}),
    "negative": ("x^2 - 2*x", {}),
}


@pytest.fixture(scope="module", params=QUESTIONS)
def written(request):
    polynomial, options = QUESTIONS[request.param]
    answer = sos.prove(polynomial, **options)
    return text(answer.statement, answer.proof)


def test_what_is_written_reads_back_and_holds(written):
    statement, proof = load(written)
    assert holds(statement, proof)
    assert text(statement, proof) == written


def leaves(value, path=()):
    if isinstance(value, dict):
        for key in value:
            yield from leaves(value[key], (*path, key))
    elif isinstance(value, list):
        for i, entry in enumerate(value):
            yield from leaves(entry, (*path, i))
    else:
        yield path, value


def replaced(value, path, new):
    if not path:
        return new
    copy = dict(value) if isinstance(value, dict) else list(value)
    copy[path[0]] = replaced(value[path[0]], path[1:], new)
    return copy


def test_changing_any_number_of_the_proof_loses_it(written):
    """A changed value of a functional may stay a proof of the same statement; everything else must break."""
    raw = json.loads(written)
    kind = next(k for k in ("sos", "not-sos", "negative") if k in raw)
    for path, value in leaves(raw[kind]):
        if kind != "sos":
            continue
        new = str(Fraction(value) + 1) if isinstance(value, str) else value + 1
        try:
            statement, proof = load(json.dumps(replaced(raw, (kind, *path), new)))
        except CertificateError:
            continue
        assert not holds(statement, proof), path


def test_pairing_a_proof_with_another_polynomial_loses_it(written):
    raw = json.loads(written)
    if "sos" in raw:
        for key, c in raw["polynomial"].items():
            other = raw | {"polynomial": raw["polynomial"] | {key: str(Fraction(c) + Fraction(1, 7))}}
            statement, proof = load(json.dumps(other))
            assert not holds(statement, proof)


HOSTILE = [
    "",
    "[]",
    "{",
    '{"polynomial": {}}',
    "[" * 100_000,
    '{"polynomial": ' + "9" * 5000 + "}",
    '{"polynomial": NaN}',
    '{"polynomial": 1.5}',
    '{"polynomial": {}, "polynomial": {}}',
]


@pytest.mark.parametrize("hostile", HOSTILE)
def test_hostile_texts_are_refused(hostile):
    with pytest.raises(CertificateError):
        load(hostile)


@given(data=st.data())
def test_truncated_or_mistyped_files_are_refused(data):
    answer = sos.prove("(x - y)^2 + y^2")
    raw = json.loads(text(answer.statement, answer.proof))
    path, _ = data.draw(st.sampled_from(list(leaves(raw))))
    new = data.draw(st.sampled_from([None, True, -1, 10**6, "1/0", "01", "2/4", "", [], {}, 1.5, "x" * 500]))
    try:
        statement, proof = load(json.dumps(replaced(raw, path, new)))
    except CertificateError:
        return
    assert not holds(statement, proof)


# ---------------------------------------------------------------- every rule of a file by itself

BY_HAND = {
    "format": 1,
    "variables": ["x", "y"],
    "polynomial": {"2,0": "1", "0,2": "1"},
    "inequalities": [{"1,0": "1"}],
    "equalities": [],
    "products": [[], [0]],
    "degree": 2,
    "multiplier": {"0,0": "1"},
    "sos": {
        "squares": [{"product": [], "basis": [[1, 0], [0, 1]], "gram": ["1", "0", "1"]}],
        "cofactors": [],
        "multiplier": [],
    },
}
SQUARE = ("sos", "squares", 0)


def with_square(**parts):
    return replaced(BY_HAND, SQUARE, BY_HAND["sos"]["squares"][0] | parts)


ILL_FORMED = {
    "format true": BY_HAND | {"format": True},
    "format 2": BY_HAND | {"format": 2},
    "no variables": BY_HAND | {"variables": []},
    "a variable that is no name": BY_HAND | {"variables": ["x", "y z"]},
    "a variable that is a number": BY_HAND | {"variables": ["x", 1]},
    "a variable twice": BY_HAND | {"variables": ["x", "x"]},
    "seventeen variables": BY_HAND | {"variables": [f"x{i}" for i in range(17)]},
    "degree true": BY_HAND | {"degree": True},
    "degree negative": BY_HAND | {"degree": -1},
    "product of booleans": BY_HAND | {"products": [[], [False]]},
    "product unknown": BY_HAND | {"products": [[], [1]]},
    "multiplier empty": BY_HAND | {"multiplier": {}},
    "33 conditions": BY_HAND | {"inequalities": [{"1,0": str(i)} for i in range(1, 34)]},
    "33 conditions of both kinds": BY_HAND
    | {"inequalities": [{"1,0": str(i)} for i in range(1, 18)], "equalities": [{"1,0": "1"}] * 16}
    | {"sos": BY_HAND["sos"] | {"cofactors": [{}] * 16}},
    "a number": 5,
    "gram too fine": with_square(basis=[[i, 0] for i in range(12)], gram=[f"1/{10**399 + i}" for i in range(78)]),
    "two kinds of proof": BY_HAND | {"negative": {"point": ["0", "0"]}},
    "square of a product that is not listed": with_square(product=[0, 0]),
    "square of a product of booleans": with_square(product=[False]),
    "basis empty": with_square(basis=[], gram=[]),
    "basis repeated": with_square(basis=[[1, 0], [1, 0]], gram=["1", "0", "1"]),
    "basis of a monomial as a polynomial": with_square(basis=[{"1,0": "1"}, [0, 1]]),
    "basis of an empty polynomial": with_square(basis=[{}, [0, 1]]),
    "basis of another length": with_square(basis=[[1], [0, 1]]),
    "basis with a negative exponent": with_square(basis=[[1, -1], [0, 1]]),
    "basis of a polynomial in another number of variables": with_square(basis=[{"1": "2", "0": "1"}, [0, 1]]),
    "cofactor in another number of variables": BY_HAND
    | {"equalities": [{"1,0": "1"}], "sos": BY_HAND["sos"] | {"cofactors": [{"1": "1"}]}},
    "gram too short": with_square(gram=["1", "0"]),
    "gram too long": with_square(gram=["1", "0", "1", "0"]),
    "cofactor without equality": replaced(BY_HAND, ("sos", "cofactors"), [{}]),
    "no object": [BY_HAND],
}


@pytest.mark.parametrize("case", ILL_FORMED)
def test_what_breaks_a_rule_is_not_read(case):
    load(json.dumps(BY_HAND))
    with pytest.raises(CertificateError):
        load(json.dumps(ILL_FORMED[case]))


MANY = {f"{i},{j}": "1" for i in range(142) for j in range(142)}


@pytest.mark.parametrize("key", ["polynomial", "functional"])
def test_a_polynomial_of_a_file_has_at_most_20000_terms(key):
    plain = {name: entry for name, entry in BY_HAND.items() if name != "sos"}
    refuted = plain | {"not-sos": {"functional": {"0,0": "1"}}}
    assert load(json.dumps(refuted))[1] == Functional(values={(0, 0): Fraction(1)})
    long = refuted | ({"polynomial": MANY} if key == "polynomial" else {"not-sos": {"functional": MANY}})
    with pytest.raises(CertificateError, match=f"{key} is longer than 20000 terms"):
        load(json.dumps(long))


@pytest.mark.parametrize("point", [[], ["1"], ["1", "0", "1"]])
def test_a_point_has_a_coordinate_for_every_variable(point):
    negative = {key: entry for key, entry in BY_HAND.items() if key != "sos"}
    statement, proof = load(json.dumps(negative | {"negative": {"point": ["-1", "0"]}}))
    assert (proof, statement.variables) == (Point(coordinates=(Fraction(-1), Fraction(0))), ("x", "y"))
    with pytest.raises(CertificateError, match="point must have 2 coordinates"):
        load(json.dumps(negative | {"negative": {"point": point}}))


@pytest.mark.parametrize(
    "fine",
    [
        BY_HAND | {"degree": 0},
        BY_HAND | {"variables": [f"x{i}" for i in range(16)], "polynomial": {}, "inequalities": [], "products": [[]],
                   "multiplier": {",".join("0" * 16): "1"}, "sos": BY_HAND["sos"] | {"squares": []}},
        BY_HAND | {"inequalities": [{"1,0": str(i)} for i in range(1, 33)]},
        with_square(basis=[{"1,0": "2"}, [0, 1]]),
        with_square(basis=[{"1,0": "1", "0,0": "1"}, [0, 1]]),
        with_square(basis=[[999, 0], [0, 1]]),
    ],
    ids=["degree 0", "16 variables", "32 conditions", "twice a monomial", "a polynomial", "exponent 999"],
)  # fmt: skip
def test_what_is_at_the_edge_of_a_rule_is_read(fine):
    statement, proof = load(json.dumps(fine))
    assert json.loads(text(statement, proof)) == fine


def test_only_what_can_be_read_again_is_written(tmp_path):
    statement, proof = load(json.dumps(BY_HAND))
    path = tmp_path / "proof.json"
    save(statement, proof, path)
    assert load(path.read_text()) == (statement, proof)
    assert path.read_text().isascii()
    other = tmp_path / "none.json"
    with pytest.raises(CertificateError, match="only a proof"):
        save(statement, None, other)
    fine = dataclasses.replace(proof.squares[0], gram=(Fraction(1, 10**401), Fraction(0), Fraction(1)))
    with pytest.raises(CertificateError, match="rational"):
        save(statement, dataclasses.replace(proof, squares=(fine,)), other)
    assert not other.exists()


def test_an_answer_is_its_proof(tmp_path):
    statement, proof = load(json.dumps(BY_HAND))
    answer = Answer(statement=statement, proof=proof)
    assert (str(answer.verdict), answer.check()) == ("sos", True)
    assert (answer.blocks, answer.seconds, answer.versions) == ({}, 0, {})
    wrong = Answer(statement=dataclasses.replace(statement, polynomial={(2, 0): Fraction(1)}), proof=proof)
    assert (str(wrong.verdict), wrong.check()) == ("sos", False)
    undecided = Answer(statement=statement, proof=None)
    assert (str(undecided.verdict), undecided.check()) == ("undecided", True)
    point = Answer(statement=statement, proof=Point(coordinates=(Fraction(0), Fraction(0))))
    assert (str(point.verdict), point.check()) == ("negative", False)
    assert str(Answer(statement=statement, proof=Functional(values={})).verdict) == "not-sos"
    answer.save(tmp_path / "answer.json")
    assert load((tmp_path / "answer.json").read_text())[1] == proof
