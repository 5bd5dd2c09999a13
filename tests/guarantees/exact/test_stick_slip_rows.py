"""Numbers and rows of the stick–slip theorem, each compared with the standalone checker's."""

import json
from fractions import Fraction as F
from pathlib import Path

import numpy as np
import pytest
from flint import ctx
from scipy.integrate import simpson
from standalone_guarantee import CHECK

from quakedesign.guarantees import read_guarantee
from quakedesign.guarantees.exact import stick_slip_set as package

checker = CHECK.beside("guarantee.stick_slip")
FOLDER = Path(__file__).parents[3] / "proofs" / "certificates"
WIDE = {"stiffness": "1/50", "damping": "1/4", "authority": "1/100"}
CASES = {
    "plain": ("stick_slip_real-fault.json", {}),
    "noise": ("stick_slip_noise_real-fault.json", {}),
    "sliding mode": ("stick_slip_cta_real-fault.json", {}),
    "aperiodic": ("stick_slip_aperiodic_real-fault.json", {}),
    "wide box": ("stick_slip_noise_real-fault.json", WIDE),
    "wide box, aperiodic": ("stick_slip_aperiodic_real-fault.json", WIDE),
}
SOME = slice(None, None, 9)  # facets


@pytest.fixture(scope="module", params=CASES)
def pair(request):
    """A file as the package reads it, its period in the checker, and the package's periods."""
    name, spreads = CASES[request.param]
    document = json.loads((FOLDER / name).read_text())
    document["fault"]["spreads"] |= spreads
    document["disturbance"]["growths"]["rate"] = "1/10000000"
    if spreads:
        document["loop"]["slip_noise"] = "1/20000000"
        document["loop"]["rest_slip"] = "3/20000000"
        document["fault"]["friction"]["rate_slope"] = "1/100000"
    proof = read_guarantee(document)
    task, rock = checker.read_task(document), checker.read_rock(document["fault"])
    growths = [F(document["disturbance"]["growths"][name]) for name in ("slip", "rate")]
    target = F(document["reference"]["target_slip"])
    law, reach = checker.read_law(document["loop"]), checker.read_reach(document["set"])
    period = checker.Period(rock, task, target, growths, law, reach)
    with ctx.workprec(package.BITS):
        push = package.feedback_range(proof.task, proof.sampled_loop, proof.invariant_set)
        ahead, rate = proof.invariant_set.box[:2]
        moved = proof.task.reference_rates[0] * proof.sampled_loop.longest
        plant = package.ranges(proof.task, ahead + moved, push, rate * proof.sampled_loop.longest)
        periods = package.Period.deciding(package.BALLS, proof.task, proof.sampled_loop, plant, rate, push)
    return proof, period, periods, push


def close(value, other):
    return float(value) == pytest.approx(float(other), rel=1e-12, abs=1e-300)


def test_pressures_and_ranges_of_the_plant_agree(pair):
    _, period, periods, push = pair
    plant = periods[0].plant
    assert all(map(close, push, period.push))
    for name in ("slope", "damping", "chord"):
        assert all(map(close, getattr(plant, name), getattr(period, name))), name
    assert all(map(close, plant.rest_pressure, period.rest))
    assert len(periods) == len(period.law.intervals)


def test_slips_before_a_stop_and_polytopes_agree(pair):
    proof, period, periods, _ = pair
    plant = periods[0].plant
    stops = package.stop_bounds(proof.task, proof.sampled_loop, plant)
    assert all(close(*two) for a, b in zip(stops, period.stops(), strict=True) for two in zip(a, b, strict=True))
    lines = package.polytopes(proof.task, proof.sampled_loop, proof.invariant_set.facets, plant)
    for ours, other in zip(lines, period.slices, strict=False):
        assert [(tuple(row), end) for row, end in ours] == [(tuple(row), end) for row, end in other]
    resting = [lines[package.SLICES + place] for place in (0, 2, 4, 5)]
    for ours, (other, _) in zip(resting, period.resting(), strict=True):
        assert len(ours) == len(other.lines)
        for (row, end), (line, limit) in zip(ours, other.lines, strict=True):
            assert row == pytest.approx(line, rel=1e-12)
            assert close(end, limit)


def scaled(sizes, row, constant):
    """Entries in units of their effect on a facet."""
    return [float(v) * float(size) for v, size in zip(row, sizes, strict=True)] + [float(constant)]


def test_images_of_facets_after_a_sliding_period_agree(pair):
    proof, period, periods, _ = pair
    sizes = period.sizes[2]
    sizes = [max(period.ahead, period.behind), *sizes[1:]]
    facets, multipliers = proof.invariant_set.facets[SOME], proof.invariant_set.multipliers[SOME]
    for ours, interval in ((periods[0], period.law.intervals[0]), (periods[-1], period.law.intervals[-1])):
        period.respond(interval)
        found = {(facet, cut): [] for facet in range(len(facets)) for cut in (False, True)}
        with ctx.workprec(package.BITS):
            arrays = [package._ball_array([list(row) for row in rows]) for rows in (facets, multipliers)]
            for rows in package.sliding_rows(ours, *arrays):
                for facet, row, constant in zip(rows.which, rows.factors, rows.constants, strict=True):
                    found[facet, rows.cut].append((rows.place, scaled(sizes, row, constant)))
        for (facet, cut), mine in found.items():
            limited = cut and facets[facet][2] <= 0
            functions = [] if limited else list(period.sliding(facets[facet], multipliers[facet], cut))
            assert len(mine) == len(functions)
            for (place, row), (other, f) in zip(mine, functions, strict=True):
                line = [float(v) + near.at / checker.ONE for v, near in zip(f.row, f.more, strict=True)]
                line = scaled(sizes, line, float(f.constant) + f.beside.at / checker.ONE)
                assert place == other
                assert row == pytest.approx(line, rel=1e-9, abs=1e-12)


def test_images_of_facets_after_a_period_that_ends_at_rest_agree(pair):
    proof, period, periods, _ = pair
    sizes = [max(period.ahead, period.behind), *period.sizes[2][1:], period.longest]
    facets, multipliers = proof.invariant_set.facets[SOME], proof.invariant_set.multipliers[SOME]
    found = {facet: set() for facet in range(len(facets))}
    arrays = [package._exact_array([list(row) for row in rows]) for rows in (facets, multipliers)]
    for rows in package.resting_rows(package.EXACT, proof.task, proof.sampled_loop, periods[0].plant, *arrays):
        for facet, row, constant in zip(rows.which, rows.factors, rows.constants, strict=True):
            first = package.COMBINATIONS[rows.place - package.SLICES]
            found[facet].add((first[:2], *(f"{v:.9e}" for v in scaled(sizes, row, constant))))
    resting = period.resting()
    for facet, mine in found.items():
        other = set()
        for _, ends in resting:
            for end in ends:
                for f in period.stopped(facets[facet], multipliers[facet], end):
                    line = scaled(sizes, f.row, f.constant)
                    other.add(((end.place, end.positive), *(f"{v:.9e}" for v in line)))
        assert mine == other


def test_the_loss_to_the_range_of_the_input_gain_agrees(pair):
    proof, period, periods, push = pair
    step, least = period.law.longest_interval, 0 if period.law.longest else 1
    share = period.per_slip * step**2 / 2 + period.per_rate * step * (1 + period.slope[1] * period.growth * step**2)
    loss = share * period.task.b * (period.task.beta[1] - least) * max(period.push[1], F(0))
    assert close(package._bracket(proof.task, proof.sampled_loop, periods[0].plant, push[1]), loss)


def test_the_pressure_before_a_stop_counts_only_where_it_is_positive(pair):
    proof, _, periods, _ = pair
    assert package._bracket(proof.task, proof.sampled_loop, periods[0].plant, F(-1)) == 0


def test_margins_between_intervals_agree(pair):
    _, period, periods, _ = pair
    for ours, theirs in zip(periods[0].margin, period.margin, strict=True):
        assert float(ours) == pytest.approx(theirs.at / checker.ONE, rel=1e-12, abs=1e-60)


def test_integrals_are_upper_sums(pair):
    """Chords between nodes, and above them: not below the integral of the response itself in fine steps."""
    _, _, periods, _ = pair
    ours = periods[0]
    with ctx.workprec(package.BITS):
        one, none = package._ball_array([F(1)]), package._ball_array([F(0)])
        areas = [float(v[0]) for v in ours.integrals(one, none)]
        slope, damping = (float(sum(two)) / 2 for two in (ours.plant.slope, ours.plant.damping))
    T = float(ours.interval)
    time = np.linspace(0, T, 2001)
    root = np.emath.sqrt(damping**2 / 4 + slope)
    response = np.abs(np.real(np.exp(-damping / 2 * (T - time)) * np.sinh(root * (T - time)) / root))
    for j, area in enumerate(areas):
        exact = simpson(response * time**j, x=time)
        assert exact * (1 - 1e-6) <= area <= exact * 1.01
