"""Entries of fault files, declared once as fields of dataclasses, and the tables that contain them.

The metadata of a field are its `unit`, `symbol`, `example`, `default` and `text`; without `text`, the docstring of the
class describes the field. Reading, writing, template, JSON Schema and reference page use the same entries.
"""

import inspect
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import MISSING, dataclass, fields
from fractions import Fraction
from functools import cache
from typing import TypeVar

from quakedesign.errors import ScenarioError
from quakedesign.fault.friction.base import FrictionLaw
from quakedesign.fault.model import Problems
from quakedesign.fault.units import si_value
from quakedesign.files import Json
from quakedesign.text import nearest_name, shown

_Value = TypeVar("_Value")
Reader = Callable[[object, str, str], float | Fraction]
"""Function (value as in the file, SI unit, name of the entry for messages) that returns the value in this unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FileEntry:
    """One entry of a table.

    Attributes
    ----------
    name : str
    unit : str, optional
        SI unit of a quantity, empty for a dimensionless one; None for a text.
    required : bool
        Whether a file must contain it.
    example : str or float
        Value in the template and the JSON Schema.
    default_text : str
        Default if a file omits the entry; empty if the description states it.
    symbol : str
        Symbol (LaTeX), an alternative name of the entry in a file; empty for none.
    text : str
        Description in place of that in the docstring of `owner`.
    owner : type
        Class that declares the field.
    """

    name: str
    unit: str | None = None
    required: bool = True
    example: str | float = ""
    default_text: str = ""
    symbol: str = ""
    text: str = ""
    owner: type = object

    @property
    def description(self) -> str:
        """Description of the entry, empty for none."""
        return self.text or _descriptions(self.owner).get(self.name, "")

    @property
    def symbol_pattern(self) -> str:
        """Regular expression of the spellings of the symbol, such as ``Dc`` and ``d_c``."""
        return "^_?" + "_?".join(f"[{c}{c.upper()}]" if c.isalpha() else c for c in _letters(self.symbol)) + "_?$"


def entries_of(kind: type) -> dict[str, FileEntry]:
    """Entries of the fields of a dataclass that are quantities or texts; all fields of a friction law."""
    law = issubclass(kind, FrictionLaw)
    return {
        each.name: FileEntry(
            name=each.name,
            unit=(unit := each.metadata.get("unit")),
            required=each.default is MISSING and not each.metadata.get("default"),
            example=each.metadata.get("example", f"1 {unit}" if unit else 0.1),
            default_text=each.metadata.get("default", ""),
            symbol=each.metadata.get("symbol", "") if law else "",
            text=each.metadata.get("text", ""),
            owner=kind,
        )
        for each in fields(kind)
        if law or each.type is str or "unit" in each.metadata
    }


@cache
def _descriptions(kind: type) -> dict[str, str]:
    """Descriptions of attributes by name, from the docstrings of a class and of its base classes."""
    from docstring_parser import DocstringStyle, parse

    descriptions: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        for entry in parse(inspect.cleandoc(base.__doc__ or ""), DocstringStyle.NUMPYDOC).params:
            descriptions |= dict.fromkeys(entry.arg_name.split(", "), " ".join((entry.description or "").split()))
    return descriptions


class Table:
    """One table of a file; its errors are collected.

    Parameters
    ----------
    entries : mapping
        Values by key, as in the file.
    problems : Problems
        The collected errors.
    where : str
        Dotted name of the table; empty for the whole file, and for a missing table.
    """

    def __init__(self, entries: Json, problems: Problems, where: str = "") -> None:
        self.entries, self.problems, self.where = entries, problems, where
        self._keys: list[str] = []
        self._missing: list[str] = []

    def read(self, entries: Mapping[str, FileEntry], quantity: Reader = si_value) -> Json:
        """Texts, and quantities in SI units, by name; None for an invalid entry or a missing required one.

        An optional entry that the file omits is not in the result.
        """
        values: Json = {}
        for entry in entries.values():
            key = self._key(entry)
            if self._given(key, not entry.required):
                values[entry.name] = None
                with self.problems.collected():
                    value, unit, name = self.entries[key], entry.unit, self._name(key)
                    values[entry.name] = (
                        _typed(str, value, name, "a string") if unit is None else quantity(value, unit, name)
                    )
            elif entry.required:
                values[entry.name] = None
        return values

    def table(self, key: str, *, optional: bool = False) -> "Table":
        """Table inside this one; if invalid or missing, an empty one whose own errors are discarded."""
        if self._given(key, optional):
            with self.problems.collected():
                name = self._name(key)
                return Table(_typed(dict, self.entries[key], name, "a table"), self.problems, name)
        return Table({}, Problems())

    def name_or_table(self, key: str, default: str) -> "str | Table | None":
        """Text or table of an entry, the default if it is omitted; None if it is invalid."""
        value = self.entries.get(key, default)
        if isinstance(value, dict):
            return self.table(key, optional=True)
        self._keys.append(key)
        with self.problems.collected():
            return _typed(str, value, self._name(key), "a name or a table")
        return None

    def built(self, kind: Callable[..., _Value], values: Json) -> _Value | None:
        """Object `kind(**values)`; None if one of the values, or the object, is invalid."""
        with self.problems.collected():
            return None if None in values.values() else kind(**values)
        return None

    def close(self) -> None:
        """Report the missing entries, and the unknown ones with the nearest known name of each."""
        near = {key: nearest_name(key, self._missing or self._keys) for key in self.entries if key not in self._keys}
        meant = {key for key in self._missing if f" Did you mean {key}?" in near.values()}
        self.report_missing(meant)
        with self.problems.collected():
            if near:
                named = " ".join(f"{self._name(key)} is not a known key.{question}" for key, question in near.items())
                raise ScenarioError(f"{named} Use one of {', '.join(self._keys)}.")

    def report_missing(self, but: Collection[str] = ()) -> None:
        """Report the missing entries, except those in `but`."""
        missing = [self._name(key) for key in self._missing if key not in but]
        with self.problems.collected():
            if missing:
                raise ScenarioError(f"{', '.join(missing)} must be given. Received no value. Add each, as in a preset.")

    def _key(self, entry: FileEntry) -> str:
        """Key of an entry in the file: its name, or a spelling of its symbol, ``Dc`` or ``d_c`` for :math:`d_c`."""
        letters, others = _letters(entry.symbol), self.entries.keys() - {*self._keys} if entry.symbol else ()
        spelt = [key for key in self.entries if key == entry.name or (key in others and _letters(key) == letters)]
        with self.problems.collected():
            if len(spelt) > 1:
                raise ScenarioError(
                    f"{self._name(entry.name)} must be given once. Received {' and '.join(spelt)}. Omit one of them."
                )
        return spelt[0] if len(spelt) == 1 else entry.name

    def _given(self, key: str, optional: bool = False) -> bool:
        self._keys.append(key)
        if key not in self.entries and not optional:
            self._missing.append(key)
        return key in self.entries

    def _name(self, key: str) -> str:
        return f"{self.where}.{key}".strip(".")


def _typed(kind: type[_Value], value: object, name: str, what: str) -> _Value:
    """Return a value of the type `kind`, else raise; `name` and `what` (the type in words) are for the message."""
    if not isinstance(value, kind):
        raise ScenarioError(f"{name} must be {what}. Received {shown(value)}. Compare with a preset.")
    return value


def _letters(symbol: str) -> str:
    """Letters and digits of a symbol, in lower case."""
    return re.sub(r"[^a-z0-9]", "", symbol.lower())
