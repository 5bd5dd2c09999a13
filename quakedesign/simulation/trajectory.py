"""Trajectories of runs with export to xarray, pandas and NetCDF, their outcome and figure.

Every run is a `Trajectory`; `LoopTrajectory` is that of a closed loop, with or without an actuator. The outcome of a
closed loop is ``tracked``, ``slow slip``, ``earthquake``, ``diverged`` or ``opened``.
"""

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, asdict, field, fields
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.fault import Fault
from quakedesign.files import Json, write_whole
from quakedesign.simulation.closed_loop import EnergyBudget
from quakedesign.simulation.recorder import Metrics

if TYPE_CHECKING:
    import control
    import pandas as pd
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# ----------------------------------------------------------------------
# Export of every run: xarray, pandas, NetCDF.

CONVENTIONS = "CF-1.11"


def signal(title: str, unit: str, default: Any = MISSING) -> Any:
    """Dataclass field for a signal, with long name and SI unit; its value is None if the run has no such signal."""
    return field(repr=False, metadata={"title": title, "unit": unit}, default=default)


@checked_dataclass(frozen=True, eq=False, kw_only=True)
class Trajectory(ABC):
    """Result of a run: signals over time with SI units, metrics and outcome. A missing signal is None.

    Attributes
    ----------
    name : str
    time : ndarray
        [s], shape (n,).
    slip, slip_rate, pressure : ndarray
        x1 [m], x2 [m/s], p [Pa], shape (n,).
    reference, reference_rate, matched_perturbation : ndarray or None
        r [m], r' [m/s], h [m/s²], shape (n,); None without a controller.
    friction : ndarray
        Friction coefficient [-], shape (n,).
    metrics : Metrics
        Metrics of the run.
    energy : EnergyBudget or None
        None for a run that diverged, and in slow sliding.
    events : mapping of str to float
        Time of first occurrence [s] by name.
    provenance : mapping
        Method, settings and versions.
    failed : str
        Reason if the run ended early other than by divergence; otherwise empty.
    """

    name: str
    time: "np.ndarray" = field(repr=False)
    slip: "np.ndarray" = signal("slip x1", "m")
    slip_rate: "np.ndarray" = signal("slip rate x2", "m/s")
    pressure: "np.ndarray" = signal("fluid pressure p", "Pa")
    reference: "np.ndarray | None" = signal("reference slip r", "m", default=None)
    reference_rate: "np.ndarray | None" = signal("reference slip rate r'", "m/s", default=None)
    matched_perturbation: "np.ndarray | None" = signal("matched perturbation h", "m/s^2", default=None)
    friction: "np.ndarray" = signal("friction coefficient", "")
    metrics: Metrics
    energy: EnergyBudget | None = field(repr=False)
    events: Mapping[str, float]
    provenance: Mapping[str, Any] = field(repr=False)
    failed: str = field(default="", repr=False)

    @property
    @abstractmethod
    def outcome(self) -> "Outcome":
        """Outcome of the run."""

    @property
    @abstractmethod
    def natural_peak(self) -> float | None:
        """Largest slip rate of the fault without control [m/s]; None where there is no earthquake."""

    @property
    def cycle(self) -> dict[str, float | None] | None:
        """Last recurrence interval [s], and slip [m] and magnitude of the last event; None without a seismic cycle."""
        return None

    @property
    def slip_error(self) -> "np.ndarray | None":
        """x1 − r [m]."""
        return None if self.reference is None else self.slip - self.reference

    @property
    def slip_rate_error(self) -> "np.ndarray | None":
        """x2 − r' [m/s]."""
        return None if self.reference_rate is None else self.slip_rate - self.reference_rate

    def signals(self) -> "dict[str, tuple[np.ndarray, str, str]]":
        """Values, long name and SI unit of every signal that this run has, by name."""
        every = ((each.name, getattr(self, each.name), each.metadata) for each in fields(self))
        return {name: (v, part["title"], part["unit"]) for name, v, part in every if part and v is not None}

    def attributes(self) -> Mapping[str, Any]:
        """Metadata of the run: text and numbers."""
        return self.provenance

    def to_xarray(self) -> "xr.Dataset":
        """Return an xarray Dataset over ``time``, with the attributes of the CF conventions.

        Time is measured from the beginning of the run [s]. It is not marked as axis T of the CF conventions, whose unit
        must name a reference date. No fill value is set, since no value is missing.
        """
        import xarray as xr

        variables = {
            name: ("time", values, {"long_name": title, "units": unit or "1"})
            for name, (values, title, unit) in self.signals().items()
        }
        time = ("time", self.time, {"long_name": "time since the start of the run", "units": "s"})
        source = f"quakedesign {self.attributes().get('version_quakedesign', '')}".strip()
        head = {"Conventions": CONVENTIONS, "title": self.name, "source": source, "history": f"simulated by {source}"}
        dataset = xr.Dataset(variables, coords={"time": time}, attrs=head | dict(self.attributes()))
        for variable in dataset.variables.values():
            variable.encoding["_FillValue"] = None
        return dataset

    def resample(self, dt: float) -> "xr.Dataset":
        """Return an xarray Dataset at uniform instants by linear interpolation, for example for filters and spectra.

        Parameters
        ----------
        dt : float
            Interval [s], at least the mean interval of the stored instants.

        Raises
        ------
        ParameterError
            For a shorter interval, or one longer than the run.
        """
        duration, intervals = float(self.time[-1] - self.time[0]), max(len(self.time) - 1, 1)
        if not 0 < duration / intervals * (1 - 1e-9) <= dt <= duration:
            raise ParameterError(
                f"dt must be between {duration / intervals:.4g} s, the mean interval of the stored instants, and "
                f"{duration:.4g} s, the run. Received {dt!r} s. Change dt, or increase samples in simulate."
            )
        count = int(duration / dt * (1 + 1e-12)) + 1
        return self.to_xarray().interp(time=self.time[0] + dt * np.arange(count))

    def to_pandas(self) -> "pd.DataFrame":
        """Return a pandas DataFrame over the time [s]; the columns carry their units."""
        import pandas as pd

        columns = {f"{name} [{unit or '-'}]": values for name, (values, _, unit) in self.signals().items()}
        return pd.DataFrame(columns, index=pd.Index(self.time, name="time [s]"))

    def save(self, path: str | Path) -> Path:
        """Write the run as NetCDF; a failure leaves no partial file.

        Raises
        ------
        OutputError
            When the file cannot be written.
        """
        target, content = Path(path), BytesIO()
        self.to_xarray().to_netcdf(content, engine="h5netcdf")
        write_whole(target, content.getvalue())
        return target


# ----------------------------------------------------------------------
# Outcome of a run: tracked, slow slip, earthquake, diverged or opened.

KINDS = ("tracked", "slow slip", "earthquake", "diverged", "opened")
HARMLESS = ("tracked", "slow slip")
EARTHQUAKE_SHARE = 0.1
"""A run whose slip rate exceeds the reference rate by at least this fraction of the natural peak is an earthquake."""
TRACKED_SHARE = 0.01
"""The slip rate of a tracked run exceeds the reference rate by at most this fraction of the natural peak."""
SLIP_BAND = 0.02
"""Largest slip error of a tracked run, as a fraction of the target slip: the usual 2 % settling band."""


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Outcome of one run, decided by `OutcomeCriterion`.

    Attributes
    ----------
    kind : str
        One of `KINDS`; for an uncontrolled run with a friction state also ``creep`` or ``unknown``.
    peak_slip_rate : float or None
        Largest |x2| of the run [m/s], or until the law overflows; None if the motion of the plant overflows.
    share_of_natural : float or None
        Ratio of `peak_slip_rate` to the peak of the natural earthquake [-]; None if either does not exist.
    """

    kind: str
    peak_slip_rate: float | None
    share_of_natural: float | None

    @property
    def harmless(self) -> bool:
        """Whether `kind` is ``tracked`` or ``slow slip``; ``creep`` and ``unknown`` are not counted as harmless."""
        return self.kind in HARMLESS

    def to_dict(self) -> Json:
        """Plain values with the keys of docs/reference/json.md."""
        return asdict(self)


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class OutcomeCriterion:
    """Criterion of the outcome of a run.

    In this order, a run is

    - ``diverged``, if the motion of the plant overflows; ``opened``, if the event ``opening`` occurred;
    - ``tracked``, if it has a controller, its slip error never exceeds 2 % of the target slip (over the time in which
      errors count), and its slip rate never exceeds the largest of the reference by more than 1 % of the natural peak
      (over the whole run);
    - an ``earthquake``, if its slip rate ever exceeds the largest of the reference by 10 % of the natural peak or more;
    - ``slow slip`` otherwise.

    A ``tracked`` or ``slow slip`` run is ``diverged`` if the numbers of its law overflow: its rest is then unknown.

    A stable fault has no natural earthquake: its natural peak is replaced by ω_n·d_max, the peak slip rate of a
    harmonic oscillation with the target slip as amplitude. For friction with a state it is always `dynamic_rate`.

    Attributes
    ----------
    natural_peak : float or None
        Largest slip rate of the fault without control [m/s]; None for a stable fault.
    inertial_rate : float
        ω_n·d_max [m/s].
    reference_rate : float
        Largest r' [m/s].
    target_slip : float
        d_max [m].
    dynamic_rate : float, optional
        aσ'A/(η + √(km)) [m/s], for friction with a state, where the natural peak would require simulating a cycle.
    """

    natural_peak: float | None
    inertial_rate: float
    reference_rate: float
    target_slip: float
    dynamic_rate: float | None = None

    @classmethod
    def of(cls, fault: Fault, natural_peak: float | None) -> "OutcomeCriterion":
        """Criterion of a fault and its task."""
        target = fault.reference.target_slip
        return cls(
            natural_peak=natural_peak or None,
            inertial_rate=fault.natural_frequency * target,
            reference_rate=fault.reference.largest_rate,
            target_slip=target,
        )

    def outcome(
        self, peak_slip_rate: float | None, max_slip_error: float | None, events: Mapping[str, float], *, followed: bool
    ) -> Outcome:
        """Outcome of one run.

        Parameters
        ----------
        peak_slip_rate : float or None
            [m/s]; None where the motion of the plant overflows.
        max_slip_error : float or None
            [m]; None for a run that ends before errors are evaluated; the slip rate alone then decides.
        events : mapping of str to float
            Time of first occurrence [s].
        followed : bool
            Whether there was a controller, and therefore a reference.
        """
        if peak_slip_rate is None:
            return Outcome(kind="diverged", peak_slip_rate=None, share_of_natural=None)
        share = peak_slip_rate / self.natural_peak if self.natural_peak else None
        kind = "opened" if "opening" in events else self._kind(peak_slip_rate, max_slip_error or 0.0, followed)
        kind = "diverged" if "diverged" in events and kind in HARMLESS else kind
        return Outcome(kind=kind, peak_slip_rate=peak_slip_rate, share_of_natural=share)

    def _kind(self, peak_slip_rate: float, slip_error: float, followed: bool) -> str:
        excess = peak_slip_rate - (self.reference_rate if followed else 0.0)
        scale = self.dynamic_rate or self.natural_peak or self.inertial_rate
        if followed and slip_error <= SLIP_BAND * self.target_slip and excess <= TRACKED_SHARE * scale:
            return "tracked"
        return "earthquake" if excess >= EARTHQUAKE_SHARE * scale else "slow slip"


# ----------------------------------------------------------------------
# The figure of one run.

Array = np.ndarray
Panel = tuple[str, str, Array, tuple[str, Array | None]]
"""Name, SI unit and values of a signal, and name and values of another in the same panel."""
Signal = tuple["np.ndarray", str, str]
NOTHING = ("", None)
_TIMES = ((2 * 86400.0, 86400.0, "d"), (2 * 3600.0, 3600.0, "h"), (2 * 60.0, 60.0, "min"), (0.0, 1.0, "s"))
_PREFIXES = ((1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def figure(title: str, time: np.ndarray, panels: Sequence[Panel]) -> "Figure":
    """Return a Figure of signals over time [s], one panel each."""
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(7, 1.9 * len(panels)), layout="constrained")
    axes = drawing.subplots(len(panels), 1, sharex=True)
    divisor, unit = next((size, name) for least, size, name in _TIMES if time[-1] >= least)
    for axis, (name, si_unit, values, beside) in zip(axes, panels, strict=True):
        _panel(axis, time / divisor, name, si_unit, values, beside)
    axes[-1].set_xlabel(f"time [{unit}]")
    drawing.suptitle(title)
    return drawing


def stress_figure(title: str, time: Array, slip: Array, shear_stress: Array, moment_rate: Array) -> "Figure":
    """Return a Figure of shear stress against slip (the area under it is the work per area), and of the moment rate."""
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(7, 4.5), layout="constrained")
    above, below = drawing.subplots(2, 1)
    size, prefix = _prefix(float(abs(slip).max()))
    _panel(above, slip / size, "shear stress", "Pa", shear_stress, NOTHING)
    above.set_xlabel(f"slip [{prefix}m]")
    divisor, unit = next((size, name) for least, size, name in _TIMES if time[-1] >= least)
    below.plot(time / divisor, moment_rate, linewidth=1)
    below.set_ylabel("moment rate [N m/s]")
    below.set_xlabel(f"time [{unit}]")
    below.grid(visible=True, alpha=0.3)
    drawing.suptitle(title)
    return drawing


def _panel(axis: "Axes", time: Array, title: str, unit: str, values: Array, beside: tuple[str, Array | None]) -> None:
    name, others = beside
    largest = max(float(abs(curve).max()) for curve in (values, others) if curve is not None)
    # No prefix for a unit with a power, which would apply to the prefix too.
    size, prefix = (1.0, "") if "^" in unit else _prefix(largest)
    if others is not None:
        axis.plot(time, others / size, "--", color="black", linewidth=1, label=name)
    axis.plot(time, values / size, linewidth=1, label="fault", zorder=2.5 if name == "reference" else 1.5)
    if others is not None:
        axis.legend(loc="best")
    axis.set_ylabel(f"{title} [{prefix}{unit.replace('^2', '²').replace('^3', '³')}]")
    axis.grid(visible=True, alpha=0.3)


def _prefix(largest: float) -> tuple[float, str]:
    return next(
        ((size, prefix) for size, prefix in _PREFIXES if largest >= size), _PREFIXES[-1] if largest else (1.0, "")
    )


# ----------------------------------------------------------------------
# Result of a simulation.


@checked_dataclass(frozen=True, eq=False, kw_only=True)
class LoopTrajectory(Trajectory):
    """Run of a closed loop: signals at stored instants, metrics from every step; see `Trajectory`.

    Attributes
    ----------
    shear_stress : ndarray
        Shear stress of friction [Pa], μ(σ' − p) in forward slip, shape (n,).
    moment_per_slip : float
        G·A [N], the seismic moment of one metre of slip.
    integrals : ndarray
        Integral states ξ of the law, shape (number of states, n), in `integral_units`.
    integral_units : tuple of str
    actuation : mapping of str to tuple
        Values, shape (n,), long name and SI unit of the signals of an actuator: ``well_pressure`` [Pa] and, if fluid is
        stored, ``injected_volume`` [m³] and ``flow_rate`` [m³/s]. With an actuator, `pressure` is that in the fault.
    events : mapping of str to float
        Time of first occurrence [s] of ``diverged``, ``opening`` (p ≥ σ'), ``reverse_slip`` (x2 < 0), ``stick`` (the
        fault comes to rest after t = 0), ``load_reversed`` (at rest, the load exceeds friction in the backward
        direction; the stick–slip plant does not model the backward slip that would follow).
    criterion : OutcomeCriterion
        Criterion of `outcome`.
    provenance : mapping
        Method, step, scheme, backend and versions; the fault as a TOML file (``scenario``).
    """

    shear_stress: "np.ndarray" = signal("shear stress that resists slip", "Pa")
    moment_per_slip: float = field(repr=False)
    integrals: "np.ndarray" = field(repr=False)
    integral_units: tuple[str, ...]
    actuation: Mapping[str, Signal] = field(default_factory=dict, repr=False)
    criterion: OutcomeCriterion = field(repr=False)

    @property
    def outcome(self) -> Outcome:
        """Outcome of the run: tracked, slow slip, earthquake, diverged or opened."""
        figures, followed = self.metrics, self.reference is not None
        return self.criterion.outcome(figures.peak_slip_rate, figures.max_slip_error, self.events, followed=followed)

    @property
    def natural_peak(self) -> float | None:
        """Peak slip rate of the natural earthquake [m/s]; None for a stable fault and in slow sliding."""
        return self.criterion.natural_peak

    @property
    def moment_rate(self) -> "np.ndarray":
        """Seismic moment rate G·A·x2 [N m/s], shape (n,)."""
        return self.moment_per_slip * self.slip_rate

    def signals(self) -> dict[str, Signal]:
        """Values, long name and SI unit of every signal that this run has, by name."""
        entries = super().signals() | {"moment_rate": (self.moment_rate, "seismic moment rate", "N m/s")}
        for number, (values, unit) in enumerate(zip(self.integrals, self.integral_units, strict=True), 1):
            entries[f"xi_{number}"] = (values, f"integral state xi{number}", unit)
        return entries | dict(self.actuation)

    def attributes(self) -> Json:
        """Provenance, and outcome, metrics, events and energy as JSON text."""
        entries = {
            "outcome": self.outcome.to_dict(),
            "metrics": self.metrics.to_dict(),
            "events": dict(self.events),
            "energy": self.energy and self.energy.to_dict(),
        }
        return {**self.provenance} | {name: json.dumps(value, allow_nan=False) for name, value in entries.items()}

    @property
    def response(self) -> "control.TimeResponseData":
        """The run as python-control's TimeResponseData: outputs slip [m] and slip_rate [m/s], input p [Pa]."""
        import control

        motion = np.vstack([self.slip, self.slip_rate])
        states = np.vstack([motion, self.integrals])
        labels = ["slip", "slip_rate", *(f"xi_{i + 1}" for i in range(len(self.integrals)))]
        return control.TimeResponseData(
            self.time,
            motion,
            states,
            self.pressure[None, :],
            issiso=False,
            output_labels=labels[:2],
            state_labels=labels,
            input_labels=["p"],
            title=self.name,
        )

    @property
    def heading(self) -> str:
        """Title: the name and, if steps are omitted, the number of drawn steps. Metrics use all steps."""
        drawn = len(self.time) - 1
        return self.name + (f"\n{drawn} of {self.metrics.steps} steps drawn" if drawn < self.metrics.steps else "")

    def panels(self) -> list[Panel]:
        """Slip, slip rate, pressures in the fault and at the well, errors, and other signals of an actuator."""
        further = dict(self.actuation)
        well, *_ = further.pop("well_pressure", (None,))
        panels: list[Panel] = [
            ("slip", "m", self.slip, ("reference", self.reference)),
            ("slip rate", "m/s", self.slip_rate, ("reference", self.reference_rate)),
            ("pressure", "Pa", self.pressure, ("at the well", well)),
        ]
        if self.slip_error is not None:
            errors: Any = ("slip error", "m", self.slip_error), ("slip-rate error", "m/s", self.slip_rate_error)
            panels += ((*error, NOTHING) for error in errors)
        return [*panels, *((title, unit, values, NOTHING) for values, title, unit in further.values())]

    def plot(self) -> "Figure":
        """Return a matplotlib Figure of slip, slip rate, pressure, errors, and signals of an actuator."""
        return figure(self.heading, self.time, self.panels())

    def plot_stress(self) -> "Figure":
        """Return a matplotlib Figure of the shear stress against slip, and of the moment rate over time."""
        return stress_figure(self.heading, self.time, self.slip, self.shear_stress, self.moment_rate)
