"""``python -m quakedesign``, and the command ``quakedesign``."""

import gc
import os

from quakedesign.parallel import ending, leave
from quakedesign.streams import has_memory, lack_memory, lacks_memory, open_all, widen

_OBJECTS = 100_000
"""Allocations between garbage collections: loading the libraries makes about as many objects, none of them garbage."""


def main() -> None:
    """Run the command line; an interruption prints one line, even during the first imports."""
    gc.set_threshold(_OBJECTS, *gc.get_threshold()[1:])
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # for small matrices, linear-algebra threads only wait for each other
    open_all()
    widen()
    try:
        with ending(process=True):
            try:
                _run()
            except Exception as error:
                if not lacks_memory(error):
                    raise
                lack_memory()
    except SystemExit as end:
        leave(end.code)
        raise


def _run() -> None:
    if not has_memory():
        lack_memory()
    from quakedesign.cli import main as run

    run()


if __name__ == "__main__":
    main()
