"""``python -m quakedesign``, and the command ``quakedesign``."""

import gc
import sys

from quakedesign.interruption import ending, leave

OBJECTS = 100_000
"""Made between two searches for cycles: nearly all that a command makes is kept, and is not looked through again."""


_OBJECTS = 100_000
"""How many are made between two searches for garbage: libraries make as many when they load, and none is garbage."""


def main() -> None:
    """Run the command line; an interruption is one line from the first import on."""
    gc.set_threshold(_OBJECTS, *gc.get_threshold()[1:])
    gc.set_threshold(OBJECTS)
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
