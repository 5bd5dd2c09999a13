"""Balance of two blocks under one well: all corners of the ranges, and solutions that do not close."""

from dataclasses import replace
from fractions import Fraction as F
from itertools import product

import numpy as np
import pytest

from quakedesign import load_fault
from quakedesign.plant import block_plant, uncertain_plant
from quakedesign.plant.block_plant import measured_by

SHARES, WEIGHTS = [(F(1),), (F(1, 2),)], ((F(2, 3), F(1, 3)),)
TASK = uncertain_plant(load_fault("real-fault"))
K = F(40)
SPRINGS = [(0, 1, K), (1, 0, 2 * K)]
LOST = [(-block_plant._LOST, block_plant._LOST)] * 2


def tasks(least="0.3", largest="0.33", weakening="0.02"):
    """Two blocks; the second has less friction, and less damping and stiffness of its own."""
    law = replace(
        TASK.friction, static=F("0.32"), least=F(least), largest=F(largest), weakening=F(weakening),
        strengthening=F(weakening),
    )  # fmt: skip
    return [
        replace(TASK, friction=law),
        replace(TASK, friction=replace(law, least=F("0.29")), shear_modulus=F(25 * 10**9)),
    ]


def solved(diagonal, force, right_side, spring=float(K)):
    """Slips and pressure of [[diagonal + springs, force], [weights, 0]]."""
    pulls = np.array([[-spring, spring], [2 * spring, -2 * spring]])
    rows = np.zeros((3, 3))
    rows[:2, :2] = np.diag(np.array(diagonal, dtype=float)) + pulls
    rows[:2, 2] = [float(f) * float(s[0]) for f, s in zip(force, SHARES, strict=True)]
    rows[2, :2] = [float(v) for v in WEIGHTS[0]]
    return np.linalg.solve(rows, np.array(right_side, dtype=float))


def test_stresses_at_balance_are_those_of_all_coefficients_and_both_ends_of_the_slip():
    both = tasks()
    k = [float(t.stiffness[0] - t.growths[0]) for t in both]
    n = [float(t.area_per_mass[0]) for t in both]
    normal = float(both[0].normal_stress)
    found = []
    for slip, *mu in product(
        (0, float(TASK.target_slip)), *((float(t.friction.least), float(t.friction.largest)) for t in both)
    ):
        forces = [a * (m - 0.32) * normal for a, m in zip(n, mu, strict=True)]
        pressure = solved([-v for v in k], [a * m for a, m in zip(n, mu, strict=True)], [*forces, slip])[2]
        found.append([normal - float(s[0]) * pressure for s in SHARES])
    for (low, high), values in zip(
        block_plant._stresses(both, SPRINGS, SHARES, WEIGHTS), zip(*found, strict=True), strict=True
    ):
        width = max(values) - min(values)
        assert low <= min(values) <= float(low) + 0.3 * width
        assert float(high) - 0.3 * width <= max(values) <= high


def test_moves_and_pressures_are_those_of_all_slopes_and_gains():
    both, stresses = tasks(), [(F(4 * 10**7), F(5 * 10**7)), (F(45 * 10**6), F(5 * 10**7))]
    balance = block_plant._moving(both, SPRINGS, SHARES, WEIGHTS, stresses)
    slopes = [task.slip_slopes(stress) for task, stress in zip(both, stresses, strict=True)]
    assert balance.slopes == slopes
    assert balance.dampings == [task.rate_slopes(stress) for task, stress in zip(both, stresses, strict=True)]
    moves, pressures = np.zeros(2), 0.0
    for *s, b1, b2 in product(*slopes, both[0].beta, both[1].beta):
        force = [float(b * t.authority) for b, t in zip((b1, b2), both, strict=True)]
        *xi, q = solved(s, force, [*(-v for v in s), 0])
        moves, pressures = np.maximum(moves, np.abs(xi)), max(pressures, abs(q))
    bounds, (most,) = np.array(balance.moves, dtype=float), balance.pressures
    assert (moves <= bounds).all()
    assert (bounds <= 1.6 * moves).all()
    assert pressures <= most <= 1.6 * pressures


def test_the_deviations_start_from_those_at_the_middle_of_all_ranges(monkeypatch):
    """Half of s times |1 + ξ|, and half of β times b|q|, of the solution with the middles."""
    both, given = tasks(), []
    both[1] = replace(both[1], friction=replace(both[1].friction, weakening=F("0.4")))
    stresses = [(F(3 * 10**7), F(5 * 10**7)), (F(4 * 10**7), F(5 * 10**7))]
    monkeypatch.setattr(block_plant, "_closed", lambda gains, first: given.append(first))
    soft = [(i, j, spring / 400) for i, j, spring in SPRINGS]
    block_plant._moving(both, soft, SHARES, WEIGHTS, stresses)
    slopes = [task.slip_slopes(stress) for task, stress in zip(both, stresses, strict=True)]
    s, beta = ([float(low + high) / 2 for low, high in ends] for ends in (slopes, [task.beta for task in both]))
    force = [float(task.authority) for task in both]
    *xi, q = solved(s, [b * f for b, f in zip(beta, force, strict=True)], [*(-v for v in s), 0], 0.1)
    assert abs(xi[0] - xi[1]) > 0.2
    for i, first in enumerate(given[0]):
        halves = [float(high - low) / 2 for low, high in (slopes[i], both[i].beta)]
        exact = halves[0] * abs(1 + xi[i]) + halves[1] * abs(force[i] * float(SHARES[i][0]) * q)
        assert float(first) == pytest.approx(exact, rel=1e-4)


def test_without_a_solution_nothing_is_bounded(monkeypatch):
    both = tasks()
    stresses = block_plant._stresses(both, SPRINGS, SHARES, WEIGHTS)
    monkeypatch.setattr(block_plant, "_balancing", lambda *_: None)
    assert block_plant._stresses(both, SPRINGS, SHARES, WEIGHTS) == LOST
    assert min(block_plant._moving(both, SPRINGS, SHARES, WEIGHTS, stresses).moves) == block_plant._LOST
    monkeypatch.undo()
    monkeypatch.setattr(block_plant, "_closed", lambda *_: None)
    assert block_plant._stresses(both, SPRINGS, SHARES, WEIGHTS) == LOST
    assert min(block_plant._moving(both, SPRINGS, SHARES, WEIGHTS, stresses).moves) == block_plant._LOST
    monkeypatch.undo()
    assert min(block_plant._moving(both, SPRINGS, SHARES, WEIGHTS, LOST).moves) == block_plant._LOST


@pytest.mark.parametrize(
    ("gains", "first", "solution"),
    [
        ([[0, 0], [0, "1/2"]], [1, 1], [3, "1/10"]),  # the second row does not close
        ([["1/2", 0], [0, 0]], [1, 1], ["1/10", 3]),
        ([[0, 1], [0, 2]], [0, 0], [-1, -3]),  # closes, but is negative
    ],
)
def test_every_number_must_close_and_be_positive(gains, first, solution, monkeypatch):
    rows = [[F(v) for v in row] for row in gains]
    monkeypatch.setattr(np.linalg, "eigvals", lambda _: np.zeros(2))
    monkeypatch.setattr(np.linalg, "solve", lambda *_: np.array([float(F(v)) for v in solution]))
    assert block_plant._closed(rows, [F(v) for v in first]) is None


@pytest.mark.parametrize(
    ("weakening", "strengthening", "by"), [("0.02", "0", "0.04"), ("0.02", "0.05", "0.2"), ("0.02", "0.01", "0.04")]
)
def test_alike_blocks_weaken_and_strengthen_as_fast_as_they_move(weakening, strengthening, by, monkeypatch):
    """X = 3: 4 times as fast; backward at up to twice the rate of the reference, weakening strengthens."""
    law = replace(TASK.friction, static=F("0.3"), least=F("0.2"), largest=F("0.4"), weakening=F(weakening))
    task = replace(TASK, friction=replace(law, strengthening=F(strengthening)), target_slip=F(1, 10))
    given = []

    def moving(tasks, springs, shares, weights, stresses):
        given.append(stresses)
        return block_plant._Balance(slopes=[], dampings=[], moves=[F(2), F(3)], pressures=[F(1)])

    monkeypatch.setattr(block_plant, "_moving", moving)
    block_plant._balance([task] * 2, [(0, 1, K), (1, 0, K)], [(F(1),)] * 2, ((F(1, 2),) * 2,))
    faster = replace(law, weakening=4 * F(weakening), strengthening=F(by))
    assert given[1] == [replace(task, friction=faster).stress] * 2
    k, n = task.stiffness[0] - task.growths[0], task.area_per_mass[0]
    any_friction = [
        (law.static * task.normal_stress - k / n * r) / mu for r in (0, F(1, 10)) for mu in (F("0.2"), F("0.4"))
    ]
    assert float(given[0][0][0]) == pytest.approx(float(min(any_friction)), rel=1e-7)
    assert float(given[0][0][1]) == pytest.approx(float(max(any_friction)), rel=1e-7)


def test_wells_as_many_as_blocks_measure_single_blocks():
    assert measured_by([(F(1), F(0)), (F(1, 3), F(2, 3))]) == ((1, 0), (0, 1))
    assert measured_by([(F(1),), (F(1, 3),)]) == ((F(3, 4), F(1, 4)),)
