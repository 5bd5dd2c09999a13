"""What every way to a proof offers."""

from abc import ABC, abstractmethod
from typing import ClassVar

from quakedesign.sos.exact.proofs import Proof
from quakedesign.sos.exact.statement import Statement


class Method(ABC):
    """A search that may end in a proof; exact arithmetic decides whether it is one.

    Attributes
    ----------
    name : str
    order : int
        Lower ones, which are cheaper, are tried first.
    """

    name: ClassVar[str]
    order: ClassVar[int]

    @abstractmethod
    def propose(self, asked: Statement) -> Proof | None:
        """Proof of exactly this statement, which is not that zero is a sum of squares; None if none is found."""
