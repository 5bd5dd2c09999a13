"""Uncertain plants: nominal model, exact ranges, reference and disturbance, built once from a fault."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
