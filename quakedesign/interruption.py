"""Signals that end a command: one line, the exit code of the shell, no process and no temporary folder left."""

import atexit
import os
import select
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from threading import Thread, current_thread, main_thread
from time import monotonic
from types import FrameType
from typing import Any

from quakedesign.output import number_placed
from quakedesign.temporary import discard_all, sweep_system
from quakedesign.text import one_line

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
