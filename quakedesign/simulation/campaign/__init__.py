"""Campaigns: many samples of one closed loop, in batches that survive whatever stops them."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.simulation.campaign.crews import SerialExecutor
    from quakedesign.simulation.campaign.problem import Problem, SampleResult
    from quakedesign.simulation.campaign.result import Campaign, Failure
    from quakedesign.simulation.campaign.running import campaign_problem, run_campaign
    from quakedesign.simulation.campaign.search import Worst
    from quakedesign.simulation.campaign.space import Sample, Space

__all__ = [
    "Campaign",
    "Failure",
    "Problem",
    "Sample",
    "SampleResult",
    "SerialExecutor",
    "Space",
    "Worst",
    "campaign_problem",
    "run_campaign",
]

face(__name__)
