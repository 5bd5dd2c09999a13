"""Linear feedback that holds where Theorem 2 as printed does not: bounds, design, analysis, sampled implementation."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
