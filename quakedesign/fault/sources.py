"""Where descriptions of faults come from: presets, and files of the user."""

from pathlib import Path

from quakedesign.errors import ScenarioError, UnknownNameError
from quakedesign.input import read_text
from quakedesign.text import nearest_name

LARGEST_FILE = 1 << 16
"""Bytes; reading a key of many dots takes the square of its length."""
_PRESETS = Path(__file__).parent / "presets"


def presets() -> list[str]:
    """Names of the faults that come with the package."""
    return sorted(path.stem for path in _PRESETS.glob("*.toml"))


def require_source(source: str) -> str:
    """Name of a preset or of a file.

    Raises
    ------
    UnknownNameError
    """
    if source not in presets() and Path(source).suffix != ".toml":
        raise UnknownNameError(
            f"fault must be a preset ({', '.join(presets())}) or the path of a .toml file. Received {source!r}."
            + nearest_name(source, presets())
        )
    return source


def source_text(source: str | Path) -> str:
    """Text of a preset or file.

    Raises
    ------
    UnknownNameError, ScenarioError
    """
    if require_source(str(source)) in presets():
        return (_PRESETS / f"{source}.toml").read_text(encoding="utf-8")
    return read_text(source, "fault file", largest=LARGEST_FILE, refusal=ScenarioError)
