"""Every search: gains with a proof, and verdicts on given gains."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.sos.solve.conic import stated_problems
    from quakedesign.synthesis.analysis.certify import certify
    from quakedesign.synthesis.design import assess, design
    from quakedesign.synthesis.designed import Design
    from quakedesign.synthesis.gains.synthesise import synthesise
    from quakedesign.synthesis.guarantee import answer
    from quakedesign.synthesis.guaranteed.sliding_answer import answer_sliding
    from quakedesign.synthesis.methods.base import designable

__all__ = [
    "Design",
    "answer",
    "answer_sliding",
    "assess",
    "certify",
    "design",
    "designable",
    "stated_problems",
    "synthesise",
]

face(__name__)
