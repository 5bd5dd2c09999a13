"""The compiled call over many samples has the digits of one run, and of the virtual machine."""

import ctypes
import os

import numpy as np
import pytest

from quakedesign.fault import load_fault
from quakedesign.laws import published
from quakedesign.loop import simulation_scheme
from quakedesign.loop.sensing.measurement import Measurement
from quakedesign.simulation import Variation, simulate
from quakedesign.simulation.campaign import campaign_problem
from quakedesign.simulation.campaign import problem as program_module
from quakedesign.simulation.campaign.problem import mover
from quakedesign.simulation.compiled import compiler, shared_library

LAB = load_fault("lab-fault", box="ten-percent")
LAW = published("lab-fault")["elqr"]  # sampled at 1 ms it is on the verge of instability (ERRATA 22)
SCHEME = simulation_scheme("explicit", measurement=Measurement(slip_noise=1e-7))
PROBLEM = campaign_problem(LAB, LAW, scheme=SCHEME, duration=0.3, initial_slip=1e-4, plant="printed")
STEPS = PROBLEM.setting.steps


def starts(count):
    return np.array([PROBLEM.start(PROBLEM.sample(i)) for i in range(count)])


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    program = PROBLEM.program.compiled(tmp_path_factory.mktemp("library"))
    assert program.library
    return program


@pytest.fixture(scope="module")
def ends(built):
    return built.ends(starts(16), STEPS)


def test_some_diverge_and_some_do_not(ends):
    diverged = [result.diverged for result in PROBLEM.results(ends)]
    assert 0 < sum(diverged) < 16


def test_the_virtual_machine_has_the_same_digits(ends, monkeypatch, tmp_path):
    monkeypatch.setenv("CC", "false")
    mover.cache_clear()
    assert PROBLEM.program.compiled(tmp_path).library is None
    slow = PROBLEM.program.ends(starts(16), STEPS)
    mover.cache_clear()
    assert slow.tobytes() == ends.tobytes()


@pytest.mark.parametrize("steps", [1, 77, 10**9])
def test_slices_and_company_change_nothing(built, ends, monkeypatch, steps):
    """A slice of 1 of all samples together is still one step of each."""
    monkeypatch.setattr(program_module, "SLICE", steps)
    for i in (0, 5, 15):
        assert built.ends(starts(16)[[i, 3]], STEPS)[0].tobytes() == ends[i].tobytes()


def test_results_are_those_of_each_end(ends, monkeypatch):
    whole = PROBLEM.results(ends)
    monkeypatch.setattr(program_module, "_SLICE", 5)
    assert PROBLEM.results(ends) == whole
    assert len(whole) == 16


def test_a_library_that_is_there_is_loaded_and_nothing_is_built_or_interpreted(built, ends, monkeypatch):
    def never(*_, **__):
        raise AssertionError("not needed")

    mover.cache_clear()
    for name in ("shared_library", "_virtual_machine"):
        monkeypatch.setattr(program_module, name, never)
    assert built.ends(starts(2), STEPS).tobytes() == ends[:2].tobytes()
    monkeypatch.setattr(program_module, "shared_library", lambda *_: built.library.path)
    assert PROBLEM.program.ends(starts(2), STEPS).tobytes() == ends[:2].tobytes()  # built where it is not there
    with pytest.raises(AssertionError):  # compiled code would write beside vectors of another length
        mover(built)(np.zeros((1, built.size - 1)), 1)
    mover.cache_clear()


def test_a_sample_that_has_diverged_stays(built):
    """As soon as it has a time of divergence, zero included, in machine code and without a compiler."""
    rows = starts(1)
    rows[0, built.diverged] = 0.0
    before = rows.tobytes()
    assert built.ends(rows, 10).tobytes() == before
    program_module._virtual_machine(built)(rows, 10)
    assert rows.tobytes() == before


PLANTED = """
#include <stdio.h>
__attribute__((constructor)) static void sign(void) {{ fclose(fopen("{mark}", "w")); }}
int advance_samples(double* vectors, long long samples, long long steps) {{ return 0; }}
"""


@pytest.fixture
def plant(tmp_path):
    """Replaces a library by one that leaves a mark as soon as it is loaded, and computes nothing."""
    mark = tmp_path / "loaded"

    def replace_library(path):
        library = shared_library(PLANTED.format(mark=mark), tmp_path, compiler())
        os.replace(library, path)
        return mark

    return replace_library


def test_a_library_that_fails_or_is_for_another_processor_is_refused(tmp_path):
    seen = '__attribute__((visibility("default"))) int'
    text = f"{seen} made_for_this_processor(void) {{ return %d; }}\n{seen} advance_samples(void) {{ return 1; }}"
    for number, ours in enumerate((1, 0)):
        (folder := tmp_path / str(number)).mkdir()
        content = shared_library(text % ours, folder, compiler()).read_bytes()
        if ours:
            with pytest.raises(ArithmeticError, match="the compiled step failed"):
                program_module._machine_code(content, folder, 1)(np.zeros((1, 1)), 1)
        else:
            with pytest.raises(OSError, match="built for another processor"):
                program_module._machine_code(content, folder, 1)


def test_a_library_whose_content_is_another_one_is_no_library(tmp_path):
    (tmp_path / "steps.so").write_bytes(b"built")
    library = program_module.Library.of(tmp_path / "steps.so")
    assert library.content() == b"built"
    library.path.write_bytes(b"other")
    with pytest.raises(OSError, match=r"steps\.so differs from the library that was built"):
        library.content()


def test_the_planted_library_of_these_tests_would_be_seen(plant, tmp_path):
    mark = plant(tmp_path / "planted.so")
    ctypes.CDLL(str(tmp_path / "planted.so"))
    assert mark.exists()


@pytest.mark.slow
def test_a_planted_library_is_not_loaded(ends, plant, tmp_path):
    program = PROBLEM.program.compiled(tmp_path)
    mark = plant(program.library.path)
    assert program.ends(starts(2), STEPS).tobytes() == ends[:2].tobytes()
    assert not mark.exists()


@pytest.mark.slow
@pytest.mark.parametrize("left", [0.0, 0.5, 0.99])
def test_a_damaged_library_is_built_anew(ends, tmp_path, left):
    program = PROBLEM.program.compiled(tmp_path)
    content = program.library.path.read_bytes()
    program.library.path.write_bytes(content[: int(left * len(content))])
    assert program.ends(starts(2), STEPS).tobytes() == ends[:2].tobytes()


@pytest.mark.slow
def test_a_library_that_is_gone_is_built_anew(ends, tmp_path):
    program = PROBLEM.program.compiled(tmp_path)
    program.library.path.unlink()
    assert program.ends(starts(2), STEPS).tobytes() == ends[:2].tobytes()


def test_nothing_compiled_in_its_folder_changes_a_campaign(ends, plant, tmp_path):
    """Whatever a folder of results holds comes from whoever may write there."""
    from quakedesign.parallel import SerialExecutor
    from quakedesign.simulation.campaign import run_campaign

    folder = tmp_path / "campaign"
    run_campaign(PROBLEM, 2, folder, executor=SerialExecutor())
    for path in [*folder.rglob("*.so"), folder / "steps.so"]:
        mark = plant(path)
    found = run_campaign(PROBLEM, 4, folder, executor=SerialExecutor())
    assert list(found.results) == PROBLEM.results(ends[:4])
    assert not mark.exists()
    assert [path.name for path in folder.rglob("*.so")] == ["steps.so"]


def test_a_sample_is_what_simulate_gives():
    """Without an initial state, simulate() takes the same arguments."""
    from quakedesign.simulation.campaign.problem import reseeded

    problem = campaign_problem(LAB, LAW, scheme=SCHEME, duration=0.1)
    sample = problem.sample(3)
    (result,) = problem.results(problem.program.ends([problem.start(sample)], problem.setting.steps))
    scheme = reseeded(SCHEME, sample.noise_seed)
    run = simulate(LAB, LAW, scheme=scheme, duration=0.1, variation=Variation(**_varied(sample)))
    figures = run.metrics.to_dict()
    assert result.figures
    assert result.figures == {name: figures[name] for name in result.figures}
    assert result.events == run.events


def _varied(sample):
    return {name: value for name, value in sample.numbers.items() if not name.startswith("initial")}
