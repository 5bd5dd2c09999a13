"""The verdict on a given K over a whole box, with every certified margin beside its limit."""

from dataclasses import dataclass
from typing import Any

from quakedesign.bounds import LowerBound
from quakedesign.certificates import Certificate, Verdict
from quakedesign.certificates.sectors import sectors
from quakedesign.controllers import Controller
from quakedesign.fault import Fault
from quakedesign.synthesis.linear.analysis.common_quadratic import finished_exactly, sector_loop
from quakedesign.synthesis.linear.analysis.frequency import FrequencyFacts, frequency_facts
from quakedesign.synthesis.linear.analysis.inverse_optimality import inverse_optimality
from quakedesign.synthesis.linear.analysis.margins import (
    DecayRate,
    GainRange,
    SlopeMargin,
    decay_rate,
    friction_slope_margin,
    gain_range,
)
from quakedesign.synthesis.linear.plant.polytope import polytope_of
from quakedesign.synthesis.linear.plant.problem import FeedbackLoop, LinearProblem, Vertex


@dataclass(frozen=True, slots=True, kw_only=True)
class Analysis:
    """What is proved of a K about any constant reference, and how much more than the box it tolerates.

    Attributes
    ----------
    decay : DecayRate or None
        None when no V was found for the whole box.
    unstable_at : (Fraction, Fraction, Fraction) or None
        β, s [1/s²] and w [1/s] of a vertex at which the loop is not asymptotically stable (Routh–Hurwitz, exact).
    slope : SlopeMargin or None
    span : GainRange or None
    frequency : tuple of FrequencyFacts
        Measured, one for every vertex.
    """

    decay: DecayRate | None
    unstable_at: Vertex | None
    slope: SlopeMargin | None
    span: GainRange | None
    frequency: tuple[FrequencyFacts, ...]

    @property
    def verdict(self) -> Verdict:
        """PROVED with a V for the whole box, REFUTED by a vertex, else UNDECIDED."""
        if self.decay is not None:
            return Verdict.PROVED
        return Verdict.UNDECIDED if self.unstable_at is None else Verdict.REFUTED

    @property
    def certificates(self) -> dict[str, Certificate]:
        """What was proved, by name: ``stability``, ``friction-slope``, ``low-beta`` and ``high-beta``."""
        by_name: dict[str, Certificate | None] = {"stability": self.decay.certificate if self.decay else None}
        by_name["friction-slope"] = self.slope.certificate if self.slope else None
        if self.span is not None:
            by_name["low-beta"], by_name["high-beta"] = self.span.certificates
        return {name: certificate for name, certificate in by_name.items() if certificate is not None}

    def to_dict(self) -> dict[str, Any]:
        """Exact numbers as texts, measured ones as numbers, SI."""
        return {
            "verdict": str(self.verdict),
            "unstable_at": [float(v) for v in self.unstable_at] if self.unstable_at else None,
            "decay_rate": self.decay.certified.exact if self.decay else None,
            "decay_limit": self.decay.limit if self.decay else None,
            **(self.slope.to_dict() if self.slope else {"friction_slope_margin": None}),
            **(self.span.to_dict() if self.span else {}),
            "frequency": [{name: getattr(f, name) for name in f.__slots__} for f in self.frequency],
        }


def analysis(fault: Fault, controller: Controller) -> Analysis:
    """Judge a given K on a fault, over its uncertainty box.

    Parameters
    ----------
    fault : Fault
    controller : Controller
        e-LQR.
    """
    needed = sectors(fault)
    loop = FeedbackLoop(gains=tuple(controller.gains.values()), sectors=needed)
    return Analysis(
        decay=decay_rate(sector_loop(controller, needed)) or _decay_of_optimal_gains(fault, controller),
        unstable_at=loop.unstable_vertex(),
        slope=friction_slope_margin(fault, controller),
        span=gain_range(fault, controller),
        frequency=tuple(frequency_facts(loop, corner) for corner in needed.vertices()),
    )


def _decay_of_optimal_gains(fault: Fault, controller: Controller) -> DecayRate | None:
    """What the Riccati equation that K solves proves, where it covers the uncertainty; None where it does not."""
    optimality = inverse_optimality(LinearProblem.of(fault), tuple(controller.gains.values()))
    if optimality.P is None:
        return None
    loop = sector_loop(controller, sectors(fault))
    certificate = finished_exactly(loop, optimality.scales.form_outside(optimality.P))
    if certificate is None:
        return None
    return DecayRate(
        certified=LowerBound(certificate.claims["rate"]), limit=-polytope_of(loop).slowest(), certificate=certificate
    )


def why_undecided(loop: FeedbackLoop) -> str:
    """What is known about gains for which no V was found: an unstable vertex, or nothing."""
    vertex = loop.unstable_vertex()
    if vertex is None:
        return (
            "every constant vertex of the box is stable, but no common quadratic V was found for parameters that vary; "
            "a narrower box or more bandwidth may help"
        )
    beta, s, w = map(float, vertex)
    return (
        f"the loop is not stable near beta = {beta:.4g}, s = {s:.4g} 1/s^2, w = {w:.4g} 1/s of the box, so no V "
        "exists; a narrower box or a shorter sampling time (more bandwidth) may help"
    )
