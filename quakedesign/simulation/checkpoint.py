"""Long runs that can be interrupted at any moment and go on later with the same digits."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from io import BytesIO
from pathlib import Path
from time import monotonic
from typing import Any
from zipfile import BadZipFile

import numpy as np

from quakedesign.errors import OutputError, SimulationError
from quakedesign.output import write_whole
from quakedesign.temporary import sweep

SECONDS = 30.0


@dataclass(frozen=True)
class Checkpoint:
    """File that holds what a run has kept so far, written whole or not at all.

    Attributes
    ----------
    path : Path
    fingerprint : str
        Of everything that determines the digits of the run; a file of another run is refused.
    """

    path: Path
    fingerprint: str
    _written: list[float] = field(default_factory=lambda: [monotonic()], repr=False)

    @classmethod
    def of(cls, path: str | Path, step: Any, start: Sequence[float], kept: Sequence[int]) -> "Checkpoint":
        """Checkpoint of a run.

        Parameters
        ----------
        path : str or Path
        step : casadi.Function
            One step of the run.
        start : sequence of float
            Vector at time zero.
        kept : sequence of int
            Numbers of the steps to keep.
        """
        told = (step.serialize(), *(float(x).hex() for x in start), *map(str, kept), version("casadi"))
        return cls(Path(path), hashlib.sha256("\n".join(told).encode()).hexdigest())

    def read(self) -> "list[np.ndarray]":
        """Vectors kept so far; none where there is no file yet.

        Raises
        ------
        OutputError
            When the file cannot be read.
        SimulationError
            When it is no checkpoint, or that of another run.
        """
        sweep(self.path.parent)
        try:
            with np.load(BytesIO(self.path.read_bytes()), allow_pickle=False) as held:
                fingerprint, vectors = str(held["fingerprint"]), held["vectors"]
        except FileNotFoundError:
            return []
        except OSError as error:
            raise OutputError(f"checkpoint {self.path} cannot be read: {error.strerror or error}.") from None
        except (ValueError, KeyError, EOFError, BadZipFile):
            fingerprint, vectors = "", np.empty((0, 0))
        if fingerprint != self.fingerprint:
            raise SimulationError(
                f"checkpoint {self.path} must be that of this very run. Received that of another run, or another file. "
                "Delete it, or choose another name."
            )
        return list(vectors)

    def write(self, vectors: "Sequence[np.ndarray]", *, now: bool = False) -> None:
        """Write the vectors kept so far, if the last time is long enough ago or `now`.

        Raises
        ------
        OutputError
            When the file cannot be written.
        """
        if not now and monotonic() - self._written[0] < SECONDS:
            return
        content = BytesIO()
        np.savez(content, fingerprint=np.array(self.fingerprint), vectors=np.array(vectors))
        write_whole(self.path, content.getvalue())
        self._written[0] = monotonic()

    def remove(self) -> None:
        """Delete the file of a run that has ended."""
        self.path.unlink(missing_ok=True)
