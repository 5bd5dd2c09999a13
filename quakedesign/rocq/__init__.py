"""Certificates for the proof assistant Rocq: files that its compiler, ``coqc``, verifies."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
