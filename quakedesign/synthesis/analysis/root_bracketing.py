"""The last number for which a search succeeds, from margins and their slopes, in as few solves as possible."""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from quakedesign.synthesis.analysis.parametric_program import SURE, Screened

TOLERANCE = Fraction(1, 10_000)
"""Relative width of a bracket: the search succeeds at x and not at x(1 + TOLERANCE)."""
_BELOW, _ABOVE = TOLERANCE / 2, TOLERANCE / 5  # where the ends of the bracket are wanted
_MOST = 40
_STRIDE = 8
_BELIEVED = 6  # questions; after them tangents are no longer believed alone
_NEAR = 3 * TOLERANCE


@dataclass(frozen=True, slots=True, kw_only=True)
class Bracket:
    """Where the search succeeds, and where it does not.

    Attributes
    ----------
    low : Fraction or None
        Largest number at which it succeeded.
    high : Fraction or None
        Smallest number at which it did not; None where none was tried, as a limit makes it needless.
    best : Screened or None
        Answer at `low`.
    asked : int
        How often it was told something.
    """

    low: Fraction | None = None
    high: Fraction | None = None
    best: Screened | None = None
    asked: int = 0

    def closed(self, limit: Fraction | None) -> bool:
        """Whether `low` is within the tolerance of `high` or of a limit."""
        ends = [end for end in (self.high, limit) if end is not None]
        return self.low is not None and any(end <= self.low * (1 + TOLERANCE) for end in ends)

    def told(self, x: Fraction, answer: Screened | None) -> "Bracket":
        """The bracket after one more answer."""
        if answer is not None and answer.found:
            return Bracket(low=x, high=self.high, best=answer, asked=self.asked + 1)
        return Bracket(low=self.low, high=x, best=self.best, asked=self.asked + 1)


def last_success(
    ask: Callable[[Fraction], tuple[Screened | None, float]],
    first: Fraction,
    *,
    floor: Fraction = Fraction(0),
    limit: Fraction | None = None,
    most: Fraction | None = None,
    only_above: bool = False,
) -> Bracket:
    """Bracket around the last number at which a search succeeds, by Newton's rule kept inside what is known.

    Parameters
    ----------
    ask : callable
        Answer at a number, and the slope of its margin there.
    first : Fraction
        Where to begin; the floor is a good place where nothing is known.
    floor : Fraction
        Smallest number that makes sense.
    limit : Fraction, optional
        No search can succeed there or beyond, so none is made.
    most : Fraction, optional
        Success there is enough.
    only_above : bool
        Stop where the search does not succeed at `first`.

    Returns
    -------
    Bracket
        Without `low` when the search does not even succeed at the floor.
    """
    bracket, x = Bracket(), first
    for _ in range(_MOST):
        answer, slope = ask(x)
        bracket = bracket.told(x, answer)
        enough = most is not None and bracket.low is not None and bracket.low >= most
        if bracket.closed(limit) or enough or bracket.high == floor or (only_above and bracket.low is None):
            break
        x = max(floor, _short(_next(bracket, x, _root(x, answer, slope), floor, limit)))
    return bracket


def _root(x: Fraction, answer: Screened | None, slope: float) -> Fraction | None:
    """Where the tangent says that the search just succeeds; None where there is none."""
    if answer is None or not slope < 0:
        return None
    return Fraction(float(x) - (answer.margin - SURE) / slope)


def _next(bracket: Bracket, x: Fraction, root: Fraction | None, floor: Fraction, limit: Fraction | None) -> Fraction:
    """Number to ask about: near the tangent's root, on the side that is still open; else halfway."""
    low, high = bracket.low, bracket.high
    astray = root is None or root <= floor or bracket.asked > _BELIEVED
    if low is None and bracket.asked > 1 and astray:
        return floor
    ceiling = None if limit is None else first_below(limit)
    middle = _middle(x, low, high, floor, ceiling)
    if root is None or (bracket.asked > _BELIEVED and bracket.asked % 3 == 0):
        return middle
    near = abs(root - x) < _NEAR * x
    guess = root * (1 - _BELOW) if not near or x == high else root * (1 + _ABOVE)
    if x > floor:
        guess = min(guess, floor + (x - floor) * _STRIDE)
    if ceiling is not None:
        guess = min(guess, ceiling)
    bottom = low if low is not None else (floor + x) / 2
    return guess if bottom < guess and (high is None or guess < high) else middle


def _middle(
    x: Fraction, low: Fraction | None, high: Fraction | None, floor: Fraction, ceiling: Fraction | None
) -> Fraction:
    if high is None:
        doubled = 2 * x - floor if x > floor else x + 1
        return doubled if ceiling is None else min(doubled, ceiling)
    return ((floor if low is None else low) + high) / 2


def first_below(limit: Fraction) -> Fraction:
    """Number so near to a limit that the search need not go on if it succeeds there."""
    return limit * (1 - _BELOW - _ABOVE)


def _short(x: Fraction) -> Fraction:
    """Nearest decimal of eight digits."""
    return Fraction(f"{float(x):.7e}")
