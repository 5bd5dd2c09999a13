"""The compiled call over many samples has the digits of one run, and of the virtual machine."""

import numpy as np
import pytest

from quakedesign.controllers import published
from quakedesign.fault import load_fault
from quakedesign.simulation import Variation, simulate
from quakedesign.simulation.campaign import campaign_problem
from quakedesign.simulation.campaign import worker as worker_module
from quakedesign.simulation.campaign.program import mover
from quakedesign.simulation.campaign.worker import advance
from quakedesign.simulation.measurement import Measurement
from quakedesign.simulation.schemes import simulation_scheme

LAB = load_fault("lab-fault", box="ten-percent")
LAW = published("lab-fault")["elqr"]  # sampled at 1 ms it is on the verge of instability (ERRATA 22)
SCHEME = simulation_scheme("explicit", measurement=Measurement(slip_noise=1e-7))
PROBLEM = campaign_problem(LAB, LAW, scheme=SCHEME, duration=0.3, initial_slip=1e-4)
STEPS = PROBLEM.setting.steps


def starts(count):
    return np.array([PROBLEM.start(PROBLEM.sample(i)) for i in range(count)])


@pytest.fixture(scope="module")
def ends(tmp_path_factory):
    program = PROBLEM.program.compiled(tmp_path_factory.mktemp("library"))
    assert program.library
    return advance(program, starts(16), STEPS)


def test_some_diverge_and_some_do_not(ends):
    diverged = [result.diverged for result in PROBLEM.results(ends)]
    assert 0 < sum(diverged) < 16


def test_the_virtual_machine_has_the_same_digits(ends, monkeypatch, tmp_path):
    monkeypatch.setenv("CC", "false")
    mover.cache_clear()
    assert PROBLEM.program.compiled(tmp_path).library is None
    slow = advance(PROBLEM.program, starts(16), STEPS)
    mover.cache_clear()
    assert slow.tobytes() == ends.tobytes()


def test_slices_and_company_change_nothing(ends, monkeypatch):
    monkeypatch.setattr(worker_module, "SLICE", 77)
    for i in (0, 5, 15):
        assert advance(PROBLEM.program, starts(16)[[i, 3]], STEPS)[0].tobytes() == ends[i].tobytes()


def test_a_library_that_cannot_be_loaded_is_made_anew(ends, tmp_path):
    from dataclasses import replace

    (tmp_path / "no.so").write_bytes(b"none")
    for library in (tmp_path / "no.so", tmp_path / "missing.so"):
        found = advance(replace(PROBLEM.program, library=str(library)), starts(2), STEPS)
        assert found.tobytes() == ends[:2].tobytes()


def test_a_compiled_library_is_used_again(tmp_path):
    first = PROBLEM.program.compiled(tmp_path).library
    before = (tmp_path / first).stat().st_mtime_ns
    assert PROBLEM.program.compiled(tmp_path).library == first
    assert (tmp_path / first).stat().st_mtime_ns == before


def test_a_sample_is_what_simulate_gives():
    """Without an initial state, simulate() takes the same arguments."""
    from quakedesign.simulation.campaign.reseeding import reseeded

    problem = campaign_problem(LAB, LAW, scheme=SCHEME, duration=0.1)
    sample = problem.sample(3)
    (result,) = problem.results(advance(problem.program, [problem.start(sample)], problem.setting.steps))
    scheme = reseeded(SCHEME, sample.noise_seed)
    run = simulate(LAB, LAW, scheme=scheme, duration=0.1, variation=Variation(**_varied(sample)))
    figures = run.metrics.to_dict()
    assert result.figures
    assert result.figures == {name: figures[name] for name in result.figures}
    assert result.events == run.events


def _varied(sample):
    return {name: value for name, value in sample.numbers.items() if not name.startswith("initial")}
