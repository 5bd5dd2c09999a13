"""Each condition of the stick–slip theorem in the package, at its limit and just beyond it."""

from dataclasses import replace
from fractions import Fraction as F
from functools import cache

import numpy as np
import pytest
from flint import fmpq
from stick_slip_box import box

from quakedesign.errors import ParameterError
from quakedesign.guarantees import read_guarantee
from quakedesign.guarantees.exact import stick_slip_set as module
from quakedesign.guarantees.exact.stick_slip_set import (
    COMBINATIONS,
    EXACT,
    MOST_BASES,
    MOST_FACETS,
    SLICES,
    Ranges,
    ranges,
    stick_slip_bounds,
    stop_bounds,
)
from quakedesign.laws import Power

TINY = F(1, 10**12)


@cache
def claim(noisy=True):
    return read_guarantee(box(noisy))


PLANT = Ranges(
    slope=(F(-1, 20), F(1, 20)), damping=(F(1, 3), F(1, 2)), chord=(F(-1), F(1)), rest_pressure=(F(-40), F(40))
)


@pytest.fixture
def facets_inside(monkeypatch):
    """Every facet counts as inside, so that the other conditions remain; the ranges of the plant are `PLANT`."""
    monkeypatch.setattr(module, "facet_rows", lambda *_: iter(()))
    monkeypatch.setattr(module, "ranges", lambda *_: PLANT)
    return monkeypatch


def bounds(known=None, **changes):
    known = known or claim()
    return stick_slip_bounds(known.task, replace(known.sampled_loop, **changes), known.invariant_set)


# ----------------------------------------------------------------------
# The shape of a polytope.

BASIS = {"sliding": 3, "resting": 4}


def with_rows(many):
    known = claim().invariant_set
    more = many - len(known.facets)
    return {
        "facets": (*known.facets, *known.facets[-1:] * more),
        "multipliers": (*known.multipliers, *known.multipliers[-1:] * more),
    }


def with_bases(many):
    known = claim().invariant_set
    more = many - sum(map(len, (*known.sliding, *known.resting)))
    return {"sliding": ((*known.sliding[0], *known.sliding[0][:1] * more), *known.sliding[1:])}


def with_multipliers(*row):
    return {"multipliers": (tuple(map(F, row)), *claim().invariant_set.multipliers[1:])}


def with_basis(name, basis):
    known = getattr(claim().invariant_set, name)
    return {name: ((*known[0], basis), *known[1:])}


@pytest.mark.parametrize(
    "changes",
    [
        with_rows(MOST_FACETS),
        with_bases(MOST_BASES),
        with_multipliers(0, 0, -5, 1, 0),
        with_multipliers(7, 1, 5, 0, 1),
        with_basis("sliding", (0, 1, 2)),
        with_basis("resting", (0, 1, 2, 3)),
    ],
    ids=["facets", "bases", "least multipliers", "largest multipliers", "slice", "combination"],
)
def test_a_polytope_has_this_shape(changes):
    assert replace(claim().invariant_set, **changes)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        (with_rows(MOST_FACETS + 1), "have 5 to 400 facets"),
        (with_bases(MOST_BASES + 1), "have at most 40000 bases"),
        (with_multipliers(-TINY, 0, 0, 0, 0), "have a first multiplier of 0 or more"),
        (with_multipliers(0, F(1, 2), 0, 0, 0), "have a first multiplier of 0 or more"),
        (with_multipliers(0, 2, 0, 0, 0), "have a first multiplier of 0 or more"),
        (with_multipliers(0, 0, 0, F(1, 2), 0), "have a first multiplier of 0 or more"),
        (with_multipliers(0, 0, 0, 2, 0), "have a first multiplier of 0 or more"),
        (with_multipliers(0, 0, 0, 0, -TINY), "have a first multiplier of 0 or more"),
        (with_multipliers(0, 0, 0, 0, 1 + TINY), "have a first multiplier of 0 or more"),
        (with_multipliers(0, 0, 0, 0), "have 5 multipliers for each facet"),
        ({"sliding": claim().invariant_set.sliding[:2]}, "have bases for 3 slices and 7 combinations"),
        ({"sliding": (*claim().invariant_set.sliding, ((0, 1, 2),))}, "have bases for 3 slices and 7 combinations"),
        ({"resting": claim().invariant_set.resting[:6]}, "have bases for 3 slices and 7 combinations"),
        ({"resting": (*claim().invariant_set.resting, ((0, 1, 2, 3),))}, "have bases for 3 slices and 7 combinations"),
        ({"sliding": ((), *claim().invariant_set.sliding[1:])}, "have bases for 3 slices and 7 combinations"),
        ({"resting": (*claim().invariant_set.resting[:6], ())}, "have bases for 3 slices and 7 combinations"),
        (with_basis("sliding", (0, 1)), "have bases of 3 constraints for slices and of 4 for combinations"),
        (with_basis("resting", (0, 1, 2)), "have bases of 3 constraints for slices and of 4 for combinations"),
        (with_basis("sliding", (0, 1, -1)), "have bases of 3 constraints for slices and of 4 for combinations"),
    ],
)
def test_a_polytope_of_another_shape_is_rejected(changes, reason):
    with pytest.raises(ParameterError, match=reason):
        replace(claim().invariant_set, **changes)


@pytest.mark.parametrize("place", range(5))
@pytest.mark.parametrize("changed", ["empty", "zero", "short"])
def test_each_of_the_first_facets_has_its_entry(place, changed):
    known, axis = claim().invariant_set, (0, 1, 2, 0, 2)[place]
    row = {"empty": (), "zero": (F(0),) * 3, "short": known.facets[place][:axis]}[changed]
    facets = (*known.facets[:place], row, *known.facets[place + 1 :])
    with pytest.raises(ParameterError, match="begin with facets along" if changed == "zero" else "have facets of 3"):
        replace(known, facets=facets)


# ----------------------------------------------------------------------
# The ranges of the plant.


def task(**changes):
    return replace(claim().task, **changes)


def test_the_fault_may_not_open():
    """At the least U, −σ' of the least stress, the effective normal stress reaches 0."""
    plain = task()
    low, high = plain.stress
    assert ranges(plain, F(0), (TINY - low, F(0)), F(0)).slope
    with pytest.raises(ParameterError, match="the fault may open"):
        ranges(plain, F(0), (-low, F(0)), F(0))
    assert 0 < low < high


def test_stresses_are_those_of_u_and_of_the_equilibrium():
    """U = 0 occurs: a range of U on one side of 0 is extended to it."""
    plain = task()
    for one_side, with_zero in (((1, 2), (0, 2)), ((-2, -1), (-2, 0))):
        pairs = [tuple(map(F, pair)) for pair in (one_side, with_zero)]
        assert len({repr(ranges(plain, F(0), pair, F(0))) for pair in pairs}) == 1
    low, high = plain.stress
    wide = ranges(plain, F(0), (F(-2), F(3)), F(0))
    slopes = plain.slip_slopes((low - 2, high + 3))
    assert wide.damping == plain.rate_slopes((low - 2, high + 3))
    assert wide.slope == tuple(pick(v, 0) for pick, v in zip((min, max), slopes, strict=True))


def test_damping_may_be_zero():
    law = replace(claim().task.friction, rate_slope=F(0))
    still = task(damping=F(0), growths=(F(0), F(0)), friction=law)
    assert ranges(still, F(0), (F(0), F(0)), F(0)).damping == (0, 0)
    with pytest.raises(ParameterError, match="w may be negative"):
        ranges(replace(still, growths=(F(0), TINY)), F(0), (F(0), F(0)), F(0))
    low, high = ranges(task(growths=(F(0), F(0))), F(0), (F(0), F(0)), F(0)).damping
    assert ranges(task(growths=(F(0), low)), F(0), (F(0), F(0)), F(0)).damping == (0, high - low)
    with pytest.raises(ParameterError, match="w may be negative"):
        ranges(task(growths=(F(0), low + TINY)), F(0), (F(0), F(0)), F(0))


@pytest.mark.parametrize("growth", ["-1/60", "1/60"])
def test_the_shear_stress_stays_above_the_disturbance(growth):
    """N̂(μ*σ′) at its least against k̂ at its largest times the largest slip, and the disturbance."""
    plain = task(growths=(F(growth), F(0)))
    stiffness = plain.stiffness[1] - F(growth)
    most = plain.area_per_mass[0] * plain.friction.static * plain.normal_stress - stiffness * plain.target_slip
    assert plain.area_per_mass[0] < plain.area_per_mass[1]
    assert plain.stiffness[0] < plain.stiffness[1]
    assert most > 0
    ranges(replace(plain, amplitude=most - TINY), F(0), (F(0), F(0)), F(0))
    with pytest.raises(ParameterError, match="the shear stress may reverse"):
        ranges(replace(plain, amplitude=most), F(0), (F(0), F(0)), F(0))


@pytest.mark.parametrize(
    ("plant", "inside"),
    [
        ({"damping": (F(24), F(24)), "slope": (F(0), F(0))}, False),  # wT = 12: 1/2 + wT/24 is 1
        ({"damping": (F(0), F(0)), "slope": (F(-8), F(0))}, False),  # 1 − 8T²/2 is 0
        ({"damping": (F(0), F(0)), "slope": (F(-7), F(0))}, True),
    ],
)
def test_a_period_is_short_against_damping_and_slope(plant, inside):
    found = replace(PLANT, **plant)
    loop = replace(claim(False).sampled_loop, step=F(1, 2))
    if inside:
        assert stop_bounds(task(), loop, found)
    else:
        with pytest.raises(
            ParameterError, match=r"T_s, or the longest interval .*, is too long, for this damping and friction slope"
        ):
            stop_bounds(task(), loop, found)


# ----------------------------------------------------------------------
# The conditions beside the facets, and the claims.


@pytest.mark.parametrize(
    ("row", "inside"),
    [
        (("45", "30"), True),  # 45/90 + 30/60 = 1
        (("45", "30.0001"), False),
        (("90", "0"), True),
        (("90.0001", "0"), False),
        (("90", "-30"), True),  # the error of the pressure may as well be 0
        (("90.0001", "-30"), False),
        (("-90", "60"), True),
    ],
)
def test_the_first_measurement_leaves_the_loop_in_its_set(row, inside, facets_inside):
    """Noise of the slip is 1/90 m, that of U 1/60 Pa."""
    known = claim()
    assert (known.sampled_loop.slip_noise, known.sampled_loop.pressure_noise) == (F(1, 90), F(1, 60))
    facet = (F(row[0]), F(0), F(row[1]))
    other = replace(
        known.invariant_set,
        facets=(*known.invariant_set.facets[:-1], facet),
        sliding=(((0, 1, 2),),) * 3,
        resting=(((0, 1, 2, 3),),) * 7,
    )
    with pytest.raises(ParameterError) as error:
        stick_slip_bounds(known.task, known.sampled_loop, other)
    assert ("noise of the first measurement" in str(error.value)) is not inside


@pytest.mark.parametrize("noisy", [False, True, "aperiodic"])
def test_claims_are_the_ends_of_the_box_with_what_the_reference_moves(noisy, facets_inside):
    """e1 exceeds the slip error by the noise; within a period the reference moves max r' times T_s."""
    known = claim(noisy)
    found, loop = bounds(known), known.sampled_loop
    moved, low, high = known.task.reference_rates[0] * loop.longest, F(2, 5), F(2, 5)
    assert (known.invariant_set.box[3], known.invariant_set.box[0]) == (low, high)
    assert found.slip_behind == low + loop.slip_noise + moved
    assert found.slip_ahead == high - loop.slip_noise + moved
    assert found.peak_slip_rate == 1
    push = module.feedback_range(known.task, loop, known.invariant_set)
    assert (found.least_pressure, found.largest_pressure) == (-40 - push[1], 40 - push[0])


@pytest.mark.parametrize("longest", [F(0), F(3, 4)])
def test_weakening_is_slow_against_the_longest_interval(longest, facets_inside):
    T = longest or F(1, 2)
    loop = {"step": F(1, 2), "longest_step": longest}
    for slope in (1 / T**2, 1 / T**2 - TINY):
        facets_inside.setattr(module, "ranges", lambda *_, slope=slope: replace(PLANT, slope=(F(-1), slope)))
        facets_inside.setattr(module, "_bracket", lambda *_: F(0))
        facets_inside.setattr(module, "verifiers", lambda *_: [])
        facets_inside.setattr(module, "feedback_range", lambda *_: (F(-1), F(1)))
        if slope * T**2 < 1:
            assert bounds(**loop)
        else:
            with pytest.raises(
                ParameterError, match=r"T_s, or the longest interval .*, is too long for this weakening"
            ):
                bounds(**loop)


def test_the_disturbance_may_equal_the_loss_to_the_range_of_beta(facets_inside):
    amplitude = claim().task.amplitude
    facets_inside.setattr(module, "_bracket", lambda *_: amplitude)
    assert bounds()
    facets_inside.setattr(module, "_bracket", lambda *_: amplitude + TINY)
    with pytest.raises(ParameterError, match="too small for this range of the input gain"):
        bounds()


@pytest.mark.parametrize("holds", [True, False])
@pytest.mark.parametrize("ahead", ["1/2", "1/5"])
def test_an_implicit_step_is_deadbeat_for_the_larger_slip_error(holds, ahead, facets_inside):
    known, seen = claim(False), []
    step = known.sampled_loop.step
    deadbeat = replace(known.sampled_loop.law, target_gain=F(2), rate_gain=F(2), return_rate=1 / step)
    law = replace(deadbeat, pull=(Power(factor=(F(1), F(1)), exponent=F(1, 2), argument="slip"),))
    facets = list(known.invariant_set.facets)
    facets[0] = (1 / F(ahead), F(0), F(0))

    def judged(root, time, slip, rate):
        seen.append((root.pull, time, slip, rate))
        return holds

    facets_inside.setattr(module, "sector_is_valid", judged)
    facets_inside.setattr(module, "verifiers", lambda *_: [])
    facets_inside.setattr(module, "feedback_range", lambda *_: (F(-1), F(1)))
    other = replace(known.invariant_set, facets=tuple(facets))
    loop = replace(known.sampled_loop, law=law)
    moved = known.task.reference_rates[0] * step
    if holds:
        assert stick_slip_bounds(known.task, loop, other)
    else:
        with pytest.raises(ParameterError, match="may not be deadbeat everywhere in the polytope"):
            stick_slip_bounds(known.task, loop, other)
    rate = max(F(1), known.task.reference_rates[0])
    assert seen == [(law.pull, step, max(F(ahead), F(2, 5)) + moved, rate)]


def test_numbers_beyond_floats_decide_nothing():
    known = claim(False)
    facets = list(known.invariant_set.facets)
    facets[6] = (F(10) ** 400, F(1), F(1))
    with pytest.raises(ParameterError, match="must be within the range of floats"):
        stick_slip_bounds(known.task, known.sampled_loop, replace(known.invariant_set, facets=tuple(facets)))


# ----------------------------------------------------------------------
# Parts.


def test_only_certainly_negative_flagged_numbers_become_zero():
    values = np.array([fmpq(1, 2), fmpq(-1, 2), fmpq(0), fmpq(-1, 2)], dtype=object)
    found = EXACT.without(values, np.array([True, True, True, False]))
    assert list(found) == [fmpq(1, 2), 0, 0, fmpq(-1, 2)]


@pytest.mark.parametrize("place", [1, *(SLICES + i for i, first in enumerate(COMBINATIONS) if first[0] == 1)])
def test_in_the_middle_slice_the_end_of_e1_is_where_the_target_rate_vanishes(place):
    known = claim()
    found = module.verifiers(known.task, known.sampled_loop, known.invariant_set, PLANT)[place]
    fastest = known.task.reference_rates[0] + known.sampled_loop.target_noise
    assert list(found.rows[found.last])[:3] == [1, 0, 0]
    assert F(int(found.ends[found.last].p), int(found.ends[found.last].q)) == fastest / F(9, 5)


def test_the_slip_until_a_stop_is_the_least_bound_for_the_fastest_start(monkeypatch):
    """g·y + h at the largest y, which is 1; the disturbance of 1/8 is not below −S⁻ times this slip."""
    known = claim()
    monkeypatch.setattr(module, "stop_bounds", lambda *_: ((F(1, 20), F(1, 5)), (F(1, 30), F(1, 3))))

    def found(slope):
        plant = replace(PLANT, slope=(slope, F(1, 20)))
        return module.verifiers(known.task, known.sampled_loop, known.invariant_set, plant)

    assert {one.sizes[3] for one in found(F(-1, 2))[SLICES:]} == {fmpq(1, 4)}
    with pytest.raises(ParameterError, match="too small for the condition of rest"):
        found(F(-1, 2) - TINY)


@pytest.mark.parametrize(("place", "entry"), [(0, "5"), (3, "-5"), (2, "1/3"), (4, "-1/3")])
def test_sizes_are_those_of_the_farther_side(place, entry):
    """The other side of the box keeps its 2/5 and 4."""
    known = claim()
    facets = [*known.invariant_set.facets]
    facets[place] = tuple(F(entry) if v else v for v in facets[place])
    smaller = replace(known.invariant_set, facets=tuple(facets))
    for one in module.verifiers(known.task, known.sampled_loop, smaller, None):
        assert list(one.sizes) == [fmpq(2, 5), 1, 4]


def test_rest_needs_a_force_below_the_disturbance():
    """b·β_max·(U + m·N) ≥ H − |S⁻|δ with U = 3·(9/5 − q)·e1 + 2y + d, q = 9/5 or 0 the slope of the least r′ in e1."""
    known = claim()
    plant = known.task
    lines = module.polytopes(plant, known.sampled_loop, (), PLANT)
    most = plant.beta[1] * plant.authority
    for place, combination in enumerate(module.LEAST):
        row, room = lines[SLICES + place][-7]
        slope = 0 if COMBINATIONS[combination][2] else F(27, 5)
        assert row == (-most * slope, -2 * most, -most, PLANT.slope[0])
        assert room == most * F(3, 2) / 90 - plant.amplitude
