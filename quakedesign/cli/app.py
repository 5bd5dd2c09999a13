"""Application, output and progress bar of all commands."""

import json
import logging
import os
import shlex
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from itertools import combinations
from pathlib import Path
from textwrap import wrap
from typing import Any

from cyclopts import App, Parameter
from rich.console import Console
from rich.text import Text

from quakedesign.discovery import allow_code
from quakedesign.errors import OutputError, ParameterError
from quakedesign.files import Json, require_writable
from quakedesign.text import Progress, in_lines, visible

_quiet: ContextVar[bool] = ContextVar("quiet", default=False)
_log = logging.getLogger("quakedesign")
_typed: ContextVar[tuple[str, ...]] = ContextVar("typed", default=())


def store_command(arguments: Sequence[str]) -> None:
    """Store the typed command for `command_line`; enable output until `set_output`; forbid running code from files."""
    _typed.set(tuple(arguments))
    allow_code(False)
    set_output(quiet=False, level="warning")


def set_output(*, quiet: bool, level: str) -> None:
    """Switch off text output if `quiet`, and log messages of a level and above on stderr."""
    _quiet.set(quiet)
    for handler in _log.handlers[:]:
        _log.removeHandler(handler)
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    _log.addHandler(handler)
    _log.propagate = False
    _log.setLevel(level.upper())


def command_line() -> str:
    """Command line as typed; empty outside a command."""
    return shlex.join(("quakedesign", *_typed.get())) if _typed.get() else ""


app = App(
    name="quakedesign",
    help="Design controllers that let a fault slip slowly instead of in an earthquake, and prove that they do.",
    version_flags=["--version"],
    suppress_keyboard_interrupt=False,
    default_parameter=Parameter(negative=""),  # no --no-… and --empty-… options
)


def _version() -> str:
    from importlib.metadata import version

    return version("quakedesign")


app.version = _version


def specified(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options whose value is not None."""
    return {name: value for name, value in options.items() if value is not None}


def reject(options: Mapping[str, Any], what: str) -> None:
    """Raise ParameterError if any of the options, which cannot be used with `what`, is given."""
    if names := list(specified(options)):
        raise ParameterError(f"{', '.join(names)} cannot be used with {what}. Omit {', '.join(names)}.")


def print_json(value: Json) -> None:
    """Print a result as JSON on stdout."""
    print(json.dumps(value, indent=1, allow_nan=False))


def print_lines(lines: Iterable[str]) -> None:
    """Print a result as text on stdout."""
    screen = console()
    for line in lines:
        screen.print(line)


class _Screen(Console):
    """Console that prints strings as plain text: no markup, no emoji, no control characters, long lines broken."""

    def print(self, *objects: Any, **options: Any) -> None:
        """Print strings, on a terminal wrapped with a hanging indent, elsewhere broken only beyond 200 characters."""
        if self.is_terminal:
            objects = tuple(self._wrapped(text) if isinstance(text, str) else text for text in objects)
        super().print(*objects, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        return super().render_str(f"\n{_hanging(text)}".join(in_lines(visible(text))), **options)

    def _wrapped(self, text: str) -> Text:
        below = _hanging(text)
        lines = wrap(visible(text), self.width, subsequent_indent=below, break_long_words=False, break_on_hyphens=False)
        return Text("\n".join(lines))


def _hanging(text: str) -> str:
    """Hanging indent of a wrapped line."""
    return " " * (len(text) - len(text.lstrip(" ")) + 2)


def console(**options: Any) -> Console:
    """Console for text, on stdout by default; a string is printed as one line, a long string as several."""
    return _Screen(quiet=_quiet.get(), markup=False, emoji=False, highlight=False, soft_wrap=True, **options)


def new_file(path: Path | None, what: str, *, force: bool) -> None:
    """Reject an existing file before the work begins.

    Raises
    ------
    OutputError
        When the file exists without `force`, or cannot be written.
    """
    if path is None:
        return
    if os.path.isdir(path):
        raise OutputError(f"{what} must be a file. Received {path}, which is a folder. Choose another path.")
    if os.path.exists(path) and not force:
        raise OutputError(f"{what} must be new. Received {path}, which exists. Give --force to replace it.")
    require_writable(path)


def require_different(places: Mapping[str, Path | None]) -> None:
    """Raise OutputError if two options name one file, so that no input file is overwritten."""
    named = {name: os.path.realpath(path) for name, path in places.items() if path is not None}
    for one, other in combinations(named, 2):
        if named[one] == named[other]:
            raise OutputError(
                f"{one} and {other} must be different files. Received {places[one]} for both. Choose another."
            )


@contextmanager
def progress() -> Iterator[Progress]:
    """Progress bar on stderr; stdout is for the result only."""
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Display

    columns = TextColumn("{task.description:44}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn()
    console = Console(stderr=True)
    shown = console.is_terminal and not _quiet.get()
    with Display(*columns, console=console, transient=True, disable=not shown) as bar:
        task, last = bar.add_task("starting", total=1.0), ""

        def report(what: str, done: float) -> None:
            nonlocal last
            bar.update(task, description=what, completed=done)
            _log.log(logging.DEBUG if what == last else logging.INFO, "%s (%.0f %%)", visible(what), 100 * done)
            last = what

        yield report
