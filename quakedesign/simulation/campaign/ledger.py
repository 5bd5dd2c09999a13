"""Folder of a campaign: its settings, and one file for each finished batch."""

import hashlib
import json
import math
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from quakedesign.errors import OutputError, SimulationError
from quakedesign.files import FAMILY, sweep, write_whole

MANIFEST, BATCHES = "campaign.json", "batches"
_RESULTS = ("results.json", "samples.csv", "distribution.*", "sample-*.nc")
_NAMED = 5  # entries listed in a message


def plain(value: Any) -> Any:
    """Value in JSON types, dataclasses with the name of their type; other types as text."""
    if is_dataclass(value) and not isinstance(value, type):
        named = {field.name: plain(getattr(value, field.name)) for field in fields(value) if field.compare}
        return {"type": type(value).__name__} | named
    match value:
        case Mapping():
            return {str(key): plain(entry) for key, entry in value.items()}
        case list() | tuple():
            return [plain(entry) for entry in value]
        case float():
            return value if math.isfinite(value) else str(value)
        case None | bool() | int() | str():
            return value
    return _text(value)


def _text(value: Any) -> str:
    """Text of a value if its type defines one, else the name of the type: never an address in memory."""
    kind: Any = value if isinstance(value, type) else type(value)
    has_text = kind.__str__ is not object.__str__ or kind.__repr__ is not object.__repr__
    return str(value) if has_text and not isinstance(value, type) else kind.__name__


def differences(one: Any, other: Any, name: str = "") -> list[str]:
    """Names of the entries in which two plain values differ, nested ones with dots."""
    if isinstance(one, dict) and isinstance(other, dict):
        keys = [*one, *(key for key in other if key not in one)]
        every = (differences(one.get(key), other.get(key), f"{name}.{key}".strip(".")) for key in keys)
        return [entry for part in every for entry in part]
    return [] if one == other else [name]


def _listed(names: list[str]) -> str:
    """The first few names as text, without `arithmetic`, which is a digest of other entries."""
    chosen = [name or "everything" for name in names if name != "arithmetic"] or names
    return ", ".join(chosen[:_NAMED]) + " and more" * (len(chosen) > _NAMED)


@dataclass(frozen=True)
class Ledger:
    """Results of a campaign on disk: final vectors of the samples, indexed by their initial vectors."""

    folder: Path
    fingerprint: str  # Digest of all inputs of the campaign

    @classmethod
    def open(cls, folder: Path, inputs: Mapping[str, Any], *, renew: bool = False) -> "Ledger":
        """Open the folder of a new campaign, or of this campaign to resume it.

        Parameters
        ----------
        inputs : mapping
            Everything that determines the numerical results of the samples, in the form of `plain`.
        renew : bool
            Delete another campaign in the folder; the same campaign is resumed.

        Raises
        ------
        OutputError
            If the folder contains other files, or cannot be written.
        SimulationError
            If it contains another campaign and `renew` is false.
        """
        text = json.dumps(inputs, indent=1, sort_keys=True, allow_nan=False)
        ledger = cls(folder, hashlib.sha256(text.encode()).hexdigest())
        for place in (folder, folder / BATCHES):
            sweep(place)
        changed = ledger._changes(json.loads(text)) if (folder / MANIFEST).exists() else None
        if changed is None:
            ledger._require_nothing_else()
        elif changed and renew:
            ledger._clear()
        elif changed:
            raise SimulationError(
                f"the campaign in {folder} can be resumed only with the same settings. These differ: "
                f"{_listed(changed)}. Choose a new folder, or replace the campaign: renew=True, --force."
            )
        ledger._create()
        write_whole(folder / MANIFEST, text + "\n")
        return ledger

    def _create(self) -> None:
        try:
            (self.folder / BATCHES).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"{self.folder} cannot be written: {error.strerror}. Choose another folder.") from None

    def _clear(self) -> None:
        shutil.rmtree(self.folder / BATCHES, ignore_errors=True)
        for path in (path for name in (*_RESULTS, MANIFEST) for path in self.folder.glob(name)):
            path.unlink(missing_ok=True)

    def _require_nothing_else(self) -> None:
        """Raise if a folder without manifest contains other files than those of a campaign killed at its beginning."""
        try:
            names = [path.name for path in self.folder.iterdir()] if self.folder.exists() else []
        except OSError as error:
            raise OutputError(f"{self.folder} must be a folder: {error.strerror}. Choose a folder.") from None
        others = [name for name in names if name != BATCHES and not name.startswith(FAMILY)]
        if others:
            raise OutputError(
                f"the folder of a campaign must be new, empty, or that of this campaign. Received {self.folder}, "
                f"which contains {others[0]}. Choose a new folder."
            )

    def _changes(self, inputs: Any) -> list[str]:
        """Names of the inputs that differ from those of the campaign in the folder."""
        try:
            stored = json.loads((self.folder / MANIFEST).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            stored = None
        return differences(stored, inputs)

    def read(self) -> "dict[bytes, np.ndarray]":
        """Final vectors, indexed by the bytes of the initial vectors; damaged files are skipped.

        Raises
        ------
        SimulationError
            If a file belongs to another campaign.
        """
        records: dict[bytes, np.ndarray] = {}
        for path in sorted((self.folder / BATCHES).glob("[!.]*.npz")):
            for start, end in self._pairs(path):
                records[start.tobytes()] = end
        return records

    def _pairs(self, path: Path) -> "list[tuple[np.ndarray, np.ndarray]]":
        try:
            with np.load(BytesIO(path.read_bytes()), allow_pickle=False) as archive:
                fingerprint, starts, ends = str(archive["fingerprint"]), archive["starts"], archive["ends"]
        except Exception:  # zipfile, zlib and numpy raise errors without a common base for damaged bytes
            return []
        if fingerprint != self.fingerprint:
            raise SimulationError(
                f"{path} must be a batch of this campaign. Received one of another campaign. Remove the file."
            )
        return list(zip(starts, ends, strict=True))

    def add(self, starts: "np.ndarray", ends: "np.ndarray") -> None:
        """Write a batch, one sample per row.

        Raises
        ------
        OutputError
            If it cannot be written.
        """
        content = BytesIO()
        np.savez(content, fingerprint=np.array(self.fingerprint), starts=starts, ends=ends)
        name = hashlib.sha256(np.ascontiguousarray(starts).tobytes()).hexdigest()[:16]
        write_whole(self.folder / BATCHES / f"{name}.npz", content.getvalue())
