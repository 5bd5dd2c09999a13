"""Text of users as it may be shown: what a terminal would obey is written out, what is too long is shortened."""

import re
from unicodedata import category

_OBEYED = {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"}  # controls, invisible formats, half characters, line separators
_LONGEST_WORD = 200
_LONGEST_MESSAGE = 2000


def visible(text: str) -> str:
    r"""Text with every control character, direction mark and line break as an escape such as ``\x1b`` or ``\n``."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(c.encode("unicode_escape").decode() if category(c) in _OBEYED else c for c in text)


def one_line(message: str) -> str:
    """Message in one visible line; long words, such as paths, and long messages lose their middle."""
    short = re.sub(rf"\S{{{_LONGEST_WORD + 1},}}", lambda word: _shortened(word[0], _LONGEST_WORD), message)
    return _shortened(visible(" ".join(short.split())), _LONGEST_MESSAGE)


def _shortened(text: str, length: int) -> str:
    """Beginning and end of a text."""
    half = length // 2 - 12
    return text if len(text) <= length else f"{text[:half]}…({len(text)} characters)…{text[-half:]}"
