"""Campaigns: many samples of one closed loop, in batches that survive an interruption."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
