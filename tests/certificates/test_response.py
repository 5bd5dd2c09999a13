"""Bounds on outputs: one input on one state in closed form, every side condition, every number of a file."""

import importlib.util
import json
import re
import sys
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import pytest
import sympy as sp

from quakedesign.certificates import Certificate, Verdict, Witness, certificate_text, parse_certificate
from quakedesign.certificates.claim import Loop
from quakedesign.certificates.response import InputResponse, InvariantSet, OutputBound, Response
from quakedesign.certificates.response_obligations import OneInput, demanded
from quakedesign.controllers import LoopField
from quakedesign.errors import CertificateError
from quakedesign.sos.exact.proofs import Square
from quakedesign.symbolic.terms import Term

PROOFS = Path(__file__).parents[2] / "proofs"


@pytest.fixture(scope="module")
def standalone():
    specification = importlib.util.spec_from_file_location("standalone_check_of_bounds", PROOFS / "check.py")
    module = importlib.util.module_from_spec(specification)
    sys.modules[specification.name] = module
    specification.loader.exec_module(module)
    return module


def refused(standalone, text):
    """Whether each checker refuses a text."""
    try:
        parse_certificate(text).check(MODEL)
        mine = False
    except (CertificateError, ArithmeticError):
        mine = True
    try:
        standalone.check(text)
        other = False
    except standalone.Refused:
        other = True
    return mine, other


def state(name, coefficient=1, *parameters):
    return Term(F(coefficient), parameters, ((name, F(1), "s"),))


def square(name, coefficient):
    return Term(F(coefficient), (), ((name, F(2), "a"),))


def gram(one):
    """Gram matrix of a quadratic form, written down from its coefficients."""
    n = len(next(iter(one.polynomial)))
    unit = [tuple(int(i == j) for j in range(n)) for i in range(n)]
    entries = [
        one.polynomial.get(tuple(a + b for a, b in zip(unit[i], unit[j], strict=True)), F(0)) / (1 if i == j else 2)
        for i in range(n)
        for j in range(i, n)
    ]
    return Witness(multiplier={(0,) * n: F(1)}, squares=(Square(basis=tuple(unit), gram=tuple(entries)),))


def complete(loop, response):
    witnesses, known = {}, set()
    for one in demanded(loop, response):
        if one.key not in known:
            known.add(one.key)
            witnesses[one.name] = gram(one)
    return Certificate(loop=loop, response=response, witnesses=witnesses)


x, k1, beta = sp.symbols("x k1 beta", real=True)
MODEL = LoopField(
    states={x: 1}, field={x: -beta * k1 * x}, gains=(k1,), constants=(), uncertain=(beta,), domain="reals"
)
LOOP = Loop(
    law="custom",
    gains={"k1": F(3)},
    constants={},
    states={"x": 1},
    domain="reals",
    uncertain={"beta": (F(1), F(2))},
    field={"x": (state("x", -1, "beta", "k1"), Term(F(1), ("u",), ()))},
    inputs={"u": (F(1, 2),)},
)


def one_set(size=30, decay=3, share=3, bound=F(1, 5), weight=1):
    part = InputResponse(
        sets=(InvariantSet(function=(square("x", size),), decay=F(decay), shares=(F(share),), borrowed=(F(0),)),),
        bounds={"y": OutputBound(bound=bound, weights=(F(weight),))},
    )
    return Response(outputs={"y": (state("x"),)}, parts={"u": part})


GOOD = complete(LOOP, one_set())


def test_the_example_of_the_format_is_this_one_and_both_checkers_prove_it(standalone):
    text = (PROOFS / "FORMAT.md").read_text(encoding="utf-8")
    block = next(b for b in re.findall(r"```json\n(.*?)```", text, flags=re.DOTALL) if '"limits"' in b)
    shown = json.loads(block.replace(", …", ""))
    mine = json.loads(certificate_text(GOOD))
    assert shown["witnesses"] == mine["witnesses"][:1]
    assert {k: v for k, v in shown.items() if k != "witnesses"} == {k: v for k, v in mine.items() if k != "witnesses"}
    assert GOOD.check(MODEL) is Verdict.PROVED
    assert parse_certificate(certificate_text(GOOD)) == GOOD
    assert standalone.check(certificate_text(GOOD)).verdict == "proved"


def test_nothing_below_the_true_peak_is_ever_proved():
    # x' = −3βx + u with |u| ≤ 1/2: the largest |x| from rest is (1/2)/3
    true, best = F(1, 6), None
    for decay in [F(n, 2) for n in range(2, 11)]:
        for size in [F(n) for n in range(20, 45)]:
            bound = F(1001, 1000) / F(float(size) ** 0.5)
            try:
                complete(LOOP, one_set(size, decay, decay, bound)).check(MODEL)
            except CertificateError:
                continue
            best = bound if best is None else min(best, bound)
    assert true < best < true * F(103, 100)


def test_a_limited_rate_gives_less_than_the_amplitude_alone():
    # x' = −3x + u: with |u'| ≤ c and u(0) anything, |x| ≤ b/3 is still the limit; the input is a variable of V
    loop = replace(LOOP, uncertain={"beta": (F(1), F(1))}, inputs={"u": (F(1, 2), F(1, 10))})
    mixed = Term(F(-3), (), (("x", F(1), "s"), ("u", F(1), "s")))
    own = InvariantSet(
        function=(square("x", 30), mixed, square("u", F(1, 2))), decay=F(2), shares=(F(9, 5), F(1, 5)), borrowed=(F(0),)
    )
    part = InputResponse(sets=(own,), bounds={"y": OutputBound(bound=F(1, 5), weights=(F(1),))})
    found = complete(loop, Response(outputs={"y": (state("x"),)}, parts={"u": part}))
    alone = OneInput(loop, "u")
    assert alone.variables == ("x", "u", "rate of u")
    assert alone.start(own) == F(1, 8)
    assert parse_certificate(certificate_text(found)) == found
    high = replace(own, function=(*own.function[:2], square("u", 5)))
    with pytest.raises(CertificateError, match="start is outside"):
        complete(loop, Response(outputs=found.response.outputs, parts={"u": replace(part, sets=(high,))})).check(MODEL)


def test_v_dot_agrees_with_a_difference_quotient():
    loop = replace(LOOP, inputs={"u": (F(1, 2), F(1, 10))})
    mixed = Term(F(-3), (), (("x", F(1), "s"), ("u", F(1), "s")))
    own = InvariantSet(
        function=(square("x", 30), mixed, square("u", 1)), decay=F(2), shares=(F(1), F(1)), borrowed=(F(0),)
    )
    alone = OneInput(loop, "u")
    form = alone.dissipation((own,), 0, alone.derivative(own), {"beta": F(2)})

    def V(a, b):
        return 30 * a * a - 3 * a * b + b * b

    a, b, c, step = 0.3, -0.2, 0.07, 1e-6
    rate = (V(a + step * (-6 * a + b), b + step * c) - V(a, b)) / step
    expected = 1 * (b / 0.5) ** 2 + 1 * (c / 0.1) ** 2 - rate - 2 * V(a, b)
    value = sum(float(k) * a ** e[0] * b ** e[1] * c ** e[2] for e, k in form.items())
    assert value == pytest.approx(expected, rel=1e-4)


PART, SET = GOOD.response.parts["u"], GOOD.response.parts["u"].sets[0]


def with_set(**changes):
    return replace(GOOD.response, parts={"u": replace(PART, sets=(replace(SET, **changes),))})


def with_bound(**changes):
    return replace(GOOD.response, parts={"u": replace(PART, bounds={"y": replace(PART.bounds["y"], **changes)})})


BROKEN = {
    "shares above the decay": (LOOP, with_set(shares=(F(31, 10),)), "more than the decay"),
    "a negative share": (LOOP, with_set(shares=(F(-1),)), "must not be negative"),
    "no decay": (LOOP, with_set(decay=F(0), shares=(F(0),)), "decay must be positive"),
    "borrowed from itself": (LOOP, with_set(borrowed=(F(1),)), "misplaced"),
    "weights above one": (LOOP, with_bound(weights=(F(11, 10),)), "together at most 1"),
    "a bound of zero": (LOOP, with_bound(bound=F(0)), "bound must be positive"),
    "a cubic V": (LOOP, with_set(function=(Term(F(1), (), (("x", F(3), "s"),)),)), "form of degree 2"),
    "an uncertain V": (LOOP, with_set(function=(Term(F(30), ("beta",), (("x", F(2), "a"),)),)), "uncertain"),
    "an output of degree 2": (LOOP, replace(GOOD.response, outputs={"y": (square("x", 1),)}), "form of degree 1"),
    "another output": (LOOP, replace(GOOD.response, outputs={"z": (state("x"),)}), "bound of every output"),
    "a set too few": (LOOP, replace(GOOD.response, parts={}), "every input needs its sets"),
    "a negative limit": (replace(LOOP, inputs={"u": (F(-1),)}), GOOD.response, "positive limits"),
    "an idle input": (
        replace(LOOP, inputs={"u": (F(1, 2),), "v": (F(1),)}),
        replace(GOOD.response, parts={"u": PART, "v": PART}), "must act",
    ),
    "a product of input and state": (
        replace(LOOP, field={"x": (*LOOP.field["x"], state("x", 1, "u"))}), GOOD.response, "linear"
    ),
    "a quadratic field": (replace(LOOP, field={"x": (*LOOP.field["x"], square("x", 1))}), GOOD.response, "field"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_every_side_condition_counts_for_both_checkers(case, standalone):
    loop, response, said = BROKEN[case]
    text = certificate_text(replace(GOOD, loop=loop, response=response))
    with pytest.raises(standalone.Refused):
        standalone.check(text)
    with pytest.raises(CertificateError, match=said):
        replace(GOOD, loop=loop, response=response).check(MODEL)


def test_a_parameter_squared_in_v_dot_is_refused():
    # the ends of its range would not decide
    loop = replace(LOOP, field={"x": (state("x", -1, "beta", "beta"), Term(F(1), ("u",), ()))})
    with pytest.raises(CertificateError, match="not affine in beta"):
        list(demanded(loop, GOOD.response))


NUMBER = re.compile(r'(?<=")-?\d+(?:/\d+)?(?=")|(?<=[\[,:])-?\d+(?=[\],}])')


def test_no_number_of_the_file_can_be_changed_but_the_sign_of_an_output(standalone):
    text, survived = certificate_text(GOOD), []
    for place in NUMBER.finditer(text):
        for fresh in {"0", "1", "2", "-1", "3/7", place[0] + "1"} - {place[0]}:
            changed = text[: place.start()] + fresh + text[place.end() :]
            verdicts = refused(standalone, changed)
            if verdicts != (True, True):
                assert verdicts == (False, False)
                survived.append(json.loads(changed))
    assert [found["outputs"]["y"][0][0] for found in survived] == ["-1"]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"outputs":', '"V":[],"outputs":'),
        ('"inputs":{', '"inputs":{"x":{"limits":["1"],"sets":[],"bounds":{}},'),
        ('"limits":["1/2"]', '"limits":[]'),
        ('"limits":["1/2"]', '"limits":["1/2","1","1"]'),
        ('"decay":"3"', '"decay":3'),
        ('"borrowed":["0"]', '"borrowed":["0"],"note":"x"'),
        ('"bounds":{"y"', '"bounds":{"z"'),
        ('["1",["u"],[]]', '["1",["v"],[]]'),
        ('"V":[["30",[]', '"V":[["30",["u"]'),
        ('"domain":"reals"', '"domain":"cells"'),
    ],
)
def test_every_departure_from_the_format_is_refused_twice(standalone, old, new):
    text = certificate_text(GOOD)
    assert old in text
    assert refused(standalone, text.replace(old, new, 1)) == (True, True)


def test_a_missing_or_extra_witness_is_refused():
    first, *rest = GOOD.witnesses
    with pytest.raises(CertificateError, match="missing"):
        replace(GOOD, witnesses={n: GOOD.witnesses[n] for n in rest}).check(MODEL)
    with pytest.raises(CertificateError, match="no obligation needs"):
        replace(GOOD, witnesses={**GOOD.witnesses, "more": GOOD.witnesses[first]}).check(MODEL)


def test_two_sets_that_borrow_from_each_other_bound_a_chain():
    # x' = −x + u/10 + y/10, y' = −2y + x/2: worst |x| from rest is 0.1/(1 − 0.025) for |u| ≤ 1
    u, y, z = sp.symbols("u y z", real=True)
    model = LoopField(
        states={y: 1, z: 1},
        field={y: -y + z / 10, z: -2 * z + y / 2},
        gains=(),
        constants=(),
        uncertain=(),
        domain="reals",
    )
    field = {
        "y": (state("y", -1), state("z", F(1, 10)), Term(F(1, 10), ("u",), ())),
        "z": (state("z", -2), state("y", F(1, 2))),
    }
    loop = replace(LOOP, gains={}, uncertain={}, states={"y": 1, "z": 1}, field=field, inputs={str(u): (F(1),)})

    def chain(first, second):
        sets = (
            InvariantSet(
                function=(square("y", 1 / first**2), square("z", F(1, 1000))), decay=F(99, 100), shares=(F(9, 10),),
                borrowed=(F(0), F(9, 100)),
            ),
            InvariantSet(
                function=(square("z", 1 / second**2), square("y", F(1, 1000))), decay=F(19, 10),
                shares=(F(1, 100),), borrowed=(F(189, 100), F(0)),
            ),
        )  # fmt: skip
        bounds = {"y": OutputBound(bound=first * F(101, 100), weights=(F(1), F(0)))}
        part = InputResponse(sets=sets, bounds=bounds)
        return complete(loop, Response(outputs={"y": (state("y"),)}, parts={"u": part}))

    with pytest.raises(CertificateError):
        chain(F(1, 11), F(1, 30)).check(model)
    true = 0.1 / (1 - 0.025)
    good = Certificate(loop=loop)
    for widened in (F(11, 10), F(6, 5), F(13, 10)):
        candidate = chain(F(1, 10) * widened, F(1, 10) * widened * F(3, 10))
        try:
            candidate.check(model)
        except CertificateError:
            continue
        good = candidate
        break
    assert good.response is not None
    assert true < float(good.response.total("y")) < 1.4 * true
