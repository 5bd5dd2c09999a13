"""Sensitivity of a sampled loop to its sampling period, noise and input gain: tables and figures."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError, SimulationError, require_known
from quakedesign.fault import Fault
from quakedesign.files import Json
from quakedesign.laws import Controller
from quakedesign.loop.sensing.measurement import Measurement
from quakedesign.simulation.closed_loop import Variation
from quakedesign.simulation.run_settings import PRINTED
from quakedesign.simulation.simulate import simulate

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from quakedesign.simulation.trajectory import Trajectory


SCHEMES = ("explicit", "implicit", "semi-implicit", "compensated")
QUANTITIES = {
    "slip_error": ("max |e1|", "m"),
    "slip_rate_error": ("max |e2|", "m/s"),
    "matched_error": ("max |e3|", "m/s^2"),
}
_COLOURS = {"explicit": "#D55E00", "implicit": "#0072B2", "semi-implicit": "#CC79A7", "compensated": "#009E73"}
_MOST_SAMPLES = 20_000


@checked_dataclass(frozen=True, kw_only=True)
class Study:
    """Largest errors of several schemes as functions of one parameter.

    Attributes
    ----------
    title : str
    label, unit : str
        Name and unit of the parameter.
    levels : tuple of float
        Values of the parameter.
    errors : mapping of str to mapping
        Largest errors at every level, by scheme and by the names of `QUANTITIES`; infinite for a run that diverged.
    """

    title: str
    label: str
    unit: str
    levels: tuple[float, ...]
    errors: Mapping[str, Mapping[str, tuple[float, ...]]]

    def rows(self) -> list[Json]:
        """One row per scheme and level."""
        return [
            {"scheme": scheme, self.label: level} | {name: values[i] for name, values in errors.items()}
            for scheme, errors in self.errors.items()
            for i, level in enumerate(self.levels)
        ]

    def to_pandas(self) -> "pd.DataFrame":
        """Return the rows as a pandas DataFrame."""
        import pandas as pd

        return pd.DataFrame(self.rows())

    def orders(self) -> dict[str, dict[str, float | None]]:
        """Exponent n of error ~ levelⁿ by scheme and quantity, by least squares in logarithms.

        None if a run diverged or an error is zero.
        """
        return {
            scheme: {name: _slope(self.levels, values) for name, values in errors.items()}
            for scheme, errors in self.errors.items()
        }

    def to_dict(self) -> Json:
        """Return the study in JSON types; null marks a run that diverged."""
        errors = {
            scheme: {name: [v if math.isfinite(v) else None for v in values] for name, values in by_name.items()}
            for scheme, by_name in self.errors.items()
        }
        return {k: getattr(self, k) for k in ("title", "label", "unit")} | {"levels": [*self.levels], "errors": errors}

    def figure(self) -> "Figure":
        """Return a matplotlib Figure with one panel per quantity and one line per scheme."""
        from matplotlib.figure import Figure

        shown = list(next(iter(self.errors.values())))
        drawing = Figure(figsize=(8, 1.2 + 2.4 * len(shown)), layout="constrained", dpi=150)
        axes = drawing.subplots(len(shown), 1, sharex=True, squeeze=False).ravel()
        for axis, name in zip(axes, shown, strict=True):
            self._panel(axis, name)
        axes[-1].set_xlabel(f"{self.label} [{self.unit or '-'}]")
        drawing.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
        drawing.suptitle(self.title)
        return drawing

    def _panel(self, axis: "Axes", name: str) -> None:
        label, unit = QUANTITIES[name]
        for scheme, errors in self.errors.items():
            axis.plot(
                self.levels, errors[name], "o-", ms=3, lw=1.2, color=_COLOURS.get(scheme, "#555555"), label=scheme
            )
        wide = min(self.levels) > 0 and max(self.levels) > 10 * min(self.levels)
        axis.set_xscale("log" if wide else "linear")
        axis.set_yscale("log")
        axis.set_ylabel(f"{label} [{unit}]")
        axis.grid(visible=True, alpha=0.3)


def accuracy(
    fault: Fault,
    controller: Controller,
    *,
    steps: Sequence[float],
    schemes: Sequence[str] = SCHEMES,
    duration: float,
    settled_from: float,
) -> Study:
    """Errors of a sliding-mode law versus the sampling period, on the plant without stick.

    Parameters
    ----------
    fault : Fault
    controller : Controller
        Without feed-forward, so that e3 = ξ1 + h.
    steps : sequence of float
        Sampling periods T_s [s].
    schemes : sequence of str
    duration, settled_from : float
        Duration of every run, and time from which errors count [s].

    Returns
    -------
    Study
        `orders` gives the exponents of slip error e1, slip-rate error e2, and e3; 3, 2 and 1 for ``explicit``.

    Raises
    ------
    ParameterError
        For a law with feed-forward.
    """
    if any(controller.feedforward.coefficients.values()):
        raise ParameterError("accuracy needs a law without feed-forward, since e3 = xi1 + h. Received a law with it.")

    def run(scheme: str, step: float) -> "Trajectory":
        return simulate(
            fault,
            controller,
            scheme=scheme,
            step=step,
            duration=duration,
            settled_from=settled_from,
            samples=_MOST_SAMPLES,
            plant=PRINTED,
        )

    title = f"{fault.name}, {controller.title}: accuracy of sampling"
    return _study(title, ("T_s", "s"), tuple(steps), schemes, run, matched=True)


def noise_sensitivity(
    fault: Fault,
    controller: Controller,
    *,
    levels: Sequence[float],
    of: str = "slip_noise",
    schemes: Sequence[str] = SCHEMES,
    seed: int = 0,
    duration: float | None = None,
    plant: str | None = None,
) -> Study:
    """Errors versus the standard deviation of the measurement noise.

    Parameters
    ----------
    fault : Fault
    controller : Controller
    levels : sequence of float
        Standard deviations, in the unit of `of`.
    of : str
        ``"slip_noise"`` [m] or ``"rate_noise"`` [m/s], otherwise a ParameterError is raised; the other noise is 0.
    schemes : sequence of str
    seed : int
    duration : float, optional
        [s]; the operation time unless given.
    plant : str, optional
        As in `simulate`.
    """
    units = {"slip_noise": "m", "rate_noise": "m/s"}
    exact = Measurement(seed=seed)
    require_known(of, units, "noise")

    def run(scheme: str, level: float) -> "Trajectory":
        slip, rate = (level, 0.0) if of == "slip_noise" else (0.0, level)
        measurement = replace(exact, slip_noise=slip, rate_noise=rate)
        return simulate(fault, controller, scheme=scheme, measurement=measurement, duration=duration, plant=plant)

    title = f"{fault.name}, {controller.title}: sensitivity to noise"
    label = f"standard deviation of the {of.replace('_', ' ')}"
    return _study(title, (label, units[of]), tuple(levels), schemes, run)


def gain_sensitivity(
    fault: Fault,
    controller: Controller,
    *,
    points: int = 5,
    schemes: Sequence[str] = SCHEMES,
    duration: float | None = None,
    plant: str | None = None,
) -> Study:
    """Errors versus the true input gain, over the range of β = μN̂/(μ0N̂0) in the fault's box.

    A level is the ratio of β at rest to the geometric mean of the bounds of β, which is the value that the scheme
    ``compensated`` assumes. N̂ is varied. During the run β decreases as friction weakens.

    Parameters
    ----------
    fault : Fault
        With a box in which N̂ is uncertain, such as ``ten-percent``; a ParameterError is raised for others.
    controller : Controller
    points : int
        Number of levels, at least 2.
    schemes : sequence of str
    duration : float, optional
        [s]; the operation time unless given.
    plant : str, optional
        As in `simulate`.
    """
    width = float(fault.box.authority)
    if not width or points < 2:
        raise ParameterError(
            f"sensitivity to the input gain needs a box with uncertain authority and at least 2 points. Received the "
            f"box {fault.box.name!r} and {points!r}. Use fault.with_box('ten-percent')."
        )
    low, high = fault.friction.bounds
    factors = np.linspace(1 - width, 1 + width, points)
    levels = {float(high * x / np.sqrt(low * (1 - width) * high * (1 + width))): float(x) for x in factors}

    def run(scheme: str, level: float) -> "Trajectory":
        variation = Variation(authority=levels[level])
        return simulate(fault, controller, scheme=scheme, variation=variation, duration=duration, plant=plant)

    title = f"{fault.name}, {controller.title}: sensitivity to the input gain"
    return _study(title, ("β at rest divided by the geometric mean of its bounds", ""), tuple(levels), schemes, run)


def _slope(levels: Sequence[float], values: Sequence[float]) -> float | None:
    if len(levels) < 2 or not all(0 < v < math.inf for v in (*levels, *values)):
        return None
    return float(np.polyfit(np.log(levels), np.log(values), 1)[0])


def _study(
    title: str,
    parameter: tuple[str, str],
    levels: tuple[float, ...],
    schemes: Sequence[str],
    run: "Callable[[str, float], Trajectory]",
    *,
    matched: bool = False,
) -> Study:
    errors = {}
    for scheme in schemes:
        by_level = [_errors(run(scheme, level), matched) for level in levels]
        errors[scheme] = {name: tuple(values[name] for values in by_level) for name in by_level[0]}
    label, unit = parameter
    return Study(title=title, label=label, unit=unit, levels=levels, errors=errors)


def _errors(run: "Trajectory", matched: bool) -> dict[str, float]:
    """Largest errors of a run; that of e3 is evaluated only at the stored instants."""
    metrics, infinite = run.metrics, math.inf
    errors = {"slip_error": metrics.max_slip_error, "slip_rate_error": metrics.max_slip_rate_error}
    if "diverged" in run.events:
        return dict.fromkeys([*errors, "matched_error"] if matched else errors, infinite)
    if None in errors.values():
        raise SimulationError(f"duration must exceed {metrics.settled_from:g} s. Received {run.time[-1]:g} s.")
    if matched:
        settled = run.time > metrics.settled_from
        assert run.matched_perturbation is not None
        errors["matched_error"] = float(np.max(np.abs(run.signals()["xi_1"][0] + run.matched_perturbation)[settled]))
    return {name: float(value) for name, value in errors.items() if value is not None}
