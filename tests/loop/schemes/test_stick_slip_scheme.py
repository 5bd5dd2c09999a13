"""The scheme stick-slip against the recursion of FORMAT.md with a root found by bisection, and as it is exported."""

from pathlib import Path

import numpy as np
import pytest
from stick_slip_attack import end_of_step

import quakedesign as qd
from quakedesign.errors import ParameterError
from quakedesign.guarantees.exact.file_entries import power_entries
from quakedesign.guarantees.search.compensated_search import recovered
from quakedesign.loop import simulation_scheme
from quakedesign.simulation.export import controller_step
from quakedesign.sos.exact.strict import written

REAL = qd.load_fault("real-fault")
FILE = Path(__file__).parents[3] / "proofs" / "certificates" / "stick_slip_cta_real-fault.json"


@pytest.fixture(scope="module")
def claim():
    return qd.load_guarantee(FILE)


def recursion(law, step, seen, reference):
    """Pressures of FORMAT.md, section "A guarantee on the stick-slip plant", with v = r' + w."""
    pull, level, predicted, last_rate, last_slip = written(power_entries(law.pull)), 0.0, 0.0, 0.0, 0.0
    for (x, y), (r, r_rate) in zip(seen, reference, strict=True):
        innovation = x - last_slip - step * (last_rate + predicted) / 2
        if y == 0:
            innovation = max(innovation, -step * predicted / 2 - float(law.rest_slip))
        level += float(law.level_gain) * (y - predicted) + float(law.slip_gain) * innovation
        v = r_rate + float(end_of_step(pull, step, np.array(x - r), np.array(y - r_rate)))
        yield float(law.target_gain) * (v - y) - level
        predicted, last_rate, last_slip = max(v, 0.0), y, x


@pytest.mark.parametrize("size", [1.0, 1e3], ids=["deadbeat", "far"])
def test_exported_c_computes_the_pressures_of_the_recursion(claim, size):
    """Within the claims, where the step is deadbeat, and a thousand times as far, where it is not; with rests."""
    law, controller = claim.sampled_loop.law, recovered(claim).controller
    random, step = np.random.default_rng(0), float(claim.sampled_loop.step)
    rates = size * random.uniform(0, 1e-4, 60) * (random.random(60) < 0.6)
    seen = np.column_stack([np.cumsum(rates) * 0.184 / 8, rates])
    found, end = controller_step(REAL, controller), REAL.reference.operation_time
    grid, target = np.arange(60) * found.step, REAL.reference.target_slip
    curve = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    reference = np.column_stack([target * curve(grid / end), target / end * curve.deriv()(grid / end)])
    memory, pressure, said = list(found.start.values()), 0.0, []
    for one in seen:
        memory, pressure = found.function(one, pressure, memory)
        said.append(float(pressure))
    assert said == pytest.approx(list(recursion(law, step, seen, reference)), rel=1e-7, abs=1.0)
    errors = seen[:, 0] - reference[:, 0], seen[:, 1] - reference[:, 1]
    ends = end_of_step(written(power_entries(law.pull)), step, *errors)
    assert np.allclose(ends, -errors[0] / step, rtol=1e-6, atol=1e-12) == (size == 1)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"weight": 0.0}, "weight must be above 0 and at most 1. Received 0.0"),
        ({"weight": 1.1}, "weight must be above 0 and at most 1. Received 1.1"),
        ({"slip_weight": -0.1}, "slip_weight must be from 0 to 1. Received -0.1"),
        ({"slip_weight": 1.1}, "slip_weight must be from 0 to 1. Received 1.1"),
        ({"rest_slip": -1e-6}, "rest_slip must be finite and 0 or more. Received -1e-06 m"),
        ({"rest_slip": float("inf")}, "rest_slip must be finite and 0 or more. Received inf m"),
    ],
)
def test_settings_out_of_their_range_are_rejected(settings, said):
    with pytest.raises(ParameterError, match=said):
        simulation_scheme("stick-slip", **settings)
    simulation_scheme("stick-slip", weight=1.0, slip_weight=0.0, rest_slip=0.0)


def test_its_certificate_gives_a_controller_that_runs_and_stays_within_the_claims(claim):
    """Under the disturbance of the fault, for 1600 periods on the stick-slip plant."""
    controller = recovered(claim).controller
    assert controller.sampling.scheme == "stick-slip"
    assert controller.numbers["weight"] == claim.sampled_loop.law.level_gain / claim.sampled_loop.law.target_gain
    run = qd.simulate(REAL, controller, duration=300)
    assert run.provenance["scheme"] == "stick-slip"
    assert 0 < np.max(run.slip_rate) <= float(claim.claims.peak_slip_rate)
    assert np.max(np.abs(run.slip_error)) <= float(claim.claims.slip_error)
