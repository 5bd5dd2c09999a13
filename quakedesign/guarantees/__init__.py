"""Peaks of the loop that runs, proved: `task` reads the fault, `norms` the loop, `theorem` joins them."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
