"""What a friction law declares is believed only as far as its expression confirms it."""

from dataclasses import dataclass, field, replace
from fractions import Fraction as F
from typing import ClassVar

import pytest
import sympy as sp

from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.fault import FrictionLaw, friction_laws, load_fault
from quakedesign.symbolic.friction_bounds import friction_bounds

QUANTITIES = {
    "residual": 0.2353,
    "drop": 0.1,
    "critical_slip": 0.27635,
    "critical_rate": 0.02,
    "reference_coefficient": 0.6,
    "direct_effect": 0.011,
    "evolution_effect": 0.016,
    "reference_rate": 1e-6,
    "slowest_rate": 1e-9,
    "fastest_rate": 1e-3,
}
LAB = load_fault("lab-fault")


def shape(kind):
    """A law of a user's: residual + drop·shape(slip/length, rate), with what it declares."""

    def decorate(function):
        @dataclass(frozen=True, kw_only=True)
        class Own(FrictionLaw):
            """Friction of a user's."""

            name: ClassVar[str] = "own-law"
            source: ClassVar[str] = "this test"
            domain: ClassVar[str] = "slip >= 0"
            residual: float = field(default=0.4, metadata={"unit": "", "symbol": "c"})
            drop: float = field(default=0.1, metadata={"unit": "", "symbol": "d"})
            length: float = field(default=1e-3, metadata={"unit": "m", "symbol": "l"})
            low: float = kind[0]
            high: float = kind[1]
            slip_slope: float = kind[2]
            rate_slope: float = kind[3]

            def coefficient(self, slip, rate):
                """Friction coefficient [-]."""
                return self.residual + self.drop * function(slip / self.length, rate)

            def extended(self, slip, rate):
                """Friction coefficient [-], continued."""
                return self.coefficient(sp.Max(slip, 0), sp.Abs(rate))

            @property
            def bounds(self):
                """Declared [-]."""
                return self.low, self.high

        return Own

    return decorate


@shape((0.4, 0.5, 100, 0))
def hyperbolic(s, _):
    return 1 / (1 + s)


@pytest.mark.parametrize("name", sorted(friction_laws()))
def test_every_law_of_the_package_is_confirmed_as_declared(name):
    kind = friction_laws()[name]
    law = kind(**{quantity: QUANTITIES[quantity] for quantity in kind.quantities()})
    found, exact = friction_bounds(law), law.exact()
    declared = (*exact.bounds, exact.slip_slope, exact.rate_slope)
    confirmed = (found.least, found.most, found.slip_slope, found.rate_slope)
    if law.state_names:  # irrational corners, declared as floats
        assert confirmed == pytest.approx([float(value) for value in declared], rel=1e-15)
    else:
        assert confirmed == declared
    assert found.weakens is not bool(law.state_names)


def test_a_law_of_a_users_is_confirmed():
    found = friction_bounds(hyperbolic())
    assert (found.least, found.most, found.slip_slope, found.rate_slope) == (F(2, 5), F(1, 2), 100, 0)
    assert found.weakens


WRONG = {
    "slip_slope": (hyperbolic, {"slip_slope": 0.1}, r"slip_slope of own-law .*Declared 0\.1, but at slip .* m it is"),
    "just too flat": (hyperbolic, {"slip_slope": 99.999}, "slip_slope of own-law"),
    "upper bound": (hyperbolic, {"high": 0.4999}, "the upper of its bounds of own-law .*Declared 0.4999"),
    "lower bound": (hyperbolic, {"low": 0.401}, "the lower of its bounds of own-law .*Declared 0.401"),
    "rate_slope": (
        shape((0.4, 0.5, 100, 0))(lambda s, v: 1 / (1 + s + v)),
        {},
        "rate_slope of own-law .*Declared 0, but",
    ),
    "a narrow ripple": (shape((0.3, 0.6, 150, 0))(lambda s, _: 1 / (1 + s) + sp.sin(40 * s) / 20), {}, "slip_slope"),
    "a hidden step": (shape((0.3, 0.6, 150, 0))(lambda s, _: sp.Max(0, sp.Min(1, 50 * (s - 7)))), {}, "slip_slope"),
    "growth far out": (shape((0.3, 0.6, 150, 0))(lambda s, _: sp.log(1 + s) / 9), {}, "the upper of its bounds"),
    "no friction": (shape((0.0, 0.5, 500, 0))(lambda s, _: 5 / (1 + s) - 4), {}, "must stay positive"),
}


@pytest.mark.parametrize(("kind", "changes", "message"), WRONG.values(), ids=WRONG)
def test_a_law_that_exceeds_what_it_declares_is_refused_with_the_place(kind, changes, message):
    with pytest.raises(ParameterError, match=message):
        friction_bounds(kind(**changes))


UNDECIDED = {
    "a jump": lambda s, _: (1 - sp.sign(s - 1)) / 2,
    "a jump of branches": lambda s, _: sp.Piecewise((1, s < 1), (0, True)),
    "no enclosure": lambda s, _: sp.erfc(s),
    "steep at rest": lambda s, _: 1 - sp.sqrt(s) / (1 + s),
}


@pytest.mark.parametrize("function", UNDECIDED.values(), ids=UNDECIDED)
def test_what_cannot_be_enclosed_is_not_proved(function):
    with pytest.raises((UnsupportedError, ParameterError), match="own-law"):
        friction_bounds(shape((0.3, 0.6, 150, 0))(function)())


def test_a_continuation_counts_too():
    """Friction that goes on to fall for negative slip, where the law itself says nothing."""

    class Continued(hyperbolic):
        def extended(self, slip, rate):
            return self.coefficient(sp.Abs(slip), rate) - sp.tanh(sp.Max(-slip, 0) * 3000) / 10

    with pytest.raises(ParameterError, match=r"slip_slope of own-law .*slip -"):
        friction_bounds(Continued(low=0.2))


def test_strengthening_is_seen():
    stronger = shape((0.4, 0.5, 100, 0))(lambda s, _: 1 - 1 / (1 + s))()
    assert not friction_bounds(stronger).weakens


def test_every_proof_asks_for_confirmed_bounds():
    """Premises, sectors, margins, feed-forward: a declared slope that is too small by a thousand stops each of them."""
    from quakedesign.certificates.linear_premises import sectors
    from quakedesign.certificates.premises import friction_range
    from quakedesign.controllers.feed_forward import feed_forward
    from quakedesign.synthesis import design

    fault = replace(LAB, friction=hyperbolic(slip_slope=0.1))
    for prove in (
        lambda: friction_range(fault),
        lambda: sectors(fault),
        lambda: feed_forward("centred", fault, F(1)),
        *(lambda name=name: design(fault, name) for name in ("cta", "dia", "elqr")),
        lambda: design(fault, "elqr", continuous=True),
    ):
        with pytest.raises(ParameterError, match="slip_slope of own-law"):
            prove()
