"""May one block stand for a fault: as a value, and as a command."""

import json
from fractions import Fraction

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.cli import main
from quakedesign.plant import uncertain_plant
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
    assert "a mode escapes, which is not measured" in capsys.readouterr().out


def test_answers_are_told_in_lines_and_numbers():
    answer = one_block(REAL, [2], coupling="0.5")
    assert not answer.proved
    assert answer.peaks(2) is None
    assert answer.lines()[2].startswith("  2 blocks: none: a mode escapes")
    assert answer.to_dict()["blocks"][0]["verdict"] == "undecided"


@pytest.mark.slow
def test_the_balance_of_blocks_under_one_well_stays_within_its_bounds():
    """Balances of random piecewise linear friction laws of the box, by Newton's method, beside what is derived."""
    blocks = 3
    plant, task = qd.UncertainPlant.from_blocks(REAL, blocks, wells="one"), uncertain_plant(REAL)
    first = float(task.reference_rates[0])
    differ = float(plant.disturbances["balance of block 1"][1]) / first
    slopes = [float(v) for v in plant.sectors["slope of block 1"].slopes]
    k, N = (float(ends[0]) for ends in (task.stiffness, task.area_per_mass))
    static, least, stress, K = float(task.friction.static), float(task.friction.least), float(task.normal_stress), 4.32
    steepest, random, worst = float(task.friction.weakening), np.random.default_rng(4), 0.0
    for _ in range(40):
        # each block weakens at its own slip, as steeply as it may
        starts, falls = random.uniform(0, 0.5, blocks), random.uniform(0, static - least, blocks)
        mu = lambda x, starts=starts, falls=falls: static - np.clip(steepest * (x - starts), 0, falls)  # noqa: E731
        chain = K * (2 * np.eye(blocks) - np.eye(blocks, k=1) - np.eye(blocks, k=-1))
        chain[0, 0] = chain[-1, -1] = K
        before, x, p = None, np.zeros(blocks), 0.0
        for r in np.linspace(0, float(task.target_slip), 400)[1:]:
            for _ in range(60):
                force = -(k - float(task.growths[0])) * x - chain @ x + N * (static * stress - mu(x) * (stress - p))
                tangent = (mu(x + 1e-9) - mu(x)) / 1e-9
                slope = -k + float(task.growths[0]) - N * tangent * (stress - p)
                jacobian = np.block([[np.diag(slope) - chain, (N * mu(x))[:, None]], [np.ones((1, blocks)), 0]])
                move = np.linalg.solve(jacobian, -np.r_[force, x.sum() - blocks * r])
                x, p = x + move[:-1], p + move[-1]
                if np.abs(move[:-1]).max() < 1e-13:
                    break
            assert slopes[0] * (1 + 1e-6) <= slope.min() * 1.0 + 1e-9 or slope.min() >= slopes[0] - 1e-6
            assert slope.max() <= slopes[1] + 1e-6
            if before is not None:
                worst = max(worst, np.abs((x - before) / (float(task.target_slip) / 399) - 1).max())
            before = x
    assert 0.1 * differ < worst <= differ
