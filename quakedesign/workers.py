"""Processes that compute beside this one, and end when it does: at once, and however it ends."""

import ctypes
import os
import pickle
import signal
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import parent_process
from multiprocessing.context import SpawnContext, SpawnProcess
from threading import Thread
from types import TracebackType
from typing import Any, Self, cast

from quakedesign.errors import ParameterError, SimulationError
from quakedesign.interruption import SIGNALS, undisturbed

_LIVES = 3
_PR_SET_PDEATHSIG = 1


class Crew(ABC):
    """Workers behind an executor, which a context opens and closes."""

    @property
    @abstractmethod
    def width(self) -> int:
        """Number of tasks that are worth having under way at once."""

    @abstractmethod
    def submit(self, task: Callable[..., Any], *arguments: Any) -> "Future[Any]":
        """Start a task."""

    @abstractmethod
    def renew(self) -> None:
        """Replace workers that are dead.

        Raises
        ------
        SimulationError
            When that is not possible.
        """

    def shared(self, value: Any) -> Any:
        """Argument that stands for a value which many tasks take, so that it travels once where it has to travel."""
        return value

    def answers(self, task: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> Iterator[tuple[int, Any]]:
        """Answers to many arguments, each with their place in the sequence, in any order.

        Raises
        ------
        SimulationError
            When workers die again and again; those that were killed from outside are replaced.
        """
        waiting = dict(enumerate(arguments))
        for _ in range(_LIVES):
            try:
                futures = {self.submit(task, *given): place for place, given in waiting.items()}
                for future in as_completed(futures):
                    answer = future.result()
                    del waiting[futures[future]]
                    yield futures[future], answer
                return
            except BrokenExecutor:
                self.renew()
        raise SimulationError(
            f"workers must live until their tasks are done. They died {_LIVES} times, with {len(waiting)} tasks left. "
            "Ask for fewer workers, or make room in memory."
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return None


class Processes(Crew):
    """A pool of processes on this machine, each started afresh; it is filled again after a death.

    An error in the block, an interruption among them, ends the processes at once. So does the death of this process:
    a thread of theirs waits for it, and on Linux the kernel sees to it while they are in foreign code.

    Parameters
    ----------
    count : int or None
        One process per core that this process may use, unless given.
    begin : callable, optional
        Called in every process before its first task, with `arguments`.
    arguments : tuple

    Raises
    ------
    ParameterError
    """

    def __init__(
        self, count: int | None = None, begin: Callable[..., object] | None = None, arguments: tuple[Any, ...] = ()
    ) -> None:
        self._count = cores() if count is None else require_workers(count)
        self._begin = pickle.dumps((begin, arguments))  # whose modules take seconds to import
        self._context = _Roll()
        self._pool: Executor = self._filled()

    def _filled(self) -> Executor:
        return ProcessPoolExecutor(self._count, self._context, _enlist, (self._begin,))

    @property
    def width(self) -> int:
        """See `Crew.width`."""
        return self._count

    def submit(self, task: Callable[..., Any], *arguments: Any) -> "Future[Any]":
        """See `Crew.submit`."""
        with undisturbed():  # no process starts that is not known
            try:
                return self._pool.submit(task, *arguments)
            except (OSError, ValueError) as error:  # a death closed the pipes of the process that was to start
                raise BrokenProcessPool("a process of the pool died while another was started") from error

    def renew(self) -> None:
        """See `Crew.renew`."""
        self._end()
        self._pool = self._filled()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self._pool.shutdown(wait=True, cancel_futures=True)
        finally:
            self._end()

    def _end(self) -> None:
        self._context.kill()
        self._pool.shutdown(wait=True, cancel_futures=True)


class _Roll(SpawnContext):
    """Starts processes afresh, and knows them."""

    def __init__(self) -> None:
        self._started: list[SpawnProcess] = []

    def _known(self, *given: Any, **named: Any) -> SpawnProcess:
        self._started.append(SpawnProcess(*given, **named))
        return self._started[-1]

    Process = cast(Any, _known)

    def kill(self) -> None:
        for process in self._started:
            if process.is_alive():
                process.kill()
        self._started.clear()


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def require_workers(count: int) -> int:
    """Refuse a number of workers that is none.

    Raises
    ------
    ParameterError
    """
    if isinstance(count, bool) or not isinstance(count, int) or count < 1:
        raise ParameterError(f"workers must be a whole number of at least 1. Received {count!r}.")
    return count


def _enlist(packed: bytes) -> None:
    """Prepare a process of a pool: the parent handles Ctrl-C, and nobody survives it, even while modules load."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN if number == signal.SIGINT else signal.SIG_DFL)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    Thread(target=_follow_parent, daemon=True).start()
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    begin, arguments = pickle.loads(packed)
    if begin is not None:
        begin(*arguments)


def _follow_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
