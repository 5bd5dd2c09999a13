"""What a simulation of a spring-slider with state returns."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from quakedesign.simulation.energy import EnergyBudget
from quakedesign.simulation.recording import Recording, signal


@dataclass(frozen=True, eq=False, kw_only=True)
class StateTrajectory(Recording):
    """One run of a spring-slider without control.

    Attributes
    ----------
    name : str
    time : ndarray
        [s], shape (n,); the same one twice where the pressure steps, before and after.
    load_point, slip, stretch : ndarray
        Displacement of the load point, slip, and stretch of the spring [m], shape (n,).
    slip_rate : ndarray
        [m/s], shape (n,).
    friction : ndarray
        Friction coefficient [-], shape (n,).
    pressure : ndarray
        Fluid pressure [Pa], shape (n,).
    states : ndarray
        State of friction, shape (number of variables, n), named `state_names`, in `state_units`.
    state_names, state_units : tuple of str
    imbalance : ndarray
        Driving less resisting stress, as a share of the normal stress [-], shape (n,): what accelerates the mass.
        Without mass it must vanish, and what is left of it is an error of the integration.
    onsets : ndarray
        Times [s] at which the slip rate rises through `onset_rate`.
    onset_rate : float
        [m/s].
    energy : EnergyBudget
        [J], of the fault, or of 1 m² of a `SpringSlider`. Works are forces along the path through the instants of
        `time`; without mass the residual is the work of `imbalance`.
    provenance : mapping
        Method, tolerance, evaluations and versions.
    """

    name: str
    time: "np.ndarray" = field(repr=False)
    load_point: "np.ndarray" = signal("displacement of the load point", "m")
    slip: "np.ndarray" = signal("slip", "m")
    slip_rate: "np.ndarray" = signal("slip rate", "m/s")
    stretch: "np.ndarray" = signal("stretch of the spring", "m")
    friction: "np.ndarray" = signal("friction coefficient", "")
    pressure: "np.ndarray" = signal("fluid pressure", "Pa")
    states: "np.ndarray" = field(repr=False)
    state_names: tuple[str, ...]
    state_units: tuple[str, ...]
    imbalance: "np.ndarray" = field(repr=False)
    onsets: "np.ndarray" = field(repr=False)
    onset_rate: float
    energy: EnergyBudget = field(repr=False)
    provenance: Mapping[str, Any] = field(repr=False)

    @property
    def recurrence_intervals(self) -> "np.ndarray":
        """Times between successive onsets [s]."""
        return np.diff(self.onsets)

    @property
    def event_slips(self) -> "np.ndarray":
        """Slip [m] of every event that has ended: from its onset until the slip rate is back at `onset_rate`.

        Between the instants of `time` by straight lines. `Fault.moment_of` makes it a seismic moment.
        """
        at = self._at_arrest(self.slip)
        return np.asarray(at - np.interp(self.onsets[: len(at)], self.time, self.slip))

    @property
    def arrests(self) -> "np.ndarray":
        """Times [s] at which the slip rate is back at `onset_rate`, of every event that has ended."""
        return self._at_arrest(self.time)

    def _at_arrest(self, values: "np.ndarray") -> "np.ndarray":
        """Values where the slip rate falls through `onset_rate` after every onset, by straight lines."""
        below = self.slip_rate <= self.onset_rate
        falls = np.flatnonzero(~below[:-1] & below[1:]).tolist()
        ends = [next((i for i in falls if self.time[i + 1] > onset), None) for onset in self.onsets]
        at = np.array([i for i in ends if i is not None], dtype=int)
        fast, slow = self.slip_rate[at], self.slip_rate[at + 1]
        return np.asarray(values[at] + (values[at + 1] - values[at]) * (fast - self.onset_rate) / (fast - slow))

    def signals(self) -> dict[str, tuple["np.ndarray", str, str]]:
        """Values, long name and SI unit of every signal, by name."""
        found = super().signals()
        for name, values, unit in zip(self.state_names, self.states, self.state_units, strict=True):
            found[name] = (values, f"state of friction {name}", unit)
        return found

    def attributes(self) -> Mapping[str, Any]:
        """Provenance."""
        return self.provenance
