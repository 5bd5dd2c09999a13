"""What stands between law and fault, each element stated once: loops as exact matrices, schemes, actuators, sensors."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
