"""Certificates small enough to verify by hand, and every way to break them."""

import copy
import importlib.util
import itertools
import json
import random
import re
import subprocess
import sys
from fractions import Fraction
from math import log2, sqrt
from pathlib import Path

import pytest
from thinned import few, some_or_all, spread

PATH = Path(__file__).parents[2] / "proofs" / "check.py"
SPECIFICATION = importlib.util.spec_from_file_location("certificate_check", PATH)
checker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(checker)
exact_numbers, squares, stability = map(checker.beside, ("numbers", "squares", "lyapunov.stability"))

REMOVED = object()
X1 = [["1", [], [["x", "1", "s"]]]]


# ---------------------------------------------------------------- certificates made by hand


def square(times, basis, *gram):
    return {"times": times, "basis": basis, "gram": list(gram)}


def witness(obligation, *squares, multiplier=None, equalities=(), inequalities=()):
    size = len(squares[0]["times"])
    return {
        "obligation": obligation,
        "multiplier": multiplier or {",".join("0" * size): "1"},
        "squares": list(squares),
        "equalities": list(equalities),
        "inequalities": list(inequalities),
    }


def relay():
    """x' = -2 sign(x), V = x^2: V - u^2/2 = u^2/2 and -V' - u = 4u - u = 3u, the same on both cells."""
    return {
        "format": 1,
        "law": "relay",
        "gains": {"k": "2"},
        "constants": {},
        "states": {"x": 1},
        "domain": "cells",
        "uncertain": {},
        "roots": {},
        "lifts": {},
        "field": {"x": [["-1", ["k"], [["x", "0", "s"]]]]},
        "V": [["1", [], [["x", "2", "a"]]]],
        "claims": {"positive": "1/2", "decrease": "1"},
        "witnesses": [
            witness("positive +", square([0], [[1]], "1/2")),
            witness("decrease +", square([1], [[0]], "3")),
        ],
    }


def disturbed_relay():
    """x' = -2 sign(x) + d, |d| <= 1: -V' = 4u - 2 d s u, thus 6u where d s = -1 and 2u where d s = 1.

    Cell - repeats the polynomials of cell +, so that only the first names occur. Minus u: 5u and u.
    """
    document = relay()
    document["uncertain"] = {"d": ["-1", "1"]}
    document["field"]["x"].append(["1", ["d"], []])
    document["witnesses"][1:] = [
        witness("decrease + d=-1", square([1], [[0]], "5")),
        witness("decrease + d=1", square([1], [[0]], "1")),
    ]
    return document


def decay():
    """x' = -3x, V = x^2, a = 1: V - x^2/4 = 3x^2/4 and -V' - 2V = 6x^2 - 2x^2 = 4x^2."""
    return {
        "format": 1,
        "law": "decay",
        "gains": {"k": "3"},
        "constants": {},
        "states": {"x": 1},
        "domain": "reals",
        "uncertain": {},
        "roots": {},
        "lifts": {},
        "field": {"x": [["-1", ["k"], [["x", "1", "s"]]]]},
        "V": [["1", [], [["x", "2", "a"]]]],
        "claims": {"positive": "1/4", "rate": "1"},
        "witnesses": [
            witness("positive", square([0], [[1]], "3/4")),
            witness("rate", square([0], [[1]], "4")),
        ],
    }


def oscillator():
    """x' = y, y' = -x - y, V = 3x^2 + 2xy + 2y^2, so that V' = -2x^2 - 2y^2.

    V - |.|^2 = 2x^2 + 2xy + y^2, of determinant 1.
    -V' - 2aV for a = 1/4 is x^2/2 - xy + y^2, of determinant 1/4.
    """
    return {
        "format": 1,
        "law": "oscillator",
        "gains": {},
        "constants": {"c": "3"},
        "states": {"x": 1, "y": 1},
        "domain": "reals",
        "uncertain": {},
        "roots": {},
        "lifts": {},
        "field": {
            "x": [["1", [], [["y", "1", "s"]]]],
            "y": [["-1", [], [["x", "1", "s"]]], ["-1/3", ["c"], [["y", "1", "s"]]]],
        },
        "V": [
            ["3", [], [["x", "2", "a"]]],
            ["2", [], [["x", "1", "s"], ["y", "1", "s"]]],
            ["2", [], [["y", "2", "a"]]],
        ],
        "claims": {"positive": "1", "rate": "1/4"},
        "witnesses": [
            witness("positive", square([0, 0], [[1, 0], [0, 1]], "2", "1", "1")),
            witness("rate", square([0, 0], [[1, 0], [0, 1]], "1/2", "-1/2", "1")),
        ],
    }


def oscillator_on_cells():
    """Decide the oscillator cell by cell: 2u^2 + 2uw + w^2 where the signs agree, 2u^2 - 2uw + w^2 where not.

    -V' - (u^2 + w^2) = u^2 + w^2 everywhere.
    """
    document = oscillator()
    document["domain"] = "cells"
    document["claims"] = {"positive": "1", "decrease": "1"}
    document["witnesses"] = [
        witness(
            "positive ++",
            square([1, 1], [[0, 0]], "2"),
            square([0, 0], [[1, 0], [0, 1]], "2", "0", "1"),
        ),
        witness("positive +-", square([0, 0], [[1, 0], [0, 1]], "2", "-1", "1")),
        witness("decrease ++", square([0, 0], [[1, 0], [0, 1]], "1", "0", "1")),
    ]
    return document


def weighted_pair():
    """x' = -sqrt|x| sign(x), y' = -sign(y) + d, |d| <= 1/2, V = |x|^(3/2) + |y|^3, weights 2 and 1, degree 3.

    V' = -3/2 |x| - 3 y^2 (1 - d sign(y)): degree 2. V - sum/2 = (u^3 + w^3)/2.
    -V' - sum = u^2/2 + c w^2 with c = 3 (1 + 1/2) - 1 = 7/2 for d sign(y) = -1/2 and 1/2 for d sign(y) = 1/2.
    """
    basis = [[1, 0], [0, 1]]
    return {
        "format": 1,
        "law": "weighted-pair",
        "gains": {"k": "2"},
        "constants": {},
        "states": {"x": 2, "y": 1},
        "domain": "cells",
        "uncertain": {"d": ["-1/2", "1/2"]},
        "roots": {},
        "lifts": {},
        "field": {
            "x": [["-1/2", ["k"], [["x", "1/2", "s"]]]],
            "y": [["-1", [], [["y", "0", "s"]]], ["1", ["d"], []]],
        },
        "V": [["1", [], [["x", "3/2", "a"]]], ["1", [], [["y", "3", "a"]]]],
        "claims": {"positive": "1/2", "decrease": "1"},
        "witnesses": [
            witness("positive ++", square([1, 0], [[1, 0]], "1/2"), square([0, 1], [[0, 1]], "1/2")),
            witness("decrease ++ d=-1/2", square([0, 0], basis, "1/2", "0", "7/2")),
            witness("decrease ++ d=1/2", square([0, 0], basis, "1/2", "0", "1/2")),
        ],
    }


def bounded_oscillator():
    """The oscillator with V >= 2 x^2 and V >= y^2.

    3x^2 + 2xy + 2y^2 - 2x^2 = x^2 + 2xy + 2y^2 and minus y^2 instead 3x^2 + 2xy + y^2: determinants 1 and 2.
    """
    document, basis = oscillator(), [[1, 0], [0, 1]]
    document["claims"] |= {"bound_y": "1", "bound_x": "2"}
    document["witnesses"][1:1] = [
        witness("bound_x", square([0, 0], basis, "1", "1", "2")),
        witness("bound_y", square([0, 0], basis, "3", "1", "1")),
    ]
    return document


def bounded_pair():
    """V - 1/3 |y|^3 = u^3 + 2/3 w^3 in the weighted pair."""
    document = weighted_pair()
    document["claims"] |= {"bound_y": "1/3"}
    squares = square([1, 0], [[1, 0]], "1"), square([0, 1], [[0, 1]], "2/3")
    document["witnesses"].insert(1, witness("bound_y ++", *squares))
    return document


def rooted_relay():
    """x' = -s sign(x) with s = sqrt(2) in [7/5, 3/2]: -V' - u = 2su - u, 9/5 u and 2u at the ends."""
    document = relay()
    document["roots"] = {"s": ["k", "7/5", "3/2"]}
    document["field"]["x"][0][1] = ["s"]
    document["witnesses"][1:] = [
        witness("decrease + s=7/5", square([1], [[0]], "9/5")),
        witness("decrease + s=3/2", square([1], [[0]], "2")),
    ]
    return document


def settling_relay():
    """The relay with V' <= -2 sqrt(V), V = v^2: (u + v)(4u - 2v) = 2u^2 + 2uv - 2(v^2 - u^2)."""
    document = relay()
    document["claims"]["decay"] = "2"
    squares = square([0, 0], [[1, 0]], "2"), square([1, 1], [[0, 0]], "2")
    multiplier = {"1,0": "1", "0,1": "1"}
    document["witnesses"].append(witness("decay +", *squares, multiplier=multiplier, equalities=[{"0,0": "-2"}]))
    return document


def nested_root():
    """x' = -[n]^(1/3), n = x, V = |x|^(4/3), weight 3, so that -V' = 4/3 uw with w^3 = u^3.

    The cells +- and -+ have the equality w^3 + u^3 = 0. V - u^4/2 = u^4/2. With M = u^2 + uw + w^2 and
    (w - u) M = w^3 - u^3: M (4/3 uw - u^2/3) = M u^2 + 4/3 u (w^3 - u^3).
    """
    document = relay()
    document |= {"gains": {"k": "2"}, "states": {"x": 3}, "lifts": {"n": [["1/2", ["k"], [["x", "1", "s"]]]]}}
    document |= {"field": {"x": [["-1", [], [["n", "1/3", "s"]]]]}, "V": [["1", [], [["x", "4/3", "a"]]]]}
    document["claims"] = {"positive": "1/2", "decrease": "1/3"}
    form, multiplier = square([0, 0], [[2, 0], [1, 1]], "1", "1/2", "1"), {"2,0": "1", "1,1": "1", "0,2": "1"}
    document["witnesses"] = [
        witness("positive +", square([0], [[2]], "1/2")),
        witness("decrease ++", form, multiplier=multiplier, equalities=[{"1,0": "4/3"}]),
        witness("decrease --", form, multiplier=multiplier, equalities=[{"1,0": "-4/3"}]),
    ]
    return document


def nested_size():
    """x' = -x |n|, n = x, V = x^2: -V' = 2u^2 w with w = u, and 2u^2 w - u^3 = u u^2 + 2u^2 (w - u)."""
    document = relay()
    document |= {"gains": {}, "lifts": {"n": X1}, "field": {"x": [["-1", [], [["x", "1", "s"], ["n", "1", "a"]]]]}}
    document["witnesses"][1:] = [
        witness(f"decrease {cell}", square([1, 0], [[1, 0]], "1"), equalities=[{"2,0": cofactor}])
        for cell, cofactor in (("++", "2"), ("--", "-2"))
    ]
    return document


def cubic_relay():
    """x' = -2 sign(x), V = |x|^3: V - u^3/2 = u u^2/2 and -V' - u^2 = 6u^2 - u^2."""
    document = relay()
    document["V"] = [["1", [], [["x", "3", "a"]]]]
    document["witnesses"] = [
        witness("positive +", square([1], [[1]], "1/2")),
        witness("decrease +", square([0], [[1]], "5")),
    ]
    return document


def nested_sum():
    """x' = -2x - n, y' = -2y - n, n = x + y, V = x^2 + y^2: -V' = 4u^2 + 4w^2 + 2 (s u + r w) t z.

    With h = tz - su - rw that minus (u^2 + w^2) is 3u^2 + 3w^2 + 2z^2 - 2tz h. The cells ++- and --+ are left out.
    """
    document = oscillator_on_cells()
    document |= {"constants": {}, "lifts": {"n": [["1", [], [["x", "1", "s"]]], ["1", [], [["y", "1", "s"]]]]}}
    document["field"] = {name: [["-2", [], [[name, "1", "s"]]], ["-1", [], [["n", "1", "s"]]]] for name in "xy"}
    document |= {"V": [["1", [], [[name, "2", "a"]]] for name in "xy"], "claims": {"positive": "1/2", "decrease": "1"}}
    basis = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    document["witnesses"] = [witness("positive ++", square([0, 0], [[1, 0], [0, 1]], "1/2", "0", "1/2"))]
    for cell in ("+++", "+-+", "+--", "-++", "-+-", "---"):
        form = square([0, 0, 0], basis, "3", "0", "0", "3", "0", "2")
        cofactor = {"0,0,1": "-2" if cell[2] == "+" else "2"}
        document["witnesses"].append(witness(f"decrease {cell}", form, equalities=[cofactor]))
    return document


def nested_sign():
    """x' = -2 sign(x) - sign(n), the same for y, n = x + y and a term of another degree whose gain is zero.

    -V' = 4u + 4w + 2g with g = t (su + rw) >= 0; the cells - share the witnesses of the cells +.
    """
    document = nested_sum()
    document |= {"gains": {"c": "0"}, "constants": {"k": "2"}, "roots": {"s": ["k", "7/5", "3/2"]}}
    document["lifts"]["n"].append(["7", ["c", "s"], [["x", "3", "a"]]])
    document["field"] = {name: [["-2", [], [[name, "0", "s"]]], ["-1", [], [["n", "0", "s"]]]] for name in "xy"}
    squares = square([1, 0], [[0, 0]], "3"), square([0, 1], [[0, 0]], "3")
    document["witnesses"][1:] = [
        witness(f"decrease {cell} s=7/5", *squares, inequalities=[[square([0, 0], [[0, 0]], "2")]])
        for cell in ("+++", "+-+", "+--")
    ]
    return document


def nested_root_sign():
    """x' = -2 sign(x) - sign(n), y' = -2 sign(y) - s sign(n), n = x + s y with s = 2^(1/2) in [7/5, 3/2].

    -V' = 4u + 4w + 2t (x + s y). Of the signs of n only g = t (x + b y) >= 0 is used, b the end where g is largest:
    3/2 where t y > 0, else 7/5. So -V' - u - w = 2g + 3u + (3 - 2|s - b|) w. No cell has -t for the signs of x and y.
    """
    document = nested_sign()
    document |= {"gains": {}, "lifts": {"n": [["1", [], [["x", "1", "s"]]], ["1", ["s"], [["y", "1", "s"]]]]}}
    document["field"]["y"] = [["-2", [], [["y", "0", "s"]]], ["-1", ["s"], [["n", "0", "s"]]]]
    document["witnesses"][1:] = [
        witness(
            f"decrease {cell} s={end}",
            square([1, 0], [[0, 0]], "3"),
            square([0, 1], [[0, 0]], "3" if (end == "3/2") == (cell[1] == cell[2]) else "14/5"),
            inequalities=[[square([0, 0], [[0, 0]], "2")]],
        )
        for cell in ("+++", "+-+", "+--")
        for end in ("7/5", "3/2")
    ]
    return document


def refuted(document, **refutation):
    for key in ("V", "claims", "witnesses"):
        del document[key]
    return {**document, "refutation": refutation}


def overpowered_relay():
    """x' = -2 sign(x) + d with d = 2 rests at x = 1."""
    document = disturbed_relay()
    document["uncertain"]["d"] = ["-3", "3"]
    return refuted(document, parameters={"d": "2"}, point={"x": "1"}, weights={"+": "1"})


def sliding_rest():
    """x' = 2 sign(y), y' = -2 sign(y) rests at (1, 0), half of the limits from either side."""
    document = oscillator_on_cells()
    document["field"] = {"x": [["2", [], [["y", "0", "s"]]]], "y": [["-2", [], [["y", "0", "s"]]]]}
    return refuted(document, parameters={}, point={"x": "1", "y": "0"}, weights={"+-": "1/2", "++": "1/2"})


def inhomogeneous_rest():
    """x' = -sqrt|x| sign(x) + 3 rests at x = 9, which is v = 3 for weight 2."""
    document = relay()
    document["states"] = {"x": 2}
    document["field"]["x"] = [["-1", [], [["x", "1/2", "s"]]], ["3", [], []]]
    return refuted(document, parameters={}, point={"x": "3"}, weights={"+": "1"})


PROOFS = [relay, disturbed_relay, decay, oscillator, oscillator_on_cells, weighted_pair]
PROOFS += [bounded_oscillator, bounded_pair]
PROOFS += [
    rooted_relay,
    settling_relay,
    nested_root,
    nested_size,
    nested_sum,
    nested_sign,
    nested_root_sign,
    cubic_relay,
]
REFUTATIONS = [overpowered_relay, sliding_rest, inhomogeneous_rest]


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


@pytest.mark.parametrize("make", REFUTATIONS)
def test_a_refutation_by_hand_is_refuted(make):
    assert verify(make()).verdict == "refuted"


def test_the_statement_says_everything_that_was_verified():
    assert verify(weighted_pair()).statement == (
        "law weighted-pair: names are not verified, the verdict is on the field below",
        "gains and constants: k = 2",
        "domain: cells; states with weights: x = 2, y = 1",
        "uncertain, measurable in time: d in [-1/2, 1/2]",
        "dx/dt = -1*sign(x)*|x|^(1/2)",
        "dy/dt = -1*sign(y) + 1*d",
        "V = 1*|x|^(3/2) + 1*|y|^(3)",
        "claims: V >= 1/2 * sum u_i^3; dV/dt <= -1 * sum u_i^2; u_i = |x_i|^(1/weight)",
        "homogeneous degrees: V 3, dV/dt 2",
        "conclusion: the origin is globally asymptotically stable, in finite time",
    )


def test_roots_lifts_and_settling_times_are_stated():
    assert "root: s in [7/5, 3/2] is the positive square root of k" in verify(rooted_relay()).statement
    assert "dV/dt <= -2 * V^(1/2)" in verify(settling_relay()).statement
    assert "settling time: the origin is reached within 1 * V(0)^(1/2)" in verify(settling_relay()).statement
    lines = verify(nested_sign()).statement
    assert 'argument of a nested power: n = 1*x + 1*y + 0 for ["7", ["c", "s"], [["x", "3", "a"]]]' in lines
    assert "dx/dt = -1*sign(n)*|n|^(1/3)" in verify(nested_root()).statement


def test_cells_without_interior_need_no_witness_and_admit_none():
    document = nested_sum()
    thin = copy.deepcopy(document["witnesses"][1]) | {"obligation": "decrease ++-"}
    document["witnesses"].insert(2, thin)
    assert "next witness" in refusal(document)


def test_a_lift_that_is_zero_on_open_sets_is_refused():
    """x' = x + m, n = x, m = n - x = 0 is unstable, V = x^2, but z P = P (z - 0) for the variable z = 0 of m.

    With h = tw - su and k = rz - (tw - su) every P has z P = rP h + rP k: no square is needed.
    """
    document = relay()
    document["lifts"] = {
        "n": [["1", [], [["x", "1", "s"]]]],
        "m": [["1", [], [["n", "1", "s"]]], ["-1", [], [["x", "1", "s"]]]],
    }
    document["field"] = {"x": [["1", [], [["x", "1", "s"]]], ["1", [], [["m", "1", "s"]]]]}
    for s, r in itertools.product((1, -1), repeat=2):
        cofactor = {"2,0,0": str(-3 * r), "1,0,1": str(-2 * s)}
        cell = "".join("+" if sign > 0 else "-" for sign in (s, s, r))
        entry = witness(f"decrease {cell}", square([0] * 3, [[0] * 3], "1"), multiplier={"0,0,1": "1"})
        document["witnesses"] += [entry | {"squares": [], "equalities": [cofactor] * 2}]
    del document["witnesses"][1]
    assert "zero on a null set only" in refusal(document)


def test_lifts_may_be_nested():
    """With y of its own in its argument the second lift is zero on a null set only: m = [n]^1 + y, n = x."""
    document = nested_sum()
    document["lifts"] = {
        "n": [["1", [], [["x", "1", "s"]]]],
        "m": [["1", [], [["n", "1", "s"]]], ["1", [], [["y", "1", "s"]]]],
    }
    document["field"] = {name: [["-2", [], [[name, "1", "s"]]], ["-1", [], [["m", "1", "s"]]]] for name in "xy"}
    del document["witnesses"][1:]
    for s, r, t in itertools.product((1, -1), repeat=3):
        if s != r or r == t:  # else tz = sw + rv has no solution of positive numbers
            # -V' - u^2 - v^2 = 3u^2 + 3v^2 + 2tz(su + rv); su = sw - h, sw + rv = tz - k
            basis = [[int(i == j) for j in range(4)] for i in range(4)]
            form = square([0] * 4, basis[:2] + basis[3:], "3", "0", "0", "3", "0", "2")
            cofactors = [{"0,0,0,1": str(-2 * t)}] * 2
            cell = "".join("+" if sign > 0 else "-" for sign in (s, r, s, t))
            document["witnesses"].append(witness(f"decrease {cell}", form, equalities=cofactors))
    assert verify(document).verdict == "proved"


def test_bounds_of_states_are_stated_in_the_order_of_the_states():
    statement = verify(bounded_oscillator()).statement
    first = statement.index("V >= 2 * |x|^(2)")
    assert statement[first + 1] == "V >= 1 * |y|^(2)"
    assert "V >= 1/3 * |y|^(3)" in verify(bounded_pair()).statement


def test_gains_are_substituted_in_the_field():
    assert "dx/dt = -2*sign(x)" in verify(relay()).statement
    assert "dx/dt = -3*x" in verify(decay()).statement


def test_equal_degrees_do_not_settle_in_finite_time():
    conclusion = verify(oscillator_on_cells()).statement[-1]
    assert conclusion.endswith("globally asymptotically stable, finite time is not claimed")


def test_rate_is_exponential_for_quadratic_functions_only():
    quartic = edited(
        decay(),
        ("V", [["1", [], [["x", "4", "a"]]]]),  # -V' - 2V = 12 x^4 - 2 x^4
        ("witnesses", 0, "squares", [square([0], [[2]], "3/4")]),
        ("witnesses", 1, "squares", [square([0], [[2]], "10")]),
    )
    assert verify(decay()).statement[-1].endswith("exponentially with rate a")
    assert verify(quartic).statement[-1].endswith("with V(t) <= exp(-2*a*t)*V(0)")


def test_homogeneous_equilibria_refute_local_stability_too():
    assert "the origin is not asymptotically stable" in verify(overpowered_relay()).statement[-1]
    assert "homogeneous degrees: field -1" in verify(overpowered_relay()).statement


def test_a_single_equilibrium_refutes_global_stability_only():
    """x' = x^2 - x is stable at 0 and rests at 1."""
    document = relay()
    document["field"]["x"] = [["1", [], [["x", "2", "a"]]], ["-1", [], [["x", "1", "s"]]]]
    document = refuted(document, parameters={}, point={"x": "1"}, weights={"+": "1"})
    assert "not globally asymptotically stable" in verify(document).statement[-1]


def test_terms_without_effect_do_not_spoil_homogeneity():
    document = overpowered_relay()
    document["field"]["x"].append(["1", ["e"], [["x", "2", "a"]]])
    document["uncertain"]["e"] = ["0", "1"]
    document["refutation"]["parameters"]["e"] = "0"
    assert "the origin is not asymptotically stable" in verify(document).statement[-1]


def test_an_equilibrium_may_have_negative_coordinates():
    """x' = -sqrt|x| sign(x) - 3 rests at x = -9: 3 - 3 = 0."""
    document = edited(inhomogeneous_rest(), ("field", "x", 1, 0, "-3"))
    document["refutation"] |= {"point": {"x": "-3"}, "weights": {"-": "1"}}
    assert verify(document).verdict == "refuted"


def test_the_tight_rate_leaves_a_zero_polynomial_without_squares():
    """With a = 3, -V' - 2aV = 6x^2 - 6x^2 = 0."""
    tight = edited(decay(), ("claims", "rate", "3"), ("witnesses", 1, "squares", []))
    assert verify(tight).verdict == "proved"
    assert "rate" in refusal(edited(tight, ("claims", "rate", "301/100")))


def test_a_zero_polynomial_admits_only_the_multiplier_one():
    """Otherwise a number in the file would be without effect. V - u^2 = 0."""
    tight = edited(relay(), ("claims", "positive", "1"), ("witnesses", 0, "squares", []))
    assert verify(tight).verdict == "proved"
    assert "multiplier" in refusal(edited(tight, ("witnesses", 0, "multiplier", {"0": "2"})))
    assert "squares" in refusal(edited(tight, ("witnesses", 0, "squares", [square([0], [[1]], "1")])))


def test_a_positive_multiplier_may_scale_the_polynomial():
    """(2 + u) u^2/2 = u^2 + u u^2/2."""
    scaled = edited(
        relay(),
        ("witnesses", 0, "multiplier", {"0": "2", "1": "1"}),
        ("witnesses", 0, "squares", [square([0], [[1]], "1"), square([1], [[1]], "1/2")]),
    )
    assert verify(scaled).verdict == "proved"


def test_obligations_of_different_kinds_share_a_witness():
    """x' = -x/2, V = x^2, V' = -x^2.

    V - u^2/2 = u^2/2 and -V' - u^2/2 = u^2/2 are one polynomial, hence one witness.
    """
    shared = edited(
        relay(),
        ("field", "x", [["-1/2", [], [["x", "1", "s"]]]]),
        ("claims", "decrease", "1/2"),
        ("witnesses", 1, REMOVED),
    )
    assert verify(shared).verdict == "proved"


def test_a_range_of_one_point_has_one_vertex():
    """With d = 1 alone, cell + gives u and cell - gives 5u."""
    point = edited(disturbed_relay(), ("uncertain", "d", ["1", "1"]))
    point["witnesses"][1:] = [
        witness("decrease + d=1", square([1], [[0]], "1")),
        witness("decrease - d=1", square([1], [[0]], "5")),
    ]
    assert verify(point).verdict == "proved"


def test_ranges_of_one_point_count_once_as_obligations(monkeypatch):
    """Two cells with one vertex each, once for V and once for V'."""
    point = edited(relay(), ("uncertain", {f"d{i}": ["1", "1"] for i in range(8)}))
    point["witnesses"][1]["obligation"] += "".join(f" d{i}=1" for i in range(8))
    monkeypatch.setattr(stability, "MAX_OBLIGATIONS", 4)
    assert verify(point).verdict == "proved"
    monkeypatch.setattr(stability, "MAX_OBLIGATIONS", 3)
    assert "obligations" in refusal(point)


def test_vertices_run_with_the_last_parameter_fastest():
    """x' = -2 sign(x) + d + e/4: 4u - 2ds u - es u/2 - u, from 11/2 to 1/2, the same on cell -."""
    document = disturbed_relay()
    document["uncertain"]["e"] = ["-1", "1"]
    document["field"]["x"].append(["1/4", ["e"], []])
    document["witnesses"][1:] = [
        witness(f"decrease + d={d} e={e}", square([1], [[0]], number))
        for d, e, number in [("-1", "-1", "11/2"), ("-1", "1", "9/2"), ("1", "-1", "3/2"), ("1", "1", "1/2")]
    ]
    assert verify(document).verdict == "proved"
    document["witnesses"][2:4] = document["witnesses"][3:1:-1]
    assert "witness" in refusal(document)


def test_parity_tells_the_cells_apart():
    """x' = -2x - |x|: -V' = 4u^2 + 2 s u^2, and minus u^2 that is 5u^2 on cell + and u^2 on cell -."""
    document = edited(
        relay(),
        ("field", "x", [["-2", [], [["x", "1", "s"]]], ["-1", [], [["x", "1", "a"]]]]),
        ("witnesses", 1, witness("decrease +", square([0], [[1]], "5"))),
    )
    document["witnesses"].append(witness("decrease -", square([0], [[1]], "1")))
    assert verify(document).verdict == "proved"


def test_seventeen_obligations_with_dense_blocks_of_six_are_cheap(monkeypatch):
    """x_i' = -2 x_i + sum p x_j: the Gram matrix of a quadratic form is the matrix of the form itself."""
    monkeypatch.setattr(exact_numbers, "MAX_STEPS", 20_000)  # of about a microsecond
    names, size = "abcdef", 6
    document = edited(decay(), ("gains", {}), ("states", dict.fromkeys(names, 1)))
    document["uncertain"] = {f"p{i}": ["-1/97", "1/89"] for i in range(4)}
    document["field"] = {
        name: [["-2", [], [[name, "1", "s"]]]]
        + [["1", [f"p{j % 4}"], [[names[j], "1", "s"]]] for j in range(size) if j != i]
        for i, name in enumerate(names)
    }
    document["V"] = [["1", [], [[name, "2", "a"]]] for name in names]
    basis = [[int(i == j) for j in range(size)] for i in range(size)]
    pairs = list(itertools.combinations_with_replacement(range(size), 2))

    def gram(values):  # -V' - 2V = sum (4 - 2) x_i^2 - 2 sum_{i != j} p_{j mod 4} x_i x_j
        return [str(Fraction(2) if i == j else -values[j % 4] - values[i % 4]) for i, j in pairs]

    diagonal = [str(Fraction(3, 4) * (i == j)) for i, j in pairs]
    document["witnesses"] = [witness("positive", square([0] * size, basis, *diagonal))]
    for values in itertools.product((Fraction(-1, 97), Fraction(1, 89)), repeat=4):
        name = "rate " + " ".join(f"p{i}={value}" for i, value in enumerate(values))
        document["witnesses"].append(witness(name, square([0] * size, basis, *gram(values))))
    assert verify(document).verdict == "proved"


# ---------------------------------------------------------------- false statements are not


@pytest.mark.parametrize(
    ("bound", "reason", "numbers"),
    [("2", "form of one degree", "7 -1"), ("3", "positive definite", "9 -3")],  # V' = 0; V' = 2u
)
def test_a_disturbance_as_strong_as_the_gain_is_not_proved(bound, reason, numbers):
    """-V' - u = (4 - 2 d s - 1) u: no positive number can stand in the Gram matrix for d s = 2 or 3."""
    strong = edited(disturbed_relay(), ("uncertain", "d", [f"-{bound}", bound]))
    strong["witnesses"][1:] = [
        witness(f"decrease + d={end}", square([1], [[0]], number))
        for end, number in zip((f"-{bound}", bound), numbers.split(), strict=True)
    ]
    assert reason in refusal(strong)


@pytest.mark.parametrize(
    ("gram", "definite"),
    [
        (["2", "1", "1"], True),
        (["1", "1", "1"], False),  # singular
        (["1", "2", "1"], False),
        (["0", "0", "1"], False),
        (["-1", "0", "-1"], False),  # determinant positive
        (["1/3", "1/7", "1/16"], True),  # 1/48 > 1/49
        (["1/3", "1/7", "1/17"], False),  # 1/51 < 1/49
    ],
)
def test_two_by_two_matrices_are_decided_by_their_determinant(gram, definite):
    numbers, _ = exact_numbers.to_integers([Fraction(entry) for entry in gram], "")
    upper = [[numbers[0], numbers[1]], [0, numbers[2]]]
    assert squares.is_positive_definite(upper) is definite


def test_elimination_agrees_with_leading_minors_by_permutations():
    """Compare with Leibniz' formula for every leading minor of random 4 x 4 matrices B'B - shift."""
    generator = random.Random(1)
    verdicts = set()
    for _ in range(200):
        rows = [[generator.randint(-4, 4) for _ in range(4)] for _ in range(4)]
        shift = generator.randint(0, 3)
        matrix = [[sum(row[i] * row[j] for row in rows) - shift * (i == j) for j in range(4)] for i in range(4)]
        expected = all(leibniz([row[:k] for row in matrix[:k]]) > 0 for k in range(1, 5))
        verdicts.add(expected)
        assert squares.is_positive_definite(matrix) is expected
    assert verdicts == {True, False}


def leibniz(matrix):
    total = 0
    for order in itertools.permutations(range(len(matrix))):
        swaps = sum(a > b for a, b in itertools.combinations(order, 2))
        term = (-1) ** swaps
        for i, j in enumerate(order):
            term *= matrix[i][j]
        total += term
    return total


# ---------------------------------------------------------------- every rule, broken once

X2 = [["1", [], [["x", "2", "a"]]]]
LONG = "1" + "0" * 400
UNUSUAL = ["4/2", "2/1", "-0", "0/1", "0/2", "2/0", "2/-1", "2/01", "02", "+2", " 2", "2 ", "2\n"]
UNUSUAL += ["2.0", "2e0", "", "-", "/2", "--2", "2//1", "²", "٢", "1_0", "0x2", "NaN", "inf"]
UNUSUAL += [LONG, f"1/{LONG}"]

BROKEN = {
    # header
    "format 2": (relay, [("format", 2)], "format"),
    "format true": (relay, [("format", True)], "format"),
    "format string": (relay, [("format", "1")], "format"),
    "unknown key": (relay, [("note", "hello")], "unknown keys"),
    "missing key": (relay, [("constants", REMOVED)], "constants is missing"),
    "law with a space": (relay, [("law", "a b")], "law"),
    "law empty": (relay, [("law", "")], "law"),
    "law too long": (relay, [("law", "a" * 41)], "law"),
    "law with a newline": (relay, [("law", "relay\n")], "law"),
    "law a list": (relay, [("law", [])], "law"),
    "domain unknown": (relay, [("domain", "complex")], "domain"),
    "domain a list": (relay, [("domain", ["cells"])], "domain"),
    "null": (relay, [("law", None)], "law"),
    # names
    "gain named like a state": (relay, [("gains", "x", "1")], "different"),
    "gain named like an uncertain one": (disturbed_relay, [("gains", "d", "1")], "different"),
    "constant named like a gain": (relay, [("constants", "k", "1")], "different"),
    "name with a newline": (relay, [("gains", "b\n", "1")], "name"),
    "name with a digit first": (relay, [("gains", "1b", "1")], "name"),
    "name with a Greek letter": (relay, [("gains", "β", "1")], "name"),
    "name too long": (relay, [("gains", "b" * 41, "1")], "name"),
    "lone surrogate": (relay, [("gains", "\ud800", "1")], "name"),
    "too many gains": (relay, [("gains", {f"k{i}": "1" for i in range(65)})], "gains"),
    "too many gains and constants": (
        relay,
        [("gains", {f"k{i}": "1" for i in range(33)}), ("constants", {f"c{i}": "1" for i in range(32)})],
        "gains and constants",
    ),
    # states
    "no states": (relay, [("states", {})], "states"),
    "seven states": (relay, [("states", dict.fromkeys("abcdefg", 1))], "states"),
    "states as a list": (relay, [("states", ["x"])], "states"),
    "weight 0": (relay, [("states", "x", 0)], "weight"),
    "weight 13": (relay, [("states", "x", 13)], "weight"),
    "weight true": (relay, [("states", "x", True)], "weight"),
    "weight in a string": (relay, [("states", "x", "1")], "weight"),
    "weight 2 on reals": (decay, [("states", "x", 2)], "weight"),
    "state without field": (oscillator, [("field", "y", REMOVED)], "y is missing"),
    "field without state": (relay, [("field", "z", [])], "unknown keys"),
    # uncertain
    "range reversed": (disturbed_relay, [("uncertain", "d", ["1", "-1"])], "lower end first"),
    "range of one": (disturbed_relay, [("uncertain", "d", ["1"])], "range"),
    "range of three": (disturbed_relay, [("uncertain", "d", ["0", "1", "2"])], "range"),
    "range of integers": (disturbed_relay, [("uncertain", "d", [-1, 1])], "integer"),
    "nine uncertain": (relay, [("uncertain", {f"d{i}": ["0", "1"] for i in range(9)})], "uncertain"),
    "uncertain squared": (disturbed_relay, [("field", "x", 1, 1, ["d", "d"])], "affine"),
    "uncertain in V": (disturbed_relay, [("V", 0, 1, ["d"])], "uncertain"),
    "too many obligations": (
        oscillator_on_cells,
        [
            ("states", dict.fromkeys("xypqrs", 1)),
            ("uncertain", {f"p{i}": ["0", "1"] for i in range(8)}),
            *[("field", name, []) for name in "pqrs"],
        ],
        "obligations",
    ),
    # rationals
    **{f"rational {text!r}": (relay, [("gains", "k", text)], "k must be") for text in UNUSUAL},
    "rational as integer": (relay, [("gains", "k", 2)], "k must be"),
    "rational as float": (relay, [("gains", "k", 2.5)], "a number"),
    "rational as boolean": (relay, [("gains", "k", False)], "k must be"),
    "rational as null": (relay, [("gains", "k", None)], "k must be"),
    "NaN": (relay, [("gains", "k", float("nan"))], "a number"),
    "infinity": (relay, [("gains", "k", float("-inf"))], "a number"),
    # terms
    "zero number": (relay, [("field", "x", 0, 0, "0")], "nonzero"),
    "term of two": (relay, [("field", "x", 0, ["1", []])], "a list of 3"),
    "term as object": (relay, [("field", "x", 0, {})], "a list"),
    "term of four": (relay, [("field", "x", 0, ["1", [], [], []])], "a list of 3"),
    "terms as object": (relay, [("field", "x", {})], "a list"),
    "unknown parameter": (relay, [("field", "x", 0, 1, ["q"])], "product of gains"),
    "state as parameter": (relay, [("field", "x", 0, 1, ["x"])], "product of gains"),
    "parameter as list": (relay, [("field", "x", 0, 1, [["k"]])], "product of gains"),
    "parameter as string": (relay, [("field", "x", 0, 1, "k")], "a list"),
    "many parameters": (relay, [("field", "x", 0, 1, ["k"] * 33)], "parameters"),
    "long product": (relay, [("gains", "k", "9" * 400), ("field", "x", 0, 1, ["k", "k"])], "599 digits"),
    "gain as factor": (relay, [("field", "x", 0, 2, [["k", "1", "s"]])], "power of a state"),
    "state as list": (relay, [("field", "x", 0, 2, [[["x"], "1", "s"]])], "power of a state"),
    "kind unknown": (relay, [("field", "x", 0, 2, [["x", "1", "b"]])], "kind"),
    "kind as list": (relay, [("field", "x", 0, 2, [["x", "1", ["s"]]])], "kind"),
    "factor of two": (relay, [("field", "x", 0, 2, [["x", "1"]])], "a list of 3"),
    "factor of four": (relay, [("field", "x", 0, 2, [["x", "1", "s", "s"]])], "a list of 3"),
    "exponent integer": (relay, [("field", "x", 0, 2, [["x", 1, "s"]])], "string"),
    "exponent negative": (relay, [("field", "x", 0, 2, [["x", "-1", "s"]])], "power 0 to"),
    "exponent 25": (relay, [("field", "x", 0, 2, [["x", "25", "s"]])], "power 0 to"),
    "exponent 0 of kind a": (relay, [("field", "x", 0, 2, [["x", "0", "a"]])], "positive"),
    "exponent off the weight": (relay, [("field", "x", 0, 2, [["x", "1/2", "s"]])], "integer"),
    "state twice": (relay, [("field", "x", 0, 2, [["x", "1", "s"], ["x", "1", "a"]])], "at most once"),
    "sign squared": (relay, [("field", "x", 0, 2, [["x", "0", "s"], ["x", "0", "s"]])], "at most once"),
    "201 terms": (relay, [("field", "x", [["1", [], []]] * 201)], "200 entries"),
    "even s on reals": (decay, [("V", 0, 2, [["x", "2", "s"]])], "on reals"),
    "odd a on reals": (decay, [("V", 0, 2, [["x", "3", "a"]])], "on reals"),
    "sign on reals": (decay, [("field", "x", 0, 2, [["x", "0", "s"]])], "on reals"),
    "root on reals": (decay, [("field", "x", 0, 2, [["x", "1/3", "s"]])], "integer"),
    # V
    "V with |x|": (relay, [("V", 0, 2, [["x", "1", "a"]])], "C1"),
    "V with a root": (weighted_pair, [("V", 0, 2, [["x", "1/2", "a"]])], "C1"),
    "V with a signed root": (weighted_pair, [("V", 0, 2, [["x", "1/2", "s"], ["y", "2", "s"]])], "C1"),
    "V with a sign": (oscillator_on_cells, [("V", 1, 2, [["x", "2", "a"], ["y", "0", "s"]])], "C1"),
    "V empty": (relay, [("V", [])], "form of one degree"),
    "V constant": (relay, [("V", [["1", [], []]])], "form of one degree"),
    "V that cancels": (relay, [("V", [*X2, ["-1", [], [["x", "2", "a"]]]])], "form of one degree"),
    "V of two degrees": (relay, [("V", [*X2, ["1", [], [["x", "4", "a"]]]])], "form of one degree"),
    "V of degree 3 on reals": (decay, [("V", [["1", [], [["x", "3", "s"]]]])], "even degree"),
    "V of two degrees on one cell": (
        relay,  # on + the cubes cancel
        [("V", [*X2, ["1", [], [["x", "3", "s"]]], ["-1", [], [["x", "3", "a"]]]])],
        "form of one degree",
    ),
    # claims
    "claim of zero": (relay, [("claims", "positive", "0")], "positive"),
    "claim below zero": (relay, [("claims", "decrease", "-1")], "positive"),
    "rate of zero": (decay, [("claims", "rate", "0")], "positive"),
    "rate on cells": (relay, [("claims", {"positive": "1/2", "rate": "1"})], "decrease is missing"),
    "decrease on reals": (decay, [("claims", {"positive": "1/4", "decrease": "1"})], "rate is missing"),
    "bound of zero": (bounded_pair, [("claims", "bound_y", "0")], "positive"),
    "bound of no state": (bounded_pair, [("claims", "bound_z", "1")], "unknown keys"),
    "bound too large": (bounded_oscillator, [("claims", "bound_x", "3")], "identity"),
    "bound without witness": (relay, [("claims", "bound_x", "1/3")], "next witness"),
    "bound claim missing": (bounded_pair, [("claims", "bound_y", REMOVED)], "next witness"),
    "bound witness missing": (bounded_pair, [("witnesses", 1, REMOVED)], "next witness"),
    "claims both": (relay, [("claims", "rate", "1")], "unknown keys"),
    # witnesses
    "witness missing": (relay, [("witnesses", 1, REMOVED)], "an object"),
    "witness missing first": (relay, [("witnesses", 0, REMOVED)], "next witness"),
    "no witnesses": (relay, [("witnesses", [])], "an object"),
    "witness misnamed": (relay, [("witnesses", 0, "obligation", "positive -")], "next witness"),
    "witness name a list": (relay, [("witnesses", 0, "obligation", ["positive +"])], "next witness"),
    "witness with a note": (relay, [("witnesses", 0, "note", "x")], "unknown keys"),
    "witness without squares": (relay, [("witnesses", 0, "squares", REMOVED)], "squares is missing"),
    "witness as list": (relay, [("witnesses", 0, [])], "an object"),
    "squares empty": (relay, [("witnesses", 0, "squares", [])], "identity"),
    "squares as object": (relay, [("witnesses", 0, "squares", {})], "a list"),
    "multiplier empty": (relay, [("witnesses", 0, "multiplier", {})], "nonempty"),
    "multiplier negative": (relay, [("witnesses", 0, "multiplier", {"0": "-1"})], "positive"),
    "multiplier zero": (relay, [("witnesses", 0, "multiplier", {"0": "1", "1": "0"})], "positive"),
    "multiplier list": (relay, [("witnesses", 0, "multiplier", ["1"])], "an object"),
    "multiplier key short": (oscillator, [("witnesses", 0, "multiplier", {"0": "1"})], "keys such as"),
    "multiplier key padded": (relay, [("witnesses", 0, "multiplier", {"00": "1"})], "keys such as"),
    "multiplier key spaced": (oscillator, [("witnesses", 0, "multiplier", {"0, 0": "1"})], "keys such as"),
    "multiplier key negative": (relay, [("witnesses", 0, "multiplier", {"-1": "1"})], "keys such as"),
    "multiplier key huge": (relay, [("witnesses", 0, "multiplier", {"9" * 5000: "1"})], "keys such as"),
    "multiplier 2 on reals": (decay, [("witnesses", 0, "multiplier", {"0": "2"})], "1 on reals"),
    "multiplier x on reals": (decay, [("witnesses", 0, "multiplier", {"2": "1"})], "1 on reals"),
    "times 2": (relay, [("witnesses", 1, "squares", 0, "times", [2])], "up to 1"),
    "times true": (relay, [("witnesses", 1, "squares", 0, "times", [True])], "up to 1"),
    "times short": (oscillator_on_cells, [("witnesses", 0, "squares", 0, "times", [1])], "times"),
    "times on reals": (decay, [("witnesses", 0, "squares", 0, "times", [1])], "up to 0"),
    "basis empty": (relay, [("witnesses", 0, "squares", 0, square([0], []))], "basis"),
    "basis repeated": (
        relay,
        [("witnesses", 0, "squares", 0, square([0], [[1], [1]], "1/8", "1/16", "1/4"))],
        "repetitions",
    ),
    "basis boolean": (relay, [("witnesses", 0, "squares", 0, "basis", [[True]])], "integers"),
    "basis rational": (relay, [("witnesses", 0, "squares", 0, "basis", [["1"]])], "integers"),
    "basis negative": (relay, [("witnesses", 0, "squares", 0, "basis", [[-1]])], "integer"),
    "basis long": (relay, [("witnesses", 0, "squares", 0, "basis", [[1, 0]])], "basis"),
    "basis of polynomials": (
        relay,
        [("witnesses", 0, "squares", 0, {"times": [0], "basis": [{"1": "2"}], "gram": ["1/8"]})],
        "a list",
    ),
    "basis of 201": (relay, [("witnesses", 0, "squares", 0, "basis", [[i] for i in range(201)])], "basis"),
    "gram short": (oscillator, [("witnesses", 0, "squares", 0, "gram", ["2", "1"])], "gram"),
    "gram full": (oscillator, [("witnesses", 0, "squares", 0, "gram", ["2", "1", "1", "1"])], "gram"),
    "gram zero": (relay, [("witnesses", 0, "squares", 0, "gram", ["0"])], "positive definite"),
    "gram of integers": (relay, [("witnesses", 0, "squares", 0, "gram", [1])], "string"),
    "gram indefinite": (
        oscillator_on_cells,  # 2u^2 - 4uw + w^2 and 6uw add up to the right form
        [
            ("witnesses", 0, "squares", 0, square([1, 1], [[0, 0]], "6")),
            ("witnesses", 0, "squares", 1, "gram", ["2", "-2", "1"]),
        ],
        "positive definite",
    ),
    "gram negative beside a positive one": (
        relay,
        [("witnesses", 0, "squares", [square([0], [[1]], "1"), square([0], [[1]], "-1/2")])],
        "positive definite",
    ),
    # roots
    "root of nothing": (rooted_relay, [("roots", "s", 0, "q")], "gain or constant"),
    "root of a list": (rooted_relay, [("roots", "s", 0, [])], "gain or constant"),
    "root of a negative": (rooted_relay, [("gains", "k", "-2")], "positive number"),
    "root of zero": (rooted_relay, [("gains", "k", "0"), ("roots", "s", ["k", "0", "1"])], "positive number"),
    "root below its range": (rooted_relay, [("gains", "k", "1")], "contains the root"),
    "root above its range": (rooted_relay, [("gains", "k", "3")], "contains the root"),
    "root above its number": (rooted_relay, [("roots", "s", ["k", "3/2", "8/5"])], "contains the root"),
    "root below its number": (rooted_relay, [("roots", "s", ["k", "1", "7/5"])], "contains the root"),
    "root with three ends": (rooted_relay, [("roots", "s", ["k", "7/5", "3/2", "2"])], "a list of 3"),
    "root with one end": (rooted_relay, [("roots", "s", ["k", "7/5"])], "a list of"),
    "root negative": (rooted_relay, [("roots", "s", 1, "-7/5")], "contains the root"),
    "root both negative": (rooted_relay, [("roots", "s", ["k", "-2", "-1"])], "contains the root"),
    "root reversed": (rooted_relay, [("roots", "s", ["k", "7/5", "-3"])], "lower end first"),
    "root squared": (rooted_relay, [("field", "x", 0, 1, ["s", "s"])], "affine"),
    "root in V": (rooted_relay, [("V", 0, 1, ["s"])], "uncertain"),
    "root named like a gain": (rooted_relay, [("roots", "k", ["k", "0", "2"])], "different"),
    "five roots": (rooted_relay, [("roots", {f"s{i}": ["k", "0", "2"] for i in range(5)})], "roots"),
    # lifts
    "lift unused": (nested_sum, [("lifts", "m", [["1", [], [["x", "1", "s"]]]])], "used"),
    "lift used where disregarded": (
        nested_sign,
        [("lifts", {"m": X2, **nested_sign()["lifts"]}), ("lifts", "n", 2, 2, [["m", "1", "s"]])],
        "used",
    ),
    "lift in itself": (nested_sum, [("lifts", "n", 0, 2, [["n", "1", "s"]])], "earlier lift"),
    "lift in V": (nested_sum, [("V", 0, 2, [["n", "2", "a"]])], "power of a state"),
    "lift of two degrees": (nested_sum, [("lifts", "n", 0, 2, [["x", "2", "s"]])], "form of one degree"),
    "lift empty": (nested_sum, [("lifts", "n", [])], "form of one degree"),
    "lift that varies": (
        nested_sign,
        [("uncertain", {"p": ["1", "1001/1000"]}), ("lifts", "n", 0, 1, ["p"])],
        "that vary",
    ),
    "lift with a nonzero term": (nested_sign, [("gains", "c", "1")], "form of one degree"),
    "lift with a root and a power": (nested_root_sign, [("field", "x", 1, 2, [["n", "1", "s"]])], "by its sign only"),
    "lift with an open sign": (
        nested_root_sign,
        [("lifts", "n", [*nested_root_sign()["lifts"]["n"], ["-29/20", [], [["y", "1", "s"]]]])],
        "the ranges of roots decide",
    ),
    "lift with an open zero": (
        nested_root_sign,
        [("lifts", "n", [*nested_root_sign()["lifts"]["n"], ["-3/2", [], [["y", "1", "s"]]]])],
        "the ranges of roots decide",
    ),
    "root in a lift of another range": (
        nested_root_sign,
        [("roots", "s", ["k", "7/5", "29/20"])],
        "identity",
    ),
    "lift to a fraction": (nested_sum, [("field", "x", 1, 2, [["n", "1/2", "s"]])], "integers"),
    "lift twice": (nested_sum, [("field", "x", 1, 2, [["n", "1", "s"], ["n", "1", "a"]])], "at most once"),
    "lift on reals": (decay, [("lifts", {"n": [["1", [], [["x", "1", "s"]]]]})], "lifts"),
    "lift named like a state": (nested_sum, [("lifts", {"x": X2})], "different"),
    "lift of other degree": (
        nested_root,  # of degree 3 for x > 0 and 6 for x < 0
        [("lifts", "n", [[f"{c}/2", [], [["x", a, kind]]] for c, a, kind in ("11s", "11a", "12s", ("-1", "2", "a"))])],
        "of one degree on all cells",
    ),
    "equalities missing": (nested_sum, [("witnesses", 1, "equalities", [])], "equalities"),
    "equality without lift": (relay, [("witnesses", 0, "equalities", [{"0": "1"}])], "equalities"),
    "inequality without lift": (relay, [("witnesses", 0, "inequalities", [[]])], "inequalities"),
    "inequality indefinite": (nested_sign, [("witnesses", 1, "inequalities", 0, 0, "gram", ["-2"])], "definite"),
    "three squares of one variable": (relay, [("witnesses", 0, "squares", [square([0], [[1]], "1/6")] * 3)], "squares"),
    # decay
    "decay too large": (settling_relay, [("claims", "decay", "3")], "identity"),
    "decay of zero": (settling_relay, [("claims", "decay", "0")], "positive"),
    "decay on reals": (decay, [("claims", "decay", "1")], "unknown keys"),
    "decay without witness": (relay, [("claims", "decay", "1")], "an object"),
    # refutations
    "refutation with roots": (overpowered_relay, [("roots", {"s": ["k", "1", "2"]})], "empty"),
    "refutation with lifts": (
        overpowered_relay,
        [("lifts", {"n": X1}), ("field", "x", 0, 2, [["n", "0", "s"]])],
        "empty",
    ),
    "refutation with V": (overpowered_relay, [("V", X2)], "unknown keys"),
    "refutation on reals": (
        overpowered_relay,
        [("domain", "reals"), ("field", "x", [["1", ["d"], [["x", "1", "s"]]]])],
        "cells",
    ),
    "refutation key": (overpowered_relay, [("refutation", "note", "x")], "unknown keys"),
    "parameter missing": (overpowered_relay, [("refutation", "parameters", {})], "d is missing"),
    "parameter beyond": (overpowered_relay, [("refutation", "parameters", "d", "4")], "in its range"),
    "parameter below": (overpowered_relay, [("refutation", "parameters", "d", "-4")], "in its range"),
    "parameter unknown": (sliding_rest, [("refutation", "parameters", "d", "1")], "unknown keys"),
    "point at the origin": (overpowered_relay, [("refutation", "point", "x", "0")], "away from the origin"),
    "point incomplete": (sliding_rest, [("refutation", "point", "y", REMOVED)], "y is missing"),
    "point on the other side": (overpowered_relay, [("refutation", "point", "x", "-1")], "- is missing"),
    "point elsewhere": (inhomogeneous_rest, [("refutation", "point", "x", "2")], "weighted limit"),
    "weights incomplete": (sliding_rest, [("refutation", "weights", {"++": "1"})], "+- is missing"),
    "weights of other cells": (sliding_rest, [("refutation", "weights", "--", "0")], "unknown keys"),
    "weights beyond one": (sliding_rest, [("refutation", "weights", {"++": "1", "+-": "1"})], "sum 1"),
    "weights of sum zero": (sliding_rest, [("refutation", "weights", {"++": "0", "+-": "0"})], "sum 1"),
    "weights negative": (sliding_rest, [("refutation", "weights", {"++": "2", "+-": "-1"})], "non-negative"),
    "weights uneven": (
        sliding_rest,
        [("refutation", "weights", {"++": "1/3", "+-": "2/3"})],
        "weighted limit",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_rule_is_refused_for_its_reason(case):
    make, steps, reason = BROKEN[case]
    assert verify(make()).verdict in ("proved", "refuted")
    assert reason in refusal(edited(make(), *steps))


@pytest.mark.parametrize("ends", [("0", "2"), ("1", "2"), ("0", "3")])
def test_roots_may_stand_at_the_ends_of_their_range(ends):
    """x' = -s sign(x) with s = sqrt(1) or sqrt(4): the ends need not be the root; x' = 0 at s = 0 is not proved."""
    low, high = ends
    for number in ("1", "4"):
        document = edited(rooted_relay(), ("gains", "k", number), ("roots", "s", ["k", low, high]))
        contained = Fraction(low) ** 2 <= Fraction(number) <= Fraction(high) ** 2
        assert ("contains the root" in refusal(document)) is not contained


def test_an_exact_root_is_one_point():
    """x' = -s sign(x) with s = sqrt(9/4) = 3/2: -V' - u = 2u; s = sqrt(1/4) = 1/2 leaves nothing."""
    exact = edited(rooted_relay(), ("gains", "k", "9/4"), ("roots", "s", ["k", "3/2", "3/2"]))
    exact["witnesses"][1:] = [witness("decrease + s=3/2", square([1], [[0]], "2"))]
    assert verify(exact).verdict == "proved"
    small = edited(exact, ("gains", "k", "1/4"), ("roots", "s", ["k", "1/2", "1/2"]), ("claims", "decrease", "1/2"))
    small["witnesses"][1:] = [witness("decrease + s=1/2", square([1], [[0]], "1/2"))]
    assert verify(small).verdict == "proved"


@pytest.mark.parametrize("ends", [["-3", "2"], ["2", "3"]])
def test_a_parameter_may_stand_at_an_end_of_its_range(ends):
    assert verify(edited(overpowered_relay(), ("uncertain", "d", ends))).verdict == "refuted"


def test_a_field_of_two_degrees_is_refused_on_cells():
    document = relay()
    document["field"]["x"].append(["-1", [], [["x", "1", "s"]]])
    assert "form of one degree" in refusal(document)


def test_degrees_must_agree_between_cells():
    """x' = -x (1 + sign x)/2 - x^3 (1 - sign x)/2: V' = -2u^2 for x > 0 and -2u^4 for x < 0."""
    document = relay()
    document["field"]["x"] = [
        ["-1/2", [], [["x", "1", "s"]]],
        ["-1/2", [], [["x", "1", "a"]]],
        ["-1/2", [], [["x", "3", "s"]]],
        ["1/2", [], [["x", "3", "a"]]],
    ]
    document["witnesses"][1]["squares"] = [square([0], [[1]], "1")]
    assert "degree" in refusal(document)


def test_an_extra_witness_is_refused():
    document = relay()
    document["witnesses"].append(witness("decrease -", square([1], [[0]], "3")))
    assert "2 in number" in refusal(document)
    document = relay()
    document["witnesses"].append(document["witnesses"][1])
    assert "2 in number" in refusal(document)


def test_misplaced_witnesses_are_refused():
    document = oscillator_on_cells()
    document["witnesses"][:2] = document["witnesses"][1::-1]
    assert "next witness" in refusal(document)


def test_an_indefinite_function_is_refused():
    """V = xy has no lower bound: -uw - (u^2 + w^2)... on the cell +-."""
    document = edited(oscillator_on_cells(), ("V", [["1", [], [["x", "1", "s"], ["y", "1", "s"]]]]))
    document["witnesses"][0]["squares"] = [square([1, 1], [[0, 0]], "1")]
    assert "identity" in refusal(document)


def test_a_repeated_uncertain_parameter_is_harmless_in_a_refutation():
    """There d has one value: -2 + 4/2 = 0."""
    document = edited(overpowered_relay(), ("field", "x", 1, ["1/2", ["d", "d"], []]))
    assert verify(document).verdict == "refuted"


# ---------------------------------------------------------------- hostile text


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "JSON"),
        ("{", "JSON"),
        ("nonsense", "JSON"),
        ("\ufeff{}", "JSON"),
        ("{}{}", "JSON"),
        ("[]", "an object"),
        ("null", "an object"),
        ("1", "an object"),
        ('"proved"', "an object"),
        ("1.5", "a number"),
        ("1e5", "a number"),
        ("NaN", "a number"),
        ("-Infinity", "a number"),
        ("-1", "an integer"),
        ("-0", "an integer"),
        ("9" * 5000, "an integer"),
        ("01", "JSON"),
        ('{"a": 1, "a": 1}', "unique"),
        ('{"a": 1, "\\u0061": 1}', "unique"),
        ("[" * 13 + "]" * 13, "nesting"),
        ("[" * 100_000, "nesting"),
        ('{"a":' * 100_000, "nesting"),
        ('["]]]]]]]]]]]]]]",' * 13 + "1" + "]" * 13, "nesting"),
        ('["\\"]]]]]]]]]]]]]]",' * 13 + "1" + "]" * 13, "nesting"),
        ('"' + '\\"' * 1_000_000, "JSON"),  # a quadratic scan would take hours
        ('"' + "\\" * 1_000_001, "JSON"),
        ("[" + "0," * 2_200_000, "bytes"),
        ("é" * 2_200_000, "bytes"),
        ('"\ud800"', "an object"),
    ],
)
def test_hostile_text_is_refused(text, reason):
    with pytest.raises(checker.Refused, match=reason) as refused:
        checker.check(text)
    assert str(refused.value).isascii()
    assert len(str(refused.value)) < 300


def test_nesting_of_twelve_is_read():
    with pytest.raises(checker.Refused, match="an object"):
        checker.check("[" * 12 + "]" * 12)


@pytest.mark.parametrize("make", PROOFS + REFUTATIONS)
@some_or_all
def test_every_truncation_is_refused(make, most):
    text = json.dumps(make())
    for end in spread(range(len(text)), most and 20 * most):
        with pytest.raises(checker.Refused, match="JSON"):
            checker.check(text[:end])


OTHERS = [None, True, False, 0, 1, 7, 1.5, "", "1", "x", [], [[]], [{}], ["1", "2"], {}, {"x": []}]


@few("make", [weighted_pair, oscillator, sliding_rest], every=2)
def test_any_other_type_anywhere_is_refused_or_visible(make):
    """Replace each value by values of every type: no exception but Refused may escape."""
    original = verify(make())
    for path, _ in leaves(make(), every=True):
        for value in OTHERS:
            try:
                result = verify(edited(make(), (*path, value)))
            except checker.Refused:
                continue
            same = edited(make(), (*path, value)) == make()
            assert same or result.statement != original.statement


def test_duplicate_keys_are_refused_at_any_level():
    text = json.dumps(weighted_pair())
    for fragment in ('"k": "2"', '"x": 2', '"positive": "1/2"', '"times": [1, 0]', '"0,0": "1"'):
        assert fragment in text
        with pytest.raises(checker.Refused, match="unique"):
            checker.check(text.replace(fragment, f"{fragment}, {fragment}", 1))


def test_floats_that_equal_integers_are_refused():
    text = json.dumps(relay())
    for before, after in (('"x": 1', '"x": 1.0'), ('"format": 1', '"format": 1e0'), ("[[1]]", "[[1.0]]")):
        assert before in text
        with pytest.raises(checker.Refused, match="a number"):
            checker.check(text.replace(before, after, 1))


def large_gram():
    """V - u^2/2 with a Gram matrix of 200 x 200 whose denominators share nothing."""
    document = relay()
    size = 200
    entries = [f"{i}/{i + 1}" for i in range(1, size * (size + 1) // 2 + 1)]
    document["witnesses"][0]["squares"] = [square([0], [[i] for i in range(size)], *entries)]
    return document


def large_elimination():
    document = relay()
    entries = ["9" * 100 if i == j else "1" for i, j in itertools.combinations_with_replacement(range(200), 2)]
    document["witnesses"][0]["squares"] = [square([0], [[i] for i in range(200)], *entries)] * 2
    return document


def large_powers():
    """Powers up to 288 of numbers of 400 digits; neighbouring odd numbers have no common divisor."""
    document = inhomogeneous_rest()
    document["states"] = {"x": 12}
    document["field"]["x"] = [["1", [], [["x", str(i), "s"]]] for i in range(1, 25)] * 8
    document["refutation"]["point"]["x"] = f"{10**399 + 1}/{10**399 + 3}"
    return document


def large_derivative():
    """196 terms of V and 196 of each of six fields, at 64 cells."""
    names = "abcdef"
    pairs = list(itertools.product(range(14), repeat=2))
    field = [["1", [], [["c", str(i + 1), "a"], ["d", str(j + 1), "a"]]] for i, j in pairs]
    document = edited(relay(), ("states", dict.fromkeys(names, 1)), ("field", dict.fromkeys(names, field)))
    document["V"] = [["1", [], [["a", str(i + 2), "a"], ["b", str(j + 2), "a"]]] for i, j in pairs]
    return document


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (large_gram, "common denominator"),
        (large_elimination, "fewer steps"),
        (large_powers, "fewer steps"),
        (large_derivative, "fewer steps"),
    ],
)
def test_work_is_bounded(make, reason, monkeypatch):
    monkeypatch.setattr(exact_numbers, "MAX_STEPS", 20_000)
    assert reason in refusal(make())


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
    elif not every and (isinstance(value, int) or is_rational(value)):
        yield path, value


def is_rational(value):
    return isinstance(value, str) and re.fullmatch("-?[0-9]+(/[0-9]+)?", value) is not None


def other_numbers(value):
    number, small = Fraction(value), Fraction(1, 1000)
    changed = {Fraction(0), -number, number / 2, number * 2, number * 10}
    changed |= {1 / number} if number else {Fraction(3)}
    changed |= {number + 1, number - 1, number + small, number - small}
    for other in sorted(changed - {number}):
        if isinstance(value, str):
            yield str(other)
        elif other.denominator == 1:
            yield int(other)


@pytest.mark.parametrize("make", PROOFS + REFUTATIONS)
@some_or_all
def test_a_changed_number_is_refused_or_changes_the_statement(make, most):
    """And where it is accepted, the changed statement is true, by sampling in floating point."""
    original = verify(make())
    paths = spread(leaves(make()), most)
    assert len(paths) >= 8
    refusals = 0
    for path, value in paths:
        for other in other_numbers(value):
            document = edited(make(), (*path, other))
            try:
                result = verify(document)
            except checker.Refused:
                refusals += 1
                continue
            assert result.statement != original.statement
            assert looks_true(document)
    assert refusals > len(paths)


@pytest.mark.parametrize("make", PROOFS)
@some_or_all
def test_a_changed_witness_is_always_refused(make, most):
    for path, value in spread(leaves(make()["witnesses"]), most):
        for other in other_numbers(value):
            assert refusal(edited(make(), ("witnesses", edited(make()["witnesses"], (*path, other)))))


@pytest.mark.parametrize("make", PROOFS)
def test_a_changed_exponent_in_a_multiplier_is_refused(make):
    for index, entry in enumerate(make()["witnesses"]):
        key = min(entry["multiplier"])
        raised = key[:-1] + "1"
        assert refusal(edited(make(), ("witnesses", index, "multiplier", {raised: "1"})))


@pytest.mark.parametrize("make", PROOFS + REFUTATIONS)
@some_or_all
def test_numbers_written_otherwise_are_refused(make, most):
    """The same value in another spelling would escape a comparison of texts."""
    for path, value in spread(leaves(make()), most):
        if isinstance(value, str):
            number = Fraction(value)
            double = f"{2 * number.numerator}/{2 * number.denominator}"
            for spelling in (double, f"+{value}", f" {value}", f"{value}.0", f"0{value}"):
                assert refusal(edited(make(), (*path, spelling)))


def test_sampling_tells_true_statements_from_false_ones():
    """The oracle of the mutation test must be able to fail."""
    assert all(looks_true(make()) for make in PROOFS + REFUTATIONS)
    assert not looks_true(edited(relay(), ("claims", "decrease", "5")))
    assert not looks_true(edited(relay(), ("claims", "positive", "2")))
    assert not looks_true(edited(oscillator(), ("claims", "rate", "1/2")))
    assert not looks_true(edited(bounded_oscillator(), ("claims", "bound_x", "3")))
    assert not looks_true(edited(rooted_relay(), ("gains", "k", "1/5")))
    assert not looks_true(edited(settling_relay(), ("claims", "decay", "5")))
    assert not looks_true(edited(nested_root(), ("claims", "decrease", "3/2")))
    assert not looks_true(edited(nested_sign(), ("field", "x", 1, 0, "3")))
    assert not looks_true(edited(overpowered_relay(), ("refutation", "parameters", "d", "1")))


def evaluate(terms, point, numbers):
    total = 0.0
    for number, parameters, factors in terms:
        term = float(Fraction(number))
        for name in parameters:
            term *= numbers[name]
        for state, exponent, kind in factors:
            x = point[state]
            term *= abs(x) ** float(Fraction(exponent)) * (1.0 if kind == "a" or x > 0 else -1.0)
        total += term
    return total


def known_numbers(document):
    numbers = {name: float(Fraction(text)) for name, text in (document["gains"] | document["constants"]).items()}
    return numbers | {name: sqrt(numbers[square]) for name, (square, _, _) in document["roots"].items()}


def with_lifts(document, point, numbers):
    for lift, terms in document["lifts"].items():
        point = {**point, lift: evaluate(terms, point, numbers)}
    return point


def slope(document, point, numbers):
    """Return V' along the field, with the gradient from central differences."""
    total, step = 0.0, 1e-6
    for state, terms in document["field"].items():
        up, down = ({**point, state: point[state] + sign * step} for sign in (1, -1))
        rise = evaluate(document["V"], up, numbers) - evaluate(document["V"], down, numbers)
        total += rise / (2 * step) * evaluate(terms, with_lifts(document, point, numbers), numbers)
    return total


def looks_true(document, samples=60):
    """Sample the two inequalities; for a refutation, add up the field beside the point."""
    if "refutation" in document:
        return balances(document)
    generator, numbers, weights = random.Random(2), known_numbers(document), document["states"]
    claims = {key: float(Fraction(text)) for key, text in document["claims"].items()}
    decay = claims["rate" if document["domain"] == "reals" else "decrease"]
    m = sum(float(Fraction(a)) * weights[state] for state, a, _ in document["V"][0][2])
    for _ in range(samples):
        x = {state: generator.choice((-1, 1)) * generator.uniform(0.1, 2) for state in weights}
        for name, ends in document["uncertain"].items():
            numbers[name] = generator.uniform(*(float(Fraction(end)) for end in ends))
        value, rate = evaluate(document["V"], x, numbers), slope(document, x, numbers)
        if document["domain"] == "reals":
            bound = 2 * decay * value
        else:  # the degree of V' follows from doubling u
            far = {state: number * 2 ** weights[state] for state, number in x.items()}
            n = round(log2(slope(document, far, numbers) / rate))
            bound = max(decay * power_sum(x, weights, n), claims.get("decay", 0.0) * value ** (n / m))
        if value < claims["positive"] * power_sum(x, weights, m) - 1e-6 or rate > -bound + 1e-4:
            return False
        for state, weight in weights.items():
            if value < claims.get(f"bound_{state}", 0.0) * abs(x[state]) ** (m / weight) - 1e-6:
                return False
    return True


def power_sum(point, weights, degree):
    return sum(abs(point[state]) ** (degree / weight) for state, weight in weights.items())


def balances(document):
    refutation, weights = document["refutation"], document["states"]
    numbers = known_numbers(document)
    numbers |= {name: float(Fraction(text)) for name, text in refutation["parameters"].items()}
    point = {state: float(Fraction(text)) for state, text in refutation["point"].items()}
    totals = dict.fromkeys(weights, 0.0)
    for cell, share in refutation["weights"].items():
        beside = {
            state: (abs(point[state]) ** weights[state] or 1e-300) * (1 if sign == "+" else -1)
            for state, sign in zip(weights, cell, strict=True)
        }
        for state in weights:
            totals[state] += float(Fraction(share)) * evaluate(document["field"][state], beside, numbers)
    return any(point.values()) and all(abs(total) < 1e-9 for total in totals.values())


# ---------------------------------------------------------------- the command


def run(*arguments):
    return subprocess.run(
        [sys.executable, "-W", "error", str(PATH), *map(str, arguments)],
        capture_output=True,
        text=True,
        env={"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONINTMAXSTRDIGITS": "640"},
        timeout=60,
        check=False,
    )


@pytest.fixture
def write(tmp_path):
    def to_file(name, content):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())
        return path

    return to_file


def test_only_proofs_exit_with_zero(write):
    proof, other = write("proof.json", relay()), write("other.json", decay())
    refutation, broken = write("refutation.json", sliding_rest()), write("broken.json", {})
    assert run(proof, other).returncode == 0
    assert run(proof, refutation).returncode == 1
    assert run(broken, proof).returncode == 1


def test_each_file_gets_a_block(write):
    proof, refutation = write("proof.json", relay()), write("refutation.json", sliding_rest())
    broken = write("broken.json", b'{"format": 1, "format": 1}')
    lines = run(proof, refutation, broken).stdout.splitlines()
    heads = [line for line in lines if not line.startswith("    ")]
    assert heads == [
        f"{proof}: proved",
        f"{refutation}: refuted",
        f"{broken}: invalid: a key must be unique in its object. Received 'format'",
    ]
    assert any("names are not verified" in line for line in lines)


@pytest.mark.parametrize(
    ("content", "reason"),
    [(b"\xff\xfe", "UTF-8"), (b"", "JSON"), (b"{" * 10**6, "nesting"), ("é".encode() * 2**22, "bytes")],
)
def test_bad_content_is_invalid_without_a_traceback(write, content, reason):
    result = run(write("bad.json", content))
    assert result.returncode == 1
    assert reason in result.stdout
    assert result.stdout.count("\n") == 1
    assert result.stderr == ""


def test_what_cannot_be_read_exits_with_two_and_one_line(write, tmp_path):
    proof = write("proof.json", relay())
    missing = tmp_path / "none.json"
    unreadable = [[], ["--help"], [tmp_path], [missing, proof], [proof, missing], ["/dev/zero"], ["a" * 5000]]
    for arguments in unreadable:
        result = run(*arguments)
        assert result.returncode == 2
        assert result.stderr.count("\n") == 1
        assert "Traceback" not in result.stderr


def test_long_numbers_are_printed_under_the_smallest_digit_limit(write):
    """k = 10^399 + 1 leaves -V' - u = 2k u - u."""
    k = 10**399 + 1
    gram = ("witnesses", 1, "squares", 0, "gram", [str(2 * k - 1)])
    result = run(write("long.json", edited(relay(), ("gains", "k", str(k)), gram)))
    assert result.returncode == 0
    assert str(k) in result.stdout


def test_a_hostile_name_cannot_forge_a_verdict(write):
    path = write("a\nb.json: proved", {})
    result = run(path)
    assert result.returncode == 1
    assert result.stdout.count("\n") == 1
