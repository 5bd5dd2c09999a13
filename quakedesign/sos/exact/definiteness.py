"""Positive definiteness of rational matrices, decided exactly."""

from collections.abc import Sequence
from fractions import Fraction
from math import lcm


def full_matrix(upper: Sequence[Fraction], size: int) -> list[list[Fraction]]:
    """Symmetric matrix (size × size) from its upper triangle, row by row.

    Raises
    ------
    ValueError
        When the number of entries is not size(size+1)/2.
    """
    if len(upper) != size * (size + 1) // 2:
        raise ValueError(f"an upper triangle of size {size} has {size * (size + 1) // 2} entries, not {len(upper)}.")
    entries = iter(upper)
    rows = [[Fraction(0)] * size for _ in range(size)]
    for i in range(size):
        for j in range(i, size):
            rows[i][j] = rows[j][i] = next(entries)
    return rows


def positive_definite(rows: Sequence[Sequence[Fraction]]) -> bool:
    """Whether a symmetric rational matrix is positive definite (Sylvester, by fraction-free elimination).

    Parameters
    ----------
    rows : sequence of n sequences of n Fraction
        Assumed symmetric; only then is the answer meaningful.
    """
    from flint import fmpz_mat

    size = len(rows)
    scale = lcm(1, *(value.denominator for row in rows for value in row))
    integers = fmpz_mat([[value.numerator * (scale // value.denominator) for value in row] for row in rows])
    permutation, _, _, upper = integers.fflu()
    unmoved = all(permutation[i, i] == 1 for i in range(size))
    return unmoved and all(upper[i, i] > 0 for i in range(size))


def nonnegative_definite(rows: Sequence[Sequence[Fraction]]) -> bool:
    """Whether a symmetric rational matrix is non-negative definite, by exact symmetric elimination.

    A zero pivot is allowed only with a zero row; the matrix is split into its connected blocks first.

    Parameters
    ----------
    rows : sequence of n sequences of n Fraction
        Assumed symmetric.
    """
    blocks = ([[rows[i][j] for j in chosen] for i in chosen] for chosen in _components(rows))
    return all(positive_definite(block) or _eliminates(block) for block in blocks)


def _components(rows: Sequence[Sequence[Fraction]]) -> list[list[int]]:
    """Index sets between which all entries are zero."""
    left, found = set(range(len(rows))), []
    while left:
        frontier, block = [min(left)], []
        left.discard(frontier[0])
        while frontier:
            i = frontier.pop()
            block.append(i)
            near = [j for j in left if rows[i][j]]
            left.difference_update(near)
            frontier += near
        found.append(sorted(block))
    return found


def _eliminates(block: list[list[Fraction]]) -> bool:
    size = len(block)
    for k in range(size):
        pivot = block[k][k]
        if pivot < 0 or (pivot == 0 and any(block[k][j] for j in range(k + 1, size))):
            return False
        for i in range(k + 1, size) if pivot else ():
            factor = block[i][k] / pivot
            for j in range(k + 1, size) if factor else ():
                block[i][j] -= factor * block[k][j]
    return True
