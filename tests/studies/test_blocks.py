"""May one block stand for a fault: as a value, and as a command."""

import json
from dataclasses import replace
from fractions import Fraction
from fractions import Fraction as F
from pathlib import Path

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.cli import main
from quakedesign.errors import ParameterError
from quakedesign.fault.friction.weakening import SlipRateWeakening
from quakedesign.guarantees.search import block_design
from quakedesign.guarantees.search.plant_search import linear_part
from quakedesign.plant import block_plant, uncertain_plant
from quakedesign.studies import one_block

REAL = qd.load_fault("real-fault")


def run(*arguments):
    with pytest.raises(SystemExit) as stop:
        main([*map(str, arguments)])
    return stop.value.code


@pytest.mark.slow
def test_the_command_proves_two_blocks_and_its_files_are_checked(tmp_path, capsys):
    assert run("blocks", "real-fault", "--most", "2", "--out", tmp_path / "files", "--json") == 0
    (row,) = json.loads(capsys.readouterr().out)["blocks"]
    assert row["verdict"] == "proved"
    assert Fraction(row["slip_rate_error"]) < Fraction("1e-3")
    assert run("check", tmp_path / "files" / "real-fault-2-blocks.json") == 0
    capsys.readouterr()
    file = tmp_path / "files" / "real-fault-2-blocks.json"
    assert run("simulate", "real-fault", "--certificate", file, "--controller", "elqr") == 2
    assert "about an uncertain plant" in capsys.readouterr().err


def test_loose_springs_are_refused_with_the_mode_that_escapes(capsys):
    assert run("blocks", "real-fault", "--most", "2", "--coupling", "0.5") == 1
    assert "a mode that is not measured is unstable" in capsys.readouterr().out


def test_answers_are_told_in_lines_and_numbers():
    answer = one_block(REAL, [2], coupling="0.5")
    assert not answer.proved
    assert answer.peaks(2) is None
    assert answer.lines()[2].startswith("  2 blocks: none: a mode that is not measured is unstable")
    assert answer.to_dict()["blocks"][0]["verdict"] == "undecided"


CHAIN = qd.load_chain(Path(__file__).parents[1] / "data" / "three_blocks.toml")
SHORT = replace(CHAIN.fault, length=4500.0)
ALIKE = replace(CHAIN, fault=SHORT, blocks=(replace(CHAIN.blocks[0], length=1500.0),) * 3, wells=(2250.0,))
LONG = tuple(replace(CHAIN.blocks[0], length=length) for length in (500.0, 3500.0, 500.0))
CASES = {
    "alike, one well": ALIKE,
    "of other lengths, one well": replace(ALIKE, blocks=LONG),
    "one well": replace(CHAIN, wells=(2500.0,)),
    "two": replace(CHAIN, wells=(1e3, 4e3)),
}


def numbers(chain):
    """What a balance depends on, in floats, beside what is derived of it: X, Q [Pa/m] and slopes."""
    plant, tasks = qd.UncertainPlant.from_blocks(chain), [uncertain_plant(fault) for fault in chain.faults]
    first = float(tasks[0].reference_rates[0])
    pulls = np.zeros((3, 3))
    for i, j, K in chain.springs:
        pulls[i, j], pulls[i, i] = float(K), pulls[i, i] - float(K)
    weights = np.array([[float(v) for v in row[:3]] for row in plant.C[: len(chain.wells)]])
    moves = np.array([float(v) for name, (_, v) in plant.disturbances.items() if "balance" in name]) / first
    pressures = np.array([float(load.rate) for load in plant.loads.values()]) / first
    slopes = np.array([[float(v) for v in one.slopes] for name, one in plant.sectors.items() if "slope" in name])
    return tasks, pulls, np.array(chain.shares, dtype=float), weights, moves, pressures, slopes


@pytest.mark.parametrize("case", CASES)
def test_balances_of_random_slopes_and_coefficients_stay_within_their_bounds(case):
    """Linear equations for slopes, gains and coefficients at random ends of their ranges."""
    tasks, pulls, shares, weights, moves, pressures, slopes = numbers(CASES[case])
    m, random = len(weights), np.random.default_rng(7)
    largest, reached, steepest = np.zeros(3), np.zeros(m), slopes[:, 1] * 0
    n, k = (np.array([float(getattr(t, name)[0]) for t in tasks]) for name in ("area_per_mass", "stiffness"))
    k = k - np.array([float(t.growths[0]) for t in tasks])
    law = [t.friction for t in tasks]
    least, most, static, weakening = (
        np.array([float(getattr(one, name)) for one in law]) for name in ("least", "largest", "static", "weakening")
    )
    normal = np.array([float(t.normal_stress) for t in tasks])
    for _ in range(400):
        s = np.where(random.random(3) < 0.5, *slopes.T)
        force = np.where(random.random(3) < 0.5, least, most) * n
        rows = np.block([[np.diag(s) + pulls, force[:, None] * shares], [weights, np.zeros((m, m))]])
        found = np.linalg.solve(rows, [*-s, *[0] * m])
        largest, reached = np.maximum(largest, abs(found[:3])), np.maximum(reached, abs(found[3:]))
        mu = np.where(random.random(3) < 0.5, least, most)
        rows = np.block([[pulls - np.diag(k), (n * mu)[:, None] * shares], [weights, np.zeros((m, m))]])
        slip = random.choice([0, float(tasks[0].target_slip)])
        p = np.linalg.solve(rows, [*(n * (mu - static) * normal), *[slip] * m])[3:]
        steepest = np.maximum(steepest, n * weakening * (normal - shares @ p) - k)
    assert (largest <= moves).all()
    assert (reached <= pressures).all()
    assert (largest > 0.3 * moves).all()
    assert (reached > 0.3 * pressures).all()
    if case != "alike, one well":  # there any coefficient at any slip is more than the friction can have
        assert (steepest <= slopes[:, 1]).all()
        assert (steepest > 0.8 * slopes[:, 1]).all()


def test_where_no_balance_is_proved_sectors_hold_for_no_error():
    lost, held = (qd.UncertainPlant.from_blocks(REAL, 2, wells="one", coupling=v) for v in ("0.5", "50"))
    assert max(size for name, (_, size) in lost.disturbances.items() if "balance" in name) > 1000
    assert all(one.within < 1e-20 for name, one in lost.sectors.items() if "slope" in name)
    assert all(one.within is None for one in held.sectors.values())


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_balance_of_blocks_under_fewer_wells_stays_within_its_bounds(case):
    """Balances of random piecewise linear friction laws of the box, by Newton's method, beside what is derived."""
    tasks, pulls, shares, weights, moves, pressures, slopes = numbers(CASES[case])
    m, blocks, random, worst = len(weights), 3, np.random.default_rng(4), np.zeros(3)
    k = np.array([float(t.stiffness[0] - t.growths[0]) for t in tasks])
    N = np.array([float(t.area_per_mass[0]) for t in tasks])
    static, least, steepest = (
        np.array([float(getattr(t.friction, name)) for t in tasks]) for name in ("static", "least", "weakening")
    )
    stress, target = np.array([float(t.normal_stress) for t in tasks]), float(tasks[0].target_slip)
    for _ in range(40):
        # each block weakens at its own slip, as steeply as it may
        starts, falls = random.uniform(0, 0.5, blocks), random.uniform(0, static - least)
        mu = lambda x, starts=starts, falls=falls: static - np.clip(steepest * (x - starts), 0, falls)  # noqa: E731
        before, x, p = None, np.zeros(blocks), np.zeros(m)
        for r in np.linspace(0, target, 400)[1:]:
            for _ in range(60):
                normal = stress - shares @ p
                force = pulls @ x - k * x + N * (static * stress - mu(x) * normal)
                slope = -k - N * (mu(x + 1e-9) - mu(x)) / 1e-9 * normal
                jacobian = np.block(
                    [[np.diag(slope) + pulls, (N * mu(x))[:, None] * shares], [weights, np.zeros((m, m))]]
                )
                move = np.linalg.solve(jacobian, -np.r_[force, weights @ x - r])
                x, p = x + move[:blocks], p + move[blocks:]
                if np.abs(move[:blocks]).max() < 1e-13:
                    break
            assert (slopes[:, 0] - 1e-6 <= slope).all()
            assert (slope <= slopes[:, 1] + 1e-6).all()
            if before is not None:
                worst = np.maximum(worst, np.abs((x - before[0]) / (target / 399) - 1))
                assert (np.abs(p - before[1]) / (target / 399) <= pressures * (1 + 1e-6)).all()
            before = x, p
    assert (worst <= moves).all()
    assert (worst > 0.1 * moves).all()


def known(least, largest, weakening=0):
    """Two alike blocks of a friction that is known but for its coefficient."""
    task = uncertain_plant(CHAIN.faults[0])
    law = replace(task.friction, static=F("0.3"), least=F(least), largest=F(largest), weakening=F(weakening))
    return [replace(task, friction=law)] * 2


def test_the_stress_at_balance_goes_from_that_at_rest_to_that_at_the_target():
    """Of a constant coefficient: mu*N = mu*sigma' - kx/n, no matter what the springs are."""
    tasks, K = known("0.3", "0.3"), F(5)
    (low, high), _ = block_plant._stresses(tasks, [(0, 1, K), (1, 0, K)], [(F(1),)] * 2, ((F(1, 2),) * 2,))
    task = tasks[0]
    k, n = task.stiffness[0] - task.growths[0], task.area_per_mass[0]
    assert float(high) == pytest.approx(50e6)
    assert float(low) == pytest.approx(50e6 - float(k * task.target_slip / n) / 0.3)


def test_blocks_that_differ_in_their_coefficient_alone_move_apart():
    """mu*q the same force on both: by 2/3 and 4/3 of the mean; k(1 + xi) + K(2 xi) is that force."""
    tasks, K = known("0.25", "0.35"), F(1)
    plant = block_plant._moving(
        tasks, [(0, 1, K), (1, 0, K)], [(F(1),)] * 2, ((F(1, 2),) * 2,), [(F(5 * 10**7),) * 2] * 2
    )
    k = float(tasks[0].stiffness[0] - tasks[0].growths[0])
    least = k * (0.35 - 0.25) / (0.35 + 0.25) / (k + 2)  # of one block at each end
    assert float(plant.moves[0]) >= least
    assert float(plant.moves[0]) <= 1.5 * least


def test_the_mean_of_blocks_stands_for_alike_ones_alone(monkeypatch):
    """Two blocks of one length, whose springs are equal both ways, of which the second may have other friction."""
    told, found = [], block_plant._stresses
    monkeypatch.setattr(block_plant, "_stresses", lambda *given: told.append(1) or found(*given))
    whole = replace(CHAIN.fault, length=2000.0)
    for differs in (False, True):
        blocks = [replace(block, length=1000.0) for block in (CHAIN.blocks[0], CHAIN.blocks[2 if differs else 0])]
        chain = replace(CHAIN, fault=whole, blocks=tuple(blocks), wells=(1000.0,))
        qd.UncertainPlant.from_blocks(chain)
        assert bool(told) is differs
    told.clear()
    alike = replace(CHAIN, fault=whole, blocks=(replace(CHAIN.blocks[0], length=500.0),) * 4, wells=(250.0, 1750.0))
    qd.UncertainPlant.from_blocks(alike)
    assert told  # springs of two wells do not drop out


def test_each_turn_of_alike_blocks_moves_them_less(monkeypatch):
    given = ([uncertain_plant(REAL)] * 2, [(0, 1, F(20)), (1, 0, F(20))], [(F(1),)] * 2, ((F(1, 2),) * 2,))
    often = block_plant._balance(*given).moves
    monkeypatch.setattr(block_plant, "_TURNS", 1)
    assert max(often) < max(block_plant._balance(*given).moves)


@pytest.mark.parametrize("ends", [("1/3", "2/3"), ("1/7", "5/7"), ("-2/3", "1/9"), ("1", "1"), ("-8/9", "-1/7")])
def test_a_range_is_covered_about_its_rounded_middle(ends):
    low, high = map(F, ends)
    middle, half = block_plant._middle((low, high))
    assert middle - half <= low <= high <= middle + half
    assert half <= (high - low) / 2 + F(1, 10**5)


def test_weakening_strengthens_blocks_that_move_backward(monkeypatch):
    """Blocks that move by 1 + X to 1 - X per slip of the mean, X = 3: they weaken 4 times and strengthen twice."""
    task, told = uncertain_plant(CHAIN.faults[0]), []
    law = replace(task.friction, strengthening=F(0), static=(task.friction.least + task.friction.largest) / 2)
    task = replace(task, friction=law)

    def moving(tasks, springs, shares, weights, stresses):
        told.append(stresses)
        return block_plant._Balance(slopes=[], dampings=[], moves=[F(3)] * 2, pressures=[F(1)])

    monkeypatch.setattr(block_plant, "_moving", moving)
    block_plant._balance([task] * 2, [(0, 1, F(1)), (1, 0, F(1))], [(F(1),)] * 2, ((F(1, 2),) * 2,))
    ends = [
        replace(task, friction=replace(law, weakening=4 * law.weakening, strengthening=by * law.weakening)).stress
        for by in (2, 0)
    ]
    assert told[1] == [ends[0]] * 2 != [ends[1]] * 2


@pytest.mark.parametrize("solved", [[1.9], [-5.0], [2.0]])
def test_numbers_that_do_not_close_exactly_prove_no_balance(solved, monkeypatch):
    """1 + F/2 < F needs F > 2, whatever floats propose."""
    assert block_plant._closed([[F(1, 2)]], [F(1)])[0] > 2
    monkeypatch.setattr(np.linalg, "solve", lambda *_: np.array(solved))
    assert block_plant._closed([[F(1, 2)]], [F(1)]) is None
    assert block_plant._closed([[F(2)]], [F(1)]) is None


def test_a_stress_that_is_not_bounded_proves_no_balance(monkeypatch):
    tasks, K = known("0.29", "0.31"), F(1000)
    lost = [(-block_plant._LOST, block_plant._LOST)] * 2
    monkeypatch.setattr(block_plant, "_stresses", lambda *_: lost)
    springs = [(0, 1, K), (1, 0, K / 2)]
    assert min(block_plant._balance(tasks, springs, [(F(1),)] * 2, ((F(1, 2),) * 2,)).moves) >= block_plant._LOST


def test_a_decentralised_law_uses_the_signals_of_its_well_alone():
    part = linear_part(qd.UncertainPlant.from_blocks(CASES["two"]), {})
    whole, alone = (block_design._law_of(part, F("0.184"), np.array(block_design._START), one) for one in (False, True))
    for name in ("update", "measured", "output", "feedback"):
        crossed = [[bool(v) for v in row if v] for row in getattr(whole, name)]
        assert max(map(len, crossed)) > 1
        assert all(not v or i % 2 == j % 2 for i, row in enumerate(getattr(alone, name)) for j, v in enumerate(row))


def test_a_search_leaves_the_slip_rates_no_larger_than_its_start(monkeypatch):
    """Pressures in pascals are far larger numbers than slip rates; the search does not weigh them."""
    monkeypatch.setattr(block_design, "_EVALUATIONS", (25, 10**6))
    part = linear_part(plant := qd.UncertainPlant.from_blocks(CASES["two"]), {})
    start = block_design._law_of(part, F("0.184"), np.array(block_design._START), False)
    laws = (start, block_design.block_law(plant, F("0.184")))
    before, after = (block_design.estimate(part, law)[1][len(part.A) // 2 : len(part.A)].max() for law in laws)
    assert after <= before


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"blocks": 1}, "blocks must be a whole number from 2 to 20. Received 1"),
        ({"blocks": 21}, "blocks must be a whole number from 2 to 20. Received 21"),
        ({"blocks": 2, "coupling": 0}, "coupling of blocks must be positive"),
    ],
)
def test_a_fault_is_cut_into_blocks_that_pull_each_other(given, said):
    with pytest.raises(ParameterError, match=said):
        qd.UncertainPlant.from_blocks(REAL, **given)


@pytest.mark.parametrize("part", ["stiffness", "damping", "authority"])
def test_fewer_wells_need_known_constants_each(part):
    unknown = replace(REAL, box=replace(REAL.box, name="own", **{part: F(1, 10)}))
    with pytest.raises(ParameterError, match="box paper"):
        qd.UncertainPlant.from_blocks(unknown, 2, wells="one")


def test_friction_of_the_slip_rate_is_a_sector_of_its_block():
    """Its half-width is that of the damping; friction of the slip alone has none."""
    assert not any("damping" in name for name in qd.UncertainPlant.from_blocks(REAL, 2).sectors)
    law = SlipRateWeakening(residual=0.25, drop=0.08, critical_rate=1.0)
    plant = qd.UncertainPlant.from_blocks(replace(REAL, friction=law), 2)
    low, high = uncertain_plant(replace(REAL, friction=law)).rate_chord
    for place in (1, 2):
        assert plant.sectors[f"damping of block {place}"].slopes == (-(high - low) / 2, (high - low) / 2)
        assert plant.A[1 + place][1 + place] == -(high + low) / 2
    assert high > low
