"""Figures of the laboratory experiment in its own apparatus."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from quakedesign.report.drawing import SMALL, colour, figure, finish, known, named

if TYPE_CHECKING:
    from quakedesign.simulation import Trajectory
    from quakedesign.studies.laboratory import LaboratoryFinding


_LEAST, _MOST = 1e-7, 10.0  # m, of the axis of slip errors; what is outside lies on its edge
_MARKS = {"tracked": "o", "slow slip": "s", "earthquake": "x", "opened": "^", "diverged": "^"}
_APART = 0.22  # of laws in a row


def conditions_figure(findings: Sequence["LaboratoryFinding"], title: str, note: str) -> Any:
    """Slip error [m] of the published laws under every condition: median, range and the commonest outcome."""
    names = list(dict.fromkeys(f.condition for f in findings))
    laws = list(dict.fromkeys(f.law for f in findings))
    drawing, axes = figure(1, 1.6 + 0.24 * len(names))
    axis = axes[0, 0]
    for place, law in enumerate(laws):
        for f in (f for f in findings if f.law == law):
            low, middle, high = np.clip(f.slip_error, _LEAST, _MOST)
            kind = max(f.outcomes, key=lambda k: f.outcomes[k])
            at = names.index(f.condition) + _APART * (place - (len(laws) - 1) / 2)
            axis.plot([low, high], [at, at], color=colour(law), linewidth=1)
            axis.plot(middle, at, _MARKS[kind], color=colour(law), markersize=4)
        axis.plot([], [], "-", color=colour(law), label=law)
    for kind in dict.fromkeys(max(f.outcomes, key=lambda k: f.outcomes[k]) for f in findings):
        axis.plot([], [], _MARKS[kind], color="#444444", label=kind)
    axis.set(xscale="log", xlim=(_LEAST / 1.5, _MOST), yticks=range(len(names)), xlabel="largest slip error [m]")
    axis.set_yticklabels(names)
    axis.set_ylim(len(names) - 0.5, -0.5)
    return finish(drawing, title, [], note, legend=axis)


def runs_figure(runs: Mapping[str, Mapping[str, "Trajectory"]], title: str, note: str) -> Any:
    """Slip error, slip rate and pressure of runs over time, one column a condition, one line a law."""
    drawing, axes = figure(3, 5.0, len(runs), sharex=True, sharey="row")
    for column, (condition, laws) in zip(axes.T, runs.items(), strict=True):
        named(column[0], condition)
        for behind, (law, run) in enumerate(laws.items()):
            minutes = run.time / 60
            values = (run.slip - known(run.reference)) * 1e3, run.slip_rate * 1e3, run.pressure / 1e3
            for axis, value in zip(column, values, strict=True):
                axis.plot(minutes, value, color=colour(law), linewidth=0.8, label=law, zorder=2 - behind / 10)
        column[-1].set_xlabel("time [min]", fontsize=SMALL)
    for axis, label in zip(axes[:, 0], ("slip error [mm]", "slip rate [mm/s]", "pressure [kPa]"), strict=True):
        axis.set_ylabel(label, fontsize=SMALL)
    for axis, width in zip(axes[:, 0], (1e-3, 1e-2, 10.0), strict=True):
        axis.set_yscale("symlog", linthresh=width)
    return finish(drawing, title, [run for laws in runs.values() for run in laws.values()], note, legend=axes[0, -1])
