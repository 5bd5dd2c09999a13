"""What is asked of a synthesis of gains, and where its search begins."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from quakedesign.certificates import Loop
from quakedesign.controllers import Subject, family, model_of
from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.synthesis.analysis.certify import Number, closed_loop
from quakedesign.synthesis.gains.dilation import scaled_norm, stretch_exponents
from quakedesign.synthesis.gains.objectives import objective_for
from quakedesign.synthesis.gains.path_following import short, with_gains
from quakedesign.synthesis.gains.setting import Setting
from quakedesign.synthesis.lyapunov.search import candidate_degrees

_SPREAD, _WIDTH = 0.4, 3.0
_HIGHEST = 12  # beyond, one programme takes minutes


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What is asked of a synthesis, read and checked.

    Attributes
    ----------
    subject : str, type of Law or LoopField
    loop : Loop
        With gains of one.
    setting : Setting
        With the lowest degree.
    degrees : tuple of int
    known : tuple of Loop
        With gains from the literature, scaled to the same ranges.
    """

    subject: Subject
    loop: Loop
    setting: Setting
    degrees: tuple[int, ...]
    known: tuple[Loop, ...]


def question(
    subject: Subject,
    objective: str,
    *,
    lipschitz: Number,
    gain_range: tuple[Number, Number],
    bound: float | None = None,
    degrees: Iterable[int] | None = None,
) -> Question:
    """Read what is asked; see `synthesise`.

    Raises
    ------
    ParameterError, UnknownNameError
        As `synthesise`.
    """
    name, model = model_of(subject)
    loop = closed_loop(subject, (1,) * len(model.gains), lipschitz=lipschitz, gain_range=gain_range)
    if not ("d" in loop.uncertain and loop.uncertain["d"][1] > 0):
        raise ParameterError(f"synthesis needs a positive bound on |d|. Received lipschitz = {lipschitz}.")
    exponents = stretch_exponents(loop, {"d": 1})
    known = tuple(with_gains(loop, gains) for gains in _literature(name, loop, exponents))
    if bound is None and known:
        bound = min(scaled_norm(one, exponents) for one in known)
    chosen = tuple(degrees) if degrees is not None else candidate_degrees(loop)[:2]
    lowest = candidate_degrees(loop)[0]
    if not chosen or not all(lowest <= m <= _HIGHEST for m in chosen):
        raise ParameterError(f"the degree of V must be from {lowest} to {_HIGHEST}. Received {list(chosen)}.")
    setting = Setting(
        objective=objective_for(objective, loop, bound),
        exponents=exponents,
        units={str(state): unit for state, unit in model.units.items()},
        degree=chosen[0],
    )
    return Question(subject=subject, loop=loop, setting=setting, degrees=chosen, known=known)


def _literature(name: str, loop: Loop, exponents: Mapping[str, Fraction]) -> list[dict[str, Fraction]]:
    """Gains that are known for a law, scaled to the loop's L̄ and to the least β."""
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
    """Gains for |d| ≤ bound and β = 1 carried over to the loop's ranges, with four digits."""
    beta = float(loop.uncertain["beta"][0]) if "beta" in loop.uncertain else 1.0
    of_beta = stretch_exponents(loop, {"beta": 1})
    ratio = float(loop.uncertain["d"][1]) / bound
    moved = {n: k * ratio ** float(exponents[n]) * beta ** float(of_beta[n]) for n, k in gains.items()}
    return short(loop, moved)


def begin_with(asked: Question, seed: int) -> Iterator[Loop]:
    """Gains from the literature, the nearest to the bound on the norm first, then random ones around them.

    Random ones of any size where there are none in the literature.
    """
    yield from sorted(asked.known, key=lambda one: _beyond(asked.setting, one))
    loop, rng = asked.loop, np.random.default_rng(seed)
    while True:
        near = asked.known[int(rng.integers(len(asked.known)))].gains if asked.known else {}
        spread = rng.normal(0, _SPREAD, len(loop.gains)) if near else rng.uniform(0, _WIDTH, len(loop.gains))
        factors = dict(zip(loop.gains, np.exp(spread).tolist(), strict=True))
        if near:
            yield with_gains(loop, short(loop, {n: float(k) * factors[n] for n, k in near.items()}))
        else:
            yield with_gains(loop, _scaled(loop, factors, 1.0, asked.setting.exponents))


def _beyond(setting: Setting, loop: Loop) -> tuple[bool, float]:
    """Order of gains: those within the bound on the norm before those beyond, the nearest to it first."""
    bound, norm = setting.objective.bound, scaled_norm(loop, setting.exponents)
    return (False, 0.0) if bound is None else (norm > bound * (1 + 1e-9), abs(bound - norm))
