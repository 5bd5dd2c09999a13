"""Every search: gains with a proof, and verdicts on given gains."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.sos.solve.conic import stated_problems as stated_problems
    from quakedesign.synthesis.analysis.certify import certify as certify
    from quakedesign.synthesis.design import assess as assess
    from quakedesign.synthesis.design import design as design
    from quakedesign.synthesis.designed import Design as Design
    from quakedesign.synthesis.gains.synthesise import synthesise as synthesise
    from quakedesign.synthesis.guarantee import answer as answer
    from quakedesign.synthesis.guarantee import answers as answers
    from quakedesign.synthesis.guarantee import guarantee as guarantee
    from quakedesign.synthesis.guaranteed.sliding_answer import answer_sliding as answer_sliding
    from quakedesign.synthesis.methods.base import designable as designable
    from quakedesign.synthesis.methods.base import left_out as left_out

face(__name__)
