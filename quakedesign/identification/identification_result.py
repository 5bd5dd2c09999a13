"""Result of an identification: parameters, intervals, verdict, and further experiments."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property

import numpy as np
from numpy import ndarray

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.fault import FrictionLaw
from quakedesign.files import Json
from quakedesign.identification.assessment import DECISIVE, EXPLAINS, EXPLAINS_NOT, Assessment, Check
from quakedesign.identification.fitting import CONFIDENCE, Fit, Profile
from quakedesign.identification.record import Record

_OTHER_LAW = {"rest": "another --law", "sliding": "no --law, which fits both laws with a state"}
_SEPARABLE = "delay", "start_rate"  # names of parameters that no other one depends on if they are undetermined


_EXPERIMENTS = {
    "the stiffness of the machine, from loading or unloading: --stiffness": "stiffness",
    "a step to ten times the rate, with ten samples within a critical slip after it": "direct_effect evolution_effect",
    "longer sliding after the step, until friction is constant": "critical_slip second_slip second_effect",
    "longer sliding before the step, which fixes the trend, and steps up and down by a factor of 10": "sign",
    "slip from rest until friction is constant": "drop residual",
}
"""Experiments that determine open parameters, or the sign of a - b."""


@checked_dataclass(frozen=True, kw_only=True)
class ParameterEstimate:
    """One parameter with its 95 % profile-likelihood interval.

    Attributes
    ----------
    name, unit : str
        The unit is SI.
    value : float
        Best fit.
    low, high : float
        Ends for this parameter alone; infinite where the record sets no end.
    least, most : float
        Ends for all parameters jointly: those of the smallest box that contains their joint region.
    profile : tuple of (float, float)
        Tried values, ascending, each with the square root of its excess: the sum of squares, minimised over all other
        parameters, minus the smallest one, divided by the noise variance of independent samples.
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
    least: float
    most: float
    profile: tuple[tuple[float, float], ...] = ()

    @property
    def identified(self) -> bool:
        """Whether the record sets both ends, also of the joint region."""
        return all(math.isfinite(end) for end in (self.low, self.high, self.least, self.most))

    def to_dict(self) -> Json:
        """Value and ends; None for an end that the record does not set."""
        ends = {name: _finite(getattr(self, name)) for name in ("value", "low", "high")}
        return {**ends, "unit": self.unit, "identified": self.identified}


@dataclass(frozen=True, kw_only=True)
class Outlier:
    """A sample that noise does not explain, excluded from the fit."""

    time: float  # time in the record [s], since its first sample
    size: float  # measured minus simulated friction [-]


@dataclass(frozen=True, kw_only=True)
class OtherLaw:
    """Another law with as many parameters, which explains the record less well."""

    law: str  # its name
    squares: float  # ratio of its weighted sum of squares to that of the selected law
    excess: float  # increase of its AIC, twice the decrease of the log-likelihood

    def __str__(self) -> str:
        little = "" if self.excess > DECISIVE else "; so little that the record hardly distinguishes the laws"
        return (
            f"{self.law} fits worse: {self.squares:.4g} times the sum of squares, AIC higher by {self.excess:.3g}"
            f"{little}"
        )


@checked_dataclass(frozen=True, kw_only=True)
class Identification:
    """Friction parameters of a record with their confidence regions.

    Attributes
    ----------
    record : Record
    fit : Fit
    used : ndarray of bool
        Whether each sample of the record is simulated by the fit.
    estimates : dict of ParameterEstimate
        By name: quantities of the law, and, if fitted, the stiffness, delays, initial rate and trend.
    difference : ParameterEstimate or None
        Direct minus evolution effect, or minus both evolution effects, for laws that have them.
    law : FrictionLaw
        Law with the best values.
    notes : tuple of str
        Assumptions of the fit.
    seed : int
        Seed of the random starts.
    rival : OtherLaw or None
        Law that was also fitted but not selected, if no law was given.
    assessment : Assessment
        Tests of the assumptions, and the verdict.
    """

    record: Record
    fit: Fit
    used: ndarray
    estimates: dict[str, ParameterEstimate]
    difference: ParameterEstimate | None
    law: FrictionLaw
    notes: tuple[str, ...]
    seed: int
    rival: OtherLaw | None = None
    assessment: Assessment = Assessment(checks=(), factor=1.0)

    def __repr__(self) -> str:
        ends = {e.name: f"{e.value:.4g} ({e.low:.4g} to {e.high:.4g}) {e.unit}" for e in self.estimates.values()}
        sentence = ", ".join(f"{name} {text}".strip() for name, text in ends.items())
        return f"Identification({self.record.name!r}, {self.law.name}: {sentence})"

    @property
    def determined(self) -> bool:
        """Whether every parameter except delays and the initial rate has an interval with both ends."""
        return all(e.identified for e in self.estimates.values() if not e.name.startswith(_SEPARABLE))

    @property
    def identified(self) -> bool:
        """Whether `determined`, and the verdict is not that the fit does not explain the record."""
        return self.determined and self.assessment.verdict != EXPLAINS_NOT

    @property
    def explained(self) -> bool:
        """Whether the verdict is that the fit explains the record."""
        return self.assessment.verdict == EXPLAINS

    def to_try(self) -> list[str]:
        """Options with which a fit may explain the record."""
        return [
            "--figure, which shows where the fit fails",
            *([_OTHER_LAW[self.law.equilibrium.name]] if self.rival is None else []),
            *(["--states 2"] if self.law.state_names == ("theta",) else []),
            *(["--stiffness of the machine, if it was measured"] if "stiffness" in self.estimates else []),
            "one step alone, cut out with --from and --to",
        ]

    def experiments(self, sign: Check | None = None) -> list[str]:
        """Experiments that would determine the quantities that this record leaves open."""
        open_ = {name for name, estimate in self.estimates.items() if not estimate.identified}
        open_ |= {"sign"} if sign is not None and not sign.passed else set()
        return [experiment for experiment, names in _EXPERIMENTS.items() if open_ & set(names.split())]

    @property
    def box(self) -> dict[str, tuple[float, float]]:
        """Ranges, by name, that contain every set of parameters which the record allows at 95 %."""
        return {name: (estimate.least, estimate.most) for name, estimate in self.estimates.items()}

    @cached_property
    def outliers(self) -> tuple[Outlier, ...]:
        """Samples excluded from the fit, largest residual first."""
        left = ~self.fit.used
        sizes, times = self.fit.residuals[left].tolist(), self.record.time[self.used][left].tolist()
        outliers = [Outlier(time=time, size=size) for time, size in zip(times, sizes, strict=True)]
        return tuple(sorted(outliers, key=lambda outlier: -abs(outlier.size)))

    def allows(self, values: Mapping[str, float]) -> bool:
        """Whether all fitted parameters, in SI, are in the joint 95 % region; `ParameterError` if one is missing."""
        coordinates = self.fit.experiment.coordinates
        if missing := {c.name for c in coordinates} - set(values):
            raise ParameterError(
                f"values must contain every fitted parameter. Received no {', '.join(sorted(missing))}. Add these."
            )
        return self.fit.distance(self.fit.experiment.near(values)) <= self.fit.threshold(len(coordinates))

    def undetermined(self) -> list[str]:
        """Sentences about parameters that the record does not determine; empty if it determines all."""
        open_ = [e for e in self.estimates.values() if not (e.identified or e.name.startswith(_SEPARABLE))]
        texts, only = [], self.difference
        pair = only.name.split(" - ") if only is not None and only.identified else []
        if only is not None and pair and {e.name for e in open_} >= set(pair):
            ends = f"{only.name} = {_with_unit(only, only.value)} ({only.low:.4g} to {only.high:.4g})"
            texts.append(f"{pair[0]} and {pair[1]} are not identifiable from this record: only {ends} is")
            open_ = [estimate for estimate in open_ if estimate.name not in pair]
        return texts + [f"{e.name} is not identifiable from this record: {_one_sided(e)}" for e in open_]

    def to_dict(self) -> Json:
        """JSON-able facts; SI units."""
        fit, difference = self.fit, self.difference
        return {
            "law": self.law.name,
            **self.assessment.to_dict(),
            "identified": self.identified,
            "not_identifiable": self.undetermined(),
            "parameters": {name: estimate.to_dict() for name, estimate in self.estimates.items()},
            "difference": None if difference is None else {"of": difference.name, **difference.to_dict()},
            "chosen": {
                name: {"value": getattr(self.law, name), "unit": field.metadata["unit"]}
                for name, field in self.law.quantities().items()
                if name not in self.estimates
            },
            "confidence": CONFIDENCE,
            "residual": {
                "noise": fit.noise,
                "unit": "",
                "samples": int(fit.used.sum()),
                "correlation": fit.correlation,
                "correlated": None if fit.correlated is None else fit.correlated.to_dict(fit.noise),
            },
            "measurements": round(float(np.sum(fit.counts))),
            "rival": None if self.rival is None else asdict(self.rival),
            "box": {name: [_finite(end) for end in ends] for name, ends in self.box.items()},
            "outliers": [{"time": o.time, "time_unit": "s", "size": o.size, "size_unit": ""} for o in self.outliers],
            "starts": {"seed": self.seed, "searches": fit.starts, "agreeing": fit.agreeing},
            "assumptions": list(self.notes),
            "read": list(self.record.remarks),
        }


def estimate(profile: Profile, alone: tuple[float, float], jointly: tuple[float, float]) -> ParameterEstimate:
    """Estimate of one coordinate from its profile and the ends, given as fitted coordinates."""
    fit, best = profile.fit, float(profile.fit.fitted[profile.place])
    coordinate = fit.experiment.coordinates[profile.place]
    points = [(0.0, 0.0), *((each.step, each.distance) for each in profile.points)]
    low, high, least, most = (coordinate.outward(end) if math.isfinite(end) else end for end in (*alone, *jointly))
    return ParameterEstimate(
        name=coordinate.name,
        unit=coordinate.unit,
        value=coordinate.outward(best),
        low=low,
        high=high,
        least=min(least, low),
        most=max(most, high),
        profile=tuple((coordinate.outward(best + step), distance) for step, distance in sorted(points)),
    )


def _finite(end: float) -> float | None:
    return end if math.isfinite(end) else None


def _with_unit(estimate: ParameterEstimate, value: float) -> str:
    return f"{value:.4g} {estimate.unit}".rstrip()


def _one_sided(estimate: ParameterEstimate) -> str:
    """Text with the finite end of the joint interval, if it has one."""
    if math.isfinite(estimate.most):
        return f"at most {_with_unit(estimate, estimate.most)}, without a lower end"
    if math.isfinite(estimate.least):
        return f"at least {_with_unit(estimate, estimate.least)}, without an upper end"
    return "any value fits equally well"
