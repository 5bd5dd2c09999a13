"""Effect of sampling on a law: all schemes, published controllers, orders, noise, input gain."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from quakedesign.errors import ParameterError
from quakedesign.exact import rational
from quakedesign.fault import Fault
from quakedesign.files import Json
from quakedesign.laws import Controller, published
from quakedesign.lyapunov.exact.premises import Premise
from quakedesign.simulation import Study, Trajectory, accuracy, gain_sensitivity, noise_sensitivity, simulate
from quakedesign.simulation.run_settings import PRINTED
from quakedesign.simulation.sensitivity import SCHEMES
from quakedesign.studies.certified import certified_bound, trajectory_premise
from quakedesign.synthesis import Design
from quakedesign.text import Progress, silent

PUBLISHED_SCHEMES = ("continuous", "explicit", "compensated")
DECADES = 3
PERIODS = 650  # duration of the runs that measure the orders, as a multiple of the longest T_s
SHARE = 1 / 16  # duration of a run for the sensitivity to noise, as a share of the task
UNCERTAIN = "ten-percent"


@dataclass(frozen=True, kw_only=True)
class SchemeRow:
    """One law under one scheme."""

    label: str  # Law, with its λ or the note that it is published
    origin: str  # Origin of the gains: ``"designed"``, ``"given"``, ``"published"``
    controller: Controller
    scheme: str
    run: Trajectory
    # |h'| on the trajectory, for a sliding mode that did not diverge; gains without a certificate have no certified
    # bound
    premise: Premise | None

    def to_dict(self) -> Json:
        """JSON-able facts, SI."""
        law, energy = self.controller, self.run.energy
        return {
            "label": self.label,
            "origin": self.origin,
            "law": law.name,
            "gains": {name: str(v) for name, v in law.gains.items()},
            "scale": str(law.scale) if law.scale is not None else None,
            "scheme": self.scheme,
            "outcome": self.run.outcome.to_dict(),
            "metrics": self.run.metrics.to_dict(),
            "events": dict(self.run.events),
            "on_trajectory": self.premise.to_dict() if self.premise else None,
            "energy_residual": energy.relative_residual if energy else None,
            "run": dict(self.run.provenance),
        }


@dataclass(frozen=True, kw_only=True)
class SamplingReport:
    """Report of the effect of sampling on a law."""

    fault: Fault
    # The law under every scheme, then the published ones: as in the paper, with zero-order hold, and compensated
    rows: tuple[SchemeRow, ...]
    # ``orders`` (of a sliding mode without feed-forward), ``slip_noise``, ``rate_noise``, ``input_gain``
    studies: dict[str, Study]

    def to_dict(self) -> Json:
        """JSON-able facts, SI; exact quantities are strings, null means diverged or not applicable."""
        entries = {name: study.to_dict() for name, study in self.studies.items()}
        if "orders" in entries:
            entries["orders"]["exponents"] = self.studies["orders"].orders()
        none = dict.fromkeys(("orders", "slip_noise", "rate_noise", "input_gain"))
        return {"fault": self.fault.name, "schemes": [row.to_dict() for row in self.rows], **none, **entries}

    def figures(self) -> dict[str, Any]:
        """Matplotlib figures of the studies, by name."""
        return {name: study.figure() for name, study in self.studies.items()}


def sampling_report(
    fault: Fault,
    law: Controller | Design,
    *,
    scales: Sequence[str] = (),
    schemes: Sequence[str] = SCHEMES,
    duration: float | None = None,
    progress: Progress | None = None,
) -> SamplingReport:
    """Run a law under every scheme, and published laws, on the plant without stick; measure orders and sensitivities.

    Parameters
    ----------
    law : Controller or Design
        A design also supplies the certified bound on |h'|.
    scales : sequence of str
        Further exact λ for runs of the base gains of a sliding mode; its certificate holds for every λ.
    schemes : sequence of str
        Sampled schemes.
    duration : float, optional
        Duration of runs [s]; the operation time by default. Noise sensitivities take a sixteenth of it, orders 650 T_s.
    progress : callable, optional
        Called with the current activity and the fraction done [-].

    Raises
    ------
    ParameterError
        For a scale if the law has none.
    """
    progress = progress or (silent)
    design = law if isinstance(law, Design) else None
    controller = law.controller if isinstance(law, Design) else law
    if controller is None:
        raise ParameterError(f"law must have gains. Received a design for {fault.name} that found none. Give gains.")
    bound = certified_bound(design)
    entries: list[tuple[str, Controller, tuple[str, ...]]]
    entries = [
        ("designed" if design else "given", variant, tuple(schemes)) for variant in _variants(controller, scales)
    ]
    entries += [("published", printed, PUBLISHED_SCHEMES) for printed in published(fault.name).values()]
    rows = [
        _row(fault, origin, variant, scheme, bound if origin != "published" else None, duration, progress)
        for origin, variant, chosen in entries
        for scheme in chosen
    ]
    return SamplingReport(
        fault=fault, rows=tuple(rows), studies=_studies(fault, controller, schemes, duration, progress)
    )


def _variants(controller: Controller, scales: Sequence[str]) -> list[Controller]:
    """The law, and the same base gains with other λ."""
    return [controller, *(controller.scaled(rational(scale, "scale")) for scale in scales)]


def _row(
    fault: Fault,
    origin: str,
    law: Controller,
    scheme: str,
    bound: Fraction | None,
    duration: float | None,
    progress: Progress,
) -> SchemeRow:
    label = f"{law.title}{f', λ {float(law.scale):.3g}' if law.scale is not None else ''}"
    label = f"{law.title}, published" if origin == "published" else label
    text = f"{label}, {scheme}"
    options: dict[str, Any] = {"scheme": scheme, "duration": duration, "samples": 1000, "plant": PRINTED}
    run = simulate(fault, law, progress=lambda done: progress(text, done), **options)
    premise = trajectory_premise(law, None if bound is None else float(bound * (law.scale or 1)), run)
    return SchemeRow(label=label, origin=origin, controller=law, scheme=scheme, run=run, premise=premise)


def _studies(
    fault: Fault, law: Controller, schemes: Sequence[str], duration: float | None, progress: Progress
) -> dict[str, Study]:
    task = fault.reference.operation_time
    window = (task if duration is None else duration) * SHARE
    studies = {}
    if law.scale is not None and not any(law.feedforward.coefficients.values()):
        progress("orders of accuracy", 0.0)
        studies["orders"] = orders(fault, law, schemes)
    for i, of in enumerate(("slip_noise", "rate_noise")):
        progress(f"sensitivity to {of.replace('_', ' ')}", i / 3)
        levels = noise_levels(fault, of)
        studies[of] = noise_sensitivity(
            fault, law, levels=levels, of=of, schemes=schemes, duration=window, plant=PRINTED
        )
    progress("sensitivity to the input gain", 2 / 3)
    box = fault if fault.box.authority else fault.with_box(UNCERTAIN)
    gain = gain_sensitivity(box, law, points=3, schemes=schemes, duration=duration, plant=PRINTED)
    return studies | {"input_gain": gain}


def orders(fault: Fault, law: Controller, schemes: Sequence[str] = SCHEMES) -> Study:
    """Errors over three decades of T_s up to that of the fault, in the second half of runs of 650 of its T_s."""
    longest = fault.sampling_time
    steps = [longest * 10 ** (-k / 2) for k in range(2 * DECADES + 1)]
    return accuracy(
        fault, law, steps=steps, schemes=schemes, duration=PERIODS * longest, settled_from=PERIODS * longest / 2
    )


def noise_levels(fault: Fault, of: str) -> tuple[float, ...]:
    """Standard deviations: 1e-8 … 1e-4 of the target slip [m], or 1e-2 … 100 times the mean slip rate [m/s]."""
    task = fault.reference
    first = 1e-8 * task.target_slip if of == "slip_noise" else 1e-2 * task.target_slip / task.operation_time
    return tuple(float(f"{first * 10**k:.2g}") for k in range(5))
