"""SymPy derivations: signed powers, plant, error dynamics, terms, enclosures."""

from quakedesign.symbolic.model import Model, derive
from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower, off_kinks

__all__ = ["AbsolutePower", "Model", "SignedPower", "derive", "off_kinks"]
