"""Positivity of polynomials with exact proofs; independent of faults. The checks need no solver."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
