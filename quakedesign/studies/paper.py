"""Studies for the figures and tables of the paper: metrics, extra runs, and trade-off.

The trade-off is between the certified slip-rate error and the tracking error.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from importlib.resources import files
from math import pi

import numpy as np

from quakedesign.arguments import checked_dataclass
from quakedesign.fault import Fault
from quakedesign.fault.equilibrium import by_equilibrium
from quakedesign.files import Json
from quakedesign.guarantees import TrackingProof, design_sampled_law
from quakedesign.plant import uncertain_plant
from quakedesign.simulation import Trajectory, natural_earthquake, simulate
from quakedesign.simulation.closed_loop import ClosedLoop
from quakedesign.studies.comparison import Compared, Entry
from quakedesign.text import Progress, silent

# ----------------------------------------------------------------------
# Numbers of the bar charts: every metric of every run, and the five of the paper relative to the e-LQR.

BARS = {
    "mise_slip": "MISE of the slip",
    "mise_slip_rate": "MISE of the slip rate",
    "max_slip_error": "max |slip error|",
    "max_slip_rate_error": "max |slip-rate error|",
    "rms_pressure": "RMS pressure",
}
"""Metrics of the paper's bar charts (figures 8 and 12), MISE being the mean of the squared error."""
BASIS = "elqr"
"""Law whose numbers the paper divides by."""
_MADE = ("scheme", "step", "method", "plant")


def baseline(comparison: Compared) -> Entry | None:
    """Reference entry of the ratios: the published e-LQR, else the designed one."""
    able = [
        e
        for origin in ("published", "designed")
        for e in comparison.of(origin)
        if e.design.name == BASIS and e.run is not None and e.run.metrics.max_slip_error is not None
    ]
    return able[0] if able else None


def relative(run: Trajectory | None, basis: Trajectory | None) -> dict[str, float | None]:
    """Metrics of the bars over those of another run [-]; None if a value is missing or the divisor is zero."""
    ratios: dict[str, float | None] = {}
    for name in BARS:
        own, other = (getattr(r.metrics, name) if r else None for r in (run, basis))
        ratios[name] = own / other if own is not None and other else None
    return ratios


def table(comparison: Compared, more: dict[str, Trajectory] | None = None) -> list[Json]:
    """One row for each run: its name, law and origin, metrics in SI units, the five ratios, and settings.

    Parameters
    ----------
    more : dict of str to Trajectory, optional
        Further runs without a controller, by name.
    """
    runs: list[tuple[str, str, str, Trajectory | None]] = [("uncontrolled", "none", "", comparison.uncontrolled)]
    runs += [(name, "none", "", run) for name, run in (more or {}).items()]
    runs += [(e.label, e.design.name, e.origin, e.run) for e in comparison.entries]
    basis = baseline(comparison)
    return [
        {"run": label, "law": law, "origin": origin}
        | (_outcome(run) | run.metrics.to_dict() if run else {})
        | {f"{name}_over_{BASIS}": ratio for name, ratio in relative(run, basis.run if basis else None).items()}
        | ({name: run.provenance[name] for name in _MADE} if run else {})
        for label, law, origin, run in runs
    ]


def _outcome(run: Trajectory) -> Json:
    outcome = run.outcome
    return {"outcome": outcome.kind, "share_of_natural": outcome.share_of_natural}


def printed(comparison: Compared) -> list[Json]:
    """Printed numbers of the paper and ours for these runs, their ratio, our plant, and the reason for differences."""
    data = tomllib.loads((files(__package__) / "printed.toml").read_text(encoding="utf-8"))
    runs: dict[str, Trajectory | None] = {"uncontrolled": comparison.uncontrolled}
    runs |= {f"{e.origin} {e.design.name}": e.run for e in comparison.entries}
    rows = []
    for row in data.get(comparison.fault.name, []):
        run = runs.get(row["run"])
        value = getattr(run.metrics, row["metric"]) if run else None
        ratio = value / row["printed"] if value is not None else None
        plant, more = run.provenance["plant"] if run else None, row.pop("note_without_stick", "")
        row["note"] += f" {more}" if more and plant == "printed" else ""
        unit = run.metrics.unit(row["metric"]) if run else None
        rows.append({**row, "plant": plant, "unit": unit, "found": value, "ratio": ratio})
    return rows


# ----------------------------------------------------------------------
# Trade-off between certified slip-rate error and tracking error of designs for the sampled loop.

ROOMS = (1.2, 1.4, 1.6, 2.2)
"""Slip-rate errors admitted for tracking, as multiples of the smallest certified one; the default design uses 1.6."""
_PERIODS = 32  # duration of a run in natural periods; errors are evaluated in its second half


@checked_dataclass(frozen=True, slots=True, kw_only=True)
class FrontPoint:
    """One design.

    Attributes
    ----------
    objective : str
        ``peak``, or ``tracking`` with the admitted multiple of the smallest certified slip-rate error.
    guarantee : TrackingProof
    run : Trajectory
        Run under the fault's own disturbance, from rest.
    """

    objective: str
    guarantee: TrackingProof
    run: Trajectory


def objective_front(fault: Fault, step: Fraction) -> tuple[FrontPoint, ...]:
    """Designs from the smallest certified slip-rate error to the best tracking, each with a guarantee.

    Parameters
    ----------
    fault : Fault
    step : Fraction
        T_s [s].
    """
    task = uncertain_plant(fault)
    designs = {"peak": design_sampled_law(task, step, objective="peak")}
    designs |= {
        f"tracking, {factor:g} times the least slip-rate error": design_sampled_law(task, step, allowance=factor)
        for factor in ROOMS
    }
    length = min(_PERIODS * 2 * pi / fault.natural_frequency, fault.reference.operation_time)
    return tuple(
        FrontPoint(
            objective=name,
            guarantee=claim,
            run=simulate(fault, claim.controller, duration=max(length, float(step)), settled_from=length / 2),
        )
        for name, claim in designs.items()
        if isinstance(claim, TrackingProof)
    )


# ----------------------------------------------------------------------
# Further runs for the figures of the paper: the induced earthquake, and a close-up of every law.

INDUCING_SHARE = 0.1
"""Ratio of the constant pressure of the induced earthquake to σ'_n: 5 MPa on the paper's fault at 50 MPa."""
PERIODS = 16
"""Length of a close-up in natural periods."""


@dataclass(frozen=True, kw_only=True)
class PaperRuns:
    """Runs of all figures."""

    comparison: Compared
    # Without control, under a constant pressure of a tenth of the effective normal stress; None for friction with a
    # state, which has none of the short runs
    induced: Trajectory | None = None
    # By label of the entry: its first `PERIODS` natural periods with every step stored
    close_ups: Mapping[str, Trajectory] = field(default_factory=dict)
    front: tuple[FrontPoint, ...] = ()  # Trade-off between peak and tracking, if a sampled e-LQR was designed


def paper_runs(comparison: Compared, *, progress: Progress | None = None) -> PaperRuns:
    """Make the short runs that the figures of the paper need in addition to a comparison.

    Parameters
    ----------
    progress : callable, optional
        Called with the current activity and the fraction done [-].
    """
    return _runs(comparison.fault, comparison, progress or (silent))


def _short_runs(fault: Fault, comparison: Compared, progress: Progress) -> PaperRuns:
    progress("induced earthquake", 0.0)
    plant = comparison.uncontrolled.provenance["plant"]
    induced = natural_earthquake(fault, INDUCING_SHARE * fault.effective_normal_stress, plant=plant)
    length = min(PERIODS * 2 * pi / fault.natural_frequency, fault.reference.operation_time)
    close_ups = {}
    for entry in comparison.entries:
        if entry.run is not None:
            progress(f"{entry.label}: close-up", 0.0)
            step = entry.run.provenance["step"]
            close_ups[entry.label] = simulate(
                fault,
                entry.design.controller,
                scheme=entry.run.provenance["scheme"],
                duration=max(length, step),
                step=step,
                samples=int(length / step) + 1,
                plant=plant,
            )
    laws = [entry.design.controller for entry in comparison.of("designed")]
    progress("peak against tracking", 0.0)
    steps = [law.sampling.step for law in laws if law and law.sampling and law.lipschitz_limit is None]
    front = objective_front(fault, steps[0]) if steps else ()
    return PaperRuns(comparison=comparison, induced=induced, close_ups=close_ups, front=front)


_runs = by_equilibrium(rest=_short_runs, sliding=lambda fault, comparison, progress: PaperRuns(comparison=comparison))


def friction_curve(fault: Fault, largest: float, points: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Slips [m] up to the largest, the friction coefficient at rest there, and the unloading line of the spring.

    Both curves [-] have shape (points,); the fault is unstable where friction falls faster than the spring unloads.
    """
    slips, coefficient = np.linspace(0, largest, points), ClosedLoop(fault).friction
    values = np.array([float(coefficient([slip, 0])) for slip in slips])
    unloading = fault.specific_stiffness / (fault.authority * fault.effective_normal_stress)
    return slips, values, values[0] - unloading * slips
