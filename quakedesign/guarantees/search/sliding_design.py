"""Search for slow-sliding laws with a proof over a box of friction constants.

The second chapter computes the longest diffusion path or lag, or the largest V, by continuation from a short path.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from math import floor, log10
from typing import Any

import numpy as np
from scipy.optimize import OptimizeResult, minimize

from quakedesign.errors import ParameterError
from quakedesign.exact import LowerBound, UpperBound, rational
from quakedesign.fault import Fault
from quakedesign.fault.fault_toml import SAMPLES_PER_STATE_TIME, rate_out_of_range, sliding_step
from quakedesign.guarantees.exact.proof import NoProof
from quakedesign.guarantees.exact.sampled_loop import PLAIN, ExactSetup, SampledLoop
from quakedesign.guarantees.exact.sliding_proof import SlidingProof
from quakedesign.guarantees.exact.sliding_small_gain import (
    SlidingClaims,
    after_a_step,
    bounds_from,
    cell_bounds,
    follows,
    loop_of,
    model_of,
)
from quakedesign.guarantees.search.float_bounds import gains_of, short, spectral_radius
from quakedesign.guarantees.search.lqg import Weights, sliding_law
from quakedesign.laws import LinearLaw
from quakedesign.loop import PeriodicLoop, SlidingModel
from quakedesign.lyapunov import Verdict
from quakedesign.plant.of_fault import slow_sliding_plant
from quakedesign.plant.sliding_plant import MOST_CELLS, Cuts, SlidingPlant, parts

# ----------------------------------------------------------------------
# A law for slow sliding, chosen by its provable bounds, and cells that cover a box of constants.

LOG_RATES = (Fraction(1, 2), Fraction(1, 4), Fraction(1, 8))
"""Bounds of |ln(v/V)| in the order in which they are tried: the sectors of a smaller one are narrower."""
_STARTS = (
    (-1.02, -1.74, 6.76, 0.97, -5.19, 3.11, -0.06, 0.39, -0.12),
    (-6.0, -0.9, 4.6, 1.2, -5.9, 2.3, -0.17, 0.52, -0.05),
)
"""Logarithms of the weights and of a, b and D_c of the model over the fault's, for ρL²/D = 1, ρT_s = 0.06."""
_SIMPLEX = (0.7, 0.7, 0.7, 0.7, 0.7, 0.7, 0.05, 0.05, 0.05)
_EVALUATIONS = 120
_MOST_UNBOUNDED = 60  # number of laws without bounds after which a search ends
_POOR, _PATIENCE = 2.0, 40  # a search ends if the best cost of the first 40 laws exceeds 2
_FORGETTING = 0.972  # largest eigenvalue of a period, to limit the periods of the proof
# initial claims divided by Y; pressures in units of 2aσ'
_GUESSES = {"log_state": 0.4, "push": 1.2, "asked": 3.6}
_TURNS = 6
_SHRINKING = 24
_MEASURED = 2
_SPARE = 1.02
_MARGIN = 1.05  # margin of claims over estimates
_NEAR = 0.89  # largest estimate over its claim, as the sums of the proof are larger
_FAILED = 50.0
_SMALL = Fraction(1, 10**4)  # share of the normal stress
_DIGITS, _SHORT = 6, 3
# index of the end of each range at the worst corner (0: low, 1: high)
_ENDS = {"direct_effect": 0, "evolution_effect": 1, "critical_slip": 0}
_AXES = tuple(_ENDS)
_NAMES = tuple(SlidingClaims.__dataclass_fields__)


def proved_sliding(
    task: SlidingPlant, sampled_loop: SampledLoop, *, log_rate: Fraction = LOG_RATES[0]
) -> SlidingProof | NoProof:
    """Proof of a law with |ln(v/V)| at most `log_rate`, by cells and claims, or the reason why there is none."""
    corner = worst_corner(task)
    claims = _claims(corner, sampled_loop, log_rate)
    if claims is None or (corner != task and _excess(corner, sampled_loop, claims) >= _NEAR):
        return NoProof(reason=_too_much(task, log_rate))
    try:
        cuts = _cut(task, sampled_loop, claims, [MOST_CELLS - 1])
        by_estimate = SlidingProof(task=task, sampled_loop=sampled_loop, cuts=cuts, claims=claims)
        smaller = replace(by_estimate, claims=_smallest_claims(by_estimate))
        if smaller.check() is Verdict.PROVED:
            return smaller
        _cut(corner, sampled_loop, claims, [0], exactly=True)  # if this fails, no cuts of the box help
        return replace(by_estimate, cuts=_cut(task, sampled_loop, claims, [MOST_CELLS - 1], exactly=True))
    except ParameterError:
        return NoProof(reason=f"{_too_much(task, log_rate)} in {MOST_CELLS} cells of the box")


def _smallest_claims(proof: SlidingProof) -> SlidingClaims:
    """Fixed point of the map from claims to the bounds that follow from them.

    The map is the estimate times the ratio of bound and estimate on the worst cell. It is monotone, so that claims that
    follow from larger ones also follow from themselves.
    """
    claims = proof.claims
    for _ in range(_MEASURED):
        worst = max(proof.cells, key=lambda cell: _excess(cell, proof.sampled_loop, claims))
        bounds, estimate = cell_bounds(worst, proof.sampled_loop, claims), _estimate(worst, proof.sampled_loop, claims)
        if isinstance(bounds, NoProof) or estimate is None:
            break
        margins = {name: _SPARE * float(bounds[name]) / float(estimate[name]) for name in _NAMES}
        claims = _followed(proof, claims, margins)
    return claims


def _followed(proof: SlidingProof, claims: SlidingClaims, margins: Mapping[str, float]) -> SlidingClaims:
    """Claims iterated by the estimate times `margins` until they change by less than 1 %."""
    for _ in range(_SHRINKING):
        every = [_estimate(cell, proof.sampled_loop, claims) for cell in proof.cells]
        if any(one is None for one in every):
            break
        most = {name: max(float(one[name]) for one in every if one) for name in margins}
        following = {name: min(most[name] * v, float(getattr(claims, name))) for name, v in margins.items()}
        still = all(v > 0.99 * float(getattr(claims, name)) for name, v in following.items())
        claims = _as_claims(following)
        if still:
            break
    return claims


def largest_stress(task: SlidingPlant, sampled_loop: SampledLoop, *, log_rate: Fraction = LOG_RATES[0]) -> Fraction:
    """Estimate of the largest stress [Pa] that `proved_sliding` proves; 0 for none."""
    corner = worst_corner(task)
    claims, some = _guess(corner, log_rate), _SMALL * corner.ranges["normal_stress"][0]
    estimates = [_estimate(replace(corner, stress=stress), sampled_loop, claims) for stress in (Fraction(0), some)]
    rest, more = (0.0 if one is None else float(one["log_rate"]) for one in estimates)
    margin = (1 if corner == task else _NEAR) * _NEAR * float(log_rate) - rest
    if None in estimates or margin <= 0:
        return Fraction(0)
    return two_digits(Fraction(float(some) * margin / (more - rest)))


def two_digits(value: Fraction) -> Fraction:
    """Positive rational, rounded down to two digits."""
    scale = Fraction(10) ** (floor(log10(value)) - 1)
    return floor(value / scale) * scale


def designed_sliding(
    task: SlidingPlant,
    step: Fraction,
    *,
    log_rate: Fraction = LOG_RATES[0],
    near: np.ndarray | None = None,
    setup: ExactSetup = PLAIN,
) -> SampledLoop | NoProof:
    """Law with the least estimated bounds at the least stable corner; `near`: parameters of a further start."""
    chosen, _ = searched_sliding(task, step, log_rate, setup, near=near)
    if chosen is not None:
        return chosen
    ageing = float(task.ranges["critical_slip"][0] / task.rate)
    path = "".join(f", {title} = {float(v):.4g} s" for title, v in _path(setup).items() if v)
    reason = (
        f"no law with zero-order hold over {float(step):g} s was found whose loop is stable and decays within some "
        f"hundred periods, D_c/V = {ageing:.3g} s{path}"
    )
    return NoProof(reason=reason)


def _path(setup: ExactSetup) -> dict[str, Fraction]:
    return {"L^2/D": setup.diffusion, "lag": setup.lag, "delay": setup.delay}


def searched_sliding(
    task: SlidingPlant,
    step: Fraction,
    log_rate: Fraction,
    setup: ExactSetup,
    *,
    near: np.ndarray | None = None,
    enough: float = 0.0,
    most: int = _EVALUATIONS,
) -> tuple[SampledLoop | None, np.ndarray]:
    """Law with small estimated bounds, or None, and its parameters.

    Parameters
    ----------
    task : SlidingPlant
    step, log_rate : Fraction
        T_s [s], and the bound of |ln(v/V)| [-].
    setup : ExactSetup
        With a lag or a diffusion path.
    near : array, optional
        Further start of the search.
    enough : float
        The search ends when the ratio of the estimated bound of |ln(v/V)| to `log_rate` is at most this [-].
    most : int
        Largest number of laws to evaluate.
    """
    corner = worst_corner(task)
    claims = _guess(corner, log_rate)

    def sampled_loop(x: np.ndarray) -> SampledLoop | None:
        law = _law(corner, task, step, setup, x)
        return None if law is None else setup.with_law(law, step)

    costs: list[float] = []

    def cost(x: np.ndarray) -> float:
        costs.append(estimated(x))
        return costs[-1]

    def estimated(x: np.ndarray) -> float:
        tried = sampled_loop(x)
        if tried is None:
            return _FAILED
        model = model_of(corner, claims)
        if model is None:
            return 2 * _FAILED
        loop = loop_of(tried, model, corner)
        radius = spectral_radius(loop)
        if radius > _FORGETTING:
            return _FAILED + radius
        estimate = _estimate_of(loop, corner, tried, claims)
        return _FAILED / 2 if estimate is None else float(estimate["log_rate"] / log_rate)

    def ends(intermediate_result: OptimizeResult) -> None:
        cost = intermediate_result.fun
        patience = _MOST_UNBOUNDED if cost >= _FAILED / 2 else _PATIENCE
        if (cost >= _POOR and len(costs) > patience) or cost <= enough:
            raise StopIteration

    best = min([np.array(start) for start in _STARTS] + ([] if near is None else [near]), key=cost)
    if min(costs) <= enough:
        return sampled_loop(best), best
    simplex = np.vstack([best, best + np.diag(_SIMPLEX)])
    options = {"initial_simplex": simplex, "maxfev": most}
    reached = minimize(cost, best, method="Nelder-Mead", options=options, callback=ends)
    return (sampled_loop(reached.x) if reached.fun < _FAILED / 2 else None), reached.x


def worst_corner(task: SlidingPlant) -> SlidingPlant:
    """Small a, large b, small D: where the fault is least stable."""
    fixed = {axis: (task.ranges[axis][end],) * 2 for axis, end in _ENDS.items()}
    return replace(task, ranges={**task.ranges, **fixed})


def _law(
    corner: SlidingPlant, task: SlidingPlant, step: Fraction, setup: ExactSetup, x: np.ndarray
) -> LinearLaw | None:
    sizes = map(float, np.exp(np.clip(x[:6], -30, 30)))
    weights = Weights(**dict(zip(Weights.__dataclass_fields__, sizes, strict=True)))
    a, b, d = (_middle(task, axis) * short(float(np.exp(v)), _DIGITS) for axis, v in zip(_AXES, x[6:], strict=True))
    normal = _middle(task, "normal_stress")
    model = SlidingModel(
        rate=task.rate,
        state_rate=task.rate / d,
        slope=Fraction(1),
        state_slope=Fraction(1),
        strength=normal * a + task.radiation * task.rate,
        weakening=normal * b,
        direct=a,
        evolution=b,
        stiffness=task.stiffness,
        coefficient=_middle(task, "coefficient"),
    )
    try:
        return sliding_law(model, step, diffusion=setup.diffusion, weights=weights)
    except ParameterError:
        return None


def _middle(task: SlidingPlant, axis: str) -> Fraction:
    low, high = task.ranges[axis]
    return (low + high) / 2


def _guess(task: SlidingPlant, log_rate: Fraction) -> SlidingClaims:
    pressure = 2 * task.ranges["direct_effect"][1] * task.ranges["normal_stress"][0] * log_rate
    return _as_claims(
        {
            "log_rate": log_rate,
            "log_state": _GUESSES["log_state"] * float(log_rate),
            "slip_error": task.ranges["critical_slip"][1] * log_rate,
            "push": _GUESSES["push"] * float(pressure),
            "asked": _GUESSES["asked"] * float(pressure),
        }
    )


def _as_claims(values: Mapping[str, Any]) -> SlidingClaims:
    return SlidingClaims(**{name: UpperBound(short(float(v), _SHORT)) for name, v in values.items()})


def _claims(task: SlidingPlant, sampled_loop: SampledLoop, log_rate: Fraction) -> SlidingClaims | None:
    """Self-consistent claims by the estimate, with the given bound of |ln(v/V)|; None without any."""
    claims = _guess(task, log_rate)
    for _ in range(_TURNS):
        estimate = _estimate(task, sampled_loop, claims)
        if estimate is None:
            return None
        wider = {k: float(estimate[k]) * _MARGIN / _NEAR for k in _NAMES}
        if min(float(getattr(claims, k)) / v for k, v in wider.items() if k != "log_rate") >= 1 / _MARGIN:
            break
        try:
            claims = _as_claims({**wider, "log_rate": log_rate})
        except ParameterError:  # above the limits of claims
            return None
    else:
        return None
    return claims if float(estimate["log_rate"]) < float(log_rate) else None


def _estimate(task: SlidingPlant, sampled_loop: SampledLoop, claims: SlidingClaims) -> dict[str, Any] | None:
    model = model_of(task, claims)
    return None if model is None else _estimate_of(loop_of(sampled_loop, model, task), task, sampled_loop, claims)


def _estimate_of(
    loop: PeriodicLoop, task: SlidingPlant, sampled_loop: SampledLoop, claims: SlidingClaims
) -> dict[str, Any] | None:
    gains = gains_of(loop)
    if gains is None:
        return None
    count = len(next(iter(gains.values())))
    ends = [sampled_loop.step * Fraction(i, count - 1) for i in range(count)] if len(loop.segments) == 1 else None
    phases = after_a_step(loop)
    if len(phases) != count:
        phases = tuple(ends) if ends and loop.fading else (max(phases),) * count
    bounds = bounds_from(task, sampled_loop, claims, loop, gains, phases)
    return None if isinstance(bounds, NoProof) else bounds


def _cut(
    task: SlidingPlant, sampled_loop: SampledLoop, claims: SlidingClaims, left: list[int], *, exactly: bool = False
) -> Cuts:
    """Cuts of a box such that the claims follow on every cell; `left` limits their number.

    The claims are checked by the estimate, or exactly with `exactly`. Raises `ParameterError` beyond the limit.
    """
    wide = [axis for axis in _AXES if task.ranges[axis][0] < task.ranges[axis][1]]
    if _excess(task, sampled_loop, claims) < (_NEAR if wide else 1):
        bounds = cell_bounds(task, sampled_loop, claims) if exactly else None
        if not exactly or (isinstance(bounds, dict) and follows(bounds, claims)):
            return (None,)
    if not wide or left[0] < 1:
        raise ParameterError(
            f"the claims must be proved on at most {MOST_CELLS} cells of the box. Received a box that needs more. "
            "Reduce the spread, or raise the claims."
        )
    left[0] -= 1
    middles = {axis: (task.ranges[axis][0] + task.ranges[axis][1]) / 2 for axis in wide}
    halves = {axis: parts(task, axis, at) for axis, at in middles.items()}
    axis = min(wide, key=lambda name: _excess(halves[name][_ENDS[name]], sampled_loop, claims))
    below, above = (_cut(part, sampled_loop, claims, left, exactly=exactly) for part in halves[axis])
    return ((axis, middles[axis]), *below, *above)


def _excess(task: SlidingPlant, sampled_loop: SampledLoop, claims: SlidingClaims) -> float:
    """Largest ratio of bound and claim, by the estimate."""
    estimate = _estimate(task, sampled_loop, claims)
    if estimate is None:
        return _FAILED
    return max(float(estimate[k]) / float(getattr(claims, k)) for k in _NAMES)


def _too_much(task: SlidingPlant, log_rate: Fraction) -> str:
    return (
        f"a stress of {float(task.stress):.3g} Pa is not shown to keep |ln(v/V)| below {float(log_rate):.3g} with the "
        "laws that were tried"
    )


# ----------------------------------------------------------------------
# Longest diffusion path, or largest V, for which a law is found: continuation from a short path, law after law.
#
# With times in D_c/V the loop hardly depends on V: a proof for a share of L²/D is nearly one for that share of V.

Prove = Callable[[SlidingPlant, SampledLoop, Fraction], SlidingProof | NoProof]
"""Proof for a task, a sampled law in its setup and a bound of |ln(v/V)|."""

PATH = {"diffusion": "L^2/D", "lag": "the lag"}
_EASY = Fraction(1)  # L²/D in D_c/V for which laws are found without continuation
_FARTHER = Fraction(13, 10), Fraction(9, 8), Fraction(17, 16)  # step factors, the next one after a failure
_WELL_SHARE = Fraction(3, 4)
_NEARER = 3  # number of halvings of the path
_LAWS = 40  # number of laws tried for a share of the path
_ENOUGH = 0.5  # ratio of the estimate to the bound of |ln(v/V)| that suffices
_SLOWER = 1.05  # margin, as damping does not scale with V
_WELL_DIGITS = 2
_ADMISSIBLE_FACTOR = 2
_QUIETER = Fraction(1, 10), Fraction(1, 100), Fraction(0)  # shares of the slip noise


@dataclass(frozen=True, kw_only=True)
class FarthestWell:
    """Largest share of a path for which a law was found.

    Attributes
    ----------
    share : Fraction
        Share of the path [-]; 0 if no law was found.
    sampled_loop : SampledLoop or None
        Law for this share.
    numbers : array or None
        Its parameters, near which a search may begin.
    log_rate : Fraction
        Bound of |ln(v/V)| for which the law was estimated [-].
    """

    share: Fraction = Fraction(0)
    sampled_loop: SampledLoop | None = None
    numbers: np.ndarray | None = None
    log_rate: Fraction = LOG_RATES[-1]


def admissible_step(task: SlidingPlant, step: Fraction) -> Fraction:
    """T_s [s] if within a factor of 2 of D_c/(20 V), else D_c/(20 V) with two digits."""
    suits = task.ranges["critical_slip"][0] / task.rate / int(SAMPLES_PER_STATE_TIME)
    return step if suits / _ADMISSIBLE_FACTOR <= step <= _ADMISSIBLE_FACTOR * suits else two_digits(suits)


def farthest(
    task: SlidingPlant, step: Fraction, setup: ExactSetup, *, stressed: bool, most: Fraction = Fraction(1)
) -> FarthestWell:
    """Largest share of a path for which a law is found, by continuation from a short path.

    Parameters
    ----------
    task : SlidingPlant
    step : Fraction
        T_s [s].
    setup : ExactSetup
        As in `designed_sliding`; with a lag or a diffusion path.
    stressed : bool
        Whether the stress of the task is given, so that larger bounds of |ln(v/V)| may be needed.
    most : Fraction
        Largest share.
    """
    ageing = task.ranges["critical_slip"][0] / task.rate
    rates = LOG_RATES[::-1] if stressed else LOG_RATES[-1:]
    reached = FarthestWell()
    share = min(most, _EASY * ageing / (setup.lag + setup.diffusion))
    for _ in range(1 + _NEARER):
        reached = _followed_well(task, step, setup, share, reached, rates)
        if reached.share:
            break
        share /= 2
    farther = list(_FARTHER)
    while 0 < reached.share < most and farther:
        share = min(most, farther[0] * reached.share)
        reached = _followed_well(task, step, setup, share, reached, rates)
        if reached.share < share:
            farther.pop(0)
    if 0 < reached.share < most:  # with a margin for a proof, whose bounds exceed their estimate
        return _followed_well(task, step, setup, _WELL_SHARE * reached.share, reached, rates)
    return reached


def _followed_well(
    task: SlidingPlant,
    step: Fraction,
    setup: ExactSetup,
    share: Fraction,
    before: FarthestWell,
    rates: tuple[Fraction, ...],
) -> FarthestWell:
    """Law for a share of the path, near the previous one, or the previous one if the search fails."""
    for log_rate in rates:
        sampled_loop, numbers = searched_sliding(
            task, step, log_rate, shortened(setup, share), near=before.numbers, enough=_ENOUGH, most=_LAWS
        )
        if sampled_loop is not None:
            return FarthestWell(share=share, sampled_loop=sampled_loop, numbers=numbers, log_rate=log_rate)
    return before


def shortened(setup: ExactSetup, share: Fraction) -> ExactSetup:
    """Setup with a share of the lag and of the diffusion time."""
    return replace(setup, lag=share * setup.lag, diffusion=share * setup.diffusion)


def possible_remedy(
    fault: Fault, task: SlidingPlant, well: FarthestWell, setup: ExactSetup, prove: Prove, *, spread: Fraction
) -> str:
    """Remedies that are proved, as text: a shorter path or a smaller V.

    Parameters
    ----------
    fault : Fault
    task : SlidingPlant
        Plant of the fault.
    well : FarthestWell
    setup : ExactSetup
        As in `designed_sliding`.
    prove : callable
        See `Prove`.
    spread : Fraction
        Relative uncertainty of a, b and D_c in the plant [-].
    """
    if well.sampled_loop is None or well.numbers is None:
        return "no guarantee was found even with a much shorter path: a smaller spread, stress or noise may help"
    for noise in (setup.slip_noise, *quieter(setup)):
        loop = setup if noise == setup.slip_noise else replace(setup, slip_noise=noise)
        sampled_loop = replace(well.sampled_loop, slip_noise=noise)
        proof = prove(task, sampled_loop, well.log_rate)
        sentences = [_slower(fault, task, well, loop, prove, spread)]
        if proof.available:
            path = (f"{title} = {float(v):.3g} s" for name, title in PATH.items() if (v := getattr(sampled_loop, name)))
            sentences.append(
                f"at this V for {' and '.join(path)} with T_s = {float(sampled_loop.step):.3g} s{_under(proof)}"
            )
        if remedies := ", and ".join(filter(None, sentences)):
            return f"a proof was found {with_noise(noise, setup)}{remedies}"
    return "a smaller spread, stress or noise may help"


def quieter(setup: ExactSetup) -> tuple[Fraction, ...]:
    """Smaller bounds of the slip noise [m] to try, down to 0; empty without noise."""
    noise = setup.slip_noise
    return tuple(two_digits(share * noise) if share else Fraction(0) for share in _QUIETER) if noise else ()


def with_noise(noise: Fraction, setup: ExactSetup) -> str:
    """Text for a proof with a smaller slip noise than required; empty for the same noise."""
    if noise == setup.slip_noise:
        return ""
    return (
        f"with slip noise of at most {LowerBound(noise).quantity('m')} "
        if noise
        else "with exact measurements of slip "
    )


def _slower(
    fault: Fault, task: SlidingPlant, well: FarthestWell, setup: ExactSetup, prove: Prove, spread: Fraction
) -> str:
    """Text of a task with the same slip and a smaller V that is proved for the given path; empty without one."""
    time = float(short(_SLOWER * fault.reference.operation_time / float(well.share), _WELL_DIGITS))
    reference = replace(fault.reference, operation_time=time)
    slow = replace(fault, reference=reference, sampling_time=sliding_step(fault.friction, reference))
    slower, step = slow_sliding_plant(slow, task.stress, spread), rational(slow.sampling_time)
    sampled_loop, _ = searched_sliding(
        slower, step, well.log_rate, setup, near=well.numbers, enough=_ENOUGH, most=_LAWS
    )
    proof = None if sampled_loop is None else prove(slower, sampled_loop, well.log_rate)
    if proof is None or not proof.available:
        return ""
    return (
        f"with this path for V = {float(slower.rate):.3g} m/s{_under(proof)}: in [task] target_slip = "
        f"'{fault.reference.target_slip:g} m', operation_time = '{time:g} s', sampling_time = '{float(step):g} s'"
        f"{f' (but {beyond})' if (beyond := rate_out_of_range(fault.friction, float(slower.rate))) else ''}"
    )


def _under(proof: SlidingProof) -> str:
    return f" under a stress of at most {float(proof.task.stress):.3g} Pa (a law for this case alone may tolerate more)"
