"""Positive definiteness of rational matrices, decided exactly."""

from collections.abc import Sequence
from fractions import Fraction
from itertools import islice
from math import lcm
from typing import TypeVar

from flint import fmpz_mat

from quakedesign.sos.exact.work import length, longest, spend

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
    """Integers n and d with values n/d."""
    scale = lcm(*{value.denominator for value in values})
    return [value.numerator * (scale // value.denominator) for value in values], scale


def positive_definite(rows: Sequence[Sequence[Fraction]]) -> bool:
    """Whether a symmetric rational matrix is positive definite.

    Parameters
    ----------
    rows : sequence of n sequences of n Fraction
        Assumed symmetric; only then is the answer meaningful.
    """
    size = len(rows)
    spend(size * size, longest(value for row in rows for value in row))
    integers, _ = over_common_denominator([value for row in rows for value in row])
    return positive_definite_integers([integers[i * size : (i + 1) * size] for i in range(size)])


def positive_definite_integers(rows: Sequence[Sequence[int]]) -> bool:
    """Whether a symmetric integer matrix is positive definite.

    Its eigenvalues are real, so they are positive if and only if the coefficients of its characteristic polynomial
    alternate in sign, none of them zero.
    """
    bits = max((abs(v).bit_length() for row in rows for v in row), default=0)
    spend(1 + len(rows) ** 4 * (bits + 10) // 100_000)  # modulo one prime after another, some nanoseconds each
    coefficients = reversed(fmpz_mat(rows).charpoly().coeffs())
    return all((-c if power % 2 else c) > 0 for power, c in enumerate(coefficients))


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
        if not pivot:
            continue
        spend(6 * (size - k) ** 2, max(length(v) for row in block[k:] for v in row[k:]))
        for i in range(k + 1, size):
            factor = block[i][k] / pivot
            for j in range(k + 1, size) if factor else ():
                block[i][j] -= factor * block[k][j]
    return True
