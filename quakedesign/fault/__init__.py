"""What is controlled: parameters in SI, uncertainty, reference and disturbance."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.fault.disturbance import Disturbance
    from quakedesign.fault.friction import FrictionLaw, friction_law, friction_laws
    from quakedesign.fault.parameters import Fault, require_fault
    from quakedesign.fault.reference import Reference
    from quakedesign.fault.scales import Scales
    from quakedesign.fault.scaling import scaled_fault
    from quakedesign.fault.scenario import load_fault, parse_fault
    from quakedesign.fault.sources import presets
    from quakedesign.fault.template import fault_toml
    from quakedesign.fault.uncertainty import BOXES, UncertaintyBox, uncertainty_box

__all__ = [
    "BOXES",
    "Disturbance",
    "Fault",
    "FrictionLaw",
    "Reference",
    "Scales",
    "UncertaintyBox",
    "fault_toml",
    "friction_law",
    "friction_laws",
    "load_fault",
    "parse_fault",
    "presets",
    "require_fault",
    "scaled_fault",
    "uncertainty_box",
]

face(__name__)
