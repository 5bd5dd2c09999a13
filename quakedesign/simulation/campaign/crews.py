"""Who computes the batches besides processes on this machine: a cluster, or any executor of `concurrent.futures`."""

from collections.abc import Callable
from concurrent.futures import Executor, Future
from types import TracebackType
from typing import Any

from quakedesign.errors import SimulationError
from quakedesign.workers import Crew, cores

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
            "the executor must keep its workers. Received a broken one. Run the campaign again, with a new executor: "
            "it goes on from the files."
        )


class Cluster(Given):
    """A dask.distributed cluster, whose scheduler replaces dead workers by itself.

    Parameters
    ----------
    address : str
        Of the scheduler, such as ``tcp://host:8786``. Its workers need quakedesign, in the same version.

    Raises
    ------
    SimulationError
        When dask.distributed is not installed or the scheduler cannot be reached.
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
        super().__init__(self._client.get_executor(pure=False))

    @property
    def width(self) -> int:
        """Twice the number of threads that the cluster has now, so that none waits for the next batch."""
        return 2 * max(1, int(sum(self._client.nthreads().values())))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._executor.shutdown(wait=False)
        self._client.close()
