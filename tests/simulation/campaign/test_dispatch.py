"""Deaths and errors of workers: who is charged, and what is kept."""

from concurrent.futures import BrokenExecutor, CancelledError, Future, wait

import pytest

from quakedesign.parallel import Crew, SerialExecutor, UserExecutor
from quakedesign.simulation.campaign import running
from quakedesign.simulation.campaign.running import dispatch


class Frail(Crew):
    """Workers that answer in turn, all of whom die as soon as a deadly batch is among those under way."""

    width = 3

    def __init__(self, deadly=(), deaths=10**6):
        self.deadly, self.deaths, self.under_way = set(deadly), deaths, []
        self.renewals = self.submitted = 0

    def submit(self, task, *arguments):
        self.submitted += 1
        future = Future()
        self.under_way.append((future, task, arguments))
        if len(self.under_way) == self.width or arguments[0] >= 100:
            self._work()
        return future

    def _work(self):
        dies = self.deaths > 0 and any(arguments[0] in self.deadly for _, _, arguments in self.under_way)
        self.deaths -= dies
        for future, task, arguments in self.under_way:
            if dies:
                future.set_exception(BrokenExecutor())
                continue
            try:
                future.set_result(task(*arguments))
            except (Exception, CancelledError) as error:
                future.set_exception(error)
        self.under_way = []

    def renew(self):
        self.renewals += 1


class Alone(Frail):
    """The same with one batch under way at a time."""

    width = 1


def run(crew, task, count):
    found = {}
    failed = dispatch(task, {i: (i,) for i in range(count)}, crew, found.__setitem__)
    return found, failed


def test_all_answers_are_kept():
    found, failed = run(UserExecutor(SerialExecutor()), lambda i: i * i, 10)
    assert found == {i: i * i for i in range(10)}
    assert not failed


def test_a_death_that_does_not_come_back_costs_nothing():
    crew = Alone(deadly={4}, deaths=1)
    found, failed = run(crew, abs, 9)
    assert found == {i: i for i in range(9)}
    assert (failed, crew.renewals) == ({}, 1)


def test_a_deadly_batch_alone_is_given_up():
    found, failed = run(Alone(deadly={4}), abs, 9)
    assert sorted(found) == [0, 1, 2, 3, 5, 6, 7, 8]
    assert list(failed) == [4]
    assert "a worker died" in failed[4]


def test_its_neighbours_are_innocent():
    class Pool(Frail):
        def submit(self, task, *arguments):
            future = super().submit(task, *arguments)
            if self.renewals and self.under_way:
                self._work()  # suspects come one at a time
            return future

    found, failed = run(Pool(deadly={1}), abs, 9)
    assert sorted(found) == [0, 2, 3, 4, 5, 6, 7, 8]
    assert list(failed) == [1]


def test_workers_that_never_live_are_given_up():
    crew = Alone(deadly=set(range(50)))
    found, failed = run(crew, abs, 50)
    assert not found
    assert sorted(failed) == list(range(50))
    assert (crew.renewals, crew.submitted) == (6, 7)  # twice the attempts for one batch, and nothing afterwards


def test_deaths_count_in_a_row():
    """Four deadly batches, each tried three times: workers that answer in between live."""
    found, failed = run(Alone(deadly={1, 3, 5, 7}), abs, 9)
    assert sorted(found) == [0, 2, 4, 6, 8]
    assert sorted(failed) == [1, 3, 5, 7]


class Later(Frail):
    """Workers that begin when their answers are waited for, so that all that is under way dies together."""

    def __init__(self, monkeypatch, **deaths):
        super().__init__(**deaths)

        def answers(futures, **told):
            self._work()
            return wait(futures, **told)

        monkeypatch.setattr(running, "wait", answers)

    def submit(self, task, *arguments):
        self.submitted += 1
        self.under_way.append((Future(), task, arguments))
        return self.under_way[-1][0]


def test_suspects_are_computed_alone(monkeypatch):
    """One death of three together, then three of the guilty batch by itself: no innocent one dies with it."""
    crew = Later(monkeypatch, deadly={1})
    found, failed = run(crew, abs, 9)
    assert sorted(found) == [0, 2, 3, 4, 5, 6, 7, 8]
    assert (list(failed), crew.renewals) == ([1], 4)


def test_workers_that_never_live_are_given_up_among_suspects_too(monkeypatch):
    """Three batches together, then six by themselves: no suspect is tried after that."""
    crew = Later(monkeypatch, deadly=set(range(9)))
    found, failed = run(crew, abs, 9)
    assert (found, sorted(failed)) == ({}, list(range(9)))
    assert (crew.renewals, crew.submitted) == (6, 9)


def test_answers_that_come_one_by_one_are_all_waited_for(monkeypatch):
    """The last three come when nothing is left to be started."""

    class OneByOne(Later):
        def _work(self):
            later, self.under_way = self.under_way[1:], self.under_way[:1]
            super()._work()
            self.under_way = later

    found, failed = run(OneByOne(monkeypatch), abs, 5)
    assert (found, failed) == ({i: i for i in range(5)}, {})


def test_a_batch_that_broken_workers_refuse_is_not_waited_for(monkeypatch):
    """What was under way has no answer, now or ever: it is computed again."""

    class Refusing(Alone):
        width = 2

        def submit(self, task, *arguments):
            if self.renewals:
                return super().submit(task, *arguments)
            if self.under_way:
                raise BrokenExecutor
            self.under_way.append(None)
            return Future()

        def renew(self):
            super().renew()
            self.under_way, self.width = [], 1

    monkeypatch.setattr(
        running, "wait", lambda futures, timeout=60.0, **told: wait(futures, min(timeout, 5.0) / 50, **told)
    )
    found, failed = run(Refusing(), abs, 3)
    assert (found, failed) == ({0: 0, 1: 1, 2: 2}, {})


@pytest.mark.parametrize("error", [ValueError("no number"), CancelledError()])
def test_an_error_is_tried_again_and_reported(error):
    tried = []

    def task(i):
        tried.append(i)
        if i == 2:
            raise error
        return i

    found, failed = run(Alone(), task, 4)
    assert sorted(found) == [0, 1, 3]
    assert tried.count(2) == 3
    assert type(error).__name__ in failed[2]
