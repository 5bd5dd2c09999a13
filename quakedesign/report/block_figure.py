"""Figure of a run of several blocks: slip error, slip rate and pressure over time, and slip along the fault."""

from typing import TYPE_CHECKING

import numpy as np

from quakedesign.fault import BlockChain
from quakedesign.report.drawing import SMALL, clock, figure, finish, scaled
from quakedesign.simulation.block_run import BlockRun
from quakedesign.simulation.coupled_sliders import SlidersRun

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LINES = ("solid", "dashed", "dotted")
_STAGES = 6


def block_figure(chain: BlockChain, run: BlockRun | SlidersRun, proved: str) -> "Figure":
    """Matplotlib figure of a run.

    Parameters
    ----------
    chain : BlockChain
    run : BlockRun or SlidersRun
    proved : str
        Sentence of the guarantee, which becomes the note below the figure.
    """
    from matplotlib import colormaps

    drawing, axes = figure(2, 5.2, 2)
    size, unit = clock(float(run.times[-1]))
    times, N, palette = run.times / size, len(chain.blocks), colormaps["viridis"]
    shades = [palette(0.9 * i / max(N - 1, 1)) for i in range(N)]
    errors = run.slip - run.reference[:, None]
    parts = ((axes[0, 0], errors, "m", "slip error"), (axes[0, 1], run.slip_rate, "m/s", "largest slip rate"))
    for axis, values, SI, title in parts:
        factor, name = scaled(float(np.abs(values).max()) or 1.0, SI)
        for i in range(N):
            label = f"block {i + 1}"
            axis.plot(
                times, values[:, i] / factor, color=shades[i], linestyle=_LINES[i % 3], linewidth=0.8, label=label
            )
        axis.set_ylabel(f"{title} [{name}]", fontsize=SMALL)
    if chain.has_state:
        axes[0, 1].set_yscale("log")
    factor, name = scaled(float(np.abs(run.pressure).max(initial=0.0)) or 1.0, "Pa")
    for j in range(run.pressure.shape[1]):
        axes[1, 0].plot(
            times, run.pressure[:, j] / factor, linewidth=0.8, linestyle=_LINES[j % 3], label=f"well {j + 1}"
        )
    axes[1, 0].set_ylabel(f"pressure [{name}]", fontsize=SMALL)
    if run.pressure.shape[1]:
        axes[1, 0].legend(fontsize=SMALL - 1, ncols=2)
    for axis in (*axes[0], axes[1, 0]):
        axis.set_xlabel(f"time [{unit}]", fontsize=SMALL)
    edges = np.concatenate([[0], np.cumsum([float(v) for v in chain.lengths])]) / 1e3
    factor, name = scaled(float(np.abs(run.slip).max()) or 1.0, "m")
    for stage in range(1, _STAGES):
        at = stage * (len(run.times) - 1) // (_STAGES - 1)
        axes[1, 1].stairs(run.slip[at] / factor, edges, color="black", alpha=0.2 + 0.8 * stage / _STAGES)
        axes[1, 1].annotate(f"{times[at]:.3g} {unit}", (edges[0], run.slip[at, 0] / factor), fontsize=SMALL - 2)
    for place in chain.wells:
        axes[1, 1].axvline(place / 1e3, color="#0072B2", linestyle="dotted", linewidth=0.8)
    axes[1, 1].set_xlabel("position along the fault [km] (wells: dotted)", fontsize=SMALL)
    axes[1, 1].set_ylabel(f"slip [{name}]", fontsize=SMALL)
    return finish(drawing, f"{chain.name}: {N} blocks", [], proved, legend=axes[0, 0])
