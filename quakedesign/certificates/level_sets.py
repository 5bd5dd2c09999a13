"""Level sets of a proved Lyapunov function in metres and seconds."""

from dataclasses import dataclass
from fractions import Fraction

import sympy as sp

from quakedesign.certificates.certificate import Certificate
from quakedesign.certificates.loop_expressions import error_units, full_field
from quakedesign.certificates.matched import Errors
from quakedesign.controllers import LoopField
from quakedesign.rationals import end_of
from quakedesign.symbolic.balls import enclose
from quakedesign.symbolic.term_expressions import from_terms

_BASE, _OTHER = sp.symbols("x y", positive=True)


@dataclass(frozen=True)
class LevelSets:
    """Level sets of a proved V for gains scaled by λ, in metres and seconds.

    Attributes
    ----------
    certificate : Certificate
        For the base gains (λ = 1), with bounds of all states.
    scale : Fraction
        λ; the scaled loop has the errors λe of the base loop at the same time.
    model : LoopField, optional
        Loop of the law, for the units of its states; that of the law of the package by the certificate's name.
    """

    certificate: Certificate
    scale: Fraction
    model: LoopField | None = None

    @property
    def degree(self) -> Fraction:
        """m, the degree of V."""
        loop, (term, *_) = self.certificate.loop, self.certificate.lyapunov
        return sum((exponent * loop.states[state] for state, exponent, _ in term.factors), Fraction(0))

    def level(self, matched: Fraction) -> Fraction:
        """Upper bound of V where e1 = e2 = 0 and |e3| ≤ matched [unit of ν]."""
        return self.level_of(matched=matched)

    def level_of(self, *, slip: Fraction = Fraction(0), rate: Fraction = Fraction(0), matched: Fraction) -> Fraction:
        """Upper bound of V where |e1| ≤ slip [m], |e2| ≤ rate [m/s] and |e3| ≤ matched [unit of ν]."""
        loop = self.certificate.loop
        first, second, *rest = (loop.symbols[s] for s in loop.states)
        units = {loop.symbols[s]: low for s, (low, _) in error_units(loop, self.model).items()}
        sizes = {first: slip, second: rate, **dict.fromkeys(rest, Fraction(0)), rest[-1]: matched}
        sizes = {symbol: size / units[symbol] for symbol, size in sizes.items()}
        box = {symbol: (-v / self.scale, v / self.scale) for symbol, v in sizes.items()}
        return end_of(enclose(from_terms(self.certificate.lyapunov, loop.symbols), box).upper())

    def errors(self, level: Fraction) -> Errors:
        """Bounds on e1, e2 and e2' on {V ≤ level}, from V ≥ γ_i u_i^m."""
        loop = self.certificate.loop
        sizes: dict[str, Fraction] = {}
        for state, weight in loop.states.items():
            gamma = self.certificate.claims[f"bound_{state}"]
            quotient = enclose((_BASE / _OTHER) ** self._power(weight), {_BASE: (level,) * 2, _OTHER: (gamma,) * 2})
            sizes[state] = end_of(quotient.upper())
        box = {loop.symbols[s]: (-v, v) for s, v in sizes.items()} | {
            loop.symbols[n]: ends for n, ends in loop.uncertain.items()
        }
        box |= {loop.symbols[n]: (v, v) for n, v in loop.parameters.items()}
        box |= {loop.symbols[n]: ends for n, (_, ends) in loop.roots.items()}
        first, second, *_ = loop.states
        units = error_units(loop, self.model)
        acceleration = end_of(abs(enclose(full_field(loop)[loop.symbols[second]], box)).upper()) * units[second][1]
        return Errors(
            slip=self.scale * sizes[first] * units[first][1],
            rate=self.scale * sizes[second] * units[second][1],
            acceleration=self.scale * acceleration,
        )

    def starts(self, level: Fraction) -> tuple[Fraction, ...]:
        """Largest size of every state for which {V ≤ level} surely holds it while the other states are zero."""
        loop = self.certificate.loop
        function, sizes = from_terms(self.certificate.lyapunov, loop.symbols), []
        for state, weight in loop.states.items():
            alone = ({loop.symbols[s]: sign * (s == state) for s in loop.states} for sign in (1, -1))
            peak = max(end_of(enclose(function.subs(point), {}).upper()) for point in alone)
            size = enclose((_BASE / _OTHER) ** self._power(weight), {_BASE: (level,) * 2, _OTHER: (peak,) * 2})
            sizes.append(self.scale * end_of(size.lower()) * error_units(loop, self.model)[state][0])
        return tuple(sizes)

    def _power(self, weight: int) -> sp.Rational:
        return sp.Rational(weight) / sp.Rational(self.degree.numerator, self.degree.denominator)
