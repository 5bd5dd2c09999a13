"""Identified friction law on a terminal and as a figure."""

import math
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from quakedesign.errors import OutputError
from quakedesign.files import write_whole
from quakedesign.identification.assessment import CANNOT_TELL, EXPLAINS_NOT
from quakedesign.identification.experiment import DELAY, TREND, TREND_IN_TIME, Widened
from quakedesign.identification.fitting import Fit
from quakedesign.identification.identification_result import Identification, ParameterEstimate
from quakedesign.identification.several_steps import Steps
from quakedesign.report.drawing import FORMATS, NATURAL, SMALL, figure, figure_bytes, finish
from quakedesign.text import PREFIXES, plain, power_of, quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MEASURED, _FITTED, _OUTLIER = "#777777", "#0072B2", "#D55E00"
_DASHED = 0, (4, 2)
_MOST_OUTLIERS = 8
_MOST_PANELS = 4
_SHOWN = 12.0  # range of displacement shown after a step, in critical slips
_LAGS = 40
_SMALL_EFFECT = 0.1  # friction below which values are written in thousandths
_SYMBOLS = {"direct_effect": "a", "evolution_effect": "b", "critical_slip": "$D_c$"}
_SHORT, _LONG = 2e-7, 0.01  # range of D_c [m] without a warning


def identification_lines(result: Identification | Steps, *, verbose: bool = False) -> list[str]:
    """Lines of at most 80 characters: the verdict, a table, and the next command; with `verbose` also all tests."""
    if isinstance(result, Steps):
        each = [line for step in result.steps for line in identification_lines(step, verbose=True)]
        table = [_STEP_HEAD, *(_step_row(i, step) for i, step in enumerate(result.steps, start=1))][: 1 + _MOST_STEPS]
        left = len(result.steps) - _MOST_STEPS
        table += [f"and {left} more: --verbose"] * (left > 0)
        common = identification_lines(result.common)
        head = common.index(_HEAD) - 1
        text = f"All steps jointly: {result.common.assessment.checks[0].sentence}."
        return [*common[:head], "", *table, "", *_wrapped([text]), *common[head:], *(each if verbose else [])]
    assessment, summary = result.assessment, f"{result.record.name}: {result.law.name}"
    unclear, unexplained = (assessment.verdict == each for each in (CANNOT_TELL, EXPLAINS_NOT))
    summary += f", {assessment}: {assessment.open[0]}." if unclear else f" {assessment}."
    sign = next((check for check in assessment.checks if check.name == "sign" and check.passed), None)
    if sign is not None and not unexplained and result.difference is not None:
        does, (value, ends, _) = "weakens" if result.difference.value < 0 else "strengthens", _cells(result.difference)
        summary += f" Friction {does} with rate: a - b = {value} ({ends})."
    but = [f"But {each}." for each in assessment.cautions]
    more = [f"also undecided: {each}" for each in assessment.open[1:4] if unclear]
    more += [f"this experiment would decide: {each}" for each in assessment.experiments if unclear]
    more += (
        [*(f"- {each}" for each in result.undetermined()), f"suggested: {'; '.join(result.to_try())}"]
        if unexplained
        else []
    )
    failed = [check.sentence for check in assessment.checks if not check.passed]
    more += [f"not passed: {each}" for each in failed if each not in (*assessment.open, *assessment.cautions)]
    shown = [each for each in result.estimates.values() if verbose or not each.name.startswith(DELAY)]
    shown += [result.difference] if result.difference else []
    notes = [each for each in result.record.remarks if verbose or " is read as " not in each]
    more += [
        *_warnings(result),
        *([f"reading of the file: {'; '.join(notes)}"] if notes else []),
        *(_more(result) if verbose else []),
    ]
    return [*_wrapped([summary, *but, ""]), _HEAD, *map(_row, shown), "", *_wrapped(more)]


_HEAD = f"{'parameter':22}{'value':>13}{'95 % interval':>27}  unit"
_STEP_HEAD = f"{'step':5}{'a':>10}{'b':>10}{'a - b':>10}{'D_c':>10}{'k':>14}  verdict"
_MOST_STEPS = 14
_PREFIXED = ("m", "s", "Pa/m", "N/m")
_COLUMNS = {"direct_effect": 10, "evolution_effect": 10, "difference": 10, "critical_slip": 10, "stiffness": 14}


def _step_row(number: int, step: Identification) -> str:
    """Values of a step; a question mark after those without an interval."""
    entries = {**step.estimates, "difference": step.difference}
    cells = []
    for name, width in _COLUMNS.items():
        one = entries.get(name)
        value = "" if one is None else quantity(one.value, one.unit) if one.unit else f"{one.value:.3g}"
        cells.append(f"{value}{'' if one is None or one.identified else '?'}".rjust(width))
    return f"{number:<5}{''.join(cells)}  {step.assessment.verdict.replace(' the record', '')}"


def _more(result: Identification) -> list[str]:
    """Passed tests, noise, searches and assumptions."""
    fit, rate = result.fit, getattr(result.law, "reference_rate", None)
    means, all_ = len(fit.counts), round(float(np.sum(fit.counts)))
    samples = f"{int(fit.used.sum())} samples" if all_ == means else f"{all_} samples averaged to {means}"
    return [
        *(f"passed: {check.sentence}" for check in result.assessment.checks if check.passed),
        f"noise per sample {fit.noise:.3g}; {samples}; {fit.agreeing} of {fit.starts} searches (seed "
        f"{result.seed}) ended in this fit{', the others in worse ones' if fit.agreeing < fit.starts else ''}",
        *([str(result.rival)] if result.rival else []),
        *(
            []
            if rate is None
            else [f"reference_coefficient is the friction coefficient in steady sliding at {quantity(rate, 'm/s', 4)}"]
        ),
        f"assumed: {'; '.join(result.notes)}",
    ]


def _wrapped(paragraphs: list[str]) -> list[str]:
    return [line for paragraph in paragraphs for line in (wrap(paragraph, 80, subsequent_indent="  ") or [""])]


def _row(estimate: ParameterEstimate) -> str:
    name = estimate.name
    if " - " in name:
        name = "difference a - b" if name.count(" - ") == 1 else "difference a - b - b2"
    value, ends, unit = _cells(estimate)
    return f"{name:22}{value:>13}{ends:>27}  {unit or '-'}"


def _cells(estimate: ParameterEstimate) -> tuple[str, str, str]:
    """Value, interval and prefixed unit, with as many digits as the interval justifies."""
    power = power_of(estimate.value) if estimate.unit in _PREFIXED else 0
    wide = estimate.high - estimate.low
    finite = math.isfinite(wide) and wide > 0
    digits = min(max(2 + math.ceil(math.log10(max(abs(estimate.value), wide) / wide)), 3), 6) if finite else 3
    value, low, high = (
        plain(end / 10.0**power, digits) if math.isfinite(end) else "?"
        for end in (estimate.value, estimate.low, estimate.high)
    )
    return value, f"{low} … {high}", f"{PREFIXES[power]}{estimate.unit}"


def _warnings(identification: Identification) -> list[str]:
    """Warnings: implausible values, correlated noise, and outliers."""
    notes, critical = [], identification.estimates.get("critical_slip")
    evolves = "evolution_effect" in identification.law.quantities()
    if critical is not None and evolves and not _SHORT <= critical.value <= _LONG:
        size = critical.value
        long = f"{1e9 * size:.3g} nm is far shorter" if size < _SHORT else f"{100 * size:.3g} cm is far longer"
        notes.append(f"D_c of {long} than in laboratories (1 µm to 100 µm): check the unit of the displacement")
    if (correlated := identification.fit.correlated) is not None and correlated.share:
        size = identification.fit.noise * correlated.share**0.5
        length = f"{correlated.length:.2g} {'s' if correlated.of_time else 'm'}"
        notes.append(
            f"correlated noise of {size:.2g} in the friction coefficient, correlation length {length}; "
            "the confidence regions include it"
        )
    outliers = identification.outliers
    if outliers:
        largest = ", ".join(f"{o.size:+.3g} at {o.time:.6g} s" for o in outliers[:_MOST_OUTLIERS])
        more = f", and {len(outliers) - _MOST_OUTLIERS} smaller" if len(outliers) > _MOST_OUTLIERS else ""
        notes.append(f"excluded outliers: {largest}{more}")
    return notes


def steps_figure(steps: Steps) -> "Figure":
    """One panel per step with its own and the common fit, and the confidence regions of two parameters."""
    joint: Any = steps.common.fit.experiment
    at, count = steps.common.fit.fitted, len(steps.steps)
    names = [f"step {i}" for i in range(count)] + ["."] * (count % 2)
    rows = [names[i : i + 2] for i in range(0, len(names), 2)] + [["region", "region"]]
    drawing, axes = figure(0, 1.7 * len(rows) + 1.2, mosaic=rows)
    for i, step in enumerate(steps.steps):
        axis, path = axes[f"step {i}"], step.record.load_point
        way = step.record.time[step.used] if path is None else path[step.used] * 1e6
        _friction(axis, step, way, slice(None))
        shared, dashed = joint.parts[i].friction(at[joint.places[i]]), (0, (5, 2))
        axis.plot(way, shared, color=_OUTLIER, linewidth=1.0, label="common fit", linestyle=dashed)
        axis.set_title(f"{i + 1}: {step.record.name}", fontsize=SMALL)
        axis.set_xlabel("time [s]" if path is None else "displacement of the load point [µm]", fontsize=SMALL)
        _region(axes["region"], step, f"{i + 1}", f"C{i}")
    _region(axes["region"], steps.common, "all", "black")
    axes["region"].legend(fontsize=SMALL - 1, frameon=False, ncols=4)
    title = next(check.sentence for check in steps.common.assessment.checks if check.name == "common")
    return finish(drawing, title, [], "95 % confidence regions of two parameters", legend=axes["step 0"])


def identification_figure(identification: Identification) -> "Figure":
    """Friction with fit and trend, load-point rate, residuals, every step, correlation, joint region, and profiles."""
    record, used, fit = identification.record, identification.used, identification.fit
    way = record.time[used] if record.path is None else record.path[used] * 1e6
    slipped = "time [s]" if record.slip is None else "slip [µm]"
    label = slipped if record.load_point is None else "displacement of the load point [µm]"
    rates = None if record.load_point is None else np.gradient(record.load_point[used], record.time[used])
    steps = [] if rates is None else _steps(rates)[:_MOST_PANELS]
    names = ["friction", *(["rate"] if rates is not None else []), "residual"]
    columns = math.lcm(2, max(len(steps), 1))
    rows = [[name] * columns for name in names]
    if steps:
        rows.append([f"step {i}" for i in range(len(steps)) for _ in range(columns // len(steps))])
    rows.append(["correlation"] * (columns // 2) + ["region"] * (columns // 2))
    drawn = identification.law.quantities().keys() - {"reference_coefficient"}
    profiles = [each for name, each in identification.estimates.items() if name in drawn][:3]
    profiles += [identification.difference] if identification.difference else []
    profiles = [each for each in profiles if len(each.profile) > 1]
    columns = math.lcm(columns, max(len(profiles), 1))
    rows = [[name for name in row for _ in range(columns // len(row))] for row in rows]
    if profiles:
        rows.append([f"profile {each.name}" for each in profiles for _ in range(columns // len(profiles))])
    heights = [2.0 if row[0] == "friction" else 0.8 if row[0] in ("rate", "residual") else 1.4 for row in rows]
    drawing, axes = figure(0, 1.1 * sum(heights) + 1.0, mosaic=rows, height_ratios=heights)
    _friction(axes["friction"], identification, way, slice(None))
    if rates is not None:
        axes["rate"].plot(way, rates * 1e6, color=_FITTED, linewidth=1.0, drawstyle="steps-mid")
        axes["rate"].set_ylabel("rate [µm/s]", fontsize=SMALL)
        ends = [1e6 * float(np.min(rates)), 1e6 * float(np.max(rates))]
        if steps and ends[0] > 0:
            axes["rate"].set_yscale("log")
            axes["rate"].set_yticks(ends, [f"{end:.3g}" for end in ends])
            axes["rate"].set_yticks([], minor=True)
        else:
            axes["rate"].set_ylim(0, 1.2e6 * np.max(rates))
    below = axes["residual"]
    below.plot(way[fit.used], fit.residuals[fit.used], ".", color=_MEASURED, markersize=2)
    for level, style in ((-2 * fit.noise, _DASHED), (0.0, "solid"), (2 * fit.noise, _DASHED)):
        below.axhline(level, color=NATURAL, linewidth=0.6, linestyle=style)
    inside = 8 * fit.noise
    below.plot(way[~fit.used], np.clip(fit.residuals[~fit.used], -inside, inside), "x", color=_OUTLIER, markersize=5)
    below.set_ylabel("residual [-]", fontsize=SMALL)
    below.set_xlabel(label, fontsize=SMALL)
    for name in names[1:]:
        axes[name].sharex(axes["friction"])
    critical = 1e6 * fit.experiment.outward(fit.fitted).get("critical_slip", 0.0)
    for i, place in enumerate(steps):
        far = min(max(_SHOWN * critical, 0.01 * float(np.ptp(way))), 0.5 * float(np.ptp(way)))
        far = min(far, way[steps[i + 1]] - way[place]) if i + 1 < len(steps) else far
        near = np.flatnonzero((way >= way[place] - 0.2 * far) & (way <= way[place] + far))
        _friction(axes[f"step {i}"], identification, way, slice(int(near[0]), int(near[-1]) + 1))
        axes[f"step {i}"].set_title(f"step at {way[place]:.4g} µm", fontsize=SMALL)
    _correlation(axes["correlation"], fit)
    _region(axes["region"], identification)
    boxes = [(e.low, e.high) for e in (identification.estimates[name] for name in _pair(fit))]
    for box, line in zip(boxes, (axes["region"].axvline, axes["region"].axhline), strict=True):
        for end in box:
            if math.isfinite(end):
                line(end, color=NATURAL, linewidth=0.6, linestyle=_DASHED)
    for i, each in enumerate(profiles):
        axis = axes[f"profile {each.name}"]
        _profile(axis, each, fit)
        axis.tick_params(labelleft=i == 0)
        axis.set_ylabel("" if i else "distance [standard deviations]", fontsize=SMALL)
    note = f"residual: dashed at twice the noise of {fit.noise:.3g}; crosses: outliers, drawn at eight times the noise "
    note += "if larger; profiles: dashed at the 95 % threshold of one parameter, dotted at that of all jointly"
    title = f"{record.name}: {identification.law.name} {identification.assessment}"
    return finish(drawing, title, [], note, legend=axes["friction"])


def _steps(rates: ndarray) -> list[int]:
    """Samples at which the rate of the load point begins to change by more than a quarter."""
    size = np.log(np.maximum(rates, 1e-3 * np.max(rates)))
    changed = np.flatnonzero(np.abs(size[2:] - size[:-2]) > np.log(1.25)) + 1
    return [int(part[0]) for part in np.split(changed, np.flatnonzero(np.diff(changed) > 2) + 1) if len(part)]


def _friction(axis: "Axes", identification: Identification, way: ndarray, part: slice) -> None:
    fit = identification.fit
    simulated = fit.measured - fit.residuals
    axis.plot(way[part], fit.measured[part], ".", color=_MEASURED, markersize=2, label="measured")
    axis.plot(way[part], simulated[part], color=_FITTED, linewidth=1.2, label=f"fitted: {identification.law.name}")
    if isinstance(fit.experiment, Widened) and fit.experiment.coordinates[-1].name in (TREND, TREND_IN_TIME):
        along = fit.experiment.columns[:, 0]
        line = simulated[0] + fit.fitted[-1] * (along - along[0])
        axis.plot(way[part], line[part], color=NATURAL, linewidth=0.8, linestyle=_DASHED, label="trend")
    left = np.flatnonzero(~fit.used[part]) + (part.start or 0)
    if len(left):
        axis.plot(way[left], fit.measured[left], "x", color=_OUTLIER, markersize=5, label="outlier")
    axis.set_ylabel("friction [-]", fontsize=SMALL)


def _correlation(axis: "Axes", fit: Fit) -> None:
    """Autocorrelation of the residuals, and of the whitened residuals."""
    for left, colour, label in (
        ((fit.residuals * np.sqrt(fit.counts))[fit.used], _MEASURED, "residuals"),
        (fit.whitened, _FITTED, "whitened residuals"),
    ):
        off = left - left.mean()
        each = np.correlate(off, off, "full")[len(off) - 1 :][: _LAGS + 1]
        axis.plot(each / max(each[0], 1e-300), ".-", color=colour, markersize=3, label=label)
    for level in (-2.0, 2.0):
        axis.axhline(level / len(fit.whitened) ** 0.5, color=NATURAL, linewidth=0.6, linestyle=_DASHED)
    axis.set_xlabel("lag [samples]", fontsize=SMALL)
    axis.set_ylabel("autocorrelation [-]", fontsize=SMALL)
    axis.legend(fontsize=SMALL - 1, frameon=False)


def _profile(axis: "Axes", estimate: ParameterEstimate, fit: Fit) -> None:
    """Profile: square root of the excess at fixed values, with thresholds for one parameter and for all jointly."""
    alone, jointly = (math.sqrt(fit.threshold(count)) for count in (1, len(fit.fitted)))
    small = not estimate.unit and abs(estimate.value) < _SMALL_EFFECT
    power = power_of(estimate.value) if estimate.unit in _PREFIXED else -3 * small
    value, distance = np.array([point for point in estimate.profile if point[1] <= 1.5 * jointly]).T
    axis.plot(value / 10.0**power, distance, ".-", color=_FITTED, linewidth=1.0, markersize=3)
    for level, style in ((alone, _DASHED), (jointly, (0, (1, 2)))):
        axis.axhline(level, color=NATURAL, linewidth=0.6, linestyle=style)
    axis.set_ylim(0, 1.3 * jointly)
    axis.locator_params(axis="x", nbins=3)
    name = "a - b" if " - " in estimate.name else _SYMBOLS.get(estimate.name, estimate.name)
    axis.set_xlabel(f"{name} [{'$10^{-3}$' if small else PREFIXES[power] + (estimate.unit or '-')}]", fontsize=SMALL)


def _pair(fit: Fit) -> list[str]:
    """Names of the two parameters whose region is drawn."""
    names = [c.name for c in fit.experiment.coordinates]
    pair: list[str] = [name for name in ("direct_effect", "evolution_effect") if name in names]
    return pair if len(pair) == 2 else names[:2]


def _region(axis: "Axes", identification: Identification, label: str = "", colour: str = _FITTED) -> None:
    """95 % confidence region of two parameters, from the Jacobian of the fit."""
    fit, pair = identification.fit, _pair(identification.fit)
    places = [[c.name for c in fit.experiment.coordinates].index(name) for name in pair]
    size = np.maximum(np.linalg.norm(fit.slopes, axis=0), 1e-300)
    turned = (fit.slopes / size).T @ (fit.slopes / size)
    spread = (np.linalg.pinv(turned) / np.outer(size, size))[np.ix_(places, places)]
    values, turned = np.linalg.eigh(spread * fit.noise**2 * fit.correlation * fit.threshold(2))
    turn = np.linspace(0, 2 * np.pi, 181)
    around = turned * np.sqrt(np.maximum(values, 0)) @ np.array([np.cos(turn), np.sin(turn)])
    x, y = (
        np.array([fit.experiment.coordinates[place].outward(fit.fitted[place] + v) for v in row])
        for place, row in zip(places, around.tolist(), strict=True)
    )
    axis.plot(x, y, color=colour, linewidth=1.0, label=label)
    axis.plot(*(identification.estimates[name].value for name in pair), "+", color=colour)
    axis.locator_params(axis="x", nbins=4)
    across, upward = (f"{name} [{identification.estimates[name].unit or '-'}]" for name in pair)
    axis.set_xlabel(across, fontsize=SMALL)
    axis.set_ylabel(upward, fontsize=SMALL)


def require_format(path: Path) -> None:
    """Raise `OutputError` for a figure format other than SVG, PNG or PDF."""
    if path.suffix[1:] not in FORMATS:
        raise OutputError(f"a figure must end in .{', .'.join(FORMATS)}. Received {path}. Write {path.stem}.svg, say.")


def save_figure(identification: Identification | Steps, path: Path) -> None:
    """Write the figure, whole or not at all, without a date, so that the file is reproducible bitwise."""
    require_format(path)
    draw: Any = steps_figure if isinstance(identification, Steps) else identification_figure
    write_whole(path, figure_bytes(draw(identification), path.suffix[1:], path.stem))
