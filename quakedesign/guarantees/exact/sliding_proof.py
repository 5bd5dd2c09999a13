"""Proof of slow sliding with rate-and-state friction: claims over the cells of a box of constants, statement."""

from collections.abc import Mapping
from dataclasses import fields
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

from quakedesign.arguments import checked_dataclass
from quakedesign.exact import Bound, LowerBound, UpperBound
from quakedesign.files import Json
from quakedesign.guarantees.exact.proof import NoProof, Proof
from quakedesign.guarantees.exact.sampled_loop import SampledLoop
from quakedesign.guarantees.exact.sliding_small_gain import SlidingClaims, cell_bounds, exponential, follows
from quakedesign.lyapunov.exact.certificate_files import SLOW_SLIDING
from quakedesign.plant.sliding_plant import Cuts, SlidingPlant, cells

if TYPE_CHECKING:
    from quakedesign.laws import SampledController


@checked_dataclass(frozen=True, kw_only=True)
class SlidingProof(Proof[Mapping[str, Fraction]]):
    """Claims about one loop in slow sliding; `check` decides them.

    Attributes
    ----------
    task : SlidingPlant
    sampled_loop : SampledLoop
    cuts : Cuts
        Subdivision of the box of constants into cells.
    claims : SlidingClaims
    """

    kind: ClassVar[str] = SLOW_SLIDING
    slides: ClassVar[bool] = True
    task: SlidingPlant
    sampled_loop: SampledLoop
    cuts: Cuts
    claims: SlidingClaims

    @property
    def motion(self) -> str:
        """Slip range and stress for which the slip rate is bounded, as text."""
        stress = LowerBound(self.task.stress).quantity("Pa")
        return f" {self.validity}, under every shear stress disturbance of at most {stress}"

    @property
    def bounds(self) -> Mapping[str, Bound]:
        """Claims by name, SI; pressures are those in the fault."""
        claims, (least, largest) = self.claims, self.pressures
        named = {part.name: getattr(claims, part.name) for part in fields(claims)}
        return named | {"peak_slip_rate": self.peak_slip_rate, "least_pressure": least, "largest_pressure": largest}

    @property
    def validity(self) -> str:
        """Short statement of the slip range of the claims."""
        return f"during the {LowerBound(self.task.distance):.4g} m of slip of the task"

    def __repr__(self) -> str:
        return f"SlidingProof({self.task.name}: |ln(v/V)| <= {self.claims.log_rate:.4g})"

    @property
    def controller(self) -> "SampledController":
        """Law for `simulate` with the T_s, delay, lag and diffusion path of the proof."""
        return self.sampled_loop.controller

    @cached_property
    def cells(self) -> tuple[SlidingPlant, ...]:
        """The task on every cell."""
        return cells(self.task, self.cuts)

    def theorem_bounds(self) -> Mapping[str, Fraction] | NoProof:
        """Largest bounds over all cells that follow from the claims, by name, or the first reason for failure."""
        largest: dict[str, Fraction] = {}
        for cell in self.cells:
            bounds = cell_bounds(cell, self.sampled_loop, self.claims)
            if isinstance(bounds, NoProof):
                return bounds
            largest = {name: max(bound, largest.get(name, bound)) for name, bound in bounds.items()}
        return largest

    def follows_from(self, bounds: Mapping[str, Fraction]) -> bool:
        """Whether every bound lies below its claim."""
        return follows(bounds, self.claims)

    @property
    def peak_slip_rate(self) -> UpperBound:
        """Upper bound of V·e^Y [m/s], with the claimed bound Y of |ln(v/V)|."""
        return UpperBound(self.task.rate * exponential(self.claims.log_rate))

    @property
    def pressures(self) -> tuple[LowerBound, UpperBound]:
        """Least and largest pressure in the fault [Pa]."""
        return self._within(self.claims.push)

    @property
    def valve_pressures(self) -> tuple[LowerBound, UpperBound]:
        """Least and largest pressure at the valve, including the planned pressure [Pa]."""
        return self._within(self.claims.asked)

    def _within(self, size: UpperBound) -> tuple[LowerBound, UpperBound]:
        """Range of p* along the reference, widened by a size [Pa] on both sides."""
        return LowerBound(-size), UpperBound(self.task.pressure_per_slip * self.task.distance + size)

    def to_dict(self) -> Json:
        """Exact numbers as strings, SI."""
        claims, (low, high), (least, largest) = self.claims, self.pressures, self.valve_pressures
        return {
            "peak_slip_rate": self.peak_slip_rate.exact,
            "log_rate": claims.log_rate.exact,
            "log_state": claims.log_state.exact,
            "slip_error": claims.slip_error.exact,
            "pressure": [low.exact, high.exact],
            "asked_pressure": [least.exact, largest.exact],
            "stress": str(self.task.stress),
            "cells": len(self.cells),
            **{
                name: str(getattr(self.sampled_loop, name))
                for name in ("step", "diffusion", "lag", "delay", "slip_noise")
            },
            "measured": "slip",
        }

    def sentence(self) -> str:
        """Statement of the guarantee; bounds are rounded outward, conditions inward."""
        task, sampled_loop, claims = self.task, self.sampled_loop, self.claims
        ratio = UpperBound(exponential(claims.log_rate))
        (low, high), (least, largest) = self.pressures, self.valve_pressures
        empty = "" if task.distance else "vacuous, as the reference covers 0 m in 0 s: "
        under = f"for every shear stress disturbance of at most {LowerBound(task.stress).quantity('Pa')}"
        under = under if task.stress else "without disturbance"
        return (
            f"{empty}from steady sliding at V = {float(task.rate):.4g} m/s, {_path(sampled_loop)}, "
            f"{under}, {_along(task)}{_box(task)}: the slip rate never "
            f"exceeds {ratio:.4g} V = {self.peak_slip_rate.quantity('m/s')} {self.validity}, in which the fault slides "
            f"forward throughout, the slip stays within {claims.slip_error.quantity('m')} of the reference, the "
            f"pressure in the fault between {low.quantity('Pa')} and "
            f"{high.quantity('Pa')}, at the valve between {least.quantity('Pa')} and {largest.quantity('Pa')} "
            f"({', '.join(['with inertia', *_friction(task)])})"
        )


def _path(sampled_loop: SampledLoop) -> str:
    text = f"with zero-order hold over {float(sampled_loop.step):.6g} s"
    text += f", with a delay of {float(sampled_loop.delay):.6g} s" if sampled_loop.delay else ""
    text += f", through a lag of {float(sampled_loop.lag):.6g} s" if sampled_loop.lag else ""
    text += (
        f", through a diffusion path of L^2/D = {float(sampled_loop.diffusion):.6g} s" if sampled_loop.diffusion else ""
    )
    noise = LowerBound(sampled_loop.slip_noise)
    if sampled_loop.slip_noise:
        return f"{text}, with any noise of at most {noise:.6g} m in the measured slip"
    return f"{text}, with exact measurements of slip"


def _along(task: SlidingPlant) -> str:
    """Part of the statement on the references, if there is more than one."""
    slow, fast = UpperBound(1 - task.swing), LowerBound(1 + task.swing)
    text = f"for every reference whose rate stays between {slow:.6g} V and {fast:.6g} V, "
    return text if task.swing else ""


def _friction(task: SlidingPlant) -> list[str]:
    """Parts of the statement on regularised friction and on the slip law."""
    parts = ["friction regularised"] if task.regularised else []
    return parts + (["state by the slip law"] if task.state_law == "slip" else [])


def _box(task: SlidingPlant) -> str:
    symbols = {"direct_effect": "a", "evolution_effect": "b", "critical_slip": "D_c"}
    wide = [
        f"{short} from {_inside(*task.ranges[axis])}"
        for axis, short in symbols.items()
        if task.ranges[axis][0] < task.ranges[axis][1]
    ]
    if not wide:
        return "for the constants of fault and friction as they are given"
    return f"for every constant value of {', of '.join(wide)}, all other constants as they are given"


def _inside(low: Fraction, high: Fraction) -> str:
    """Ends of a range, rounded inward, with as many digits as necessary."""
    for digits in range(6, 16):
        ends = f"{UpperBound(low):.{digits}g}", f"{LowerBound(high):.{digits}g}"
        if Fraction(ends[0]) < Fraction(ends[1]):
            return " to ".join(ends)
    return f"{low} to {high}"
