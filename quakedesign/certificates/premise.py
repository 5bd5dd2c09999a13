"""One condition under which a certificate speaks about a given loop."""

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from quakedesign.bounds import LowerBound, UpperBound

_MOST_DIGITS = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class Premise:
    """One condition under which a certificate speaks about a given loop.

    Attributes
    ----------
    name : str
    required : UpperBound
        What the loop asks for, in `unit`; a rigorous upper bound unless `measured`.
    certified : LowerBound
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
    required: Fraction | float
    certified: Fraction | float
    unit: str
    measured: bool = False
    proved: bool = True
    note: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "required", _bound(UpperBound, self.required))
        object.__setattr__(self, "certified", _bound(LowerBound, self.certified))

    @property
    def ratio(self) -> Fraction | float | None:
        """required/certified [-], an `UpperBound`; None where nothing is certified and something is required."""
        if self.certified == 0:
            return UpperBound(0) if self.required == 0 else None
        return _bound(UpperBound, self.required / self.certified)

    @property
    def holds(self) -> bool:
        """Whether the ratio is at most 1 and a certificate exists."""
        return self.proved and self.ratio is not None and self.ratio <= 1

    @property
    def sides(self) -> tuple[str, str]:
        """Texts of what is required, rounded up, and certified, rounded down, with the unit; of one number, said so."""
        unit = "" if self.unit == "-" else f" {self.unit}"
        if self.required == self.certified != 0:
            return f"at most {self.required:.4g}{unit}", "the same number"
        for digits in range(4, _MOST_DIGITS):  # as many as it takes to see that what holds does
            required, certified = (f"{side:.{digits}g}" for side in (self.required, self.certified))
            if not self.holds or Fraction(required) <= Fraction(certified):
                return f"{required}{unit}", f"{certified}{unit}"
        return f"{self.required:.4g}{unit}", "no less"

    def to_dict(self) -> dict[str, Any]:
        """Keys of DESIGN.md and the unit; None for what is infinite."""
        return {
            "name": self.name,
            "required": _finite(self.required),
            "certified": _finite(self.certified),
            "ratio": _finite(self.ratio),
            "holds": self.holds,
            "unit": self.unit,
            "measured": self.measured,
            "note": self.note,
        }


def _bound(kind: type[UpperBound] | type[LowerBound], value: Fraction | float) -> Fraction | float:
    """Bound on a number; one that is not finite, as of a run that diverges, stays as it is."""
    return value if isinstance(value, float) and not math.isfinite(value) else kind(value)


def _finite(value: Fraction | float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
