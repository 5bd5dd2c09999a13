"""The command line. Every command returns its exit code; heavy libraries load inside the commands."""

import errno
import io
import os
import sys
import warnings

from cyclopts import CoercionError, CycloptsError, MissingArgumentError

from quakedesign.cli import (
    block_commands,
    design_commands,
    fault_commands,
    gain_commands,
    guarantee_commands,
    proof_commands,
    simulate_commands,
)
from quakedesign.cli.app import app, store_command
from quakedesign.discovery import user_code
from quakedesign.errors import QuakedesignError
from quakedesign.files import release
from quakedesign.parallel import ending
from quakedesign.streams import lack_memory, lacks_memory
from quakedesign.text import one_line

__all__ = [
    "app",
    "block_commands",
    "design_commands",
    "fault_commands",
    "gain_commands",
    "guarantee_commands",
    "main",
    "proof_commands",
    "simulate_commands",
]


_UNWRITABLE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM)
"""Error numbers of output that cannot be written; any other `OSError`, except on stdout, is an internal error."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its code; an input error prints one line on stderr and exits with code 2."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    if arguments is None and not sys.warnoptions:
        # Hide warnings of libraries, also in workers; ``python -W default -m quakedesign`` shows them.
        warnings.simplefilter("ignore")
        os.environ.setdefault("PYTHONWARNINGS", "ignore")
    try:
        store_command(sys.argv[1:] if arguments is None else arguments)
        with ending(), user_code():
            code = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        sys.exit(code if isinstance(code, int) else 0)
    except QuakedesignError as error:
        _reject(str(error))
    except CycloptsError as error:
        _reject(_with_help(error))
    except BrokenPipeError:
        sys.stderr.close()
        sys.exit(1)
    except Exception as error:
        if lacks_memory(error):
            lack_memory()
        if "QUAKEDESIGN_TRACEBACK" in os.environ:
            raise
        if isinstance(error, OSError) and (error.errno in _UNWRITABLE or error.filename == "stdout"):
            where = error.filename or "the output"
            _reject(f"{where} cannot be written: {error.strerror}. Choose another folder, or free disk space.")
        defect = one_line(f"{type(error).__name__}: {error}")
        print(f"quakedesign: internal error: {defect}. Set QUAKEDESIGN_TRACEBACK=1 for the traceback.", file=sys.stderr)
        sys.exit(3)
    finally:
        release()


def _with_help(error: CycloptsError) -> str:
    """Message of an error of the command line, with a pointer to --help unless the value of an option is wrong."""
    if isinstance(error, CoercionError):
        return str(error)
    hyphen = " If a value begins with -, write --option=value." if isinstance(error, MissingArgumentError) else ""
    return f"{error}{hyphen} See {' '.join(('quakedesign', *(error.command_chain or ())))} --help."


def _reject(reason: str) -> None:
    print(f"quakedesign: {one_line(reason)}", file=sys.stderr)
    sys.exit(2)
