"""From a laboratory record to friction parameters: fits of the simulated experiment, with confidence regions."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
