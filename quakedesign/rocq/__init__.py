"""Certificates for a proof assistant: files that Rocq's compiler, ``coqc``, verifies by itself."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
