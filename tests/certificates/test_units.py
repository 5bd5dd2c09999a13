"""Errors that the states of a law stand for, also of a law from outside the package."""

from dataclasses import dataclass
from fractions import Fraction as F
from typing import ClassVar

from quakedesign.certificates import Verdict, loop_of
from quakedesign.certificates.claim import error_units
from quakedesign.controllers.dia import DiscontinuousIntegral
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


def test_a_controller_from_outside_the_package_is_judged_on_a_fault():
    from quakedesign.certificates.premises import least_authority
    from quakedesign.fault import load_fault

    fault = load_fault("real-fault")
    judged = assess(fault, Mine.from_values(tuple(GAINS.values()), scale=F(1, 100), divisor=least_authority(fault)))
    assert judged.verdict is Verdict.PROVED
    assert judged.certificate.loop.law == "mine"
    assert 0 < judged.domain.start_slip_error < judged.domain.slip_error < 1e-8
