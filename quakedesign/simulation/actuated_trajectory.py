"""What a simulation with an actuator returns."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from quakedesign.simulation.plotting import NOTHING, Panel
from quakedesign.simulation.trajectory import Trajectory

Signal = tuple["np.ndarray", str, str]


@dataclass(frozen=True, eq=False, kw_only=True)
class SampledTrajectory(Trajectory):
    """A run whose pressure reaches the fault through an actuator; `pressure` is that in the fault.

    Attributes
    ----------
    actuation : mapping of str to tuple
        Values, shape (n,), long name and SI unit of ``well_pressure`` [Pa], and where the actuator stores fluid of
        ``injected_volume`` [m³] and ``flow_rate`` [m³/s].
    """

    actuation: Mapping[str, Signal] = field(repr=False)

    def signals(self) -> dict[str, Signal]:
        """Values, long name and SI unit of every signal that this run has, by name."""
        return super().signals() | dict(self.actuation)

    def panels(self) -> list[Panel]:
        """The pressure at the well in the panel of that in the fault, and what the actuator tells beside."""
        found, further = super().panels(), dict(self.actuation)
        if "well_pressure" in further:
            found[2] = (*found[2][:3], ("at the well", further.pop("well_pressure")[0]))
        return [*found, *((title, unit, values, NOTHING) for values, title, unit in further.values())]
