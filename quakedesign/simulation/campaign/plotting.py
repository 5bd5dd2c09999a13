"""The figure of a campaign."""

from collections.abc import Mapping
from typing import Any

import numpy as np

_DECADES = 30.0


def figure(title: str, caption: str, shown: Mapping[str, tuple[Any, Mapping[float, float | None]]]) -> Any:
    """Return a Figure with the share of samples below every value.

    Parameters
    ----------
    title, caption : str
    shown : mapping of str to tuple
        Under what is shown, with its unit: values of the samples, nan where there is none, and quantiles to mark.
    """
    from matplotlib.figure import Figure

    rows = max(1, -(-len(shown) // 3))
    drawing = Figure(figsize=(10, 0.8 + 2.6 * rows), layout="constrained")
    axes = drawing.subplots(rows, 3, sharey=True, squeeze=False).ravel()
    for axis in axes[len(shown) :]:
        axis.set_visible(False)
    for axis, (name, (values, marks)) in zip(axes, shown.items(), strict=False):
        _distribution(axis, name, values, marks)
    drawing.suptitle(title)
    drawing.supxlabel(caption, fontsize=7)
    return drawing


def _distribution(axis: Any, name: str, values: Any, marks: Mapping[float, float | None]) -> None:
    known = values[~np.isnan(values)]
    finite = np.sort(known[np.isfinite(known)])
    axis.step(finite, np.arange(1, len(finite) + 1) / max(1, len(known)), where="post", color="#0072B2")
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
