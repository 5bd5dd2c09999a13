"""Every rule that reading a certificate file checks by itself, with files made by hand for the standalone checker."""

import importlib.util
import json
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import pytest

from quakedesign.certificates import certificate_text, checking, parse_certificate
from quakedesign.certificates.files import save_certificate
from quakedesign.certificates.obligations import claimed, less
from quakedesign.certificates.response_obligations import OneInput, require_sound
from quakedesign.errors import CertificateError
from quakedesign.symbolic.terms import Term

PATH = Path(__file__).parents[1] / "proofs" / "test_check.py"
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
    "an array": (lambda: ["inputs"], "must have exactly the keys"),
    "domain": (lambda: hand.relay() | {"domain": "complex"}, "domain must be"),
    "names that are none": (lambda: hand.relay() | {"lifts": {"n m": hand.X1}}, "need names"),
    "no states": (lambda: hand.relay() | twelve(0), "need names"),
    "65 gains and constants": (
        lambda: (
            hand.relay() | {"gains": {f"k{i}": "1" for i in range(60)}, "constants": {f"c{i}": "1" for i in range(5)}}
        ),
        "names must differ",
    ),
    "a name twice": (lambda: hand.relay() | {"constants": {"k": "1"}}, "names must differ"),
    "weight 13": (lambda: hand.relay() | {"states": {"x": 13}}, "weights must be"),
    "one weight of two": (lambda: hand.weighted_pair() | {"states": {"x": 3, "y": 13}}, "weights must be"),
    "weight 2 on reals": (lambda: hand.decay() | {"states": {"x": 2}}, "weights must be"),
    "range turned round": (lambda: hand.disturbed_relay() | {"uncertain": {"d": ["1", "-1"]}}, "is not ordered"),
    "lift on reals": (lambda: hand.decay() | {"lifts": {"n": hand.X1}}, "lifts belong on cells"),
    "lift in itself": (
        lambda: hand.nested_sum() | {"lifts": {"n": [["1", [], [["n", "1", "s"]]]]}},
        "unknown state",
    ),
    "multiplier of too few": (
        lambda: hand.edited(hand.oscillator(), ("witnesses", 0, "multiplier", {"0": "1"})),
        "wrong key",
    ),
    "multiplier of too many": (
        lambda: hand.edited(hand.relay(), ("witnesses", 0, "multiplier", {"0,0,0": "1"})),
        "wrong key",
    ),
    "times on reals": (lambda: hand.edited(hand.decay(), ("witnesses", 0, "squares", 0, "times", [1])), "from 0 to 0"),
    "basis repeated": (
        lambda: hand.edited(
            hand.relay(), ("witnesses", 0, "squares", 0, hand.square([0], [[1], [1]], "1/8", "1/16", "1/4"))
        ),
        "different exponents",
    ),
    "basis empty": (
        lambda: hand.edited(hand.relay(), ("witnesses", 0, "squares", 0, hand.square([0], []))),
        "different exponents",
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
        "named once",
    ),
    "an obligation without a name": (
        lambda: hand.edited(hand.relay(), ("witnesses", 0, "obligation", 7)),
        "named once",
    ),
    "outputs without names": (lambda: hand.driven() | {"outputs": {"y z": hand.X1}}, "outputs need names"),
    "one output of two without a name": (
        lambda: hand.driven() | {"outputs": {"y": hand.X1, "y z": hand.X1}},
        "outputs need names",
    ),
    "three limits": (lambda: hand.edited(hand.driven(), ("inputs", "v", "limits", ["1"] * 3)), "limits is longer"),
    "a number": (lambda: 5, "must have exactly the keys"),
    "a state twice in a term": (
        lambda: hand.edited(hand.relay(), ("field", "x", 0, 2, [["x", "1", "s"], ["x", "1", "a"]])),
        "longer|twice in a term",
    ),
    "a lift and a state twice": (
        lambda: hand.edited(hand.nested_sum(), ("field", "x", 0, 2, [["x", "1", "s"], ["x", "1", "a"]])),
        "twice in a term",
    ),
    "an unknown kind": (lambda: hand.edited(hand.relay(), ("field", "x", 0, 2, [["x", "1", "b"]])), "wrong kind"),
    "an even power zero": (lambda: hand.edited(hand.relay(), ("field", "x", 0, 2, [["x", "0", "a"]])), "wrong kind"),
    "a power 25": (lambda: hand.edited(hand.relay(), ("field", "x", 0, 2, [["x", "25", "s"]])), "wrong kind"),
    "33 parameters": (lambda: hand.edited(hand.relay(), ("field", "x", 0, 1, ["k"] * 33)), "longer than 32"),
    "an exponent off the weight": (
        lambda: hand.edited(hand.relay(), ("field", "x", 0, 2, [["x", "1/2", "s"]])),
        "is no integer",
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
        (hand.decay() | {"V": [["1", [], [["x", "3", "s"]]]]}, "odd degree"),
        (hand.decay() | {"field": {"x": [["-1", [], [["x", "3", "s"]]]]}}, "of the same degree"),
    ):
        one = read(document)
        with pytest.raises(CertificateError, match=reason):
            list(claimed(one.loop, one.lyapunov, one.claims))


def test_what_is_left_has_no_zeros():
    assert less({(1,): F(2), (2,): F(1)}, F(2), {(1,): F(1), (3,): F(1)}) == {(2,): 1, (3,): -2}
    assert less({(1,): F(2)}, F(2), {(1,): F(1)}) == {}


# ---------------------------------------------------------------- bounds


@pytest.fixture(autouse=True)
def any_field(monkeypatch):
    monkeypatch.setattr(checking, "_same_field", lambda loop, law: None)


@pytest.mark.parametrize("name", ["slip_error", "slip_rate_error", "pressure_offset"])
def test_an_output_with_a_name_that_says_something_is_what_it_says(name):
    document = json.loads(json.dumps(hand.driven()).replace('"y"', f'"{name}"').replace(" y", f" {name}"))
    assert str(read(hand.driven()).check()) == "proved"
    with pytest.raises(CertificateError, match="another row than its name says"):
        read(document).check()


def test_the_start_is_the_input_alone():
    """V = 10 x^2 + v^2 at |v| = 1/2; without a limited rate V does not hold the input."""
    response = read(hand.driven())
    (first,), (second,) = (part.sets for part in response.response.parts.values())
    assert OneInput(response.loop, "u").start(first) == 0
    assert OneInput(response.loop, "v").start(second) == F(1, 4)
    without = replace(second, function=second.function[:1])
    assert OneInput(response.loop, "v").start(without) == 0
    double = replace(response.loop, inputs=response.loop.inputs | {"v": (F(3), F(1))})
    assert OneInput(double, "v").start(second) == 9


def test_the_bounds_of_all_inputs_add_up():
    assert read(hand.driven()).response.total("y") == F(7, 10)


def test_a_weight_of_zero_takes_nothing_from_its_set():
    document = hand.edited(hand.driven(), ("inputs", "u", "bounds", "y", "weights", ["0"]))
    with pytest.raises(CertificateError, match="does not prove"):
        read(document).check()


def changed_set(**parts):
    """The set of the input v with other parts."""
    one = read(hand.driven())
    part = one.response.parts["v"]
    sets = tuple(replace(own, **parts) for own in part.sets)
    return one.loop, replace(one.response, parts=one.response.parts | {"v": replace(part, sets=sets)})


def changed_bound(**parts):
    """The bound of y under v with other parts."""
    one = read(hand.driven())
    part = one.response.parts["v"]
    bounds = {name: replace(bound, **parts) for name, bound in part.bounds.items()}
    return one.loop, replace(one.response, parts=one.response.parts | {"v": replace(part, bounds=bounds)})


def changed_loop(**parts):
    one = read(hand.driven())
    return replace(one.loop, **parts), one.response


def changed_response(**parts):
    one = read(hand.driven())
    return one.loop, replace(one.response, **parts)


def changed_field(*terms):
    loop = read(hand.driven()).loop
    return changed_loop(field={"x": (*loop.field["x"], *terms)})


def term(*factors, parameters=()):
    return Term(F(1), parameters, tuple((name, F(exponent), kind) for name, exponent, kind in factors))


V, X = (term(("v", 2, "a")),), (term(("x", 1, "s")),)
PARTS = read(hand.driven()).response.parts
SIDE_CONDITIONS = {
    "on cells": (changed_loop(domain="cells"), "a bound needs reals"),
    "with lifts": (changed_loop(lifts={"n": X}), "a bound needs reals"),
    "with roots": (changed_loop(roots={"r": ("k", (F(1), F(2)))}), "a bound needs reals"),
    "a cube": (changed_field(term(("x", 3, "s"))), "that is linear"),
    "a constant": (changed_field(term()), "that is linear"),
    "an input times a state": (changed_field(term(("x", 1, "s"), parameters=("u",))), "that is linear"),
    "two inputs": (changed_field(term(parameters=("u", "v"))), "that is linear"),
    "two states": (changed_field(term(("x", 1, "s"), ("x", 1, "s"))), "that is linear"),
    "an absolute value": (changed_field(term(("x", 1, "a"))), "that is linear"),
    "no inputs": (changed_loop(inputs={}, field={"x": X}), "must act on the loop"),
    "an input without effect": (changed_loop(inputs={"u": (F(1),), "v": (F(1), F(1)), "w": (F(1),)}), "must act"),
    "an input without sets": (changed_response(parts={"u": PARTS["u"]}), "every input needs its sets"),
    "inputs in another order": (changed_response(parts=dict(reversed(PARTS.items()))), "every input needs its sets"),
    "no outputs": (changed_response(outputs={}), "every input needs its sets"),
    "an output of degree 2": (changed_response(outputs={"y": (term(("x", 2, "a")),)}), "a form of degree 1"),
    "an output of two degrees": (changed_response(outputs={"y": (*X, term(("x", 2, "a")))}), "a form of degree 1"),
    "an uncertain output": (
        changed_response(outputs={"y": (term(("x", 1, "s"), parameters=("b",)),)}),
        "an uncertain parameter",
    ),
    "no limits": (changed_loop(inputs={"u": (F(1, 2),), "v": ()}), "one or two positive limits"),
    "three limits": (changed_loop(inputs={"u": (F(1, 2),), "v": (F(1),) * 3}), "one or two positive limits"),
    "a limit of zero": (changed_loop(inputs={"u": (F(1, 2),), "v": (F(1), F(0))}), "one or two positive limits"),
    "no sets": (
        changed_response(parts=PARTS | {"v": replace(PARTS["v"], sets=())}),
        "sets and a bound of every output",
    ),
    "no bounds": (
        changed_response(parts=PARTS | {"v": replace(PARTS["v"], bounds={})}),
        "sets and a bound of every output",
    ),
    "a set of degree 1": (changed_set(function=X), "a form of degree 2"),
    "an uncertain set": (changed_set(function=(term(("x", 2, "a"), parameters=("b",)),)), "an uncertain parameter"),
    "one share for two limits": (changed_set(shares=(F(1),)), "needs a share"),
    "three shares": (changed_set(shares=(F(1),) * 3), "needs a share"),
    "nothing said of borrowing": (changed_set(borrowed=()), "is misplaced"),
    "two borrowed": (changed_set(borrowed=(F(0), F(0))), "is misplaced"),
    "borrowed from itself": (changed_set(shares=(F(0), F(0)), borrowed=(F(1),)), "is misplaced"),
    "no decay": (changed_set(decay=F(0), shares=(F(0), F(0))), "the decay must be positive"),
    "a negative share": (changed_set(shares=(F(3), F(-1))), "must not be negative"),
    "shares above the decay": (changed_set(shares=(F(5, 2), F(501, 1000))), "more than the decay"),
    "a start outside": (changed_set(function=(term(("x", 2, "a")), *V * 1, *V * 4)), "the start is outside"),
    "a bound of zero": (changed_bound(bound=F(0)), "a bound must be positive"),
    "a negative bound": (changed_bound(bound=F(-1)), "a bound must be positive"),
    "no weight": (changed_bound(weights=()), "every set needs a weight"),
    "two weights": (changed_bound(weights=(F(1, 2), F(1, 2))), "every set needs a weight"),
    "a negative weight": (changed_bound(weights=(F(-1),)), "every set needs a weight"),
    "a weight above one": (changed_bound(weights=(F(1001, 1000),)), "every set needs a weight"),
}


@pytest.mark.parametrize("case", SIDE_CONDITIONS)
def test_every_side_condition_of_a_bound_by_itself(case):
    (loop, response), reason = SIDE_CONDITIONS[case]
    with pytest.raises(CertificateError, match=reason):
        require_sound(loop, response)


@pytest.mark.parametrize(
    "fine",
    [
        changed_set(function=(term(("x", 2, "a")), *V * 4)),  # 4 v^2 = 1 at the limit 1/2
        changed_set(shares=(F(5, 2), F(1, 2))),
        changed_set(shares=(F(0), F(0))),
        changed_bound(weights=(F(0),)),
        changed_bound(weights=(F(1),)),
        changed_field(term(parameters=("u",))),
    ],
)
def test_a_bound_at_the_edge_of_a_side_condition_is_sound(fine):
    require_sound(*fine)


def test_the_derivative_of_a_set_is_affine_in_what_has_a_range():
    loop, response = changed_field(term(("x", 1, "s"), parameters=("b", "b")))
    with pytest.raises(CertificateError, match="not affine in b"):
        OneInput(loop, "u").derivative(response.parts["u"].sets[0])
    loop, response = changed_field(term(("x", 1, "s"), parameters=("k", "k")))
    assert OneInput(loop, "u").derivative(response.parts["u"].sets[0])


@pytest.mark.parametrize(("weights", "sound"), [((1, 0), True), ((F(1, 2), F(1, 2)), True), ((F(-1, 2), 1), False)])
def test_weights_of_two_sets_are_each_not_negative(weights, sound):
    loop, response = changed_bound(weights=tuple(map(F, weights)))
    part = response.parts["v"]
    twice = replace(part, sets=tuple(replace(own, borrowed=(F(0), F(0))) for own in part.sets * 2))
    both = replace(response, parts=response.parts | {"v": twice})
    if sound:
        require_sound(loop, both)
    else:
        with pytest.raises(CertificateError, match="every set needs a weight"):
            require_sound(loop, both)
