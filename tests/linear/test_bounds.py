"""Every term of the bound on h, against the sectors of the certificates and against sampled plants."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.errors import ParameterError
from quakedesign.fault import Disturbance
from quakedesign.fault.friction import friction_law
from quakedesign.linear.riccati_bounds import Contribution, uncertainty_bounds
from quakedesign.lyapunov.exact.perturbation_bounds import rest_pressure, sectors

REAL = qd.load_fault("real-fault")


def variants():
    law = type(REAL.friction)
    yield "paper", REAL
    yield "ten percent", REAL.with_box("ten-percent")
    yield "growing", REAL.with_disturbance(Disturbance(slip_growth=0.01, rate_growth=0.2)).with_box("ten-percent")
    yield "no weakening", replace(REAL, friction=law(residual=0.3, drop=0.0, critical_slip=0.1))


@pytest.mark.parametrize(("name", "fault"), list(variants()), ids=[n for n, _ in variants()])
def test_the_terms_add_up_to_the_row_bounds_of_the_certificates(name, fault):
    bounds = uncertainty_bounds(fault)
    for acts_on, g in zip(("slip", "slip rate"), sectors(fault).row_bounds, strict=True):
        assert sum(c.bound for c in bounds.contributions if c.acts_on == acts_on) == g


def test_the_terms_of_the_real_fault_by_hand():
    # N̂ = 8e-8 m²/kg, chord slope 0.1/0.27635 1/m, b = 0.2353·8e-8; the worst friction of the box weakens straight, so
    # that σ' − p* is largest at r0 = d_c
    stress = (0.3353 * 50e6 - 0.48 / 8e-8 * 0.27635) / 0.2353
    bounds = uncertainty_bounds(REAL)
    first = max((c for c in bounds.contributions if c.acts_on == "slip"), key=lambda c: c.bound)
    assert first.name == "friction chord slope"
    assert float(first.bound) == pytest.approx(stress * 0.1 / 0.27635 / 0.2353, rel=0.01)
    assert [float(v) for v in bounds.control] == pytest.approx([0.2353 * 8e-8, 0.3353 * 8e-8], rel=1e-12)
    assert not any(c.bound for c in bounds.contributions if c.acts_on == "slip rate")
    assert float(bounds.nonvanishing) == pytest.approx(3.2e-4 / (0.2353 * 8e-8), rel=1e-12)


def test_a_named_uncertainty_changes_only_its_own_term():
    before, after = (uncertainty_bounds(f).contributions for f in (REAL, REAL.with_box("ten-percent")))
    changed = {b.name for b, a in zip(before, after, strict=True) if a.bound > b.bound * F(11, 10)}
    assert {"stiffness", "viscosity"} <= changed
    stiffness = next(c for c in after if c.name == "stiffness")
    least = F(9, 10) * F("0.2353") * F(8, 10**8)
    assert stiffness.bound == F(1, 10) * F(48, 100) / least


def test_each_term_has_the_far_ends_of_its_ranges():
    """Ten per cent about k̂ = 0.48 1/s² and η̂ = 2.3 1/s: what the law does not know, and the largest drift."""
    fault = REAL.with_box("ten-percent")
    bounds = uncertainty_bounds(fault, loading_rate="1e-6")
    found = {(c.name, c.acts_on): c for c in bounds.contributions}
    assert found["stiffness", "slip"].range == (-F("0.048"), F("0.048"))
    low, high = found["viscosity", "slip rate"].range
    assert (-low, high) == (high, F(1, 10) * sectors(REAL).rate[0])
    drift = F("0.528") * F(1, 10**6) * F(fault.reference.operation_time)
    assert found["drift of the far end", "nothing"].range == (0, drift)
    shaking = F("3.2e-4")
    assert found["disturbance at rest", "nothing"].range == (-shaking, shaking)
    assert bounds.nonvanishing == sum(c.bound for c in bounds.contributions if c.acts_on == "nothing")
    assert found["friction chord slope", "slip"].range[0] == 0  # the weakest friction of the box has no slope
    low, high = found["friction chord slope", "slip rate"].range
    assert low == -high == 0
    assert bounds.rest_pressure == rest_pressure(fault, (F(0), F(fault.reference.target_slip)), drift=drift)
    plain = bounds.to_dict()
    for name in ("control", "rest_pressure"):
        assert plain[name][0] <= getattr(bounds, name)[0] < getattr(bounds, name)[1] <= plain[name][1]
        assert plain[name] == pytest.approx([float(v) for v in getattr(bounds, name)], rel=1e-14)
    assert [plain["g1"], plain["g2"]] == pytest.approx([float(v) for v in sectors(fault).row_bounds], rel=1e-14)


def test_friction_that_weakens_with_the_rate_acts_on_the_slip_rate_with_both_signs():
    law = friction_law("slip-rate-weakening")(residual=0.2, drop=0.1, critical_rate=0.5)
    bounds = uncertainty_bounds(replace(REAL, friction=law))
    terms = {(c.name, c.acts_on): c for c in bounds.contributions}
    low, high = terms["friction chord slope", "slip rate"].range
    assert -low == high > 0
    assert float(high) == pytest.approx(8e-8 * float(bounds.sectors.largest_effective_stress) * float(law.rate_slope))


def test_shares_are_of_the_bounds_that_act_on_the_same_quantity():
    bounds = uncertainty_bounds(REAL)
    terms = [("a", "slip", 1), ("b", "slip", 3), ("c", "slip rate", 0), ("d", "nothing", 2)]
    parts = tuple(
        Contribution(name=name, acts_on=acts_on, range=(F(0), F(bound)), bound=F(bound))
        for name, acts_on, bound in terms
    )
    shares = [line.split("|")[-2].strip() for line in replace(bounds, contributions=parts).table().splitlines()[2:]]
    assert shares == ["25.0%", "75.0%", "-", "100.0%"]


def test_the_table_gives_every_term_its_share_of_its_column():
    bounds = uncertainty_bounds(REAL.with_box("ten-percent"))
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in bounds.table().splitlines()[2:]]
    assert len(rows) == len(bounds.contributions)
    for row, term in zip(rows, bounds.contributions, strict=True):
        assert row[:2] == [term.name, term.acts_on]
        (low, _, high), unit = row[2].split()[:3], row[2].split()[3]
        assert F(low) <= term.range[0] <= term.range[1] <= F(high)
        assert [unit, row[3].split()[1]] == {
            "slip": ["1/s²", "Pa/m"], "slip rate": ["1/s", "Pa·s/m"], "nothing": ["m/s²", "Pa"]
        }[term.acts_on]  # fmt: skip
        assert float(row[3].split()[0]) == pytest.approx(float(term.bound), rel=1e-3)
    for acts_on in ("slip", "slip rate", "nothing"):
        shares = [float(row[4][:-1]) for row in rows if row[1] == acts_on and row[4] != "-"]
        assert sum(shares) == pytest.approx(100, abs=0.3)


def test_drift_of_the_far_end_stays_at_the_equilibrium():
    # 30 mm a year over 184.17 h against k̂ = 0.48 1/s²
    speed, seconds = 0.03 / 31557600, 184.17 * 3600
    bounds = uncertainty_bounds(REAL, loading_rate=speed)
    drift = next(c for c in bounds.contributions if c.name == "drift of the far end")
    assert float(drift.range[1]) == pytest.approx(0.48 * speed * seconds, rel=1e-12)
    assert bounds.nonvanishing > uncertainty_bounds(REAL).nonvanishing
    assert bounds.rest_pressure[0] < uncertainty_bounds(REAL).rest_pressure[0]
    with pytest.raises(ParameterError, match="loading_rate must not be negative"):
        uncertainty_bounds(REAL, loading_rate=-1e-9)


def test_the_pressure_at_rest_of_the_nominal_fault_encloses_its_closed_form():
    quiet = REAL.with_disturbance(Disturbance())
    low, high = rest_pressure(quiet, (F(0), F("0.785")), nominal=True, pieces=400)
    r = np.linspace(0, 0.785, 4001)
    mu = 0.2353 + 0.1 * np.exp(-r / 0.27635)
    p = -((0.3353 - mu) * 8e-8 * 50e6 - 0.48 * r) / (mu * 8e-8)
    assert float(low) <= p.min() + 1e-3
    assert p.max() - 1e-3 <= float(high)
    assert float(low) == pytest.approx(-5.67e6, rel=0.03)  # ERRATA 8
    point = rest_pressure(quiet, (F(1, 5), F(1, 5)), nominal=True)
    at = 0.2353 + 0.1 * np.exp(-0.2 / 0.27635)
    assert [float(v) for v in point] == pytest.approx([-((0.3353 - at) * 4 - 0.096) / (at * 8e-8)] * 2, rel=1e-12)


def test_the_pressure_at_rest_over_the_box_holds_sampled_plants():
    fault = REAL.with_box("ten-percent").with_disturbance(Disturbance(slip_growth=0.01))
    low, high = (float(v) for v in rest_pressure(fault, (F(0), F("0.785"))))
    rng = np.random.default_rng(8)
    k, N = 0.48 * rng.uniform(0.9, 1.1, 20000), 8e-8 * rng.uniform(0.9, 1.1, 20000)
    r, share = rng.uniform(0, 0.785, 20000), rng.uniform(0, 1, 20000)
    least = np.maximum(0.2353, 0.3353 - 0.1 / 0.27635 * r)
    mu = least + share * (0.3353 - least)
    p = -((0.3353 - mu) * N * 50e6 - k * r + 0.01 * r) / (mu * N)
    assert low <= p.min()
    assert p.max() <= high
    assert 50e6 - low <= float(sectors(fault).largest_effective_stress) * 1.02


def test_the_table_names_every_term_with_its_share():
    bounds = uncertainty_bounds(REAL.with_box("ten-percent"))
    text = bounds.table()
    assert all(c.name in text for c in bounds.contributions)
    assert "100.0%" not in text.split("| stiffness")[0]
    exact = bounds.sectors.row_bounds[0]
    assert exact <= F(bounds.to_dict()["g1"]) <= exact * (1 + F(1, 10**15))
