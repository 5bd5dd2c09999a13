"""What every run can be handed on as: xarray, pandas, NetCDF."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import field, fields
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from quakedesign.errors import ParameterError
from quakedesign.output import write_whole

CONVENTIONS = "CF-1.11"


def signal(title: str, unit: str) -> Any:
    """Field that is a signal, with its long name and SI unit; one that is None is none."""
    return field(repr=False, metadata={"title": title, "unit": unit})


class Recording(ABC):
    """Signals over time, each with its long name and SI unit.

    Attributes
    ----------
    name : str
    time : ndarray
        [s], shape (n,).
    """

    name: str
    time: "np.ndarray"

    def signals(self) -> "dict[str, tuple[np.ndarray, str, str]]":
        """Values, long name and SI unit of every signal that this run has, by name."""
        known = ((each.name, getattr(self, each.name), each.metadata) for each in fields(self))  # type: ignore[arg-type]
        return {name: (v, told["title"], told["unit"]) for name, v, told in known if told and v is not None}

    @abstractmethod
    def attributes(self) -> Mapping[str, Any]:
        """Texts and numbers about the run as a whole."""

    def to_xarray(self) -> Any:
        """Return an xarray Dataset over ``time``, with the attributes of the CF conventions.

        The time [s] is that since the start of the run. It is not marked as CF's axis T, which is for dates: its unit
        would have to name a day that a simulation does not have. Nothing is missing, so there are no fill values.
        """
        import xarray as xr

        variables = {
            name: ("time", values, {"long_name": title, "units": unit or "1"})
            for name, (values, title, unit) in self.signals().items()
        }
        time = ("time", self.time, {"long_name": "time since the start of the run", "units": "s"})
        source = f"quakedesign {self.attributes().get('version_quakedesign', '')}".strip()
        head = {"Conventions": CONVENTIONS, "title": self.name, "source": source, "history": f"simulated by {source}"}
        found = xr.Dataset(variables, coords={"time": time}, attrs=head | dict(self.attributes()))
        for variable in found.variables.values():
            variable.encoding["_FillValue"] = None
        return found

    def resample(self, dt: float) -> Any:
        """Return an xarray Dataset at uniform instants, as filters and spectra need them, interpolated linearly.

        Parameters
        ----------
        dt : float
            [s]. No shorter than the mean distance of the instants that are kept, between which nothing is known.

        Raises
        ------
        ParameterError
            For a shorter one, or one longer than the run.
        """
        duration, kept = float(self.time[-1] - self.time[0]), max(len(self.time) - 1, 1)
        if not duration / kept * (1 - 1e-9) <= dt <= duration:
            raise ParameterError(
                f"dt must be between {duration / kept:.4g} s, the mean distance of the instants that are kept, and "
                f"{duration:.4g} s, the run. Received {dt!r}. Ask simulate for more samples."
            )
        count = int(duration / dt * (1 + 1e-12)) + 1
        return self.to_xarray().interp(time=self.time[0] + dt * np.arange(count))

    def to_pandas(self) -> Any:
        """Return a pandas DataFrame over the time [s]; the columns carry their units."""
        import pandas as pd

        columns = {f"{name} [{unit or '-'}]": values for name, (values, _, unit) in self.signals().items()}
        return pd.DataFrame(columns, index=pd.Index(self.time, name="time [s]"))

    def save(self, path: str | Path) -> Path:
        """Write the run as NetCDF, wholly or not at all.

        Raises
        ------
        OutputError
            When the file cannot be written.
        """
        target, content = Path(path), BytesIO()
        self.to_xarray().to_netcdf(content, engine="h5netcdf")
        write_whole(target, content.getvalue())
        return target
