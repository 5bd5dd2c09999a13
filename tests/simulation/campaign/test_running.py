"""Whole campaigns: the same digits however they are computed, interrupted, and resumed."""

import json
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import active_children
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from thinned import few

from quakedesign.errors import OutputError, ParameterError, SimulationError
from quakedesign.fault import load_fault
from quakedesign.laws import published
from quakedesign.loop import simulation_scheme
from quakedesign.loop.sensing.measurement import Measurement
from quakedesign.parallel import SerialExecutor, UserExecutor
from quakedesign.simulation.campaign import campaign_problem, run_campaign, running
from quakedesign.simulation.campaign.ledger import Ledger
from quakedesign.simulation.campaign.space import MOST_SAMPLES

LAB = load_fault("lab-fault", box="ten-percent")
LAW = published("lab-fault")["elqr"]
SCHEME = simulation_scheme("explicit", measurement=Measurement(slip_noise=1e-7))
PROBLEM = campaign_problem(LAB, LAW, scheme=SCHEME, duration=0.3, initial_slip=1e-4, plant="printed")
COUNT = 40
SEARCH = {"metric": "max_slip_rate_error", "rounds": 2}


def answer(found):
    """Everything but how it came about."""
    return {name: value for name, value in found.to_dict().items() if name != "resumed"}


TOLD = []  # of the first campaign, while it was computed


@pytest.fixture(scope="module")
def serial(tmp_path_factory):
    folder, progress = tmp_path_factory.mktemp("serial") / "campaign", lambda *told: TOLD.append(told)
    return run_campaign(PROBLEM, COUNT, folder, executor=SerialExecutor(), batch=7, progress=progress, **SEARCH), folder


def test_what_is_done_is_told_batch_by_batch(serial):
    assert serial[0].resumed == 0
    told = np.array([done for what, done in TOLD if what == "samples"])
    assert (told[0], told[-1]) == (0, 1)
    assert sorted(np.diff(told) * COUNT) == pytest.approx([5, 7, 7, 7, 7, 7])  # in any order
    for what in {what for what, _ in TOLD} - {"samples"}:
        assert [done for whose, done in TOLD if whose == what][-1] == 1


def test_divergence_is_a_result(serial):
    found, _ = serial
    told = found.to_dict()
    assert 0 < told["events"]["diverged"]["count"] < COUNT
    assert not told["failures"]
    assert told["quantiles"]["max_slip_error"]["1"] is None
    assert told["search"]["value"] is None


@pytest.mark.slow
def test_processes_have_the_same_digits_and_a_death_loses_nothing(serial, tmp_path):
    killed = []

    def kill_one(what, done):
        if 0 < done < 1 and not killed:
            killed.append(active_children()[0].pid)
            os.kill(killed[0], signal.SIGKILL)

    found = run_campaign(PROBLEM, COUNT, tmp_path, workers=2, batch=3, progress=kill_one, **SEARCH)
    assert killed
    assert answer(found) == answer(serial[0])
    assert not active_children()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Creating scratch directories")  # dask's advice where a disk is slow for a second
def test_dask_has_the_same_digits(serial, tmp_path):
    from distributed import LocalCluster

    setting = {"processes": False, "n_workers": 1, "threads_per_worker": 2, "dashboard_address": ":0"}
    with LocalCluster(protocol="tcp", **setting) as cluster:
        found = run_campaign(PROBLEM, COUNT, tmp_path, scheduler=cluster.scheduler_address, batch=5, **SEARCH)
    assert answer(found) == answer(serial[0])


@pytest.mark.slow
def test_any_executor_will_do(serial, tmp_path):
    with ThreadPoolExecutor(3) as executor:
        found = run_campaign(PROBLEM, COUNT, tmp_path, executor=executor, **SEARCH)
    assert answer(found) == answer(serial[0])


def test_files_answer_without_computing(serial, tmp_path):
    found, folder = serial

    class Idle(SerialExecutor):
        def submit(self, task, /, *arguments, **named):
            raise AssertionError("nothing is left to do")

    again = run_campaign(PROBLEM, COUNT, folder, executor=Idle(), **SEARCH)
    assert answer(again) == answer(found)
    assert again.resumed >= COUNT


def test_what_is_saved(serial, tmp_path):
    found, _ = serial
    found.save(tmp_path)
    assert json.loads((tmp_path / "results.json").read_text()) == found.to_dict()
    assert (tmp_path / "distribution.png").read_bytes().startswith(b"\x89PNG")
    assert len((tmp_path / "samples.csv").read_text().splitlines()) == COUNT + 1


@pytest.mark.slow
def test_more_samples_begin_with_those_that_are_there(serial, tmp_path):
    few = run_campaign(PROBLEM, 10, tmp_path, executor=SerialExecutor())
    more = run_campaign(PROBLEM, COUNT, tmp_path, executor=SerialExecutor())
    assert (few.resumed, more.resumed) == (0, 10)
    assert more.metrics == PROBLEM.metrics
    assert more.results == serial[0].results


def test_a_sample_run_again_has_its_digits(serial):
    found, _ = serial
    worst = found.worst("max_slip_rate_error", COUNT)
    for index in (worst[-1], worst[0], f"search-{found.search.index}"):
        run = found.trajectory(index, samples=20)
        result = found.results[index] if isinstance(index, int) else None
        assert len(run.time) > 1
        if result is None:
            assert ("diverged" in run.events) == np.isinf(found.search.value)
        else:
            assert {name: getattr(run.metrics, name) for name in result.figures} == result.figures
            assert run.events == result.events


def test_an_interruption_leaves_what_is_done(serial, tmp_path):
    def interrupt(what, done):
        if done > 0.4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_campaign(PROBLEM, COUNT, tmp_path, executor=SerialExecutor(), batch=3, progress=interrupt, **SEARCH)
    found = run_campaign(PROBLEM, COUNT, tmp_path, executor=SerialExecutor(), batch=4, **SEARCH)
    assert 16 < found.resumed < COUNT
    assert answer(found) == answer(serial[0])


KILLED = """
import json, os, random, signal, sys, time
from dataclasses import replace
from quakedesign.laws import published
from quakedesign.fault import load_fault
from quakedesign.parallel import UserExecutor, SerialExecutor
from quakedesign.simulation.campaign import campaign_problem, run_campaign, running
from quakedesign.simulation.campaign.ledger import Ledger
from quakedesign.loop.sensing.measurement import Measurement
from quakedesign.loop.schemes import simulation_scheme

folder = sys.argv[1]
scheme = simulation_scheme("explicit", measurement=Measurement(slip_noise=1e-7))
lab, law = load_fault("lab-fault", box="ten-percent"), published("lab-fault")["elqr"]
problem = campaign_problem(lab, law, scheme=scheme, duration=0.3, initial_slip=1e-4, plant="printed")
problem.inputs
chance, files = random.Random(1), []
for _ in range(5):
    child = os.fork()
    if not child:
        slow = lambda what, done: time.sleep(0.02)
        run_campaign(problem, 40, folder, executor=SerialExecutor(), batch=1, progress=slow)
        os._exit(0)
    begun = time.monotonic()
    batches = os.path.join(folder, "batches")
    have = lambda: len(os.listdir(batches)) if os.path.isdir(batches) else 0
    wanted = have() + chance.randint(1, 6)
    while have() < wanted and time.monotonic() < begun + 20:
        time.sleep(0.001)
    time.sleep(chance.random() * 0.03)
    os.kill(child, signal.SIGKILL)
    assert os.waitpid(child, 0)[1] == signal.SIGKILL
    files.append(have())
print(json.dumps(files))
"""


@pytest.mark.slow
def test_killed_five_times_it_ends_as_if_it_had_not_been(serial, tmp_path):
    """SIGKILL at random points, in the middle of batches and of writing."""
    call = [sys.executable, "-c", KILLED, str(tmp_path / "campaign")]
    done = subprocess.run(call, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False)
    assert done.returncode == 0, done.stderr
    files = json.loads(done.stdout)
    assert 0 < files[0] < files[-1] < COUNT
    found = run_campaign(PROBLEM, COUNT, tmp_path / "campaign", executor=SerialExecutor(), **SEARCH)
    assert files[-1] <= found.resumed < COUNT
    assert answer(found) == answer(serial[0])


@pytest.mark.slow
def test_a_killed_parent_leaves_no_workers_and_resumes(serial, tmp_path):
    """Real processes: SIGKILL to the parent alone, five times."""
    program = (
        "import sys\nfrom test_running import *\n"
        "if __name__ == '__main__':\n    run_campaign(PROBLEM, COUNT, sys.argv[1], workers=2, batch=1,"
        " progress=lambda what, done: print(what, done, [c.pid for c in active_children()], flush=True), **SEARCH)\n"
    )
    (tmp_path / "main.py").write_text(program)
    folder, workers = tmp_path / "campaign", set()
    for stop in (2, 4, 5, 9, 14):
        call = [sys.executable, str(tmp_path / "main.py"), str(folder)]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
        running = subprocess.Popen(call, stdout=subprocess.PIPE, text=True, env=environment)
        for _ in range(stop):
            line = running.stdout.readline()
            workers |= set(json.loads(line[line.index("[") :])) if line else set()
        running.kill()
        running.wait()
        running.stdout.close()
    assert len(workers) >= 10
    _until_gone(workers)
    found = run_campaign(PROBLEM, COUNT, folder, workers=2, **SEARCH)
    assert found.resumed > 4
    assert answer(found) == answer(serial[0])


def _until_gone(workers):
    from time import monotonic, sleep

    end = monotonic() + 30
    while any(_alive(pid) for pid in workers):
        assert monotonic() < end, "workers outlive their parent"
        sleep(0.1)


def _alive(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"


@pytest.mark.parametrize(
    "change",
    [
        {"seed": 1},
        {"controller": published("lab-fault")["cta"]},
        {"scheme": simulation_scheme("explicit", substeps=2)},
        {"fault": LAB.with_box("paper")},
    ],
    ids=lambda change: next(iter(change)),
)
def test_another_campaign_does_not_go_on_here(serial, change):
    before = {path: path.stat().st_mtime_ns for path in serial[1].rglob("*")}
    with pytest.raises(SimulationError, match=rf"These differ: .*{next(iter(change))}"):
        run_campaign(replace(PROBLEM, **change), COUNT, serial[1], executor=SerialExecutor())
    assert {path: path.stat().st_mtime_ns for path in serial[1].rglob("*")} == before


class Failing(SerialExecutor):
    """Has no answer for the batches that hold one of some rows."""

    def __init__(self, *rows):
        super().__init__()
        self.rows = [row.tobytes() for row in rows]

    def submit(self, task, /, *arguments, **named):
        def fail():
            raise MemoryError("full")

        bad = any(row.tobytes() in self.rows for row in arguments[1])
        return super().submit(fail) if bad else super().submit(task, *arguments, **named)


@pytest.mark.slow
def test_a_batch_that_fails_leaves_the_others(tmp_path):
    failing = Failing(PROBLEM.start(PROBLEM.sample(4)))
    found = run_campaign(PROBLEM, 8, tmp_path, executor=failing, batch=3)
    assert [(failure.samples, failure.reason) for failure in found.failures] == [(("3", "4", "5"), "MemoryError: full")]
    assert [result is None for result in found.results] == [index in (3, 4, 5) for index in range(8)]
    failing = Failing(PROBLEM.start(PROBLEM.sample(0)))
    nothing = run_campaign(PROBLEM, 1, tmp_path / "other", executor=failing, metric="peak_slip_rate")
    assert (nothing.results, nothing.search) == ((None,), None)


@few("wanted", ["max_slip_error", "peak_slip_rate"], every=2)
def test_a_search_begins_at_the_worst_sample_and_passes_over_failures(tmp_path, monkeypatch, wanted):
    calm = replace(PROBLEM, setting=replace(PROBLEM.setting, steps=20, settled_from=0.0))
    asked, lost = [], calm.sample(30)

    def search(space, metric, evaluate, starts, *, noise_seed, rounds):
        values = evaluate([calm.sample(20), lost]) + evaluate([lost, calm.sample(21)])
        asked.append((metric, [point.tolist() for point in starts], noise_seed, rounds, values))

    monkeypatch.setattr(running, "search", search)
    settings = {"executor": Failing(calm.start(lost)), "batch": 1, "metric": wanted, "rounds": 3}
    found = run_campaign(calm, 12, tmp_path, **settings)
    values = found.values(wanted)
    worst = int(np.argmax(values))
    ((metric, starts, noise_seed, rounds, evaluated),) = asked
    assert len(set(values)) == 12
    assert (metric, starts, rounds) == (wanted, [calm.point(worst).tolist()], 3)
    assert noise_seed == calm.sample(worst).noise_seed
    others = run_campaign(calm, 22, tmp_path, executor=SerialExecutor()).values(wanted)
    assert evaluated == [others[20], -np.inf, -np.inf, others[21]]
    assert [failure.samples for failure in found.failures] == [("search-1",), ("search-2",)]


def test_a_search_needs_a_metric_that_some_sample_has(tmp_path):
    """Errors count after these runs have ended."""
    short = replace(PROBLEM, setting=replace(PROBLEM.setting, steps=20))
    with pytest.raises(ParameterError, match=r"metric must be one of peak_slip_rate, .*Received 'max_slip_error'"):
        run_campaign(short, 2, tmp_path, executor=SerialExecutor(), metric="max_slip_error")


@pytest.mark.parametrize(
    ("count", "width", "steps", "size"),
    [
        (1, 4, 100, 1),
        (5, 4, 100, 2),  # every worker has some, whatever the lanes
        (100, 4, 100, 8),  # 100/32, but all lanes
        (10_000, 4, 100, 312),  # eight batches a worker, in whole lanes
        (1_000_000, 4, 100, 1024),
        (1_000_000, 4, 1_000_000, 80),  # of 80 million steps
        (1_000_000, 4, 10**9, 8),
    ],
)
def test_a_batch_fills_lanes_and_workers_and_is_lost_in_half_a_minute(tmp_path, count, width, steps, size):
    program = SimpleNamespace(lanes=8, batch_steps=80_000_000)
    problem = SimpleNamespace(setting=SimpleNamespace(steps=steps))
    with UserExecutor(SerialExecutor(), width=width) as crew:
        runner = running._Runner(problem, Ledger(tmp_path, ""), program, crew, None, lambda *_: None)
        assert runner._batch_size(count) == size


def test_what_makes_no_sense_is_refused(tmp_path):
    for count in (0, -1, MOST_SAMPLES + 1):
        with pytest.raises(ParameterError, match="samples must be a whole number from 1 to 1048576"):
            run_campaign(PROBLEM, count, tmp_path)
        with pytest.raises(ParameterError, match="batch must be a whole number from 1 to 1048576"):
            run_campaign(PROBLEM, 1, tmp_path, batch=count)
    assert not any(tmp_path.iterdir())
    with pytest.raises(ParameterError, match="scheduler or an executor"):
        run_campaign(PROBLEM, 1, tmp_path, scheduler="tcp://here:1", executor=SerialExecutor())
    with pytest.raises(ParameterError, match="metric must be one of"):
        run_campaign(PROBLEM, 2, tmp_path / "a", executor=SerialExecutor(), metric="beauty")
    with pytest.raises(ParameterError, match=r"metric must be one of .*max_slip_error.*Received 'max_well_pressure'"):
        run_campaign(PROBLEM, 2, tmp_path / "a", executor=SerialExecutor(), metric="max_well_pressure")
    assert not (tmp_path / "a").exists()  # before any work
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        run_campaign(PROBLEM, 1, tmp_path / "file" / "folder", executor=SerialExecutor())
