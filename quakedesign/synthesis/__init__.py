"""Design of gains with a proof, guarantees, and verdicts on given gains."""

from quakedesign.arguments import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
