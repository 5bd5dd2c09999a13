"""Synthesis of gains with a proof: problem, objectives, and the search.

Objectives: smallest scaled norm, largest decay rate, largest range of β. Gains without a proof are never returned.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from itertools import islice
from typing import ClassVar

import numpy as np

from quakedesign.errors import ParameterError, UnknownNameError, require_known
from quakedesign.fault.model import MOST_WORKERS, require_count
from quakedesign.laws import Subject, family, model_of
from quakedesign.lyapunov.exact.certificate import Certificate
from quakedesign.lyapunov.exact.claim import Loop
from quakedesign.lyapunov.exact.obligations import Obligations
from quakedesign.lyapunov.gains.path_following import (
    FAINT,
    Objective,
    PathSetting,
    State,
    box,
    climb,
    degrees_of,
    fastest,
    least_margins,
    on_box,
    rounded,
    scaled_norm,
    scaling_exponents,
    short,
    state_at,
    with_gains,
)
from quakedesign.lyapunov.search.certify import Number, closed_loop, largest_gain_range
from quakedesign.lyapunov.search.lyapunov_search import (
    MARGIN_SHARE,
    balance,
    below,
    bounds_of,
    candidate_degrees,
    certificate_of,
    with_largest_decay,
)
from quakedesign.lyapunov.search.settling_time import fastest_settling
from quakedesign.parallel import Crew, InProcess, crew_or_here
from quakedesign.sos.solve.conic import collecting

# ----------------------------------------------------------------------
# Objectives: order of levels, requirements of a level on a loop, the final proof and its value.

_HALVINGS = 8  # of the initial settling speed
_BITS = (16, 24, 34)  # significant binary digits of the coefficients of V, coarsest first


@dataclass(frozen=True, kw_only=True)
class SmallestNorm(Objective):
    """Smallest ‖k_i/L̄^{p_i}‖₂ with p_i from homogeneity: (k1L̄^{−2/3}, k2L̄^{−1/2}, k3/L̄, k4/L̄) for the 2-CTA."""

    name: ClassVar[str] = "norm"
    unit: ClassVar[str] = "-"
    meaning: ClassVar[str] = "norm of the gains, scaled to a bound of one on |h'|"
    larger: ClassVar[bool] = False
    bounded: ClassVar[bool] = False

    def norm_bound(self, level: float) -> float | None:
        """The level itself."""
        return level

    def reached(self, level: float, loop: Loop, exponents: Mapping[str, Fraction]) -> float:
        """Norm of the gains."""
        return scaled_norm(loop, exponents)

    def start(self, setting: PathSetting, loop: Loop) -> State | None:
        """State at given gains."""
        return state_at(setting, loop, scaled_norm(loop, setting.exponents), least=FAINT)

    def figure(self, certificate: Certificate, setting: PathSetting) -> float:
        """Norm of the gains."""
        return scaled_norm(certificate.loop, setting.exponents)


@dataclass(frozen=True, kw_only=True)
class LargestDecay(Objective):
    """Largest κ in V̇ ≤ −κV^{n/m}, measured by 1/T with the certified settling time T = m/((m−n)κ)·C^{(m−n)/m}.

    T is valid for all initial errors |e_i| ≤ L̄, where V ≤ C. Unlike κ, it is independent of the scaling of V and
    comparable between degrees m, and it is invariant under λ-scaling.
    """

    name: ClassVar[str] = "decay"
    unit: ClassVar[str] = "1/s"
    meaning: ClassVar[str] = "inverse of the certified settling time from errors of at most the bound on |h'|"
    has_rate: ClassVar[bool] = True

    def speed(self, level: float) -> float | None:
        """The level itself."""
        return level

    def start(self, setting: PathSetting, loop: Loop) -> State | None:
        """State at half the settling speed estimated for a V without a rate condition, or at a smaller speed."""
        first = state_at(replace(setting, objective=SmallestNorm()), loop, scaled_norm(loop, setting.exponents))
        if first is None:
            return None
        largest = on_box(first.lyapunov, loop.states, box(loop, setting.units))
        function = rounded(first.lyapunov, _BITS[-1], largest)
        m, n = degrees_of(Obligations(loop, function))
        speed = fastest(loop, function) * (m - n) / m
        for _ in range(_HALVINGS):
            speed /= 2
            state = state_at(setting, loop, speed, function)
            if state is not None:
                return state
        return None

    def proved(self, setting: PathSetting, state: State, subject: Subject) -> Certificate | None:
        """Certificate with the V of the state and the largest κ that the solver finds for it."""
        scale = balance(state.loop)
        for bits in _BITS:
            function = rounded(state.lyapunov, bits)
            positive, decrease = (MARGIN_SHARE * below(t) for t in least_margins(state.loop, function, scale))
            if not (positive > 0 and decrease > 0):
                continue
            claims = {"positive": positive, "decrease": decrease, **bounds_of(state.loop, function, scale)}
            plain = certificate_of(state.loop, function, claims, subject)
            certificate = plain and with_largest_decay(plain, scale, subject)
            if certificate:
                return certificate
        return None

    def given(self, loop: Loop, degrees: Sequence[int], subject: Subject) -> Certificate | None:
        """Certificate with the V of largest margins, which may be better where the forms w ≈ V^{1/m} fit poorly."""
        bound, beta = loop.uncertain["d"][1], loop.uncertain.get("beta", (Fraction(1), Fraction(1)))
        gains = tuple(loop.gains.values())
        settling = fastest_settling(subject, gains, lipschitz=bound, gain_range=beta, start=bound, degrees=degrees)
        return settling[0] if settling else None

    def figure(self, certificate: Certificate, setting: PathSetting) -> float:
        """1/T = κ·(m−n)/m·C^{−(m−n)/m} with V ≤ C where |e_i| ≤ L̄, rounded down."""
        loop = certificate.loop
        m, n = degrees_of(Obligations(loop, certificate.lyapunov))
        share = (m - n) / m
        largest = on_box(certificate.lyapunov, loop.states, box(loop, setting.units))
        return float(certificate.claims["decay"]) * share * float(largest**-share) * (1 - 1e-12)


@dataclass(frozen=True, kw_only=True)
class LargestRange(Objective):
    """Largest ρ with β ∈ [b/ρ, bρ] about the geometric mean b of the requested range."""

    name: ClassVar[str] = "beta"
    unit: ClassVar[str] = "-"
    meaning: ClassVar[str] = "ratio of the ends of the range of β to its geometric mean"

    middle: Fraction = Fraction(1)
    first: float = 1.01

    def at(self, loop: Loop, level: float) -> Loop:
        """Loop with the range of the level."""
        ratio = Fraction(f"{level:.6g}")
        ends = (self.middle / ratio, self.middle * ratio)
        return replace(loop, uncertain={**loop.uncertain, "beta": ends})

    def start(self, setting: PathSetting, loop: Loop) -> State | None:
        """State with the requested range, which is widened to at least 1 % on either side."""
        return state_at(setting, loop, self.first, least=FAINT)

    def given(self, loop: Loop, degrees: Sequence[int], subject: Subject) -> Certificate | None:
        """Certificate of the largest range to four digits, from a search over one number."""
        gains, bound = tuple(loop.gains.values()), loop.uncertain["d"][1]
        limit = largest_gain_range(
            subject, gains, lipschitz=bound, nominal=self.middle, symmetric=True, degrees=tuple(degrees)
        )
        return limit.certificate if limit.value is not None else None

    def figure(self, certificate: Certificate, setting: PathSetting) -> float:
        """ρ, rounded down."""
        low, high = certificate.loop.uncertain["beta"]
        return float(float(high / low) ** 0.5) * (1 - 1e-15)


_OBJECTIVES: dict[str, type[Objective]] = {o.name: o for o in (SmallestNorm, LargestDecay, LargestRange)}
OBJECTIVES = tuple(_OBJECTIVES)


def objective_for(name: str, loop: Loop, bound: float | None) -> Objective:
    """Objective of a given name for the ranges of a loop.

    Raises
    ------
    UnknownNameError
        If the objective is unknown.
    ParameterError
        If the bound is missing or not positive, or the loop lacks the uncertain parameter of the objective.
    """
    require_known(name, _OBJECTIVES, "objective", UnknownNameError)
    chosen = _OBJECTIVES[name]
    if chosen.bounded and not (bound is not None and bound > 0):
        raise ParameterError(f"the objective {name} needs a positive bound on the norm. Received {bound}.")
    make = partial(chosen, bound=bound if chosen.bounded else None)
    if chosen is not LargestRange:
        return make()
    if "beta" not in loop.uncertain:
        raise ParameterError(f"the objective {name} needs a loop with an uncertain beta. Received {loop.law}.")
    low, high = loop.uncertain["beta"]
    middle = low if low == high else Fraction(f"{float(low * high) ** 0.5:.6g}")
    return LargestRange(
        bound=bound, middle=middle, first=max(1.01, float(max(high / middle, middle / low)) * (1 + 1e-6))
    )


# ----------------------------------------------------------------------
# The problem of a synthesis of gains, and the initial loops of its search.

_SPREAD, _WIDTH = 0.4, 3.0  # standard deviation of log factors of published gains; largest log of other random gains
_HIGHEST = 12  # for higher degrees, one programme takes minutes


@dataclass(frozen=True, slots=True, kw_only=True)
class SynthesisProblem:
    """Synthesis problem with checked arguments."""

    subject: Subject
    loop: Loop  # Loop with all gains 1
    setting: PathSetting  # Setting with the lowest degree
    degrees: tuple[int, ...]  # Degrees of V
    published: tuple[Loop, ...]  # Loops with gains from the literature, scaled to the same ranges


def problem_of(
    subject: Subject,
    objective: str,
    *,
    lipschitz: Number,
    gain_range: tuple[Number, Number],
    bound: float | None = None,
    degrees: Iterable[int] | None = None,
) -> SynthesisProblem:
    """Problem from the checked arguments of `synthesise`.

    Raises
    ------
    ParameterError, UnknownNameError
        As `synthesise`.
    """
    name, model = model_of(subject)
    loop = closed_loop(subject, (1,) * len(model.gains), lipschitz=lipschitz, gain_range=gain_range)
    if not ("d" in loop.uncertain and loop.uncertain["d"][1] > 0):
        raise ParameterError(f"synthesis needs a positive bound on |d|. Received lipschitz = {lipschitz}.")
    exponents = scaling_exponents(loop, {"d": 1})
    published = tuple(with_gains(loop, gains) for gains in _literature(name, loop, exponents))
    if bound is None and published:
        bound = min(scaled_norm(one, exponents) for one in published)
    chosen = tuple(degrees) if degrees is not None else candidate_degrees(loop)[:2]
    lowest = candidate_degrees(loop)[0]
    if not chosen or not all(lowest <= m <= _HIGHEST for m in chosen):
        raise ParameterError(f"the degree of V must be from {lowest} to {_HIGHEST}. Received {list(chosen)}.")
    setting = PathSetting(
        objective=objective_for(objective, loop, bound),
        exponents=exponents,
        units={str(state): unit for state, unit in model.units.items()},
        degree=chosen[0],
    )
    return SynthesisProblem(subject=subject, loop=loop, setting=setting, degrees=chosen, published=published)


def _literature(name: str, loop: Loop, exponents: Mapping[str, Fraction]) -> list[dict[str, Fraction]]:
    """Gains from the literature for a law, scaled to the L̄ of the loop and to its least β."""
    try:
        sets = [one for one in family(name) if one.literature]
    except UnknownNameError:
        return []
    return [
        _scaled(loop, {n: float(k) for n, k in one.law.gains.items()}, float(one.lipschitz), exponents) for one in sets
    ]


def _scaled(
    loop: Loop, gains: Mapping[str, float], bound: float, exponents: Mapping[str, Fraction]
) -> dict[str, Fraction]:
    """Gains for |d| ≤ bound and β = 1, scaled to the ranges of the loop and rounded to four digits."""
    beta = float(loop.uncertain["beta"][0]) if "beta" in loop.uncertain else 1.0
    of_beta = scaling_exponents(loop, {"beta": 1})
    ratio = float(loop.uncertain["d"][1]) / bound
    moved = {n: k * ratio ** float(exponents[n]) * beta ** float(of_beta[n]) for n, k in gains.items()}
    return short(loop, moved)


def initial_loops(problem: SynthesisProblem, seed: int) -> Iterator[Loop]:
    """Loops with gains from the literature, nearest to the norm bound first, then with random gains near them.

    Without gains from the literature, all gains are random: 1 to e³, scaled to the L̄ of the loop.
    """
    yield from sorted(problem.published, key=lambda one: _beyond(problem.setting, one))
    loop, rng = problem.loop, np.random.default_rng(seed)
    while True:
        near = problem.published[int(rng.integers(len(problem.published)))].gains if problem.published else {}
        spread = rng.normal(0, _SPREAD, len(loop.gains)) if near else rng.uniform(0, _WIDTH, len(loop.gains))
        factors = dict(zip(loop.gains, np.exp(spread).tolist(), strict=True))
        if near:
            yield with_gains(loop, short(loop, {n: float(k) * factors[n] for n, k in near.items()}))
        else:
            yield with_gains(loop, _scaled(loop, factors, 1.0, problem.setting.exponents))


def _beyond(setting: PathSetting, loop: Loop) -> tuple[bool, float]:
    """Sort key: gains within the norm bound before those beyond it, and by distance from the bound."""
    bound, norm = setting.objective.bound, scaled_norm(loop, setting.exponents)
    return (False, 0.0) if bound is None else (norm > bound * (1 + 1e-9), abs(bound - norm))


# ----------------------------------------------------------------------
# Joint search for gains and a Lyapunov function; gains without a proof are never returned.

_GAIN_SCALES = (1.0, 1.5, 4.0)  # factors of L̄ to which initial gains are scaled up
_DRAWS = 12  # candidates per climb
_MOST_STARTS = 10_000
_TRIES, _FEW = 6, 2  # states whose proof is tried; the same if a proof for other states exists
_INSIDE = 0.98  # share of the norm bound to which larger gains are reduced
_SHARES = (1.0, 0.9, 0.7)  # shares of the level at which a V of higher degree begins


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedGains:
    """Proved value of the objective for gains from the literature."""

    gains: Mapping[str, Fraction]  # Scaled to the same L̄ and β
    value: float | None  # Proved value; None without a proof
    norm: float  # ‖k_i/L̄^{p_i}‖₂
    ratio: float | None  # Factor by which the synthesised gains are better
    certificate: Certificate | None = None  # Proof of the value, with the best V found for these gains


@dataclass(frozen=True, slots=True, kw_only=True)
class Synthesis:
    """Gains with a proof, and their value of the objective."""

    law: str
    objective: str
    unit: str
    gains: Mapping[str, Fraction]
    certificate: Certificate  # Checked in exact arithmetic
    # Value of the objective that the certificate proves, rounded down if larger is better. The objective ``sampled`` of
    # the command line has no proved value; for it, this is the measured value
    value: float
    norm: float  # ‖k_i/L̄^{p_i}‖₂ of the gains
    # Gains from the literature, if any are known for the law
    compared: tuple[ComparedGains, ...] = field(default=())


def synthesise(
    subject: Subject,
    objective: str = "norm",
    *,
    lipschitz: Number = 1,
    gain_range: tuple[Number, Number] = (1, 1),
    bound: float | None = None,
    degrees: Iterable[int] | None = None,
    starts: int = 4,
    seed: int = 0,
    workers: int = 1,
    scheduler: str | None = None,
    executor: Executor | None = None,
    compare: bool = True,
) -> Synthesis | None:
    """Find gains that optimise an objective, together with a proof of stability.

    Several local searches (climbs) begin with a V of the lowest degree; the best one continues with higher degrees.

    Parameters
    ----------
    subject : str, type of Law or LoopField
        As for `certify`.
    objective : str
        ``"norm"``: smallest norm of the gains. ``"decay"``: fastest certified decay. ``"beta"``: widest certified range
        of β about the geometric mean of `gain_range`. See `SmallestNorm`, `LargestDecay`, `LargestRange`.
    lipschitz : number or text
        Bound L̄ > 0 on |ḣ| [unit of ν per s].
    gain_range : tuple of two numbers or texts
        Range [b_m, b_M] of β [-] that the proof must cover.
    bound : float, optional
        Largest ‖k_i/L̄^{p_i}‖₂ for all objectives except ``"norm"``; by default the smallest norm of the gains from the
        literature.
    degrees : iterable of int, optional
        Degrees of V; by default the two lowest of `candidate_degrees`. Higher degrees yield better gains in more time.
    starts : int
        Number of climbs. Candidates are the gains from the literature, then random gains; up to 12 candidates per climb
        are tried, since a climb needs feasible initial gains.
    seed : int
        Seed of the random gains; the result does not depend on the number of workers.
    workers : int
        Number of processes; 1 computes in the calling process.
    scheduler : str, optional
        Address of a dask.distributed scheduler, used instead of local processes.
    executor : Executor, optional
        Executor of `concurrent.futures`, used instead of local processes.
    compare : bool
        Whether to compute the objective also for the gains from the literature, which replace the result if they are
        better.

    Returns
    -------
    Synthesis or None
        None when no gains were proved.

    Raises
    ------
    ParameterError
        For an argument out of range, a missing bound, or a law whose terms do not determine the scaling of its gains.
    UnknownNameError
        For an unknown law or objective.
    SimulationError
        If the workers cannot be reached, or die repeatedly.
    """
    problem = problem_of(subject, objective, lipschitz=lipschitz, gain_range=gain_range, bound=bound, degrees=degrees)
    require_count(_MOST_STARTS, starts=starts)
    require_count(MOST_WORKERS, workers=workers)
    first = list(islice(initial_loops(problem, seed), starts * _DRAWS))
    with InProcess() if collecting() else crew_or_here(workers, scheduler, executor) as crew:
        best = _best(problem, _climbed(problem.setting, first, starts, crew))
    synthesis = _synthesis(problem, *best) if best else None
    return _compared(problem, synthesis) if compare else synthesis


def _synthesis(problem: SynthesisProblem, certificate: Certificate, value: float) -> Synthesis:
    return Synthesis(
        law=problem.loop.law,
        objective=problem.setting.objective.name,
        unit=problem.setting.objective.unit,
        gains=dict(certificate.loop.gains),
        certificate=certificate,
        value=value,
        norm=scaled_norm(certificate.loop, problem.setting.exponents),
    )


def _compared(problem: SynthesisProblem, synthesis: Synthesis | None) -> Synthesis | None:
    """Synthesis compared with gains from the literature, which replace it if they are better within the norm bound."""
    objective = problem.setting.objective
    compared = [compared_gains(problem, one) for one in problem.published]
    for one in compared:
        if one.certificate is None or one.value is None or one.norm > (objective.bound or one.norm) * (1 + 1e-9):
            continue
        if not _covers(one.certificate.loop, problem.loop):
            continue
        if synthesis is None or objective.better(one.value, synthesis.value):
            synthesis = _synthesis(problem, one.certificate, one.value)
    if synthesis is None:
        return None
    best = synthesis.value
    ratios = [one.value and (best / one.value if objective.larger else one.value / best) for one in compared]
    return replace(synthesis, compared=tuple(replace(c, ratio=r) for c, r in zip(compared, ratios, strict=True)))


def _covers(proved: Loop, requested: Loop) -> bool:
    """Whether a proof covers all requested ranges."""
    return all(
        proved.uncertain[name][0] <= low and high <= proved.uncertain[name][1]
        for name, (low, high) in requested.uncertain.items()
    )


def _climbed(setting: PathSetting, first: Sequence[Loop], count: int, crew: Crew) -> list[list[State]]:
    """Climbs from the first `count` feasible loops, in the order of the loops."""
    done: list[list[State]] = []
    for at in range(0, len(first), crew.width):
        climbs = dict(crew.results(attempt, [(setting, loop) for loop in first[at : at + crew.width]]))
        done += [climbs[place] for place in sorted(climbs) if climbs[place]]
        if len(done) >= count:
            break
    return done[:count]


def attempt(setting: PathSetting, loop: Loop) -> list[State]:
    """States of a climb from given gains, or from these gains scaled up; empty if no initial state is found.

    The level is improved first with fixed gains, then with free gains.
    """
    begin = next(filter(None, (_begin(setting, _scaled_up(setting, loop, s)) for s in _GAIN_SCALES)), None)
    if begin is None:
        return []
    fixed = climb(setting, begin, free=False)
    return [*fixed, *climb(setting, fixed[-1])]


def _begin(setting: PathSetting, loop: Loop) -> State | None:
    """Initial state within the norm bound; gains that exceed it are first reduced by a climb for the norm."""
    bound = setting.objective.bound
    if bound is not None and scaled_norm(loop, setting.exponents) > bound * (1 + 1e-9):
        smaller = replace(setting, objective=SmallestNorm())
        state = smaller.objective.start(smaller, loop)
        reached = climb(smaller, state, until=_INSIDE * bound) if state else []
        if not reached or reached[-1].level > bound:
            return None
        loop = reached[-1].loop
    return setting.objective.start(setting, loop)


def _scaled_up(setting: PathSetting, loop: Loop, factor: float) -> Loop:
    """Loop with the gains scaled to a larger L̄."""
    if factor == 1:
        return loop
    gains = {n: float(k) * factor ** float(setting.exponents[n]) for n, k in loop.gains.items()}
    return with_gains(loop, short(loop, gains))


def _best(problem: SynthesisProblem, climbs: Sequence[Sequence[State]]) -> tuple[Certificate, float] | None:
    """Best proof over all degrees; the best climb continues with higher degrees."""
    best = _in_order(problem.setting, climbs)
    stages = [(problem.setting, best)]
    for degree in problem.degrees[1:] if best else ():
        higher = replace(problem.setting, degree=degree)
        begin = next(filter(None, (_carried(higher, state) for state in best[:_TRIES])), None)
        if begin is not None:
            best = _in_order(higher, [climb(higher, begin)])
            stages.append((higher, best))
    proofs = list(filter(None, (_proved(at, states, problem.subject) for at, states in stages)))
    pick = max if problem.setting.objective.larger else min
    return pick(proofs, key=lambda item: item[1], default=None)


def _carried(higher: PathSetting, state: State) -> State | None:
    """State with a V of higher degree for the gains of a state, at its level or a lower one."""
    objective = higher.objective
    levels = [objective.reached(state.level * share, state.loop, higher.exponents) for share in _SHARES]
    states = (state_at(higher, state.loop, level, state.lyapunov, least=FAINT) for level in dict.fromkeys(levels))
    return next(filter(None, states), None)


def _in_order(setting: PathSetting, climbs: Sequence[Sequence[State]]) -> list[State]:
    """All states of the climbs, best first."""
    states = [state for states in climbs for state in states]
    return sorted(states, key=lambda s: s.level, reverse=setting.objective.larger)


def _proved(
    setting: PathSetting, states: Sequence[State], subject: Subject, tries: int = _TRIES
) -> tuple[Certificate, float] | None:
    """Proof of one of the best states, tried at ranks 1, 2, 4, …, and its value."""
    for k in range(tries):
        if (1 << k) - 1 >= len(states):
            break
        certificate = setting.objective.proved(setting, states[(1 << k) - 1], subject)
        if certificate is not None:
            return certificate, setting.objective.figure(certificate, setting)
    return None


def compared_gains(problem: SynthesisProblem, loop: Loop) -> ComparedGains:
    """Best proved value of the objective for given gains of any norm, over all degrees of V; `ratio` is None.

    Parameters
    ----------
    problem : SynthesisProblem
        Objective and degrees.
    loop : Loop
        Loop with the given gains.
    """
    objective = replace(problem.setting.objective, bound=None)
    setting = replace(problem.setting, objective=objective, least=FAINT)
    direct = objective.given(loop, problem.degrees, problem.subject)
    proofs = [(direct, objective.figure(direct, setting))] if direct else []
    for degree in problem.degrees if objective.has_rate or not direct else ():
        at = replace(setting, degree=degree)
        begin = objective.start(at, loop)
        states = _in_order(at, [climb(at, begin, free=False)]) if begin else []
        states = [s for s in states if all(objective.better(s.level, value) for _, value in proofs)]
        reached = _proved(at, states, problem.subject, _FEW if proofs else _TRIES)
        proofs += [reached] if reached else []
        if proofs and not objective.bounded:  # then V has no effect on the value
            break
    certificate, value = (max if objective.larger else min)(proofs, key=lambda item: item[1], default=(None, None))
    norm = scaled_norm(loop, problem.setting.exponents)
    return ComparedGains(gains=dict(loop.gains), value=value, norm=norm, ratio=None, certificate=certificate)
