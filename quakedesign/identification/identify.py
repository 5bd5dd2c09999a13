"""Identification of friction parameters from a record, with confidence regions.

The second chapter selects the experiment from the friction law and the measured columns.
"""

import math
from dataclasses import MISSING, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

from quakedesign.errors import RecordError
from quakedesign.fault import FrictionLaw, friction_law
from quakedesign.fault.model import require_positive, require_seed
from quakedesign.identification.experiment import Coordinate, Difference, Experiment
from quakedesign.identification.fitting import BetterFit, Fit, FitSearch, advantage, fit, interval, settled
from quakedesign.identification.identification_result import Identification, ParameterEstimate, Rival, estimate
from quakedesign.identification.record import FAR_OFF, Record, first_rate, read_record, scatter, thinned
from quakedesign.identification.sliding_experiment import STIFFNESS, Drive, SlidingExperiment
from quakedesign.identification.weakening_experiment import START, Drawn, MeasuredSlip

# ----------------------------------------------------------------------
# From a record and a law to the experiment that is fitted.

_EFFECTS = {"low": 1e-5, "high": 1.0, "start": (2e-3, 3e-2)}
_SHARES = {"drop": (0.2, 1.5), "residual": (0.3, 1.1)}
_MODERATE = 1e3


@dataclass(frozen=True, kw_only=True)
class Setup:
    """An experiment with the samples that it is about.

    Attributes
    ----------
    experiment : Experiment
    used : ndarray of bool
        Samples of the record that it simulates.
    notes : tuple of str
        What was taken for granted.
    """

    experiment: Experiment
    used: "np.ndarray"
    notes: tuple[str, ...]


def set_up(record: Record, law: type[FrictionLaw], stiffness: float | None) -> Setup:
    """The experiment of a record, by what its law depends on and what was measured.

    Raises
    ------
    RecordError
        When the law is of neither kind, or something is missing.
    """
    if law.state_names:
        return _sliding(record, law, stiffness)
    template = law(**dict.fromkeys(law.quantities(), 1.0))
    slip, rate = sp.symbols("slip rate", positive=True)
    if sp.sympify(template.symbolic().coefficient(slip, rate)).has(rate):
        raise RecordError(
            f"a law that is identified must depend on slip or on a state. Received {law.name}, which depends on the "
            "slip rate alone. Take another."
        )
    return _measured_slip(record, law) if record.slip is not None else _drawn(record, law, stiffness)


def _coordinate(name: str, law: type[FrictionLaw], record: Record, path: float) -> Coordinate:
    """Where one quantity of a law is sought; `path` is how far the block can have slipped [m]."""
    unit = law.quantities()[name].metadata["unit"]
    size = float(np.max(np.abs(record.friction)))
    ends: dict[str, Any]
    if unit == "m":
        ends = {"low": path * 1e-6, "high": path * 10, "start": (path * 1e-3, path * 0.3)}
    elif name in _SHARES:
        spread = size if name == "residual" else float(np.ptp(record.friction[record.friction > size / 3]))
        low, high = _SHARES[name]
        ends = {"low": size * 1e-4, "high": size * 10, "start": (spread * low, spread * high)}
    elif name == "reference_coefficient":
        level = float(np.median(record.friction[: max(len(record.friction) // 20, 1)]))
        ends = {"low": size * 1e-2, "high": size * 10, "start": (level * 0.999, level * 1.001)}
    else:
        ends = _EFFECTS
    return Coordinate(name=name, unit=unit, **ends)


def _sliding(record: Record, law: type[FrictionLaw], stiffness: float | None) -> Setup:
    if record.load_point is None:
        raise RecordError(
            f"{law.name} needs the motion of the load point, which drives the experiment. Received none. Add "
            "load_point_displacement [um] or load_point_rate [um/s]."
        )
    lengths = np.diff(record.time)
    rates = np.diff(record.load_point) / lengths
    first = record.first_rate or first_rate(record.time, record.load_point)
    if not first > 0:
        raise RecordError(
            f"a record for {law.name} must begin in steady sliding. Received a load point that moves at {first:.3g} "
            "m/s. Cut off what is before."
        )
    path = float(np.ptp(record.load_point))
    chosen = _rates(law, rates, first)
    optional = {field.name for field in fields(law) if field.default is not MISSING}  # type: ignore[arg-type]
    names = [name for name in law.quantities() if name not in chosen and name not in optional]
    coordinates = [_coordinate(name, law, record, path) for name in names]
    if stiffness is None:
        coordinates.append(_stiffness(record, path))
    template = law(**dict.fromkeys(names, 1.0), **chosen)
    log_normal = np.log(record.normal)
    drive = Drive(
        lengths=lengths,
        rates=rates,
        growth=np.diff(log_normal) / lengths,
        compliance=np.exp(-(log_normal[1:] + log_normal[:-1]) / 2),
        first_rate=first,
    )
    experiment = SlidingExperiment(
        law=template,
        drive=drive,
        normal_unit=record.normal_unit,
        coordinates=tuple(coordinates),
        stiffness=stiffness,
        steps=tuple((length,) for length in lengths.tolist()),
    )
    notes = (f"the record begins in steady sliding at {first:.4g} m/s",)
    return Setup(experiment=experiment, used=np.ones(len(record.time), dtype=bool), notes=notes)


def _rates(law: type[FrictionLaw], rates: "np.ndarray", first: float) -> dict[str, float]:
    """Rates of a law, which are chosen, not fitted: that of the first sliding, and a range around those of the load."""
    fast = max(float(np.max(rates)), first)
    chosen = {
        "reference_rate": float(f"{first:.6g}"),
        "slowest_rate": first / _MODERATE,
        "fastest_rate": fast * _MODERATE,
    }
    return {name: chosen[name] for name in law.quantities() if name in chosen}


def _stiffness(record: Record, path: float) -> Coordinate:
    """Stiffness [as the record's], about that at which the whole friction takes between all and 1e-4 of the path."""
    whole = float(np.max(record.normal) * np.max(np.abs(record.friction))) / path
    return Coordinate(
        name=STIFFNESS,
        unit=record.stiffness_unit,
        low=whole * 1e-2,
        high=whole * 1e6,
        start=(whole, whole * 1e3),
    )


def _measured_slip(record: Record, law: type[FrictionLaw]) -> Setup:
    """Samples after the slip has left the noise about zero for good."""
    assert record.slip is not None
    noise = scatter(record.time, record.slip)
    resting = np.flatnonzero(record.slip <= FAR_OFF * noise)
    used = np.arange(len(record.slip)) > (resting[-1] if len(resting) else -1)
    if used.sum() < 3 * len(law.quantities()):
        raise RecordError(
            f"slip must have grown from zero in at least {3 * len(law.quantities())} samples. Received "
            f"{int(used.sum())}. Measure it from where the fault begins to slip, forward positive."
        )
    slip = record.slip[used]
    coordinates = tuple(_coordinate(name, law, record, float(slip.max())) for name in law.quantities())
    template = law(**dict.fromkeys(law.quantities(), 1.0))
    note = f"friction as a function of the measured slip, in {int(used.sum())} samples that slip"
    return Setup(
        experiment=MeasuredSlip(law=template, slip=slip, slip_noise=noise, coordinates=coordinates),
        used=used,
        notes=(note,),
    )


def _drawn(record: Record, law: type[FrictionLaw], stiffness: float | None) -> Setup:
    if record.load_point is None:
        raise RecordError(
            f"{law.name} needs the column slip, or the motion of the load point. Received neither. Add slip [mm], say."
        )
    path = float(np.ptp(record.load_point))
    coordinates = [_coordinate(name, law, record, path) for name in law.quantities()]
    template = law(**dict.fromkeys(law.quantities(), 1.0))
    if stiffness is None:
        coordinates.append(_stiffness(record, path))
    first, size = float(record.friction[0]), float(np.max(np.abs(record.friction)))
    start = (first - 0.02 * size, first + 0.02 * size)
    coordinates.append(Coordinate(name=START, unit="", low=-size, high=2 * size, start=start, logarithmic=False))
    experiment = Drawn(
        law=template,
        load_point=record.load_point - record.load_point[0],
        normal=record.normal,
        coordinates=tuple(coordinates),
        stiffness=stiffness,
    )
    notes = ("the block sticks at first and has not slipped before", "without inertia")
    return Setup(experiment=experiment, used=np.ones(len(record.time), dtype=bool), notes=notes)


# ----------------------------------------------------------------------
# The main call: from a record to friction parameters with their confidence regions.

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
        search=FitSearch() if near is None else FitSearch(least=_LEAST_NEAR),
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
            best = settled(replace(best, fitted=better.fitted, agreeing=1), FitSearch())
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


def _estimates(best: Fit) -> dict[str, ParameterEstimate]:
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


def _difference(best: Fit) -> ParameterEstimate | None:
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

    def estimate(self, place: int) -> ParameterEstimate:
        turned = Difference(whole=self.best.experiment, first=self.first, second=self.second)
        try:
            return _estimate(replace(self.best, experiment=turned, fitted=turned.difference(self.best.fitted)), place)
        except BetterFit as better:
            raise BetterFit(turned.whole_of(better.fitted)) from None


def _open(told: ParameterEstimate) -> ParameterEstimate:
    """The same without ends: along a valley of equal fits those that a search comes upon mean nothing."""
    return replace(told, low=-math.inf, high=math.inf, least=-math.inf, most=math.inf)


def _estimate(best: Fit, place: int) -> ParameterEstimate:
    alone = interval(best, place, best.threshold(1))
    jointly = interval(best, place, best.threshold(len(best.fitted)), inside=alone)
    return estimate(best, place, (alone.low, alone.high), (jointly.low, jointly.high))
