"""Budget of work for a check, counted in arithmetic operations before they are done (proofs/FORMAT.md).

Work is counted only within a `limited` block, so that searches are not limited.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from fractions import Fraction
from math import lcm

from quakedesign.errors import WorkError

STEPS = 3 * 10**7
"""Largest number of steps of one check; a step is an operation on two numbers of up to about a thousand bits."""
TERMS = 20_000
"""Largest number of terms of a polynomial, as read and after expansion."""

_left: ContextVar[int | None] = ContextVar("steps left", default=None)


@contextmanager
def limited(steps: int | None = None) -> Iterator[None]:
    """Count the work within a block and limit it to a number of steps, `STEPS` by default."""
    before = _left.set(STEPS if steps is None else steps)
    try:
        yield
    finally:
        _left.reset(before)


def spend(steps: int, bits: int = 0) -> None:
    """Count steps on integers of a bit length; a step costs 1 + bits²/2²⁰ units, as division is quadratic.

    Raises
    ------
    WorkError
        When the budget is exceeded.
    """
    left = _left.get()
    if left is None:
        return
    left -= steps * (1 + (bits * bits >> 20))
    _left.set(left)
    if left < 0:
        raise WorkError("the check exceeds its budget of exact arithmetic. Shorten terms or digits.")


def counted() -> bool:
    """Whether a `limited` block is active."""
    return _left.get() is not None


def length(number: Fraction) -> int:
    """Bit length of the longer of numerator and denominator."""
    return max(number.numerator.bit_length(), number.denominator.bit_length())


def longest(numbers: Iterable[Fraction]) -> int:
    """Bound on the bit length of numbers over their common denominator; counts its own work; 0 outside `limited`."""
    if not counted():
        return 0
    top, common = 0, 1
    for number in numbers:
        spend(1, common.bit_length() + number.denominator.bit_length())
        common = lcm(common, number.denominator)
        top = max(top, number.numerator.bit_length())
    return top + common.bit_length()


def expanded(terms: int) -> None:
    """Raise WorkError for a polynomial with more than `TERMS` terms."""
    if counted() and terms > TERMS:
        raise WorkError(f"an expanded polynomial has more than {TERMS} terms. Split it.")
