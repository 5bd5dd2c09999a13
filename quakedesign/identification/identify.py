"""Identification of friction parameters from a record: choice of the experiment, fit, confidence region."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp
from numpy import ndarray

from quakedesign.errors import RecordError, UnknownNameError, require_known, require_whole
from quakedesign.fault import FrictionLaw, friction_law
from quakedesign.fault.equilibrium import by_equilibrium
from quakedesign.fault.model import require_positive
from quakedesign.identification.assessment import (
    DECISIVE,
    Assessment,
    checks_of,
    in_doubt,
    sign_check,
    unsteady_beginning,
)
from quakedesign.identification.correlated_noise import CorrelatedNoise, noise_of
from quakedesign.identification.experiment import (
    DELAY,
    START,
    START_RATE,
    START_STATE,
    STIFFNESS,
    TREND,
    TREND_IN_TIME,
    Coordinate,
    Difference,
    Experiment,
    MeasuredSlip,
    SlidingExperiment,
    SpringLoaded,
    delayed,
    trended,
)
from quakedesign.identification.fitting import BetterFit, Fit, Profile, advantage, fit, minimised, settled
from quakedesign.identification.identification_result import Identification, OtherLaw, ParameterEstimate, estimate
from quakedesign.identification.loading import Loading, prepared
from quakedesign.identification.record import FAR_OFF, Record, read_record, scatter
from quakedesign.identification.two_states import SECOND_EFFECT, with_two_states

_EFFECTS = 1e-5, 1.0, (2e-3, 3e-2)  # limits and start of a direct effect [-]
_SHARES = {"drop": (0.2, 1.5), "residual": (0.3, 1.1)}  # starts, relative to the range and the maximum of friction
_MODERATE = 1e3  # working range of the law during the fit, relative to the loading rates
_NUISANCE = {TREND, TREND_IN_TIME, START_STATE}
_START = tuple(
    Coordinate(name=name, unit="", low=-most, high=most, start=(-1e-3, 1e-3), logarithmic=False)
    for name, most in ((START_STATE, 5.0), (START_RATE, 2.0))
)


@dataclass(frozen=True, kw_only=True)
class Setup:
    """An experiment with the samples of the record that it simulates (`used`), and notes on its assumptions."""

    experiment: Experiment
    used: ndarray
    notes: tuple[str, ...]
    starts: tuple[Coordinate, ...] = ()  # coordinates that an unsteady beginning adds


def set_up(
    record: Record,
    law: type[FrictionLaw],
    stiffness: float | None,
    loading: Loading | None = None,
    nuisance: Collection[str] = (),
) -> Setup:
    """Experiment of a prepared record, chosen by the variables of the law and the measured columns.

    `nuisance` names further fitted parameters: `TREND` or `TREND_IN_TIME`, `START_STATE` (with `START_RATE`). Raises
    `RecordError` when the law depends on neither slip nor state, or a column is missing.
    """
    setup = _setup(law, record, stiffness, loading, START_STATE in nuisance)
    for name, along in ((TREND, record.path), (TREND_IN_TIME, record.time)):
        if name in nuisance and along is not None and np.ptp(along[setup.used]) > 0:
            along = along[setup.used] - along[0]
            return replace(setup, experiment=trended(setup.experiment, along, record.largest, name))
    return setup


def _template(law: type[FrictionLaw]) -> FrictionLaw:
    return law(**dict.fromkeys(law.quantities(), 1.0))


def _coordinate(name: str, law: type[FrictionLaw], record: Record, path: float) -> Coordinate:
    """Search range of one quantity of a law; `path` is the largest possible slip of the block [m]."""
    unit = law.quantities()[name].metadata["unit"]
    if name in ("evolution_effect", SECOND_EFFECT):
        start = (-0.005, 0.025) if name == "evolution_effect" else (-0.01, 0.01)
        return Coordinate(name=name, unit=unit, low=-1.0, high=1.0, start=start, logarithmic=False)
    size, (low, high, start) = record.largest, _EFFECTS
    if unit == "m":
        low, high, start = path * 1e-6, path * 10, (path * 1e-3, path * 0.3)
    elif name in _SHARES:
        spread = size if name == "residual" else float(np.ptp(record.friction[record.friction > size / 3]))
        low, high, start = size * 1e-4, size * 10, (spread * _SHARES[name][0], spread * _SHARES[name][1])
    elif name == "reference_coefficient":
        level = float(np.median(record.friction[: max(len(record.friction) // 20, 1)]))
        low, high, start = size * 1e-2, size * 10, (level * 0.999, level * 1.001)
    return Coordinate(name=name, unit=unit, low=low, high=high, start=start)


def _of_slip(
    law: type[FrictionLaw], record: Record, stiffness: float | None, loading: Loading | None, unsteady: bool
) -> Setup:
    slip, rate = sp.symbols("slip rate", positive=True)
    if sp.sympify(_template(law).symbolic().coefficient(slip, rate)).has(rate):
        raise RecordError(
            f"a law to identify must depend on slip or on a state. Received {law.name}, which depends on the slip "
            "rate alone. Choose another law."
        )
    return _measured_slip(record, law) if record.slip is not None else _spring_loaded(record, law, stiffness)


def _sliding(
    law: type[FrictionLaw], record: Record, stiffness: float | None, loading: Loading | None, unsteady: bool
) -> Setup:
    if record.load_point is None or loading is None:
        raise RecordError(
            f"{law.name} needs the motion of the load point, which drives the experiment. Received none. Add "
            "load_point_displacement [um] or load_point_rate [um/s]."
        )
    first = loading.first_rate
    if not first > 0:
        raise RecordError(
            f"a record for {law.name} must begin in steady sliding. Received a load point that moves at {first:.3g} "
            "m/s. Remove the samples before steady sliding with --from."
        )
    drive, measured = loading.drive(record)
    path = float(np.ptp(record.load_point))
    fast = max(float(np.max(drive.rates)), first)
    ends = {"slowest_rate": first / _MODERATE, "fastest_rate": fast * _MODERATE}
    rates = {"reference_rate": float(f"{first:.6g}"), **ends}  # chosen, not fitted
    chosen = {name: rates[name] for name in law.quantities() if name in rates}
    optional = {field.name for field in fields(law) if field.default is not MISSING}  # type: ignore[arg-type]
    names = [name for name in law.quantities() if name not in chosen and name not in optional]
    coordinates = [_coordinate(name, law, record, path) for name in names]
    coordinates += _stiffness(record, path, stiffness)
    coordinates += _START if unsteady else ()
    experiment = SlidingExperiment(
        law=law(**dict.fromkeys(names, 1.0), **chosen),
        drive=drive,
        normal_unit=record.normal_unit,
        coordinates=tuple(coordinates),
        stiffness=stiffness,
        steps=tuple((length,) for length in drive.lengths.tolist()),
        measured=measured,
    )
    begins = f"in {'a state other than ' if unsteady else ''}steady sliding at {first:.4g} m/s"
    notes = (f"the record begins {begins}", *loading.notes)
    late = delayed(experiment, *loading.delays(record))
    return Setup(experiment=late, used=np.ones(len(record.time), dtype=bool), notes=notes, starts=_START)


_setup = by_equilibrium(rest=_of_slip, sliding=_sliding)


def _stiffness(record: Record, path: float, given: float | None) -> list[Coordinate]:
    """Coordinate of the stiffness unless it is given, scaled by the largest shear load divided by the path."""
    if given is not None:
        return []
    whole = float(np.max(record.normal) * np.max(np.abs(record.friction))) / path
    start, unit = (whole, whole * 1e3), record.stiffness_unit
    return [Coordinate(name=STIFFNESS, unit=unit, low=whole * 1e-2, high=whole * 1e6, start=start)]


def _measured_slip(record: Record, law: type[FrictionLaw]) -> Setup:
    """Experiment with measured slip; samples up to the last one indistinguishable from zero slip are omitted."""
    assert record.slip is not None
    noise = scatter(record.time, record.slip)
    resting = np.flatnonzero(record.slip <= FAR_OFF * noise)
    used = np.arange(len(record.slip)) > (resting[-1] if len(resting) else -1)
    count, least = int(used.sum()), 3 * len(law.quantities())
    if count < least:
        raise RecordError(
            f"slip must exceed its noise in at least {least} samples at the end. Received {count}. Measure slip from "
            "its onset, forward positive."
        )
    slip = record.slip[used]
    coordinates = tuple(_coordinate(name, law, record, float(slip.max())) for name in law.quantities())
    experiment = MeasuredSlip(law=_template(law), slip=slip, slip_noise=noise, coordinates=coordinates)
    note = f"friction as a function of the measured slip, in the {count} samples with slip"
    return Setup(experiment=experiment, used=used, notes=(note,))


def _spring_loaded(record: Record, law: type[FrictionLaw], stiffness: float | None) -> Setup:
    if record.load_point is None:
        raise RecordError(
            f"{law.name} needs the column slip, or the motion of the load point. Received neither. Add slip [mm], say."
        )
    path = float(np.ptp(record.load_point))
    first, size = float(record.friction[0]), record.largest
    start = (first - 0.02 * size, first + 0.02 * size)
    coordinates = (
        *(_coordinate(name, law, record, path) for name in law.quantities()),
        *_stiffness(record, path, stiffness),
        Coordinate(name=START, unit="", low=-size, high=2 * size, start=start, logarithmic=False),
    )
    drawn, normal = record.load_point - record.load_point[0], record.normal
    experiment = SpringLoaded(
        law=_template(law), load_point=drawn, normal=normal, coordinates=coordinates, stiffness=stiffness
    )
    notes = ("the block sticks at first and has not slipped before", "without inertia")
    return Setup(experiment=experiment, used=np.ones(len(record.time), dtype=bool), notes=notes)


AGEING, SLIP = "rate-and-state-aging", "rate-and-state-slip"
_LEAST_NEAR = 2  # least number of searches if the first begins near the fit of a similar law
_EFFECTS_OF = ("direct_effect", "evolution_effect", SECOND_EFFECT)
_MOST_BETTER = 10
_MOST_MOVES = 4  # corrections of the times of rate changes, each to first order in the delay
_TRENDS = {"": "without a trend", TREND: "with a trend in displacement", TREND_IN_TIME: "with a trend in time"}
_ONE_TREND = {"displacement": {TREND}, "time": {TREND_IN_TIME}}
TREND_CHOICES = "auto", *_ONE_TREND, "none"
_STAYS = 0.5  # standard deviations: a smaller delay needs no correction
_NEGLIGIBLE = 0.1  # negligible effect of a rate error, in standard deviations of the whole record
_UNSEEN = 1e-5  # resolution that no testing machine reaches, as a share of the range of friction
_CHANCE = 0.01  # probability of fitting a trend or an unsteady beginning to noise; such a fit changes a - b


def identify(
    record: Record | str | Path,
    law: str | None = None,
    *,
    stiffness: float | None = None,
    normal_stress: float | None = None,
    rates: Sequence[float] = (),
    states: int = 1,
    trend: str = "auto",
    seed: int = 0,
) -> Identification:
    """Friction parameters of a laboratory record, each with its 95 % profile-likelihood interval.

    A law with state is fitted by simulation of the experiment: a spring connects a block without inertia to the load
    point, whose rate is piecewise constant. A law that weakens with slip is fitted at the measured slip; if no slip is
    measured, a block is simulated that sticks at first and then slips against a stiff spring. A trend of friction with
    displacement and an unsteady beginning are fitted as well where the likelihood favours them. Noise is white, with a
    part correlated over time or displacement where the likelihood favours it. In a long record neighbouring samples are
    averaged, and each mean has the weight of its samples.

    Parameters
    ----------
    record : Record, str or Path
        A record, or the path of its file, see `read_record`.
    law : str, optional
        Name of a friction law with state, or of one that depends on slip. By default the ageing and the slip law are
        both fitted, and the likelier one is selected.
    stiffness : float, optional
        Machine stiffness [Pa/m; N/m for a record of forces, 1/m for friction alone], exact; fitted unless given.
    normal_stress : float, optional
        Constant normal stress [Pa], where a file has no such column.
    rates : sequence of float
        Successive rates of the load point [m/s], if known; by default from its displacement.
    states : int
        1, or 2 for a second evolution effect with its own critical slip, which a fault file cannot contain.
    trend : str
        ``"displacement"``, ``"time"``, ``"none"``, or ``"auto"``: fitted if an F test (level 1 %) requires it.
    seed : int
        Seed of the random initial values.

    Returns
    -------
    Identification

    Raises
    ------
    RecordError
        When the record cannot be read, or is unsuitable for the law; or for another number of states.
    UnknownNameError, ParameterError
        For a law or trend that does not exist; for a stiffness, stress or seed out of range.
    """
    require_positive(normal_stress=1.0 if normal_stress is None else normal_stress)
    if not isinstance(record, Record):
        record = read_record(record, normal_stress=normal_stress)
    elif normal_stress is not None:
        raise RecordError("normal_stress is for a file. Received it with a Record. Set it in the record.")
    return identified_as(record, kinds_of(law, states), stiffness=stiffness, rates=rates, trend=trend, seed=seed)


def kinds_of(law: str | None, states: int) -> list[type[FrictionLaw]]:
    """Laws to fit: the requested law, or the ageing and the slip law; `RecordError` unless `states` is 1 or 2."""
    if states not in (1, 2):
        raise RecordError(f"states must be 1 or 2. Received {states}. Use 2 if one state does not explain the record.")
    return [friction_law(name) if states == 1 else with_two_states(name) for name in ([law] if law else [AGEING, SLIP])]


def identified_as(
    record: Record,
    kinds: Sequence[type[FrictionLaw]],
    *,
    stiffness: float | None = None,
    rates: Sequence[float] = (),
    trend: str = "auto",
    seed: int = 0,
) -> Identification:
    """Identification with given laws, of which the likeliest is selected."""
    require_whole(0, seed=seed)
    require_positive(stiffness=1.0 if stiffness is None else stiffness)
    require_known(trend, TREND_CHOICES, "trend", UnknownNameError)
    if len(record.time) < 2 or not np.ptp(record.friction) > 0:
        raise RecordError("a record must have samples in which friction changes. Received none. Give a longer one.")
    means, loading = prepared(record, rates)
    choice = _Choice(record=means, raw=record, loading=loading, stiffness=stiffness, trend=trend, seed=seed)
    return choice.identified(kinds)


@dataclass(frozen=True, kw_only=True)
class _Fitted:
    """A setup and the best fit to it."""

    kind: type[FrictionLaw]
    setup: Setup
    best: Fit


@dataclass(frozen=True, kw_only=True)
class _Choice:
    """Selection of the law, the nuisance parameters and the noise of a record."""

    record: Record  # means of the samples
    raw: Record  # record as measured
    loading: Loading | None
    stiffness: float | None
    seed: int
    trend: str = "auto"
    by_load: ndarray | None = None  # times of rate changes by the load point alone, uncorrected [s]

    def identified(self, kinds: Sequence[type[FrictionLaw]]) -> Identification:
        """Profiles about the best fit of the likeliest law; fitted delays correct the times of rate changes."""
        first = _ONE_TREND.get(self.trend, {TREND} if self.trend == "auto" else set())
        fits: list[_Fitted] = []
        for kind in kinds:
            try:
                near = fits[0].best if fits else None
                if len(kind.state_names) > 1:  # states are hard to distinguish with a trend; first fit without trend
                    near = self._fitted(kind, (), None).best
                fits.append(self._fitted(kind, first, near))
            except RecordError:  # for example if this law jumps with every candidate
                if not fits:
                    raise
        choice = self
        for _ in range(_MOST_MOVES):
            better = choice._extended(min(fits, key=lambda fitted: fitted.best.sum_of_squares))
            if (moved := choice._moved(better)) is None:
                break
            choice = moved
            fits = [choice._fitted(each.kind, _nuisance(better), better.best, start=False) for each in fits]
        better, rival, others = choice._chosen(fits)
        result = replace(profiled(better.best, choice.record, better.setup, self.seed), rival=rival)
        return replace(result, assessment=choice._assessed(result, others))

    def _moved(self, fitted: _Fitted) -> "_Choice | None":
        """Choice with the times of rate changes corrected by fitted delays; None if they need no correction."""
        coordinates = fitted.best.experiment.coordinates
        places = [place for place, c in enumerate(coordinates) if c.name.startswith(DELAY)]
        delays, errors = fitted.best.fitted[places], fitted.best.standard_errors[places]
        errors = np.where(errors < np.array([coordinates[place].high for place in places]), errors, 0)
        if self.loading is None or not np.any(np.abs(delays) > _STAYS * errors):
            return None
        pieces, (after, most) = self.loading.pieces, self.loading.delays(self.record)
        begins, original = pieces.begins.copy(), self.by_load if self.by_load is not None else pieces.begins
        for delay, samples, end in zip(delays.tolist(), after.T, most.tolist(), strict=True):
            first = self.record.time[np.flatnonzero(samples)[0]]
            place = int(np.searchsorted(begins, first, side="right")) - 1
            begins[place] = np.clip(begins[place] + delay, original[place] - end, original[place] + end)
        pieces = replace(pieces, begins=np.maximum.accumulate(np.clip(begins, self.raw.time[0], None)))
        record, loading = prepared(self.raw, (), pieces)
        return replace(self, record=record, loading=loading, by_load=original)

    def _chosen(self, fits: list[_Fitted]) -> tuple[_Fitted, OtherLaw | None, dict[str, tuple[_Fitted, float]]]:
        """Best law, with trend and unsteady beginning where likelier; rival law; alternative fits.

        Alternatives are fits with other trends, and of the rival law if the record hardly distinguishes the laws.
        """
        noise, rival = self._noise(min(fits, key=lambda fitted: fitted.best.sum_of_squares)), None
        fits = sorted((_with_noise(each, noise) for each in fits), key=lambda fitted: fitted.best.sum_of_squares)
        if len(fits) > 1:
            squares, excess = advantage(fits[0].best, fits[1].best)
            rival = OtherLaw(law=fits[1].kind.name, squares=squares, excess=excess)
        better = self._extended(fits[0])
        better, others = self._trend(self._without_start(_with_noise(better, self._noise(better))))
        noise = self._noise(better)
        better = _with_noise(better, noise)
        if rival is not None and rival.excess < DECISIVE:
            other = _with_noise(self._fitted(fits[1].kind, _nuisance(better), fits[1].best, start=False), noise)
            others[f"by {rival.law}"] = other, advantage(better.best, other.best)[1]
        return better, rival, others

    def _trend(self, fitted: _Fitted) -> tuple[_Fitted, dict[str, tuple[_Fitted, float]]]:
        """Fit with the selected trend or without one; other fits, with the excess of their AIC.

        A trend in time replaces one in displacement where its AIC is lower by `DECISIVE`.
        """
        own, rest = next(iter(_nuisance(fitted) & _TRENDS.keys()), ""), _nuisance(fitted) - _TRENDS.keys()
        names = {"", own} if self.trend in _ONE_TREND else _TRENDS
        same = fitted, fitted.best.sum_of_squares
        fits = {name: same if name == own else self._refitted(fitted, {*rest, name} - {""}) for name in sorted(names)}
        aic = {name: fitted.best.excess(squares) + 2 * bool(name) for name, (_, squares) in fits.items()}
        in_time = self.trend == "auto" and aic[TREND_IN_TIME] < aic[own] - DECISIVE
        selected = TREND_IN_TIME if in_time else own
        if selected and not needed(fits[selected][0].best, fits[""][1]):
            selected = ""
        better, _ = fits.pop(selected)
        others = {_TRENDS[name]: (other, aic[name] - aic[selected]) for name, (other, _) in fits.items()}
        return better if better is fitted else _settled(better), others

    def _assessed(self, result: Identification, others: Mapping[str, tuple[_Fitted, float]]) -> Assessment:
        """Tests of the assumptions, and quantities that the record does not determine."""
        values = result.fit.experiment.outward(result.fit.fitted)
        checks, factor = checks_of(result.fit, self.raw, self.record, result.used, self.loading, values)
        shift, doubted = self._late_trend(result), {}
        for trend, (other, excess) in others.items():
            if result.difference is not None and in_doubt(excess, shift):
                try:
                    doubted[trend] = _difference(other.best, jointly=False), excess
                except BetterFit:  # the profile leads to another minimum: the sign is undetermined
                    doubted[trend] = replace(result.difference, low=-math.inf, high=math.inf), excess
        unsteady = unsteady_beginning(result.difference, values, self.loading) if self.loading is not None else ""
        sign = sign_check(result.difference, doubted, shift, unsteady)
        checks = checks if sign is None else (*checks, sign)
        undetermined = (*result.undetermined(), *([sign.sentence] if sign is not None and not sign.passed else []))
        return Assessment(checks=checks, factor=factor, open=undetermined, experiments=tuple(result.experiments(sign)))

    def _late_trend(self, result: Identification) -> float | None:
        """Change of a - b if the trend begins at the first change of rate; None without trend or if decisively worse.

        A slow evolution of friction after a change of rate looks like a trend that is absent before the change.
        """
        fit, loading, load = result.fit, self.loading, self.record.load_point
        values = fit.experiment.outward(fit.fitted)
        if TREND not in values or loading is None or load is None or not len(loading.steps):
            return None
        setup = set_up(self.record, type(fit.experiment.law), self.stiffness, loading, {START_STATE})
        after = np.maximum(load - load[0] - loading.before, 0)
        late: Experiment = trended(setup.experiment, after, self.record.largest)
        at = late.near(values)
        for _ in range(2):
            late = late.resolved(at, fit.accuracy)
            at, squares = minimised(late, fit.measured, fit.weights, at)
        if fit.excess(squares) >= DECISIVE:
            return None
        return values[TREND] * float(after[-1]) / (loading.first_step or math.inf)

    def _fitted(
        self, kind: type[FrictionLaw], nuisance: Collection[str], near: Fit | None, start: bool = True
    ) -> _Fitted:
        """Best fit of a law: the search begins near the fit `near`, and with `start` also at random points."""
        setup = set_up(self.record, kind, self.stiffness, self.loading, nuisance)
        measured = self.record.friction[setup.used]
        counts = None if self.record.counts is None else self.record.counts[setup.used]
        how, at = {}, None
        if near is not None:
            how = {"least": _LEAST_NEAR} if start else {"least": 1, "most": 0}
            values = near.experiment.outward(near.fitted).items()
            at = setup.experiment.near({name: v for name, v in values if start or not name.startswith(DELAY)})
        best = fit(setup.experiment, measured, seed=self.seed, counts=counts, near=at, **how)
        return _Fitted(kind=kind, setup=setup, best=best)

    def _noise(self, fitted: _Fitted) -> CorrelatedNoise | None:
        """Likeliest noise of a fit, with the uncertainty of load-point rates; None for white noise alone."""
        best, used, path = fitted.best, fitted.setup.used, self.record.path
        slopes = np.nan_to_num(best.experiment.slopes(best.fitted), posinf=0, neginf=0)
        where, time = None if path is None else path[used], self.record.time[used]
        moved = self._moved_by_rates(fitted)
        noise = noise_of(best.residuals, np.hstack([slopes, moved]), best.counts, time, where, best.used)
        none = CorrelatedNoise(0.0, 1.0, time, best.counts, True)
        return replace(noise or none, common=moved / best.noise) if moved.size else noise

    def _moved_by_rates(self, fitted: _Fitted) -> ndarray:
        """Change of friction per standard deviation of each load-point rate, where it is not negligible.

        Rates from noisy displacements are unknowns of known standard deviation. As part of the covariance of the
        samples they widen the regions of a and b as much as if they were fitted with that deviation as a prior.
        """
        best, loading = fitted.best, self.loading
        columns: list[ndarray] = []
        if loading is not None and not loading.pieces.rough and loading.pieces.errors is not None:
            values = best.experiment.outward(best.fitted)
            effects = [values.get(name, 0.0) for name in _EFFECTS_OF]
            size, strengthens = max(map(abs, effects)), effects[0] - sum(effects[1:])
            negligible = best.noise * _NEGLIGIBLE / float(np.sqrt(np.sum(best.counts)))
            before = best.experiment.friction(best.fitted)
            for place, error in enumerate(loading.pieces.errors.tolist()):
                if not negligible < size * error < size:
                    continue
                rates = loading.pieces.rates.copy()
                rates[place] *= 1 + error
                other = replace(loading, pieces=replace(loading.pieces, rates=rates))
                setup = set_up(self.record, fitted.kind, self.stiffness, other, _nuisance(fitted))
                if len(setup.experiment.coordinates) == len(best.fitted):
                    moved = setup.experiment.resolved(best.fitted, best.accuracy).friction(best.fitted) - before
                    moved += strengthens * np.log1p(error) * (place == 0)  # this rate is also the reference rate
                    columns += [moved] * bool(np.all(np.isfinite(moved)))
        columns = [each for each in columns if np.linalg.norm(each * np.sqrt(best.counts)) > _NEGLIGIBLE * best.noise]
        return np.array(columns).T.reshape(len(best.measured), len(columns))

    def _extended(self, fitted: _Fitted) -> _Fitted:
        """Fit with an unsteady beginning, where it improves the fit significantly."""
        if not fitted.setup.starts:
            return fitted
        wider, _ = self._refitted(fitted, {*_nuisance(fitted), START_STATE})
        return _settled(wider) if needed(wider.best, fitted.best.sum_of_squares, len(_START)) else fitted

    def _without_start(self, fitted: _Fitted) -> _Fitted:
        """Fit without an unsteady beginning, unless it improves the fit significantly."""
        if START_STATE not in _nuisance(fitted):
            return fitted
        narrower, squares = self._refitted(fitted, _nuisance(fitted) - {START_STATE})
        return fitted if needed(fitted.best, squares, len(_START)) else _settled(narrower)

    def _refitted(self, fitted: _Fitted, nuisance: Collection[str]) -> tuple[_Fitted, float]:
        """Fit with other nuisance parameters at the same samples with the same noise, and its sum of squares."""
        other, best = self._fitted(fitted.kind, nuisance, fitted.best, start=False), fitted.best
        at, squares = minimised(other.best.experiment, best.measured, best.weights, other.best.fitted)
        return replace(other, best=replace(best, experiment=other.best.experiment, fitted=at)), squares


def profiled(
    best: Fit, record: Record, setup: Setup, seed: int, names: Collection[str] | None = None
) -> Identification:
    """Profiles of `names` or all parameters about the best fit, restarted from any better fit on a profile."""
    for _ in range(_MOST_BETTER):
        try:
            estimates = _estimates(best, names)
            difference = _difference(best)
            break
        except BetterFit as better:
            best = settled(replace(best, fitted=better.fitted, agreeing=1))
    else:
        raise RecordError(
            "a record must have one best fit. Received one whose profiles repeatedly find better fits. Give the "
            "stiffness, or a record with more steps."
        )
    pair = [name for name in _EFFECTS_OF if name in estimates]
    if difference is not None and difference.identified and not any(estimates[name].identified for name in pair):
        # along a valley of equal fits, the ends found by a search are meaningless
        ends: dict[str, Any] = {"low": -math.inf, "high": math.inf, "least": -math.inf, "most": math.inf}
        estimates |= {name: replace(estimates[name], **ends) for name in pair}
    law, notes = best.experiment.best_law(best.fitted), best.experiment.remarks(best.fitted, best.noise)
    entries: dict[str, Any] = {"record": record, "used": setup.used, "notes": (*setup.notes, *notes), "seed": seed}
    return Identification(fit=best, law=law, estimates=estimates, difference=difference, **entries)


def needed(best: Fit, squares: float, fewer: int = 1) -> bool:
    """Whether a fit is significantly better (level 1 %) than one that lacks `fewer` of its parameters.

    `squares` is the latter's sum of squares. Fisher's F test; an improvement below the resolution of a testing machine
    does not count.
    """
    resolution = _UNSEEN * float(np.ptp(best.measured))
    measurable = squares - best.sum_of_squares > resolution**2 * best.degrees_of_freedom
    return measurable and best.excess(squares) > best.threshold(fewer, _CHANCE)


def _nuisance(fitted: _Fitted) -> set[str]:
    return {c.name for c in fitted.best.experiment.coordinates} & _NUISANCE


def _settled(fitted: _Fitted) -> _Fitted:
    return replace(fitted, best=settled(fitted.best))


def _with_noise(fitted: _Fitted, noise: CorrelatedNoise | None) -> _Fitted:
    white = noise is None and fitted.best.correlated is None
    return fitted if white else _settled(replace(fitted, best=replace(fitted.best, correlated=noise)))


def _estimates(best: Fit, wanted: Collection[str] | None = None) -> dict[str, ParameterEstimate]:
    """Estimates of the `wanted` or all coordinates, those of the law first.

    For a law with both effects, their difference is a coordinate of the profiles: if the record determines only the
    difference, the valley of equal fits is straight.
    """
    names, effects = [c.name for c in best.experiment.coordinates], _effects(best)
    estimates = {}
    for i, name in enumerate(names):
        if wanted is None or name in wanted:
            direct = effects[:1] == [i]
            plain = len(effects) < 2 or (direct and len(effects) > 2)
            estimates[name] = _estimate(best, i) if plain else _turned(best, i, effects[::-1] if direct else effects)
    return estimates


def _effects(best: Fit) -> list[int]:
    """Indices of the direct effect and all evolution effects."""
    names = [c.name for c in best.experiment.coordinates]
    return [names.index(name) for name in _EFFECTS_OF if name in names]


def _difference(best: Fit, jointly: bool = True) -> ParameterEstimate | None:
    """Estimate of the difference of the direct effect and all evolution effects."""
    effects = _effects(best)
    return _turned(best, effects[0], effects, jointly) if len(effects) > 1 else None


def _turned(best: Fit, place: int, effects: Sequence[int], jointly: bool = True) -> ParameterEstimate:
    """Estimate in coordinates with the difference of the effects in place of the first effect."""
    turned = Difference(whole=best.experiment, first=effects[0], seconds=tuple(effects[1:]))
    try:
        return _estimate(replace(best, experiment=turned, fitted=turned.difference(best.fitted)), place, jointly)
    except BetterFit as better:
        raise BetterFit(turned.inside(better.fitted)) from None


def _estimate(best: Fit, place: int, jointly: bool = True) -> ParameterEstimate:
    """Estimate of one coordinate, with its own interval and, if `jointly`, that of all coordinates at once."""
    profile = Profile(best, place)
    alone = profile.interval(best.threshold(1))
    of_all = profile.interval(best.threshold(len(best.fitted))) if jointly else alone
    return estimate(profile, alone, of_all)
