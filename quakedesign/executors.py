"""Who computes many tasks: this process, others of this machine, a cluster, any executor of `concurrent.futures`."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Executor, Future
from dataclasses import dataclass
from types import TracebackType
from typing import Any

from quakedesign.errors import ParameterError, SimulationError
from quakedesign.workers import Crew, Processes, cores

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
    executor : Executor
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
                f"a scheduler must answer at {address!r}. {said}. Start one with 'dask scheduler', or leave it out."
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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
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
    executor : Executor, optional

    Raises
    ------
    ParameterError
        For a scheduler and an executor, or no number of workers.
    SimulationError
        When the scheduler cannot be reached.
    """
    if scheduler and executor:
        raise ParameterError("give a scheduler or an executor. Received both. Leave one out.")
    if executor is not None:
        return Given(executor, workers)
    return Cluster(scheduler) if scheduler else Processes(workers)


def crew_or_here(workers: int, scheduler: str | None = None, executor: Executor | None = None) -> Crew:
    """As `crew_of`, but for one worker this process."""
    return Here() if workers == 1 and not (scheduler or executor) else crew_of(workers, scheduler, executor)
