"""SymPy derivations: signed powers, plant, error dynamics, homogeneity, terms, enclosures."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.symbolic.homogeneity import Homogeneity as Homogeneity
    from quakedesign.symbolic.homogeneity import dilate as dilate
    from quakedesign.symbolic.homogeneity import homogeneous as homogeneous
    from quakedesign.symbolic.homogeneity import weights_for as weights_for
    from quakedesign.symbolic.signed_power import AbsolutePower as AbsolutePower
    from quakedesign.symbolic.signed_power import SignedPower as SignedPower
    from quakedesign.symbolic.signed_power import normal_form as normal_form
    from quakedesign.symbolic.signed_power import off_kinks as off_kinks
    from quakedesign.symbolic.stability import Model as Model
    from quakedesign.symbolic.stability import critical_stiffness as critical_stiffness
    from quakedesign.symbolic.stability import derive as derive
    from quakedesign.symbolic.stability import nucleation_length as nucleation_length
    from quakedesign.symbolic.stability import stability as stability
    from quakedesign.symbolic.term_expressions import real_symbols as real_symbols

face(__name__)
