"""Figures of the paper that show simulations, redrawn for any fault.

Source: Gutiérrez-Oribio, Tzortzopoulos, Stefanou and Plestan, Earthquake Control, sections II-D and IV. The paper's
figures of the laboratory fault show experiments; here this fault is simulated like any other.
"""

from functools import cached_property
from typing import TYPE_CHECKING, Any

from quakedesign.report.comparison_table import Comparison
from quakedesign.report.drawing import (
    INDUCED,
    NATURAL,
    SMALL,
    bar_look,
    clock,
    colour,
    figure,
    finish,
    length,
    named,
    runs_of,
    scaled,
    style,
    with_diverged,
)
from quakedesign.report.figures import end, figures, pressure
from quakedesign.studies.paper import BARS, PaperRuns, baseline, friction_curve, paper_runs, relative
from quakedesign.text import Progress

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from quakedesign.simulation import Trajectory
    from quakedesign.studies.comparison import Compared, Entry


PAPER = {
    "friction-law": "figure 4",
    "earthquakes": "figure 3",
    "uncontrolled": "figures 5 and 9",
    "states": "figures 6 and 10",
    "pressure": "figures 7 and 11",
    "friction-coefficient": "figure 11",
    "errors-and-power": "figures 8 and 12",
}
"""Corresponding figures of the paper, by name of the figure here."""


def paper_figures(study: "PaperRuns") -> "dict[str, Figure]":
    """Figures of a study by name: those of a comparison, and the paper's (`PAPER`).

    Closed-loop figures need a run, ``errors-and-power`` a run of an e-LQR. For friction with a state there are no
    figures of friction law and earthquakes.
    """
    comparison = study.comparison
    if study.induced is None:
        seen = {"friction-coefficient": friction_coefficient(comparison)} if runs_of(comparison.entries) else {}
        return figures(comparison) | seen
    quakes = earthquakes(comparison, study.induced)
    drawn = {"friction-law": friction_law(comparison), "earthquakes": quakes, **figures(comparison)}
    if runs_of(comparison.entries):
        drawn["pressure"] = pressure(comparison, study.close_ups)
        drawn["friction-coefficient"] = friction_coefficient(comparison)
    if baseline(comparison) is not None:
        drawn["errors-and-power"] = errors_and_power(comparison)
    if study.front:
        drawn["peak-against-tracking"] = peak_against_tracking(study)
    return drawn


def peak_against_tracking(study: "PaperRuns") -> "Figure":
    """Simulated errors against the guaranteed slip-rate error, one point per design."""
    claims = [point.guarantee.claims for point in study.front]
    drawing, axes = figure(1, 3.2, 2)
    largest = max(float(claim.slip_rate_error) for claim in claims)
    size, unit = scaled(largest, "m/s")
    for axis, metric, base in zip(axes[0], ("max_slip_error", "max_slip_rate_error"), ("m", "m/s"), strict=True):
        seen = [getattr(point.run.metrics, metric) for point in study.front]
        divisor, name = scaled(max(seen), base)
        across = [float(claim.slip_rate_error) / size for claim in claims]
        axis.plot(across, [value / divisor for value in seen], "o-", color=colour("elqr"), linewidth=1)
        for x, value, point in zip(across, seen, study.front, strict=True):
            short = point.objective.removeprefix("tracking, ").removesuffix(" times the least slip-rate error")
            axis.annotate(short, (x, value / divisor), textcoords="offset points", xytext=(4, 4), fontsize=SMALL - 1)
        axis.set(xlabel=f"guaranteed slip-rate error [{unit}]", ylim=(0, 1.15 * max(seen) / divisor))
        axis.set_ylabel(f"simulated {'slip' if base == 'm' else 'slip-rate'} error [{name}]")
        axis.margins(x=0.12)
    note = "plant without stick; peak: smallest guaranteed slip-rate error; numbers: allowed multiple of this error"
    title = f"{study.comparison.fault.name}: peak against tracking of the e-LQR"
    return finish(drawing, title, [point.run for point in study.front], note)


def friction_law(comparison: "Compared") -> "Figure":
    """Friction coefficient against slip, and the slope at which the spring unloads."""
    fault, run = comparison.fault, comparison.uncontrolled
    slips, values, spring = friction_curve(fault, 1.1 * max(float(run.slip.max()), fault.reference.target_slip))
    size, unit = length(float(slips[-1]))
    drawing, ((axis,),) = figure(1, 3.0)
    axis.plot(slips / size, values, color=NATURAL, label=f"{fault.friction.name} at rest")
    axis.plot(slips / size, spring, color="grey", linestyle="--", linewidth=1, label="unloading of the spring")
    axis.set_ylim(bottom=max(0.0, values.min() - (values.max() - values.min()) / 4))
    axis.set_xlabel(f"slip [{unit}]")
    axis.set_ylabel("friction coefficient [-]")
    axis.legend(fontsize=SMALL)
    return finish(drawing, f"{fault.name}: friction law of the simulations", [], "from the law itself, not from a run")


def earthquakes(comparison: "Compared", induced: "Trajectory") -> "Figure":
    """Slip and slip rate of the natural and of the induced earthquake."""
    fault, natural = comparison.fault, comparison.uncontrolled
    drawing, ((slip,), (rate,)) = figure(2, 4.4)
    size, unit = length(float(induced.slip.max()))
    divisor, name = clock(end(natural, induced))
    amount, pascal = scaled(float(induced.pressure[0]), "Pa")
    for run, shade, line, label in (
        (natural, NATURAL, "solid", "natural, p = 0"),
        (induced, INDUCED, (0, (4, 2)), f"induced, p = {induced.pressure[0] / amount:.4g} {pascal}"),
    ):
        slip.plot(run.time / divisor, run.slip / size, color=shade, linestyle=line, label=label)
        rate.plot(run.time / divisor, run.slip_rate, color=shade, linestyle=line)
    slip.set_xlim(-0.03 * (last := end(natural, induced)) / divisor, last / divisor)
    slip.set_ylabel(f"slip [{unit}]")
    slip.legend(loc="lower right", fontsize=SMALL)
    rate.set_ylabel("slip rate [m/s]")
    rate.set_xlabel(f"time [{name}]")
    return finish(drawing, f"{fault.name}: natural and induced earthquake", [natural, induced])


def friction_coefficient(comparison: "Compared") -> "Figure":
    """Friction coefficient over time in closed loop; laws that track the reference share one curve."""
    drawing, ((axis,),) = figure(1, 3.2)
    runs = runs_of(comparison.entries)
    divisor, unit = clock(max(float(run.time[-1]) for _, run in runs))
    for place, (entry, run) in enumerate(runs):
        width = 1.2 * (len(runs) - place)
        axis.plot(run.time / divisor, run.friction, **style(entry) | {"linewidth": width, "linestyle": "solid"})
    low, high = comparison.fault.friction.bounds
    for bound, name, side in ((low, "smallest", "top"), (high, "largest", "bottom")):
        axis.axhline(float(bound), color="grey", linestyle=":", linewidth=1)
        axis.annotate(f"{name} {float(bound):.4g}", (1, float(bound)), xycoords=("axes fraction", "data"),
                      xytext=(-4, -3 if side == "top" else 3), textcoords="offset points",
                      ha="right", va=side, fontsize=SMALL - 1, color="#444444")  # fmt: skip
    axis.margins(y=0.12)
    axis.set_xlabel(f"time [{unit}]")
    axis.set_ylabel("friction coefficient [-]")
    title = f"{comparison.fault.name}: friction coefficient in closed loop"
    return finish(drawing, title, runs, with_diverged(comparison.entries), legend=axis)


def errors_and_power(comparison: "Compared") -> "Figure":
    """Ratios to the e-LQR of mean squared errors, largest errors and RMS pressure, in five panels."""
    basis = baseline(comparison)
    assert basis is not None
    ratios = [(entry, relative(entry.run, basis.run)) for entry, _ in runs_of(comparison.entries)]
    shown = [(entry, values) for entry, values in ratios if all(values[name] is not None for name in BARS)]
    drawing, axes = figure(2, 4.6, 3, sharey=True)
    for axis, (name, title) in zip(axes.ravel(), BARS.items(), strict=False):
        _bars(axis, shown, name, title)
    axes[0, 0].invert_yaxis()
    _notes(axes[1, 2], basis)
    return finish(
        drawing,
        f"{comparison.fault.name}: errors and RMS pressure relative to the {basis.label}",
        runs_of(entry for entry, _ in shown),
        with_diverged(comparison.entries),
    )


def _bars(axis: "Axes", shown: "list[tuple[Entry, dict[str, Any]]]", name: str, title: str) -> None:
    """Draw one panel; on a logarithmic axis bars begin at 1, so that better and worse values are on opposite sides."""
    values = [entry_ratios[name] for _, entry_ratios in shown]
    logarithmic = name != "rms_pressure" and min(values) > 0
    start = 1.0 if logarithmic else 0.0
    for place, ((entry, _), value) in enumerate(zip(shown, values, strict=True)):
        axis.barh(place, value - start, left=start, **bar_look(entry))
        outside = max(value, start) if logarithmic else value
        axis.annotate(f" {value:.3g}", (outside, place), va="center", fontsize=SMALL - 1)
    axis.axvline(1, color="black", linewidth=0.8)
    axis.set_yticks(range(len(shown)), [entry.label for entry, _ in shown])
    named(axis, title)
    axis.set_xlabel("ratio to e-LQR [-]")
    if logarithmic:
        axis.set_xscale("log")
        low, high = min(*values, 1.0), max(*values, 1.0)
        axis.set_xlim(low / 2, high * (high / low) ** 0.6 * 4)
    else:
        axis.set_xlim(0, 1.4 * max(*values, 1.0))


def _notes(axis: "Axes", basis: "Entry") -> None:
    """Write the reference values of the ratios into the free panel."""
    run = basis.run
    assert run is not None
    lines = [f"ratio 1 is {basis.label}:", ""]
    for name, title in BARS.items():
        lines.append(
            f"{title.replace(chr(10), ' ')}: {getattr(run.metrics, name):.3g} {_superscript(run.metrics.unit(name))}"
        )
    lines += ["", f"t > {run.metrics.settled_from:.6g} s; hatched: published gains"]
    axis.axis("off")
    axis.text(0, 0.95, "\n".join(lines), transform=axis.transAxes, va="top", fontsize=SMALL - 1, wrap=True)


def _superscript(unit: str) -> str:
    return unit.replace("^2", "²")


# ----------------------------------------------------------------------
# Figures of the paper from the runs that they need.


class PaperStudy(PaperRuns):
    """Runs of all figures, see `PaperRuns`, and the figures themselves."""

    comparison: Comparison

    def figures(self) -> "dict[str, Figure]":
        """Matplotlib figures by name, drawn once."""
        return self._drawn

    @cached_property
    def _drawn(self) -> "dict[str, Figure]":
        return paper_figures(self)


def paper_study(comparison: Comparison, *, progress: Progress | None = None) -> PaperStudy:
    """Simulate the additional runs for the figures of the paper; see `paper_runs`."""
    return PaperStudy(**vars(paper_runs(comparison, progress=progress)))
