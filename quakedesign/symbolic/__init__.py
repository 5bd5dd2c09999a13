"""SymPy derivations: signed powers, plant, error dynamics, homogeneity, Filippov fields, cells, lifts, enclosures."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.symbolic.filippov import FilippovField, filippov_derivative
    from quakedesign.symbolic.homogeneity import Homogeneity, dilate, homogeneous
    from quakedesign.symbolic.lifting import lift
    from quakedesign.symbolic.model import Model, derive
    from quakedesign.symbolic.normal_form import normal_form, solve_signed
    from quakedesign.symbolic.set_valued import SetValued, restrict
    from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower, off_kinks
    from quakedesign.symbolic.term_expressions import real_symbols
    from quakedesign.symbolic.weights import weights_for

__all__ = [
    "AbsolutePower",
    "FilippovField",
    "Homogeneity",
    "Model",
    "SetValued",
    "SignedPower",
    "derive",
    "dilate",
    "filippov_derivative",
    "homogeneous",
    "lift",
    "normal_form",
    "off_kinks",
    "real_symbols",
    "restrict",
    "solve_signed",
    "weights_for",
]

face(__name__)
