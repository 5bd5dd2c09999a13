"""``python -m quakedesign``, and the command ``quakedesign``."""

import gc
import os
import sys

from quakedesign.interruption import ending, leave

_OBJECTS = 100_000
"""How many are made between two searches for garbage: libraries make as many when they load, and none is garbage."""


def main() -> None:
    """Run the command line; an interruption is one line from the first import on."""
    gc.set_threshold(_OBJECTS, *gc.get_threshold()[1:])
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # matrices are small: threads of linear algebra only wait for another
    try:
        with ending(process=True):
            _run()
    except SystemExit as end:
        leave(end.code)
        raise


def _run() -> None:
    if sys.argv[1:] in ([], ["--help"], ["-h"]):
        from quakedesign.overview import print_overview

        if print_overview():
            sys.exit(0)
    from quakedesign.cli import main as run

    run()


if __name__ == "__main__":
    main()
