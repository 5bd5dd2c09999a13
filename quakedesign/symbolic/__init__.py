"""SymPy derivations: signed powers, plant, error dynamics, homogeneity, Filippov fields, terms, enclosures."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.symbolic.filippov import FilippovField as FilippovField
    from quakedesign.symbolic.filippov import filippov_derivative as filippov_derivative
    from quakedesign.symbolic.homogeneity import Homogeneity as Homogeneity
    from quakedesign.symbolic.homogeneity import dilate as dilate
    from quakedesign.symbolic.homogeneity import homogeneous as homogeneous
    from quakedesign.symbolic.model import Model as Model
    from quakedesign.symbolic.model import derive as derive
    from quakedesign.symbolic.normal_form import normal_form as normal_form
    from quakedesign.symbolic.normal_form import solve_signed as solve_signed
    from quakedesign.symbolic.set_valued import SetValued as SetValued
    from quakedesign.symbolic.set_valued import restrict as restrict
    from quakedesign.symbolic.signed_power import AbsolutePower as AbsolutePower
    from quakedesign.symbolic.signed_power import SignedPower as SignedPower
    from quakedesign.symbolic.signed_power import off_kinks as off_kinks
    from quakedesign.symbolic.term_expressions import real_symbols as real_symbols
    from quakedesign.symbolic.weights import weights_for as weights_for

face(__name__)
