"""Peaks of the idealised loop whose pressure acts at once: the theorem of the loop that runs, in continuous time."""

from dataclasses import dataclass
from typing import Any

from quakedesign.certificates.claim import Verdict
from quakedesign.certificates.guarantee.claims import Claims
from quakedesign.certificates.guarantee.small_gain import Bounds, NoGuarantee, certified_bounds
from quakedesign.certificates.guarantee.statement import sentence_of
from quakedesign.certificates.guarantee.task import Task
from quakedesign.errors import ParameterError
from quakedesign.loop import ContinuousLaw, PeriodicLoop, continuous_loop

WHEN = "for a pressure that acts at once (continuous time)"
PREMISES = (
    "start at rest: x = 0, integrals 0; for the class rate a disturbance that starts at 0",
    "friction: any function of slip and slip rate within the bounds and chord slopes of the box",
    "k, eta, N anywhere in the box but constant",
    "pressure acts at once; limits of the law, if any, lie outside the certified range of p",
    "friction opposes forward motion: the printed plant is continued to negative slip rates (ERRATA 14)",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ContinuousPeaks:
    """Claims about a law in continuous time, which no computer runs; `check` decides them.

    Attributes
    ----------
    task : Task
    law : ContinuousLaw
    claims : Claims
    """

    task: Task
    law: ContinuousLaw
    claims: Claims

    @property
    def loop(self) -> PeriodicLoop:
        """Nominal error loop."""
        return _loop(self.task, self.law)

    def bounds(self) -> Bounds | NoGuarantee:
        """What the theorem gives, computed anew."""
        return _bounds(self.task, self.law)

    def check(self) -> Verdict:
        """PROVED if the theorem gives the claims, in ball arithmetic; else UNDECIDED."""
        bounds = self.bounds()
        return self.claims.verdict(self.task, bounds) if isinstance(bounds, Bounds) else Verdict.UNDECIDED

    def to_dict(self) -> dict[str, Any]:
        """Exact claims as texts, SI, and what they rest on."""
        kind = "amplitude" if self.task.change is None else "rate"
        return {"disturbance_class": kind, **self.claims.to_dict(), "premises": list(PREMISES)}

    def sentence(self) -> str:
        """What is proved, for people."""
        return sentence_of(self.task, self.claims, WHEN)


def continuous_peaks(task: Task, law: ContinuousLaw) -> ContinuousPeaks | NoGuarantee:
    """Tightest rounded claims about a law in continuous time, or why there are none.

    Raises
    ------
    ParameterError
        For a law that leaves an error under a constant pressure at rest.
    """
    bounds = _bounds(task, law)
    if isinstance(bounds, NoGuarantee):
        return bounds
    claims = Claims.of(task, bounds).rounded()
    if reason := claims.opens(task):
        return NoGuarantee(reason=reason, small_gain=None)
    return ContinuousPeaks(task=task, law=law, claims=claims)


def _loop(task: Task, law: ContinuousLaw) -> PeriodicLoop:
    """Nominal error loop, of a law that fits the reference."""
    loop = continuous_loop(law, task.model, task.authority)
    if any(law.of_reference):
        task.require_smooth_reference()
    return loop


def _bounds(task: Task, law: ContinuousLaw) -> Bounds | NoGuarantee:
    loop = _loop(task, law)
    try:
        return certified_bounds(task, loop)
    except ParameterError:
        reason = f"{WHEN} even the nominal loop is not stable, or too slow to be seen so"
        return NoGuarantee(reason=reason, small_gain=None)
