"""Measurement chain from the true slip to the input of a law: transducer, averaging, differentiator."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
