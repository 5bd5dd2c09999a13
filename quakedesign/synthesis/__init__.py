"""Every search: gains with a proof, and verdicts on given gains."""

from quakedesign.arguments import check_arguments
from quakedesign.sos.solve.conic import stated_problems
from quakedesign.synthesis.analysis.certify import certify
from quakedesign.synthesis.design import DESIGNABLE, Design, assess, design
from quakedesign.synthesis.gains.synthesise import synthesise

__all__ = ["DESIGNABLE", "Design", "assess", "certify", "design", "stated_problems", "synthesise"]

check_arguments(__name__)
