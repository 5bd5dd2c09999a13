"""Gains and V improved together: steps along the bilinear inequalities, each looked at again at the gains it finds.

At gains k0 with V0 the products of changes of V and of k are left out, so that V and k move in one programme with the
largest margin (the path-following of Hassibi, How and Boyd, American Control Conference 1999). What a step finds counts
only after a programme with these gains fixed has a margin too. Nothing here is proved.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from quakedesign.certificates import Loop
from quakedesign.certificates.claim import root_enclosure
from quakedesign.errors import CertificateError
from quakedesign.sos.solve.joint import Limits
from quakedesign.symbolic.terms import Term
from quakedesign.synthesis.gains.dilation import scaled_norm
from quakedesign.synthesis.gains.linearised_program import Neighbourhood, neighbourhood
from quakedesign.synthesis.gains.pace import box, on_box, pace_of
from quakedesign.synthesis.gains.setting import Setting, State
from quakedesign.synthesis.lyapunov.balancing import balance

_ROUNDS = 100  # programmes of steps to solve at most


@dataclass(frozen=True, slots=True, kw_only=True)
class TrustRegion:
    """How far the bilinear products that a step leaves out are trusted; a step is a share by which the level improves.

    Attributes
    ----------
    initial : float
        First share. What a step leaves out is of second order, about (`gains` times the share)²: a tenth of what is
        kept.
    largest : float
        Share at which what is left out is as large as what is kept.
    least : float
        Share below which the search centres instead: gains are rounded to four digits, ten of which it is.
    grow, shrink : float
        What the share is multiplied by after a step that was found, and divided by after one that was not: up slowly
        and down fast, since a programme that fails takes as long as one that succeeds.
    gains : float
        Largest change of a gain over the share: a level asks for changes of several gains larger than its own.
    again : float
        Share after centring, below the initial one, which had failed.
    worthwhile : float
        Share by which the level must have improved since the last centring for another: three of the least steps.
    margin : float
        Factor by which centring must raise the margin; less leaves no room for a step, and the search ends.
    under_root : float
        Largest change of a gain under a root over the gain, so that the root stays real.
    """

    initial: float = 0.1
    largest: float = 0.35
    least: float = 1e-3
    grow: float = 1.5
    shrink: float = 3.0
    gains: float = 3.0
    again: float = 0.03
    worthwhile: float = 3e-3
    margin: float = 1.2
    under_root: float = 0.5

    def longer(self, share: float) -> float:
        """Share after a step that was found."""
        return min(self.largest, self.grow * share)


TRUST = TrustRegion()


def with_gains(loop: Loop, gains: Mapping[str, Fraction]) -> Loop:
    """Loop with other gains and the roots that belong to them."""
    known = {**loop.constants, **gains}
    roots = {name: (of, root_enclosure(known[of])) for name, (of, _) in loop.roots.items()}
    return replace(loop, gains=dict(gains), roots=roots)


def short(loop: Loop, gains: Mapping[str, float]) -> dict[str, Fraction]:
    """Gains with four digits; those under a root as squares of numbers with four digits, so that the root is exact."""
    rooted = {of for of, _ in loop.roots.values()}
    return {name: _digits(math.sqrt(max(k, 0.0))) ** 2 if name in rooted else _digits(k) for name, k in gains.items()}


def _digits(number: float) -> Fraction:
    return Fraction(f"{number:.4g}")


def climb(setting: Setting, state: State, *, free: bool = True, until: float | None = None) -> Any:
    """States in the order in which they were found, each better than the one before; the given one first.

    Parameters
    ----------
    setting : Setting
    state : State
    free : bool
        Whether the gains may move.
    until : float, optional
        Level at which to stop.

    Returns
    -------
    list of State
    """
    states, share, centred = [state], TRUST.initial, None
    objective = setting.objective
    for _ in range(_ROUNDS):
        if until is not None and not objective.better(until, state.level):
            break
        if share < TRUST.least:
            worthwhile = centred is None or objective.better(state.level, objective.improved(centred, TRUST.worthwhile))
            found = _step(setting, state, 0.0) if free and worthwhile else None
            if found is None or found.margin < TRUST.margin * state.margin:
                break
            state, share, centred = found, TRUST.again, found.level
            continue
        found = _step(setting, state, share) if free else _level(setting, state, share)
        if found is None:
            share /= TRUST.shrink
            continue
        state, share = found, TRUST.longer(share)
        if objective.better(state.level, states[-1].level):
            states.append(state)
    return states


def _level(setting: Setting, state: State, share: float) -> State | None:
    """The same gains at a better level."""
    level = setting.objective.improved(state.level, share)
    level = setting.objective.reached(level, state.loop, setting.exponents)
    return look(setting, state.loop, level, state.lyapunov, state.level)


def _step(setting: Setting, state: State, share: float) -> State | None:
    """State that is better by a share; for the share zero, one about as good with the largest margin."""
    objective = setting.objective
    level = objective.improved(state.level, share)
    loop = objective.at(state.loop, level)
    changes = _changes(setting, loop, TRUST.gains * (share or TRUST.again))
    base = [float(k) for k in loop.gains.values()]
    changed = [with_gains(loop, g) for g in changes.values()]
    sizes = [float(changes[name][name] - loop.gains[name]) for name in changes]
    around = _around(setting, loop, level, state.lyapunov, changed)
    if around is None:
        return None
    limits = _limits(setting, loop, level, around, dict(zip(changes, sizes, strict=True)))
    proposal = around.program.solve(around.demands, around.fixed, limits)
    if proposal is None:
        return None
    chosen = dict(zip(loop.gains, base, strict=True))
    first = len(around.monomials)
    for name, size, x in zip(changes, sizes, proposal.decision[first : first + len(sizes)], strict=True):
        chosen[name] += size * x
    moved = with_gains(loop, short(loop, objective.kept(chosen, loop, setting.exponents)))
    beyond = state.level if share else None
    return look(setting, moved, objective.reached(level, moved, setting.exponents), state.lyapunov, beyond)


def _changes(setting: Setting, loop: Loop, trust: float) -> dict[str, dict[str, Fraction]]:
    """For every gain that may move, the gains with this one larger; none that is zero moves."""
    norm = scaled_norm(loop, setting.exponents)
    bound = float(loop.uncertain["d"][1])
    rooted = {of for of, _ in loop.roots.values()}
    changes = {}
    for name, k in loop.gains.items():
        unit = bound ** float(setting.exponents[name])
        step = trust * math.sqrt(abs(float(k)) * norm * unit)
        step = min(step, TRUST.under_root * float(k)) if name in rooted else step
        larger = short(loop, {name: float(k) + step})
        if k and larger[name] != k:
            changes[name] = {**loop.gains, **larger}
    return changes


def _around(
    setting: Setting, loop: Loop, level: float, lyapunov: tuple[Term, ...], changed: Sequence[Loop] = ()
) -> Neighbourhood | None:
    speed = setting.objective.speed(level)
    try:
        pace = pace_of(loop, lyapunov, speed, setting.degree) if speed else None
        return neighbourhood(loop, setting.degree, balance(loop), pace=pace, lyapunov=lyapunov, changed=changed)
    except (CertificateError, ValueError):
        return None


def _limits(setting: Setting, loop: Loop, level: float, around: Neighbourhood, sizes: Mapping[str, float]) -> Limits:
    """|a_j| and shares of the changes at most one, the norm of the gains as the objective asks."""
    count = len(around.monomials)
    bound = setting.objective.norm_bound(level)
    rows, bounds = [], []
    if bound is not None and sizes:
        norm = scaled_norm(loop, setting.exponents)
        unit = float(loop.uncertain["d"][1])
        slopes = [float(loop.gains[n]) / unit ** (2 * float(setting.exponents[n])) / norm * s for n, s in sizes.items()]
        rows.append([*[0.0] * count, *slopes])
        bounds.append(bound - norm)
    return Limits(radii=[1.0] * (count + len(sizes)), rows=rows, bounds=bounds, shares=_shares(setting, loop, around))


def _shares(setting: Setting, loop: Loop, around: Neighbourhood) -> list[float]:
    """Largest size of every a_j-th part of V on the box, where a rate is asked for: then V ≤ 1 there."""
    if not setting.objective.paced:
        return []
    sizes = box(loop, setting.units)
    shares = [on_box((term,), loop.states, sizes) for term in around.monomials]
    return [share / float(size) for size, share in zip(around.sizes, shares, strict=True)]


def look(
    setting: Setting,
    loop: Loop,
    level: float,
    lyapunov: tuple[Term, ...] = (),
    beyond: float | None = None,
    least: float | None = None,
) -> State | None:
    """State at fixed gains and level with the largest margin; None without one, or where it is no better than `beyond`.

    Parameters
    ----------
    setting : Setting
    loop : Loop
    level : float
    lyapunov : tuple of Term
        V of a state nearby; only a rate needs it.
    beyond : float, optional
    least : float, optional
        Margin that counts; that of the setting unless given.

    Returns
    -------
    State or None
    """
    objective = setting.objective
    if beyond is not None and not objective.better(level, beyond):
        return None
    loop = objective.at(loop, level)
    around = _around(setting, loop, level, lyapunov)
    if around is None:
        return None
    limits = _limits(setting, loop, level, around, {})
    proposal = around.program.solve(around.demands, around.fixed, limits)
    if proposal is None or not proposal.margin > (setting.least if least is None else least):
        return None
    function = around.function(proposal.decision)
    return State(loop=loop, level=level, lyapunov=function, margin=proposal.margin)
