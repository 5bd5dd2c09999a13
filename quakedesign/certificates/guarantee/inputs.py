"""The inputs of a nominal loop, and what bounds each: acceleration, drift, root, noise, start, a layer's rest.

Why each is bounded so stands in `quakedesign.certificates.guarantee.small_gain`.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from types import MappingProxyType
from typing import Any

from quakedesign.certificates.guarantee.free_response import START
from quakedesign.certificates.guarantee.task import Task
from quakedesign.loop import NOISES, ImplicitRoot

Gains = Mapping[tuple[str, str], tuple[Any, ...]]
NOISELESS: Mapping[str, Fraction] = MappingProxyType({})
LATE = "late"
_ZERO = Fraction(0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """An input of the nominal loop and what bounds it: F + Σ c_y·|y|.

    Attributes
    ----------
    name : str
    own : Fraction
        F, in the unit of the input.
    shares : mapping of str to Fraction
        c_y by the output.
    """

    name: str
    own: Fraction
    shares: Mapping[str, Fraction]

    def rounded(self) -> "Channel":
        """The same in floats, which are multiplied twenty times as fast: for estimates."""
        shares: Mapping[str, Any] = {output: float(share) for output, share in self.shares.items()}
        own: Any = float(self.own)
        return Channel(name=self.name, own=own, shares=shares)


@dataclass(frozen=True, slots=True, kw_only=True)
class GainSpread:
    """How far the input gain may be off that of a nominal loop [-].

    Attributes
    ----------
    half : Fraction
        By itself.
    aged : Fraction
        Of that of a time σ ago, over e^{ασ}.
    """

    half: Fraction
    aged: Fraction


def channels_of(
    task: Task,
    root: ImplicitRoot | None,
    step: Fraction,
    noise: Mapping[str, Fraction] = NOISELESS,
    spread: GainSpread | None = None,
    jitter: Fraction = _ZERO,
) -> tuple[Channel, ...]:
    """Inputs of the loop of a task, of a law with an implicit root or without, with noise or without.

    `noise` has the bounds of those inputs of the loop that are noise, `jitter` [s] is that of the measurements.
    """
    force, drift, coupling = _task_inputs(task)
    half, implicit, aged = task.half_ranges, [], []
    if spread is not None:
        half = {**half, "push": spread.half}
        aged.append(Channel(name="aged", own=_ZERO, shares={"push": spread.aged}))
    if root is not None:
        share = root.half_range / step
        own = root.remainder + share * (noise.get("slip_noise", _ZERO) + jitter * task.reference_rates[0])
        implicit.append(Channel(name="root", own=own, shares={"slip_error": share}))
    return (
        Channel(name="acceleration", own=force, shares=half),
        Channel(name="drift", own=drift, shares={"slip_rate_error": coupling}),
        *implicit,
        *aged,
        *_told(task, noise, jitter),
    )


def _told(task: Task, noise: Mapping[str, Fraction], jitter: Fraction) -> Iterator[Channel]:
    """What the measured errors are more than the true ones at their instants: noise, and what moves until then."""
    forces = _task_inputs(task)[0]
    slopes = [max(map(abs, ends)) for ends in (task.slip_chord, task.rate_chord, task.beta)]
    moves = {
        "slip_noise": (_ZERO, {"slip_rate_error": Fraction(1)}),
        "rate_noise": (forces, dict(zip(task.half_ranges, slopes, strict=True))),
    }
    for name, rate in zip(NOISES, task.reference_rates, strict=True):
        if name in noise:
            force, shares = moves[name]
            off = {output: jitter * share for output, share in shares.items()} if jitter else {}
            yield Channel(name=name, own=noise[name] + jitter * (rate + force), shares=off)


def beside(task: Task, names: Collection[str]) -> Iterator[Channel]:
    """Inputs of a law in continuous time that uses the reference itself (`continuous_loop`), a start, what is late."""
    if "reference_acceleration" in names:
        yield Channel(name="reference_acceleration", own=task.reference_rates[1], shares={})
    if "reference_jerk" in names:
        yield Channel(name="reference_jerk", own=task.reference_jerk, shares={})
    if START in names:
        yield Channel(name=START, own=Fraction(1), shares={})
    if LATE in names:
        yield Channel(name=LATE, own=_ZERO, shares={"stepped": Fraction(1)})


def through_layer(channels: Sequence[Channel], gains: Gains) -> Iterator[Channel]:
    """Inputs of a loop through a layer: what its modes leave out acts as v does, by itself where it fades."""
    fades = ("left_out", "left_out") in gains
    for channel in channels:
        share = {"left_out": channel.shares["push"]} if "push" in channel.shares else {}
        if fades and channel.name == "acceleration":
            yield from (channel, Channel(name="left_out", own=_ZERO, shares=share))
        else:
            yield replace(channel, shares={**channel.shares, **share})
    for name in ("awaited", "awaited_told"):
        yield Channel(name=name, own=_ZERO, shares={"left_out": Fraction(1)})


def _task_inputs(task: Task) -> tuple[Fraction, Fraction, Fraction]:
    """F of a [m/s²] and of d [m/s³], and κ [1/s²]."""
    if task.change is None:
        return task.reference_force + task.amplitude, task.drift, _ZERO
    law = task.friction
    if law.rate_slope:
        middle, half = (task.beta[0] + task.beta[1]) / 2, task.half_ranges["push"]
        return task.reference_force + half / middle * task.amplitude, task.drift + task.change / middle, _ZERO
    coupling = task.amplitude * max(law.weakening, law.strengthening) * task.area_per_mass[1] / task.authority
    return task.reference_force, task.drift + task.change + coupling * task.reference_rates[0], coupling
