"""Verdicts with margins, for every law of the package and for laws of a user."""

import math
import random
from dataclasses import dataclass, field, replace
from fractions import Fraction as F
from typing import ClassVar

import mpmath
import pytest
import sympy as sp
from thinned import few

from quakedesign import derive
from quakedesign.errors import ParameterError
from quakedesign.fault import FrictionLaw, friction_law, friction_laws, load_fault
from quakedesign.symbolic.rate_and_state_plant import operating_rate
from quakedesign.symbolic.stability import Stability, critical_stiffness, nucleation_length, stability

VALUES = {
    "residual": 0.3,
    "drop": 0.1,
    "critical_slip": 0.02,
    "critical_rate": 0.02,
    "reference_coefficient": 0.6,
    "direct_effect": 0.011,
    "evolution_effect": 0.016,
    "reference_rate": 1e-6,
    "slowest_rate": 1e-9,
    "fastest_rate": 1e-1,
}
REAL = load_fault("real-fault")
A, B, D, STRESS = 0.011, 0.016, 0.02, 50e6


def fault_with(name, **options):
    kind = friction_law(name)
    return replace(REAL, friction=kind(**{q: VALUES[q] for q in kind.quantities() if q in VALUES}, **options))


def with_stiffness(fault, stiffness):
    """Same mass, area and damping ratio of forces, another stiffness: only G changes."""
    return replace(fault, shear_modulus=stiffness / fault.length)


AGING, SLIP, REGULAR = (
    fault_with(f"{n}") for n in ("rate-and-state-aging", "rate-and-state-slip", "regularised-rate-and-state")
)
STATEFUL = [AGING, SLIP, REGULAR, fault_with("regularised-rate-and-state", evolution="slip")]


@dataclass(frozen=True, kw_only=True)
class FlashHeating(FrictionLaw):
    """A user's law without state: μ = low + (high − low)·v_w/(v + v_w) above the weakening rate, with a power."""

    name: ClassVar[str] = "users-flash-heating"
    source: ClassVar[str] = "after Rice (2006), J. Geophys. Res. 111, B05311"
    domain: ClassVar[str] = "rate >= 0"
    slip_slope = 0.0

    high: float = field(metadata={"unit": "", "symbol": "f_h"})
    low: float = field(metadata={"unit": "", "symbol": "f_l"})
    weakening_rate: float = field(metadata={"unit": "m/s", "symbol": "v_w"})
    power: float = field(metadata={"unit": "", "symbol": "n"})

    def coefficient(self, slip, rate):
        return self.low + (self.high - self.low) * (1 + rate / self.weakening_rate) ** (-self.power)

    extended = coefficient

    @property
    def bounds(self):
        return self.low, self.high

    @property
    def rate_slope(self):
        return (self.high - self.low) * self.power / self.weakening_rate


@dataclass(frozen=True, kw_only=True)
class PerrinRiceZheng(FrictionLaw):
    """A user's law with state: θ' = 1 − (vθ/2d_c)² (Perrin, Rice and Zheng 1995, J. Mech. Phys. Solids 43, 1461)."""

    name: ClassVar[str] = "users-perrin-rice-zheng"
    source: ClassVar[str] = "Perrin, Rice and Zheng (1995)"
    domain: ClassVar[str] = "rate > 0"
    state_names: ClassVar[tuple[str, ...]] = ("theta",)
    state_units: ClassVar[tuple[str, ...]] = ("s",)
    bounds = (0.2, 1.0)
    slip_slope = 1.0
    rate_slope = 1.0
    operating_rate = 1e-6

    direct: float = field(metadata={"unit": "", "symbol": "a"})
    evolution: float = field(metadata={"unit": "", "symbol": "b"})
    length: float = field(metadata={"unit": "m", "symbol": "L"})

    def coefficient(self, slip, rate, *state):
        (theta,) = state
        return (
            sp.Rational(3, 5)
            + self.direct * sp.log(rate * 10**6)
            + self.evolution * sp.log(theta / self.length / 10**6)
        )

    extended = coefficient

    def state_rates(self, slip, rate, *state):
        return (1 - (rate * state[0] / (2 * self.length)) ** 2,)

    def steady_state(self, rate):
        return (2 * self.length / rate,)


@pytest.mark.parametrize("name", sorted(friction_laws()))
def test_every_law_has_a_verdict_with_and_without_inertia(name):
    for inertia in (True, False):
        verdict = stability(fault_with(name), inertia=inertia)
        assert verdict.outcome in Stability
        assert all(-1 <= c.margin[0] <= c.margin[1] <= 1 for c in verdict.conditions)
        assert verdict._repr_latex_().startswith("$")


def test_the_real_fault_is_unstable_by_an_exact_margin():
    # k_c/A = Δμσ'/d_c and k/A = G/L, in rationals
    k, critical = F(30 * 10**9, 5000), F(1, 10) * 50 * 10**6 / F("0.27635")
    verdict = stability(REAL)
    assert verdict.outcome is Stability.UNSTABLE
    assert verdict.margin == ((k - critical) / (k + critical),) * 2
    assert all(c.exact for c in verdict.conditions)
    assert critical_stiffness(REAL) == pytest.approx(float(critical) * 5000**2, rel=1e-14)
    assert nucleation_length(REAL) == pytest.approx(30e9 / float(critical), rel=1e-14)


@few("fault", STATEFUL, ids=lambda fault: fault.friction.name, every=2)
@pytest.mark.parametrize("inertia", [True, False])
def test_the_verdict_turns_at_the_critical_stiffness_and_its_margin_says_how_far(fault, inertia):
    at = critical_stiffness(fault, inertia=inertia)
    for factor in (0.5, 1 - 1e-9, 1 + 1e-9, 2):
        verdict = stability(with_stiffness(fault, at * factor), inertia=inertia)
        assert verdict.outcome is (Stability.STABLE if factor > 1 else Stability.UNSTABLE)
        assert float(verdict.margin[0]) == pytest.approx((factor - 1) / (factor + 1), rel=1e-5)
        assert verdict.margin[1] - verdict.margin[0] < F(1, 10**12)


@pytest.mark.parametrize("fault", [AGING, SLIP], ids=lambda fault: fault.friction.name)
def test_quasi_dynamic_critical_stiffness_is_that_of_ruina(fault):
    undamped = replace(fault, damping=0.0)
    per_area = (B - A) * STRESS / D
    assert critical_stiffness(undamped, inertia=False) == pytest.approx(per_area * fault.area, rel=1e-13)
    assert nucleation_length(fault) == pytest.approx(fault.shear_modulus / per_area, rel=1e-13)


def test_inertia_counts_at_high_rates():
    # Rice and Ruina (1983): k_c = (b − a)σ/d_c · (1 + m v²/(σ a d_c)) without damping, m per area
    undamped = replace(AGING, damping=0.0)
    v, mass = 0.1, AGING.density * AGING.length
    expected = (B - A) * STRESS / D * (1 + mass * v**2 / (STRESS * A * D))
    assert critical_stiffness(undamped, loading_rate=v) == pytest.approx(expected * AGING.area, rel=1e-13)
    assert critical_stiffness(undamped, loading_rate=v) > 1.5 * critical_stiffness(undamped, loading_rate=1e-6)


def test_exactly_critical_is_undecided_and_says_zero():
    # (b − a)σ'/d_c = 12.5 MPa/m is G/L for G = 62.5 GPa; no damping, no mass
    verdict = stability(replace(AGING, damping=0.0, shear_modulus=62.5e9), inertia=False)
    assert verdict.outcome is Stability.UNDECIDED
    assert verdict.margin == (0, 0)


def test_velocity_strengthening_is_stable_for_every_stiffness():
    law = replace(AGING.friction, evolution_effect=0.005)
    fault = replace(AGING, friction=law)
    assert stability(with_stiffness(fault, 1.0)).outcome is Stability.STABLE
    assert critical_stiffness(fault) < 0
    assert nucleation_length(fault) == math.inf


@few("name", sorted(set(friction_laws()) - {"slip-rate-weakening"}), every=3)
def test_withdrawal_raises_the_softening_and_injection_lowers_it(name):
    # ERRATA 1: the critical stiffness goes with σ' − p
    fault = replace(fault_with(name), damping=0.0)
    least, middle, most = (critical_stiffness(fault, pressure=p, inertia=False) for p in (25e6, 0, -25e6))
    assert (least / middle, most / middle) == pytest.approx((0.5, 1.5), rel=1e-9)
    between = with_stiffness(fault_with(name), (middle + most) / 2)
    assert stability(between, inertia=False, pressure=-25e6).outcome is Stability.UNSTABLE
    assert stability(replace(between, damping=5e14), inertia=False).outcome is Stability.STABLE


def test_slip_rate_weakening_is_a_matter_of_damping():
    # η̂ against N̂(σ' − p)·drop/v_c, whatever the stiffness
    fault = fault_with("slip-rate-weakening")
    limit = 0.1 / 0.02 * STRESS * fault.area
    for factor, outcome in ((0.999, Stability.UNSTABLE), (1.001, Stability.STABLE)):
        damped = replace(fault, damping=limit * factor)
        assert stability(damped).outcome is outcome
        assert stability(with_stiffness(damped, damped.stiffness * 1e3)).outcome is outcome
    assert critical_stiffness(fault) == 0


@few("fault", STATEFUL, ids=lambda fault: fault.friction.name, every=4)
def test_over_a_range_of_pressure_the_verdict_holds_everywhere(fault):
    critical = critical_stiffness(fault)
    stiff, soft, middling = (with_stiffness(fault, critical * f) for f in (1.6, 0.4, 1.0))
    over = {"pressure": (-25e6, 25e6)}
    assert stability(stiff, **over).outcome is Stability.STABLE
    assert stability(soft, **over).outcome is Stability.UNSTABLE
    assert stability(middling, **over).outcome is Stability.UNDECIDED
    for p in (-25e6, 0, 25e6):
        low, high = stability(stiff, **over).margin
        point = stability(stiff, pressure=p).margin
        assert low <= point[0] <= point[1] <= high


def test_over_the_uncertainty_box_a_narrow_verdict_becomes_undecided():
    fault = with_stiffness(AGING, critical_stiffness(AGING) * 1.1).with_box("ten-percent")
    assert stability(fault).outcome is Stability.STABLE
    assert stability(fault, uncertain=True).outcome is Stability.UNDECIDED
    assert stability(with_stiffness(fault, critical_stiffness(fault) * 1.3), uncertain=True).outcome is Stability.STABLE


def eigenvalues(fault, v):
    """Largest real part [1/s] at fifty digits, the Jacobian of rate and state typed in from Ruina (1983)."""
    with mpmath.workdps(50):
        a, b, d = (
            mpmath.mpf(str(getattr(fault.friction, n))) for n in ("direct_effect", "evolution_effect", "critical_slip")
        )
        v, S = mpmath.mpf(str(v)), mpmath.mpf(fault.effective_normal_stress) / fault.density / fault.length
        k, eta = (mpmath.mpf(x) / mpmath.mpf(fault.mass) for x in (fault.stiffness, fault.damping))
        J = mpmath.matrix([[0, 1, 0], [-k, -eta - S * a / v, -S * b * v / d], [0, -1 / v, -v / d]])
        found = [complex(z) for z in mpmath.eig(J, left=False, right=False)]
        return sorted(found, key=lambda z: (-z.real, -z.imag))


@pytest.mark.slow
def test_random_faults_are_stable_exactly_when_their_eigenvalues_say_so():
    draw, seen = random.Random(11), {True: 0, False: 0}
    for i in range(30):
        law = replace(
            (AGING, SLIP)[i % 2].friction,
            direct_effect=draw.uniform(0.005, 0.016),
            critical_slip=10 ** draw.uniform(-3, -1),
        )
        v = 10 ** draw.uniform(-8, -1.1)
        fault = replace(AGING, friction=law, damping=10 ** draw.uniform(8, 15))
        critical = critical_stiffness(fault, loading_rate=v)
        if critical > 0:
            fault = with_stiffness(fault, critical * draw.choice([1 - 1e-6, 1 + 1e-6, 0.3, 3]))
        stable = eigenvalues(fault, v)[0].real < 0
        assert stability(fault, loading_rate=v).outcome is (Stability.STABLE if stable else Stability.UNSTABLE)
        seen[stable] += 1
    assert min(seen.values()) >= 8


@few("fault", [AGING, SLIP], ids=lambda fault: fault.friction.name, every=2)
def test_the_model_of_a_law_with_state_is_that_of_the_closed_form(fault):
    soft = with_stiffness(fault, critical_stiffness(fault) * 0.7)
    model = derive(soft)
    assert model.unstable
    assert len(model.reasons) == 1
    assert "stiffness of the spring is below its critical value" in model.reasons[0]
    assert model.eigenvalues == pytest.approx(eigenvalues(soft, 1e-6), rel=1e-12)
    assert model.jacobian.shape == (3, 3)
    assert not model.jacobian.subs(model.values).free_symbols
    assert {"theta", "v"} <= {s.name for s in model.acceleration.free_symbols}
    assert r"\begin{aligned}" in model._repr_latex_()
    stiff = derive(with_stiffness(fault, critical_stiffness(fault) * 1.3))
    assert not stiff.unstable
    assert stiff.reasons == ()


def test_the_model_without_state_is_what_it_was():
    model = derive(REAL)
    k, eta, softening = 0.48, 1.6, 0.1 * 50e6 / 0.27635 / 2500 / 5000
    root = math.sqrt(eta**2 / 4 + softening - k)
    assert model.eigenvalues == pytest.approx([-eta / 2 + root, -eta / 2 - root], rel=1e-12)
    assert model.unstable
    assert "the spring unloads more slowly" in model.reasons[0]


def test_a_users_law_without_state_goes_through_derive_and_stability():
    law = FlashHeating(high=0.6, low=0.2, weakening_rate=0.1, power=1.5)
    fault = replace(REAL, friction=law)
    limit = 0.4 * 1.5 / 0.1 * STRESS * fault.area
    for factor in (0.99, 1.01):
        damped = replace(fault, damping=limit * factor)
        assert derive(damped).unstable is (factor < 1)
        assert float(stability(damped).margin[0]) == pytest.approx((factor - 1) / (factor + 1), rel=1e-9)
        # sliding at v_w, the slope is 2^−2.5 of that
        slower = replace(fault, damping=limit * factor * 2**-2.5)
        moving = stability(slower, loading_rate="0.1")
        assert moving.outcome is (Stability.UNSTABLE if factor < 1 else Stability.STABLE)


@pytest.mark.slow
def test_a_users_law_with_state_goes_through_derive_and_stability():
    # about steady sliding θ' has slope −v/d_c again, and −1/v·2/2 in v: the critical stiffness of Ruina
    law = PerrinRiceZheng(direct=A, evolution=B, length=D)
    fault = replace(REAL, friction=law, damping=0.0)
    assert critical_stiffness(fault, inertia=False) == pytest.approx((B - A) * STRESS / D * fault.area, rel=1e-13)
    at = critical_stiffness(fault)
    for factor in (0.9, 1.1):
        model = derive(with_stiffness(fault, at * factor))
        assert model.unstable is (factor < 1)
        assert (model.eigenvalues[0].real > 0) is (factor < 1)
        assert bool(model.reasons) is (factor < 1)
        assert model._repr_latex_()


def test_a_pressure_that_opens_the_fault_is_refused():
    with pytest.raises(ParameterError, match=r"pressure must be below the effective normal stress .*At this stress"):
        stability(REAL, pressure=50e6)
    with pytest.raises(ParameterError, match="range must ascend"):
        stability(REAL, pressure=(1e6, -1e6))


def test_a_loading_rate_outside_of_the_working_range_is_refused():
    for rate in (0, 1e-10, 1.0):
        with pytest.raises(ParameterError, match="loading_rate must be zero or positive and in the working range"):
            stability(AGING, loading_rate=rate)
    with pytest.raises(ParameterError, match="loading_rate must be zero for exponential-slip-weakening"):
        stability(REAL, loading_rate=1e-6)
    assert operating_rate(REAL) == 0
    assert operating_rate(AGING) == F(1, 10**6)
