"""Robust small-gain theorem for slow sliding with rate-and-state friction: v ≤ Ve^Y.

**Plant.** Per unit of area, with v = Ve^y, θ = (D/V)e^z, the slip error x, the pressure error q = p − p*, N = σ′ − p
and a shear stress disturbance s, |s| ≤ S,


    mVe^y·y′ = s − ŝ,    ŝ = N(ay + bz) + HV(e^y − 1) + Kx − μ*q,    x′ = V(f − ω),    z′ = −ρ(f + g),

f = e^y − 1, g = 1 − e^{−z}, ρ = V/D. The first equation is the force balance minus that of steady sliding, Nμ* + HV +
Kr; the last equation is the ageing law. The slip law has z′ = −ρe^y(y + z) instead. All variables are initially 0; a,
b, D, μ* and σ′ are constants. The slip error is relative to a reference r with r′ = V(1 + ω), |ω| ≤ W < 1 with any time
history, r = Vt for W = 0. r rises from 0 to the distance, and p* = Kr/μ*, so that |p*′| ≤ KV(1 + W)/μ*. Rate and state
remain relative to V and D/V: V does not follow r′.

**Regularised friction** exceeds a·ln(2s), 2s = 2sinh(μ*/a)·e^{y + bz/a}, by at most a/(4s²), as arsinh s = ln(2s) +
ln((1 + √(1 + 1/s²))/2). With m = μ* − aY − bZ, 2m/a ≥ 1, this is below 4a·e^{−2m/a} =: ε, as (1 − e^{−2μ*/a})^{−2} < 4.
So it equals logarithmic friction under a shear stress that is larger by at most N_max·ε, far below 1 Pa.

**Inertia.** Let |y| ≤ Y, |z| ≤ Z, |q| ≤ Q so far. Then ŝ′ = λ(s − ŝ) + κ with λ = (Na + HVe^y)/(mVe^y) ≥ λ₀ =
N_min·a/(mVe^Y) and κ = N′(ay + bz) + Nbz′ + Kx′ − μ*q′. Where |ŝ| > S + sup|κ|/λ₀ it decreases, so |ŝ| ≤ S + sup|κ|/λ₀:
the fault with mass is one without mass (ŝ in place of s) under a stress that is larger by sup|κ|/λ₀, a few Pa. In κ,
|N′| ≤ KV(1 + W)/μ* + |q′|, |z′| ≤ ζ with ζ the larger of ρ(e^Y − e^{−Z}) and ρ(e^Z − e^{−Y}), or ρe^Y(Y + Z) for the
slip law, and |x′| ≤ V(e^Y − 1 + W). The well pressure minus the plan, u, acts on the fault through filters 1/(1 +
s/λ_n), one of which has the rate λ. So q′ = λ(i − w) − Δ′ with i the input and w the output of that filter, Δ = p* −
plan, |Δ′| ≤ d. Filters are weighted means of the past, with a total mean delay E. So |u − Δ| ≤ U gives |i − Δ| ≤ U + dE
and, as |w − Δ| = |q| ≤ Q, |q′| ≤ λ(U + dE + Q) + d. A diffusion path has λ = π²/(4τ) < 5/(2τ) and E = τ/2, and E = τ/2
+ ℓ with a lag ℓ before it; a lag alone has λ = 1/ℓ, E = ℓ.

**Sectors.** For |y| ≤ Y, f/y lies between (1 − e^{−Y})/Y and (e^Y − 1)/Y, with midpoint c and half-width δ. For |z| ≤
Z, g/z lies between the same bounds with Z, with midpoint c_z and half-width δ_z. With the midpoints N₀, a₀, b₀, μ₀, ρ₀
of the ranges of a cell the loop of `sliding_loop` has the inputs

    e = ŝ − (N − N₀)(ay + bz) − N₀((a − a₀)y + (b − b₀)z) − HV(f − cy) + (μ* − μ₀)q,    φ = f − cy,
    h = (ρ/ρ₀ − 1)(cy + c_z·z + φ) + (ρ/ρ₀)(g − c_z·z),

so |e| ≤ sup|ŝ| + δN|a₀y + b₀z| + N_max(δa|y| + δb|z|) + HVδ|y| + δμ|q|, |φ| ≤ δ|y| and, with χ = sup|ρ/ρ₀ − 1|, |h| ≤
χ|cy + c_z·z| + χδ|y| + (1 + χ)δ_z|z|. For the slip law (ρ/ρ₀)e^y lies between (1 − χ)e^{−Y} and (1 + χ)e^Y, with
midpoint c_z and half-width δ_z. Then z′ = −ρ₀c_z(y + z) − ρ₀h does not contain φ, and |h| ≤ δ_z|y + z|. ω is another
input. Noise of the measured slip, drift of p* from the plan and the truncation error R of the diffusion modes are
inputs as in `small_gain`. q is that of the loop plus R. y and its combinations with z include the direct feedthrough of
e and μ₀R, where R is bounded by its weight at the beginning of each part of the period.

**After a step.** R is largest immediately after a step, before the fault responds to the step. With the midpoint N₀a₀ +
HVc = B, By = X + e and |X′| ≤ KV(e^Y − 1 + W) + N₀b₀ζ + μ₀q̇, |z′| ≤ ζ, |q′| ≤ q̇ as above. So until θ after a step, αy
+ βz is at most its value before the step, with the feedthrough of the present e, plus θ(α|X′|/B + βζ). In the parts of
the period that begin before R has decayed to a sixteenth, y, ay + bz and cy + c_z·z have the gains of the part that
ends with the step. Their bounds are larger by the above constant, with θ the beginning of the first other part.

**Conclusion.** Let the bounds that follow for |y|, |z|, |q| and |u − Δ| lie below Y, Z, Q and U. y, z and q are
continuous and initially 0, and u is determined by samples before it acts. So none of them ever reaches its claim: until
then it would have obeyed the smaller bound. The slip rate never exceeds Ve^Y, on every cell. ∎
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from itertools import accumulate
from typing import Any

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.exact import UpperBound, shortly
from quakedesign.guarantees.exact.norms import norms
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.exact.sampled_loop import Channel, Gains, SampledLoop
from quakedesign.guarantees.exact.small_gain import channel_bounds
from quakedesign.loop import PeriodicLoop, SlidingModel, at_once, sliding_loop
from quakedesign.plant.sliding_plant import Range, SlidingPlant

_TERMS = 24  # of Taylor's series
_LARGEST = 3  # largest logarithm of a ratio in slow sliding
_FADED = Fraction(1, 16)
_AT_ONCE = ("log_rate", "ageing", "strength")
_ZERO, _ONE = Fraction(0), Fraction(1)


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class SlidingClaims:
    """Claimed bounds of absolute values, while the reference moves over the distance of the plant.

    Attributes
    ----------
    log_rate, log_state : UpperBound
        Y and Z: logarithms of v/V and of θ over D/V [-].
    slip_error : UpperBound
        [m].
    push : UpperBound
        Q: pressure in the fault minus p* [Pa].
    asked : UpperBound
        U: pressure at the valve minus p* [Pa].

    Raises
    ------
    ParameterError
        For bounds that are not positive, or logarithms above 3.
    """

    log_rate: UpperBound
    log_state: UpperBound
    slip_error: UpperBound
    push: UpperBound
    asked: UpperBound

    def __post_init__(self) -> None:
        every = (self.log_rate, self.log_state, self.slip_error, self.push, self.asked)
        if min(every) <= 0 or max(self.log_rate, self.log_state) > _LARGEST:
            received = (f"{name} {shortly(v)}" for name, v in zip(self.__dataclass_fields__, every, strict=True))
            raise ParameterError(
                f"claims must be positive, log_rate and log_state at most {_LARGEST}. Received {', '.join(received)}."
            )


def cell_bounds(task: SlidingPlant, sampled_loop: SampledLoop, claims: SlidingClaims) -> dict[str, Any] | NoProof:
    """Bounds that follow from the claims on one cell, by name, with ``small_gain``.

    Raises
    ------
    ParameterError
        For a law without a steady state, or a pressure without lag and diffusion path.
    """
    model = model_of(task, claims)
    if model is None:
        return NoProof(reason=_left(task, claims))
    loop = loop_of(sampled_loop, model, task)
    try:
        gains = norms(loop)
    except ParameterError:
        return NoProof(reason="even the nominal loop is not stable, or decays too slowly")
    return bounds_from(task, sampled_loop, claims, loop, gains, after_a_step(loop))


def bounds_from(
    task: SlidingPlant,
    sampled_loop: SampledLoop,
    claims: SlidingClaims,
    loop: PeriodicLoop,
    gains: Gains,
    phases: Sequence[Fraction],
) -> dict[str, Any] | NoProof:
    """Bounds that follow from the gains of the loop; gains in floats give an estimate.

    `phases` are the times [s] since the last step at the well, at the start of every part of the period.
    """
    model = model_of(task, claims)
    if model is None:
        return NoProof(reason=_left(task, claims))
    late = settled(loop)
    more = _moved(task, sampled_loop, claims, model, late)
    gains = _once_settled(_with_what_adds_at_once(loop, model, gains, phases), phases, late)
    channels = [
        replace(one, constant=one.constant + sum((c * more.get(y, _ZERO) for y, c in one.coefficients.items()), _ZERO))
        for one in channels_of(task, sampled_loop, claims, loop)
    ]
    small_gain, bounds = channel_bounds(channels, gains)
    if bounds is None:
        whole = UpperBound(Fraction(small_gain))
        return NoProof(reason=f"small gain {whole:.3g}", small_gain=whole)
    return {
        "log_rate": bounds["log_rate"] + more["log_rate"],
        "log_state": bounds["log_state"],
        "slip_error": bounds["slip_error"],
        "push": bounds["push"] + bounds.get("left_out", _ZERO),
        "asked": bounds["asked"],
        "small_gain": small_gain,
    }


def follows(bounds: Mapping[str, Any], claims: SlidingClaims) -> bool:
    """Whether every bound lies below its claim."""
    return all(bounds[name] < getattr(claims, name) for name in SlidingClaims.__dataclass_fields__)


def loop_of(sampled_loop: SampledLoop, model: SlidingModel, task: SlidingPlant) -> PeriodicLoop:
    """Nominal loop; it has the inputs ``drift`` and ``reference`` only if their bounds are not 0.

    Raises
    ------
    ParameterError
        For a law that uses the slip rate, steps of the pressure in the fault, jitter or the rate limit of a pump.
    """
    if sampled_loop.instants is not None:
        raise ParameterError(
            "slow sliding has no guarantee with jitter, averaging or the rate limit of a pump. Received one of these. "
            "Omit jitter, averaging and the rate limit."
        )
    if not sampled_loop.law.of_slip_alone or not (sampled_loop.lag or sampled_loop.diffusion):
        raise ParameterError(
            "slow sliding has a guarantee for a law of the slip alone, with a diffusion path or a lag. Received "
            f"L^2/D = {shortly(sampled_loop.diffusion)} s and a lag of {shortly(sampled_loop.lag)} s"
            f"{'' if sampled_loop.law.of_slip_alone else ', for a law that uses the slip rate'}. Give diffusion or "
            "lag, and a law of the slip alone."
        )
    times = {"delay": sampled_loop.delay, "lag": sampled_loop.lag, "diffusion": sampled_loop.diffusion}
    loop = sliding_loop(sampled_loop.law, model, sampled_loop.step, **times, noisy=sampled_loop.noise)
    for name, size in _moving(task).items():
        if not size:
            del loop.inputs[name]
    return loop


def _moving(task: SlidingPlant) -> dict[str, Fraction]:
    """Bounds of the inputs that the reference causes, by name."""
    return {"drift": task.drift, "reference": task.swing}


def model_of(task: SlidingPlant, claims: SlidingClaims) -> SlidingModel | None:
    """Nominal model; None if the normal stress, or regularised friction, may come near 0."""
    low, high = task.normal_stress(claims.push)
    if low <= 0 or (task.regularised and _least_exponent(task, claims) < 1):
        return None
    a, b, mu = (_middle(task.ranges[name]) for name in ("direct_effect", "evolution_effect", "coefficient"))
    slope, state_slope = _middle(chords(claims.log_rate)), _middle(_state_slopes(task, claims))
    return SlidingModel(
        rate=task.rate,
        state_rate=_middle(_ageing(task)),
        slope=slope,
        state_slope=state_slope,
        strength=_middle((low, high)) * a + task.radiation * task.rate * slope,
        weakening=_middle((low, high)) * b,
        direct=a,
        evolution=b,
        stiffness=task.stiffness,
        coefficient=mu,
        state_law=task.state_law,
    )


def _left(task: SlidingPlant, claims: SlidingClaims) -> str:
    """Reason why there is no nominal model."""
    if task.normal_stress(claims.push)[0] <= 0:
        return "the pressure may open the fault"
    return "regularised friction may come near 0"


def channels_of(
    task: SlidingPlant, sampled_loop: SampledLoop, claims: SlidingClaims, loop: PeriodicLoop
) -> tuple[Channel, ...]:
    """Inputs of the loop with their bounds F + Σ c_y·|y|, see `Channel`."""
    low, high = task.normal_stress(claims.push)
    rates, states = chords(claims.log_rate), _state_slopes(task, claims)
    spread, bent = _ageing_spread(task), _half(rates)
    stress = {
        "strength": _half((low, high)),
        "log_rate": high * _half(task.ranges["direct_effect"]) + task.radiation * task.rate * bent,
        "log_state": high * _half(task.ranges["evolution_effect"]),
        "push": _half(task.ranges["coefficient"]),
    }
    left_out = {"left_out": stress["push"]} if "left_out" in loop.outputs else {}
    if left_out and not loop.fading:
        left_out["left_out"] += _middle(task.ranges["coefficient"])
    state = {"ageing": spread, "log_rate": spread * bent, "log_state": (1 + spread) * _half(states)}
    if task.state_law == "slip":
        state = {"ageing": _half(states) / _middle(states)}
    own = task.stress + inertia(task, sampled_loop, claims) + regularisation(task, claims)
    channels = [
        Channel(name="stress", constant=own, coefficients={**stress, **left_out}),
        Channel(name="rate", constant=_ZERO, coefficients={"log_rate": bent}),
        Channel(name="state", constant=_ZERO, coefficients=state),
    ]
    beside = {name: size for name, size in _moving(task).items() if size} | sampled_loop.noise
    channels += [Channel(name=name, constant=size, coefficients={}) for name, size in beside.items()]
    if loop.fading:
        channels.append(Channel(name="left_out", constant=_ZERO, coefficients={"left_out": _ONE}))
    return tuple(channels)


def inertia(task: SlidingPlant, sampled_loop: SampledLoop, claims: SlidingClaims) -> Fraction:
    """Stress equivalent of inertia, sup|κ|/λ₀ [Pa]."""
    low, high = task.normal_stress(claims.push)
    (a_low, a), (_, b), (_, mu) = (task.ranges[n] for n in ("direct_effect", "evolution_effect", "coefficient"))
    grown, moved = exponential(claims.log_rate), _pressure_rate(task, sampled_loop, claims)
    rest = (task.pressure_per_slip * task.fastest + moved) * (a * claims.log_rate + b * claims.log_state)
    rest += high * b * _state_rate(task, claims) + _spring_rate(task, claims) + mu * moved
    return rest * task.inertia * task.rate * grown / (low * a_low)


def regularisation(task: SlidingPlant, claims: SlidingClaims) -> Fraction:
    """Stress equivalent of the regularisation, N_max·ε [Pa]."""
    if not task.regularised:
        return _ZERO
    a = task.ranges["direct_effect"][1]
    return task.normal_stress(claims.push)[1] * 4 * a / _partial(_least_exponent(task, claims))


def _least_exponent(task: SlidingPlant, claims: SlidingClaims) -> Fraction:
    """2m/a with m the least possible friction coefficient, without regularisation."""
    (_, a), (_, b), (mu, _) = (task.ranges[n] for n in ("direct_effect", "evolution_effect", "coefficient"))
    return 2 * (mu - a * claims.log_rate - b * claims.log_state) / a


def _pressure_rate(task: SlidingPlant, sampled_loop: SampledLoop, claims: SlidingClaims) -> Fraction:
    """Bound of |q′| [Pa/s]."""
    late = sampled_loop.diffusion / 2 + sampled_loop.lag
    speed = Fraction(5, 2) / sampled_loop.diffusion if sampled_loop.diffusion else 1 / sampled_loop.lag
    return speed * (claims.asked + task.drift * late + claims.push) + task.drift


def _spring_rate(task: SlidingPlant, claims: SlidingClaims) -> Fraction:
    """Bound of K|x′| [Pa/s]."""
    return task.stiffness * task.rate * (exponential(claims.log_rate) - 1 + task.swing)


def _state_rate(task: SlidingPlant, claims: SlidingClaims) -> Fraction:
    """Bound ζ of |z′| [1/s]."""
    grown, aged = exponential(claims.log_rate), exponential(claims.log_state)
    if task.state_law == "slip":
        return _ageing(task)[1] * grown * (claims.log_rate + claims.log_state)
    return _ageing(task)[1] * max(grown - 1 / aged, aged - 1 / grown)


def _moved(
    task: SlidingPlant, sampled_loop: SampledLoop, claims: SlidingClaims, model: SlidingModel, time: Fraction
) -> dict[str, Fraction]:
    """Bounds of the change of y and its combinations within a time [s], without steps of e."""
    of_state = _state_rate(task, claims)
    change = (
        _spring_rate(task, claims)
        + model.weakening * of_state
        + model.coefficient * _pressure_rate(task, sampled_loop, claims)
    )
    y, z = change / model.strength * time, of_state * time
    return {
        "log_rate": y,
        "ageing": model.evolution_slope * y + model.state_slope * z,
        "strength": model.direct * y + model.evolution * z,
    }


def chords(size: Fraction) -> Range:
    """(1 − e^{−Y})/Y from below and (e^Y − 1)/Y from above, the bounds of (e^y − 1)/y."""
    grown = exponential(size)
    return (1 - 1 / _partial(size)) / size, (grown - 1) / size


def _state_slopes(task: SlidingPlant, claims: SlidingClaims) -> Range:
    """Range with midpoint c_z: (1 − e^{−z})/z of the ageing law, (ρ/ρ₀)e^y of the slip law."""
    if task.state_law == "ageing":
        return chords(claims.log_state)
    grown, spread = exponential(claims.log_rate), _ageing_spread(task)
    return (1 - spread) / grown, (1 + spread) * grown


@lru_cache(maxsize=64, typed=True)
def exponential(size: Fraction) -> Fraction:
    """Upper bound of e^Y for 0 ≤ Y ≤ 3, by Taylor's sum and its remainder."""
    term = _ONE
    for k in range(1, _TERMS + 1):
        term *= size / k
    return _partial(size) + term / (1 - size / (_TERMS + 1))


@lru_cache(maxsize=64, typed=True)
def _partial(size: Fraction) -> Fraction:
    """e^Y from below."""
    total = term = _ONE
    for k in range(1, _TERMS):
        term *= size / k
        total += term
    return total


def _ageing(task: SlidingPlant) -> Range:
    """ρ = V/D [1/s]."""
    low, high = task.ranges["critical_slip"]
    return task.rate / high, task.rate / low


def _ageing_spread(task: SlidingPlant) -> Fraction:
    """χ = sup|ρ/ρ₀ − 1|, ρ₀ the midpoint of the range of ρ."""
    slow, fast = _ageing(task)
    return (fast - slow) / (fast + slow)


def _middle(ends: Range) -> Fraction:
    return (ends[0] + ends[1]) / 2


def _half(ends: Range) -> Fraction:
    return (ends[1] - ends[0]) / 2


def after_a_step(loop: PeriodicLoop) -> tuple[Fraction, ...]:
    """Times [s] since the last step at the well, at the start of each part; 0 without steps."""
    first = {fading.first for fading in loop.fading.values()}
    starts = list(accumulate((part.duration for part in loop.segments), initial=_ZERO))
    origin = starts[max(first)] if first else None
    return tuple(
        _ZERO if origin is None else (start + share * part.duration - origin) % loop.period
        for start, part in zip(starts, loop.segments, strict=False)
        for share in part.ends[:-1]
    )


def settled(loop: PeriodicLoop) -> Fraction:
    """First of the times `after_a_step` [s] at which the truncation error has a weight of at most 1/16; else 0."""
    times = sorted(after_a_step(loop))
    return next((t for t in times for fading in loop.fading.values() if fading.weight(t) <= _FADED), _ZERO)


def _with_what_adds_at_once(
    loop: PeriodicLoop, model: SlidingModel, gains: Gains, phases: Sequence[Fraction]
) -> dict[tuple[str, str], tuple[Any, ...]]:
    """Gains with the direct feedthrough from stress and truncation error to y."""
    total = dict(gains)
    for (output, name), size in at_once(model).items():
        if name in loop.inputs:
            total[output, name] = tuple(v + size for v in gains[output, name])
        elif name in loop.fading:
            weights = (loop.fading[name].weight(time) for time in phases)
            total[output, name] = tuple(v + size * w for v, w in zip(gains[output, name], weights, strict=True))
    return total


def _once_settled(
    gains: Mapping[tuple[str, str], tuple[Any, ...]], phases: Sequence[Fraction], late: Fraction
) -> dict[tuple[str, str], tuple[Any, ...]]:
    """Gains in which the last part of the period replaces all parts soon after a step."""
    last = max(range(len(phases)), key=lambda j: phases[j])
    return {
        (output, name): tuple(v[last] if output in _AT_ONCE and phases[j] < late else v[j] for j in range(len(v)))
        for (output, name), v in gains.items()
    }
