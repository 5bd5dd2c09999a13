"""Errors that the states of a law stand for, also of a law from outside the package."""

from dataclasses import dataclass, replace
from fractions import Fraction as F
from functools import cache
from typing import ClassVar

import pytest
import sympy as sp
from thinned import few

from quakedesign.fault import load_fault
from quakedesign.laws.cta import ContinuousTwisting
from quakedesign.laws.dia import DiscontinuousIntegral
from quakedesign.lyapunov import Verdict, loop_of
from quakedesign.lyapunov.exact.loop_expressions import error_units
from quakedesign.lyapunov.exact.perturbation_bounds import least_authority
from quakedesign.symbolic import SignedPower
from quakedesign.synthesis.design import assess


@dataclass(frozen=True, kw_only=True)
class Mine(DiscontinuousIntegral):
    """A law of the user's own, in other coordinates than the errors."""

    name: ClassVar[str] = "mine"


@dataclass(frozen=True, kw_only=True)
class Borrowed(DiscontinuousIntegral):
    """A law of the user's own under a name of the package."""

    name: ClassVar[str] = "cta"


GAINS = {"kI1": F(4), "kI2": F(20), "kI3": F(1), "kI4": F(0)}
RANGES = {"beta": (F(1), F(1)), "d": (F(-1, 10), F(1, 10))}


def test_the_units_are_those_of_the_law_itself_whatever_its_name():
    for law in (DiscontinuousIntegral, Mine, Borrowed):
        model = law.loop_field()
        units = error_units(loop_of(law.name, model, gains=GAINS, uncertain=RANGES), model)
        assert units["f1"] == (F(1, 8), F(1, 8))  # f1 = κ³e1, κ = √k_I1
        assert units["e2"] == units["e3"] == (F(1), F(1))


@pytest.mark.slow
def test_a_controller_from_outside_the_package_is_judged_on_a_fault():
    fault = load_fault("real-fault")
    judged = assess(fault, Mine.from_values(tuple(GAINS.values()), scale=F(1, 100), divisor=least_authority(fault)))
    assert judged.verdict is Verdict.PROVED
    assert judged.certificate.loop.law == "mine"
    assert 0 < judged.domain.start_slip_error < judged.domain.slip_error < 1e-8


@pytest.mark.slow
@few("unit", ["4", "1/16", "1/256"], every=3)
def test_what_is_certified_does_not_depend_on_the_unit_of_the_second_state(unit):
    one, other = _judged("1"), _judged(unit)
    assert other.verdict is one.verdict is Verdict.PROVED
    assert other.domain.start_slip_error == pytest.approx(one.domain.start_slip_error, rel=0.02)
    assert other.domain.method == one.domain.method


def rescaled_twisting(unit):
    """The law of the package with e2 = unit·y."""

    @dataclass(frozen=True, kw_only=True)
    class Rescaled(ContinuousTwisting):
        name: ClassVar[str] = "rescaled"

        @classmethod
        def loop_field(cls):
            model = ContinuousTwisting.loop_field()
            _, second, _ = model.states
            rates = {
                s: rate.replace(
                    lambda part: isinstance(part, SignedPower) and part.args[0] == second,
                    lambda part: unit ** part.args[1] * part,
                )
                for s, rate in model.field.items()
            }
            first, *_ = model.states
            field = rates | {first: unit * second, second: sp.expand(rates[second] / unit)}
            return replace(model, field=field, units={second: unit})

    return Rescaled


@cache
def _judged(unit):
    fault, law = load_fault("real-fault"), rescaled_twisting(sp.Rational(unit))
    gains = tuple(map(F, ("7", "5", "23/10", "11/10")))
    return assess(fault, law.from_values(gains, scale=F(1, 100), divisor=least_authority(fault)))
