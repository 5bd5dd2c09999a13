"""Limits of several blocks beside closed forms, limits of one block, other equations, and runs of a mode."""

import json
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

import quakedesign as qd
from quakedesign.cli import main
from quakedesign.errors import ParameterError
from quakedesign.guarantees.exact.limit_theorems import (
    DisturbedSliding,
    farthest_well,
    longest_diffusion,
    longest_reaction,
    smallest_withdrawal,
)
from quakedesign.guarantees.search.lqg import sliding_model
from quakedesign.plant import uncertain_plant
from quakedesign.simulation.coupled_sliders import CoupledSliders
from quakedesign.studies import block_limits, chain_limits

DATA = Path(__file__).parents[1] / "data"
CHAIN = qd.load_chain(DATA / "three_blocks.toml")
SLIDING = qd.load_chain(DATA / "three_sliding_blocks.toml")


def alike(lengths, wells, modulus=None):
    """Blocks of one friction; a softer rock has softer springs."""
    blocks = tuple(replace(CHAIN.blocks[0], length=float(v)) for v in lengths)
    return replace(CHAIN, blocks=blocks, wells=wells)


def test_modes_of_equal_blocks_are_those_of_a_chain():
    """Poles p² + wp = s − 2K(1 − cos πk/N), of which one well in the middle reaches every second mode."""
    long = replace(CHAIN.fault, length=80e3, width=5e3)
    blocks = tuple(replace(CHAIN.blocks[0], length=20e3) for _ in range(4))
    chain = replace(CHAIN, fault=long, blocks=blocks, wells=(40e3,))
    assert {row[0] for row in chain.shares} == {1}
    task = uncertain_plant(chain.faults[0])
    s, w, K = float(task.slip_chord[1]), float(task.rate_chord[0]), float(chain.springs[0][2])
    wanted = [s - 2 * K * (1 - np.cos(np.pi * k / 4)) for k in range(4)]
    wanted = sorted(((np.sqrt(w**2 + 4 * v) - w) / 2 for v in wanted if v > 0), reverse=True)
    found = chain_limits(chain)
    assert len(wanted) > 1
    assert [mode.pole for mode in found.modes] == pytest.approx(wanted, rel=1e-9)
    assert found.modes[0].shape == pytest.approx([1] * 4)
    # a common pressure moves the common mode alone: H over the largest βb
    assert [mode.reached for mode in found.modes] == [True] + [False] * (len(wanted) - 1)
    assert found.modes[0].pressure == pytest.approx(float(task.amplitude / (task.authority * task.beta[1])), rel=1e-9)
    assert not found.feasible
    assert f"{len(wanted) - 1} unstable modes, reached by no well" in found.lines()[-1]
    every = chain_limits(replace(chain, wells=(10e3, 30e3, 50e3, 70e3)))
    assert every.feasible
    assert [mode.pole for mode in every.modes] == pytest.approx(wanted, rel=1e-9)


def test_a_well_that_diffuses_needs_more_pressure_by_its_transfer_function_at_the_pole():
    """Two alike blocks and a well between their middles, r = D/(L·L/2): r/(p + r) of its pressure at a pole p."""
    chain = alike((2500.0, 2500.0), (2500.0,))
    steady, slow = chain_limits(chain), chain_limits(replace(chain, diffusivity=1e5))
    rate, (one,) = 1e5 / (2500 * 1250), [mode for mode in steady.modes if mode.reached]
    (other,) = [mode for mode in slow.modes if mode.reached]
    assert other.pole == pytest.approx(one.pole, rel=1e-12)
    assert other.pressure == pytest.approx(one.pressure * (one.pole + rate) / rate, rel=1e-9)
    assert [mode.reached for mode in slow.modes] == [mode.reached for mode in steady.modes]
    aside = chain_limits(replace(chain, wells=(1250.0,), diffusivity=1e5))
    through = 1e5 / 2500**2
    felt = (1 + through / (one.pole + through)) / 2  # by the mean of both blocks
    assert aside.modes[0].pressure == pytest.approx(one.pressure / felt, rel=1e-9)
    told = chain_limits(replace(chain, diffusivity=1.0)).lines()
    assert told[-2].endswith("a mode needs more than the effective normal stress, 50 MPa: move the wells")
    assert not any("needs more than" in line for line in slow.lines() + steady.lines())


def test_blocks_that_hardly_pull_each_other_need_a_well_each():
    """Of blocks with one pole each, m wells reach as many combinations as the wells are independent."""
    long = replace(CHAIN.fault, length=5e7, width=5e3)
    blocks = tuple(replace(CHAIN.blocks[0], length=1e7) for _ in range(5))
    for wells, reached in (((5e6,), 1), ((5e6, 4.5e7), 2), ((5e6, 1.5e7, 2.5e7, 3.5e7, 4.5e7), 5)):
        found = chain_limits(replace(CHAIN, fault=long, blocks=blocks, wells=wells))
        assert len(found.modes) == 5
        assert sum(mode.reached for mode in found.modes) == reached


def test_a_pressure_below_the_limit_lets_the_mode_grow_and_one_above_can_hold_it():
    found = chain_limits(CHAIN)
    (mode,) = found.modes
    tasks, N = [uncertain_plant(fault) for fault in CHAIN.faults], 3
    A = np.zeros((6, 6))
    A[:3, 3:] = np.eye(3)
    A[3:, 3:] = -np.diag([float(task.rate_chord[0]) for task in tasks])
    A[3:, :3] = np.diag([float(task.slip_chord[1]) for task in tasks])
    for i, j, K in CHAIN.springs:
        A[3 + i, j] += float(K)
        A[3 + i, i] -= float(K)
    B = np.array(
        [[float(t.authority * t.beta[1] * v) for v in row] for t, row in zip(tasks, CHAIN.shares, strict=True)]
    )
    values, vectors = np.linalg.eig(A.T)
    left = np.real(vectors[:, np.argmax(values.real)])
    assert mode.pole == pytest.approx(values.real.max(), rel=1e-9)
    pushed = 3.2e-4 * np.sign(left[3:])
    for share, grows in ((0.99, True), (1.01, False)):
        pressure = -share * mode.pressure * np.sign(left[3:] @ B) * np.sign(left[3:] @ pushed)
        force = np.r_[np.zeros(N), pushed + B @ pressure]
        state = expm(np.block([[A, force[:, None]], [np.zeros((1, 7))]]) * 20)[:6, 6]
        assert (left @ state * np.sign(left[3:] @ pushed) > 0) is np.bool_(grows)


def test_a_mode_that_floating_point_loses_is_no_statement():
    """A block of 1 nm pulls its neighbour so strongly that the pole of all blocks drowns in the rounding of another."""
    long = replace(CHAIN.fault, length=1000.000000001)
    blocks = tuple(replace(CHAIN.blocks[0], length=v) for v in (1e-9, 1000.0))
    long = replace(long, effective_normal_stress=1e9)
    blocks = tuple(replace(block, effective_normal_stress=1e9) for block in blocks)
    chain = replace(CHAIN, fault=long, blocks=blocks, wells=(500.0,))
    with pytest.raises(ParameterError, match="modes that floating point tells apart"):
        chain_limits(chain)


# ----------------------------------------------------------------------
# Blocks in slow sliding.


def sliding(wells=SLIDING.wells, **friction):
    """The blocks of the file with other wells, and other constants of friction for all, or a tuple for each."""
    blocks = tuple(
        replace(
            block,
            friction=replace(block.friction, **{k: v[i] if isinstance(v, tuple) else v for k, v in friction.items()}),
        )
        for i, block in enumerate(SLIDING.blocks)
    )
    return replace(SLIDING, wells=wells, blocks=blocks)


def one_block_pole(stiffer, critical_slip):
    """Poles [1/s] of one block whose spring is stiffer [Pa/m], by s² + (1 + κ − β)s + κ = 0 in units of V/D."""
    V, K, N = 1e-6, 32.04e9 / 15e3 + stiffer, 50e6
    strength = N * 0.010 + 1.0405e15 / 15e3**2 * V
    kappa, beta = K * critical_slip / strength, N * 0.015 / strength
    return np.roots([1, 1 + kappa - beta, kappa]) * V / critical_slip


def test_the_common_mode_of_sliding_blocks_has_the_limits_of_one_block():
    found = chain_limits(SLIDING, stress=1e4, pressure=1e6, diffusivity=2.0)
    push = DisturbedSliding(model=sliding_model(SLIDING.faults[0]), amplitude=F(10_000))
    common = found.modes[0]
    assert common.shape == pytest.approx([1, 1, 1])
    assert common.pole == pytest.approx(float(push.pole.mid()), rel=1e-9)
    assert common.pressure == pytest.approx(float(smallest_withdrawal(push, F(400))), rel=1e-9)
    assert common.longest_step == pytest.approx(float(longest_reaction(push, F(10**6))), rel=1e-9)
    rock = longest_diffusion(push, F(10**6), F(400))
    assert common.farthest_well == pytest.approx(float(farthest_well(rock, F(2))), rel=1e-9)
    assert found.slip_rate_error == pytest.approx([float(push.smallest_rate_error(F(400)))] * 3, rel=1e-9)
    assert found.modes[2].frequency > 0
    assert (found.modes[2].reached, found.modes[2].pressure, found.modes[2].longest_step) == (True, None, None)
    weak = chain_limits(SLIDING, stress=1e4, pressure=1e4).modes[0]  # below the 16.7 kPa that are needed at once
    assert (weak.longest_step, weak.farthest_well) == (0, 0)


@pytest.mark.parametrize("critical_slip", [8e-3, 3e-4])
def test_poles_of_alike_sliding_blocks_are_those_of_one_with_a_stiffer_spring(critical_slip):
    """Springs between three blocks add 0, 1 and 3 times their stiffness; those of 3e-4 m are too soft to hold any."""
    spring = 32.04e9 * 15e3 / 5e3**2
    wanted = [p for by in (0, 1, 3) for p in one_block_pole(by * spring, critical_slip) if p.real > 0 and p.imag >= 0]
    found = chain_limits(sliding(critical_slip=critical_slip))
    modes = sorted((mode.pole, mode.frequency) for mode in found.modes)
    assert len(wanted) == (3 if critical_slip == 8e-3 else 6)
    assert modes == [pytest.approx(pair, rel=1e-8) for pair in sorted((p.real, p.imag) for p in wanted)]
    assert [mode.pressure for mode in found.modes] == [None] * len(modes)  # without a stress
    assert found.feasible


def test_poles_of_sliding_blocks_that_differ_are_those_of_the_simulated_equations():
    """Of the Jacobian of slips, log rates and log states in steady sliding, whose further poles are 0."""
    chain = sliding(critical_slip=(8e-3, 2e-3, 5e-4), direct_effect=(0.01, 0.008, 0.012))
    sliders = CoupledSliders.of(chain)
    y = sliders.start([1e-6] * 3, [float(law.steady_state(1e-6)[0]) for law in sliders.laws])
    poles = np.linalg.eigvals(np.array(sliders.rates()(y, [1e-6, 0, 0])[1]))
    wanted = sorted(((p.real, p.imag) for p in poles if p.real > 1e-9 and p.imag >= 0), reverse=True)
    found = chain_limits(chain)
    assert len(wanted) > 2
    assert [(m.pole, m.frequency) for m in found.modes] == [pytest.approx(pair, rel=1e-6) for pair in wanted]


def test_one_well_in_the_middle_reaches_the_modes_that_are_even(capsys, tmp_path):
    """Of six unstable modes those of (1, 0, -1) and of (1, -2, 1), which does not move the mean either, escape."""
    chain = sliding(wells=(7500.0,), critical_slip=3e-4)
    found = chain_limits(chain, stress=1e4, pressure=1e6)
    assert [mode.reached for mode in found.modes] == [True, False, False, False, False, True]
    assert not found.feasible
    escaping = found.modes[1]
    assert (escaping.pressure, escaping.longest_step, escaping.farthest_well) == (None, None, None)
    assert max(map(len, found.lines())) <= 80
    told = "\n".join(found.lines())
    assert "4 unstable modes, reached by no well" in told
    assert "for stress of 10 kPa on every block, pressures within\n1 MPa of the plan, diffusivity 1 m^2/s" in told
    path = tmp_path / "blocks.toml"
    text = (DATA / "three_sliding_blocks.toml").read_text()
    path.write_text(text.split("[[well]]")[0] + '[[well]]\nposition = "7.5 km"\n')
    with pytest.raises(SystemExit) as end:
        main(["limits", str(path), "--stress", "10 kPa", "--json"])
    assert end.value.code == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["largest_pressure"] == 50e6
    assert [mode["reached"] for mode in answer["modes"]] == [True, True, False]
    assert answer["modes"][2]["frequency"] > 0


def test_a_pressure_below_the_limit_lets_a_mode_of_sliding_blocks_grow_and_one_above_can_hold_it():
    """Blocks that differ, one mode; signs of stresses and pressures by a left eigenvector of equations typed anew."""
    chain = sliding(evolution_effect=(0.015, 0.014, 0.016), wells=(2500.0, 12500.0))
    (mode, *_) = chain_limits(chain, stress=1e4).modes
    V, D, S = 1e-6, 8e-3, 50e6 * 0.01 + 1.0405e15 / 15e3**2 * 1e-6
    K = 32.04e9 / 15e3 * np.eye(3) + 32.04e9 * 15e3 / 5e3**2 * np.array([[1, -1, 0], [-1, 2, -1], [0, -1, 1.0]])
    W = np.diag([0.015, 0.014, 0.016]) * 50e6
    A = np.block([[-V / S * K, -V / S * W], [K / S * V / D, W / S * V / D - V / D * np.eye(3)]])
    E = np.vstack([np.eye(3) * V / S, -np.eye(3) * V / D / S])
    shares = np.array([[1, 0], [0.5, 0.5], [0, 1]])
    mu = [0.6] * 3
    values, vectors = np.linalg.eig(A.T)
    left = np.real(vectors[:, np.argmax(values.real)])
    assert mode.pole == pytest.approx(values.real.max(), rel=1e-9)
    pushed, B = 1e4 * np.sign(left @ E), E @ np.diag(mu) @ shares
    late = np.exp(mode.pole * 400.0)
    for share, grows in ((0.999, True), (1.001, False)):
        pressure = -share * mode.pressure * np.sign(left @ B)
        state = np.linalg.solve(A, (expm(A * 400) - np.eye(6)) @ E @ pushed)  # until the first sample
        force = E @ pushed + B @ pressure
        state = expm(A * 3e6) @ state + np.linalg.solve(A, (expm(A * 3e6) - np.eye(6)) @ force)
        assert (left @ state > 0) is np.bool_(grows)
    assert late > 1.01


def test_stress_that_changes_the_state_and_poles_that_floats_confuse_give_no_limits(monkeypatch):
    with pytest.raises(ParameterError, match=r"stress_sensitivity 0\. Received 0\.1 in block 2\."):
        chain_limits(sliding(stress_sensitivity=(0.0, 0.1, 0.0)))
    monkeypatch.setattr(block_limits, "_MOST_SKEWED", 1.0)
    with pytest.raises(ParameterError, match="modes that floating point tells apart"):
        chain_limits(SLIDING)


def test_the_largest_pressure_opens_no_block():
    weak = replace(SLIDING.blocks[0], effective_normal_stress=45e6)
    assert chain_limits(replace(SLIDING, blocks=(weak, *SLIDING.blocks[1:]))).largest_pressure == 45e6


def test_blocks_that_strengthen_have_no_unstable_mode():
    found = chain_limits(sliding(evolution_effect=1e-4), stress=1e4)
    assert found.modes == ()
    strength = 50e6 * 0.010 + 1.0405e15 / 15e3**2 * 1e-6
    assert found.slip_rate_error == pytest.approx([1e-6 * 1e4 / strength] * 3, rel=1e-9)  # at once, then less
    assert found.lines()[-1] == "no mode is unstable"
    assert found.to_dict()["modes"] == []
