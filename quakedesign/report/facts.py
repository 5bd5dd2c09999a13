"""What a fault is, in numbers and in sentences."""

from typing import Any

from quakedesign.fault import Fault
from quakedesign.symbolic import derive


def fault_dict(fault: Fault) -> dict[str, Any]:
    """Keys of the command ``fault`` in DESIGN.md; SI, eigenvalues as [real, imaginary] in 1/s."""
    model = derive(fault)
    return {
        "name": fault.name,
        "source": fault.source,
        "natural_frequency": fault.natural_frequency,
        "damping_ratio": fault.damping_ratio,
        "seismic_moment": fault.seismic_moment,
        "magnitude": fault.magnitude if fault.stress_drop > 0 else None,
        "rest_slip": fault.rest_slip,
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
    }


def fault_sentences(fault: Fault) -> list[str]:
    """The same for people."""
    model = derive(fault)
    poles = ", ".join(f"{z.real:.4g}{z.imag:+.4g}i" if z.imag else f"{z.real:.4g}" for z in model.eigenvalues)
    magnitude = f"{fault.magnitude:.2f}" if fault.stress_drop > 0 else "none (no stress drop)"
    state = "unstable: " + "; ".join(model.reasons) if model.unstable else "stable without control"
    return [
        f"mass {fault.mass:.4g} kg, stiffness {fault.stiffness:.4g} N/m, natural frequency "
        f"{fault.natural_frequency:.4g} rad/s, damping ratio {fault.damping_ratio:.4g}",
        f"seismic moment {fault.seismic_moment:.4g} N·m, magnitude {magnitude}",
        f"next rest slip {fault.rest_slip:.4g} m, target slip {fault.reference.target_slip:.4g} m in "
        f"{fault.reference.operation_time:.6g} s{beyond_rest(fault)}",
        f"{state}; eigenvalues {poles} 1/s",
    ]


def beyond_rest(fault: Fault) -> str:
    """What a target means that is more than one percent beyond the next rest slip; empty for others."""
    if not 0 < 1.01 * fault.rest_slip < fault.reference.target_slip:
        return ""
    return f", {fault.reference.target_slip / fault.rest_slip:.3g} times the rest slip: pressure has to hold it there"
