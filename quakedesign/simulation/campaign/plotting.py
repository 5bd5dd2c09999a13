"""The figure of a campaign."""

from typing import TYPE_CHECKING, Any

from quakedesign.simulation.metrics import StickMetrics

if TYPE_CHECKING:
    from quakedesign.simulation.campaign.result import Campaign

SHOWN = (
    "max_slip_error",
    "max_slip_rate_error",
    "peak_slip_rate",
    "rms_pressure",
    "max_pressure",
    "pressure_total_variation",
)
_MARKED = {0.05: "5 %", 0.5: "50 %", 0.95: "95 %"}
_DECADES = 30.0


def figure(campaign: "Campaign") -> Any:
    """Return a Figure with the share of samples below every value, for the metrics that the samples have."""
    from matplotlib.figure import Figure

    names = [name for name in SHOWN if name in campaign.metrics]
    rows = max(1, -(-len(names) // 3))
    drawing = Figure(figsize=(10, 0.8 + 2.6 * rows), layout="constrained")
    axes = drawing.subplots(rows, 3, sharey=True, squeeze=False).ravel()
    for axis in axes[len(names) :]:
        axis.set_visible(False)
    for axis, name in zip(axes, names, strict=False):
        _distribution(axis, campaign, name)
    diverged, count = len(campaign.events["diverged"]), len(campaign.results)
    problem = campaign.problem
    law = problem.controller.title if problem.controller else "no control"
    drawing.suptitle(f"{problem.fault.name}, {law}: {count} samples, {diverged} diverge")
    drawing.supxlabel(f"scheme {problem.scheme.name}, step {problem.setting.step:g} s", fontsize=7)
    return drawing


def _distribution(axis: Any, campaign: "Campaign", name: str) -> None:
    import numpy as np

    values = campaign.values(name)
    known = values[~np.isnan(values)]
    finite = np.sort(known[np.isfinite(known)])
    axis.step(finite, np.arange(1, len(finite) + 1) / max(1, len(known)), where="post", color="#0072B2")
    for level, label in _MARKED.items():
        value = campaign.quantiles((level,))[name][f"{level:g}"]
        if value is not None:
            axis.axvline(value, color="grey", linestyle=":", linewidth=1)
            side = {"ha": "right", "xytext": (-2, 2)} if level > 0.5 else {"ha": "left", "xytext": (2, 2)}
            axis.annotate(label, (value, level), fontsize=7, textcoords="offset points", **side)
    if len(finite) and finite[0] > 0 and finite[-1] > _DECADES * finite[0]:
        axis.set_xscale("log")
    else:
        axis.locator_params(axis="x", nbins=5)
    axis.set_xlabel(f"{name.replace('_', ' ')} [{StickMetrics.unit(name) or '-'}]")
    if axis.get_subplotspec().is_first_col():
        axis.set_ylabel("share of samples [-]")
    axis.set_ylim(0, 1.02)
    axis.grid(visible=True, alpha=0.3)
