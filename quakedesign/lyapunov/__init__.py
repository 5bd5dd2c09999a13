"""Claims about closed loops, their certificate files, and their exact check."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
