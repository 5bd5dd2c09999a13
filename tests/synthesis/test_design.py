"""Designs: proved, reproducible, for stable and unusual faults too."""

from dataclasses import replace
from fractions import Fraction as F
from functools import cache

import numpy as np
import pytest
from thinned import few

import quakedesign as qd
from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.fault import Disturbance
from quakedesign.laws import published
from quakedesign.linear.riccati import riccati_design, vertex_poles
from quakedesign.lyapunov import Verdict
from quakedesign.lyapunov.exact.perturbation_bounds import sectors
from quakedesign.simulation.integrators import amplification
from quakedesign.synthesis import assess
from quakedesign.synthesis.sliding_mode_design import smallest_root


@pytest.fixture(scope="module")
def real():
    return qd.load_fault("real-fault")


@pytest.fixture(scope="module")
def sampled(real):
    return qd.design(real, "elqr")


@pytest.fixture(scope="module")
def judged(real):
    """The published gains."""
    return {name: assess(real, law) for name, law in published("real-fault").items()}


@pytest.fixture(scope="module")
def variants(real):
    law = type(real.friction)
    return {
        "real": real,
        "lab": qd.load_fault("lab-fault"),
        "ten percent": real.with_box("ten-percent"),
        "stable": replace(real, friction=law(residual=0.2353, drop=0.01, critical_slip=0.27635)),
        "no stress drop": replace(real, friction=law(residual=0.2353, drop=0.0, critical_slip=0.27635)),
        "strong weakening": replace(real, friction=law(residual=0.05, drop=0.8, critical_slip=0.05)),
        "undamped": replace(real, damping=0.0),
        "overdamped": replace(real, damping=5e16),
        "slow sampling": replace(real, sampling_time=60.0),
        "quiet": real.with_disturbance(Disturbance()),
        "small": replace(real, length=1.0, damping=1e3),
    }


@pytest.fixture(scope="module")
def continuous(variants):
    """Designs in continuous time, each made once."""
    return cache(lambda law, variant="real": qd.design(variants[variant], law, continuous=True))


VARIANTS = (
    "real", "lab", "ten percent", "stable", "no stress drop", "strong weakening", "undamped", "overdamped",
    "slow sampling", "quiet", "small",
)  # fmt: skip


SHORT = {"cta": {"real", "lab", "ten percent", "strong weakening"}, "dia": set()}
SLIDING = [pytest.param(law, v, marks=() if v in SHORT[law] else pytest.mark.slow) for law in SHORT for v in VARIANTS]


@pytest.mark.slow
@pytest.mark.parametrize(("law", "variant"), SLIDING)
def test_a_sliding_mode_in_continuous_time_is_proved_with_its_premise_along_the_reference(continuous, law, variant):
    design = continuous(law, variant)
    assert design.verdict is Verdict.PROVED
    assert design.certificate.check() is Verdict.PROVED
    premises = {p.name: p for p in design.premises}
    assert premises["along_reference"].holds
    assert premises["control_coefficient"].holds
    assert design.controller.scale == F(design.details["rho"]) ** 6


@few("variant", VARIANTS, every=3)
def test_the_elqr_in_continuous_time_is_proved_about_constant_references(continuous, variant):
    design = continuous("elqr", variant)
    assert design.verdict is Verdict.PROVED
    assert {p.name: p for p in design.premises}["friction_slope"].holds


@pytest.mark.parametrize("name", ["real-fault", "lab-fault"])
def test_riccati_residual_and_gain_by_independent_algebra(name):
    # A'S + SA − SBR⁻¹B'S + Q = 0 and K = R⁻¹B'S, in the nondimensional variables of the design
    fault = qd.load_fault(name)
    found = riccati_design(fault)
    zeta = fault.damping_ratio
    A = np.array([[0, 1, 0, 0], [-1, -2 * zeta, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0]])
    B = np.array([[0.0], [1.0], [0.0], [0.0]])
    residual = A.T @ found.S + found.S @ A - found.S @ B @ B.T @ found.S / found.R + found.Q
    assert np.abs(residual).max() < 1e-9 * np.abs(found.S).max() / found.R
    assert np.linalg.eigvalsh(found.S).min() > 0


def test_every_vertex_is_stable_and_the_step_is_short_enough(real, continuous):
    design = continuous("elqr")
    poles = vertex_poles(sectors(real), list(design.controller.gains.values()))
    assert max(z.real for z in poles) < 0
    assert max(abs(z) for z in poles) * real.sampling_time == pytest.approx(1.5, rel=1e-3)
    assert amplification(poles, real.sampling_time) < 1


def test_the_stability_limit_of_dormand_prince_on_the_real_axis():
    # |R(z)| = 1 at z ≈ −3.3066 for the six-stage fifth-order method (Hairer and Wanner, Solving ODEs II, IV.2)
    assert amplification([-3.30], 1.0) < 1 < amplification([-3.31], 1.0)


def test_published_gains_are_judged_without_error(judged):
    assert {name: found.verdict for name, found in judged.items()} == dict.fromkeys(
        ("cta", "dia", "elqr"), Verdict.PROVED
    )


def test_a_destabilising_gain_has_no_certificate(real):
    good = published("real-fault")["elqr"]
    bad = replace(good, gains={n: -k for n, k in good.gains.items()})
    assert assess(real, bad).verdict is not Verdict.PROVED


@pytest.mark.parametrize("scale", ["1/3", "250/1000000", "12345", "1"])
def test_the_root_is_rational_and_just_large_enough(scale):
    root = smallest_root(F(scale))
    assert root**6 >= F(scale)
    assert float(root**6 / F(scale)) < 1.07


@pytest.mark.slow
def test_the_same_input_gives_the_same_digits(real, sampled, continuous):
    again = qd.design(real, "elqr")
    assert again.controller == sampled.controller
    assert again.premises == sampled.premises
    first, second = continuous("elqr"), qd.design(real, "elqr", continuous=True)
    assert first.gains == second.gains
    assert first.certificate == second.certificate
    first, second = continuous("cta"), qd.design(real, "cta", continuous=True)
    assert first.certificate == second.certificate


def test_an_unknown_controller_is_one_clear_message(real):
    with pytest.raises(UnknownNameError, match=r"must be one of cta, dia, elqr\. Received 'pid'"):
        qd.design(real, "pid")


@pytest.mark.parametrize("law", ["cta", "elqr"])
def test_options_that_do_not_go_together_are_one_message(real, law):
    with pytest.raises(ParameterError, match=r"in continuous time must be tracking\. Received 'peak'"):
        qd.design(real, law, continuous=True, objective="peak")
    with pytest.raises(ParameterError, match="one of tracking, peak"):
        qd.design(real, law, objective="speed")


def test_what_a_law_cannot_be_told_is_refused(real):
    with pytest.raises(ParameterError, match="a sliding mode needs slip and slip rate"):
        qd.design(real, "cta", measured="slip")
    for law, options in (
        ("elqr", {"measured": "slip"}),
        ("elqr", {"slip_noise": "1e-6"}),
        ("cta", {"slip_noise": "1e-6"}),
        ("dia", {"rate_noise": 1e-6}),
    ):
        with pytest.raises(ParameterError, match="needs exact measurements of slip and slip rate"):
            qd.design(real, law, continuous=True, **options)


def test_a_sliding_mode_has_no_bound_of_peaks_in_continuous_time(judged):
    assert "no certified peaks in continuous time for 2-CTA" in judged["cta"].certified_peaks().reason


@pytest.mark.slow
def test_a_simulation_that_holds_the_pressure_agrees_with_both_guarantees(real, sampled):
    free = qd.design(real, "elqr", continuous=True)
    assert sampled.guarantee.check() is Verdict.PROVED
    assert free.guarantee.sentence().startswith(
        "none: with zero-order hold over 0.184 s even the nominal loop is not stable"
    )
    assert free.sampled_stability().to_dict()["verdict"] == "refuted"
    assert sampled.sampled_stability() is None
    assert "no certified peaks" in sampled.certified_peaks().reason
    held = qd.simulate(real, sampled.controller, duration=400.0)
    unstable = qd.simulate(real, free.controller, scheme="explicit", plant="printed", duration=400.0)
    assert "diverged" not in held.events
    assert held.metrics.max_slip_error < 1e-4
    assert "diverged" in unstable.events


def test_a_design_refuses_quantities_of_the_setup_that_it_does_not_know():
    with pytest.raises(ParameterError, match=r"a design takes step, measured, delay, .* Received jitter, longest_step"):
        qd.design(qd.load_fault("real-fault"), "elqr", jitter="1 ms", longest_step="100 ms")


def test_a_step_of_the_setup_is_the_sampling_time_of_the_fault(real):
    seen = []

    class Noted(published("real-fault")["elqr"].__class__):
        @classmethod
        def design(cls, problem):
            seen.append((problem.fault, problem.setup))

    qd.design(real, Noted, qd.LoopSetup(step="7/50", delay="1 ms"))
    qd.design(real, Noted, step="140 ms", delay="1 ms")
    qd.design(replace(real, sampling_time=0.14), Noted, delay="1 ms")
    assert seen == 3 * [(replace(real, sampling_time=0.14), qd.LoopSetup(delay="1 ms"))]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"objective": "peak"}, "objective 'peak'"),
        ({"disturbance_class": "rate"}, "class 'rate'"),
        ({"slip_noise": "1 um"}, "noise"),
        ({"rate_noise": "1 um/s", "objective": "peak"}, "objective 'peak', noise"),
        ({"continuous": True}, "continuous"),
    ],
)
def test_a_design_for_slow_sliding_rejects_what_does_not_apply(more, said):
    with pytest.raises(ParameterError, match=f"designed for the sampled loop without noise.* Received {said}. Omit"):
        qd.design(qd.load_fault("crustal-patch"), "elqr", diffusion="800 s", **more)
