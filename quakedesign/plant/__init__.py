"""Uncertain plants: nominal model, exact ranges, reference and disturbance, built once from a fault."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.plant.of_fault import slow_sliding_plant as slow_sliding_plant
    from quakedesign.plant.of_fault import static_friction as static_friction
    from quakedesign.plant.of_fault import uncertain_plant as uncertain_plant
    from quakedesign.plant.ranges import UncertainPlant as UncertainPlant
    from quakedesign.plant.sliding_plant import WHOLE as WHOLE
    from quakedesign.plant.sliding_plant import Cuts as Cuts
    from quakedesign.plant.sliding_plant import SlidingPlant as SlidingPlant
    from quakedesign.plant.sliding_plant import cells as cells
    from quakedesign.plant.sliding_plant import parts as parts

face(__name__)
