"""Result of a campaign: quantiles, worst samples, samples by index, and a figure."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import field
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, require_known
from quakedesign.files import Json, write_whole
from quakedesign.simulation.campaign.problem import CampaignProblem, SampleResult
from quakedesign.simulation.campaign.space import UNITS, WorstSample
from quakedesign.simulation.recorder import EVENTS, Metrics
from quakedesign.simulation.trajectory import KINDS, Outcome, Trajectory

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

# ----------------------------------------------------------------------
# The figure of a campaign.

_DECADES = 30.0


def figure(title: str, caption: str, shown: Mapping[str, tuple[np.ndarray, Mapping[float, float | None]]]) -> "Figure":
    """Return a Figure of the empirical distribution functions of the metrics.

    Parameters
    ----------
    shown : mapping of str to tuple
        For each metric with its unit: values of the samples, nan if missing, and the quantiles to mark.
    """
    from matplotlib.figure import Figure

    rows = max(1, -(-len(shown) // 3))
    drawing = Figure(figsize=(10, 0.8 + 2.6 * rows), layout="constrained")
    axes = drawing.subplots(rows, 3, sharey=True).ravel()
    for axis in axes[len(shown) :]:
        axis.set_visible(False)
    for axis, (name, (values, marks)) in zip(axes, shown.items(), strict=False):
        _distribution(axis, name, values, marks)
    drawing.suptitle(title)
    drawing.supxlabel(caption, fontsize=7)
    return drawing


def _distribution(axis: Any, name: str, values: np.ndarray, marks: Mapping[float, float | None]) -> None:
    defined = values[~np.isnan(values)]
    finite = np.sort(defined[np.isfinite(defined)])
    axis.step(finite, np.arange(1, len(finite) + 1) / len(defined), where="post", color="#0072B2")
    for level, value in marks.items():
        if value is not None:
            axis.axvline(value, color="grey", linestyle=":", linewidth=1)
            side = {"ha": "right", "xytext": (-2, 2)} if level > 0.5 else {"ha": "left", "xytext": (2, 2)}
            axis.annotate(
                f"{level:.0%}".replace("%", " %"), (value, level), fontsize=7, textcoords="offset points", **side
            )
    if len(finite) and finite[0] > 0 and finite[-1] > _DECADES * finite[0]:
        axis.set_xscale("log")
    else:
        axis.locator_params(axis="x", nbins=4)
        axis.ticklabel_format(axis="x", scilimits=(-2, 4), useMathText=True)
    axis.set_xlabel(name)
    if axis.get_subplotspec().is_first_col():
        axis.set_ylabel("share of samples [-]")
    axis.set_ylim(0, 1.02)
    axis.grid(visible=True, alpha=0.3)


# ----------------------------------------------------------------------
# Result of a campaign: quantiles, worst samples, and a new run of any sample by its index.

LEVELS = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 1.0)
SHOWN = 5
_DRAWN = (
    "max_slip_error",
    "max_slip_rate_error",
    "peak_slip_rate",
    "rms_pressure",
    "max_pressure",
    "pressure_total_variation",
)
_MARKED = (0.05, 0.5, 0.95)
_LESS_IS_WORSE = frozenset({"min_pressure"})


@checked_dataclass(frozen=True, kw_only=True)
class Failure:
    """A batch that could not be computed; a run that diverges is a result, not a failure.

    Attributes
    ----------
    samples : tuple of str
        Indices of the samples in the batch; samples of the search are named ``search-0``, ``search-1``, ….
    reason : str
    """

    samples: tuple[str, ...]
    reason: str


@checked_dataclass(frozen=True, eq=False, kw_only=True)
class Campaign:
    """Many runs of one closed loop.

    Attributes
    ----------
    problem : CampaignProblem
    results : tuple of SampleResult or None
        Results in the order of the sample index; None if the batch of the sample failed.
    failures : tuple of Failure
    resumed : int
        Number of samples whose result was read from the folder.
    search : WorstSample or None
    seconds : float
        Wall-clock time of the call of `run_campaign` [s].
    """

    problem: CampaignProblem = field(repr=False)
    results: tuple[SampleResult | None, ...] = field(repr=False)
    failures: tuple[Failure, ...] = ()
    resumed: int = 0
    search: WorstSample | None = None
    seconds: float = 0.0

    @cached_property
    def metrics(self) -> tuple[str, ...]:
        """Names of the metrics of the samples."""
        return metric_names([result for result in self.results if result])

    def values(self, metric: str) -> "np.ndarray":
        """One metric of all samples, shape (samples,): nan if the batch failed, ±∞ if the run diverged or has no value.

        Raises
        ------
        ParameterError
            When the samples have no such metric.
        """
        require_metric(metric, self.metrics)
        return np.array([math.nan if result is None else severity(result, metric) for result in self.results]) * (
            -1 if metric in _LESS_IS_WORSE else 1
        )

    def quantiles(self, levels: Sequence[float] = LEVELS) -> dict[str, dict[str, float | None]]:
        """Quantiles of every metric, by level, over the samples that did not fail; None if the quantile is infinite.

        A quantile is the value of one sample (inverse of the empirical distribution function). For `min_pressure`,
        where smaller is worse, samples are ordered from the largest down, so that high levels are bad for every metric.

        Raises
        ------
        ParameterError
            For a level outside 0 to 1.
        """
        if outside := [level for level in levels if not 0 <= level <= 1]:
            raise ParameterError(f"level of a quantile must be between 0 and 1. Received {outside[0]!r}.")
        return {metric: self._quantiles(metric, levels) for metric in self.metrics}

    def _quantiles(self, metric: str, levels: Sequence[float]) -> dict[str, float | None]:
        way = -1 if metric in _LESS_IS_WORSE else 1
        ordered = sorted(way * value for value in self.values(metric).tolist() if not math.isnan(value))
        places = {level: max(0, math.ceil(level * len(ordered)) - 1) for level in levels}
        return {f"{level:g}": _finite(way * ordered[place]) for level, place in places.items()}

    def worst(self, metric: str, count: int = SHOWN) -> list[int]:
        """Indices of the worst samples in one metric, worst first; those that diverged or have no value come first."""
        require_metric(metric, self.metrics)
        ranked = [(-severity(result, metric), i) for i, result in enumerate(self.results) if result]
        return [i for _, i in sorted(ranked)[:count]]

    @cached_property
    def events(self) -> dict[str, list[int]]:
        """Indices of the samples in which an event occurred, by event."""
        pairs = [(i, result) for i, result in enumerate(self.results) if result]
        return {name: [i for i, result in pairs if name in result.events] for name in EVENTS}

    @cached_property
    def outcomes(self) -> tuple[Outcome | None, ...]:
        """Outcome of every sample, by index; None for a sample of a batch that failed."""
        return tuple(self.problem.outcome(result) if result else None for result in self.results)

    @cached_property
    def kinds(self) -> dict[str, list[int]]:
        """Indices of the samples by the kind of their outcome."""
        pairs = [(i, outcome.kind) for i, outcome in enumerate(self.outcomes) if outcome]
        return {kind: [i for i, own in pairs if own == kind] for kind in KINDS}

    def trajectory(self, index: int | str, samples: int = 2000) -> Trajectory:
        """Rerun one sample and store about `samples` instants; the results equal those of the campaign bitwise.

        Parameters
        ----------
        index : int or str
            Index of the sample; ``"search-3"`` is a sample of the search.

        Raises
        ------
        ParameterError
            If the index is not 0 to 2^20 − 1, or is not the name of a sample of the search.
        """
        if not isinstance(index, str):
            return self.problem.trajectory(self.problem.sample(index), samples)
        looked_at = self.search.looked_at if self.search else ()
        number = index.removeprefix("search-")
        if not (index.startswith("search-") and number.isdecimal() and int(number) < len(looked_at)):
            searched = f", or search-0 … search-{len(looked_at) - 1}" if looked_at else ", since there was no search"
            raise ParameterError(f"index must be a whole number{searched}. Received {index!r}.")
        return self.problem.trajectory(looked_at[int(number)], samples)

    def to_dict(self) -> Json:
        """Return JSON data: samples, outcomes, worst, quantiles, events, failures, search, resumed."""
        return {
            "samples": len(self.results),
            "outcomes": {
                kind: {"count": len(indices), "first": indices[:SHOWN]} for kind, indices in self.kinds.items()
            },
            "worst": {metric: [self._worst_entry(i, metric) for i in self.worst(metric)] for metric in self.metrics},
            "quantiles": self.quantiles(),
            "events": {name: {"count": len(found), "first": found[:SHOWN]} for name, found in self.events.items()},
            "failures": [{"samples": list(f.samples), "reason": f.reason} for f in self.failures],
            "search": self._search_entry(),
            "resumed": self.resumed,
        }

    def _worst_entry(self, index: int, metric: str) -> Json:
        value = _finite(float(self.values(metric)[index]))
        return {"index": index, "value": value, "sample": self.problem.sample(index).numbers}

    def _search_entry(self) -> Json | None:
        if self.search is None:
            return None
        return {
            "metric": self.search.metric,
            "value": _finite(self.search.value * (-1 if self.search.metric in _LESS_IS_WORSE else 1)),
            "index": f"search-{self.search.index}",
            "sample": self.search.sample.numbers,
            "looked_at": len(self.search.looked_at),
        }

    def to_pandas(self) -> "pd.DataFrame":
        """Return a pandas DataFrame, one row per sample: varied numbers, outcome, and metrics as in `values`."""
        import pandas as pd

        numbers = [self.problem.sample(i).numbers for i in range(len(self.results))]
        columns: dict[str, Any] = {
            f"{name} [{UNITS.get(name, '-')}]": [n[name] for n in numbers] for name in numbers[0]
        }
        columns["outcome [-]"] = [outcome.kind if outcome else None for outcome in self.outcomes]
        columns |= {f"{m} [{Metrics.unit(m) or '-'}]": self.values(m) for m in self.metrics}
        return pd.DataFrame(columns, index=pd.Index(range(len(numbers)), name="sample"))

    def save(self, folder: str | Path, figures: Mapping[str, bytes] | None = None) -> None:
        """Write ``results.json``, ``samples.csv`` and figures into a folder, each file atomically.

        Parameters
        ----------
        folder : str or Path
        figures : mapping of str to bytes, optional
            Contents of files by name; ``distribution.png`` unless given.

        Raises
        ------
        OutputError
            When a file cannot be written.
        """
        text = json.dumps(self.to_dict(), indent=1, allow_nan=False) + "\n"
        contents = {
            "results.json": text,
            "samples.csv": self.to_pandas().to_csv(),
            **({"distribution.png": self._image()} if figures is None else figures),
        }
        for name, content in contents.items():
            write_whole(Path(folder) / name, content)

    def _image(self) -> bytes:
        image = BytesIO()
        self.plot().savefig(image, format="png", dpi=150, metadata={"Software": None})
        return image.getvalue()

    def plot(self) -> "Figure":
        """Return a matplotlib Figure of the distribution of the metrics."""
        problem, levels = self.problem, self.quantiles(_MARKED)
        law = problem.controller.title if problem.controller else "no control"
        diverged, count = len(self.events["diverged"]), len(self.results)
        return figure(
            f"{problem.fault.name}, {law}: {count} samples, {diverged} diverge",
            f"scheme {problem.scheme.name}, step {problem.setting.step:g} s",
            {
                f"{name.replace('_', ' ')} [{Metrics.unit(name)}]": (
                    self.values(name),
                    {level: levels[name][f"{level:g}"] for level in _MARKED},
                )
                for name in _DRAWN
                if name in self.metrics
            },
        )


def metric_names(results: Sequence[SampleResult]) -> tuple[str, ...]:
    """Names of the metrics that any of the results has, in order."""
    return tuple(dict.fromkeys(name for result in results if not result.diverged for name in result.figures))


def require_metric(metric: str, available: Sequence[str]) -> None:
    """Raise a ParameterError if a metric is unknown, or if all runs diverged, so that no metric has a value."""
    if not available:
        raise ParameterError(f"metric {metric!r} has no value, since all runs diverged")
    require_known(metric, available, "metric")


def severity(result: SampleResult, metric: str) -> float:
    """Value of a metric, negated where less is worse; infinite for a diverged sample or a missing value."""
    if result.diverged or metric not in result.figures:
        return math.inf
    value = result.figures[metric]
    return -value if metric in _LESS_IS_WORSE else value


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
