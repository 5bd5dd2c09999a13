"""Laws chosen by what can be guaranteed of them as they run."""

from quakedesign.arguments import check_arguments
from quakedesign.synthesis.guaranteed.adversary import WorstFound, worst_found
from quakedesign.synthesis.guaranteed.answer import Answer, answer
from quakedesign.synthesis.guaranteed.compensated import Compensation, compensated, design_compensated
from quakedesign.synthesis.guaranteed.continuous import CLASSES, certified_peaks
from quakedesign.synthesis.guaranteed.design import OBJECTIVES, design_held

__all__ = [
    "CLASSES",
    "OBJECTIVES",
    "Answer",
    "Compensation",
    "WorstFound",
    "answer",
    "certified_peaks",
    "compensated",
    "design_compensated",
    "design_held",
    "worst_found",
]

check_arguments(__name__)
