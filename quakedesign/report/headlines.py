"""What is said of a comparison: outcome and verdict of every controller with what breaks it, domains, schemes."""

from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import accumulate
from typing import Any

from quakedesign.bounds import LowerBound
from quakedesign.certificates import Verdict
from quakedesign.certificates.guarantee import NoGuarantee
from quakedesign.certificates.premises import Domain, Variant
from quakedesign.fault import Fault
from quakedesign.report.elqr_sentences import held_sentences, peaks_sentence
from quakedesign.report.outcomes import run_sentences
from quakedesign.simulation import Trajectory
from quakedesign.studies.comparison import AS_IN_THE_PAPER, Compared, Entry
from quakedesign.synthesis import Design
from quakedesign.text import lasting


def guarantee_lines(entry: "Entry") -> list[str]:
    """What is guaranteed of the loop as it runs, the worst found and what no controller can do; for designed laws."""
    if entry.answer is None:
        return []
    asked = entry.design.details.get("reason") if entry.answer.proved else None
    too_long = [f"{entry.design.other_step_first}: {asked}"] if asked else []
    first, *rest = entry.answer.lines()
    return [*too_long, f"guarantee: {first.removeprefix('proved: ')}", *rest, *_reach(entry)]


def limit_lines(entry: "Entry") -> list[str]:
    """Those of `guarantee_lines` that say what cannot be had: by no controller, and by designs of this kind."""
    return [] if entry.answer is None else [*entry.answer.limit_lines(), *_reach(entry)]


def _reach(entry: "Entry") -> list[str]:
    """How long T_s and a delay may be for designs of the same kind, as far as the search of a design goes."""
    certified = {p.name: p.certified for p in entry.design.premises if p.name in ("sampling_time", "delay")}
    if not certified:
        return []
    step, delay = (LowerBound(Fraction(certified[name])) for name in ("sampling_time", "delay"))
    law = entry.design.controller
    own = f"at T_s = {law.sampling_time:.6g} s" if law and law.sampling_time else "at the fault's own T_s"
    late = f"for delays up to at least {delay:.3g} s" if delay else "no delay was found with one"
    return [f"designs have a guarantee for T_s up to at least {step:.3g} s, and {own} {late}"]


def said(entry: "Entry") -> str:
    """What is guaranteed, and the headline."""
    return "; ".join([*guarantee_lines(entry)[:2], headline(entry)])


_WHOLE = 1e-3  # of a task that a run may leave out, as the last sample has no period
HEADLINE = 200
"""Characters of a headline at most: two lines and a half of a terminal."""


def headline(entry: "Entry") -> str:
    """Outcome of the run, the verdict, and of the `sentences` that follow as many as `HEADLINE` characters hold."""
    told = sentences(entry)
    return "; ".join(told[: _fitting(told)])


def remarks(entry: "Entry") -> list[str]:
    """The `sentences` for which the headline has no place."""
    told = sentences(entry)
    return told[_fitting(told) :]


def beside_guarantee(told: Sequence[str], entry: "Entry") -> list[str]:
    """What is told of a controller, without a reason that its `guarantee_lines` have given."""
    reason, said = entry.design.details.get("reason"), " ".join(guarantee_lines(entry))
    given = bool(reason) and str(reason) in said
    return [line for line in told if not (given and line.endswith(str(reason)))]


def _fitting(told: Sequence[str]) -> int:
    """How many sentences, joined, make a headline."""
    lengths = accumulate(len(sentence) + len("; ") for sentence in told)
    return max(1, sum(length <= HEADLINE + len("; ") for length in lengths))


def sentences(entry: "Entry") -> list[str]:
    """All that is said of a run and of its proof, what matters most first, without full stops."""
    design = entry.design
    if design.controller is None:
        return _because(Verdict.UNDECIDED, design.details.get("reason", "no gains with a proof were found"))
    outcome, *of_run = run_sentences(entry.run, design.fault) if entry.run else ("",)
    assumed = [f"assumed: {what}" for what in filter(None, [design.details.get("assumed")])]
    told = [outcome, *_verdict(design), *_step_verdict(entry), *_premises(entry), *of_run, *_bounds(entry), *assumed]
    told += [part_of_task(entry.run, design.fault)] if entry.run else []
    return [sentence for sentence in (*told, *_reversed(entry.run)) if sentence]


def part_of_task(run: Trajectory, fault: Fault) -> str:
    """How much of the task a run shows that does not show all of it; empty for one that ended of itself."""
    task, last = fault.reference.operation_time, float(run.time[-1])
    if last > (1 - _WHOLE) * task or not run.outcome.harmless:
        return ""
    return f"shown: the first {lasting(last)} of {lasting(task)}; --whole-task runs all of it"


def _verdict(design: Design) -> list[str]:
    """Of the loop that ran or in continuous time, with the reason where it is not positive."""
    if design.verdict is Verdict.PROVED:
        lasts = "for ever" if design.runs is None or isinstance(design.runs, NoGuarantee) else design.runs.lasts
        return [f"proved for the loop that ran, {lasts}" if _sampled(design) else "proved in continuous time"]
    unsaid = {Verdict.REFUTED: "a counterexample checks in exact arithmetic", Verdict.UNDECIDED: "no certificate"}
    return _because(design.verdict, design.details.get("reason", unsaid[design.verdict]))


def _because(verdict: Verdict, reason: str) -> list[str]:
    """In one sentence where that leaves half of the headline to others."""
    told = f"{verdict}: {reason}"
    return [told] if len(told) <= HEADLINE // 2 else [str(verdict), reason]


def _step_verdict(entry: "Entry") -> list[str]:
    """Whether the step that ran, or that of the fault, is stable."""
    told = []
    if entry.growth_per_step is not None:
        told.append(f"{'stable' if entry.growth_per_step < 1 else 'UNSTABLE'} at the step used")
    if entry.held is not None:
        own = entry.run is None or entry.run.provenance["scheme"] in (AS_IN_THE_PAPER, "explicit")
        first, *others = held_sentences(entry.held)
        told += [first if own else f"with scheme explicit {first}", *others]
    return told


def _premises(entry: "Entry") -> list[str]:
    """Every premise that fails, and what the proof is about besides."""
    design, told = entry.design, _broken(entry.design.conditions)
    if design.verdict is Verdict.PROVED and design.conditions and all(p.holds for p in design.conditions):
        told.append("every premise holds")
    if _sampled(design):
        told += ["its base gains are proved in continuous time too"] if design.certificate is not None else []
    else:
        told += _held(entry.run)
    if entry.largest_step is not None and not _holds(design.premises, "on_trajectory"):
        told.append(f"it would stay inside for T_s up to about {entry.largest_step:g} s")
    return told


def _bounds(entry: "Entry") -> list[str]:
    return [peaks_sentence(entry.peaks)] if entry.peaks else []


def _sampled(design: Design) -> bool:
    return design.controller is not None and design.controller.sampling_time is not None


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


def scheme_sentence(comparison: "Compared") -> str:
    """How the pressure of the runs was computed."""
    runs: dict[str, list[str]] = {}
    for entry in comparison.entries:
        if entry.run:
            runs.setdefault(entry.run.provenance["scheme"], []).append(f"{entry.design.title} ({entry.origin})")
    said = "; ".join(f"{scheme}: {', '.join(labels)}" for scheme, labels in runs.items()) or "none"
    return (
        f"Schemes: {said}. Continuous evaluates the law in every Runge–Kutta stage, all others hold p over a "
        "step, which no certificate in continuous time covers"
    )


def _held(run: Trajectory | None) -> list[str]:
    """What the certificate in continuous time does not cover."""
    scheme = run.provenance["scheme"] if run else AS_IN_THE_PAPER
    return [] if scheme == AS_IN_THE_PAPER else [f"in this run p is held over every step, scheme {scheme}"]


def _reversed(run: Trajectory | None) -> list[str]:
    """Slip against the direction of the model."""
    share = run.metrics.reverse_slip_fraction if run else None
    return [f"the slip rate is negative, outside the model, in {100 * share:.3g} % of the steps"] if share else []


def _holds(premises: Iterable[Any], name: str) -> bool:
    return all(p.holds for p in premises if p.name == name)


_SAID = {
    "along_reference": "the reference and the disturbance alone leave the premise on |h'| {:.3g}-fold",
    "level_set": "a start at an unknown phase of the disturbance is not certified ({:.3g}-fold)",
    "on_trajectory": "this run leaves the premise on |h'| {:.3g}-fold",
    "control_coefficient": "β leaves its certified range {:.3g}-fold",
    "friction_slope": "the friction slope exceeds the certified sector {:.3g}-fold",
    "sampling_time": (
        "T_s of the fault is {:.3g} times the longest for which a guarantee was found, and this design samples faster"
    ),
    "constant_reference": "the reference moves, the certificate is about constant ones",
    "vanishing_disturbance": "the disturbance does not vanish at the equilibrium, so a bounded error remains",
}


def _broken(premises: Iterable[Any]) -> list[str]:
    return [
        _SAID[p.name].format(p.ratio) for p in premises if not p.holds and (p.proved or p.name == "along_reference")
    ]
