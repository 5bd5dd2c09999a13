"""Laws chosen by what can be guaranteed of them as they run."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.synthesis.guaranteed.adversary import WorstFound as WorstFound
    from quakedesign.synthesis.guaranteed.adversary import worst_found as worst_found
    from quakedesign.synthesis.guaranteed.answer import Answer as Answer
    from quakedesign.synthesis.guaranteed.answer import attacked as attacked
    from quakedesign.synthesis.guaranteed.compensated import Compensation as Compensation
    from quakedesign.synthesis.guaranteed.compensated import compensated as compensated
    from quakedesign.synthesis.guaranteed.compensated import design_compensated as design_compensated
    from quakedesign.synthesis.guaranteed.continuous import CLASSES as CLASSES
    from quakedesign.synthesis.guaranteed.continuous import certified_peaks as certified_peaks
    from quakedesign.synthesis.guaranteed.default_design import SampledDesign as SampledDesign
    from quakedesign.synthesis.guaranteed.default_design import sampled_design as sampled_design
    from quakedesign.synthesis.guaranteed.default_design import sampled_sliding_mode as sampled_sliding_mode
    from quakedesign.synthesis.guaranteed.design import OBJECTIVES as OBJECTIVES
    from quakedesign.synthesis.guaranteed.design import design_held as design_held
    from quakedesign.synthesis.guaranteed.families import MEASURED as MEASURED
    from quakedesign.synthesis.guaranteed.longest_times import continued as continued
    from quakedesign.synthesis.guaranteed.longest_times import design_at as design_at
    from quakedesign.synthesis.guaranteed.longest_times import farthest_rock as farthest_rock
    from quakedesign.synthesis.guaranteed.longest_times import longest_delay as longest_delay
    from quakedesign.synthesis.guaranteed.longest_times import longest_step as longest_step
    from quakedesign.synthesis.guaranteed.longest_times import reached as reached
    from quakedesign.synthesis.guaranteed.sliding import guarantee_of as guarantee_of
    from quakedesign.synthesis.guaranteed.slowly import best_guarantee as best_guarantee
    from quakedesign.synthesis.guaranteed.slowly import tightened as tightened

face(__name__)
