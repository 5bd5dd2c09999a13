"""Studies that combine several packages: limits, comparisons, runs, exports and checks of the paper."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
