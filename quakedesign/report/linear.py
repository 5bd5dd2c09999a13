"""What is said about an e-LQR: certified margins, sampling and peaks, in lines for people."""

from collections.abc import Mapping
from typing import Any

from quakedesign.rationals import rational
from quakedesign.synthesis.linear.analysis.verdict import LinearVerdict
from quakedesign.synthesis.linear.certified_peaks import CertifiedPeaks


def held_sentence(held: Mapping[str, Any]) -> str:
    """Whether the loop is stable when p is held over every step, and up to which step it is."""
    step, longest = held["step"], held["largest_step"]
    end = f"every T_s up to {longest:.3g} s is proved" if longest else "no T_s is proved"
    if held["verdict"] == "refuted":
        at = "β = {:.4g}, s = {:.4g} 1/s^2, w = {:.4g} 1/s".format(*held["witness"])
        return f"UNSTABLE if p is held over T_s = {step:.4g} s (at {at}); {end}"
    if held["verdict"] == "undecided":
        return f"undecided if p is held over T_s = {step:.4g} s; {end}"
    course = "any course of the parameters" if held["varying"] == "proved" else "constant parameters"
    if held["summed"] != "proved":
        state = {"refuted": "UNSTABLE", "undecided": "undecided"}[held["summed"]]
        course += f", but {state} with integrals summed from the samples"
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
        lines.append(f"  beta down to {low:.4g} (unstable from {end:.4g} on) or up to {high:.4g} is certified")
    optimal = {True: "yes", False: "no", None: "undecided"}[facts["inverse_optimal"]]
    tests = facts["tests"]
    lines.append(
        f"  optimal for a Q that covers the uncertainty: {optimal} (the printed test: {tests['printed']['verdict']})"
    )
    lines.append(f"  {held_sentence(facts['held'])}")
    if judged.asked is not None:
        lines.append(f"  {peaks_sentence({judged.asked: judged.peaks})}")
    return lines
