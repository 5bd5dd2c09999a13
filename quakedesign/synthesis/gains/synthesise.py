"""Gains and Lyapunov function found together for an objective; gains without a proof are never returned."""

from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import islice

from quakedesign.certificates import Certificate, Loop
from quakedesign.controllers import Subject
from quakedesign.executors import Here, crew_or_here
from quakedesign.fault.checks import MOST_WORKERS, require_count
from quakedesign.sos.solve.conic import handing_back
from quakedesign.synthesis.analysis.certify import Number
from quakedesign.synthesis.gains.dilation import scaled_norm
from quakedesign.synthesis.gains.objectives import SmallestNorm
from quakedesign.synthesis.gains.path_following import climb, look, short, with_gains
from quakedesign.synthesis.gains.problem import Question, begin_with, question
from quakedesign.synthesis.gains.setting import FAINT, Setting, State
from quakedesign.workers import Crew

_STRETCHES = (1.0, 1.5, 4.0)
_DRAWS = 12
_MOST_STARTS = 10_000
_TRIES, _FEW = 6, 2
_INSIDE = 0.98
_SHARES = (1.0, 0.9, 0.7)


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """What gains from elsewhere reach in the same objective.

    Attributes
    ----------
    gains : mapping of str to Fraction
        Scaled to the same L̄ and β.
    value : float or None
        Proved; None where no proof was found.
    norm : float
        ‖k_i/L̄^{p_i}‖₂.
    ratio : float or None
        By which factor the gains found are better.
    certificate : Certificate or None
        Of the value, V being the best that was found for these gains.
    """

    gains: Mapping[str, Fraction]
    value: float | None
    norm: float
    ratio: float | None
    certificate: Certificate | None = None


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
        In terms of the objective: what the certificate proves, rounded down where more is better; for `sampled` what
        was measured.
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
    scheduler: str | None = None,
    executor: Executor | None = None,
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
        of β around the middle of `gain_range`. See `quakedesign.synthesis.gains.objectives`.
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
        Processes; 1 computes in this one.
    scheduler : str, optional
        Address of a dask.distributed scheduler that is used instead.
    executor : Executor, optional
        Any other executor of `concurrent.futures` that is used instead.
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
    SimulationError
        When the workers cannot be reached, or do not live.
    """
    asked = question(subject, objective, lipschitz=lipschitz, gain_range=gain_range, bound=bound, degrees=degrees)
    require_count(_MOST_STARTS, starts=starts)
    require_count(MOST_WORKERS, workers=workers)
    first = list(islice(begin_with(asked, seed), starts * _DRAWS))
    with Here() if handing_back() else crew_or_here(workers, scheduler, executor) as crew:
        best = _best(asked, _climbed(asked.setting, first, starts, crew))
    mine = _synthesis(asked, *best) if best else None
    return _beside(asked, mine) if compare else mine


def _synthesis(asked: Question, certificate: Certificate, value: float) -> Synthesis:
    return Synthesis(
        law=asked.loop.law,
        objective=asked.setting.objective.name,
        unit=asked.setting.objective.unit,
        gains=dict(certificate.loop.gains),
        certificate=certificate,
        value=value,
        norm=scaled_norm(certificate.loop, asked.setting.exponents),
    )


def _beside(asked: Question, mine: Synthesis | None) -> Synthesis | None:
    """Gains found beside known ones, which take their place where they are better within the same bound on the norm."""
    objective = asked.setting.objective
    compared = [given(asked, one) for one in asked.known]
    for one in compared:
        if one.certificate is None or one.value is None or one.norm > (objective.bound or one.norm) * (1 + 1e-9):
            continue
        if not _covers(one.certificate.loop, asked.loop):
            continue
        if mine is None or objective.better(one.value, mine.value):
            mine = _synthesis(asked, one.certificate, one.value)
    if mine is None:
        return None
    best = mine.value
    ratios = [one.value and (best / one.value if objective.larger else one.value / best) for one in compared]
    return replace(mine, compared=tuple(replace(c, ratio=r) for c, r in zip(compared, ratios, strict=True)))


def _covers(proved: Loop, wanted: Loop) -> bool:
    """Whether a proof is about all ranges that were asked for."""
    return all(
        proved.uncertain[name][0] <= low and high <= proved.uncertain[name][1]
        for name, (low, high) in wanted.uncertain.items()
    )


def _climbed(setting: Setting, first: Sequence[Loop], wanted: int, crew: Crew) -> list[list[State]]:
    """Climbs from as many starts as wanted, of those that can begin; in the order of the starts."""
    done: list[list[State]] = []
    for at in range(0, len(first), crew.width):
        climbs = dict(crew.answers(attempt, [(setting, loop) for loop in first[at : at + crew.width]]))
        done += [climbs[place] for place in sorted(climbs) if climbs[place]]
        if len(done) >= wanted:
            break
    return done[:wanted]


def attempt(setting: Setting, loop: Loop) -> list[State]:
    """States of a climb from some gains, or from the same stretched; empty where there is no beginning.

    As far as the gains go by themselves, then with the gains moving.
    """
    begin = next(filter(None, (_begin(setting, _stretched(setting, loop, s)) for s in _STRETCHES)), None)
    if begin is None:
        return []
    fixed = climb(setting, begin, free=False)
    return [*fixed, *climb(setting, fixed[-1])]


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


def _best(asked: Question, climbs: Sequence[Sequence[State]]) -> tuple[Certificate, float] | None:
    """Best proof, the best climb going on with higher degrees."""
    best = _in_order(asked.setting, climbs)
    stages = [(asked.setting, best)]
    for degree in asked.degrees[1:] if best else ():
        higher = replace(asked.setting, degree=degree)
        begin = next(filter(None, (_carried(higher, state) for state in best[:_TRIES])), None)
        if begin is not None:
            best = _in_order(higher, [climb(higher, begin)])
            stages.append((higher, best))
    proofs = list(filter(None, (_proved(at, states, asked.subject) for at, states in stages)))
    pick = max if asked.setting.objective.larger else min
    return pick(proofs, key=lambda item: item[1], default=None)


def _carried(higher: Setting, state: State) -> State | None:
    """State of a lower degree looked at with a higher one, at its level or a lower one."""
    objective = higher.objective
    levels = [objective.reached(state.level * share, state.loop, higher.exponents) for share in _SHARES]
    states = (look(higher, state.loop, level, state.lyapunov, least=FAINT) for level in dict.fromkeys(levels))
    return next(filter(None, states), None)


def _in_order(setting: Setting, climbs: Sequence[Sequence[State]]) -> list[State]:
    """Best state first."""
    states = [state for states in climbs for state in states]
    return sorted(states, key=lambda s: s.level, reverse=setting.objective.larger)


def _proved(
    setting: Setting, states: Sequence[State], subject: Subject, tries: int = _TRIES
) -> tuple[Certificate, float] | None:
    """Proof of one of the best states, each try twice as far down the order."""
    for k in range(tries):
        if (1 << k) - 1 >= len(states):
            break
        certificate = setting.objective.proved(setting, states[(1 << k) - 1], subject)
        if certificate is not None:
            return certificate, setting.objective.figure(certificate, setting)
    return None


def given(asked: Question, loop: Loop) -> Compared:
    """The same question about given gains, whatever their norm, with V of every degree; its ratio is left open.

    Parameters
    ----------
    asked : Question
    loop : Loop
        With the gains.
    """
    objective = replace(asked.setting.objective, bound=None)
    setting = replace(asked.setting, objective=objective, least=FAINT)
    shorter = objective.given(loop, asked.degrees, asked.subject)
    found = [(shorter, objective.figure(shorter, setting))] if shorter else []
    for degree in asked.degrees if objective.paced or not shorter else ():
        at = replace(setting, degree=degree)
        begin = objective.start(at, loop)
        states = _in_order(at, [climb(at, begin, free=False)]) if begin else []
        states = [s for s in states if all(objective.better(s.level, value) for _, value in found)]
        reached = _proved(at, states, asked.subject, _FEW if found else _TRIES)
        found += [reached] if reached else []
        if found and not objective.bounded:  # then V does not matter
            break
    certificate, value = (max if objective.larger else min)(found, key=lambda item: item[1], default=(None, None))
    norm = scaled_norm(loop, asked.setting.exponents)
    return Compared(gains=dict(loop.gains), value=value, norm=norm, ratio=None, certificate=certificate)
