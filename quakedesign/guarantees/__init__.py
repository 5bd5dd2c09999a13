"""Proved peaks of sampled loops: norms of the nominal loop, robust small-gain theorem."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
