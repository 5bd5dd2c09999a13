"""Performance limits of a fault as lines, as a figure and as a folder."""

from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from quakedesign.exact import Bound, LowerBound, UpperBound, rational
from quakedesign.files import Json, whole_folder
from quakedesign.guarantees import SlidingProof
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.report.drawing import NATURAL, figure, finish, write_figures, write_results
from quakedesign.studies import Limits
from quakedesign.studies.performance_limits import SlidingLimits
from quakedesign.text import quantity

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FORBIDDEN, _HIDDEN, _PROVED = "#F3C6B2", "#F9E4DA", "#0072B2"


def limits_lines(limits: Limits) -> list[str]:
    """Performance limits and proved bounds as lines of at most 80 characters."""
    task = limits.fault
    head = [
        f"{task.name}: performance limits, and proved bounds of designs",
        f"({_box(limits)}{limits.against}, T_s = {task.sampling_time:g} s{_delay(limits)})",
        "",
        f"{'':24}{'infeasible':>20}{'proved':>16}",
    ]
    rows = [
        f"{limit.title:24}{_beyond(limit.impossible_beyond, limit.unit):>20}"
        f"{_shown(limit.proved_up_to, limit.unit):>16}"
        for limit in limits.named().values()
    ]
    lines = [*_meaning(limits), *_undecided(limits)]
    return [*head, *rows, "", *(line for note in lines for line in wrap(note, 80, subsequent_indent="  "))]


def _delay(limits: Limits) -> str:
    """Delay of the loop; limits of slow sliding have no delay."""
    late = 0 if isinstance(limits, SlidingLimits) else ExactSetup.of(limits.sensing.setup).delay
    return f", delay {quantity(float(late), 's')}" if late else ""


def _meaning(limits: Limits) -> list[str]:
    if isinstance(limits, SlidingLimits):
        return _meaning_of_sliding(limits)
    if limits.peak_slip_rate_error.impossible_beyond is None:
        return ["without a disturbance no limit is known: give an amplitude in [disturbance] of the fault file"]
    within = "bounded" if limits.slip_error is None else f"within {limits.slip_error.quantity('m')}"
    signals = "knows slip, slip rate and disturbance"
    if limits.sensing.noisy:
        signals = f"measures {limits.sensing.summary()}"
    lines = [
        "infeasible: every controller, linear or not, fails for some friction of the box and some disturbance of the "
        "stated size, which may jump",
        f"slip-rate error: for controllers that keep the slip error {within}, on the plant without stick, "
        f"even for a controller that {signals} up to each sample",
        "proved, slip-rate error: the smaller bound of the designs for the objectives tracking and peak, on the plant "
        "without stick",
    ]
    if (least := limits.stick_slip_rate) is not None:
        lines.insert(
            2,
            f"on the stick-slip plant, even without a delay, every controller that makes the fault follow a moving "
            f"reference lets the slip rate reach {least.quantity('m/s')} for some disturbance, even if friction does "
            "not change",
        )
    if limits.largest_step.impossible_beyond is None:
        return [
            *lines,
            "other rows: no limit is known, as the weakening of friction alone does not make this fault unstable",
        ]
    return [
        *lines,
        "other rows: a constant disturbance begins just after a sample; before the next pressure acts, the fault has "
        f"slipped so far that a withdrawal of {UpperBound(limits.withdrawal).quantity('Pa', 4)} (last row: the "
        f"withdrawal in that row) no longer stops it; D = {float(limits.diffusivity):g} m^2/s",
    ]


def _meaning_of_sliding(limits: SlidingLimits) -> list[str]:
    lines = [
        "infeasible: every controller, linear or not, fails for the nominal fault linearised about slow sliding along "
        "its task, without inertia; for the fault itself these limits are approximations by linearisation",
        "slip-rate error: the limit applies even to a controller that knows slip, slip rate, state and stress up to "
        "each sample; the stress may jump",
    ]
    if limits.diffusion_time:
        holds = "INFEASIBLE for every controller, in the same sense" if limits.beyond else "not shown to be infeasible"
        lines.append(f"the given well, L^2/D = {float(limits.diffusion_time):.4g} s: {holds}")
    if limits.largest_step.impossible_beyond is None:
        return [
            *lines,
            "other rows: no limit is known, as errors of this fault oscillate while they grow, or do not grow",
        ]
    return [
        *lines,
        "other rows: a constant stress begins just after a sample; before the next pressure acts, the errors have "
        f"grown so far that a pressure within {UpperBound(limits.withdrawal).quantity('Pa', 4)} of that for the "
        f"reference no longer stops them; D = {float(limits.diffusivity):g} m^2/s",
        "proved: no design"
        if limits.guarantee is None
        else f"proved: bounds of an e-LQR that was designed for this table{_path(limits.guarantee)}, "
        f"{_constants(limits.guarantee)}, on the fault itself with inertia; another design has other bounds; the "
        "pressure is that at the fault",
    ]


def _constants(proof: SlidingProof) -> str:
    """Spread of a, b and D_c for which the design is proved, in words."""
    low, high = proof.task.ranges["direct_effect"]
    spread = LowerBound((high - low) / (high + low))  # a covered range: rounded inward
    return f"for a, b and D_c with relative spreads of {spread:.3g}" if spread else "for the given a, b and D_c"


def _box(limits: Limits) -> str:
    """Name of the uncertainty box; empty for slow sliding, which has no box."""
    return "" if isinstance(limits, SlidingLimits) else f"box {limits.fault.box.name}, "


def _path(proof: SlidingProof) -> str:
    """Lag or diffusion path of the proved design."""
    ways = {"a lag of": proof.sampled_loop.lag, "a diffusion path of L^2/D =": proof.sampled_loop.diffusion}
    lines = [f"{way} {float(time):.4g} s" for way, time in ways.items() if time]
    return f" behind {' and '.join(lines)}" if lines else ""


def _undecided(limits: Limits) -> list[str]:
    """Sentence for a T_s of the fault that is neither proved nor infeasible; empty otherwise."""
    step, own = limits.largest_step, rational(limits.fault.sampling_time)
    proved = step.proved_up_to is not None and own <= step.proved_up_to
    if proved or step.impossible_beyond is None or own > step.impossible_beyond:
        return []
    return [
        f"T_s = {limits.fault.sampling_time:g} s of this fault: neither proved for a design nor shown to be infeasible"
    ]


def _beyond(bound: Bound | None, unit: str) -> str:
    if bound is None:
        return "-"
    return f"{'below' if isinstance(bound, LowerBound) else 'above'} {bound.quantity(unit)}"


def _shown(bound: Bound | None, unit: str) -> str:
    return "-" if bound is None else bound.quantity(unit)


def limits_figure(limits: Limits) -> "Figure":
    """Infeasible and proved slip-rate errors over T_s, and the slip rate of the natural earthquake."""
    drawing, axes = figure(1, 4.2)
    axis, natural = axes[0, 0], limits.natural_peak
    axis.set(xscale="log", yscale="log", xlabel="T_s [s]", ylabel="slip-rate error [m/s]")
    steps, peaks = np.array([(float(step), float(peak)) for step, peak in limits.smallest_peaks()]).reshape(-1, 2).T
    if len(steps):
        top = 3 * max(natural or 0.0, *peaks)
        last = limits.largest_step.impossible_beyond
        axis.fill_between(steps, peaks[0] / 3, peaks, color=_FORBIDDEN, lw=0, label="infeasible for every controller")
        if last is not None:
            axis.axvspan(float(last), 2 * steps[-1], color=_FORBIDDEN, lw=0)
        if limits.sensing.noisy:
            exact = [float(peak) for _, peak in limits.smallest_peaks(measured=False)]
            axis.fill_between(
                steps, exact, peaks, color=_HIDDEN, lw=0, label=f"infeasible when measuring {limits.sensing.summary()}"
            )
        axis.set(xlim=(steps[0], (1 if last is None else 2) * steps[-1]), ylim=(peaks[0] / 3, top))
    if limits.achieved:
        proved = [(float(step), float(error)) for step, error in limits.achieved]
        axis.plot(*zip(*proved, strict=True), "o", color=_PROVED, label="proved for a designed controller")
    if natural:
        axis.axhline(natural, color=NATURAL, linestyle="--", linewidth=1, label="natural earthquake (slip rate)")
    axis.axvline(limits.fault.sampling_time, color="#777777", linewidth=0.8, linestyle=":", label="T_s of the fault")
    note = f"{_box(limits)}{limits.against.replace('^2', '²')}"
    return finish(drawing, f"{limits.fault.name}: limits with zero-order hold", [], note, legend=axis)


def write_limits(limits: Limits, folder: Path, formats: Sequence[str] = ("png",)) -> Json:
    """Write the figure ``limits`` and ``results.json`` into a folder, whole or not at all; return the results."""
    values = limits.to_dict()
    with whole_folder(folder) as partial:
        write_figures(partial, {"limits": limits_figure(limits)}, formats)
        write_results(partial, values)
    return values
