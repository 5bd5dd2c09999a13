"""Control laws, one per file, discovered in this package; and the gains of the paper."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
