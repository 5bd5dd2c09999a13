"""What the sliding-mode laws share: homogeneity, λ, the divisor, and the loop in e1, e2, e3."""

from fractions import Fraction as F

import numpy as np
import pytest
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.laws import Signals, SlidingMode, control_law, control_laws
from quakedesign.symbolic.casadi_printer import to_numpy

GAINS = {"cta": ("7", "5", "2.3", "1.1"), "dia": ("2", "5", "1.44", "0.3")}
LAWS = sorted(name for name, law in control_laws().items() if issubclass(law, SlidingMode))
E1, E2, XI = sp.symbols("a b c", real=True)


def signed(value, power):
    return np.sign(value) * np.abs(value) ** power


def by_hand(name, scale):
    """ν and ξ1' of eqs. cta and dia as functions of e1, e2, ξ1, typed in from the paper."""
    k1, k2, k3, k4 = map(float, GAINS[name])

    def cta(a, b, c):
        nu = -(scale ** (2 / 3)) * k1 * signed(a, 1 / 3) - scale**0.5 * k2 * signed(b, 0.5) + c
        return nu, -scale * k3 * np.sign(a) - scale * k4 * np.sign(b)

    def dia(a, b, c):
        nu = -(scale**0.5) * k2 * signed(signed(b, 1.5) + scale**0.5 * k1**1.5 * a, 1 / 3) + c
        return nu, -scale * k3 * np.sign(a + scale**-0.5 * k4 * signed(b, 1.5))

    return {"cta": cta, "dia": dia}[name]


def ours(name, scale, at):
    law = control_law(name)
    gains = [sp.Rational(g) for g in GAINS[name]]
    nu = law.virtual_control(E1, E2, XI, gains, sp.Rational(scale))
    rate = law.integral_rate(E1, E2, gains, sp.Rational(scale))
    return np.array([float(v) for v in to_numpy([nu, rate], dict(zip((E1, E2, XI), at, strict=True)))])


def with_roots(loop, values):
    """Values of gains and of the roots that stand for √gain."""
    return values | {root: np.sqrt(values[of]) for root, of in loop.roots.items()}


POINTS = np.random.default_rng(7).uniform(-2, 2, (12, 3))


@pytest.mark.parametrize("scale", ["1", "500", "1/9"])
@pytest.mark.parametrize("name", LAWS)
def test_the_law_is_that_of_the_paper(name, scale):
    for at in POINTS:
        assert ours(name, scale, at) == pytest.approx(by_hand(name, float(F(scale)))(*at), rel=1e-12)


@pytest.mark.parametrize("scale", [64.0, 0.001, 500.0])
@pytest.mark.parametrize("name", LAWS)
def test_stretching_the_errors_maps_the_loop_onto_itself(name, scale):
    # z = λe, ζ = λξ: z' and ζ' are λ times the loop with λ = 1 (the paper's "linear change of variables")
    for at in POINTS:
        stretched = ours(name, str(F(scale)), np.multiply(scale, at))
        assert stretched == pytest.approx(scale * ours(name, "1", at), rel=1e-12)


def test_the_printed_closed_loop_of_the_dia_does_not_scale():
    # ERRATA 5: λ^{1/3} in place of λ^{1/2} before k_I1^{3/2} e1
    k1, k2 = 2.0, 5.0

    def printed(scale, a, b):
        return -(scale**0.5) * k2 * signed(signed(b, 1.5) + scale ** (1 / 3) * k1**1.5 * a, 1 / 3)

    a, b, scale = 0.4, -0.3, 64.0
    assert printed(scale, scale * a, scale * b) != pytest.approx(scale * printed(1, a, b), rel=0.1)
    right = ours("dia", "64", (scale * a, scale * b, 0.0))[0]
    assert right == pytest.approx(scale * printed(1, a, b), rel=1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_the_loop_is_homogeneous_with_the_weights_and_degree_minus_one(name):
    loop = control_law(name).loop_field()
    assert list(loop.states.values()) == [3, 2, 1]
    values = with_roots(loop, dict(zip(loop.gains, map(float, GAINS[name]), strict=True)))
    values |= dict.fromkeys(loop.uncertain, 0.7)
    epsilon = 0.3
    for at in POINTS:
        near = {s: epsilon**w * v for (s, w), v in zip(loop.states.items(), at, strict=True)}
        far = dict(zip(loop.states, at, strict=True))
        for state, rate in loop.field.items():
            small, large = (float(to_numpy([rate], values | point)[0]) for point in (near, far))
            assert small == pytest.approx(epsilon ** (loop.states[state] - 1) * large, rel=1e-10)


@pytest.mark.parametrize("name", LAWS)
def test_the_loop_is_that_of_the_paper(name):
    # eqs. clsystem1 and clsystem2 with λ = 1: e1' = e2, e2' = β(ν without ξ1 + e3), e3' = ξ1' + h'
    loop = control_law(name).loop_field()
    beta, d = 1.3, -0.2
    values = with_roots(loop, dict(zip(loop.gains, map(float, GAINS[name]), strict=True)))
    values |= dict(zip(loop.uncertain, (beta, d), strict=True))
    # a state may stand for an error in another unit, as f1 = k_I1^{3/2} e1 does
    units = np.array([float(to_numpy([sp.sympify(loop.units.get(s, 1))], values)[0]) for s in loop.states])
    for a, b, c in POINTS:
        at = dict(zip(loop.states, (a, b, c) / units, strict=True))
        found = np.array([float(v) for v in to_numpy(list(loop.field.values()), values | at)])
        nu, rate = by_hand(name, 1.0)(a, b, c)
        assert found * units == pytest.approx([b, beta * nu, rate + d], rel=1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_other_scales_keep_the_base_gains(name):
    controller = control_law(name).from_values(GAINS[name], divisor="4/1385")
    scaled = controller.scaled(F(64))
    assert scaled.scale == 64
    assert scaled.gains == controller.gains
    assert scaled.divisor == F(4, 1385)
    assert controller.scale == 1


@pytest.mark.parametrize("name", LAWS)
def test_the_pressure_is_the_virtual_control_over_the_divisor(name):
    signals = Signals(slip=E1, slip_rate=E2, slip_error=E1, slip_rate_error=E2, integrals=(XI,))
    controller = control_law(name).from_values(GAINS[name], divisor="4/1385", scale="500")
    for at in POINTS[:4]:
        (found,) = to_numpy([controller.pressure(signals)], dict(zip((E1, E2, XI), at, strict=True)))
        assert float(found) == pytest.approx(by_hand(name, 500.0)(*at)[0] * 1385 / 4, rel=1e-12)


@pytest.mark.parametrize("value", ["0", "-1", "nan", "1/0"])
@pytest.mark.parametrize("what", ["scale", "divisor"])
@pytest.mark.parametrize("name", LAWS)
def test_scale_and_divisor_are_positive(name, what, value):
    with pytest.raises(ParameterError, match=f"^{what} must be "):
        control_law(name).from_values(GAINS[name], **{what: value})


def test_necessary_bounds_of_the_errata():
    # ERRATA, end: 2-CTA λ(k3 − |k4|), 2-DIA λk_I3; ERRATA 15: 0.118 and 0.1955 with the published gains
    cta, dia = (control_law(name) for name in ("cta", "dia"))
    assert cta.from_values(("1", "1", "4.51e-4", "2.15e-4"), scale=500).lipschitz_limit == F("0.118")
    assert cta.from_values(("1", "1", "3", "-1")).lipschitz_limit == 2
    assert dia.from_values(("1", "1", "3.91e-4", "0"), scale=500).lipschitz_limit == F("0.1955")
