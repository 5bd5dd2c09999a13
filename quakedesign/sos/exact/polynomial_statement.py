"""Statement that multiplier · polynomial lies in the cone of a basic semialgebraic set."""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import cached_property
from itertools import combinations

from quakedesign.arguments import checked_dataclass
from quakedesign.errors import PolynomialError
from quakedesign.sos.exact.polynomial import Exponents, Polynomial, constant, degree, product

Structure = tuple[
    int,
    frozenset[Exponents],
    int,
    tuple[tuple[int, ...], ...],
    tuple[tuple[tuple[Exponents, Fraction], ...], ...],
    tuple[tuple[tuple[Exponents, Fraction], ...], ...],
]
"""Number of variables, monomials of the target, degree, products, inequalities and equalities of a statement."""


@checked_dataclass(frozen=True, kw_only=True)
class Statement:
    """multiplier · polynomial = Σ_S (Π_{i∈S} g_i)·σ_S + Σ_k q_k h_k with sums of squares σ_S, all of bounded degree.

    Attributes
    ----------
    variables : tuple of str
    polynomial : mapping of exponents to Fraction
    inequalities : tuple of Polynomial
        g_i ≥ 0 on the set; nonzero and different from each other.
    equalities : tuple of Polynomial
        h_k = 0 on the set; nonzero.
    products : tuple of tuple of int
        The index sets S, distinct and increasing, always including the empty one.
    degree : int
        Largest degree of a summand.
    multiplier : mapping of exponents to Fraction
    """

    variables: tuple[str, ...]
    polynomial: Polynomial
    inequalities: tuple[Polynomial, ...] = ()
    equalities: tuple[Polynomial, ...] = ()
    products: tuple[tuple[int, ...], ...] = ((),)
    degree: int
    multiplier: Polynomial

    def __post_init__(self) -> None:
        size = len(self.variables)
        polynomials = (self.polynomial, self.multiplier, *self.inequalities, *self.equalities)
        if len(set(self.variables)) != size or any(len(e) != size for p in polynomials for e in p):
            raise PolynomialError(f"every polynomial must be in the {size} different variables {self.variables}.")
        if not self.multiplier or not all(self.inequalities) or not all(self.equalities):
            raise PolynomialError("multiplier, inequalities and equalities must not be zero. Omit each zero one.")
        if len({tuple(sorted(g.items())) for g in self.inequalities}) < len(self.inequalities):
            raise PolynomialError("inequalities must differ from each other. Received one twice. Omit one of the two.")
        allowed = range(len(self.inequalities))
        well_formed = all(i in allowed for s in self.products for i in s) and all(
            tuple(sorted(set(s))) == s for s in self.products
        )
        if () not in self.products or len(set(self.products)) != len(self.products) or not well_formed:
            raise PolynomialError(
                f"products must be distinct increasing index sets, one of them (). Received {self.products}."
            )

    @cached_property
    def target(self) -> dict[Exponents, Fraction]:
        """multiplier · polynomial."""
        return product(len(self.variables), (self.multiplier, self.polynomial))

    @cached_property
    def structure(self) -> Structure:
        """Statement without the coefficients of the target; the reduced bases depend on this part only."""
        inequalities, equalities = (tuple(tuple(p.items()) for p in g) for g in (self.inequalities, self.equalities))
        return len(self.variables), frozenset(self.target), self.degree, self.products, inequalities, equalities

    @classmethod
    def of(cls, structure: Structure) -> "Statement":
        """Statement of a structure; every coefficient of its target is one."""
        size, support, largest, products, inequalities, equalities = structure
        return cls(
            variables=tuple(f"x{i}" for i in range(size)),
            polynomial=dict.fromkeys(support, Fraction(1)),
            inequalities=tuple(map(dict, inequalities)),
            equalities=tuple(map(dict, equalities)),
            products=products,
            degree=largest,
            multiplier=constant(size),
        )

    def weight(self, chosen: tuple[int, ...]) -> dict[Exponents, Fraction]:
        """Π_{i∈S} g_i."""
        return product(len(self.variables), (self.inequalities[i] for i in chosen))

    @cached_property
    def weights(self) -> tuple[dict[Exponents, Fraction], ...]:
        """Π_{i∈S} g_i for every S."""
        return tuple(self.weight(s) for s in self.products)

    @cached_property
    def graded(self) -> bool:
        """Whether target and constraints are forms, and the target has the statement's degree."""
        constraints = (*self.inequalities, *self.equalities)
        own = all(sum(e) == self.degree for e in self.target)
        return own and all(len({sum(e) for e in p}) == 1 for p in constraints)

    @cached_property
    def dense(self) -> bool:
        """Whether at most signs of variables are constrained; a multiplier may then vanish on a set of measure 0."""
        return not self.equalities and all(self.is_variable(g) for g in self.inequalities)

    @cached_property
    def parities(self) -> dict[int, int]:
        """Echelon basis over GF(2) of the parities of all occurring exponents: vectors by leading bit."""
        echelon: dict[int, int] = {}
        for p in (self.target, *self.inequalities, *self.equalities):
            for e in p:
                if len(echelon) == len(self.variables):
                    return echelon
                vector = residue(parity(e), echelon)
                if vector:
                    echelon[vector.bit_length()] = vector
        return echelon

    @staticmethod
    def is_variable(polynomial: Polynomial) -> bool:
        """Whether a polynomial is a positive multiple of one variable."""
        return len(polynomial) == 1 and all(sum(e) == 1 and c > 0 for e, c in polynomial.items())


def parity(exponents: Exponents) -> int:
    """Parities of the exponents as bits, one for odd."""
    return sum((x & 1) << i for i, x in enumerate(exponents))


def residue(vector: int, echelon: dict[int, int]) -> int:
    """Remainder of a vector modulo an echelon basis over GF(2)."""
    for lead in sorted(echelon, reverse=True):
        if vector >> (lead - 1) & 1:
            vector ^= echelon[lead]
    return vector


def statement(
    variables: tuple[str, ...],
    polynomial: Polynomial,
    *,
    inequalities: tuple[Polynomial, ...] = (),
    equalities: tuple[Polynomial, ...] = (),
    multiplier: Polynomial | None = None,
    products: bool | None = None,
    degree_bound: int | None = None,
    more: int = 0,
) -> Statement:
    """Statement with default products and degree bound.

    Parameters
    ----------
    variables : tuple of str
    polynomial : mapping of exponents to Fraction
    inequalities, equalities : tuple of Polynomial
    multiplier : mapping of exponents to Fraction, optional
        1 by default.
    products : bool, optional
        All squarefree products of inequalities (Schmüdgen) if True, only single inequalities (Putinar) if False. By
        default, products of inequalities that are variables (orthant), and the other inequalities singly.
    degree_bound : int, optional
        By default, the smallest even degree not below those of multiplier · polynomial and every constraint.
    more : int
        Increment of the degree bound.
    """
    size = len(variables)
    inequalities = tuple({tuple(sorted(g.items())): g for g in inequalities}.values())
    factor = constant(size) if multiplier is None else dict(multiplier)
    target = product(size, (factor, polynomial))
    least = max(degree(p) for p in (target, *inequalities, *equalities))
    bound = (degree_bound if degree_bound is not None else least + least % 2) + more
    plain = [i for i, g in enumerate(inequalities) if Statement.is_variable(g)]
    others = [i for i in range(len(inequalities)) if i not in plain]
    if products is None:
        sets = [*_subsets(plain, len(plain)), *((i,) for i in others)]
    else:
        sets = list(_subsets(range(len(inequalities)), len(inequalities) if products else 1))
    degrees = [degree(g) for g in inequalities]
    included = tuple(sorted({s for s in sets if sum(degrees[i] for i in s) <= bound} | {()}, key=lambda s: (len(s), s)))
    return Statement(
        variables=variables,
        polynomial=polynomial,
        inequalities=inequalities,
        equalities=equalities,
        products=included,
        degree=bound,
        multiplier=factor,
    )


def _subsets(indices: Sequence[int], largest: int) -> Iterator[tuple[int, ...]]:
    for size in range(largest + 1):
        yield from combinations(indices, size)
