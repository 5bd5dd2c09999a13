"""What every run can be handed on as: xarray, pandas, NetCDF."""

import os
from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import TYPE_CHECKING, Any

from quakedesign.errors import OutputError

if TYPE_CHECKING:
    import numpy as np

CONVENTIONS = "CF-1.11"


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

    @abstractmethod
    def signals(self) -> "dict[str, tuple[np.ndarray, str, str]]":
        """Values, long name and SI unit of every signal that this run has, by name."""

    @abstractmethod
    def attributes(self) -> Mapping[str, Any]:
        """Texts and numbers about the run as a whole."""

    def to_xarray(self) -> Any:
        """Return an xarray Dataset over ``time``, with the attributes of the CF conventions."""
        import xarray as xr

        variables = {
            name: ("time", values, {"long_name": title, "units": unit or "1"})
            for name, (values, title, unit) in self.signals().items()
        }
        time = ("time", self.time, {"long_name": "time since the start of the run", "units": "s", "axis": "T"})
        version = self.attributes().get("version_quakedesign", "")
        head = {"Conventions": CONVENTIONS, "title": self.name, "source": f"quakedesign {version}".strip()}
        return xr.Dataset(variables, coords={"time": time}, attrs=head | dict(self.attributes()))

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
