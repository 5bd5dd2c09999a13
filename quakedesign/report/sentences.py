"""Sentences of reports: scope of a proof, outcome of a run, margins and limits.

Chapters: loop and task that a proof covers; headline of a run; e-LQR margins and sampling; comparison; runs of faults
whose friction has a state.
"""

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import accumulate
from typing import TYPE_CHECKING, Any

from quakedesign.exact import Bound, LowerBound, UpperBound, rational
from quakedesign.fault import Fault, SlidingReference
from quakedesign.files import Json
from quakedesign.guarantees import ContinuousProof, NoProof, TrackingProof
from quakedesign.laws import control_laws
from quakedesign.linear.robust_stability import Analysis
from quakedesign.linear.sampled_stability import SampledStability
from quakedesign.linear.verdict import LinearVerdict
from quakedesign.lyapunov import Verdict
from quakedesign.lyapunov.exact.domain import Domain
from quakedesign.lyapunov.exact.premises import Premise, Variant
from quakedesign.simulation import Trajectory
from quakedesign.simulation.earthquake import waiting
from quakedesign.simulation.run_settings import STICK_SLIP
from quakedesign.studies.comparison import AS_IN_THE_PAPER, Compared, Entry, pressure_extremes, shortfall
from quakedesign.synthesis import Design
from quakedesign.text import lasting, quantity

if TYPE_CHECKING:
    from quakedesign.guarantees import FaultProof
    from quakedesign.simulation.recorder import Metrics


# ----------------------------------------------------------------------
# Scope of a proof: the simulated loop and its task, or the premises that fail, with their ratios.

BOUNDED_BY_PEAKS = frozenset({"constant_reference", "vanishing_disturbance"})
"""Premises of the stability of a linear law that its certified peaks do not require."""


def grade(entry: "Entry") -> str:
    """Verdict on one controller, and those parts of its loop and task that the proof does not cover."""
    if entry.proof is not None:
        other = f"{entry.design.other_step_first}; " if entry.design.other_step else ""
        return f"{other}{_guaranteed(entry.proof)}{_unmet(entry)}"
    if entry.design.verdict is not Verdict.PROVED:
        return str(entry.design.verdict)
    missing = [_failing(p) for p in entry.design.premises if not (p.holds or _bounded(entry, p))] + _hold_gaps(entry)
    verdict = f"proved, but {'; '.join(missing)}" if missing else "proved for this loop and task"
    return f"{verdict}; UNSTABLE with zero-order hold over T_s" if _unstable_with_hold(entry) else verdict


def _guaranteed(proof: "FaultProof") -> str:
    return f"guaranteed: slip rate <= {proof.peak_slip_rate:.3g} m/s, slip error <= {proof.claims.slip_error:.3g} m"


def _unmet(entry: "Entry") -> str:
    own = ("sampling_time",) * bool(entry.design.other_step)
    failing = [_failing(p) for p in entry.design.conditions if not p.holds and p.name not in own]
    return f", but {'; '.join(failing)}" if failing else ""


def _unstable_with_hold(entry: "Entry") -> bool:
    """Whether a run in continuous time hides an instability with zero-order hold."""
    if entry.run is None or entry.zero_order_hold is None:
        return False
    return (
        entry.run.provenance["scheme"] == "continuous"
        and entry.zero_order_hold.verdict_at_step.verdict is Verdict.REFUTED
    )


def _bounded(entry: "Entry", premise: Premise) -> bool:
    return bool(entry.peaks) and premise.name in BOUNDED_BY_PEAKS


def _failing(premise: Premise) -> str:
    if premise.ratio is None or not premise.proved:
        return f"{premise.name} fails (nothing is certified)"
    return f"{premise.name} fails: requires {premise.ratio:.3g} times the certified value"


def _hold_gaps(entry: "Entry") -> list[str]:
    """Reasons why the proof does not cover the scheme of the run."""
    if entry.run is None:
        return []
    scheme, step = entry.run.provenance["scheme"], entry.run.provenance["step"]
    if scheme == "continuous":
        unstable = entry.growth_per_step is not None and entry.growth_per_step >= 1
        return ["UNSTABLE at the step used"] if unstable else []
    if entry.zero_order_hold is None or scheme != "explicit":
        return [f"zero-order hold (scheme {scheme}) is not covered"]
    if entry.zero_order_hold.verdict_at_step.verdict is Verdict.REFUTED:
        return ["UNSTABLE with zero-order hold"]
    used, longest = rational(step), entry.zero_order_hold.largest_step
    if longest is None:
        return ["with zero-order hold, stability is proved for no T_s"]
    own = used == entry.zero_order_hold.step and entry.zero_order_hold.verdict_at_step.verdict is Verdict.PROVED
    if not (used <= longest or own):
        return [f"T_s is {UpperBound(used / longest):.3g} times the largest proved T_s"]
    return ["with zero-order hold stability is proved, but no error bound"]


# ----------------------------------------------------------------------
# First sentences about a run: outcome, pressure, and whether this pressure was sufficient.

_NEGLIGIBLE = 1e-6
"""An end of a pressure range that is below this fraction of the larger end is printed as zero."""


def run_sentences(run: Trajectory, fault: Fault) -> list[str]:
    """Outcome of a run, expected onset of its event if the run is too short, pressure, and shortfall of pressure."""
    extremes = pressure_extremes(run)
    pressure = pressure_sentence(*extremes) if extremes else None
    parts = [outcome_sentence(run), waiting_sentence(run, fault), pressure, shortfall(run, fault)]
    return [part for part in parts if part]


def outcome_sentence(run: Trajectory) -> str:
    """Outcome of a run with its peak slip rate."""
    outcome = run.outcome
    if outcome.peak_slip_rate is None:
        return f"{outcome.kind} at {run.events['diverged']:.4g} s"
    over = f"; floating-point overflow at {run.events['diverged']:.4g} s" if "diverged" in run.events else ""
    opened = f" at {run.events['opening']:.4g} s (p >= σ')" if outcome.kind == "opened" else ""
    return f"{outcome.kind}{opened}: peak slip rate {outcome.peak_slip_rate:.3g} m/s, {_beside_natural(run)}{over}"


def waiting_sentence(run: Trajectory, fault: Fault) -> str | None:
    """Expected onset of the event, for an uncontrolled run that ends before it; None for other runs."""
    event = waiting(run, fault)
    if event is None:
        return None
    text = f"the fault is unstable, but its event has not begun by {run.time[-1]:.4g} s"
    if event.onset is None:
        return f"{text}: no forward disturbance acts; omit --duration to add one"
    return f"{text}: at a growth rate of {event.growth:.3g} 1/s it would begin at about {event.onset:.3g} s"


def pressure_sentence(least: float, largest: float) -> str:
    """Range of a pressure [Pa], and whether it is withdrawal or injection."""
    nothing = _NEGLIGIBLE * max(abs(least), abs(largest))
    shown = (value if abs(value) > nothing else 0.0 for value in (least, largest))
    parts = [f"{value / 1e6 + 0.0:.3g} MPa{_direction(value)}" for value in shown]
    return f"pressure from {parts[0]} to {parts[1]}"


def _direction(pressure: float) -> str:
    return " (withdrawal)" if pressure < 0 else " (injection)" if pressure > 0 else ""


def _beside_natural(run: Trajectory) -> str:
    share, natural = run.outcome.share_of_natural, run.natural_peak
    if share is None or natural is None:
        return "and the fault has no natural earthquake"
    return f"{_percent(share)} of the natural earthquake's {natural:.3g} m/s"


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"


# ----------------------------------------------------------------------
# Sentences about an e-LQR: certified margins, sampling and peaks.


def hold_sentences(stability: SampledStability) -> list[str]:
    """Stability of the running law with zero-order hold, and the largest proved T_s."""
    over = f"with zero-order hold over T_s = {float(stability.step):.12g} s"
    if stability.verdict_at_step.verdict is Verdict.REFUTED and stability.verdict_at_step.witness is not None:
        return [f"UNSTABLE {over} ({_near(stability.verdict_at_step.witness)})", _proved_up_to(stability)]
    if stability.verdict_at_step.verdict is Verdict.UNDECIDED:
        return [f"undecided {over}", _proved_up_to(stability)]
    course = "any time-varying parameters, with integrals computed as sums over the samples"
    return [f"stable {over}, proved for {course}", _proved_up_to(stability)]


def _proved_up_to(stability: SampledStability) -> str:
    if stability.largest_step is None:
        return "no T_s is proved"
    proved = f"stability is proved for every T_s up to {stability.largest_step:.4g} s"
    return proved if stability.refuted_step is None else f"{proved} and refuted for {stability.refuted_step:.15g} s"


def peaks_sentence(peaks: Mapping[str, ContinuousProof | NoProof]) -> str:
    """Largest slip rate in continuous time, for every requested class of disturbances."""
    lines = [
        f"{proved.claims.peak_slip_rate:.3g} m/s (slip error {proved.claims.slip_error:.3g} m) for "
        + f"any disturbance of the fault's amplitude{' and rate' if name == 'rate' else ''}"
        for name, proved in peaks.items()
        if proved.available
    ]
    if not lines:
        reasons = {proved.reason for proved in peaks.values() if not proved.available}
        return "; ".join(["no bound on the slip rate is certified", *sorted(reasons)])
    return "certified in continuous time for the initial condition at rest: slip rate below " + ", ".join(lines)


def verdict_lines(judged: LinearVerdict) -> list[str]:
    """Lines about the stability, sampling and peaks of an e-LQR with given gains."""
    fault = judged.fault
    gains = " ".join(f"{float(k):.6g}" for k in judged.controller.gains.values())
    lines = [
        f'{judged.analysis.verdict}: elqr {gains} on "{fault.name}", box {fault.box.name}',
        *(f"  {line}" for line in margin_lines(judged.analysis)),
        f"  {'; '.join(hold_sentences(judged.sampled))}",
    ]
    if judged.peaks_class is None or judged.peaks is None:
        return lines
    return [*lines, f"  {peaks_sentence({judged.peaks_class: judged.peaks})}"]


def margin_lines(analysis: Analysis) -> list[str]:
    """Decay rate and margins, each with its limit; or a vertex that is not stable."""
    lines, decay, slope, span = [], analysis.decay, analysis.slope, analysis.span
    if analysis.unstable_at:
        lines.append(f"not stable {_near(analysis.unstable_at)}")
    if decay is not None:
        lines.append(
            f"decay rate {decay.certified:.4g} 1/s certified; that of the slowest vertex is {decay.limit:.4g} 1/s"
        )
    if slope is not None and slope.certified:
        lines.append(f"friction-slope margin {slope.certified:.5g} certified; unstable from {slope.limit:.5g} on")
    if span is not None:
        low = f"{span.low:.4g} (unstable at {span.low_limit:.4g})"
        lines.append(
            f"certified ranges of beta: [{low}, upper end of the box] and [lower end of the box, {span.high:.4g}]"
        )
    return lines


def _near(vertex: Sequence[Fraction]) -> str:
    """A vertex of x2' = s·x1 − w·x2 + β·…, rounded; its exact numbers are in the JSON facts."""
    return "near β = {:.4g}, slope s = {:.4g} 1/s^2, damping w = {:.4g} 1/s".format(*map(float, vertex))


# ----------------------------------------------------------------------
# Sentences about a comparison: outcome, verdict and failed premises of every controller, domains, schemes.


def guarantee_lines(entry: "Entry") -> list[str]:
    """Guarantee of the running loop, worst case found, and performance limits; for designed laws."""
    if entry.guarantee is None:
        return []
    reason = entry.design.details.get("reason") if entry.guarantee.proved else None
    too_long = [f"{entry.design.other_step_first}: {reason}"] if reason else []
    first, *rest = entry.guarantee.lines()
    return [*too_long, f"guarantee: {first.removeprefix('proved: ')}", *rest, *_longest_step_and_delay(entry)]


def limit_lines(entry: "Entry") -> list[str]:
    """Limits that `guarantee_lines` contains: for every controller, and for designs of this kind."""
    return [] if entry.guarantee is None else [*entry.guarantee.limit_lines(), *_longest_step_and_delay(entry)]


def _longest_step_and_delay(entry: "Entry") -> list[str]:
    """Longest T_s and delay for designs of the same kind, as far as the design search tests them."""
    certified = {p.name: p.certified for p in entry.design.premises if p.name in ("sampling_time", "delay")}
    if not certified:
        return []
    step, delay = (LowerBound(Fraction(certified[name])) for name in ("sampling_time", "delay"))
    law = entry.design.controller
    own = f"at T_s = {law.sampling_time:.6g} s" if law and law.sampling_time else "at the fault's own T_s"
    late = f"for delays up to at least {delay:.3g} s" if delay else "no guarantee was found with a delay"
    return [f"designs have a guarantee for T_s up to at least {step:.3g} s, and {own} {late}"]


def brief(entry: "Entry") -> str:
    """First lines of the guarantee, and the headline."""
    return "; ".join([*guarantee_lines(entry)[:2], headline(entry)])


_WHOLE = 1e-3  # a complete run may omit this share of a task, since no period follows its last sample
HEADLINE = 200
"""Largest number of characters of a headline: two and a half lines of a terminal."""


def headline(entry: "Entry") -> str:
    """Outcome of the run, the verdict, and as many further `sentences` as fit into `HEADLINE` characters."""
    every = sentences(entry)
    return "; ".join(every[: _fitting(every)])


def remarks(entry: "Entry") -> list[str]:
    """The `sentences` that do not fit into the headline."""
    every = sentences(entry)
    return every[_fitting(every) :]


def without_stated_reason(lines: Sequence[str], entry: "Entry") -> list[str]:
    """Sentences about a controller, without a reason that its `guarantee_lines` already state."""
    reason, guaranteed = entry.design.details.get("reason"), " ".join(guarantee_lines(entry))
    stated = bool(reason) and str(reason) in guaranteed
    return [line for line in lines if not (stated and line.endswith(str(reason)))]


def _fitting(lines: Sequence[str]) -> int:
    """Number of sentences that fit into a headline."""
    lengths = accumulate(len(sentence) + len("; ") for sentence in lines)
    return max(1, sum(length <= HEADLINE + len("; ") for length in lengths))


def sentences(entry: "Entry") -> list[str]:
    """All sentences about a run and its proof, the most important first, without full stops."""
    design = entry.design
    if design.controller is None:
        return _because(Verdict.UNDECIDED, design.details.get("reason", "no gains with a proof were found"))
    outcome, *of_run = run_sentences(entry.run, design.fault) if entry.run else ("",)
    assumed = [f"assumed: {what}" for what in filter(None, [design.details.get("assumed")])]
    lines = [
        outcome,
        *_verdict(design, entry.run),
        *_step_verdict(entry),
        *_premises(entry),
        *of_run,
        *_bounds(entry),
        *assumed,
    ]
    lines += [part_of_task(entry.run, design.fault)] if entry.run else []
    if entry.run and (share := entry.run.metrics.reverse_slip_fraction):
        lines.append(f"on the plant without stick, the slip rate is negative in {100 * share:.3g} % of the steps")
    return [sentence for sentence in lines if sentence]


def part_of_task(run: Trajectory, fault: Fault) -> str:
    """Shown part of the task; empty for a complete run, or one that ended by itself."""
    task, last = fault.reference.operation_time, float(run.time[-1])
    if last > (1 - _WHOLE) * task or not run.outcome.harmless:
        return ""
    return f"shown: the first {lasting(last)} of {lasting(task)}; --whole-task runs all of it"


def _verdict(design: Design, run: Trajectory | None) -> list[str]:
    """Verdict on the sampled loop or in continuous time, with the reason if it is not positive."""
    if design.verdict is Verdict.PROVED:
        ran: FaultProof | None = design.runs if design.runs is not None and design.runs.available else None
        lasts, proved = (ran.validity, ran.plant) if ran else ("for all t >= 0", TrackingProof.plant)
        plant = "for the loop that ran"
        if run is not None and proved and run.provenance["plant"] != proved:
            other = "stick-slip plant" if proved == STICK_SLIP else "plant without stick"
            plant = f"for this sampled loop on the {other}"
        return [f"proved {plant}, {lasts}" if _sampled(design) else "proved in continuous time"]
    unsaid = {Verdict.REFUTED: "a counterexample, checked in exact arithmetic", Verdict.UNDECIDED: "no certificate"}
    return _because(design.verdict, design.details.get("reason", unsaid[design.verdict]))


def _because(verdict: Verdict, reason: str) -> list[str]:
    """Verdict and reason, in one sentence if it takes at most half of the headline."""
    text = f"{verdict}: {reason}"
    return [text] if len(text) <= HEADLINE // 2 else [str(verdict), reason]


def _step_verdict(entry: "Entry") -> list[str]:
    """Stability at the step of the run, or that of the fault."""
    lines = []
    if entry.growth_per_step is not None:
        lines.append(f"{'stable' if entry.growth_per_step < 1 else 'UNSTABLE'} at the step used")
    if entry.zero_order_hold is not None:
        own = entry.run is None or entry.run.provenance["scheme"] in (AS_IN_THE_PAPER, "explicit")
        first, *others = hold_sentences(entry.zero_order_hold)
        lines += [first if own else f"with scheme explicit {first}", *others]
    return lines


def _premises(entry: "Entry") -> list[str]:
    """Failed premises, and further facts about the proof."""
    premises = entry.design.conditions
    design, texts = (
        entry.design,
        [_SAID[p.name].format(p.ratio) for p in premises if not p.holds and (p.proved or p.name == "along_reference")],
    )
    if design.verdict is Verdict.PROVED and design.conditions and all(p.holds for p in design.conditions):
        texts.append("every premise holds")
    if _sampled(design):
        texts += ["its base gains are proved in continuous time too"] if design.certificate is not None else []
    else:
        scheme = entry.run.provenance["scheme"] if entry.run else AS_IN_THE_PAPER
        texts += [] if scheme == AS_IN_THE_PAPER else [f"this run uses a zero-order hold (scheme {scheme})"]
    if entry.largest_step is not None and not _holds(design.premises, "on_trajectory"):
        texts.append(f"the run satisfies the proved bound on |h'| for T_s up to about {entry.largest_step:g} s")
    return texts


def _bounds(entry: "Entry") -> list[str]:
    return [peaks_sentence(entry.peaks)] if entry.peaks else []


def _sampled(design: Design) -> bool:
    return design.controller is not None and design.controller.sampling_time is not None


def domain_sentence(domain: Domain) -> str:
    """Domain where the certificate is valid although the control itself changes h, and its limiting premise."""
    which = (
        "certified domain" if domain.feedforward == "none" else f"certified domain, {domain.feedforward} feed-forward"
    )
    if domain.level == 0:
        return f"{which}: empty, because of {domain.limited_by or 'the control itself'} (ERRATA 16)"
    return (
        f"{which}: |e1| <= {domain.slip_error:.2g} m, |e2| <= {domain.slip_rate_error:.2g} m/s; admissible initial "
        f"conditions: |e1| <= {domain.start_slip_error:.2g} m or |e2| <= {domain.start_slip_rate_error:.2g} m/s or "
        f"|h(0)| <= {domain.start_perturbation:.2g} m/s², each with the other two zero; limited by {domain.limited_by}"
    )


def feedforward_rows(variants: Iterable[Variant]) -> list[tuple[str, ...]]:
    """One row per feed-forward under `FEEDFORWARD_COLUMNS`."""
    rows = []
    for variant in variants:
        ratios = {p.name: p.ratio for p in variant.premises}
        values = [ratios.get("along_reference"), ratios.get("level_set")]
        domain = variant.domain
        values += [domain.slip_error, domain.slip_rate_error] if domain else [None, None]
        rows.append((variant.feedforward.name, *("–" if v is None else f"{v:.2g}" for v in values)))
    return rows


FEEDFORWARD_COLUMNS = ("feed-forward", "along_reference", "level_set", "domain |e1| [m]", "domain |e2| [m/s]")
"""The two premises are ratios required/certified; the gains are the same in every row."""


def scheme_sentence(comparison: "Compared") -> str:
    """Schemes that computed the pressure of the runs."""
    runs: dict[str, list[str]] = {}
    for entry in comparison.entries:
        if entry.run:
            runs.setdefault(entry.run.provenance["scheme"], []).append(f"{entry.design.title} ({entry.kind})")
    schemes = "; ".join(f"{scheme}: {', '.join(labels)}" for scheme, labels in runs.items()) or "none"
    return (
        f"Schemes: {schemes}. Continuous evaluates the law in every Runge–Kutta stage; all others keep p constant over "
        "a step, which no certificate in continuous time covers"
    )


def _holds(premises: Iterable[Any], name: str) -> bool:
    return all(p.holds for p in premises if p.name == name)


_SAID = {
    "along_reference": "reference and disturbance alone make |h'| {:.3g} times as large as the proof allows",
    "level_set": "not covered: an unknown initial phase of the disturbance (|h'| is {:.3g} times the certified bound)",
    "on_trajectory": "in this run |h'| is {:.3g} times as large as the proof allows",
    "control_coefficient": "β leaves the proved range by a factor of {:.3g}",
    "friction_slope": "the friction slope is {:.3g} times as large as the proof allows",
    "sampling_time": ("T_s of the fault is {:.3g} times the longest with a guarantee; this design has a shorter T_s"),
    "constant_reference": "the certificate is for a constant reference, but the reference moves",
    "vanishing_disturbance": "the disturbance does not vanish at the equilibrium, so a bounded error remains",
}


# ----------------------------------------------------------------------
# Sentences about a run of a fault whose friction has a state, without control or in slow sliding.

_MOST_EVENTS = 8
_LOCKED = 0.5  # below this ratio of slip to loading displacement a fault counts as locked
FASTEST_PLATE = 1e-8
"""Loading rate [m/s] that no tectonic plate exceeds: about 0.3 m per year."""
_LABORATORY = 10.0  # length of a fault [m] below which it counts as a laboratory sample


def state_run_lines(result: Json) -> list[str]:
    """Lines of text, from the JSON of `run_state`: outcome, cycle, events."""
    outcome, cycle, events = result["outcome"], result["cycle"], result["slip_events"]
    least, largest = (p / 1e6 for p in result["pressure"])
    state = ", ".join(f"{name} = {value:.4g} s" for name, value in result["start"]["state"].items())
    lines = [
        f"{outcome['kind']}: peak slip rate {outcome['peak_slip_rate']:.3g} m/s (an earthquake from "
        f"{outcome['earthquake_from']:.3g} m/s on), {len(events)} events in {lasting(result['duration'])}, "
        f"slip {result['slip']:.4g} m",
        f"loaded at {result['loading_rate']:.4g} m/s; starts at {result['start']['slip_rate']:.4g} m/s with {state}",
        f"pressure from {least:.3g} MPa to {largest:.3g} MPa",
    ]
    if result["resting"]:
        lines.append("steady sliding is unstable here, but nothing disturbs it: use --start late, or set a pressure")
    if outcome["kind"] == "creep" and result["slip"] < _LOCKED * result["loading_rate"] * result["duration"]:
        lines.append(
            "this is not steady creep: the slip is far below the loading displacement, and the run ends before the "
            "event; set a longer --duration, such as the recurrence interval that design reports"
        )
    if cycle["recurrence_interval"] is not None:
        lines.append(f"recurrence interval {lasting(cycle['recurrence_interval'])}")
    if cycle["slip"] is not None:
        lines.append(f"slip of an event {cycle['slip']:.4g} m, magnitude {cycle['magnitude']:.2f}")
    lines += [_event_line(number, event) for number, event in enumerate(events[:_MOST_EVENTS], start=1)]
    if len(events) > _MOST_EVENTS:
        lines.append(f"and {len(events) - _MOST_EVENTS} more events (--json lists all)")
    lines.append(f"energy error of the integration: {result['energy']['relative_residual']:.2g} of the largest energy")
    return lines


def cycle_sentences(comparison: "Compared") -> list[str]:
    """Seismic cycle of a fault without control, and initial condition of run and proof; empty without a cycle."""
    run, fault = comparison.uncontrolled, comparison.fault
    return [] if run.cycle is None else [_cycle(run, run.cycle, fault), steady_start_sentence(run, fault)]


def _cycle(run: Trajectory, cycle: dict[str, float | None], fault: Fault) -> str:
    """Behaviour without control of a fault whose friction has a state, with its last complete event."""
    if run.failed:
        return f"Without control: unknown, since its cycle could not be computed ({run.failed.rstrip('.')})"
    peak = f"slip rate up to {run.outcome.peak_slip_rate:.3g} m/s"
    if run.natural_peak is None:
        return f"Without control: the fault creeps, {peak}"
    size = "" if cycle["magnitude"] is None else f" of magnitude {cycle['magnitude']:.2f}"
    again = "" if cycle["recurrence_interval"] is None else f" every {lasting(cycle['recurrence_interval'])}"
    return f"Without control: {run.outcome.kind}{size}{again}, {peak}, {_loading(run, fault)}"


def steady_start_sentence(run: Trajectory, fault: Fault) -> str:
    """Initial condition of run and proof of slow sliding, and the slip of the task relative to an earthquake's."""
    task = fault.reference
    rate, slip = float(SlidingReference(task=task).first_rate), run.cycle["slip"] if run.cycle else None
    text = f"Run and proof begin in steady sliding at V = {quantity(rate, 'm/s')}; the transition from rest is not"
    share = (
        ""
        if slip is None
        else f"; the task releases {task.target_slip:.3g} m of the {slip:.3g} m of slip of an earthquake"
    )
    return f"{text} covered{share}"


def _loading(run: Trajectory, fault: Fault) -> str:
    """Loading rate of a cycle, its plant, and a warning if the rate is an implausible default."""
    moved = "with inertia" if run.provenance["plant"] == "smooth" else "quasi-dynamic"
    rate = fault.friction.operating_rate
    loaded = f"loaded at {rate:.3g} m/s ({moved})"
    if rate <= FASTEST_PLATE or fault.length < _LABORATORY:
        return loaded
    return (
        f"{loaded}, FASTER than any plate: that is reference_rate of [friction]; for the recurrence interval enter "
        "the plate rate, such as '1 nm/s' (30 mm a year)"
    )


def left_out_lines(comparison: "Compared") -> list[str]:
    """Laws that do not apply to this fault, each reason once."""
    named: dict[str, list[str]] = {}
    for name, why in comparison.left_out.items():
        named.setdefault(why, []).append(control_laws()[name].title)
    return [f"Not designed, {', '.join(titles)}: {why}" for why, titles in named.items()]


def proved_line(sentence: str | None, outside: list[str], exceeded: str = "") -> str:
    """Guarantee of the law of a run, and settings of the run that the proof does not cover; empty without a proof."""
    if sentence is None:
        return ""
    if outside:
        beyond = f"{exceeded}; " if exceeded else ""
        others = f"this run is NOT covered by the proof, from which it differs in: {', '.join(outside)}"
        return f"{others}; {beyond}the proof says: {sentence}"
    return f"proved: {sentence}"


def exceeded_line(metrics: "Metrics", least: Bound, largest: Bound) -> str:
    """Pressures of a run [Pa] that exceed the proved ones; empty if none does."""
    low, high = metrics.min_pressure, metrics.max_pressure
    if low is None or high is None or (low >= least and high <= largest):
        return ""
    ran = f"{quantity(low, 'Pa')} to {quantity(high, 'Pa')}"
    return f"its pressure EXCEEDS the proved range: {ran}, proved {least.quantity('Pa')} to {largest.quantity('Pa')}"


def sliding_run_lines(result: Json) -> list[str]:
    """Lines of text, from the JSON of `run_sliding`: outcome, errors, pressure, and guarantee."""
    outcome, metrics = result["outcome"], result["metrics"]
    least, largest = (p / 1e6 for p in result["pressure"])
    path = "".join(f", through a {name.replace('_', ' ')}" for name in result["stages"])
    path += f", through a lag of {result['lag']:.4g} s" if result["lag"] else ""
    path += f", through a diffusion path of L^2/D = {result['diffusion']:.4g} s" if result["diffusion"] else ""
    shaken = f", under a shear stress of up to {result['stress'] / 1e3:.4g} kPa" if result["stress"] else ""
    return [
        f"{outcome['kind']}: peak slip rate {outcome['peak_slip_rate']:.4g} m/s, the reference's is "
        f"{result['largest_reference_rate']:.4g} m/s (an earthquake from {outcome['earthquake_from']:.3g} m/s on)",
        f"zero-order hold over {result['step']:.4g} s{path}{shaken}, for {lasting(result['duration'])}; without "
        f"control errors grow at {result['growth_rate']:.3g} 1/s",
        f"|ln(v/r')| at most {metrics['max_log_rate']:.3g}, slip error at most {metrics['max_slip_error']:.3g} m",
        f"pressure from {least:.3g} MPa to {largest:.3g} MPa; feedback adds at most "
        f"{metrics['max_asked'] / 1e6:.3g} MPa, of either sign, to the pressure for the reference",
        proved_line((result["guarantee"] or {}).get("sentence"), result["outside"])
        or "no guarantee: all values are of this run",
    ]


def _event_line(number: int, event: Json) -> str:
    nucleation = "" if event["nucleation"] is None else f"nucleation from {event['nucleation']:.6g} s, "
    arrest = "not over at the end of the run" if event["arrest"] is None else f"arrest {event['arrest']:.6g} s"
    return f"event {number}: {nucleation}onset {event['onset']:.6g} s, {arrest}, peak {event['peak_slip_rate']:.3g} m/s"
