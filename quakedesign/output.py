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
        When the folder cannot be written.
    """
    data = content.encode() if isinstance(content, str) else content
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=f".{path.name}.", delete=False) as handle:
            handle.write(data)
        os.chmod(handle.name, 0o644)
        os.replace(handle.name, path)
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror}. Choose a folder that you may write.") from None
