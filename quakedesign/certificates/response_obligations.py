"""What decides a bound on outputs: side conditions in rationals, and quadratic forms that must be definite."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction

import sympy as sp

from quakedesign.certificates.claim import Loop, require, sympy_field
from quakedesign.certificates.obligations import Obligation, Obligations
from quakedesign.certificates.response import InputResponse, InvariantSet, Response
from quakedesign.sos.exact.polynomial import Polynomial, combination, product
from quakedesign.symbolic.terms import Term, from_terms, lie_derivative, real_polynomial, to_terms

_RATE = "rate of "


def demanded(loop: Loop, response: Response) -> Iterator[Obligation]:
    """Every obligation of a bound with the form that must be positive definite, in the order of FORMAT.md."""
    for name, part in response.parts.items():
        alone = OneInput(loop, name)
        for i, own in enumerate(part.sets):
            rate = alone.derivative(own)
            for vertex, values in Obligations(loop, ()).vertices():
                label = " ".join(filter(None, (f"invariant {name} {i}", vertex)))
                yield Obligation(label, alone.dissipation(part.sets, i, rate, values))
        for output, row in response.outputs.items():
            yield Obligation(f"output {name} {output}", alone.reach(part, output, row))


@dataclass(frozen=True)
class OneInput:
    """The loop moved by one input, the others at rest.

    Attributes
    ----------
    loop : Loop
    name : str
        Of the input.
    """

    loop: Loop
    name: str

    @property
    def limits(self) -> tuple[Fraction, ...]:
        """Bound of the input and, where it has one, of its rate."""
        return self.loop.inputs[self.name]

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Variables of V: the states, and the input if its rate is limited."""
        return (*self.loop.states, *((self.name,) if len(self.limits) == 2 else ()))

    @property
    def variables(self) -> tuple[str, ...]:
        """Variables of V′: the states, the input and, if limited, its rate."""
        return (*self.loop.states, self.name, *((_RATE + self.name,) if len(self.limits) == 2 else ()))

    def form(self, terms: tuple[Term, ...]) -> Polynomial:
        """V or a row as a polynomial in `coordinates`."""
        return real_polynomial(terms, self.coordinates, self.loop.parameters)

    def wide(self, own: InvariantSet) -> Polynomial:
        """V in `variables`."""
        more = (0,) * (len(self.variables) - len(self.coordinates))
        return {(*e, *more): c for e, c in self.form(own.function).items()}

    def derivative(self, own: InvariantSet) -> tuple[Term, ...]:
        """Terms of V′ in `variables`; refused unless it is affine in every uncertain parameter."""
        symbols = self.loop.symbols | {_RATE + self.name: sp.Symbol(_RATE + self.name, real=True)}
        others = {symbols[u]: 0 for u in self.loop.inputs if u != self.name}
        field = {state: rate.subs(others) for state, rate in sympy_field(self.loop).items()}
        if len(self.limits) == 2:
            field[symbols[self.name]] = symbols[_RATE + self.name]
        terms = to_terms(lie_derivative(from_terms(own.function, symbols), field), [symbols[v] for v in self.variables])
        twice = {p for t in terms for p in t.parameters if p in self.loop.ranges and t.parameters.count(p) > 1}
        require(not twice, f"V̇ is not affine in {', '.join(sorted(twice))}; the ends of its range do not decide.")
        return terms

    def dissipation(
        self, sets: tuple[InvariantSet, ...], i: int, rate: tuple[Term, ...], vertex: Mapping[str, Fraction]
    ) -> Polynomial:
        """Σ borrowed_j·V_j + Σ share·(u/limit)² − V_i′ − decay·V_i at a vertex, for the terms of V_i′."""
        own, values = sets[i], {**self.loop.parameters, **vertex}
        given = len(self.loop.states)
        squares = [
            (share / limit**2, {tuple(2 * (k == given + n) for k in range(len(self.variables))): Fraction(1)})
            for n, (share, limit) in enumerate(zip(own.shares, self.limits, strict=True))
        ]
        lent = [(b, self.wide(other)) for b, other in zip(own.borrowed, sets, strict=True)]
        fallen = real_polynomial(rate, self.variables, values)
        return combination([*lent, *squares, (Fraction(-1), fallen), (-own.decay, self.wide(own))])

    def reach(self, part: InputResponse, output: str, row: tuple[Term, ...]) -> Polynomial:
        """bound²·Σ weight_j·V_j − output²."""
        claim, line = part.bounds[output], self.form(row)
        held = [(claim.bound**2 * w, self.form(own.function)) for w, own in zip(claim.weights, part.sets, strict=True)]
        return combination([*held, (Fraction(-1), product(len(self.coordinates), [line, line]))])

    def start(self, own: InvariantSet) -> Fraction:
        """Largest V at the start: all states zero, an input with a limited rate anywhere within its bound."""
        if len(self.limits) == 1:
            return Fraction(0)
        corner = (*(0 for _ in self.loop.states), 2)
        return self.form(own.function).get(corner, Fraction(0)) * self.limits[0] ** 2


def require_sound(loop: Loop, response: Response) -> None:
    """Refuse a bound whose side conditions do not hold.

    Raises
    ------
    CertificateError
    """
    require(loop.domain == "reals" and not loop.lifts and not loop.roots, "a bound needs reals, no roots and no lifts.")
    for terms in loop.field.values():
        require(all(_is_linear(t, loop) for t in terms), "a bound needs a field that is linear in states and inputs.")
    used = {p for terms in loop.field.values() for t in terms for p in t.parameters}
    require(bool(loop.inputs) and set(loop.inputs) <= used, "every input must act on the loop.")
    require(list(response.parts) == list(loop.inputs) and bool(response.outputs), "every input needs its sets.")
    for terms in response.outputs.values():
        _require_form(loop, tuple(loop.states), terms, 1, "an output")
    for name, part in response.parts.items():
        _require_part(OneInput(loop, name), part, list(response.outputs))


def _is_linear(term: Term, loop: Loop) -> bool:
    inputs = sum(p in loop.inputs for p in term.parameters)
    return [f[1:] for f in term.factors] == [(1, "s")] * (1 - inputs) and inputs <= 1


def _require_form(loop: Loop, variables: tuple[str, ...], terms: tuple[Term, ...], degree: int, what: str) -> None:
    uncertain = {p for t in terms for p in t.parameters} - set(loop.parameters)
    require(not uncertain, f"{what} must not depend on an uncertain parameter.")
    polynomial = real_polynomial(terms, variables, loop.parameters)
    require({sum(e) for e in polynomial} == {degree}, f"{what} must be a form of degree {degree}.")


def _require_part(alone: OneInput, part: InputResponse, outputs: list[str]) -> None:
    count = len(part.sets)
    require(len(alone.limits) in (1, 2) and min(alone.limits) > 0, "an input needs one or two positive limits.")
    require(count > 0 and list(part.bounds) == outputs, "every input needs sets and a bound of every output.")
    for i, own in enumerate(part.sets):
        _require_form(alone.loop, alone.coordinates, own.function, 2, "V")
        require(len(own.shares) == len(alone.limits), "every limit of an input needs a share.")
        require(len(own.borrowed) == count and own.borrowed[i] == 0, "a borrowed share is misplaced.")
        shares = (*own.shares, *own.borrowed)
        require(own.decay > 0 and min(shares) >= 0, "shares must not be negative, the decay must be positive.")
        require(sum(shares) <= own.decay, "the shares add to more than the decay.")
        require(alone.start(own) <= 1, "the start is outside V ≤ 1.")
    for claim in part.bounds.values():
        require(claim.bound > 0, "a bound must be positive.")
        right = len(claim.weights) == count and min(claim.weights) >= 0 and sum(claim.weights) <= 1
        require(right, "every set needs a weight, not negative, together at most 1.")
