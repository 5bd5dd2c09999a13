"""Fields of the plant of several blocks, from the plant of one block."""

from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import pytest

from quakedesign import load_chain, load_fault
from quakedesign.errors import ParameterError
from quakedesign.exact import LowerBound, UpperBound
from quakedesign.fault.friction.weakening import SlipRateWeakening
from quakedesign.plant import UncertainPlant, uncertain_plant
from quakedesign.plant.block_plant import block_parts
from quakedesign.plant.plant_values import unit

PAPER = load_fault("real-fault")
WIDE = load_fault("real-fault", box="ten-percent")
CHAIN = load_chain(Path(__file__).parents[1] / "data" / "three_blocks.toml")


def elastic(fault, blocks):
    """G·n²/(ρL²) of n strips of a fault of the length L."""
    return F(str(fault.shear_modulus)) * blocks**2 / (F(str(fault.density)) * F(str(fault.length)) ** 2)


def needed(task):
    """Largest w·r' + r'' [m/s²]."""
    return max(map(abs, task.rate_chord)) * task.reference_rates[0] + task.reference_rates[1]


def test_two_blocks_with_a_well_each():
    task, K = uncertain_plant(WIDE), elastic(WIDE, 2)
    parts = block_parts(WIDE, 2, "each", None)
    w, half = sum(task.rate_chord) / 2, (task.rate_chord[1] - task.rate_chord[0]) / 2
    assert half > 0
    assert [list(row) for row in parts["A"]] == [[0, 0, 1, 0], [0, 0, 0, 1], [-K, K, -w, 0], [K, -K, 0, -w]]
    b = task.authority
    assert [list(row) for row in parts["B"]] == [[0, 0], [0, 0], [b, 0], [0, b]]
    assert not parts["C"]
    enters = unit(4, 2), unit(4, 3)
    assert list(parts["sectors"]) == [
        f"{what} of block {i}" for what in ("slope", "damping", "input gain") for i in (1, 2)
    ]
    for i in (0, 1):
        assert parts["sectors"][f"slope of block {i + 1}"] == {
            "entry": enters[i], "row": unit(4, i), "slopes": task.slip_chord, "within": None,
        }  # fmt: skip
        damping = parts["sectors"][f"damping of block {i + 1}"]
        assert damping == {"entry": enters[i], "row": enters[i], "slopes": (-half, half)}
        gain = parts["sectors"][f"input gain of block {i + 1}"]
        acts = [0] * 4 + [b * (i == 0), b * (i == 1)]
        assert (gain["entry"], list(gain["row"]), gain["slopes"]) == (enters[i], acts, (0, task.beta[1] - 1))
        assert parts["disturbances"][f"force on block {i + 1}"] == (enters[i], needed(task) + task.amplitude)
    drift = max(map(abs, task.slip_chord)) * task.reference_rates[0] / b
    assert parts["loads"] == {"pressure 1": ((1, 0), None, drift), "pressure 2": ((0, 1), None, drift)}
    assert parts["outputs"] == {
        "slip error 1": unit(4, 0), "slip error 2": unit(4, 1), "slip-rate error 1": enters[0],
        "slip-rate error 2": enters[1],
    }  # fmt: skip
    assert parts["controls"] == ("pressure 1", "pressure 2")
    assert parts["units"] == {
        "slip error 1": "m", "slip error 2": "m", "slip-rate error 1": "m/s", "slip-rate error 2": "m/s",
        "pressure 1": "Pa", "pressure 2": "Pa", "force on block 1": "m/s²", "force on block 2": "m/s²",
    }  # fmt: skip
    assert parts["name"] == "2 blocks of real-fault, 2 wells"


def test_one_well_acts_on_all_blocks_and_measures_their_mean():
    task = uncertain_plant(PAPER)
    parts = block_parts(PAPER, 2, "one", None)
    assert parts["name"] == "2 blocks of real-fault, one well"
    assert [list(row) for row in parts["B"]] == [[0], [0], [task.authority], [task.authority]]
    assert [list(row) for row in parts["C"]] == [[F(1, 2), F(1, 2), 0, 0], [0, 0, F(1, 2), F(1, 2)]]
    assert list(parts["disturbances"]) == [
        "force on block 1", "force on block 2", "balance of block 1", "balance of block 2",
    ]  # fmt: skip
    for i in (0, 1):
        enters, size = parts["disturbances"][f"balance of block {i + 1}"]
        assert enters == unit(4, i)
        assert 0 < size < 100 * task.reference_rates[0]
        assert parts["units"][f"balance of block {i + 1}"] == "m/s"
        assert parts["sectors"][f"slope of block {i + 1}"]["within"] is None
    assert list(parts["loads"]) == ["pressure 1"]
    assert (parts["controls"], parts["loads"]["pressure 1"][0]) == (("pressure 1",), (1,))


@pytest.mark.parametrize(
    ("fault", "box"),
    [(PAPER, "paper"), (WIDE, "ten-percent, the stiffness of the springs between blocks known exactly")],
)
def test_remarks_name_the_box_and_what_the_reference_needs(fault, box):
    task, remarks = uncertain_plant(fault), block_parts(fault, 2, "each", None)["remarks"]
    assert remarks["plant"] == (
        "of 2 blocks of real-fault, 2 wells, without stick (friction continues to negative slip rates), for all "
        f"friction and constants of box {box}"
    )
    assert remarks["disturbances"] == (
        f"on a block: {LowerBound(task.amplitude).quantity('m/s²', 4)} of disturbance and at most "
        f"{UpperBound(needed(task)).quantity('m/s²')} that the reference needs"
    )


def test_springs_without_a_spread_of_the_stiffness_are_still_those_of_the_nominal_fault():
    box = replace(WIDE.box, stiffness=F(0), damping=F(0))
    assert "springs between blocks known exactly" in block_parts(
        replace(WIDE, box=box), 2, "each", None
    )["remarks"]["plant"]  # fmt: skip


def test_blocks_that_differ_have_their_own_ranges_and_the_largest_need():
    law = SlipRateWeakening(residual=0.25, drop=0.08, critical_rate=1.0)
    chain = replace(CHAIN, blocks=(CHAIN.blocks[0], replace(CHAIN.blocks[1], friction=law), CHAIN.blocks[2]))
    tasks, parts = [uncertain_plant(fault) for fault in chain.faults], block_parts(chain, None, "each", None)
    for i, task in enumerate(tasks):
        assert parts["sectors"][f"slope of block {i + 1}"]["slopes"] == task.slip_chord
        assert parts["disturbances"][f"force on block {i + 1}"][1] == needed(task) + task.amplitude
    assert len({needed(task) for task in tasks}) > 1
    most = UpperBound(max(map(needed, tasks))).quantity("m/s²")
    assert f"at most {most} that the reference needs" in parts["remarks"]["disturbances"]


@pytest.mark.parametrize("count", [2, 3])
def test_pressures_that_diffuse_settle_at_the_shares_of_the_wells(count):
    """The shift of a load solves the steady state of the pressures, and its force acts on one block."""
    lengths = {2: (2500.0, 2500.0), 3: (2000.0, 1500.0, 1500.0)}[count]
    blocks = tuple(replace(CHAIN.blocks[0], length=length) for length in lengths)
    wells = (1000.0, 3000.0, 4000.0)[:count]
    chain = replace(CHAIN, blocks=blocks, wells=wells, diffusivity=1e6)
    parts, task = block_parts(chain, None, "each", None), uncertain_plant(chain.faults[0])
    assert parts["remarks"]["plant"].endswith("pressures diffuse along the fault, 1e+06 m²/s")
    N, A, B = count, parts["A"], parts["B"]
    assert [list(row[:N]) for row in parts["C"][:N]] == [list(unit(N, i)) for i in range(N)]
    for place, (control, shift, _) in enumerate(parts["loads"].values()):
        moves = [
            sum(a * b for a, b in zip((*of_states, *of_controls), (*shift, *control), strict=True))
            for of_states, of_controls in zip(A, B, strict=True)
        ]
        assert all(v == 0 for v in moves[2 * N :])
        assert moves[N : 2 * N] == [task.authority * (i == place) for i in range(N)]
        assert list(shift[: 2 * N]) == [0] * 2 * N


@pytest.mark.parametrize(
    ("blocks", "wells", "coupling", "said"),
    [
        (None, "each", None, "blocks must be a whole number from 2 to 20. Received None"),
        (1, "each", None, "blocks must be a whole number from 2 to 20. Received 1"),
        (21, "each", None, "blocks must be a whole number from 2 to 20. Received 21"),
        (2, "some", None, "wells"),
        (2, "each", 0, "coupling of blocks must be positive. Received 0 1/s"),
        (2, "each", -1, "coupling of blocks must be positive. Received -1 1/s"),
    ],
)
def test_blocks_wells_and_springs_are_rejected(blocks, wells, coupling, said):
    with pytest.raises(ParameterError, match=said):
        block_parts(PAPER, blocks, wells, coupling)


def test_up_to_twenty_blocks_have_a_plant():
    assert len(UncertainPlant.from_blocks(PAPER, 20).A) == 40
    assert block_parts(PAPER, 2, "each", "3")["A"][2][:2] == [-3, 3]


def test_the_disturbance_is_printed_rounded_down_to_four_digits():
    fault = replace(PAPER, disturbance=replace(PAPER.disturbance, amplitude=3.23456e-4))
    said = block_parts(fault, 2, "each", None)["remarks"]["disturbances"]
    assert said.startswith("on a block: 323.4 µm/s² of disturbance")
