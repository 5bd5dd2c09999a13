"""What a fault is, in numbers and in sentences."""

from fractions import Fraction
from math import isfinite
from typing import Any

from quakedesign.bounds import LowerBound, UpperBound
from quakedesign.certificates.guarantee import task_of
from quakedesign.certificates.impossibility import longest_reaction
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.fault import Fault, fault_toml
from quakedesign.fault.defaults import AGEINGS, beyond_rates, mean_rate, sliding_step
from quakedesign.rationals import rational
from quakedesign.studies.needed_pressure import need_sentence, needed_pressure, ways
from quakedesign.symbolic import derive
from quakedesign.synthesis.analysis.sampling_adequacy import LARGEST_PRODUCT, SamplingAdequacy, sampling_adequacy
from quakedesign.text import lasting

SHEAR_SPEEDS = 500.0, 6000.0  # of soft sediments and of the mantle, m/s
IN_A_LABORATORY = 10.0  # m; below it what slides need not be rock


def fault_dict(fault: Fault) -> dict[str, Any]:
    """Keys of the command ``fault`` in DESIGN.md; SI, eigenvalues as [real, imaginary] in 1/s.

    ``equilibrium_pressure`` is the range [Pa] that the task needs, and ``needs`` says whether that is withdrawal,
    injection or both. ``assumed`` says what the file left open, ``scenario`` is all of it as a TOML file.
    """
    model, needed = derive(fault), needed_pressure(fault)
    return {
        "name": fault.name,
        "source": fault.source,
        "assumed": list(fault.assumed),
        "natural_frequency": fault.natural_frequency,
        "damping_ratio": fault.damping_ratio,
        "seismic_moment": _known(fault.seismic_moment) or None,
        "magnitude": _known(fault.magnitude),
        "rest_slip": _known(fault.rest_slip),
        "unstable": model.unstable,
        "reasons": list(model.reasons),
        "eigenvalues": [[z.real, z.imag] for z in model.eigenvalues],
        "mass": fault.mass,
        "area": fault.area,
        "stiffness": fault.stiffness,
        "authority": fault.authority,
        "specific_stiffness": fault.specific_stiffness,
        "specific_damping": fault.specific_damping,
        "uncertainty_box": fault.box.name,
        "sampling": sampling_adequacy(fault).to_dict(),
        "equilibrium_pressure": [float(needed.low), float(needed.high)] if needed else None,
        "needs": list(ways(needed)) if needed else None,
        "scenario": fault_toml(fault),
    }


def fault_sentences(fault: Fault) -> list[str]:
    """The same for people."""
    model = derive(fault)
    poles = ", ".join(f"{z.real:.4g}{z.imag:+.4g}i" if z.imag else f"{z.real:.4g}" for z in model.eigenvalues)
    mean = mean_rate(fault.reference)
    state = "unstable: " + "; ".join(model.reasons) if model.unstable else "stable without control"
    return [
        f"mass {fault.mass:.4g} kg, stiffness {fault.stiffness:.4g} N/m, natural frequency "
        f"{fault.natural_frequency:.4g} rad/s, damping ratio {fault.damping_ratio:.4g}",
        *_rock(fault),
        *_event(fault),
        *(f"assumed: {said}" for said in fault.assumed),
        f"{state}; eigenvalues {poles} 1/s{_about(fault, fault.friction.operating_rate, '')}",
        f"{sampling_sentence(sampling_adequacy(fault))}{_about(fault, mean, '; the pole is that')}",
        *_sliding_sentence(fault),
        *beyond_control(fault),
        *([need_sentence(needed)] if (needed := needed_pressure(fault)) else []),
    ]


def _about(fault: Fault, rate: float, before: str) -> str:
    """About which steady sliding poles are; nothing for friction without a state, whose fault rests."""
    return f"{before} about steady sliding at {rate:.4g} m/s" if fault.friction.state_names else ""


def beyond_rest(fault: Fault) -> str:
    """What a target means that is more than one percent beyond the next rest slip; empty for others."""
    if not 0 < 1.01 * fault.rest_slip < fault.reference.target_slip:
        return ""
    return f", {fault.reference.target_slip / fault.rest_slip:.3g} times the rest slip: pressure has to hold it there"


def sampling_sentence(adequacy: SamplingAdequacy) -> str:
    """Whether T_s is short enough for the instability, and which one would be."""
    if adequacy.adequate_step is None:
        return f"T_s = {adequacy.step:.4g} s: nothing grows between two samples"
    pole = f"at most {UpperBound(adequacy.pole):.4g}" if adequacy.over_box else f"{adequacy.pole:.4g}"
    where = "over the uncertainty box" if adequacy.over_box else "of the nominal fault"
    longest = LowerBound(Fraction(adequacy.adequate_step)).quantity("s")
    judged = "is adequate" if adequacy.adequate else "is LONGER than a rule of thumb for the instability allows"
    return (
        f"T_s = {adequacy.step:.4g} s {judged}: times the unstable pole, {pole} 1/s {where}, it is "
        f"{adequacy.pole_times_step:.3g}; up to {LARGEST_PRODUCT:g}, T_s = {longest}, is adequate"
        f"{'' if adequacy.adequate else '; guarantee says whether something is proved at this T_s all the same'}"
    )


def _sliding_sentence(fault: Fault) -> list[str]:
    """That friction is extrapolated, and which T_s suits a guarantee of slow sliding, where it is a factor two off."""
    if not fault.friction.state_names:
        return []
    beyond = list(filter(None, [beyond_rates(fault.friction, mean_rate(fault.reference))]))
    suits = sliding_step(fault.friction, fault.reference)
    if suits / 2 <= fault.sampling_time <= 2 * suits:
        return beyond
    return [*beyond, f"a guarantee of slow sliding wants sampling_time near D_c/({AGEINGS:g} V), here {suits:g} s"]


def beyond_control(fault: Fault) -> list[str]:
    """That no controller can hold a fault at its T_s, where that is proved."""
    try:
        task = task_of(fault)
        longest = longest_reaction(task, task.normal_stress)
    except (ParameterError, UnsupportedError):  # friction with a state, or that nothing can be proved with
        return []
    if longest is None or rational(fault.sampling_time) <= longest:
        return []
    return [
        f"NO CONTROLLER can hold this fault at T_s = {fault.sampling_time:.4g} s for all friction of its box and a "
        f"disturbance as large as its own: beyond {longest.quantity('s')} none can, even if it withdraws all of the "
        "effective normal stress"
    ]


def _known(value: float) -> float | None:
    """A number, if there is one."""
    return value if isfinite(value) else None


def _rock(fault: Fault) -> list[str]:
    """Speed of shear waves, by which a wrong unit shows, the stress, friction as it was read, and its box."""
    speed, law = (fault.shear_modulus / fault.density) ** 0.5, fault.friction
    usual = fault.length < IN_A_LABORATORY or SHEAR_SPEEDS[0] <= speed <= SHEAR_SPEEDS[1]
    unlikely = "" if usual else " (UNLIKELY for rock: check density and shear modulus)"
    stress = LowerBound(rational(fault.effective_normal_stress)).quantity("Pa")
    numbers = ", ".join(
        f"{name} {getattr(law, name):.4g} {told.metadata['unit']}".strip() for name, told in law.quantities().items()
    )
    rock = f"shear waves {speed:.4g} m/s{unlikely}, effective normal stress {stress}"
    return [f"{rock}, friction {law.name}: {numbers}", *([] if law.state_names else [_box(fault)])]


def _box(fault: Fault) -> str:
    """What a guarantee takes for possible of friction without a state."""
    (low, high), law = fault.friction.bounds, fault.friction
    slopes = [f"{law.slip_slope:.4g} per m of slip"] * (law.slip_slope > 0)
    slopes += [f"{law.rate_slope:.4g} per m/s"] * (law.rate_slope > 0)
    return (
        f"guarantees are for every friction from {low:.4g} to {high:.4g} that changes by at most {', '.join(slopes)} "
        f"(box {fault.box.name})"
    )


def _event(fault: Fault) -> list[str]:
    """What an earthquake of the fault is, as far as it is known without simulating one, and the task."""
    task = f"target slip {fault.reference.target_slip:.4g} m in {lasting(fault.reference.operation_time, 6)}"
    if fault.friction.state_names:
        depends = "stress drop, magnitude and slip of an event depend on its history"
        return [f"{depends}: simulate a cycle (simulate --start late)", task]
    moment = f"seismic moment {fault.seismic_moment:.4g} N·m, magnitude {fault.magnitude:.2f}"
    return [
        moment if fault.seismic_moment > 0 else "no earthquake, so no seismic moment and no magnitude",
        f"next rest slip {fault.rest_slip:.4g} m, {task}{beyond_rest(fault)}",
    ]
