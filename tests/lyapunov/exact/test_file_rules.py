"""Every rule that reading a certificate file checks by itself, with files made by hand for the standalone checker."""

import importlib.util
import json
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import pytest

from quakedesign.checking import check_files
from quakedesign.errors import CertificateError, UnsupportedError
from quakedesign.lyapunov import certificate_text, parse_certificate
from quakedesign.lyapunov.exact.certificate_files import save_certificate
from quakedesign.lyapunov.exact.obligations import claimed, less

PATH = Path(__file__).parents[2] / "proofs" / "test_check.py"
SPECIFICATION = importlib.util.spec_from_file_location("files_by_hand", PATH)
hand = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(hand)


def read(document):
    return parse_certificate(json.dumps(document))


def twelve(count):
    """States named by letters, all still."""
    names = "abcdefghijkl"[:count]
    return {"states": dict.fromkeys(names, 1), "field": {name: [] for name in names}, "V": [], "witnesses": []}


CASES = {
    "an array": (lambda: ["refutation"], "the file must be an object"),
    "domain": (lambda: hand.relay() | {"domain": "complex"}, "domain: invalid enum value"),
    "names that are none": (lambda: hand.relay() | {"lifts": {"n m": hand.X1}}, "key in lifts: expected a name"),
    "no states": (lambda: hand.relay() | twelve(0), "states: expected `object` of length >= 1"),
    "65 gains and constants": (
        lambda: (
            hand.relay() | {"gains": {f"k{i}": "1" for i in range(60)}, "constants": {f"c{i}": "1" for i in range(5)}}
        ),
        "names must differ",
    ),
    "a name twice": (lambda: hand.relay() | {"constants": {"k": "1"}}, "names must differ"),
    "weight 0": (lambda: hand.relay() | {"states": {"x": 0}}, "weights must be"),
    "weight 13": (lambda: hand.relay() | {"states": {"x": 13}}, "weights must be"),
    "one weight of two": (lambda: hand.weighted_pair() | {"states": {"x": 3, "y": 13}}, "weights must be"),
    "weight 2 on reals": (lambda: hand.decay() | {"states": {"x": 2}}, "weights must be"),
    "range turned round": (lambda: hand.disturbed_relay() | {"uncertain": {"d": ["1", "-1"]}}, "is not ordered"),
    "lift on reals": (lambda: hand.decay() | {"lifts": {"n": hand.X1}}, "lifts require the domain 'cells'"),
    "lift in itself": (
        lambda: hand.nested_sum() | {"lifts": {"n": [["1", [], [["n", "1", "s"]]]]}},
        "unknown state",
    ),
    "multiplier of too few": (
        lambda: hand.edited(hand.oscillator(), ("witnesses", 0, "multiplier", {"0": "1"})),
        "a multiplier must have",
    ),
    "multiplier of too many": (
        lambda: hand.edited(hand.relay(), ("witnesses", 0, "multiplier", {"0,0,0": "1"})),
        "a multiplier must have",
    ),
    "times on reals": (lambda: hand.edited(hand.decay(), ("witnesses", 0, "squares", 0, "times", [1])), "from 0 to 0"),
    "times 2 on cells": (
        lambda: hand.edited(hand.relay(), ("witnesses", 1, "squares", 0, "times", [2])),
        "from 0 to 1",
    ),
    "times 2 of one of two": (
        lambda: hand.edited(hand.weighted_pair(), ("witnesses", 0, "squares", 0, "times", [0, 2])),
        "from 0 to 1",
    ),
    "times of another length": (
        lambda: hand.edited(hand.weighted_pair(), ("witnesses", 0, "squares", 0, "times", [1])),
        "from 0 to 1",
    ),
    "basis of which one is longer": (
        lambda: hand.edited(
            hand.relay(), ("witnesses", 0, "squares", 0, hand.square([0], [[1], [1, 1]], "1/8", "1/16", "1/4"))
        ),
        "distinct exponents",
    ),
    "cofactor of another number of variables": (
        lambda: hand.edited(hand.settling_relay(), ("witnesses", 2, "equalities", [{"0": "1"}])),
        "a cofactor has another number of variables",
    ),
    "cofactor of too many terms": (
        lambda: hand.edited(
            hand.settling_relay(),
            ("witnesses", 2, "equalities", [{f"{i},{j}": "1" for i in range(142) for j in range(142)}]),
        ),
        "a cofactor is longer than 20000 terms",
    ),
    "basis repeated": (
        lambda: hand.edited(
            hand.relay(), ("witnesses", 0, "squares", 0, hand.square([0], [[1], [1]], "1/8", "1/16", "1/4"))
        ),
        "distinct exponents",
    ),
    "basis empty": (
        lambda: hand.edited(hand.relay(), ("witnesses", 0, "squares", 0, hand.square([0], []))),
        "distinct exponents",
    ),
    "gram too fine": (
        lambda: hand.edited(
            hand.weighted_pair(),
            (
                "witnesses",
                0,
                "squares",
                [hand.square([0, 0], [[i, 0] for i in range(12)], *[f"1/{10**399 + i}" for i in range(78)])],
            ),
        ),
        "common denominator",
    ),
    "an obligation twice": (
        lambda: hand.edited(hand.relay(), ("witnesses", 1, "obligation", "positive +")),
        "only one witness",
    ),
    "an obligation without a name": (
        lambda: hand.edited(hand.relay(), ("witnesses", 0, "obligation", 7)),
        "expected `str`",
    ),
    "a number": (lambda: 5, "the file must be an object"),
    "a state twice in a term": (
        lambda: hand.edited(hand.relay(), ("field", "x", 0, 2, [["x", "1", "s"], ["x", "1", "a"]])),
        "longer|twice in a term",
    ),
    "a lift and a state twice": (
        lambda: hand.edited(hand.nested_sum(), ("field", "x", 0, 2, [["x", "1", "s"], ["x", "1", "a"]])),
        "twice in a term",
    ),
    "an unknown kind": (
        lambda: hand.edited(hand.relay(), ("field", "x", 0, 2, [["x", "1", "b"]])),
        "invalid enum value",
    ),
    "an even power zero": (
        lambda: hand.edited(hand.relay(), ("field", "x", 0, 2, [["x", "0", "a"]])),
        "outside its range",
    ),
    "a power 25": (lambda: hand.edited(hand.relay(), ("field", "x", 0, 2, [["x", "25", "s"]])), "outside its range"),
    "33 parameters": (lambda: hand.edited(hand.relay(), ("field", "x", 0, 1, ["k"] * 33)), "length <= 32"),
    "a root of a state": (
        lambda: hand.rooted_relay() | {"roots": {"s": ["x", "7/5", "3/2"]}},
        "a root must be the square root of a gain",
    ),
    "a state without a field": (
        lambda: hand.oscillator() | {"field": {"x": hand.oscillator()["field"]["x"]}},
        "field must have a list of terms for every state",
    ),
    "a field without a state": (
        lambda: hand.edited(hand.relay(), ("field", "y", [])),
        "field must have a list of terms for every state",
    ),
    "a term of zero": (lambda: hand.edited(hand.relay(), ("field", "x", 0, 0, "0")), "a term must not be zero"),
    "a parameter that is none": (
        lambda: hand.edited(hand.relay(), ("field", "x", 0, 1, ["q"])),
        "a term has an unknown parameter",
    ),
    "multiplier empty": (
        lambda: hand.edited(hand.relay(), ("witnesses", 0, "multiplier", {})),
        "a multiplier must have 1 to",
    ),
    "multiplier of 201 terms": (
        lambda: hand.edited(hand.relay(), ("witnesses", 0, "multiplier", {f"{i}": "1" for i in range(201)})),
        "a multiplier must have 1 to",
    ),
    "three squares of one variable": (
        lambda: hand.edited(hand.relay(), ("witnesses", 0, "squares", [hand.square([0], [[1]], "1/6")] * 3)),
        "must have at most 2 squares",
    ),
    "gram too long": (
        lambda: hand.edited(hand.relay(), ("witnesses", 0, "squares", 0, "gram", ["1/2", "1"])),
        "gram must have one entry per pair of basis monomials",
    ),
    "an exponent off the weight": (
        lambda: hand.edited(hand.relay(), ("field", "x", 0, 2, [["x", "1/2", "s"]])),
        "is not an integer",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_what_breaks_a_rule_is_not_even_read(case):
    make, reason = CASES[case]
    with pytest.raises(CertificateError, match=reason):
        read(make())


def test_what_is_at_the_edge_of_a_rule_is_read():
    many = {"gains": {f"k{i}": "1" for i in range(59)} | {"k": "2"}, "constants": {f"c{i}": "1" for i in range(4)}}
    assert len(read(hand.relay() | many).loop.parameters) == 64
    assert read(hand.relay() | {"states": {"x": 12}}).loop.states == {"x": 12}
    assert read(hand.disturbed_relay() | {"uncertain": {"d": ["1", "1"]}}).loop.uncertain == {"d": (1, 1)}
    claims = {"positive": "1", "decrease": "1", "decay": "1"} | {f"bound_{n}": "1" for n in "abcdef"}
    assert len(read(hand.relay() | twelve(6) | {"claims": claims}).claims) == 9
    with pytest.raises(CertificateError, match="claims"):
        read(hand.relay() | twelve(6) | {"claims": claims | {"more": "1"}})
    edge = read(hand.edited(hand.relay(), ("field", "x", 0, ["1", ["k"] * 32, [["x", "24", "s"]]])))
    assert edge.loop.field["x"][0].factors == (("x", 24, "s"),)
    inner = {"n": hand.X1, "m": [["1", [], [["n", "1", "s"]]]]}
    assert list(read(hand.relay() | {"lifts": inner}).loop.lifts) == ["n", "m"]
    long = {f"{i}": "1" for i in range(200)}
    found = read(hand.edited(hand.relay(), ("witnesses", 0, "multiplier", long))).witnesses["positive +"]
    assert len(found.multiplier) == 200
    halves = [hand.square([0], [[1]], "1/4")] * 2
    assert (
        len(read(hand.edited(hand.relay(), ("witnesses", 0, "squares", halves))).witnesses["positive +"].squares) == 2
    )
    high = hand.edited(hand.relay(), ("witnesses", 0, "squares", 0, "basis", [[999]]))
    assert read(high).witnesses["positive +"].squares[0].basis == ((999,),)


@pytest.mark.parametrize("make", hand.PROOFS + hand.REFUTATIONS, ids=lambda make: make.__name__)
def test_what_was_read_is_written_again(make):
    text = certificate_text(read(make()))
    assert text.isascii()
    assert json.loads(text) == make()


def test_only_what_can_be_read_again_is_saved(tmp_path):
    good = read(hand.relay())
    save_certificate(good, tmp_path / "good.json")
    assert json.loads((tmp_path / "good.json").read_text()) == hand.relay()
    long = replace(good, loop=replace(good.loop, gains={"k": F(1, 10**401)}))
    with pytest.raises(CertificateError):
        save_certificate(long, tmp_path / "long.json")
    assert not (tmp_path / "long.json").exists()


def test_a_squares_condition_is_counted_from_the_variables():
    squares = read(hand.nested_sign()).witnesses["decrease +++ s=7/5"].squares
    assert [square.product for square in squares] == [(0,), (1,), (2,)]


def test_every_list_of_squares_has_its_own_condition():
    square = hand.square([0, 0], [[0, 0]], "2")
    document = hand.edited(hand.nested_sign(), ("witnesses", 1, "inequalities", [[square], [square]]))
    found = read(document).witnesses["decrease +++ s=7/5"]
    assert [one.product for one in found.squares] == [(0,), (1,), (2,), (3,)]
    assert found.conditions == 2


# ---------------------------------------------------------------- obligations of files


def test_degrees_on_the_reals_are_even_and_equal():
    for document, reason in (
        (hand.decay() | {"V": [["1", [], [["x", "3", "s"]]]]}, "degree of V on the reals must be even"),
        (hand.decay() | {"field": {"x": [["-1", [], [["x", "3", "s"]]]]}}, "of the same degree"),
    ):
        one = read(document)
        with pytest.raises(CertificateError, match=reason):
            list(claimed(one.loop, one.lyapunov, one.claims))


def test_what_is_left_has_no_zeros():
    assert less({(1,): F(2), (2,): F(1)}, F(2), {(1,): F(1), (3,): F(1)}) == {(2,): 1, (3,): -2}
    assert less({(1,): F(2)}, F(2), {(1,): F(1)}) == {}


def test_a_bound_under_inputs_is_no_longer_read_and_its_successor_is_named(tmp_path, capsys):
    """One line and exit code 2 in both checkers, whatever else the file holds."""
    path = tmp_path / "old.json"
    path.write_text(json.dumps(hand.decay() | {"inputs": {}, "outputs": {}}))
    with pytest.raises(UnsupportedError, match="Write a new file with certify elqr FAULT"):
        check_files([path])
    assert hand.checker.main([str(path)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert "certify elqr FAULT --gains K1 K2 K3 K4 --peaks CLASS --out FILE" in err


@pytest.mark.parametrize("more", [{}, {"format": 1}])
def test_an_object_of_inputs_and_outputs_alone_is_of_the_older_kind(more):
    with pytest.raises(UnsupportedError, match="obsolete bound under inputs"):
        read({"inputs": {}, "outputs": {}} | more)
    with pytest.raises(CertificateError):
        read({"inputs": {}} | more)
