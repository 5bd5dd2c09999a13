"""What lies between the true slip and what a law is told: transducer, averaging, differentiator."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
