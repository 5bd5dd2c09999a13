"""How far a proof reaches: to the loop that ran and its task, or to which premise, and how far that fails."""

from typing import TYPE_CHECKING

from quakedesign.bounds import UpperBound
from quakedesign.certificates import Verdict
from quakedesign.certificates.premise import Premise
from quakedesign.rationals import rational

if TYPE_CHECKING:
    from quakedesign.certificates.guarantee import Guarantee
    from quakedesign.certificates.slow_sliding import SlidingGuarantee
    from quakedesign.studies.comparison import Entry

BOUNDED_BY_PEAKS = frozenset({"constant_reference", "vanishing_disturbance"})
"""Premises of a linear law's stability that its certified peaks do without."""
GRADES = (
    "guaranteed: the slip rate that the loop as it ran never exceeds, and how far its slip stays from the reference; "
    "proved for this loop and task: every premise holds in the run that is shown; proved, but …: what the proof does "
    "not cover, and how many times over"
)


def grade(entry: "Entry") -> str:
    """Verdict on one controller, and what of its loop and task the proof leaves out."""
    if entry.guaranteed is not None:
        other = f"{entry.design.other_step_first}; " if entry.design.other_step else ""
        return f"{other}{_guaranteed(entry.guaranteed)}{_unmet(entry)}"
    if entry.design.verdict is not Verdict.PROVED:
        return str(entry.design.verdict)
    missing = [_failing(p) for p in entry.design.premises if not (p.holds or _bounded(entry, p))] + _held(entry)
    reach = f"proved, but {'; '.join(missing)}" if missing else "proved for this loop and task"
    return f"{reach}; UNSTABLE if p is held over T_s" if _unstable_if_held(entry) else reach


def _guaranteed(found: "Guarantee | SlidingGuarantee") -> str:
    return f"guaranteed: slip rate <= {found.peak_slip_rate:.3g} m/s, slip error <= {found.claims.slip_error:.3g} m"


def _unmet(entry: "Entry") -> str:
    own = ("sampling_time",) * bool(entry.design.other_step)
    failing = [_failing(p) for p in entry.design.conditions if not p.holds and p.name not in own]
    return f", but {'; '.join(failing)}" if failing else ""


def _unstable_if_held(entry: "Entry") -> bool:
    """Whether a run with p acting at once hides what a sampled controller would do."""
    if entry.run is None or entry.held is None:
        return False
    return entry.run.provenance["scheme"] == "continuous" and entry.held.runs.verdict is Verdict.REFUTED


def _bounded(entry: "Entry", premise: Premise) -> bool:
    return bool(entry.peaks) and premise.name in BOUNDED_BY_PEAKS


def _failing(premise: Premise) -> str:
    if premise.ratio is None or not premise.proved:
        return f"{premise.name} fails (nothing is certified)"
    return f"{premise.name} fails {premise.ratio:.3g}-fold"


def _held(entry: "Entry") -> list[str]:
    """What the way in which the run carries out the law takes from the proof."""
    if entry.run is None:
        return []
    scheme, step = entry.run.provenance["scheme"], entry.run.provenance["step"]
    if scheme == "continuous":
        unstable = entry.growth_per_step is not None and entry.growth_per_step >= 1
        return ["UNSTABLE at the step used"] if unstable else []
    if entry.held is None or scheme != "explicit":
        return [f"p is held ({scheme}), which is not covered"]
    if entry.held.runs.verdict is Verdict.REFUTED:
        return ["UNSTABLE with p held"]
    used, longest = rational(step), entry.held.largest_step
    if longest is None:
        return ["p is held, and no T_s is proved"]
    proved = used <= longest or (used == entry.held.step and entry.held.runs.verdict is Verdict.PROVED)
    if not proved:
        return [f"T_s is {UpperBound(used / longest):.3g} times the largest proved"]
    return ["p is held: stability proved, errors without a bound"]
