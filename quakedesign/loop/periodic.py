"""Periodic linear systems with jumps and flows in rationals, and timing errors of samples."""

from dataclasses import field
from fractions import Fraction
from itertools import pairwise

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError

# ----------------------------------------------------------------------
# Periodic loop of flows and jumps, in rationals.

Row = tuple[Fraction, ...]
Matrix = tuple[Row, ...]

EVEN: Row = tuple(Fraction(i, 8) for i in range(9))


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """A jump x⁺ = Jx and the flow that follows it.

    Attributes
    ----------
    jump : tuple of rows
    duration : Fraction
        [s], positive.
    ends, past_ends : tuple of Fraction
        Instants, as fractions of the duration, that divide the flow into pieces: `ends` for the bounds of outputs,
        `past_ends` for the responses to inputs of earlier periods.
    """

    jump: Matrix
    duration: Fraction
    ends: Row = EVEN
    past_ends: Row = EVEN

    def pieces(self, *, past: bool = False) -> tuple[Fraction, ...]:
        """Lengths of the pieces [s]."""
        return tuple(self.duration * (b - a) for a, b in pairwise(self.past_ends if past else self.ends))


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Fading:
    """An input b·w of amplitude W that decays: |w| ≤ W·(height·e^{−rate·θ} + floor) at a time θ after a jump.

    Attributes
    ----------
    entry : tuple of Fraction
        b.
    first : int
        Index of the segment that begins with this jump, from 0.
    height, floor : Fraction
        [-], not negative.
    rate : Fraction
        [1/s], positive.
    """

    entry: Row
    first: int
    height: Fraction
    rate: Fraction
    floor: Fraction

    def weight(self, time: Fraction) -> Fraction:
        """Bound of |w|/W a time θ [s] after the jump, as e^x exceeds the first terms of its series."""
        x = self.rate * time
        return self.height / (1 + x + x**2 / 2 + x**3 / 6 + x**4 / 24) + self.floor


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Pulse:
    """An input b·w of amplitude W, |w| ≤ W, that acts only near the jump of a segment, before or after it.

    With I₋ and I₊ the integrals of |w| before and after the jump, I₋/`before` + I₊/`after` ≤ W.

    Attributes
    ----------
    entry : tuple of Fraction
        b.
    first : int
        Index of the segment, from 0.
    early, late : Fraction
        Durations before and after the jump [s], within the segments that meet there.
    before, after : Fraction
        Scales of the two integrals [s].
    """

    entry: Row
    first: int
    early: Fraction
    late: Fraction
    before: Fraction
    after: Fraction


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class PeriodicLoop:
    """x' = Ax + Σ b_i·w_i between jumps; segments repeat periodically for all t ≥ 0, the first at t = 0.

    Without segments the loop is a continuous flow.

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
        j_i by the name of an input that adds j_i·w_i to the state once per period, with the jump of the first segment.
    fading : dict of str to Fading
        Inputs that decay after a jump.
    pulses : dict of str to Pulse
        Inputs that act only near a jump.
    feedthrough : dict of (str, str) to Fraction
        Bound of the direct feedthrough from an input of size 1 to an output, by (output, input).
    start : tuple of tuple of Fraction
        Columns s_i of the box of initial states: x(0) = Σ θ_i·s_i, |θ_i| ≤ 1, before the first jump; empty for 0.
    """

    states: tuple[str, ...]
    flow: Matrix
    segments: tuple[Segment, ...]
    inputs: dict[str, Row]
    outputs: dict[str, Row]
    sampled: dict[str, Row] = field(default_factory=dict)
    fading: dict[str, Fading] = field(default_factory=dict)
    pulses: dict[str, Pulse] = field(default_factory=dict)
    feedthrough: dict[tuple[str, str], Fraction] = field(default_factory=dict)
    start: tuple[Row, ...] = ()

    def __hash__(self) -> int:
        rows = frozenset(self.inputs.items()), frozenset(self.outputs.items())
        return hash((self.states, self.flow, self.segments, *rows))

    @property
    def period(self) -> Fraction:
        """Period [s], the sum of the durations."""
        return sum((part.duration for part in self.segments), Fraction(0))


# ----------------------------------------------------------------------
# Timing errors of the samples and pressures of a loop.


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Instants:
    """Timing errors of measurements and pressures: any sequence within given bounds [s].

    Attributes
    ----------
    measured : Fraction
        Largest timing error of a measurement [s]; the first one is exact.
    arrived : Fraction
        Largest timing error of the start of a pressure change at the valve [s].
    ramp : Fraction
        Longest duration of a pressure change at the valve [s]; its rate is at least |change|/ramp.
    """

    measured: Fraction = Fraction(0)
    arrived: Fraction = Fraction(0)
    ramp: Fraction = Fraction(0)

    def require_within(self, step: Fraction, part: Fraction) -> None:
        """Reject timing errors that let events overlap; `part` [s] is the time from a sample to the next change due."""
        if min(self.measured, self.arrived, self.ramp) < 0 or 2 * self.measured > step:
            raise ParameterError(
                "jitter and ramp must not be negative, and jitter of a measurement at most half a step of "
                f"{float(step):.4g} s. Received {float(self.measured):.4g} s for measurements, "
                f"{float(self.arrived):.4g} s for pressures and a ramp of {float(self.ramp):.4g} s. Reduce the jitter."
            )
        after = self.arrived + self.ramp
        if self.arrived > (part or step) or after > step - part or self.arrived + after > step:
            raise ParameterError(
                "a pressure change must begin and end between two samples, and before the next change may begin. "
                f"Received a change due {float(part):.4g} s after a sample, with the step {float(step):.4g} s, "
                f"jitter of {float(self.arrived):.4g} s and a ramp of {float(self.ramp):.4g} s. "
                "Reduce jitter or ramp, or change the delay."
            )
