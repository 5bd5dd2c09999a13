"""From a laboratory record to friction parameters: fits of the simulated experiment, with confidence regions."""

from quakedesign.arguments import check_arguments
from quakedesign.identification.fault_file import (
    cover,
    identified_fault,
    law_remarks,
    next_command,
    other_parts,
    save_fault,
    task_remarks,
)
from quakedesign.identification.identification_result import Identification, ParameterEstimate
from quakedesign.identification.identify import identify
from quakedesign.identification.record import Record, read_record

__all__ = [
    "Identification",
    "ParameterEstimate",
    "Record",
    "cover",
    "identified_fault",
    "identify",
    "law_remarks",
    "next_command",
    "other_parts",
    "read_record",
    "save_fault",
    "task_remarks",
]

check_arguments(__name__)
