"""SymPy derivations: signed powers, plant, error dynamics, homogeneity, terms, enclosures."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
