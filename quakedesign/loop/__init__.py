"""Loop setup between law and fault: exact loop matrices, schemes, actuators and sensors."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
