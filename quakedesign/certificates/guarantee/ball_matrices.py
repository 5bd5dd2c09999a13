"""Matrices of balls: rationals go in, upper bounds come out."""

from fractions import Fraction
from itertools import chain
from typing import Any

from flint import arb, arb_mat, fmpq

from quakedesign.rationals import end_of


def ball(value: Fraction) -> Any:
    """A rational."""
    return arb(fmpq(value.numerator, value.denominator))


def matrix(rows: tuple[tuple[Fraction, ...], ...]) -> Any:
    """A matrix of rationals."""
    return arb_mat([[ball(v) for v in row] for row in rows])


def column(values: tuple[Fraction, ...]) -> Any:
    """One column of rationals."""
    return arb_mat([[ball(v)] for v in values])


def identity(size: int) -> Any:
    """The unit matrix."""
    return arb_mat(size, size, [int(i == j) for i in range(size) for j in range(size)])


def beside(parts: list[Any]) -> Any:
    """Matrices side by side."""
    return arb_mat([list(chain(*rows)) for rows in zip(*(part.tolist() for part in parts), strict=True)])


def majorant(flow: Any) -> Any:
    """M with |e^{Aδ}| ≤ e^{Mh} for 0 ≤ δ ≤ h: |A| off the diagonal, max(A, 0) on it."""
    table = [[v.abs_upper() for v in row] for row in flow.tolist()]
    for i in range(len(table)):
        table[i][i] = arb(0).max(flow[i, i]).abs_upper()
    return arb_mat(table)


def absolute(matrix: Any) -> Any:
    """Upper bounds of the absolute values, exact numbers."""
    return arb_mat([[v.abs_upper() for v in row] for row in matrix.tolist()])


def upper(value: Any) -> Fraction:
    """A rational that is not below a ball."""
    return end_of(value.upper())
