"""The law of the stick-slip plant as it is exported, linearised and run, against its recursion in FORMAT.md."""

from pathlib import Path

import numpy as np
import pytest

import quakedesign as qd
from quakedesign.simulation.export import controller_step

REAL = qd.load_fault("real-fault")
CERTIFICATES = Path(__file__).parents[2] / "proofs" / "certificates"


@pytest.fixture(scope="module", params=["", "noise_", "aperiodic_"])
def law(request):
    return qd.load_guarantee(CERTIFICATES / f"stick_slip_{request.param}real-fault.json").controller


def recursion(law, seen, reference, *, sticks=True):
    """Pressures of FORMAT.md, section "A guarantee on the stick-slip plant"."""
    k, step = {name: float(value) for name, value in law.gains.items()}, float(law.step)
    level = predicted = last_rate = last_slip = 0.0
    for (x, y), (r, r_rate) in zip(seen, reference, strict=True):
        innovation = x - last_slip - step * (last_rate + predicted) / 2
        if sticks and y == 0:
            innovation = max(innovation, -step * predicted / 2 - k["rest_slip"])
        level += k["level_gain"] * (y - predicted) + k["slip_gain"] * innovation
        v = r_rate - k["return_rate"] * (x - r)
        yield -k["rate_gain"] * y + k["target_gain"] * v - level
        predicted, last_rate, last_slip = max(v, 0.0) if sticks else v, y, x


def measured(random, count):
    """Slips that rise, with rests, and slip rates."""
    rates = random.uniform(0, 1e-4, count) * (random.random(count) < 0.6)
    return np.column_stack([np.cumsum(rates) * 0.184, rates])


def test_exported_c_computes_the_pressures_of_the_recursion(law):
    """On a fault that rests, where the reference has left it behind and where it is ahead: both cut-offs act."""
    seen = measured(np.random.default_rng(0), 60)
    found, shape, end = controller_step(REAL, law), REAL.reference.shape, REAL.reference.operation_time
    grid = np.arange(60) * found.step
    target = REAL.reference.target_slip
    curve = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    assert [float(shape(s)) for s in (0.3, 0.8)] == pytest.approx(curve(np.array([0.3, 0.8])))
    reference = np.column_stack([target * curve(grid / end), target / end * curve.deriv()(grid / end)])
    memory, pressure, said = list(found.start.values()), 0.0, []
    for one in seen:
        memory, pressure = found.function(one, pressure, memory)
        said.append(float(pressure))
    assert said == pytest.approx(list(recursion(law, seen, reference)), rel=1e-9, abs=1e-6)


def test_as_a_system_of_python_control_it_computes_the_same_pressures(law):
    random = np.random.default_rng(1)
    seen, reference = measured(random, 40), random.uniform(-1e-4, 1e-4, (40, 2))
    system, state, said = qd.to_iosystem(law), np.zeros(4), []
    for one, target in zip(seen, reference, strict=True):
        inputs = np.concatenate([one, target])
        said.append(float(system.output(0, state, inputs)[0]))
        state = system.dynamics(0, state, inputs)
    assert said == pytest.approx(list(recursion(law, seen, reference)), rel=1e-9)


def test_while_the_fault_slides_it_is_linear_and_its_loop_is_stable(law):
    """Without cut-offs it is another law, of which the loop transfer function is."""
    random = np.random.default_rng(2)
    seen, reference = random.uniform(-1e-4, 1e-4, (40, 2)), random.uniform(-1e-4, 1e-4, (40, 2))
    system, state, said = qd.to_iosystem(law.while_moving), np.zeros(4), []
    for one, target in zip(seen, reference, strict=True):
        inputs = np.concatenate([one, target])
        said.append(float(system.output(0, state, inputs)[0]))
        state = system.dynamics(0, state, inputs)
    assert said == pytest.approx(list(recursion(law, seen, reference, sticks=False)), rel=1e-9)
    assert law.while_moving != law
    assert qd.loop_margins(qd.loop_transfer(REAL, law)).stable
