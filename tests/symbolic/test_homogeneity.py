"""Degrees of homogeneity: published laws, proofs that are re-checked, counterexamples that are evaluated anew."""

import dataclasses
import random

import mpmath as mp
import pytest
import sympy as sp
from thinned import few

from quakedesign.errors import ParameterError
from quakedesign.laws import control_law
from quakedesign.symbolic import SignedPower, dilate, homogeneous, weights_for
from quakedesign.symbolic.homogeneity import Counterexample, Identity, dilation, epsilon
from quakedesign.symbolic.signed_power import AbsolutePower

R = sp.Rational
x, y, z = sp.symbols("x y z", real=True)
a, b, c = sp.symbols("a b c", positive=True)
d = sp.Symbol("d", real=True)

# Published laws with the weights and degrees that their papers state.
SUPER_TWISTING = {x: -a * SignedPower(x, R(1, 2)) + y, y: -b * SignedPower(x, 0) + d}  # Levant (1993)
TWISTING = {x: y, y: -a * SignedPower(x, 0) - b * SignedPower(y, 0) + d}  # Levant (1993)
NESTED = (AbsolutePower(y, 3) + x**2) ** R(1, 6) * SignedPower(y + AbsolutePower(x, R(2, 3)) * SignedPower(x, 0), 0)
THIRD_ORDER = {x: y, y: z, z: -a * SignedPower(z + 2 * NESTED, 0) + d}  # Levant (2005), nested, r = 3
DIFFERENTIATOR = {  # Levant (2003), second order
    x: y - a * SignedPower(x, R(2, 3)),
    y: z - b * SignedPower(x, R(1, 3)),
    z: -c * SignedPower(x, 0) + d,
}
DOUBLE_INTEGRATOR = {x: y, y: -a * SignedPower(x, R(1, 3)) - b * SignedPower(y, R(1, 2))}  # Bhat, Bernstein (1998)
LAWS = {
    "super-twisting": (SUPER_TWISTING, (2, 1), -1),
    "twisting": (TWISTING, (2, 1), -1),
    "third order": (THIRD_ORDER, (3, 2, 1), -1),
    "differentiator": (DIFFERENTIATOR, (3, 2, 1), -1),
    "finite-time": (DOUBLE_INTEGRATOR, (3, 2), -1),
    "linear": ({x: y, y: -a * x - b * y}, (1, 1), 0),
    "cta": (control_law("cta").loop_field().field, (3, 2, 1), -1),
    "dia": (control_law("dia").loop_field().field, (3, 2, 1), -1),
}


@pytest.mark.parametrize("name", LAWS)
def test_published_laws_have_the_published_degree(name):
    field, weights, degree = LAWS[name]
    answer = homogeneous(field, dict(zip(field, weights, strict=True)))
    assert answer
    assert answer.verdict == "proved"
    assert answer.degree == degree
    assert len(answer.proof) == len(field)


@pytest.mark.parametrize("name", [n for n in LAWS if n not in ("linear", "finite-time")])
def test_weights_follow_from_the_terms(name):
    field, weights, degree = LAWS[name]
    assert tuple(weights_for(field, degree).values()) == weights


def test_weights_that_do_not_exist_or_are_not_unique_are_refused():
    with pytest.raises(ParameterError, match="no unique positive weights"):
        weights_for({x: y, y: -a * x - b * y}, 0)
    with pytest.raises(ParameterError, match="no unique positive weights"):
        weights_for({x: x + SignedPower(x, R(1, 2))}, -1)
    with pytest.raises(ParameterError, match="no degree"):
        weights_for({x: sp.exp(x)}, -1)


@few("name", LAWS, every=4)
@pytest.mark.parametrize("change", [0, 1])
def test_wrong_weights_or_degrees_come_with_a_point(name, change):
    field, weights, degree = LAWS[name]
    weights = dict(zip(field, weights, strict=True))
    if change:
        answer = homogeneous(field, weights, degree - 1)
    else:
        first = next(iter(weights))
        answer = homogeneous(field, weights | {first: weights[first] + 1})
    assert answer.verdict == "refuted"
    assert not answer
    left, right = (complex(v) for v in answer.counterexample.values)
    assert abs(left - right) > 1e-9
    assert "fails at" in str(answer.counterexample)


FUNCTIONS = [
    (AbsolutePower(x, R(5, 3)) + x * y + AbsolutePower(y, R(5, 2)), {x: 3, y: 2}, 5),
    (SignedPower(SignedPower(y, R(3, 2)) + a * x, R(1, 3)), {x: 3, y: 2}, 1),
    (sp.Abs(x) * sp.sign(y), {x: 2, y: 7}, 2),
    (SignedPower(x + y**3, 0), {x: 3, y: 1}, 0),
    (x / y, {x: R(1, 2), y: R(1, 3)}, R(1, 6)),
]


@pytest.mark.parametrize(("function", "weights", "degree"), FUNCTIONS, ids=[str(f[0]) for f in FUNCTIONS])
def test_functions_scale_as_their_degree_says(function, weights, degree):
    answer = homogeneous(function, weights)
    assert answer.degree == degree
    numbers = random.Random(3)
    own = {
        "SignedPower": lambda v, n: mp.sign(v) * abs(v) ** n,
        "AbsolutePower": lambda v, n: abs(v) ** n,
    }
    evaluate = sp.lambdify([a, *weights], function, [own, "mpmath"])
    with mp.workdps(50):
        for _ in range(10):
            point = [mp.mpf(numbers.uniform(-2, 2)) for _ in weights]
            factor = mp.mpf(numbers.uniform(0.1, 4))
            power = [mp.mpf(int(w.p)) / int(w.q) for w in map(sp.Rational, weights.values())]
            moved = [factor**w * v for w, v in zip(power, point, strict=True)]
            expected = factor ** (mp.mpf(int(sp.Rational(degree).p)) / int(sp.Rational(degree).q)) * evaluate(2, *point)
            assert abs(evaluate(2, *moved) - expected) < mp.mpf(10) ** -40


@few("function", [x**2 + y, sp.exp(x) * y, SignedPower(x + y**2, 0), sp.sin(x)], ids=str, every=2)
def test_functions_of_no_degree_are_refuted(function):
    assert homogeneous(function, {x: 1, y: 1}).verdict == "refuted"


def test_a_counterexample_never_lies_on_a_switching_surface():
    answer = homogeneous({x: y, y: SignedPower(x + y, 0)}, {x: 2, y: 1})
    point = answer.counterexample.point
    assert answer.verdict == "refuted"
    assert all(factor**2 * point[x] + factor * point[y] != 0 for factor in (1, 2, 4))


def test_a_parameter_may_have_the_name_of_the_dilation():
    own = sp.Symbol("epsilon", positive=True)
    assert homogeneous(own * x**3, {x: 1}).degree == 3
    assert homogeneous(own * x**3 + x, {x: 1}).verdict == "refuted"


def test_zero_is_homogeneous():
    assert homogeneous(sp.Integer(0), {x: 1})
    assert homogeneous({x: sp.Integer(0), y: y}, {x: 1, y: 1}).degree == 0


def test_a_proof_is_computed_anew_each_time():
    answer = homogeneous(x**3, {x: 1})
    assert answer
    forged = dataclasses.replace(answer, proof=(Identity(left=epsilon**3 * x**3, right=epsilon**2 * x**3),))
    assert forged.verdict == "undecided"
    wrong = Counterexample(identity=answer.proof[0], meaning="", point={x: sp.Integer(1)}, epsilon=sp.Integer(2))
    assert dataclasses.replace(answer, proof=(), counterexample=wrong).verdict == "undecided"


def test_switching_surfaces_are_listed_with_their_degree():
    answer = homogeneous(TWISTING, {x: 2, y: 1})
    assert dict(answer.switching) == {x: 2, y: 1}


def test_dilation_takes_any_positive_factor():
    assert sp.expand(dilate(SignedPower(x, R(1, 3)) + y, {x: 3, y: 1}, a) / a) == SignedPower(x, R(1, 3)) + y
    for weights, factor in (({x: 0}, a), ({x: -1}, a), ({x: 1}, x)):
        with pytest.raises(ParameterError, match="must be positive"):
            dilation(weights, factor)


def test_a_state_without_weight_is_named():
    with pytest.raises(ParameterError, match="Received none for y"):
        homogeneous(TWISTING, {x: 2})


def test_answers_are_shown_as_latex():
    assert "aligned" in homogeneous(x**3, {x: 1})._repr_latex_()
    assert "fails" in homogeneous(x**2 + x, {x: 1})._repr_latex_()
