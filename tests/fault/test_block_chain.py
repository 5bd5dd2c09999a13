"""Files of several blocks: lengths, shares and springs by hand, and what is refused in one line."""

from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from scipy.linalg import expm

import quakedesign as qd
from quakedesign.errors import ParameterError, QuakedesignError, ScenarioError
from quakedesign.fault import load_chain, parse_fault

PATH = Path(__file__).parents[1] / "data" / "three_blocks.toml"
TEXT = PATH.read_text()
CHAIN = load_chain(PATH)


def test_a_file_gives_blocks_wells_and_what_they_share():
    assert CHAIN.name == "three-blocks"
    assert CHAIN.lengths == (2000, 1500, 1500)
    assert CHAIN.middles == (1000, 2750, 4250)
    assert [b.effective_normal_stress for b in CHAIN.blocks] == [50e6, 45e6, 50e6]
    assert [b.friction.name for b in CHAIN.blocks] == ["exponential-slip-weakening"] * 2 + ["linear-slip-weakening"]
    assert CHAIN.blocks[1].friction == CHAIN.fault.friction
    assert not CHAIN.alike
    assert load_chain("real-fault") is None


def test_pressure_is_linear_between_wells_and_constant_beyond_them():
    # the middle of block 2 lies 250 m of 1750 m behind the second well
    assert CHAIN.shares == ((1, 0, 0), (0, F(6, 7), F(1, 7)), (0, 0, 1))
    beyond = replace(CHAIN, wells=(1500.0, 2000.0))
    assert beyond.shares == ((1, 0), (0, 1), (0, 1))


def test_diffusing_pressure_settles_at_the_shares():
    slow = replace(CHAIN, wells=(1000.0, 2000.0, 4900.0), diffusivity=0.1)
    flow, wells = sp.Matrix(slow.flow)[:, :2], sp.Matrix(slow.flow)[:, 2:]
    settled = -flow.LUsolve(wells)
    assert [tuple(map(F, map(str, row))) for row in settled.tolist()] == list(slow.shares[1:])
    assert slow.pressures == ((0, 0, 1, 0, 0), (1, 0, 0, 0, 0), (0, 1, 0, 0, 0))
    assert (CHAIN.flow, CHAIN.pressures) == ((), CHAIN.shares)


def test_diffusion_is_that_of_a_strip_with_one_end_held_and_one_closed():
    """1 − Σ 4/((2n+1)π)·sin((2n+1)πx/2l)·exp(−D((2n+1)π/2l)²t); errors fall with the square of the lengths."""
    errors = []
    for count in (10, 20):
        blocks = tuple(replace(CHAIN.blocks[0], length=5000.0 / count) for _ in range(count))
        chain = replace(CHAIN, blocks=blocks, wells=(2500.0 / count,), diffusivity=0.3)
        x = np.array([float(v) for v in chain.middles])[1:] - 2500 / count
        far, time = 5000 - 2500 / count, 0.1 * 5000**2 / 0.3
        n = (2 * np.arange(200)[:, None] + 1) * np.pi / 2
        exact = 1 - (2 / n * np.sin(n * x / far) * np.exp(-0.3 * (n / far) ** 2 * time)).sum(axis=0)
        flow = np.vstack([np.array(chain.flow, dtype=float), np.zeros(count)])
        errors.append(np.abs(expm(flow * time)[:-1, -1] - exact).max())
    assert errors[1] < 1e-3
    assert errors[1] < errors[0] / 3


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ('diffusivity = "0 m^2/s"', "diffusivity must be positive"),
        ("diffusivity = 1", "diffusivity"),
        ('diffusivity = "1 m"', "diffusivity"),
    ],
)
def test_a_diffusivity_is_positive_with_its_unit(written, said, tmp_path):
    path = tmp_path / "fault.toml"
    path.write_text(f"{written}\n{TEXT}")
    with pytest.raises(QuakedesignError, match=said):
        load_chain(path)
    path.write_text(f'diffusivity = "2 m^2/s"\n{TEXT}')
    assert load_chain(path) == replace(CHAIN, diffusivity=2.0)


def test_diffusion_along_the_fault_needs_friction_without_a_state():
    sliding = load_chain(PATH.with_name("three_sliding_blocks.toml"))
    with pytest.raises(ParameterError, match="diffusivity along the fault needs friction without a state"):
        replace(sliding, diffusivity=1.0)


def test_springs_are_those_of_elastic_strips():
    """Stiffness G·h·h over the distance of the middles, mass ρ·h·h·length, h the side of the fault."""
    side, found = 5000, {(i, j): K for i, j, K in CHAIN.springs}
    for (i, j), distance in {(0, 1): 1750, (1, 2): 1500}.items():
        stiffness = F(30 * 10**9) * side * side / distance
        for a, b in ((i, j), (j, i)):
            assert found[a, b] == stiffness / (2500 * side * side * CHAIN.lengths[a])
    assert len(found) == 4


def test_equal_strips_are_those_of_a_fault_that_is_cut():
    blocks = tuple(replace(CHAIN.blocks[0], length=1000.0) for _ in range(5))
    cut = replace(CHAIN, blocks=blocks, wells=tuple(500.0 + 1000 * i for i in range(5)))
    one = qd.UncertainPlant.from_blocks(CHAIN.fault, 5)
    same = qd.UncertainPlant.from_blocks(cut)
    assert (same.A, same.B, same.sectors) == (one.A, one.B, one.sectors)
    assert (same.disturbances, same.loads) == (one.disturbances, one.loads)
    under_one = qd.UncertainPlant.from_blocks(replace(cut, wells=(2500.0,)))
    assert under_one.disturbances == qd.UncertainPlant.from_blocks(CHAIN.fault, 5, wells="one").disturbances


def test_a_load_is_held_by_the_pressures_that_hold_its_block_alone():
    plant = qd.UncertainPlant.from_blocks(CHAIN)
    for i, load in enumerate(plant.loads.values()):
        held = [sum(s * p for s, p in zip(row, load.control, strict=True)) for row in CHAIN.shares]
        assert held == [int(i == j) for j in range(3)]


def test_with_fewer_wells_each_measures_an_average_by_its_shares():
    plant = qd.UncertainPlant.from_blocks(replace(CHAIN, wells=(1000.0, 4000.0)))
    # shares (1, 0), (5/12, 7/12), (0, 1) in columns of sums 17/12 and 19/12
    first, second = (F(12, 17), F(5, 17), F(0)), (F(0), F(7, 19), F(12, 19))
    none = (F(0),) * 3
    assert plant.C == ((*first, *none), (*second, *none), (*none, *first), (*none, *second))
    assert [load.control for load in plant.loads.values()] == [(1, 0), (0, 1)]


def without(text, start):
    """The text without the lines from one on, up to an empty line."""
    before, _, after = text.partition(start)
    return before + after.partition("\n\n")[2]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (TEXT.replace('length = "2 km"', 'length = "1 km"'), "must add up to the length of the fault, 5000 m"),
        (TEXT.replace('position = "2.5 km"', 'position = "0.5 km"'), "positions of wells must be from 0 to"),
        (TEXT.replace('position = "4.25 km"', 'position = "6 km"'), "positions of wells must be from 0 to 5000"),
        (TEXT.split("[[well]]")[0], "at most as many wells as blocks. Received 3 blocks and 0 wells"),
        (TEXT.replace('length = "2 km"', 'size = "2 km"'), "block 1: size is not a known key"),
        (TEXT.replace('length = "2 km"', 'length = "2 MPa"'), "block 1: length"),
        (TEXT.replace('position = "1 km"', "position = 1"), "well 1: position"),
        (
            TEXT.replace('critical_slip = "300 mm"', 'critical_slip = "-300 mm"'),
            "block 3: critical_slip must be",
        ),
        (TEXT.replace('"45 MPa"', '"-45 MPa"'), "block 2: effective_normal_stress must be positive"),
        (TEXT.replace('law = "linear-slip-weakening"', 'law = "linear"'), "block 3: friction law"),
        (TEXT.replace('length = "2 km"', 'length = "nan m"'), "block 1: length must be positive and finite"),
        (TEXT.replace('"45 MPa"', '"1e300 Pa"'), "block 2: effective_normal_stress must have a magnitude"),
        (TEXT.replace('position = "1 km"', 'position = "inf m"'), "well 1: position must be zero or positive, and fin"),
        (TEXT.replace('position = "1 km"', 'position = "-1 m"'), "well 1: position must be zero or positive"),
        (TEXT.replace('position = "1 km"', 'position = "2.5 km"'), "Received 2500, 2500, 4250 m. Sort the wells"),
        (
            TEXT.replace('length = "2 km"', 'length = "1.9999999999999 km"'),
            "5000 m. Received 4999.9999999999 m, which differs by 1e-10 m. Change one of these lengths",
        ),
        (TEXT.split("[[block]]")[0] + '[[well]]\nposition = "1 km"\n', "Received 0 blocks and 1 well. Add or omit"),
        (TEXT.replace('density = "2500 kg/m^3"', ""), "density"),
        (TEXT.replace('length = "2 km"', 'length = "2 km"\nfriction = {}'), "block 1: friction.law must be given"),
        (TEXT.replace('length = "2 km"', 'length = "0 m"\nfriction = 3'), "a table. Received 3.* block 1: length must"),
        (TEXT.split("[[block]]")[0] + "[block]\nlength = 1\n", r"block must be \[\[block\]\] tables"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(text, said, tmp_path):
    path = tmp_path / "blocks.toml"
    path.write_text(text)
    with pytest.raises(QuakedesignError, match=said) as refused:
        load_chain(path)
    assert "\n" not in str(refused.value)
    assert str(refused.value).startswith(f"{path}: ")


def test_every_wrong_table_is_named_at_once(tmp_path):
    path = tmp_path / "blocks.toml"
    path.write_text(TEXT.replace('length = "2 km"', 'length = "0 m"').replace('"45 MPa"', '"0 Pa"'))
    with pytest.raises(ParameterError, match=r"2 errors\. \(1\) block 1: length must.* \(2\) block 2: effective"):
        load_chain(path)


def test_a_well_that_is_no_number_is_named_in_python():
    with pytest.raises(ParameterError, match="position of a well must be a finite number"):
        replace(CHAIN, wells=(float("nan"),))


def test_friction_with_a_state_beside_friction_without_one_is_refused(tmp_path):
    state = (
        'law = "rate-and-state-aging"\nreference_coefficient = 0.6\ndirect_effect = 0.01\nevolution_effect = 0.015\n'
        'critical_slip = "1 mm"\nreference_rate = "1 um/s"\nslowest_rate = "1e-12 m/s"\nfastest_rate = "1 m/s"\n'
    )
    path = tmp_path / "blocks.toml"
    path.write_text(TEXT.split('law = "linear')[0] + state + "\n" + TEXT.split('"300 mm"\n')[1])
    condition = r"all blocks of a fault or none must have friction with a state.* in block 3. Change one"
    with pytest.raises(QuakedesignError, match=condition):
        load_chain(path)


def test_what_takes_one_block_refuses_the_file_and_says_what_takes_it():
    with pytest.raises(
        ScenarioError, match="Use the commands fault, design, guarantee, compare, simulate, export or limits"
    ):
        qd.load_fault(PATH)
    with pytest.raises(ScenarioError, match="no \\[\\[block\\]\\]"):
        parse_fault(TEXT, "text")


@pytest.mark.parametrize(
    ("chain", "given", "said"),
    [
        (replace(CHAIN, wells=(100.0, 200.0)), {}, "wells that act independently. Received 2 wells for 3 blocks"),
        (
            replace(CHAIN, wells=(100.0, 200.0, 300.0)),
            {},
            "3 wells for 3 blocks, whose effects on the measured slips are linearly dependent",
        ),
        (
            replace(CHAIN, wells=(2500.0,), fault=CHAIN.fault.with_box("ten-percent")),
            {},
            "fewer wells than blocks needs exact constants, box paper",
        ),
        (CHAIN, {"blocks": 3}, "has its own blocks, wells and coupling"),
        (CHAIN, {"wells": "one"}, "has its own blocks, wells and coupling"),
        (CHAIN, {"coupling": 12}, "has its own blocks, wells and coupling"),
    ],
)
def test_wells_that_a_guarantee_does_not_cover_are_refused(chain, given, said):
    with pytest.raises(ParameterError, match=said):
        qd.UncertainPlant.from_blocks(chain, **given)


def test_wells_may_be_at_both_ends_of_a_fault_of_two_blocks_at_least():
    ends = replace(CHAIN, wells=(0.0, CHAIN.fault.length))
    assert [sum(row) for row in ends.shares] == [1, 1, 1]
    assert ends.shares[0] == (1 - CHAIN.middles[0] / 5000, CHAIN.middles[0] / 5000)
    with pytest.raises(ParameterError, match=r"2 to 20 blocks.*Received 1 block and 1 well"):
        replace(CHAIN, blocks=(replace(CHAIN.blocks[0], length=CHAIN.fault.length),), wells=(1.0,))
    for wells in ((), (1.0, 2.0, 3.0, 4.0)):
        with pytest.raises(ParameterError, match="at most as many wells as blocks"):
            replace(CHAIN, wells=wells)
