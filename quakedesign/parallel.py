"""Executors for independent tasks, worker processes, and handling of interrupts.

Chapters: signals that end a command (exit code of the shell, temporary folders removed); worker processes
that end with their parent; the choice between this process, local workers and any executor of
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
_SWITCH = 2e-4  # seconds after which threads take turns while one runs in the background
_PATIENT = 0.2  # seconds between two reports of progress


class Background:
    """One thread beside the caller's, for runs: compiled steps and the C compiler need no interpreter lock."""

    def __init__(self, executor: Executor) -> None:
        self._executor = executor
        self._stopped = False
        self._done = 0.0

    def _report(self, done: float) -> None:
        """Progress of the thread, which ends here when the caller does not wait any longer."""
        if self._stopped:
            raise SimulationError("the run was stopped.")
        self._done = done

    def stop(self) -> None:
        """End the present run early."""
        self._stopped = True

    def submit(self, run: Callable[..., _Result], *given: Any, **named: Any) -> "Future[_Result]":
        """Begin a run, after those before it; it takes ``progress``."""
        return self._executor.submit(run, *given, **named, progress=self._report)

    def result(self, run: "Future[_Result]", tell: Callable[[float], None]) -> _Result:
        """Wait for a run, with its progress."""
        while not run.done():
            tell(self._done)
            wait([run], timeout=_PATIENT)
        return run.result()


@contextmanager
def in_background() -> Iterator[Background]:
    """Runs beside the caller's work, in the order in which they are submitted; all are ended when the block ends."""
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
# Signals that end a command: one line, the exit code of the shell, no process and no temporary folder left.

_NAMES = {"SIGINT": "interrupted", "SIGTERM": "terminated", "SIGHUP": "hung up"}
SIGNALS = {getattr(signal, name): said for name, said in _NAMES.items() if hasattr(signal, name)}
"""What is said of each; SIGHUP is not everywhere."""
PATIENCE = 3.0  # seconds: what a library has swallowed, or does not return from, is not waited for any longer


class Interruption(KeyboardInterrupt):
    """A signal asks for the end.

    After a plain `KeyboardInterrupt` that has gone through ``exec`` of a text, as in generated classes, Python dies of
    SIGINT when it ends, whatever the exit code.
    """


class _Ending:
    """What is known of the end of a command."""

    def __init__(self, last: bool) -> None:
        self._last = last
        self._number: int | None = None
        self._said = False
        self._held = self._waits = False
        self._before = number_placed()
        self.remedy: str | None = None
        self.reported = sys.unraisablehook

    def receive(self, number: int, _frame: FrameType | None) -> None:
        """Handle the first signal; further ones do not disturb the end."""
        if self._number is None:
            self._number, self._waits = number, self._held
            if not self._held:
                raise Interruption

    @contextmanager
    def held_back(self) -> Iterator[None]:
        """Raise what arrives in the block at its end; Python handles signals that any of its threads has received."""
        self._held = True
        try:
            yield
        finally:
            self._held, waits, self._waits = False, self._waits, False
            if waits:
                raise Interruption

    def watch(self, reader: int) -> None:
        """End the process where it has not ended by itself some time after a signal."""
        number, end = None, None
        while select.select([reader], [], [], None if end is None else max(0.0, end - monotonic()))[0]:
            if not (received := os.read(reader, 1)):
                os.close(reader)
                return
            if end is None and received[0] in SIGNALS:
                number, end = received[0], monotonic() + PATIENCE
        self._number = self._number or number
        os._exit(self._conclude())

    def not_raised(self, what: Any) -> None:
        """End the process where Python can only report the interruption, as in a finaliser, and would go on."""
        if isinstance(what.exc_value, Interruption):
            os._exit(self._conclude())
        self.reported(what)

    @contextmanager
    def concluded(self) -> Iterator[None]:
        """Whatever arrives here after a signal is its doing: libraries make other exceptions of it."""
        try:
            yield
        except BaseException as error:
            if self._number is None and not isinstance(error, KeyboardInterrupt):
                raise
            code = self._conclude()
            if self._last:
                leave(code, whatever=True)
            raise SystemExit(code) from None

    def _conclude(self) -> int:
        """Leave no process and no temporary folder behind, say so once, and return the exit code."""
        processes: Any = sys.modules.get("multiprocessing")
        for child in processes.active_children() if processes else ():
            child.kill()
        discard_all()
        number = self._number or signal.SIGINT
        if not self._said:
            self._said = True
            kept = "nothing was written" if number_placed() == self._before else "what was written is whole"
            _say(one_line(f"quakedesign: {SIGNALS[number]}; {self.remedy or kept}."))
        return 128 + number


_ending: _Ending | None = None


def remedy(text: str) -> None:
    """Say this, instead of whether anything was written, if the command is interrupted from now on."""
    if _ending is not None:
        _ending.remedy = text


@contextmanager
def undisturbed() -> Iterator[None]:
    """Signals wait until the block has ended; the processes that it starts inherit that."""
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

    They raise `Interruption` in the block, so that it can put things in order. Whatever becomes of that, the
    command ends as was asked; what has not ended within `PATIENCE` is ended. A block in another one leaves them to it.

    Parameters
    ----------
    process : bool
        The process ends with the block: what comes later is too late to interrupt it, and is ignored. After a signal
        it ends at once, without taking apart all that it has loaded, which takes seconds on a busy machine.
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
    """Signals are received, and a thread sees them too while the main one is busy with foreign code."""
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


def leave(code: str | int | None, *, whatever: bool = False) -> None:
    """End the process once what is registered for its end is done, without taking apart all that it has loaded.

    Parameters
    ----------
    code : str or int or None
        As `SystemExit` has it; with a text the process does not end here.
    whatever : bool
        Also where nobody reads what has been said; unless given, the process does not end here then.
    """
    if isinstance(code, str):
        return
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            if not whatever:
                return
    os._exit(code or 0)


def _say(line: str) -> None:
    try:
        print(line, file=sys.stderr, flush=True)
    except (OSError, ValueError):  # the terminal is gone
        return


# ----------------------------------------------------------------------
# Processes that compute beside this one, and end when it does: at once, and however it ends.

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

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
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
    """

    def __init__(
        self, count: int | None = None, begin: Callable[..., object] | None = None, arguments: tuple[Any, ...] = ()
    ) -> None:
        self._count = cores() if count is None else require_workers(count)
        self._begin = pickle.dumps((begin, arguments))  # whose modules take seconds to import
        self._pool = self._filled()

    def _filled(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self._count, get_context("spawn"), _enlist, (self._begin,))

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
    """Refuse a number of workers that is none."""
    require_whole(1, workers=count)
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


# ----------------------------------------------------------------------
# Who computes many tasks: this process, others of this machine, a cluster, any executor of `concurrent.futures`.

_PATIENCE = "10s"


class SerialExecutor(Executor):
    """Runs everything at once in the calling process."""

    def submit(self, task: Callable[..., Any], /, *arguments: Any, **named: Any) -> "Future[Any]":
        """Future that is done already."""
        future: Future[Any] = Future()
        try:
            future.set_result(task(*arguments, **named))
        except Exception as error:
            future.set_exception(error)
        return future


class Here(Crew):
    """The process that asks: one task after the other, each when its answer is wanted."""

    @property
    def width(self) -> int:
        """See `Crew.width`."""
        return 1

    def submit(self, task: Callable[..., Any], *arguments: Any) -> "Future[Any]":
        """See `Crew.submit`."""
        return SerialExecutor().submit(task, *arguments)

    def renew(self) -> None:
        """See `Crew.renew`: nobody dies."""

    def answers(self, task: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> Iterator[tuple[int, Any]]:
        """See `Crew.answers`."""
        return ((place, task(*given)) for place, given in enumerate(arguments))


class Given(Crew):
    """An executor of the user's, who opens and closes it.

    Parameters
    ----------
    width : int or None
        One batch per core, unless given.
    """

    def __init__(self, executor: Executor, width: int | None = None) -> None:
        self._executor = executor
        self._width = width or cores()

    @property
    def width(self) -> int:
        """See `Crew.width`."""
        return self._width

    def submit(self, task: Callable[..., Any], *arguments: Any) -> "Future[Any]":
        """See `Crew.submit`."""
        return self._executor.submit(task, *arguments)

    def renew(self) -> None:
        """See `Crew.renew`."""
        raise SimulationError(
            "the executor must keep its workers. Received a broken one. Ask again with a new executor: a campaign goes "
            "on from its files."
        )


@dataclass
class _Sent:
    """A value, and the future of dask.distributed that stands for it on the workers."""

    value: Any
    place: Any


class Cluster(Given):
    """A dask.distributed cluster, whose scheduler replaces dead workers by itself.

    Parameters
    ----------
    address : str
        Of the scheduler, such as ``tcp://host:8786``. Its workers need quakedesign, in the same version.

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
                "Install it with pip install 'dask[distributed]', or leave the scheduler out."
            ) from None
        try:
            self._client = Client(address, timeout=_PATIENCE, set_as_default=False)
        except (OSError, ValueError) as error:
            said = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise SimulationError(
                f"a scheduler must answer at {address!r}. {said}. Start one with 'dask scheduler', or omit scheduler."
            ) from None
        try:
            self._client.wait_for_workers(1, timeout=_PATIENCE)
        except TimeoutError:
            self._client.close()
            raise SimulationError(
                f"a scheduler must have workers. The one at {address!r} has none. Start one with 'dask worker "
                f"{address}', or leave the scheduler out."
            ) from None
        super().__init__(self._client.get_executor(pure=False))

    def shared(self, value: Any) -> Any:
        """See `Crew.shared`: the workers hand it on among themselves."""
        return _Sent(value, self._client.scatter(value, broadcast=True, hash=False))

    def submit(self, task: Callable[..., Any], *arguments: Any) -> "Future[Any]":
        """See `Crew.submit`."""
        return super().submit(task, *(self._there(given) if isinstance(given, _Sent) else given for given in arguments))

    def _there(self, sent: "_Sent") -> Any:
        """What stands for a value, sent again if all workers that had it are gone."""
        if sent.place.status not in ("finished", "pending"):
            sent.place = self._client.scatter(sent.value, broadcast=True, hash=False)
        return sent.place

    @property
    def width(self) -> int:
        """Twice the number of threads that the cluster has now, so that none waits for the next batch."""
        return 2 * max(1, int(sum(self._client.nthreads().values())))

    def answers(self, task: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> Iterator[tuple[int, Any]]:
        """See `Crew.answers`."""
        from distributed import KilledWorker

        try:
            yield from super().answers(task, arguments)
        except (KilledWorker, CancelledError) as error:
            said = " ".join(str(error).split()) or type(error).__name__
            raise SimulationError(
                f"workers of the cluster must live until their tasks are done. {said} Give them more memory, or ask "
                "for processes of this machine."
            ) from None

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._executor.shutdown(wait=False)
        self._client.close()


def crew_of(workers: int | None, scheduler: str | None = None, executor: Executor | None = None) -> Crew:
    """Processes, unless a scheduler or an executor is given.

    Parameters
    ----------
    workers : int or None
        Number of processes, or of tasks that an executor is given at once; one per core where it is None.
    scheduler : str, optional
        Address of one of dask.distributed.

    Raises
    ------
    ParameterError
        For a scheduler and an executor, or no number of workers.
    SimulationError
        When the scheduler cannot be reached.
    """
    if scheduler and executor:
        raise ParameterError("give a scheduler or an executor. Received both. Omit one of them.")
    if executor is not None:
        return Given(executor, workers)
    return Cluster(scheduler) if scheduler else Processes(workers)


def crew_or_here(workers: int, scheduler: str | None = None, executor: Executor | None = None) -> Crew:
    """As `crew_of`, but for one worker this process."""
    return Here() if workers == 1 and not (scheduler or executor) else crew_of(workers, scheduler, executor)
