"""What is controlled: parameters in SI, uncertainty, reference and disturbance."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.fault.fault_toml import fault_toml as fault_toml
    from quakedesign.fault.fault_toml import load_fault as load_fault
    from quakedesign.fault.fault_toml import parse_fault as parse_fault
    from quakedesign.fault.fault_toml import presets as presets
    from quakedesign.fault.friction import friction_law as friction_law
    from quakedesign.fault.friction import friction_laws as friction_laws
    from quakedesign.fault.friction.base import FrictionLaw as FrictionLaw
    from quakedesign.fault.model import BOXES as BOXES
    from quakedesign.fault.model import Disturbance as Disturbance
    from quakedesign.fault.model import Fault as Fault
    from quakedesign.fault.model import Reference as Reference
    from quakedesign.fault.model import SlidingReference as SlidingReference
    from quakedesign.fault.model import UncertaintyBox as UncertaintyBox
    from quakedesign.fault.model import require_fault as require_fault
    from quakedesign.fault.model import uncertainty_box as uncertainty_box
    from quakedesign.fault.similarity import Scales as Scales
    from quakedesign.fault.similarity import scaled_fault as scaled_fault

face(__name__)
