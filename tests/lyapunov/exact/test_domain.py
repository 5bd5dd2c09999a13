"""Certified domains with and without feed-forward: hand calculation, an attack by sampling, and what limits them."""

from dataclasses import dataclass, replace
from fractions import Fraction as F

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.errors import CertificateError, ParameterError
from quakedesign.fault import Disturbance
from quakedesign.laws import control_law
from quakedesign.laws.feed_forward import FEED_FORWARDS, feed_forward
from quakedesign.lyapunov.exact import robustness as robustness_module
from quakedesign.lyapunov.exact.domain import DomainProblem, certified_domain
from quakedesign.lyapunov.exact.perturbation_bounds import (
    Errors,
    largest_matched_rate,
    largest_sensitivities,
    least_authority,
)
from quakedesign.lyapunov.exact.premises import feedforward_variants, sliding_mode_premises
from quakedesign.lyapunov.exact.robustness import LevelSets, robustness
from quakedesign.symbolic.terms import value

REAL = qd.load_fault("real-fault")
D = least_authority(REAL)


@dataclass(frozen=True)
class Found:
    """Gains of the literature, proved, and scaled as `design` scales them."""

    certificate: object
    controller: object


@pytest.fixture(scope="module")
def found():
    gains = ("7", "5", "2.3", "1.1")
    verdict, certificate = qd.certify("cta", gains, lipschitz=1, gain_range=(1, "3353/2353"))
    assert str(verdict) == "proved"
    return Found(certificate, control_law("cta").from_values(gains, scale=F(251, 1000) ** 6, divisor=D))


@pytest.fixture(scope="module")
def variants(found):
    return {v.feedforward.name: v for v in feedforward_variants(REAL, found.controller, found.certificate)}


@pytest.fixture(scope="module")
def known(found):
    return robustness(found.certificate)


def function(certificate, e):
    """V by numpy, from its terms."""
    total = 0.0
    for term in certificate.lyapunov:
        part = float(value(term, {}))
        for state, exponent, kind in term.factors:
            x = e[int(state[1]) - 1]
            part = part * np.abs(x) ** float(exponent) * (np.sign(x) if kind == "s" else 1)
        total = total + part
    return total


def gradient(certificate, e):
    """∂V/∂e by numpy, with the power rule typed in."""
    out = [0.0, 0.0, 0.0]
    for term in certificate.lyapunov:
        factors = [(int(s[1]) - 1, float(a), k) for s, a, k in term.factors]
        for i in {f[0] for f in factors}:
            part = float(value(term, {}))
            for j, a, kind in factors:
                x, sign = np.abs(e[j]), np.sign(e[j])
                if j == i:
                    part = part * a * x ** (a - 1) * (1 if kind == "s" else sign)
                else:
                    part = part * x**a * (sign if kind == "s" else 1)
            out[i] = out[i] + part
    return out


def law(e, gains):
    """Proportional part of ν and ξ' of the 2-CTA, typed in from eq. cta."""
    k1, k2, k3, k4 = (float(k) for k in gains)
    root = -k1 * np.sign(e[0]) * np.abs(e[0]) ** (1 / 3) - k2 * np.sign(e[1]) * np.abs(e[1]) ** 0.5
    return root, -k3 * np.sign(e[0]) - k4 * np.sign(e[1])


def on_level(certificate, rng, number, level):
    """Points of {V = level} of the base loop, many near the switching surfaces."""
    sizes = np.array([float(certificate.claims[f"bound_e{i}"]) ** -0.2 for i in (1, 2, 3)])
    u = rng.uniform(-1, 1, (3, number)) * np.abs(rng.uniform(0, 1, (3, number))) ** rng.integers(0, 6, (3, number))
    e = np.sign(u) * (np.abs(u) * sizes[:, None]) ** np.array([3, 2, 1])[:, None]
    stretch = (level / function(certificate, e)) ** 0.2
    return e * stretch ** np.array([3, 2, 1])[:, None]


def h_and_slopes(fault, e1, e2, s, phi, added):
    """h + feed-forward with the fault's own friction, typed in from eq. esystem3; e1, e2 in SI."""
    task, friction, shake = fault.reference, fault.friction, fault.disturbance
    r, dr, ddr = (
        np.polynomial.Polynomial([0, 0, 0, 10, -15, 6]).deriv(n)(s) * task.target_slip / task.operation_time**n
        for n in range(3)
    )
    x1, x2 = e1 + r, e2 + dr
    mu = friction.residual + friction.drop * np.exp(-np.maximum(x1, 0) / friction.critical_slip)
    drop = mu - friction.residual - friction.drop
    force = -drop * fault.authority * fault.effective_normal_stress
    force = force - fault.specific_stiffness * x1 - fault.specific_damping * x2
    force = force + phi + shake.slip_growth * x1 - ddr
    beta = mu * fault.authority / float(D)
    k, eta, share = (float(v) for v in added.coefficients.values())
    return force / beta + k * x1 + eta * x2 + share * ddr, beta


@pytest.mark.parametrize("name", FEED_FORWARDS)
def test_no_sampled_point_of_the_domain_gains(found, variants, name):
    # V' of the true loop, e3 = ξ1 + h(t, 0), at ends of |d h(t, 0)/dt| ≤ L̄: negative everywhere on the level set
    domain, certificate = variants[name].domain, found.certificate
    assert domain.level > 0
    assert domain.method == "split"
    rng = np.random.default_rng(11)
    scale = float(found.controller.scale)
    for share in (1.0, 0.3, 1e-3):
        e = on_level(certificate, rng, 60_000, domain.level * share)
        assert np.abs(e[0]).max() * scale <= domain.slip_error
        assert np.abs(e[1]).max() * scale <= domain.slip_rate_error
        number = e.shape[1]
        s, phi = rng.uniform(0, 1, number), rng.choice([-1, 1], number) * REAL.disturbance.amplitude
        added = variants[name].feedforward
        h, beta = h_and_slopes(REAL, scale * e[0], scale * e[1], s, phi, added)
        at_rest, _ = h_and_slopes(REAL, 0.0, 0.0, s, phi, added)
        nu, integral = law(e, found.controller.gains.values())
        slopes = gradient(certificate, e)
        for d in (-1, 1):
            rate = (
                slopes[0] * e[1] + slopes[1] * beta * (nu + e[2] + (h - at_rest) / scale) + slopes[2] * (integral + d)
            )
            assert rate.max() < 0


def test_the_bounds_on_what_the_decrease_withstands_are_rigorous_and_not_loose(found, known):
    certificate = found.certificate
    e = on_level(certificate, np.random.default_rng(2), 300_000, 1.0)
    nu, integral = law(e, found.controller.gains.values())
    slopes = gradient(certificate, e)
    slip, rate = 0.0, 0.0
    for beta in (1.0, 3353 / 2353):
        for d in (-1, 1):
            fall = -(slopes[0] * e[1] + slopes[1] * beta * (nu + e[2]) + slopes[2] * (integral + d))
            slip = max(slip, np.max(beta * np.abs(slopes[1] * e[0]) / fall))
            rate = max(rate, np.max(beta * np.abs(slopes[1] * e[1]) / fall))
    assert slip <= float(known.slip) <= 1.12 * slip
    assert rate <= float(known.rate) <= 1.12 * rate
    assert (known.slip_power, known.rate_power) == (F(2, 5), F(1, 5))


def test_feed_forward_enlarges_the_domain(variants):
    slip = {name: v.domain.slip_error for name, v in variants.items()}
    rate = {name: v.domain.slip_rate_error for name, v in variants.items()}
    assert slip["nominal"] > 10 * slip["none"]
    assert slip["centred"] > 30 * slip["none"]
    assert rate["centred"] > rate["nominal"] > 5 * rate["none"]
    assert "viscosity" in variants["none"].domain.limited_by
    assert "minus" not in variants["none"].domain.limited_by
    assert "minus its feed-forward" in variants["nominal"].domain.limited_by


def test_only_with_feed_forward_is_the_start_certified(variants):
    holds = {name: {p.name: p.holds for p in v.premises} for name, v in variants.items()}
    assert not holds["none"]["level_set"]
    assert all(all(holds[name].values()) for name in ("nominal", "centred"))
    for name, variant in variants.items():
        starts = 3.2e-4 / 3353 * 2353 <= variant.domain.start_perturbation
        assert starts == holds[name]["level_set"]
        premises = {p.name: p for p in variant.premises}
        assert (f"with {name} feed-forward" in premises["level_set"].note) == (name != "none")


def test_admitted_starts_lie_in_the_level_set(found, variants):
    certificate, scale = found.certificate, float(found.controller.scale)
    for variant in variants.values():
        domain = variant.domain
        starts = (domain.start_slip_error, domain.start_slip_rate_error, domain.start_perturbation)
        for i, size in enumerate(starts):
            point = np.zeros(3)
            for sign in (-1, 1):
                point[i] = sign * size / scale
                assert function(certificate, point) <= domain.level * (1 + 1e-9)
            point[i] *= 1.02
            assert function(certificate, point) > domain.level


def test_the_domain_in_metres_grows_with_lambda(found, known):
    def size(scale):
        return certified_domain(DomainProblem(REAL, found.controller.scaled(scale), found.certificate, known))

    small, large = size(found.controller.scale), size(64 * found.controller.scale)
    assert large.slip_error == pytest.approx(64 * small.slip_error, rel=1e-6)
    assert large.slip_rate_error == pytest.approx(64 * small.slip_rate_error, rel=1e-6)


def test_the_other_method_alone_is_rigorous_and_smaller(found, variants):
    # with all of h in e3 the control itself is in h' (ERRATA 16), and only the headroom of a tenth is left for it
    whole = certified_domain(DomainProblem(REAL, found.controller, found.certificate, None))
    assert whole.method == "whole"
    assert 0 < whole.slip_error < 1e-3 * variants["none"].domain.slip_error
    assert "the control, through viscosity" in whole.limited_by


def test_an_empty_domain_names_its_cause(found, known):
    weak = found.controller.scaled(found.controller.scale / 2)
    premises, domain = sliding_mode_premises(REAL, weak, found.certificate)
    assert domain.level == domain.slip_error == domain.start_perturbation == 0
    assert "disturbance" in domain.limited_by
    assert not {p.name: p for p in premises}["along_reference"].holds
    wide = certified_domain(DomainProblem(REAL.with_box("ten-percent"), found.controller, found.certificate, known))
    assert wide.level == 0
    assert "β" in wide.limited_by


@pytest.mark.parametrize("box", ["paper", "ten-percent"])
def test_sensitivities_by_hand(box):
    fault = REAL.with_box(box)
    width = 0.1 if box == "ten-percent" else 0.0
    divisor = least_authority(fault)
    most, friction = 3353 / 2353 * (1 + width) / (1 - width), REAL.friction
    static, least = friction.residual + friction.drop, friction.residual
    taken = 50e6 * float(divisor) * static * friction.slip_slope / least**2
    by_name = {}
    for name in FEED_FORWARDS:
        added = feed_forward(name, fault, divisor)
        by_name[name] = [float(g) for g in largest_sensitivities(fault, divisor, Errors(), feedforward=added)]
    low, high = 1.6 * (1 - width) / most, 1.6 * (1 + width)
    assert by_name["none"][1] == pytest.approx(high, rel=1e-3)
    assert by_name["nominal"][1] == pytest.approx(max(1.6 - low, high - 1.6), rel=1e-3)
    assert by_name["centred"][1] == pytest.approx((high - low) / 2, rel=1e-3)
    # friction takes most, σ'·μ0N̂0·μ_max·slope/μ_res², at μ_res, where β is between 1 and N̂_max/N̂_min
    left = 0.48 * (1 - (1 - width) ** 2 / (1 + width))
    assert taken + left <= by_name["nominal"][0] <= 1.02 * (taken + left)
    assert by_name["centred"][0] < by_name["none"][0] < by_name["nominal"][0]


def test_what_is_known_exactly_is_compensated_exactly():
    law = type(REAL.friction)
    frictionless = replace(
        REAL.with_disturbance(Disturbance()), friction=law(residual=0.3, drop=0.0, critical_slip=0.1)
    )
    divisor = least_authority(frictionless)
    added = feed_forward("nominal", frictionless, divisor)
    box = Errors(slip=F(1, 10), rate=F(1, 10), acceleration=F(1))
    assert largest_matched_rate(frictionless, divisor, box, pieces=20) > F(1, 2)
    assert float(largest_matched_rate(frictionless, divisor, box, pieces=20, feedforward=added)) < 1e-12
    assert all(float(g) < 1e-12 for g in largest_sensitivities(frictionless, divisor, box, feedforward=added))
    assert feed_forward("centred", frictionless, divisor).coefficients == added.coefficients


@pytest.mark.parametrize("name", FEED_FORWARDS)
def test_the_rate_along_the_reference_is_covered(name):
    # finite differences of the typed-in h over a stage step, disturbance at rest
    quiet = REAL.with_disturbance(Disturbance(slip_growth=REAL.disturbance.slip_growth))
    added = feed_forward(name, quiet, D)
    s = np.linspace(0, 1, 4001)
    values, _ = h_and_slopes(quiet, 0.0, 0.0, s, 0.0, added)
    sampled = np.abs(np.diff(values) / np.diff(s)).max() / quiet.reference.operation_time
    bound = float(largest_matched_rate(quiet, D, Errors(), feedforward=added))
    assert sampled <= bound <= 1e-5


def test_variants_start_with_the_laws_own_and_name_each_once(found):
    fed = found.controller.with_feedforward(feed_forward("centred", REAL, D))
    names = [v.feedforward.name for v in feedforward_variants(REAL, fed, found.certificate)]
    assert names == ["centred", "none", "nominal"]
    without = feedforward_variants(REAL, fed, None)
    assert [[p.name for p in v.premises] for v in without] == [["along_reference"]] * 3
    assert {v.domain for v in without} == {None}
    assert set(without[0].to_dict()) == {"feedforward", "coefficients", "premises", "domain"}


@pytest.mark.parametrize(
    ("preset", "name"),
    [
        ("real-fault", "nominal"),
        pytest.param("real-fault", "centred", marks=pytest.mark.slow),
        pytest.param("lab-fault", "nominal", marks=pytest.mark.slow),
        pytest.param("lab-fault", "centred", marks=pytest.mark.slow),
    ],
)
def test_a_design_with_feed_forward_has_every_premise(preset, name):
    fault = qd.load_fault(preset)
    with pytest.raises(ParameterError, match="feedforward has no guarantee with zero-order hold"):
        qd.design(fault, "cta", feedforward=name)
    design = qd.design(fault, "cta", feedforward=name, continuous=True)
    assert str(design.verdict) == "proved"
    assert all(p.holds for p in design.premises)
    assert design.domain.feedforward == design.controller.feedforward.name == name
    assert design.gains["feedforward_damping"] == design.controller.feedforward.damping


def test_the_linear_law_takes_none():
    with pytest.raises(ParameterError, match="Received 'nominal' with elqr"):
        qd.design(REAL, "elqr", feedforward="nominal")
    law = control_law("elqr").from_values((1, 1, 1, 1))
    assert law.feedforward.name == "none"
    with pytest.raises(ParameterError, match=r"feedforward is for sliding modes. Received nominal for elqr"):
        law.with_feedforward(feed_forward("nominal", REAL, F(1)))


def test_joint_starts_are_bounded(found):
    sets = LevelSets(found.certificate, found.controller.scale)
    alone = sets.level(F(1, 10**4))
    joint = sets.level_of(slip=F(1, 10**8), rate=F(1, 10**6), matched=F(1, 10**4))
    assert 0 < alone < joint


def test_where_the_decrease_is_not_polynomial_the_claimed_decay_serves(found, known, monkeypatch):
    def refuse(*_):
        raise CertificateError("not polynomial on a cell.")

    monkeypatch.setattr(robustness_module, "_against_decrease", refuse)
    assert robustness(found.certificate) is None
    claims = {**found.certificate.claims, "decay": F(1, 70)}
    weaker = robustness(replace(found.certificate, claims=claims))
    assert weaker.source == "claimed decay"
    assert (weaker.slip_power, weaker.rate_power) == (known.slip_power, known.rate_power)
    # −V' ≥ κV^{4/5} is never more than V' itself
    assert weaker.slip > known.slip / F(105, 100)
    assert weaker.rate > known.rate / F(105, 100)
