"""Processes of a pool end with the process that asks, however that ends."""

import os
import signal
import sys
import time
from concurrent.futures import BrokenExecutor, Future

import pytest
from thinned import few

from quakedesign.errors import ParameterError, SimulationError
from quakedesign.parallel import Crew, Processes, cores, require_workers

PROGRAM = """
import os, sys, time
from quakedesign.parallel import ending
from quakedesign.parallel import Processes

def work(kind):
    os.write(1, b"there\\n")  # two write at once: a line in one piece
    while kind == "idle":
        time.sleep(1)
    while kind == "busy":
        pass
    sum(range(10**12))  # foreign code, in which no thread of the process has its turn

if __name__ == "__main__":
    with ending(), Processes(2) as crew:
        list(crew.results(work, [(sys.argv[1],)] * 2))
"""
KINDS = ["idle", "busy", *(["foreign"] if sys.platform == "linux" else [])]


@pytest.mark.parametrize("kind", KINDS)
@few(
    ("number", "code", "said"),
    [
        (signal.SIGINT, 130, "quakedesign: interrupted; nothing was written.\n"),
        (signal.SIGTERM, 143, "quakedesign: terminated; nothing was written.\n"),
        (signal.SIGHUP, 129, "quakedesign: hung up; nothing was written.\n"),
        (signal.SIGKILL, -signal.SIGKILL, ""),
    ],
    ids=lambda value: value.name if isinstance(value, signal.Signals) else "",
    every=2,
)
def test_nobody_outlives_the_process_that_asks(start, tmp_path, number, code, said, kind):
    (tmp_path / "program.py").write_text(PROGRAM)
    process = start("program.py", kind)
    assert [process.stdout.readline() for _ in range(2)] == ["there\n"] * 2
    process.send_signal(number)
    _, err = process.communicate(timeout=5)
    assert process.returncode == code
    assert err == said or not said


HEAVY = """
import os
from multiprocessing import current_process

def begin():
    pass

if current_process().name != "MainProcess":
    os.write(1, b"there\\n")
    sum(range(10**12))
"""


def test_nobody_outlives_it_while_modules_are_imported(start, tmp_path):
    """What is called before the first task lies in a module that takes its time in foreign code."""
    (tmp_path / "heavy.py").write_text(HEAVY)
    program = PROGRAM.replace("    with", "    from heavy import begin\n    with").replace("(2)", "(2, begin)")
    (tmp_path / "program.py").write_text(program)
    process = start("program.py", "idle")
    assert [process.stdout.readline() for _ in range(2)] == ["there\n"] * 2
    process.kill()
    process.communicate(timeout=5)


def test_interruptions_of_the_whole_group_are_one_line_from_the_start(start, tmp_path):
    """Ctrl-C reaches the workers too, which may have just begun to start."""
    (tmp_path / "program.py").write_text("print('begun', flush=True)\n" + PROGRAM)
    process = start("program.py", "idle")
    assert process.stdout.readline() == "begun\n"
    assert process.stdout.read(1) == "b"  # of a worker
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=5)
    assert (process.returncode, err) == (130, "quakedesign: interrupted; nothing was written.\n")


# CPython's pool may count its processes while it starts another, and tells so in a thread that has done its work
@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_worker_that_was_killed_is_replaced_and_answers_keep_their_places():
    with Processes(2) as crew:
        (answer,) = crew.results(os.getpid, [()])
        os.kill(answer[1], signal.SIGKILL)
        found = dict(crew.results(divmod, [(i, 7) for i in range(20)]))
    assert found == {i: divmod(i, 7) for i in range(20)}


def test_a_death_that_closes_the_pipes_of_a_process_about_to_start_is_a_death(monkeypatch):
    """A pool that breaks while `submit` starts a process ends in an error of the system's, not of the pool's."""
    with Processes(1) as crew:
        broken = crew._pool
        monkeypatch.setattr(broken, "submit", lambda *_: os.close(-1))
        assert dict(crew.results(divmod, [(5, 7)])) == {0: (0, 5)}
        assert crew._pool is not broken


def test_an_error_of_a_task_is_that_of_the_caller():
    with pytest.raises(ZeroDivisionError), Processes(1) as crew:
        list(crew.results(divmod, [(1, 0)]))


class Mortal(Crew):
    """Does tasks at once, and dies at some of them: at those numbers, counted over all lives."""

    width = 1

    def __init__(self, *deaths):
        self.deaths, self.begun, self.renewed = deaths, [], 0

    def submit(self, task, *given):
        done = Future()
        if len(self.begun) in self.deaths:
            done.set_exception(BrokenExecutor("died"))
        else:
            done.set_result(task(*given))
        self.begun.append(given)
        return done

    def renew(self):
        self.renewed += 1


def test_workers_have_three_lives():
    """A single task that twice kills who does it is done by the third; one that kills three is given up."""
    third = Mortal(0, 1)
    with third as crew:
        assert list(crew.results(divmod, [(9, 7)])) == [(0, (1, 2))]
    assert (len(third.begun), third.renewed) == (3, 2)
    with pytest.raises(SimulationError, match="died 3 times, with 1 tasks left"):
        list(Mortal(0, 1, 2, 3).results(divmod, [(9, 7)]))


def test_what_was_answered_before_a_death_is_not_asked_for_again():
    crew, tasks = Mortal(0), [(i, 7) for i in range(5)]
    found = [(place, answer, crew.renewed) for place, answer in crew.results(divmod, tasks)]
    assert {place: answer for place, answer, _ in found} == {i: divmod(*given) for i, given in enumerate(tasks)}
    assert sorted(place for place, _, lives in found if lives) == [i for i, _ in crew.begun[5:]]
    assert len(found) == 5
    assert list(Mortal().results(divmod, [])) == []


def test_one_worker_is_enough_and_none_is_refused():
    assert require_workers(1) == 1
    for none in (0, -1, True, 1.5, "2"):
        with pytest.raises(ParameterError, match="whole number of at least 1"):
            require_workers(none)
    with Processes(1) as one, Processes() as many:
        assert (one.width, many.width) == (1, cores())


def test_what_many_tasks_take_is_handed_on_as_it_is():
    value = object()
    assert Mortal().shared(value) is value


def test_cores_are_those_that_this_process_may_use_else_all_and_one_where_nobody_knows(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {3, 5, 7} if process == 0 else set(), raising=False)
    assert cores() == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    for count, expected in ((6, 6), (None, 1)):
        monkeypatch.setattr(os, "cpu_count", lambda count=count: count)
        assert cores() == expected


def test_an_error_in_the_block_ends_processes_at_once_and_renewal_begins_with_others():
    crew = Processes(1)
    assert crew.submit(divmod, 9, 7).result() == (1, 2)
    (first,) = crew._pool._processes.values()
    crew.renew()
    assert not first.is_alive()
    assert crew.submit(divmod, 9, 7).result() == (1, 2)
    (second,) = crew._pool._processes.values()
    crew.submit(time.sleep, 1000)
    crew.__exit__(RuntimeError, RuntimeError("enough"), None)
    second.join(10)
    assert not second.is_alive()
