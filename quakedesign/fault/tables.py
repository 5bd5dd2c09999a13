"""Tables of a file with quantities, read entry by entry; whatever is wrong with them is collected."""

import re
from collections.abc import Callable, Collection, Mapping
from typing import Any

from quakedesign.errors import ScenarioError
from quakedesign.fault.checks import Problems
from quakedesign.fault.units import si_value
from quakedesign.text import nearest_name, shown

Reader = Callable[[Any, str, str], float]
"""Value in an SI unit of an entry, with the entry's name for messages."""


class Table:
    """One table of a file.

    Parameters
    ----------
    entries : mapping
        As the file has them.
    problems : Problems
        That collect what is wrong.
    where : str
        Dotted name of the table, empty for the whole file.
    """

    def __init__(self, entries: Mapping[str, Any], problems: Problems, where: str = "") -> None:
        self.entries, self.problems, self.where = entries, problems, where
        self._known: list[str] = []
        self._missing: list[str] = []

    def quantities(
        self, units: Mapping[str, str], *, optional: bool = False, read: Reader = si_value
    ) -> dict[str, float | None]:
        """Values in SI units by name; None for one that is wrong, nothing for an optional one that is not given."""
        quantities: dict[str, float | None] = {}
        for key, unit in units.items():
            if self._given(key, optional):
                quantities[key] = None
                with self.problems.collected():
                    quantities[key] = read(self.entries[key], unit, self._name(key))
            elif not optional:
                quantities[key] = None
        return quantities

    def spelling(self, name: str, symbol: str) -> str:
        """How the file spells an entry: by its name, or by its symbol, as ``Dc`` or ``d_c`` for :math:`d_c`."""
        spelt = [
            key for key in self.entries if key == name or (key not in self._known and _letters(key) == _letters(symbol))
        ]
        with self.problems.collected():
            if len(spelt) > 1:
                raise ScenarioError(
                    f"{self._name(name)} must be given once. Received {' and '.join(spelt)}. Leave one out."
                )
        return spelt[0] if len(spelt) == 1 else name

    def text(self, key: str) -> str | None:
        """Text of an entry; None for one that is wrong or not given."""
        return self._of_type(key, str, "a text") if self._given(key) else None

    def table(self, key: str, *, optional: bool = False) -> "Table | None":
        """Table inside this one; None for one that is wrong or not given."""
        entries = self._of_type(key, dict, "a table") if self._given(key, optional) else None
        return None if entries is None else Table(entries, self.problems, self._name(key))

    def name_or_table(self, key: str, default: str) -> "str | Table | None":
        """Text or table of an entry, the default where it is not given; None for a wrong one."""
        value = self._of_type(key, (str, dict), "a name or a table") if self._given(key, True) else default
        return Table(value, self.problems, self._name(key)) if isinstance(value, dict) else value

    def close(self) -> None:
        """Say at once which entries are missing, and which are not known and what they are near to."""
        near = {key: nearest_name(key, self._missing or self._known) for key in self._others()}
        meant = {key for key in self._missing if f" Did you mean {key}?" in near.values()}
        self.say_missing(meant)
        with self.problems.collected():
            if near:
                named = " ".join(f"{self._name(key)} is not a known key.{question}" for key, question in near.items())
                raise ScenarioError(f"{named} Known here are {', '.join(self._known)}.")

    def say_missing(self, but: Collection[str] = ()) -> None:
        """Say which entries are missing."""
        missing = [self._name(key) for key in self._missing if key not in but]
        with self.problems.collected():
            if missing:
                raise ScenarioError(f"{', '.join(missing)} must be given. Received nothing. Compare with a preset.")

    def _others(self) -> list[str]:
        return [key for key in self.entries if key not in self._known]

    def _given(self, key: str, optional: bool = False) -> bool:
        self._known.append(key)
        if key not in self.entries and not optional:
            self._missing.append(key)
        return key in self.entries

    def _of_type(self, key: str, kind: type | tuple[type, ...], what: str) -> Any:
        value = self.entries[key]
        with self.problems.collected():
            if not isinstance(value, kind):
                raise ScenarioError(
                    f"{self._name(key)} must be {what}. Received {shown(value)}. Compare with a preset."
                )
            return value
        return None

    def _name(self, key: str) -> str:
        return f"{self.where}.{key}".strip(".")


def _letters(symbol: str) -> str:
    """Letters and digits of a symbol, in small letters."""
    return re.sub(r"[^a-z0-9]", "", symbol.lower())
