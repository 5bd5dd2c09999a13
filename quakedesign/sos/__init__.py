"""Positivity of polynomials with exact proofs; knows nothing of faults. What decides needs no solver."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
