"""Proof obligations of a Lyapunov function, and the witnesses that prove them.

A loop and a Lyapunov function define polynomials that must be non-negative on cells (FORMAT.md, 2 to 5). A witness is a
polynomial identity with sums of squares on one cell.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property
from itertools import combinations, product

from quakedesign.lyapunov.exact.claim import Loop, Witness, require
from quakedesign.sos.exact.polynomial import Exponents, Polynomial, combination, constant, degree
from quakedesign.sos.exact.polynomial_statement import Statement
from quakedesign.sos.exact.proofs import SumOfSquares, identity_holds
from quakedesign.symbolic.terms import Term, cell_polynomial, collected, lie_terms, real_polynomial

# ----------------------------------------------------------------------
# From a loop and a Lyapunov function to the polynomials that must be non-negative (FORMAT.md, 2 to 5).


@dataclass(frozen=True)
class Cell:
    """Signs of states and lifts, and the conditions on the cell variables."""

    name: str  # Signs as a string of + and −, states first; empty on the reals
    signs: Mapping[str, int]
    # equalities, inequalities: Polynomials that are 0, or ≥ 0, on the cell
    equalities: tuple[Polynomial, ...] = ()
    inequalities: tuple[Polynomial, ...] = ()


@dataclass(frozen=True)
class Obligation:
    """One polynomial that must be non-negative on a cell."""

    name: str
    polynomial: Polynomial  # In the variables of states, lifts and, for a decay, V^{1/m}; all ≥ 0 unless on the reals
    equalities: tuple[Polynomial, ...] = ()
    inequalities: tuple[Polynomial, ...] = ()

    @property
    def key(self) -> tuple[object, ...]:
        """Polynomial and conditions; obligations with equal keys share one witness."""
        parts = ((self.polynomial,), self.equalities, self.inequalities)
        return tuple(
            tuple(tuple(sorted((e, c.as_integer_ratio()) for e, c in p.items())) for p in part) for part in parts
        )


@dataclass(frozen=True)
class Obligations:
    """All polynomials whose signs decide V > 0 and V̇ < 0 for one loop and one V."""

    loop: Loop
    lyapunov: tuple[Term, ...]

    @cached_property
    def derivative(self) -> tuple[Term, ...]:
        """Terms of V̇; raises unless V is C¹ and V̇ affine in all parameters with ranges."""
        kinks = [t for t in self.lyapunov for _, a, kind in t.factors if a < 1 or (kind == "a" and a == 1)]
        require(not kinks, "a term of V is not continuously differentiable.")
        rates = (rate for t in self.lyapunov for rate in lie_terms(t, self.loop.field))
        terms = collected(rates, (*self.loop.states, *self.loop.lifts))
        ranges = self.loop.ranges
        twice = {p for t in terms for p in t.parameters if p in ranges and t.parameters.count(p) > 1}
        require(not twice, f"V̇ is not affine in {', '.join(sorted(twice))}, so the ends of a range do not suffice.")
        return terms

    def sign_cells(self) -> Iterator[Cell]:
        """Every sign cell of the states; on the reals, one cell without name."""
        if self.loop.domain == "reals":
            yield Cell("", dict.fromkeys(self.loop.states, 1))
            return
        for signs in _signs(tuple(self.loop.states)):
            yield Cell(_word(signs), signs)

    @cached_property
    def cells(self) -> tuple[Cell, ...]:
        """Every sign cell of states and lifts whose interior may be nonempty."""
        if not self.loop.lifts:
            return tuple(self.sign_cells())
        possible = (self._cell(signs) for signs in _signs((*self.loop.states, *self.loop.lifts)))
        return tuple(cell for cell in possible if cell is not None)

    @cached_property
    def with_variable(self) -> tuple[str, ...]:
        """Lifts that need a cell variable, as they occur with a positive exponent; raises if a lift does not occur."""
        everything = [t for terms in (*self.loop.field.values(), *self.loop.lifts.values()) for t in terms]
        exponents: dict[str, list[Fraction]] = {lift: [] for lift in self.loop.lifts}
        for term in everything:
            for name, exponent, _ in term.factors:
                if name in exponents:
                    exponents[name].append(exponent)
        require(all(exponents.values()), "a lift does not occur in the field or in another lift.")
        return tuple(lift for lift, occurring in exponents.items() if any(occurring))

    @cached_property
    def lift_degrees(self) -> dict[str, int]:
        """Degree n of every lift's argument, a form in the cell variables."""
        degrees: dict[str, int] = {}
        for lift in self.loop.lifts:
            weights = {**self.loop.states, **degrees}
            values = {
                sum(e) for signs in _signs(tuple(weights)) for e in self._argument(lift, weights, signs)[1] or [()]
            }
            require(len(values) == 1 and min(values) >= 1, f"the argument of {lift} has no single positive degree.")
            degrees[lift] = values.pop()
        return degrees

    def _require_null_zeros(self, arguments: Mapping[str, Polynomial]) -> None:
        """Reject a lift whose argument on a cell could vanish on a set of positive measure.

        Collect the argument by powers of the states on which no lift inside it depends: one of the coefficients must
        contain no lift, and so is a nonzero polynomial in the other states. Otherwise the variable of the lift could be
        zero on an open set, where a multiplier that contains it proves nothing.
        """
        states = tuple(self.loop.states)
        depends: dict[str, set[str]] = {}
        for position, (lift, argument) in enumerate(arguments.items()):
            earlier = list(arguments)[:position]
            inner = {name for e in argument for name, x in zip(earlier, e[len(states) :], strict=False) if x}
            inside = set[str]().union(*(depends[name] for name in inner))
            own = {s for e in argument for s, x in zip(states, e, strict=False) if x}
            parts: dict[tuple[int, ...], bool] = {}
            for e in argument:
                key = tuple(x for s, x in zip(states, e, strict=False) if s not in inside)
                parts[key] = parts.get(key, False) or any(e[len(states) :])
            require(False in parts.values(), f"the argument of {lift} may vanish on an open set.")
            depends[lift] = inside | own

    def _cell(self, signs: Mapping[str, int]) -> Cell | None:
        """Cell with its conditions; None if a condition implies that the interior is empty."""
        weights = {**self.loop.states, **self.lift_degrees}
        equalities, inequalities = [], []
        whole = {lift: self._argument(lift, weights, signs) for lift in self.loop.lifts}
        self._require_null_zeros({lift: high for lift, (_, high) in whole.items()})
        for lift, (low, high) in whole.items():
            if lift in self.with_variable:
                position = len(self.loop.states) + self.with_variable.index(lift)
                power = tuple(self.lift_degrees[lift] * (i == position) for i in range(self.variables))
                equality = [(Fraction(signs[lift]), {power: Fraction(1)}), (Fraction(-1), self._of_variables(high))]
                equalities.append(combination(equality))
                if len({c > 0 for c in equalities[-1].values()}) == 1:
                    return None
            else:
                largest = self._of_variables(high if signs[lift] > 0 else low)
                inequalities.append({e: signs[lift] * c for e, c in largest.items()})
                if all(c < 0 for c in inequalities[-1].values()):
                    return None
        _require_different(inequalities, [lift for lift in self.loop.lifts if lift not in self.with_variable])
        return Cell(_word(signs), signs, tuple(equalities), tuple(inequalities))

    @property
    def variables(self) -> int:
        """Number of cell variables of states and lifts."""
        return len(self.loop.states) + len(self.with_variable)

    def _argument(
        self, lift: str, weights: Mapping[str, int], signs: Mapping[str, int]
    ) -> tuple[Polynomial, Polynomial]:
        """Argument of a lift on a cell, with the smallest and the largest coefficients over the ranges of roots.

        Variables and roots are non-negative, so the argument lies between the two. Raises if the sign of a coefficient
        depends on the roots.
        """
        least, largest = dict[Exponents, Fraction](), dict[Exponents, Fraction]()
        for term in self._live(lift):
            ends = [cell_polynomial((term,), weights, signs, values) for values in self._ends]
            for e in ends[1]:
                for total, c in zip((least, largest), sorted(p.get(e, Fraction(0)) for p in ends), strict=True):
                    total[e] = total.get(e, Fraction(0)) + c
        occurring = [e for e in least if least[e] or largest[e]]
        certain = all(least[e] * largest[e] > 0 for e in occurring)
        require(certain, f"the sign of a coefficient in the argument of {lift} depends on a root.")
        return {e: least[e] for e in occurring}, {e: largest[e] for e in occurring}

    @cached_property
    def _ends(self) -> tuple[dict[str, Fraction], ...]:
        """Values of all fixed parameters, once with the lower and once with the upper ends of the roots."""
        points = {name: ends for name, ends in self.loop.uncertain.items() if ends[0] == ends[1]}
        ranges = points | {name: ends for name, (_, ends) in self.loop.roots.items()}
        return tuple({**self.loop.parameters, **{name: ends[i] for name, ends in ranges.items()}} for i in (0, 1))

    def _live(self, lift: str) -> tuple[Term, ...]:
        """Terms of a lift whose parameters are all nonzero.

        Raises if a parameter has a range; a root may have one if only the sign of the lift occurs.
        """
        parameters, (low, high) = self.loop.parameters, self._ends
        live = tuple(t for t in self.loop.lifts[lift] if all(parameters.get(p, Fraction(1)) for p in t.parameters))
        names = [p for t in live for p in t.parameters]
        vague = [p for p in names if p not in low or (lift in self.with_variable and low[p] < high[p])]
        require(
            not vague,
            f"the argument of a lift has a parameter with a range, {', '.join(vague[:1])}. "
            "Choose gains for which this parameter is a rational number.",
        )
        return live

    def _of_variables(self, polynomial: Polynomial) -> dict[Exponents, Fraction]:
        """Polynomial without the exponents of lifts that have no variable."""
        names = (*self.loop.states, *self.loop.lifts)
        places = [i for i, name in enumerate(names) if name not in self.loop.lifts or name in self.with_variable]
        return combination([(c, {tuple(e[i] for i in places): Fraction(1)}) for e, c in polynomial.items()])

    def vertices(self) -> Iterator[tuple[str, dict[str, Fraction]]]:
        """Every vertex of the box of ranges with its name."""
        ranges = self.loop.ranges
        for values in product(*(sorted(set(ends)) for ends in ranges.values())):
            vertex = dict(zip(ranges, values, strict=True))
            yield " ".join(f"{name}={v}" for name, v in vertex.items()), vertex

    def function(self, claim: str = "positive") -> Iterator[tuple[str, dict[Exponents, Fraction]]]:
        """V on every sign cell of the states; the names begin with `claim`."""
        for cell in self.sign_cells():
            yield " ".join(filter(None, (claim, cell.name))), self.potential(cell.signs)

    def potential(self, signs: Mapping[str, int]) -> dict[Exponents, Fraction]:
        """V on one cell, in the variables of the states."""
        states = {s: signs[s] for s in self.loop.states}
        if self.loop.domain == "reals":
            return real_polynomial(self.lyapunov, tuple(states), self.loop.parameters)
        return cell_polynomial(self.lyapunov, self.loop.states, states, self.loop.parameters)

    def decrease(self, claim: str) -> Iterator[tuple[Cell, Obligation]]:
        """−V̇ on every cell and vertex; the names begin with `claim`."""
        for cell in self.cells:
            for vertex, values in self.vertices():
                name = " ".join(filter(None, (claim, cell.name, vertex)))
                polynomial = {e: -c for e, c in self._rate(cell.signs, values).items()}
                yield cell, Obligation(name, polynomial, cell.equalities, cell.inequalities)

    def _rate(self, signs: Mapping[str, int], vertex: Mapping[str, Fraction]) -> dict[Exponents, Fraction]:
        values = {**self.loop.parameters, **vertex}
        if self.loop.domain == "reals":
            return real_polynomial(self.derivative, tuple(self.loop.states), values)
        weights = {**self.loop.states, **self.lift_degrees}
        return self._of_variables(cell_polynomial(self.derivative, weights, signs, values))


def _require_different(inequalities: Sequence[Polynomial], lifts: Sequence[str]) -> None:
    """Reject sign conditions proportional to each other or to a variable, as the solvers accept no duplicates."""
    largest = [max(map(abs, p.values())) for p in inequalities]
    scaled = {tuple(sorted((e, c / m) for e, c in p.items())) for p, m in zip(inequalities, largest, strict=True)}
    require(
        len(scaled) == len(inequalities) and not any(len(p) == 1 and sum(p[0][0]) == 1 for p in scaled),
        f"the signs of {', '.join(lifts)} coincide, or one is that of a state. Use one lift, or ⌈x⌋⁰ of the state x.",
    )


def _signs(names: tuple[str, ...]) -> Iterator[dict[str, int]]:
    for signs in product((1, -1), repeat=len(names)):
        yield dict(zip(names, signs, strict=True))


def _word(signs: Mapping[str, int]) -> str:
    return "".join("+" if s > 0 else "-" for s in signs.values())


def different(obligations: Iterable[Obligation]) -> Iterator[Obligation]:
    """Obligations without duplicates: the first one of every key."""
    seen = set[tuple[object, ...]]()
    for one in obligations:
        key = one.key
        if key not in seen:
            seen.add(key)
            yield one


def obligation_degree(polynomials: Sequence[Polynomial], what: str) -> int:
    """Common degree of forms.

    Raises
    ------
    CertificateError
        When there are no forms, or their degrees differ.
    """
    degrees = {sum(exponents) for p in polynomials for exponents in p}
    require(len(degrees) == 1 and min(degrees) >= 1, f"{what} is not homogeneous of one positive degree.")
    require(all(polynomials), f"{what} vanishes on a cell.")
    return degrees.pop()


def power_sum(chosen: int, power: int, variables: int) -> dict[Exponents, Fraction]:
    """Σ u_i^power over the first `chosen` of the variables."""
    return {tuple(power if j == i else 0 for j in range(variables)): Fraction(1) for i in range(chosen)}


def claimed(loop: Loop, lyapunov: tuple[Term, ...], claims: Mapping[str, Fraction]) -> Iterator[Obligation]:
    """Every obligation of a certificate with the polynomial that must be non-negative, in the order of FORMAT.md."""
    obligations = Obligations(loop, lyapunov)
    states = len(loop.states)
    function = list(obligations.function())
    m = obligation_degree([p for _, p in function], "V")
    require(loop.domain == "cells" or m % 2 == 0, "the degree of V on the reals must be even.")
    for name, polynomial in function:
        yield Obligation(name, less(polynomial, claims["positive"], power_sum(states, m, states)))
    for i, state in enumerate(loop.states):
        for name, polynomial in obligations.function(f"bound_{state}") if f"bound_{state}" in claims else ():
            corner = {tuple(m if j == i else 0 for j in range(states)): Fraction(1)}
            yield Obligation(name, less(polynomial, claims[f"bound_{state}"], corner))
    second = "decrease" if loop.domain == "cells" else "rate"
    decrease = list(obligations.decrease(second))
    n = obligation_degree([o.polynomial for _, o in decrease], "V̇")
    require(second == "decrease" or m == n, "the claim 'rate' requires V and V̇ of the same degree.")
    doubled = {e: 2 * c for e, c in function[0][1].items()}
    margin = power_sum(states, n, obligations.variables) if second == "decrease" else doubled
    for _, one in decrease:
        polynomial = less(one.polynomial, claims[second], margin)
        yield Obligation(one.name, polynomial, one.equalities, one.inequalities)
    if "decay" in claims:
        for cell, one in decrease:
            yield with_decay(obligations, cell, one, claims["decay"], m, n)


def with_decay(obligations: Obligations, cell: Cell, one: Obligation, rate: Fraction, m: int, n: int) -> Obligation:
    """Obligation −V̇ − κv^n ≥ 0 with v^m = V on a cell, from that of −V̇; κ is `rate`."""
    states, width = len(obligations.loop.states), len(next(iter(one.polynomial))) + 1
    potential = {(*e, *(0,) * (width - states)): c for e, c in obligations.potential(cell.signs).items()}
    last = {(*(0,) * (width - 1), m): Fraction(1)}

    def wider(p: Polynomial) -> dict[Exponents, Fraction]:
        return {(*e, 0): c for e, c in p.items()}

    return Obligation(
        name="decay" + one.name.removeprefix("decrease"),
        polynomial=less(wider(one.polynomial), rate, {(*(0,) * (width - 1), n): Fraction(1)}),
        equalities=(*map(wider, one.equalities), less(last, Fraction(1), potential)),
        inequalities=tuple(map(wider, one.inequalities)),
    )


def less(polynomial: Polynomial, factor: Fraction, other: Polynomial) -> dict[Exponents, Fraction]:
    """Polynomial − factor · other, without zero coefficients."""
    difference = dict(polynomial)
    for e, c in other.items():
        difference[e] = difference.get(e, Fraction(0)) - factor * c
    return {e: c for e, c in difference.items() if c}


# ----------------------------------------------------------------------
# Proof of one obligation: an identity with sums of squares on a cell.


def statement_of(one: Obligation, domain: str, multiplier: Polynomial | None = None) -> Statement:
    """Statement that a witness of an obligation proves.

    On cells all variables are non-negative, and squares may be multiplied by products of different variables and by one
    sign condition. The degree is that of the form multiplier · P.
    """
    size = width(one)
    factor = constant(size) if multiplier is None else multiplier
    plain = domain == "cells"
    variables = tuple({tuple(int(i == j) for j in range(size)): Fraction(1)} for i in range(size)) if plain else ()
    return Statement(
        variables=tuple(f"u{i}" for i in range(size)),
        polynomial=one.polynomial,
        inequalities=(*variables, *one.inequalities),
        equalities=one.equalities,
        products=_products(len(variables), len(one.inequalities)),
        degree=degree(one.polynomial) + degree(factor),
        multiplier=factor,
    )


def width(one: Obligation) -> int:
    """Number of variables of an obligation; one for the zero polynomial without conditions."""
    for p in (one.polynomial, *one.equalities, *one.inequalities):
        for e in p:
            return len(e)
    return 1


@cache
def _products(variables: int, conditions: int) -> tuple[tuple[int, ...], ...]:
    subsets = [s for size in range(variables + 1) for s in combinations(range(variables), size)]
    with_condition = [(*s, variables + k) for k in range(conditions) for s in subsets]
    return (*subsets, *with_condition)


def proves(one: Obligation, witness: Witness, domain: str) -> bool:
    """Whether a witness proves an obligation, in exact arithmetic; False for a malformed witness.

    The multiplier has positive coefficients, so it is positive where all variables are positive, which suffices
    (FORMAT.md). On the reals, and for P = 0, the multiplier must be 1, so that every number of a file matters.
    """
    factor = witness.multiplier
    if not factor or any(c <= 0 for c in factor.values()):
        return False
    size = len(next(iter(factor)))
    if witness.conditions != len(one.inequalities):
        return False
    if any(len(e) != size for e in factor):
        return False
    if not one.polynomial:
        unused = not witness.squares and not any(witness.cofactors)
        return unused and factor == constant(size) and len(witness.cofactors) == len(one.equalities)
    if size != width(one) or (domain != "cells" and factor != constant(size)):
        return False
    proof = SumOfSquares(squares=witness.squares, cofactors=witness.cofactors)
    return identity_holds(statement_of(one, domain, factor), proof)
