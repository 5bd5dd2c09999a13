"""The robust small-gain theorem for a loop that runs: bounds for ever, in exact arithmetic.

**Theorem.** Let v stand for b·(p − p*) [m/s²] and let the middle of the ranges of s, w and β be the model of the
nominal loop. Then e2′ = s0·e1 − w0·e2 + β0·v + a with

    a = φ − w·r′ − r″ + (s − s0)e1 − (w − w0)e2 + (β − β0)v,

and p* drifts by d = b·dp*/dt. With the gains g of `norms` (worst in each part j of the period), half ranges δ, and
A_t, D_t the essential suprema of |a|, |d| on [0, t], linearity gives |y(τ)| ≤ g_ya,j·A_t + g_yd,j·D_t for τ ≤ t in
part j. Hence A_t ≤ F + m·A_t + n·D_t with m = max_j Σ δ_y·g_ya,j, n = max_j Σ δ_y·g_yd,j and F a bound of |φ − w·r′ −
r″|. A_t is finite, because the solution of a linear equation with bounded coefficients is bounded on [0, t]; nothing
is assumed about stability. So m < 1 yields A_t ≤ (F + n·D_t)/(1 − m) for every t: all outputs stay below g_ya·A +
g_yd·D for ever, for every measurable course of s, w, β in their ranges and of φ, also within a period. ∎

**Class rate.** For |φ| ≤ H and |φ′| ≤ Ḣ with φ(0) = 0, and friction of the slip alone, shift p* by φ/(β·b), with the β
of the plant: φ leaves a, v becomes b(p − p*) + φ/β, and d gains (φ/β)′. N̂ being constant, |β′| ≤ μ′·N̂|x2|/b with the
largest slope μ′, so |d| ≤ D + Ḣ + κ(|e2| + r′), κ = H·μ′·N̂/b, because β ≥ 1: a second, small loop from e2 to d,

    D_t ≤ D + Ḣ + κ·r′ + κ(g_2a·A_t + g_2d·D_t),

and both inequalities together hold where the spectral radius of their 2 × 2 matrix is below 1. Where friction depends
on the slip rate as well, β may jump: p* is shifted by φ/(β0·b) instead, a keeps (1 − β/β0)φ and d gains φ′/β0.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from quakedesign.bounds import UpperBound
from quakedesign.certificates.claim import Verdict
from quakedesign.certificates.guarantee.flow_norms import flow_norms
from quakedesign.certificates.guarantee.norms import norms
from quakedesign.certificates.guarantee.task import Task
from quakedesign.loop import PeriodicLoop

_ZERO, _ONE = Fraction(0), Fraction(1)
OUTPUTS = ("slip_error", "slip_rate_error", "push")
_WORDS = {
    "slip_error": "range of friction's slope in slip",
    "slip_rate_error": "range of the slope in slip rate",
    "push": "input gain's range",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """What no course of the uncertain quantities exceeds, from rest, for ever.

    Attributes
    ----------
    slip_error : Fraction
        |e1| [m].
    slip_rate_error : Fraction
        |e2| [m/s].
    push : Fraction
        b·|p − p*| [m/s²].
    small_gain : Fraction
        Gain of the loop through the uncertain quantities [-], below 1.
    shares : mapping of str to Fraction
        What each range contributes to it.
    """

    slip_error: Fraction
    slip_rate_error: Fraction
    push: Fraction
    small_gain: Fraction
    shares: Mapping[str, Fraction]


@dataclass(frozen=True, slots=True, kw_only=True)
class NoGuarantee:
    """Why a loop has none.

    Attributes
    ----------
    reason : str
        With the quantity that fails.
    small_gain : UpperBound or None
        At least 1; None where the nominal loop itself is not stable.
    """

    reason: str
    small_gain: UpperBound | None

    def check(self) -> Verdict:
        """UNDECIDED."""
        return Verdict.UNDECIDED

    def sentence(self) -> str:
        """For people."""
        return f"none: {self.reason}"


@dataclass(frozen=True, slots=True)
class _Inputs:
    """F [m/s²], D [m/s³], κ [1/s²], and what the push is more than the shifted one [m/s²]."""

    force: Fraction
    drift: Fraction
    coupling: Fraction
    unshifted: Fraction


def certified_bounds(task: Task, loop: PeriodicLoop) -> Bounds | NoGuarantee:
    """Bounds of the theorem for the loop of `held_loop` or `continuous_loop` with the task's model.

    Raises
    ------
    ParameterError
        When the nominal loop is not found to be stable.
    """
    return bounds_from(task, norms(loop) if loop.segments else flow_norms(loop))


def bounds_from(task: Task, gains: Mapping[tuple[str, str], tuple[Any, ...]]) -> Bounds | NoGuarantee:
    """Bounds of the theorem from the gains of the nominal loop; of floats, floats."""
    half, given = task.half_ranges, _inputs(task)
    parts = range(len(gains["push", "drift"]))

    def through(name: str, j: int) -> Fraction:
        return sum((half[y] * gains[y, name][j] for y in OUTPUTS), _ZERO)

    worst = max(parts, key=lambda j: through("acceleration", j))
    shares = {y: half[y] * gains[y, "acceleration"][worst] for y in OUTPUTS}
    m, n = (max(through(name, j) for j in parts) for name in ("acceleration", "drift"))
    rate = {name: max(gains["slip_rate_error", name]) for name in ("acceleration", "drift")}
    own = given.coupling * rate["drift"]
    if m >= 1 or own >= 1 or m + n * given.coupling * rate["acceleration"] / (1 - own) >= 1:
        return _none(m, n, own, given.coupling * rate["acceleration"], shares)
    small_gain = m + n * given.coupling * rate["acceleration"] / (1 - own)
    acceleration = (given.force + n * given.drift / (1 - own)) / (1 - small_gain)
    drift = (given.drift + given.coupling * rate["acceleration"] * acceleration) / (1 - own)
    found = {
        y: max(gains[y, "acceleration"][j] * acceleration + gains[y, "drift"][j] * drift for j in parts)
        for y in OUTPUTS
    }
    return Bounds(
        slip_error=found["slip_error"],
        slip_rate_error=found["slip_rate_error"],
        push=found["push"] + given.unshifted,
        small_gain=small_gain,
        shares=shares,
    )


def _inputs(task: Task) -> _Inputs:
    if task.change is None:
        return _Inputs(task.reference_force + task.amplitude, task.drift, _ZERO, _ZERO)
    law = task.friction
    if law.rate_slope:
        middle, half = (task.beta[0] + task.beta[1]) / 2, task.half_ranges["push"]
        left, shifted = half / middle * task.amplitude, task.amplitude / middle
        return _Inputs(task.reference_force + left, task.drift + task.change / middle, _ZERO, shifted)
    slope = max(law.weakening, law.strengthening) * task.area_per_mass[1] / task.authority
    coupling = task.amplitude * slope
    drift = task.drift + task.change + coupling * task.reference_rates[0]
    return _Inputs(task.reference_force, drift, coupling, task.amplitude)


def _none(m: Fraction, n: Fraction, own: Fraction, coupled: Fraction, shares: Mapping[str, Fraction]) -> NoGuarantee:
    whole = UpperBound(m if m >= 1 or own >= 1 else m + n * coupled / (1 - own))
    name, share = max(shares.items(), key=lambda item: item[1])
    alone = UpperBound(share)
    return NoGuarantee(reason=f"small gain {whole:.3g}: the {_WORDS[name]} alone needs {alone:.2g}", small_gain=whole)
