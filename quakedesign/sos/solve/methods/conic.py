"""Gram matrices by conic programming, rounded."""

from typing import ClassVar

from quakedesign.sos.exact.proofs import Proof
from quakedesign.sos.exact.statement import Statement
from quakedesign.sos.solve.decide import Search
from quakedesign.sos.solve.methods.base import Method


class Conic(Method):
    """Solve, round, look for a point, refute, pass to a face; see `quakedesign.sos.solve.decide`."""

    name: ClassVar[str] = "conic"
    order: ClassVar[int] = 2

    def propose(self, asked: Statement) -> Proof | None:
        """See `Method.propose`."""
        return Search(asked).run()
