"""Laws of several blocks as C: the digits of Python, the equations by hand, and the slips of the simulated loop."""

import ctypes
import subprocess
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

import quakedesign as qd
from quakedesign.fault import SlidingReference
from quakedesign.guarantees.exact.plant_loop import MatrixLaw
from quakedesign.simulation import simulate_blocks
from quakedesign.simulation.export import block_step, write_step

DATA = Path(__file__).parents[1] / "data"
CHAIN = qd.load_chain(DATA / "three_blocks.toml")
N = 3


def law_of(wells, measured, states):
    """Matrices of random numbers, small enough for a loop of a thousand samples."""
    random = np.random.default_rng(wells + measured)

    def rows(height, width, size):
        values = random.uniform(-size, size, (height, width))
        return tuple(tuple(F(f"{v:.6g}") for v in row) for row in values)

    return MatrixLaw(
        step=F("0.184"),
        delay=F(0),
        update=rows(states, states, 0.3),
        measured=rows(states, measured, 1),
        output=rows(wells, states, 1e6),
        feedback=rows(wells, measured, 1e9),
    )


CASES = {
    "a well a block": (CHAIN, law_of(3, 6, 6)),
    "two wells": (replace(CHAIN, wells=(1000.0, 4000.0)), law_of(2, 4, 4)),
    "one well": (replace(CHAIN, wells=(2500.0,)), law_of(1, 2, 2)),
    "without states": (CHAIN, law_of(3, 6, 0)),
}
Numbers = ctypes.POINTER(ctypes.c_double)


def compiled(folder):
    flags = ["-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Werror", "-fPIC", "-shared"]
    call = ["cc", *flags, "controller.c", "-o", "controller.so", "-lm"]
    subprocess.run(call, cwd=folder, check=True, capture_output=True)
    library = ctypes.CDLL(str(folder / "controller.so"))
    library.controller_step.argtypes, library.controller_step.restype = [Numbers] * 3, None
    library.controller_reset.argtypes, library.controller_reset.restype = [Numbers], None
    return library


def stepping(found, folder):
    """Pressures of the compiled step for a measurement, and its memory."""
    library, memory, pressure = compiled(folder), np.ones(len(found.start)), np.zeros(len(found.pressures))
    told = [array.ctypes.data_as(Numbers) for array in (memory, pressure)]
    library.controller_reset(told[0])

    def step(seen):
        given = np.ascontiguousarray(seen)
        library.controller_step(given.ctypes.data_as(Numbers), *told)
        return pressure

    return step, memory


def planned(time, task=CHAIN.fault.reference):
    stage = min(time / task.operation_time, 1.0)
    r = task.target_slip * stage**3 * (10 - 15 * stage + 6 * stage**2)
    return r, task.target_slip / task.operation_time * 30 * stage**2 * (1 - stage) ** 2


def averages_by_hand(chain):
    """Of the blocks, for each well: weights of its shares."""
    shares = np.array(chain.shares, dtype=float)
    return np.eye(N) if shares.shape[1] == N else (shares / shares.sum(axis=0)).T


@pytest.mark.parametrize("case", CASES)
def test_c_gives_the_digits_of_python_and_the_pressures_of_the_matrices(case, tmp_path):
    chain, law = CASES[case]
    found = write_step(block_step(chain, law), tmp_path / "c")
    assert list(found.measurement) == [f"{what}_{i}" for what in ("slip", "slip_rate") for i in (1, 2, 3)]
    step, memory = stepping(found, tmp_path / "c")
    assert memory.tolist() == list(found.start.values())
    own, different, random = memory.copy(), 0, np.random.default_rng(4)
    A, B, C, D = (np.array(m, dtype=float) for m in (law.update, law.measured, law.output, law.feedback))
    z, weights = np.zeros(len(A)), averages_by_hand(chain)
    for k, seen in enumerate(random.normal(size=(500, 2 * N)) * np.repeat([1e-4, 1e-3], N)):
        pressure = step(seen)
        own, expected = found.function(seen, own)
        own = own.full().ravel()
        different += own.tobytes() != memory.tobytes() or expected.full().ravel().tobytes() != pressure.tobytes()
        r, moved = planned(k * 0.184)
        y = np.r_[weights @ seen[:N] - r, weights @ seen[N:] - moved]
        wanted = D @ y + (C @ z if len(z) else 0)
        assert pressure == pytest.approx(wanted, rel=1e-9, abs=1e-4)
        z = A @ z + B @ y if len(z) else z
    assert different == 0
    assert memory[0] == 500


def looped(chain, step, periods, substeps):
    """Slips after each period of blocks that friction holds at rest, by the steps of Euler that a run states."""
    pulls, fault, rate = np.zeros((N, N)), chain.fault, 0.184 / substeps
    for i, j, K in chain.springs:
        pulls[i, j], pulls[i, i] = float(K), pulls[i, i] - float(K)
    shares, phases = np.array(chain.shares, dtype=float), 2 * np.pi * np.arange(N) / N
    stress, x, v, slips = np.array([50e6, 45e6, 50e6]), np.zeros(N), np.zeros(N), []

    def friction(x):
        exponential = 0.2353 + 0.1 * np.exp(-np.maximum(x[:2], 0) / 0.27635)
        return np.array([*exponential, 0.25 + 0.08 * max(0, 1 - max(x[2], 0) / 0.3)])

    for k in range(periods):
        p = shares @ step(np.r_[x, v])
        for i in range(substeps):
            push = 3.2e-4 * np.sin(0.69 * (k * 0.184 + i * rate) + phases) + 3.2e-6 * x - fault.specific_damping * v
            driven = fault.authority * (friction(np.zeros(N)) * stress - friction(x) * (stress - p))
            v = np.maximum(v + rate * (driven - fault.specific_stiffness * x + pulls @ x + push), 0)
            x = x + rate * v
        slips.append(x)
    return np.array(slips)


@pytest.mark.slow
@pytest.mark.parametrize(("wells", "kind"), [(3, "centralised"), (3, "decentralised"), (1, "centralised")])
def test_blocks_under_the_compiled_law_move_as_in_the_simulated_loop(wells, kind, tmp_path):
    """1000 periods of a hurried task: slips apart by rounding, 1e-9 of their size."""
    task = replace(CHAIN.fault.reference, operation_time=184.0, target_slip=3.68e-3)
    chain = replace(CHAIN, fault=replace(CHAIN.fault, reference=task), wells=CHAIN.wells if wells == N else (2500.0,))
    found = qd.guarantee(chain, kind)
    assert found.proved
    exported = write_step(block_step(chain, found.proof.law), tmp_path / "c")
    step, _ = stepping(exported, tmp_path / "c")
    run = simulate_blocks(chain, found.proof.law, duration=184.0, substeps=8)
    slips = looped(chain, step, 1000, 8)
    assert slips[-1].min() > 1e-3
    assert np.abs(slips - run.slip).max() < 1e-9 * slips.max()


def test_an_fmu_has_a_pressure_for_each_well(tmp_path):
    chain, law = CASES["two wells"]
    found = write_step(block_step(chain, law), tmp_path / "c", fmu=True)
    path = str(tmp_path / "c" / "controller.fmu")
    assert validate_fmu(path) == []
    described = fmpy.read_model_description(path)
    named = [(v.name, v.causality) for v in described.modelVariables]
    outputs = [("pressure_1", "output"), ("pressure_2", "output")]
    assert named == [*((name, "input") for name in found.measurement), *outputs]
    times = 0.184 * np.arange(20)
    seen = np.array([1e-4 * np.sin(times + i) for i in range(2 * N)]).T
    own, wanted = list(found.start.values()), []
    for row in seen:
        own, pressure = found.function(row, own)
        wanted.append(pressure.full().ravel())
    given = np.array(
        [(t, *row) for t, row in zip(times, seen, strict=True)],
        dtype=[(n, float) for n in ("time", *found.measurement)],
    )
    run = fmpy.simulate_fmu(
        path,
        stop_time=20 * 0.184,
        step_size=0.184,
        output_interval=0.184,
        input=given,
        output=["pressure_1", "pressure_2"],
    )
    simulated = np.array([run["pressure_1"], run["pressure_2"]]).T[1:]
    assert len(simulated) >= 19
    assert simulated[:19] == pytest.approx(np.array(wanted)[:19], rel=1e-12)


@pytest.mark.parametrize("wells", [3, 2])
@pytest.mark.parametrize("ramp", [None, 0.2])
def test_a_law_of_slow_sliding_reads_slips_and_writes_pressures_beside_the_plan(wells, ramp, tmp_path):
    """By hand: megapascals of the matrices; what the header says of the plan is what the blocks need, by K and mu."""
    chain = qd.load_chain(DATA / "three_sliding_blocks.toml")
    chain = replace(chain, wells=chain.wells if wells == 3 else (2500.0, 12500.0))
    chain = replace(chain, fault=replace(chain.fault, reference=replace(chain.fault.reference, ramp=ramp)))
    law = replace(law_of(wells, wells, 4), step=F(400))
    found = write_step(block_step(chain, law), tmp_path / "c", fmu=wells == 2)
    assert found.measurement == {f"slip_{i}": "m" for i in (1, 2, 3)}
    step, memory = stepping(found, tmp_path / "c")
    A, B, C, D = (np.array(m, dtype=float) for m in (law.update, law.measured, law.output, law.feedback))
    z, weights, share = np.zeros(4), averages_by_hand(chain), ramp or 0.0
    for k, seen in enumerate(np.random.default_rng(4).normal(size=(50, 3)) * 1e-4):
        s = min(k * 400 / 1e6, 1.0)
        y = weights @ seen - ((1 - share) * k * 400 / 1e6 + share * s**3 * (10 - 15 * s + 6 * s**2))
        assert step(seen) == pytest.approx(1e6 * (D @ y + C @ z), rel=1e-9)
        z = A @ z + B @ y
    assert memory[0] == 50
    plan = found.facts["planned pressure"]
    per_slip, formula = plan.split(" Pa/m times r(t), r = ")
    assert float(per_slip) == pytest.approx(32.04e9 / 15e3 / chain_friction(chain), rel=1e-12)
    assert formula.endswith(f"d = 1.0 m, T = 1000000.0 s, c = {share!r}")
    body = (
        formula.split(", s =")[0].replace("^", "**").replace("c s", "c*s").replace("15s", "15*s").replace("6s", "6*s")
    )
    body = body.replace("(1 - c)t", "(1 - c)*t").replace("**3(", "**3*(")
    course = SlidingReference(task=chain.fault.reference)
    for t in (0.0, 3e5, 9.9e5):
        r = eval(body.replace("d(", "d*("), {"c": share, "t": t, "T": 1e6, "d": 1.0, "s": t / 1e6})
        assert r == pytest.approx(float(course.slip(t)), rel=1e-12)
    if wells == 2:
        assert validate_fmu(str(tmp_path / "c" / "controller.fmu")) == []


def chain_friction(chain):
    """Steady friction at the first rate, mu_0 + (a - b)ln(V/v_0)."""
    law, V = chain.blocks[0].friction, float(SlidingReference(task=chain.fault.reference).first_rate)
    return law.reference_coefficient + (law.direct_effect - law.evolution_effect) * np.log(V / law.reference_rate)
