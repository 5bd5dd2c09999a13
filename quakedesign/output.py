"""Files are written whole or not at all."""

import os
import tempfile
from pathlib import Path

from quakedesign.errors import OutputError


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file through a temporary neighbour, so that no reader ever sees half of it.

    Raises
    ------
    OutputError
        When the file cannot be written; nothing is left behind then.
    """
    data = content.encode() if isinstance(content, str) else content
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.name}.", delete=False) as handle:
            try:
                handle.write(data)
                handle.close()
                os.chmod(handle.name, 0o644)
                os.replace(handle.name, path)
            except BaseException:
                os.unlink(handle.name)
                raise
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror}. Choose a folder that you may write.") from None
