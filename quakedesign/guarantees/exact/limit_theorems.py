"""Performance limits of every controller: theorems, evaluated in ball arithmetic.

Theorem 1 bounds the smallest peak error at a given sampling period. Theorem 2 gives the longest reaction and diffusion
times, and the smallest withdrawal, with which a controller may stabilise the fault. The first chapter treats the
linearised rate-and-state fault in slow sliding, the second a fault with slip or slip-rate dependent friction.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from math import ceil, sqrt
from typing import TypedDict

from flint import arb, arb_mat, ctx

from quakedesign.errors import ParameterError
from quakedesign.exact import LowerBound, UpperBound, end_of
from quakedesign.guarantees.exact.norms import ball, upper
from quakedesign.loop import SlidingModel
from quakedesign.plant.fault_plant import FaultPlant

# ----------------------------------------------------------------------
# Performance limits of every controller for the linearised fault in slow sliding: two theorems, in ball arithmetic.
#
# The plant is the nominal one, linearised about sliding at V and the pressure 0, without inertia (`SlidingModel` with c
# = c_z = 1): slip error x, y = ln(v/V), z = ln(θ/θ_ss), pressure error q = p − p*, any measurable shear stress |d| ≤ D;
# x(0) = z(0) = 0 and
#
#     x′ = Vy,   z′ = −ρ(y + z),   Sy = −Kx − Wz + μq + d.
#
# The controller is arbitrary: linear or not, with memory, with exact knowledge of plant, errors and stress up to the
# sample.
#
# **Theorem 1 (surprise).** If pressures are decided at samples T apart, no controller keeps |y| below D·h(t) for any 0
# ≤ t < T, h the response of y to a unit step of d with q = 0: h(0) = 1/S. *Proof.* Compare d = D for all t with a d
# that changes to −D just after a sample. All decisions up to this sample are the same, so q is the same until the next
# one. At t after the change both solutions y differ by 2D·h(t), and one of them is at least D·h(t) in size. ∎ By
# continuity t = T is included.
#
# **Theorem 2 (limited pressure).** Let λ > 0 be an eigenvalue without control, G the transfer function of the path from
# well to fault, whose impulse response is not negative, and q the path's response to the well pressure u, |u| ≤ P. If a
# stress d = D begins while x = z = u = 0 and u remains 0 until T later, no controller keeps x and z bounded if D·e^{λT}
# > μP·G(λ). *Proof.* The plant is controllable from y, so a left eigenvector w can be scaled to give ζ = w·(x, z) with
# ζ′ = λζ + μq + d. Let η be ζ plus the future effect of u up to now: η′ = λη + μG(λ)u + D, η(0) = 0. Until T η grows to
# D(e^{λT} − 1)/λ, and then η′ ≥ λη + D − μG(λ)P > 0 at all later t: η grows exponentially. Its difference from ζ is
# bounded. ∎

_BITS = 128
_ZERO, _ONE = Fraction(0), Fraction(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class DisturbedSliding:
    """A linearised fault in slow sliding and its stress disturbance.

    Attributes
    ----------
    model : SlidingModel
        With c = c_z = 1.
    amplitude : Fraction
        D [Pa], positive.
    """

    model: SlidingModel
    amplitude: Fraction

    @property
    def authority(self) -> Fraction:
        """μ [-], the ratio of the input gains of pressure and stress."""
        return self.model.coefficient

    @property
    def _ratios(self) -> tuple[Fraction, Fraction]:
        """κ = KV/(ρS) and β = W/S."""
        model = self.model
        return model.stiffness * model.rate / (model.state_rate * model.strength), model.weakening / model.strength

    @property
    def grows(self) -> bool:
        """Whether a real λ > 0 exists; the values of λ/ρ are the roots of s² + (1 + κ − β)s + κ."""
        kappa, beta = self._ratios
        return beta > 1 + kappa and (beta - 1 - kappa) ** 2 >= 4 * kappa

    @property
    def pole(self) -> arb:
        """The largest λ [1/s]."""
        kappa, beta = self._ratios
        trace = beta - 1 - kappa
        return ball(self.model.state_rate) * (ball(trace) + ball(trace**2 - 4 * kappa).sqrt()) / 2

    def smallest_rate_error(self, step: Fraction) -> LowerBound:
        """V·D·h [m/s] of theorem 1 for samples a step [s] apart, with the larger of h(0) and h(T)."""
        kappa, beta = self._ratios
        flow = ((-kappa, -beta, _ONE), (kappa, beta - 1, -_ONE), (_ZERO, _ZERO, _ZERO))
        with ctx.workprec(_BITS):
            time = ball(step * self.model.state_rate)
            moved = (arb_mat([[ball(v) * time for v in row] for row in flow])).exp()
            late = 1 - ball(kappa) * moved[0, 2] - ball(beta) * moved[1, 2]
            share = max(_ONE, end_of(late.lower()))
        return LowerBound(self.model.rate * self.amplitude / self.model.strength * share)


# ----------------------------------------------------------------------
# Performance limits of every controller for a fault: three theorems, evaluated in ball arithmetic.
#
# A claim about all frictions and parameters of the box fails if it fails for one of them, so each theorem takes the
# worst of a few plants. A plant has κ = k̂ − φ1 and w = η̂ − φ2, φ1 and φ2 the slopes of the disturbance in slip and
# slip rate, and φ is any measurable function of time with |φ| ≤ H. The controller is arbitrary: linear or not, with
# memory, with exact knowledge of plant, slip, slip rate and disturbance up to the sample. With noise in theorem 1 it
# knows the plant, and measures slip and slip rate at all times up to the sample within n and n′ of the true ones;
# either may be missing (n = ∞). X and P below are the largest slip-rate error and the largest withdrawal.
#
# **Theorem 1 (surprise).** Let the pressure be decided at samples T apart, act θ later and stay for T. On the plant
# without stick no controller keeps the slip error within E and the slip-rate error below X for all t if
#
#     X ≤ 2H·h(T + θ + τ),   h: impulse response of h″ = σh − wh′ from acceleration to slip,
#
# where τ is a time for which noise hides a change of sign of the disturbance: H·h₊(t) ≤ n′ and H·∫₀ᵗ h₊ ≤ n for 0 ≤ t ≤
# τ, h₊ as h with σ₊; τ = 0 without noise. Once the reference r rests, friction that is affine there, μ(r + e1) = μr −
# m·e1 for |e1| ≤ E, gives with q = p − p*
#
#     e1′ = e2,   e2′ = s·e1 − w·e2 + N̂(μr − m·e1)q + φ,   s = N̂m(σ′ − p*) − κ,
#     σ = s − m(2X/T + sE + |w|X)/(μr − mE),   σ₊ = s + m(2X/T + sE + |w|X + H)/(μr − mE),
#
# and σ must not be negative. Constant friction, m = 0, gives σ = σ₊ = s = −κ, and E may be any bound. *Proof.* Suppose
# |e1| ≤ E, |e2| ≤ X′ < X for every φ and every noise. Take φ = H once r rests. While p is constant, y = e2 obeys y″ =
# σ_k·y − w·y′ with σ_k = s − N̂mq_k. The integral of e2′ over the interval T of q_k bounds q_k: −(2X′/T + sE + |w|X′ +
# H) ≤ N̂q_k(μr − mE) ≤ 2X′/T + sE + |w|X′, so σ ≤ σ_k ≤ σ₊. Suppose y ≥ δ > 0 at all changes of p from some time on.
# Between them y is above the solution for σ₊ with δ at both ends (maximum principle, or for σ < 0 since κT² ≤ 1 < π²),
# so each T adds at least a fixed part of δ to e1, and e1 exceeds E. So for every δ there are arbitrarily late changes
# of p, at t + θ + T with t a sample, with e2 < δ. Change φ to −H at t − τ. While p is the same in both solutions, their
# difference d has d2′ = σ(t)d1 − w·d2 + 2H with σ ≤ σ(t) ≤ σ₊, so d1 and d2 are at least 0 and at most those for σ₊: up
# to t at most 2n and 2n′. Let the measurements always be n and n′ too low in the first solution, and their errors
# higher by d in the second. These are within n and n′ too, and up to t the measurements of both agree, which determines
# p until t + θ + T. By then d2 ≥ 2H·h(τ + θ + T) ≥ X, and the second solution has e2 < δ − X, for every δ > 0. ∎ A hold
# over T is also a hold over T/j for every integer j, and a controller with a shorter delay can imitate one with the
# delay θ; so T and θ may be shortened, and τ as well.
#
# **Theorem 2 (withdrawal).** Let a fault rest at p = 0 when a disturbance φ = H begins. Let the well pressure be 0
# until T later, then at least −P; let G be the transfer function from well to fault of a path whose impulse response is
# not negative: delay, diffusion 1/cosh √(sL²/D). Friction that falls from μ* by m per slip gives s = N̂mσ′ − κ and, for
# s > 0, the unstable pole λ, λ² + wλ = s. If
#
#     H·e^{λT} > N̂μ*·P·G(λ),
#
# then slip exceeds E = (μ* − μ_res)/m, where friction has its residual value, under every controller, even if it knows
# φ and the plant from the onset; also on the stick–slip plant. *Proof.* For 0 ≤ x1 ≤ E: x2′ ≥ s·x1 − w·x2 + N̂(μ* −
# m·x1)p_f + H, an equality unless the fault is at rest. The third term is at least c·min(p_f, 0), c = N̂μ*, and
# min(p_f, 0) is at least v, the path's response to u = min(p, 0). So z = (λ + w)x1 + x2 ≥ z0, z0′ = λz0 + cv + H, z0(0)
# = 0. Let ζ be z0 plus the future effect of u up to now, which is not positive: z ≥ ζ, and ζ′ = λζ + cG(λ)u + H. Until
# T ζ grows to H(e^{λT} − 1)/λ, and then ζ′ ≥ λζ + H − cG(λ)P > 0 at all later t: ζ grows exponentially. x1′ = z − (λ +
# w)x1 with z ≥ ζ > 0 keeps x1 positive, so the premise x1 ≥ 0 remains true, and x1 exceeds E. ∎
#
# **Theorem 3 (stick–slip plant).** Let a fault rest at slip 0 and p = 0, held by friction, and never slip backward. Let
# the pressure be decided at samples T apart and stay for T. With constant friction and κT² ≤ 1, no controller that
# moves the fault keeps its slip rate below 2H·h(T) for every φ, with the h of theorem 1 for σ = −κ. *Proof.* Let φ = −H
# always. While the fault rests, the force on it changes with the pressure alone, so it first moves in a period of some
# pressure p with N̂μ*p ≥ H. Change φ to H when that pressure begins to act. Until then both solutions agree, so p is
# the same, and it stays for T. The fault starts from rest with the force N̂μ*p + H ≥ 2H, and y = x2 has y′ = N̂μ*p + H
# − κx1 − wy, whose solution is this force times h and positive up to T. ∎ So theorem 3 takes the place of theorem 1
# where slip rates cannot be negative: on a moving reference every controller has to move the fault. While the reference
# rests there is no such limit: at low enough pressure friction holds the fault at rest.

_SHARE = Fraction(1, 20)  # E of theorem 1 over the smaller of weakening slip and target slip
_BISECTIONS = 14
_SHARES = [Fraction(3, 4) ** n for n in range(16)]  # shares of τ, tried until X decreases
_GROWN, _TURNED = 32, 1  # largest T·√|s| used in theorem 1, for s above and below 0
_IMPOSSIBILITY_ZERO = Fraction(0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SmallestPeak:
    """Lower bound X of the slip-rate error under every controller that keeps the slip error within E.

    Attributes
    ----------
    slip_rate_error : LowerBound
        X [m/s].
    slip_error : UpperBound or None
        E [m]; None if X applies to every bounded slip error.
    """

    slip_rate_error: LowerBound
    slip_error: UpperBound | None


class Noise(TypedDict):
    """Bounds n [m] and n′ [m/s] of theorem 1; None for a slip rate that is not measured."""

    slip_noise: Fraction
    rate_noise: Fraction | None


@dataclass(frozen=True, slots=True)
class _ReversalPlant:
    """A plant of theorem 1: s [1/s²], w [1/s], m [1/m], the least friction near r [-], E [m]."""

    slip: Fraction
    rate: Fraction
    weakening: Fraction
    friction: Fraction
    excess: Fraction | None


@dataclass(frozen=True, slots=True)
class _Measurements:
    """Bounds n [m] and n′ [m/s] of the measurement noise; None for an unmeasured slip rate."""

    slip_noise: Fraction
    rate_noise: Fraction | None

    @property
    def noisy(self) -> bool:
        """Whether noise can hide a disturbance."""
        return bool(self.slip_noise) and self.rate_noise != 0

    def hides(self, slip: Fraction, rate: Fraction, disturbance: Fraction, step: Fraction) -> Fraction:
        """τ [s]: time for which noise hides a reversed disturbance.

        Exact up to a small part of T, for a disturbance `disturbance` [m/s²], σ₊ = `slip` and w = `rate`.

        A larger σ₊ gives a shorter τ. Responses with σ₊ ≥ 0 only grow, so it suffices to check their ends.
        """
        if not disturbance or not self.noisy:
            return _IMPOSSIBILITY_ZERO

        def hidden(time: Fraction) -> bool:
            responses = zip(
                _moved(max(slip, _IMPOSSIBILITY_ZERO), rate, time), (self.slip_noise, self.rate_noise), strict=True
            )
            return all(
                noise is None or bool(ball(disturbance) * response <= ball(noise)) for response, noise in responses
            )

        low, high = _IMPOSSIBILITY_ZERO, step
        while hidden(high):
            low, high = high, 2 * high
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            low, high = (middle, high) if hidden(middle) else (low, middle)
        return low


@dataclass(frozen=True, slots=True)
class _DisturbedPlant:
    """A plant of theorem 2: s [1/s²], w [1/s], N̂μ* [m²/kg]."""

    slip: Fraction
    rate: Fraction
    authority: Fraction

    @property
    def pole(self) -> arb:
        """λ [1/s], in a form without cancellation where damping is large."""
        w, twice = ball(self.rate), 2 * ball(self.slip)
        root = (w * w + 2 * twice).sqrt()
        return twice / (root + w) if self.rate > 0 else (root - w) / 2


def smallest_peak(
    task: FaultPlant,
    step: Fraction,
    delay: Fraction = _IMPOSSIBILITY_ZERO,
    *,
    slip_noise: Fraction = _IMPOSSIBILITY_ZERO,
    rate_noise: Fraction | None = _IMPOSSIBILITY_ZERO,
) -> SmallestPeak | None:
    """Theorem 1; None without a disturbance.

    Parameters
    ----------
    task : FaultPlant
    step, delay : Fraction
        T, positive, and θ [s].
    slip_noise, rate_noise : Fraction
        n [m] and n′ [m/s]; None for a slip rate that is not measured.

    Raises
    ------
    ParameterError
        For times or noise that are negative, or a step of 0.
    """
    _require(step > 0 and delay >= 0, "a step above 0 and a delay of at least 0", step, delay)
    noise = (slip_noise, *([] if rate_noise is None else [rate_noise]))
    _require(min(noise) >= 0, "bounds of noise of at least 0", *noise)
    measurements = _Measurements(slip_noise, rate_noise)
    with ctx.workprec(_BITS):
        peaks = [
            SmallestPeak(
                slip_rate_error=LowerBound(_surprise(plant, step, delay, measurements, task.amplitude)),
                slip_error=None if plant.excess is None else UpperBound(plant.excess),
            )
            for plant in _surprised(task)
        ]
    best = max(peaks, key=lambda one: one.slip_rate_error)
    return best if best.slip_rate_error > 0 else None


def smallest_stick_slip_rate(task: FaultPlant, step: Fraction) -> LowerBound | None:
    """Theorem 3: slip rate [m/s] under every controller; None without a disturbance.

    Parameters
    ----------
    task : FaultPlant
    step : Fraction
        T, positive [s].
    """
    _require(step > 0, "a step above 0", step)
    plants = [
        _ReversalPlant(-kappa, w, _IMPOSSIBILITY_ZERO, task.friction.static, None) for kappa, w, _ in _corners(task)
    ]
    with ctx.workprec(_BITS):
        measurements = _Measurements(_IMPOSSIBILITY_ZERO, _IMPOSSIBILITY_ZERO)
        peak = max(_surprise(plant, step, _IMPOSSIBILITY_ZERO, measurements, task.amplitude) for plant in plants)
    return LowerBound(peak) if peak > 0 else None


def longest_reaction(task: FaultPlant | DisturbedSliding, withdrawal: Fraction) -> UpperBound | None:
    """T + θ [s] beyond which every controller fails, without a diffusion path; None without a limit.

    `withdrawal` is P [Pa].
    """
    _require(withdrawal >= 0, "a withdrawal of at least 0", withdrawal)

    def longest(plant: _DisturbedPlant | DisturbedSliding) -> arb:
        ratio = ball(plant.authority * withdrawal / task.amplitude)
        return _at_least_one(ratio).log() / plant.pole

    return _least(task, longest)


def longest_diffusion(task: FaultPlant | DisturbedSliding, withdrawal: Fraction, step: Fraction) -> UpperBound | None:
    """L²/D [s] beyond which every controller with samples T apart fails; None without a limit.

    `withdrawal` is P [Pa], `step` is T [s].
    """
    _require(withdrawal >= 0 and step >= 0, "a withdrawal and a step of at least 0", withdrawal, step)

    def longest(plant: _DisturbedPlant | DisturbedSliding) -> arb:
        pole = plant.pole
        ratio = ball(plant.authority * withdrawal / task.amplitude) * (-pole * ball(step)).exp()
        return _at_least_one(ratio).acosh() ** 2 / pole

    return _least(task, longest)


def farthest_well(diffusion_time: UpperBound, diffusivity: Fraction) -> UpperBound:
    """L [m] of a diffusion time L²/D [s] at a diffusivity D [m²/s]."""
    _require(diffusivity > 0, "a diffusivity above 0", diffusivity)
    with ctx.workprec(_BITS):
        return UpperBound(upper(ball(diffusion_time * diffusivity).sqrt()))


def nearest_proved_well(diffusion_time: LowerBound, diffusivity: Fraction) -> LowerBound:
    """L [m] of a proved diffusion time L²/D [s], at a diffusivity D [m²/s]."""
    _require(diffusivity > 0, "a diffusivity above 0", diffusivity)
    with ctx.workprec(_BITS):
        return LowerBound(end_of(ball(diffusion_time * diffusivity).sqrt().lower()))


def smallest_withdrawal(task: FaultPlant | DisturbedSliding, step: Fraction) -> LowerBound | None:
    """P [Pa] below which every controller with samples T = `step` [s] apart fails; None without a limit."""
    _require(step >= 0, "a step of at least 0", step)
    with ctx.workprec(_BITS):
        needed = (ball(task.amplitude / plant.authority) * (plant.pole * ball(step)).exp() for plant in _pushed(task))
        withdrawals = [end_of(one.lower()) for one in needed]
    return LowerBound(max(withdrawals)) if withdrawals else None


def too_slow(task: FaultPlant, withdrawal: Fraction, step: Fraction, delay: Fraction) -> str:
    """Reason why T_s and delay are infeasible for every controller; else empty. SI units."""
    late = longest_reaction(task, withdrawal) if task.change is None else None
    if late is None or step + delay <= late:
        return ""
    most = LowerBound(withdrawal).quantity("Pa")
    how = f"with T_s + delay above {late.quantity('s')}"
    return f"no controller that withdraws at most {most} can hold the fault {how}{_ASSUMED}"


def infeasibility(task: FaultPlant, withdrawal: Fraction, delay: Fraction, diffusion: Fraction) -> str:
    """Reason why the path is infeasible for every controller and every T_s; else empty.

    Parameters
    ----------
    task : FaultPlant
    withdrawal : Fraction
        [Pa].
    delay, diffusion : Fraction
        θ and L²/D [s].
    """
    late, far = longest_reaction(task, withdrawal), longest_diffusion(task, withdrawal, _IMPOSSIBILITY_ZERO)
    if task.change is None and late is not None and delay > late:
        way = f"with a delay above {late.quantity('s')}"
    elif task.change is None and far is not None and diffusion > far:
        way = f"through a diffusion path of L^2/D above {far.quantity('s')}"
    else:
        return ""
    most = LowerBound(withdrawal).quantity("Pa")
    return f"no controller that withdraws at most {most} can hold the fault {way}, for any T_s{_ASSUMED}"


_ASSUMED = (
    " (for some friction of the box, under the largest disturbance, constant from some instant on, even if the "
    "controller knows both)"
)


def _least(
    task: FaultPlant | DisturbedSliding, value: Callable[[_DisturbedPlant | DisturbedSliding], arb]
) -> UpperBound | None:
    with ctx.workprec(_BITS):
        bounds = [upper(value(plant)) for plant in _pushed(task)]
    return UpperBound(min(bounds)) if bounds else None


def _corners(task: FaultPlant) -> Iterator[tuple[Fraction, Fraction, Fraction]]:
    """κ, w and N̂ at the ends of their ranges."""
    ranges = (dict.fromkeys(ends) for ends in (task.stiffness, task.specific_damping, task.area_per_mass))
    for k, eta, area in product(*ranges):
        yield k - task.growths[0], eta - task.growths[1], area


def _pushed(task: FaultPlant | DisturbedSliding) -> Sequence[_DisturbedPlant | DisturbedSliding]:
    """Plants of theorem 2, of a fault or of slow sliding."""
    if isinstance(task, DisturbedSliding):
        return [task] if task.grows else []
    law = task.friction
    plants = [
        _DisturbedPlant(area * law.weakening * task.normal_stress - kappa, w, area * law.static)
        for kappa, w, area in _corners(task)
    ]
    return [plant for plant in plants if plant.slip > 0 and law.static > law.least and task.amplitude]


def _surprised(task: FaultPlant) -> Iterator[_ReversalPlant]:
    """Plants with constant friction near the target, and with friction of the largest weakening slope."""
    law, target = task.friction, task.target_slip
    for kappa, w, area in _corners(task):
        yield _ReversalPlant(-kappa, w, _IMPOSSIBILITY_ZERO, law.static, None)
        if law.static > law.least and law.weakening:
            extent = _SHARE * min((law.static - law.least) / law.weakening, target)
            middle = max(law.least + law.weakening * extent, law.static - law.weakening * target)
            stress = (law.static * task.normal_stress - kappa / area * target) / middle
            slip = area * law.weakening * stress - kappa
            yield _ReversalPlant(slip, w, law.weakening, middle - law.weakening * extent, extent)


def _surprise(
    plant: _ReversalPlant, step: Fraction, delay: Fraction, measurements: _Measurements, amplitude: Fraction
) -> Fraction:
    """X, or 0 where the theorem gives no bound."""
    pace = sqrt(abs(plant.slip))
    most = _GROWN if plant.slip > 0 else _TURNED
    interval = step / max(1, ceil(float(step) * pace / most))

    def shortened(time: Fraction) -> Fraction:
        return time if float(time) * pace <= most else Fraction(most / pace)

    def hidden(slip: Fraction) -> Fraction:
        return shortened(measurements.hides(slip, plant.rate, amplitude, step))

    def bound(slip: Fraction, unseen: Fraction) -> arb:
        return 2 * ball(amplitude) * _moved(slip, plant.rate, interval + shortened(delay) + unseen)[1]

    extent = plant.excess or _IMPOSSIBILITY_ZERO

    def slope_change(peak: Fraction, more: Fraction = _IMPOSSIBILITY_ZERO) -> Fraction:
        """Change of σ [1/s²] by the slope of friction under the pressure force."""
        force = 2 * peak / interval + plant.slip * extent + abs(plant.rate) * peak + more
        return plant.weakening * force / plant.friction

    def largest(share: Fraction) -> Fraction:
        unseen = share * hidden(plant.slip)
        if not plant.weakening:
            return end_of(bound(plant.slip, unseen).lower())
        low, high = _IMPOSSIBILITY_ZERO, upper(bound(plant.slip, unseen))
        unseen = min(unseen, hidden(plant.slip + slope_change(high, amplitude)))
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            slip = plant.slip - slope_change(middle)
            reached = slip >= 0 and bool(bound(slip, unseen) >= ball(middle))
            low, high = (middle, high) if reached else (low, middle)
        return low

    best = _IMPOSSIBILITY_ZERO
    for share in _SHARES if measurements.noisy else _SHARES[:1]:
        if (error := largest(share)) <= best:
            break
        best = error
    return best


def _moved(slip: Fraction, rate: Fraction, time: Fraction) -> tuple[arb, arb]:
    """Slip and slip rate from rest after a unit acceleration for some time."""
    flow = arb_mat([[arb(0), arb(1), arb(0)], [ball(slip), -ball(rate), arb(1)], [arb(0), arb(0), arb(0)]])
    moved = (flow * ball(time)).exp()
    return moved[0, 2], moved[1, 2]


def _require(condition: bool, what: str, *values: Fraction) -> None:
    if not condition:
        received = ", ".join(f"{float(v):.4g}" for v in values)
        raise ParameterError(f"a performance limit needs {what}. Received {received}.")


def _at_least_one(value: arb) -> arb:
    """Larger of the upper end of a ball and 1."""
    return value.upper().max(arb(1))
