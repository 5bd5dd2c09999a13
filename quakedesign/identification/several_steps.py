"""Several velocity steps of one experiment: each fitted alone, and one law fitted to all.

The common fit shares the parameters of the law and the stiffness. Each step has its own level, trend, beginning, delays
and noise; its residuals are divided by the standard deviation of its noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray
from scipy import stats

from quakedesign.errors import RecordError
from quakedesign.fault import FrictionLaw
from quakedesign.files import Json
from quakedesign.identification.assessment import Assessment, Check, sign_check
from quakedesign.identification.experiment import STIFFNESS, Coordinate, Experiment
from quakedesign.identification.fitting import Fit, minimised, weighted
from quakedesign.identification.identification_result import Identification
from quakedesign.identification.identify import Setup, identified_as, kinds_of, profiled
from quakedesign.identification.loading import prepared
from quakedesign.identification.record import Record, part, read_record, read_windows
from quakedesign.text import counted, shown

_LEVEL = "reference_coefficient"
_UNLIKELY = 0.01  # probability below which one law does not explain all steps
_ROUNDS = 3  # alternations between simulation steps and the common fit


@dataclass(frozen=True, kw_only=True)
class Steps:
    """Identifications of several steps, and that of one law for all.

    Attributes
    ----------
    steps : tuple of Identification
    common : Identification
        Identification of the shared parameters; samples of its fit are in standard deviations of their step's noise.
    probability : float
        Probability of differences as large as these by chance, if one law holds for all steps (Fisher's F).
    """

    steps: tuple[Identification, ...]
    common: Identification
    probability: float

    def to_dict(self) -> Json:
        """JSON-able facts of the common fit, in SI units, and of every step under `steps`."""
        steps = [{"record": step.record.name, **step.to_dict()} for step in self.steps]
        return {**self.common.to_dict(), "probability": self.probability, "steps": steps}


def read_steps(
    path: str | Path, steps: str = "", *, begin: str | None = None, end: str | None = None, **how: Any
) -> list[Record]:
    """Records of the steps of a file: windows ``0 s to 60 s, 60 s to 120 s``, or the parts of `cut` with ``auto``.

    By default one record of the whole file. `how` are other arguments of `read_record`, whose errors are raised here
    too; `RecordError` also for overlapping windows.
    """
    if steps in ("", "auto"):
        record = read_record(path, begin=begin, end=end, **how)
        return cut(record) if steps else [record]
    if begin is not None or end is not None:
        raise RecordError(f"--from and --to are for one window. Received them with --steps {shown(steps)}. Omit them.")
    parts: list[Record] = []
    windows = [[end.strip() for end in each.split(" to ")] for each in steps.split(",")]
    named = [" to ".join(ends) for ends in windows]
    if wrong := [name for name, ends in zip(named, windows, strict=True) if len(ends) != 2]:
        raise RecordError(f"--steps must name windows as 0 s to 60 s, 60 s to 120 s. Received {shown(wrong[0])}.")
    records = read_windows(path, [(begin, end) for begin, end in windows], **how)
    for window, record in zip(named, records, strict=True):
        for other in parts:
            shared = np.isin((record.origin + record.time).round(9), (other.origin + other.time).round(9))
            if shared.sum() > 1:
                raise RecordError(
                    f"--steps windows must not overlap. Received {shared.sum()} samples of {window} twice. Shorten one."
                )
            record = part(record, ~shared, record.name)
        parts.append(replace(record, name=f"{record.name} {window}"))
    return parts


def cut(record: Record) -> list[Record]:
    """Parts of a record with one large change of rate each, cut midway; `RecordError` for fewer than two changes."""
    _, loading = prepared(record)
    begins = np.empty(0) if loading is None else loading.steps
    if len(begins) < 2:
        raise RecordError(
            f"a record that is cut into steps must have two changes of rate by over 25 %. Received {len(begins)}. "
            "Name the windows: --steps '0 s to 60 s, 60 s to 120 s'."
        )
    ends = [-np.inf, *((begins[1:] + begins[:-1]) / 2).tolist(), np.inf]
    inside = [(record.time >= low) & (record.time < high) for low, high in pairwise(ends)]
    return [part(record, each, f"{record.name}, step {i}") for i, each in enumerate(inside, start=1)]


def identify_steps(
    records: Sequence[Record],
    law: str | None = None,
    *,
    stiffness: float | None = None,
    rates: Sequence[float] = (),
    states: int = 1,
    trend: str = "auto",
    seed: int = 0,
) -> Steps:
    """Friction parameters of every step, shared parameters of all steps, and whether one law explains all.

    Parameters
    ----------
    records : sequence of Record
        One record per step, at least two, without common samples.
    law, stiffness, rates, states, trend, seed
        As for `identify`; the same `rates` apply to every step.

    Raises
    ------
    RecordError
        For fewer than two records, missing columns that the law needs, or stiffnesses of steps in different units.
    """
    if len(records) < 2:
        raise RecordError(f"a common fit must have at least 2 records. Received {len(records)}. Use identify for one.")
    units = sorted({record.stiffness_unit for record in records if record.load_point is not None})
    if len(units) > 1:
        raise RecordError(
            f"stiffness must have one unit in all steps. Received {', '.join(units)}. Use stresses in every step."
        )
    more: dict[str, Any] = {"stiffness": stiffness, "rates": rates, "trend": trend, "seed": seed}
    kinds = kinds_of(law, states)
    steps = [identified_as(record, kinds, **more) for record in records]
    worse = {kind.name: sum(s.rival.excess for s in steps if s.rival and s.rival.law == kind.name) for kind in kinds}
    kind = min(kinds, key=lambda each: worse[each.name])
    steps = [
        step if step.law.name == kind.name else identified_as(record, [kind], **more)
        for step, record in zip(steps, records, strict=True)
    ]
    best, shared, squares = _common(steps)
    notes = tuple(f"step {i}: {note}" for i, step in enumerate(steps, start=1) for note in step.notes[:2])
    setup = Setup(experiment=best.experiment, used=np.ones(len(best.measured), dtype=bool), notes=notes)
    name = f"{steps[0].record.name} and {counted(len(steps) - 1, 'more step')}"
    places = np.arange(float(len(best.measured)))
    whole = replace(steps[0].record, name=name, time=places, friction=best.measured, load_point=None, slip=None)
    common = profiled(best, whole, setup, seed, [*shared, _LEVEL])
    count = len(shared) * (len(steps) - 1)
    excess = squares / max(step.fit.correlation for step in steps)
    probability = float(stats.f.sf(excess / count, count, best.pieces))
    common = replace(common, assessment=_assessed(common, steps, probability))
    return Steps(steps=tuple(steps), common=common, probability=probability)


def _common(steps: Sequence[Identification]) -> tuple[Fit, list[str], float]:
    """Common fit, names of shared parameters, and its sum of squares minus those of the separate fits of the steps."""
    fits = [step.fit for step in steps]
    of_steps = [fit.experiment.coordinates for fit in fits]
    quantities = steps[0].law.quantities()
    everywhere = set.intersection(*({c.name for c in own} for own in of_steps))
    shared = [c.name for c in of_steps[0] if c.name in everywhere & {*quantities, STIFFNESS} - {_LEVEL}]
    coordinates: list[Coordinate] = [c for c in of_steps[0] if c.name in shared]
    places, starts = [], []
    for i, (fit, own) in enumerate(zip(fits, of_steps, strict=True)):
        others = [c for c in own if c.name not in shared]
        at = [shared.index(c.name) if c.name in shared else len(coordinates) + others.index(c) for c in own]
        places.append(np.array(at))
        coordinates += [replace(c, name=c.name if i == 0 else f"{c.name} (step {i + 1})") for c in others]
        starts += [value for value, c in zip(fit.fitted.tolist(), own, strict=True) if c.name not in shared]
    rows = [[[c.name for c in own].index(name) for name in shared] for own in of_steps]
    values = np.array([fit.fitted[row] for fit, row in zip(fits, rows, strict=True)])
    sharp = np.array([np.maximum(fit.standard_errors[row] ** -2.0, 1e-12) for fit, row in zip(fits, rows, strict=True)])
    start = np.array([*(np.sum(sharp * values, axis=0) / np.sum(sharp, axis=0)), *starts])
    parts = tuple(fit.experiment for fit in fits)
    joint = _Joint(fits=tuple(fits), parts=parts, places=tuple(places), coordinates=tuple(coordinates))
    measured = joint.joined([fit.measured for fit in fits])
    ones, pieces = np.ones(len(measured)), sum(fit.freedom_of_noise for fit in fits)
    best = Fit(experiment=joint, fitted=start, measured=measured, counts=ones, used=ones > 0, agreeing=1, starts=1)
    best = replace(best, pieces=pieces)
    for _ in range(_ROUNDS):
        finer = best.experiment.resolved(best.fitted, best.accuracy)
        fitted, _ = minimised(finer, measured, ones, best.fitted)
        best = replace(best, experiment=finer, fitted=fitted)
    return best, shared, max(best.sum_of_squares - sum(fit.sum_of_squares / fit.noise**2 for fit in fits), 0.0)


def _assessed(common: Identification, steps: Sequence[Identification], probability: float) -> Assessment:
    """Whether one law explains all steps, and whether a - b has one sign in it and in at least one step."""
    text = "explains" if probability >= _UNLIKELY else "does not explain"
    sentence = f"one set of parameters {text} all steps (p-value {probability:.2g})"
    one = Check(name="common", passed=probability >= _UNLIKELY, value=probability, limit=_UNLIKELY, sentence=sentence)
    signs = {np.sign(c.value) for step in steps for c in step.assessment.checks if c.name == "sign" and c.passed}
    sign = sign_check(common.difference, {})
    if sign is not None and sign.passed and signs != {np.sign(sign.value)}:
        why = "the steps disagree" if signs else "no step alone determines it"
        sign = replace(sign, passed=False, sentence=f"the sign of a - b is open: {why}")
    checks = (one, *([sign] if sign is not None else []))
    return Assessment(
        checks=checks,
        factor=max(step.assessment.factor for step in steps),
        open=(*common.undetermined(), *(check.sentence for check in checks if not check.passed)),
        experiments=tuple(common.experiments(sign)),
    )


@dataclass(frozen=True, kw_only=True)
class _Joint(Experiment):
    """Steps with shared coordinates; samples are made independent, in standard deviations of their step's noise."""

    fits: tuple[Fit, ...]  # separate fits of the steps, which give the weights of samples
    parts: tuple[Experiment, ...]
    places: tuple[ndarray, ...]  # indices of the coordinates of each step among all coordinates
    coordinates: tuple[Coordinate, ...]

    def joined(self, values: Sequence[ndarray]) -> ndarray:
        """Weighted values of the samples of each step."""
        return np.concatenate([weighted(w, v) for w, v in zip(self._weights, values, strict=True)])

    @cached_property
    def _weights(self) -> list[ndarray]:
        return [fit.weights / fit.noise for fit in self.fits]

    def friction(self, fitted: ndarray) -> ndarray:
        """Weighted friction of all steps."""
        return self.joined([each.friction(fitted[at]) for each, at in zip(self.parts, self.places, strict=True)])

    def slopes(self, fitted: ndarray) -> ndarray:
        """Derivatives of `friction`; those in the coordinates of other steps are 0."""
        rows = []
        for each, weights, at in zip(self.parts, self._weights, self.places, strict=True):
            own = weighted(weights, np.nan_to_num(each.slopes(fitted[at]), posinf=0, neginf=0))
            rows.append(np.zeros((len(own), len(self.coordinates))))
            rows[-1][:, at] = own
        return np.vstack(rows)

    def best_law(self, fitted: ndarray) -> FrictionLaw:
        """Law of the first step."""
        return self.parts[0].best_law(fitted[self.places[0]])

    def resolved(self, fitted: ndarray, accuracy: float) -> "_Joint":
        """The same experiment with each step resolved for its own noise."""
        parts = zip(self.parts, self.places, self.fits, strict=True)
        return replace(self, parts=tuple(each.resolved(fitted[at], fit.accuracy) for each, at, fit in parts))
