"""The compiled step loop beside a hand-written numba loop and beside python-control, in one run.

Run with ``python benchmarks/simulation.py`` (numba: ``pip install quakedesign[benchmark]``); about two minutes.
``--steps N`` shortens it. The numba loop is written from the equations of the paper, not generated: Dormand–Prince
stages, 2-CTA, friction, reference, and all sums for metrics and energy. Times are processor time, of the C compiler
too; nothing is kept from one run to the next, but the code where it says so. All included are the preparation of the
run, and of the first its compilation, as numba's on its first call.
"""

import argparse
import math
import os
import sys
import tempfile
from collections.abc import Callable
from time import perf_counter
from typing import Any

import control
import numpy as np

import quakedesign as qd
from quakedesign import cache
from quakedesign.simulation.trajectory import Trajectory

FAULT = qd.load_fault("real-fault")
LAW = qd.published("real-fault")["cta"]
SAMPLES = 2000


def hand_written() -> Any:
    """Loop (steps, samples) → kept states, metrics; machine code on its first call."""
    import numba

    law, load, task = FAULT.friction, FAULT.disturbance, FAULT.reference
    residual, drop, critical = law.residual, law.drop, law.critical_slip
    k, eta, N, stress = FAULT.specific_stiffness, FAULT.specific_damping, FAULT.authority, FAULT.effective_normal_stress
    amplitude, frequency, growth = load.amplitude, load.frequency, load.slip_growth
    target, end, step = task.target_slip, task.operation_time, FAULT.sampling_time
    scale, divisor = float(LAW.scale), float(LAW.divisor)
    g1, g2, g3, g4 = (float(gain) for gain in LAW.gains.values())
    k1, k2, k3, k4 = scale ** (2 / 3) * g1 / divisor, scale**0.5 * g2 / divisor, scale * g3, scale * g4
    static, settled = residual + drop, end / 4

    @numba.njit(inline="always")
    def reference(t: float) -> tuple[float, float, float]:
        s = min(t, end) / end
        moving = 1.0 if t < end else 0.0
        slip = target * s * s * s * (10 - 15 * s + 6 * s * s)
        rate = moving * 30 * target / end * s * s * (1 - s) * (1 - s)
        return slip, rate, moving * 60 * target / (end * end) * s * (1 - s) * (1 - 2 * s)

    @numba.njit(inline="always")
    def pressure_of(x1: float, x2: float, xi: float, r: float, r_rate: float) -> float:
        e1, e2 = x1 - r, x2 - r_rate
        return -k1 * np.sign(e1) * abs(e1) ** (1 / 3) - k2 * np.sign(e2) * math.sqrt(abs(e2)) + xi / divisor

    @numba.njit(inline="always")
    def weakened(x1: float) -> float:
        return drop * math.expm1(-max(x1, 0.0) / critical)

    @numba.njit(inline="always")
    def field(t: float, x: Any) -> Any:
        x1, x2, xi = x[0], x[1], x[2]
        r, r_rate, _ = reference(t)
        p = pressure_of(x1, x2, xi, r, r_rate)
        less = weakened(x1)
        push = N * (static + less) * p
        shaking = amplitude * math.sin(frequency * t) + growth * x1
        return (
            x2,
            push - N * stress * less - k * x1 - eta * x2 + shaking,
            -k3 * np.sign(x1 - r) - k4 * np.sign(x2 - r_rate),
            N * stress * less * x2,
            push * x2,
            eta * x2 * x2,
            shaking * x2,
            x1,
        )

    @numba.njit(inline="always")
    def dormand_prince(n: int, x: Any, w: Any) -> Any:
        h = step
        a = field(n * h, x)
        y = (x[0] + h * (a[0] / 5), x[1] + h * (a[1] / 5), x[2] + h * (a[2] / 5))
        b = field((n + 1 / 5) * h, y)
        y = (
            x[0] + h * (3 / 40 * a[0] + 9 / 40 * b[0]),
            x[1] + h * (3 / 40 * a[1] + 9 / 40 * b[1]),
            x[2] + h * (3 / 40 * a[2] + 9 / 40 * b[2]),
        )
        c = field((n + 3 / 10) * h, y)
        y = (
            x[0] + h * (44 / 45 * a[0] - 56 / 15 * b[0] + 32 / 9 * c[0]),
            x[1] + h * (44 / 45 * a[1] - 56 / 15 * b[1] + 32 / 9 * c[1]),
            x[2] + h * (44 / 45 * a[2] - 56 / 15 * b[2] + 32 / 9 * c[2]),
        )
        d = field((n + 4 / 5) * h, y)
        d1, d2, d3, d4 = 19372 / 6561, 25360 / 2187, 64448 / 6561, 212 / 729
        y = (
            x[0] + h * (d1 * a[0] - d2 * b[0] + d3 * c[0] - d4 * d[0]),
            x[1] + h * (d1 * a[1] - d2 * b[1] + d3 * c[1] - d4 * d[1]),
            x[2] + h * (d1 * a[2] - d2 * b[2] + d3 * c[2] - d4 * d[2]),
        )
        e = field((n + 8 / 9) * h, y)
        e1, e2, e3, e4, e5 = 9017 / 3168, 355 / 33, 46732 / 5247, 49 / 176, 5103 / 18656
        y = (
            x[0] + h * (e1 * a[0] - e2 * b[0] + e3 * c[0] + e4 * d[0] - e5 * e[0]),
            x[1] + h * (e1 * a[1] - e2 * b[1] + e3 * c[1] + e4 * d[1] - e5 * e[1]),
            x[2] + h * (e1 * a[2] - e2 * b[2] + e3 * c[2] + e4 * d[2] - e5 * e[2]),
        )
        f = field((n + 1) * h, y)
        s1, s3, s4, s5, s6 = h * 35 / 384, h * 500 / 1113, h * 125 / 192, h * 2187 / 6784, h * 11 / 84
        moved = (
            x[0] + s1 * a[0] + s3 * c[0] + s4 * d[0] - s5 * e[0] + s6 * f[0],
            x[1] + s1 * a[1] + s3 * c[1] + s4 * d[1] - s5 * e[1] + s6 * f[1],
            x[2] + s1 * a[2] + s3 * c[2] + s4 * d[2] - s5 * e[2] + s6 * f[2],
        )
        works = (
            w[0] + s1 * a[3] + s3 * c[3] + s4 * d[3] - s5 * e[3] + s6 * f[3],
            w[1] + s1 * a[4] + s3 * c[4] + s4 * d[4] - s5 * e[4] + s6 * f[4],
            w[2] + s1 * a[5] + s3 * c[5] + s4 * d[5] - s5 * e[5] + s6 * f[5],
            w[3] + s1 * a[6] + s3 * c[6] + s4 * d[6] - s5 * e[6] + s6 * f[6],
            w[4] + s1 * a[7] + s3 * c[7] + s4 * d[7] - s5 * e[7] + s6 * f[7],
        )
        return moved, works

    @numba.njit
    def loop(steps: int, samples: int) -> tuple[Any, Any]:
        stride = max(1, -(-steps // samples))
        kept = np.empty((samples + 2, 4))
        x1 = x2 = xi = 0.0
        works = (0.0, 0.0, 0.0, 0.0, 0.0)
        big1 = big2 = sum1 = sum2 = sum3 = total = peak = change_of_h = 0.0
        p_before = h_before = 0.0
        p_most, p_least, reverse, counted, stored = -np.inf, np.inf, 0, 0, 0
        diverged = opened = reversed_at = -1.0
        for n in range(steps + 1):
            t = n * step
            r, r_rate, r_acceleration = reference(t)
            p = pressure_of(x1, x2, xi, r, r_rate)
            less = weakened(x1)
            mu = static + less
            shaking = amplitude * math.sin(frequency * t) + growth * x1
            free = -N * stress * less - k * x1 - eta * x2 + shaking
            h = (free - r_acceleration) * divisor / (mu * N)
            e1, e2 = x1 - r, x2 - r_rate
            if n % stride == 0 or n == steps:
                kept[stored] = t, x1, x2, p
                stored += 1
            if t > settled:
                big1, big2 = max(big1, abs(e1)), max(big2, abs(e2))
                sum1, sum2, sum3 = sum1 + e1 * e1, sum2 + e2 * e2, sum3 + p * p
                total += abs(p - p_before)
                reverse += x2 < 0
                counted += 1
            if n > 0:
                change_of_h = max(change_of_h, abs(h - h_before))
            p_most, p_least, peak = max(p_most, p), min(p_least, p), max(peak, abs(x2))
            p_before, h_before = p, h
            if diverged < 0 and not (abs(x1) <= 1e9 and abs(x2) <= 1e9 and abs(xi) <= 1e100 and abs(p) <= 1e100):
                diverged = t
            if opened < 0 and p >= stress:
                opened = t
            if reversed_at < 0 and x2 < 0:
                reversed_at = t
            if n == steps:
                break
            (x1, x2, xi), works = dormand_prince(n, (x1, x2, xi), works)
        figures = np.array([big1, big2, sum1, sum2, sum3, total, peak, change_of_h / step, p_most, p_least])
        counts = np.array(
            [reverse, counted, diverged, opened, reversed_at, works[0], works[1], works[2], works[3], works[4]]
        )
        return kept[:stored], np.concatenate((figures, counts))

    return loop


def compiled(steps: int) -> Trajectory:
    """Our run over a number of steps."""
    return qd.simulate(FAULT, LAW, duration=steps * FAULT.sampling_time, samples=SAMPLES, compiled=True)


def seconds(run: Trajectory) -> float:
    """Time [s] that the stepping took, without preparation."""
    return float(run.provenance["stepping_seconds"])


def processor(work: Callable[[], Any]) -> tuple[float, Any]:
    """Processor time [s] of a piece of work and the processes that it waits for, with what it gives."""
    before = os.times()
    found = work()
    after = os.times()
    return sum(after[:4]) - sum(before[:4]), found


def beside_numba(steps: int, rounds: int = 3) -> None:
    """Both loops in turn, several times; the shortest of each counts."""
    compiling, loop = processor(hand_written)
    few = 20
    more, (kept, _) = processor(lambda: loop(few, few))
    compiling += more
    agreement = np.max(np.abs(kept[:, 1] / compiled(few).slip[-1] - compiled(few).slip / compiled(few).slip[-1]))
    print(f"after {few} steps both slips agree to {agreement:.1g}; later the chatter of each is its own")
    for length in (steps, steps // 9):
        first, _ = processor(lambda length=length: compiled(length))
        with tempfile.TemporaryDirectory() as folder:
            ours, theirs = [], []
            for number in range(rounds):
                os.environ[cache.PLACE] = f"{folder}/{number}"
                compiled(few)  # keeps the code
                took, run = processor(lambda length=length: compiled(length))
                ours.append((took, seconds(run)))
                took, (kept, figures) = processor(lambda length=length: loop(length, SAMPLES))
                theirs.append(took)
            os.environ[cache.PLACE] = "off"
        (whole, stepping), numba = map(min, zip(*ours, strict=True)), min(theirs)
        print(f"{length} steps: stepping {stepping:.3f} s, numba {numba:.3f} s, ratio {stepping / numba:.2f}")
        print(f"  all included, code kept: {whole:.3f} s, ratio {whole / numba:.2f}")
        both = numba + compiling
        print(f"  all included, code compiled: {first:.3f} s, numba {both:.3f} s, ratio {first / both:.2f}")
        early, late = run.metrics.max_slip_rate_error, figures[1]
        print(f"  largest slip-rate error: {early:.4g} and {late:.4g} m/s")
        print(f"  last slip: {run.slip[-1]:.9g} and {kept[-1, 1]:.9g} m", flush=True)


def beside_control(duration: float = 20.0) -> None:
    """python-control on the same loop, interconnected by names, at the tolerance it needs for three digits."""
    fault, law = qd.to_iosystem(FAULT), qd.to_iosystem(LAW)
    joined = control.interconnect([fault, law], inputs=["r", "r_rate"], outputs=["slip", "p"], check_unused=False)
    run = qd.simulate(FAULT, LAW, duration=duration, samples=10**6)
    signals = np.vstack([run.reference, run.reference_rate])
    began = perf_counter()
    control.input_output_response(
        joined, run.time, signals, solve_ivp_method="RK45", solve_ivp_kwargs={"max_step": FAULT.sampling_time}
    )
    theirs = (perf_counter() - began) / duration
    steps = 400_000
    ours = seconds(compiled(steps)) / (steps * FAULT.sampling_time)
    print(f"per simulated second: compiled {ours:.3g} s, python-control {theirs:.3g} s, ratio {theirs / ours:.0f}")


def growth() -> None:
    """Time and peak memory at one, two, four and eight times as many steps."""
    from resource import RUSAGE_SELF, getrusage

    base = 450_000
    compiled(base)
    took, before = [], getrusage(RUSAGE_SELF).ru_maxrss
    for times in (1, 2, 4, 8):
        took.append(min(seconds(compiled(times * base)) for _ in range(2)))
    shares = ", ".join(f"{t / took[0] / n:.2f}" for t, n in zip(took, (1, 2, 4, 8), strict=True))
    more = (getrusage(RUSAGE_SELF).ru_maxrss - before) / 1024
    print(f"time per step at 1, 2, 4, 8 × {base} steps, relative: {shares}; peak memory grew by {more:.1f} MiB")


def main() -> int:
    """Print every comparison."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=3_600_000)
    steps = parser.parse_args().steps
    os.environ[cache.PLACE] = "off"
    growth()
    beside_control()
    try:
        beside_numba(steps)
    except ImportError:
        print("numba is not installed: pip install 'quakedesign[benchmark]'", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
