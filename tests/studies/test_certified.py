"""Answers about given gains in facts and words."""

from dataclasses import replace
from fractions import Fraction as F

import pytest
from thinned import few

from quakedesign.errors import ParameterError
from quakedesign.laws.dia import DiscontinuousIntegral
from quakedesign.lyapunov import Verdict
from quakedesign.lyapunov.search.certify import CertifiedLimit
from quakedesign.studies.certified import _limit_lines, certified

KEYS = {
    "verdict", "lipschitz", "gain_range", "decay", "settling", "limit", "counterexample", "dual", "certificate",
    "seconds",
}  # fmt: skip
TWISTING = ("super-twisting", ("0.7", "2"))


def test_a_bound_is_proved():
    answer = certified(*TWISTING, lipschitz="0.5")
    assert set(answer.facts) == KEYS
    assert answer.verdict is Verdict.PROVED is answer.certificate.check()
    assert (answer.facts["verdict"], answer.facts["lipschitz"], answer.facts["limit"]) == ("proved", "1/2", "2")
    assert answer.lines[0] == "proved: super-twisting 0.7 2, |h'| <= 1/2, beta from 1 to 1"
    assert "necessary limit: no certificate of these gains exists for a bound |h'| >= 2" in answer.lines[1]


@pytest.mark.slow
def test_the_largest_bound_is_told_with_what_limits_it_and_the_scale_for_a_larger_one():
    answer = certified(*TWISTING, maximize="lipschitz", lipschitz=3)
    facts = answer.facts
    value, beyond = F(facts["lipschitz"]), F(facts["maximized"]["beyond"])
    assert {"maximized", "degrees", "degree", "scale", "scale_limit", "solves", *KEYS} == set(facts)
    assert value < beyond <= value * F(10_001, 10_000)
    assert F(facts["scale"]) == 3 / value > F(facts["scale_limit"]) == F(3, 2)
    assert facts["maximized"]["value"] == facts["lipschitz"]
    assert answer.certificate.loop.uncertain["d"][1] == value
    said = "\n".join(answer.lines)
    assert f"(exactly {value})" in said
    assert "no function of degree 3, 4, 6, 8, 10 was found" in said
    assert "lambda >=" in said


@pytest.mark.slow
@few("maximize", ["beta", "beta-factor"], every=2)
def test_the_largest_range_is_told_as_a_range(maximize):
    answer = certified("super-twisting", ("1.2", "2"), lipschitz=1, maximize=maximize, gain_range=(2, 2))
    low, high = map(F, answer.facts["gain_range"])
    value = F(answer.facts["maximized"]["value"])
    assert (low, high) == ((2, value) if maximize == "beta" else (2 / value, 2 * value))
    assert answer.certificate.loop.uncertain["beta"] == (low, high)


@pytest.mark.slow
def test_the_decay_comes_with_a_settling_time():
    answer = certified("super-twisting", ("1.5", "1.1"), lipschitz="0.5", maximize="decay")
    told = answer.facts["settling"]
    assert F(answer.facts["decay"]) == answer.certificate.claims["decay"]
    assert F(told["factor"]) * F(told["power"]) * F(answer.facts["decay"]) == 1
    assert F(told["start"]) == F(1, 2)
    assert 1 < told["seconds"] < 30
    assert "settles within" in answer.lines[-1]


@pytest.mark.slow
def test_what_is_not_proved_is_told_with_what_speaks_against_it():
    refuted = certified("super-twisting", ("3", "1"), lipschitz=1)
    assert (refuted.facts["verdict"], refuted.facts["counterexample"]) == ("refuted", "exact")
    undecided = certified("super-twisting", ("0.4", "1.5"), lipschitz=1)
    assert (undecided.facts["verdict"], undecided.facts["counterexample"]) == ("undecided", "simulated")
    assert "in which the state grows, which is no proof" in undecided.lines[-2]
    assert undecided.facts["dual"] == [3, 4, 6, 8, 10]
    assert "an exact dual was found: no sum of even signed monomials of degree 3, 4, 6, 8, 10" in undecided.lines[-1]
    never = certified("cta", ("7", "5", "2.3", "2.3"), maximize="lipschitz")
    assert (never.facts["verdict"], never.facts["lipschitz"], never.facts["limit"]) == ("refuted", None, "0")


def test_gains_too_far_apart_for_floating_point_are_undecided():
    answer = certified("cta", ("1e-300", "1", "1", "0"), maximize="lipschitz")
    assert answer.verdict is Verdict.UNDECIDED
    assert "differ too much for a search in floating point" in answer.lines[-1]


@pytest.mark.slow
def test_at_the_necessary_limit_nothing_is_searched_for():
    answer = certified("dia", ("2", "5", "1.44e-4", "0"), lipschitz="1.44e-4")
    assert (answer.facts["verdict"], answer.facts["limit"], answer.facts["dual"]) == ("undecided", "9/62500", [])
    assert "the bound is at or beyond that limit" in answer.lines
    assert answer.lines[-1] == "no exact dual was found"


def test_the_necessary_limit_is_rounded_up_as_nothing_is_proved_only_from_there_on():
    answer = certified("super-twisting", ("1", "1/3"), lipschitz="1/10")
    assert answer.facts["limit"] == "1/3"
    assert "|h'| >= 0.333334" in answer.lines[1]


def test_the_limit_is_told_beside_a_range_as_well():
    answer = certified("super-twisting", ("1.2", "2"), lipschitz=3, maximize="beta")
    assert (answer.facts["verdict"], answer.facts["limit"]) == ("refuted", "2")


@pytest.mark.slow
def test_gains_with_an_irrational_root_in_a_sign_are_proved_over_a_range():
    # k_I4 ≠ 0 brings the root of k_I1 into the argument of the sign
    answer = certified("dia", ("2", "5", "1", "1/10"), lipschitz="0.78", gain_range=("1", "3"))
    assert answer.verdict is Verdict.PROVED is answer.certificate.check()
    assert len(answer.certificate.lyapunov) == 10


class WithRoot(DiscontinuousIntegral):
    """The 2-DIA with e1 for a state: the root of k_I1 stands under a cube root."""

    @classmethod
    def loop_field(cls):
        loop = super().loop_field()
        ((root, gain),) = loop.roots.items()
        f1, e2, _ = loop.states
        field = {state: rate.subs(f1, f1 * gain * root) for state, rate in loop.field.items()}
        return replace(loop, field={**field, f1: e2}, units={})


def test_gains_that_no_certificate_can_express_are_undecided_with_the_reason():
    for wish in ({"lipschitz": "0.1"}, {"maximize": "lipschitz"}):
        answer = certified(WithRoot, ("3", "20", "1", "0"), **wish)
        assert answer.verdict is Verdict.UNDECIDED
        assert "has a parameter with a range, kappa. Choose gains" in answer.lines[-1]


@pytest.mark.parametrize(
    ("wish", "message"),
    [
        ({}, "needs a bound on"),
        ({"maximize": "beta"}, "needs a bound on"),
        ({"maximize": "speed"}, "must be one of lipschitz, beta, beta-factor, decay"),
        ({"maximize": "beta", "lipschitz": 1, "gain_range": (1, 2)}, "give one value twice"),
        ({"lipschitz": "x"}, "lipschitz must be a finite number"),
    ],
)
def test_bad_wishes_get_one_clear_message(wish, message):
    with pytest.raises(ParameterError, match=message):
        certified(*TWISTING, **wish)


@pytest.mark.parametrize(
    ("numbers", "said"),
    [
        ({"value": None}, ["nothing is proved with Lyapunov functions of degree 2, 4"]),
        ({"limit": F(1)}, ["the search ended there without reaching an upper limit"]),
        ({"limit": F(50005, 10**5)}, ["this is within a relative 1e-4 of the limit of every Lyapunov function"]),
        ({"beyond": F(50005, 10**5)}, ["at 0.50005 no function of degree 2, 4 was found"]),
        ({"beyond": F(3, 5)}, ["at 0.6 no function of degree 2, 4 was found; between the two values nothing is known"]),
    ],
)
def test_the_lines_about_a_largest_value_say_what_limits_it(numbers, said):
    """Of the value 1/2; four digits of it are known if the next number is at most 1/2·(1 + 1e-4)."""
    found = CertifiedLimit(
        quantity="lipschitz", value=F(1, 2), beyond=None, limit=None, degrees=(2, 4), degree=4, certificate=None,
        counterexample="none", solves=0, seconds=0,
    )  # fmt: skip
    first = ["largest bound on |h'|: 0.5 (exactly 1/2), V of degree 4"] * (numbers.get("value", F(1, 2)) is not None)
    assert _limit_lines(replace(found, **numbers)) == first + said
