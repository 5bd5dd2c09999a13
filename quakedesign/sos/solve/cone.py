"""The cone Σ u^m · bᵀQb as linear algebra: one sparse matrix from Gram entries to coefficients."""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, combinations_with_replacement
from typing import Any

from quakedesign.sos.exact.witness import Exponents, Polynomial


@dataclass(frozen=True)
class Cone:
    """Forms of one degree that are sums of squares times squarefree monomials.

    Attributes
    ----------
    variables, degree : int
    orthant : bool
        Squarefree multipliers of matching parity if True, none otherwise.
    """

    variables: int
    degree: int
    orthant: bool

    @cached_property
    def monomials(self) -> tuple[Exponents, ...]:
        """All exponents of the degree."""
        return _monomials(self.variables, self.degree)

    @cached_property
    def blocks(self) -> tuple[tuple[Exponents, tuple[Exponents, ...]], ...]:
        """Multiplier and basis of every block."""
        found = []
        for size in range(self.degree % 2, min(self.variables, self.degree) + 1, 2) if self.orthant else (0,):
            for chosen in combinations(range(self.variables), size):
                times = tuple(int(i in chosen) for i in range(self.variables))
                found.append((times, _monomials(self.variables, (self.degree - size) // 2)))
        return tuple(found)

    @cached_property
    def positions(self) -> dict[Exponents, list[tuple[int, int, int]]]:
        """Gram entries (block, row, column ≥ row) that feed each monomial."""
        feeding: dict[Exponents, list[tuple[int, int, int]]] = {e: [] for e in self.monomials}
        for k, (times, basis) in enumerate(self.blocks):
            for i, left in enumerate(basis):
                for j in range(i, len(basis)):
                    key = tuple(a + b + c for a, b, c in zip(times, left, basis[j], strict=True))
                    feeding[key].append((k, i, j))
        return feeding

    @cached_property
    def maps(self) -> list[Any]:
        """For every block the sparse matrix from vec(Q) (column major) to coefficients."""
        from scipy.sparse import coo_array

        entries: list[tuple[list[int], list[int]]] = [([], []) for _ in self.blocks]
        for row, e in enumerate(self.monomials):
            for k, i, j in self.positions[e]:
                size = len(self.blocks[k][1])
                for column in {i + j * size, j + i * size}:
                    entries[k][0].append(row)
                    entries[k][1].append(column)
        shapes = [(len(self.monomials), len(basis) ** 2) for _, basis in self.blocks]
        return [
            coo_array(([1.0] * len(rows), (rows, columns)), shape=shape).tocsr()
            for (rows, columns), shape in zip(entries, shapes, strict=True)
        ]

    def vector(self, polynomial: Polynomial) -> list[float]:
        """Coefficients in the order of `monomials`, as floats."""
        return [float(polynomial.get(e, 0)) for e in self.monomials]


def _monomials(variables: int, degree: int) -> tuple[Exponents, ...]:
    found = []
    for chosen in combinations_with_replacement(range(variables), degree):
        found.append(tuple(chosen.count(i) for i in range(variables)))
    return tuple(found)
