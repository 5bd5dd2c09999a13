"""Laws chosen by what can be guaranteed of them as they run."""

from quakedesign.synthesis.guaranteed.adversary import WorstFound, worst_found
from quakedesign.synthesis.guaranteed.answer import Answer, answer
from quakedesign.synthesis.guaranteed.design import OBJECTIVES, design_held

__all__ = ["OBJECTIVES", "Answer", "WorstFound", "answer", "design_held", "worst_found"]
