"""Peaks in continuous time, against the faults themselves: friction law, moving reference, bad forces."""

import json
from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest
from scipy.linalg import expm
from thinned import few

import quakedesign as qd
from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.fault import Disturbance
from quakedesign.guarantees import CLASSES, ContinuousProof, NoProof, certified_peaks, worst_tracking
from quakedesign.laws import published
from quakedesign.laws.elqr import ExtendedLQR, PressureLimits
from quakedesign.lyapunov import Verdict

# gains that `design` gives for continuous time, box paper
GAINS = {
    "real-fault": ("2640677339", "523784305.9", "2647975129", "957074176.5"),
    "lab-fault": ("583425853.6", "628482.2814", "107744467200", "7172047093000"),
}


def law(name="real-fault"):
    return ExtendedLQR.from_values(GAINS[name])


@pytest.fixture(scope="module")
def real():
    return qd.load_fault("real-fault")


@pytest.fixture(scope="module")
def designed():
    return law()


@pytest.fixture(scope="module")
def peaks(real, designed):
    return {kind: certified_peaks(real, designed, disturbance_class=kind) for kind in CLASSES}


def of_disturbance(found, output):
    """What the disturbance alone may do: nothing of the reference; linear in H."""
    half, task = found.task.half_ranges, found.task
    A, b, rows = matrices(found)
    kernels = np.array([rows @ expm(A * t) @ b for t in np.arange(0, 40, 0.01)])
    gains = (np.abs(kernels).sum(axis=0) - np.abs(kernels[0]) / 2) * 0.01
    m = float(sum(h * F(g) for h, g in zip(half.values(), gains, strict=True)))
    return m, gains[output] * float(task.amplitude) / (1 - m)


def matrices(found):
    loop = found.loop
    A = np.array([[float(v) for v in row] for row in loop.flow])
    rows = np.array([[float(v) for v in row] for row in loop.outputs.values()])
    return A, np.array([float(v) for v in loop.inputs["acceleration"]]), rows


def test_the_real_fault_reaches_what_the_method_promises(peaks):
    """Ellipsoids certified 8.0e-5 m/s and 1.66e-5 m of the disturbance's part, 3.1e-5 m/s of the class rate."""
    found = peaks["amplitude"].claims
    assert found.slip_rate_error <= F("5.95e-5")
    assert found.slip_error <= F("1.58e-5")
    for output, bound in enumerate((1.55e-5, 5.9e-5)):
        m, part = of_disturbance(peaks["amplitude"], output)
        assert 0.25 < m < 0.27
        assert part < bound
        assert part < (found.slip_error, found.slip_rate_error)[output]
    assert peaks["rate"].claims.slip_rate_error <= F("2.3e-5")


@few("name", GAINS, every=2)
@pytest.mark.parametrize("kind", CLASSES)
def test_what_a_search_finds_is_below_and_near(name, kind):
    found = certified_peaks(qd.load_fault(name), law(name), disturbance_class=kind)
    seen = worst_tracking(found)
    assert found.check() is Verdict.PROVED
    assert seen.slip_error < found.claims.slip_error < 2 * seen.slip_error
    assert seen.slip_rate_error < found.claims.slip_rate_error < 1.5 * seen.slip_rate_error


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "box"),
    [("real-fault", "paper"), ("lab-fault", "ten-percent")]
    + [
        pytest.param(*other, marks=pytest.mark.slow)
        for other in (("real-fault", "ten-percent"), ("lab-fault", "paper"))
    ],
)
def test_gains_with_poles_that_are_far_apart_are_decided_too(name, box):
    """The published integrals are 10^6 times slower than the fastest pole."""
    gains = replace(published(name)["elqr"], feedback="error")
    found = {kind: certified_peaks(qd.load_fault(name, box=box), gains, disturbance_class=kind) for kind in CLASSES}
    assert found["rate"].claims.slip_rate_error <= found["amplitude"].claims.slip_rate_error
    assert worst_tracking(found["amplitude"]).slip_rate_error < found["amplitude"].claims.slip_rate_error


def test_a_quiet_fault_has_only_what_the_reference_causes(real, designed):
    found = certified_peaks(real.with_disturbance(Disturbance()), designed)
    assert found.claims.peak_slip_rate < 2 * found.task.reference_rates[0]


@pytest.mark.parametrize(("feedback", "share"), [("error", 0.1), ("state", 0.2)])
def test_along_the_whole_reference_the_published_law_stays_within_what_is_certified(real, feedback, share):
    """The middle of all ranges, p* as steep as it may be; powers of t/T beside the states, so that e^{At} is exact."""
    quiet = real.with_disturbance(Disturbance(slip_growth=real.disturbance.slip_growth))
    found = certified_peaks(quiet, replace(published("real-fault")["elqr"], feedback=feedback))
    task, model = found.task, found.task.model
    k1, k2, k3, k4 = map(float, published("real-fault")["elqr"].gains.values())
    T, strength, w = float(task.operation_time), float(model.gain), float(model.rate)
    r = float(task.target_slip) * np.array([0, 0, 0, 10, -15, 6.0])
    rate = np.append(np.polynomial.polynomial.polyder(r) / T, 0)
    bent = np.append(np.polynomial.polynomial.polyder(r, 2) / T**2, [0, 0])
    rest = -float(task.drift / task.reference_rates[0] / task.authority) * r
    fed = -k1 * r - k2 * rate if feedback == "state" else 0 * r
    whole = np.zeros((10, 10))
    whole[0, 1] = whole[2, 0] = whole[3, 2] = 1
    whole[1, :4] = float(model.slip) - strength * k1, -w - strength * k2, -strength * k3, -strength * k4
    whole[1, 4:] = strength * (fed - rest) - w * rate - bent
    for n in range(1, 6):
        whole[4 + n, 3 + n] = n / T
    step, x, seen = expm(whole * T / 4000), np.eye(10)[4], np.zeros(2)
    for _ in range(4000):
        x = step @ x
        seen = np.maximum(seen, np.abs(x[:2]))
    assert share * float(found.claims.slip_error) < seen[0] < found.claims.slip_error
    assert seen[1] < found.claims.slip_rate_error


def test_a_constant_disturbance_is_of_the_class_amplitude_only(real, designed):
    constant = real.with_disturbance(Disturbance(constant=-2e-4))
    assert isinstance(certified_peaks(constant, designed), ContinuousProof)
    with pytest.raises(ParameterError, match="needs a disturbance that is 0 at t = 0"):
        certified_peaks(constant, designed, disturbance_class="rate")


def test_the_facts_are_plain_and_exact(peaks):
    for kind, found in peaks.items():
        facts = json.loads(json.dumps(found.to_dict()))
        assert facts["disturbance_class"] == kind
        assert F(facts["peak_slip_rate"]) == found.claims.peak_slip_rate
        assert F(facts["slip_error"]) == found.claims.slip_error
        assert facts["premises"]


def test_limits_count_only_where_the_pressure_reaches_them(real, designed, peaks):
    low, high = peaks["amplitude"].claims.least_pressure, peaks["amplitude"].claims.largest_pressure
    # p* of the preset's own law, on a grid
    slip = np.linspace(0, real.reference.target_slip, 2001)
    mu = real.friction.residual + real.friction.drop * np.exp(-slip / real.friction.critical_slip)
    N = real.authority
    spring = (real.specific_stiffness - real.disturbance.slip_growth) * slip
    rest = ((mu - mu[0]) * N * real.effective_normal_stress + spring) / (mu * N)
    assert float(low) < rest.min() < rest.max() < float(high) < real.effective_normal_stress
    wide = replace(designed, limits=PressureLimits(lowest=low - 1, highest=high + 1))
    assert certified_peaks(real, wide) == peaks["amplitude"]
    for limits in (PressureLimits(lowest=low, highest=high + 1), PressureLimits(lowest=low - 1, highest=high)):
        found = certified_peaks(real, replace(designed, limits=limits))
        assert isinstance(found, NoProof)
        assert "may reach a limit of the law" in found.reason


def test_what_is_not_covered_is_refused(real, designed):
    with pytest.raises(UnknownNameError, match=r"amplitude, rate\. Received 'any'"):
        certified_peaks(real, designed, disturbance_class="any")
    with pytest.raises(ParameterError, match="needs p = 0 initially"):
        certified_peaks(real, replace(designed, offset=F(10)))


def test_a_law_may_have_one_integral_and_says_so_if_it_has_too_few(real):
    """k4 = 0: the same theorem with one state less; feedback of the state lets one integral drift along a reference."""
    one = certified_peaks(real, ExtendedLQR.from_values((*GAINS["real-fault"][:3], "0")))
    assert one.check() is Verdict.PROVED
    assert worst_tracking(one).slip_rate_error < one.claims.slip_rate_error < 2 * worst_tracking(one).slip_rate_error
    none = certified_peaks(real, ExtendedLQR.from_values((*GAINS["real-fault"][:2], "0", "0")))
    assert none.reason == "too few integrals for feedback of the error: 1 needed, 0 in use"
    drifting = certified_peaks(real, ExtendedLQR.from_values((*GAINS["real-fault"][:3], "0"), feedback="state"))
    assert drifting.reason == "too few integrals for feedback of the state: 2 needed, 1 in use"


def test_an_unstable_loop_and_a_large_gain_say_why(real, designed):
    bad = certified_peaks(real, replace(designed, gains={n: -k for n, k in designed.gains.items()}))
    assert "in continuous time (pressure without sampling or delay) even the nominal loop is not stable" in bad.reason
    weak = certified_peaks(real, replace(designed, gains={n: k / 16 for n, k in designed.gains.items()}))
    assert "small gain" in weak.reason
    assert weak.small_gain >= 1


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


def test_no_attack_on_the_fault_itself_exceeds_the_bound(real, designed):
    box = "ten-percent"
    fault = real.with_box(box)
    found = certified_peaks(fault, designed)
    A, b, rows = matrices(found)
    step, count, a = 0.04, 400, fault.disturbance.largest_explicit
    worst = np.sign([rows[1] @ expm(A * step * k) @ b for k in range(count)])[::-1]
    rng, tops = np.random.default_rng(11), []
    for stage in (0.05, 0.5):
        plant = Plant(fault, designed, stage, 60, rng)
        flips = rng.uniform(0.3, 12, size=60)

        def bang(t, flips=flips):
            return a * np.where(np.arange(60) % 2 == 0, worst[round(t / step)], np.sign(np.sin(2 * np.pi * t / flips)))

        tops.append(plant.run(bang, step, count))
    top = np.max([t.max(axis=1) for t in tops], axis=0)
    assert top[0] < float(found.claims.slip_error)
    assert 0.5 * float(found.claims.slip_rate_error) < top[1] < float(found.claims.slip_rate_error)


@pytest.mark.parametrize("kind", CLASSES)
def test_the_sine_of_the_preset_stays_within_both_classes(real, designed, peaks, kind):
    plant = Plant(real, designed, 0.4, 3, np.random.default_rng(2))
    shaking = real.disturbance
    top = plant.run(lambda t: shaking.amplitude * np.sin(shaking.frequency * t), 0.04, 700).max(axis=1)
    assert top[0] < float(peaks[kind].claims.slip_error)
    assert top[1] < float(peaks[kind].claims.slip_rate_error)


@pytest.mark.slow
@few("name", GAINS, every=2)
@pytest.mark.parametrize("box", ["paper", "ten-percent"])
def test_many_attacks_with_random_switching_never_exceed_the_bounds(name, box):
    """Parameters and force jump between their ends, 400 courses of 4000 steps; the loop by hand from the gains."""
    fault = qd.load_fault(name, box=box)
    found = certified_peaks(fault, law(name))
    task, k = found.task, [float(v) for v in GAINS[name]]
    ends = [[float(v) for v in pair] for pair in (task.beta, task.slip_chord, task.rate_chord)]
    a, strength = float(task.amplitude), float(task.authority)
    rng, pace, courses = np.random.default_rng(5), fault.natural_frequency, 400
    x, top, step = np.zeros((4, courses)), np.zeros((2, courses)), 0.02 / fault.natural_frequency
    spans = rng.uniform(0.05, 3, size=courses) / pace
    which, sign = rng.integers(2, size=(3, courses)), np.ones(courses)
    for _ in range(4000):
        which = np.where(rng.random(courses) < step / spans, rng.integers(2, size=(3, courses)), which)
        sign = np.where(rng.random(courses) < step / spans, -sign, sign)
        beta, s, w = (np.where(chosen, high, low) for chosen, (low, high) in zip(which, ends, strict=True))

        def rate(y, beta=beta, s=s, w=w, sign=sign):
            pressure = -k[0] * y[0] - k[1] * y[1] - k[2] * y[2] - k[3] * y[3]
            return np.array([y[1], s * y[0] - w * y[1] + beta * strength * pressure + a * sign, y[0], y[2]])

        k1 = rate(x)
        k2 = rate(x + step / 2 * k1)
        k3 = rate(x + step / 2 * k2)
        x = x + step / 6 * (k1 + 2 * k2 + 2 * k3 + rate(x + step * k3))
        top = np.maximum(top, np.abs(x[:2]))
    assert top[0].max() < found.claims.slip_error
    assert 0.4 * float(found.claims.slip_rate_error) < top[1].max() < found.claims.slip_rate_error
