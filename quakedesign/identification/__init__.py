"""Friction parameters from laboratory records: fits of simulated experiments, with confidence regions."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
