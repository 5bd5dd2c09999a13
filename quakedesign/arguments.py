"""Type checks of arguments of public functions and classes, from their annotations."""

import ast
import dataclasses
import operator
import sys
import types
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from enum import Enum
from functools import cache, partial, wraps
from importlib import import_module
from inspect import CO_VARARGS, CO_VARKEYWORDS, Parameter, Signature, getsource, isclass, isfunction, signature
from itertools import islice
from numbers import Integral, Rational, Real
from threading import Lock
from typing import TYPE_CHECKING, Any, Literal, TypeVar, Union, Unpack, get_args, get_origin, get_type_hints

import lazy_loader

from quakedesign.errors import ParameterError
from quakedesign.text import shown

__all__ = ["attach", "checked", "checked_dataclass", "matches", "parsed"]

_ABBREVIATIONS = {"sp": "sympy", "np": "numpy", "pd": "pandas", "ca": "casadi"}
_NUMBERS = {"float": Real, "int": Integral, "Fraction": Rational, "Expr": Real, "SX": Real}
"""Types of numbers accepted for each annotation; SymPy and CasADi accept Python numbers."""
_WORDS = {
    "float": "a number",
    "SX": "a CasADi expression",
    "int": "a whole number",
    "str": "a string",
    "bool": "True or False",
    "NoneType": "None",
}
_REMEDIES = {
    "Fault": "Give for example load_fault('real-fault').",
    "Controller": "Give for example design(fault, 'cta').controller or published('real-fault')['cta'].",
    "Fraction": "Give for example Fraction('0.1').",
    "float": "Give it in SI units.",
}
_Value = TypeVar("_Value")
_MOST_ENTRIES = 16  # entries of a collection that are checked, so that large ones cost little


def attach(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Load the public names of a package on first use, see `lazy_loader.attach_stub`; they then check their arguments.

    Parameters
    ----------
    package, file : str
        ``__name__`` and ``__file__`` of the package; its stub lists the names.

    Returns
    -------
    tuple
        ``__getattr__``, ``__dir__`` and ``__all__`` of the package.
    """
    load, listed, names = lazy_loader.attach_stub(package, file)

    def get(name: str) -> Any:
        vars(sys.modules[package])[name] = value = checked(load(name))
        return value

    return get, listed, names


def checked(value: _Value) -> _Value:
    """Function or class that checks its arguments; functions are also replaced in their module, so that pickling works.

    The constructor and the public methods of a class check their arguments; classes derived from SymPy are not changed.
    """
    if isfunction(value):
        replaced: Any = _checked(value)
        setattr(sys.modules[value.__module__], value.__name__, replaced)
        return replaced  # type: ignore[no-any-return]
    if isclass(value) and not issubclass(value, Enum | BaseException) and not hasattr(value, "free_symbols"):
        for base in value.__mro__:
            if base.__module__.partition(".")[0] == __name__.partition(".")[0]:
                _check_methods(base)
    return value


if TYPE_CHECKING:
    from dataclasses import dataclass as checked_dataclass
else:

    def checked_dataclass(**options: object) -> Callable[[type], type]:
        """Dataclass that checks the arguments of construction and methods, also if not imported through `attach`."""
        return lambda kind: checked(dataclasses.dataclass(**options)(kind))


def _check_methods(owner: type) -> None:
    for name, member in list(vars(owner).items()):
        function = member.__func__ if isinstance(member, classmethod | staticmethod) else member
        if (name == "__init__" or name[0] != "_") and isfunction(function) and _takes_any(function, member):
            replaced = _checked(function)
            type.__setattr__(owner, name, replaced if function is member else type(member)(replaced))


def _takes_any(function: Any, member: Any) -> bool:
    """Whether a method takes arguments besides its instance or class, and is not abstract."""
    code = getattr(function, "__wrapped__", function).__code__
    several = bool(code.co_flags & (CO_VARARGS | CO_VARKEYWORDS))
    count = code.co_argcount + code.co_kwonlyargcount + several
    return not getattr(function, "__isabstractmethod__", False) and count > (not isinstance(member, staticmethod))


def _checked(function: Callable[..., object]) -> Callable[..., object]:
    if hasattr(function, "checks_arguments"):
        return function

    @wraps(function)
    def checking(*positional: object, **named: object) -> object:
        try:
            bound = _signature(function).bind(*positional, **named)
        except TypeError as error:
            raise ParameterError(f"{_name(function)} cannot be called like this: {error}.") from None
        for name, value in bound.arguments.items():
            bound.arguments[name] = _accept(function, name)(value)
        return function(*bound.args, **bound.kwargs)

    checking.checks_arguments = True  # type: ignore[attr-defined]
    return checking


@cache
def _signature(function: Callable[..., object]) -> Signature:
    return signature(function)


@cache
def _accept(function: Callable[..., object], name: str) -> Callable[[Any], Any]:
    """Function that returns a valid argument with NumPy numbers converted, and raises for an invalid argument."""
    parameter, hint = _signature(function).parameters[name], _hint(function, name)
    if parameter.kind is Parameter.VAR_POSITIONAL:
        return lambda values: tuple(_accepted(function, name, hint, value) for value in values)
    if parameter.kind is not Parameter.VAR_KEYWORD:
        default = parameter.default
        return lambda value: value if value is default else _accepted(function, name, hint, value)
    if get_origin(hint) is not Unpack:
        return lambda values: {key: _accepted(function, name, hint, value) for key, value in values.items()}
    hints = get_type_hints(get_args(hint)[0])

    def entries(values: Mapping[str, Any]) -> Mapping[str, Any]:
        for key in [key for key in values if key not in hints][:1]:
            raise ParameterError(f"{_name(function)} cannot be called like this: there is no argument {key!r}.")
        return {key: _accepted(function, key, hints[key], value) for key, value in values.items()}

    return entries


def _accepted(function: Callable[..., object], name: str, hint: Any, value: Any) -> Any:
    if not matches(value, hint):
        remedies = (_REMEDIES[part] for part in _parts(hint) if part in _REMEDIES)
        raise ParameterError(
            f"{name} of {_name(function)} must be {_type_text(hint)}. Received {shown(value)}. {next(remedies, '')}"
        )
    if type(value) in _PLAIN:
        return value
    return float(value) if isinstance(value, Real) and _is_float_alone(hint) else _native(value)


_PARSING = Lock()  # CPython counts the recursion of all threads together and raises SystemError if two build a tree


def parsed(text: str, mode: str = "exec") -> Any:
    """Syntax tree of a text, as from `ast.parse`, built by one thread at a time."""
    with _PARSING:
        return ast.parse(text, mode=mode)


class _Late(dict[str, Any]):
    """Names that a module imports only for type checkers, and usual abbreviations of libraries, imported on demand."""

    def __init__(self, module: str) -> None:
        tree = parsed(getsource(sys.modules[module]))
        blocks = (node for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")
        imports = (node for block in blocks for node in block.body if isinstance(node, ast.ImportFrom))
        self._homes = {alias.name: str(node.module) for node in imports for alias in node.names}

    def __missing__(self, name: str) -> Any:
        home = self._homes.get(name)
        return getattr(import_module(home), name) if home else import_module(_ABBREVIATIONS[name])


_late = cache(_Late)


@cache
def _hint(function: Callable[..., object], name: str) -> Any:
    """Type of a parameter; `Any` if only a type checker can resolve it."""
    hint = _signature(function).parameters[name].annotation
    if not isinstance(hint, str):
        return Any if hint is Parameter.empty else hint
    home = function.__module__  # the `__init__` of a dataclass has further names
    names = getattr(function, "__globals__", {}) | vars(sys.modules[home])
    for late in (dict, partial(_late, home)):
        with suppress(NameError, TypeError, OSError):
            return eval(hint, names, late())
    return Any


def matches(value: object, hint: Any) -> bool:
    """Whether a value is of a type; of a collection, the first 16 entries must have their declared type."""
    return _test(hint)(value)


@cache
def _test(hint: Any) -> Callable[[object], bool]:
    """Function that tests whether a value is of a type; the type is analysed once, here."""
    origin, inner = get_origin(hint), get_args(hint)
    if hint in (Any, Parameter.empty):
        return lambda _: True
    if origin in (Union, types.UnionType):
        tests = [_test(part) for part in inner]
        plain = {p for p in inner if isinstance(p, type) and get_origin(p) is None and p.__name__ != "ndarray"}
        return lambda value: type(value) in plain or any(test(value) for test in tests)
    if origin is Literal:
        return lambda value: value in inner
    if origin is type:
        return lambda value: isclass(value) and all(not isclass(part) or issubclass(value, part) for part in inner)
    if isinstance(origin, type):
        return callable if issubclass(origin, Callable) else _test_of_collection(origin, inner)  # type: ignore[arg-type]
    if hint is None or hint is type(None):
        return lambda value: value is None
    return _test_of_class(hint) if isinstance(hint, type) else lambda _: True


def _test_of_class(hint: type) -> Callable[[object], bool]:
    numbers = _NUMBERS.get(hint.__name__)
    if hint.__name__ == "SX":  # also all other CasADi expressions and matrices
        hint = next(base for base in hint.__mro__ if base.__name__ == "GenericExpressionCommon")

    def test(value: object) -> bool:
        if hint.__name__ == "ndarray":  # masked arrays are instances as well
            return isinstance(value, hint) and not _lacks_entries(value)
        if type(value) is hint:
            return True
        if numbers is not None and isinstance(value, numbers):
            return not isinstance(value, bool) and (hint is not float or _fits_float(value))
        return isinstance(value, hint) or (hint is bool and type(value).__name__ == "bool")

    return test


_PLAIN = (float, int, str, bool, type(None))


@cache
def _is_float_alone(hint: Any) -> bool:
    return {part for part in _parts(hint) if part in _NUMBERS} == {"float"}


def _native(value: Any) -> Any:
    """Value with NumPy numbers as Python numbers, also in tuples, lists, dictionaries; longdouble arrays as float64."""
    if hasattr(value, "dtype") and hasattr(value, "item"):
        if getattr(value, "ndim", 0):
            return value if value.dtype.kind != "f" or value.dtype.itemsize <= 8 else value.astype(float)
        kind = {"f": float, "i": int, "u": int, "b": bool}.get(value.dtype.kind)
        return value if kind is None or isinstance(value, kind) else kind(value)
    if type(value) in (tuple, list):
        native = [_native(entry) for entry in value]
        return value if all(map(operator.is_, native, value)) else type(value)(native)
    if type(value) is dict:
        native = [_native(entry) for entry in value.values()]
        return value if all(map(operator.is_, native, value.values())) else dict(zip(value, native, strict=True))
    return value


def _fits_float(value: Any) -> bool:
    try:
        float(value)
    except OverflowError:
        return False
    return True


def _test_of_collection(origin: type, inner: tuple[Any, ...]) -> Callable[[object], bool]:
    tests = [_test(part) for part in inner if part is not Ellipsis]
    fixed = origin is tuple and len(tests) == len(inner) > 0

    def test(value: object) -> bool:
        if isinstance(value, str | bytes) or not _is_one(value, origin):
            return False
        if not isinstance(value, Collection) or not tests:
            return True
        if isinstance(value, Mapping) and len(tests) == 2:
            return all(tests[0](key) and tests[1](entry) for key, entry in islice(value.items(), _MOST_ENTRIES))
        if fixed:
            return len(value) == len(tests) and all(each(entry) for each, entry in zip(tests, value, strict=True))
        return all(map(tests[0], islice(value, _MOST_ENTRIES)))

    return test


def _is_one(value: object, origin: type) -> bool:
    """Whether a collection is of a kind; lists and arrays count as tuples and sequences, mappings as dictionaries."""
    if type(value) is origin:
        return True
    if issubclass(origin, Mapping):
        return isinstance(value, Mapping)
    if _lacks_entries(value):
        return False
    listed = hasattr(value, "__len__") and hasattr(value, "__getitem__") and not isinstance(value, Mapping)
    return isinstance(value, origin) or (issubclass(origin, Sequence) and listed)


def _lacks_entries(value: object) -> bool:
    """Whether a NumPy array has no dimension, or masked entries."""
    mask = getattr(value, "mask", None)
    return getattr(value, "ndim", 1) == 0 or (mask is not None and hasattr(mask, "any") and bool(mask.any()))


def _parts(hint: Any) -> list[str]:
    """Names of the component types of a type."""
    if not isinstance(hint, type) or get_origin(hint):
        return [part for inner in get_args(hint) for part in _parts(inner)]
    return [hint.__name__]


def _type_text(hint: Any) -> str:
    """A type in words."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return " or ".join(_type_text(part) for part in inner)
    if origin is Literal:
        return " or ".join(map(repr, inner))
    if hint is None:
        return "None"
    name = getattr(origin or hint, "__name__", str(hint))
    if origin and inner and name not in ("Callable", "type"):
        return f"a {name.lower()} of {', '.join(_type_text(part) for part in inner if part is not Ellipsis)}"
    if name == "type":
        return f"a class derived from {', '.join(_type_text(part) for part in inner)}"
    return _WORDS.get(name, f"{'an' if name[0] in 'AEIOU' else 'a'} {name}")


def _name(function: Callable[..., object]) -> str:
    return function.__qualname__.removesuffix(".__init__")
