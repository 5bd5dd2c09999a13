"""The numbers behind the bars: every metric of every run, and the five of the paper over those of the e-LQR."""

import tomllib
from importlib.resources import files
from typing import Any

from quakedesign.simulation import Trajectory
from quakedesign.studies.comparison import Compared, Entry, Run

BARS = {
    "mise_slip": "MISE of the slip",
    "mise_slip_rate": "MISE of the slip rate",
    "max_slip_error": "max |slip error|",
    "max_slip_rate_error": "max |slip-rate error|",
    "rms_pressure": "RMS pressure",
}
"""Metrics of the paper's bar charts (fig:simindex, fig:labindex), MISE being the mean of the squared error."""
BASIS = "elqr"
"""Law whose numbers the paper divides by."""
_MADE = ("scheme", "step", "method", "plant")


def baseline(comparison: Compared) -> Entry | None:
    """Entry that numbers are divided by: the published e-LQR, the designed one where there is no other."""
    able = [
        e
        for origin in ("published", "designed")
        for e in comparison.of(origin)
        if e.design.name == BASIS and e.run is not None and e.run.metrics.max_slip_error is not None
    ]
    return able[0] if able else None


def relative(run: Run | None, basis: Run | None) -> dict[str, float | None]:
    """Metrics of the bars over those of another run [-]; None where one of the two has none or the other is zero."""
    ratios: dict[str, float | None] = {}
    for name in BARS:
        own, other = (getattr(r.metrics, name) if r else None for r in (run, basis))
        ratios[name] = own / other if own is not None and other else None
    return ratios


def table(comparison: Compared, more: dict[str, Trajectory] | None = None) -> list[dict[str, Any]]:
    """One row a run: what it is, its metrics in SI units, the five ratios, and how it was made.

    Parameters
    ----------
    comparison : Compared
    more : dict of str to Trajectory, optional
        Further runs without a controller, by name.
    """
    runs: list[tuple[str, str, str, Run | None]] = [("uncontrolled", "none", "", comparison.uncontrolled)]
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


def _outcome(run: Run) -> dict[str, Any]:
    outcome = run.outcome
    return {"outcome": outcome.kind, "share_of_natural": outcome.share_of_natural}


def printed(comparison: Compared) -> list[dict[str, Any]]:
    """Numbers that the paper prints about these runs beside ours, their ratio, and why they differ."""
    data = tomllib.loads((files(__package__) / "printed.toml").read_text(encoding="utf-8"))
    runs: dict[str, Run | None] = {"uncontrolled": comparison.uncontrolled}
    runs |= {f"{e.origin} {e.design.name}": e.run for e in comparison.entries}
    rows = []
    for said in data.get(comparison.fault.name, []):
        run = runs.get(said["run"])
        value = getattr(run.metrics, said["metric"]) if run else None
        ratio = value / said["printed"] if value is not None else None
        rows.append({**said, "unit": run.metrics.unit(said["metric"]) if run else None, "found": value, "ratio": ratio})
    return rows
