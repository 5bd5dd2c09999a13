"""A loop that flows and jumps with one period, in rationals."""

from dataclasses import dataclass, field
from fractions import Fraction

Row = tuple[Fraction, ...]
Matrix = tuple[Row, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """A jump x⁺ = Jx and the flow that follows it.

    Attributes
    ----------
    jump : tuple of rows
    duration : Fraction
        [s], positive.
    """

    jump: Matrix
    duration: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class PeriodicLoop:
    """x' = Ax + Σ b_i·w_i between jumps; the segments follow each other for ever, the first one at time 0.

    Without any segment there are no jumps: it flows for ever.

    Attributes
    ----------
    states : tuple of str
    flow : tuple of rows
        A.
    segments : tuple of Segment
    inputs : dict of str to tuple of Fraction
        b_i by the name of the input.
    outputs : dict of str to tuple of Fraction
        Rows c with y = cx.
    sampled : dict of str to tuple of Fraction
        j_i by the name of an input that adds j_i·w_i to the state once a period, with the jump of the first segment.
    """

    states: tuple[str, ...]
    flow: Matrix
    segments: tuple[Segment, ...]
    inputs: dict[str, Row]
    outputs: dict[str, Row]
    sampled: dict[str, Row] = field(default_factory=dict)

    @property
    def period(self) -> Fraction:
        """[s]."""
        return sum((part.duration for part in self.segments), Fraction(0))
