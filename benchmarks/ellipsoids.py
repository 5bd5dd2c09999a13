"""Peaks of an uncertain plant: the small gain of the sampled loop beside invariant ellipsoids of a continuous one.

An ellipsoid {x: xᵀQ⁻¹x ≤ 1} is invariant under |d| ≤ s where A_v·Q + Q·A_vᵀ + αQ + s²EEᵀ/α ⪯ 0 at every vertex v of the
uncertain terms, for some α > 0; |cx| is at most √(cQcᵀ). The feedback of the second is continuous, without hold and
delay, which favours it. Run: python benchmarks/ellipsoids.py
"""

from itertools import product

import control
import cvxpy as cp
import numpy as np

import quakedesign as qd


def bearing():
    """Magnetic bearing, x″ = 2000(1 ± 0.1)x + 10(1 ± 0.1)i + shock; as in the tests."""
    A, B = np.array([[0, 1], [2000, 0]]), np.array([[0], [10]])
    plant = qd.UncertainPlant(
        A=A,
        B=B,
        sectors={"stiffness": qd.Sector(entry=[0, 1], row=[1, 0], slopes=(-200, 200))},
        gains={"u1": (0.9, 1.1)},
        disturbances={"shock": ([0, 1], 5)},
        outputs={"place [m]": [1, 0], "speed [m/s]": [0, 1]},
    )
    vertices = [(A + np.array([[0, 0], [200 * a, 0]]), B * (1 + b / 10)) for a, b in product((-1, 1), repeat=2)]
    return plant, vertices, np.array([[0], [5]]), (np.diag([1e4, 1]), 0.01), {"step": "0.001", "delay": "0.0003"}


def converter():
    """Averaged buck converter, load 5 to 20 Ω, source 12 V ± 10 %, current disturbance; as in the tests."""
    L, C = 1e-3, 1e-4
    A, B, half = np.array([[0, -1 / L], [1 / C, -0.125 / C]]), np.array([[12 / L], [0]]), 0.075 / C
    plant = qd.UncertainPlant(
        A=A,
        B=B,
        sectors={"load": qd.Sector(entry=[0, 1], row=[0, 1], slopes=(-half, half))},
        gains={"u1": (0.9, 1.1)},
        disturbances={"current": ([0, 1 / C], 0.05)},
        outputs={"current [A]": [1, 0], "voltage [V]": [0, 1]},
    )
    vertices = [(A + np.array([[0, 0], [0, half * a]]), B * (1 + b / 10)) for a, b in product((-1, 1), repeat=2)]
    return plant, vertices, np.array([[0], [0.05 / C]]), (np.eye(2), 100.0), {"step": "2e-5"}


def gain(A, B, step, Q, R):
    """LQR of the sampled plant."""
    held = control.c2d(control.ss(A, B, np.eye(len(A)), 0), step)
    return np.asarray(control.dlqr(held.A, held.B, Q, [[R]])[0])


def ellipsoid_peak(vertices, E, K, row):
    """Smallest bound of a row over the decay rates tried."""
    size, best = len(E), np.inf
    units = np.array([1.0, np.sqrt(np.abs(vertices[0][0] - vertices[0][1] @ K).max())])
    for alpha in np.geomspace(1, 1e4, 40):
        Q = cp.Variable((size, size), PSD=True)  # of x over its units
        rows = []
        for A, B in vertices:
            closed = (A - B @ K) / units[:, None] * units
            entered = E / units[:, None]
            rows.append(closed @ Q + Q @ closed.T + alpha * Q + entered @ entered.T / alpha << 0)
        c = np.array(row) * units
        problem = cp.Problem(cp.Minimize(c @ Q @ c * 1e6), rows)
        try:
            problem.solve(solver=cp.CLARABEL)
        except cp.SolverError:
            continue
        if problem.status in ("optimal", "optimal_inaccurate"):
            best = min(best, float(np.sqrt(problem.value / 1e6)))
    return best


def main():
    """Print the table."""
    for make in (bearing, converter):
        plant, vertices, E, (Q, R), setup = make()
        K = gain(np.array(plant.A, dtype=float), np.array(plant.B, dtype=float), float(setup["step"]), Q, R)
        found = qd.guarantee(plant, gains=K, **setup).proof
        for (name, row), bound in zip(plant.outputs.items(), found.claims.outputs, strict=True):
            other = ellipsoid_peak(vertices, E, K, np.array(row, dtype=float))
            print(f"{make.__name__:10} {name:12} small gain {float(bound):.4g}, ellipsoid {other:.4g}", flush=True)


if __name__ == "__main__":
    main()
