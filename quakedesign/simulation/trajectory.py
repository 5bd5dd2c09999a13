"""What a simulation returns."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import TYPE_CHECKING, Any

from quakedesign.errors import OutputError
from quakedesign.simulation.metrics import Metrics

if TYPE_CHECKING:
    import numpy as np

SIGNALS = {
    "slip": ("slip x1", "m"),
    "slip_rate": ("slip rate x2", "m/s"),
    "pressure": ("fluid pressure p", "Pa"),
    "reference": ("reference slip r", "m"),
    "reference_rate": ("reference slip rate r'", "m/s"),
    "matched_perturbation": ("matched perturbation h", "m^3 Pa/(kg s^2)"),
    "friction": ("friction coefficient", ""),
}


@dataclass(frozen=True, eq=False, kw_only=True)
class Trajectory:
    """One run, at some of its instants, with metrics from all of them.

    Attributes
    ----------
    name : str
    time : ndarray
        [s], shape (n,).
    slip, slip_rate, pressure : ndarray
        x1 [m], x2 [m/s], p [Pa], shape (n,).
    reference, reference_rate, matched_perturbation : ndarray or None
        r [m], r' [m/s], h [unit of ν], shape (n,); None without a controller.
    friction : ndarray
        Friction coefficient [-], shape (n,).
    integrals : ndarray
        The law's own states ξ, shape (number of them, n), in `integral_units`.
    integral_units : tuple of str
    metrics : Metrics
    events : mapping of str to float
        Time of first occurrence [s] of ``diverged``, ``opening`` (p ≥ σ'_n), ``reverse_slip`` (x2 < 0), ``stick``
        (friction holds the fault at rest after the start; not watched on the smooth plant).
    provenance : mapping
        Method, step, scheme, backend and versions.
    """

    name: str
    time: "np.ndarray" = field(repr=False)
    slip: "np.ndarray" = field(repr=False)
    slip_rate: "np.ndarray" = field(repr=False)
    pressure: "np.ndarray" = field(repr=False)
    reference: "np.ndarray | None" = field(repr=False)
    reference_rate: "np.ndarray | None" = field(repr=False)
    matched_perturbation: "np.ndarray | None" = field(repr=False)
    friction: "np.ndarray" = field(repr=False)
    integrals: "np.ndarray" = field(repr=False)
    integral_units: tuple[str, ...]
    metrics: Metrics
    events: Mapping[str, float]
    provenance: Mapping[str, Any] = field(repr=False)

    @property
    def slip_error(self) -> "np.ndarray | None":
        """x1 − r [m]."""
        return None if self.reference is None else self.slip - self.reference

    @property
    def slip_rate_error(self) -> "np.ndarray | None":
        """x2 − r' [m/s]."""
        return None if self.reference_rate is None else self.slip_rate - self.reference_rate

    def signals(self) -> dict[str, tuple["np.ndarray", str, str]]:
        """Values, long name and SI unit of every signal that this run has, by name."""
        found = {
            name: (getattr(self, name), *described)
            for name, described in SIGNALS.items()
            if getattr(self, name) is not None
        }
        for number, (values, unit) in enumerate(zip(self.integrals, self.integral_units, strict=True), 1):
            found[f"xi_{number}"] = (values, f"integral state xi{number}", unit)
        return found

    def to_xarray(self) -> Any:
        """Return an xarray Dataset over ``time``, with units and long names; metrics and events as JSON text."""
        import xarray as xr

        variables = {
            name: ("time", values, {"long_name": title, "units": unit or "1"})
            for name, (values, title, unit) in self.signals().items()
        }
        time = ("time", self.time, {"long_name": "time", "units": "s"})
        attributes = {"title": self.name, **self.provenance}
        attributes |= {"metrics": json.dumps(self.metrics.to_dict()), "events": json.dumps(dict(self.events))}
        return xr.Dataset(variables, coords={"time": time}, attrs=attributes)

    def to_pandas(self) -> Any:
        """Return a pandas DataFrame over the time [s]; the columns carry their units."""
        import pandas as pd

        columns = {f"{name} [{unit or '-'}]": values for name, (values, _, unit) in self.signals().items()}
        return pd.DataFrame(columns, index=pd.Index(self.time, name="time [s]"))

    @property
    def response(self) -> Any:
        """The run as python-control's TimeResponseData: outputs slip [m] and slip_rate [m/s], input p [Pa]."""
        import control
        import numpy as np

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

    def plot(self) -> Any:
        """Return a matplotlib Figure of slip, slip rate, pressure and errors."""
        from quakedesign.simulation.plotting import figure

        return figure(self)

    def save(self, path: str | Path) -> Path:
        """Write the run as NetCDF, wholly or not at all.

        Raises
        ------
        OutputError
            When the file cannot be written.
        """
        target = Path(path)
        temporary = None
        try:
            with NamedTemporaryFile(dir=target.parent, prefix=f".{target.name}-", delete=False) as handle:
                temporary = Path(handle.name)
            self.to_xarray().to_netcdf(temporary, engine="h5netcdf")
            os.replace(temporary, target)
        except OSError as error:
            raise OutputError(f"run cannot be written to {target}: {error.strerror or error}.") from None
        finally:
            if temporary:
                temporary.unlink(missing_ok=True)
        return target
