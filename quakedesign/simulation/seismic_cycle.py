"""Uncontrolled run of a fault with a friction state: slip events (nucleation, onset, arrest), cycle and outcome."""

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise, zip_longest

import numpy as np

from quakedesign.arguments import checked_dataclass
from quakedesign.fault.model import magnitude
from quakedesign.simulation.closed_loop import EnergyBudget
from quakedesign.simulation.trajectory import EARTHQUAKE_SHARE, Outcome, Trajectory, signal


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipEvent:
    """One slip event of a fault, as far as the run covers it."""

    # Time [s] of the last rise of the slip rate through the loading rate before the onset; None if there is no rise
    nucleation: float | None
    onset: float  # Time [s] at which the slip rate rises through the `onset_rate` of the run
    # Time [s] at which the slip rate falls below `onset_rate` again; None, as are slip, moment and magnitude, if the
    # run ends earlier
    arrest: float | None
    peak_slip_rate: float  # [m/s]
    slip: float | None  # From onset to arrest [m]
    moment: float | None  # G·A times the slip [N·m]
    magnitude: float | None  # M_w of that moment [-]


@checked_dataclass(frozen=True, eq=False, kw_only=True)
class StateTrajectory(Trajectory):
    """One uncontrolled run of a spring-slider; see `Trajectory`.

    At a step of the pressure the time occurs twice, with the values before and after the step.

    Attributes
    ----------
    load_point, stretch : ndarray
        Displacement of the load point, and stretch of the spring [m], shape (n,).
    states : ndarray
        State variables of friction, shape (number of variables, n), with `state_names` and `state_units`.
    state_names, state_units : tuple of str
    imbalance : ndarray
        Driving minus resisting stress, divided by σ' at p = 0 [-], shape (n,). It accelerates the mass; without mass it
        is zero except for the integration error.
    onsets : ndarray
        Times [s] at which the slip rate rises through `onset_rate`.
    onset_rate, loading_rate : float
        Slip rate above which an event begins, and largest v_∞ [m/s].
    dynamic_rate, moment_per_slip : float
        aσ'A/(η + √(km)) [m/s] and G·A [N]; infinite and nan for a `SpringSlider`.
    energy : EnergyBudget
        [J], of the fault, or of 1 m² of a `SpringSlider`. Each work is a force integrated along the path through the
        instants of `time`; without mass the residual is the work of `imbalance`.
    """

    load_point: "np.ndarray" = signal("displacement of the load point", "m")
    slip: "np.ndarray" = signal("slip", "m")
    slip_rate: "np.ndarray" = signal("slip rate", "m/s")
    stretch: "np.ndarray" = signal("stretch of the spring", "m")
    pressure: "np.ndarray" = signal("fluid pressure", "Pa")
    states: "np.ndarray" = field(repr=False)
    state_names: tuple[str, ...]
    state_units: tuple[str, ...]
    imbalance: "np.ndarray" = field(repr=False)
    onsets: "np.ndarray" = field(repr=False)
    onset_rate: float
    loading_rate: float
    dynamic_rate: float = field(repr=False)
    moment_per_slip: float = field(repr=False)
    energy: EnergyBudget = field(repr=False)

    @property
    def outcome(self) -> Outcome:
        """``earthquake`` if a tenth of `dynamic_rate` is reached, else ``slow slip`` with an event, else ``creep``."""
        peak = self.metrics.peak_slip_rate
        if peak is None:
            return Outcome(kind="unknown", peak_slip_rate=None, share_of_natural=None)
        fast = peak >= EARTHQUAKE_SHARE * self.dynamic_rate
        kind = "earthquake" if fast else "slow slip" if peak >= self.onset_rate else "creep"
        return Outcome(kind=kind, peak_slip_rate=peak, share_of_natural=None)

    @property
    def natural_peak(self) -> float | None:
        """Largest slip rate of the events of this run [m/s]; None without events."""
        return self.metrics.peak_slip_rate if self.slip_events else None

    @property
    def cycle(self) -> dict[str, float | None]:
        """Last recurrence interval [s]; slip [m] and magnitude of the last complete event; None if undefined."""
        intervals = [later.onset - event.onset for event, later in pairwise(self.slip_events)]
        whole = [event for event in self.slip_events if event.arrest is not None]
        return {
            "recurrence_interval": intervals[-1] if intervals else None,
            "slip": whole[-1].slip if whole else None,
            "magnitude": whole[-1].magnitude if whole else None,
        }

    @cached_property
    def slip_events(self) -> tuple[SlipEvent, ...]:
        """All events of the run; valid only if every step was returned (no `times` given)."""
        ends = (self.onsets.tolist(), self.arrests.tolist(), self.event_slips.tolist())
        return tuple(self._event(*one) for one in zip_longest(*ends))

    def _event(self, onset: float, arrest: float | None, slip: float | None) -> SlipEvent:
        during = (self.time >= onset) & (self.time <= (np.inf if arrest is None else arrest))
        moment = None if slip is None else self.moment_per_slip * slip
        return SlipEvent(
            nucleation=self._last_rise(onset),
            onset=onset,
            arrest=arrest,
            peak_slip_rate=float(np.max(self.slip_rate[during], initial=self.onset_rate)),
            slip=slip,
            moment=moment,
            magnitude=None if moment is None else magnitude(moment),
        )

    def _last_rise(self, before: float) -> float | None:
        """Last time [s] before a given one at which log(slip rate), linear between instants, rises through log v_∞."""
        if self.loading_rate <= 0:
            return None
        ahead = np.log(self.slip_rate[self.time <= before]) - np.log(self.loading_rate)
        rises = np.flatnonzero((ahead[:-1] < 0) & (ahead[1:] >= 0))
        if not len(rises):
            return None
        i = rises[-1]
        return float(self.time[i] + (self.time[i + 1] - self.time[i]) * ahead[i] / (ahead[i] - ahead[i + 1]))

    @property
    def recurrence_intervals(self) -> "np.ndarray":
        """Times between successive onsets [s]."""
        return np.diff(self.onsets)

    @property
    def event_slips(self) -> "np.ndarray":
        """Slip [m] of every finished event, from its onset until the slip rate falls to `onset_rate` again.

        Linear interpolation between the instants of `time`. `Fault.moment_of` gives the seismic moment.
        """
        at = self._at_arrest(self.slip)
        return np.asarray(at - np.interp(self.onsets[: len(at)], self.time, self.slip))

    @property
    def arrests(self) -> "np.ndarray":
        """Times [s] at which the slip rate falls to `onset_rate` again, one for every finished event."""
        return self._at_arrest(self.time)

    def _at_arrest(self, values: "np.ndarray") -> "np.ndarray":
        """Values at which the slip rate falls through `onset_rate` after each onset, by linear interpolation."""
        below = self.slip_rate <= self.onset_rate
        falls = np.flatnonzero(~below[:-1] & below[1:]).tolist()
        ends = [next((i for i in falls if self.time[i + 1] > onset), None) for onset in self.onsets]
        at = np.array([i for i in ends if i is not None], dtype=int)
        fast, slow = self.slip_rate[at], self.slip_rate[at + 1]
        return np.asarray(values[at] + (values[at + 1] - values[at]) * (fast - self.onset_rate) / (fast - slow))

    def signals(self) -> dict[str, tuple["np.ndarray", str, str]]:
        """Values, long name and SI unit of every signal, by name."""
        signals = super().signals()
        for name, values, unit in zip(self.state_names, self.states, self.state_units, strict=True):
            signals[name] = (values, f"state of friction {name}", unit)
        return signals
