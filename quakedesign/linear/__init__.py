"""Linear feedback, corrected where Theorem 2 as printed fails: bounds, design, analysis, sampled implementation."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
