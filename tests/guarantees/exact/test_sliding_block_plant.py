"""The plant of blocks in slow sliding: ranges at all corners of a damped fault, and every field of the plant."""

from dataclasses import replace
from fractions import Fraction as F
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.guarantees.exact.sliding_blocks import BlockClaims, SlidingBlocks

CHAIN = qd.load_chain(Path(__file__).parents[2] / "data" / "three_sliding_blocks.toml")
CLAIMS = BlockClaims(log_state=F("0.02"), pull=F(30000), push=F(200000))
V, D, MU, A, B = F(1, 10**6), F(8, 1000), F(6, 10), F(1, 100), F(15, 1000)


def blocks_of(chain=CHAIN, lag=800, stress=10000):
    return SlidingBlocks(chain=chain, lag=F(lag), stress=F(stress))


def faulty(chain=CHAIN, **changes):
    """The chain of a fault with other constants."""
    return replace(chain, fault=replace(chain.fault, **changes))


def changed(block, **values):
    """A block with other friction."""
    return replace(block, friction=replace(block.friction, **values))


DAMPED = blocks_of(faulty(damping=1.0405e20))


def test_ranges_of_a_damped_block_are_those_of_all_corners():
    """γN·b/(Na + HVγ') and γ/(Na + HVγ'), with γ and γ' the chords of e^y - 1 for |y| ≤ Y and N one of its ends."""
    task = DAMPED.tasks[0]
    damping = float(task.radiation * task.rate)
    for one in DAMPED._ranges(CLAIMS):
        Y, ends = float(one.log_rate), [float(v) for v in task.normal_stress(CLAIMS.push)]
        chords = [-np.expm1(-Y) / Y, np.expm1(Y) / Y]
        corners = list(product(chords, chords, ends))
        by_state = [g * n * float(B) / (n * float(A) + damping * h) for g, h, n in corners]
        by_pull = [g / (n * float(A) + damping * h) for g, h, n in corners]
        assert [float(v) for v in one.by_state] == pytest.approx([min(by_state), max(by_state)], rel=1e-7)
        assert [float(v) for v in one.by_pull] == pytest.approx([min(by_pull), max(by_pull)], rel=1e-7)
        assert one.by_state[0] < min(by_state) < max(by_state) < one.by_state[1]
        assert one.by_pull[0] < min(by_pull) < max(by_pull) < one.by_pull[1]
        Z, W = float(CLAIMS.log_state), float(CLAIMS.pull)
        assert max(by_state) > 1.05 * min(by_state)  # the damping counts
        alpha, kappa = ([v / g for v, (g, _, _) in zip(values, corners, strict=True)] for values in (by_state, by_pull))
        needed = max(alpha) * Z + max(kappa) * (W + float(one.stress))
        assert needed <= Y <= 1.003 * needed
    assert DAMPED.log_rate(CLAIMS) == max(one.log_rate for one in DAMPED._ranges(CLAIMS))


def test_the_largest_rate_is_that_of_the_fastest_block():
    chain = replace(CHAIN, blocks=(changed(CHAIN.blocks[0], direct_effect=0.004), *CHAIN.blocks[1:]))
    ranges = blocks_of(chain)._ranges(CLAIMS)
    assert ranges[0].log_rate > 1.5 * ranges[1].log_rate
    assert blocks_of(chain).log_rate(CLAIMS) == ranges[0].log_rate


def test_rounding_of_the_coefficient_counts_along_the_whole_distance():
    """Half the range of μ*, times Q + K·distance/μ*."""
    known, open_to = blocks_of(), blocks_of()
    tasks = tuple(replace(t, distance=F(1, 4)) for t in known.tasks)
    vars(known)["tasks"] = tasks
    vars(open_to)["tasks"] = tuple(
        replace(t, ranges={**t.ranges, "coefficient": (F("0.59"), F("0.61"))}) for t in tasks
    )
    stresses = [float(one._ranges(CLAIMS)[0].stress) for one in (known, open_to)]
    expected = 0.01 * (2e5 + float(tasks[0].stiffness) * 0.25 / 0.59)
    assert stresses[1] - stresses[0] == pytest.approx(expected, rel=1e-3)


def test_a_reference_that_swings_pulls_the_block_faster():
    """(K + 2Σk)·V·swing more in w', times the inertia mVe^Y/(Na): positive, and that of the formula."""
    dense = {"density": 2670e4, "shear_modulus": 32.04e9}
    task = replace(CHAIN.fault.reference, ramp=0.05)
    swinging, steady = blocks_of(faulty(**dense, reference=task)), blocks_of(faulty(**dense))
    rate = swinging.tasks[0].rate
    vars(steady)["tasks"] = tuple(
        replace(t, rate=rate, ramp=s.ramp) for t, s in zip(steady.tasks, swinging.tasks, strict=True)
    )
    one, other = (float(blocks._ranges(CLAIMS)[1].stress) for blocks in (swinging, steady))
    swing, plant = float(swinging.tasks[0].swing), swinging.tasks[1]
    assert swing > 0.05
    Y, Z = float(swinging._ranges(CLAIMS)[1].log_rate), float(CLAIMS.log_state)
    springs = float(sum(map(abs, swinging.springs[1])))
    inertia = float(plant.inertia * rate) * np.exp(Y) / (float(plant.normal_stress(CLAIMS.push)[0]) * float(A))
    along = float(plant.pressure_per_slip * rate) * (float(A) * Y + float(B) * Z)
    assert one - other == pytest.approx((springs + along / float(rate)) * float(rate) * swing * inertia, rel=0.05)


def test_every_field_of_the_plant():
    """Two wells differ in their shares; states are slips over D, logarithms of states, and pressures in MPa."""
    chain = replace(CHAIN, blocks=(CHAIN.blocks[0], changed(CHAIN.blocks[1], critical_slip=0.016), CHAIN.blocks[2]))
    blocks = blocks_of(chain)
    plant, ranges = blocks.plant(CLAIMS), blocks._ranges(CLAIMS)
    slip = [F(8, 1000), F(16, 1000), F(8, 1000)]

    def unit(i):
        return tuple(F(int(i == j)) for j in range(9))

    assert plant.A[:6] == ((F(0),) * 9,) * 6
    assert plant.B[:6] == ((F(0),) * 3,) * 6
    for k in range(3):
        assert plant.A[6 + k] == tuple(-v / 800 for v in unit(6 + k))
        assert plant.B[6 + k] == tuple(F(int(j == k), 800) for j in range(3))
        assert plant.C[k] == tuple(slip[k] * v for v in unit(k))
    for i in range(3):
        aged = V / slip[i]
        slips = tuple(aged * (a - b) for a, b in zip(unit(i), unit(3 + i), strict=True))
        state, pull, ageing = (
            plant.sectors[name]
            for name in (
                f"rate of block {i + 1} by its state",
                f"rate of block {i + 1} by its pull",
                f"ageing of block {i + 1}",
            )
        )
        assert (state.entry, state.row) == (tuple(-v for v in slips), unit(3 + i))
        assert (state.slopes, state.within) == (ranges[i].by_state, CLAIMS.log_state)
        springs = [k * d / 10**6 for k, d in zip(blocks.springs[i], slip, strict=True)]
        assert pull.row == (*springs, 0, 0, 0, *(MU * v for v in chain.shares[i]))
        assert (pull.entry, pull.within) == (slips, CLAIMS.pull / 10**6)
        assert pull.slopes == tuple(10**6 * v for v in ranges[i].by_pull)
        assert (ageing.entry, ageing.row) == (tuple(-aged * v for v in unit(3 + i)), unit(3 + i))
        assert (ageing.slopes, ageing.within) == (ranges[i].ageing, CLAIMS.log_state)
        entry, size = plant.disturbances[f"stress on block {i + 1}"]
        exact = ranges[i].by_pull[1] * ranges[i].stress
        assert entry == slips
        assert exact < size < exact * (1 + F(1, 10**7))
        assert plant.outputs[f"slip error {i + 1}"] == tuple(slip[i] * v for v in unit(i))
        assert plant.outputs[f"log state {i + 1}"] == unit(3 + i)
        assert plant.outputs[f"pull {i + 1}"] == pull.row
    assert list(plant.disturbances) == [f"stress on block {i}" for i in (1, 2, 3)]
    assert list(plant.outputs) == [f"{what} {i}" for what in ("slip error", "log state", "pull") for i in (1, 2, 3)]
    assert plant.controls == ("pressure 1", "pressure 2", "pressure 3")
    assert plant.units == {
        **{f"slip error {i}": "m" for i in (1, 2, 3)}, **{f"pull {i}": "MPa" for i in (1, 2, 3)},
        **{f"pressure {i}": "MPa" for i in (1, 2, 3)},
    }  # fmt: skip


def test_ranges_are_rounded_outward():
    plant = blocks_of(stress="12345.6789")
    said = plant.plant(CLAIMS).remarks["disturbances"]
    assert said.startswith("changes of slip rate, divided by V, due to 12.34 kPa of shear stress and up to ")


def test_a_block_that_just_does_not_press_leaves_no_plant():
    """σ' - P - Q = 0 exactly; a logarithm of the state beyond 3."""
    low = blocks_of().tasks[0].normal_stress(F(0))[0]
    assert blocks_of().log_rate(replace(CLAIMS, push=low)) is None
    assert blocks_of().log_rate(replace(CLAIMS, log_state=F(4))) is None
    assert blocks_of().log_rate(replace(CLAIMS, log_state=F(31, 10))) is None


def alike(count, wells):
    """Blocks of 1 km."""
    block = replace(CHAIN.blocks[0], length=1000.0)
    places = tuple(1000.0 * (k + 0.5) * count / wells for k in range(wells))
    return replace(CHAIN, fault=replace(CHAIN.fault, length=1000.0 * count), blocks=(block,) * count, wells=places)


def test_alike_blocks_may_have_fewer_wells():
    chain = alike(2, 1)
    assert blocks_of(chain).size == 5
    other = replace(chain, blocks=(chain.blocks[0], changed(chain.blocks[0], direct_effect=0.011)))
    with pytest.raises(UnsupportedError, match="must be identical if there are fewer wells"):
        blocks_of(other)


@pytest.mark.parametrize(("lag", "stress"), [("1/9", 1), (1, "1/9")])
def test_small_lags_and_stresses_are_accepted(lag, stress):
    assert blocks_of(lag=lag, stress=stress).size == 9


def test_at_most_thirteen_blocks_are_accepted():
    assert blocks_of(alike(13, 13)).size == 39
    with pytest.raises(ParameterError, match=r"blocks in slow sliding must be 2 to 13\. Received 14"):
        blocks_of(alike(14, 14))
