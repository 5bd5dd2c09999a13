"""The main call: from a record to friction parameters with their confidence regions."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from quakedesign.errors import RecordError
from quakedesign.fault import friction_law
from quakedesign.fault.checks import require_positive, require_seed
from quakedesign.identification.experiment import Difference
from quakedesign.identification.fitting import Fit, Search, advantage, fit, settled
from quakedesign.identification.profiles import BetterFit, interval
from quakedesign.identification.record import Record, read_record
from quakedesign.identification.result import Estimate, Identification, Rival, estimate
from quakedesign.identification.setup import Setup, set_up
from quakedesign.identification.thinning import thinned

AGEING, SLIP = "rate-and-state-aging", "rate-and-state-slip"
_LEAST_NEAR = 2  # searches, where the first begins near the fit of a similar law
_PAIR = ("direct_effect", "evolution_effect")
_MOST_BETTER = 10


def identify(
    record: Record | str | Path,
    law: str | None = None,
    *,
    stiffness: float | None = None,
    normal_stress: float | None = None,
    seed: int = 0,
) -> Identification:
    """Friction parameters of a laboratory record, each with its profile likelihood at 95 %.

    A law with state is fitted to the simulated experiment: a block without inertia that a spring draws after the
    recorded load point, from steady sliding on. A law that weakens with slip is fitted at the measured slip, or
    without one to a block that sticks at first and then slips as the stiff spring lets it. Noise is taken for
    independent from sample to sample and equally large; where residuals are correlated, regions are widened by it. Of
    a long record, means of neighbouring samples are fitted, each with the weight of its samples.

    Parameters
    ----------
    record : Record, str or Path
        Or a CSV file of one, see `read_record`.
    law : str, optional
        Name of a friction law with state, or of one that depends on slip. Unless told, the ageing and the slip law are
        both fitted, and the one that leaves the smaller residuals is taken.
    stiffness : float, optional
        Of the machine, known exactly [Pa/m; N/m for a record of forces, 1/m for one of friction alone]; fitted unless
        given.
    normal_stress : float, optional
        Constant [Pa], where a file has no such column.
    seed : int
        Of the draw of the starts.

    Returns
    -------
    Identification

    Raises
    ------
    RecordError
        When the record cannot be read, or does not suit the law.
    UnknownNameError
        For a law that does not exist.
    """
    require_seed(seed)
    if stiffness is not None:
        require_positive(stiffness=stiffness)
    if normal_stress is not None:
        require_positive(normal_stress=normal_stress)
    if isinstance(record, Record):
        if normal_stress is not None:
            raise RecordError("normal_stress goes with a file. Received it beside a Record. Put it into the record.")
        found = record
    else:
        found = read_record(record, normal_stress=normal_stress)
    if len(found.time) < 2 or not np.ptp(found.friction) > 0:
        raise RecordError("a record must have samples in which friction changes. Received none. Give a longer one.")
    means = thinned(found)
    if law is not None:
        return _profiled(_fitted(means, law, stiffness, seed))
    return _preferred(means, stiffness, seed)


@dataclass(frozen=True, kw_only=True)
class _Fitted:
    """A record and the best fit of one law to it."""

    record: Record
    setup: Setup
    best: Fit
    seed: int


def _fitted(record: Record, law: str, stiffness: float | None, seed: int, near: Fit | None = None) -> _Fitted:
    """Best fit of a law, sought first near that of a law with the same quantities."""
    setup = set_up(record, friction_law(law), stiffness)
    best = fit(
        setup.experiment,
        record.friction[setup.used],
        seed=seed,
        counts=None if record.counts is None else record.counts[setup.used],
        near=None if near is None else near.fitted,
        search=Search() if near is None else Search(least=_LEAST_NEAR),
    )
    return _Fitted(record=record, setup=setup, best=best, seed=seed)


def _preferred(record: Record, stiffness: float | None, seed: int) -> Identification:
    """The one of both laws with state that explains the record better, and by how much."""
    first = _fitted(record, AGEING, stiffness, seed)
    try:
        second = _fitted(record, SLIP, stiffness, seed, first.best)
    except RecordError:  # which no spring holds without a jump
        return _profiled(first)
    better, worse = (second, first) if advantage(second.best, first.best)[1] > 0 else (first, second)
    squares, excess = advantage(better.best, worse.best)
    rival = Rival(law=worse.setup.experiment.law.name, squares=squares, excess=excess)
    return replace(_profiled(better), rival=rival)


def _profiled(fitted: _Fitted) -> Identification:
    """Profiles about the best fit; about a better one if a profile comes upon it."""
    setup, best = fitted.setup, fitted.best
    for _ in range(_MOST_BETTER):
        try:
            estimates = _estimates(best)
            difference = _difference(best)
            break
        except BetterFit as better:
            best = settled(replace(best, fitted=better.fitted, agreeing=1), Search())
    else:
        raise RecordError(
            "a record must have one best fit. Received one whose fit gets better wherever it is followed. Give the "
            "stiffness, or a record with more steps."
        )
    if difference is not None and difference.identified and not any(estimates[name].identified for name in _PAIR):
        estimates |= {name: _open(estimates[name]) for name in _PAIR}
    return Identification(
        record=fitted.record,
        fit=best,
        used=setup.used,
        estimates=estimates,
        difference=difference,
        law=best.experiment.best_law(best.fitted),
        notes=(*setup.notes, *best.experiment.remarks(best.fitted, best.noise)),
        seed=fitted.seed,
    )


def _estimates(best: Fit) -> dict[str, Estimate]:
    """Estimates of all coordinates, those of the law first.

    Where a law has both effects, profiles are followed in coordinates that hold their difference: where a record tells
    only that, the valley of equal fits is straight in them.
    """
    names = [c.name for c in best.experiment.coordinates]
    if not set(_PAIR) <= set(names):
        return {name: _estimate(best, i) for i, name in enumerate(names)}
    direct, evolution = map(names.index, _PAIR)
    others_turned = _Turned(best, direct, evolution)
    first_turned = _Turned(best, evolution, direct)
    return {name: (first_turned if i == direct else others_turned).estimate(i) for i, name in enumerate(names)}


def _difference(best: Fit) -> Estimate | None:
    """Estimate of the difference of both effects."""
    names = [c.name for c in best.experiment.coordinates]
    if not set(_PAIR) <= set(names):
        return None
    direct, evolution = map(names.index, _PAIR)
    return _Turned(best, direct, evolution).estimate(direct)


@dataclass(frozen=True)
class _Turned:
    """A fit in coordinates with the difference of two in place of the first of them."""

    best: Fit
    first: int
    second: int

    def estimate(self, place: int) -> Estimate:
        turned = Difference(whole=self.best.experiment, first=self.first, second=self.second)
        try:
            return _estimate(replace(self.best, experiment=turned, fitted=turned.difference(self.best.fitted)), place)
        except BetterFit as better:
            raise BetterFit(turned.whole_of(better.fitted)) from None


def _open(told: Estimate) -> Estimate:
    """The same without ends: along a valley of equal fits those that a search comes upon mean nothing."""
    return replace(told, low=-math.inf, high=math.inf, least=-math.inf, most=math.inf)


def _estimate(best: Fit, place: int) -> Estimate:
    alone = interval(best, place, best.threshold(1))
    jointly = interval(best, place, best.threshold(len(best.fitted)), inside=alone)
    return estimate(best, place, (alone.low, alone.high), (jointly.low, jointly.high))
