"""Facial reduction: rational zeros of the target, or a rational kernel of the Gram matrix, reduce the basis.

A wrong guess costs time only, as the final proof is checked against the full statement.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from flint import fmpq, fmpq_mat
from scipy.linalg import qr

from quakedesign.exact import fraction_of
from quakedesign.sos.exact.polynomial import Exponents, Polynomial, evaluate, monomial
from quakedesign.sos.exact.proofs import Element, as_element
from quakedesign.sos.solve.moment import Shape

Row = tuple[Fraction, ...]
_SIMPLE = 20_000  # a fraction counts as simple if its numerator or denominator is smaller


@dataclass(frozen=True, kw_only=True)
class Block:
    """One Gram matrix of the search: product of inequalities and basis."""

    product: tuple[int, ...]  # Indices of the multiplied inequalities
    weight: Polynomial  # Their product
    monomials: tuple[Exponents, ...]  # Vector m (length n)
    face: tuple[Row, ...] | None = None  # r × n; the basis b is face·m, or m if None

    @property
    def basis(self) -> tuple[Element, ...]:
        """Entries of the basis b."""
        if self.face is None:
            return self.monomials
        return tuple(as_element(dict(zip(self.monomials, row, strict=True))) for row in self.face)

    def shape(self) -> Shape:
        """Block in floating point."""
        face = None if self.face is None else [[float(v) for v in row] for row in self.face]
        weight = {e: float(c) for e, c in self.weight.items()}
        return Shape(weight=weight, basis=self.monomials, face=face)

    def restricted(self, kernel: Sequence[Row]) -> "Block | None":
        """Block whose Gram matrix has given vectors, in the present basis, in its kernel; None if no basis remains."""
        if not kernel:
            return self
        reduced, rank = fmpq_mat([[fmpq(v.numerator, v.denominator) for v in row] for row in kernel]).rref()
        rows = [[fraction_of(v) for v in row] for row in reduced.tolist()[:rank]]
        pivots = [next(i for i, v in enumerate(row) if v) for row in rows]
        size = len(self.monomials) if self.face is None else len(self.face)
        complement = []
        for free in (i for i in range(size) if i not in pivots):
            new = [Fraction(0)] * size
            new[free] = Fraction(1)
            for pivot, row in zip(pivots, rows, strict=True):
                new[pivot] = -row[free]
            complement.append(tuple(new))
        return self._with(complement) if complement else None

    def _with(self, rows: list[Row]) -> "Block":
        if self.face is not None:
            columns = list(zip(*self.face, strict=True))
            rows = [
                tuple(sum((a * b for a, b in zip(row, c, strict=True)), start=Fraction(0)) for c in columns)
                for row in rows
            ]
        if all(sum(map(bool, row)) == 1 for row in rows):
            return replace(
                self, monomials=tuple(self.monomials[next(i for i, v in enumerate(r) if v)] for r in rows), face=None
            )
        used = [i for i in range(len(self.monomials)) if any(row[i] for row in rows)]
        return replace(
            self,
            monomials=tuple(self.monomials[i] for i in used),
            face=tuple(tuple(row[i] for i in used) for row in rows),
        )

    def at(self, point: Sequence[Fraction]) -> Row:
        """Values of the basis at a point."""
        values = [monomial(point, e) for e in self.monomials]
        if self.face is None:
            return tuple(values)
        return tuple(sum((a * v for a, v in zip(row, values, strict=True)), start=Fraction(0)) for row in self.face)


def at_zeros(blocks: Sequence[Block], zeros: Sequence[Sequence[Fraction]]) -> list[Block]:
    """Blocks whose squares vanish at the given zeros of the target."""
    reduced = []
    for block in blocks:
        live = [z for z in zeros if evaluate(block.weight, z) > 0]
        smaller = block.restricted([block.at(z) for z in live])
        if smaller is not None:
            reduced.append(smaller)
    return reduced


def at_real_zeros(blocks: Sequence[Block], zeros: Sequence[Sequence[float]], scale: Sequence[Fraction]) -> list[Block]:
    """Blocks whose squares vanish at real zeros where the basis is proportional to a rational vector.

    The zero itself may be irrational, such as (√2, 1): within a parity class its square roots cancel.
    """
    reduced = []
    for block in blocks:
        rows = [_proportional(block, z, scale) for z in zeros if _float_value(block.weight, z) > 1e-7]
        smaller = block.restricted([row for row in rows if row is not None])
        if smaller is not None:
            reduced.append(smaller)
    return reduced


def _proportional(block: Block, zero: Sequence[float], scale: Sequence[Fraction]) -> Row | None:
    """Simple rational vector proportional to the basis at a zero; None if there is none."""
    values = [math.prod(v**x for v, x in zip(zero, e, strict=True)) for e in block.monomials]
    if block.face is not None:
        values = [sum(float(a) * v for a, v in zip(row, values, strict=True)) for row in block.face]
    lead = max(range(len(values)), key=lambda i: abs(values[i]))
    if abs(values[lead]) < 1e-6:
        return None
    units = _units(block, scale)
    row = [_entry(v / values[lead], units[j] / units[lead], 1e-9) for j, v in enumerate(values)]
    plain = [v * units[j] / units[lead] for j, v in enumerate(row)]
    return tuple(row) if all(min(v.denominator, abs(v.numerator)) < _SIMPLE for v in plain) else None


def _float_value(polynomial: Polynomial, point: Sequence[float]) -> float:
    return sum(float(c) * math.prod(v**x for v, x in zip(point, e, strict=True)) for e, c in polynomial.items())


def modulo(blocks: Sequence[Block], relations: Sequence[Polynomial]) -> list[Block]:
    """Blocks without the monomials that multiples of the equalities express by lower monomials."""
    return [b for b in (_modulo(block, relations) for block in blocks) if b is not None]


def _modulo(block: Block, relations: Sequence[Polynomial]) -> Block | None:
    order = sorted(block.monomials, key=lambda e: (sum(e), e), reverse=True)
    index = {e: i for i, e in enumerate(order)}
    inside = [r for r in relations if all(e in index for e in r)]
    if not inside:
        return block
    rows = [[fmpq(0)] * len(order) for _ in inside]
    for row, r in zip(rows, inside, strict=True):
        for e, c in r.items():
            row[index[e]] = fmpq(c.numerator, c.denominator)
    reduced, rank = fmpq_mat(rows).rref()
    led = {order[next(i for i, v in enumerate(row) if v != 0)] for row in reduced.tolist()[:rank]}
    remaining = tuple(e for e in block.monomials if e not in led)
    return replace(block, monomials=remaining) if remaining else None


def at_kernels(
    blocks: Sequence[Block], grams: Sequence[np.ndarray], threshold: float, tolerance: float, scale: Sequence[Fraction]
) -> list[Block] | None:
    """Blocks without the rounded numerical kernels of their Gram matrices; None if there is no kernel.

    Parameters
    ----------
    threshold : float
        Eigenvalues below it count as zero.
    tolerance : float
        Relative tolerance of the fractions of the kernel.
    scale : sequence of Fraction
        Unit of every variable in which the fractions are simple, see `decimal_units`.
    """
    reduced, smaller_face = [], False
    for block, gram in zip(blocks, grams, strict=True):
        kernel = _kernel(block, gram, threshold, tolerance, scale)
        smaller_face = smaller_face or bool(kernel)
        smaller = block.restricted(kernel)
        if smaller is not None:
            reduced.append(smaller)
    return reduced if smaller_face else None


def _kernel(block: Block, gram: np.ndarray, threshold: float, tolerance: float, scale: Sequence[Fraction]) -> list[Row]:
    """Rational basis of the eigenspace of small eigenvalues, in simplest fractions in the units `scale`."""
    values, vectors = np.linalg.eigh(gram)
    space = vectors[:, values < threshold].T
    if not len(space):
        return []
    _, _, order = qr(space, pivoting=True)
    pivots = order[: len(space)]
    echelon = np.linalg.solve(space[:, pivots], space)
    units = _units(block, scale)
    return [
        tuple(_entry(float(v), units[j] / units[pivot], tolerance) for j, v in enumerate(row))
        for pivot, row in zip(pivots, echelon, strict=True)
    ]


def _units(block: Block, scale: Sequence[Fraction]) -> list[Fraction]:
    """Unit of every basis element in the scaled variables; on a face, the unit of its leading monomial."""
    sizes = [monomial(scale, e) for e in block.monomials]
    if block.face is None:
        return sizes
    return [sizes[next((i for i, v in enumerate(row) if v == 1), 0)] for row in block.face]


def _entry(value: float, unit: Fraction, tolerance: float) -> Fraction:
    """Simplest fraction near value·unit, divided by the unit."""
    if abs(value) < max(tolerance, 1e-7):
        return Fraction(0)
    return simplest(value * float(unit), tolerance) / unit


def simplest(value: float, tolerance: float) -> Fraction:
    """Fraction of smallest denominator within a relative tolerance of a nonzero number."""
    exact = Fraction(value)
    width = abs(exact) * Fraction(tolerance)
    low, high = exact - width, exact + width
    return -simplest_between(-high, -low) if exact < 0 else simplest_between(low, high)


def just_below(value: Fraction) -> Fraction:
    """Simplest fraction in [(1 − 1e-7)·value, value] for a positive value; the bisection on levels is coarser."""
    return simplest_between(value * (1 - Fraction(1, 10**7)), value)


def simplest_between(low: Fraction, high: Fraction) -> Fraction:
    """Fraction of smallest denominator in [low, high], 0 < low (continued fractions)."""
    whole = low.numerator // low.denominator
    if whole == low:
        return Fraction(whole)
    if whole + 1 <= high:
        return Fraction(whole + 1)
    return whole + 1 / simplest_between(1 / (high - whole), 1 / (low - whole))
