"""Design controllers that let a fault slip slowly instead of in an earthquake, and prove that they do.

The public names load on first use, so that ``import quakedesign`` costs nothing.
"""

from importlib import import_module
from importlib.metadata import version as _version

_HOME = {
    "Fault": "fault",
    "load_fault": "fault",
    "derive": "symbolic",
    "Certificate": "certificates",
    "Verdict": "certificates",
    "load_certificate": "certificates",
    "published": "controllers",
    "simulate": "simulation",
    "Trajectory": "simulation",
    "to_casadi": "simulation",
    "to_iosystem": "simulation",
    "design": "synthesis",
    "certify": "synthesis",
    "Design": "synthesis",
    "limits": "studies",
    "compare": "report",
}

__all__ = list(_HOME)


def __getattr__(name: str):
    if name == "__version__":
        return _version("quakedesign")
    if name not in _HOME:
        raise AttributeError(f"module 'quakedesign' has no attribute {name!r}")
    return getattr(import_module(f"quakedesign.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOME])
