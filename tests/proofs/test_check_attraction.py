"""Files about regions of attraction, made by hand: both checkers decide them, and no entry of a proof can change."""

import copy
import importlib.util
import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from quakedesign.errors import CertificateError, PolynomialError
from quakedesign.sos.exact.attraction import Region, load, save_attraction, text
from quakedesign.sos.exact.proofs import Point

ROOT = Path(__file__).parents[2]
SPECIFICATION = importlib.util.spec_from_file_location("attraction_check", ROOT / "proofs" / "check.py")
checker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(checker)
checker.beside("attraction")  # loaded before, so that mutants can take its place

ONE = {"product": [], "basis": [[1]], "gram": ["1"]}


def squares(*listed):
    return {"squares": list(listed), "cofactors": [], "multiplier": []}


def cubic():
    """x' = -x + x³, V = x²: -V̇ = 2x² - 2x⁴ = 2x²·(1 - V)."""
    falling = {"product": [0], "basis": [[1]], "gram": ["2"]}
    claim = {"format": 1, "kind": "attraction", "variables": ["x"], "field": [{"1": "-1", "3": "1"}], "V": {"2": "1"}}
    proof = {"multiplier": {"0": "1"}, "positive": squares(ONE), "decrease": squares(falling)}
    return copy.deepcopy({**claim, "level": ["1"], **proof})


def everywhere():
    """x' = -x + y, y' = -x - y³, V = x² + y²: -V̇ = 2x² + 2y⁴, with the multiplier 1 + y²."""
    one = {"product": [], "basis": [[1, 0], [0, 1]], "gram": ["1", "0", "1"]}
    falling = {"product": [], "basis": [[1, 0], [0, 2], [1, 1], [0, 3]]}
    gram = ["2", "0", "0", "0", "2", "0", "0", "2", "0", "2"]
    claim = {"format": 1, "kind": "attraction", "variables": ["x", "y"], "level": []}
    field = [{"1,0": "-1", "0,1": "1"}, {"1,0": "-1", "0,3": "-1"}]
    proof = {
        "multiplier": {"0,0": "1", "0,2": "1"},
        "positive": squares(one),
        "decrease": squares(falling | {"gram": gram}),
    }
    return copy.deepcopy({**claim, "field": field, "V": {"2,0": "1", "0,2": "1"}, **proof})


def refuted(point="1", level="2", V="1"):
    claim = {"format": 1, "kind": "attraction", "variables": ["x"], "field": [{"1": "-1", "3": "1"}], "V": {"2": V}}
    return {**claim, "level": [level] if level else [], "negative": {"point": [point]}}


def turning(point=("0", "1"), V="1,0", field=None):
    """x' = -y, y' = -x and V = x: at (0, 1) V is 0 and falls, and x' alone is not 0."""
    field = [{"0,1": "-1"}, {"1,0": "-1"}] if field is None else field
    claim = {"format": 1, "kind": "attraction", "variables": ["x", "y"], "field": field, "V": {V: "1"}}
    return {**claim, "level": ["1"], "negative": {"point": list(point)}}


def by_itself(document):
    try:
        return checker.check(json.dumps(document)).verdict
    except checker.Refused:
        return "refused"


def by_package(document):
    try:
        claim = load(json.dumps(document))
    except CertificateError:
        return "refused"
    return claim.verdict if claim.check() else "refused"


def decided(document):
    verdicts = {by_itself(document), by_package(document)}
    assert len(verdicts) == 1, verdicts
    return verdicts.pop()


def places(value, path=()):
    """Paths of all keys and entries."""
    children = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, child in children:
        yield (*path, key)
        yield from places(child, (*path, key))


def edited(document, path, change):
    document = copy.deepcopy(document)
    inner = document
    for key in path[:-1]:
        inner = inner[key]
    change(inner, path[-1])
    return document


def number(inner, key):
    old = inner[key]
    inner[key] = (
        str(Fraction(old) + 1) if isinstance(old, str) and old[-1:].isdigit() else [*old, 1] if old == [] else 7
    )


def removed(inner, key):
    del inner[key]


@pytest.mark.parametrize("make", [cubic, everywhere])
def test_a_proof_is_accepted_and_no_entry_can_change_or_go(make):
    assert decided(make()) == "proved"
    names = {("variables", 0), ("variables", 1)}
    for path in places(make()):
        changes = [removed] if isinstance(path[-1], str) or path[0] != "level" else []
        changes += [number] if path not in names else []
        for change in changes:
            assert decided(edited(make(), path, change)) == "refused", (path, change)


def test_a_point_refutes_where_v_does_not_fall_or_is_not_positive():
    for document in (
        refuted(),
        refuted("-1"),
        refuted("2", "5"),
        refuted("3", ""),
        refuted("1/2", "1", "-1"),
        refuted("2", "1", "-1"),
        turning(),
        turning(("-1", "2"), "0,2", [{"1,0": "-1"}, {}]) | {"level": ["5"]},
    ):
        assert decided(document) == "refuted"


@pytest.mark.parametrize(
    "document",
    [
        refuted("0"),  # the origin
        refuted("1", "1"),  # V is the level there
        refuted("1/2"),  # V falls there
        refuted("1", "0"),
        refuted("1", "-1"),
        refuted("1", "0", "-1"),
        everywhere() | {"variables": ["x", "x"]},
        everywhere() | {"multiplier": {}},
        refuted() | {"multiplier": {"0": "1"}},
        refuted() | {"negative": {"point": ["1", "1"]}},
        refuted() | {"V": {"2": "1", "0": "1"}},
        refuted() | {"field": [{"0": "1"}]},
        refuted() | {"field": []},
        turning(field=[{"0,0": "1", "0,1": "-1"}, {"1,0": "-1"}]),
        turning(("0", "0")),
        turning(("1",)),
        refuted() | {"level": ["2", "3"]},
        refuted() | {"format": True},
        {**everywhere(), "variables": [], "field": [], "V": {}, "multiplier": {}}
        | {"positive": squares(), "decrease": squares()},
        cubic() | {"positive": squares({**ONE, "basis": [{"1": "2"}], "gram": ["1/4"]})},
        refuted() | {"kind": "attraction "},
        refuted() | {"format": 2},
        refuted() | cubic(),
    ],
)
def test_anything_else_is_refused(document):
    assert by_itself(document) == "refused"
    if document["kind"] == "attraction":
        assert by_package(document) == "refused"


def semidefinite():
    """V = (x - y)² is not positive, though a sum of squares, and it falls."""
    field = [{"1,0": "-1"}, {"0,1": "-1"}]
    difference = {"product": [], "basis": [{"1,0": "1", "0,1": "-1"}], "gram": ["1"]}
    claim = {"format": 1, "kind": "attraction", "variables": ["x", "y"], "field": field, "level": []}
    falling = squares({**difference, "gram": ["2"]})
    V = {"2,0": "1", "1,1": "-2", "0,2": "1"}
    return {**claim, "V": V, "multiplier": {"0,0": "1"}, "positive": squares(difference), "decrease": falling}


def idle():
    """V = x² + y² does not fall in y, which rests."""
    field = [{"1,0": "-1"}, {}]
    one = squares({"product": [], "basis": [[1, 0], [0, 1]], "gram": ["1", "0", "1"]})
    falling = squares({"product": [], "basis": [[1, 0]], "gram": ["2"]})
    claim = {"format": 1, "kind": "attraction", "variables": ["x", "y"], "field": field, "level": []}
    return {**claim, "V": {"2,0": "1", "0,2": "1"}, "multiplier": {"0,0": "1"}, "positive": one, "decrease": falling}


def mixed():
    """V = y² + x²y² vanishes where y does, a product of both states among its squares or not."""
    field = [{"1,0": "-1"}, {"0,1": "-1"}]
    square = {"product": [], "basis": [[0, 1], [1, 1]]}
    claim = {"format": 1, "kind": "attraction", "variables": ["x", "y"], "field": field, "level": []}
    proof = {part: squares({**square, "gram": gram})
             for part, gram in (("positive", ["1", "0", "1"]), ("decrease", ["2", "0", "4"]))}  # fmt: skip
    return {**claim, "V": {"0,2": "1", "2,2": "1"}, "multiplier": {"0,0": "1"}, **proof}


@pytest.mark.parametrize("make", [semidefinite, idle, mixed])
def test_squares_that_vanish_elsewhere_prove_nothing(make):
    assert decided(make()) == "refused"


def test_what_is_read_is_written_again():
    for document in (cubic(), everywhere(), refuted()):
        assert json.loads(text(load(json.dumps(document)))) == document


def test_the_statement_is_printed():
    lines = checker.check(json.dumps(cubic())).statement
    assert lines[:3] == ("x' = 1*x^3 + -1*x", "V = 1*x^2", "level: 1")
    assert lines[-1].startswith("conclusion: every solution that starts where V < level remains there and tends to")
    assert "from any initial state" in checker.check(json.dumps(everywhere())).statement[-1]
    assert "no other V proves it" in checker.check(json.dumps(refuted())).statement[-1]
    for document in (refuted("2", "5"), turning()):
        assert "no other V proves it" not in checker.check(json.dumps(document)).statement[-1]
    documents = (refuted(), refuted("2", "5"), turning(), cubic())
    assert [load(json.dumps(document)).equilibrium for document in documents] == [True, False, False, False]


def test_a_claim_of_another_size_decides_nothing():
    claim = load(json.dumps(turning()))
    with pytest.raises(PolynomialError, match="needs 2 polynomials"):
        replace(claim, field=claim.field[:1])
    assert not replace(claim, proof=Point(coordinates=(Fraction(1),))).check()


def test_only_a_proof_that_can_be_read_again_is_saved(tmp_path):
    claim = load(json.dumps(cubic()))
    with pytest.raises(CertificateError, match="only a proof"):
        save_attraction(replace(claim, proof=None), tmp_path / "file.json")
    with pytest.raises(CertificateError, match=r"variables\[0\]: expected a name"):
        save_attraction(replace(claim, variables=("x y",)), tmp_path / "file.json")
    assert not (tmp_path / "file.json").exists()


def test_a_region_is_what_its_claims_say():
    proof, point = load(json.dumps(everywhere())), load(json.dumps(refuted("3", "")))
    found = [Region.of(claim) for claim in (proof, point, replace(proof, proof=None))]
    assert [one.verdict for one in found] == ["proved", "refuted", "undecided"]
    assert [bool(one.remark) for one in found] == [False, False, True]
    above = load(json.dumps(refuted()))
    assert Region(proved=None, refuted=above).verdict == "undecided"
