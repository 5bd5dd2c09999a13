"""Laws, one a file, found by looking into this folder; and the gains that the paper prints."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.controllers.base import BaseGains, Controller, Law, Sampling, Signals
    from quakedesign.controllers.catalogue import (
        Subject,
        control_law,
        control_laws,
        family,
        law,
        laws,
        model_of,
        published,
    )
    from quakedesign.controllers.loop_field import LoopField
    from quakedesign.controllers.sliding_mode import SlidingMode

__all__ = [
    "BaseGains",
    "Controller",
    "Law",
    "LoopField",
    "Sampling",
    "Signals",
    "SlidingMode",
    "Subject",
    "control_law",
    "control_laws",
    "family",
    "law",
    "laws",
    "model_of",
    "published",
]

face(__name__)
