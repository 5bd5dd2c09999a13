"""Search for a proof of positivity: methods and multipliers.

Methods: Gram matrices by conic programming with rounding, and factorisation into a square and a cofactor. Multipliers
are powers of 1 + Σx_i² (or a similar sum), or sums of squares found in floating point. Exact arithmetic decides every
proof.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache
from importlib.metadata import version
from math import comb
from time import perf_counter
from typing import Any, ClassVar

from quakedesign.errors import PolynomialError, WorkError
from quakedesign.exact import nearest, rational
from quakedesign.sos.exact.answer import Answer, Positivity
from quakedesign.sos.exact.polynomial import (
    Exponents,
    Polynomial,
    combination,
    constant,
    degree,
    from_sympy,
    monomials,
    product,
    rescaled,
    square_factor,
)
from quakedesign.sos.exact.polynomial_statement import Statement, statement
from quakedesign.sos.exact.polynomial_text import read
from quakedesign.sos.exact.proofs import (
    Proof,
    SumOfSquares,
    as_element,
    as_polynomial,
    in_echelon_form,
    invariant,
    multiplier_is_positive,
)
from quakedesign.sos.solve.decide import StatementSearch, block_sizes, strict_proof
from quakedesign.sos.solve.joint import Demand, joint_program
from quakedesign.sos.solve.rounding import scaled

# ----------------------------------------------------------------------
# Multipliers of a polynomial P on ℝⁿ: powers of 1 + Σx_i², and sums of squares found by a search.
#
# For a sum of squares σ of given degree, the condition that σ·P is a sum of squares is a linear conic constraint on σ.
# σ is computed in floating point and scaled variables, rounded, and proved to be a sum of squares. The caller decides
# σ·P exactly.

_TERMS = 40  # largest number of terms of σ, so that the programme is solved within seconds
_GRID = 2**8  # denominator of its coefficients
_LEAST = 1e-5  # least margin of σ, whose coefficients are at most one


def searched(variables: tuple[str, ...], polynomial: Polynomial, top: int) -> Polynomial | None:
    """Sum of squares σ of given degree such that σ·P may be a sum of squares; None if not found.

    σ is a form if P is a form.
    """
    moved = scaled(statement(variables, polynomial))
    target = moved.statement.polynomial
    used = [i for i in range(len(variables)) if any(e[i] for e in target)]
    form = len({sum(e) for e in target}) == 1
    terms = [
        e
        for e in monomials(len(variables), top, top if form else 0)
        if not any(k for i, k in enumerate(e) if i not in used) and invariant(moved.statement, e)
    ]
    values = _centred(variables, target, terms) if 0 < len(terms) <= _TERMS else None
    if values is None:
        return None
    rounded = {e: nearest(v, _GRID) for e, v in zip(terms, values, strict=True)}
    multiplier = rescaled({e: c for e, c in rounded.items() if c}, tuple(1 / s for s in moved.scale))
    return multiplier if strict_proof(statement(variables, multiplier)) is not None else None


def _centred(variables: tuple[str, ...], target: Polynomial, terms: list[Exponents]) -> list[float] | None:
    """Coefficients of σ, each of size at most 1, with the largest t such that σ − t·Σ m² and σ·P are sums of squares.

    m² are the terms of σ with even exponents.
    """
    squares = {e: Fraction(1) for e in terms if not any(k % 2 for k in e)}
    own: list[Polynomial] = [{e: Fraction(1)} for e in terms]
    multiplied = [product(len(variables), (target, p)) for p in own]
    demands = [_demand(variables, own, squares), _demand(variables, multiplied, {})]
    proposal = joint_program(demands).solve(demands)
    return proposal.decision if proposal is not None and proposal.margin > _LEAST else None


def _demand(variables: tuple[str, ...], parts: Sequence[Polynomial], margin: Polynomial) -> Demand:
    template = statement(variables, {e: Fraction(1) for p in (*parts, margin) for e in p})
    return Demand(template=template, parts=parts, margin=margin)


class Method(ABC):
    """A search method for proofs, whose proposals are checked in exact arithmetic.

    Attributes
    ----------
    name : str
    order : int
        Rank by cost; the cheapest method, with the lowest order, is tried first.
    """

    name: ClassVar[str]
    order: ClassVar[int]

    @abstractmethod
    def propose(self, statement: Statement) -> Proof | None:
        """Proof of exactly this statement, whose target is nonzero; None if none is found."""


@cache
def methods() -> tuple[Method, ...]:
    """All methods, in the order in which they are tried."""
    return SquareFactor(), Conic()


# ----------------------------------------------------------------------
# Decisions about positivity, with a proof or ``undecided``.

_GROWTH = (0, 2)
_SEARCHED = (2, 4)  # degrees of searched multipliers
_LARGEST_RETRY = 60  # largest number of monomials in a basis for a further attempt, which then takes seconds


def prove(
    polynomial: Any,
    *,
    on: Sequence[Any] = (),
    multiplier: Any = None,
    variables: Sequence[Any] | None = None,
    margin: Any = 0,
    products: bool | None = None,
    degree_bound: int | None = None,
) -> Answer:
    """Decide whether a polynomial is a sum of squares, or has a sum-of-squares proof of positivity on a set.

    Parameters
    ----------
    polynomial : str, SymPy expression or mapping of exponents to Fraction
        With rational coefficients; text in the grammar of `quakedesign.sos.exact.polynomial_text`.
    on : sequence of str or SymPy relation
        Constraints of the set such as ``"x >= 0"``, ``"x^2 + y^2 <= 1"``, ``"x*y == 1"``; ℝⁿ unless given.
    multiplier : str, SymPy expression or mapping, optional
        multiplier · polynomial is decided instead. ``"auto"`` tries powers of 1 + Σx_i² (of Σx_i² for forms, of Σx_i
        for forms on the orthant) up to the third. On ℝⁿ the sums contain only variables of the polynomial without its
        square factor, and before the first and the second power a search proposes a sum of squares of the same degree.
    variables : sequence of str or Symbol, optional
        Variables in order; by default in order of appearance.
    margin : rational, optional
        Decide p − margin·Σ x_i^d instead for a form p of degree d, and p − margin·(1 + Σ x_i^d) for any other p.
    products : bool, optional
        All squarefree products of inequalities if True, single inequalities only if False. By default products of
        inequalities that are variables, and the others singly.
    degree_bound : int, optional
        Largest degree of a summand. By default the smallest even degree possible and, on a constrained set, also the
        next even degree.

    Returns
    -------
    Answer
        Its ``verdict`` is ``sos``, ``not-sos``, ``negative`` or ``undecided``; every proof returned is checked.

    Raises
    ------
    PolynomialError
        When the input is not readable, the multiplier is not proved to be positive, the margin is negative or given for
        an odd degree, or the Gram matrices are too large for the solver.
    """
    start = perf_counter()
    names, given, inequalities, equalities, factor = read(polynomial, on, multiplier, variables)
    exact = _with_margin(given, margin, len(names))
    growth = _GROWTH if (inequalities or equalities) and degree_bound is None else (0,)
    answer: Answer | None = None
    for chosen in _multipliers(names, exact, factor, inequalities, equalities):
        for more in growth:
            problem = statement(
                names,
                exact,
                inequalities=inequalities,
                equalities=equalities,
                multiplier=chosen,
                products=products,
                degree_bound=degree_bound,
                more=more,
            )
            if answer is not None and _largest_basis(problem) > _LARGEST_RETRY:
                continue
            decided = decide(problem)
            if decided.verdict in (Positivity.SOS, Positivity.NEGATIVE):
                return replace(decided, seconds=perf_counter() - start)
            answer = decided if answer is None or answer.verdict is Positivity.UNDECIDED else answer
    assert answer is not None
    return replace(answer, seconds=perf_counter() - start)


def _largest_basis(statement: Statement) -> int:
    """Number of monomials up to half the degree; on ℝⁿ for the cofactor without square factor and its variables."""
    if statement.inequalities or statement.equalities or not statement.target:
        return _basis_size(statement.degree, len(statement.variables))
    rest = square_factor(statement.target, len(statement.variables))[1]
    return _basis_size(degree(rest), sum(any(powers) for powers in zip(*rest, strict=True)))


def _basis_size(top: int, variables: int) -> int:
    return comb(top // 2 + variables, variables)


def decide(statement: Statement) -> Answer:
    """Search for a proof of exactly the given statement.

    Raises
    ------
    PolynomialError
        When the multiplier is not proved to be positive, or the Gram matrices are too large for the solver.
    """
    squares, start = _squares_of_multiplier(statement), perf_counter()
    none = Answer(statement=statement, proof=None, blocks=block_sizes(statement), versions=versions())
    nothing = SumOfSquares(squares=(), cofactors=tuple({} for _ in statement.equalities))
    proposed = (method.propose(statement) for method in methods()) if statement.target else (nothing,)
    multiplied = (replace(p, multiplier=squares) if isinstance(p, SumOfSquares) else p for p in proposed)
    answers = (replace(none, proof=proof) for proof in multiplied if proof is not None)
    return replace(next(filter(_decides, answers), none), seconds=perf_counter() - start)


def _decides(answer: Answer) -> bool:
    """Whether the proof of an answer is valid and can be checked within the work budget."""
    try:
        return answer.check()
    except WorkError:
        return False


def versions() -> dict[str, str]:
    """Versions of the packages on which an answer depends."""
    return {name: version(name) for name in ("quakedesign", "clarabel", "python-flint")}


def _with_margin(polynomial: Polynomial, margin: Any, size: int) -> Polynomial:
    amount = rational(margin, "margin")
    if not amount:
        return polynomial
    top = degree(polynomial)
    if top % 2 or amount < 0:
        raise PolynomialError(
            "a margin must be positive, and needs a polynomial of even degree. "
            f"Received the margin {margin} and the degree {top}."
        )
    powers = {tuple(top * (i == j) for j in range(size)): Fraction(1) for i in range(size)}
    if any(sum(e) != top for e in polynomial):
        powers[(0,) * size] = Fraction(1)
    return combination([(Fraction(1), polynomial), (-amount, powers)])


def _multipliers(names: Any, polynomial: Any, factor: Any, inequalities: Any, equalities: Any) -> Iterator[Any]:
    """Multipliers to try: the given one, or for ``"auto"`` 1, then searched multipliers and powers by degree."""
    if factor != "auto":
        yield factor
        return
    size, free = len(names), not inequalities and not equalities and polynomial
    if free:
        polynomial = square_factor(polynomial, size)[1]
    top = degree(polynomial)
    form = all(sum(e) == top for e in polynomial)
    used = [any(e[i] for e in polynomial) or bool(inequalities or equalities) for i in range(size)]
    orthant = inequalities and not equalities and all(Statement.is_variable(g) for g in inequalities)
    step = 1 if orthant and form else 2
    base: dict[Any, Any] = {tuple(step * (i == j) for j in range(size)): Fraction(1) for i in range(size) if used[i]}
    if not form or not base:
        base[(0,) * size] = Fraction(1)
    for k in range(4):
        if free and 2 * k in _SEARCHED and _basis_size(top + 2 * k, sum(used)) <= _LARGEST_RETRY:
            own = searched(names, polynomial, 2 * k)
            yield from () if own is None else (own,)
        yield product(size, [base] * k)


def _squares_of_multiplier(claim: Statement) -> Any:
    """Sum of squares of the multiplier; empty if its coefficients show that it is positive."""
    if multiplier_is_positive(claim, ()):
        return ()
    own = statement(
        claim.variables,
        claim.multiplier,
        inequalities=claim.inequalities,
        degree_bound=max(claim.degree, degree(claim.multiplier) + degree(claim.multiplier) % 2),
    )
    positive = decide(replace(own, products=claim.products))
    if isinstance(positive.proof, SumOfSquares) and multiplier_is_positive(claim, positive.proof.squares):
        return positive.proof.squares
    where = "is positive on a dense part of the set" if claim.dense else "has a sum of squares with a positive constant"
    raise PolynomialError(
        f"multiplier must be shown to be positive, that is, it {where}. This was not possible for the given one. "
        "Use for example 1 + x^2."
    )


__all__ = ["decide", "from_sympy", "prove"]


class Conic(Method):
    """Solve, round, search for a point, refute, restrict to a face; see `quakedesign.sos.solve.decide`."""

    name: ClassVar[str] = "conic"
    order: ClassVar[int] = 2

    def propose(self, statement: Statement) -> Proof | None:
        """See `Method.propose`."""
        return StatementSearch(statement).run()


# ----------------------------------------------------------------------
# Polynomials with a square factor.


class SquareFactor(Method):
    """Proof for s²·r from a proof for r."""

    name: ClassVar[str] = "square-factor"
    order: ClassVar[int] = 1

    def propose(self, claim: Statement) -> SumOfSquares | None:
        """See `Method.propose`; also None if no sum of squares is found for r.

        Both P (multiplier retained) and multiplier·P (multiplier 1) are factored into s²·r. The second may move a
        factor of the multiplier into s², although the proof for r needs it.
        """
        count = len(claim.variables)
        whole = replace(claim, polynomial=claim.target, multiplier=constant(count))
        parts = {degree(root): (root, replace(part, polynomial=rest))
                 for part in (claim, whole) for root, rest in [square_factor(part.polynomial, count)]}  # fmt: skip
        proofs = (_multiplied(*parts[d], claim.degree - 2 * d) for d in sorted(parts, reverse=True) if d)
        return next((proof for proof in proofs if proof is not None), None)


def _multiplied(root: Polynomial, left: Statement, bound: int) -> SumOfSquares | None:
    """Proof for root²·P from a proof for P, the polynomial of the given statement, with a given degree bound."""
    inner = decide(replace(left, degree=bound)).proof if bound >= 0 else None
    if not isinstance(inner, SumOfSquares):
        return None
    count = len(left.variables)
    squares = tuple(
        in_echelon_form(replace(s, basis=tuple(as_element(product(count, (root, as_polynomial(b)))) for b in s.basis)))
        for s in inner.squares
    )
    return SumOfSquares(squares=squares, cofactors=tuple(product(count, (root, root, q)) for q in inner.cofactors))
