"""Long runs are kept on the user's disk, see `quakedesign.cache`: the same code from the same start ends the same."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np

from quakedesign import cache
from quakedesign.simulation.backend import compilation

LONG = 100_000_000
"""Instructions of a run from which on it is worth a place."""


@dataclass(frozen=True)
class Answer:
    """What was computed.

    Attributes
    ----------
    vectors : ndarray
        At the kept instants, one a column.
    told : dict of str to str
        Backend and why, as in the provenance of a run.
    """

    vectors: "np.ndarray"
    told: dict[str, str]


@dataclass(frozen=True)
class Question:
    """Everything that determines the digits of a run.

    Attributes
    ----------
    parts : tuple of bytes
        Empty for a run that is not kept.
    """

    parts: tuple[bytes, ...]

    @classmethod
    def of(
        cls, step: Any, start: Sequence[float], instants: Sequence[int], compiled: bool | None, steps: int
    ) -> "Question":
        """Question of a run of one step function (casadi.Function) over so many steps."""
        if not cache.in_use() or compiled is False or steps * step.n_instructions() < LONG:
            return cls(())
        how = compilation()
        return cls((step.serialize().encode(), np.array(start).tobytes(), np.array(instants).tobytes(), how.encode()))

    def recall(self) -> Answer | None:
        """What was kept."""
        content = cache.recall("run", *self.parts) if self.parts else None
        if content is None:
            return None
        head, _, rest = content.partition(b"\n")
        told = json.loads(head)
        told["backend_reason"] += "; from the cache"
        return Answer(np.load(BytesIO(rest), allow_pickle=False), told)

    def keep(self, answer: Answer) -> None:
        """Keep an answer."""
        if self.parts and answer.told["backend"] == "compiled":
            content = BytesIO()
            np.save(content, answer.vectors, allow_pickle=False)
            cache.keep("run", json.dumps(answer.told).encode() + b"\n" + content.getvalue(), *self.parts)
