"""What a simulation returns."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from quakedesign.simulation.energy import EnergyBudget
from quakedesign.simulation.metrics import Metrics
from quakedesign.simulation.outcome import Outcome, OutcomeCriterion
from quakedesign.simulation.plotting import NOTHING, Panel, figure, stress_figure
from quakedesign.simulation.recording import Recording, signal


@dataclass(frozen=True, eq=False, kw_only=True)
class Trajectory(Recording):
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
    shear_stress : ndarray
        What friction sets against the load, μ(σ' − p) where the fault slips forward [Pa], shape (n,).
    moment_per_slip : float
        G·A [N], the seismic moment of one metre of slip.
    integrals : ndarray
        The law's own states ξ, shape (number of them, n), in `integral_units`.
    integral_units : tuple of str
    metrics : Metrics
    energy : EnergyBudget or None
        From all of its steps; None for a run that diverged.
    events : mapping of str to float
        Time of first occurrence [s] of ``diverged``, ``opening`` (p ≥ σ'_n), ``reverse_slip`` (x2 < 0), ``stick``
        (friction holds the fault at rest after the start; not watched on the smooth plant).
    criterion : OutcomeCriterion
        What `outcome` is decided by.
    provenance : mapping
        Method, step, scheme, backend and versions; the fault as a TOML file (``scenario``).
    """

    name: str
    time: "np.ndarray" = field(repr=False)
    slip: "np.ndarray" = signal("slip x1", "m")
    slip_rate: "np.ndarray" = signal("slip rate x2", "m/s")
    pressure: "np.ndarray" = signal("fluid pressure p", "Pa")
    reference: "np.ndarray | None" = signal("reference slip r", "m")
    reference_rate: "np.ndarray | None" = signal("reference slip rate r'", "m/s")
    matched_perturbation: "np.ndarray | None" = signal("matched perturbation h", "m/s^2")
    friction: "np.ndarray" = signal("friction coefficient", "")
    shear_stress: "np.ndarray" = signal("shear stress that resists slip", "Pa")
    moment_per_slip: float = field(repr=False)
    integrals: "np.ndarray" = field(repr=False)
    integral_units: tuple[str, ...]
    metrics: Metrics
    energy: EnergyBudget | None = field(repr=False)
    events: Mapping[str, float]
    criterion: OutcomeCriterion = field(repr=False)
    provenance: Mapping[str, Any] = field(repr=False)

    @property
    def outcome(self) -> Outcome:
        """What the run comes to: tracked, slow slip, earthquake, diverged or opened."""
        figures, followed = self.metrics, self.reference is not None
        return self.criterion.outcome(figures.peak_slip_rate, figures.max_slip_error, self.events, followed=followed)

    @property
    def slip_error(self) -> "np.ndarray | None":
        """x1 − r [m]."""
        return None if self.reference is None else self.slip - self.reference

    @property
    def slip_rate_error(self) -> "np.ndarray | None":
        """x2 − r' [m/s]."""
        return None if self.reference_rate is None else self.slip_rate - self.reference_rate

    @property
    def moment_rate(self) -> "np.ndarray":
        """Seismic moment rate G·A·x2 [N m/s], shape (n,)."""
        return self.moment_per_slip * self.slip_rate

    def signals(self) -> dict[str, tuple["np.ndarray", str, str]]:
        """Values, long name and SI unit of every signal that this run has, by name."""
        found = super().signals() | {"moment_rate": (self.moment_rate, "seismic moment rate", "N m/s")}
        for number, (values, unit) in enumerate(zip(self.integrals, self.integral_units, strict=True), 1):
            found[f"xi_{number}"] = (values, f"integral state xi{number}", unit)
        return found

    def attributes(self) -> dict[str, Any]:
        """Provenance, and outcome, metrics, events and energy as JSON text."""
        told = {
            "outcome": self.outcome.to_dict(),
            "metrics": self.metrics.to_dict(),
            "events": dict(self.events),
            "energy": self.energy and self.energy.to_dict(),
        }
        return dict(self.provenance) | {name: json.dumps(value, allow_nan=False) for name, value in told.items()}

    @property
    def response(self) -> Any:
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
        """Name, and how much of the run is drawn: what happened in between is in its metrics alone."""
        kept = len(self.time) - 1
        return self.name + (f"\n{kept} of {self.metrics.steps} steps drawn" if kept < self.metrics.steps else "")

    def panels(self) -> list[Panel]:
        """Slip, slip rate and pressure, and errors where something is followed."""
        found: list[Panel] = [
            ("slip", "m", self.slip, ("reference", self.reference)),
            ("slip rate", "m/s", self.slip_rate, ("reference", self.reference_rate)),
            ("pressure", "Pa", self.pressure, ("at the well", None)),
        ]
        if self.slip_error is None:
            return found
        errors = (("slip error", "m", self.slip_error), ("slip-rate error", "m/s", self.slip_rate_error))
        return [*found, *((*error, NOTHING) for error in errors)]

    def plot(self) -> Any:
        """Return a matplotlib Figure of slip, slip rate, pressure, errors, and what an actuator adds."""
        return figure(self.heading, self.time, self.panels())

    def plot_stress(self) -> Any:
        """Return a matplotlib Figure of the shear stress against slip, and of the moment rate over time."""
        return stress_figure(self.heading, self.time, self.slip, self.shear_stress, self.moment_rate)
