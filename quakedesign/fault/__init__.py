"""What is controlled: parameters in SI, uncertainty, reference and disturbance."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.fault.disturbance import Disturbance as Disturbance
    from quakedesign.fault.file_reading import load_fault as load_fault
    from quakedesign.fault.file_reading import parse_fault as parse_fault
    from quakedesign.fault.friction import FrictionLaw as FrictionLaw
    from quakedesign.fault.friction import friction_law as friction_law
    from quakedesign.fault.friction import friction_laws as friction_laws
    from quakedesign.fault.parameters import Fault as Fault
    from quakedesign.fault.parameters import require_fault as require_fault
    from quakedesign.fault.reference import Reference as Reference
    from quakedesign.fault.reference import SlidingReference as SlidingReference
    from quakedesign.fault.scales import Scales as Scales
    from quakedesign.fault.scaling import scaled_fault as scaled_fault
    from quakedesign.fault.sources import presets as presets
    from quakedesign.fault.template import fault_toml as fault_toml
    from quakedesign.fault.uncertainty import BOXES as BOXES
    from quakedesign.fault.uncertainty import UncertaintyBox as UncertaintyBox
    from quakedesign.fault.uncertainty import uncertainty_box as uncertainty_box

face(__name__)
