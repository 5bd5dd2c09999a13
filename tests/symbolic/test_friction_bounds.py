"""What a friction law declares is believed only as far as its expression confirms it."""

from dataclasses import dataclass, field, replace
from fractions import Fraction as F
from typing import ClassVar

import pytest
import sympy as sp
from thinned import few

from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.fault import FrictionLaw, friction_laws, load_fault
from quakedesign.symbolic import SignedPower
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
    "stress_sensitivity": 0.2,
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


@pytest.mark.slow
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
    "upper bound": (hyperbolic, {"high": 0.4999}, "the upper bound of own-law .*Declared 0.4999"),
    "lower bound": (hyperbolic, {"low": 0.401}, "the lower bound of own-law .*Declared 0.401"),
    "rate_slope": (
        shape((0.4, 0.5, 100, 0))(lambda s, v: 1 / (1 + s + v)),
        {},
        "rate_slope of own-law .*Declared 0, but",
    ),
    "a narrow ripple": (shape((0.3, 0.6, 150, 0))(lambda s, _: 1 / (1 + s) + sp.sin(40 * s) / 20), {}, "slip_slope"),
    "a hidden step": (shape((0.3, 0.6, 150, 0))(lambda s, _: sp.Max(0, sp.Min(1, 50 * (s - 7)))), {}, "slip_slope"),
    "growth far out": (shape((0.3, 0.6, 150, 0))(lambda s, _: sp.log(1 + s) / 9), {}, "the upper bound"),
    "no friction": (shape((0.0, 0.5, 500, 0))(lambda s, _: 5 / (1 + s) - 4), {}, "must stay positive"),
}


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "changes", "message"), WRONG.values(), ids=WRONG)
def test_a_law_that_exceeds_what_it_declares_is_refused_with_the_place(kind, changes, message):
    with pytest.raises(ParameterError, match=message):
        friction_bounds(kind(**changes))


JUMP = "friction of own-law may jump"
UNPROVED = {
    "a sign": (lambda s, _: (1 - sp.sign(s - 1)) / 2, JUMP),
    "a set-valued sign": (lambda s, _: (1 - SignedPower(s - 1, 0)) / 2, JUMP),
    "a step": (lambda s, _: sp.Heaviside(1 - s), JUMP),
    "a jump of branches": (
        lambda s, _: sp.Piecewise((1, s < 1), (0, True)),
        "no bounds of own-law can be proved: no enclosure for Piecewise",
    ),
    "no enclosure": (lambda s, _: sp.erfc(s), "own-law: no enclosure for erfc"),
    "steep at rest": (lambda s, _: 1 - sp.sqrt(sp.Min(s, 1)), r"slip_slope of own-law .* but at slip .* m it is"),
    "no end of a half-line": (
        lambda s, _: s * sp.sin(s) / (1 + s) ** 2,
        r"own-law can be proved: .* bound, declared as 0\.[36], is undecided for slip from \S+e\+\d\d to inf",
    ),
}


@few(("function", "message"), UNPROVED.values(), ids=UNPROVED, every=3)
def test_what_cannot_be_enclosed_is_not_proved(function, message):
    with pytest.raises((UnsupportedError, ParameterError), match=message):
        friction_bounds(shape((0.3, 0.6, 150, 0))(function)())


@pytest.mark.slow
def test_signed_powers_without_a_jump_are_proved():
    """Friction 0.4 + 0.1·min(1, (s/mm)²) has slopes up to 200 1/m."""
    squared = shape((0.4, 0.5, 200, 0))(lambda s, _: sp.Min(1, SignedPower(s, 2)))
    found = friction_bounds(squared())
    assert (found.least, found.most, found.weakens) == (F(2, 5), F(1, 2), False)
    assert 200 <= found.slip_slope <= 200 * (1 + F(1, 10**9))
    with pytest.raises(ParameterError, match="slip_slope of own-law"):
        friction_bounds(squared(slip_slope=199))


def test_an_arsinh_without_a_state_is_taken_as_it_is():
    found = friction_bounds(shape((0.4, 0.5, 100, 0))(lambda s, _: sp.Min(1, sp.asinh(s)))())
    assert (found.least, found.most, found.slip_slope) == (F(2, 5), F(1, 2), 100)


def test_what_is_declared_a_little_too_small_is_rounded_up():
    """Up to a part in 1e9, as irrational numbers are; beyond it is refused."""
    assert friction_bounds(hyperbolic(slip_slope=F(100) - F(1, 10**8))).slip_slope == 100
    with pytest.raises(ParameterError, match="slip_slope"):
        friction_bounds(hyperbolic(slip_slope=F(100) - F(1, 10**6)))
    irrational = shape((0.4, 0.5, 100 * sp.sqrt(2), 0))(lambda s, _: sp.sqrt(2) / (1 + s) - sp.sqrt(2) + 1)
    found = friction_bounds(irrational(low=0.3))
    assert 0 <= found.slip_slope**2 - 20000 < F(1, 10**4)


@pytest.mark.parametrize("wrong", [sp.oo, sp.nan, sp.Symbol("k")])
def test_a_declared_slope_is_a_finite_number(wrong):
    with pytest.raises(ParameterError, match="slope of a friction law must be a finite number"):
        friction_bounds(hyperbolic(slip_slope=wrong))


def test_constant_friction_counts_everywhere():
    with pytest.raises(ParameterError, match=r"declared 0\.45, but everywhere it is 0\.5\."):
        friction_bounds(shape((0.4, 0.45, 0, 0))(lambda s, _: sp.Integer(1))())


@pytest.mark.parametrize("axis", ["slip", "rate"])
def test_slow_and_short_slip_counts(axis):
    """Friction that exceeds its bound below 1 m/s or 1 m only, where the continuation says nothing."""

    class Raised(hyperbolic):
        def coefficient(self, slip, rate):
            return sp.Rational(2, 5) + sp.Max(0, 1 - {"slip": slip, "rate": rate}[axis])

        def extended(self, slip, rate):
            return sp.Rational(2, 5)

    with pytest.raises(ParameterError, match=rf"upper bound .* but at {axis} .* it is 1\."):
        friction_bounds(Raised(rate_slope=1.0))


@pytest.mark.parametrize("declared", [0.15, 0.1499])
def test_a_state_adds_its_own_slope_to_that_of_slip(declared):
    """Of 0.4 + m/10 + (1/10)/(1 + s), m′ = −v·m with m from 1/4 to 1/2: at most 1/10 + 1/20 per metre, at s = 0."""

    class Remembering(hyperbolic):
        state_names = ("memory",)
        state_units = ("",)
        working_rates = (1.0, 3.0)

        def coefficient(self, slip, rate, memory):
            return sp.Rational(2, 5) + memory / 10 + 1 / (1 + slip) / 10

        def state_rates(self, slip, rate, memory):
            return (-rate * memory,)

        def steady_state(self, rate):
            return (1 / (1 + rate),)

    law = Remembering(high=0.55, low=0.425, slip_slope=declared)
    if declared < 0.15:
        with pytest.raises(ParameterError, match="slip_slope of own-law"):
            friction_bounds(law)
    else:
        found = friction_bounds(law)
        assert (found.least, found.most, found.slip_slope) == (F(17, 40), F(11, 20), F(3, 20))
        assert found.weakens


@pytest.mark.slow
def test_an_arsinh_of_a_state_is_taken_by_its_logarithm():
    """Of arsinh(v·e^{1000m})/1000, m′ = −v·m with m from 1/4 to 1/2: between m and m + log(6)/1000, slope at most m."""

    class Activated(hyperbolic):
        state_names = ("memory",)
        state_units = ("",)
        working_rates = (1.0, 3.0)

        def coefficient(self, slip, rate, memory):
            return sp.asinh(rate * sp.exp(1000 * memory)) / 1000

        def state_rates(self, slip, rate, memory):
            return (-rate * memory,)

        def steady_state(self, rate):
            return (1 / (1 + rate),)

    found = friction_bounds(Activated(low=0.25, high=0.502, slip_slope=0.5, rate_slope=0.001))
    assert (found.least, found.most, found.slip_slope) == (F(1, 4), F(251, 500), F(1, 2))
    assert found.weakens


@pytest.mark.parametrize("name", ["rate-and-state-aging", "rate-and-state-slip"])
@pytest.mark.parametrize("what", ["least", "most", "slip_slope", "rate_slope"])
def test_laws_with_state_reach_what_they_declare(name, what):
    """A thousandth less is refused: of the corners of slip rate and state, and of the slope that ageing adds."""
    kind = friction_laws()[name]
    law = kind(**{quantity: QUANTITIES[quantity] for quantity in kind.quantities()})
    declared = {
        "least": law.bounds[0],
        "most": law.bounds[1],
        "slip_slope": law.slip_slope,
        "rate_slope": law.rate_slope,
    }
    changed = {**declared, what: declared[what] * (1.001 if what == "least" else 0.999)}

    class Tighter(kind):
        bounds = changed["least"], changed["most"]
        slip_slope = changed["slip_slope"]
        rate_slope = changed["rate_slope"]

    with pytest.raises(ParameterError, match="contradicts the law"):
        friction_bounds(Tighter(**{quantity: QUANTITIES[quantity] for quantity in kind.quantities()}))


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

    class Back(hyperbolic):
        def extended(self, slip, rate):
            return self.coefficient(sp.Abs(slip), rate)

    assert not friction_bounds(Back()).weakens


def test_every_proof_asks_for_confirmed_bounds():
    """Premises, sectors, margins, feed-forward: a declared slope that is too small by a thousand stops each of them."""
    from quakedesign.laws.feed_forward import feed_forward
    from quakedesign.lyapunov.exact.perturbation_bounds import friction_range, sectors
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
