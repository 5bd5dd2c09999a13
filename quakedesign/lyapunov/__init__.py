"""Stability claims about closed loops: search, exact check, certificate files, and synthesis of gains."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
