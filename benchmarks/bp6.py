"""SEAS benchmark BP6-QD-A: aseismic slip by injection of fluid into a fault, as a chain of blocks.

Run with ``python benchmarks/bp6.py [CELL]``, the length of a block in metres: seconds at 100, two minutes at 25, the
grid of the code RSFaultZ (github.com/rmskarbek/RSFaultZ, benchmarks/BP6QD); the description suggests 10 and admits
others. Parameters are those of V. Lambert and E. M. Dunham, SEAS Benchmark Problems BP6-QD-A/S/C (2021), table 1.
Antiplane slip in a whole space, elasticity of every block on every other, regularised friction with the ageing law;
the pressure diffuses along the fault. Blocks at ±z are one: half of the fault is followed.

The published run is that of CYCLAPS by P. Dublanchet (elements of 9.7656 m). Its stations are named z = 0 and 0.5 km;
its pressures are those of the closed form one element from there, at 9.77 m and 488.28 m, within 300 Pa. So values
are compared at these places.
"""

import csv
import sys
from dataclasses import dataclass
from pathlib import Path
from time import process_time

import numpy as np
from scipy.special import erfc

from quakedesign.fault.friction.rate_and_state import RegularisedRateAndState
from quakedesign.simulation.coupled_sliders import CoupledSliders, SlidersRun, simulate_sliders

DAY, HALF = 86400.0, 20_000.0  # s; m, half of the fault
SHEAR_MODULUS, SHEAR_WAVE = 2670 * 3464.0**2, 3464.0  # Pa, m/s
STRESS, START, INITIAL = 50e6, 1e-12, 29.2e6  # effective normal stress [Pa], slip rate [m/s], shear stress [Pa]
INJECTED, STORED, DIFFUSIVITY = 1.25e-6, 1e-8 * 0.1, 0.1  # m/s, 1/Pa, m²/s
INJECTION, WHOLE = 100 * DAY, 730.5 * DAY
LAW = RegularisedRateAndState(
    reference_coefficient=0.6,
    direct_effect=0.007,
    evolution_effect=0.005,
    critical_slip=4e-3,
    reference_rate=1e-6,
    slowest_rate=1e-20,
    fastest_rate=1e2,
)
PUBLISHED = Path(__file__).parents[1] / "tests" / "data" / "bp6_cyclaps.csv"


@dataclass(frozen=True, kw_only=True)
class Injection:
    """A run with blocks at z [m] from 0 on."""

    z: np.ndarray
    run: SlidersRun

    def at(self, time: float, place: float) -> tuple[float, float, float]:
        """Slip [m], log10 of the slip rate [m/s] and pressure [MPa] on a day, by straight lines between blocks."""
        at = int(np.flatnonzero(self.run.times == time)[0])
        rows = (self.run.slip[at], np.log10(self.run.slip_rate[at]), self.run.pressure[at] / 1e6)
        slip, rate, pressure = (float(np.interp(place, self.z, row)) for row in rows)
        return slip, rate, pressure


def blocks(cell: float, half: float = HALF) -> tuple[np.ndarray, CoupledSliders]:
    """Places z ≥ 0 [m] of the blocks, and the blocks."""
    z = cell * np.arange(round(half / cell) + 1)

    def released(distance: np.ndarray) -> np.ndarray:
        """Stress [Pa/m] that slip of a block takes from the middle of another."""
        return np.asarray(SHEAR_MODULUS / (2 * np.pi) * cell / (cell**2 / 4 - distance**2))

    stiffness = released(z[:, None] - z)
    stiffness[:, 1:] += released(z[:, None] + z[1:])
    passing = DIFFUSIVITY / cell**2
    flow = passing * (np.eye(len(z), k=1) + np.eye(len(z), k=-1) - 2 * np.eye(len(z)))
    flow[0, 1] *= 2
    flow[-1, -1] = -passing
    source = np.zeros((len(z), 1))
    source[0] = INJECTED / STORED / cell
    return z, CoupledSliders(
        laws=(LAW,) * len(z),
        stiffness=stiffness,
        normal_stress=(STRESS,) * len(z),
        damping=SHEAR_MODULUS / (2 * SHEAR_WAVE),
        flow=flow,
        source=source,
        shares=np.eye(len(z)),
    )


def injection(cell: float, duration: float = WHOLE, rtol: float = 1e-6) -> Injection:
    """The benchmark with blocks of a length [m]."""
    z, sliders = blocks(cell)
    a, b = LAW.direct_effect, LAW.evolution_effect
    log = a / b * np.log(2 * LAW.reference_rate / START * np.sinh(INITIAL / (a * STRESS)))
    state = LAW.critical_slip / LAW.reference_rate * np.exp(log - LAW.reference_coefficient / b)
    start = sliders.start([START] * len(z), [float(state)] * len(z))
    inputs = [(0.0, (1.0,)), (INJECTION, (0.0,))]
    days = DAY * np.arange(1, int(duration / DAY))
    run = simulate_sliders(sliders, start, duration, inputs=inputs, times=days, method="dop853", rtol=rtol)
    return Injection(z=z, run=run)


def pressure(z: float, time: float) -> float:
    """Pressure [MPa] of the infinite fault, equations 26 and 27 of the description."""

    def of_source(since: float) -> float:
        if since <= 0:
            return 0.0
        width = np.sqrt(4 * DIFFUSIVITY * since)
        return float(
            np.sqrt(since / np.pi) * np.exp(-((z / width) ** 2)) - z / np.sqrt(4 * DIFFUSIVITY) * erfc(z / width)
        )

    return INJECTED / STORED / np.sqrt(DIFFUSIVITY) * (of_source(time) - of_source(time - INJECTION)) / 1e6


def published() -> list[dict[str, float]]:
    """Rows of the run of CYCLAPS: place [m], time [s], slip [m], log10 of the rate [m/s], pressure [MPa]."""
    with PUBLISHED.open(encoding="utf-8") as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        return [{name: float(value) for name, value in row.items()} for row in rows]


def main() -> None:
    """Print what differs from the published run."""
    cell = float(sys.argv[1]) if len(sys.argv) > 1 else 25.0
    began = process_time()
    found = injection(cell)
    print(f"blocks of {cell:g} m: {len(found.run.times)} steps, {process_time() - began:.0f} s of processor time")
    print("place [m], day: slip [m] here / published, log10 slip rate [m/s], pressure [MPa], closed form")
    for row in published():
        slip, rate, here = found.at(row["time"], row["place"])
        told = f"{row['place']:6g} {row['time'] / DAY:5.0f}: {slip:.5g} / {row['slip']:.5g}, "
        told += f"{rate:.4f} / {row['rate']:.4f}, {here:.4f} / {row['pressure']:.4f}, "
        print(told + f"{pressure(row['place'], row['time']):.4f}")


if __name__ == "__main__":
    main()
