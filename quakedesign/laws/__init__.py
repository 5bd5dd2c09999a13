"""Laws, one a file, found by looking into this folder; and the gains that the paper prints."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
