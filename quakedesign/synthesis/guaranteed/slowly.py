"""Guarantees that use how slowly the input gain changes, where friction depends on the slip alone."""

from dataclasses import replace
from fractions import Fraction
from math import log
from typing import overload

from quakedesign.certificates.guarantee import Guarantee, Held, NoGuarantee, SlowGain, Task, guarantee
from quakedesign.loop import PeriodicLoop
from quakedesign.synthesis.guaranteed.poles import spectral_radius
from quakedesign.synthesis.guaranteed.rounding import short
from quakedesign.synthesis.guaranteed.unclocked import unclocked_guarantee

_PARTS = 8
_SHARE = 0.5  # of the slowest decay, for what is past to grow by


def best_guarantee(task: Task, held: Held) -> Guarantee | NoGuarantee:
    """Guarantee with an input gain that is slow, where the friction's is and it helps, else with any.

    Where samples follow no clock that is one with a set that the loop never leaves.
    """
    if held.longest_step:
        return unclocked_guarantee(task, held)
    slow = slow_gain(task, held)
    found = guarantee(task, held) if slow is None else guarantee(task, held, slow)
    if slow is None or isinstance(found, Guarantee):
        return found
    anyhow = guarantee(task, held)
    return anyhow if isinstance(anyhow, Guarantee) else found


@overload
def tightened(found: Guarantee) -> Guarantee: ...
@overload
def tightened(found: Guarantee | NoGuarantee) -> Guarantee | NoGuarantee: ...
def tightened(found: Guarantee | NoGuarantee) -> Guarantee | NoGuarantee:
    """A guarantee with a slow input gain in place of one with any, where there is one."""
    if isinstance(found, NoGuarantee) or found.slow_gain is not None or found.reach is not None:
        return found
    better = best_guarantee(found.task, found.held)
    return better if isinstance(better, Guarantee) else found


def slow_gain(task: Task, held: Held) -> SlowGain | None:
    """Parts and growth for a proof; None where friction depends on the slip rate or a nominal loop is not stable."""
    if task.friction.rate_slope:
        return None
    parts = SlowGain(parts=_PARTS, growth=Fraction(1))
    decay = min(_decay(held.loop(task, model)) for model in parts.models(task))
    return replace(parts, growth=short(_SHARE * decay, 2)) if decay > 0 else None


def _decay(loop: PeriodicLoop) -> float:
    """Of the slowest mode [1/s]."""
    return -log(max(spectral_radius(loop), 1e-12)) / float(loop.period)
