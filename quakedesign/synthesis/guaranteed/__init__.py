"""Laws chosen by what can be guaranteed of them as they run."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.synthesis.guaranteed.adversary import WorstFound, worst_found
    from quakedesign.synthesis.guaranteed.answer import Answer, attacked
    from quakedesign.synthesis.guaranteed.compensated import Compensation, compensated, design_compensated
    from quakedesign.synthesis.guaranteed.continuous import CLASSES, certified_peaks
    from quakedesign.synthesis.guaranteed.default_design import (
        SampledDesign,
        sampled_design,
        sampled_sliding_mode,
    )
    from quakedesign.synthesis.guaranteed.design import OBJECTIVES, design_held
    from quakedesign.synthesis.guaranteed.families import MEASURED
    from quakedesign.synthesis.guaranteed.reach import longest_delay, reached
    from quakedesign.synthesis.guaranteed.sliding import guarantee_of
    from quakedesign.synthesis.guaranteed.slowly import best_guarantee, tightened

__all__ = [
    "CLASSES",
    "MEASURED",
    "OBJECTIVES",
    "Answer",
    "Compensation",
    "SampledDesign",
    "WorstFound",
    "attacked",
    "best_guarantee",
    "certified_peaks",
    "compensated",
    "design_compensated",
    "design_held",
    "guarantee_of",
    "longest_delay",
    "reached",
    "sampled_design",
    "sampled_sliding_mode",
    "tightened",
    "worst_found",
]

face(__name__)
