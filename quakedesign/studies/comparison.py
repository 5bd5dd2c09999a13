"""Comparison of all controllers of one fault in closed loop, and the required pressure.

The second chapter gives the equilibrium pressure [Pa] of a task and tests whether a run supplied it.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from typing import Any

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import ParameterError
from quakedesign.exact import Enclosure, rational
from quakedesign.fault import Fault, require_fault
from quakedesign.fault.equilibrium import STEADY_SLIDING
from quakedesign.files import Json
from quakedesign.guarantees import CLASSES, ContinuousProof, FaultProof, Guarantee, with_worst_case
from quakedesign.guarantees.stick_slip_result import stick_slip_with_worst_case
from quakedesign.guarantees.tracking_result import given_law_with_worst_case
from quakedesign.laws import Controller, published
from quakedesign.linear.riccati import vertex_poles
from quakedesign.linear.sampled_stability import SampledStability
from quakedesign.loop import simulation_scheme
from quakedesign.lyapunov import Verdict
from quakedesign.lyapunov.exact.certificate_files import STICK_SLIP
from quakedesign.lyapunov.exact.perturbation_bounds import equilibrium_pressure, sectors
from quakedesign.lyapunov.exact.premises import Variant
from quakedesign.parallel import Background, in_background
from quakedesign.simulation import Trajectory, natural_earthquake, simulate
from quakedesign.simulation.integrators import amplification
from quakedesign.studies.certified import certified_bound, largest_sampling_time, on_trajectory
from quakedesign.studies.single_runs import designed_run, natural_run
from quakedesign.synthesis import Design, assess, designable, left_out
from quakedesign.synthesis import design as synthesise
from quakedesign.text import Progress

# ----------------------------------------------------------------------
# Comparison of all controllers of one fault in closed loop.


AS_IN_THE_PAPER = "continuous"
"""Scheme of the paper's simulations."""


@checked_dataclass(frozen=True, kw_only=True)
class Entry:
    """One controller with its run.

    Attributes
    ----------
    label : str
    origin : str
        ``"published"``, or ``"designed"`` for all others.
    design : Design
        With the premise `on_trajectory` where it applies.
    run : Trajectory or None
        None when there is no controller to run.
    largest_step : float or None
        Largest T_s [s] for which the run would satisfy the premise on |h'|; None if not computed or not found, and for
        sampled schemes.
    growth_per_step : float or None
        For a linear law: growth of the fastest mode per step of the run [-]; below 1 is stable. None for sampled
        schemes, see `zero_order_hold`.
    variants : tuple of Variant
        For a designed sliding mode: certified properties of the same gains with every named feed-forward.
    zero_order_hold : SampledStability or None
        For a linear law: stability with zero-order hold over T_s, see `Design.sampled_stability`.
    peaks : mapping of str to ContinuousProof
        For a designed linear law that is proved: peaks in continuous time by class; empty if there are none.
    given : bool
        Whether the law is given, not designed.
    guarantee : Guarantee or None
        For a designed or given law: guarantee with zero-order hold over T_s, see `Design.guarantee`, and worst case
        found.
    """

    label: str
    origin: str
    design: Design
    run: Trajectory | None
    largest_step: float | None = None
    growth_per_step: float | None = None
    variants: tuple[Variant, ...] = ()
    zero_order_hold: SampledStability | None = None
    peaks: Mapping[str, ContinuousProof] = field(default_factory=dict)
    given: bool = False
    guarantee: Guarantee | None = None

    @property
    def kind(self) -> str:
        """``"given"``, or the origin."""
        return "given" if self.given else self.origin

    @property
    def proof(self) -> FaultProof | None:
        """Proof of the guarantee; None without one."""
        proof = self.guarantee.proof if self.guarantee else None
        return proof if proof is not None and proof.available else None

    def to_dict(self) -> Json:
        """JSON-able facts: exact quantities as strings, measured ones as numbers, SI.

        None also for entries that a report fills later.
        """
        design = self.design
        return {
            "guarantee": self.guarantee.to_dict() | {"certificate": None} if self.guarantee else None,
            "class": design.disturbance_class,
            "outcome": self.run.outcome.to_dict() if self.run else None,
            "gains": {name: str(v) for name, v in design.gains.items()},
            "verdict": str(design.verdict),
            "certificate": None,
            "premises": [p.to_dict() for p in design.premises],
            "domain": design.domain.to_dict() if design.domain else None,
            "feedforward": {v.feedforward.name: v.to_dict() for v in self.variants},
            "headline": None,
            "remarks": [],
            "largest_sampling_time": self.largest_step,
            "growth_per_step": self.growth_per_step,
            "held": self.zero_order_hold.to_dict() if self.zero_order_hold else None,
            "peaks": {name: design.to_dict() for name, design in self.peaks.items()} or None,
            "details": dict(design.details),
            "metrics": self.run.metrics.to_dict() if self.run else None,
            "events": dict(self.run.events) if self.run else None,
            "run": dict(self.run.provenance) if self.run else None,
        }


@dataclass(frozen=True, kw_only=True, repr=False)
class Compared:
    """Uncontrolled, published and designed runs on one fault.

    Attributes
    ----------
    uncontrolled : Trajectory
        The natural earthquake; with friction state the seismic cycle.
    """

    fault: Fault
    uncontrolled: Trajectory
    entries: tuple[Entry, ...]

    @property
    def left_out(self) -> dict[str, str]:
        """Reasons why other laws do not apply to this fault or loop setup, by name."""
        return behind_path(self.fault) if self.path else left_out(self.fault)

    @property
    def path(self) -> dict[str, Fraction]:
        """Delay, lag and diffusion time [s] of the designs that are not 0."""
        return {name: time for entry in self.entries for name, time in entry.design.setup.path.items()}

    def of(self, origin: str) -> tuple[Entry, ...]:
        """Entries of one origin."""
        return tuple(e for e in self.entries if e.origin == origin)


def compared(
    fault: Fault,
    designs: Iterable[tuple[Design, bool]],
    progress: Progress,
    *,
    with_published: bool = True,
    whole_task: bool = False,
    schemes: Mapping[str, str],
    plant: str | None = None,
) -> Compared:
    """Runs of all controllers of a fault, as `quakedesign.report.compare` shows them; schemes by origin.

    `designs` are pairs of a design and a flag, True if the law was given, not designed. Runs go on in the background
    while further designs are made, if these come from a generator.
    """
    require_fault(fault)
    fault.friction.require(plant=plant)
    for name in schemes.values():
        simulation_scheme(name)
    progress("uncontrolled", 0.0)
    if fault.friction.equilibrium is STEADY_SLIDING:
        return _compared_in_slow_sliding(fault, [designed for designed, _ in designs], progress, whole=whole_task)
    begun: list[tuple[Entry, Future[Trajectory] | None]] = []
    with in_background() as runs:
        uncontrolled = runs.submit(natural_earthquake, fault, plant=plant)
        for controller in published(fault.name).values() if with_published else ():
            progress(f"{controller.title} (published): verdict", 0.0)
            begun.append(_begun("published", assess(fault, controller), schemes, runs, plant))
        for designed, given in designs:
            begun.append(_begun("designed", designed, schemes, runs, plant, given=given))
            progress(f"{begun[-1][0].label}: worst cases", 0.0)
            result = _guarantee_of(fault, designed, given=given)
            begun[-1] = replace(begun[-1][0], guarantee=result), begun[-1][1]
        natural = runs.result(uncontrolled, partial(progress, "uncontrolled"))
        entries = [
            entry if run is None else _ended(entry, runs.result(run, partial(progress, entry.label)), progress)
            for entry, run in begun
        ]
    return Compared(fault=fault, uncontrolled=natural, entries=tuple(entries))


def behind_path(fault: Fault) -> dict[str, str]:
    """Reasons why laws designed for a pressure without delay do not apply with a delay, lag or diffusion path."""
    why = (
        "sliding modes and published gains assume a pressure without delay; a comparison with a delay, a lag or a "
        "diffusion path omits them; the command guarantee gives proved bounds of a sliding mode with these"
    )
    return {name: why for name in designable(fault) if name != "elqr"}


def _guarantee_of(fault: Fault, design: Design, *, given: bool) -> Guarantee | None:
    proof: Any = design.guarantee
    if design.sliding is not None:
        return design.sliding
    if proof.available and proof.kind == STICK_SLIP:
        return stick_slip_with_worst_case(fault, proof, design.compensation)
    if given:
        notes = getattr(design.controller, "notes", None)
        return replace(given_law_with_worst_case(fault, proof, notes), compensation=design.compensation)
    tried = str(design.details.get("not_at_rest", ""))
    result = replace(with_worst_case(fault, proof), compensation=design.compensation, not_at_rest=tried)
    return result if proof.available or design.runs else replace(result, given=True)  # only T_s of the fault was tried


def _compared_in_slow_sliding(fault: Fault, designs: Sequence[Design], progress: Progress, *, whole: bool) -> Compared:
    """Comparison for friction with a state: seismic cycle, and designs with their runs."""
    natural = natural_run(fault)
    entries = []
    for designed in designs:
        entry = Entry(label=f"{designed.title} (designed)", origin="designed", design=designed, run=None)
        if designed.controller is not None:
            reported = partial(progress, entry.label)
            entry = replace(entry, run=designed_run(designed, natural.natural_peak, reported, whole=whole))
        entries.append(replace(entry, guarantee=designed.sliding))
    return Compared(fault=fault, uncontrolled=natural, entries=tuple(entries))


def designs_of(
    fault: Fault, names: Iterable[str], progress: Progress, options: Mapping[str, Any] | None = None
) -> Iterator[Design]:
    """Designs of the named laws, one after the other, with options of `quakedesign.design`."""
    listed = list(names)
    for i, name in enumerate(listed):
        progress(f"synthesis and proof of {name}", i / len(listed))
        yield synthesise(fault, name, progress=progress, **(options or {}))


def _begun(
    origin: str, design: Design, schemes: Mapping[str, str], runs: Background, plant: str | None, *, given: bool = False
) -> tuple[Entry, Future[Trajectory] | None]:
    """Entry without its run, which has begun in the background if there is a controller."""
    sampling = design.controller.sampling if design.controller else None
    scheme = sampling.scheme if sampling else schemes[origin]
    differ = len(set(schemes.values())) > 1
    kind = "given" if given else origin
    label = f"{design.title} ({kind}, {scheme})" if differ else f"{design.title} ({kind})"
    entry = Entry(label=label, origin=origin, design=design, run=None, given=given)
    if design.controller is None:
        return entry, None
    options: dict[str, Any] = {"scheme": scheme, "measurement": design.measurement, "plant": plant}
    return entry, runs.submit(simulate, design.fault, design.controller, **options)


def _ended(entry: Entry, run: Trajectory, progress: Progress) -> Entry:
    """Entry with its run, and the results that depend on the run."""
    law = entry.design.controller
    assert law is not None
    entry = replace(entry, run=run)
    if law.lipschitz_limit is not None:
        return _sliding_mode(entry, law, float(law.lipschitz_limit), run, progress)
    return entry if law.sampling else _linear(entry, run, progress)


def _linear(entry: Entry, run: Trajectory, progress: Progress) -> Entry:
    """Entry of a linear law in continuous time, with its stability under zero-order hold and its peaks."""
    design = entry.design
    growth, sampled = None, design.sampled_stability()
    if sampled is not None and run.provenance["scheme"] == AS_IN_THE_PAPER:
        poles = vertex_poles(sectors(design.fault), list(design.gains.values()))
        growth = amplification(poles, run.provenance["step"], run.provenance["method"])
    progress(f"{entry.label}: zero-order hold and peaks", 0.0)
    named_classes = CLASSES if entry.origin == "designed" and design.verdict is Verdict.PROVED else ()
    classes = [kind for kind in named_classes if kind != "rate" or not design.fault.disturbance.constant]
    peaks = {kind: design.certified_peaks(kind) for kind in classes}
    proved = {kind: peak for kind, peak in peaks.items() if peak.available}
    return replace(entry, growth_per_step=growth, zero_order_hold=sampled, peaks=proved)


def _sliding_mode(entry: Entry, law: Controller, limit: float, run: Trajectory, progress: Progress) -> Entry:
    """Entry of a sliding mode, with |h'| of its run; in continuous time also largest T_s and feed-forward variants."""
    design, certified = entry.design, certified_bound(entry.design)
    bound = limit if certified is None else float(certified * (law.scale or 1))
    premise = on_trajectory(bound, run)
    if certified is None or premise is None:
        return entry
    assessed, step = design.with_premise(premise), None
    if entry.origin != "designed" or law.sampling is not None:
        return replace(entry, design=assessed)
    if run.provenance["scheme"] == AS_IN_THE_PAPER:
        progress(f"{entry.label}: largest sampling time", 0.0)
        step = largest_sampling_time(design.fault, law, bound)
    progress(f"{entry.label}: feed-forward", 0.0)
    return replace(entry, design=assessed, largest_step=step, variants=design.feedforward_variants())


# ----------------------------------------------------------------------
# Equilibrium pressure of a task, and whether a run reached it.

_MARGIN = 0.01
"""Tolerance relative to the equilibrium range: smaller differences from zero, or from the range, are ignored."""


def needed_pressure(fault: Fault, slip: float | None = None) -> Enclosure | None:
    """Pressure [Pa] that holds the nominal fault at rest at references up to a slip [m], the target unless given.

    None for friction with a state, and where no finite range is found.
    """
    try:
        fault.require_memoryless("a pressure at rest")
        return Enclosure.of(
            *equilibrium_pressure(fault, rational(fault.reference.target_slip if slip is None else slip))
        )
    except ParameterError:
        return None


def ways(needed: Enclosure) -> tuple[str, ...]:
    """Fluid operations of a range of pressures: ``withdrawal`` below zero, ``injection`` above."""
    margin = _margin(needed)
    needs = {"withdrawal": needed.low < -margin, "injection": needed.high > margin}
    return tuple(operation for operation, is_needed in needs.items() if is_needed)


def need_sentence(needed: Enclosure) -> str:
    """Range of the equilibrium pressure of a task, and its fluid operations."""
    operations = f"the task needs {' and '.join(ways(needed))} of fluid" if ways(needed) else "the task needs no fluid"
    ends = f"{needed.low.quantity('Pa')} to {needed.high.quantity('Pa')}"
    return f"equilibrium pressure along the reference: {ends} (p < 0 is withdrawal): {operations}"


def pressure_extremes(run: "Trajectory") -> tuple[float, float] | None:
    """Least and largest pressure [Pa] of a run; None without a controller, and for one that diverged."""
    least, largest = run.metrics.min_pressure, run.metrics.max_pressure
    return None if least is None or largest is None else (least, largest)


def shortfall(run: "Trajectory", fault: Fault) -> str | None:
    """Sentence on an equilibrium pressure that a run never reached; None for a run that tracked."""
    extremes = pressure_extremes(run)
    if run.reference is None or extremes is None or run.outcome.kind == "tracked":
        return None
    needed = needed_pressure(fault, float(run.reference.max()))
    if needed is None:
        return None
    (least, largest), margin = extremes, _margin(needed)
    if least > needed.low + margin:
        end, lack = needed.low.quantity("Pa"), f"never falls below {_mega(least)}" if least < 0 else "never withdraws"
    elif largest < needed.high - margin:
        end, lack = (needed.high.quantity("Pa"), "never injects" if largest <= 0 else f"never exceeds {_mega(largest)}")
    else:
        return None
    return f"falls short of its task: the reference needs {end} at equilibrium, and this run {lack}"


def _mega(pressure: float) -> str:
    return f"{pressure / 1e6:.3g} MPa"


def _margin(needed: Enclosure) -> float:
    return _MARGIN * float(needed.high - needed.low)
