"""Draws the figures of the page How it works: python docs/figures/how_it_works.py."""

from pathlib import Path

import numpy as np
import sympy as sp
from scipy.linalg import expm
from scipy.spatial import ConvexHull, HalfspaceIntersection

import quakedesign as qd
from quakedesign.guarantees.exact.guarantee_files import parse_guarantee
from quakedesign.laws.stick_slip_controller import StickSlipController
from quakedesign.laws.stick_slip_law import GAIN_UNITS
from quakedesign.report.drawing import SMALL, figure, finish, named

HERE = Path(__file__).parent
PROOFS = HERE.parents[1] / "proofs" / "certificates"
FAULT = qd.load_fault("real-fault")
FINE = 160  # parts of a period
BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#777777"


def proof(name):
    """Guarantee of a stored certificate."""
    return parse_guarantee((PROOFS / name).read_text(encoding="utf-8"))


def save(drawing, name, title, note="", legend=None):
    """Write a figure beside this file."""
    finish(drawing, title, [], note, legend=legend)
    drawing.savefig(HERE / f"{name}.png", dpi=130)


def forces():
    """Friction and spring over slip: the fault is unstable where friction falls faster than the spring unloads."""
    drawing, ((left,),) = figure(1, 3.0)
    slip = np.linspace(0, 1.2, 400)
    normal = FAULT.effective_normal_stress
    friction = np.array([float(FAULT.friction.coefficient(x, 0.0)) for x in slip]) * normal / 1e6
    start = friction[0]
    spring = start - FAULT.stiffness * slip / FAULT.length**2 / 1e6
    left.plot(slip, friction, color=BLUE, linewidth=2, label="friction that resists")
    left.plot(slip, spring, color="black", label="spring that drives")
    held = friction * (1 + 5.67e6 / normal)
    left.plot(slip, held, color=BLUE, linestyle=":", label="friction with 5.67 MPa withdrawn")
    faster = spring > friction
    left.fill_between(slip, friction, spring, where=faster, color=ORANGE, alpha=0.25, label="force that accelerates")
    left.set(xlabel="slip [m]", ylabel="shear stress [MPa]", xlim=(0, 1.2))
    save(drawing, "forces", "Force balance of real-fault", legend=left)


def stuck_and_sliding(law, step, start, periods):
    """Slip rate [m/s] in `FINE` parts a period and pressures [Pa]: true friction, stick, and a sine of the amplitude.

    The course begins at rest on the reference, at the pressure that balances friction there.
    """
    x, t = sp.symbols("x t")
    mu = sp.lambdify(x, FAULT.friction.coefficient(x, sp.Integer(0)), "math")
    follow = sp.lambdify(t, [FAULT.reference.slip(t), sp.diff(FAULT.reference.slip(t), t)], "math")
    push = sp.lambdify(t, FAULT.disturbance.explicit(t), "math")
    normal, authority, stiff = FAULT.effective_normal_stress, FAULT.authority, FAULT.specific_stiffness
    gain = {name: float(getattr(law, name)) for name in GAIN_UNITS}
    time, (slip, _), rate = start, follow(start), 0.0
    balance = normal + (stiff * slip / authority - mu(0.0) * normal) / mu(slip)
    level, expected, last = -balance, 0.0, (slip, 0.0)
    rates, pressures, fine = [], [], step / FINE
    for _ in range(periods):
        target, wanted = follow(time)
        change = slip - last[0] - step * (last[1] + expected) / 2
        change = max(change, -step * expected / 2) if rate == 0 else change
        level += gain["level_gain"] * (rate - expected) + gain["slip_gain"] * change
        wish = wanted - gain["return_rate"] * (slip - target)
        expected, last = max(wish, 0.0), (slip, rate)
        pressure = -gain["rate_gain"] * rate + gain["target_gain"] * wish - level
        pressures.append(pressure)
        for _ in range(FINE):
            rates.append(rate)
            force = authority * (mu(0.0) * normal - mu(slip) * (normal - pressure)) - stiff * slip + push(time)
            rate = max(rate + fine * (force - FAULT.specific_damping * rate), 0.0)
            slip, time = slip + fine * rate, time + fine
    return np.array(rates), np.array(pressures)


def sampled(claim):
    """Slip rate, its measurements and the pressure over a cycle of rest and slip, in the middle of the task."""
    step, shown, before = float(claim.sampled_loop.step), 50, 450
    rates, pressures = stuck_and_sliding(claim.sampled_loop.law, step, 3.3e5, before + shown)
    rates, pressures = rates[FINE * before :], pressures[before:]
    time = step / FINE * np.arange(len(rates))
    drawing, ((rate,), (pressure,)) = figure(2, 3.6)
    rate.plot(time, 1e6 * rates, color=BLUE, label="slip rate of the fault")
    rate.plot(time[::FINE], 1e6 * rates[::FINE], "o", color=ORANGE, markersize=4, label="measured")
    pressure.step(
        step * np.arange(shown),
        (pressures - pressures[0]) / 1e3,
        where="post",
        color=GREY,
        label="pressure (zero-order hold)",
    )
    rate.set_ylabel("slip rate [µm/s]")
    pressure.set(ylabel="change of pressure [kPa]", xlabel="time [s]", xlim=(0, shown * step))
    pressure.legend(fontsize=SMALL)
    title = "The loop as it runs on the stick–slip plant: measured, computed and held every 0.184 s"
    save(drawing, "sampled-loop", title, legend=rate)


def matrices(claim):
    """Flow of a part of a period of the nominal plant, and the law."""
    law, model = claim.sampled_loop.law, claim.task.model
    flow = np.array([[0, 1], [float(model.slip), -float(model.rate)]])
    into = np.array([[0.0], [1.0]])
    fine = float(claim.sampled_loop.step) / FINE
    joint = expm(fine * np.block([[flow, into], [np.zeros((1, 3))]]))
    as_floats = lambda rows: np.array([[float(v) for v in row] for row in rows])  # noqa: E731
    update, measured = as_floats(law.update), as_floats(law.measured)
    output, feedback = (np.array([float(v) for v in row]) for row in (law.output, law.feedback))
    return joint[:2, :2], joint[:2, 2], update, measured, output, feedback, float(model.gain)


def course(claim, disturbance, start=(0.0, 0.0)):
    """The nominal loop of errors under a disturbance [m/s²] that is constant in each part of a period."""
    flow, into, update, measured, output, feedback, gain = matrices(claim)
    x, z, p = np.array(start), np.zeros(len(update)), 0.0
    states, pressures = [], []
    for k, d in enumerate(disturbance):
        if k % FINE == 0:
            p = output @ z + feedback @ x
            z = update @ z + measured @ x
        states.append(x)
        pressures.append(p)
        x = flow @ x + into * (gain * p + d)
    fine = float(claim.sampled_loop.step) / FINE
    return fine * np.arange(len(disturbance)), np.array(states), np.array(pressures), fine


def small_gain(claim):
    """The L1 norm of the nominal loop, what the proof adds for friction, and the worst disturbance."""
    amplitude, periods = float(claim.task.amplitude), 60
    kernel = np.zeros((periods, FINE))  # answers at the end of a period to an impulse in a part of an earlier one
    for part in range(FINE):
        disturbance = np.zeros(FINE * (periods + 1))
        disturbance[part] = 1.0
        kernel[:, part] = course(claim, disturbance)[1][FINE::FINE, 1][:periods]
    ages = kernel[:, ::-1].ravel()  # the latest impulse first
    drawing, ((norm,), (seen,)) = figure(2, 4.2, sharex=False)
    fine = float(claim.sampled_loop.step) / FINE
    norm.plot(
        fine * np.arange(ages.size),
        1e6 * amplitude * np.cumsum(np.abs(ages)),
        color=BLUE,
        label=f"L1 norm up to this age, times the amplitude: {np.ceil(1e6 * amplitude * np.abs(ages).sum()):.0f} µm/s",
    )
    proved = 1e6 * float(claim.claims.slip_rate_error)
    text = f"proved for every friction law of the box, also between samples: {np.ceil(proved):.0f} µm/s"
    norm.axhline(proved, color=ORANGE, linestyle="--", label=text)
    norm.set(xlabel="age of the disturbance [s]", ylabel="slip-rate error [µm/s]", xlim=(0, 8), ylim=(0, 1.15 * proved))
    norm.legend(fontsize=SMALL, loc="lower right")
    worst = amplitude * np.sign(ages[::-1])
    time, states, _, _ = course(claim, np.append(worst, 0.0))
    seen.plot(time, 1e6 * states[:, 1], color=BLUE, label="slip-rate error under the worst disturbance")
    seen.fill_between(
        time[:-1], 40 * np.sign(worst), color=GREY, alpha=0.3, linewidth=0, label="sign of that disturbance"
    )
    seen.set(xlabel="time [s]", ylabel="slip-rate error [µm/s]", xlim=(time[-1] - 8, time[-1]), ylim=(-230, 160))
    seen.legend(fontsize=SMALL, loc="lower left")
    save(drawing, "small-gain", "Plant without stick: largest slip-rate error of the nominal loop")


def invariant_set(claim):
    """Projection of the polytope on slip error and slip rate, and the run of the task inside of it."""
    facets = np.array([[float(v) for v in row] for row in claim.invariant_set.facets] + [[0.0, -1.0, 0.0]])
    scale = 1 / np.abs(facets).max(axis=0)
    bounds = np.append(-np.ones(len(facets) - 1), 0.0)
    inside = np.array([0.0, 1e-3, 0.0])
    corners = HalfspaceIntersection(np.column_stack([facets * scale, bounds]), inside).intersections * scale
    drawing, ((axis,),) = figure(1, 3.6)
    flat = 1e6 * corners[:, :2]
    ring = ConvexHull(flat).vertices
    axis.fill(*flat[np.append(ring, ring[0])].T, color=BLUE, alpha=0.2, label="invariant polytope (projected)")
    law = StickSlipController(law=claim.sampled_loop.law, step=claim.sampled_loop.step)
    run = qd.simulate(FAULT, law)
    label = "run of the task"
    axis.plot(1e6 * run.slip_error, 1e6 * run.slip_rate, ".", markersize=1, color=ORANGE, label=label)
    axis.axvline(
        1e6 * float(claim.claims.slip_ahead),
        color="black",
        linestyle="--",
        linewidth=0.8,
        label="proved bounds, between samples too",
    )
    axis.axvline(-1e6 * float(claim.claims.slip_behind), color="black", linestyle="--", linewidth=0.8)
    axis.axhline(1e6 * float(claim.claims.peak_slip_rate), color="black", linestyle="--", linewidth=0.8)
    axis.set(xlabel="slip ahead of the reference [µm]", ylabel="slip rate [µm/s]")
    named(axis, "a period that begins in the polytope ends in it, whether the fault slides or rests")
    save(drawing, "invariant-set", "States at the samples on the stick–slip plant", legend=axis)


if __name__ == "__main__":
    loop = proof("guarantee_real-fault.json")
    forces()
    sticks = proof("stick_slip_real-fault.json")
    sampled(sticks)
    invariant_set(sticks)
    small_gain(loop)
