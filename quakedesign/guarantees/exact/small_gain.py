"""Robust small-gain theorem for sampled loops: bounds for all t ≥ 0 in exact arithmetic.

Chapters: the theorem with the bounds of all inputs; slowly varying input gain, where friction depends on slip alone;
sector bounds of the implicit step. Symbols are those of `plant.fault_plant`. The paragraphs *Theorem* and *Inputs*
suffice for a loop that starts at rest, under the class amplitude, without noise, jitter, diffusion path, implicit step
and slowly varying input gain.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from fractions import Fraction
from itertools import chain
from typing import Any, ClassVar, Literal

from flint import arb, ctx

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.exact import LowerBound, UpperBound, shortly
from quakedesign.guarantees.exact.norms import ball, flow_norms, norms
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.exact.sampled_loop import (
    NOISELESS,
    Channel,
    Gains,
    GainSpread,
    channels_of,
    reference_channels,
    through_diffusion,
)
from quakedesign.laws import ImplicitStep, NominalModel, Power
from quakedesign.loop import PeriodicLoop
from quakedesign.plant.fault_plant import FaultPlant

# ----------------------------------------------------------------------
# Robust small-gain theorem for the sampled loop: bounds for all t ≥ 0, in exact arithmetic.
#
# **Theorem.** Let a loop with inputs w_1 … w_n be linear, with initial state 0, and g_yi,j its gains as in `norms`:
# |y(τ)| ≤ Σ_i g_yi,j·W_i(t) for τ ≤ t in part j of the period, W_i(t) the essential supremum of |w_i| on [0, t] (for a
# sampled input, over the samples up to t). Let the outputs in turn bound every input, |w_i| ≤ F_i + Σ_y c_iy·|y| at
# every time, c ≥ 0, and let M_ik = max_j Σ_y c_iy·g_yk,j. If the spectral radius of M is below 1, then W(t) ≤ (1 −
# M)⁻¹F for every t, and |y| is at most max_j Σ_i g_yi,j·W_i for all t. *Proof.* W(t) ≤ F + M·W(t). W(t) is
# finite, because the solution of such a loop is bounded on [0, t]. (1 − M)⁻¹ = 1 + M + M² … has no negative entry. The
# nominal loop is stable, as its gains are finite; stability of the uncertain loop is not assumed. ∎
#
# **Inputs.** Let v = b·(p − p*) [m/s²], and let the nominal loop have the midpoints of the ranges of s, w and β. Then
# e2′ = s0·e1 − w0·e2 + β0·v + a with the input ``acceleration``
#
#     a = φ − w·r′ − r″ + (s − s0)e1 − (w − w0)e2 + (β − β0)v,
#
# so F of a is a bound of |φ − w·r′ − r″|, and its c are the half-widths of the ranges. The input ``drift`` is d =
# b·dp*/dt.
#
# **Class rate.** Let |φ| ≤ H and |φ′| ≤ Ḣ with φ(0) = 0, and let friction depend on the slip alone. Shift p* by
# φ/(β·b), with the β of the plant: a no longer contains φ, v becomes b(p − p*) + φ/β, and (φ/β)′ is added to d. As N̂
# is constant, |β′| ≤ μ′·N̂|x2|/b with the largest slope μ′. So |d| ≤ D + Ḣ + κH(|e2| + r′), D the bound of |d| without
# φ, κ = μ′·N̂/b, because β ≥ 1. If friction depends on the slip rate as well, β may jump. Then p* is shifted by
# φ/(β0·b), (1 − β/β0)φ remains in a, and φ′/β0 is added to d. As class amplitude includes class rate, the smaller of
# both bounds holds for every output.
#
# **Initial state.** Let the loop start at x(0) = Σ θ_i·s_i, |θ_i| ≤ 1, instead of at rest. By superposition |y(τ)| ≤
# h_y,j + Σ_i g_yi,j·W_i(t), where h_y,j bounds |y| of the free response in part j from every such initial state
# (`free_peaks`). So the initial state is one more input, ``start``, with F = 1, c = 0 and the gains h. Its row of M is
# zero, so the spectral radius does not change. The s_i contain the bounds of e1(0) and e2(0), and the response of the
# law's states to its first measurement. All other initial values remain 0: p = 0, and p* = 0 at r = 0, as r(0) = r′(0)
# = 0. In class rate φ(0) = 0, so the shift of p* is also 0. With a slowly varying gain (below), the loops of all parts
# of the range of β have the same initial state. As t = 0 is included, the bounds of e1 and e2, and with them the claims
# E and R (below), are at least the bounds of the initial errors.
#
# **Noise.** Let a law measure e1 + n1 and e2 + n2 with |n1| ≤ N1 and |n2| ≤ N2 at the samples. Then the loop has two
# more sampled inputs, ``slip_noise`` and ``rate_noise``, with F = N1 and N2 and c = 0. They are any sequences within
# these bounds. Measurements quantised in steps of q have errors of at most q/2.
#
# **Implicit step.** In this paragraph w is the solution of the implicit step, not the damping. By the sector bounds of
# the last chapter w lies between −γ0·e1/T_s and −γ1·e1/T_s up to ε; γ is their midpoint, δγ half their difference. The
# law is linear except for the sampled input ``root``, w_k + γe1/T_s at the samples: |w_k + γe1/T_s| ≤ δγ|e1|/T_s + ε
# wherever |e1| ≤ E and |e2| ≤ R (`sector_is_valid`). E and R are the claims themselves. Suppose that the claims follow
# from these bounds of the inputs. If all samples of e before kT_s are within the claims, the input ``root`` obeys its
# bound up to kT_s, as it depends on these samples alone. So e is within the claims up to kT_s and, as e is continuous,
# so is the sample at kT_s. By induction all samples are. If there is noise, the step is solved for e1 + n1 and e2 + n2:
# E + N1 and R + N2 replace E and R, and δγN1/T_s is added to ε. ∎
#
# **Jitter.** Let sample k be measured within J of kT_s, the first at 0. Let the valve pressure leave p_{k−1} within A
# of the due time of p_k and move to p_k monotonically, within at most Θ and at a rate of at least |p_k − p_{k−1}|/Θ.
# The nominal loop has no timing error. The measured error is then e(kT_s) plus the change of e until the measurement:
# |n1| ≤ J(|e2| + r′), as the slip is compared with the reference at kT_s, and |n2| ≤ J(|e2′| + |r″|), |e2′| ≤
# max|s||e1| + max|w||e2| + max β|v| + |φ − w·r′ − r″|. These bounds give c and F of the noise inputs. Let j be the
# valve pressure minus that of the nominal loop, and u_k = b(p_k − p_{k−1}), the output ``stepped``. Then b·|j| ≤ |u_k|,
# and j is nonzero only from A before to A + Θ after the due time of p_k: the valve has p_k early, or p_{k−1} late. The
# input ``late`` is b·j. It acts as the valve pressure does, with F = 0 and c = 1 for u_k. Let f be the share of the
# step that is completed by the due time of p_k. The areas of b|j| before and after that time are B and L times |u_k|:
# if the step begins late, B = 0 and L ≤ A + Θ/2; if it begins early, B ≤ f·A and L ≤ (1 − f)²·Θ/2. So B/A + L/(A + Θ/2)
# ≤ 1 always, and ``late`` is a `Pulse`. The true p is between values of the nominal p at times at most A + Θ before or
# after. So v = b(p − p*) is bounded by that of the nominal loop plus the change of b·p* in this time, at most |d|(A +
# Θ); the bound of the output ``push`` (with a lag ``asked``) includes it.
#
# An input at t may thus be bounded by outputs up to t + T_s. The theorem still holds: fix t, and let the nominal loop
# continue after t without inputs, except those that stand for the timing error of a measurement or a pressure from
# before t. They obey the same bounds and vanish after t + T_s. So W(t + T_s) ≤ F + M·W(t + T_s), and W(t) is not
# larger. An implicit step uses e at the time of the measurement, up to which the bounds hold. So E grows only by N1 +
# J·r′, R by N2 + J·|r″|, and ε by δγ(N1 + J·r′)/T_s. A measurement may also be a mean of e with non-negative weights of
# sum 1 over times within J of kT_s: it obeys every bound that all these values obey. ∎
#
# **Slowly varying input gain.** For friction that depends on the slip alone β = μ(x1)N̂/b, so |β(τ) − β(t)| ≤ κ|x1(τ) −
# x1(t)| ≤ κ(2E + r′σ), σ = t − τ, κ = μ′·N̂/b, while |e1| ≤ E. Divide the range of β into parts with midpoints β_i and
# half-widths δ. Fix t, let β(t) be in part i, and take β_i in place of β0 in the nominal loop up to t: |β(τ) − β_i| ≤ δ
# + 2κE + κr′σ, and σ ≤ e^{ασ}/(eα) for every α > 0. So (β − β_i)v is bounded by two terms: (δ + 2κE)|v|, as before with
# a smaller c, and ``aged``, an input that enters like ``acceleration``, with c = κr′/(eα) for v. The gains of ``aged``
# are those of the loop with α added to the diagonal of its flow matrix, whose responses are e^{ασ} times as large.
# Every gain is the largest over the parts. E is the claim on the slip error, which must exceed the resulting bound: e1
# is continuous and initially below E, so it never reaches E. ∎
#
# **Diffusion path.** In this paragraph R is b times the truncation error of the modes [m/s²], |R| ≤ sup|y| with the
# output y = ``left_out``, and bY is its integral as in `loop.diffusion_path`. The plant has β(v + R). The loop
# contains β0·v and, with the state e2 − β0·bY in place of e2, also β0·R, as known jumps. So (β − β0)R enters like
# ``acceleration``; its c for y is that of ``acceleration`` for v. If the well pressure is continuous, this term is part
# of ``acceleration``. If it has steps, R decays after every step and is a separate input. With a slowly varying gain,
# past values of R are treated as those of v, with the same c. There are two more inputs, with F = 0 and c = 1 for y:
# ``awaited``, β0·bY in the derivatives of e1 and of that state, and ``awaited_told``, its effect on the measurement at
# the samples. It acts like noise, because e2 is measured, not that state. The bound of e2 is that of the state plus
# that of β0·bY, the direct feedthrough of ``awaited``. ∎

_ZERO = Fraction(0)
OUTPUTS = ("slip_error", "slip_rate_error", "push")
_WORDS = {
    ("acceleration", "slip_error"): "range of friction's slope in slip",
    ("acceleration", "slip_rate_error"): "range of the slope in slip rate",
    ("acceleration", "push"): "input gain's range",
    ("aged", "push"): "change of the input gain",
    ("drift", "slip_rate_error"): "change of the input gain under the disturbance",
    ("root", "slip_error"): "range of the implicit step's slope",
    ("late", "stepped"): "jitter, or the duration of a pressure change",
    **{("rate_noise", output): "jitter of the measurement" for output in OUTPUTS},
    ("slip_noise", "slip_rate_error"): "jitter of the measurement",
}
_LEFT_OUT = "truncation error of the diffusion modes"
_HALVINGS = 96


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """Bounds for all t ≥ 0 and every realisation of the uncertain quantities; from a search, estimates.

    Attributes
    ----------
    available : bool
        True; False for `NoProof`.
    slip_error : Fraction
        |e1| [m].
    slip_rate_error : Fraction
        |e2| [m/s].
    push : Fraction
        b·|p − p*| [m/s²].
    valve_push : Fraction, optional
        The same at the valve [m/s²]; None where both pressures are equal.
    stepped : Fraction, optional
        b times the change of the commanded pressure between samples [m/s²]; None where it is not needed.
    small_gain : Fraction
        Upper bound of the spectral radius of M [-], below 1; for aperiodic sampling the largest Σ c·Y/W over the
        inputs, at most 1, with bounds Y of the outputs and W of the input.
    """

    available: ClassVar[Literal[True]] = True
    slip_error: Fraction
    slip_rate_error: Fraction
    push: Fraction
    small_gain: Fraction
    valve_push: Fraction | None = None
    stepped: Fraction | None = None


def certified_bounds(
    task: FaultPlant,
    loop: PeriodicLoop,
    implicit_step: ImplicitStep | None = None,
    noise: Mapping[str, Fraction] = NOISELESS,
    jitter: Fraction = _ZERO,
) -> Bounds | NoProof:
    """Bounds of the theorem for the nominal loop of a fault that tracks its reference.

    `noise` gives the bounds of the noise inputs in SI units, `jitter` the bound J of measurement times [s].

    Raises
    ------
    ParameterError
        When the nominal loop is not proved to be stable.
    """
    gains = norms(loop) if loop.segments else flow_norms(loop)
    return best_bounds(task, gains, implicit_step, loop.period, noise, jitter=jitter)


def best_bounds(
    task: FaultPlant,
    gains: Gains,
    implicit_step: ImplicitStep | None,
    step: Fraction,
    noise: Mapping[str, Fraction] = NOISELESS,
    spread: GainSpread | None = None,
    jitter: Fraction = _ZERO,
) -> Bounds | NoProof:
    """Bounds of the theorem from the gains; in class ``rate`` the smaller of those of both classes."""
    classes = [task] if task.change is None else [task, replace(task, change=None)]
    results = [bounds_from(one, gains, implicit_step, step, noise, spread, jitter) for one in classes]
    proved = [bounds for bounds in results if bounds.available]
    if not proved:
        return results[0]
    every = {part.name: [getattr(bounds, part.name) for bounds in proved] for part in fields(Bounds)}
    best: dict[str, Any] = {name: None if None in values else min(values) for name, values in every.items()}
    return Bounds(**best)


def bounds_from(
    task: FaultPlant,
    gains: Gains,
    implicit_step: ImplicitStep | None,
    step: Fraction,
    noise: Mapping[str, Fraction] = NOISELESS,
    spread: GainSpread | None = None,
    jitter: Fraction = _ZERO,
) -> Bounds | NoProof:
    """Bounds of the theorem from the gains of the nominal loop; gains in floats give an estimate."""
    channels = (
        *channels_of(task, implicit_step, step, noise, spread, jitter),
        *reference_channels(task, {name for _, name in gains}),
    )
    if ("push", "awaited") in gains:
        channels = tuple(through_diffusion(channels, gains))
    if all(isinstance(values[0], float) for values in gains.values()):
        channels = tuple(channel.rounded() for channel in channels)
    small_gain, peaks = channel_bounds(channels, gains)
    if peaks is None:
        return _none(small_gain, channels, gains)
    return Bounds(
        slip_error=Fraction(peaks["slip_error"]),
        slip_rate_error=Fraction(peaks["slip_rate_error"]),
        push=Fraction(peaks["push"] + peaks.get("left_out", _ZERO) + shift_bound(task)),
        small_gain=Fraction(small_gain),
        valve_push=Fraction(peaks["asked"] + shift_bound(task)) if "asked" in peaks else None,
        stepped=Fraction(peaks["stepped"]) if "stepped" in peaks else None,
    )


def channel_bounds(channels: Sequence[Channel], gains: Gains) -> tuple[Any, dict[str, Any] | None]:
    """Upper bound of the spectral radius of M and, if it is below 1, a bound of every output.

    Raises
    ------
    ValueError
        For an input of the loop that no channel bounds.
    """
    if unbounded := {name for _, name in gains} - {channel.name for channel in channels}:
        raise ValueError(f"every input of a loop needs a bound. Received {', '.join(sorted(unbounded))} without one.")
    loops = [
        [
            max(sum((c * gains[y, k.name][j] for y, c in i.coefficients.items()), _ZERO) for j in _parts(gains))
            for k in channels
        ]
        for i in channels
    ]
    small_gain = spectral_radius(loops)
    if small_gain >= 1:
        return small_gain, None
    inputs = _solved(loops, [channel.constant for channel in channels])
    return small_gain, {
        y: max(
            sum((gains[y, k.name][j] * v for k, v in zip(channels, inputs, strict=True)), _ZERO) for j in _parts(gains)
        )
        for y in dict.fromkeys(y for y, _ in gains)
    }


def spectral_radius(matrix: Sequence[Sequence[Any]]) -> Any:
    """Upper bound of the spectral radius of a non-negative matrix, by bisection to 1e-6.

    The spectral radius is below v if, and only if, elimination of v − M has positive pivots (Hawkins and Simon 1949).
    """
    low, high = _ZERO, max(sum(row, _ZERO) for row in matrix)
    for _ in range(_HALVINGS):
        if high - low <= high / 2**20:
            break
        middle = (low + high) / 2
        low, high = (low, middle) if _dominates(middle, matrix) else (middle, high)
    return high


def _dominates(value: Any, matrix: Sequence[Sequence[Any]]) -> bool:
    rows = [[(i == j) * value - v for j, v in enumerate(row)] for i, row in enumerate(matrix)]
    while rows:
        first, *rest = rows
        if first[0] <= 0:
            return False
        rows = [[v - row[0] / first[0] * p for v, p in zip(row[1:], first[1:], strict=True)] for row in rest]
    return True


def _parts(gains: Gains) -> range:
    return range(len(next(iter(gains.values()))))


def _solved(matrix: Sequence[Sequence[Any]], own: Sequence[Any]) -> list[Any]:
    """(1 − M)⁻¹F; the pivots are positive, since the spectral radius of M ≥ 0 is below 1."""
    size = len(own)
    rows = [[(i == j) - v for j, v in enumerate(row)] + [own[i]] for i, row in enumerate(matrix)]
    for i in range(size):
        rows[i] = [v / rows[i][i] for v in rows[i]]
        for k in range(size):
            if k != i:
                rows[k] = [v - rows[k][i] * p for v, p in zip(rows[k], rows[i], strict=True)]
    return [row[size] for row in rows]


def shift_bound(task: FaultPlant) -> Fraction:
    """Bound of the shift of b·p* by a disturbance of class ``rate`` [m/s²]; 0 in class ``amplitude``."""
    if task.change is None:
        return _ZERO
    return task.amplitude / ((task.beta[0] + task.beta[1]) / 2 if task.friction.rate_slope else 1)


def _none(small_gain: Any, channels: Sequence[Channel], gains: Gains) -> NoProof:
    alone = {(i.name, y): c * max(gains[y, i.name]) for i in channels for y, c in i.coefficients.items()}
    (name, share), whole = max(alone.items(), key=lambda item: item[1]), UpperBound(small_gain)
    what = _WORDS.get(name, _LEFT_OUT)
    return NoProof(
        reason=f"small gain {whole:.3g}, which must be below 1: the {what} contributes {LowerBound(share):.3g}",
        small_gain=whole,
    )


# ----------------------------------------------------------------------
# Slowly varying input gain of friction that depends on the slip alone.

MOST_PARTS = 16
_ONE_OVER_E = Fraction(3679, 10000)  # rounded up


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class VaryingGain:
    """Slowly varying input gain as used by a proof.

    Attributes
    ----------
    parts : int
        Number of equal parts of the range of the gain, at most 16; each has its own nominal loop.
    growth : Fraction
        α [1/s]: weight e^{ασ} of the response a time σ ago.
    """

    parts: int
    growth: Fraction

    def __post_init__(self) -> None:
        if not 1 <= self.parts <= MOST_PARTS or self.growth <= 0:
            raise ParameterError(
                f"a slowly varying input gain needs 1 to {MOST_PARTS} parts and a positive growth. Received "
                f"{self.parts} parts and the growth {shortly(self.growth)} 1/s."
            )

    def models(self, task: FaultPlant) -> tuple[NominalModel, ...]:
        """Nominal model of every part.

        Raises
        ------
        ParameterError
            For friction that depends on the slip rate, whose coefficient may jump.
        """
        if task.friction.rate_slope:
            raise ParameterError(
                "a slowly varying input gain needs friction that depends on the slip alone. Received friction with "
                f"rate_slope {shortly(task.friction.rate_slope)} s/m. Omit the slowly varying input gain."
            )
        half = self._half(task)
        middles = (task.beta[0] + (2 * number + 1) * half for number in range(self.parts))
        return tuple(replace(task.model, gain=middle * task.authority) for middle in middles)

    def spread(self, task: FaultPlant, slip_error: Fraction) -> GainSpread:
        """Deviation of the input gain while the slip error stays below a bound [m]."""
        law = task.friction
        slope = max(law.weakening, law.strengthening) * task.area_per_mass[1] / task.authority
        return GainSpread(
            present=self._half(task) + 2 * slope * slip_error,
            past=slope * task.reference_rates[0] * _ONE_OVER_E / self.growth,
        )

    def _half(self, task: FaultPlant) -> Fraction:
        return (task.beta[1] - task.beta[0]) / (2 * self.parts)


def varying_gain_norms(loops: Iterable[PeriodicLoop], growth: Fraction) -> Gains:
    """Gains of the nominal loops of all parts, concatenated, including those of ``aged``.

    Raises
    ------
    ParameterError
        When one of the loops, with its flow matrix or with α added to the diagonal, is not proved to be stable.
    """
    of_parts = [norms(loop) | norms(grown(loop, growth)) for loop in loops]
    return {key: tuple(chain.from_iterable(gains[key] for gains in of_parts)) for key in of_parts[0]}


def grown(loop: PeriodicLoop, growth: Fraction) -> PeriodicLoop:
    """Loop whose responses to the acceleration are multiplied by e^{ασ}."""
    flow = tuple(tuple(v + growth * (i == j) for j, v in enumerate(row)) for i, row in enumerate(loop.flow))
    entry = {"aged": loop.inputs["acceleration"]}
    return replace(loop, flow=flow, inputs=entry, sampled={}, fading={}, pulses={}, feedthrough={}, start=())


# ----------------------------------------------------------------------
# Sector bounds of the solution of an implicit step for bounded errors, in ball arithmetic.
#
# **Statement.** Let w solve 0 ∈ w − e2 + q(e1 + T_s·w, w). For |e1| ≤ E, |e2| ≤ R and u = e1/T_s ≥ 0: −γ1·u − ε ≤ w ≤
# −γ0·u + ε. The mirrored bounds hold where e1 ≤ 0.
#
# **Proof.** F(w) = w − e2 + q is strongly monotone, so w ≤ ω wherever F(ω) contains a non-negative number. For e2 ≤ R
# and 0 ≤ u ≤ E/T_s take ω = ε − γ0·u, where e1 + T_s·ω = T_s(ε + (1 − γ0)u). As q is odd, the lower bound for e1 is
# minus the upper bound for −e1, where ω = ε + γ1·u and −e1 + T_s·ω = T_s(ε − (1 − γ1)u). On a part of the range of u
# both arguments of q are at least the smaller of their values at its ends, and q is non-decreasing, with ⌈0⌋⁰ taken as
# 1. Parts are halved until this shows ω − R + q ≥ 0 on each, or until they are too small. ∎

Range = tuple[Fraction, Fraction]

_BITS = 128
_SECTOR_HALVINGS = 10


def sector_is_valid(implicit_step: ImplicitStep, step: Fraction, slip: Fraction, rate: Fraction) -> bool:
    """Whether the sector encloses the solution for |e1| ≤ slip [m] and |e2| ≤ rate [m/s]."""
    last = slip / step
    low, high = implicit_step.slopes
    with ctx.workprec(_BITS):
        return all(
            _above(implicit_step, step, rate, (away, along), (Fraction(0), last), _SECTOR_HALVINGS)
            for away, along in ((1 - low, -low), (high - 1, high))
        )


def _above(
    implicit_step: ImplicitStep, step: Fraction, rate: Fraction, slopes: Range, part: Range, halvings: int
) -> bool:
    """Whether a line is shown to lie above the solution on a part of the range of u."""
    ahead, end = (implicit_step.remainder + min(slope * u for u in part) for slope in slopes)
    if _least(implicit_step.pull, _below(step * ahead), _below(end)) + ball(end - rate) >= 0:
        return True
    middle = (part[0] + part[1]) / 2
    return halvings > 0 and all(
        _above(implicit_step, step, rate, slopes, half, halvings - 1) for half in ((part[0], middle), (middle, part[1]))
    )


def _least(terms: tuple[Power, ...], slip: Any, rate: Any) -> Any:
    """Lower bound of q for arguments at or above given ones, in ball arithmetic."""
    total = arb(0)
    for term in terms:
        inner = {"slip": slip, "rate": rate}
        value = inner[term.argument] if isinstance(term.argument, str) else _least(term.argument, slip, rate)
        size = abs(value).root(term.exponent.denominator) if value != 0 else value
        total += (
            ball(term.factor[0]) * size**term.exponent.numerator
            if value >= 0
            else -(ball(term.factor[1]) * size**term.exponent.numerator)
        )
    return total.lower()


def _below(value: Fraction) -> Any:
    return ball(value).lower()
