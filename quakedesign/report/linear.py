"""What is said about an e-LQR: certified margins, sampling and peaks, in lines for people."""

from collections.abc import Mapping
from typing import Any

from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.synthesis.linear.certified_peaks import CertifiedPeaks
from quakedesign.synthesis.linear.hold_lyapunov import varying_verdict
from quakedesign.synthesis.linear.problem import LinearProblem
from quakedesign.synthesis.linear.sampled import hold_verdict, largest_step
from quakedesign.synthesis.linear.verdict import LinearVerdict


def held_facts(fault: Fault, gains: Mapping[str, Any]) -> dict[str, Any]:
    """What is decided of a K when p is held over the fault's sampling time; SI.

    Returns
    -------
    dict
        ``step``; ``verdict`` for constant parameters anywhere in the box, ``varying`` for any course of them; the
        spectral ``radius`` of a period (largest vertex, measured); ``witness`` (β, s, w) of a refutation;
        ``largest_step`` up to which every period is proved for constant parameters, None when the loop is unstable.
    """
    problem, values = LinearProblem.of(fault), tuple(rational(v) for v in gains.values())
    period = rational(fault.sampling_time)
    held, longest = hold_verdict(problem, values, period), largest_step(problem, values)
    return {
        "step": float(period),
        "verdict": str(held.verdict),
        "varying": str(varying_verdict(problem, values, period).verdict),
        "radius": held.radius,
        "witness": [float(v) for v in held.witness] if held.witness else None,
        "largest_step": float(longest.proved) if longest else None,
    }


def held_sentence(held: Mapping[str, Any]) -> str:
    """Whether the loop is stable when p is held over every step, and up to which step it is."""
    step, longest = held["step"], held["largest_step"]
    end = f"every T_s up to {longest:.3g} s is proved" if longest else "no T_s is proved"
    if held["verdict"] == "refuted":
        beta = held["witness"][0]
        return f"UNSTABLE if p is held over T_s = {step:.4g} s (radius {held['radius']:.3g}, at β = {beta:.4g}); {end}"
    if held["verdict"] == "undecided":
        return f"undecided if p is held over T_s = {step:.4g} s; {end}"
    course = "any course of the parameters" if held["varying"] == "proved" else "constant parameters"
    return f"stable if p is held over T_s = {step:.4g} s, proved for {course}; {end}"


def peaks_sentence(peaks: Mapping[str, CertifiedPeaks | None]) -> str:
    """How fast the fault can slip at most, for every class of disturbances that was asked for."""
    said = [
        f"{float(found.peak_slip_rate):.3g} m/s (slip error {float(found.total('slip_error')):.3g} m) for "
        + {"amplitude": "any disturbance of its amplitude", "rate": "one of its amplitude and rate"}[name]
        for name, found in peaks.items()
        if found is not None
    ]
    if not said:
        return "no bound on the slip rate is certified"
    return "certified from rest, p acting at once: slip rate below " + ", ".join(said)


def verdict_lines(judged: LinearVerdict) -> list[str]:
    """Lines about a given K."""
    facts, fault = judged.to_dict(), judged.fault
    gains = " ".join(f"{float(k):.6g}" for k in judged.controller.gains.values())
    lines = [f"{facts['verdict']}: elqr {gains} on {fault.name}, box {fault.box.name}"]
    if facts["unstable_at"]:
        lines.append("  not stable at beta = {:.4g}, s = {:.4g} 1/s^2, w = {:.4g} 1/s".format(*facts["unstable_at"]))
    if facts["decay_rate"]:
        decay = float(rational(facts["decay_rate"]))
        lines.append(f"  decay rate {decay:.4g} 1/s certified; no vertex is faster than {facts['decay_limit']:.4g} 1/s")
    if facts["friction_slope_margin"]:
        margin, limit = (float(rational(facts[name])) for name in ("friction_slope_margin", "linear_limit"))
        lines.append(f"  friction-slope margin {margin:.5g} certified; unstable from {limit:.5g} on")
    if "beta_low" in facts:
        low, high, end = (float(rational(facts[name])) for name in ("beta_low", "beta_high", "beta_low_limit"))
        lines.append(
            f"  beta from {low:.4g} (unstable below {end:.4g}) or up to {high:.4g}, the other end as in the box"
        )
    optimal = {True: "yes", False: "no", None: "undecided"}[facts["inverse_optimal"]]
    tests = facts["tests"]
    lines.append(
        f"  optimal for a Q that covers the uncertainty: {optimal} (the printed test: {tests['printed']['verdict']})"
    )
    held = facts["sampling"]
    named = held["constant"] | {"step": float(judged.step), "varying": held["varying"]}
    lines.append(f"  {held_sentence(named | {'largest_step': held['largest_step']})}")
    if judged.peaks is not None:
        lines.append(f"  {peaks_sentence({judged.peaks.disturbance_class: judged.peaks})}")
    return lines
