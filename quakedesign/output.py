"""Files and folders are written whole or not at all."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from quakedesign.errors import OutputError

_LONGEST_NAME = 200  # of the 255 bytes of most systems; the rest is for temporary neighbours and for what goes beside


def require_room(path: Path) -> None:
    """Refuse a place that cannot be written, before the work begins.

    Raises
    ------
    OutputError
    """
    parent, length = path.absolute().parent, len(path.name.encode(errors="surrogatepass"))
    if length > _LONGEST_NAME:
        raise OutputError(
            f"{path} must have a name of at most {_LONGEST_NAME} bytes. Received {length}. Choose a shorter one."
        )
    try:
        with tempfile.NamedTemporaryFile(dir=parent, prefix=f".{path.name}."):
            pass
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise OutputError(
            f"{path} must be in a folder that can be written. Received {parent}: {reason}. Choose another."
        ) from None


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


@contextmanager
def whole_folder(target: Path) -> Iterator[Path]:
    """Folder to fill that takes its place, and that of an earlier one, when the block ends without an error.

    Raises
    ------
    OutputError
        When it cannot be written; nothing is left behind then, and an earlier folder stays.
    """
    try:
        partial = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.absolute().parent))
        try:
            yield partial
            partial.chmod(0o755)
            _swap(partial, target)
        finally:
            shutil.rmtree(partial, ignore_errors=True)
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"{target} cannot be written: {error.strerror}. Choose another folder.") from None


def _swap(partial: Path, target: Path) -> None:
    if not target.exists():
        partial.rename(target)
        return
    old = Path(tempfile.mkdtemp(prefix=f".{target.name}-old-", dir=target.absolute().parent))
    os.replace(target, old / target.name)
    os.replace(partial, target)
    shutil.rmtree(old, ignore_errors=True)
