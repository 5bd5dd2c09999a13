"""Linear feedback that holds where Theorem 2 as printed does not: bounds, design, analysis, sampled implementation."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.linear.uncertainty_bounds import uncertainty_bounds as uncertainty_bounds
    from quakedesign.linear.verdict import judge as judge

face(__name__)
