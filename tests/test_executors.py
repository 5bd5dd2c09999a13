"""Who computes: the same digits wherever, and one clear message where nobody can."""

import sys
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor
from fractions import Fraction as F
from functools import partial
from types import SimpleNamespace

import pytest
from thinned import few

import quakedesign as qd
from quakedesign import parallel as executors
from quakedesign.errors import ParameterError, SimulationError
from quakedesign.fault import load_fault
from quakedesign.lyapunov import certificate_text
from quakedesign.lyapunov.gains.synthesise import synthesise
from quakedesign.lyapunov.maps.gain_map import gain_map
from quakedesign.parallel import Cluster, InProcess, Processes, SerialExecutor, UserExecutor, crew_of, crew_or_here
from quakedesign.synthesis import guarantees_of

MAP = {"ranges": (("0.5", "3"), ("1", "4")), "points": 4, "levels": ("1", "0.5"), "degree": 4, "interior": 2}
GAINS = ("6.96e8", "2.53e8", "6.02e8", "2.16e8")


@pytest.fixture(scope="module")
def scheduler():
    """Address of a cluster of one worker with two threads."""
    from distributed import LocalCluster

    setting = {"processes": False, "n_workers": 1, "threads_per_worker": 2, "dashboard_address": ":0"}
    with LocalCluster(protocol="tcp", **setting) as cluster:
        yield cluster.scheduler_address


def mapped(**who):
    found = gain_map("super-twisting", ("1.5", "1.1"), ("k1", "k2"), **MAP, **who)
    return found.limits, found.screened, found.proved, found.edges, found.certificates, found.solves


def climbed(**who):
    found = synthesise("super-twisting", degrees=(4,), starts=2, compare=False, **who)
    return found.gains, found.value, certificate_text(found.certificate)


def guaranteed(**who):
    fault, patch = load_fault("real-fault"), load_fault("crustal-patch")
    one = partial(qd.guarantee, fault)
    asked = [partial(one, gains=GAINS), partial(qd.guarantee, patch), partial(one, gains=GAINS, step=F(1, 10))]
    first, refused, other = guarantees_of(asked, **who)
    assert "slow sliding needs a diffusion path or a lag" in str(refused)
    return first.to_dict(), str(refused), other.to_dict()


@pytest.mark.filterwarnings("ignore:Creating scratch directories")  # dask's advice where a disk is slow for a second
@few("asked", [mapped, climbed, guaranteed], every=3)
def test_no_digit_depends_on_who_computes(asked, scheduler):
    alone = asked(workers=1)
    assert asked(scheduler=scheduler) == alone


def test_any_executor_will_do():
    with ThreadPoolExecutor(2) as executor:
        assert mapped(executor=executor) == mapped(workers=1)


def test_progress_of_several_answers():
    told = []
    found = guarantees_of([lambda i=i: i * i for i in range(3)], progress=lambda what, done: told.append((what, done)))
    assert found == [0, 1, 4]
    assert told == [("1 of 3 computed", 1 / 3), ("2 of 3 computed", 2 / 3), ("3 of 3 computed", 1)]


def test_the_process_that_asks_does_what_is_wanted_and_no_more():
    done = []
    waiting = InProcess().results(done.append, [(1,), (2,)])
    assert next(waiting) == (0, None)
    assert done == [1]
    assert InProcess().submit(abs, -3).result() == 3


def test_who_is_asked():
    assert isinstance(crew_or_here(1), InProcess)
    with crew_or_here(2) as crew:
        assert isinstance(crew, Processes)
    with crew_of(1) as crew:
        assert isinstance(crew, Processes)
    for chosen in (crew_or_here(1, executor=SerialExecutor()), crew_of(3, executor=SerialExecutor())):
        assert isinstance(chosen, UserExecutor)
    with pytest.raises(ParameterError, match="give a scheduler or an executor"):
        crew_or_here(1, "tcp://127.0.0.1:9", SerialExecutor())


def length(text):
    return len(text)


@pytest.mark.filterwarnings("ignore:Creating scratch directories")
def test_what_many_tasks_take_is_sent_once_and_again_where_it_is_lost(scheduler):
    with Cluster(scheduler) as crew:
        sent = crew.shared("a programme")
        assert crew.submit(length, sent).result() == len("a programme")
        first = sent.place
        crew.submit(length, sent).result()
        assert sent.place is first
        first.cancel()  # as when all workers that had it are gone
        assert crew.submit(length, sent).result() == len("a programme")
        assert sent.place is not first
    assert InProcess().shared("a programme") == "a programme"


@pytest.mark.filterwarnings("ignore:Creating scratch directories")
def test_a_scheduler_without_workers_is_told_what_to_start(monkeypatch):
    from distributed import LocalCluster

    monkeypatch.setattr(executors, "_CONNECTION_TIMEOUT", "300ms")
    with LocalCluster(n_workers=0, processes=False, dashboard_address=":0", protocol="tcp") as cluster:
        with pytest.raises(SimulationError, match=r"a scheduler must have workers.*Start one with 'dask worker tcp"):
            Cluster(cluster.scheduler_address)


def kills(_place):
    from distributed import KilledWorker

    raise KilledWorker("a task", SimpleNamespace(address="tcp://worker"), 3)


@pytest.mark.filterwarnings("ignore:Creating scratch directories")
def test_workers_of_a_cluster_that_die_are_told(scheduler):
    with Cluster(scheduler) as crew, pytest.raises(SimulationError, match="workers of the cluster must live"):
        list(crew.results(kills, [(1,)]))


def test_an_executor_of_the_user_is_not_replaced():
    class Broken(SerialExecutor):
        def submit(self, task, /, *arguments, **named):
            raise BrokenExecutor

    with pytest.raises(SimulationError, match="executor must have live workers"):
        list(UserExecutor(Broken()).results(abs, [(1,), (2,)]))


@pytest.mark.parametrize("count", [0, -1, 1.5, True])
def test_a_number_of_workers_that_is_none(count):
    with pytest.raises(ParameterError, match="workers must be a whole number"):
        Processes(count)


def test_a_scheduler_that_does_not_answer(monkeypatch):
    monkeypatch.setattr(executors, "_CONNECTION_TIMEOUT", "100ms")
    with pytest.raises(SimulationError, match="scheduler must be the address of a running scheduler"):
        executors.Cluster("tcp://127.0.0.1:9")


def test_a_scheduler_without_dask_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(SimulationError, match=r"not installed\. Install it with pip install 'dask\[distributed\]'"):
        executors.Cluster("tcp://127.0.0.1:9")
