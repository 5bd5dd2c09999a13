"""What is said about an e-LQR: certified margins, sampling and peaks, in lines for people."""

from collections.abc import Mapping, Sequence
from fractions import Fraction

from quakedesign.certificates import Verdict
from quakedesign.certificates.guarantee import ContinuousPeaks, NoGuarantee
from quakedesign.synthesis.linear.analysis.robust_stability import Analysis
from quakedesign.synthesis.linear.analysis.verdict import LinearVerdict
from quakedesign.synthesis.linear.sampled.held import HeldLoop


def held_sentences(held: HeldLoop) -> list[str]:
    """Whether the law that runs is stable when p is held over every step, and up to which step it is."""
    over = f"if p is held over T_s = {float(held.step):.12g} s"
    if held.runs.verdict is Verdict.REFUTED and held.runs.witness is not None:
        return [f"UNSTABLE {over} ({_near(held.runs.witness)})", _proved_up_to(held)]
    if held.runs.verdict is Verdict.UNDECIDED:
        return [f"undecided {over}", _proved_up_to(held)]
    course = "any course of the parameters, integrals summed over the samples"
    return [f"stable {over}, proved for {course}", _proved_up_to(held)]


def _proved_up_to(held: HeldLoop) -> str:
    if held.largest_step is None:
        return "no T_s is proved"
    said = f"every T_s up to {held.largest_step:.4g} s is proved"
    return said if held.refuted_step is None else f"{said}, {held.refuted_step:.15g} s is refuted, open in between"


def peaks_sentence(peaks: Mapping[str, ContinuousPeaks | NoGuarantee]) -> str:
    """How fast the fault can slip at most in continuous time, for every class of disturbances that was asked for."""
    said = [
        f"{proved.claims.peak_slip_rate:.3g} m/s (slip error {proved.claims.slip_error:.3g} m) for "
        + {"amplitude": "any disturbance of its amplitude", "rate": "one of its amplitude and rate"}[name]
        for name, proved in peaks.items()
        if isinstance(proved, ContinuousPeaks)
    ]
    if not said:
        reasons = {proved.reason for proved in peaks.values() if isinstance(proved, NoGuarantee)}
        return "; ".join(["no bound on the slip rate is certified", *sorted(reasons)])
    return "certified from rest, p acting at once: slip rate below " + ", ".join(said)


def verdict_lines(judged: LinearVerdict) -> list[str]:
    """Lines about a given K."""
    fault, tests = judged.fault, judged.facts["tests"]
    gains = " ".join(f"{float(k):.6g}" for k in judged.controller.gains.values())
    optimal = {True: "yes", False: "no", None: "undecided"}[judged.facts["inverse_optimal"]]
    lines = [
        f'{judged.analysis.verdict}: elqr {gains} on "{fault.name}", box {fault.box.name}',
        *(f"  {line}" for line in margin_lines(judged.analysis)),
        f"  optimal for a Q that covers the uncertainty: {optimal} (the printed test: {tests['printed']['verdict']})",
        f"  {'; '.join(held_sentences(judged.held))}",
    ]
    if judged.asked is None or judged.peaks is None:
        return lines
    return [*lines, f"  {peaks_sentence({judged.asked: judged.peaks})}"]


def margin_lines(analysis: Analysis) -> list[str]:
    """Decay rate and margins, each beside its limit; or a vertex that is not stable."""
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
        end = f"unstable from {span.low_limit:.4g} on"
        lines.append(f"beta down to {span.low:.4g} ({end}) or up to {span.high:.4g} is certified")
    return lines


def _near(vertex: Sequence[Fraction]) -> str:
    """A corner of the box, nearly: its exact numbers are in the JSON facts."""
    return "near β = {:.4g}, s = {:.4g} 1/s^2, w = {:.4g} 1/s".format(*map(float, vertex))
