"""Executors for independent tasks, worker processes, and handling of interrupts.

Chapters: background thread; signals that end a command (exit code as in a shell, temporary folders removed); worker
processes that end with their parent; the choice between this process, local workers and any executor of
`concurrent.futures`.
"""

import atexit
import ctypes
import os
import pickle
import select
import signal
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    as_completed,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from threading import Thread, current_thread, main_thread
from time import monotonic
from types import FrameType
from typing import Any, Self, TypeVar

from quakedesign.errors import ParameterError, SimulationError, require_whole
from quakedesign.files import discard_all, number_placed, sweep_system
from quakedesign.text import one_line

_Result = TypeVar("_Result")
_SWITCH = 2e-4  # switch interval of threads [s] while one runs in the background
_REPORT_INTERVAL = 0.2  # time between two reports of progress [s]


class Background:
    """Queue of runs in a second thread, parallel to the caller, since compiled code releases the interpreter lock."""

    def __init__(self, executor: Executor) -> None:
        self._executor = executor
        self._stopped = False
        self._done = 0.0

    def _report(self, done: float) -> None:
        """Store the progress of the run; raise in the second thread after `stop`, which ends the run."""
        if self._stopped:
            raise SimulationError("the run was stopped.")
        self._done = done

    def stop(self) -> None:
        """End the current run early."""
        self._stopped = True

    def submit(self, run: Callable[..., _Result], *given: object, **named: object) -> "Future[_Result]":
        """Queue a run: a callable that accepts the keyword ``progress``, a function of the completed fraction."""
        return self._executor.submit(run, *given, **named, progress=self._report)

    def result(self, run: "Future[_Result]", progress: Callable[[float], None]) -> _Result:
        """Wait for a run, reporting its progress."""
        while not run.done():
            progress(self._done)
            wait([run], timeout=_REPORT_INTERVAL)
        return run.result()


@contextmanager
def in_background() -> Iterator[Background]:
    """Queue for runs in parallel with the caller's work, in order of submission; all end with the block."""
    interval = sys.getswitchinterval()
    executor = ThreadPoolExecutor(1)
    background = Background(executor)
    sys.setswitchinterval(_SWITCH)
    try:
        yield background
    finally:
        background.stop()
        executor.shutdown(cancel_futures=True)
        sys.setswitchinterval(interval)


# ----------------------------------------------------------------------
# Signals that end a command: one line of output, exit code of the shell, no process or temporary folder left.

_NAMES = {"SIGINT": "interrupted", "SIGTERM": "terminated", "SIGHUP": "hung up"}
SIGNALS = {getattr(signal, name): said for name, said in _NAMES.items() if hasattr(signal, name)}
"""Message for each signal; SIGHUP does not exist on every platform."""
PATIENCE = 3.0  # longest wait [s] for a library that swallows the signal or does not return


class Interruption(KeyboardInterrupt):
    """Exception raised by a signal that ends the command.

    After a plain `KeyboardInterrupt` inside ``exec`` of a text, as in generated classes, Python ends itself with SIGINT
    and ignores a requested exit code; after a subclass it does not.
    """


class _Ending:
    """Handlers of the signals that end a command, and their state."""

    def __init__(self, last: bool) -> None:
        self._last = last
        self._number: int | None = None
        self._said = False
        self._held = self._waits = False
        self._before = number_placed()
        self.remedy: str | None = None
        self.reported = sys.unraisablehook

    def receive(self, number: int, _frame: FrameType | None) -> None:
        """Handle the first signal; ignore further ones."""
        if self._number is None:
            self._number, self._waits = number, self._held
            if not self._held:
                raise Interruption

    @contextmanager
    def held_back(self) -> Iterator[None]:
        """Delay the interruption by a signal to the end of the block; Python handles signals received by any thread."""
        self._held = True
        try:
            yield
        finally:
            self._held, waits, self._waits = False, self._waits, False
            if waits:
                raise Interruption

    def watch(self, reader: int) -> None:
        """End the process if it has not ended by itself within `PATIENCE` after a signal."""
        number, end = None, None
        while select.select([reader], [], [], None if end is None else max(0.0, end - monotonic()))[0]:
            if not (received := os.read(reader, 1)):
                os.close(reader)
                return
            if end is None and received[0] in SIGNALS:
                number, end = received[0], monotonic() + PATIENCE
        self._number = self._number or number
        os._exit(self._conclude())

    def not_raised(self, what: "sys.UnraisableHookArgs") -> None:
        """End the process where Python would only report the interruption and continue, as in a finaliser."""
        if isinstance(what.exc_value, Interruption):
            os._exit(self._conclude())
        self.reported(what)

    @contextmanager
    def concluded(self) -> Iterator[None]:
        """Treat every exception after a signal as an interruption: libraries convert `Interruption` to other types."""
        try:
            yield
        except BaseException as error:
            if self._number is None and not isinstance(error, KeyboardInterrupt):
                raise
            code = self._conclude()
            if self._last:
                leave(code, even_if_unwritable=True)
            raise SystemExit(code) from None

    def _conclude(self) -> int:
        """End all processes, remove temporary folders, report the interruption once, and return the exit code."""
        processes: Any = sys.modules.get("multiprocessing")
        for child in processes.active_children() if processes else ():
            child.kill()
        discard_all()
        number = self._number or signal.SIGINT
        if not self._said:
            self._said = True
            nothing = number_placed() == self._before
            files = "nothing was written" if nothing else "all files written so far are complete"
            _say(one_line(f"quakedesign: {SIGNALS[number]}; {self.remedy or files}."))
        return 128 + number


_ending: _Ending | None = None


def remedy(text: str) -> None:
    """Set the text printed at an interruption, in place of the statement of whether anything was written."""
    if _ending is not None:
        _ending.remedy = text


@contextmanager
def signals_delayed() -> Iterator[None]:
    """Delay signals until the block has ended; processes started in it inherit the signal mask."""
    blocks = hasattr(signal, "pthread_sigmask")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS) if blocks else ()
    try:
        with nullcontext() if _ending is None else _ending.held_back():
            yield
    finally:
        if blocks:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def ending(*, process: bool = False) -> Iterator[None]:
    """Turn the signals of `SIGNALS`, unless they are ignored, into one line and `SystemExit` with 128 + signal.

    They raise `Interruption` in the block, so that it can clean up. The command then ends in any case, at the latest
    after `PATIENCE`. An inner block leaves the signals to the outer one.

    Parameters
    ----------
    process : bool
        The process ends with the block: later signals are ignored. After a signal it ends at once, without the
        interpreter's shutdown, which takes seconds on a busy machine.
    """
    global _ending
    if _ending is not None:
        with _ending.concluded():
            yield
        return
    _ending = new = _Ending(process)
    sweep_system()
    try:
        with new.concluded(), _received(new, process), new.concluded():
            yield
    finally:
        _ending = None


@contextmanager
def _received(by: _Ending, last: bool) -> Iterator[None]:
    """Install the handlers; a second thread also sees signals while the main one runs foreign code."""
    if current_thread() is not main_thread():
        yield
        return
    handled = [number for number in SIGNALS if signal.getsignal(number) != signal.SIG_IGN]
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    Thread(target=by.watch, args=(reader,), daemon=True).start()
    woken = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    before = {number: signal.getsignal(number) for number in handled}
    sys.unraisablehook = by.not_raised
    try:
        for number in handled:
            signal.signal(number, by.receive)
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_IGN if last else handler)
        sys.unraisablehook = by.reported
        signal.set_wakeup_fd(woken)
        os.close(writer)


def leave(code: str | int | None, *, even_if_unwritable: bool = False) -> None:
    """End the process after the registered exit functions, without the interpreter's shutdown.

    Parameters
    ----------
    code : str or int or None
        As in `SystemExit`; with a text the process does not end here.
    even_if_unwritable : bool
        End the process even if stdout or stderr can no longer be written; otherwise return in this case.
    """
    if isinstance(code, str):
        return
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            if not even_if_unwritable:
                return
    os._exit(code or 0)


def _say(line: str) -> None:
    try:
        print(line, file=sys.stderr, flush=True)
    except (OSError, ValueError):  # the terminal is closed
        return


# ----------------------------------------------------------------------
# Worker processes, which end at once when this process ends, however it ends.

_MOST_ATTEMPTS = 3
_PR_SET_PDEATHSIG = 1


class Crew(ABC):
    """Workers behind an executor, which a context opens and closes."""

    @property
    @abstractmethod
    def width(self) -> int:
        """Number of tasks that should be submitted at a time."""

    @abstractmethod
    def submit(self, task: Callable[..., _Result], *arguments: object) -> "Future[_Result]":
        """Start a task."""

    @abstractmethod
    def renew(self) -> None:
        """Replace dead workers.

        Raises
        ------
        SimulationError
            When this is not possible.
        """

    def shared(self, value: Any) -> Any:
        """Reference to pass to tasks instead of a value that many tasks use; the value is sent to workers only once."""
        return value

    def results(
        self, task: Callable[..., _Result], arguments: Sequence[tuple[object, ...]]
    ) -> Iterator[tuple[int, _Result]]:
        """Results of a task for many arguments, each with the index of its arguments, in any order.

        Raises
        ------
        SimulationError
            When workers die repeatedly; workers killed from outside are replaced.
        """
        waiting = dict(enumerate(arguments))
        for _ in range(_MOST_ATTEMPTS):
            try:
                futures = {self.submit(task, *given): place for place, given in waiting.items()}
                for future in as_completed(futures):
                    result = future.result()
                    del waiting[futures[future]]
                    yield futures[future], result
                return
            except BrokenExecutor:
                self.renew()
        raise SimulationError(
            f"workers must live until their tasks are done. They died {_MOST_ATTEMPTS} times, with {len(waiting)} "
            "tasks left. Use fewer workers, or free memory."
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        return None


class Processes(Crew):
    """A pool of newly started processes on this machine, which is restored after a process has died.

    An error in the ``with`` block, including an interruption, ends the processes at once. So does the end of this
    process: a thread in each worker waits for it, and on Linux the kernel kills the workers even in compiled code.

    Parameters
    ----------
    count : int or None
        Number of processes; by default one per core that this process may use.
    begin : callable, optional
        Called in every process before its first task, with `arguments`.
    arguments : tuple
        Arguments of `begin`.

    Raises
    ------
    ParameterError
        If the count is not a positive whole number.
    """

    def __init__(
        self, count: int | None = None, begin: Callable[..., object] | None = None, arguments: tuple[object, ...] = ()
    ) -> None:
        self._count = cores() if count is None else require_workers(count)
        self._begin = pickle.dumps((begin, arguments))  # importing its modules takes seconds
        self._pool = self._filled()

    def _filled(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self._count, get_context("spawn"), _enlist, (self._begin,))

    @property
    def width(self) -> int:
        """See `Crew.width`."""
        return self._count

    def submit(self, task: Callable[..., _Result], *arguments: object) -> "Future[_Result]":
        """See `Crew.submit`."""
        with signals_delayed():  # so that every started process is registered
            try:
                return self._pool.submit(task, *arguments)
            except (OSError, ValueError) as error:  # the death of a process closed the pipes of the one being started
                raise BrokenProcessPool("a process of the pool died while another was started") from error

    def renew(self) -> None:
        """See `Crew.renew`."""
        self._end()
        self._pool = self._filled()

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None:
                self._pool.shutdown(wait=True, cancel_futures=True)
        finally:
            self._end()

    def _end(self) -> None:
        for process in list((self._pool._processes or {}).values()):
            process.kill()
        self._pool.shutdown(wait=True, cancel_futures=True)


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def require_workers(count: int) -> int:
    """Return a number of workers, or raise `ParameterError` if it is not a positive whole number."""
    require_whole(1, workers=count)
    return count


def _enlist(packed: bytes) -> None:
    """Prepare a worker: only the parent handles Ctrl-C; the worker ends when its parent ends, even during imports."""
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


# ----------------------------------------------------------------------
# Executors of many tasks: this process, other local processes, a cluster, any `concurrent.futures` executor.

_CONNECTION_TIMEOUT = "10s"


class SerialExecutor(Executor):
    """Runs every task immediately in the calling process."""

    def submit(self, task: Callable[..., _Result], /, *arguments: object, **named: object) -> "Future[_Result]":
        """Completed future."""
        future: Future[_Result] = Future()
        try:
            future.set_result(task(*arguments, **named))
        except Exception as error:
            future.set_exception(error)
        return future


class InProcess(Crew):
    """The calling process: one task after the other, each when its result is requested."""

    @property
    def width(self) -> int:
        """See `Crew.width`."""
        return 1

    def submit(self, task: Callable[..., _Result], *arguments: object) -> "Future[_Result]":
        """See `Crew.submit`."""
        return SerialExecutor().submit(task, *arguments)

    def renew(self) -> None:
        """See `Crew.renew`: no worker dies."""

    def results(
        self, task: Callable[..., _Result], arguments: Sequence[tuple[object, ...]]
    ) -> Iterator[tuple[int, _Result]]:
        """See `Crew.results`."""
        return ((place, task(*given)) for place, given in enumerate(arguments))


class UserExecutor(Crew):
    """A user-defined executor, which the user opens and closes.

    Parameters
    ----------
    executor : Executor
        Executor of the tasks.
    width : int or None
        Number of simultaneous tasks; by default one per core.
    """

    def __init__(self, executor: Executor, width: int | None = None) -> None:
        self._executor = executor
        self._width = width or cores()

    @property
    def width(self) -> int:
        """See `Crew.width`."""
        return self._width

    def submit(self, task: Callable[..., _Result], *arguments: object) -> "Future[_Result]":
        """See `Crew.submit`."""
        return self._executor.submit(task, *arguments)

    def renew(self) -> None:
        """See `Crew.renew`."""
        raise SimulationError(
            "the executor must have live workers. Received a broken one. Run again with a new executor: a campaign "
            "continues from its files."
        )


@dataclass
class _Sent:
    """A value, and the dask.distributed future that represents it on the workers."""

    value: Any
    place: Any


class Cluster(UserExecutor):
    """A dask.distributed cluster, whose scheduler replaces dead workers by itself.

    Parameters
    ----------
    address : str
        Address of the scheduler, such as ``tcp://host:8786``. Its workers need the same version of quakedesign.

    Raises
    ------
    SimulationError
        When dask.distributed is not installed, or the scheduler cannot be reached or has no workers.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise SimulationError(
                f"a scheduler needs dask.distributed. Received {address!r}, and it is not installed. "
                "Install it with pip install 'dask[distributed]', or omit scheduler."
            ) from None
        try:
            self._client = Client(address, timeout=_CONNECTION_TIMEOUT, set_as_default=False)
        except (OSError, ValueError) as error:
            said = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise SimulationError(
                f"scheduler must be the address of a running scheduler. Received {address!r}: {said}. Start one with "
                "'dask scheduler', or omit scheduler."
            ) from None
        try:
            self._client.wait_for_workers(1, timeout=_CONNECTION_TIMEOUT)
        except TimeoutError:
            self._client.close()
            raise SimulationError(
                f"a scheduler must have workers. Received {address!r}, which has none. Start one with 'dask worker "
                f"{address}', or omit scheduler."
            ) from None
        super().__init__(self._client.get_executor(pure=False))

    def shared(self, value: Any) -> Any:
        """See `Crew.shared`: the workers distribute the value among themselves."""
        return _Sent(value, self._client.scatter(value, broadcast=True, hash=False))

    def submit(self, task: Callable[..., _Result], *arguments: object) -> "Future[_Result]":
        """See `Crew.submit`."""
        return super().submit(task, *(self._there(given) if isinstance(given, _Sent) else given for given in arguments))

    def _there(self, sent: "_Sent") -> Any:
        """Future of a value, sent again if no worker has it any more."""
        if sent.place.status not in ("finished", "pending"):
            sent.place = self._client.scatter(sent.value, broadcast=True, hash=False)
        return sent.place

    @property
    def width(self) -> int:
        """Twice the current number of threads of the cluster, so that none waits for the next batch."""
        return 2 * max(1, int(sum(self._client.nthreads().values())))

    def results(
        self, task: Callable[..., _Result], arguments: Sequence[tuple[object, ...]]
    ) -> Iterator[tuple[int, _Result]]:
        """See `Crew.results`."""
        from distributed import KilledWorker

        try:
            yield from super().results(task, arguments)
        except (KilledWorker, CancelledError) as error:
            said = " ".join(str(error).split()) or type(error).__name__
            raise SimulationError(
                f"workers of the cluster must live until their tasks are done. Received: {said.rstrip('.')}. Give "
                "them more memory, or omit scheduler to use local processes."
            ) from None

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._executor.shutdown(wait=False)
        self._client.close()


def crew_of(workers: int | None, scheduler: str | None = None, executor: Executor | None = None) -> Crew:
    """Crew on a scheduler or an executor if one is given, else a pool of local processes.

    Parameters
    ----------
    workers : int or None
        Number of processes, or of simultaneous tasks of an executor; one per core if None.
    scheduler : str, optional
        Address of a dask.distributed scheduler.
    executor : Executor, optional
        User-defined executor, which the caller opens and closes.

    Raises
    ------
    ParameterError
        For both a scheduler and an executor, or an invalid number of workers.
    SimulationError
        When dask.distributed is not installed, or the scheduler cannot be reached or has no workers.
    """
    if scheduler and executor:
        raise ParameterError("give a scheduler or an executor. Received both. Omit one of them.")
    if executor is not None:
        return UserExecutor(executor, workers)
    return Cluster(scheduler) if scheduler else Processes(workers)


def crew_or_here(workers: int, scheduler: str | None = None, executor: Executor | None = None) -> Crew:
    """As `crew_of`, but with one worker the tasks run in this process."""
    return InProcess() if workers == 1 and not (scheduler or executor) else crew_of(workers, scheduler, executor)
