"""Campaigns: many samples of one closed loop, in batches that survive whatever stops them."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.parallel import SerialExecutor as SerialExecutor
    from quakedesign.simulation.campaign.campaign_result import Campaign as Campaign
    from quakedesign.simulation.campaign.campaign_result import Failure as Failure
    from quakedesign.simulation.campaign.problem import CampaignProblem as CampaignProblem
    from quakedesign.simulation.campaign.problem import SampleResult as SampleResult
    from quakedesign.simulation.campaign.problem import SlidingProblem as SlidingProblem
    from quakedesign.simulation.campaign.problem import SteppedProblem as SteppedProblem
    from quakedesign.simulation.campaign.running import campaign_problem as campaign_problem
    from quakedesign.simulation.campaign.running import run_campaign as run_campaign
    from quakedesign.simulation.campaign.space import Sample as Sample
    from quakedesign.simulation.campaign.space import Space as Space
    from quakedesign.simulation.campaign.space import Worst as Worst

face(__name__)
