"""Model of the controlled fault: parameters in SI, uncertainty, reference and disturbance."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
