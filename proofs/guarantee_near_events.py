"""What comes of an input that is there near an event alone: of jitter, and of a pressure that rises (FORMAT.md)."""

from dataclasses import dataclass
from fractions import Fraction

from guarantee_numbers import Fixed, exponential
from guarantee_reading import Row


@dataclass
class Pulse:
    """From `early` before the event with this number until `late` after it; its areas over `before`, `after` are 1."""

    event: int
    early: Fraction
    late: Fraction
    before: Fraction
    after: Fraction


@dataclass
class Near:
    """What it is in one flow: columns that begin with its event, each with a bound of what it is off, in size.

    `soon` bounds in size what is there in the last part, `reach` long, before the next event, beside `ahead` as it is.
    """

    sides: list[tuple[Fixed, Fixed]]
    ahead: Fixed | None
    soon: Fixed | None
    reach: Fraction

    def halves(self) -> tuple[Fixed, Fixed]:
        """Half the sum and half the difference of both sides, whose sizes add up to the larger; what both are off."""
        (one, off), (other, far) = self.sides
        less = Fixed([[-v for v in line] for line in other.rows], other.error)
        both = (one + other).beside(one + less).scaled(Fraction(1, 2))
        return both, Fixed([[max(*a, *b)] for a, b in zip(off.rows, far.rows, strict=True)])


def near_of(flow: list[Row], majorant: list[Row], event: Fixed, entry: Fixed, moved: Fixed, pulse: Pulse) -> Near:
    """Both sides of a pulse after its event; `moved` is A*entry.

    Before it, an impulse is within early*|J|*|e^{A.}|*|A*b| of J*b, after it within late*|e^{A.}|*|e^{-A*late}*A*b|.
    """
    before, after = event * entry, entry
    shifted = ((event.size() * exponential(majorant, pulse.early).size()).size() * moved.size()).size()
    back = (exponential([[-v for v in line] for line in flow], pulse.late) * moved).size()
    behind = (exponential(majorant, pulse.late).size() * back).size()
    sides = [
        (before.scaled(pulse.before), shifted.scaled(pulse.before * pulse.early).size()),
        (after.scaled(pulse.after), behind.scaled(pulse.after * pulse.late).size()),
    ]
    return Near(sides, None, None, Fraction(0))


def with_next(here: Near | None, majorant: list[Row], entry: Fixed, moved: Fixed, pulse: Pulse) -> Near:
    """What is there before the next event as well: at most |c*b| + early*|c|*|e^{A.}|*|A*b|, over `before`."""
    soon = (exponential(majorant, pulse.early).size() * moved.size()).size()
    sides = here.sides if here else []
    scaled = soon.scaled(pulse.early * pulse.before).size()
    return Near(sides, entry.scaled(pulse.before), scaled, pulse.early)
