"""What all commands share: the application, options, output and progress."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter
from rich.console import Console

from quakedesign.errors import OutputError

Json = Annotated[bool, Parameter(name="--json", negative="")]
Force = Annotated[bool, Parameter(negative="")]
# Negative decimals are values anyhow; with leading hyphens allowed, options after the gains would be gains too.
Gains = Annotated[tuple[str, ...], Parameter(consume_multiple=True)]

app = App(
    name="quakedesign",
    help="Design controllers that let a fault slip slowly instead of in an earthquake, and prove that they do.",
    version_flags=["--version"],
)


def _version() -> str:
    from importlib.metadata import version

    return version("quakedesign")


app.version = _version


def print_json(value: dict[str, Any]) -> None:
    """Print an answer as JSON on stdout."""
    print(json.dumps(value, indent=1, allow_nan=False))


def console() -> Console:
    """Console for people, on stdout."""
    return Console(highlight=False, soft_wrap=True)


def new_file(path: Path | None, what: str, *, force: bool) -> None:
    """Refuse an existing file before the work begins.

    Raises
    ------
    OutputError
        When it exists and force is not given.
    """
    if path is not None and path.exists() and not force:
        raise OutputError(f"{what} must be new. Received {path}, which exists. Give --force to replace it.")


@contextmanager
def progress() -> Iterator[Callable[[str, float], None]]:
    """Progress bar on stderr, which leaves stdout to the answer."""
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    columns = TextColumn("{task.description:44}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn()
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("starting", total=1.0)

        def tell(what: str, done: float) -> None:
            bar.update(task, description=what, completed=done)

        yield tell
