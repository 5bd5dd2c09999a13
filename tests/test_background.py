"""Runs in the background: one thread beside the caller's, in the order of their submission."""

from threading import Event, current_thread

import pytest

from quakedesign.errors import SimulationError
from quakedesign.parallel import in_background


def test_runs_follow_one_another_beside_the_caller_and_report_their_progress():
    begun, told, seen = Event(), [], []

    def run(number, *, progress):
        seen.append((number, current_thread()))
        progress(0.25)
        if number == 1:
            assert begun.wait(10)  # set by the caller while this run goes on
        return number

    with in_background() as runs:
        first, second = runs.submit(run, 1), runs.submit(run, 2)
        assert not first.done()

        def progress(done):
            told.append(done)
            if done:
                begun.set()

        assert [runs.result(first, progress), runs.result(second, progress)] == [1, 2]
    (one, thread), (other, same) = seen
    assert (one, other) == (1, 2)
    assert thread is same is not current_thread()
    assert told[-1] == 0.25


def test_an_error_of_a_run_is_raised_where_its_result_is_taken():
    def fails(*, progress):
        raise SimulationError("the step failed.")

    with in_background() as runs:
        run = runs.submit(fails)
        with pytest.raises(SimulationError, match="the step failed"):
            runs.result(run, lambda done: None)


def test_leaving_early_ends_the_present_run_and_begins_no_other():
    begun, ended = Event(), []

    def endless(*, progress):
        begun.set()
        try:
            while True:
                progress(0.5)
        finally:
            ended.append("endless")

    def never(*, progress):
        ended.append("never")

    def leave_early():
        with in_background() as runs:
            runs.submit(endless)
            runs.submit(never)
            assert begun.wait(10)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        leave_early()
    assert ended == ["endless"]
