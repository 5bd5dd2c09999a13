"""Draws the figures of the gallery, or those named: python docs/figures/gallery.py [NAME ...]."""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import control
import matplotlib.pyplot as plt
import numpy as np

import quakedesign as qd
from quakedesign.simulation import simulate_blocks

HERE = Path(__file__).parent
DATA = HERE.parents[1] / "tests" / "data"


def same_slip():
    """The natural earthquake and the slip under control."""
    fault = qd.load_fault("real-fault")
    law = qd.design(fault, "elqr").controller
    figure, axes = plt.subplots(figsize=(7, 3.6), layout="constrained")
    for label, controller, duration in (("no control", None, 3600.0), ("designed e-LQR", law, None)):
        run = qd.simulate(fault, controller, duration=duration)
        axes.plot(run.time[1:], run.slip[1:], label=label)
    axes.set(xscale="log", xlabel="time [s]", ylabel="slip [m]", title=fault.name)
    axes.legend()
    return figure


def sampling_times():
    """Sampling time required for a bound on the slip rate."""
    fault = qd.load_fault("real-fault")
    times = [50, 100, 150, 200, 250, 300, 350, 400, 450]  # ms
    found = [qd.guarantee(fault, step=f"{time} ms") for time in times]
    figure, axes = plt.subplots(figsize=(7, 3.6), layout="constrained")
    axes.plot(times, [1e6 * float(each.bounds["peak_slip_rate"]) for each in found], "o-", label="proved")
    axes.plot(times, [1e6 * each.worst_case["peak_slip_rate"] for each in found], "s--", label="worst case found")
    axes.plot(times, [1e6 * float(each.least_slip_rate) for each in found], ":", label="limit of every controller")
    axes.set(xlabel="sampling time [ms]", ylabel="largest slip rate [µm/s]", ylim=(0, None), title=fault.name)
    axes.legend()
    return figure


def margins():
    """Stability margins of an LQR and a PID."""
    fault = qd.load_fault("real-fault")
    lqr = qd.SampledLaw.from_gains([1.8e9, 3.0e8, 2.1e9, 1.0e9], step="184 ms", label="LQR")
    pid = qd.SampledLaw.from_pid(3e8, 1e8, 2e8, N=40, step="50 ms", label="PID")
    figure = plt.figure(figsize=(7, 5), layout="constrained")
    for law in (lqr, pid):
        frequencies = np.logspace(-2, np.log10(np.pi / float(law.step)), 400)  # rad/s, to half the sampling rate
        control.bode_plot(qd.loop_transfer(fault, law), frequencies, dB=True, label=law.label)
    return figure


def velocity_step():
    """Friction law identified from a velocity step."""
    found = qd.identify(DATA / "records" / "sepiolite_2.csv")
    slip = 1e6 * found.record.load_point
    figure, axes = plt.subplots(figsize=(7, 3.6), layout="constrained")
    axes.plot(slip, found.record.friction, ".", color="silver", markersize=2, label="measured")
    axes.plot(slip[found.used], found.fit.measured - found.fit.residuals, label=found.law.name)
    axes.set(xlabel="displacement of the load point [µm]", ylabel="friction [-]", title=found.assessment.verdict)
    axes.legend()
    return figure


def blocks():
    """Slip of the blocks of a fault under control."""
    chain = qd.load_chain(DATA / "three_blocks.toml")
    found = qd.guarantee(chain)
    run = simulate_blocks(chain, found.controller, duration=86400.0)
    figure, axes = plt.subplots(figsize=(7, 3.6), layout="constrained")
    for number, error in enumerate((run.slip - run.reference[:, None]).T, start=1):
        axes.plot(run.times / 3600, 1e6 * error, linewidth=0.7, label=f"block {number}")
    axes.set(xlabel="time [h]", ylabel="slip error [µm]", title=chain.name)
    axes.legend()
    return figure


def seismic_cycle():
    """Earthquakes of a rate-and-state fault, and the slip rate under control."""
    fault = qd.load_fault("crustal-patch")
    run = qd.simulate(fault, duration=2e10)
    figure, axes = plt.subplots(figsize=(7, 3.6), layout="constrained")
    axes.semilogy(run.time / 31556952, run.slip_rate, label="no control")
    bound = qd.design(fault, "elqr").guarantee.peak_slip_rate
    axes.axhline(float(bound), color="black", linestyle="--", label="proved with the designed law, at 1 µm/s")
    axes.set(xlabel="time [year]", ylabel="slip rate [m/s]", title=fault.name)
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def campaign():
    """Distribution of errors over the parameters of the box."""
    fault = qd.load_fault("lab-fault", box="ten-percent")
    problem = qd.campaign_problem(fault, qd.design(fault, "cta").controller, seed=1)
    with TemporaryDirectory() as folder:
        return qd.run_campaign(problem, 64, Path(folder) / "campaign").plot()


FIGURES = (same_slip, sampling_times, margins, velocity_step, blocks, seismic_cycle, campaign)

if __name__ == "__main__":
    for draw in FIGURES:
        if draw.__name__ in (sys.argv[1:] or [each.__name__ for each in FIGURES]):
            draw().savefig(HERE / f"gallery-{draw.__name__.replace('_', '-')}.png", dpi=110)
