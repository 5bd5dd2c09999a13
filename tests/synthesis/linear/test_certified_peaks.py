"""Certified peaks of whole faults, against the faults themselves: friction law, moving reference, bad forces."""

import json
from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.certificates import Verdict
from quakedesign.certificates.linear_premises import sectors
from quakedesign.certificates.tracking import disturbance_inputs, reference_rates, tracking_inputs
from quakedesign.controllers import published
from quakedesign.controllers.elqr import PressureLimits
from quakedesign.errors import CertificateError, ParameterError, UnknownNameError
from quakedesign.fault import Disturbance
from quakedesign.synthesis.linear.certified_peaks import certified_peaks, loop_for
from quakedesign.synthesis.linear.design.riccati import riccati_design
from quakedesign.synthesis.linear.disturbance_search import bang_bang, rate_limited, switched


@pytest.fixture(scope="module")
def real():
    return qd.load_fault("real-fault")


@pytest.fixture(scope="module")
def designed(real):
    return riccati_design(real).controller


@pytest.fixture(scope="module")
def peaks(real, designed):
    return {kind: certified_peaks(real, designed, disturbance_class=kind) for kind in ("amplitude", "rate")}


def test_the_amplitude_class_is_certified_within_a_factor_four_of_what_was_found(real, designed, peaks):
    loop, a = loop_for(real, designed), real.disturbance.largest_explicit
    worst = max(bang_bang(loop, corner, a, "slip_rate_error").peak for corner in loop.corners())
    certified = float(peaks["amplitude"].peak_slip_rate)
    assert worst < certified < 4 * worst
    assert switched(loop, a, "slip_rate_error").peak < certified


def test_the_rate_limited_class_is_certified_within_a_factor_ten_of_what_was_found(real, designed, peaks):
    loop, force = loop_for(real, designed), real.disturbance
    a, change = force.largest_explicit, force.largest_rate
    worst = max(rate_limited(loop, corner, a, change, "slip_rate_error").peak for corner in loop.corners())
    assert worst < float(peaks["rate"].peak_slip_rate) < 10 * worst
    assert peaks["rate"].peak_slip_rate < peaks["amplitude"].peak_slip_rate / 2


def test_every_bound_checks_and_a_changed_one_does_not(peaks):
    for found in peaks.values():
        assert found.check() is Verdict.PROVED
        key, bound = next(iter(found.bounds.items()))
        forged = replace(found, bounds={**found.bounds, key: replace(bound, bound=bound.bound / 2)})
        with pytest.raises(CertificateError):
            forged.check()


def test_bounds_belong_to_one_fault_one_controller_and_one_class(real, designed, peaks):
    for found in peaks.values():
        found.require_cover(real, designed)
        weaker = replace(found, bounds={k: b for k, b in found.bounds.items() if k[0] != "disturbance"})
        for changed, fault, controller in (
            (weaker, real, designed),
            (found, real.with_box("ten-percent"), designed),
            (found, real.with_disturbance(replace(real.disturbance, amplitude=4e-4)), designed),
            (found, real, published("real-fault")["elqr"]),
            (replace(found, reference_rate=found.reference_rate / 2), real, designed),
        ):
            with pytest.raises(CertificateError):
                changed.require_cover(fault, controller)
    with pytest.raises(CertificateError):
        replace(peaks["rate"], disturbance_class="amplitude").require_cover(real, designed)


def test_the_rates_of_the_reference_are_those_of_the_polynomial(real):
    # s³(10 − 15s + 6s²): 15/8 at s = 1/2, 10/√3 at (1 − 1/√3)/2, 60 at the ends
    rates, d, T = reference_rates(real), real.reference.target_slip, real.reference.operation_time
    for value, exact in (
        (rates.first, 15 / 8 * d / T),
        (rates.second, 10 / 3**0.5 * d / T**2),
        (rates.third, 60 * d / T**3),
    ):
        assert exact * (1 - 1e-12) <= float(value) < exact * 1.01


def test_the_inputs_of_the_reference_cover_dense_samples(real):
    # p*(r(t)) with the law of the preset, differentiated numerically; force with η̂r′
    law = published("real-fault")["elqr"]
    bounds = tracking_inputs(real, law, sectors(real))
    T, d = real.reference.operation_time, real.reference.target_slip
    s = np.linspace(0, 1, 20001)
    r, r1 = d * s**3 * (10 - 15 * s + 6 * s**2), d / T * 30 * s**2 * (1 - s) ** 2
    r2, r3 = d / T**2 * 60 * s * (1 - s) * (1 - 2 * s), d / T**3 * 60 * (1 - 6 * s + 6 * s**2)
    friction = real.friction
    mu = friction.residual + friction.drop * np.exp(-r / friction.critical_slip)
    N, sigma = real.authority, real.effective_normal_stress
    top = (mu - mu[0]) * N * sigma + (real.specific_stiffness - real.disturbance.slip_growth) * r
    drift = np.gradient(top / (mu * N), s * T)
    assert np.abs(drift).max() < float(bounds["drift"])
    assert np.abs(-r2 - real.specific_damping * r1).max() < float(bounds["force"]) * (1 + 1e-12)
    k1, k2 = float(law.gains["k1"]), float(law.gains["k2"])
    assert np.abs(k1 * r2 + k2 * r3).max() < float(bounds["drift_rate"])
    assert "drift_rate" not in tracking_inputs(real, replace(law, feedback="error"), sectors(real))


def test_a_quiet_fault_has_only_what_the_reference_causes(real, designed):
    quiet = real.with_disturbance(Disturbance())
    assert disturbance_inputs(quiet, True) == {}
    found = certified_peaks(quiet, designed, outputs=("slip_rate_error",))
    assert {name for name, _ in found.bounds} == {"reference_force", "reference_drift"}
    assert found.peak_slip_rate < 2 * found.reference_rate


def test_a_constant_disturbance_has_no_rate(real):
    constant = real.with_disturbance(Disturbance(constant=-2e-4))
    assert disturbance_inputs(constant, True) == {"force": F(1, 5000)}


def test_the_facts_are_plain_and_exact(peaks):
    facts = json.loads(json.dumps(peaks["amplitude"].to_dict()))
    assert F(facts["peak_slip_rate"]) == peaks["amplitude"].peak_slip_rate
    assert F(facts["slip_error"]) == peaks["amplitude"].total("slip_error")
    assert facts["premises"]


def test_the_pressure_has_a_certified_range_and_limits_count_only_where_it_reaches_them(real, designed, peaks):
    low, high = peaks["amplitude"].pressure.low, peaks["amplitude"].pressure.high
    # p* of the preset's own law, on a grid
    slip = np.linspace(0, real.reference.target_slip, 2001)
    mu = real.friction.residual + real.friction.drop * np.exp(-slip / real.friction.critical_slip)
    N = real.authority
    spring = (real.specific_stiffness - real.disturbance.slip_growth) * slip
    rest = ((mu - mu[0]) * N * real.effective_normal_stress + spring) / (mu * N)
    assert float(low) < rest.min() < rest.max() < float(high) < real.effective_normal_stress
    wide = replace(designed, limits=PressureLimits(lowest=low - 1, highest=high + 1))
    found = certified_peaks(real, wide, outputs=("pressure_offset",))
    assert found.pressure == peaks["amplitude"].pressure
    found.require_cover(real, wide)
    tight = replace(designed, limits=PressureLimits(lowest=low + 1, highest=high + 1))
    assert certified_peaks(real, tight, outputs=("pressure_offset",)) is None
    unknown = replace(found, bounds={k: b for k, b in peaks["amplitude"].bounds.items() if k[1] != "pressure_offset"})
    assert unknown.pressure is None
    assert not unknown.within(wide.limits)
    with pytest.raises(CertificateError, match="limit of the law"):
        found.require_cover(real, tight)
    with pytest.raises(ParameterError, match="starts with p = 0"):
        certified_peaks(real, replace(designed, offset=F(10)))


def test_an_unknown_class_and_an_unstable_loop(real, designed):
    with pytest.raises(UnknownNameError, match=r"amplitude, rate\. Received 'any'"):
        certified_peaks(real, designed, disturbance_class="any")
    bad = replace(designed, gains={n: -k for n, k in designed.gains.items()})
    assert certified_peaks(real, bad) is None


class Plant:
    """The fault itself, vectorised over runs: friction laws inside the box, any force, feedback on errors or the state.

    Friction weakens along a broken line or an exponential; r(t) starts at a chosen stage with everything in balance.
    """

    def __init__(self, fault, controller, stage, runs, rng):
        self.fault, self.controller, self.stage = fault, controller, stage
        law = fault.friction
        self.res, self.drop, self.slope = law.residual, law.drop, law.drop / law.critical_slip
        self.width = rng.choice([1e-7, 1e-6, 1e-5, 1e-3], size=runs)
        self.flat = rng.integers(0, 3, size=runs)
        self.centre = self.reference(0.0)[0]
        self.k = rng.choice([1 - float(fault.box.stiffness), 1 + float(fault.box.stiffness)], size=runs)
        self.eta = rng.choice([1 - float(fault.box.damping), 1 + float(fault.box.damping)], size=runs)
        self.N = rng.choice([1 - float(fault.box.authority), 1 + float(fault.box.authority)], size=runs)

    def reference(self, t):
        T, d = self.fault.reference.operation_time, self.fault.reference.target_slip
        s = self.stage + t / T
        return (
            d * s**3 * (10 - 15 * s + 6 * s**2),
            d / T * 30 * s**2 * (1 - s) ** 2,
        )

    def friction(self, slip):
        """Weakening function: the law, or saw-like steps of slope 0 and the largest slope about the start."""
        base = self.res + self.drop * np.exp(-np.maximum(slip, 0) / self.fault.friction.critical_slip)
        u = (slip - self.centre) / self.width
        wave = self.slope * self.width * (np.floor(u) + np.minimum(2 * (u - np.floor(u)), 1)) / 2
        centre = self.res + self.drop * np.exp(-self.centre / self.fault.friction.critical_slip)
        stairs = np.clip(centre - wave, self.res, self.res + self.drop)
        steep = np.clip(centre - self.slope * (slip - self.centre), self.res, self.res + self.drop)
        return np.choose(self.flat, [base, stairs, steep])

    def balance(self):
        """p* at the start."""
        mu, r, f = self.friction(self.centre), self.centre, self.fault
        static = self.res + self.drop
        N = f.authority * self.N
        return (
            (mu - static) * N * f.effective_normal_stress
            + (f.specific_stiffness * self.k - f.disturbance.slip_growth) * r
        ) / (mu * N)

    def run(self, force, step, count):
        k1, k2, k3, k4 = (float(v) for v in self.controller.gains.values())
        f, held = self.fault, self.controller.feedback == "state"
        N = f.authority * self.N
        r0, v0 = self.reference(0.0)
        e1, e2 = np.zeros(len(self.k)), np.zeros(len(self.k))
        fed = k1 * r0 + k2 * v0 if held else 0.0
        xi2 = (-self.balance() - fed) / k4
        xi1 = np.zeros(len(self.k))
        top = np.zeros((2, len(self.k)))

        def rates(t, y, push):
            e1, e2, xi1, xi2 = y
            r, v = self.reference(t)
            slip, rate = e1 + r, e2 + v
            p = -k1 * (slip if held else e1) - k2 * (rate if held else e2) - k3 * xi1 - k4 * xi2
            mu = self.friction(slip)
            acceleration = (
                -mu * N * (f.effective_normal_stress - p)
                + (self.res + self.drop) * N * f.effective_normal_stress
                - f.specific_stiffness * self.k * slip
                - f.specific_damping * self.eta * rate
                + f.disturbance.slip_growth * slip
                + push
            )
            return np.array([e2, acceleration, e1, xi1])

        y = np.array([e1, e2, xi1, xi2])
        for n in range(count):
            t, push = n * step, force(n * step)
            a = rates(t, y, push)
            b = rates(t + step / 2, y + step / 2 * a, push)
            c = rates(t + step / 2, y + step / 2 * b, push)
            d = rates(t + step, y + step * c, push)
            y = y + step / 6 * (a + 2 * b + 2 * c + d)
            top = np.maximum(top, np.abs(y[:2]))
        return top


@pytest.mark.parametrize("box", ["paper", pytest.param("ten-percent", marks=pytest.mark.slow)])
def test_no_attack_on_the_fault_itself_exceeds_the_bound(real, designed, box):
    fault = real.with_box(box)
    found = certified_peaks(fault, designed, outputs=("slip_error", "slip_rate_error"))
    loop, a = loop_for(fault, designed), fault.disturbance.largest_explicit
    worst = max((bang_bang(loop, c, a, "slip_rate_error") for c in loop.corners()), key=lambda w: w.peak)
    rng, step = np.random.default_rng(11), 0.04
    tops = []
    for stage in (0.05, 0.5):
        plant = Plant(fault, designed, stage, 60, rng)
        flips = rng.uniform(0.3, 12, size=60)

        def bang(t, flips=flips, worst=worst):
            n = int(t / worst.step)
            pulse = worst.force[n] if n < len(worst.force) else 0.0
            return np.where(np.arange(60) % 2 == 0, pulse, a * np.sign(np.sin(2 * np.pi * t / flips)))

        tops.append(plant.run(bang, step, int(min(len(worst.force) * worst.step, 30) / step)))
    top = np.max([t.max(axis=1) for t in tops], axis=0)
    assert top[0] < float(found.total("slip_error"))
    assert 0.3 * worst.peak < top[1] < float(found.total("slip_rate_error"))


@pytest.mark.parametrize("kind", ["amplitude", "rate"])
def test_the_sine_of_the_preset_stays_within_both_classes(real, designed, peaks, kind):
    plant = Plant(real, designed, 0.4, 3, np.random.default_rng(2))
    shaking = real.disturbance
    top = plant.run(lambda t: shaking.amplitude * np.sin(shaking.frequency * t), 0.04, 700).max(axis=1)
    assert top[0] < float(peaks[kind].total("slip_error"))
    assert top[1] < float(peaks[kind].total("slip_rate_error"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["real-fault", "lab-fault"])
@pytest.mark.parametrize("box", ["paper", "ten-percent"])
def test_many_attacks_with_random_switching_never_exceed_the_bounds(name, box):
    fault = qd.load_fault(name, box=box)
    controller = riccati_design(fault).controller
    loop, a = loop_for(fault, controller), fault.disturbance.largest_explicit
    found = certified_peaks(fault, controller)
    vertices = np.array(loop.polytope().floats())
    rng, pace = np.random.default_rng(5), fault.natural_frequency
    x, top = np.zeros((400, 4)), np.zeros((3, 400))
    rows = np.array([[float(v) for v in row] for row in loop.outputs().values()])
    spans, step = rng.uniform(0.05, 3, size=400) / pace, 0.01 / pace
    which, sign = rng.integers(len(vertices), size=400), np.ones(400)
    for n in range(12000):
        fresh = rng.random(400) < step / spans
        which = np.where(fresh, rng.integers(len(vertices), size=400), which)
        sign = np.where(rng.random(400) < step / spans, -sign, sign)
        M = vertices[which]
        push = np.zeros((400, 4))
        push[:, 1] = a * sign

        def rate(y, M=M, push=push):
            return np.einsum("nij,nj->ni", M, y) + push

        k1 = rate(x)
        k2 = rate(x + step / 2 * k1)
        k3 = rate(x + step / 2 * k2)
        x = x + step / 6 * (k1 + 2 * k2 + 2 * k3 + rate(x + step * k3))
        top = np.maximum(top, np.abs(rows @ x.T))
        assert n < 12000
    for output, reached in zip(loop.outputs(), top.max(axis=1), strict=True):
        assert reached < float(found.bounds["disturbance", output].bound)
