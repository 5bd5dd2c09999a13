"""Derivations that are the same for every fault, kept beside the code that derives them.

`derived.json` has what SymPy needs half a second for, by function and names of states; what it does not have is
derived. A test derives every entry again and compares; ``write_whole(FILE, derived_again())`` brings it up to date.
"""

import json
from collections.abc import Callable
from functools import cache, wraps
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import sympy as sp

FILE = Path(str(files(__package__))) / "derived.json"
_TEXTS: dict[str, str] = json.loads(FILE.read_text(encoding="utf-8"))
_Given = ParamSpec("_Given")
_Result = TypeVar("_Result")


def kept(derivation: Callable[_Given, _Result]) -> Callable[_Given, _Result]:
    """Read the results of a derivation where they are kept. Its one argument, if any, are names of states."""
    home = derivation.__module__.rpartition(".")[2]

    @cache
    @wraps(derivation)
    def result(*names: Any, **options: Any) -> Any:
        text = None if options else _TEXTS.get(" ".join([f"{home}.{derivation.__name__}", *sum(names, ())]))
        return derivation(*names, **options) if text is None else _read(text)

    return result  # type: ignore[return-value]


def derived_again() -> str:
    """Content of the file, derived now."""
    before, found = dict(_TEXTS), {}
    _TEXTS.clear()
    try:
        for key in before:
            name, *states = key.split()
            home, function = name.split(".")
            derivation = getattr(import_module(f"{__package__}.{home}"), function)
            derivation.cache_clear()
            found[key] = sp.srepr(derivation(*([tuple(states)] if states else [])))
    finally:
        _TEXTS.update(before)
    return json.dumps(found, indent=1) + "\n"


def _read(text: str) -> Any:
    """Expression of its ``srepr``, which leaves out that the functions of the plant are real."""
    return eval(text, vars(sp) | {"Function": lambda name: sp.Function(name, real=True)})
