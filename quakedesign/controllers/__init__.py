"""Laws, one a file, found by looking into this folder; and the gains that the paper prints."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.controllers.base import BaseGains as BaseGains
    from quakedesign.controllers.base import Controller as Controller
    from quakedesign.controllers.base import Law as Law
    from quakedesign.controllers.base import Sampling as Sampling
    from quakedesign.controllers.base import Signals as Signals
    from quakedesign.controllers.catalogue import Subject as Subject
    from quakedesign.controllers.catalogue import control_law as control_law
    from quakedesign.controllers.catalogue import control_laws as control_laws
    from quakedesign.controllers.catalogue import family as family
    from quakedesign.controllers.catalogue import law as law
    from quakedesign.controllers.catalogue import laws as laws
    from quakedesign.controllers.catalogue import model_of as model_of
    from quakedesign.controllers.catalogue import published as published
    from quakedesign.controllers.loop_field import LoopField as LoopField
    from quakedesign.controllers.sliding_mode import SlidingMode as SlidingMode

face(__name__)
