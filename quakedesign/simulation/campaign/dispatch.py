"""Batches handed to workers until each has an answer or has failed a bounded number of times."""

from collections import Counter, deque
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from typing import Any

from quakedesign.workers import Crew

ATTEMPTS = 3
_MOST_DEATHS = 2 * ATTEMPTS  # in a row: then the workers themselves do not live
_DEATH = (
    "a worker died (out of memory, or killed; in a script, the call belongs under if __name__ == '__main__':), "
    "each time that this batch was computed"
)


def dispatch(
    task: Callable[..., Any],
    batches: Mapping[int, tuple[Any, ...]],
    crew: Crew,
    keep: Callable[[int, Any], None],
) -> dict[int, str]:
    """Reasons why batches failed, by their key; none for those whose answer was kept.

    A worker that dies takes the whole pool along, so that the guilty batch is not known: all that were under way are
    suspects, and are computed again one at a time. Only a batch that was alone is charged with a death.

    Parameters
    ----------
    task : callable
        Computes one batch from its arguments.
    batches : mapping of int to tuple
        Arguments, by key.
    crew : Crew
    keep : callable
        Called with key and answer, in any order.
    """
    return _Dispatch(task, batches, crew, keep).run()


class _Dispatch:
    def __init__(
        self, task: Callable[..., Any], batches: Mapping[int, tuple[Any, ...]], crew: Crew, keep: Callable[..., None]
    ) -> None:
        self._task, self._batches, self._crew, self._keep = task, batches, crew, keep
        self._waiting, self._suspects = deque(batches), deque[int]()
        self._running: dict[Future[Any], int] = {}
        self._charges = Counter[int]()
        self._failed: dict[int, str] = {}
        self._deaths = 0

    def run(self) -> dict[int, str]:
        while self._waiting or self._suspects or self._running:
            dead = self._fill()
            done = wait(self._running, return_when=FIRST_COMPLETED).done if self._running and not dead else ()
            for future in done:
                dead += self._collect(self._running.pop(future), future)
            if dead:
                self._bury([*dead, *self._left()])
        return self._failed

    def _fill(self) -> list[int]:
        """Start as many batches as are worth it; those that a broken executor refused."""
        while (self._suspects and not self._running) or (
            self._waiting and not self._suspects and len(self._running) < self._crew.width
        ):
            key = (self._suspects or self._waiting).popleft()
            try:
                self._running[self._crew.submit(self._task, *self._batches[key])] = key
            except BrokenExecutor:
                return [key]
        return []

    def _collect(self, key: int, future: "Future[Any]") -> list[int]:
        """Keep an answer, or charge the batch with its error; a batch whose worker died is returned."""
        try:
            answer = future.result()
        except BrokenExecutor:
            return [key]
        except (Exception, CancelledError) as error:
            self._charge(key, " ".join(f"{type(error).__name__}: {error}".split()), self._waiting)
            return []
        self._deaths = 0
        self._keep(key, answer)
        return []

    def _bury(self, dead: list[int]) -> None:
        """Renew the workers and decide who is suspected of the death."""
        self._running.clear()
        self._deaths += 1
        if self._deaths > _MOST_DEATHS:
            self._failed |= dict.fromkeys((*dead, *self._suspects, *self._waiting), _DEATH)
            self._suspects.clear()
            self._waiting.clear()
            return
        self._crew.renew()
        if len(dead) == 1:
            self._charge(dead[0], _DEATH, self._suspects)
        else:
            self._suspects.extend(dead)

    def _left(self) -> list[int]:
        """Batches under way that the broken workers leave without an answer."""
        done, pending = wait(self._running, timeout=1.0)
        lost = [key for future in done for key in self._collect(self._running[future], future)]
        return lost + [self._running[future] for future in pending]

    def _charge(self, key: int, reason: str, queue: "deque[int]") -> None:
        self._charges[key] += 1
        if self._charges[key] < ATTEMPTS:
            queue.append(key)
        else:
            self._failed[key] = reason
