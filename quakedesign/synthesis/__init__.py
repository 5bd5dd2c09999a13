"""Every search: gains with a proof, and verdicts on given gains."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.sos.solve.conic import stated_problems as stated_problems
    from quakedesign.synthesis.design import Design as Design
    from quakedesign.synthesis.design import assess as assess
    from quakedesign.synthesis.design import design as design
    from quakedesign.synthesis.guarantee import answers as answers
    from quakedesign.synthesis.guarantee import guarantee as guarantee
    from quakedesign.synthesis.method import designable as designable
    from quakedesign.synthesis.method import left_out as left_out

face(__name__)
