"""Fault files whose friction and box cover every law that a record allows.

The plant is x″ = −N̂[μ(x)(σ′ − p) − μ(0)σ′] − k̂x − …, so multiplying μ by a number and dividing N̂ by it changes
nothing. Let a law of the record's box have the static friction s. On a fault with N̂ it is equivalent to the law times
s₀/s on a fault with N̂s/s₀. With s₀ between the smallest and the largest s, all laws of the box then have the single
static friction that a fault file needs, and the half-width of N̂ increases.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from itertools import product
from math import ceil, log
from pathlib import Path
from shlex import quote
from typing import Any

from quakedesign.errors import RecordError
from quakedesign.exact import rational
from quakedesign.fault import Disturbance, Fault, FrictionLaw, UncertaintyBox, friction_laws
from quakedesign.fault.equilibrium import STEADY_SLIDING
from quakedesign.fault.fault_toml import fault_toml, mean_rate, rate_out_of_range, sliding_step, step_assumed
from quakedesign.fault.friction.rate_and_state import RateAndState
from quakedesign.files import write_whole
from quakedesign.identification.assessment import EXPLAINS, EXPLAINS_NOT
from quakedesign.identification.identification_result import Identification
from quakedesign.text import quantity

_DIGITS = 6
_WIDEST_SPREAD = Fraction(1, 5)  # largest independent relative uncertainty of a, b, D_c with guarantees
_WEAKENING = {"residual", "drop", "critical_slip"}
_OF_TASK = ("target slip", "operation time")
_RATE_AND_STATE = ("direct_effect", "evolution_effect", "critical_slip")


def cover(
    law: FrictionLaw, ranges: Mapping[str, tuple[float, float]], box: UncertaintyBox
) -> tuple[FrictionLaw, UncertaintyBox]:
    """Slip-weakening law and box that cover every law with residual, drop and critical slip in given ranges.

    The bounds and the slope of the scaled laws are monotone in each of the three, so corners are enough; numbers are
    rounded conservatively. `law` gives the family, `box` the uncertainty of all other parameters.
    """
    ends = {name: [rational(end) for end in ranges[name]] for name in sorted(_WEAKENING)}
    corners = [dict(zip(ends, corner, strict=True)) for corner in product(*ends.values())]
    statics = [corner["residual"] + corner["drop"] for corner in corners]
    static = _decimal((min(statics) + max(statics)) / 2, up=True)
    scaled = [
        (c["residual"] * static / s, c["drop"] / c["critical_slip"] * static / s)
        for c, s in zip(corners, statics, strict=True)
    ]
    residual = _decimal(min(least for least, _ in scaled), up=False)
    drop = static - residual
    critical_slip = _decimal(drop / max(slope for _, slope in scaled), up=False)
    values = {"residual": residual, "drop": drop, "critical_slip": critical_slip}
    width = _decimal(max(abs(s / static - 1) for s in statics), up=True)
    authority = box.authority + width + box.authority * width
    middle = replace(law, **{name: float(value) for name, value in values.items()})  # type: ignore[type-var]
    return middle, replace(box, name="own", authority=authority)


def _decimal(value: Fraction, *, up: bool, digits: int = _DIGITS) -> Fraction:
    """Decimal of a few digits not below (`up`) or not above a rational."""
    context = Context(prec=digits, rounding=ROUND_CEILING if up else ROUND_FLOOR)
    return Fraction(context.divide(Decimal(value.numerator), Decimal(value.denominator)))


def identified_fault(identification: Identification, fault: Fault) -> Fault:
    """Fault whose friction is replaced by the friction identified from a record.

    For a slip-weakening law, friction and box together contain every law of the record's box, so that `guarantee` and
    `design` cover all of them. For a law with state, friction is the best fit. If the fault has a reference rate, which
    is its loading rate without control, friction is stated at this rate.

    Parameters
    ----------
    identification : Identification
        Identification of a record that determines every parameter.
    fault : Fault
        Source of everything except friction. If only the identified friction has a state, there is no disturbance, and
        T_s is chosen for slow sliding. If both have a state and T_s of the fault was assumed, T_s is chosen likewise.

    Returns
    -------
    Fault

    Raises
    ------
    RecordError
        When the record does not determine every parameter, or a fault file cannot express its friction.
    """
    text = ""
    if getattr(identification.law, "evolution_effect", 1.0) <= 0:
        text = "an evolution effect that is not positive: friction strengthens with rate and needs no control."
    if len(identification.law.state_names) > 1:
        text = "two states. Omit --states for a file."
    if text:
        raise RecordError(f"friction of a file must have one state with a positive evolution effect. Received {text}")
    if not identification.determined:
        named, unknown = identification.record.name, identification.undetermined()[0]
        raise RecordError(f"a fault file needs every parameter. Received {named}: {unknown}.")
    law, box = _at_rate_of(fault, identification.law), fault.box
    if covers(law):
        law, box = cover(law, identification.box, box)
    if _step_follows(identification, fault):
        shaken = Disturbance() if _gains_a_state(identification, fault) else fault.disturbance
        step = sliding_step(law, fault.reference)
        fault = replace(fault, friction=law, sampling_time=step, disturbance=shaken)
    record = re.sub(r"[^\w.-]+", "-", identification.record.name.partition(",")[0], flags=re.ASCII).strip("-.")
    name, poor = f"{fault.name[:40].rstrip()}-identified-{record}"[:60].rstrip("-."), poor_fit(identification)
    source = f"friction identified from {identification.record.name}; everything else: {fault.source}"
    return replace(fault, name=name, source=source, friction=law, box=box, assumed=(), poor_fit=poor)


def poor_fit(identification: Identification) -> str:
    """Reason why a design on this record must be accepted explicitly; empty if the fit explains the record."""
    assessment = identification.assessment
    if assessment.verdict == EXPLAINS_NOT:
        return f"the fit {assessment}"
    return "" if assessment.verdict == EXPLAINS else f"the record cannot tell: {assessment.open[0]}"


def other_parts(identification: Identification, fault: Fault) -> str:
    """Parts that a fault file of a record takes from a fault, in words."""
    shared = "normal stress, size, task"
    if _gains_a_state(identification, fault):
        return shared
    loaded = ", reference rate, working range" if "reference_rate" in identification.law.quantities() else ""
    sampling = "" if _step_follows(identification, fault) else ", T_s"
    return f"{shared}{sampling}, disturbance{loaded}"


def task_remarks(identification: Identification, fault: Fault) -> list[str]:
    """Remarks on the task that a fault file of a record takes from a fault: assumed values, and its rate."""
    law: Any = identification.law
    task, moved = fault.reference, _at_rate_of(fault, law)
    assumed = [remark for remark in fault.assumed if remark.startswith(_OF_TASK)]
    lines = [f"assumed for the friction that is replaced: {'; '.join(assumed)}; set [task] yourself"] if assumed else []
    if moved is not law and moved.reference_rate != law.reference_rate:
        old, new = (quantity(each.reference_rate, "m/s", 4) for each in (law, moved))
        text = f"mu0 = {law.reference_coefficient:.5g} at {old} was converted to {moved.reference_coefficient:.5g}"
        lines.append(f"{text} at {new} for the file")
    return [*lines, *filter(None, [rate_out_of_range(law, mean_rate(task), source="of the record")])]


def law_remarks(identification: Identification, fault: Fault) -> list[str]:
    """Remark if a record selects another law with state than that of the fault; none if its law was given."""
    named, law = fault.friction, identification.law
    if identification.rival is None or named.equilibrium is not law.equilibrium or named.name == law.name:
        return []
    why = "the record prefers" if named.name == identification.rival.law else "the record was fitted by"
    return [f"{fault.name} has {named.name}, but {why} {law.name}; --law {named.name} fits the law of the fault"]


def next_command(identification: Identification, path: str | Path | None) -> str:
    """Command that designs for a fault file of a record, and for all parameters that the record allows.

    Without a path, the text names the option that writes a file.
    """
    difference = identification.difference
    if identification.explained and difference is not None and difference.low > 0:
        return "none is needed: friction strengthens with rate, so that the fault creeps without control"
    if path is None:
        return "--out FILE writes a fault file for design and guarantee"
    if why := poor_fit(identification):
        return f"none: {why}. Design rejects the file without --accept-poor-fit"
    if not covers(identification.law) and (wide := _too_wide(identification)):
        return f"none that covers the record: {wide}. Without --spread, design covers the best fit alone"
    spread = "" if covers(identification.law) else f" --spread {_spread(identification)}"
    code = "" if type(identification.law) in friction_laws().values() else " --allow-code"
    return f"quakedesign design {quote(str(path))}{spread}{code}"


def _at_rate_of(fault: Fault, law: FrictionLaw) -> Any:
    """A law restated at the reference rate of a fault; its working range covers those of law and fault.

    Friction is unchanged, because μ_0 changes by (a − b)·ln of the ratio of reference rates.
    """
    own = fault.friction
    if not isinstance(law, RateAndState) or not isinstance(own, RateAndState):
        return law
    rate = own.reference_rate
    moved = (law.direct_effect - law.evolution_effect) * log(rate / law.reference_rate)
    return replace(
        law,
        reference_rate=rate,
        reference_coefficient=law.reference_coefficient + moved,
        slowest_rate=min(law.slowest_rate, own.slowest_rate),
        fastest_rate=max(law.fastest_rate, own.fastest_rate),
    )


def _step_follows(identification: Identification, fault: Fault) -> bool:
    """Whether T_s is chosen for the identified friction: the fault's is assumed, or for another kind of friction."""
    slides = identification.law.equilibrium is STEADY_SLIDING
    return slides and (step_assumed(fault) or _gains_a_state(identification, fault))


def _gains_a_state(identification: Identification, fault: Fault) -> bool:
    return identification.law.equilibrium is STEADY_SLIDING is not fault.friction.equilibrium


def covers(law: FrictionLaw) -> bool:
    """Whether a fault file can express ranges of a law's parameters, not only their best values."""
    return set(law.quantities()) == _WEAKENING


def save_fault(identification: Identification, fault: Fault, path: str | Path) -> None:
    """Write `identified_fault` to a TOML file, with best fit and ranges as comments at its head; whole or not at all.

    Raises `RecordError` as `identified_fault`, and `OutputError` when the file cannot be written.
    """
    whole, law = identified_fault(identification, fault), identification.law
    if covers(law):
        text = "friction and uncertainty below cover all laws in the boxes"
    else:
        text = "friction below is the best fit: a fault file cannot contain ranges of this law; "
        spread = _spread(identification)
        text += _too_wide(identification) or f"design --spread {spread} covers a, b and D_c of the box"
    remarks = [
        f"Friction identified from {identification.record.name!r} as {law.name}; "
        f"from {fault.name}: {other_parts(identification, fault)}.",
        f"Best fit (95 % interval of each parameter alone; box of all parameters together); {text}.",
        *(
            f"  {e.name} = {e.value:.6g} ({e.low:.6g} to {e.high:.6g}; {e.least:.6g} to {e.most:.6g}) {e.unit}".rstrip()
            for e in identification.estimates.values()
        ),
        *(f"{remark}." for remark in [*task_remarks(identification, fault), *filter(None, [poor_fit(identification)])]),
        *(f"Not passed: {remark}." for remark in identification.assessment.cautions),
    ]
    write_whole(Path(path), "".join(f"# {line}\n" for line in remarks) + fault_toml(whole))


def _too_wide(identification: Identification) -> str:
    """Which of a, b and D_c are too uncertain for a guarantee, and a remedy; empty if none is."""
    wide = {name: share for name, share in _shares(identification).items() if share > _WIDEST_SPREAD}
    if not wide:
        return ""
    number = ceil((max(wide.values()) / _WIDEST_SPREAD) ** 2)  # as standard deviations decrease with its square root
    text = ", ".join(f"{name} within {float(share):.0%}" for name, share in wide.items())
    return (
        f"the box is too wide for a guarantee: {text}; at most about {float(_WIDEST_SPREAD):.0%} is admissible. Fit "
        f"about {number} such steps together, or steps to ten times the rate with more samples within D_c after them"
    )


def _spread(identification: Identification) -> str:
    """Largest relative deviation of a, b and D_c from their best values in the box, rounded up to two digits."""
    return f"{float(_decimal(max(_shares(identification).values()), up=True, digits=2)):g}"


def _shares(identification: Identification) -> dict[str, Fraction]:
    """Largest relative deviation of each of a, b and D_c from its best value in the box."""
    estimates = [identification.estimates[name] for name in _RATE_AND_STATE]
    return {e.name: max(abs(rational(end) / rational(e.value) - 1) for end in (e.least, e.most)) for e in estimates}
