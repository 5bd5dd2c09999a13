"""Design controllers that let a fault slip slowly instead of in an earthquake, and prove that they do.

The public names are those of ``__init__.pyi``. They and the stub itself load on first use, so that
``import quakedesign`` takes almost no time.
"""

from importlib import import_module as _import_module

from lazy_loader import attach_stub as _attach_stub


def __getattr__(name: str) -> object:
    if name == "__version__":
        return _import_module("importlib.metadata").version("quakedesign")
    load, _, names = _attach_stub(__name__, __file__)
    globals()["__all__"] = names
    return names if name == "__all__" else load(name)


def __dir__() -> list[str]:
    return [*__getattr__("__all__"), "__version__"]
