"""Sparse polynomials with rational coefficients, and exact positive definiteness."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cache, reduce
from itertools import combinations_with_replacement, islice
from math import lcm
from operator import add
from typing import Any, TypeVar

from flint import fmpq, fmpq_mpoly, fmpq_mpoly_ctx, fmpz_mat

from quakedesign.errors import PolynomialError
from quakedesign.exact import fraction_of, fraction_of_float, to_sympy
from quakedesign.sos.exact.work_budget import counted, expanded, length, longest, spend

# ----------------------------------------------------------------------
# Sparse polynomials with rational coefficients: exponents to nonzero coefficient.

Exponents = tuple[int, ...]
Polynomial = Mapping[Exponents, Fraction]
"""Sparse polynomial: exponents to nonzero rational coefficient."""


@cache
def ring(variables: int) -> fmpq_mpoly_ctx:
    """Multivariate polynomial ring over ℚ (python-flint context)."""
    return fmpq_mpoly_ctx.get([f"u{i}" for i in range(variables)], "degrevlex")


def element(polynomial: Polynomial, variables: int) -> fmpq_mpoly:
    """Element of the ring."""
    spend(len(polynomial), longest(polynomial.values()))  # the conversion computes a common denominator
    entries = {e: fmpq(c.numerator, c.denominator) for e, c in polynomial.items() if c}
    return ring(variables).from_dict(entries)


def mapping(polynomial: fmpq_mpoly) -> dict[Exponents, Fraction]:
    """Sparse form of an element of the ring."""
    return {tuple(map(int, e)): fraction_of(c) for e, c in polynomial.to_dict().items()}


def product(variables: int, factors: Iterable[Polynomial]) -> dict[Exponents, Fraction]:
    """Product of polynomials; the constant 1 if there are no factors."""
    factors, one = list(factors), constant(variables)
    others = [f for f in factors if f != one]
    if len(others) < 2:
        return dict(others[0]) if others else one
    return mapping(reduce(multiplied, (element(f, variables) for f in others)))


def multiplied(left: fmpq_mpoly, right: fmpq_mpoly) -> fmpq_mpoly:
    """Product of two elements of the ring; its work is counted in advance."""
    if counted():
        spend(len(left) * len(right), _height(left) + _height(right))
    result = left * right
    expanded(len(result))
    return result


def _height(polynomial: fmpq_mpoly) -> int:
    """Bit length of the longest coefficient."""
    return max((int(c.height_bits()) for c in polynomial.coeffs()), default=0)


def constant(variables: int, value: Fraction = Fraction(1)) -> dict[Exponents, Fraction]:
    """Constant polynomial."""
    return {(0,) * variables: value} if value else {}


def combination(parts: Iterable[tuple[Fraction, Polynomial]]) -> dict[Exponents, Fraction]:
    """Σ c·p."""
    total: dict[Exponents, Fraction] = {}
    for factor, part in parts:
        for e, c in part.items():
            total[e] = total.get(e, Fraction(0)) + factor * c
    return {e: c for e, c in total.items() if c}


def square_factor(
    polynomial: Polynomial, variables: int
) -> tuple[dict[Exponents, Fraction], dict[Exponents, Fraction]]:
    """Polynomials s and r with p = s²·r and r free of square factors."""
    _, factors = element(polynomial, variables).factor_squarefree()
    root = ring(variables).constant(1)
    for factor, power in factors:
        root *= factor ** (power // 2)
    rest, remainder = divmod(element(polynomial, variables), root * root)
    assert not remainder
    return mapping(root), mapping(rest)


def degree(polynomial: Polynomial) -> int:
    """Total degree; 0 for the zero polynomial."""
    return max((sum(e) for e in polynomial), default=0)


def evaluate(polynomial: Polynomial, point: Sequence[Fraction]) -> Fraction:
    """Exact value at a rational point."""
    total = Fraction(0)
    for e, c in polynomial.items():
        powers = sum(x * length(v) for x, v in zip(e, point, strict=True) if x)
        spend(12, powers + length(c) + length(total))  # two operations on fractions, each six on integers
        total += c * monomial(point, e)
    return total


def monomial(values: Sequence[Fraction], exponents: Exponents) -> Fraction:
    """Π values_i^exponents_i."""
    result = Fraction(1)
    for v, e in zip(values, exponents, strict=True):
        if e:
            result *= Fraction(v) ** e
    return result


def rescaled(polynomial: Polynomial, scale: Sequence[Fraction]) -> dict[Exponents, Fraction]:
    """Polynomial in ũ that results from u_i = scale_i·ũ_i."""
    return {e: c * monomial(scale, e) for e, c in polynomial.items()}


def times(left: Exponents, right: Exponents) -> Exponents:
    """Exponents of the product of two monomials in the same variables."""
    return tuple(map(add, left, right))


def monomials(variables: int, most: int, least: int = 0) -> Iterator[Exponents]:
    """All exponents of total degree least … most, lowest degree first."""
    for total in range(least, most + 1):
        for chosen in combinations_with_replacement(range(variables), total):
            exponents = [0] * variables
            for i in chosen:
                exponents[i] += 1
            yield tuple(exponents)


def from_sympy(expression: Any, variables: Sequence[Any]) -> dict[Exponents, Fraction]:
    """Sparse form of a SymPy polynomial with rational coefficients; floats are read by `fraction_of_float`.

    Raises
    ------
    PolynomialError
        When the expression is not such a polynomial.
    """
    import sympy as sp

    try:
        whole = expression.as_expr()
        floats = {f: to_sympy(fraction_of_float(f)) for f in whole.atoms(sp.Float)}  # "QQ" accepts floats inexactly
        terms = sp.Poly(whole.xreplace(floats), *variables, domain="QQ").terms()
    except (AttributeError, sp.polys.polyerrors.BasePolynomialError) as error:  # relations and matrices have no as_expr
        raise PolynomialError(
            f"a polynomial in {', '.join(map(str, variables))} with rational coefficients is needed. "
            f"Received {str(expression)[:80]} ({error}). Write floats as exact rationals."
        ) from None
    return {tuple(e): fraction_of(c) for e, c in terms if c}


# ----------------------------------------------------------------------
# Positive definiteness of rational matrices, decided exactly.

Entry = TypeVar("Entry", int, Fraction)


def full_matrix(upper: Sequence[Entry], size: int) -> list[list[Entry]]:
    """Symmetric matrix (size × size) from its upper triangle, row by row.

    Raises
    ------
    ValueError
        When the number of entries is not size(size+1)/2.
    """
    if len(upper) != size * (size + 1) // 2:
        raise ValueError(f"an upper triangle of size {size} has {size * (size + 1) // 2} entries, not {len(upper)}.")
    rows: list[list[Entry]] = []
    entries = iter(upper)
    for i in range(size):
        mirrored = [row[i] for row in rows]
        rows.append(mirrored + list(islice(entries, size - i)))
    return rows


def over_common_denominator(values: Sequence[Fraction]) -> tuple[list[int], int]:
    """Integers n and d such that the values are n/d."""
    scale = lcm(*{value.denominator for value in values})
    return [value.numerator * (scale // value.denominator) for value in values], scale


def positive_definite(rows: Sequence[Sequence[Fraction]]) -> bool:
    """Whether a symmetric rational matrix is positive definite.

    Parameters
    ----------
    rows : sequence of n sequences of n Fraction
        Assumed symmetric; the result is meaningless otherwise.
    """
    size = len(rows)
    spend(size * size, longest(value for row in rows for value in row))
    integers, _ = over_common_denominator([value for row in rows for value in row])
    return positive_definite_integers([integers[i * size : (i + 1) * size] for i in range(size)])


def positive_definite_integers(rows: Sequence[Sequence[int]]) -> bool:
    """Whether a symmetric integer matrix is positive definite.

    The eigenvalues are real, so they are all positive if and only if the coefficients of the characteristic polynomial
    are nonzero and alternate in sign.
    """
    bits = max((abs(v).bit_length() for row in rows for v in row), default=0)
    # the algorithm works modulo many primes; an operation takes a few nanoseconds
    spend(1 + len(rows) ** 4 * (bits + 10) // 100_000)
    coefficients = reversed(fmpz_mat(rows).charpoly().coeffs())
    return all((-c if power % 2 else c) > 0 for power, c in enumerate(coefficients))


def nonnegative_definite(rows: Sequence[Sequence[Fraction]]) -> bool:
    """Whether a symmetric rational matrix is positive semidefinite, by exact symmetric elimination.

    The matrix is first split into its connected blocks. A zero pivot is admissible only if its row is zero.

    Parameters
    ----------
    rows : sequence of n sequences of n Fraction
        Assumed symmetric.
    """
    blocks = ([[rows[i][j] for j in chosen] for i in chosen] for chosen in _components(rows))
    return all(positive_definite(block) or _eliminates(block) for block in blocks)


def _components(rows: Sequence[Sequence[Fraction]]) -> list[list[int]]:
    """Index sets of the connected blocks; entries between blocks are zero."""
    left, components = set(range(len(rows))), []
    while left:
        frontier, block = [min(left)], []
        left.discard(frontier[0])
        while frontier:
            i = frontier.pop()
            block.append(i)
            near = [j for j in left if rows[i][j]]
            left.difference_update(near)
            frontier += near
        components.append(sorted(block))
    return components


def _eliminates(block: list[list[Fraction]]) -> bool:
    size = len(block)
    for k in range(size):
        pivot = block[k][k]
        if pivot < 0 or (pivot == 0 and any(block[k][j] for j in range(k + 1, size))):
            return False
        if not pivot:
            continue
        spend(6 * (size - k) ** 2, max(length(v) for row in block[k:] for v in row[k:]))
        for i in range(k + 1, size):
            factor = block[i][k] / pivot
            for j in range(k + 1, size) if factor else ():
                block[i][j] -= factor * block[k][j]
    return True
