"""Robustness of a proved decrease of V to perturbations of the acceleration, and level sets of V in SI units.

The robustness constants depend only on the certificate. They bound the perturbations |w| ≤ g1|e1| + g2|e2| of the
acceleration for which V' stays negative, for every fault and every gain scale λ.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import sympy as sp

from quakedesign.errors import CertificateError, KinkError
from quakedesign.exact import end_of
from quakedesign.laws import LoopField
from quakedesign.lyapunov.exact.certificate import Certificate
from quakedesign.lyapunov.exact.claim import require
from quakedesign.lyapunov.exact.forms import Form, Problem, largest_ratio
from quakedesign.lyapunov.exact.loop_expressions import error_units, full_field
from quakedesign.lyapunov.exact.obligations import Obligations, obligation_degree
from quakedesign.lyapunov.exact.perturbation_bounds import Errors
from quakedesign.symbolic.enclosure import enclose
from quakedesign.symbolic.term_expressions import from_terms, lie_derivative, to_terms
from quakedesign.symbolic.terms import Term, cell_polynomial

# ----------------------------------------------------------------------
# Robustness of a proved decrease: constants of the certificate only, equal for every fault and every λ.
#
# Let V have degree m along a field of degree d. A perturbation w of the acceleration, e2' = β(ν + e3 + w), adds
# β·∂V/∂e2·w to V'. For |w| ≤ g1|e1| + g2|e2| the quotients β|∂V/∂e2||e_i| / (−V'·V^{p_i}), p_i = (r_i − r_2 − d)/m, are
# homogeneous of degree 0, so they have maxima a_i, and V' stays negative where a1·g1·V^{p1} + a2·g2·V^{p2} < 1.

_INPUT = 1
"""Index of e2, on which ν acts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Robustness:
    """Constants that bound the perturbations of the acceleration for which V' stays negative."""

    # slip, rate: Upper bounds on a1 [s²] and a2 [s], for a V without unit; see the comment above
    slip: Fraction
    rate: Fraction
    # slip_power, rate_power: p1 and p2 [-]
    slip_power: Fraction
    rate_power: Fraction
    source: str  # Method of the bounds


class _Cells:
    """Forms of a certificate on the sign cells, in coordinates in which {V ≤ 1} is approximately the unit box."""

    def __init__(self, certificate: Certificate, model: LoopField | None = None) -> None:
        self.model = model
        self.loop, self.lyapunov = certificate.loop, certificate.lyapunov
        self.obligations = Obligations(certificate.loop, certificate.lyapunov)
        self.weights = list(self.loop.states.values())
        self.m = obligation_degree([p for _, p in self.obligations.function()], "V")
        # e1' = e2 determines the degree of the field
        self.degree = self.weights[_INPUT] - self.weights[0]
        self.decrease_degree = self.m + self.degree
        self.sizes = [_size(certificate.claims.get(f"bound_{s}"), self.m) for s in self.loop.states]

    def form(self, polynomial: dict[tuple[int, ...], Fraction], total: int) -> Form:
        return Form.of(polynomial, len(self.weights), total, self.sizes)

    def functions(self) -> Iterator[tuple[dict[str, int], Form]]:
        """Signs of every cell, and V on it."""
        for cell in self.obligations.sign_cells():
            yield dict(cell.signs), self.form(self.obligations.potential(cell.signs), self.m)

    def decreases(self, signs: dict[str, int]) -> Iterator[tuple[dict[str, Fraction], Form]]:
        """Uncertain values at every vertex, and −V' there on a cell."""
        require(not self.loop.lifts, "V' is not polynomial in the states, as the field has nested powers.")
        for _, values in self.obligations.vertices():
            parameters = {**self.loop.parameters, **values}
            rate = cell_polynomial(self.obligations.derivative, self.loop.states, signs, parameters)
            yield values, self.form({e: -c for e, c in rate.items()}, self.decrease_degree)

    def power(self, index: int) -> Fraction:
        """Exponent p_i = (r_i − r_2 − d)/m, where d is the degree of the field."""
        return Fraction(self.weights[index] - self.weights[_INPUT] - self.degree, self.m)

    def slope(self) -> tuple[Term, ...]:
        """∂V/∂e2."""
        symbols = self.loop.symbols
        second = symbols[list(self.loop.states)[_INPUT]]
        derivative = lie_derivative(from_terms(self.lyapunov, symbols), {second: sp.Integer(1)})
        return to_terms(derivative, [symbols[s] for s in self.loop.states])

    def disturbance_term(self, slope: tuple[Term, ...], index: int, signs: dict[str, int], beta: Fraction) -> Form:
        """Bound on β·∂V/∂e2·|e_i| on a cell, with the enclosures of the units of e_i and e2."""
        weight = self.weights[index]
        bare = cell_polynomial(slope, self.loop.states, signs, {})
        units = list(error_units(self.loop, self.model).values())
        beta *= units[index][1] / units[_INPUT][0]
        raised = {tuple(k + weight * (j == index) for j, k in enumerate(e)): beta * c for e, c in bare.items()}
        return self.form(raised, self.m - self.weights[_INPUT] + weight)


def _size(gamma: Fraction | None, m: int) -> Fraction:
    """Short rational near γ^{−1/m}; any positive number is valid, but this one speeds up the bisection."""
    return Fraction(float(gamma) ** (-1 / m)).limit_denominator(1000) if gamma else Fraction(1)


def robustness(certificate: Certificate, model: LoopField | None = None) -> Robustness | None:
    """Robustness constants of V', for all uncertain values of the certificate.

    Where V' is polynomial on the cells, the quotients contain V' itself; otherwise its bound −κV^{(m+d)/m} with the
    claimed κ.

    Parameters
    ----------
    certificate : Certificate
        Certificate that was already checked.
    model : LoopField, optional
        Loop of the law, see `LevelSets`.

    Returns
    -------
    Robustness or None
        None if no bound was found, for example because V is not polynomial on its cells.
    """
    try:
        cells = _Cells(certificate, model)
        slope = cells.slope()
    except (CertificateError, KinkError):
        return None
    try:
        ratios = [largest_ratio(_against_decrease(cells, slope, index)) for index in (0, _INPUT)]
        source = "bisection of the cells"
    except (CertificateError, KinkError):
        kappa = certificate.claims.get("decay")
        if kappa is None:
            return None
        largest = [largest_ratio(_against_function(cells, slope, index)) for index in (0, _INPUT)]
        ratios = [None if v is None else v / kappa for v in largest]
        source = "claimed decay"
    slip, rate = ratios
    if slip is None or rate is None:
        return None
    return Robustness(slip=slip, rate=rate, slip_power=cells.power(0), rate_power=cells.power(_INPUT), source=source)


def _against_decrease(cells: _Cells, slope: tuple[Term, ...], index: int) -> list[Problem]:
    """Quotients β|∂V/∂e2||e_i| / (−V'·V^p) on every cell and vertex."""
    powers = (Fraction(1), Fraction(-1), -cells.power(index))
    return [
        ((cells.disturbance_term(slope, index, signs, values["beta"]), decrease, function), powers)
        for signs, function in cells.functions()
        for values, decrease in cells.decreases(signs)
    ]


def _against_function(cells: _Cells, slope: tuple[Term, ...], index: int) -> list[Problem]:
    """Quotients β|∂V/∂e2||e_i| / V^{1 + (r_i − r_2)/m} on every cell, with the largest β."""
    beta = cells.loop.uncertain["beta"][1]
    return [
        ((term, function), (Fraction(1), -Fraction(term.degree, cells.m)))
        for signs, function in cells.functions()
        for term in (cells.disturbance_term(slope, index, signs, beta),)
    ]


# ----------------------------------------------------------------------
# Level sets of a proved Lyapunov function in metres and seconds.

_BASE, _OTHER = sp.symbols("x y", positive=True)


@dataclass(frozen=True)
class LevelSets:
    """Level sets of a proved V for gains scaled by λ, in metres and seconds."""

    certificate: Certificate  # For the base gains (λ = 1), with bounds of all states
    scale: Fraction  # λ; at any time the errors of the scaled loop are λ times those of the base loop
    # Loop of the law, for the units of its states; by default that of the law that the certificate names
    model: LoopField | None = None

    @property
    def degree(self) -> Fraction:
        """Degree m of V."""
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
        """Bounds on |e1| [m], |e2| [m/s] and |e2'| [m/s²] on {V ≤ level}, from V ≥ γ_i|x_i|^{m/r_i} for all i."""
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
        """Largest |e_i| [SI units], rounded down, such that {V ≤ level} contains the state with zero other errors."""
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
