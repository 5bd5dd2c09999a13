"""Gains and Lyapunov function found together for an objective; gains without a proof are never returned."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from itertools import islice
from multiprocessing import get_context

from quakedesign.certificates import Certificate, Loop
from quakedesign.controllers import Subject, family, model_of
from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.synthesis.climbing import Setting, State, climb, short, with_gains
from quakedesign.synthesis.decision import Number, closed_loop
from quakedesign.synthesis.lyapunov import candidate_degrees
from quakedesign.synthesis.objectives import SmallestNorm, objective_for
from quakedesign.synthesis.stretching import scaled_norm, stretch_exponents

_STRETCHES = (1.0, 1.5, 4.0)
_DRAWS = 12
_SPREAD, _WIDTH = 0.4, 3.0
_TRIES = 6
_INSIDE = 0.98


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """What gains from elsewhere reach in the same objective.

    Attributes
    ----------
    gains : mapping of str to Fraction
        Scaled to the same L̄ and β.
    value : float or None
        Proved; None where no proof was found, or where the gains exceed the bound on the norm.
    norm : float
        ‖k_i/L̄^{p_i}‖₂.
    ratio : float or None
        By which factor the gains found are better.
    """

    gains: Mapping[str, Fraction]
    value: float | None
    norm: float
    ratio: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Synthesis:
    """Gains with a proof, and how good they are.

    Attributes
    ----------
    law, objective, unit : str
    gains : mapping of str to Fraction
    certificate : Certificate
        Checked in exact arithmetic.
    value : float
        What the certificate proves, in terms of the objective; rounded to the safe side.
    norm : float
        ‖k_i/L̄^{p_i}‖₂ of the gains.
    compared : tuple of Compared
        Gains from the literature, where there are any for the law.
    """

    law: str
    objective: str
    unit: str
    gains: Mapping[str, Fraction]
    certificate: Certificate
    value: float
    norm: float
    compared: tuple[Compared, ...] = field(default=())


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
    compare: bool = True,
) -> Synthesis | None:
    """Find gains with a proof that are best in one respect.

    Several starts climb with a V of the lowest degree; the best goes on with the higher ones.

    Parameters
    ----------
    subject : str, type of Law or LoopField
        As for `certify`.
    objective : str
        ``"norm"``: smallest norm of the gains. ``"decay"``: fastest certified decay. ``"beta"``: widest certified range
        of β around the middle of `gain_range`. See `quakedesign.synthesis.objectives`.
    lipschitz : number or text
        L̄ > 0.
    gain_range : tuple of two
    bound : float, optional
        Largest ‖k_i/L̄^{p_i}‖₂, for all objectives but ``"norm"``; the smallest of the gains known from the literature
        unless given.
    degrees : iterable of int, optional
        Of V; the two lowest of `candidate_degrees` unless given. Higher ones find better gains and take longer.
    starts : int
        The gains from the literature come first, then random ones.
    seed : int
        Of the random starts; the answer is the same for the same seed, however many workers.
    workers : int
        Processes.
    compare : bool
        Whether to ask the same question about the gains from the literature.

    Returns
    -------
    Synthesis or None
        None when no gains were proved.

    Raises
    ------
    ParameterError
        For input out of range, a bound that is missing, or a law whose gains do not scale.
    UnknownNameError
        For an unknown law or objective.
    """
    loop = closed_loop(subject, _ones(subject), lipschitz=lipschitz, gain_range=gain_range)
    _require(loop, starts, workers)
    name, model = model_of(subject)
    exponents = stretch_exponents(loop, {"d": 1})
    known = [with_gains(loop, gains) for gains in _literature(name, loop, exponents)]
    if bound is None and known:
        bound = min(scaled_norm(one, exponents) for one in known)
    chosen = objective_for(objective, loop, bound)
    units = {str(state): unit for state, unit in model.units.items()}
    steps = tuple(degrees) if degrees is not None else candidate_degrees(loop)[:2]
    setting = Setting(objective=chosen, exponents=exponents, units=units, degree=steps[0])
    first = list(islice(_starts(known, loop, exponents, seed), max(starts, 1) * _DRAWS))
    states = _climbed(setting, first, starts, workers)
    found = _best(setting, states, steps, subject)
    if found is None:
        return None
    certificate, value = found
    beside = (_compared(setting, one, steps, subject, value) for one in known) if compare else ()
    return Synthesis(
        law=name,
        objective=objective,
        unit=chosen.unit,
        gains=dict(certificate.loop.gains),
        certificate=certificate,
        value=value,
        norm=scaled_norm(certificate.loop, exponents),
        compared=tuple(beside),
    )


def _ones(subject: Subject) -> tuple[Number, ...]:
    return (1,) * len(model_of(subject)[1].gains)


def _require(loop: Loop, starts: int, workers: int) -> None:
    if not ("d" in loop.uncertain and loop.uncertain["d"][1] > 0):
        raise ParameterError(f"synthesis needs a positive bound on |d|. Received the ranges {dict(loop.uncertain)}.")
    if starts < 1 or workers < 1:
        raise ParameterError(f"starts and workers must be at least 1. Received {starts} and {workers}.")


def _literature(name: str, loop: Loop, exponents: Mapping[str, Fraction]) -> list[dict[str, Fraction]]:
    """Gains that are known for a law, scaled to the loop's L̄ and to the least β."""
    try:
        bound, sets = family(name)
    except UnknownNameError:
        return []
    return [_scaled(loop, {n: float(k) for n, k in one.gains.items()}, float(bound), exponents) for one in sets]


def _scaled(
    loop: Loop, gains: Mapping[str, float], bound: float, exponents: Mapping[str, Fraction]
) -> dict[str, Fraction]:
    """Gains for |d| ≤ bound and β = 1 carried over to the loop's ranges, with four digits."""
    beta = float(loop.uncertain["beta"][0]) if "beta" in loop.uncertain else 1.0
    of_beta = stretch_exponents(loop, {"beta": 1})
    ratio = float(loop.uncertain["d"][1]) / bound
    moved = {n: k * ratio ** float(exponents[n]) * beta ** float(of_beta[n]) for n, k in gains.items()}
    return short(loop, moved)


def _starts(
    known: Sequence[Loop], loop: Loop, exponents: Mapping[str, Fraction], seed: int
) -> Iterator[Loop]:
    """Gains from the literature, then random ones around them, or of any size where there are none."""
    import numpy as np

    yield from known
    rng = np.random.default_rng(seed)
    bound = float(loop.uncertain["d"][1])
    while True:
        near = known[int(rng.integers(len(known)))].gains if known else {}
        spread = rng.normal(0, _SPREAD, len(loop.gains)) if near else rng.uniform(0, _WIDTH, len(loop.gains))
        factors = dict(zip(loop.gains, np.exp(spread).tolist(), strict=True))
        if near:
            yield with_gains(loop, short(loop, {n: float(k) * factors[n] for n, k in near.items()}))
        else:
            yield with_gains(loop, _scaled(loop, factors, 1.0, exponents))


def _climbed(setting: Setting, first: Sequence[Loop], wanted: int, workers: int) -> list[list[State]]:
    """Climbs from as many starts as wanted, of those that can begin; in the order of the starts."""
    job = partial(attempt, setting)
    done: list[list[State]] = []
    if workers == 1:
        return list(islice((states for states in map(job, first) if states), wanted))
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        for at in range(0, len(first), workers):
            done += [states for states in pool.map(job, first[at : at + workers]) if states]
            if len(done) >= wanted:
                break
    return done[:wanted]


def attempt(setting: Setting, loop: Loop) -> list[State]:
    """States of a climb from some gains, or from the same stretched; empty where there is no beginning."""
    begin = next(filter(None, (_begin(setting, _stretched(setting, loop, s)) for s in _STRETCHES)), None)
    return [] if begin is None else climb(setting, begin)


def _begin(setting: Setting, loop: Loop) -> State | None:
    """State that meets the bound on the norm, after a climb for the norm alone where the gains exceed it."""
    bound = setting.objective.bound
    if bound is not None and scaled_norm(loop, setting.exponents) > bound * (1 + 1e-9):
        smaller = replace(setting, objective=SmallestNorm())
        state = smaller.objective.start(smaller, loop)
        reached = climb(smaller, state, until=_INSIDE * bound) if state else []
        if not reached or reached[-1].level > bound:
            return None
        loop = reached[-1].loop
    return setting.objective.start(setting, loop)


def _stretched(setting: Setting, loop: Loop, factor: float) -> Loop:
    """Loop with the gains for a larger L̄."""
    if factor == 1:
        return loop
    gains = {n: float(k) * factor ** float(setting.exponents[n]) for n, k in loop.gains.items()}
    return with_gains(loop, short(loop, gains))


def _best(
    setting: Setting, climbs: Sequence[Sequence[State]], degrees: Sequence[int], subject: Subject
) -> tuple[Certificate, float] | None:
    """Proof of the best state, after the best climb has gone on with higher degrees."""
    best = _in_order(setting, climbs)
    if not best:
        return None
    stages = [(setting, best)]
    for degree in degrees[1:]:
        higher = replace(setting, degree=degree)
        begin = next(filter(None, (higher.objective.start(higher, s.loop) for s in best[:2])), None)
        if begin is not None:
            stages.append((higher, _in_order(higher, [climb(higher, begin)])))
            best = stages[-1][1]
    return next(filter(None, (_proved(at, states, subject) for at, states in reversed(stages))), None)


def _in_order(setting: Setting, climbs: Sequence[Sequence[State]]) -> list[State]:
    """Best state first."""
    states = [state for states in climbs for state in states]
    return sorted(states, key=lambda s: s.level, reverse=setting.objective.larger)


def _proved(setting: Setting, states: Sequence[State], subject: Subject) -> tuple[Certificate, float] | None:
    """Proof of one of the best states, each try twice as far down the order."""
    for k in range(_TRIES):
        if (1 << k) - 1 >= len(states):
            break
        certificate = setting.objective.proved(setting, states[(1 << k) - 1], subject)
        if certificate is not None:
            return certificate, setting.objective.figure(certificate, setting)
    return None


def _compared(setting: Setting, loop: Loop, degrees: Sequence[int], subject: Subject, value: float) -> Compared:
    """The same question about given gains, with V of every degree; whatever their norm."""
    objective = replace(setting.objective, bound=None)
    reached = []
    for degree in degrees:
        at = replace(setting, objective=objective, degree=degree)
        begin = objective.start(at, loop)
        states = _in_order(at, [climb(at, begin, free=False)]) if begin else []
        found = _proved(at, states, subject) if states else None
        reached += [found[1]] if found else []
    best = (max(reached) if objective.larger else min(reached)) if reached else None
    ratio = None if best is None else (value / best if objective.larger else best / value)
    norm = scaled_norm(loop, setting.exponents)
    return Compared(gains=dict(loop.gains), value=best, norm=norm, ratio=ratio)
