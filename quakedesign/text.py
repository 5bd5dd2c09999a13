"""Text for terminals: control characters written out, long text shortened, quantities with prefixes, progress."""

import re
from bisect import bisect
from collections.abc import Callable, Iterable
from difflib import SequenceMatcher, get_close_matches
from itertools import takewhile
from math import floor, log10
from unicodedata import category

# controls, formats, surrogates, private and unassigned characters, separators of lines and paragraphs
_CONTROL_CATEGORIES = {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"}
_LONG = 8  # least length of a name that may be the beginning of a longer one
_LONGEST_WORD = 200
_LONGEST_MESSAGE = 2000
_LONGEST_LINE = 200
_STRENGTH = ",:;."  # punctuation marks, in increasing strength
_TIMES = (31_557_600.0, "years"), (86_400.0, "days"), (3600.0, "hours")
_MARKS = re.compile(r"[(\[)\]]|[,:;.] ")


Progress = Callable[[str, float], None]
"""Report of progress: called with the current activity and the completed fraction [-]."""


def silent(_what: str, _done: float) -> None:
    """Report no progress."""


def visible(text: str) -> str:
    r"""Text with every control character, direction mark and line break as an escape such as ``\x1b`` or ``\n``."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(c.encode("unicode_escape").decode() if category(c) in _CONTROL_CATEGORIES else c for c in text)


def one_line(message: str) -> str:
    """Message as one line of visible characters; the middle of long words (such as paths) and messages is cut out."""
    short = re.sub(rf"\S{{{_LONGEST_WORD + 1},}}", lambda word: _shortened(word[0], _LONGEST_WORD), message)
    return _shortened(visible(" ".join(short.split())), _LONGEST_MESSAGE)


def in_lines(text: str) -> list[str]:
    """Text in lines of at most 200 characters, each broken after the strongest mark in its last two thirds.

    Marks are a full stop, semicolon, colon or comma outside brackets. No text is cut: without a mark a line is longer.
    """
    lines, begin = [], 0
    ends = _divisions(text) if len(text) > _LONGEST_LINE else []
    while len(text) - begin > _LONGEST_LINE:
        first, last = (bisect(ends, begin + length, key=_place) for length in (_LONGEST_LINE // 3, _LONGEST_LINE))
        if last == len(ends) == first:
            break
        place, _ = max(ends[first:last], key=lambda end: (end[1], end[0]), default=ends[min(last, len(ends) - 1)])
        lines.append(text[begin:place])
        begin = place + 1
    return [*lines, text[begin:]]


def _divisions(text: str) -> list[tuple[int, int]]:
    """Positions after the punctuation marks of a text outside brackets, and the strength of each mark."""
    divisions, depth = [], 0
    for mark in _MARKS.finditer(text):
        depth += (mark[0] in "([") - (mark[0] in ")]")
        if depth <= 0 and mark[0].endswith(" "):
            divisions.append((mark.start() + 1, _STRENGTH.index(mark[0][0])))
    return divisions


def _place(division: tuple[int, int]) -> int:
    return division[0]


def nearest_name(name: str, known: Iterable[str]) -> str:
    """Suggestion " Did you mean NAME?" of the nearest known name, for the end of a message; empty if none is near.

    Case is ignored. Of equally near names the one with the longest common beginning is chosen; for a long name that is
    the beginning of others, the first of these in alphabetical order.
    """
    written = name[:_LONGEST_WORD].lower()
    spelt = {each.lower(): each for each in known}

    def likeness(each: str) -> tuple[float, int]:
        alike = takewhile(lambda pair: pair[0] == pair[1], zip(each, written, strict=False))
        return SequenceMatcher(None, each, written).ratio(), len(list(alike))

    longer = sorted(each for each in spelt if len(written) >= _LONG and each.startswith(written))
    close = longer[:1] or get_close_matches(written, spelt, n=5)
    return f" Did you mean {spelt[max(close, key=likeness)]}?" if close else ""


def shown(value: object) -> str:
    """Short `repr` of a received value, even if its `repr` fails or has too many digits."""
    try:
        return _shortened(repr(value), _LONGEST_WORD)
    except Exception:
        return f"one of type {type(value).__name__}"


def _shortened(text: str, length: int) -> str:
    """Beginning and end of a long text, with its length."""
    half = length // 2 - 12
    return text if len(text) <= length else f"{text[:half]}…({len(text)} characters)…{text[-half:]}"


def lasting(seconds: float, digits: int = 4) -> str:
    """A time in seconds; from two hours on also in years, days or hours (largest unit with a value of at least 2)."""
    short = duration(seconds)
    return f"{seconds:.{digits}g} s" + ("" if short.endswith(" s") else f" ({short})")


def duration(seconds: float) -> str:
    """A time in years, days or hours, the largest of these with a value of 2 or more; else in seconds."""
    size, name = next(((size, name) for size, name in _TIMES if seconds >= 2 * size), (1.0, "s"))
    return f"{plain(seconds / size)} {name}"


# ----------------------------------------------------------------------
# Measured numbers as text; `quakedesign.exact.Bound` rounds bounds outward.

PREFIXES = {3 * i - 18: prefix for i, prefix in enumerate("a f p n µ m  k M G T P E".split(" "))}


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """A measured number with a unit and its engineering prefix, such as ``74.5 mm/s``."""
    power = power_of(float(f"{value:.{digits}g}"))
    return f"{plain(value / 10.0**power, digits)} {PREFIXES[power]}{unit}"


def power_of(value: float) -> int:
    """Power of ten of the engineering prefix of a number."""
    if not value:
        return 0
    return min(max(3 * floor(log10(abs(value)) / 3 + 1e-12), min(PREFIXES)), max(PREFIXES))


def plain(value: float, digits: int = 3) -> str:
    """Number with `digits` significant digits, without a power of ten from 1e-4 to 1e15."""
    return f"{float(f'{value + 0.0:.{digits}g}'):.15g}"


def counted(number: int, thing: str) -> str:
    """A number of things, such as ``1 well`` or ``2 wells``."""
    return f"{number} {thing}{'s' * (number != 1)}"
