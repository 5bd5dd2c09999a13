"""Random faults and loops, each given by its number."""

from dataclasses import replace
from fractions import Fraction as F

import numpy as np
from scipy.linalg import LinAlgError

from quakedesign.fault import load_fault
from quakedesign.guarantees import SampledLoop, VaryingGain
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search.lqg import family_of
from quakedesign.laws import summed_integrals
from quakedesign.plant import FaultPlant, uncertain_plant

REAL = uncertain_plant(load_fault("real-fault"))


def random_task(number: int) -> tuple[FaultPlant, F]:
    """A fault near the preset real-fault, and T_s."""
    random = np.random.default_rng(number)

    def times(value, low, high):
        return F(f"{float(value) * random.uniform(low, high):.4g}")

    law = REAL.friction
    least = F(f"{random.uniform(0.2, 0.33):.3f}")
    return replace(
        REAL,
        shear_modulus=times(REAL.shear_modulus, 0.5, 1.5),
        damping=times(REAL.damping, 0.2, 2),
        normal_stress=times(REAL.normal_stress, 0.4, 1.2),
        spreads=tuple(F(int(random.integers(0, 8)), 100) for _ in range(3)),
        friction=replace(law, least=least, weakening=times(law.weakening, 0.3, 1.2)),
        amplitude=times(REAL.amplitude, 0.1, 10),
        target_slip=times(REAL.target_slip, 0.1, 1.5),
    ), F(f"{random.uniform(0.05, 0.3):.3f}")


def random_loop(number: int) -> tuple[FaultPlant, SampledLoop, VaryingGain | None] | None:
    """A loop of any kind, with or without delay, lag, diffusion, noise and initial errors; None without a law."""
    random = np.random.default_rng(10**6 + number)
    task, step = random_task(number)
    period, around, measured = float(step), {}, "slip-and-rate"

    def short(value):
        return F(f"{value:.4g}")

    if random.random() < 0.4:
        around["delay"] = short(period * random.choice([0.25, 0.5, 1, 1.5]))
    if random.random() < 0.3:
        around["lag"] = short(period * random.uniform(0.05, 2))
    if random.random() < 0.2 and "lag" not in around:
        around["diffusion"] = short(period * random.uniform(6, 20))
    if random.random() < 0.4:
        measured = "slip"
    if random.random() < 0.4:
        around["slip_noise"] = short(float(task.amplitude) * period**2 * random.uniform(0.01, 0.2))
        if measured != "slip":
            around["rate_noise"] = short(float(task.amplitude) * period * random.uniform(0.01, 0.2))
    if random.random() < 0.3:
        around["initial_slip"] = short(1e-5 * random.random())
    if random.random() < 0.2:
        task = replace(task, change=short(float(task.amplitude) * random.uniform(0.01, 1)))
    slow = None
    try:
        if random.random() < 0.35 and measured != "slip":
            shares = random.uniform([0.05, 0.3, 0.001, 0], [0.6, 1.1, 0.15, 0.1])
            gains = shares / period ** np.array([2, 1, 3, 2]) / float(task.model.gain)
            law = summed_integrals(tuple(map(short, gains)), step)
        else:
            family = family_of(task, step, measured, ExactSetup(**around))
            start = np.array(family.starts[random.integers(0, len(family.starts))])
            law = family.law(start + 0.1 * np.abs(start) * random.normal(size=len(start)))
    except LinAlgError:  # of a Riccati equation
        return None
    if random.random() < 0.3:
        slow = VaryingGain(parts=int(random.integers(1, 4)), growth=short(random.uniform(0.01, 0.1) / period))
    return task, SampledLoop(law=law, step=step, **around), slow
