"""Many polynomials of one shape: modelled once, solved with the solver's data updated in place."""

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

from quakedesign.errors import PolynomialError
from quakedesign.sos.exact.answer import Answer
from quakedesign.sos.exact.polynomial import Exponents
from quakedesign.sos.exact.statement import Statement
from quakedesign.sos.solve.decide import initial_blocks
from quakedesign.sos.solve.engine import decide
from quakedesign.sos.solve.moment import MomentProgram
from quakedesign.sos.solve.rounding import relations


class Membership:
    """Largest margins of polynomials whose monomials are among those of one statement.

    Parameters
    ----------
    template : Statement
        Fixes set, degree, multiplier and, by its polynomial, the monomials that may occur.
    """

    def __init__(self, template: Statement) -> None:
        self.template = template
        self.solver_seconds = 0.0
        rows = [{e: float(c) for e, c in r.items()} for _, _, r in relations(template)]
        self._program = MomentProgram([b.shape() for b in initial_blocks(template)], rows)

    def margin(self, polynomial: Mapping[Exponents, Any]) -> float:
        """Largest t with polynomial − t·Σ b² in the cone, in floating point: no proof; NaN when the solver fails.

        Raises
        ------
        PolynomialError
            When it has a monomial that the template's polynomial does not have.
        """
        unknown = [e for e in polynomial if e not in self.template.polynomial]
        if unknown:
            raise PolynomialError(f"monomials must be those of the template. Received another one: {unknown[0]}.")
        asked = polynomial
        if len(self.template.multiplier) != 1 or any(map(any, self.template.multiplier)):
            asked = replace(self.template, polynomial={e: Fraction(c) for e, c in polynomial.items()}).target
        size = max((abs(float(c)) for c in asked.values()), default=0.0)
        if size == 0 or not self._program.covers(asked):
            return 0.0 if size == 0 else float("-inf")
        margin = self._program.margin({e: float(c) / size for e, c in asked.items()}, 1e-8)
        self.solver_seconds = self._program.solver_seconds
        return float("nan") if margin is None else margin * size

    def prove(self, polynomial: Mapping[Exponents, Fraction]) -> Answer:
        """Exact answer for one of the polynomials."""
        return decide(replace(self.template, polynomial=dict(polynomial)))
