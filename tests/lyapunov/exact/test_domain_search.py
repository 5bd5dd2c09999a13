"""Search for the largest certified level set, with conditions that are made up, against levels known by hand."""

from dataclasses import dataclass, replace
from fractions import Fraction as F
from types import SimpleNamespace

import pytest
import sympy as sp

from quakedesign.exact import LowerBound, UpperBound
from quakedesign.fault import Disturbance, load_fault
from quakedesign.laws.feed_forward import NONE
from quakedesign.lyapunov.exact import domain
from quakedesign.lyapunov.exact.domain import Domain, DomainProblem, _largest_split, _level, certified_domain
from quakedesign.lyapunov.exact.perturbation_bounds import Errors, least_authority
from quakedesign.symbolic import plant

REAL = load_fault("real-fault")
FAR = F(10**9)


@dataclass
class Made:
    """A problem whose conditions hold below given levels."""

    whole: F
    split_below: F | None = None
    guessed_below: F | None = None
    degree: F = F(1)
    beta: tuple = (F(1), F(2))

    @property
    def sets(self):
        return SimpleNamespace(degree=self.degree, errors=lambda level: Errors(slip=level))

    @property
    def fault(self):
        return None

    @property
    def controller(self):
        return SimpleNamespace(divisor=None)

    @property
    def certificate(self):
        return SimpleNamespace(loop=SimpleNamespace(uncertain={"beta": self.beta}))

    def holds_whole(self, level):
        return level < self.whole

    def split(self, level, errors=None):
        """Shares that add up to the level over its limit."""
        if self.split_below is None:
            return None
        below = self.split_below if errors is None else self.guessed_below or self.split_below
        return {"slip": level / below / 2, "rate": level / below / 2}


def found(problem, monkeypatch, beta=(F(1), F(2))):
    monkeypatch.setattr(domain, "coefficient_range", lambda *_: beta)
    monkeypatch.setattr(domain, "_whole_limit", lambda _, errors: f"whole at {errors.slip}")
    monkeypatch.setattr(domain, "_split_limit", lambda _, level: f"split at {level}")
    monkeypatch.setattr(domain, "_domain", lambda _, level, method, limit: (level, method, limit))
    return certified_domain(problem)


@pytest.mark.parametrize(
    ("step", "degree", "level"),
    [
        (0, 1, 1),
        (1, 1, F(9, 8)),
        (7, 1, F(15, 8)),
        (8, 1, 2),
        (-1, 1, F(15, 16)),
        (-8, 1, F(1, 2)),
        (9, 2, F(81, 16)),
        (8, F(5, 2), 4),
    ],
)
def test_levels_are_powers_of_eighths(step, degree, level):
    assert _level(step, F(degree)) == level


@pytest.mark.parametrize(
    ("below", "guessed", "step"), [(1, 1, -1), (1, 4, -1), (1, 10**6, -1), (4, 1, 4 - 5), (F(1, 2**90), None, None)]
)
def test_a_split_is_as_large_as_is_proved_with_the_errors_of_its_level(below, guessed, step):
    """A guess that holds only for zero errors goes down to a level below the limit; one that is low stays so."""
    problem = Made(whole=FAR, split_below=F(below), guessed_below=None if guessed is None else F(guessed))
    assert _largest_split(problem) == step
    assert _largest_split(Made(whole=FAR)) is None


def test_shares_that_add_up_to_one_are_not_enough():
    """At the level 1, the limit itself, both halves make 1; the next level below is 15/16."""
    assert _largest_split(Made(whole=FAR, split_below=F(1))) == -1
    assert _largest_split(Made(whole=FAR, split_below=F(1001, 1000))) == 0


def test_the_larger_of_both_level_sets_is_taken(monkeypatch):
    both = Made(whole=F(4), split_below=F(1))
    assert found(both, monkeypatch) == (F(15, 4), "whole", "whole at 15/4")
    assert found(replace(both, whole=F(1, 4)), monkeypatch) == (F(15, 16), "split", "split at 15/16")
    assert found(replace(both, whole=F(1)), monkeypatch) == (F(15, 16), "split", "split at 15/16")
    assert found(replace(both, split_below=None), monkeypatch) == (F(15, 4), "whole", "whole at 15/4")
    assert found(Made(whole=F(0)), monkeypatch) == (0, "", "whole at 0")


@pytest.mark.parametrize(
    ("beta", "empty"),
    [
        ((1, 2), False),
        ((F(9, 10), 2), True),
        ((1, F(21, 10)), True),
        ((F(9, 10), F(21, 10)), True),
        ((F(3, 2), 2), False),
    ],
)
def test_an_input_gain_beyond_its_certified_range_leaves_an_empty_domain(beta, empty, monkeypatch):
    level, method, limit = found(Made(whole=F(4)), monkeypatch, tuple(map(F, beta)))
    assert ((level, method) == (0, "")) is empty
    assert limit.startswith("the input gain") is empty


# ---------------------------------------------------------------- conditions of a problem


def problem(monkeypatch, rate, limit=F(2), **given):
    """A problem whose bound on |h'| is a function of the slip error, with the sensitivities 2 and 3."""
    asked = []
    monkeypatch.setattr(domain, "largest_matched_rate", lambda *given, **_: rate(given[2].slip))
    monkeypatch.setattr(domain, "largest_sensitivities", lambda *given, **_: asked.append(given[2]) or (F(2), F(3)))
    monkeypatch.setattr(domain, "certified_lipschitz", lambda _: limit)
    monkeypatch.setattr(DomainProblem, "sets", SimpleNamespace(errors=lambda level: Errors(slip=level, rate=F(7))))
    controller = SimpleNamespace(scale=F(1), divisor=F(1), feedforward=NONE)
    robust = SimpleNamespace(slip=F(5), rate=F(11), slip_power=F(1), rate_power=F(1))
    parts = {"fault": None, "controller": controller, "certificate": None, "robustness": robust} | given
    return DomainProblem(**parts), asked


def test_shares_are_the_sensitivities_times_what_the_decrease_withstands(monkeypatch):
    """5·2·V and 11·3·V; of the level's own errors unless others are given, without the acceleration."""
    one, asked = problem(monkeypatch, lambda slip: F(2))
    shares = one.split(F(1, 4))
    assert {name: float(v) for name, v in shares.items()} == pytest.approx({"slip": 2.5, "rate": 8.25}, rel=1e-6)
    assert shares["slip"] >= F(5, 2)
    one.split(F(1, 4), Errors(slip=F(3), rate=F(1), acceleration=F(9)))
    assert asked == [Errors(slip=F(1, 4), rate=F(7)), Errors(slip=F(3), rate=F(1))]


def test_there_are_no_shares_if_zero_errors_use_up_the_bound(monkeypatch):
    assert problem(monkeypatch, lambda slip: F(2))[0].split(F(1)) is not None
    assert problem(monkeypatch, lambda slip: F(2) + F(1, 10**9))[0].split(F(1)) is None
    assert problem(monkeypatch, lambda slip: F(1), robustness=None)[0].split(F(1)) is None


def test_the_whole_perturbation_is_compared_with_its_bound(monkeypatch):
    one, _ = problem(monkeypatch, lambda slip: slip)
    assert (one.holds_whole(F(199, 100)), one.holds_whole(F(2))) == (True, False)
    assert one.whole(F(3)) == F(3, 2)


# ---------------------------------------------------------------- causes


@pytest.mark.parametrize(
    ("disturbance", "cause"),
    [
        (Disturbance(amplitude=1.0, frequency=1.0), "the disturbance"),
        (Disturbance(), "the moving reference"),
    ],
)
def test_the_cause_of_a_rate_at_zero_errors_is_the_larger_part(disturbance, cause):
    fault = REAL.with_disturbance(disturbance)
    controller = SimpleNamespace(divisor=least_authority(fault), feedforward=NONE)
    assert domain._whole_limit(SimpleNamespace(fault=fault, controller=controller), Errors()) == cause


@pytest.mark.parametrize(
    ("errors", "cause"),
    [
        (Errors(acceleration=F(1000)), "the control, through viscosity and rate weakening (e2')"),
        (Errors(slip=F(1, 10**9), rate=F(1000)), "the slip-rate error, through spring and weakening friction"),
    ],
)
def test_with_errors_the_cause_is_one_of_them(errors, cause):
    controller = SimpleNamespace(divisor=least_authority(REAL), feedforward=NONE)
    assert domain._whole_limit(SimpleNamespace(fault=REAL, controller=controller), errors) == cause


@pytest.mark.parametrize(
    ("spring", "slope", "growth", "name", "cause"),
    [
        (-4, -1, 0, "none", "the slip error, through the spring"),
        (-4, -1, 0, "nominal", "the slip error, through the spring minus its feed-forward"),
        (-2, -1, 0, "none", "the slip error, through friction"),
        (-2, -1, 9, "none", "the slip error, through the growth of the disturbance"),
    ],
)
def test_the_cause_of_the_larger_share_is_the_largest_of_its_terms(spring, slope, growth, name, cause, monkeypatch):
    """The sensitivity is 3 times the slope of friction, and the spring, and the growth of the disturbance."""
    stiffness = sp.Symbol("stiffness", real=True)
    expression = 3 * plant.slip_slope + stiffness + plant.phi_1
    ranges = {plant.slip_slope: (F(slope), F(0)), stiffness: (F(spring),) * 2, plant.phi_1: (F(growth),) * 2}
    monkeypatch.setattr(domain, "sensitivity_expressions", lambda *_: (expression, sp.Integer(0)))
    monkeypatch.setattr(domain, "parameter_ranges", lambda _: ranges)
    made = SimpleNamespace(
        split=lambda _: {"rate": F(1, 4), "slip": F(1, 2)},
        fault=None,
        controller=SimpleNamespace(divisor=None, feedforward=SimpleNamespace(name=name)),
        sets=SimpleNamespace(errors=lambda _: Errors()),
    )
    assert domain._split_limit(made, F(1)) == cause


def test_plain_values_are_floats_and_texts():
    value = Domain(
        level=0.5,
        slip_error=UpperBound(F(1, 2)),
        slip_rate_error=UpperBound(F(1, 4)),
        start_slip_error=LowerBound(F(1)),
        start_slip_rate_error=LowerBound(F(2)),
        start_perturbation=LowerBound(F(3)),
        method="split",
        limited_by="friction",
        feedforward="none",
    )
    plain = value.to_dict()
    assert (plain["slip_error"], plain["start_perturbation"], plain["method"]) == (0.5, 3.0, "split")
    assert {type(v) for v in plain.values()} == {float, str}
