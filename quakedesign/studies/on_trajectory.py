"""The premise that a run itself decides: |h'| along it against what is certified."""

from dataclasses import replace
from fractions import Fraction

from quakedesign.certificates import Verdict
from quakedesign.certificates.premises import Premise, certified_lipschitz
from quakedesign.controllers import Controller
from quakedesign.simulation import Trajectory
from quakedesign.synthesis import Design
from quakedesign.synthesis.analysis.lipschitz_on_run import on_trajectory


def certified_bound(design: Design | None) -> Fraction | None:
    """Bound on |h'| for λ = 1 [m/s³] that a design is proved with; None for a linear law, and without a proof."""
    law = design.controller if design else None
    if design is None or design.certificate is None or law is None or law.lipschitz_limit is None:
        return None
    return certified_lipschitz(design.certificate) if design.verdict is Verdict.PROVED else None


def trajectory_premise(law: Controller, lipschitz: float | None, run: Trajectory) -> Premise | None:
    """Largest |Δh/Δt| of a run against the certified bound; None for a run that diverged, or a law without a limit.

    Parameters
    ----------
    law : Controller
    lipschitz : float or None
        Certified bound on |h'| [m/s³]. None where there is no certificate: then nothing is certified, the premise does
        not hold whatever the run does, and its note names the limit that no certificate of these gains exceeds.
    run : Trajectory
    """
    if law.lipschitz_limit is None:
        return None
    limit = float(law.lipschitz_limit)
    premise = on_trajectory(limit if lipschitz is None else lipschitz, run)
    if premise is None or lipschitz is not None:
        return premise
    said = f"{premise.note}; no certificate is at hand, and none of these gains exceeds {limit:.4g} {premise.unit}"
    return replace(premise, certified=0.0, proved=False, note=said)
