"""An identified law on a terminal and as a figure of the residuals."""

import math
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from quakedesign.errors import OutputError
from quakedesign.files import write_whole
from quakedesign.identification.assessment import CANNOT_TELL, EXPLAINS_NOT
from quakedesign.identification.identification_result import Identification, ParameterEstimate
from quakedesign.report.drawing import FORMATS, NATURAL, SMALL, clock, figure, figure_bytes, finish

_MEASURED, _FITTED, _OUTLIER = "#777777", "#0072B2", "#D55E00"
_MOST_OUTLIERS = 8
_SHORT, _LONG = 2e-7, 0.01  # D_c [m] that no gouge of a laboratory has


def identification_lines(identification: Identification) -> list[str]:
    """For people, within 80 columns: what was not told first."""
    fit, assessment = identification.fit, identification.assessment
    head = [f"{identification.record.name}: {identification.law.name} {assessment}"]
    if assessment.verdict == CANNOT_TELL:
        head = [f"{identification.record.name}: {identification.law.name}, {assessment}"]
        head += [f"- {said}" for said in assessment.open]
        head += [f"- would tell: {said}" for said in assessment.experiments]
    elif assessment.verdict == EXPLAINS_NOT:
        head += [f"- {said}" for said in identification.untold()]
        head += [f"- try: {'; '.join(identification.to_try())}"]
    head += [f"{'' if check.passed else 'NOT '}passed: {check.sentence}" for check in assessment.checks]
    head += [""]
    columns = f"{'parameter':24}{'value':>12}{'95 %: from':>14}{'to':>12}  unit"
    shown = [*identification.estimates.values(), *([identification.difference] if identification.difference else [])]
    tail = [
        f"noise {fit.noise:.3g} of friction in {_samples(identification)}; of {fit.starts} searches from different "
        f"starts (seed {identification.seed}) {fit.agreeing} end in this fit"
        f"{', the others in worse ones' if fit.agreeing < fit.starts else ''}",
        *([str(identification.rival)] if identification.rival else []),
        *_warnings(identification),
        *_outliers(identification),
        *_reference(identification),
        f"assumed: {'; '.join(identification.notes)}",
        *([f"read: {'; '.join(identification.record.remarks)}"] if identification.record.remarks else []),
    ]
    return [*_wrapped(head), columns, *map(_row, shown), "", *_wrapped(tail)]


def _wrapped(told: list[str]) -> list[str]:
    return [line for said in told for line in (wrap(said, 80, subsequent_indent="  ") or [""])]


def _row(estimate: ParameterEstimate) -> str:
    name = estimate.name
    if " - " in name:
        name = "difference a - b" if name.count(" - ") == 1 else "difference a - b - b2"
    low, high = (f"{end:.5g}" if math.isfinite(end) else "?" for end in (estimate.low, estimate.high))
    return f"{name:24}{estimate.value:>12.5g}{low:>14}{high:>12}  {estimate.unit or '-'}"


def _warnings(identification: Identification) -> list[str]:
    told, critical = [], identification.estimates.get("critical_slip")
    if critical is not None and identification.law.state_names and not _SHORT <= critical.value <= _LONG:
        short, size = critical.value < _SHORT, critical.value
        told.append(
            f"D_c of {f'{1e9 * size:.3g} nm' if short else f'{100 * size:.3g} cm'} is far "
            f"{'shorter' if short else 'longer'} than the some 1 to 100 um of laboratories: check the unit of the "
            "displacement"
        )
    if (correlated := identification.fit.correlated) is not None:
        size = identification.fit.noise * correlated.share**0.5
        length = f"{correlated.length:.2g} {'s' if correlated.of_time else 'm'}"
        told.append(f"noise that neighbours share: {size:.2g} of friction, fading over {length}; regions include it")
    return told


def _samples(identification: Identification) -> str:
    fit = identification.fit
    kept, all_ = int(fit.kept.sum()), int(np.sum(fit.counts))
    return f"{kept} samples" if all_ == len(fit.counts) else f"one of {all_} samples, taken as {len(fit.counts)} means"


def _reference(identification: Identification) -> list[str]:
    rate = getattr(identification.law, "reference_rate", None)
    return [] if rate is None else [f"reference_coefficient is that of steady sliding at {rate:.4g} m/s"]


def _outliers(identification: Identification) -> list[str]:
    if not identification.outliers:
        return []
    told = ", ".join(f"{o.size:+.3g} at {o.time:.6g} s" for o in identification.outliers[:_MOST_OUTLIERS])
    more = len(identification.outliers) - _MOST_OUTLIERS
    return [f"outliers left out: {told}{f', and {more} smaller' if more > 0 else ''}"]


def identification_figure(identification: Identification) -> Any:
    """Measured and simulated friction, and what is left of the noise, over time.

    Returns
    -------
    matplotlib.figure.Figure
    """
    drawing, ((above,), (below,)) = figure(2, 4.6, gridspec_kw={"height_ratios": (2, 1)})
    size, unit = clock(float(identification.record.time[-1]))
    time, fit = identification.record.time[identification.used] / size, identification.fit
    above.plot(time, fit.measured, ".", color=_MEASURED, markersize=2, label="measured")
    above.plot(
        time, fit.measured - fit.residuals, color=_FITTED, linewidth=1.2, label=f"fitted: {identification.law.name}"
    )
    above.set_ylabel("friction [-]", fontsize=SMALL)
    below.plot(time[fit.kept], fit.residuals[fit.kept], ".", color=_MEASURED, markersize=2)
    for level in (-2 * fit.noise, 0.0, 2 * fit.noise):
        below.axhline(level, color=NATURAL, linewidth=0.6, linestyle="solid" if level == 0 else (0, (4, 2)))
    if identification.outliers:
        places = np.flatnonzero(~fit.kept)
        above.plot(time[places], fit.measured[places], "x", color=_OUTLIER, markersize=5, label="left out")
        inside = 8 * fit.noise
        below.plot(time[places], np.clip(fit.residuals[places], -inside, inside), "x", color=_OUTLIER, markersize=5)
    below.set_ylabel("residual [-]", fontsize=SMALL)
    below.set_xlabel(f"time [{unit}]", fontsize=SMALL)
    note = f"dashed: twice the noise, {fit.noise:.3g}; crosses beyond eight times it stand at its edge"
    return finish(drawing, f"{identification.record.name}: friction and residuals", [], note, legend=above)


def require_format(path: Path) -> None:
    """Refuse a figure of another format than SVG, PNG or PDF.

    Raises
    ------
    OutputError
    """
    if path.suffix[1:] not in FORMATS:
        raise OutputError(f"a figure must end in .{', .'.join(FORMATS)}. Received {path}. Write {path.stem}.svg, say.")


def save_figure(identification: Identification, path: Path) -> None:
    """Write the figure, whole or not at all, without a date so that the same figure is the same file.

    Raises
    ------
    OutputError
    """
    require_format(path)
    write_whole(path, figure_bytes(identification_figure(identification), path.suffix[1:], path.stem))
