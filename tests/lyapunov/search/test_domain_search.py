"""The search for a level set, with shares of h that are known functions of the level."""

from dataclasses import dataclass, replace
from fractions import Fraction as F

import pytest
from hypothesis import given
from hypothesis import strategies as st

import quakedesign as qd
from quakedesign.exact import LowerBound, UpperBound
from quakedesign.fault import Disturbance
from quakedesign.laws.feed_forward import NONE, feed_forward
from quakedesign.lyapunov import Certificate, Loop
from quakedesign.lyapunov.exact import domain
from quakedesign.lyapunov.exact.domain import DomainProblem, certified_domain, certified_lipschitz
from quakedesign.lyapunov.exact.perturbation_bounds import Errors, least_authority
from quakedesign.lyapunov.exact.robustness import Robustness
from quakedesign.symbolic.terms import Term

REAL = qd.load_fault("real-fault")
DIVISOR = least_authority(REAL)


def certificate(d=("-3", "2"), beta=("1", "3353/2353")):
    """V = e1^2 + e2^2 + e3^2 and bounds that make |e_i| <= sqrt(V)."""
    names = ("e1", "e2", "e3")
    loop = Loop(
        law="own",
        gains={},
        constants={},
        states=dict.fromkeys(names, 1),
        domain="reals",
        uncertain={"d": tuple(map(F, d)), "beta": tuple(map(F, beta))},
        field={"e1": (), "e2": (Term(F(1), (), (("e1", F(1), "s"),)),), "e3": ()},
    )
    lyapunov = tuple(Term(F(1), (), ((name, F(2), "a"),)) for name in names)
    return Certificate(loop=loop, lyapunov=lyapunov, claims={f"bound_{name}": F(1) for name in names})


@dataclass(frozen=True)
class Law:
    """What the search asks of a controller."""

    scale: F = F(1)
    divisor: F = DIVISOR
    feedforward: object = None

    def loop_field(self):
        """No model: units of one."""


class Feedforward:
    name = "none"


@pytest.fixture
def simple(monkeypatch):
    """|h'| = 1 + 3|e1| and sensitivities 2 + |e1| and 4 + |e2|; the cause is not asked for."""

    def rate(fault, divisor, errors, *, pieces=None, feedforward, limit=None):
        return 1 + 3 * errors.slip

    def sensitivities(fault, divisor, errors, *, feedforward):
        assert errors.acceleration == 0
        return 2 + errors.slip, 4 + errors.rate

    monkeypatch.setattr(domain, "largest_matched_rate", rate)
    monkeypatch.setattr(domain, "largest_sensitivities", sensitivities)
    for name in ("_whole_limit", "_split_limit"):
        monkeypatch.setattr(domain, name, lambda *_: "not asked")


def question(known=None, law=None, **options):
    return DomainProblem(REAL, law or Law(feedforward=Feedforward()), certificate(**options), known)


WITHSTANDS = Robustness(slip=F(1, 4), rate=F(1, 16), slip_power=F(1, 2), rate_power=F(1), source="by hand")


def test_the_smaller_end_bounds_the_rate():
    assert certified_lipschitz(certificate(d=("-3", "2"))) == 2
    assert certified_lipschitz(certificate(d=("-3", "7"))) == 3
    assert question(law=Law(scale=F(5), feedforward=Feedforward())).allowed == 10


def test_shares_by_hand(simple):
    """At V = 4: |e1| <= 2, hence 7/2 of the whole; 1/4*4*2 and 1/16*6*4 of the split."""
    one = question(WITHSTANDS)
    assert one.along_reference() == 1
    assert float(one.whole(F(4))) == pytest.approx(7 / 2)
    assert {name: float(v) for name, v in one.split(F(4)).items()} == pytest.approx({"slip": 2, "rate": 1.5})
    assert one.holds_whole(F(1, 10))
    assert not one.holds_whole(F(1, 9))
    at_rest = one.split(F(4), Errors())
    assert {name: float(v) for name, v in at_rest.items()} == pytest.approx({"slip": 1, "rate": 1})


def test_the_split_needs_the_rate_along_the_reference(simple):
    assert question(WITHSTANDS, d=("-1", "1")).split(F(1)) is not None  # just so
    assert question(WITHSTANDS, d=("-1/2", "1/2")).split(F(1)) is None
    assert question(None).split(F(1)) is None


def test_the_whole_is_largest_where_the_rate_reaches_its_bound(simple):
    """1 + 3 sqrt(V) < 2 up to V = 1/9; sqrt(V) in steps of an eighth of a power of two: 5/16 is the last below 1/3."""
    found = certified_domain(question())
    assert found.method == "whole"
    assert found.level == (5 / 16) ** 2
    assert (found.slip_error, found.slip_rate_error) == pytest.approx((5 / 16, 5 / 16))
    assert found.slip_error >= 5 / 16 >= found.start_slip_error
    assert (found.start_slip_rate_error, found.start_perturbation) == pytest.approx((5 / 16, 5 / 16))
    assert (found.limited_by, found.feedforward) == ("not asked", "none")


def test_the_split_is_largest_where_the_shares_add_up_to_one(simple):
    """With s = sqrt(V): s (2 + s)/4 + s^2 (4 + s)/16 < 1 up to 0.965; 15/16 is the last step below."""
    found = certified_domain(question(WITHSTANDS))
    assert found.method == "split"
    assert found.level == (15 / 16) ** 2
    assert (found.slip_error, found.slip_rate_error) == pytest.approx((15 / 16, 15 / 16))


def test_the_larger_of_both_is_taken(simple):
    weak = replace(WITHSTANDS, slip=F(64), rate=F(64))
    assert certified_domain(question(weak)).method == "whole"
    assert certified_domain(question(weak)).level == (5 / 16) ** 2


def test_at_the_bound_itself_nothing_is_proved(simple, monkeypatch):
    """sqrt(V) + 1 = 2 at V = 1, where the share is 1: the step below is 15/16."""
    monkeypatch.setattr(domain, "largest_matched_rate", lambda *given, **more: 1 + F(round(given[2].slip * 16), 16))
    assert certified_domain(question()).level == (15 / 16) ** 2


def test_a_share_of_all_of_the_decrease_is_too_much(simple, monkeypatch):
    """A share of V itself is one at V = 1: the step below is 15/16; and the whole is too fast at once."""
    monkeypatch.setattr(domain, "largest_sensitivities", lambda *_, **__: (F(1), F(0)))
    monkeypatch.setattr(domain, "largest_matched_rate", lambda *given, **more: F(2) if given[2] == Errors() else F(3))
    exact = replace(WITHSTANDS, slip=F(1), slip_power=F(1), rate_power=F(1))
    found = certified_domain(question(exact))
    assert (found.method, found.level) == ("split", (15 / 16) ** 2)


def test_an_equal_level_of_both_is_the_split(simple, monkeypatch):
    monkeypatch.setattr(domain, "largest_matched_rate", lambda *given, **more: 1 + given[2].slip)
    found = certified_domain(question(WITHSTANDS))
    assert (found.method, found.level) == ("split", (15 / 16) ** 2)


@pytest.mark.parametrize(
    ("beta", "holds"),
    [
        (("1", "3353/2353"), True),
        (("1/2", "2"), True),
        (("1", "3352/2353"), False),
        (("1001/1000", "3353/2353"), False),
    ],
)
def test_the_domain_is_empty_where_the_coefficient_leaves_its_range(simple, beta, holds):
    assert (certified_domain(question(WITHSTANDS, beta=beta)).level > 0) is holds


def test_the_domain_is_empty_where_the_reference_alone_is_too_fast(simple):
    found = certified_domain(question(WITHSTANDS, d=("-1/2", "1/2")))
    assert (found.level, found.slip_error, found.start_perturbation, found.method) == (0, 0, 0, "")
    assert found.limited_by == "not asked"
    assert certified_domain(question(d=("-1", "1"))).level == 0


def test_the_domain_is_found_where_the_coefficient_is_known(simple):
    certain = replace(REAL, friction=replace(REAL.friction, drop=0.0))
    law = Law(divisor=least_authority(certain), feedforward=Feedforward())
    assert certified_domain(replace(question(WITHSTANDS), fault=certain, controller=law)).level > 0


def test_plain_values_are_floats_on_the_outer_side():
    found = domain.Domain(
        level=0.5,
        slip_error=UpperBound(F(1, 3)),
        slip_rate_error=UpperBound(2),
        start_slip_error=LowerBound(F(1, 3)),
        start_slip_rate_error=LowerBound(1),
        start_perturbation=LowerBound(0),
        method="split",
        limited_by="friction",
        feedforward="none",
    )
    plain = found.to_dict()
    assert plain["start_slip_error"] < F(1, 3) < plain["slip_error"]
    assert [plain[name] for name in ("level", "slip_rate_error", "start_slip_rate_error")] == [0.5, 2.0, 1.0]
    assert [plain[name] for name in ("method", "limited_by", "feedforward")] == ["split", "friction", "none"]
    assert {type(value) for value in plain.values()} == {float, str}


# ---------------------------------------------------------------- what keeps a domain from being larger

QUIET = REAL.with_disturbance(Disturbance())
STEADY = replace(QUIET, friction=replace(REAL.friction, drop=0.0))  # its friction does not change
GROWTH = "the growth of the disturbance"
SHAKEN = REAL.with_disturbance(Disturbance(amplitude=1.0, frequency=1.0))


@pytest.mark.parametrize(
    ("fault", "errors", "cause"),
    [
        (QUIET, Errors(), "the moving reference"),
        (SHAKEN, Errors(), "the disturbance"),
        (QUIET, Errors(acceleration=F(1)), "the control, through viscosity and rate weakening (e2')"),
        (QUIET, Errors(rate=F(1)), "the slip-rate error, through spring and weakening friction"),
        (SHAKEN, Errors(acceleration=F(1)), "the control, through viscosity and rate weakening (e2')"),
        (SHAKEN, Errors(rate=F(1)), "the slip-rate error, through spring and weakening friction"),
    ],
)
def test_the_cause_of_the_rate_is_the_only_one_that_is_large(fault, errors, cause):
    asked = replace(question(), fault=fault, controller=Law(feedforward=NONE))
    assert domain._whole_limit(asked, errors) == cause


@pytest.mark.parametrize(
    ("fault", "sensitivities", "cause"),
    [
        (REAL, (2, 1), "the slip error, through friction"),
        (STEADY, (2, 1), "the slip error, through the spring"),
        (STEADY, (1, 2), "the slip-rate error, through viscosity"),
        (REAL, (1, 2), "the slip-rate error, through viscosity"),
        (STEADY.with_disturbance(Disturbance(slip_growth=100.0)), (2, 1), GROWTH),
        (STEADY.with_disturbance(Disturbance(rate_growth=100.0)), (1, 2), GROWTH),
    ],
)
def test_the_cause_of_the_sensitivity_is_the_only_one_that_is_large(fault, sensitivities, cause, monkeypatch):
    monkeypatch.setattr(domain, "largest_matched_rate", lambda *_, **__: F(0))
    monkeypatch.setattr(domain, "largest_sensitivities", lambda *_, **__: tuple(map(F, sensitivities)))
    even = replace(WITHSTANDS, slip=F(1), rate=F(1), slip_power=F(1))
    asked = replace(question(even), fault=fault, controller=Law(feedforward=NONE))
    found = domain._split_limit(asked, F(1))
    assert found.endswith(cause)
    assert found.startswith("the slip error" if sensitivities[0] > sensitivities[1] else "the slip-rate error")


def test_what_the_feed_forward_leaves_is_named_so(monkeypatch):
    """A tenth of the spring is left where the stiffness is known up to a tenth, and friction does nothing."""
    monkeypatch.setattr(domain, "largest_matched_rate", lambda *_, **__: F(0))
    monkeypatch.setattr(domain, "largest_sensitivities", lambda *_, **__: (F(2), F(1)))
    wide = STEADY.with_box("ten-percent")
    law = Law(divisor=least_authority(wide), feedforward=feed_forward("nominal", wide, least_authority(wide)))
    asked = replace(question(WITHSTANDS), fault=wide, controller=law)
    assert domain._split_limit(asked, F(1)) == "the slip error, through the spring minus its feed-forward"


@given(st.fractions(F(1, 10**6), 10**6), st.sampled_from([F(1), F(1, 2), F(2, 5), F(7, 3)]))
def test_a_root_is_rounded_up_by_little(level, power):
    found, exact = domain._root(level, power) ** power.denominator, level**power.numerator
    assert exact <= found <= exact * (1 + F(1, 2**40))
