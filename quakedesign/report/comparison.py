"""All controllers of one fault side by side, in closed loop."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import isqrt
from typing import Any

from quakedesign.certificates import Verdict
from quakedesign.certificates.linear_premises import sectors
from quakedesign.certificates.premises import Domain, Variant, certified_lipschitz
from quakedesign.controllers import SlidingMode, published
from quakedesign.fault import Fault
from quakedesign.report.linear import held_sentence, peaks_sentence
from quakedesign.simulation import Trajectory, natural_earthquake, simulate
from quakedesign.simulation.step_stability import amplification
from quakedesign.synthesis import Design, assess
from quakedesign.synthesis.linear.certified_peaks import CLASSES, CertifiedPeaks
from quakedesign.synthesis.linear.scaled_design import vertex_poles
from quakedesign.synthesis.sampling import largest_sampling_time, on_trajectory


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One controller with its run.

    Attributes
    ----------
    label : str
    origin : str
        ``"designed"`` or ``"published"``.
    design : Design
        With the premise `on_trajectory` where it applies.
    run : Trajectory or None
        None when there is no controller to run.
    largest_step : float or None
        Largest T_s [s] for which the run would stay inside the premise on |h'|; None when not asked or not found.
    growth_per_step : float or None
        For a linear law: growth of the fastest mode per step of the run [-]; below 1 is stable.
    variants : tuple of Variant
        For a designed sliding mode: what is certified of the same gains with every named feed-forward.
    held : mapping or None
        For a linear law: what is decided when p is held over T_s, see `Design.held_facts`.
    peaks : mapping of str to CertifiedPeaks
        For a designed linear law that is proved: certified peaks by class of disturbances; no class without any.
    """

    label: str
    origin: str
    design: Design
    run: Trajectory | None
    largest_step: float | None = None
    growth_per_step: float | None = None
    variants: tuple[Variant, ...] = ()
    held: Mapping[str, Any] | None = None
    peaks: Mapping[str, CertifiedPeaks] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Keys of DESIGN.md; exact quantities as texts, measured ones as numbers, SI."""
        found = self.design
        return {
            "gains": {name: str(v) for name, v in found.gains.items()},
            "verdict": str(found.verdict),
            "certificate": None,
            "premises": [p.to_dict() for p in found.premises],
            "domain": found.domain.to_dict() if found.domain else None,
            "feedforward": {v.feedforward.name: v.to_dict() for v in self.variants},
            "headline": headline(self),
            "largest_sampling_time": self.largest_step,
            "growth_per_step": self.growth_per_step,
            "held": dict(self.held) if self.held else None,
            "peaks": {name: found.to_dict() for name, found in self.peaks.items()} or None,
            "details": dict(found.details),
            "metrics": self.run.metrics.to_dict() if self.run else None,
            "events": dict(self.run.events) if self.run else None,
            "run": dict(self.run.provenance) if self.run else None,
        }


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Uncontrolled, published and designed on one fault.

    Attributes
    ----------
    fault : Fault
    uncontrolled : Trajectory
        The natural earthquake.
    entries : tuple of Entry
    """

    fault: Fault
    uncontrolled: Trajectory
    entries: tuple[Entry, ...]

    def of(self, origin: str) -> tuple[Entry, ...]:
        """Entries of one origin."""
        return tuple(e for e in self.entries if e.origin == origin)

    def to_dict(self) -> dict[str, Any]:
        """Keys of the command ``design`` in DESIGN.md."""
        by_origin = {o: {e.design.name: e.to_dict() for e in self.of(o)} for o in ("designed", "published")}
        return {
            "controllers": by_origin["designed"],
            "published": by_origin["published"],
            "uncontrolled": {
                "metrics": self.uncontrolled.metrics.to_dict(),
                "events": dict(self.uncontrolled.events),
                "run": dict(self.uncontrolled.provenance),
            },
        }

    def figures(self) -> dict[str, Any]:
        """Matplotlib figures by name."""
        from quakedesign.report.figures import figures

        return figures(self)

    def _repr_html_(self) -> str:
        from quakedesign.report.page import table_html

        return table_html(self)


def compare(
    fault: Fault,
    designs: Sequence[Design] = (),
    *,
    with_published: bool = True,
    progress: Callable[[str, float], None] | None = None,
) -> Comparison:
    """Run all controllers of a fault over the whole task, scheme ``continuous``, step T_s.

    Parameters
    ----------
    fault : Fault
    designs : sequence of Design
        Designed controllers; one without a controller is reported and not run.
    with_published : bool
        Add the paper's gains, where the fault has any, with their verdicts and premises.
    progress : callable, optional
        Called with what is being done and the fraction done [-].

    Returns
    -------
    Comparison
    """
    tell = progress or (lambda _what, _done: None)
    tell("uncontrolled", 0.0)
    uncontrolled = natural_earthquake(fault)
    entries: list[Entry] = []
    for controller in published(fault.name).values() if with_published else ():
        tell(f"{controller.title} (published): verdict", 0.0)
        entries.append(_entry("published", assess(fault, controller), tell))
    entries.extend(_entry("designed", found, tell) for found in designs)
    return Comparison(fault=fault, uncontrolled=uncontrolled, entries=tuple(entries))


def _entry(origin: str, design: Design, tell: Callable[[str, float], None]) -> Entry:
    label = f"{design.title} ({origin})"
    if design.controller is None:
        return Entry(label=label, origin=origin, design=design, run=None)
    kept = samples(design.fault)
    run = simulate(design.fault, design.controller, samples=kept, progress=lambda done: tell(label, done))
    if not isinstance(design.controller, SlidingMode):
        poles = vertex_poles(sectors(design.fault), list(design.controller.gains.values()))
        growth = amplification(poles, run.provenance["step"], run.provenance["method"])
        tell(f"{label}: held pressure and peaks", 0.0)
        wanted = CLASSES if origin == "designed" and design.verdict is Verdict.PROVED else ()
        peaks = {kind: design.certified_peaks(kind) for kind in wanted}
        return Entry(
            label=label,
            origin=origin,
            design=design,
            run=run,
            growth_per_step=growth,
            held=design.held_facts(),
            peaks={kind: found for kind, found in peaks.items() if found is not None},
        )
    bound = float(_lipschitz(design))
    premise = on_trajectory(design.controller, bound, run)
    if design.verdict is not Verdict.PROVED or premise is None:
        return Entry(label=label, origin=origin, design=design, run=run)
    judged, step = design.with_premise(premise), None
    variants: tuple[Variant, ...] = ()
    if origin == "designed":
        tell(f"{label}: largest sampling time", 0.0)
        step = largest_sampling_time(design.fault, design.controller, bound)
        tell(f"{label}: feed-forward", 0.0)
        variants = design.feedforward_variants()
    return Entry(label=label, origin=origin, design=judged, run=run, largest_step=step, variants=variants)


def samples(fault: Fault, most: int = 2000) -> int:
    """Number of instants to keep of a run, so that the steps between two are a prime number, or one.

    Chatter that repeats after few steps is then met in all its phases; every second thousandth step may meet one alone.
    """
    steps = int(fault.reference.operation_time / fault.sampling_time + 1e-6)
    strides = ((count, -(-steps // count)) for count in range(most, 0, -1))
    return next((count for count, stride in strides if stride == 1 or _prime(stride)), most)


def _prime(number: int) -> bool:
    return number > 1 and all(number % divisor for divisor in range(2, isqrt(number) + 1))


def _lipschitz(design: Design) -> Fraction:
    assert isinstance(design.controller, SlidingMode)
    if design.certificate is None or design.verdict is not Verdict.PROVED:
        return design.controller.lipschitz_limit
    return certified_lipschitz(design.certificate) * design.controller.scale


def headline(entry: Entry) -> str:
    """One sentence with the verdict and every premise that fails."""
    design = entry.design
    if design.controller is None:
        return f"undecided: {design.details.get('reason', 'no gains with a proof were found')}"
    verdict = {
        Verdict.PROVED: "proved in continuous time",
        Verdict.REFUTED: f"refuted: {design.details.get('reason', 'a counterexample checks in exact arithmetic')}",
        Verdict.UNDECIDED: f"undecided: {design.details.get('reason', 'no certificate')}",
    }[design.verdict]
    parts = [verdict, *_broken(design.premises)]
    if design.verdict is Verdict.PROVED and all(p.holds for p in design.premises):
        parts.append("every premise holds")
    if entry.largest_step is not None and not _holds(design.premises, "on_trajectory"):
        parts.append(f"it would stay inside for T_s up to about {entry.largest_step:g} s")
    if entry.growth_per_step is not None:
        stable = "stable" if entry.growth_per_step < 1 else "UNSTABLE"
        parts.append(f"{stable} at the step used")
    if entry.peaks:
        parts.append(peaks_sentence(entry.peaks))
    if entry.held is not None:
        parts.append(held_sentence(entry.held))
    return "; ".join([*parts, *_happened(entry.run)])


def domain_sentence(domain: Domain) -> str:
    """Where the certificate speaks although the control itself moves h, and what limits it."""
    which = (
        "certified domain" if domain.feedforward == "none" else f"certified domain, {domain.feedforward} feed-forward"
    )
    if domain.level == 0:
        return f"{which}: empty, because of {domain.limited_by or 'the control itself'} (ERRATA 16)"
    return (
        f"{which}: |e1| <= {domain.slip_error:.2g} m, |e2| <= {domain.slip_rate_error:.2g} m/s; it admits any one of "
        f"|e1| <= {domain.start_slip_error:.2g} m, |e2| <= {domain.start_slip_rate_error:.2g} m/s, "
        f"|h(0)| <= {domain.start_perturbation:.2g} m/s² at the start; limited by {domain.limited_by}"
    )


def feedforward_rows(variants: Iterable[Variant]) -> list[tuple[str, ...]]:
    """One row a feed-forward under `FEEDFORWARD_COLUMNS`."""
    found = []
    for variant in variants:
        ratios = {p.name: p.ratio for p in variant.premises}
        values = [ratios.get("along_reference"), ratios.get("level_set")]
        domain = variant.domain
        values += [domain.slip_error, domain.slip_rate_error] if domain else [None, None]
        found.append((variant.feedforward.name, *("–" if v is None else f"{v:.2g}" for v in values)))
    return found


FEEDFORWARD_COLUMNS = ("feed-forward", "along_reference", "level_set", "domain |e1| [m]", "domain |e2| [m/s]")
"""The two premises are ratios required/certified; the gains are the same in every row."""


def _happened(run: Trajectory | None) -> list[str]:
    """Events of a run that leave the model."""
    found = []
    if run is not None and "diverged" in run.events:
        found.append(f"the run diverges at {run.events['diverged']:.4g} s")
    if run is not None and "opening" in run.events:
        found.append(f"the fault opens (p >= σ') at {run.events['opening']:.4g} s")
    if run is not None and run.metrics.reverse_slip_fraction:
        share = run.metrics.reverse_slip_fraction
        found.append(f"the slip rate is negative, outside the model, in {100 * share:.3g} % of the steps")
    return found


def _holds(premises: Iterable[Any], name: str) -> bool:
    return all(p.holds for p in premises if p.name == name)


_SAID = {
    "along_reference": "the reference and the disturbance alone leave the premise on |h'| {:.3g}-fold",
    "level_set": "a start at an unknown phase of the disturbance is not certified ({:.3g}-fold)",
    "on_trajectory": "this run leaves the premise on |h'| {:.3g}-fold",
    "control_coefficient": "β leaves its certified range {:.3g}-fold",
    "friction_slope": "the friction slope exceeds the certified sector {:.3g}-fold",
    "constant_reference": "the reference moves, the certificate is about constant ones",
    "vanishing_disturbance": "the disturbance does not vanish at the equilibrium, so a bounded error remains",
}


def _broken(premises: Iterable[Any]) -> list[str]:
    return [
        _SAID[p.name].format(p.ratio) for p in premises if not p.holds and (p.proved or p.name == "along_reference")
    ]
