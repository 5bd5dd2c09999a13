"""What the fast modes of a layer bring into the slip rate at every step: a kick that is known, and what is awaited.

With R what the modes n < MODES leave out (FORMAT.md, Layer), A its area after a unit step, less it, and Y what of it
the steps so far will still bring, x2 = e2 - beta0*b*Y takes the place of e2 in the loop.
"""

from dataclasses import dataclass, replace
from fractions import Fraction

from guarantee_gains import gains, input_gains
from guarantee_loop import MODES, SHORT, Fade, Loop, mode_rate, mode_share
from guarantee_reading import Row
from guarantee_start import start_gains


@dataclass
class Awaited:
    """b*Y over its bound: where it enters the flow, how it fades, what it adds to e2, what the law is told of it."""

    entry: Row
    fade: Fade | None
    at_once: Fraction
    told: Row


def loop_gains(loop: Loop, gain: Fraction) -> list[list[Row]]:
    """Gains of every input: of the loop, of what is awaited and told of it where there is rock, of the start."""
    found = []
    if loop.layer:
        loop, awaited = without_area(loop, gain)
        lines = gains(loop, awaited.entry, False, awaited.fade)
        lines[1] = [v + awaited.at_once for v in lines[1]]
        found = [lines, gains(loop, awaited.told, True)]
    own = input_gains(loop)
    if loop.pulse:
        found = [gains(loop, pulse_entry(loop, gain), False, pulse=loop.pulse)]
        seen = own[1][3 if loop.asked else 2]  # the steady pressure moves on while one before is at the valve
        seen[:] = [v + loop.pulse.late for v in seen]
    return [*own, *found, *([start_gains(loop)] if loop.start else [])]


def pulse_entry(loop: Loop, gain: Fraction) -> Row:
    """Where a pressure at the valve enters: the slip rate, or what that behind a lag is more than the valve's."""
    entry = [Fraction(0)] * len(loop.flow)
    if loop.asked:
        well = len(entry) - 2
        entry[well] = -loop.flow[well][well]
    else:
        entry[1] = gain
    return entry


def without_area(loop: Loop, gain: Fraction) -> tuple[Loop, Awaited]:
    """The loop in x2, with beta0 = gain times the known kick at every step of the well, or of its flow."""
    last = next(i for i, v in enumerate(loop.outputs[3]) if v)  # the valve's last step, or the well less the valve
    kick = gain * area(loop.layer)
    flow, events = [list(line) for line in loop.flow], [([list(line) for line in jump], t) for jump, t in loop.events]
    if loop.fade:
        share, fade = held_share(loop)
        jump, rest = events[-1]
        jump[1] = [v - kick * step for v, step in zip(jump[1], jump[last], strict=True)]
        late = fade.weight(rest)
    else:
        share, fade, late = moving_share(loop.layer), None, Fraction(1)
        flow[1][last] -= kick * flow[last][last]
    own = gain * share
    told = [own * late * (line[1] - (i == 1)) for i, line in enumerate(events[0][0])]
    entry = [own * v for v in (1, flow[1][1], *[Fraction(0)] * (len(flow) - 2))]
    return replace(loop, flow=flow, events=events), Awaited(entry, fade, own, told)


def area(time: Fraction) -> Fraction:
    """A: time/2 is that of all modes."""
    return time / 2 - sum(mode_share(n) / mode_rate(n, time) for n in range(MODES))


def held_share(loop: Loop) -> tuple[Fraction, Fade]:
    """Bound of b*Y over that of b*R, for a well that steps once a period; how it fades."""
    rate, floor = mode_rate(MODES, loop.layer), 6 * MODES * SHORT * (1 + loop.layer / loop.step)
    height = abs(mode_share(MODES)) * (1 + 1 / (rate * loop.step))
    most = height / rate + floor * loop.layer
    fade = Fade(loop.fade.event if loop.fade else 0, height / rate / most, rate, floor * loop.layer / most)
    return most / (height + floor), fade


def moving_share(time: Fraction) -> Fraction:
    """The same for a well that flows."""
    high, rate, floor = abs(mode_share(MODES)), mode_rate(MODES, time), 6 * MODES * SHORT
    return (high / rate**2 + floor * time**2) / (high / rate + floor * time)
