"""A guarantee of slow sliding: a fault, its box of constants in cells, the loop that runs, and its bounds."""

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

from quakedesign.bounds import LowerBound, UpperBound
from quakedesign.certificates.claim import Verdict
from quakedesign.certificates.guarantee.held import Held
from quakedesign.certificates.guarantee.small_gain import NoGuarantee
from quakedesign.certificates.slow_sliding.cells import Cuts, cells
from quakedesign.certificates.slow_sliding.small_gain import SlidingClaims, cell_bounds, exponential, follows
from quakedesign.certificates.slow_sliding.task import SlidingTask

if TYPE_CHECKING:
    from quakedesign.loop import SampledController


@dataclass(frozen=True, kw_only=True)
class SlidingGuarantee:
    """Claims about one loop around slow sliding; `check` decides them.

    Attributes
    ----------
    task : SlidingTask
    held : Held
    cuts : Cuts
        How the box of constants falls into cells.
    claims : SlidingClaims
    """

    task: SlidingTask
    held: Held
    cuts: Cuts
    claims: SlidingClaims

    @property
    def covers(self) -> str:
        """For what it holds, in short."""
        stress = LowerBound(self.task.stress).quantity("Pa")
        return f"the stated constants of friction and every shear stress disturbance up to {stress}, {self.lasts}"

    @property
    def lasts(self) -> str:
        """For how long it holds, in short."""
        return f"while the reference goes {float(self.task.distance):.4g} m"

    def __repr__(self) -> str:
        return f"SlidingGuarantee({self.task.name}: |ln(v/V)| <= {self.claims.log_rate:.4g})"

    @property
    def controller(self) -> "SampledController":
        """The law for `simulate`, with its T_s and the delay, lag and rock that it is proved for."""
        return self.held.controller

    @cached_property
    def cells(self) -> tuple[SlidingTask, ...]:
        """The task on every cell."""
        return cells(self.task, self.cuts)

    def check(self) -> Verdict:
        """PROVED if the claims follow from themselves on every cell, in ball arithmetic; else UNDECIDED."""
        for cell in self.cells:
            bounds = cell_bounds(cell, self.held, self.claims)
            if isinstance(bounds, NoGuarantee) or not follows(bounds, self.claims):
                return Verdict.UNDECIDED
        return Verdict.PROVED

    @property
    def peak_slip_rate(self) -> UpperBound:
        """Ve^Y [m/s] from above."""
        return UpperBound(self.task.rate * exponential(self.claims.log_rate))

    @property
    def pressures(self) -> tuple[LowerBound, UpperBound]:
        """Least and largest pressure in the fault [Pa]."""
        return self._within(self.claims.push)

    @property
    def valve_pressures(self) -> tuple[LowerBound, UpperBound]:
        """Least and largest pressure at the valve, what is planned included [Pa]."""
        return self._within(self.claims.asked)

    def _within(self, size: UpperBound) -> tuple[LowerBound, UpperBound]:
        """Ends of p* while the reference goes its distance, and a size [Pa] beyond."""
        return LowerBound(-size), UpperBound(self.task.pressure_per_slip * self.task.distance + size)

    def to_dict(self) -> dict[str, Any]:
        """Exact numbers as texts, SI."""
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
        }

    def sentence(self) -> str:
        """What is guaranteed, for people; bounds rounded up, those of what it is guaranteed for down."""
        task, held, claims = self.task, self.held, self.claims
        ratio = UpperBound(exponential(claims.log_rate))
        (low, high), (least, largest) = self.pressures, self.valve_pressures
        empty = "" if task.distance else "about nothing, as the reference goes 0 m, which takes no time: "
        under = f"for every shear stress disturbance of at most {LowerBound(task.stress).quantity('Pa')}"
        under = under if task.stress else "without disturbance"
        return (
            f"{empty}from steady sliding at V = {float(task.rate):.4g} m/s, {_path(held)}, "
            f"{under}, {_along(task)}{_box(task)}: the slip rate never "
            f"exceeds {ratio:.4g} V = {self.peak_slip_rate:.3g} m/s {self.lasts}, the slip stays within "
            f"{claims.slip_error:.3g} m of it, the pressure in the fault between {low.quantity('Pa')} and "
            f"{high.quantity('Pa')}, at the valve between {least.quantity('Pa')} and {largest.quantity('Pa')} "
            f"({', '.join(['with inertia', *_friction(task)])})"
        )


def _path(held: Held) -> str:
    said = f"held over {float(held.step):.6g} s"
    said += f", {float(held.delay):.6g} s late" if held.delay else ""
    said += f", through a lag of {float(held.lag):.6g} s" if held.lag else ""
    said += f", through rock of L^2/D = {float(held.diffusion):.6g} s" if held.diffusion else ""
    noise = LowerBound(held.slip_noise)
    return said + (f", with any noise of at most {noise:.6g} m in the measured slip" if held.slip_noise else "")


def _along(task: SlidingTask) -> str:
    """The references, where there is more than one."""
    slow, fast = UpperBound(1 - task.swing), LowerBound(1 + task.swing)
    return f"every reference whose rate stays between {slow:.6g} V and {fast:.6g} V, " if task.swing else ""


def _friction(task: SlidingTask) -> list[str]:
    """What a reader would not expect, who expects ageing."""
    said = ["friction regularised"] if task.regularised else []
    return said + (["state by the slip law"] if task.state_law == "slip" else [])


def _box(task: SlidingTask) -> str:
    said = {"direct_effect": "a", "evolution_effect": "b", "critical_slip": "D_c"}
    wide = [
        f"{short} from {_inside(*task.ranges[axis])}"
        for axis, short in said.items()
        if task.ranges[axis][0] < task.ranges[axis][1]
    ]
    return f"for all constant {', '.join(wide)}" if wide else "for a, b and D_c as they are given"


def _inside(low: Fraction, high: Fraction) -> str:
    """Ends of a range on its inner side, with as many digits as it takes."""
    for digits in range(6, 16):
        ends = f"{UpperBound(low):.{digits}g}", f"{LowerBound(high):.{digits}g}"
        if Fraction(ends[0]) < Fraction(ends[1]):
            return " to ".join(ends)
    return f"{low} to {high}"
