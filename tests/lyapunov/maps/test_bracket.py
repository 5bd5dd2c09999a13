"""The search for the last success, on functions whose roots are known."""

import math
from fractions import Fraction as F

import pytest

from quakedesign.lyapunov.maps.sweep import Frame, Screened
from quakedesign.lyapunov.search.certify import TOLERANCE, first_below, last_success

FRAME = Frame(scale=(F(1),), rate_scale=1.0)
ROOT = math.sqrt(0.7)
FUNCTIONS = {
    "concave": (lambda x: 0.7 - x**2, lambda x: -2 * x),
    "convex": (lambda x: math.exp(-x) - math.exp(-ROOT), lambda x: -math.exp(-x)),
    "straight": (lambda x: ROOT - x, lambda x: -1.0),
    "kinked": (lambda x: max(1 - x / ROOT, 1e-3 * (1 - x / ROOT)), lambda x: (-1 if x < ROOT else -1e-3) / ROOT),
    "steep": (lambda x: ROOT**9 - x**9, lambda x: -9 * x**8),
    "flat beyond": (lambda x: max(0.7 - x**2, 0.0), lambda x: -2 * x if x < ROOT else 0.0),
}


def asking(value, slope, asked):
    def ask(x):
        assert x not in asked
        asked.append(x)
        answer = Screened(margin=value(float(x)), decision=[], frame=FRAME, slopes={})
        return answer, slope(float(x))

    return ask


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("first", ["0.1", "0.8", "1.5", "5"])
def test_four_digits_in_a_few_questions(name, first):
    asked = []
    bracket = last_success(asking(*FUNCTIONS[name], asked), F(first))
    assert bracket.closed(None)
    assert float(bracket.low) <= ROOT <= float(bracket.high) * (1 + 1e-12)
    assert bracket.high <= bracket.low * (1 + TOLERANCE)
    assert bracket.best.margin == FUNCTIONS[name][0](float(bracket.low))
    assert len(asked) <= (9 if name in ("concave", "convex", "straight") else 22)


@pytest.mark.parametrize("first", ["0.9", "1.5", "3"])
def test_from_beyond_tangents_lead_to_the_last_success_without_a_question_at_the_floor(first):
    """Outside its root a concave function lies below its tangents, so that Newton's steps end at the root."""
    asked = []
    bracket = last_success(asking(*FUNCTIONS["concave"], asked), F(first))
    assert min(asked) > F("0.8")
    assert len(asked) <= 7
    assert bracket.closed(None)


def test_near_a_limit_one_question_is_enough():
    asked = []
    bracket = last_success(asking(lambda x: 1.2 - x, lambda x: -1.0, asked), first_below(F("1.2")), limit=F("1.2"))
    assert len(asked) == 1
    assert bracket.high is None
    assert F("1.2") / bracket.low <= 1 + TOLERANCE


def test_beyond_a_limit_nothing_is_asked():
    asked = []
    last_success(asking(*FUNCTIONS["kinked"], asked), first_below(F("0.9")), limit=F("0.9"))
    assert max(asked) < F("0.9")


def test_no_success_at_the_floor_ends_the_search():
    asked = []
    bracket = last_success(asking(lambda x: -1 - x, lambda x: -1.0, asked), F(3), floor=F(1))
    assert bracket.low is None
    assert bracket.high == 1
    assert len(asked) == 3


def test_a_success_at_the_floor_only_is_found():
    bracket = last_success(asking(lambda x: 1.0 if x <= 1 else -1.0, lambda x: 0.0, []), F(3), floor=F(1))
    assert bracket.low == 1


def test_the_search_above_a_known_number_stops_at_once_where_there_is_nothing():
    asked = []
    bracket = last_success(asking(*FUNCTIONS["concave"], asked), F(2), only_above=True)
    assert (bracket.low, bracket.high, len(asked)) == (None, 2, 1)


def test_without_end_the_search_stops_where_it_is_told():
    bracket = last_success(asking(lambda x: 1.0, lambda x: -1e-9, []), F("1.1"), floor=F(1), most=F(10**6))
    assert bracket.low >= 10**6
    assert bracket.high is None


def test_failing_solves_count_as_no_success():
    bracket = last_success(lambda x: (None, 0.0), F(2))
    assert (bracket.low, bracket.high) == (None, 0)
