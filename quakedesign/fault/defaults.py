"""What a file may leave out: damping from physics, a task like that of the paper's faults."""

import math
from collections.abc import Mapping
from decimal import ROUND_FLOOR, Context, Decimal
from typing import Any

from quakedesign.errors import ScenarioError
from quakedesign.fault.friction import FrictionLaw
from quakedesign.fault.parameters import Fault
from quakedesign.fault.reference import Reference

PERIODS = 4.6e5
"""ω_n times the operation time [-] of both faults of Table I."""
SAMPLES = 10.0
"""Samples while the fastest of an error and of a free oscillation grows or turns by one."""
AGEINGS = 20.0
"""Samples in D_c/V, few enough to be summed in a proof of slow sliding at V and many enough to control it."""
_STEP = "sampling time"
_SHARE = 1000  # of the operation time, which a sampling time must not exceed


def radiation_damping(density: float, shear_modulus: float, area: float) -> float:
    """GA/(2c_s) [kg/s]: what plane shear waves carry away from both sides of a sliding patch.

    Parameters
    ----------
    density : float
        ρ [kg/m³].
    shear_modulus : float
        G [Pa].
    area : float
        A [m²].

    Notes
    -----
    Rice (1993), J. Geophys. Res. 98(B6), 9885; c_s = √(G/ρ) is the speed of shear waves.
    """
    return area * math.sqrt(density * shear_modulus) / 2


def sliding_step(law: FrictionLaw, task: Reference) -> float:
    """T_s [s] near which slow sliding at the mean rate V of a task has a guarantee: D_c/(20 V), rounded down.

    Parameters
    ----------
    law : FrictionLaw
        With a state.
    task : Reference
    """
    ageing = float(min(law.steady_state(mean_rate(task))))
    return _cut(min(ageing / AGEINGS, task.operation_time / _SHARE), digits=2)


def mean_rate(task: Reference) -> float:
    """V [m/s], the target slip over the operation time."""
    return task.target_slip / task.operation_time


def beyond_rates(law: FrictionLaw, rate: float, *, source: str = "") -> str:
    """That a slip rate [m/s] lies outside the working range of a law, as one sentence; empty for one inside.

    The range is that of slowest_rate and fastest_rate, unless another `source` of it is named.
    """
    slowest, fastest = law.working_rates
    if slowest <= rate <= fastest:
        return ""
    return (
        f"V = {rate:.3g} m/s is {'below' if rate < slowest else 'above'} the rates "
        f"{source or 'for which friction is known'}, {slowest:.2g} to {fastest:.2g} m/s"
        f"{'' if source else ' (slowest_rate, fastest_rate)'}: a, b and D_c are extrapolated"
    )


def step_assumed(fault: Fault) -> bool:
    """Whether the T_s of a fault was filled in, so that another friction has another."""
    return any(said.startswith(_STEP) for said in fault.assumed)


def completed(parts: Mapping[str, Any], task: Mapping[str, float], said: tuple[str, ...] = ()) -> Fault:
    """Fault of what a file has, the rest filled in and told in `Fault.assumed`.

    Parameters
    ----------
    parts : mapping
        Arguments of `Fault`, those of the task and perhaps the damping excepted.
    task : mapping
        target_slip [m], operation_time [s], ramp [-], sampling_time [s], as far as given.
    said : tuple of str
        What was assumed before.

    Raises
    ------
    ScenarioError
        For a task that has to be given.
    ParameterError
        For an unphysical value.
    """
    assumed = list(said)
    longest = task.get("operation_time", math.inf)
    trial = {
        "damping": 0.0,
        **parts,
        "reference": Reference(target_slip=1.0, operation_time=1.0),
        "sampling_time": 1e-3,
    }
    fault = Fault(**trial)
    if "damping" not in parts:
        damping = _cut(radiation_damping(fault.density, fault.shear_modulus, fault.area))
        assumed.append(f"damping {damping:g} kg/s, the radiation of shear waves, G A/(2 c_s), rounded down")
        fault = Fault(**trial | {"damping": damping})
    target = task.get("target_slip") or _target(fault, assumed)
    if "operation_time" not in task:
        longest = _cut(PERIODS / fault.natural_frequency)
        assumed.append(f"operation time {longest:g} s, about as many natural periods as for the paper's faults")
    reference = Reference(target_slip=target, operation_time=longest, ramp=task.get("ramp"))
    step = task.get("sampling_time") or _step(fault, reference, assumed)
    return Fault(
        **dict(parts) | {"damping": fault.damping, "reference": reference, "sampling_time": step},
        assumed=tuple(assumed),
    )


def _why_stable(fault: Fault) -> str:
    weakens = fault.authority * fault.effective_normal_stress * fault.friction.slip_slope
    return (
        f"a stable fault has none (per m of slip its spring unloads by {fault.specific_stiffness:.3g} m/s^2, friction "
        f"by at most {weakens:.3g} m/s^2 under {fault.effective_normal_stress:.4g} Pa; check units)"
    )


def _target(fault: Fault, assumed: list[str]) -> float:
    slip = fault.rest_slip
    if not slip > 0:
        why = "friction with a state has none" if math.isnan(slip) else _why_stable(fault)
        raise ScenarioError(
            f"task.target_slip must be given, because it is the next rest slip unless told, and {why}. "
            "Received nothing. Add [task] with target_slip."
        )
    target = _cut(slip)
    assumed.append(f"target slip {target:g} m, the next rest slip rounded down")
    return target


def _step(fault: Fault, task: Reference, assumed: list[str]) -> float:
    if fault.friction.state_names:
        step = sliding_step(fault.friction, task)
        assumed.append(f"{_STEP} {step:g} s, near D_c/({AGEINGS:g} V) in slow sliding at the task's mean rate V")
        return step
    pace = max(fault.natural_frequency, _growth(fault))
    step = _cut(min(1 / (SAMPLES * pace), task.operation_time / _SHARE), digits=2)
    assumed.append(
        f"{_STEP} {step:g} s, at least {SAMPLES:g} samples while an error grows e-fold or it swings by 1 rad"
    )
    return step


def _growth(fault: Fault) -> float:
    """Largest real pole [1/s] without pressure, friction as steep as it can be; others turn faster than they grow."""
    push, law = fault.authority * fault.effective_normal_stress, fault.friction
    damping = fault.specific_damping - push * law.rate_slope
    stiffness = fault.specific_stiffness - push * law.slip_slope
    return (math.sqrt(max(damping**2 - 4 * stiffness, 0)) - damping) / 2


def _cut(value: float, digits: int = 3) -> float:
    """Rounded down to so many digits."""
    return float(Context(prec=digits, rounding=ROUND_FLOOR).create_decimal(Decimal(value)))
