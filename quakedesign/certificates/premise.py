"""One condition under which a certificate speaks about a given loop."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Premise:
    """One condition under which a certificate speaks about a given loop.

    Attributes
    ----------
    name : str
    required : float
        What the loop asks for, in `unit`; a rigorous upper bound unless `measured`.
    certified : float
        What the certificate covers, in `unit`.
    unit : str
    proved : bool
        False if `certified` is only a limit that no certificate can exceed; the premise then never holds.
    measured : bool
        True if `required` was read off a simulation.
    note : str
        What the number assumes.
    """

    name: str
    required: float
    certified: float
    unit: str
    measured: bool = False
    proved: bool = True
    note: str = ""

    @property
    def ratio(self) -> float | None:
        """required/certified [-]; None where nothing is certified and something is required."""
        if self.certified == 0:
            return 0.0 if self.required == 0 else None
        return self.required / self.certified

    @property
    def holds(self) -> bool:
        """Whether the ratio is at most 1 and a certificate exists."""
        return self.proved and self.ratio is not None and self.ratio <= 1

    def to_dict(self) -> dict:
        """Keys of DESIGN.md and the unit."""
        return {
            "name": self.name,
            "required": self.required,
            "certified": self.certified,
            "ratio": self.ratio,
            "holds": self.holds,
            "unit": self.unit,
            "measured": self.measured,
            "note": self.note,
        }
