"""Carried gains against the formulas of the paper's appendix, its printed gains, and the loops themselves."""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.fault.similarity import Scales, radical, scaled_fault, similarity
from quakedesign.laws import Controller, Signals, SlidingMode, control_laws, published
from quakedesign.laws.gain_scaling import UNROUNDED, agrees, carry, exact, law_dimensions, printed_gains
from quakedesign.symbolic import SignedPower

LAB, REAL = load_fault("lab-fault"), load_fault("real-fault")
TABLE = similarity(LAB, REAL).scales
LAWS = sorted(published("lab-fault"))
ratios = st.fractions(min_value=Fraction(1, 100), max_value=100, max_denominator=100)


@st.composite
def scales(draw):
    units = ("slip_m", "s", "Pa", "fault_m", "kg/fault_m^3")
    return Scales.from_ratios({unit: draw(ratios) for unit in units})


def law(name):
    return published("lab-fault")[name]


# Barred gains over gains, from the appendix, with λ_v = λ_δ/λ_t.
APPENDIX = {
    "cta": {
        "k1": lambda p, d, t: p / d ** mpmath.mpf("1/3"),
        "k2": lambda p, d, t: p / mpmath.sqrt(d / t),
        "k3": lambda p, d, t: p / t,
        "k4": lambda p, d, t: p / t,
    },
    "dia": {
        "kI1": lambda p, d, t: (d / t) / d ** mpmath.mpf("2/3"),
        "kI2": lambda p, d, t: p / mpmath.sqrt(d / t),
        "kI3": lambda p, d, t: p / t,
        "kI4": lambda p, d, t: d / (d / t) ** mpmath.mpf("3/2"),
    },
    "elqr": {
        "k1": lambda p, d, t: p / d,
        "k2": lambda p, d, t: p / (d / t),
        "k3": lambda p, d, t: p / (d * t),
        "k4": lambda p, d, t: p / (d * t**2),
    },
}


@pytest.mark.parametrize(("name", "gain"), [(n, g) for n, gains in APPENDIX.items() for g in gains])
def test_factors_are_the_barred_gains_of_the_appendix(name, gain):
    with mpmath.workdps(40):
        expected = APPENDIX[name][gain](mpmath.mpf(500), mpmath.mpf("110.54"), mpmath.mpf("184.17"))
        ones = control_laws()[name].from_values(("1",) * 4)
        assert abs(mpmath.mpf(str(carry(ones, TABLE).gains[gain].decimal(30))) / expected - 1) < mpmath.mpf("1e-28")


def test_the_scale_factors_that_reproduce_the_paper_are_those_of_table_I():
    assert [TABLE.of(unit).text() for unit in ("Pa", "slip_m", "s")] == ["500", "110.54", "184.17"]


@pytest.mark.parametrize(
    ("name", "printed"),
    [
        ("cta", {"k1": "781.37", "k2": "3226.9", "k3": "4.51e-4", "k4": "2.15e-4"}),
        ("dia", {"kI1": "5.21e-2", "kI2": "3226.9", "kI3": "3.91e-4", "kI4": "0"}),
        ("elqr", {"k1": "1.886e9", "k2": "5.781e8", "k3": "1.024e6", "k4": "18.54"}),
    ],
)
def test_published_laboratory_gains_become_the_real_ones(name, printed):
    """With the values of ERRATA 25 where the paper's own are rounded from rounded numbers."""
    carried = carry(law(name), TABLE)
    assert {gain for gain, text in printed.items() if not agrees(carried.gains[gain], text)} == set()


@pytest.mark.parametrize(("name", "wrong"), [("cta", {"k2"}), ("dia", set()), ("elqr", {"k1", "k2", "k4"})])
def test_which_printed_gains_are_rounded_otherwise(name, wrong):
    """ERRATA 25."""
    carried = carry(law(name), TABLE)
    texts = printed_gains("real-fault", name)
    assert {gain for gain, text in texts.items() if not agrees(carried.gains[gain], text)} == wrong


def test_the_unrounded_laboratory_gains_give_every_printed_linear_gain():
    values = UNROUNDED["lab-fault", "elqr"]
    assert [Fraction(v) for v in values] == [
        Fraction(10**10, 24),
        Fraction(25 * 10**6, 36),
        Fraction(10**9, 24),
        Fraction(10**7, 72),
    ]
    first = control_laws()["elqr"].from_values(values)
    there = printed_gains("real-fault", "elqr")
    here = printed_gains("lab-fault", "elqr")
    assert all(agrees(exact(first).gains[n], here[n]) for n in here)
    assert all(agrees(carry(first, TABLE).gains[n], there[n]) for n in there)


@pytest.mark.parametrize(
    ("value", "printed", "verdict"),
    [
        (radical(Fraction(32269, 10)), "3.23e3", True),
        (radical(Fraction(32269, 10)), "3.22e3", False),
        (radical(Fraction(3225)), "3.23e3", True),
        (radical(2) ** Fraction(1, 2), "1.414", True),
        (radical(2) ** Fraction(1, 2) * -1, "-1.414", True),
        (radical(2) ** Fraction(1, 2) * -1, "-1.415", False),
        (radical(2) ** Fraction(1, 2), "-1.414", False),
        (radical(0), "0", True),
    ],
)
def test_rounding_to_a_printed_number(value, printed, verdict):
    assert agrees(value, printed) is verdict


def test_faults_without_printed_gains_have_none():
    assert printed_gains("my-fault", "cta") == {}
    assert printed_gains("source", "cta") == {}


@pytest.mark.parametrize("name", LAWS)
@settings(max_examples=20, deadline=None)
@given(factors=scales(), other=ratios)
def test_there_and_back_is_the_identity_exactly(name, factors, other):
    start = law(name)
    assert carry(carry(start, factors), factors.inverse()) == exact(start)
    if isinstance(start, SlidingMode):
        there = carry(start, factors, divisor=start.divisor * other)
        back = carry(there, factors.inverse(), divisor=start.divisor)
        assert back == exact(start)


@pytest.mark.parametrize("name", LAWS)
@settings(max_examples=10, deadline=None)
@given(factors=scales())
def test_gains_grow_as_their_units_say_when_the_divisor_does(name, factors):
    """With ν = p·μ0N̂0 in m/s², `gain_units` are what the inference from the terms must give."""
    start = control_laws()[name].from_values(("1",) * 4)
    divisor = None
    if isinstance(start, SlidingMode):
        divisor = (factors.of("m/s^2") / factors.of("Pa")).fraction
    carried = carry(start, factors, divisor=divisor)
    for gain, unit in start.gain_units.items():
        assert carried.gains[gain] == factors.of(unit)


def number(value):
    return value.sign * (mpmath.mpf(value.radicand.numerator) / value.radicand.denominator) ** (
        mpmath.mpf(1) / value.degree
    )


def evaluated(controller, gains, slip_error, rate_error, integrals):
    """Pressure and integral rates with 40 digits, typed from eqs. cta, dia and u (ERRATA 19 for the sign of ξ1)."""
    k = [number(g) for g in gains.values()]

    def power(x, a):
        return mpmath.sign(x) * abs(x) ** a if x else mpmath.mpf(0)

    third, half = mpmath.mpf(1) / 3, mpmath.mpf(1) / 2
    if controller.name == "elqr":
        return -(k[0] * slip_error + k[1] * rate_error + k[2] * integrals[0] + k[3] * integrals[1]), (
            slip_error,
            integrals[0],
        )
    scale, divisor = (mpmath.mpf(v.numerator) / v.denominator for v in (controller.scale, controller.divisor))
    if controller.name == "cta":
        nu = -(scale ** (2 * third)) * k[0] * power(slip_error, third) - scale**half * k[1] * power(rate_error, half)
        rate = -scale * k[2] * mpmath.sign(slip_error) - scale * k[3] * mpmath.sign(rate_error)
    else:
        inner = power(rate_error, 3 * half) + scale**half * k[0] ** (3 * half) * slip_error
        nu = -(scale**half) * k[1] * power(inner, third)
        rate = -scale * k[2] * mpmath.sign(slip_error + scale**-half * k[3] * power(rate_error, 3 * half))
    return (nu + integrals[0]) / divisor, (rate,)


@pytest.mark.parametrize("name", LAWS)
@settings(max_examples=20, deadline=None)
@given(
    factors=scales(),
    point=st.tuples(*[st.floats(-1, 1).filter(lambda v: abs(v) > 1e-6)] * 4),
    other=st.one_of(st.none(), ratios),
)
def test_the_carried_law_asks_for_the_scaled_pressure(name, factors, point, other):
    """p(λ_δe1, λ_ve2, λ_ξξ) = λ_p p(e1, e2, ξ), and ξ' scales as ξ over time (ERRATA 20)."""
    with mpmath.workdps(40):
        start = law(name)
        if name == "dia":
            start = type(start)(gains=dict(start.gains) | {"kI4": "3"}, scale=start.scale, divisor=start.divisor)
        divisor = start.divisor * other if other and isinstance(start, SlidingMode) else None
        carried = carry(start, factors, divisor=divisor)
        slip, time, pressure = (number(factors.of(unit)) for unit in ("slip_m", "s", "Pa"))
        grown = [number(f) for f in carried.integrals.values()]
        e1, e2, *xi = (mpmath.mpf(v) for v in point)
        here, rates = evaluated(start, exact(start).gains, e1, e2, xi)
        scaled_xi = [f * v for f, v in zip(grown, xi, strict=False)]
        there, scaled_rates = evaluated(carried.law, carried.gains, slip * e1, slip / time * e2, scaled_xi)
        size = max(abs(v) for v in (here, *xi))
        assert abs(there - pressure * here) <= mpmath.mpf("1e-30") * pressure * max(size, 1e12)
        for f, a, b in zip(grown, rates, scaled_rates, strict=True):
            assert abs(b - f / time * a) <= mpmath.mpf("1e-35") * abs(f / time) * max(1, abs(a))


@pytest.mark.parametrize("name", LAWS)
def test_integral_states_of_sliding_modes_scale_as_the_pressure(name):
    """ERRATA 20: only those of the e-LQR scale as slip times time."""
    grown = carry(law(name), TABLE).integrals
    product = TABLE.of("slip_m*s")
    assert grown == ({"xi1": product, "xi2": product * TABLE.of("s")} if name == "elqr" else {"xi1": radical(500)})


@pytest.mark.parametrize("name", ["cta", "dia"])
def test_the_integral_state_adds_to_the_control(name):
    """ERRATA 19: the appendix prints the opposite sign for the 2-DIA."""
    xi, e1, e2 = sp.symbols("xi e1 e2", real=True)
    signals = Signals(slip=e1, slip_rate=e2, slip_error=e1, slip_rate_error=e2, integrals=(xi,))
    assert law(name).pressure(signals).diff(xi) == sp.Rational(1385, 4)


def poles(fault, gains):
    """Eigenvalues of the loop at the origin with pressure as the input, k1 to k4 as a list."""
    law = fault.friction
    softening = law.drop / law.critical_slip * fault.authority * fault.effective_normal_stress
    control = (law.residual + law.drop) * fault.authority
    row = [softening - fault.specific_stiffness, -fault.specific_damping, 0.0, 0.0]
    matrix = np.array([[0, 1, 0, 0], row, [1, 0, 0, 0], [0, 0, 1, 0]])
    matrix[1] -= control * np.array(gains)
    return sorted(np.linalg.eigvals(matrix), key=lambda z: (z.real, z.imag))


def test_poles_of_the_linear_loop_slow_down_by_the_scale_of_time():
    start = law("elqr")
    target = scaled_fault(LAB, TABLE)
    here = poles(LAB, [float(g) for g in start.gains.values()])
    there = poles(target, [float(g) for g in carry(start, TABLE).gains.values()])
    assert np.allclose(np.array(there) * 184.17, here, rtol=1e-6)


@pytest.mark.parametrize("name", LAWS)
def test_carried_gains_make_a_controller(name):
    carried = carry(law(name), TABLE)
    made = carried.controller()
    assert type(made) is type(law(name))
    for gain, value in made.gains.items():
        assert value == carried.gains[gain].nearest(12)
        assert float(value) == pytest.approx(float(carried.gains[gain]), rel=1e-11)
    assert {k: v for k, v in vars(made).items() if k != "gains"} == {
        k: v for k, v in vars(law(name)).items() if k != "gains"
    }


def test_only_laws_with_a_divisor_take_one():
    with pytest.raises(ParameterError, match="elqr has no divisor"):
        carry(law("elqr"), TABLE, divisor=Fraction(1))


# --- a user's own law -------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Own(Controller):
    """p = −a⌈e1 + b⌈e2⌋^{3/2}⌋^½ + ξ, ξ' = −c·tanh(e1/w): nested powers, a saturated integral and a width."""

    name: ClassVar[str] = "own"
    title: ClassVar[str] = "own"
    source: ClassVar[str] = "none"
    gain_units: ClassVar[Mapping[str, str]] = {"a": "Pa/m^(1/2)", "b": "s^(3/2)/m^(1/2)", "c": "Pa/s", "w": "m"}
    integral_units: ClassVar[tuple[str, ...]] = ("Pa",)

    def pressure(self, signals):
        a, b, _, _ = self._exact_gains()
        inner = signals.slip_error + b * SignedPower(signals.slip_rate_error, sp.Rational(3, 2))
        return -a * SignedPower(inner, sp.Rational(1, 2)) + signals.integrals[0]

    def integral_rates(self, signals):
        _, _, c, w = self._exact_gains()
        return (-c * sp.tanh(signals.slip_error / w),)

    @classmethod
    def loop_field(cls):
        raise NotImplementedError


class Careless(Own):
    """Adds slip to slip rate."""

    def pressure(self, signals):
        a, b, _, _ = self._exact_gains()
        return -a * (signals.slip_error + signals.slip_rate_error) + b * signals.integrals[0]


class Hidden(Own):
    """A width of 3 mm as a bare number."""

    def integral_rates(self, signals):
        return (-self._exact_gains()[2] * sp.tanh(signals.slip_error / sp.Rational(3, 1000)),)


class Silent(Own):
    """Never uses w."""

    def integral_rates(self, signals):
        return (-self._exact_gains()[2] * sp.sign(signals.slip_error),)


class Foreign(Own):
    """Reads a symbol that is neither gain nor signal."""

    def integral_rates(self, signals):
        return (-self._exact_gains()[2] * sp.Symbol("mystery") * sp.tanh(signals.slip_error / self._exact_gains()[3]),)


@settings(max_examples=10, deadline=None)
@given(scales())
def test_a_law_of_the_user_is_carried_by_its_terms(factors):
    start = Own(gains=dict.fromkeys("abcw", "1"))
    carried = carry(start, factors)
    assert {n: carried.gains[n] for n in "abcw"} == {n: factors.of(unit) for n, unit in start.gain_units.items()}
    assert carried.integrals == {"xi1": factors.of("Pa")}


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (Careless, "must have consistent units"),
        (Hidden, "must have consistent units"),
        (Silent, "do not determine the unit of w"),
        (Foreign, "mystery"),
    ],
)
def test_laws_without_consistent_units_are_refused(kind, message):
    with pytest.raises(ParameterError, match=message):
        law_dimensions(kind(gains=dict.fromkeys("abcw", "1")))
