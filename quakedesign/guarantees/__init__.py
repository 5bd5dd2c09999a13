"""Peaks of the loop that runs, proved: `task` reads the fault, `norms` the loop, `theorem` joins them."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.guarantees.exact.guarantee_files import guarantee_document as guarantee_document
    from quakedesign.guarantees.exact.guarantee_files import load_guarantee as load_guarantee
    from quakedesign.guarantees.exact.guarantee_files import read_guarantee as read_guarantee
    from quakedesign.guarantees.exact.guarantee_files import save_guarantee as save_guarantee
    from quakedesign.guarantees.exact.loop import Held as Held
    from quakedesign.guarantees.exact.sliding_small_gain import SlidingClaims as SlidingClaims
    from quakedesign.guarantees.exact.sliding_small_gain import cell_bounds as cell_bounds
    from quakedesign.guarantees.exact.small_gain import Bounds as Bounds
    from quakedesign.guarantees.exact.small_gain import NoGuarantee as NoGuarantee
    from quakedesign.guarantees.exact.small_gain import SlowGain as SlowGain
    from quakedesign.guarantees.exact.small_gain import certified_bounds as certified_bounds
    from quakedesign.guarantees.exact.statement import Claims as Claims
    from quakedesign.guarantees.exact.statement import ContinuousPeaks as ContinuousPeaks
    from quakedesign.guarantees.exact.statement import Guarantee as Guarantee
    from quakedesign.guarantees.exact.statement import SlidingGuarantee as SlidingGuarantee
    from quakedesign.guarantees.exact.statement import continuous_peaks as continuous_peaks
    from quakedesign.guarantees.exact.statement import guarantee as guarantee
    from quakedesign.guarantees.guarantee_result import LoopAnswer as LoopAnswer
    from quakedesign.guarantees.guarantee_result import answer_sliding as answer_sliding
    from quakedesign.guarantees.guarantee_result import attacked as attacked
    from quakedesign.guarantees.search.adversary import WorstFound as WorstFound
    from quakedesign.guarantees.search.adversary import worst_found as worst_found
    from quakedesign.guarantees.search.compensated_search import Compensation as Compensation
    from quakedesign.guarantees.search.compensated_search import compensated as compensated
    from quakedesign.guarantees.search.compensated_search import design_compensated as design_compensated
    from quakedesign.guarantees.search.defaults import SampledDesign as SampledDesign
    from quakedesign.guarantees.search.defaults import guarantee_of as guarantee_of
    from quakedesign.guarantees.search.defaults import sampled_design as sampled_design
    from quakedesign.guarantees.search.defaults import sampled_sliding_mode as sampled_sliding_mode
    from quakedesign.guarantees.search.linear_design import CLASSES as CLASSES
    from quakedesign.guarantees.search.linear_design import OBJECTIVES as OBJECTIVES
    from quakedesign.guarantees.search.linear_design import best_guarantee as best_guarantee
    from quakedesign.guarantees.search.linear_design import certified_peaks as certified_peaks
    from quakedesign.guarantees.search.linear_design import continued as continued
    from quakedesign.guarantees.search.linear_design import design_at as design_at
    from quakedesign.guarantees.search.linear_design import design_held as design_held
    from quakedesign.guarantees.search.linear_design import farthest_rock as farthest_rock
    from quakedesign.guarantees.search.linear_design import longest_delay as longest_delay
    from quakedesign.guarantees.search.linear_design import longest_step as longest_step
    from quakedesign.guarantees.search.linear_design import tightened as tightened
    from quakedesign.loop.loop_setup import MEASURED as MEASURED

face(__name__)
